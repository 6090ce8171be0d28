"""``python -m segar.analysis.studies.baselines --output DIR``: what four players achieve in each panel.

The random, the idle, the scripted and the planning player need no training.

``anchors.csv`` has for each panel and player the mean full return, its standard error over levels, and success. The row
``floor`` is of the better of idle and random play on each level, of the larger return and of the larger success. A
normalised score is (return - floor) / (oracle - floor), and the regret is oracle - return.
"""

from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.tables import write_csv
from segar.evaluation import Idle, play_episodes
from segar.experiments.commands.command_line import run_from_command_line
from segar.hardness import Hardness, hardness
from segar.language import Task
from segar.levels import DIFFICULTIES, Levels, family

FAMILIES = ("empty", "objectsx1", "tilesx1", "hazardtilesx1")
PANELS = (*product(FAMILIES, DIFFICULTIES), ("billiards", ""), ("invisiball", ""))
PLAYS = 20  # random episodes per level
SAMPLES, ITERATIONS = 64, 5  # of the planner, per level


def run(output: Path = Path("anchors"), levels: int = 100) -> None:
    """Writes ``anchors.csv`` into the folder ``output``, from so many test levels of each panel."""
    rows = [row for panel in PANELS for row in players(*panel, levels)]
    write_csv(output / "anchors.csv", pd.DataFrame(rows))


def players(kind: str, difficulty: str, count: int) -> list[dict[str, Any]]:
    """One row per player, and the row ``floor``, on ``count`` test levels of a panel."""
    levels = family(f"{kind}-{difficulty}".removesuffix("-")).sample(count, seed=0, split="test")
    found = hardness_of(levels)
    idle = play_episodes(levels, np.arange(count), Idle(), seed=0)
    alone = idle.returns, idle.success.astype(float)
    chance = found.random_return, found.random_success
    episodes = {
        "idle": alone,
        "random": chance,
        "floor": tuple(np.maximum(*both) for both in zip(alone, chance, strict=True)),
        "oracle": (found.oracle.returns, found.oracle.solved),
    }
    if found.scripted is not None:
        episodes["script"] = (found.scripted.returns, found.scripted.solved)
    rows = []
    for player, (returns, success) in episodes.items():
        values = np.asarray(returns, float)
        error = float(values.std(ddof=1) / np.sqrt(count)) if count > 1 else float("nan")
        place = {"family": kind, "difficulty": difficulty, "player": player, "levels": count}
        rows.append({**place, "return": values.mean(), "return_se": error, "success": float(np.mean(success))})
    return rows


def hardness_of(levels: Levels, task: Task | None = None) -> Hardness:
    """Episodes of the random, the scripted and the planning player on each level, in the levels' task or another."""
    rng = np.random.default_rng(0)
    return hardness(levels, task, rng=rng, plays=PLAYS, samples=SAMPLES, iterations=ITERATIONS)


if __name__ == "__main__":
    run_from_command_line(run)
