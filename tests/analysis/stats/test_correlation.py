"""Correlations: scipy's answers, planted answers, and p-values that keep their promise."""

import numpy as np
import pytest
from scipy import stats

from segar.analysis.stats.correlation import correlate, explained, indicators, without_outliers

PANELS = np.repeat([f"panel{i}" for i in range(9)], 5)


def rng(seed=0):
    return np.random.default_rng(seed)


@pytest.mark.parametrize("points", [3, 8, 45])
def test_pearson_is_scipys(points):
    x = rng(points).normal(size=points)
    y = x + rng(1).normal(size=points)
    found, expected = correlate(x, y).pearson, stats.pearsonr(x, y)
    assert found.estimate == pytest.approx(expected.statistic, rel=1e-12)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-9)
    if points > 3:
        assert (found.low, found.high) == pytest.approx(tuple(expected.confidence_interval(0.95)))


def test_spearman_is_scipys_where_there_are_many_points():
    x, y = rng(2).integers(0, 12, 45).astype(float), rng(3).integers(0, 12, 45).astype(float)  # with ties
    found, expected = correlate(x, y).spearman, stats.spearmanr(x, y)
    assert found.estimate == pytest.approx(expected.statistic, rel=1e-12)
    assert found.p == pytest.approx(expected.pvalue, rel=1e-9)


def test_a_partial_correlation_is_the_t_of_the_full_regression():
    """The p of a partial correlation equals that of the coefficient of x in y ~ x + covariates."""
    x, noise, z = rng(6).normal(size=(3, 30))
    other = rng(7).normal(size=30)
    x, y = x + z, 0.5 * x + z - other + noise
    covariates = np.column_stack([z, other])
    design = np.column_stack([np.ones(30), covariates, x])
    coefficients, _, _, _ = np.linalg.lstsq(design, y, rcond=None)
    errors = y - design @ coefficients
    variance = errors @ errors / (30 - 4) * np.linalg.inv(design.T @ design)
    t = coefficients[-1] / np.sqrt(variance[-1, -1])
    assert correlate(x, y, covariates).pearson.p == pytest.approx(2 * stats.t.sf(abs(t), 30 - 4))


def test_permuted_values_are_called_significant_5_times_in_100_given_panel_and_log_n():
    n = np.tile(np.log([1, 10, 50, 100, 200]), 9)
    covariates = np.column_stack([indicators(list(PANELS)), n])
    x = n + rng(12).normal(size=45)
    y = rng(13).standard_t(5, size=45)
    found = [correlate(x, rng(seed).permutation(y), covariates) for seed in range(1000)]
    assert np.mean([f.pearson.p < 0.05 for f in found]) == pytest.approx(0.05, abs=0.02)
    assert np.mean([f.spearman.p < 0.05 for f in found]) == pytest.approx(0.05, abs=0.02)


def test_explained_variance_of_panel_and_log_n():
    n = np.tile(np.log([1, 10, 50, 100, 200]), 9)
    panel = indicators(list(PANELS))
    y = panel @ np.arange(8.0) - n
    assert explained(y, np.column_stack([panel, n])) == pytest.approx(1)
    assert explained(y, panel) + explained(y, n[:, None]) == pytest.approx(1)  # a balanced design


@pytest.mark.parametrize(
    ("x", "y", "reason"),
    [
        ([], [], "0 points; at least 3 are needed"),
        ([1.0], [1.0], "1 point; at least 3 are needed"),
        ([1.0, 2], [1.0, 2], "2 points; at least 3 are needed"),
        ([1.0, 2, 3], [5.0, 5, 5], "all points have the same value"),
        ([1.0, 2, np.nan], [5.0, 6, 5], "some values are missing or not finite"),
    ],
)
def test_what_cannot_be_computed_says_why(x, y, reason):
    x, y = np.array(x), np.array(y)
    assert correlate(x, y).pearson.note == correlate(x, y).spearman.note == reason


def test_too_many_covariates_say_so():
    x, y = rng(15).normal(size=(2, 4))
    assert correlate(x, y, indicators(["a", "b", "c", "d"])).pearson.note == "4 points are too few for 3 covariates"


def test_a_column_that_the_covariates_explain_says_so():
    y = rng(16).normal(size=45)
    found = correlate(np.repeat(np.arange(9.0), 5), y, indicators(list(PANELS))).pearson
    assert found.note == "the covariates explain one of the two columns entirely" and np.isnan(found.estimate)


def test_below_ten_points_no_point_is_an_outlier():
    for points, kept in ((9, 9), (11, 10)):
        y = np.zeros(points)
        y[3] = 1e9
        assert without_outliers(np.arange(float(points)), y).sum() == kept
