"""The verdicts of rules 3 where the truth is known: nothing, an effect with one level alone, missing runs, no room."""

from itertools import product

import numpy as np
import pandas as pd
import pytest

from segar.analysis.report.claims.claim import LEARNED, METRIC_OURS
from segar.analysis.report.claims.verdicts import NOT_SUPPORTED, NOT_TESTABLE, NOT_YET, SUPPORTED, UNDECIDED
from segar.analysis.tables import write_csv
from segar.experiments.settings import MATCHED_DESIGNS
from tests.synthetic_results import claims_of, evidence_of, player_rows, run_rows, write_players

HEADLINE = ("3a", "3a-panel", "3a-n", "3a-cell")


def claims_on(folder, runs, missing=None):
    if missing is not None:
        folder.mkdir(exist_ok=True)
        missing.to_csv(folder / "missing.csv", index=False)
    return claims_of(evidence_of(folder, {"runs": runs}))


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


def test_a_gap_of_noise_is_no_effect_of_the_distance(tmp_path):
    runs, rng = grid(), np.random.default_rng(1)
    found = verdicts_of(claims_on(tmp_path, with_gap(runs, pd.Series(-2.0 + 0.5 * rng.normal(size=len(runs))))))
    assert SUPPORTED not in found.values() and found["3a-cell"] == found["3a-panel"] == NOT_SUPPORTED


def test_an_effect_with_one_level_alone_is_never_supported_and_the_dummy_stands_beside_it(tmp_path):
    runs, rng = grid(), np.random.default_rng(1)
    one = runs["n"] == 1
    alone = pd.Series(np.where(one, runs["gap_deterministic"] - 2.0, -2.0) + 0.2 * rng.normal(size=len(runs)))
    found = claims_on(tmp_path, with_gap(runs, alone))
    assert set(verdicts_of(found, ("3a-n", "3a-cell")).values()) == {UNDECIDED}
    assert SUPPORTED not in verdicts_of(found).values()
    (finding,) = found["3a-panel"].tests(METRIC_OURS)
    assert finding.beside.startswith("[n = 1] −0.9") and "log n" in finding.beside
    assert "Without the runs with one training level" in found["3a-cell"].follows


def without(folder, runs, gone):
    """The claims on a grid of which some runs are missing."""
    return claims_on(folder, runs.drop(gone.index).reset_index(drop=True), lacking(gone))


def test_three_tenths_missing_give_no_verdict_whether_or_not_they_are_missing_at_random(tmp_path):
    runs = grid()
    found = without(tmp_path / "random", runs, runs.sample(n=81, random_state=0))
    assert set(verdicts_of(found).values()) == {NOT_YET}
    assert str(found["3a"].planned) == "189 of 270 planned runs are there, 81 are missing"
    found = without(tmp_path / "family", runs, runs[runs["family"] == "objectsx1"])
    assert set(verdicts_of(found, (*HEADLINE, "3b-trend")).values()) == {NOT_YET}
    # A claim about one family asks for that family alone.
    assert found["3b-empty"].verdict(METRIC_OURS) == SUPPORTED and found["3b-empty"].planned.planned == 90


def test_a_tenth_may_be_missing_and_p_is_corrected_over_all_claims_of_a_maker_whether_or_not_they_can_be_tested(
    tmp_path,
):
    runs = grid()
    found = without(tmp_path, runs, runs.sample(n=27, random_state=0))
    assert set(verdicts_of(found).values()) == {SUPPORTED}
    assert found["3a"].planned.present == 243
    ours = [one for one in found.values() if one.of == "ours"]
    p = {one.name: one.largest_p(METRIC_OURS, LEARNED) for one in ours}
    least = min(p, key=p.__getitem__)
    assert found[least].corrected[METRIC_OURS, LEARNED] == pytest.approx(len(p) * p[least])
    assert all(one.corrected[METRIC_OURS, LEARNED] == 1 for one in ours if not one.findings)


def test_an_outcome_without_room_for_the_margin_cannot_be_tested(tmp_path):
    """All agents solve nearly all levels, whatever they were trained on; the returns go on to differ a little."""
    runs = with_gap(grid(), pd.Series(0.02 * np.random.default_rng(0).normal(size=270) - 0.1))
    success = 0.99 - 0.001 * runs["seed"]
    almost = {"success_train_deterministic": success, "success_test_deterministic": success - 0.001 * runs["seed"]}
    easy = claims_on(tmp_path, runs.assign(**almost))
    assert set(verdicts_of(easy, (*HEADLINE, "5b-easy")).values()) == {NOT_TESTABLE}
    assert "no room" in easy["5b-easy"].tests(METRIC_OURS, LEARNED)[0].lacks_room


CHANGED = ("Mass+FloorFriction+rest", "Mass+Position+rest", "FloorFriction+Position+rest", "Mass", "Mass+Position")


@pytest.mark.parametrize(("knows", "verdict"), [("twins", SUPPORTED), ("both", UNDECIDED), ("nobody", NOT_SUPPORTED)])
def test_twins_foretell_a_cure_where_they_do_and_distance_does_not(tmp_path, knows, verdict):
    """Agents gain what a group of factors is worth; twins, or the distance, know what that is, or nobody does."""
    rng, parts, between = np.random.default_rng(5), [], []
    place = {"difficulties": ("medium",), "counts": (100,), "seeds": 3, "observation": "state"}
    for family, test in product(("empty", "objectsx1", "objectsx2", "tilesx1", "hazardtilesx1"), ("heavy", "light")):
        grid = {**place, "families": (family,), "variation": "moderate", "levels.test_variation": test}
        worth = dict(zip(("Position", "FloorFriction", "Mass"), rng.uniform(0.0, 0.4, 3), strict=True))
        noise = dict(zip(worth, rng.uniform(0.0, 0.4, 3), strict=True))
        success = {"success_train_deterministic": 0.95, "success_test_deterministic": 0.3}
        without = run_rows(rng, "twins", **grid).assign(**success)
        parts.append(without)
        for changed in CHANGED:
            (group,) = {*worth} - {*changed.split("+")} if changed.count("+") == 2 else ("Mass",)
            told, near = (worth if knows in who else noise for who in (("twins", "both"), ("both",)))
            there = {
                "test_changed": changed,
                "test_groups": "Mass+FloorFriction+Position",
                **{"test": "between", "test_family": family, "test_difficulty": "medium"},
                **{"test_variation": "moderate", "test_observation": "state"},
            }
            w2 = without["w2_exact"] * np.sqrt(1 - near[group])
            between.append(without.assign(**there, success_test_deterministic=0.3 + told[group], w2_exact=w2))
        for (group, value), share in product(worth.items(), (10, 30, 100)):
            cured = run_rows(rng, "twins_cure", design=f"{group}_of_test_{share}", **grid).assign(**success)
            gained = value * share / 30 + 0.02 * rng.normal(size=len(cured))
            parts.append(cured.assign(success_test_deterministic=0.3 + gained))
    runs, transfers = (pd.concat(some, ignore_index=True) for some in (parts, between))
    transfers = transfers.drop(columns=["levels.test_variation", "experiments", "hours", "code", "hash"])
    found = claims_of(evidence_of(tmp_path, {"runs": runs, "transfers": transfers}))["twins"]
    assert found.verdict(METRIC_OURS) == verdict and found.planned.present == 10 * 3 * (1 + 3 * 3)
    rank, _ = found.tests(METRIC_OURS)
    assert rank.found.n == 30 and (rank.found.estimate > 0.9) == (knows != "nobody")


def test_the_slope_of_regret_on_a_dose_is_found_and_sets_that_cannot_be_had_count_for_that_dose_alone(tmp_path):
    """Regret grows by a fifth for each standard deviation of W2, and not with the covering radius."""
    rng, parts = np.random.default_rng(3), []
    place = {"families": ("empty", "objectsx1"), "difficulties": ("medium",), "counts": (12, 20), "seeds": 10}
    for design, wanted in MATCHED_DESIGNS.items():
        if design != "matched_far_sparse":
            runs = run_rows(rng, "dose_response", design=design, observation="state", **place)
            regret = runs["n"] / 10 * (1 + 0.2 * wanted["w2"] + 0.1 * rng.normal(size=len(runs)))
            names = zip(runs["family"], runs["n"], runs["seed"], strict=True)
            run = [f"{family}-medium-{design}-n{n}-state-ppo_fast-s{seed}-0a1b" for family, n, seed in names]
            success = {"success_train_deterministic": 0.95, "success_test_deterministic": 0.5}
            parts.append(runs.assign(run=run, eta_test_deterministic=-regret, **success))
    runs = pd.concat(parts, ignore_index=True)
    write_players(tmp_path, player_rows())
    gone = runs[(runs["design"] == "matched_far_4.5") & (runs["seed"] > 7)]
    found = claims_on(tmp_path, runs.drop(gone.index), lacking(gone, "dose_response"))
    assert verdicts_of(found, ("dose-w2", "dose-coverage")) == {"dose-w2": SUPPORTED, "dose-coverage": NOT_SUPPORTED}
    (slope,) = found["dose-w2"].tests(METRIC_OURS)
    assert slope.found.estimate == pytest.approx(0.2, abs=0.02) and slope.margin == pytest.approx(0.2 / 3, abs=1e-6)
    assert [str(found[name].planned)[:10] for name in ("dose-w2", "dose-coverage")] == ["148 of 160", "120 of 120"]


@pytest.mark.parametrize(("billiards", "verdict"), [(5.0, SUPPORTED), (-1.0, NOT_SUPPORTED), (None, NOT_TESTABLE)])
def test_training_in_other_tasks_is_compared_with_play_in_each_of_them(tmp_path, billiards, verdict):
    """Agents in Invisiball reach more than play, agents in Billiards as much as is planted; None: play was not measured."""
    rng, panels = np.random.default_rng(4), {"billiards": 0.0 if billiards is None else billiards, "invisiball": 5.0}
    place = {"difficulties": ("",), "counts": (100,), "seeds": 6, "observation": "state"}
    runs = pd.concat([run_rows(rng, "other_tasks", families=(one,), **place) for one in panels], ignore_index=True)
    reached = runs["family"].map(panels) + 0.5 * rng.normal(size=len(runs)) - 20.0
    runs = runs.assign(eta_train_deterministic=reached, success_train_deterministic=0.0)
    if billiards is not None:
        floor = [
            {"family": one, "difficulty": "", "player": "floor", "return": -20.0, "success": 0.0} for one in panels
        ]
        write_players(tmp_path, pd.DataFrame(floor))
    assert claims_on(tmp_path, runs)["A-tasks"].verdict(METRIC_OURS) == verdict


@pytest.mark.parametrize(("knows", "verdict"), [("w1_policy", SUPPORTED), ("w2_exact", NOT_SUPPORTED)])
def test_similar_policies_tell_more_than_the_distance_where_the_regret_follows_them(tmp_path, knows, verdict):
    """What the regret does not follow of the three measures is noise; exact W2 is no part of any of them."""
    rng, place = (
        np.random.default_rng(5),
        {"families": ("empty", "objectsx1"), "difficulties": ("medium",), "counts": (10, 50)},
    )
    runs = [run_rows(rng, "matched_sets_states", design=one, seeds=10, **place) for one in ("matched", "matched_far")]
    runs = pd.concat(runs, ignore_index=True)
    names = ["w1_policy", "w2_response", "w2_uncontrollable"]
    sets = runs[["family", "difficulty", "n", "seed", "design"]].assign(
        **{name: rng.normal(size=len(runs)) for name in names}
    )
    runs["w2_exact"] = rng.normal(size=len(runs))
    known = (sets if knows in sets else runs)[knows]
    runs = runs.assign(
        eta_test_deterministic=-(5 + known + 0.5 * rng.normal(size=len(runs))), success_train_deterministic=0.95
    )
    write_players(tmp_path, player_rows())
    write_csv(tmp_path / "studies/training_sets_matched/training_sets.csv", sets)
    found = verdicts_of(claims_on(tmp_path, runs), ("D-policies", "D-exogenous"))
    assert found == {"D-policies": verdict, "D-exogenous": NOT_SUPPORTED}


@pytest.mark.parametrize(("part", "ratio", "verdicts"), [(0.02, 5.0, [SUPPORTED] * 2), (0.3, 1.5, [NOT_SUPPORTED] * 2)])
def test_studies_without_training_tell_what_is_planted_in_one_family_and_on_one_machine(
    tmp_path, part, ratio, verdicts
):
    """Dealing factors anew changes W2 by a part in Objects, and by nothing elsewhere; SEGAR is so many times as fast."""
    rng, places = np.random.default_rng(6), list(product(("empty", "objectsx1"), ("easy", "hard"), range(6), (1, 10)))
    sets = pd.DataFrame(places, columns=["family", "difficulty", "seed", "n"])
    panel, exact = sets["family"] + "-" + sets["difficulty"], rng.uniform(1, 2, len(sets))
    larger = part * (sets["family"] == "objectsx1") + 0.01 * rng.normal(size=len(sets)) + 9.0 * (sets["seed"] == 0)
    sets = sets[["n", "seed"]].assign(
        train=panel, test=panel, w2_exact=exact, w2_marginals=exact * (1 + larger), ks=0.5
    )
    write_csv(tmp_path / "studies/w2_study/distances.csv", sets)
    turns = pd.DataFrame(list(product("abcdefg", range(5))), columns=["platform", "turn"]).assign(speed=100.0)
    write_csv(
        tmp_path / "studies/platforms/platforms.csv",
        turns.assign(segar=100 * ratio * rng.uniform(0.8, 1.2, len(turns))),
    )
    found = claims_on(tmp_path, run_rows(rng, "figure_3a"))
    assert [found[name].verdict(METRIC_OURS) for name in ("marginals", "light")] == verdicts
