"""Clusters and panels: intervals that hold, and p-values that keep their promise, although runs share things."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from segar.analysis.stats.correlation import indicators
from segar.analysis.stats.resampling import cluster_jackknife, no_interval, permutation_of_blocks
from segar.errors import SegarError
from tests.analysis.grids import grid


def rng(seed=0):
    return np.random.default_rng(seed)


def mean_of_y(table):
    return float(table["y"].mean())


def clustered(seed, clusters=20, size=5, shared=1.0):
    draw = rng(seed)
    of_cluster = draw.normal(scale=shared, size=clusters)
    y = np.repeat(of_cluster, size) + 0.3 * draw.normal(size=clusters * size)
    return pd.DataFrame({"c": np.repeat(np.arange(clusters), size), "row": np.arange(len(y)), "y": y})


def r_of(table):
    return float(np.corrcoef(table["x"], table["y"])[0, 1])


def test_the_jackknife_of_a_mean_of_equal_clusters_is_students_test_of_their_means():
    table = clustered(3, clusters=6)
    expected = stats.ttest_1samp(table.groupby("c")["y"].mean(), 0.0)
    interval = expected.confidence_interval()
    found = cluster_jackknife(table, mean_of_y, ("c",))
    assert (found.low, found.high, found.p, found.n) == pytest.approx((*interval, expected.pvalue, 6))
    assert found.estimate == pytest.approx(table["y"].mean())


def test_the_jackknife_of_a_correlation_keeps_its_size_and_its_interval_within_one():
    rejected = 0
    for seed in range(150):
        table = clustered(seed, clusters=6).assign(x=clustered(1000 + seed, clusters=6)["y"])
        found = cluster_jackknife(table, r_of, ("c",), correlation=True)
        assert -1 < found.low <= found.estimate <= found.high < 1
        rejected += found.p < 0.05
    assert rejected / 150 == pytest.approx(0.05, abs=0.05)


def test_rows_and_values_say_the_same():
    table = clustered(4).assign(x=clustered(5)["y"])
    values = table[["x", "y"]].to_numpy()
    a = cluster_jackknife(table, r_of, ("c",))
    b = cluster_jackknife(table, lambda part: float(np.corrcoef(part.T)[0, 1]), ("c",), values=values)
    assert a.row() == pytest.approx(b.row())


def test_what_leaving_out_one_cluster_takes_away_has_no_interval():
    table = pd.DataFrame({"c": [0, 0, 1, 1], "x": [1.0, 2.0, 3.0, 3.0], "y": [1.0, 3.0, 2.0, 4.0]})
    with np.errstate(invalid="ignore"):
        found = cluster_jackknife(table, r_of, ("c",))
    assert np.isfinite(found.estimate) and np.isnan(found.low) and "has no value" in found.note
    with pytest.raises(SegarError, match="at least 2"):
        cluster_jackknife(clustered(0, clusters=1), mean_of_y, ("c",))


@pytest.mark.parametrize(("clusters", "note"), [(1, "one block has no interval"), (2, "2 blocks: no interval")])
def test_a_number_of_few_blocks_has_no_interval_and_says_how_many(clusters, note):
    found = no_interval(1.5, clusters)
    assert (found.estimate, found.n, found.note) == (1.5, clusters, note)
    assert np.isnan([found.low, found.high, found.p]).all()


def given_panel(table, *more):
    """A constant, the panels, and more columns."""
    panels = indicators(list(table["family"] + table["difficulty"]))
    return np.column_stack([np.ones(len(table)), panels, *(np.log(table[name]) for name in more)])


def test_permutation_of_blocks_keeps_its_size_whatever_panels_and_blocks_do():
    """The gap has no law that a t-test knows, panels differ, and the runs of a block share what blocks do not; 5 % of tests
    say p < 0.05 all the same."""
    p = []
    for seed in range(200):
        table = grid(rng(seed), slope=0.0, noise=0.0, panel_sd=3.0, seeds=4)
        blocks = table.groupby(["family", "difficulty", "seed"]).ngroup()
        shared = rng(2000 + seed).normal(size=(2, 1 + blocks.max()))
        table["gap"] += rng(1000 + seed).standard_exponential(len(table)) ** 2 + 3 * shared[0][blocks]
        table["w2"] += shared[1][blocks]
        p.append(permutation_of_blocks(table, "w2", "gap", given_panel(table, "n"), rng(seed), resamples=99).p)
    assert np.mean(np.array(p) <= 0.05) == pytest.approx(0.05, abs=0.045)
    assert stats.kstest(p, "uniform").statistic < 0.12


def test_with_blocks_of_one_row_in_one_panel_it_is_scipys_permutation_test():
    table = grid(rng(4)).iloc[:12].assign(w2=lambda t: t["gap"] + 2 * rng(5).normal(size=12))
    table = table.assign(family="empty", difficulty="easy", n=1, seed=range(12))
    a, b = table["w2"].to_numpy(), table["gap"].to_numpy()
    expected = stats.permutation_test(
        (a,), lambda x: stats.pearsonr(x, b).statistic, permutation_type="pairings", n_resamples=999, rng=rng(6)
    )
    found = permutation_of_blocks(table, "w2", "gap", np.ones((12, 1)), rng(7), resamples=999)
    assert found.estimate == pytest.approx(expected.statistic)
    assert found.p == pytest.approx(expected.pvalue, abs=0.05)


def test_nothing_to_permute_says_so():
    table = grid(rng(0), scatter=0.0, seeds=2)
    table["w2"] = table["family"].map({"empty": 1.0, "objectsx1": 2.0, "tilesx1": 3.0})
    with pytest.raises(SegarError, match="does not vary given the covariates"):
        permutation_of_blocks(table, "w2", "gap", given_panel(table), rng())
    table["w2"] = [np.nan, *rng().random(len(table) - 1)]
    with pytest.raises(SegarError, match="has missing values"):
        permutation_of_blocks(table, "w2", "gap", given_panel(table), rng())
    with pytest.raises(SegarError, match="a covariate of gap and w2 has missing values"):
        permutation_of_blocks(table, "gap", "w2", np.full((len(table), 1), np.nan), rng())
    one = grid(rng(0), seeds=1)
    with pytest.raises(SegarError, match="one block"):
        permutation_of_blocks(one, "w2", "gap", given_panel(one), rng())
