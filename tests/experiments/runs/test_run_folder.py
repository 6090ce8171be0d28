"""The run folder: one run each, found again when finished, gone on with when killed, and never half written."""

import dataclasses
import errno
import os
from pathlib import Path

import pytest

from segar.experiments.algorithms.ppo import PPO
from segar.experiments.levels.builders import make_levels
from segar.experiments.runs.executed_code import executed_code
from segar.experiments.runs.files import write_text
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import (
    CONFIG,
    is_finished,
    read_config,
    read_episodes,
    read_metrics,
    read_summary,
    use_run_folder,
)
from segar.experiments.settings import CheckpointError, ConfigError, RunFolderError, TaskConfig, TrackingConfig
from segar.experiments.training import run as run_module
from segar.experiments.training.run import run
from segar.tasks.puttputt_task import puttputt
from tests.experiments.short_runs import run_killed, short_run

FILES = {
    "config.yaml",
    "levels_train.npz",
    "levels_test.npz",
    "checkpoint",
    "episodes.parquet",
    "metrics.parquet",
    "versions.json",
    "summary.json",
    "journal.jsonl",
    ".lock",
}


@pytest.fixture
def config(tmp_path):
    """A run of four iterations."""
    return short_run(tmp_path / "run")


def test_a_run_leaves_all_files_and_can_be_read(trained_once):
    folder, config = trained_once, short_run(trained_once)
    assert {path.name for path in folder.iterdir()} == FILES
    assert read_config(folder) == config.resolved()
    episodes = read_episodes(folder).to_pandas()
    assert episodes.groupby(["levels", "action_mode"]).size().to_dict() == {
        ("test", "deterministic"): 3,
        ("test", "sampled"): 3,
        ("train", "deterministic"): 2,
        ("train", "sampled"): 2,
    }
    metrics = read_metrics(folder).to_pandas()
    assert {"episode/count", "loss/policy", "w2/exact", "evaluation/gap/deterministic"} <= set(metrics["name"])
    summary = read_summary(folder)
    assert summary["frames"] == config.scale.frames
    assert summary["evaluation/test/return/sampled"] == pytest.approx(
        episodes[(episodes.levels == "test") & (episodes.action_mode == "sampled")]["return"].mean()
    )


def test_a_finished_run_is_found_and_not_trained_again(finished, monkeypatch):
    monkeypatch.setattr(PPO, "iterate", None)
    said = []
    again = run(finished, said.append)
    assert not again.trained
    assert dict(again.summary) == read_summary(again.folder)
    assert "finished before, nothing to do" in said[0]


def test_a_run_that_cannot_begin_leaves_no_folder(config, tmp_path):
    crowded = dataclasses.replace(config.levels, test="objectsx1-easy")
    tracked = dataclasses.replace(config, levels=crowded, root=str(tmp_path), tracking=TrackingConfig())
    with pytest.raises(ConfigError, match="does not show the same in levels of objectsx1-easy") as caught:
        run(tracked)
    assert not hasattr(caught.value, "__notes__")  # which would name a journal
    assert list(tmp_path.iterdir()) == []  # nor anything for MLflow


def test_what_a_folder_holds_stays_where_a_run_that_goes_on_cannot(config, monkeypatch):
    run_killed(config, 2)
    with monkeypatch.context() as patch:
        patch.setattr("segar.experiments.levels.builders.pick_levels", nothing_to_sample)
        with pytest.raises(ConfigError, match="no levels"):
            run(config)
    assert read_journal(Path(config.folder))[-1]["event"] == "failed"
    assert run(config).trained


def nothing_to_sample(*_):
    raise ConfigError("no levels")


def test_a_task_without_a_reward_is_told(config, trained_and_said):
    said = []
    run(dataclasses.replace(config, task=TaskConfig("tests.experiments.training.own_results:unrewarded")), said.append)
    warning = "warning: the task free has no reward function: all rewards are 0"
    assert sum(warning in line for line in said) == 1
    _, otherwise = trained_and_said
    assert otherwise and not any("reward function" in line for line in otherwise)


def test_a_run_killed_before_its_first_checkpoint_begins_anew(config):
    run_killed(config, 0)
    assert run(config).trained


def test_a_folder_of_another_run_is_refused_and_kept(finished):
    other = dataclasses.replace(finished, seed=1, algorithm=dataclasses.replace(finished.algorithm, gamma=0.5))
    with pytest.raises(RunFolderError) as caught:
        run(other)
    assert "holds another run: algorithm.gamma is 0.999 there and 0.5 here; seed is 0 there and 1 here" in str(
        caught.value
    )
    assert "Choose another folder=..., or throw that run away with restart=true" in str(caught.value)
    assert is_finished(run(finished).folder)


@pytest.mark.parametrize("restart", [False, True])
def test_a_folder_that_holds_something_else_is_refused_and_kept(config, tmp_path, restart):
    mine = tmp_path / "run"
    mine.mkdir()
    (mine / "thesis.tex").write_text("x")
    with pytest.raises(RunFolderError, match=r"holds no run but is not empty: thesis\.tex\. Choose another"):
        run(dataclasses.replace(config, restart=restart))
    assert {p.name for p in mine.iterdir()} - {".lock"} == {"thesis.tex"}


@pytest.mark.parametrize("name", ["loop", "nul\0", "\udcff", "~nobody-of-this-name/x", "x" * 300, "file"])
def test_a_root_that_no_folder_can_have_is_refused_by_its_name(config, tmp_path, name):
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "file").touch()
    root = name if name.startswith("~") else str(tmp_path / name)
    with pytest.raises(RunFolderError, match=r"is no place for files|cannot use the folder"):
        run(dataclasses.replace(config, root=root, folder=None))


def test_restart_clears_no_folder_whose_settings_are_not_a_runs(config, tmp_path):
    mine = tmp_path / "run"
    (mine / "checkpoint").mkdir(parents=True)
    (mine / CONFIG).write_text("title: my web site\n")
    (mine / "checkpoint" / "latest.pt").write_text("x")
    with pytest.raises(RunFolderError, match=r"cannot read the settings of a run from .*no setting is called 'title'"):
        run(dataclasses.replace(config, restart=True))
    assert (mine / CONFIG).exists() and (mine / "checkpoint" / "latest.pt").exists()


def test_two_processes_cannot_be_at_one_folder(config):
    with (
        use_run_folder(config),
        pytest.raises(RunFolderError, match="another process is at work in"),
        use_run_folder(config),
    ):
        pass


def test_resume_can_be_forbidden(config):
    careful = dataclasses.replace(config, resume=False)
    run_killed(careful, 2)
    with pytest.raises(RunFolderError, match="holds this run, unfinished, and resume=false forbids to go on with it"):
        run(careful)
    assert run(config).trained
    assert not run(careful).trained  # finished: there is nothing to go on with


def test_a_finished_run_of_other_code_is_refused_unless_the_user_says_what_to_do(finished, monkeypatch):
    config = finished
    monkeypatch.setattr(run_module, "executed_code", lambda config: {**executed_code(config), "learner": "another"})
    differs = "finished before by other code than this: learner changed since"
    with pytest.raises(RunFolderError, match=f"{differs}. stale=anew trains it anew, stale=keep takes its results"):
        run(config)
    said = []
    assert not run(dataclasses.replace(config, stale="keep"), said.append).trained
    assert "finished before, nothing to do (by other code than this: learner changed since)" in said[-1]
    assert run(dataclasses.replace(config, stale="anew"), said.append).trained
    assert "is trained anew, because it was made by other code than this: learner changed since" in said[-2]
    assert not run(dataclasses.replace(config, stale="anew"), said.append).trained


def test_what_the_task_says_of_the_last_state_is_in_the_episodes(trained_once):
    episodes = read_episodes(trained_once).to_pandas()
    assert [name for name in episodes if name.startswith("results/")] == [
        f"results/{name}" for name in puttputt().results
    ]
    assert episodes["results/distance_to_goal"].between(0, 3).all()
    assert episodes["results/velocity"].map(len).eq(2).all()


def test_what_a_killed_process_left_half_written_is_removed(config, tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / ".writing-1-config.yaml").write_text("half")
    with use_run_folder(config) as folder:
        assert {p.name for p in folder.iterdir()} == {".lock", CONFIG}


@pytest.mark.parametrize("call", ["write", "fsync", "replace"])
def test_a_full_disk_leaves_the_old_file_and_says_so(tmp_path, monkeypatch, call):
    def no_room(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    target = tmp_path / "summary.json"
    target.write_text("old")
    if call == "write":
        monkeypatch.setattr("pathlib.Path.write_bytes", no_room)
    else:
        monkeypatch.setattr(os, call, no_room)
    with pytest.raises(RunFolderError, match=r"summary\.json cannot be written .*: No space left on device; what was"):
        write_text(target, "new")
    assert [p.name for p in tmp_path.iterdir()] == ["summary.json"]
    assert target.read_text() == "old"


def test_levels_that_changed_since_the_checkpoint_stop_the_run(config, monkeypatch):
    run_killed(config, 2)
    other = make_levels(dataclasses.replace(config.levels, seed=5))[0]
    monkeypatch.setattr("segar.experiments.levels.builders.pick_levels", lambda *_: other)
    with pytest.raises(CheckpointError, match=r"other levels than those that empty-easy gives now.*restart=true"):
        run(config)


@pytest.mark.parametrize("text", ["algorithm: 3", "task: [a]", "algorithm: {kind: [a]}"])
def test_settings_in_no_shape_that_a_run_writes_are_refused(tmp_path, text):
    (tmp_path / "config.yaml").write_text(text)
    with pytest.raises(RunFolderError, match=r"config.yaml: (algorithm|task)"):
        read_config(tmp_path)
