"""The verdicts of rules 3 where the truth is known: nothing, an effect with one level alone, missing runs, no room."""

import numpy as np
import pandas as pd
import pytest

from segar.analysis.report.claims.claim import LEARNED, METRIC_OURS
from segar.analysis.report.claims.evidence import Evidence
from segar.analysis.report.claims.reading import read_claims
from segar.analysis.report.claims.verdicts import NOT_SUPPORTED, NOT_TESTABLE, NOT_YET, SUPPORTED, UNDECIDED
from segar.analysis.report.results import read_results
from tests.synthetic_results import run_rows, write_results

HEADLINE = ("3a", "3a-panel", "3a-n", "3a-cell")


def claims_of(folder, runs, missing=None):
    write_results(folder, {"runs": runs})
    if missing is not None:
        missing.to_csv(folder / "missing.csv", index=False)
    return {claim.name: claim for claim in read_claims(Evidence(read_results(folder)))}


def grid(seeds=6):
    """The main grid, with names as runs have them, and a gap in success that is a tenth of that in returns."""
    runs = run_rows(np.random.default_rng(0), "figure_3a", seeds=seeds)
    parts = (runs[name].astype(str) for name in ("family", "difficulty", "n", "seed"))
    runs["run"] = [f"{f}-{d}-n{n}-rgb_stack2-ppo_fast-s{s}-0a1b" for f, d, n, s in zip(*parts, strict=True)]
    return with_gap(runs, runs["gap_deterministic"])


def with_gap(runs, gap):
    gaps = {"gap_deterministic": gap, "gap_ref_deterministic": 0.9 * gap}
    success = {"success_train_deterministic": 0.95, "success_test_deterministic": (0.95 + 0.1 * gap).clip(0, 1)}
    return runs.assign(**gaps, eta_test_deterministic=runs["eta_train_deterministic"] + gap, **success)


def lacking(runs, name="figure_3a"):
    return pd.DataFrame({"run": runs["run"], "reason": "not begun", "name": name, "experiment": "a title"})


def verdicts_of(claims, names=HEADLINE):
    return {name: claims[name].verdict(METRIC_OURS) for name in names}


def test_an_effect_of_the_distance_is_supported_and_a_gap_of_noise_is_not(tmp_path):
    runs, rng = grid(), np.random.default_rng(1)
    assert set(verdicts_of(claims_of(tmp_path / "effect", runs)).values()) == {SUPPORTED}
    noise = with_gap(runs, pd.Series(-2.0 + 0.5 * rng.normal(size=len(runs))))
    found = verdicts_of(claims_of(tmp_path / "nothing", noise))
    assert SUPPORTED not in found.values() and found["3a-cell"] == found["3a-panel"] == NOT_SUPPORTED


def test_an_effect_with_one_level_alone_is_never_supported_and_the_dummy_stands_beside_it(tmp_path):
    runs, rng = grid(), np.random.default_rng(1)
    one = runs["n"] == 1
    alone = pd.Series(np.where(one, runs["gap_deterministic"] - 2.0, -2.0) + 0.2 * rng.normal(size=len(runs)))
    found = claims_of(tmp_path, with_gap(runs, alone))
    assert set(verdicts_of(found, ("3a-n", "3a-cell")).values()) == {UNDECIDED}
    assert SUPPORTED not in verdicts_of(found).values()
    (finding,) = found["3a-panel"].tests(METRIC_OURS)
    assert finding.beside.startswith("[n = 1] −0.9") and "log n" in finding.beside
    assert "Without the runs with one training level" in found["3a-cell"].follows


@pytest.mark.parametrize("at_random", [True, False])
def test_three_tenths_missing_give_no_verdict_whether_or_not_they_are_missing_at_random(tmp_path, at_random):
    runs = grid()
    order = np.random.default_rng(0).permutation(len(runs)) if at_random else np.argsort(runs["gap_deterministic"])
    gone = runs.iloc[order[: int(0.3 * len(runs))]]
    there = runs.drop(gone.index).reset_index(drop=True)
    found = claims_of(tmp_path, there, lacking(gone))
    assert set(verdicts_of(found).values()) == {NOT_YET}
    assert str(found["3a"].planned) == "189 of 270 planned runs are there, 81 are missing"


def test_a_tenth_may_be_missing_and_a_claim_about_one_family_asks_for_that_family_alone(tmp_path):
    runs = grid()
    gone = runs[runs["family"] == "objectsx1"]
    found = claims_of(tmp_path / "family", runs.drop(gone.index).reset_index(drop=True), lacking(gone))
    assert found["3b-empty"].verdict(METRIC_OURS) == SUPPORTED and found["3b-empty"].planned.planned == 90
    assert found["3b-trend"].verdict(METRIC_OURS) == found["3a"].verdict(METRIC_OURS) == NOT_YET
    few = runs.sample(n=27, random_state=0)
    found = claims_of(tmp_path / "few", runs.drop(few.index).reset_index(drop=True), lacking(few))
    assert set(verdicts_of(found).values()) == {SUPPORTED}
    assert found["3a"].planned.present == 243


def test_an_outcome_without_room_for_the_margin_cannot_be_tested(tmp_path):
    """All agents solve nearly all levels, whatever they were trained on; the returns go on to differ a little."""
    runs = with_gap(grid(), pd.Series(0.02 * np.random.default_rng(0).normal(size=270) - 0.1))
    success = 0.99 - 0.001 * runs["seed"]
    almost = {"success_train_deterministic": success, "success_test_deterministic": success - 0.001 * runs["seed"]}
    easy = claims_of(tmp_path, runs.assign(**almost))
    assert set(verdicts_of(easy, (*HEADLINE, "5b-easy")).values()) == {NOT_TESTABLE}
    assert "no room" in easy["5b-easy"].tests(METRIC_OURS, LEARNED)[0].lacks_room


def test_p_is_corrected_over_all_claims_of_a_maker_whether_or_not_they_can_be_tested(tmp_path):
    found = claims_of(tmp_path, grid())
    ours = [one for one in found.values() if one.of == "ours"]
    p = {one.name: one.largest_p(METRIC_OURS, LEARNED) for one in ours}
    least = min(p, key=p.__getitem__)
    assert found[least].corrected[METRIC_OURS, LEARNED] == pytest.approx(len(p) * p[least])
    assert all(one.corrected[METRIC_OURS, LEARNED] == 1 for one in ours if not one.findings)
