"""Correlations of a table of runs: what scipy and statsmodels say, and what a confound looks like."""

import numpy as np
import pytest
from scipy import stats
from statsmodels.stats.multitest import multipletests

from segar.analysis.stats.association import associations, holm
from segar.errors import SegarError
from tests.analysis.grids import grid


def one(table, **where):
    for name, value in where.items():
        table = table[table[name] == value]
    assert len(table) == 1
    return table.iloc[0]


@pytest.fixture(scope="module")
def runs():
    return grid(np.random.default_rng(0), seeds=3)


@pytest.fixture(scope="module")
def found(runs):
    return associations(runs, "w2", "gap")


def test_there_is_a_row_for_every_question(found):
    columns = "test panel method outliers removed estimate low high n p level note p_holm"
    assert " ".join(found.columns) == columns
    tests = ["pooled", "given panel", "given panel and log n", "given cell", "within"]
    assert list(dict.fromkeys(found["test"])) == tests
    assert len(found) == (4 + 9) * 2 * 3  # tests and panels, methods, outlier rules


def test_pooled_and_within_are_scipys(runs, found):
    pooled = one(found, test="pooled", method="spearman", outliers="kept")
    expected = stats.spearmanr(runs["w2"], runs["gap"])
    assert (pooled.estimate, pooled.p) == pytest.approx((expected.statistic, expected.pvalue))
    part = runs[(runs.family == "empty") & (runs.difficulty == "hard")]
    panel = one(found, test="within", panel="empty-hard", method="pearson", outliers="kept")
    expected = stats.pearsonr(part["w2"], part["gap"])
    assert (panel.estimate, panel.p, panel.n) == pytest.approx((expected.statistic, expected.pvalue, 15))


def test_an_effect_of_n_that_is_not_linear_in_its_logarithm_is_no_effect_of_w2_once_the_cell_is_given():
    rng = np.random.default_rng(2)
    runs = grid(rng, seeds=5, slope=0.0, noise=0.1)
    runs["gap"] -= 2.0 * (runs["n"] == 1)
    found = associations(runs, "w2", "gap")
    linear = one(found, test="given panel and log n", method="pearson", outliers="kept")
    assert linear.high < 0  # what log n leaves of one level looks like W2
    cell = one(found, test="given cell", method="pearson", outliers="kept")
    assert cell.low < 0 < cell.high


def test_panels_are_corrected_together_and_other_tests_are_not(found):
    within = found[(found.test == "within") & (found.method == "pearson") & (found.outliers == "kept")]
    assert within.p_holm.to_numpy() == pytest.approx(multipletests(within.p, method="holm")[1])
    assert found[found.test != "within"].p_holm.isna().all()
    assert holm([0.01, np.nan, 0.04]) == pytest.approx([0.02, np.nan, 0.04], nan_ok=True)


def test_the_two_outlier_rules_find_different_points(runs):
    """A run that is far from its panel, but not from all runs, is an outlier of residuals alone."""
    runs = runs.copy()
    level = np.repeat(np.arange(9.0), 15)
    runs["gap"] = 10 * level + 0.1 * np.random.default_rng(2).normal(size=len(runs))
    runs.loc[0, "gap"] = 5.0
    found = associations(runs, "w2", "gap")
    counts = {rule: one(found, test="pooled", method="pearson", outliers=rule).removed for rule in set(found.outliers)}
    assert counts["kept"] == 0 and counts["removed: points"] < counts["removed: residuals"]


def test_what_cannot_be_computed_has_a_note():
    runs = grid(np.random.default_rng(3))  # one run in each cell
    runs.loc[runs.family == "empty", "gap"] = 1.0
    found = associations(runs, "w2", "gap")
    cell = one(found, test="given cell", method="pearson", outliers="kept")
    assert np.isnan(cell.estimate) and "too few for" in cell.note
    silent = one(found, test="within", panel="empty-easy", method="pearson", outliers="kept")
    assert np.isnan(silent.estimate) and silent.note == "all points have the same value"


def test_a_missing_column_is_named():
    with pytest.raises(SegarError, match="no column 'w2_exat'"):
        associations(grid(np.random.default_rng(0)), "w2_exat", "gap")
