"""``python -m analysis.studies.baselines --output DIR``: what chance, nobody, a script and a planner achieve in each panel.

``anchors.csv`` has for each panel and player the mean full return, its standard error over levels, success and steps. A
normalised score is (return - random) / (oracle - random).
"""

from __future__ import annotations

import argparse
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.tables import write_csv
from experiments.evaluation.baselines import IdleAgent
from experiments.evaluation.episodes import play_episodes
from segar.hardness import hardness
from segar.levels import DIFFICULTIES, family

FAMILIES = ("empty", "objectsx1", "tilesx1")
PLAYS = 20  # random episodes per level
SAMPLES, ITERATIONS = 64, 5  # of the planner, per level


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser("python -m analysis.studies.baselines", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("anchors"), help="folder for the table")
    parser.add_argument("--levels", type=int, default=100, help="test levels of each panel")
    chosen = parser.parse_args()
    rows = [row for place in product(FAMILIES, DIFFICULTIES) for row in players(*place, chosen.levels)]
    write_csv(chosen.output / "anchors.csv", pd.DataFrame(rows))


def players(kind: str, difficulty: str, count: int) -> list[dict[str, Any]]:
    """One row per player on ``count`` test levels of a panel."""
    levels = family(f"{kind}-{difficulty}").sample(count, seed=0, split="test")
    found = hardness(levels, rng=np.random.default_rng(0), plays=PLAYS, samples=SAMPLES, iterations=ITERATIONS)
    idle = play_episodes(IdleAgent(), levels, np.arange(count), {}, rng=None, seed=0)
    episodes = {
        "idle": ([r["return"] for r in idle], [r["success"] for r in idle]),
        "random": (found.random_return, found.random_success),
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


if __name__ == "__main__":
    main()
