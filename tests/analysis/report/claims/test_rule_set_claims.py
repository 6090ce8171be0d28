"""The claims about rule sets and trials, on tables with effects of a known size."""

import numpy as np
import pytest

from segar.analysis.report.claims import statements
from segar.analysis.report.claims.claim import METRIC_OURS
from segar.analysis.report.claims.rows import all_rule_set_runs, rule_set_runs, runs_on_ten
from segar.analysis.report.claims.verdicts import NOT_SUPPORTED, NOT_TESTABLE, SUPPORTED, UNDECIDED
from segar.analysis.report.number_format import estimate_text
from tests.synthetic_results import claims_of, evidence_of, rule_set_distances, rule_set_rows, trial_rows


def measured(folder, runs):
    """The evidence of runs with the distances of their rule sets."""
    study = folder / "studies" / "rule_set_distances"
    study.mkdir(parents=True)
    rule_set_distances(runs).to_csv(study / "rule_sets.csv", index=False)
    return evidence_of(folder, {"runs": runs})


@pytest.mark.parametrize(
    ("planted", "of_number", "of_distance"),
    [
        ({"of_number": 0.05}, SUPPORTED, NOT_SUPPORTED),
        ({"of_distance": 0.2}, SUPPORTED, SUPPORTED),  # more of them are nearer
        ({"of_number": -0.05}, NOT_SUPPORTED, NOT_SUPPORTED),
    ],
)
def test_what_number_and_distance_do_is_found(tmp_path, planted, of_number, of_distance):
    runs = rule_set_rows(np.random.default_rng(0), seeds=10, **planted)
    found = claims_of(measured(tmp_path, runs))
    assert found["rule-sets"].verdict(METRIC_OURS) == of_number
    if "of_distance" in planted:
        assert found["rule-set-distance"].verdict(METRIC_OURS) == of_distance


def test_picked_rule_sets_do_not_count_among_numbers(tmp_path):
    runs = rule_set_rows(np.random.default_rng(0), seeds=6)
    evidence = measured(tmp_path, runs)
    both, ten = all_rule_set_runs(evidence), runs_on_ten(evidence)
    assert len(both) == 30 and set(ten["design"]) == {"rule_sets_10", "rule_sets_10_near", "rule_sets_10_far"}
    assert dict(zip(ten["chosen"], ten["dynamics_w2"], strict=True)) == {"": 3.5, "near": 3.0, "far": 4.2}
    (one,) = claims_of(evidence)["rule-sets"].tests(METRIC_OURS)
    assert one.found.n == 18


def test_a_gap_that_shrinks_in_training_alone_is_no_success_on_unseen_rule_sets(tmp_path):
    runs = rule_set_rows(np.random.default_rng(0), seeds=10)
    logarithm = np.log10(runs["design"].str.extract(r"rule_sets_(\d+)")[0].astype(float))
    for shared, expected in ((-0.05, NOT_SUPPORTED), (0.05, SUPPORTED)):
        noise = np.random.default_rng(1).normal(0, 0.02, len(runs))
        test = 0.5 + shared * logarithm + noise
        train = 0.8 + noise[::-1] + (shared - 0.05) * logarithm
        changed = runs.assign(success_test_deterministic=test, success_train_deterministic=train)
        found = claims_of(evidence_of(tmp_path / str(shared), {"runs": changed}))
        assert found["rule-sets"].verdict(METRIC_OURS) == SUPPORTED
        assert found["rule-sets-unseen"].verdict(METRIC_OURS) == expected


def test_what_rests_on_one_rule_set_is_said(tmp_path):
    """Agents on one rule set have a gap, and all others none."""
    runs = rule_set_rows(np.random.default_rng(0), seeds=10)
    one = runs["design"] == "rule_sets_1"
    gap = np.where(one, 0.4, 0.0) + np.random.default_rng(1).normal(0, 0.02, len(runs))
    changed = runs.assign(success_train_deterministic=0.9, success_test_deterministic=0.9 - gap, gap_success=-gap)
    evidence = measured(tmp_path, changed)
    claim = claims_of(evidence)["rule-sets"]
    (found,) = statements.tested(evidence, rule_set_runs(evidence).query("rule_sets > 1"), "rule-sets")
    assert claim.verdict(METRIC_OURS) == UNDECIDED and found.verdict != SUPPORTED
    assert f"Without the runs on one rule set, {estimate_text(found.found)} ({found.verdict})." in claim.follows


def test_distances_that_were_not_measured_leave_the_other_question(tmp_path):
    runs = rule_set_rows(np.random.default_rng(0), seeds=6, of_number=0.05)
    found = claims_of(evidence_of(tmp_path, {"runs": runs}))
    assert found["rule-sets"].verdict(METRIC_OURS) == SUPPORTED
    assert found["rule-set-distance"].verdict(METRIC_OURS) == NOT_TESTABLE
    assert "rule_set_distances" in found["rule-set-distance"].needs


@pytest.mark.parametrize(("gain", "verdict"), [(0.2, SUPPORTED), (0.0, NOT_SUPPORTED), (-0.2, NOT_SUPPORTED)])
def test_what_a_memory_gains_is_found(tmp_path, gain, verdict):
    runs = trial_rows(np.random.default_rng(0), gain, seeds=6)
    found = claims_of(evidence_of(tmp_path, {"runs": runs}))["memory"]
    assert found.verdict(METRIC_OURS) == verdict
    assert found.tests(METRIC_OURS)[0].found.estimate == pytest.approx(gain, abs=0.02)
