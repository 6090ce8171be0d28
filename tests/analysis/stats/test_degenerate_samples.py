"""Samples that say next to nothing: no function gives them an interval without width, or a p that no test could give."""

import itertools

import numpy as np
import pandas as pd
import pytest

from segar.analysis.probes.factors import ratio_over_groups
from segar.analysis.stats.correlation import correlate, explained
from segar.analysis.stats.estimate import Estimate, mean_of_replicates
from segar.analysis.stats.prediction import left_out
from segar.analysis.stats.ranking import places
from segar.analysis.stats.resampling import cluster_jackknife, mean_of_units
from segar.analysis.stats.scores import aggregates, performance_profiles, probability_of_improvement


def runs(**scores: list[float]) -> pd.DataFrame:
    """A row for each algorithm and seed, on one task."""
    rows = [(name, seed, "a", value) for name, values in scores.items() for seed, value in enumerate(values)]
    return pd.DataFrame(rows, columns=["algorithm", "seed", "task", "score"])


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def of_clusters(values: list[float]) -> Estimate:
    table = pd.DataFrame({"cluster": np.arange(len(values)) // 2, "x": values})
    return cluster_jackknife(table, lambda part: float(part["x"].mean()), ["cluster"])


FUNCTIONS = {
    "mean_of_replicates": lambda x: mean_of_replicates(x, 0.5),
    "mean_of_units": lambda x: mean_of_units(x, "runs", 0.0, 1.0, chance=0.5),
    "ratio_over_groups": lambda x: ratio_over_groups(np.array(x), np.ones(len(x)), np.arange(len(x)), rng(), above=0.5),
    "pearson": lambda x: correlate(np.array(x), 2 * np.array(x)).pearson,
    "spearman": lambda x: correlate(np.array(x), -(np.array(x) ** 3)).spearman,
}


@pytest.mark.parametrize("name", FUNCTIONS)
@pytest.mark.parametrize("sample", [[1.0], [1.0, 1.0], [0.1] * 3, [1.0] * 20, [0.0] * 7, [0.3, 0.1 + 0.2, 0.3]])
def test_equal_values_have_neither_an_interval_nor_a_p(name, sample):
    found = FUNCTIONS[name](sample)
    assert np.isnan([found.low, found.high, found.p]).all() and found.note


@pytest.mark.parametrize("values", [[1.0] * 4, [2.0, 2.0, 2.0, 2.0, 2.0, 2.0], [1.0, 3.0, 1.0, 3.0]])
def test_clusters_with_one_mean_have_no_interval(values):
    found = of_clusters(values)
    assert np.isnan([found.low, found.high, found.p]).all() and found.note == "all units are alike: no interval"


@pytest.mark.parametrize("points", [3, 4, 5, 7, 9, 12])
def test_a_perfect_correlation_has_no_interval_and_the_p_of_its_order_among_all(points):
    x = np.arange(float(points))
    ordered = correlate(x, np.exp(x)).spearman
    assert ordered.note == "points in perfect order have no interval"
    for found, r in ((correlate(x, 3 - 2 * x).pearson, -1), (ordered, 1)):
        assert found.estimate == pytest.approx(r)
        assert np.isnan([found.low, found.high]).all() and found.note
        assert found.p == pytest.approx(2 / np.prod(np.arange(1.0, points + 1)))
    table = pd.DataFrame({"cluster": np.arange(points), "x": x, "y": 2 * x})
    whole = cluster_jackknife(table, lambda t: float(np.corrcoef(t["x"], t["y"])[0, 1]), ["cluster"], correlation=True)
    assert np.isnan([whole.low, whole.high]).all()


@pytest.mark.parametrize("count", [1, 2])
def test_scores_of_one_or_two_runs_have_no_interval(count):
    table = runs(a=[0.3, 0.4][:count], b=[0.1, 0.2][:count])
    for found in (
        aggregates(table, "score", rng(), task=["task"]),
        performance_profiles(table, "score", [0.0, 0.25], rng(), task=["task"]),
    ):
        assert found[["low", "high"]].isna().all(axis=None)
        assert set(found["note"]) == {f"{count} seed{'s' * (count > 1)}: no interval"}
    better = probability_of_improvement(table, "score", "a", "b", rng(), task=["task"])
    assert better.estimate == 1.0 and "no interval" in better.note
    assert np.isnan([better.low, better.high, better.p]).all()


def test_equal_scores_have_no_interval_of_their_mean():
    found = aggregates(runs(a=[0.3] * 5), "score", rng(), task=["task"])
    assert found[["low", "high"]].isna().all(axis=None) and set(found["note"]) == {"all units are alike: no interval"}


@pytest.mark.parametrize(("a", "b"), [(3, 3), (3, 4), (4, 5), (6, 6)])
def test_no_p_of_an_improvement_is_below_that_of_the_best_deal(a, b):
    """By going through all deals: those in which the first are all above the others, or all below."""
    scores = np.arange(float(a + b))
    table = runs(a=scores[b:].tolist(), b=scores[:b].tolist())
    found = probability_of_improvement(table, "score", "a", "b", rng(), task=["task"])
    extreme = [abs(sum(one) / a - sum(set(scores) - set(one)) / b) for one in itertools.combinations(scores, a)]
    attainable = np.mean(np.isclose(extreme, max(extreme)))
    assert found.p >= attainable - 1e-12 and np.isnan([found.low, found.high]).all()


def test_what_differs_by_rounding_only_is_a_tie():
    scores = {"a": [0.3] * 4 + [0.5], "b": [0.1 + 0.2] * 4 + [0.5]}
    assert probability_of_improvement(runs(**scores), "score", "a", "b", rng(), task=["task"]).p == 1.0
    assert set(places(pd.DataFrame(scores)).values()) == {(1, 2)}


@pytest.mark.parametrize("hole", [np.nan, np.inf, 0.3])
def test_no_share_is_explained_of_what_does_not_vary_and_none_with_missing_values(hole):
    x, y = np.arange(9.0), np.where(np.arange(9) % 2, 0.3, 0.1 + 0.2)
    x[4] = hole
    y = y if hole == 0.3 else np.arange(9.0)
    table = pd.DataFrame({"x": x, "y": y, "group": np.arange(9) // 3})
    assert np.isnan(explained(y, x[:, None])) and np.isnan(
        left_out(table, "y", {"x": ["x"]}, ["group"])["r2_left_out"][0]
    )
    assert mean_of_replicates([1.0, 2.0, np.nan]).note == "some values are missing or not finite"


def test_samples_that_vary_keep_their_intervals():
    for name in ("mean_of_replicates", "mean_of_units", "ratio_over_groups"):
        found = FUNCTIONS[name]([0.4, 0.7, 0.6, 0.9])
        assert found.low < found.estimate < found.high and 0 < found.p < 1 and not found.note
