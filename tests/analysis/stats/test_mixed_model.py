"""The mixed model: least squares where nothing is shared, planted effects and variances, honest p-values."""

import numpy as np
import pandas as pd
import pytest
import statsmodels.formula.api as smf

from segar.analysis.stats.mixed import mixed_model
from segar.errors import SegarError
from tests.analysis.grids import grid


def rng(seed=0):
    return np.random.default_rng(seed)


def test_where_runs_share_nothing_it_is_least_squares():
    runs = grid(rng(0), seeds=4, panel_sd=0.0)
    found = mixed_model(runs, "gap", ["w2"], random=("seed",)).term("w2")
    line = smf.ols("gap ~ w2", runs).fit()
    assert found.estimate == pytest.approx(line.params["w2"], rel=0.02)
    assert found.high - found.low == pytest.approx(np.ptp(line.conf_int().loc["w2"]), rel=0.05)


def test_planted_slope_and_variances_come_out():
    runs = grid(rng(1), seeds=12, slope=-3.0, noise=0.2, panel_sd=1.0, seed_sd=0.5)
    found = mixed_model(runs, "gap", ["w2"])
    assert found.term("w2").low < -3 < found.term("w2").high
    sd = np.sqrt(found.random.set_index("effect")["variance"])
    assert 0.5 < sd["family x difficulty"] < 2 and 0.25 < sd["seed"] < 1
    assert sd["residual"] == pytest.approx(0.2, rel=0.1)
    assert found.random["share"].sum() == pytest.approx(1)
    assert list(found.random["groups"]) == [9, 12, 540]


def test_it_is_the_slope_of_statsmodels_own_random_intercept():
    runs = grid(rng(2), seeds=3, panel_sd=1.0)
    runs["panel"] = runs["family"] + runs["difficulty"]
    theirs = smf.mixedlm("gap ~ w2", runs, groups=runs["panel"]).fit()
    ours = mixed_model(runs, "gap", ["w2"], random=(("family", "difficulty"),))
    assert ours.term("w2").estimate == pytest.approx(theirs.params["w2"], rel=1e-3)


def test_log_n_beside_w2_and_slopes_in_standard_deviations():
    runs = grid(rng(3), seeds=3, panel_sd=0.5)
    plain = mixed_model(runs, "gap", ["w2", "n"], log=["n"])
    scaled = mixed_model(runs, "gap", ["w2", "n"], log=["n"], standardise=True)
    assert list(plain.fixed["term"]) == ["intercept", "w2", "log n"]
    ratio = runs["w2"].std() / runs["gap"].std()
    assert scaled.term("w2").estimate == pytest.approx(plain.term("w2").estimate * ratio, rel=1e-3)


def more_likely(runs, variances):
    """Twice the restricted log likelihood of the variances of panels, seeds and the rest, but for a constant."""
    effects = [runs["family"] + runs["difficulty"], runs["seed"]]
    members = [pd.get_dummies(one).to_numpy(float) for one in effects]
    covariance = variances[2] * np.eye(len(runs)) + sum(v * m @ m.T for v, m in zip(variances, members, strict=False))
    x, inverse = np.column_stack([np.ones(len(runs)), runs["w2"]]), np.linalg.inv(covariance)
    information = x.T @ inverse @ x
    left = runs["gap"] - x @ np.linalg.solve(information, x.T @ inverse @ runs["gap"])
    return -np.linalg.slogdet(covariance)[1] - np.linalg.slogdet(information)[1] - left @ inverse @ left


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("panel_sd", "seed_sd"), [(0.0, 0.3), (2.0, 0.0), (0.0, 0.0), (0.05, 3.0)])
def test_no_other_variances_are_more_likely_also_where_one_is_at_its_bound(seed, panel_sd, seed_sd):
    runs = grid(rng(seed), seeds=4, panel_sd=panel_sd, seed_sd=seed_sd)
    model = mixed_model(runs, "gap", ["w2"])
    found = model.random["variance"].to_numpy()
    best = more_likely(runs, found)
    assert all(more_likely(runs, found * factors) <= best + 1e-6 for factors in rng(seed).uniform(0.3, 3, (50, 3)))
    assert all(more_likely(runs, found + added) <= best + 1e-6 for added in np.diag([1e-4, 1e-4, 0]))
    assert (model.note == "") == bool((found[:2] > 1e-6 * found[2]).all())


def test_units_change_nothing():
    runs = grid(rng(0), seeds=4, panel_sd=0.3, seed_sd=0.1)
    others = runs.assign(gap=1e4 + 1e-4 * runs["gap"], w2=1e5 * runs["w2"])
    found, same = (mixed_model(one, "gap", ["w2"]) for one in (runs, others))
    assert found.note == same.note == ""
    np.testing.assert_allclose(same.random["share"], found.random["share"], rtol=1e-4)
    ends = [[getattr(one.term("w2"), name) for name in ("estimate", "low", "high")] for one in (found, same)]
    np.testing.assert_allclose(np.multiply(ends[1], 1e9), ends[0], rtol=1e-4)


@pytest.mark.slow
def test_its_size_is_five_percent_with_panels_and_seeds():
    runs = [grid(rng(s), 3, slope=0.0, panel_sd=0.5, seed_sd=0.3) for s in range(500)]
    p = np.array([mixed_model(one, "gap", ["w2"]).term("w2").p for one in runs])
    assert np.mean(p < 0.05) == pytest.approx(0.05, abs=0.025)


@pytest.mark.parametrize(
    ("x", "options", "runs", "message"),
    [
        ("w3", {}, 45, "no column 'w3'"),
        ("w2", {"log": ["n"]}, 45, "'n' is not among x"),
        ("one", {}, 45, "does not vary"),
        ("rounded", {}, 45, "does not vary"),
        ("w2", {"random": ["one", "one"]}, 45, "the model is singular: an effect has one group"),
        ("w2", {}, 0, "0 runs are too few"),
        ("w2", {}, 3, "3 runs are too few"),
    ],
)
def test_what_cannot_be_fitted_is_named(x, options, runs, message):
    with pytest.raises(SegarError, match=message):
        mixed_model(grid(rng(0)).assign(one=1.0, rounded=[0.3] * 44 + [0.1 + 0.2]).head(runs), "gap", [x], **options)


def test_terms_that_say_the_same_are_refused():
    runs = grid(rng(0)).assign(twice=lambda table: 2 * table["w2"] + 1)
    with pytest.raises(SegarError, match="terms say the same"):
        mixed_model(runs, "gap", ["w2", "twice"])
