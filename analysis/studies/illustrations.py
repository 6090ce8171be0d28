"""``python -m analysis.studies.illustrations --output DIR``: the tables of the appendix's illustrations.

``densities.csv``  the density of initial factors of a panel: a histogram of levels (probability per unit)
``ks.csv``         distribution functions of a factor in n levels and in its distribution, and where they differ most
``w2.csv``         which training level goes to which test level in the optimal matching of two small sets, and how far
"""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy.optimize import linear_sum_assignment

from analysis.tables import write_csv
from experiments.commands.command_line import run_from_command_line
from segar.language import Factor, GoalTile, GolfBall, Position
from segar.levels import Levels, family
from segar.metrics import ks_by_factor, spread, w2

PANEL = "empty-hard"
POINTS = 201
BINS = 20
KS_COUNTS = (10, 100)
MATCHED = 12  # levels on each side of the matching
DENSITY_LEVELS = 2000
NAMES = {GolfBall: "GolfBall", GoalTile: "GoalTile"}


def run(output: Path = Path("illustrations")) -> None:
    """Writes the three tables into the folder ``output``."""
    for name, rows in {"densities": densities(), "ks": ks_curves(), "w2": matching()}.items():
        write_csv(output / f"{name}.csv", pd.DataFrame(rows))


def densities() -> list[dict[str, Any]]:
    """Histograms of places along x and y, in levels of the three difficulties of the empty family."""
    rows = []
    for difficulty in ("easy", "medium", "hard"):
        levels = family(f"empty-{difficulty}").sample(DENSITY_LEVELS, seed=0)
        for entity in NAMES:
            for axis in (0, 1):
                x = place_of(levels, entity, axis)
                density, edges = np.histogram(x, bins=BINS, range=(-1.0, 1.0), density=True)
                where = {"panel": f"empty-{difficulty}", "factor": f"{NAMES[entity]}.Position.{'xy'[axis]}"}
                rows += [
                    {**where, "low": a, "high": b, "density": d}
                    for a, b, d in zip(edges, edges[1:], density, strict=False)
                ]
    return rows


def ks_curves() -> list[dict[str, Any]]:
    """Distribution functions of the ball's x in n levels and in the panel, with the KS statistic of this factor."""
    dist = family(PANEL)
    at = np.linspace(-1.0, 1.0, POINTS)
    rows = []
    for n in KS_COUNTS:
        levels = dist.sample(n, seed=0)
        x = np.sort(levels.sampled_values[:, *column_of(levels, GolfBall, Position, 0)])
        statistic = ks_by_factor(levels, dist)["GolfBall.Position.x"]
        of_sample = np.searchsorted(x, at, side="right") / n
        rows += [
            {"n": n, "x": a, "sample": f, "law": cdf_of_x(a), "ks": statistic}
            for a, f in zip(at, of_sample, strict=True)
        ]
    return rows


def cdf_of_x(x: float) -> float:
    """The distribution function of a coordinate that is uniform between the margins of the arena."""
    return float(np.clip((x + 0.95) / 1.9, 0.0, 1.0))


def matching() -> list[dict[str, Any]]:
    """The optimal matching of as many training as test levels; the root of the mean squared cost is W2."""
    dist = family(PANEL)
    a, b = dist.sample(MATCHED, seed=1, split="train"), dist.sample(MATCHED, seed=1, split="test")
    unit = spread(dist)
    costs = np.array([[w2(x, y, scale=unit) ** 2 for y in b] for x in a])
    from_levels, to_levels = linear_sum_assignment(costs)
    whole = float(w2(a, b, scale=unit))
    rows = []
    for i, j in zip(from_levels, to_levels, strict=True):
        row: dict[str, Any] = {"train_level": int(i), "test_level": int(j)}
        row |= {"distance": float(np.sqrt(costs[i, j])), "w2": whole}
        for name, levels, level in (("train", a, i), ("test", b, j)):
            for entity, word in NAMES.items():
                for axis in (0, 1):
                    row[f"{name}_{word.lower()}_{'xy'[axis]}"] = float(place_of(levels, entity, axis)[level])
        rows.append(row)
    return rows


def place_of(levels: Levels, entity: type, axis: int) -> np.ndarray:
    """A coordinate of the entity at the start of each level, float64 ``[level]``."""
    slot, column = column_of(levels, entity, Position, axis)
    return levels.values[:, slot, column]


def column_of(levels: Levels, entity: type, factor: type[Factor], axis: int) -> tuple[int, int]:
    """Slot and column of a component of a factor of the first entity of a type."""
    slot = next(k for k, s in enumerate(levels.layout.slots) if entity in s.types)
    return slot, levels.layout.columns[factor] + axis


if __name__ == "__main__":
    run_from_command_line(run)
