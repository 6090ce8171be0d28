"""Transport between levels: each mode against its definition, written out plainly, on random and on recorded levels."""

import json
import os
import re
from itertools import combinations, permutations, product
from pathlib import Path

os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")

import numpy as np
import ot
import pytest
import scipy

import segar
from segar import Charger, Friction, GoalTile, GolfBall, Gravity, Levels, Position, SandTile, Size
from segar.errors import LevelError, UnseenDifferenceWarning
from segar.language import Bumper, ConvexHull, Parameter, Square
from segar.levels.moments import PointSets
from segar.levels.named_families import puttputt_default_config
from segar.metrics import spread, w2, w2_report
from segar.metrics.transport import balanced_costs, matching_costs, sliced_costs
from segar.metrics.wasserstein import reference_projections
from tests.agreement.replay import folder

# The vectors of 2022, in its order.
OBJECT = ("Size", "Position", "Visible", "Order", "Mobile", "Velocity", "Mass", "Charge", "Density", "Magnetism",
          "StoredEnergy", "InfiniteEnergy", "Alive", "Done", "Acceleration")  # fmt: skip
TILE = ("Size", "Position", "Visible", "Order", "Friction", "Heat")


def point_sets(counts: tuple[int, ...], seed: int, dimension: int = 3) -> PointSets:
    rng = np.random.default_rng(seed)
    return PointSets(np.array(counts), rng.normal(size=(sum(counts), dimension)))


def members(sets: PointSets) -> list[np.ndarray]:
    return np.split(sets.points, np.cumsum(sets.counts)[:-1])


def best_partial_matching(x: np.ndarray, y: np.ndarray, mismatch: float) -> float:
    """By trying every partial matching."""
    found = []
    for size in range(min(len(x), len(y)) + 1):
        for rows, columns in product(combinations(range(len(x)), size), permutations(range(len(y)), size)):
            matched = sum(((x[i] - y[j]) ** 2).sum() for i, j in zip(rows, columns, strict=True))
            found.append(matched + mismatch**2 * (len(x) + len(y) - 2 * size))
    return min(found)


@pytest.mark.parametrize("mismatch", [0.0, 0.7, 1.5, 100.0])
def test_exact_takes_the_best_of_all_partial_matchings(mismatch):
    a, b = point_sets((0, 1, 2, 3, 5, 2), seed=0), point_sets((4, 0, 3, 1, 2), seed=1)
    plain = [[best_partial_matching(x, y, mismatch) for y in members(b)] for x in members(a)]
    np.testing.assert_allclose(matching_costs(a, b, mismatch), plain, atol=1e-12)


def sliced(x: np.ndarray, y: np.ndarray) -> float:
    return ot.sliced_wasserstein_distance(x, y, n_projections=50, p=2, seed=0) ** 2


@pytest.mark.parametrize(
    ("costs", "plain"),
    [
        (balanced_costs, lambda x, y: ot.emd2([], [], ot.dist(x, y))),
        (lambda a, b, absent: sliced_costs(a, b, reference_projections(7), absent), sliced),
    ],
    ids=["balanced", "sliced"],
)
def test_costs_are_pots_for_all_counts(costs, plain):
    a, b = point_sets((0, 1, 2, 3, 4, 6), seed=4, dimension=7), point_sets((5, 0, 1, 2, 3, 6), seed=5, dimension=7)
    found = costs(a, b, absent=7.0)
    for (i, x), (j, y) in product(enumerate(members(a)), enumerate(members(b))):
        expected = plain(x, y) if len(x) and len(y) else 7.0 * (len(x) != len(y))
        assert found[i, j] == pytest.approx(expected, abs=1e-12)


@pytest.fixture(scope="module")
def recorded() -> list[list[dict]]:
    """Recorded levels of 2022, each the factors of its things by name, before overlaps were removed."""
    levels = []
    for name in ("puttputt", "objectsx3", "tilesx1", "empty", "billiards"):
        with np.load(folder() / f"{name}.npz") as data:
            trajectories = json.loads(bytes(data["meta_json"]).decode())
        for trajectory in trajectories[:6]:
            things = zip(trajectory["entities"], trajectory["pre_fix_positions"], strict=True)
            levels.append(
                [{**e["factors"], "type": e["type"], "kind": e["kind"], "Position": at} for e, at in things if at]
            )
    return levels


def as_levels(recorded: list[list[dict]]) -> Levels:
    made = []
    for things in recorded:
        made.append([])
        for number, thing in enumerate(things):
            kind = getattr(segar.language, thing["type"])
            names = OBJECT if thing["kind"] == "object" else TILE
            made[-1].append(
                kind({**{getattr(segar.language, n): thing[n] for n in names}, segar.language.ID: f"thing{number}"})
            )
    return Levels.from_entities(made)


def test_reference_equals_a_plain_loop_over_recorded_levels(recorded):
    first, second = recorded[0::2], recorded[1::2]
    cost = np.zeros((len(first), len(second)))
    for (i, x), (j, y), (kind, names) in product(
        enumerate(first), enumerate(second), (("object", OBJECT), ("tile", TILE))
    ):
        vectors = [
            np.array([np.hstack([np.ravel(thing[n]) for n in names]) for thing in side if thing["kind"] == kind], float)
            for side in (x, y)
        ]
        cost[i, j] += ot.sliced_wasserstein_distance(*vectors, n_projections=50, p=2, seed=0) ** 2
    plain = np.sqrt(ot.emd2([], [], cost))
    assert w2(as_levels(first), as_levels(second), mode="reference") == pytest.approx(plain, abs=1e-9)


def test_paper_is_algorithm_1_as_written():
    a = segar.family("objectsx2-hard").sample(5, seed=0, split="train")
    b = segar.family("objectsx2-hard").sample(6, seed=0, split="test")

    def states(levels: Levels, i: int, kind: type) -> np.ndarray:
        slots = np.flatnonzero(levels.types[i] == levels.layout.types.index(kind))
        numeric = [f for f in kind.declared if f.width and f is not segar.language.Drag]
        columns = [levels.layout.columns[f] + k for f in numeric for k in range(f.width)]
        return levels.sampled_values[i, slots][:, columns]

    types: list[type] = []
    for levels in (a, b):
        for i in range(len(levels)):
            for kind in (levels.layout.types[index] for index in levels.types[i]):
                if kind not in types and kind is not segar.language.GlobalFriction:
                    types.append(kind)
    cost = np.zeros((len(a), len(b)))
    for i, j in np.ndindex(cost.shape):
        for kind in types:
            x, y = states(a, i, kind), states(b, j, kind)
            if len(x) == 0 and len(y) == 0:
                pass
            elif len(x) == 0 or len(y) == 0:
                cost[i, j] = 2.5
            else:
                cost[i, j] += ot.emd2([], [], ot.dist(x, y))
    assert w2(a, b, mode="paper", mismatch=2.5) == pytest.approx(np.sqrt(ot.emd2([], [], cost)), abs=1e-9)


@pytest.mark.parametrize("mode", ["exact", "reference", "paper"])
def test_a_distance_is_symmetric_and_zero_on_itself(mode):
    a, b = (segar.family("puttputt").sample(n, seed=0, split=split) for n, split in ((6, "train"), (9, "test")))
    assert w2(a, a, mode=mode) == pytest.approx(0.0, abs=1e-6)
    assert w2(a, b, mode=mode) == pytest.approx(w2(b, a, mode=mode), rel=1e-9)


def test_a_factor_counts_in_units_of_its_spread():
    levels = segar.family("tilesx1-hard").sample(4000, seed=1, split="train")
    scale = spread(levels)
    assert scale[SandTile, Friction] == pytest.approx(0.6 / np.sqrt(12), rel=0.1)  # U(0.4, 1)
    assert scale[GolfBall, Position] == pytest.approx(1.9 / np.sqrt(12), rel=0.05)
    assert scale[GolfBall, segar.Mass] == 0.0
    assert spread(levels[:3]) == scale  # the distribution's, not the sample's
    assert spread(levels.distribution) == scale


def test_levels_from_a_file_keep_their_units_and_distances(tmp_path):
    family = segar.family("objectsx1-hard")
    sets = [family.sample(n, seed=4, split=split) for n, split in ((3, "train"), (5, "test"))]
    varied = segar.LevelDistribution(
        **{**puttputt_default_config, "parameters": {Gravity: segar.UniformNoise(8.0, 11.0)}}
    )
    for a, b in (sets, [varied.sample(4, seed=0, split="train"), varied.sample(4, seed=0, split="test")]):
        loaded = []
        for levels in (a, b):
            levels.save(tmp_path / "levels.npz")
            segar.Levels.load(tmp_path / "levels.npz").save(tmp_path / "again.npz")
            loaded.append(segar.Levels.load(tmp_path / "again.npz"))
        assert spread(*loaded) == spread(a, b)
        assert [w2(*loaded, mode=m) for m in ("exact", "reference", "paper")] == [
            w2(a, b, mode=m) for m in ("exact", "reference", "paper")
        ]
        assert spread(loaded[0][:2]) == spread(a[:2])


def test_without_a_distribution_the_levels_themselves_give_the_units():
    a, b = (Levels.from_entities([[GolfBall({Position: [x, 0.0]})] for x in xs]) for xs in ((-0.2, 0.2), (0.3, 0.7)))
    # Equal mixture of both sets along x: variance 0.2^2 within, 0.25^2 between; none along y.
    assert spread(a, b)[GolfBall, Position] == pytest.approx(np.sqrt((0.2**2 + 0.25**2) / 2))
    near = Levels.from_entities([[GolfBall({segar.Mass: mass})] for mass in (10.0, 10.0 + 2e-8)])
    assert spread(near)[GolfBall, segar.Mass] == pytest.approx(1e-8)


def test_the_size_of_a_hull_is_that_of_a_disc_of_equal_area():
    def tile(shape: ConvexHull) -> Levels:
        return Levels.from_entities([[SandTile({segar.Shape: shape})]])

    small, large = tile(Square(0.2)), tile(ConvexHull([[0, 0], [0.8, 0], [0.8, 0.3], [0.4, 0.6], [0, 0.3]]))
    diameters = [2 * np.sqrt(area / np.pi) for area in (0.04, 0.8 * 0.3 + 0.5 * 0.8 * 0.3)]
    assert w2(small, large, scale={(SandTile, Size): 0.1}) == pytest.approx(abs(np.diff(diameters)[0]) / 0.1)


def test_render_order_and_flags_do_not_count_in_exact_but_do_in_reference():
    a, b = (
        Levels.from_entities([[GolfBall({Position: [0, 0], segar.language.Order: o, segar.language.Visible: o > 0})]])
        for o in (0, 3)
    )
    with pytest.warns(UnseenDifferenceWarning, match="factor Visible of GolfBall: 0 against 1"):
        assert w2(a, b) == 0.0
    assert w2(a, b, mode="reference") > 0.5


def test_only_the_chosen_factors_count():
    a, b = (Levels.from_entities([[Charger({Position: [x, 0], segar.Charge: x})]]) for x in (0.0, 0.5))
    scale = {(Charger, Position): 0.5, (Charger, segar.Charge): 0.25}
    assert w2(a, b, scale=scale) == pytest.approx(np.sqrt(5.0))
    assert w2(a, b, scale=scale, factors=[Position]) == pytest.approx(1.0)


def test_levels_with_more_things_are_further_away():
    few = Levels.from_entities([[GolfBall(), GoalTile()]])
    more = Levels.from_entities([[GolfBall(), GoalTile(), Bumper()]])
    most = Levels.from_entities([[GolfBall(), GoalTile(), Bumper(), Charger(), Charger()]])
    assert w2(few, more, mismatch=2.0) == pytest.approx(2.0)
    assert w2(few, most, mismatch=2.0) == pytest.approx(2.0 * np.sqrt(3))
    without_tiles = Levels.from_entities([[GolfBall()]])
    assert w2(few, without_tiles, mode="reference") == pytest.approx(100.0)
    assert w2(few, more, mode="reference") < 1.0  # both have objects, and uniform measures forget how many


def test_a_report_repeats_and_contains_its_value():
    a, b = (segar.family("empty-hard").sample(n, seed=3, split=s) for n, s in ((12, "train"), (20, "test")))
    first, second = (w2_report(a, b, rng=np.random.default_rng(5), resamples=20) for _ in range(2))
    assert first == second
    assert first.low <= first.value <= first.high and first.value == w2(a, b)
    assert 0 < first.p_value <= 1 and first.floor > 0


def test_a_report_tells_equal_from_different_distributions():
    a, same = (segar.family("empty-hard").sample(25, seed=0, split=split) for split in ("train", "test"))
    rng = np.random.default_rng(0)
    equal, different = (
        w2_report(a, b, rng=rng, resamples=60) for b in (same, segar.family("empty-medium").sample(25, seed=0))
    )
    assert equal.p_value > 0.05 > different.p_value
    assert different.low > different.floor


class Nectar(segar.Scalar): ...


class Flower(segar.Tile):
    nectar: Nectar


@pytest.mark.parametrize("kinds", list(product([Flower, SandTile], repeat=2)), ids=str)
def test_the_program_of_the_documentation_takes_sets_of_which_one_has_factors_of_its_own(kinds):
    """The page runs it on named families, whose entities have the same factors."""
    page = (Path(__file__).parents[3] / "docs" / "reference" / "distances.md").read_text()
    (program,) = (part for part in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "def reference_w2" in part)
    names: dict = {}
    exec(program.partition("\npairs = ")[0], names)
    a, b = (
        segar.LevelDistribution(
            [(GolfBall, 1), (kind, 2)], [segar.Prior(Position, segar.RandomUniformLocation())]
        ).sample(6, seed)
        for seed, kind in enumerate(kinds)
    )
    assert names["reference_w2"](a, b) == pytest.approx(w2(a, b, mode="reference"))
    (other,) = (part for part in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "def exact_w2" in part)
    exec(re.sub(r"from my_lab.*\n", "", other.partition("\npairs = ")[0]), names)
    assert names["exact_w2"](a, b) == pytest.approx(w2(a, b))
    assert names["paper_w2"](a, b) == pytest.approx(w2(a, b, mode="paper"))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "refrence"}, "Did you mean 'reference'"),
        ({"mode": "paper", "factors": [Position]}, "mode='paper' takes neither scale nor factors"),
        ({"factors": []}, "w2: factors lists none"),
        ({"scale": {"Position": 1.0}}, "scale is keyed by (entity type, factor), as segar.metrics.spread(a, b) does"),
        ({"scale": {(SandTile, segar.Mass): 1.0}}, "scale gives a unit to Mass of SandTile, which has none"),
        ({"scale": {(Parameter, segar.Mass): 1.0}}, "scale gives a unit to Mass of Parameter, which has none"),
        *(
            ({"scale": {(GolfBall, Position): unit}}, "w2: the scale of GolfBall.Position must be a finite number")
            for unit in (-1.0, float("nan"), float("inf"), "1", None, True)
        ),
        ({"mismatch": -1.0}, "mismatch must be a finite number of at least 0, not -1.0"),
    ],
)
def test_wrong_options_are_named(options, message):
    levels = segar.family("empty-easy").sample(2, seed=0, split="train")
    with pytest.raises(LevelError, match=re.escape(message)):
        w2(levels, levels, **options)


def charged(numbers: list[float], unit: float = 1.0) -> Levels:
    return Levels.from_entities([[Charger({Position: [0.0, 0.0], segar.Charge: unit * x})] for x in numbers])


@pytest.mark.parametrize("mode", ["paper", "reference"])
@pytest.mark.parametrize(("far", "unit"), [(0.0, 1e-7), (1e4, 1e-3), (1e8, 1.0), (1e30, 1.0)])
def test_a_far_level_in_each_set_and_small_numbers_leave_the_distance_exact(mode, far, unit):
    rng = np.random.default_rng(3)
    a, b = (charged([far, *rng.normal(size=11)], unit) for _ in range(2))
    costs = segar.metrics.cost_matrix(a, b, mode)
    exact = np.sqrt(costs[scipy.optimize.linear_sum_assignment(costs)].mean())
    assert w2(a, b, mode) == pytest.approx(exact, rel=1e-9, abs=0)
    assert w2_report(a, b, mode, rng=rng, resamples=2).value == pytest.approx(exact, rel=1e-9, abs=0)
    assert w2(a, b[[0] + [1, 2, 3] * 5], mode) < 10 * max(exact, far)  # whatever the sizes, there is a plan


def test_sets_that_say_nothing_of_other_levels_have_no_interval_of_their_distance():
    rng = np.random.default_rng(0)
    one, other, same = charged([0.0]), charged([1.0]), charged([2.0, 2.0, 2.0])
    for a, b in ((one, other), (one, charged([1.0, 2.0, 3.0])), (same, charged([0.0, 0.0]))):
        found = w2_report(a, b, rng=rng, resamples=10)
        assert np.isnan([found.low, found.high]).all() and found.value > 0
    assert w2_report(one, other, rng=rng, resamples=50).p_value == 1.0
    many = w2_report(charged([0.0, 1.0, 2.0]), charged([1.5, 2.5, 4.0]), rng=rng, resamples=50)
    assert many.low < many.value < many.high


def test_three_against_three_levels_are_no_more_unlike_than_one_deal_in_ten():
    """There are 20 deals, of which two have the distance of the given one: it, and the one the other way round."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        a, b = charged(rng.normal(size=3).tolist()), charged((100 + rng.normal(size=3)).tolist())
        assert w2_report(a, b, rng=rng, resamples=200).p_value > 0.05


def test_distances_ask_for_level_sets():
    distribution = segar.family("empty-easy")
    levels = distribution.sample(2, seed=0, split="train")
    with pytest.raises(LevelError, match=r"w2 takes level sets .segar.Levels.; a LevelDistribution is not supported"):
        w2(levels, distribution)
    with pytest.raises(LevelError, match="at least 2 resamples, not 1"):
        w2_report(levels, levels, rng=np.random.default_rng(0), resamples=1)
