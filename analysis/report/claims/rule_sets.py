"""The tests of the questions about rule sets: how many agents train on, how far they are, and what a memory gains."""

from collections.abc import Iterator

import numpy as np
import pandas as pd

from analysis.report.claims.claim import ALL_RUNS, METRIC_OURS, Claim, Finding, correlation, mean_difference
from analysis.report.claims.evidence import Evidence
from analysis.report.claims.information import beside
from analysis.report.claims.verdicts import is_significant
from analysis.report.number_format import NONE, effect, estimate_text, plain
from analysis.report.rules import MARGINS
from analysis.stats.estimate import Estimate
from analysis.tables import count_of, keep, select

GAP_IN_SUCCESS = "gap_success"
SUCCESS = "success_test_deterministic"
OF_SET = ("family", "difficulty", "n", "seed", "design")
SUCCESS_IN_TRIAL = "success_trial_{}_test_deterministic"


def all_rule_set_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs on a chosen number of rule sets: that number ``rule_sets``, its logarithm ``log_rule_sets``, ``chosen`` (near,
    far, or empty), and ``dynamics_w2``, their distance to those of the test, which is none where it was not measured."""
    runs = evidence.results.of("rule_sets")
    if runs.empty:
        return runs
    parts = runs["design"].astype(str).str.extract(r"^rule_sets_(?P<number>\d+)(?:_(?P<chosen>near|far))?$")
    number = parts["number"].astype(float)
    found = runs.assign(rule_sets=number, log_rule_sets=np.log(number), chosen=parts["chosen"].fillna(""))
    study = evidence.results.studies.get("rule_set_distances", {}).get("rule_sets", pd.DataFrame())
    if study.empty:
        return found.assign(dynamics_w2=np.nan)
    return found.merge(study[[*OF_SET, "dynamics_w2"]], on=list(OF_SET), how="left")


def rule_set_runs(evidence: Evidence) -> pd.DataFrame:
    """The runs whose rule sets are the first of a sample, see :func:`all_rule_set_runs`."""
    runs = all_rule_set_runs(evidence)
    return select(runs, chosen="") if len(runs) else runs


def runs_on_ten(evidence: Evidence) -> pd.DataFrame:
    """The runs on ten rule sets, whether the first, near or far ones, whose distance to the test was measured."""
    runs = all_rule_set_runs(evidence)
    return keep(runs, (runs["rule_sets"] == 10) & runs["dynamics_w2"].notna()) if len(runs) else runs


def gap_by_rule_sets(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Whether the gap in success to unseen rule sets shrinks as training has more of them, at one number of levels."""
    found = evidence.correlation(runs, "log_rule_sets", GAP_IN_SUCCESS, ("panel",))
    words = "gap in success to unseen rule sets and the logarithm of the number of rule sets in training"
    yield correlation(METRIC_OURS, words, found, 1, ("panel",))


def success_at_both_ends(evidence: Evidence, runs: pd.DataFrame) -> str:
    """The success of agents on the fewest and on the most rule sets, on training levels and on unseen ones."""
    numbers = sorted({*runs["rule_sets"]})
    parts = [select(runs, rule_sets=number) for number in (numbers[0], numbers[-1])]
    trained, unseen = (
        [evidence.mean(part, name) for part in parts] for name in ("success_train_deterministic", SUCCESS)
    )
    said = (
        f"From {numbers[0]:,.0f} to {numbers[-1]:,.0f} rule sets, mean success goes on training levels from "
        f"{' to '.join(map(share, trained))} and on unseen rule sets from {' to '.join(map(share, unseen))} "
        f"(n = {' and '.join(f'{len(part)}' for part in parts)} runs)"
    )
    falls = trained[-1].estimate < trained[0].estimate
    return said + (": a gap also closes where success in training falls." if falls else ".")


def share(found: Estimate) -> str:
    """``0.95 [0.88, 1.00]``, an interval that ends at 0 and 1; or the share alone where it has none."""
    value, ends = effect(found, plain)
    return value if ends == NONE else f"{value} [{plain(max(found.low, 0.0))}, {plain(min(found.high, 1.0))}]"


def gap_in_words(evidence: Evidence, runs: pd.DataFrame) -> str:
    """:func:`success_at_both_ends`, and what is left of the correlation without the runs on one rule set."""
    more = keep(runs, runs["rule_sets"] > 1)
    if count_of(more, "rule_sets") < 2 or len(more) == len(runs):
        return success_at_both_ends(evidence, runs)
    (one,) = gap_by_rule_sets(evidence, more)
    said = f"Without the runs on one rule set, {estimate_text(one.found)} ({one.verdict})."
    return f"{said} {success_at_both_ends(evidence, runs)}"


def fall_over_all_runs(claim: Claim) -> str:
    """Where success falls with more rule sets over all runs, that it does."""
    (one,) = claim.tests(METRIC_OURS, ALL_RUNS)
    falls = one.found.estimate < 0 and is_significant(one.found)
    return f"Over all runs, it falls: {estimate_text(one.found)}." if falls else ""


def success_by_rule_sets(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Whether success on unseen rule sets grows as training has more of them, at one number of levels."""
    found = evidence.correlation(runs, "log_rule_sets", SUCCESS, ("panel",))
    words = "success on unseen rule sets and the logarithm of the number of rule sets in training"
    yield correlation(METRIC_OURS, words, found, 1, ("panel",))


def gap_by_distance(evidence: Evidence, runs: pd.DataFrame) -> Iterator[Finding]:
    """Whether the gap in success is worse where the dynamics of training and test are farther apart, at ten rule sets."""
    found = evidence.correlation(runs, "dynamics_w2", GAP_IN_SUCCESS, ("panel",))
    words = "gap in success to unseen rule sets and the distance between dynamics, ten rule sets in training"
    yield correlation(METRIC_OURS, words, found, -1, ("panel",))


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
