"""A study's claims, each tested on its runs."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.report.claims import verdicts
from analysis.report.claims.claim import ALL_RUNS, Claim, Finding, small_difference
from analysis.report.number_format import plain
from analysis.report.results import PANEL, paired
from analysis.report.rules import MARGINS
from analysis.report.study.reading import OWN_UNITS, Study
from analysis.runs import column_name, number_column, number_of_pairs
from analysis.stats.estimate import Estimate
from analysis.tables import column, keep
from experiments.reproduction.experiment_file import OF_TASK, SIGNS, ClaimConfig, claim_config
from experiments.reproduction.grid import AGENT_SEED, LEVEL_SEED, NUMBERS_OF_LEVELS, to_be_equal
from experiments.settings import ConfigError, import_object
from segar.errors import SegarError

TESTED = "tested"  # how these claims are read: in one way
WORDS = {verdicts.SUPPORTED: "holds", verdicts.NOT_SUPPORTED: "does not hold"}  # for claims that nobody made before


def claim_or_reason(study: Study, name: str, asked: Mapping[str, Any]) -> Claim:
    """The claim with its finding, or why it cannot be tested."""
    try:
        return claim_of(study, name, claim_config(asked, f"claims.{name}"))
    except ConfigError as error:
        return Claim(name, str(asked["says"]), "", needs=f"another claim or other runs ({error})")


def claim_of(study: Study, name: str, claim: ClaimConfig) -> Claim:
    """The claim with its finding; raises :class:`ConfigError` for a column that does not exist or a test that goes wrong."""
    try:
        words, measure, found, margin = tested(study, name, claim)
    except SegarError as error:
        raise ConfigError(f"claims.{name}: {error}") from error
    if claim.tested_on:
        words += f", on {claim.tested_on}"
    sign = SIGNS[claim.expected]
    expected = f"Expected: {claim.expected}; effects below {plain(margin, 3)} do not matter."
    several = number_of_pairs(study.runs) > 1 and "w2_exact" in (claim.of, claim.against, *claim.given)
    expected = " ".join(filter(None, [expected, f"{OWN_UNITS} `w2` has one for all." if several else "", found.note]))
    if not np.isfinite(found.estimate):
        return Claim(
            name, claim.says, words, needs=f"other runs ({found.note or 'nothing can be computed from these'})"
        )
    finding = Finding(TESTED, words, measure, found, margin, sign, ALL_RUNS)  # a study has no gate
    return Claim(name, claim.says, words, (finding,), note=expected, runs=ALL_RUNS)


def tested(study: Study, name: str, claim: ClaimConfig) -> tuple[str, str, Estimate, float]:
    """What is tested in words, what the estimate is, the estimate, and the margin below which it does not matter."""
    rows = chosen(study.tested_on(claim.tested_on) if claim.tested_on else study.runs, claim.where)
    if ":" in claim.test:
        return claim.test, "estimate", own_estimate(claim.test, rows), claim.margin or 0.0
    of = named(rows, "of", claim.of, number_column)
    if claim.test == "correlation":
        against = named(rows, "against", claim.against, number_column)
        given = [named(rows, "given", one) for one in claim.given]
        rows = keep(rows, np.isfinite(column(rows, of)) & np.isfinite(column(rows, against)))
        x, y = column(rows, against), column(rows, of)
        is_same = len(set(x)) > 1 and np.array_equal(x, y)  # such as gap and gap_deterministic
        if is_same or {of, against} & {*given}:
            raise ConfigError(f"of: {of}, against: {against}, given: {given}: a column has no correlation with itself")
        words = f"{of} against {against}" + (f", given {', '.join(given)}" if given else "")
        found = study.evidence.correlation(rows, against, of, given)
        return words, "partial Pearson r" if given else "Pearson r", found, claim.margin or MARGINS["correlation"]
    words, rows = f"mean of {of}", keep(rows, np.isfinite(column(rows, of))).assign(difference=rows[of])
    if claim.test == "difference":
        words, rows = differences(study, rows, of, claim.between)
    margin = claim.margin or small_difference(rows)
    return words, "mean difference" if claim.between else "mean", study.evidence.mean(rows), margin


def own_estimate(test: str, rows: pd.DataFrame) -> Estimate:
    """What a test of the user's own finds; raises :class:`ConfigError` where it goes wrong or finds no estimate."""
    try:
        found = import_object(test, "test")(rows)
    except SegarError:
        raise
    except Exception as error:  # the function is the user's, and may go wrong in any way
        raise ConfigError(f"test: {test} raises {type(error).__name__}: {error}") from error
    if not isinstance(found, Estimate):
        raise ConfigError(f"test: {test} returns {type(found).__name__}, not an analysis.stats.estimate.Estimate")
    if found.low > found.high:
        raise ConfigError(
            f"test: {test} returns an interval from {found.low:g} to {found.high:g}; its low must not be above its high"
        )
    return found


def chosen(runs: pd.DataFrame, where: Mapping[str, Any]) -> pd.DataFrame:
    """The runs with the given values, or one of a list of values, in some columns."""
    for name, value in where.items():
        values = {str(one) for one in (value if isinstance(value, list) else [value])}
        known = named(runs, "where", name)
        runs = keep(runs, [str(one) in values for one in runs[known]])
    if runs.empty:
        raise ConfigError(f"where: no run has {dict(where)}")
    return runs


def differences(
    study: Study, rows: pd.DataFrame, of: str, between: Mapping[str, Sequence[Any]]
) -> tuple[str, pd.DataFrame]:
    """Pairs of runs that differ in one column, as the rows of the first with ``difference``, and what they are in words."""
    (name, (first, second)), *_ = between.items()
    by = named(rows, "between", name)
    parts = [keep(rows, [str(one) == str(value) for one in rows[by]]) for value in (first, second)]
    shared = [name for name in PANEL if set(parts[0][name]) & set(parts[1][name])]  # none where panels are compared
    levels = (
        LEVEL_SEED if np.any(column(rows, LEVEL_SEED) != column(rows, "seed")) else "seed"
    )  # several seeds may have given one level set
    size = [] if by in NUMBERS_OF_LEVELS else ["n"]
    at = [one for one in (*shared, *size, levels, AGENT_SEED) if one != by] + to_be_equal(study.told_apart, by)
    for value, part in zip((first, second), parts, strict=True):
        if part.empty:
            raise ConfigError(
                f"between: no run has {by}={value}; there are {', '.join(sorted(set(map(str, rows[by]))))}"
            )
    found = paired(parts[0], parts[1], of, at)
    if found.empty:
        raise ConfigError(f"between: no two runs are equal but for {by}={first} and {second}")
    return f"{of}: {first} less {second}, same {', '.join(at)}", found


def named(runs: pd.DataFrame, setting: str, name: str, find: Callable[[pd.DataFrame, str], str] = column_name) -> str:
    """The column that a claim names, as ``find`` finds it; raises :class:`ConfigError`."""
    try:
        return find(runs, name)
    except SegarError as error:
        # The plan has seen that the task has the result.
        why = " Only results that are one number or truth per environment have columns." if OF_TASK.match(name) else ""
        raise ConfigError(f"{setting}: {error}{why}") from error
