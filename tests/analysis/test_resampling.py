"""Clusters and panels: intervals that hold, and p-values that keep their promise, although runs share things."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from analysis.stats.resampling import cluster_bootstrap, permutation_within
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


def test_the_interval_of_clusters_holds_and_that_of_rows_does_not():
    held = {"c": 0, "row": 0}
    for seed in range(60):
        table = clustered(seed)
        for name in held:
            found = cluster_bootstrap(table, mean_of_y, (name,), rng(seed), resamples=150)
            held[name] += found.low < 0 < found.high
    assert held["c"] / 60 > 0.87
    assert held["row"] / 60 < 0.75


def test_the_error_of_a_mean_of_clusters_is_that_of_the_mean_of_their_means():
    table = clustered(3)
    means = table.groupby("c")["y"].mean()
    found = cluster_bootstrap(table, mean_of_y, ("c",), rng(), resamples=2000)
    half = 1.96 * means.std(ddof=0) / np.sqrt(20)
    assert (found.high - found.low) / 2 == pytest.approx(half, rel=0.1)
    assert found.n == 20 and found.estimate == pytest.approx(table["y"].mean())


def test_one_cluster_says_that_it_is_too_few():
    with pytest.raises(SegarError, match="at least 2"):
        cluster_bootstrap(clustered(0, clusters=1), mean_of_y, ("c",), rng())


def test_a_bootstrap_repeats_itself_from_its_seed():
    a, b = (cluster_bootstrap(clustered(1), mean_of_y, ("c",), rng(7), resamples=100) for _ in range(2))
    assert a == b


@pytest.mark.parametrize("given", [(), ("n",)])
def test_permutation_within_panels_keeps_its_size_whatever_panels_do(given):
    """The gap has no law that a t-test knows, and panels differ; 5 % of tests say p < 0.05 all the same."""
    p = []
    for seed in range(200):
        table = grid(rng(seed), slope=0.0, noise=0.0, panel_sd=3.0)
        table["gap"] += rng(1000 + seed).standard_exponential(len(table)) ** 2
        p.append(permutation_within(table, "w2", "gap", rng(seed), given=given, resamples=99).p)
    assert np.mean(np.array(p) <= 0.05) == pytest.approx(0.05, abs=0.045)
    assert stats.kstest(p, "uniform").statistic < 0.12


def test_permutation_finds_what_is_there():
    found = permutation_within(grid(rng(1), seeds=3), "w2", "gap", rng(2), resamples=499)
    assert found.estimate < -0.4 and found.p <= 0.01 and found.n == 135


def test_without_panels_it_is_scipys_permutation_test():
    table = grid(rng(4)).iloc[:12].assign(w2=lambda t: t["gap"] + 2 * rng(5).normal(size=12))
    a, b = table["w2"].to_numpy(), table["gap"].to_numpy()
    expected = stats.permutation_test(
        (a,), lambda x: stats.pearsonr(x, b).statistic, permutation_type="pairings", n_resamples=999, rng=rng(6)
    )
    found = permutation_within(table, "w2", "gap", rng(7), within=(), resamples=999)
    assert found.estimate == pytest.approx(expected.statistic)
    assert found.p == pytest.approx(expected.pvalue, abs=0.05)


def test_nothing_to_permute_says_so():
    table = grid(rng(0), scatter=0.0).assign(
        w2=lambda t: t["family"].map({"empty": 1.0, "objectsx1": 2.0, "tilesx1": 3.0})
    )
    with pytest.raises(SegarError, match="does not vary within panels"):
        permutation_within(table, "w2", "gap", rng())
