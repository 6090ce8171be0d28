"""The table of runs: which settings differ, how far each is, what it achieved; and the mistakes one makes on the way."""

import json
import threading

import pytest

from experiments.commands.hydra_app import compose
from experiments.results import ResultsConfig, results, state_of
from experiments.runs.run_folder import VERSIONS, read_versions, use_run_folder
from experiments.runs.versions import computed_with
from experiments.settings import ConfigError, LevelsConfig, RunFolderError, TaskConfig, TrackingConfig
from experiments.training.run import run
from tests.experiments.short_runs import before_iteration, killed_after, short_run


def test_the_table_says_what_differs_how_far_it_is_and_what_came_of_it(tmp_path, monkeypatch):
    sweep = TrackingConfig(name="none", sweep="mine")
    done = run(short_run(tmp_path / "a", tracking=sweep))
    with killed_after(2, monkeypatch):
        run(short_run(tmp_path / "b", tracking=sweep, seed=1))
    run(short_run(tmp_path / "c", seed=2))
    said = []
    results(ResultsConfig(root=str(tmp_path), sweep="mine"), said.append)
    head, *lines = said[0].splitlines()
    assert head.split("  ")[0] == "levels.train"
    assert [word for word in head.split() if "." in word] == ["levels.train", "algorithm.name"]
    assert " seed " in head and "levels.count" not in head
    assert "finished" in lines[0] and f"{done.summary['evaluation/test/return/deterministic']:.4g}" in lines[0]
    assert "failed after 128 frames" in lines[1]
    assert lines[2:] == [f"computed with {computed_with(read_versions(tmp_path / 'a'))}"]


def test_the_table_says_of_each_run_what_it_was_computed_with_where_that_differs(tmp_path):
    for name in ("a", "b"):
        run(short_run(tmp_path / name))
    path = tmp_path / "b" / VERSIONS
    versions = json.loads(path.read_text())
    versions["arithmetic_before"] = [{**versions["arithmetic"], "processor": "Another"}]
    path.write_text(json.dumps(versions))
    said = []
    results(ResultsConfig(root=str(tmp_path)), said.append)
    head, *lines = said[0].splitlines()
    here = computed_with(read_versions(tmp_path / "a"))
    assert head.endswith("computed with")
    assert [line.rpartition("  ")[2] for line in lines] == [here, f"{here.rpartition(', ')[0]}, Another, then {here}"]


def test_a_run_at_work_is_told_from_one_that_was_cut_off(tmp_path, monkeypatch):
    states = []

    def look(_):
        thread = threading.Thread(target=lambda: states.append(state_of(tmp_path / "run")))
        thread.start()
        thread.join()

    with before_iteration(2, look, monkeypatch):
        run(short_run(tmp_path / "run"))
    assert states == ["at work"]
    with use_run_folder(short_run(tmp_path / "other")):
        pass
    assert state_of(tmp_path / "other") == "not begun"


def test_where_there_is_no_such_run_the_sweeps_are_named(tmp_path):
    with use_run_folder(short_run(tmp_path / "run", tracking=TrackingConfig(sweep="mine"))):
        pass
    with pytest.raises(RunFolderError, match=r"there is no run of the sweep yours in .*; there are the sweeps mine"):
        results(ResultsConfig(root=str(tmp_path), sweep="yours"))


@pytest.mark.parametrize("name", ["billiards", "invisiball"])
def test_levels_choose_their_own_task_unless_one_is_named(name):
    assert compose([f"levels={name}"]).task.name == name
    assert compose([f"levels={name}", "levels.count=3"]).levels.count == 3
    assert compose([f"levels={name}", "task=puttputt"]).task.name == "puttputt"
    assert compose([]).task.name == "puttputt"


def test_a_task_that_does_not_fit_the_levels_is_named_with_the_one_that_does(tmp_path):
    config = short_run(
        tmp_path / "run", levels=LevelsConfig("billiards", count=2, test_count=2), task=TaskConfig("puttputt")
    )
    with pytest.raises(ConfigError, match=r"levels of billiards are for task=billiards, and puttputt does not fit: "):
        run(config)
