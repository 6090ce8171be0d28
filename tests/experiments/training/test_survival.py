"""Nothing is lost but the work since the last checkpoint: runs killed at random moments, and a real server that goes away."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from experiments.runs.journal import read_journal
from experiments.runs.run_folder import CHECKPOINT, read_summary
from experiments.settings import CHECKOUT
from experiments.training.run import run
from experiments.upload import UploadConfig, upload
from tests.experiments.short_runs import before_iteration, same_results
from tests.experiments.tracking.mlflow_server import MLflowServer, in_folder, logged, long_run

pytestmark = pytest.mark.slow

KILLS = 10
LONG = (
    "levels=empty-easy",
    "levels.count=2",
    "levels.test_count=3",
    "algorithm=ppo_fast",
    "algorithm.num_envs=16",
    "algorithm.num_steps=8",
    "scale.frames=25_600",
    "evaluation.interval=6_400",
    "evaluation.episodes=2",
    "evaluation.distances=[exact]",
    "checkpoint_interval=0",
    "progress=false",
    "tracking=none",
)


def command(cwd, folder):
    return subprocess.Popen(
        [sys.executable, "-m", "experiments.train", *LONG, f"folder={folder}"],
        cwd=cwd, env={**os.environ, "PYTHONPATH": str(CHECKOUT)}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
    )  # fmt: skip


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


def test_the_same_command_gives_the_same_bits_twice(tmp_path):
    for name in ("a", "b"):
        process = command(tmp_path, tmp_path / name)
        said, _ = process.communicate()
        assert process.returncode == 0, said
    assert same_results(tmp_path / "a", tmp_path / "b")


@pytest.fixture
def server(tmp_path):
    (tmp_path / "server").mkdir()
    server = MLflowServer(tmp_path / "server")
    server.start()
    yield server
    server.stop()


def test_a_server_that_is_stopped_and_started_while_a_run_goes_on_has_all_of_it_in_the_end(tmp_path, server, capfd):
    """Stopped before iteration 5; the run goes on, is told once, and the server is up again before iteration 35."""
    config = long_run(tmp_path, server.uri)
    with (
        pytest.MonkeyPatch.context() as patch,
        before_iteration(5, lambda _: server.stop(), patch),
        before_iteration(20, lambda _: time.sleep(3), patch),
        before_iteration(35, lambda _: server.start(), patch),
    ):
        folder = run(config).folder
    one, files, history = logged(server.uri, "loss/policy")
    assert history == in_folder(folder, "loss/policy") and len(history) == 40
    assert one.info.status == "FINISHED"
    assert files == ["episodes.parquet", "summary.json"]
    assert capfd.readouterr().err.count("The run goes on; what MLflow misses is sent when it answers again") == 1


def test_a_server_that_stays_away_gets_the_run_by_a_command(tmp_path, server, capfd):
    with pytest.MonkeyPatch.context() as patch, before_iteration(5, lambda _: server.stop(), patch):
        folder = run(long_run(tmp_path, server.uri)).folder
    assert f"this sends them: python -m experiments.upload run={folder}" in capfd.readouterr().err
    server.start()
    upload(UploadConfig(run=str(folder)))
    one, files, history = logged(server.uri, "loss/policy")
    assert history == in_folder(folder, "loss/policy") and len(history) == 40
    assert (one.info.status, files) == ("FINISHED", ["episodes.parquet", "summary.json"])


def test_a_run_that_begins_without_its_server_is_trained_all_the_same(tmp_path, server):
    server.stop()
    folder = run(long_run(tmp_path, server.uri)).folder
    assert (folder / CHECKPOINT).exists()
    server.start()
    upload(UploadConfig(run=str(folder)))
    assert logged(server.uri, "loss/policy")[2] == in_folder(folder, "loss/policy")
