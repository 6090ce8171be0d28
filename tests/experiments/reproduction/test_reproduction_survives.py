"""A reproduction that is killed twice on the way ends with the tables of one that nobody disturbed."""

import os
import signal
import subprocess
import sys

import pandas as pd
import pytest

from experiments.reproduce import ReproduceConfig, reproduce
from experiments.reproduction.experiment_file import GridConfig
from experiments.reproduction.grid import grid_runs
from experiments.runs.run_folder import CHECKPOINT, folder_path, is_finished, is_locked
from experiments.settings import EvaluationConfig, LevelsConfig, PPOConfig, RunConfig, ScaleConfig, TrackingConfig
from tests.places import ROOT
from tests.waiting import until

OF_THE_CLOCK = ["hours", "finished"]  # columns that say when and how long
MAIN = {
    "title": "Two cells, and the same in another physics",
    "grid": {"algorithms": ["base"]},
    "transfers": [{"variation": "friction_0.8"}],
    "scales": {"smoke": {}},
}


def asked(root):
    run = RunConfig(
        levels=LevelsConfig(test_count=5),
        algorithm=PPOConfig(num_envs=8, num_steps=8, widths=(8,), head_width=0),
        scale=ScaleConfig("smoke", 64 * 100, families=("empty",), difficulties=("easy",), counts=(2, 4)),
        evaluation=EvaluationConfig(episodes=4, distances=("exact", "reference")),
        tracking=TrackingConfig(name="none"),
        seed=1,
        root=str(root),
        checkpoint_interval=0.0,
        progress=False,
    )
    return ReproduceConfig(run, processes=1, grids={"main": MAIN}, report=False)


def started(root):
    """A reproduction in a process of its own, with all that it starts in one group."""
    script = root / "owner.py"
    script.write_text(
        "from pathlib import Path\n"
        "from tests.experiments.reproduction.test_reproduction_survives import asked, reproduce\n"
        f"if __name__ == '__main__': reproduce(asked(Path({str(root)!r})))\n"
    )
    return subprocess.Popen(
        [sys.executable, script], env={**os.environ, "PYTHONPATH": str(ROOT)}, start_new_session=True
    )


def killed_when(root, holds):
    """Starts a reproduction and kills it and all its processes, without a word, at this moment."""
    owner = started(root)
    until(lambda: holds() or owner.poll() is not None)
    os.killpg(owner.pid, signal.SIGKILL)
    assert owner.wait() == -signal.SIGKILL
    first, second = folders(root)
    until(lambda: not any(folder.exists() and is_locked(folder) for folder in (first, second)))


def folders(root):
    return [folder_path(run) for run in grid_runs(GridConfig(), asked(root).run)]


@pytest.fixture
def tables(tmp_path):
    """The tables of a reproduction that was killed twice, and of one that was not, by name."""
    killed, undisturbed = tmp_path / "killed", tmp_path / "undisturbed"
    for root in (killed, undisturbed):
        root.mkdir()
    first, second = folders(killed)
    killed_when(killed, (first / CHECKPOINT).exists)
    assert not is_finished(first)
    killed_when(killed, (second / CHECKPOINT).exists)
    assert is_finished(first) and not is_finished(second)
    for root in (killed, undisturbed):
        reproduce(asked(root))
    return [
        {
            name: pd.read_parquet(asked(root).folder / f"{name}.parquet")
            for name in ("runs", "transfers", "levels", "curves")
        }
        for root in (killed, undisturbed)
    ]


@pytest.mark.slow  # 30 s of processor time, nearly all of it imports of eight processes
def test_killed_twice_it_ends_with_the_same_tables(tables):
    killed, undisturbed = tables
    assert len(undisturbed["runs"]) == len(undisturbed["transfers"]) == 2
    for name, table in undisturbed.items():
        clock = [column for column in OF_THE_CLOCK if column in table]
        pd.testing.assert_frame_equal(killed[name].drop(columns=clock), table.drop(columns=clock), check_exact=True)
