"""Reads the claims: the words of each from ``statements.yaml``, its findings from its tests, and how many of the runs that were
planned for it are there, from the tables of runs and of what is missing."""

import dataclasses
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from segar.analysis.report.claims.claim import ALL_RUNS, METRIC_2022, METRIC_OURS, Claim, Finding, Planned, with_holm
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.rows import rows_of
from segar.analysis.report.claims.specifications import specifications, survives
from segar.analysis.report.claims.statements import METRICS, STATEMENTS, stated, tested
from segar.analysis.report.claims.tests import restricted
from segar.analysis.report.claims.words import BESIDE, NUMBERS
from segar.analysis.report.results import HARDER, Results
from segar.analysis.tables import column, keep

# What the name of a run tells (experiments/settings/run.py), and the test that a reason names.
RUN = r"^(?P<family>[^-]+)-(?P<difficulty>[^-]+)-(?:(?P<design>matched[^-]*)-)?.*-(?P<algorithm>[^-]+)-s(?P<seed>\d+)-\w+$"
TEST = r"transfer-(?P<test_family>[^-]+)-(?P<test_difficulty>[^-]+)-[0-9a-f]+"


def read_claims(evidence: Evidence) -> list[Claim]:
    """All claims with their findings, in the order of ``statements.yaml``."""
    table = specifications(evidence)
    found = with_holm([claim_of(name, evidence, survives(table, name)) for name in STATEMENTS["claims"]])
    return [one if one.untested else with_consequence(one, evidence) for one in found]


def claim_of(name: str, evidence: Evidence, survives: bool) -> Claim:
    """The claim with its findings, and the runs that were planned for it; ``survives``: whether its specifications agree."""
    words = STATEMENTS["claims"][name]
    if "untested" in words:
        return Claim(name, words["says"], words["where"], untested=words["untested"], needs=words["needs"])
    leading = (dataclasses.replace(one, survives=survives) for one in findings_of(name, evidence))
    of_all = (dataclasses.replace(one, runs=ALL_RUNS) for one in findings_of(name, evidence.ungated))
    planned, more = planned_of(name, evidence), {key: words[key] for key in ("note", "of", "runs") if key in words}
    return Claim(name, words["says"], words["where"], (*leading, *of_all), planned=planned, **more)


def with_consequence(claim: Claim, evidence: Evidence) -> Claim:
    """The claim with what follows from its verdicts, or with what it takes to test it."""
    name, words, needs = claim.name, STATEMENTS["claims"][claim.name], STATEMENTS["evidence"]
    rows = rows_of(words["evidence"], evidence)
    follows, lacks = consequence(claim, words), ""
    if not follows:
        lacks = needs[words.get("else_needs", words["evidence"]) if len(rows) else words["evidence"]]
    if claim.planned.is_short:
        names = ",".join(STATEMENTS["planned"][words["evidence"]])
        lacks = f"{claim.planned.to_come}, `experiments=[{names}]`"
    if not len(rows):
        return dataclasses.replace(claim, needs=lacks)
    said = follows.format(**NUMBERS[name](evidence, rows)) if follows and name in NUMBERS else follows
    beside = BESIDE[name](evidence, rows) if name in BESIDE else ""
    return dataclasses.replace(claim, follows=" ".join(filter(None, (said, beside))), needs=lacks)


def findings_of(name: str, evidence: Evidence) -> list[Finding]:
    """The findings of a claim's tests; none where the runs that it is about are missing."""
    rows = rows_of(STATEMENTS["claims"][name]["evidence"], evidence)
    return tested(evidence, rows, name) if len(rows) else []


def consequence(claim: Claim, words: Mapping[str, str]) -> str:
    """The sentences for the claim's verdicts: one where both readings agree, else one for each; "" where there is none."""
    read = {settings: claim.verdict(settings) for settings in (METRIC_2022, METRIC_OURS) if claim.has(settings)}
    sentences = {settings: words.get(verdict.replace(" ", "_"), "") for settings, verdict in read.items()}
    if len(set(read.values())) > 1:
        return " ".join(f"{settings.capitalize()}: {text}" for settings, text in sentences.items() if text)
    return next(iter(sentences.values()), "")


def planned_of(name: str, evidence: Evidence) -> Planned:
    """How many runs a claim has, whether or not they learned; all were planned where the tables do not name what is missing."""
    of = STATEMENTS["claims"][name]["evidence"]
    if of not in STATEMENTS["planned"]:  # nothing is trained for it
        return Planned()
    there = rows_of(of, evidence.ungated)
    lacking = missing_for(evidence, of)
    if of == "harder levels" and len(lacking):
        harder = lacking["difficulty"].map(HARDER.get)
        own = lacking["test_family"].isna() | (lacking["test_family"] == lacking["family"])
        own &= lacking["test_difficulty"].isna() | (lacking["test_difficulty"] == harder)
        lacking = keep(lacking, harder.notna() & own)
    both = pd.concat([there, lacking]) if len(there) else there  # a family may be missing whole
    tests = [one.where for settings in METRICS for one in stated(name, settings, both)] if len(both) else [{}]
    present, missing = (runs_of(table, tests) for table in (there, lacking))
    hours = hours_of_one(evidence.all_results, STATEMENTS["planned"][of])
    return Planned(len(present | missing), len(present - missing), hours)


def hours_of_one(results: Results, experiments: Iterable[str]) -> float:
    """The mean hours of the runs of some experiments that are there, else what one is thought to take; NaN where nothing is."""
    runs = results.of(*experiments)
    if len(runs):
        return float(column(runs, "hours").mean())
    return max((STATEMENTS["hours"].get(name, math.nan) for name in experiments), default=math.nan)


def missing_for(evidence: Evidence, of: str) -> pd.DataFrame:
    """The missing runs and tests of the experiments that some evidence is from, with what their names tell."""
    table = evidence.all_results.missing
    if table.empty:
        return pd.DataFrame()
    patterns, named = STATEMENTS["planned"][of], zip(table["name"], table["run"], strict=True)
    table = keep(table, [name in patterns and bool(re.search(patterns[name], run)) for name, run in named])
    of_test = table["reason"].str.extract(TEST)
    found = pd.concat([table, table["run"].str.extract(RUN), of_test], axis=1)
    return found.assign(panel=found["family"] + "-" + found["difficulty"])


def runs_of(table: pd.DataFrame, tests: Sequence[Mapping[str, Any]]) -> set[str]:
    """The names of the runs that any of the tests is about, as far as the columns of the table tell."""
    parts = [restricted(table, {key: value for key, value in one.items() if key in table}) for one in tests]
    return {str(run) for part in parts if len(part) for run in part["run"]}
