"""Angles: distributions that come round again, and their distances on the circle."""

import itertools
import math

import numpy as np
import pytest

import segar.noise as sn
from segar.noise import wrap

UNIFORM = sn.UniformNoise(-math.pi, math.pi)
ANGLES = [
    sn.VonMises(3.1, 8.0),
    sn.VonMises(-3.1 + 4 * math.pi, 2.0),
    sn.Wrapped(sn.GaussianNoise(2.0, 3.0)),
    sn.Wrapped(sn.Empirical([0.1, 3.0, 6.0, 9.0])),
]


def masses_of_arcs(a: sn.Noise, b: sn.Noise, cells: int = 20_000) -> float:
    """The largest difference of the masses of an arc, by brute force over arcs between grid points."""
    x = np.linspace(-math.pi, math.pi, cells, endpoint=False)
    gap = sn.Wrapped(a).cdf(x) - sn.Wrapped(b).cdf(x)
    return max(gap.max(), 0.0) - min(gap.min(), 0.0)


def transport_over_all_cuts(a: sn.Noise, b: sn.Noise, n: int = 2000) -> float:
    """W2 on the circle of n quantiles each: the best of all ways to go on from the i-th to the (i + k)-th."""
    q = (np.arange(n) + 0.5) / n
    x, y = (np.sort(wrap(distribution.icdf(q), math.tau)) for distribution in (a, b))
    y = np.concatenate([y - math.tau, y, y + math.tau])
    return math.sqrt(min(np.mean((x - y[k : k + n]) ** 2) for k in range(2 * n)))


@pytest.mark.parametrize(("a", "b"), list(itertools.combinations([*ANGLES, UNIFORM], 2)), ids=repr)
def test_distances_on_the_circle_agree_with_brute_force(a, b):
    w2, ks = a.w2_estimate(b), a.ks_estimate(b)
    assert w2.error < 1e-6 and w2.value == pytest.approx(transport_over_all_cuts(a, b), abs=2e-3)
    assert ks.error < 5e-6 and ks.value == pytest.approx(masses_of_arcs(a, b), abs=1e-3)
    if a is ANGLES[0]:
        assert b.w2(a) == pytest.approx(w2.value, abs=1e-6) and b.ks(a) == pytest.approx(ks.value, abs=1e-6)


def test_directions_that_are_near_each_other_are_near_whatever_number_says_them():
    east, nearly_west, west = (
        sn.VonMises(0.0, 50.0),
        sn.VonMises(math.pi - 0.1, 50.0),
        sn.VonMises(-math.pi + 0.1, 50.0),
    )
    assert nearly_west.w2(west) == pytest.approx(0.2, abs=1e-6)
    assert east.w2(sn.VonMises(6 * math.pi, 50.0)) == pytest.approx(0.0, abs=1e-6)
    assert sn.Deterministic(math.pi - 0.1).w2(west) == pytest.approx(math.hypot(0.2, math.sqrt(west.var)), abs=1e-6)
    assert nearly_west.ks(west) < 0.6 < east.ks(west)


def test_turning_both_distributions_changes_no_distance():
    a, b = ANGLES[:2]
    turned = [sn.Affine(distribution, shift=2.5) for distribution in (a, b)]
    assert turned[0].period == math.tau
    assert turned[0].w2(turned[1]) == pytest.approx(a.w2(b), abs=1e-6)
    assert turned[0].ks(turned[1]) == pytest.approx(a.ks(b), abs=1e-6)


def test_atoms_on_the_circle_go_the_shorter_way():
    a, b = sn.Wrapped(sn.Empirical([0.1, 0.9]), period=1.0), sn.Wrapped(sn.Empirical([0.0, 0.5]), period=1.0)
    assert a.w2(b) == pytest.approx(math.sqrt((0.1**2 + 0.4**2) / 2))  # 0.1 to 0, and 0.9 to 0.5


def test_a_wide_distribution_is_uniform_once_it_is_wrapped():
    wrapped = sn.Wrapped(sn.GaussianNoise(1.0, 20.0))
    assert wrapped.entropy() == pytest.approx(math.log(math.tau)) and wrapped.ks(UNIFORM) < 1e-9
    assert sn.Wrapped(UNIFORM).cdf(0.3) == UNIFORM.cdf(0.3)


def test_numbers_are_wrapped_into_one_turn_around_zero():
    x = np.array([-0.5, 0.5, 0.49, 7.25, -3.75, 0.5 - 1e-18])
    assert np.allclose(wrap(x, 1.0), [-0.5, -0.5, 0.49, 0.25, 0.25, -0.5])
