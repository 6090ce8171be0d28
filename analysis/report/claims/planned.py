"""How many runs were planned for a claim, and how many are there: from the tables of runs and of what is missing."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from segar.analysis.report.claims.claim import Planned
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.rows import ROWS
from segar.analysis.report.claims.statements import METRICS, STATEMENTS, stated
from segar.analysis.report.claims.tests import restricted
from segar.analysis.report.results import HARDER, Results
from segar.analysis.tables import column, keep

# What the name of a run tells (experiments/settings/run.py), and the test that a reason names.
RUN = r"^(?P<family>[^-]+)-(?P<difficulty>[^-]+)-.*-(?P<algorithm>[^-]+)-s(?P<seed>\d+)-[0-9a-f]+$"
TEST = r"transfer-(?P<test_family>[^-]+)-(?P<test_difficulty>[^-]+)-[0-9a-f]+"


def planned_of(name: str, evidence: Evidence) -> Planned:
    """How many runs a claim has, whether or not they learned; all were planned where the tables do not name what is missing."""
    of = STATEMENTS["claims"][name]["evidence"]
    if of not in STATEMENTS["planned"]:  # nothing is trained for it
        return Planned()
    there = ROWS[of](evidence.ungated)
    lacking = missing_for(evidence, of)
    if of == "harder levels" and len(lacking):
        harder = lacking["difficulty"].map(HARDER.get)
        own = lacking["test_family"].isna() | (lacking["test_family"] == lacking["family"])
        own &= lacking["test_difficulty"].isna() | (lacking["test_difficulty"] == harder)
        lacking = keep(lacking, harder.notna() & own)
    both = pd.concat([there, lacking]) if len(there) else there  # a family may be missing whole
    tests = [one.where for settings in METRICS for one in stated(name, settings, both)] if len(both) else [{}]
    present, missing = (runs_of(table, tests) for table in (there, lacking))
    return Planned(
        len(present | missing), len(present - missing), hours_of_one(evidence.all_results, STATEMENTS["planned"][of])
    )


def hours_of_one(results: Results, experiments: Iterable[str]) -> float:
    """The mean hours of the runs of some experiments that are there, else what one is thought to take; NaN where nothing is."""
    runs = results.of(*experiments)
    if len(runs) and "hours" in runs:
        return float(column(runs, "hours").mean())
    return max((STATEMENTS["hours"].get(name, math.nan) for name in experiments), default=math.nan)


def missing_for(evidence: Evidence, of: str) -> pd.DataFrame:
    """The missing runs and tests of the experiments that some evidence is from, with what their names tell."""
    table = evidence.all_results.missing
    if table is None or "name" not in table:
        return pd.DataFrame()
    patterns = STATEMENTS["planned"][of]
    of_these = [
        name in patterns and bool(re.search(patterns[name], run))
        for name, run in zip(table["name"], table["run"], strict=True)
    ]
    table = keep(table, of_these)
    of_test = table["reason"].str.extract(TEST)
    found = pd.concat([table, table["run"].str.extract(RUN), of_test], axis=1)
    return found.assign(panel=found["family"] + "-" + found["difficulty"])


def runs_of(table: pd.DataFrame, tests: Sequence[Mapping[str, Any]]) -> set[str]:
    """The names of the runs that any of the tests is about, as far as the columns of the table tell."""
    parts = [restricted(table, {key: value for key, value in one.items() if key in table}) for one in tests]
    return {str(run) for part in parts if len(part) for run in part["run"]}
