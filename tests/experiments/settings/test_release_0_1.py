"""The names of release 0.1: its run folders are read, its results are found, and its settings are told the new names."""

import json
from pathlib import Path

import hydra
import pyarrow.parquet as pq
import pytest
import yaml

from experiments.commands.config_store import conf_dir, register_settings
from experiments.commands.hydra_app import compose
from experiments.reproduce import SETTINGS, build
from experiments.reproduction.plan import make_plan
from experiments.runs.run_folder import folder_path, read_config
from experiments.settings import CHECKOUT, ConfigError, RunFolderError, as_data, label_in_0_1, run_config

LABELS = json.loads((Path(__file__).parent / "labels_0_1.json").read_text())  # that release 0.1 itself printed
LATER = {"drac", "drac_fast", "ppg", "ppg_fast", "ppo_recurrent_trials"}  # algorithms that came after it
OLD_TYPES = {
    "ppo": "experiments.config:PPOConfig",
    "ppo_recurrent": "experiments.recurrent_ppo:RecurrentPPOConfig",
    "curl": "experiments.curl:CURLConfig",
    "spr": "experiments.spr:SPRConfig",
    "sac": "experiments.sac:SACConfig",
    "drq_2022": "experiments.drq:DrQConfig",
}


@pytest.mark.parametrize("algorithm", LABELS)
def test_the_names_that_0_1_gave_are_known_for_every_algorithm_and_task(algorithm):
    for task, label in LABELS[algorithm].items():
        run = compose([f"algorithm={algorithm}", f"task={task}", "observation=rgb_stack2"])
        assert label_in_0_1(run) == label


def test_the_names_that_0_1_gave_cover_every_shipped_algorithm():
    assert {*LABELS} | LATER == {path.stem for path in (conf_dir() / "algorithm").glob("*.yaml")}


@pytest.mark.results
@pytest.mark.processor
@pytest.mark.parametrize(("scale", "runs"), [("quick", 45), ("standard", 135)])
def test_the_shipped_main_grid_is_that_of_the_planned_runs(scale, runs, tmp_path):
    table = pq.read_table(CHECKOUT / "docs" / "results" / scale / "runs.parquet", columns=["run", "experiments"])
    stored = {row["run"] for row in table.to_pylist() if "figure_3a" in row["experiments"].split()}
    register_settings("reproduce", SETTINGS)
    with hydra.initialize_config_dir(str(conf_dir()), version_base="1.3"):
        config = build(hydra.compose("reproduce", [f"scale={scale}", f"root={tmp_path}"]))
        plan = make_plan(config.at_scale(), config.run, tmp_path)
    assert len(stored) >= runs
    assert stored <= {name for work in plan.runs for name in (label_in_0_1(work.run), work.run.label())}


@pytest.mark.parametrize("algorithm", OLD_TYPES)
def test_a_run_folder_of_0_1_is_read(tmp_path, algorithm):
    run = compose([f"algorithm={algorithm}", "task=conditions_1"])
    data = as_data(run)
    del data["algorithm"]["kind"]
    data["algorithm"]["type"] = OLD_TYPES[algorithm]
    data["task"]["name"] = "experiments.conditions:conditional_puttputt"
    if data["algorithm"].get("encoder") == "cnn_2022":
        data["algorithm"]["encoder"] = "experiments.drq:cnn_2022"
    (tmp_path / "config.yaml").write_text(yaml.safe_dump(data))
    assert read_config(tmp_path) == run


@pytest.mark.parametrize(
    ("group", "settings", "says"),
    [
        ("algorithm", {"type": "experiments.curl:CURLConfig"}, "algorithm.type: since release 0.2 .*, here kind: curl"),
        ("algorithm", {"type": "my_lab.mine:Mine"}, "here _target_: my_lab.mine.Mine"),
        (
            "algorithm",
            {"encoder": "experiments.drq:cnn_2022"},
            "algorithm.encoder: 'experiments.drq:cnn_2022' is called 'cnn_2022' since release 0.2",
        ),
        (
            "task",
            {"name": "experiments.conditions:conditional_puttputt"},
            "task.name: .* is called 'conditional_puttputt' since release 0.2",
        ),
    ],
)
def test_a_setting_of_0_1_is_told_its_new_name(group, settings, says):
    with pytest.raises(ConfigError, match=says):
        run_config({group: settings})


@pytest.mark.parametrize("text", ["algorithm: 3", "task: [a]", "algorithm: {type: [a]}"])
def test_settings_in_no_shape_that_any_release_wrote_are_refused(tmp_path, text):
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(RunFolderError, match=r"config.yaml: (algorithm|task)"):
        read_config(tmp_path)


def test_an_override_of_0_1_is_told_its_new_name():
    with pytest.raises(ConfigError, match=r"algorithm.type: since release 0.2 kind .* names the class of an algorithm"):
        compose(["algorithm.type=experiments.curl:CURLConfig"])


def test_a_run_folder_with_its_name_in_0_1_is_found(tmp_path):
    run = compose([f"root={tmp_path}"])
    assert folder_path(run) == tmp_path / run.label()
    (tmp_path / label_in_0_1(run)).mkdir()
    assert folder_path(run) == tmp_path / label_in_0_1(run)
    (tmp_path / run.label()).mkdir()
    assert folder_path(run) == tmp_path / run.label()
