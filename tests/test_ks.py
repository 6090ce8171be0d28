"""Kolmogorov-Smirnov statistics: against scipy per factor, and against the search over all points for the joint."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy import stats

import segar
from segar import Charger, GolfBall, Gravity, LevelError, Levels, Magnet, Position
from segar.metrics import ks, ks_by_factor
from segar.metrics.kolmogorov import _largest_difference


def balls(points: np.ndarray) -> Levels:
    return Levels.from_entities([[GolfBall({Position: p})] for p in points])


def test_each_factor_has_the_statistic_of_scipy():
    a = segar.family("objectsx2-hard").sample(60, seed=0, split="train")
    b = segar.family("objectsx2-hard").sample(90, seed=0, split="test")
    by_factor = ks_by_factor(a, b)
    for kind, factor in ((Charger, segar.Charge), (Magnet, segar.Magnetism), (GolfBall, segar.Size)):
        column = a.layout.columns[factor]
        x, y = (s.values[s.types == s.layout.types.index(kind)][:, column] for s in (a, b))
        assert by_factor[f"{kind.__name__}.{factor.__name__}"] == pytest.approx(stats.ks_2samp(x, y).statistic)
    x, y = (s.values[:, s.layout.slot_index("golfball"), s.layout.columns[Position] + 1] for s in (a, b))
    assert by_factor["GolfBall.Position.y"] == pytest.approx(stats.ks_2samp(x, y).statistic)
    counts = [(s.types == s.layout.types.index(Charger)).sum(axis=1) for s in (a, b)]
    assert by_factor["Charger.count"] == pytest.approx(stats.ks_2samp(*counts).statistic)


@pytest.mark.parametrize("seed", range(5))
def test_the_joint_statistic_is_the_largest_difference_over_all_points(seed):
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(12, 2)), rng.normal(0.3, 1.5, size=(9, 2))
    x[:4, 0], y[:2, 0] = 0.0, 0.0  # ties

    def product_of_cdfs(points: np.ndarray, at: tuple[float, ...]) -> float:
        return float(np.prod([(points[:, k] <= at[k]).mean() for k in range(2)]))

    grid = product(*(np.append(np.concatenate([x[:, k], y[:, k]]), np.inf) for k in range(2)))
    plain = max(abs(product_of_cdfs(x, at) - product_of_cdfs(y, at)) for at in grid)
    assert ks(balls(x), balls(y)) == pytest.approx(plain, abs=1e-12)


def test_the_joint_search_is_exact_for_many_factors():
    rng = np.random.default_rng(1)
    curves = [tuple(np.sort(rng.uniform(size=(2, 5)), axis=1)) for _ in range(6)]
    curves = [(np.append(f, 1.0), np.append(g, 1.0)) for f, g in curves]
    plain = max(
        np.prod([f[k] for (f, _), k in zip(curves, at, strict=True)])
        - np.prod([g[k] for (_, g), k in zip(curves, at, strict=True)])
        for at in product(range(6), repeat=6)
    )
    assert _largest_difference(curves) == pytest.approx(plain, abs=1e-12)


def test_the_joint_statistic_is_at_least_each_factors_and_symmetric():
    a = segar.family("tilesx1-hard").sample(40, seed=0, split="train")
    b = segar.family("tilesx1-medium").sample(50, seed=0, split="test")
    assert ks(a, b) == ks(b, a)
    assert max(ks_by_factor(a, b).values()) <= ks(a, b) <= 1.0
    assert ks(a, a) == 0.0


def test_disjoint_sets_are_at_distance_one():
    near, far = (balls(np.full((4, 2), c)) for c in (-0.5, 0.5))
    assert ks(near, far) == 1.0
    assert ks_by_factor(near, far)["GolfBall.Position.x"] == 1.0
    assert ks_by_factor(near, far)["GolfBall.Mass"] == 0.0


def test_a_type_that_one_set_lacks_shows_in_its_count_alone():
    a, b = (Levels.from_entities([[GolfBall()], [kind()]]) for kind in (GolfBall, Charger))
    by_factor = ks_by_factor(a, b)
    assert by_factor["Charger.count"] == 0.5
    assert not any(name.startswith("Charger.") for name in by_factor if name != "Charger.count")


def test_world_parameters_and_chosen_factors():
    a, b = (Levels.from_entities([[GolfBall()]], parameters={Gravity: g}) for g in (9.0, 10.0))
    assert ks_by_factor(a, b)["world.Gravity"] == 1.0
    assert set(ks_by_factor(a, b, factors=[Position])) == {
        "GolfBall.count",
        "GolfBall.Position.x",
        "GolfBall.Position.y",
    }


def test_laws_are_refused_by_name():
    law = segar.family("empty-easy")
    levels = law.sample(2, seed=0, split="train")
    with pytest.raises(LevelError, match=r"two level sets .* LevelDistribution is not supported"):
        ks(levels, law)
