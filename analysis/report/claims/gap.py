"""The tests of the claims about the gap and W2: figures 3a, 3b and 4a, and what the paper did not run."""

import dataclasses
from collections.abc import Callable, Iterator
from functools import partial

import pandas as pd

from analysis.report.claims import verdicts
from analysis.report.claims.claim import CORRECTED, PAPER, Finding, effect, mean_difference, with_holm
from analysis.report.claims.evidence import GIVEN_CELL, Evidence, pearson
from analysis.report.results import paired
from analysis.stats.estimate import Estimate
from analysis.tables import count_of, keep, select

R = "Pearson r"
PARTIAL = "partial Pearson r"
WORSE = -1  # the sign of the claimed effect: the gap falls where W2 rises
# Each reading's settings, mode of W2 and column of the gap.
SETTINGS = ((PAPER, "reference", "gap_2022"), (CORRECTED, "exact", "gap"))
WORDS = {PAPER: "W2 and returns of 2022", CORRECTED: "exact W2, full returns"}

of_worse_gap = partial(verdicts.of_effect, sign=WORSE)
of_weak_trend = partial(verdicts.of_insignificance, alpha=verdicts.WEAK)


def several_seeds(evidence: Evidence) -> pd.DataFrame:
    """The main grid if it has two seeds or more, else no rows."""
    return evidence.main if count_of(evidence.main, "seed") > 1 else evidence.main.head(0)


def one_number_of_levels(evidence: Evidence) -> pd.DataFrame:
    """The runs of one number of training levels, if they have several designs; the order of drawing is no such design."""
    table = evidence.results.of("fixed_n")
    table = keep(table, table["design"] != "nuisance_only")
    return table if count_of(table, "design") > 1 else table.head(0)


def pooled(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 3a: the correlation over all runs."""
    paper = evidence.association("reference", "gap_2022", "pooled")
    corrected = evidence.correlation("exact gap pooled", runs, "w2_exact", "gap")
    yield effect(PAPER, "W2 and returns of 2022, all runs pooled", R, paper, WORSE)
    yield effect(CORRECTED, "exact W2, full returns, all runs pooled, by blocks", R, corrected, WORSE)


def controlled(evidence: Evidence, runs: pd.DataFrame, test: str) -> Iterator[Finding]:
    """The partial correlation, with W2 and returns of 2022; and exact, with full returns and the p of a permutation."""
    among = "cells" if test == GIVEN_CELL else "panels"
    paper = evidence.association("reference", "gap_2022", test)
    exact = evidence.association("exact", "gap", test)
    shuffled = evidence.permutation(f"exact gap {test}", runs, "w2_exact", "gap", test)
    corrected = dataclasses.replace(exact, p=shuffled.p, note=f"p of a permutation within {among}")
    yield effect(PAPER, f"W2 and returns of 2022, {test}", PARTIAL, paper, WORSE)
    words = f"exact W2, full returns, {test}; permutation within {among}"
    yield effect(CORRECTED, words, PARTIAL, corrected, WORSE)


def at_one_number(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """What the paper's causal reading predicts where only W2 varies."""
    for settings, mode, gap in SETTINGS:
        found = evidence.correlation(f"fixed n w2_{mode}", runs, f"w2_{mode}", gap, ("panel", "n"))
        yield effect(settings, f"{WORDS[settings]}, at one n, given panel, by blocks", PARTIAL, found, WORSE)


def in_panels(
    evidence: Evidence,
    runs: pd.DataFrame,
    judge: Callable[[Estimate], str],
    difficulties: tuple[str, ...] = (),
    families: tuple[str, ...] = (),
) -> Iterator[Finding]:
    """Figure 3b: the correlation in each panel of some difficulties or families by itself; ``judge`` gives the verdict."""
    places = [(panel, *panel.rsplit("-", 1)) for panel in evidence.results.panels]
    panels = [p for p, f, d in places if (not difficulties or d in difficulties) and (not families or f in families)]
    for settings, mode, gap in SETTINGS:
        for panel in panels:
            found = evidence.association(mode, gap, "within", panel, corrected=settings == CORRECTED)
            yield Finding(settings, f"{panel}, {WORDS[settings]}", R, found, judge(found))


def in_empty(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Figure 3b: the trend in the family Empty, given the difficulty."""
    part = select(runs, family="empty")
    for settings, mode, gap in SETTINGS if len(part) else ():
        words, x = f"empty, {WORDS[settings]}, given difficulty", f"w2_{mode}"
        found = pearson(part, x, gap, ("difficulty",))
        if settings == CORRECTED:
            found = dataclasses.replace(found, p=evidence.permutation(f"empty {x}", part, x, gap).p)
            words += "; permutation within panels"
        yield effect(settings, words, PARTIAL, found, WORSE)


def larger_on_harder_levels(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a: the gap on harder levels beside the gap of the same agent on its own test levels."""
    for settings, _, gap in SETTINGS:
        words = f"gap on harder levels less the own gap, {WORDS[settings]}"
        yield from mean_difference(evidence, settings, words, paired(harder, evidence.main, gap, ["run"]), WORSE)


def cost_of_shift(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a, once the difficulty of the levels themselves is taken out: agents beside those trained where they are
    tested."""
    at, there = ["test_family", "test_difficulty", "n", "seed"], ["family", "difficulty", "n", "seed"]
    differences = paired(harder, evidence.main, "eta_test_deterministic", at, there)
    words = "return on harder levels less that of agents trained there, same n and seed"
    return mean_difference(evidence, CORRECTED, words, differences, WORSE)


def trend_to_hard(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a: the trend from medium to hard."""
    for settings, mode, gap in SETTINGS:
        parts = {family: select(harder, family=family, difficulty="medium") for family in ("empty", "objectsx1")}
        found = {family: pearson(part, f"w2_{mode}", gap) for family, part in parts.items() if len(part)}
        for family, one in with_holm(settings, found).items():
            yield effect(settings, f"{family}, medium to hard, {WORDS[settings]}", R, one, WORSE)


def within_pairs_of_panels(evidence: Evidence, harder: pd.DataFrame) -> Iterator[Finding]:
    """Figure 4a's caption, which claims more than the text."""
    paper = pearson(harder, "w2_reference", "gap_2022", ("panel",))
    corrected = evidence.correlation("4a exact", harder, "w2_exact", "gap", ("panel", "log_n"))
    yield effect(PAPER, "W2 and returns of 2022, given the pair of panels", PARTIAL, paper, WORSE)
    words = "exact W2, full returns, given the pair and log n, by blocks"
    yield effect(CORRECTED, words, PARTIAL, corrected, WORSE)
