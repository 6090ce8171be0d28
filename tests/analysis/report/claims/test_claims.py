"""Planted effects are found, planted confounds are seen through, and what was not run is said."""

import numpy as np
import pandas as pd
import pytest

from analysis.report.claims.claim import CORRECTED, PAPER, with_holm
from analysis.report.claims.evidence import BLOCKS, Evidence
from analysis.report.claims.reading import ROWS, STATEMENTS, TESTS, read_claims
from analysis.report.claims.verdicts import NOT_REPRODUCED, NOT_TESTABLE, REPRODUCED, of_insignificance
from analysis.report.document.tables import row_of
from analysis.report.results import read_results
from analysis.stats.estimate import Estimate
from analysis.stats.prediction import left_out
from tests.synthetic_results import everything, run_rows, transfer_rows, write_results


def claims_of(folder, tables):
    evidence = Evidence(read_results(write_results(folder, tables)))
    return {claim.name: claim for claim in read_claims(evidence)}


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    """All experiments, with a gap that follows exact W2 and nothing else."""
    return claims_of(tmp_path_factory.mktemp("full") / "standard", everything(np.random.default_rng(0)))


def test_an_effect_of_w2_is_found_pooled_given_panel_given_n_and_at_one_n(full):
    for name in ("3a", "3a-panel", "3a-n", "3a-cell", "fixed-n", "3b-trend", "3b-empty"):
        assert full[name].verdict(PAPER) == full[name].verdict(CORRECTED) == REPRODUCED, name
    assert full["3b-easy"].verdict(CORRECTED) == NOT_REPRODUCED


def test_a_gap_that_follows_n_and_not_w2_is_told_apart(tmp_path):
    rng = np.random.default_rng(1)
    found = claims_of(tmp_path, {"runs": run_rows(rng, "figure_3a", seeds=6, beyond_n=False)})
    assert found["3a"].verdict(CORRECTED) == REPRODUCED
    assert found["3a-n"].verdict(CORRECTED) == NOT_REPRODUCED
    assert "how many levels" in found["3a-n"].follows
    assert found["3a-cell"].verdict(CORRECTED) == NOT_REPRODUCED


def test_one_seed_says_nothing_about_sets_of_one_size(tmp_path):
    found = claims_of(tmp_path, {"runs": run_rows(np.random.default_rng(1), "figure_3a", seeds=1)})
    assert found["3a-cell"].verdict(CORRECTED) == NOT_TESTABLE
    assert "two seeds" in found["3a-cell"].needs


def test_a_loss_on_harder_levels_is_found(full):
    assert full["4a-larger"].verdict(CORRECTED) == REPRODUCED
    (finding,) = [one for one in full["4a-larger"].findings if one.settings == CORRECTED]
    assert finding.found.estimate == pytest.approx(-2.0)


def test_accuracies_without_relation_to_the_gap_are_none(full):
    assert full["4b-train"].verdict(CORRECTED) == REPRODUCED
    assert all(abs(one.found.estimate) < 0.3 for one in full["4b-none"].findings)


def test_of_four_trends_one_that_chance_would_make_is_no_trend_when_corrected():
    found = {name: Estimate(0.6, 0.0, 0.9, 9, p) for name, p in {"a": 0.04, "b": 0.3, "c": 0.2, "d": 0.9}.items()}
    assert of_insignificance(with_holm(PAPER, found)["a"]) == NOT_REPRODUCED
    corrected = with_holm(CORRECTED, found)
    assert corrected["a"].p == pytest.approx(4 * 0.04)
    assert all(of_insignificance(one) == REPRODUCED for one in corrected.values())


def test_many_blocks_are_resampled_and_few_are_left_out_one_at_a_time(full):
    notes = {name: full[name].findings[-1].found.note for name in ("3a", "4a-all", "fixed-n")}
    assert notes["3a"] == "135 rows in 27 blocks, resampled"
    assert notes["4a-all"] == "90 rows in 18 blocks, left out one at a time"
    assert notes["fixed-n"].endswith("8 blocks, left out one at a time")


def test_a_shift_of_physics_costs_what_was_planted_whatever_the_own_gap_is(tmp_path):
    tables = everything(np.random.default_rng(0))
    evidence = Evidence(read_results(write_results(tmp_path, tables)))
    found = evidence.results.other_physics
    assert len(found) == 6
    np.testing.assert_allclose(found["difference"], -3.0)


def test_sample_sizes_and_intervals_stand_beside_every_number(full):
    for claim in full.values():
        for one in claim.findings:
            assert one.found.n > 0
            assert one.found.low <= one.found.estimate <= one.found.high, (claim.name, one.test)


def test_what_was_not_run_is_not_testable_and_says_what_it_takes(tmp_path):
    found = claims_of(tmp_path, {"runs": run_rows(np.random.default_rng(0), "upper_bound", seeds=1)})
    assert {claim.verdict(PAPER) for claim in found.values()} == {NOT_TESTABLE}
    assert all("experiments=[" in claim.needs or "probes.parquet" in claim.needs for claim in found.values())


def test_part_of_a_grid_gives_what_it_can(tmp_path):
    rng = np.random.default_rng(0)
    runs = run_rows(rng, "figure_3a", seeds=1, families=("empty",), difficulties=("easy", "medium"), counts=(1, 10))
    found = claims_of(tmp_path, {"runs": runs, "transfers": transfer_rows(runs, loss=1.0)})
    assert found["3b-trend"].verdict(PAPER) == NOT_TESTABLE
    assert found["3a"].verdict(PAPER) != NOT_TESTABLE


def test_leaving_a_figure_out_changes_no_number(tmp_path):
    folder = write_results(tmp_path, {"runs": run_rows(np.random.default_rng(0), "figure_3a", seeds=1)})
    one, other = (Evidence(read_results(folder)) for _ in range(2))
    before = row_of(one.resampled, w2="exact", gap="gap", test="pooled", way=BLOCKS)
    alone = other.correlation("exact gap pooled", other.main, "w2_exact", "gap")
    assert (alone.low, alone.high) == (before.low, before.high)


def test_a_line_that_holds_in_all_panels_predicts_a_new_one():
    rng = np.random.default_rng(0)
    table = pd.DataFrame({"x": rng.normal(size=60), "family": np.repeat(["a", "b", "c"], 20), "difficulty": "easy"})
    table["y"] = 2 * table["x"] + 0.1 * rng.normal(size=60)
    table["noise"] = rng.normal(size=60)
    found = left_out(table, "y", {"x": ["x"], "noise": ["noise"]}).set_index("predictors")
    assert found.loc["x", "r2_left_out"] > 0.98
    assert found.loc["noise", "r2_left_out"] < 0.1


def test_every_claim_has_a_test_and_rows_and_every_test_a_claim():
    claims, evidence = STATEMENTS["claims"], STATEMENTS["evidence"]
    assert list(claims) == sorted(claims, key=list(TESTS).index) and set(claims) == set(TESTS)
    for words in claims.values():
        assert words["evidence"] in ROWS and {words["evidence"], words.get("else_needs", words["evidence"])} <= set(
            evidence
        )
        assert set(words) <= {
            "where", "says", "evidence", "else_needs", "note", "reproduced", "not_reproduced", "undecided",
        }  # fmt: skip
