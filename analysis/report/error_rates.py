"""``python -m analysis.report.error_rates --output DIR``: how often the rules of verdicts err, on planted data.

``error_rates.csv`` has one row per claim, kind of noise and planted effect: how often of ``simulations`` the primary test
of ``analysis/report/rules.yaml`` says each verdict. The training and test levels are those of the shipped scale, so W2 is
real; gaps and accuracies are drawn. ``noise`` is "even", or "falling" where it is larger for fewer levels, as that of gaps
is. Runs of a training set share half of the variance. Where a correlation compares panels, the runs of a panel share a
third of it, and those of a training set another. ``planted`` is "nothing", or "the margin": a relation exactly as large as
the smallest one that matters. A claim of an effect must not be supported where nothing is planted, a claim of absence not
where the margin is.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from analysis.report.claims.evidence import clusters_given, design, partial
from analysis.report.claims.verdicts import NOT_SUPPORTED, SUPPORTED, UNDECIDED, of_absence, of_effect
from analysis.report.results import BLOCK, PANEL
from analysis.report.rules import MARGINS
from analysis.stats.association import labels
from analysis.stats.correlation import residuals
from analysis.stats.estimate import Estimate
from analysis.stats.resampling import cluster_jackknife
from analysis.studies.training_sets import COUNTS, FAMILIES, FIRST_SEED, TEST_LEVELS, TEST_SEED
from analysis.tables import column, write_csv
from experiments.commands.command_line import run_from_command_line
from segar.levels import DIFFICULTIES, family
from segar.metrics import w2

EVEN, FALLING = "even", "falling"
NOISES = (EVEN, FALLING)
NOTHING, AT_MARGIN = "nothing", "the margin"
PLANTED = (NOTHING, AT_MARGIN)
SEED = 2022
# Shares of the variance: of panels, of training sets, of runs.
WITHIN, OVER_PANELS = (0.0, 1 / 2, 1 / 2), (1 / 3, 1 / 3, 1 / 3)
SD = 0.1  # of a difference in success between matched sets of one seed
# The claims with the columns that are given, the x whose relation to the gap is claimed, and its sign; 0 claims none.
CORRELATIONS: Mapping[str, tuple[tuple[str, ...], str, int]] = {
    "3a": ((), "w2", -1),
    "3a-panel": (("panel",), "w2", -1),
    "3a-n": (("panel", "levels"), "w2", -1),
    "3a-cell": (("cell",), "w2", -1),
    "4b-none": (("panel", "levels"), "accuracy", 0),
}
MATCHED_FAMILIES, MATCHED_COUNTS = ("empty", "objectsx1", "hazardtilesx1"), (10, 50)
# Pairs of sets that differ in one measure, per seed: with the other measure as in independent sets, and far.
MATCHED_PAIRS = 2


def run(output: Path = Path("error_rates"), simulations: int = 1000, seeds: int = 6, seeds_matched: int = 10) -> None:
    """Writes ``error_rates.csv`` into the folder ``output``."""
    grid = main_grid(seeds)
    rows = [*of_correlations(grid, simulations), *of_matched_sets(seeds_matched, simulations)]
    write_csv(output / "error_rates.csv", pd.DataFrame(rows), 8)


def main_grid(seeds: int) -> pd.DataFrame:
    """The cells of the main grid with the exact W2 of each training set."""
    rows: list[dict[str, Any]] = []
    for kind, difficulty in product(FAMILIES, DIFFICULTIES):
        dist = family(f"{kind}-{difficulty}")
        test = dist.sample(TEST_LEVELS, seed=TEST_SEED, split="test")
        for n, seed in product(COUNTS, range(FIRST_SEED, FIRST_SEED + seeds)):
            distance = w2(dist.sample(n, seed=seed), test, mode="exact")
            rows.append({"family": kind, "difficulty": difficulty, "n": n, "seed": seed, "w2": float(distance)})
    table = pd.DataFrame(rows)
    panel = table["family"] + "-" + table["difficulty"]
    return table.assign(panel=panel, levels=table["n"].astype(str), cell=panel + "-" + table["n"].astype(str))


def of_correlations(grid: pd.DataFrame, simulations: int) -> Iterator[dict[str, Any]]:
    """The rows of the claims about correlations."""
    for (claim, (given, x, sign)), noise, planted in product(CORRELATIONS.items(), NOISES, PLANTED):
        margin = MARGINS["correlation"]
        size = (sign or 1) * margin if planted == AT_MARGIN else 0.0
        one = Relation(grid, x, given, size, noise)
        yield row(
            claim, sign, noise, planted, len(grid), [judge(one.found(k), sign, margin) for k in range(simulations)]
        )


def of_matched_sets(seeds: int, simulations: int) -> Iterator[dict[str, Any]]:
    """The rows of the two claims about matched sets: a mean difference in success, over families, n, pairs and seeds."""
    places = product(MATCHED_FAMILIES, MATCHED_COUNTS, range(MATCHED_PAIRS), range(FIRST_SEED, FIRST_SEED + seeds))
    grid = pd.DataFrame(places, columns=["family", "n", "pair", "seed"]).assign(difficulty="medium")
    for noise, planted in product(NOISES, PLANTED):
        margin = MARGINS["success"]
        size = -margin if planted == AT_MARGIN else 0.0
        found = []
        for k in range(simulations):
            values = size + SD * noise_of(grid, np.random.default_rng([SEED, k]), noise)
            found.append(cluster_jackknife(grid, np.mean, BLOCK, values=values))
        said = [judge(one, -1, margin) for one in found]
        yield row("matched-w2, matched-coverage", -1, noise, planted, len(grid), said)


@dataclass(frozen=True)
class Relation:
    """Gaps that have a partial correlation of ``size`` with ``x``, but for noise, given some columns."""

    grid: pd.DataFrame
    x: str  # a column of the grid, or what is drawn like noise
    given: Sequence[str]
    size: float
    noise: str

    def found(self, seed: int) -> Estimate:
        """The primary test on gaps that are drawn anew."""
        rng, shares = np.random.default_rng([SEED, seed]), WITHIN if self.given else OVER_PANELS
        x = column(self.grid, self.x) if self.x in self.grid else noise_of(self.grid, rng, EVEN, shares)
        covariates = design(self.grid, self.given)
        left = residuals(x, covariates)
        gaps = self.size * left / left.std() + np.sqrt(1 - self.size**2) * noise_of(self.grid, rng, self.noise, shares)
        values = np.column_stack([x, gaps, covariates])
        clusters = clusters_given(self.grid, self.given)
        return cluster_jackknife(self.grid, partial, clusters, values=values, correlation=True)


def noise_of(grid: pd.DataFrame, rng: np.random.Generator, kind: str, shares: Sequence[float] = WITHIN) -> np.ndarray:
    """Noise of mean 0 and variance 1, float64 ``[runs]``, of which the runs of a panel and of a training set share parts."""
    panel, block = (np.unique(labels(grid, names), return_inverse=True)[1] for names in (PANEL, BLOCK))
    parts = rng.normal(size=panel.max() + 1)[panel], rng.normal(size=block.max() + 1)[block], rng.normal(size=len(grid))
    drawn = sum((np.sqrt(share) * part for share, part in zip(shares, parts, strict=True)), np.zeros(len(grid)))
    scale = 1 / np.sqrt(column(grid, "n")) if kind == FALLING else np.ones(len(grid))
    return drawn * scale / np.sqrt(np.square(scale).mean())


def judge(found: Estimate, sign: int, margin: float) -> str:
    """The verdict on a claimed effect of that sign, or with 0 on a claimed absence."""
    return of_effect(found, sign, margin) if sign else of_absence(found, margin)


def row(claim: str, sign: int, noise: str, planted: str, runs: int, said: Sequence[str]) -> dict[str, Any]:
    """The shares of verdicts, and the Wilson interval of the share that is supported."""
    counted = Counter(said)
    ends: Any = proportion_confint(counted[SUPPORTED], len(said), method="wilson")
    low, high = (round(float(end), 12) for end in ends)
    shares = {name: counted[name] / len(said) for name in (SUPPORTED, NOT_SUPPORTED, UNDECIDED)}
    head = {"claim": claim, "claimed": "an effect" if sign else "absence", "noise": noise, "planted": planted}
    return {**head, **shares, "low": low, "high": high, "runs": runs, "simulations": len(said)}


if __name__ == "__main__":
    run_from_command_line(run)
