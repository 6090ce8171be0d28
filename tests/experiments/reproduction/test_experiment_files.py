"""An experiment is data: every file of conf/experiment is right at every scale, and a wrong one is told with its place."""

import re

import pyarrow.parquet as pq
import pytest
import yaml

from segar.experiments.commands.config_store import CONF, register_settings
from segar.experiments.commands.hydra_app import compose, compose_data, initialized
from segar.experiments.reproduce import SETTINGS, ReproduceConfig, build, experiment_files, help_text
from segar.experiments.reproduction.experiment_file import BASE, SCALES, TransferConfig, experiment_at, other_panel
from segar.experiments.reproduction.grid import grid_runs
from segar.experiments.reproduction.plan import make_plan
from segar.experiments.settings import ConfigError, ObservationConfig, RunConfig
from segar.support import WORKSPACE
from tests.crafted import replaced

GOOD = {
    "title": "A grid",
    "grid": {"families": ["empty"], "counts": [1, 10], "frames": 1e5},
    "transfers": [{"difficulty": "harder"}],
    "scales": {"quick": {"counts": [3]}, "paper": {}},
}


def test_a_scale_changes_what_it_names_and_nothing_else():
    quick, paper = (experiment_at("mine", GOOD, scale) for scale in ("quick", "paper"))
    assert (quick.grid.counts, quick.grid.families, quick.grid.frames) == ((3,), ("empty",), 100_000)
    assert paper.grid.counts == (1, 10)


GRID, QUICK = ["grid"], ["scales", "quick"]
HERE = "grids.mine"


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        ([*GRID, "families"], ["emtpy"], f"{HERE}.grid.families[0]: 'emtpy' is unknown. Did you mean 'empty'?"),
        (QUICK, {"difficulties": ["hardest"]}, f"{HERE}.scales.quick.difficulties[0]: 'hardest' is unknown"),
        (QUICK, None, f"{HERE}.scales.quick: None is no group of settings; where nothing differs it is {{}}"),
        (QUICK, {"options": {"seeds": 1}}, f"{HERE}.scales.quick.options: there is no 'seeds'"),
        (QUICK, {"transfers": [{"family": "empt"}]}, f"{HERE}.scales.quick.transfers[0].family: 'empt' is unknown"),
        (["transfers"], [{}], f"{HERE}.transfers[0]: {{}} is not allowed; it must be a family, difficulty, variation"),
        (["attribution"], {"where": "Position"}, f"{HERE}.attribution.where: 'Position' is not"),
        (["attribution"], {"where": []}, f"{HERE}.attribution.where: [] is not allowed; it must be a list of factors"),
        (["attribution"], {"rest": ["Size"]}, f"{HERE}.attribution.rest: 'rest' is not allowed; it must be another"),
        (["attribution"], {"a+b": ["Size"]}, f"{HERE}.attribution.a+b: 'a+b' is not allowed; it must be a name"),
        (["grid"], {}, "it must be an experiment with a grid, a study, or both"),
    ],
)
def test_what_is_wrong_is_told_with_its_place(path, value, message):
    with pytest.raises(ConfigError, match=re.escape(message)):
        experiment_at("mine", replaced(GOOD, path, value), "quick")


def test_a_study_without_a_grid_has_nothing_to_differ_in():
    data = {"title": "Study", "study": "a.b", "scales": {"quick": {"counts": [1]}}}
    with pytest.raises(ConfigError, match="the experiment has no grid, so counts cannot differ"):
        experiment_at("mine", data, "quick")


@pytest.mark.parametrize(
    ("transfer", "panel"),
    [
        (TransferConfig(difficulty="harder"), "empty-hard"),
        (TransferConfig(difficulty="easier"), "empty-easy"),
        (TransferConfig(family="tilesx1"), "tilesx1-medium"),
        (TransferConfig(variation="gravity_40"), "empty-medium"),
    ],
)
def test_transfers_are_relative_to_the_training_levels(transfer, panel):
    assert other_panel("empty", "medium", transfer) == panel
    assert other_panel("empty", "hard", TransferConfig(difficulty="harder")) is None


def test_the_command_knows_every_file():
    listed = yaml.safe_load((CONF / "reproduce.yaml").read_text())["defaults"]
    named = [value for entry in listed if isinstance(entry, dict) for key, value in entry.items() if "@grids." in key]
    assert sorted(named) == sorted(experiment_files())
    assert all(name in help_text() for name in named)


@pytest.mark.parametrize(
    "scale", ["quick", *(pytest.param(scale, marks=pytest.mark.slow) for scale in SCALES if scale != "quick")]
)
def test_all_files_are_right_at_every_scale(scale, tmp_path):
    pixels = ObservationConfig("rgb_stack2")  # as at all these scales: agents that see states fit few other levels
    config = ReproduceConfig(RunConfig(root=str(tmp_path), observation=pixels), grids=experiment_files())
    found = [experiment_at(name, config.grids[name], scale) for name in config.grids]
    plan = make_plan([one for one in found if one is not None], config.run, tmp_path)
    assert {"figure_3a", "figure_4a", "w2_study"} <= set(plan.members)
    assert len({work.run.label() for work in plan.runs}) == len(plan.runs)
    assert all(known in SCALES for one in experiment_files().values() for known in one["scales"])


@pytest.mark.parametrize("scale", ["standard", "paper"])
def test_self_supervision_is_held_against_as_many_gradient_steps(scale):
    experiment = experiment_at("figure_5a", experiment_files()["figure_5a"], scale)
    assert experiment is not None
    steps = {}
    for name in set(experiment.grid.algorithms) - {BASE}:
        config = compose([f"algorithm={name}", "observation=rgb"]).algorithm
        steps[name] = config.epochs * config.minibatches + getattr(config, "auxiliary_minibatches", 0)
    assert sum(name.endswith("_epochs") for name in steps) == 1
    assert len(steps) == 3
    assert len(set(steps.values())) == 1


@pytest.mark.slow
def test_the_guide_says_how_many_runs_each_scale_has():
    guide = (WORKSPACE / "docs" / "how-to" / "reproduce-the-paper.md").read_text()
    register_settings("reproduce", SETTINGS)
    for scale in SCALES:
        with initialized():
            config = build(compose_data([f"scale={scale}"], "reproduce"))
        grids = [one.grid for one in config.at_scale() if one.grid is not None]
        runs = {run.label() for grid in grids for run in grid_runs(grid, config.run)}
        (row,) = (line.split("|") for line in guide.splitlines() if line.startswith(f"| `{scale}`"))
        assert row[3].strip() == f"{len(runs):,}", scale


@pytest.mark.results
@pytest.mark.processor
@pytest.mark.parametrize(("scale", "runs"), [("quick", 45), ("standard", 135)])
def test_the_shipped_main_grid_is_that_of_the_planned_runs(scale, runs, tmp_path):
    table = pq.read_table(WORKSPACE / "docs" / "results" / scale / "runs.parquet", columns=["run", "experiments"])
    stored = {row["run"] for row in table.to_pylist() if "figure_3a" in row["experiments"].split()}
    register_settings("reproduce", SETTINGS)
    with initialized():
        config = build(compose_data([f"scale={scale}", f"root={tmp_path}"], "reproduce"))
        plan = make_plan(config.at_scale(), config.run, tmp_path)
    assert len(stored) >= runs
    assert stored <= {work.run.label() for work in plan.runs}
