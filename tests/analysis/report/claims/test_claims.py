"""Planted effects are found, planted confounds are seen through, and what was not run is said."""

from collections import Counter

import numpy as np
import pandas as pd
import pytest

from segar.analysis.report.claims.claim import ALL_RUNS, LEARNED, METRIC_2022, METRIC_OURS
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.prediction import matched_predictions
from segar.analysis.report.claims.rows import ROWS
from segar.analysis.report.claims.specifications import specifications, survives
from segar.analysis.report.claims.statements import METRICS, STATEMENTS, stated
from segar.analysis.report.claims.tests import TESTS, differences
from segar.analysis.report.claims.verdicts import NOT_SUPPORTED, NOT_TESTABLE, NOT_YET, SUPPORTED, UNDECIDED
from segar.analysis.report.claims.words import BESIDE, NUMBERS
from segar.analysis.report.document.blocks import FINDING_HEAD, finding_rows
from segar.analysis.report.document.tables import CONTRASTS, contrasts
from segar.analysis.report.number_format import NONE
from segar.analysis.report.results import read_results
from segar.analysis.report.rules import WHOLE
from segar.analysis.stats.estimate import mean_of_replicates
from segar.analysis.stats.prediction import left_out
from tests.synthetic_results import (
    claims_of,
    everything,
    evidence_of,
    player_rows,
    run_rows,
    write_players,
    write_results,
)


def claims_on(folder, tables):
    return claims_of(evidence_of(folder, tables))


@pytest.fixture(scope="module")
def full(tmp_path_factory):
    """All experiments, with a gap that follows exact W2 and nothing else."""
    return claims_on(tmp_path_factory.mktemp("full") / "standard", everything(np.random.default_rng(0), seeds=6))


def test_an_effect_of_w2_is_found_pooled_given_panel_given_n_and_at_one_n(full):
    for name in ("3a", "3a-panel", "3a-n", "3a-cell", "fixed-n", "3b-trend", "3b-empty"):
        assert full[name].verdict(METRIC_2022) == full[name].verdict(METRIC_OURS) == SUPPORTED, name
    assert full["3b-easy"].verdict(METRIC_OURS) == NOT_SUPPORTED


def test_a_gap_that_follows_n_and_not_w2_is_told_apart(tmp_path):
    rng = np.random.default_rng(1)
    found = claims_on(tmp_path, {"runs": run_rows(rng, "figure_3a", seeds=6, beyond_n=False)})
    assert found["3a"].verdict(METRIC_OURS) == SUPPORTED
    assert found["3a-n"].verdict(METRIC_OURS) == NOT_SUPPORTED
    assert "how many levels" in found["3a-n"].follows
    assert found["3a-cell"].verdict(METRIC_OURS) == NOT_SUPPORTED


def test_a_loss_on_harder_levels_is_found_and_accuracies_have_no_relation_to_the_gap(full):
    assert full["4a-larger"].verdict(METRIC_OURS) == full["4b-train"].verdict(METRIC_OURS) == SUPPORTED
    (finding,) = full["4a-larger"].tests(METRIC_OURS)
    assert finding.found.estimate == pytest.approx(-2.0, rel=0.01)
    assert all(abs(one.found.estimate) < 0.3 for one in full["4b-none"].findings)


def test_blocks_stay_together_and_too_few_give_neither_an_interval_nor_a_verdict(full, tmp_path):
    assert full["3a"].findings[0].found.note == "270 rows in 9 blocks"  # panels: nothing is given
    assert full["3a-panel"].findings[0].found.note == "270 rows in 54 blocks"
    assert full["fixed-n"].findings[0].found.note == "24 rows in 8 blocks"
    n, r = (FINDING_HEAD.index(name) for name in ("n in blocks", "effect"))
    assert all(row[n].endswith(" in 6") for row in finding_rows(full["3b-trend"]))
    one_panel = {"families": ("empty",), "difficulties": ("easy",)}
    few = claims_on(tmp_path, {"runs": run_rows(np.random.default_rng(0), "figure_3a", seeds=5, **one_panel)})
    (one,) = few["3a-panel"].tests(METRIC_OURS)
    assert one.found.note == "5 blocks: no interval" and one.verdict == NOT_TESTABLE
    assert {row[r] for row in finding_rows(few["3a-panel"])} == {NONE}


def test_runs_that_did_not_learn_do_not_lead(tmp_path):
    """A family whose agents stand still has no gap at any distance: with it, the correlation is hidden."""
    rng = np.random.default_rng(0)
    runs = run_rows(rng, "figure_3a", seeds=6)
    idle = runs["family"] == "tilesx1"
    for name in ("gap_deterministic", "gap_ref_deterministic"):
        runs.loc[idle, name] = 5.0 * rng.normal(size=idle.sum())
    runs.loc[idle, ["success_train_deterministic", "success_test_deterministic"]] = 0.05
    found = claims_on(tmp_path, {"runs": runs})["3a"]
    (leading,), (all_runs,) = found.tests(METRIC_OURS), found.tests(METRIC_OURS, ALL_RUNS)
    assert leading.found.n == 180 and all_runs.found.n == 270
    assert leading.found.estimate < -0.9 < all_runs.found.estimate
    assert found.verdict(METRIC_OURS) == SUPPORTED


def test_the_gate_is_the_better_of_idle_and_random_play(tmp_path):
    runs = run_rows(np.random.default_rng(0), "figure_3a", seeds=1, families=("empty",), difficulties=("easy",))
    runs["success_train_deterministic"] = [0.31, 0.39, 0.41, 0.5, 1.0]
    folder = write_results(tmp_path, {"runs": runs})
    assert list(read_results(folder).learned) == [True] * 5
    players = {"family": "empty", "difficulty": "easy", "player": ["idle", "random"], "success": [0.1, 0.3]}
    write_players(folder, pd.DataFrame(players))
    assert list(read_results(folder).learned) == [False, False, True, True, True]


def test_matched_sets_tell_which_of_two_measures_matters(tmp_path):
    """Coverage is planted: sets that cover worse lose a fifth of the success, sets that are farther in W2 nothing."""
    rng = np.random.default_rng(0)
    parts = []
    for design in ("matched", "matched_far", "matched_sparse", "matched_far_sparse"):
        part = run_rows(rng, "matched_sets", design=design, seeds=10, difficulties=("medium",), counts=(10, 50))
        loss = 0.2 * ("sparse" in design) + 0.02 * rng.normal(size=len(part))
        part["success_test_deterministic"] = part["success_train_deterministic"] - loss
        part["radius"] = 1.0 + ("sparse" in design) + 0.1 * rng.normal(size=len(part))
        part["w2_exact"] = 1.0 + ("far" in design) + 0.1 * rng.normal(size=len(part))
        parts.append(part)
    runs = pd.concat(parts, ignore_index=True)
    evidence = evidence_of(tmp_path, {"runs": runs})
    found = claims_of(evidence)
    assert found["matched-coverage"].verdict(METRIC_OURS) == SUPPORTED
    assert found["matched-w2"].verdict(METRIC_OURS) == NOT_SUPPORTED
    assert "In other ways, which decide nothing: n = 10" in found["matched-coverage"].follows
    kind, effect = (CONTRASTS.index(name) for name in ("gap in success", "difference"))
    for row in contrasts(evidence, evidence.results.of("matched_sets")).rows:
        planted = -0.2 if "coverage" in row[kind] else 0.0
        assert float(row[effect].replace("−", "-")) == pytest.approx(planted, abs=0.05)
    table = matched_predictions(evidence, evidence.results.of("matched_sets")).set_index("measure")
    assert table.loc["covering radius", "estimate"] > 0.8 > 0.1 > table.loc["exact W2", "estimate"]


def test_the_papers_agent_is_judged_when_all_of_its_runs_are_there(tmp_path):
    rng = np.random.default_rng(0)
    runs = run_rows(rng, "paper_agent", seeds=1, difficulties=("medium",))
    runs = runs.assign(seed=np.arange(len(runs)) + 1)  # a level set each
    assert len(runs) == WHOLE["paper_agent"]
    whole = claims_on(tmp_path / "whole", {"runs": runs})["3a-agent"]
    assert whole.verdict(METRIC_OURS) == SUPPORTED and len(whole.tests(METRIC_OURS)) == 1
    part = claims_on(tmp_path / "part", {"runs": runs.iloc[:-1]})["3a-agent"]
    assert part.verdict(METRIC_OURS) == NOT_TESTABLE and not part.findings and "all fifteen" in part.needs


def test_specifications_are_all_combinations_and_decide_what_survives(full, tmp_path):
    rng = np.random.default_rng(0)
    evidence = evidence_of(tmp_path, {"runs": run_rows(rng, "figure_3a", seeds=6)})
    table = specifications(evidence)
    # Without the study of training sets, W2 is exact or that of 2022, each with its own returns, and there is no regret. Each
    # choice is made with all runs and without those with one level.
    per_claim = {"3a": 2, "3a-panel": 2, "3a-n": 2 * 3, "3a-cell": 2, "5b-diversity": 1}
    assert Counter(table["claim"]) == {name: 2 * number for name, number in per_claim.items()}
    assert full["3a-n"].verdict(METRIC_OURS) in (SUPPORTED, UNDECIDED)
    one_way = table.assign(estimate=-0.5, low=-0.7, high=-0.3, p=0.001)
    mixed = one_way.assign(estimate=np.where(table.index == table.index[table["claim"] == "3a-n"][0], 0.1, -0.5))
    assert survives(one_way, "3a-n") and not survives(mixed, "3a-n")
    assert not survives(one_way.assign(p=0.2), "3a-cell")


def test_regret_is_an_outcome_where_the_planner_is_known_and_falls_like_the_return_on_test_levels(tmp_path):
    folder = write_results(tmp_path, {"runs": run_rows(np.random.default_rng(0), "figure_3a", seeds=6)})
    players = player_rows()
    better = (players["player"] == "oracle") & (players["family"] == "empty")
    players.loc[better, "return"] = 7.0  # what is best in a panel is the panel's, and given with it
    write_players(folder, players)
    evidence = Evidence(read_results(folder))
    found = specifications(evidence)
    regret = found[(found["outcome"] == "regret") & (found["measure"] == "exact W2")]
    assert set(regret["claim"]) == {"3a-panel", "3a-n", "3a-cell"}
    regret = regret[regret["runs"] == "all"]
    expected = evidence.correlation(evidence.results.main, "w2_exact", "eta_test_deterministic", ("cell",))
    (row,) = regret[regret["claim"] == "3a-cell"].to_dict("records")
    assert row["estimate"] == pytest.approx(expected.estimate) and row["estimate"] < 0


def test_a_shift_of_physics_costs_what_was_planted_whatever_the_own_gap_is(tmp_path):
    evidence = evidence_of(tmp_path, everything(np.random.default_rng(0)))
    found = evidence.results.other_physics
    assert len(found) == 6
    np.testing.assert_allclose(found["difference"], -3.0, rtol=0.011)


def test_sample_sizes_and_intervals_stand_beside_every_number(full):
    for claim in full.values():
        for one in claim.findings:
            assert one.found.n > 0
            assert one.found.low <= one.found.estimate <= one.found.high or one.verdict == NOT_TESTABLE, claim.name


def test_what_was_not_run_is_not_testable_and_says_what_it_takes(tmp_path):
    found = claims_on(tmp_path, {"runs": run_rows(np.random.default_rng(0), "attribution", seeds=1)})
    planned = [claim for claim in found.values() if not claim.untested]
    assert {claim.verdict(METRIC_2022) for claim in planned} == {NOT_TESTABLE}
    ways = ("experiments=[", "probes.parquet", "python -m benchmarks.platforms")
    assert all(any(way in claim.needs for way in ways) for claim in planned)
    assert all(claim.needs and claim.verdict(METRIC_OURS) in (NOT_YET, NOT_TESTABLE) for claim in found.values())


def test_a_verdict_on_single_factors_follows_what_was_planted_of_them(tmp_path):
    rng = np.random.default_rng(0)
    runs = run_rows(rng, "figure_3a", seeds=6, families=("empty",), difficulties=("easy", "hard"))
    known = rng.uniform(0.2, 0.9, len(runs))
    ridge = {"representation": "trained", "probe": "ridge", "quantity": "r2", "levels": "test"}
    probes = pd.DataFrame({"run": runs["run"], "factor": "goal.Position.x", "estimate": known, **ridge})
    others = probes.assign(factor="golfball.Velocity.x", estimate=0.0)
    success = 0.4 + 0.5 * known + 0.05 * rng.uniform(size=len(runs))
    tables = {"runs": runs.assign(success_test_deterministic=success), "probes": pd.concat([probes, others])}
    assert claims_on(tmp_path / "followed", tables)["4b-factors"].verdict(METRIC_OURS) == SUPPORTED
    tables["runs"] = runs.assign(success_test_deterministic=rng.uniform(0.5, 1.0, len(runs)))
    assert claims_on(tmp_path / "nothing", tables)["4b-factors"].verdict(METRIC_OURS) != SUPPORTED


@pytest.mark.parametrize(("within", "verdict"), [(3.0, SUPPORTED), (0.2, NOT_SUPPORTED)])
def test_an_estimator_is_noisy_where_its_replicates_differ_more_than_agents_do(tmp_path, within, verdict):
    rng = np.random.default_rng(0)
    runs = run_rows(rng, "figure_3a", seeds=20, families=("empty",), difficulties=("easy", "hard"))
    true = rng.normal(size=(len(runs), 1)) + within * rng.normal(size=(len(runs), 5))
    found = [mean_of_replicates(values) for values in true]
    rows = [
        {"run": run, "levels": levels, "units": one.n, "estimate": one.estimate, "low": one.low, "high": one.high}
        for run, one in zip(runs["run"], found, strict=True)
        for levels in ("train", "test")
    ]
    what = {"representation": "trained", "factor": "all", "probe": "jsd", "quantity": "accuracy"}
    claim = claims_on(tmp_path, {"runs": runs, "probes": pd.DataFrame(rows).assign(**what)})["5a-variance"]
    assert claim.verdict(METRIC_OURS) == verdict
    (one,) = claim.tests(METRIC_OURS)
    assert one.found.estimate == pytest.approx(within**2 / (1 + within**2), abs=0.03)


def test_a_line_that_holds_in_all_panels_predicts_a_new_one():
    rng = np.random.default_rng(0)
    table = pd.DataFrame({"x": rng.normal(size=60), "family": np.repeat(["a", "b", "c"], 20), "difficulty": "easy"})
    table["y"] = 2 * table["x"] + 0.1 * rng.normal(size=60)
    table["noise"] = rng.normal(size=60)
    found = left_out(table, "y", {"x": ["x"], "noise": ["noise"]}).set_index("predictors")
    assert found.loc["x", "r2_left_out"] > 0.98
    assert found.loc["noise", "r2_left_out"] < 0.1


def test_every_claim_has_tests_that_can_be_stated_and_rows_and_every_sentence_a_claim(full):
    claims, evidence = STATEMENTS["claims"], STATEMENTS["evidence"]
    assert {*BESIDE, *NUMBERS} <= set(claims)
    values = pd.DataFrame({"family": ["empty"], "panel": ["empty-easy"], "auxiliary": ["curl"]})
    for name, words in claims.items():
        if "untested" in words:
            assert set(words) == {"where", "says", "untested", "needs"}
            continue
        assert {words["evidence"], words.get("else_needs", words["evidence"])} <= set(evidence)
        assert words["evidence"] in ROWS and words.get("runs", LEARNED) in (LEARNED, ALL_RUNS)
        assert all(one.test in TESTS for settings in METRICS for one in stated(name, settings, values))
        assert set(words) <= {
            "of", "where", "says", "evidence", "else_needs", "runs", "tests", "note", "supported", "not_supported", "undecided",
        }  # fmt: skip


def test_pairs_are_equal_in_what_they_share_and_a_run_without_a_partner_is_left_out():
    rows = pd.DataFrame({"n": [1, 1, 10, 50], "who": ["a", "b", "a", "b"], "gap": [3.0, 1.0, 5.0, 7.0]})
    assert differences(rows, "gap", {"who": ["a", "b"]}, ["n"])["difference"].tolist() == [2.0]
    both = differences(rows, "gap", {"who": [["a", "b"], ["b", "a"]]}, ["n"])
    assert both["difference"].tolist() == [2.0, -2.0]
