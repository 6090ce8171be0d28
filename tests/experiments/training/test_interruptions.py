"""Runs that are stopped, go wrong or are killed: what is left, what is said, and how they go on."""

import errno
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time

import pytest
import torch

from segar.experiments.algorithms.checkpoint import read_checkpoint
from segar.experiments.algorithms.ppo import PPO
from segar.experiments.commands.signals import Stopped
from segar.experiments.runs.journal import Journal, read_journal
from segar.experiments.runs.run_folder import (
    CHECKPOINT,
    DAMAGED,
    JOURNAL,
    METRIC_SCHEMA,
    METRICS,
    PREVIOUS,
    VERSIONS,
    is_finished,
    read_metrics,
    read_summary,
    write_rows,
)
from segar.experiments.settings import CheckpointError, RunFolderError, ScaleConfig, TrainingError
from segar.experiments.training.run import run
from tests.experiments.short_runs import (
    COMMAND,
    FRAMES,
    ITERATIONS,
    before_iteration,
    begin_module,
    run_killed,
    same_results,
    short_run,
)


@pytest.fixture(autouse=True)
def listening():
    """Ctrl-C counts; in what a shell started in its background, it is ignored."""
    there = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, there)


def send(number):
    return lambda _: os.kill(os.getpid(), number)


def frames(folder, name=CHECKPOINT):
    return read_checkpoint(folder / name)["frames"]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_that_is_stopped_finishes_its_iteration_and_saves_it(trained_once, tmp_path, capfd, number):
    config = short_run(tmp_path / "run", checkpoint_interval=1000.0)
    with before_iteration(2, send(number)), pytest.raises(Stopped) as stopped:
        run(config)
    name = signal.Signals(number).name
    assert str(stopped.value) == f"stopped by {name} after 128 of 256 frames; the checkpoint is written"
    assert f"{name}: writes a checkpoint after this iteration" in capfd.readouterr().err
    assert frames(tmp_path / "run") == 2 * FRAMES
    last = read_journal(tmp_path / "run")[-1]
    assert (last["event"], last["during"], last["frames"]) == ("stopped", "training", 2 * FRAMES)
    run(config)
    assert same_results(tmp_path / "run", trained_once)


def test_a_second_signal_stops_a_run_at_once(tmp_path):
    def twice(learner):
        send(signal.SIGINT)(learner)
        send(signal.SIGINT)(learner)

    with before_iteration(2, twice), pytest.raises(Stopped, match=r"^stopped by SIGINT\n"):
        run(short_run(tmp_path / "run"))
    assert frames(tmp_path / "run") == FRAMES


@pytest.mark.parametrize("number", [signal.SIGUSR1, signal.SIGUSR2])
def test_slurms_warning_makes_a_run_save_and_go_on(tmp_path, number):
    seen = []

    def look(_):
        seen.append(frames(tmp_path / "run"))

    config = short_run(tmp_path / "run", checkpoint_interval=1000.0)
    with before_iteration(2, send(number)), before_iteration(3, look):
        assert run(config).trained
    assert seen == [2 * FRAMES]


def test_who_handled_a_signal_before_is_asked_once_the_checkpoint_is_written(tmp_path):
    """As submitit, which puts the job back into the queue and ends the process."""

    def requeue(number, frame):
        asked.append((number, frames(tmp_path / "run")))
        sys.exit(3)

    asked = []
    there = signal.signal(signal.SIGUSR2, requeue)
    try:
        with before_iteration(2, send(signal.SIGUSR2)), pytest.raises(SystemExit):
            run(short_run(tmp_path / "run", checkpoint_interval=1000.0))
        assert signal.getsignal(signal.SIGUSR2) is requeue
    finally:
        signal.signal(signal.SIGUSR2, there)
    assert asked == [(signal.SIGUSR2, 2 * FRAMES)]
    assert run(short_run(tmp_path / "run")).trained


def test_signals_that_are_ignored_stay_ignored_and_handlers_are_given_back(tmp_path):
    there = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with before_iteration(2, send(signal.SIGINT)):
            assert run(short_run(tmp_path / "run")).trained
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGINT, there)


def test_a_run_in_another_thread_trains_without_watching_signals(tmp_path):
    results = []
    thread = threading.Thread(target=lambda: results.append(run(short_run(tmp_path / "run"))))
    thread.start()
    thread.join()
    assert results[0].trained


@pytest.mark.slow
def test_the_command_says_why_it_stopped_and_ends_as_the_shell_has_it(tmp_path):
    asked = (*COMMAND, "tracking=none", f"folder={tmp_path / 'run'}", "scale.frames=100_000_000")
    process = begin_module("segar.experiments.train", *asked, cwd=tmp_path, stderr=subprocess.PIPE)
    while not (tmp_path / "run" / CHECKPOINT).exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    _, said = process.communicate()
    assert process.returncode == 128 + signal.SIGTERM
    assert "stopped by SIGTERM after" in said
    assert "the checkpoint is written. The same command goes on from the last checkpoint" in said
    assert "Traceback" not in said


def test_a_loss_that_is_not_finite_ends_the_run_and_says_what_where_and_when(tmp_path, monkeypatch):
    monkeypatch.setattr(PPO, "learn", lambda self, _: {"loss/value": float("nan") if self.frames > 2 * FRAMES else 0.5})
    with pytest.raises(TrainingError, match="loss/value became nan after 192 frames") as told:
        run(short_run(tmp_path / "run"))
    assert told.value.__notes__ == [
        f"This happened during training, after 192 frames; see {tmp_path / 'run' / JOURNAL}"
    ]
    last = read_journal(tmp_path / "run")[-1]
    assert (last["event"], last["during"], last["frames"]) == ("failed", "training", 3 * FRAMES)
    assert last["error"].startswith("TrainingError: loss/value became nan")
    assert "training_loop.py" in last["where"] and "in iterate" in last["where"]
    assert frames(tmp_path / "run") == 2 * FRAMES
    rows = read_metrics(tmp_path / "run").to_pylist()
    assert [row["frames"] for row in rows if row["name"] == "loss/value"] == [64, 128, 192]


def test_a_weight_that_is_not_finite_is_never_saved(tmp_path, monkeypatch):
    def collect_nothing(learner):
        learner.frames += FRAMES
        return None, {}

    def spoil(learner):
        next(learner.policy.parameters()).data[0, 0] = torch.inf
        monkeypatch.setattr(PPO, "learn", lambda *_: {})
        monkeypatch.setattr(PPO, "collect", collect_nothing)

    with (
        before_iteration(3, spoil),
        pytest.raises(TrainingError, match=r"'actor\..*' is not finite after 192"),
    ):
        run(short_run(tmp_path / "run"))
    assert frames(tmp_path / "run") == 2 * FRAMES


def test_a_full_disk_is_told_and_costs_the_work_since_the_last_checkpoint(trained_once, tmp_path, monkeypatch, capsys):
    def fill(_):
        def no_room(*_):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

        full.setattr("pathlib.Path.write_bytes", no_room)
        full.setattr("segar.experiments.runs.journal.Path.open", no_room)

    with (
        monkeypatch.context() as full,
        before_iteration(3, fill),
        pytest.raises(RunFolderError, match=r"latest\.pt cannot be written to .*latest\.pt: No space left on device"),
    ):
        run(short_run(tmp_path / "run"))
    assert (
        f"cannot write {tmp_path / 'run' / JOURNAL}: No space left on device; it would say: " in capsys.readouterr().err
    )
    assert frames(tmp_path / "run") == 2 * FRAMES
    run(short_run(tmp_path / "run"))
    assert same_results(tmp_path / "run", trained_once)


def test_a_process_that_was_killed_is_found_by_the_next_one(tmp_path):
    run_killed(short_run(tmp_path / "run"), 2)
    path = tmp_path / "run" / JOURNAL
    begun, ended = path.read_text().splitlines()
    assert json.loads(ended)["event"] == "failed"
    edited = {"event": "started", "time": "x"}
    path.write_text(json.dumps(edited) + "\n")
    assert "(? on ?, begun x)" in Journal(path.parent).begin()
    path.write_text(f'{begun}\n{{"time": "cut off by a power c')  # what kill -9 leaves, at worst
    said = []
    run(short_run(tmp_path / "run"), said.append)
    assert f"the process before this one ({os.getpid()} on " in said[0] and "ended without a word: killed" in said[0]
    assert [entry["event"] for entry in read_journal(tmp_path / "run")] == ["started", "lost", "started", "finished"]


def damage(path, how):
    if how == "edited":
        content = torch.load(path, weights_only=True)
        content["learner"]["optimizer"]["param_groups"][0]["lr"] *= 2
        torch.save(content, path)
        return
    content = bytearray(path.read_bytes())
    if how == "cut":
        del content[len(content) // 2 :]
    else:
        content[len(content) // 2] ^= 1
    path.write_bytes(content)


@pytest.mark.parametrize("how", ["cut", "one bit", "edited"])
def test_a_damaged_newest_checkpoint_falls_back_to_the_one_before_and_says_so(trained_once, tmp_path, how):
    folder = tmp_path / "run"
    run_killed(short_run(folder), 3)
    assert (frames(folder), frames(folder, PREVIOUS)) == (3 * FRAMES, 2 * FRAMES)
    damage(folder / CHECKPOINT, how)
    said = []
    run(short_run(folder), said.append)
    assert f"the checkpoint {folder / CHECKPOINT} is damaged or none of ours: " in said[0]
    assert f"(kept as {DAMAGED}). The one before is used, of 128 frames: {folder / PREVIOUS}" in said[0]
    assert "goes on from 128 of 256 frames" in said[1]
    assert (folder / DAMAGED).exists()
    assert same_results(folder, trained_once)


def test_where_both_checkpoints_are_damaged_nothing_is_guessed(tmp_path):
    folder = tmp_path / "run"
    run_killed(short_run(folder), 3)
    damage(folder / CHECKPOINT, "cut")
    damage(folder / PREVIOUS, "cut")
    with pytest.raises(CheckpointError, match=r"previous\.pt is damaged or none of ours: .*restart=true trains anew"):
        run(short_run(folder))
    assert (folder / CHECKPOINT).exists()


def test_a_run_whose_tables_are_not_those_of_its_checkpoint_does_not_go_on(tmp_path):
    folder = tmp_path / "run"
    run_killed(short_run(folder), 2)
    rows = read_metrics(folder).to_pylist()
    for damaged in (rows[:5], [{**rows[0], "value": 7.0}, *rows[1:]]):
        write_rows(folder / METRICS, damaged, METRIC_SCHEMA)
        with pytest.raises(CheckpointError, match=f"{METRICS} is not that of the checkpoint: restore it"):
            run(short_run(folder))
    (folder / VERSIONS).unlink()
    with pytest.raises(RunFolderError, match=f"there is no {VERSIONS}"):
        run(short_run(folder))


@pytest.mark.slow
def test_a_run_that_stops_in_its_evaluation_is_evaluated_when_it_goes_on(trained_once, tmp_path, monkeypatch):
    with monkeypatch.context() as patch, pytest.raises(Stopped):
        patch.setattr("segar.experiments.training.run.evaluate_run", lambda *_: os.kill(os.getpid(), signal.SIGTERM))
        run(short_run(tmp_path / "run"))
    last = read_journal(tmp_path / "run")[-1]
    assert (last["event"], last["during"]) == ("stopped", "evaluation")
    assert not is_finished(tmp_path / "run")
    run(short_run(tmp_path / "run"))
    assert same_results(tmp_path / "run", trained_once)


def test_frames_are_not_lost_when_a_run_of_one_iteration_is_stopped(tmp_path):
    config = short_run(tmp_path / "run", scale=ScaleConfig(frames=FRAMES))
    with before_iteration(1, send(signal.SIGTERM)), pytest.raises(Stopped):
        run(config)
    assert frames(tmp_path / "run") == FRAMES
    assert run(config).trained


assert ITERATIONS == 4  # the numbers above are written out


KILLS = 10
LONG = (
    *COMMAND,
    "algorithm.num_envs=16",
    "algorithm.anneal=true",
    "scale.frames=25_600",
    "evaluation.interval=6_400",
    "tracking=none",
)


def command(cwd, folder):
    """The process of a longer run, which evaluates now and then."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
    return begin_module("segar.experiments.train", *LONG, f"folder={folder}", cwd=cwd, **pipes)


@pytest.mark.slow
def test_a_run_killed_at_ten_random_moments_ends_as_if_it_had_not_been_killed(tmp_path):
    process = command(tmp_path, tmp_path / "whole")
    said, _ = process.communicate()
    assert process.returncode == 0, said
    duration = read_summary(tmp_path / "whole")["seconds"]
    rng = random.Random(0)
    folder = tmp_path / "killed"
    for _ in range(KILLS):
        process = command(tmp_path, folder)
        begun = len(read_journal(folder))
        while len(read_journal(folder)) == begun and process.poll() is None:
            time.sleep(0.01)  # it imports; from here on there is something to lose
        time.sleep(rng.uniform(0.0, 1.5 * duration / KILLS))
        process.send_signal(signal.SIGKILL)
        process.communicate()
    process = command(tmp_path, folder)
    said, _ = process.communicate()
    assert process.returncode == 0, said
    events = [entry["event"] for entry in read_journal(folder)]
    assert events.count("lost") >= KILLS // 2, "the kills came when the run was over"
    assert same_results(tmp_path / "whole", folder)
