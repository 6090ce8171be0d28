"""A study's claims, each tested on its runs."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import numpy as np
import pandas as pd

from segar.analysis.report.claims import verdicts
from segar.analysis.report.claims.claim import ALL_RUNS, Claim, Finding
from segar.analysis.report.claims.tests import StatedTest, differences, finding_of, restricted
from segar.analysis.report.number_format import plain
from segar.analysis.report.results import PANEL
from segar.analysis.report.study.reading import OWN_UNITS, Study
from segar.analysis.runs import column_name, number_column, number_of_pairs
from segar.analysis.stats.estimate import Estimate
from segar.analysis.tables import column, keep
from segar.errors import SegarError, naming
from segar.experiments.reproduction.experiment_file import OF_TASK, SIGNS, ClaimConfig, claim_config
from segar.experiments.reproduction.grid import LEVEL_SEED, pair_columns
from segar.experiments.settings import ConfigError, import_object

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
    with naming(f"claims.{name}", ConfigError):
        one = tested(study, claim)
    expected = f"Expected: {claim.expected}; effects below {plain(one.margin, 3)} do not matter."
    several = number_of_pairs(study.runs) > 1 and "w2_exact" in (claim.of, claim.against, *claim.given)
    unit = f"{OWN_UNITS} `w2` has one for all." if several else ""
    if not np.isfinite(one.found.estimate):
        needs = f"other runs ({one.found.note or 'nothing can be computed from these'})"
        return Claim(name, claim.says, one.test, needs=needs)
    note = " ".join(filter(None, [expected, unit, one.found.note]))
    return Claim(name, claim.says, one.test, (one,), note=note, runs=ALL_RUNS)  # a study has no gate


def tested(study: Study, claim: ClaimConfig) -> Finding:
    """What the runs of a claim say of its test."""
    rows = chosen(study.tested_on(claim.tested_on) if claim.tested_on else study.runs, claim.where)
    there = f", on {claim.tested_on}" if claim.tested_on else ""
    if ":" in claim.test:
        found, sign = own_estimate(claim.test, rows), SIGNS[claim.expected]
        return Finding(TESTED, claim.test + there, "estimate", found, claim.margin or 0.0, sign, ALL_RUNS)
    test = stated(study, rows, claim)
    found = finding_of(study.evidence, rows, dataclasses.replace(test, words=test.words + there), TESTED)
    return dataclasses.replace(cast(Finding, found), runs=ALL_RUNS)  # of a test that restricts no rows


def stated(study: Study, rows: pd.DataFrame, claim: ClaimConfig) -> StatedTest:
    """The test of a claim, by the names of the columns that these rows have."""
    of, margin = named(rows, "of", claim.of, number_column), claim.margin or ""
    if claim.test == "correlation":
        against = named(rows, "against", claim.against, number_column)
        given = [named(rows, "given", one) for one in claim.given]
        known = keep(rows, np.isfinite(column(rows, of)) & np.isfinite(column(rows, against)))
        x, y = column(known, against), column(known, of)
        is_same = len(set(x)) > 1 and np.array_equal(x, y)  # such as gap and gap_deterministic
        if is_same or {of, against} & {*given}:
            raise ConfigError(f"of: {of}, against: {against}, given: {given}: a column has no correlation with itself")
        words = f"{of} against {against}" + (f", given {', '.join(given)}" if given else "")
        return StatedTest(claim.test, claim.expected, words, of, against, given, margin=margin)
    if claim.test == "mean":
        return StatedTest(claim.test, claim.expected, f"mean of {of}", of, margin=margin)
    (name, values), *_ = claim.between.items()
    by, values = named(rows, "between", name), [str(value) for value in values]
    same = shared_columns(study, rows, by, values)
    words = f"{of}: {values[0]} less {values[1]}, same {', '.join(same)}"
    if differences(rows, of, {by: values}, same).empty:
        raise ConfigError(f"between: no two runs are equal but for {by}={values[0]} and {values[1]}")
    return StatedTest(claim.test, claim.expected, words, of, between={by: values}, same=same, margin=margin)


def shared_columns(study: Study, rows: pd.DataFrame, by: str, values: Sequence[str]) -> list[str]:
    """The columns in which the two runs of a pair are equal that differ in the column ``by``."""
    parts = [restricted(rows, {by: value}) for value in values]
    panels = [name for name in PANEL if set(parts[0][name]) & set(parts[1][name])]  # none where panels are compared
    # Several seeds may have given one level set.
    levels = LEVEL_SEED if np.any(column(rows, LEVEL_SEED) != column(rows, "seed")) else "seed"
    return pair_columns(by, panels, levels, study.told_apart)


def own_estimate(test: str, rows: pd.DataFrame) -> Estimate:
    """What a test of the user's own finds; raises :class:`ConfigError` where it goes wrong or finds no estimate."""
    try:
        found = import_object(test, "test")(rows)
    except SegarError:
        raise
    except Exception as error:  # the function is the user's, and may go wrong in any way
        raise ConfigError(f"test: {test} raises {type(error).__name__}: {error}") from error
    if not isinstance(found, Estimate):
        raise ConfigError(f"test: {test} returns {type(found).__name__}, not an segar.analysis.stats.estimate.Estimate")
    if found.low > found.high:
        raise ConfigError(
            f"test: {test} returns an interval from {found.low:g} to {found.high:g}; its low must not be above its high"
        )
    return found


def chosen(runs: pd.DataFrame, where: Mapping[str, Any]) -> pd.DataFrame:
    """The runs with the given values, or one of a list of values, in some columns."""
    found = restricted(runs, {named(runs, "where", name): value for name, value in where.items()})
    if found.empty:
        raise ConfigError(f"where: no run has {dict(where)}")
    return found


def named(runs: pd.DataFrame, setting: str, name: str, find: Callable[[pd.DataFrame, str], str] = column_name) -> str:
    """The column that a claim names, as ``find`` finds it; raises :class:`ConfigError`."""
    try:
        return find(runs, name)
    except SegarError as error:
        # The plan has seen that the task has the result.
        why = " Only results that are one number or truth per environment have columns." if OF_TASK.match(name) else ""
        raise ConfigError(f"{setting}: {error}{why}") from error
