"""Distances between level sets: against plain loops over POT, closed forms, and the distributions of a metric."""

import os

os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")

import numpy as np
import pytest

import segar
from segar import Charger, Levels, Position
from segar.metrics import w2, w2_report
from segar.metrics.wasserstein import REFERENCE_ORDER

FAMILIES = ("empty-hard", "objectsx1-hard", "tilesx1-medium", "puttputt")


def levels(name: str, n: int, seed: int = 0, split: str = "train") -> Levels:
    return segar.family(name).sample(n, seed=seed, split=split)


def test_reference_has_the_published_vectors() -> None:
    widths = {kind: sum(f.width for f in REFERENCE_ORDER if f in kind.declared) for kind in (segar.Object, segar.Tile)}
    assert widths == {segar.Object: 18, segar.Tile: 7}


@pytest.mark.parametrize(
    ("name", "expected"), [("empty-hard", 0.307), ("empty-medium", 0.173), ("tilesx1-hard", 0.437)]
)
def test_reference_means_are_those_of_the_2022_code(name: str, expected: float) -> None:
    # Means of the 2022 code over 5 seeds at n = 10 against 100 test levels; its standard deviation there is up to 0.04.
    test = [levels(name, 100, seed=s, split="test") for s in range(12)]
    values = [w2(levels(name, 10, seed=s), test[s], mode="reference") for s in range(12)]
    assert np.mean(values) == pytest.approx(expected, abs=3 * 0.04 / np.sqrt(5))


@pytest.mark.parametrize("mode", ["exact", "reference"])
@pytest.mark.parametrize("name", FAMILIES)
def test_a_distance_is_symmetric_and_zero_on_itself(name: str, mode: str) -> None:
    a, b = levels(name, 6), levels(name, 9, split="test")
    assert w2(a, a, mode=mode) == pytest.approx(0.0, abs=1e-6)
    assert w2(a, b, mode=mode) == pytest.approx(w2(b, a, mode=mode), rel=1e-9)
    assert w2(a, b, mode=mode) > 0


def test_the_order_of_slots_does_not_matter_to_exact() -> None:
    chargers = [Charger({Position: [x, 0.1 * x]}) for x in (-0.6, 0.0, 0.6)]
    other = Levels.from_entities([[Charger({Position: [0.2, 0.3]}) for _ in range(3)]])
    a, b = Levels.from_entities([chargers]), Levels.from_entities([chargers[::-1]])
    assert w2(a, b) == pytest.approx(0.0, abs=1e-9)
    assert w2(a, other) == pytest.approx(w2(b, other))


def test_a_report_tells_equal_from_different_distributions() -> None:
    a, same, other = levels("empty-hard", 25), levels("empty-hard", 25, split="test"), levels("empty-medium", 25)
    rng = np.random.default_rng(0)
    equal, different = (w2_report(a, b, rng=rng, resamples=60) for b in (same, other))
    assert equal.p_value > 0.05 > different.p_value
    assert different.low > different.floor
