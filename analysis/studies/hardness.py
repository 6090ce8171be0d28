"""``python -m analysis.studies.hardness --output DIR``: how hard conditions on the reward make levels, before any training.

``hardness.csv`` has for each number of conditions the success of a random policy, of the scripted player and of the
planner, with Wilson intervals, and the steps that the planner needs.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from analysis.tables import write_csv
from experiments.levels.conditions import CONDITIONS, conditional_puttputt
from experiments.levels.variations import vary
from segar.hardness import hardness
from segar.levels import family

PANEL = "empty-hard"
PLAYS = 20  # random episodes per level
SAMPLES, ITERATIONS = 64, 5  # of the planner, per level
MOST_WITHOUT_ALL = 2  # so few levels are for trying things out: then one number of conditions is enough


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser("python -m analysis.studies.hardness", description=__doc__)
    parser.add_argument("-o", "--output", type=Path, default=Path("hardness"), help="folder for the table")
    parser.add_argument("--levels", type=int, default=100, help="test levels")
    chosen = parser.parse_args()
    numbers = [1] if chosen.levels <= MOST_WITHOUT_ALL else range(CONDITIONS + 1)
    rows = [{"conditions": k, **hardness_with(k, chosen.levels)} for k in numbers]
    write_csv(chosen.output / "hardness.csv", pd.DataFrame(rows))


def hardness_with(conditions: int, count: int) -> dict[str, Any]:
    """Success of chance, script and planner on ``count`` test levels, and the planner's steps."""
    levels = vary(family(PANEL), "conditions", "variation").sample(count, seed=0, split="test")
    found = hardness(
        levels,
        conditional_puttputt(conditions),
        rng=np.random.default_rng(0),
        plays=PLAYS,
        samples=SAMPLES,
        iterations=ITERATIONS,
    ).summary()
    row: dict[str, Any] = {"panel": PANEL, "levels": count, "oracle_steps": found["oracle_steps"]}
    for player in ("random", "scripted", "oracle"):
        low, high = found[f"{player}_success_95"]
        row |= {f"{player}_success": found[f"{player}_success"], f"{player}_low": low, f"{player}_high": high}
    return row


if __name__ == "__main__":
    main()
