"""Distances between level sets: against plain loops over POT, closed forms, and the distributions of a metric."""

import os

os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")

import numpy as np
import ot
import pytest

import segar
from segar import Charger, GoalTile, GolfBall, Levels, Magnet, Position
from segar.metrics import ks, spread, w2, w2_report
from segar.metrics.wasserstein import REFERENCE_ORDER

FAMILIES = ("empty-hard", "objectsx1-hard", "tilesx1-medium", "puttputt")


def levels(name: str, n: int, seed: int = 0, split: str = "train") -> Levels:
    return segar.family(name).sample(n, seed=seed, split=split)


def plain_reference(a: Levels, b: Levels) -> float:
    """The 2022 algorithm, level by level, with POT's own sliced distance."""

    def vectors(levels: Levels, i: int, kind: type) -> np.ndarray:
        rows = []
        for slot, index in enumerate(levels.types[i]):
            entity = levels.layout.types[index] if index >= 0 else None
            if entity is not None and issubclass(entity, kind):
                factors = [f for f in REFERENCE_ORDER if f in entity.declared]
                rows.append(
                    np.concatenate(
                        [levels.sampled_values[i, slot, levels.layout.columns[f] :][: f.width] for f in factors]
                    )
                )
        return np.array(rows)

    cost = np.zeros((len(a), len(b)))
    for i in range(len(a)):
        for j in range(len(b)):
            for kind in (segar.Object, segar.Tile):
                x, y = vectors(a, i, kind), vectors(b, j, kind)
                if len(x) and len(y):
                    cost[i, j] += ot.sliced_wasserstein_distance(x, y, n_projections=50, p=2, seed=0) ** 2
                elif len(x) or len(y):
                    cost[i, j] += 100.0**2
    return float(np.sqrt(ot.emd2(np.full(len(a), 1 / len(a)), np.full(len(b), 1 / len(b)), cost)))


@pytest.mark.parametrize("name", FAMILIES)
def test_reference_is_a_plain_loop_over_pots_sliced_distance(name: str) -> None:
    a, b = levels(name, 5), levels(name, 7, split="test")
    assert w2(a, b, mode="reference") == pytest.approx(plain_reference(a, b), abs=1e-9)


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


def test_the_triangle_inequality_holds_in_one_unit() -> None:
    a, b, c = (levels("puttputt", 6, split=s) for s in "abc")
    scale = spread(a)
    ab, bc, ac = (w2(x, y, scale=scale) for x, y in ((a, b), (b, c), (a, c)))
    assert ac <= ab + bc + 1e-9


def test_two_single_levels_are_as_far_apart_as_their_factors() -> None:
    def level(x: float) -> Levels:
        return Levels.from_entities([[GolfBall({Position: [x, 0.0]}), GoalTile({Position: [0.5, 0.5]})]])

    a, b = level(-0.5), level(0.3)
    scale = {(GolfBall, Position): 0.4}
    assert w2(a, b, scale=scale) == pytest.approx(0.8 / 0.4)


def test_an_entity_without_counterpart_costs_the_mismatch() -> None:
    ball = GolfBall({Position: [0.0, 0.0]})
    a = Levels.from_entities([[ball, Charger({Position: [0.5, 0.5]})]])
    b = Levels.from_entities([[ball, Magnet({Position: [0.5, 0.5]})]])
    assert w2(a, b, mismatch=3.0) == pytest.approx(np.sqrt(2 * 3.0**2))


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


def test_ks_is_between_zero_and_one_and_grows_with_the_shift() -> None:
    a, same, other = levels("empty-hard", 200), levels("empty-hard", 200, split="test"), levels("empty-medium", 200)
    assert ks(a, a) == 0.0
    assert 0.0 < ks(a, same) < ks(a, other) <= 1.0


@pytest.mark.parametrize("call", [lambda a: w2(a, a, mode="exct"), lambda a: w2(a, a[:0]), lambda a: w2(a, "b")])
def test_bad_input_is_a_level_error(call) -> None:
    with pytest.raises(segar.errors.LevelError):
        call(levels("empty-hard", 3))


def test_a_misspelt_mode_gets_the_nearest_right_one() -> None:
    a = levels("empty-hard", 3)
    with pytest.raises(segar.errors.LevelError, match="'exact'"):
        w2(a, a, mode="exct")
