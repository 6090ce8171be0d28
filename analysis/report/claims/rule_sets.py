"""The tests of the questions about rule sets: how many of them agents train on, and what a memory gains."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from analysis.report.claims.claim import METRIC_OURS, Finding, mean_difference
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.information import beside
from analysis.report.rules import MARGINS
from analysis.tables import keep

GAP_IN_SUCCESS = "gap_success"
SUCCESS_IN_TRIAL = "success_trial_{}_test_deterministic"


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


def trial_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs over trials, with ``memory`` and ``last_trial``, their success in the last trial on unseen rule sets."""
    runs = evidence.results.of("trials")
    if runs.empty:
        return runs
    names = trial_columns(runs)
    recurrent = runs["algorithm"].astype(str).str.startswith("ppo_recurrent")
    return runs.assign(memory=recurrent, last_trial=runs[names[-1]]) if names else runs.iloc[:0]


def trial_columns(runs: pd.DataFrame) -> list[str]:
    """The columns of success in each trial on the test levels, in order."""
    numbers = [n for n in range(len(runs.columns)) if SUCCESS_IN_TRIAL.format(n) in runs]
    return [SUCCESS_IN_TRIAL.format(n) for n in numbers]


def memory_beside_none(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Whether agents with a memory solve more unseen rule sets in their last trial than agents without one."""
    differences = beside(runs, "last_trial", runs["memory"], ~runs["memory"], ("family", "difficulty", "n", "seed"))
    words = "success in the last trial on unseen rule sets, with a memory less without"
    yield from mean_difference(evidence, METRIC_OURS, words, differences, 1, MARGINS["success"])
