"""How often tests reject, and bands miss, one distribution: over 1,000 pairs of level sets, within 2 points of nominal."""

from collections.abc import Callable

import numpy as np
import pytest

import segar
from segar import Levels, Position
from segar.metrics import ks_report, mmd_test, w2_report

pytestmark = pytest.mark.slow

REPETITIONS = 1000
LEVEL = 0.05
POINTS = 0.02
LAW = segar.family("empty-hard")


def sample(number: int, n: int, side: str) -> Levels:
    return LAW.sample(n, seed=number, split=f"calibration {side}")


TESTS: dict[str, Callable[[Levels, Levels, np.random.Generator], float]] = {
    "ks": lambda a, b, rng: ks_report(a, b, rng=rng, resamples=99, factors=[Position]).p_value,
    "ks against a distribution": lambda a, b, rng: ks_report(a, LAW, rng=rng, resamples=99, factors=[Position]).p_value,
    "mmd": lambda a, b, rng: mmd_test(a, b, rng=rng, resamples=199).p_value,
    "w2": lambda a, b, rng: w2_report(a, b, rng=rng, resamples=99).p_value,
}


@pytest.mark.parametrize("name", TESTS)
def test_a_test_rejects_one_distribution_as_often_as_it_says(name):
    found = [
        TESTS[name](sample(number, 30, "a"), sample(number, 25, "b"), np.random.default_rng(number)) <= LEVEL
        for number in range(REPETITIONS)
    ]
    print(f"\n{name}: {np.mean(found):.3f}")
    assert np.mean(found) == pytest.approx(LEVEL, abs=POINTS)


def test_each_factors_tests_reject_one_distribution_as_often_as_they_say():
    one, two, outside = [], [], []
    for number in range(REPETITIONS):
        a, b = sample(number, 100, "a"), sample(number, 80, "b")
        rng = np.random.default_rng(number)
        for found, other in ((one, LAW), (two, b)):
            factors = ks_report(a, other, rng=rng, resamples=19, factors=[Position]).factors
            factor = next(f for f in factors if f.name == "GolfBall.Position.x")
            found.append(factor.p_value <= LEVEL)
            if other is b:
                outside.append(factor.value > factor.band)
    rates = [float(np.mean(r)) for r in (one, two, outside)]
    print(
        f"\nsample against distribution {rates[0]:.3f}, two samples {rates[1]:.3f}, band of two samples {rates[2]:.3f}"
    )
    assert rates == pytest.approx([LEVEL] * 3, abs=POINTS)
