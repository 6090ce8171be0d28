"""Nothing is lost but the work since the last checkpoint: a run that is killed at random moments."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import read_summary
from segar.support import WORKSPACE
from tests.experiments.short_runs import same_results

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
        [sys.executable, "-m", "segar.experiments.train", *LONG, f"folder={folder}"],
        cwd=cwd, env={**os.environ, "PYTHONPATH": str(WORKSPACE)}, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
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
