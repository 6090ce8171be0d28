"""Correlations and lines: scipy's answers, planted answers, and p-values that keep their promise."""

import numpy as np
import pytest
from scipy import stats

from analysis.stats.correlation import (
    Correlation,
    Line,
    NotAvailable,
    correlate,
    explained,
    fit_line,
    indicators,
    without_outliers,
)

PANELS = np.repeat([f"panel{i}" for i in range(9)], 5)


def rng(seed=0):
    return np.random.default_rng(seed)


def available(found):
    assert not isinstance(found, NotAvailable), found
    return found


@pytest.mark.parametrize("points", [3, 8, 45])
def test_pearson_is_scipys(points):
    x = rng(points).normal(size=points)
    y = x + rng(1).normal(size=points)
    found, expected = available(correlate(x, y)), stats.pearsonr(x, y)
    assert found.pearson == pytest.approx(expected.statistic, rel=1e-12)
    assert found.pearson_p == pytest.approx(expected.pvalue, rel=1e-9)
    if points > 3:
        assert (found.pearson_low, found.pearson_high) == pytest.approx(tuple(expected.confidence_interval(0.95)))


def test_spearman_is_scipys_where_there_are_many_points():
    x, y = rng(2).integers(0, 12, 45).astype(float), rng(3).integers(0, 12, 45).astype(float)  # with ties
    found, expected = available(correlate(x, y)), stats.spearmanr(x, y)
    assert found.spearman == pytest.approx(expected.statistic, rel=1e-12)
    assert found.spearman_p == pytest.approx(expected.pvalue, rel=1e-9)


def test_four_runs_in_perfect_order_are_not_proof():
    found = available(correlate(np.array([1.0, 2, 3, 4]), np.array([4.0, 3, 2, 1.5])))
    assert found.spearman == pytest.approx(-1)
    assert found.spearman_p == pytest.approx(2 / 24)  # the order and its reverse, of 4! orders
    assert found.spearman_low is None


def test_the_line_is_scipys():
    x = rng(4).uniform(size=20)
    y = 3 * x + rng(5).normal(size=20)
    line, expected = available(fit_line(x, y)), stats.linregress(x, y)
    assert (line.slope, line.intercept) == pytest.approx((expected.slope, expected.intercept))


def test_the_band_holds_the_true_line_in_95_of_100_samples():
    x = np.linspace(0, 1, 20)
    at = np.array([0.0, 0.3, 1.0])
    held = []
    for seed in range(600):
        line = available(fit_line(x, 1 - 2 * x + rng(seed).normal(size=20)))
        held.append(np.abs(line.at(at) - (1 - 2 * at)) <= line.half_width(at))
    assert np.mean(held, axis=0) == pytest.approx(0.95, abs=0.03)


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
    assert available(correlate(x, y, covariates)).pearson_p == pytest.approx(2 * stats.t.sf(abs(t), 30 - 4))


def test_with_one_covariate_the_textbook_formula_holds():
    x, y, z = rng(8).normal(size=(3, 40))
    x, y = x + z, y + z
    r = np.corrcoef([x, y, z])
    expected = (r[0, 1] - r[0, 2] * r[1, 2]) / np.sqrt((1 - r[0, 2] ** 2) * (1 - r[1, 2] ** 2))
    assert available(correlate(x, y, z[:, None])).pearson == pytest.approx(expected)


def test_a_correlation_between_panels_alone_vanishes_within_them():
    level = np.repeat(np.arange(9.0), 5)
    x, y = level + rng(9).normal(scale=0.3, size=45), level + rng(10).normal(scale=0.3, size=45)
    assert available(correlate(x, y)).pearson > 0.95
    assert abs(available(correlate(x, y, indicators(list(PANELS)))).pearson) < 0.4


def test_a_correlation_that_panels_hide_appears_within_them():
    level = np.repeat(np.arange(9.0), 5)
    inside = rng(11).normal(size=45)
    x, y = 10 * level + inside, -10 * level + inside
    assert available(correlate(x, y)).pearson < -0.9
    assert available(correlate(x, y, indicators(list(PANELS)))).pearson == pytest.approx(1)


@pytest.mark.parametrize("given", ["nothing", "panel", "panel and log n"])
def test_permuted_values_are_called_significant_5_times_in_100(given):
    panel, n = indicators(list(PANELS)), np.tile(np.log([1, 10, 50, 100, 200]), 9)
    covariates = {"nothing": None, "panel": panel, "panel and log n": np.column_stack([panel, n])}[given]
    x = n + rng(12).normal(size=45)
    y = rng(13).standard_t(5, size=45)
    found = [available(correlate(x, rng(seed).permutation(y), covariates)) for seed in range(1000)]
    assert np.mean([f.pearson_p < 0.05 for f in found]) == pytest.approx(0.05, abs=0.02)
    assert np.mean([f.spearman_p < 0.05 for f in found]) == pytest.approx(0.05, abs=0.02)


def test_the_paper_s_p_value_belongs_to_its_45_points():
    """|r| = 0.597 with 45 points gives the p = 1.47e-5 that the paper reports."""
    x, z = rng(14).normal(size=(2, 45))
    x -= x.mean()
    z -= z.mean()
    z -= z @ x / (x @ x) * x
    y = -0.597 * x / np.linalg.norm(x) + np.sqrt(1 - 0.597**2) * z / np.linalg.norm(z)
    assert available(correlate(x, y)).pearson_p == pytest.approx(1.47e-5, rel=0.05)


def test_explained_variance_of_panel_and_log_n():
    n = np.tile(np.log([1, 10, 50, 100, 200]), 9)
    panel = indicators(list(PANELS))
    y = panel @ np.arange(8.0) - n
    assert available(explained(y, np.column_stack([panel, n]))) == pytest.approx(1)
    assert available(explained(y, panel)) + available(explained(y, n[:, None])) == pytest.approx(1)  # a balanced design


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
    assert correlate(x, y) == fit_line(x, y) == NotAvailable(reason)


def test_too_many_covariates_say_so():
    x, y = rng(15).normal(size=(2, 4))
    assert correlate(x, y, indicators(["a", "b", "c", "d"])) == NotAvailable("4 points are too few for 3 covariates")


def test_a_column_that_the_covariates_explain_says_so():
    y = rng(16).normal(size=45)
    found = correlate(np.repeat(np.arange(9.0), 5), y, indicators(list(PANELS)))
    assert found == NotAvailable("the covariates explain one of the two columns entirely")


def test_a_perfect_line_is_not_an_error():
    x = np.arange(10.0)
    found, line = available(correlate(x, -2 * x)), available(fit_line(x, -2 * x))
    assert isinstance(found, Correlation) and isinstance(line, Line)
    assert (found.pearson, found.pearson_p) == pytest.approx((-1, 0), abs=1e-6)
    assert line.slope == pytest.approx(-2)


def test_below_ten_points_no_point_is_an_outlier():
    for points, kept in ((9, 9), (11, 10)):
        y = np.zeros(points)
        y[3] = 1e9
        assert without_outliers(np.arange(float(points)), y).sum() == kept
