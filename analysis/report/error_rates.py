"""``python -m segar.analysis.report.error_rates``: how often the rules of verdicts err, on planted outcomes.

``error_rates.csv`` has one row per claim, kind of noise and planted effect: how often of ``simulations`` the primary tests
of our metric say each verdict, before specifications, room and Holm's correction. The claims are those of which enough runs
are there, and two whose runs are in training. Their runs are those of a results folder that learned, with their measures of
levels and of representations; the outcomes are drawn. ``noise`` is "even", or "falling" where it is larger for fewer
levels, as that of gaps is. Runs of a training set share half of the variance. Where a correlation compares panels, the runs
of a panel share a third of it, and those of a training set another. Differences have the standard deviation that they have
in the folder. ``planted`` is "nothing", or "the margin": an effect exactly as large as the smallest one that matters. A
claim of an effect must not be supported where nothing is planted, a claim of absence not where the margin is.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from statsmodels.stats.proportion import proportion_confint

from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.evidence import Evidence, clusters_given, design
from segar.analysis.report.claims.reading import planned_of
from segar.analysis.report.claims.rows import ROWS
from segar.analysis.report.claims.statements import STATEMENTS, stated
from segar.analysis.report.claims.tests import StatedTest, differences, finding_of, restricted
from segar.analysis.report.claims.verdicts import (
    NOT_SUPPORTED,
    SUPPORTED,
    UNDECIDED,
    combined,
    is_known,
    of_absence,
    of_effect,
)
from segar.analysis.report.results import BLOCK, PANEL, read_results
from segar.analysis.stats.association import labels
from segar.analysis.stats.correlation import residuals
from segar.analysis.stats.estimate import Estimate
from segar.analysis.stats.resampling import cosine
from segar.analysis.tables import column, keep, write_csv
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.reproduction.experiment_file import SIGNS

EVEN, FALLING = "even", "falling"
NOTHING, AT_MARGIN = "nothing", "the margin"
SEED = 2022
# Shares of the variance: of panels, of training sets, of runs.
WITHIN, OVER_PANELS = (0.0, 1 / 2, 1 / 2), (1 / 3, 1 / 3, 1 / 3)
Draw = Callable[[np.random.Generator, str, bool], Estimate]


def run(
    results: Path = Path("docs/results/standard"), output: Path = Path("docs/results/standard"), simulations: int = 1000
) -> None:
    """Writes ``error_rates.csv`` into the folder ``output``."""
    evidence = Evidence(read_results(results))
    names = [
        name
        for name, words in STATEMENTS["claims"].items()
        if "tests" in words and not planned_of(name, evidence).is_short
    ]
    rows = [row for name in names for row in of_claim(evidence, name, simulations)]
    write_csv(output / "error_rates.csv", pd.DataFrame(rows), 8)


def of_claim(evidence: Evidence, name: str, simulations: int) -> Iterator[dict[str, Any]]:
    """The rows of one claim; none where its tests have no interval, or are of shares of variance or of ranks."""
    words = STATEMENTS["claims"][name]
    runs = ROWS[words["evidence"]](evidence)
    tests = [*stated(name, METRIC_OURS, runs)] if len(runs) else []
    found = [finding_of(evidence, runs, test, METRIC_OURS) for test in tests]
    known = [(test, one) for test, one in zip(tests, found, strict=True) if one and is_known(one.found)]
    if not known or any(test.test in ("explained", "rank") for test, _ in known):
        return
    draws = [(drawing(evidence, runs, test, one.margin), SIGNS[test.expected], one.margin) for test, one in known]
    used = sum(one.found.n for _, one in known)
    for noise in (EVEN, FALLING):
        for planted in (NOTHING, AT_MARGIN):
            said = []
            for k in range(simulations):
                rng = np.random.default_rng([SEED, k])
                estimates = [(draw(rng, noise, planted == AT_MARGIN), sign, margin) for draw, sign, margin in draws]
                said.append(combined(judge(*one) for one in estimates))
            yield row(name, any(sign for _, sign, _ in draws), noise, planted, used, said)
    print(name, flush=True)


def drawing(evidence: Evidence, runs: pd.DataFrame, test: StatedTest, margin: float) -> Draw:
    """What draws the outcome of a test anew and tests it."""
    table, sign = restricted(runs, test.where), SIGNS[test.expected] or 1
    if test.test == "correlation":
        table = keep(table, np.isfinite(column(table, test.of)) & np.isfinite(column(table, test.against)))
        left = residuals(column(table, test.against), design(table, test.given))
        left = left / left.std()
        shares = OVER_PANELS if clusters_given(table, test.given) == PANEL else WITHIN

        def correlated(rng: np.random.Generator, noise: str, at_margin: bool) -> Estimate:
            size = sign * margin * at_margin
            outcome = size * left + np.sqrt(1 - size**2) * noise_of(table, rng, noise, shares)
            drawn = table.assign(outcome=outcome)
            if list(test.given) != ["cell"]:
                return evidence.correlation(drawn, test.against, "outcome", test.given)
            cells = np.unique(table["cell"], return_inverse=True)[
                1
            ]  # deviations from means: least squares take 100 times as long
            values = np.column_stack([column(drawn, test.against), outcome, cells])
            return evidence.by_blocks(drawn, values, within, clusters_given(table, test.given), correlation=True)

        return correlated
    if test.test == "slope":
        table = keep(table, np.isfinite(column(table, test.of)) & np.isfinite(column(table, test.against)))
        against, left = column(table, test.against), residuals(column(table, test.of), design(table, test.given))

        def sloping(rng: np.random.Generator, noise: str, at_margin: bool) -> Estimate:
            outcome = sign * margin * at_margin * against + left.std() * noise_of(table, rng, noise, WITHIN)
            return evidence.slope(table.assign(outcome=outcome), test.against, "outcome", test.given)

        return sloping
    name = "difference" if test.between else test.of
    table = differences(table, test.of, test.between, test.same) if test.between else table
    table = keep(table, np.isfinite(column(table, name)))
    deviation = float(column(table, name).std(ddof=1))

    def differing(rng: np.random.Generator, noise: str, at_margin: bool) -> Estimate:
        outcome = sign * margin * at_margin + deviation * noise_of(table, rng, noise, WITHIN)
        return evidence.mean(table.assign(outcome=outcome), "outcome")

    return differing


def noise_of(table: pd.DataFrame, rng: np.random.Generator, kind: str, shares: Sequence[float]) -> np.ndarray:
    """Noise of mean 0 and variance 1, float64 ``[rows]``, of which the runs of a panel and of a training set share parts."""
    panel, block = (np.unique(labels(table, names), return_inverse=True)[1] for names in (PANEL, BLOCK))
    parts = (
        rng.normal(size=panel.max() + 1)[panel],
        rng.normal(size=block.max() + 1)[block],
        rng.normal(size=len(table)),
    )
    drawn = sum((np.sqrt(share) * part for share, part in zip(shares, parts, strict=True)), np.zeros(len(table)))
    scale = 1 / np.sqrt(column(table, "n")) if kind == FALLING and "n" in table else np.ones(len(table))
    return drawn * scale / np.sqrt(np.square(scale).mean())


def within(values: np.ndarray) -> float:
    """The correlation of the first two columns within the groups that the third one numbers."""
    groups = values[:, 2].astype(np.int64)
    counts = np.maximum(np.bincount(groups), 1)
    return cosine(*(one - (np.bincount(groups, one) / counts)[groups] for one in values[:, :2].T))


def judge(found: Estimate, sign: int, margin: float) -> str:
    """The verdict on a claimed effect of that sign, or with 0 on a claimed absence."""
    return of_effect(found, sign, margin) if sign else of_absence(found, margin)


def row(claim: str, effect: bool, noise: str, planted: str, runs: int, said: Sequence[str]) -> dict[str, Any]:
    """The shares of verdicts, and the Wilson interval of the share that is supported."""
    counted = Counter(said)
    ends: Any = proportion_confint(counted[SUPPORTED], len(said), method="wilson")
    low, high = (round(float(end), 12) for end in ends)
    shares = {name: counted[name] / len(said) for name in (SUPPORTED, NOT_SUPPORTED, UNDECIDED)}
    head = {"claim": claim, "claimed": "an effect" if effect else "absence", "noise": noise, "planted": planted}
    return {**head, **shares, "low": low, "high": high, "runs": runs, "simulations": len(said)}


if __name__ == "__main__":
    run_from_command_line(run)
