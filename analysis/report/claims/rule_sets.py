"""The tests of the questions about rule sets: how many of them agents train on, and what a memory gains."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from analysis.report.claims.claim import METRIC_OURS, Finding
from analysis.report.claims.evidence import Evidence
from analysis.report.rules import MARGINS
from analysis.tables import keep

GAP_IN_SUCCESS = "gap_success"


def rule_set_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs on a chosen number of rule sets, with the column ``rule_sets`` and its logarithm ``log_rule_sets``."""
    runs = evidence.results.of("rule_sets")
    if runs.empty:
        return runs
    number = runs["design"].astype(str).str.extract(r"^rule_sets_(\d+)$")[0].astype(float)
    return keep(runs.assign(rule_sets=number, log_rule_sets=np.log(number)), number.notna())


def gap_by_rule_sets(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Whether the gap in success to unseen rule sets shrinks as training has more of them, at one number of levels."""
    found = evidence.correlation(runs, "log_rule_sets", GAP_IN_SUCCESS, ("panel",))
    words = "gap in success to unseen rule sets and the logarithm of the number of rule sets in training, given panel"
    yield Finding(METRIC_OURS, words, "r", found, MARGINS["correlation"], 1)
