"""Finished runs are probed once, whatever happens on the way, and their figures stand beside gap and distances."""

import dataclasses
from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
import torch
import yaml

from segar.analysis.probes.pairs import Column, Pairs
from segar.analysis.probes.table import probe_pairs, probe_run
from segar.errors import SegarError
from segar.experiments.commands import plugin
from segar.experiments.commands.config_store import CONF
from segar.experiments.evaluation import probing
from segar.experiments.evaluation.probing import ProbeConfig, is_probed, probe_finished
from segar.experiments.evaluation.transfers import RunTask
from segar.experiments.reproduce import ReproduceConfig, carry_out
from segar.experiments.reproduction.experiment_file import experiment_at
from segar.experiments.reproduction.plan import as_text, make_plan, measure_speeds
from segar.experiments.runs.executed_code import fingerprint
from segar.experiments.runs.own_modules import modules_reached
from segar.experiments.runs.run_folder import PROBES, folder_path, read_metrics
from segar.experiments.settings import ConfigError, RunFolderError, TrackingConfig, TrackingError, construct
from segar.experiments.tracking.mlflow_store import open_store
from segar.experiments.tracking.mlflow_sync import RunSync
from segar.experiments.training.run import run
from segar.experiments.upload import upload_run
from tests.experiments.short_runs import short_run
from tests.synthetic_runs import settings, write_run

SCALES = yaml.safe_load((CONF / "reproduce.yaml").read_text())["probes"]
ASKED = ProbeConfig(frames=100, representations={"trained": ["jsd"]})
MAIN = {"title": "Main", "grid": {"counts": [1, 10]}, "probes": True, "scales": {"single": {}}}
calls: list[tuple[str, int]] = []


def answers(folder, config):
    """Stands for the probes: an accuracy that rises from call to call."""
    calls.append((folder.name, config.frames))
    rows = [
        ("train", "trained", "all", "jsd", "accuracy", 0.9),
        ("test", "trained", "all", "jsd", "accuracy", 0.8 + 0.01 * len(calls)),
        ("test", "shuffled", "all", "jsd", "accuracy", 0.5),
        ("test", "trained", "all", "infonce", "accuracy", np.nan),
        ("test", "trained", "goal.Position.x", "ridge", "r2", 0.7),
    ]
    table = pd.DataFrame(rows, columns=["levels", "representation", "factor", "probe", "quantity", "estimate"])
    return table.assign(run=folder.name, low=np.nan, high=np.nan, p=np.nan, entropy=np.nan, n=5)


def no_answers(folder, config):
    raise SegarError("all frames are of one episode")


def install(monkeypatch, *functions):
    """Makes these functions of this file the registered probes."""
    plugins = [EntryPoint("default", f"{__name__}:{one.__name__}", "segar.probes") for one in functions]
    monkeypatch.setattr(plugin, "entry_points", lambda **of: EntryPoints(plugins).select(**of))
    probing.find_probes.cache_clear()


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    calls.clear()
    install(monkeypatch, answers)
    yield
    probing.find_probes.cache_clear()


@pytest.fixture
def finished(tmp_path):
    config = settings(tmp_path)
    write_run(config)
    return config


@pytest.mark.parametrize(
    "scale", ["standard", *(pytest.param(scale, marks=pytest.mark.slow) for scale in SCALES if scale != "standard")]
)
def test_critics_of_every_scale_find_nothing_where_nothing_is_and_all_where_all_is(scale):
    torch.set_num_threads(1)
    config = dataclasses.replace(construct(ProbeConfig, SCALES[scale], scale), replicates=2)
    rng = np.random.default_rng(1)
    n = config.frames
    hidden = rng.normal(size=(n, 6)) @ rng.normal(size=(6, 256))
    x, z = np.maximum(hidden, 0), rng.normal(size=(n, 6))
    columns = tuple(Column("ball", f"f{k}") for k in range(6))
    independent = Pairs(np.float32(x), z, columns, np.arange(n))
    said = [
        probe_pairs(pairs, np.random.default_rng(2), ["jsd"], config).estimate[0]
        for pairs in (independent, independent.with_representation(z))
    ]
    assert said[0] == pytest.approx(0.5, abs=0.02) and said[1] > 0.95


def test_a_run_is_probed_once_for_what_is_asked(finished):
    assert not is_probed(finished, ASKED)
    figures = probe_finished(finished, ASKED)
    assert is_probed(finished, ASKED)
    assert figures == {
        "probes/accuracy/train": 0.9, "probes/accuracy/test": pytest.approx(0.81), "probes/accuracy/test/shuffled": 0.5,
        "probes/r2/goal.Position.x": 0.7,
    }  # fmt: skip
    assert not is_probed(finished, dataclasses.replace(ASKED, frames=200))


def test_answers_of_other_code_do_not_count(finished, monkeypatch):
    probe_finished(finished, ASKED)
    monkeypatch.setattr(probing, "code_of_probes", lambda: "other")
    assert not is_probed(finished, ASKED)


def test_answers_that_were_damaged_are_asked_for_again(finished):
    probe_finished(finished, ASKED)
    path = folder_path(finished) / PROBES
    path.write_bytes(path.read_bytes()[:100])
    assert not is_probed(finished, ASKED)


def test_figures_stand_behind_those_of_training_and_are_replaced(finished):
    before = read_metrics(folder_path(finished)).to_pylist()
    for _ in range(2):
        probe_finished(finished, ASKED)
    rows = read_metrics(folder_path(finished)).to_pylist()
    assert rows[: len(before)] == before and len(rows) == len(before) + 4
    assert {row["name"]: row["value"] for row in rows}["probes/accuracy/test"] == pytest.approx(0.82)


def test_killed_before_the_end_it_is_done_again_and_leaves_nothing_twice(finished, monkeypatch):
    with monkeypatch.context() as patched, pytest.raises(KeyboardInterrupt):
        patched.setattr(pq, "write_table", lambda *_, **options: (_ for _ in ()).throw(KeyboardInterrupt))
        probe_finished(finished, ASKED)
    assert not is_probed(finished, ASKED)
    probe_finished(finished, ASKED)
    names = [row["name"] for row in read_metrics(folder_path(finished)).to_pylist()]
    assert is_probed(finished, ASKED) and len(names) == len(set(names))


def test_a_failure_names_the_run_the_cause_and_what_to_do(finished, monkeypatch):
    install(monkeypatch, no_answers)
    with pytest.raises(RunFolderError, match=f"probes of {finished.label()} failed: all frames"):
        probe_finished(finished, ASKED)
    assert not is_probed(finished, ASKED)


def test_the_fingerprint_of_probes_is_that_of_the_plug_ins_module(monkeypatch):
    table = EntryPoint("default", "segar.analysis.probes.table:probe_run", "segar.probes")
    monkeypatch.setattr(plugin, "entry_points", lambda **of: EntryPoints([table]).select(**of))
    probing.find_probes.cache_clear()
    assert probing.code_of_probes() == fingerprint("segar.analysis.probes.table")
    assert {"segar.analysis.probes.table", "segar.analysis.probes.readouts"} <= {*modules_reached(table.module)}
    assert probing.find_probes().load() is probe_run


@pytest.mark.slow
def test_a_run_that_is_trained_anew_loses_its_answers(tmp_path):
    config = short_run(tmp_path / "run")
    run(config, say=lambda line: None)
    carry_out(RunTask(config, (), ASKED))
    assert calls == [("run", 100)] and is_probed(config, ASKED)
    run(dataclasses.replace(config, restart=True), say=lambda line: None)
    assert not is_probed(config, ASKED)


@pytest.mark.slow
def test_mlflow_gets_the_figures_later_if_it_was_away_and_anew_if_they_change(tmp_path, monkeypatch):
    config = short_run(tmp_path / "run", tracking=TrackingConfig(), root=str(tmp_path))
    folder = run(config, say=lambda line: None).folder
    said: list[str] = []
    with monkeypatch.context() as patched:
        patched.setattr(RunSync, "send", lambda *_: (_ for _ in ()).throw(TrackingError("MLflow refuses: it is away")))
        probe_finished(config, ASKED, said.append)
    assert f"segar upload run={folder}" in said[1] and is_probed(config, ASKED)
    assert upload_run(folder).startswith("sent 4 figures")
    client, experiment = open_store(config.tracking, tmp_path)

    def told():
        (one,) = client.search_runs([experiment])
        return one.data.metrics["probes/accuracy/test"], one.info.status

    assert told() == (pytest.approx(0.81), "FINISHED")
    probe_finished(config, ASKED)
    assert told() == (pytest.approx(0.82), "FINISHED")


def test_the_plan_counts_runs_to_probe_and_does_the_rest_of_a_finished_run(tmp_path):
    base = settings(tmp_path, seed=1)
    files = {"main": {**MAIN, "probes": False}, "again": MAIN}
    plan = make_plan([experiment_at(k, v, "single") for k, v in files.items()], base, tmp_path / "results", ASKED)
    first = plan.runs[0]
    assert first.probes == ASKED and plan.members["main"][0].probes is None  # the union asks
    write_run(first.run)
    assert not first.is_done()
    said = as_text(plan, measure_speeds(tmp_path), 1, base.scale)
    assert said.splitlines()[2].split()[-2] == "18" and "18 to probe;" in said
    probe_finished(first.run, ASKED)
    assert first.is_done()
    assert "17 to probe;" in as_text(plan, measure_speeds(tmp_path), 1, base.scale)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({"frames": 0}, "probes.quick.frames: 0 is not allowed; it must be at least 1"),
        ({"fram": 1}, "no setting is called 'probes.quick.fram'. Did you mean 'probes.quick.frames'"),
        ({"representations": {"trained": ["rigde"]}}, "representations.trained: 'rigde' is unknown."),
        ({"representations": {"trained": "jsd"}}, "representations.trained: 'jsd' is not allowed; it must be a list"),
        ({"representations": {"trained": ["ksg"]}}, "and one of them other than ksg"),
        ({"representations": {"trained": [["jsd"]]}}, r"representations.trained: '\['jsd'\]' is unknown"),
    ],
)
def test_wrong_settings_are_told_with_their_place(tmp_path, data, message):
    with pytest.raises(ConfigError, match=message):
        ReproduceConfig(settings(tmp_path), probes={"quick": data}, grids={"main": MAIN})


def test_probes_need_agents():
    with pytest.raises(ConfigError, match=r"grids.mine.probes: True is not allowed; it must be beside a grid"):
        experiment_at("mine", {"title": "Mine", "study": "w2", "probes": True, "scales": {"quick": {}}}, "quick")
    without = experiment_at("mine", {**MAIN, "scales": {"single": {"probes": False}}}, "single")
    assert without is not None and not without.probes
