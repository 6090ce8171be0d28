"""Runs of a second, ways to end them, and what two of them have in common."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import torch

from segar.experiments.algorithms.checkpoint import read_checkpoint
from segar.experiments.runs.run_folder import CHECKPOINT, read_episodes, read_metrics
from segar.experiments.settings import EvaluationConfig, LevelsConfig, PPOConfig, RunConfig, ScaleConfig, TrackingConfig
from segar.experiments.training.run import run
from segar.experiments.training.training_loop import Training
from segar.support import WORKSPACE

FRAMES = 64  # of an iteration
ITERATIONS = 4
# The same on the command line.
COMMAND = (
    "levels=empty-easy",
    "levels.count=2",
    "levels.test_count=3",
    "algorithm=ppo",
    "algorithm.num_envs=8",
    "algorithm.num_steps=8",
    "algorithm.widths=[8]",
    "algorithm.head_width=0",
    f"scale.frames={FRAMES * ITERATIONS}",
    "evaluation.episodes=2",
    "evaluation.distances=[exact]",
    "checkpoint_interval=0",
    "progress=false",
)


def run_module(module, *arguments, cwd=WORKSPACE, **environment):
    """What ``python -m <module>`` does in a working directory, where a user's modules may lie: the process, which has ended."""
    return subprocess.run(**_as_module(module, arguments, cwd, environment), capture_output=True)


def begin_module(module, *arguments, cwd=WORKSPACE, stdout=None, stderr=None, **environment):
    """The process of ``python -m <module>``, which has begun in a session of its own."""
    asked = _as_module(module, arguments, cwd, environment)
    return subprocess.Popen(**asked, stdout=stdout, stderr=stderr, start_new_session=True)


def _as_module(module, arguments, cwd, environment):
    """How a process is asked to run a module."""
    paths = {"PYTHONPATH": f"{WORKSPACE}{os.pathsep}{cwd}"}
    command = [sys.executable, "-m", module, *arguments]
    return {"args": command, "cwd": cwd, "env": {**os.environ, **paths, **environment}, "text": True}


def short_run(folder: Path, **changes: Any) -> RunConfig:
    """A run of four iterations, each with a checkpoint."""
    settings = {
        "levels": LevelsConfig(train="empty-easy", count=2, test_count=3),
        "algorithm": PPOConfig(num_envs=8, num_steps=8, widths=(8,), head_width=0),
        "scale": ScaleConfig(frames=FRAMES * ITERATIONS),
        "evaluation": EvaluationConfig(episodes=2, distances=("exact",)),
        "tracking": TrackingConfig(name="none"),
        "folder": str(folder),
        "checkpoint_interval": 0.0,
        "progress": False,
    }
    return RunConfig(**{**settings, **changes})


class Killed(BaseException):
    """What stops a run in these tests."""


def run_killed(config, iterations, say=print):
    """Runs until iteration ``iterations + 1`` would begin, where training ends abruptly."""
    with before_iteration(iterations + 1, stop), pytest.raises(Killed):
        run(config, say)


@contextmanager
def before_iteration(number, happens):
    """Has ``happens(learner)`` happen before iteration ``number``, counted from 1, of runs in here."""
    iterate = Training.iterate

    def look_first(self):
        if self.learner.frames == (number - 1) * FRAMES:
            happens(self.learner)
        return iterate(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Training, "iterate", look_first)
        yield


def stop(*_):
    raise Killed


def weights(folder):
    return read_checkpoint(folder / CHECKPOINT)["policy"]


def figures(folder):
    """What a run logged, but for what the clock said."""
    rows = read_metrics(folder).to_pylist()
    return [(row["name"], row["frames"], row["value"]) for row in rows if row["name"] != "speed/frames_per_second"]


def same_results(a, b):
    """Whether two run folders have the same weights, figures and evaluation, to the bit."""
    found, expected = weights(a), weights(b)
    equal = found.keys() == expected.keys() and all(torch.equal(value, expected[name]) for name, value in found.items())
    return equal and figures(a) == figures(b) and read_episodes(a).equals(read_episodes(b))
