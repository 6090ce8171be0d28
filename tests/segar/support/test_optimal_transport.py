"""Optimal transport at every scale: against assignment, and against shortest augmenting ways in rational arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
import scipy

from segar.errors import SegarError
from segar.support import emd, plan_of


def least_cost(cost: np.ndarray, a: np.ndarray, b: np.ndarray) -> Fraction:
    """The least cost between masses that are whole numbers, in rational arithmetic, by successive shortest ways."""
    n, m = cost.shape
    c = [[Fraction(float(x)) for x in row] for row in cost]
    left_a, left_b = ([int(x) * int(other.sum()) for x in own] for own, other in ((a, b), (b, a)))
    total, flow = sum(left_a), [[0] * m for _ in range(n)]
    while any(left_a):
        to_row = [(Fraction(0), None) if left_a[i] else None for i in range(n)]
        to_column: list = [None] * m
        changed = True
        while changed:
            changed = False
            for i, j in np.ndindex(n, m):
                here, there = to_row[i], to_column[j]
                if here is not None and (there is None or here[0] + c[i][j] < there[0]):
                    to_column[j], changed = (here[0] + c[i][j], i), True
                here, there = to_column[j], to_row[i]
                if flow[i][j] and here is not None and (there is None or here[0] - c[i][j] < there[0]):
                    to_row[i], changed = (here[0] - c[i][j], j), True
        end = min((j for j in range(m) if left_b[j]), key=lambda j: to_column[j][0])
        way, j = [], end
        while True:
            i = to_column[j][1]
            way.append((i, j, 1))
            if to_row[i][1] is None:
                break
            j = to_row[i][1]
            way.append((i, j, -1))
        moved = min(left_a[i], left_b[end], *(flow[i][j] for i, j, sign in way if sign < 0))
        for row, column, sign in way:
            flow[row][column] += sign * moved
        left_a[i] -= moved
        left_b[end] -= moved
    return sum((c[i][j] * flow[i][j] for i, j in np.ndindex(n, m)), Fraction(0)) / total


def clouds(rng: np.random.Generator, n: int, m: int, far: int) -> np.ndarray:
    """Squared distances of points of which the first few of both sets lie together, far from all others."""
    x, y = rng.normal(size=(n, 2)), rng.normal(size=(m, 2))
    away = 10 ** rng.uniform(0, 15, (far, 1))
    x[:far] += away
    y[:far] = x[:far] + rng.normal(size=(far, 2))
    return scipy.spatial.distance.cdist(x, y, "sqeuclidean")


COSTS = {
    "uniform": lambda rng, n, m: rng.random((n, m)),
    "tied": lambda rng, n, m: rng.integers(0, 4, (n, m)).astype(float),
    "all scales": lambda rng, n, m: 10 ** rng.uniform(-30, 30, (n, m)),
    "one outlier of each": lambda rng, n, m: clouds(rng, n, m, 1),
    "half are far": lambda rng, n, m: clouds(rng, n, m, min(n, m) // 2 + 1),
    "forbidden": lambda rng, n, m: np.where(rng.random((n, m)) < 0.4, 10 ** rng.uniform(0, 30), rng.random((n, m))),
}


@pytest.mark.parametrize("kind", COSTS)
def test_transport_costs_what_rational_arithmetic_says_at_every_scale(kind):
    rng = np.random.default_rng(0)
    for scale in np.repeat(10.0 ** np.arange(-30, 31, 15), 5):
        n, m = rng.integers(1, 8, 2)
        cost, a, b = scale * COSTS[kind](rng, n, m), rng.integers(0, 4, n), rng.integers(1, 4, m)
        a[0] += 1
        for own, other in ((None, None), (a, b)):
            exact = least_cost(cost, *(np.ones(k) if w is None else w for k, w in ((n, own), (m, other))))
            assert abs(Fraction(emd(cost, own, other)) - exact) <= exact / 10**9
        assert abs(Fraction(float((plan_of(cost) * cost).sum())) - least_cost(cost, np.ones(n), np.ones(m))) <= (
            least_cost(cost, np.ones(n), np.ones(m)) / 10**9
        )


@pytest.mark.parametrize("kind", COSTS)
def test_transport_of_equally_many_points_is_the_best_assignment(kind):
    rng = np.random.default_rng(1)
    for n in (12, 40, 90):
        cost = COSTS[kind](rng, n, n) * 10.0 ** rng.integers(-30, 31)
        best = cost[scipy.optimize.linear_sum_assignment(cost)].sum() / n
        assert emd(cost) == pytest.approx(best, rel=1e-9, abs=0)
        # The same points, each several times: other sizes, and no mass may be left over for the far ones.
        assert emd(np.repeat(cost, 3, axis=0)) == pytest.approx(best, rel=1e-9, abs=0)
        assert emd(cost, np.full(n, 0.7 / n), np.full(n, 0.1)) == pytest.approx(best, rel=1e-9, abs=0)


def test_a_plan_has_the_marginals_and_few_entries():
    rng = np.random.default_rng(2)
    for n, m in ((1, 4), (5, 5), (30, 21), (7, 70)):
        plan = plan_of(clouds(rng, n, m, 1) * 1e-20)
        np.testing.assert_allclose(plan.sum(axis=1), 1 / n, rtol=1e-12)
        np.testing.assert_allclose(plan.sum(axis=0), 1 / m, rtol=1e-12)
        assert (plan > 0).sum() <= n + m - 1
    assert (plan_of(np.zeros((6, 6))) > 0).sum() <= 11
    assert emd(np.zeros((6, 5))) == 0.0


def test_rounding_of_masses_moves_nothing_to_a_far_point():
    masses = np.full(10, 0.1)  # whose first three sum to another number than 0.3
    cost = np.full((10, 3), 1e30)
    cost[:3, 0] = cost[3:9, 1] = cost[9:, 2] = 1.0
    assert emd(cost, masses, np.array([0.3, 0.6, 0.1])) == pytest.approx(1.0)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize("points", [1, 3])
def test_costs_that_are_no_numbers_are_refused(wrong, points):
    cost = np.ones((3, points))
    cost[1, -1] = wrong
    with pytest.raises(SegarError, match="finite numbers"):
        emd(cost)


@pytest.mark.parametrize("scale", [1e-200, 1e-12, 1e4, 1e6, 1e12, 1e200])
def test_masses_of_any_sum_count_in_proportion(scale):
    rng = np.random.default_rng(1)
    for size in ((50, 40), (3, 7), (1, 5)):
        cost, a, b = rng.random(size), rng.random(size[0]), rng.random(size[1])
        assert emd(cost, a * scale, b / scale) == pytest.approx(emd(cost, a, b), rel=1e-9)


def test_masses_and_costs_that_are_very_unlike_have_the_exact_optimum_or_none():
    """Of two by two points by rational numbers: the cost is linear in what goes from the first to the first."""
    rng, refused = np.random.default_rng(2), 0
    for _ in range(200):
        a, b = (10.0 ** rng.uniform(-15, 0, 2) for _ in range(2))
        cost = 10.0 ** rng.uniform(-12, 0, (2, 2))
        (p, _), (r, s) = ([Fraction(x) / sum(map(Fraction, w)) for x in w] for w in (a, b))
        (c, d), (e, f) = (map(Fraction, row) for row in cost)
        least = min(x * c + (p - x) * d + (r - x) * e + (s - p + x) * f for x in (max(Fraction(0), p - s), min(p, r)))
        try:
            assert emd(cost, a, b) == pytest.approx(float(least), rel=1e-9)
        except SegarError:
            refused += 1
    assert refused < 10
