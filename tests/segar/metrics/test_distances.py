"""Distances beyond w2: against POT, scipy, closed forms and the distributions that each must obey."""

import os

os.environ.setdefault("POT_BACKEND_DISABLE_PYTORCH", "1")

import numpy as np
import ot
import pytest
from scipy.spatial.distance import pdist

import segar
from segar import Bumper, Charger, GolfBall, Gravity, Levels, Magnet, Parameter, Position
from segar.errors import LevelError
from segar.language import Thing
from segar.metrics import cost_matrix, decompose, embed, mmd_test, spread, w2, w2_debiased, w2_report, w2_sliced
from segar.metrics.wasserstein import resampled

FAMILIES = ("empty-hard", "objectsx2-hard", "tilesx3-medium", "puttputt")
UNIT = {(GolfBall, Position): 1.0}


def levels(name: str, n: int, seed: int = 0, split: str = "train") -> Levels:
    return segar.family(name).sample(n, seed=seed, split=split)


def balls(points) -> Levels:
    return Levels.from_entities([[GolfBall({Position: p})] for p in points])


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def random_set(generator: np.random.Generator) -> Levels:
    """One to four levels of one to four entities of three types, anywhere."""
    kinds = (GolfBall, Charger, Bumper)

    def level() -> list:
        chosen = generator.integers(3, size=generator.integers(1, 5))
        return [kinds[k]({Position: generator.uniform(-1, 1, 2)}) for k in chosen]

    return Levels.from_entities([level() for _ in range(generator.integers(1, 5))])


@pytest.mark.parametrize("mismatch", [0.5, 3.0])
def test_exact_is_a_metric_on_random_sets_of_levels(mismatch):
    generator = rng(7)
    sets = [random_set(generator) for _ in range(9)]
    scale = {(kind, Position): unit for kind, unit in ((GolfBall, 0.3), (Charger, 0.5), (Bumper, 1.0))}
    distance = np.array([[w2(a, b, scale=scale, mismatch=mismatch) for b in sets] for a in sets])
    np.testing.assert_allclose(distance, distance.T, atol=1e-9)
    np.testing.assert_allclose(np.diag(distance), 0.0, atol=1e-7)
    assert distance[~np.eye(9, dtype=bool)].min() > 0.1
    assert (distance[:, None, :] <= distance[:, :, None] + distance[None, :, :] + 1e-9).all()


# Vectors.


def test_vectors_are_as_far_apart_as_levels_where_each_type_has_one_entity():
    a, b = levels("empty-hard", 5), levels("empty-hard", 6, split="test")
    x, y = embed(a, b)
    scale = spread(a, b)
    plain = [[w2(one, other, scale=scale, mismatch=100.0) for other in b] for one in a]
    np.testing.assert_allclose(np.linalg.norm(x[:, None] - y[None], axis=-1), plain, atol=1e-9)


def test_vectors_do_not_know_the_order_of_entities_and_are_no_farther_than_the_best_matching():
    generator = rng(1)
    places = generator.uniform(-1, 1, size=(6, 4, 2))
    sets = [
        Levels.from_entities([[Charger({Position: p}) for p in level] for level in places[k : k + 3]]) for k in (0, 3)
    ]
    turned = Levels.from_entities([[Charger({Position: p}) for p in level[::-1]] for level in places[:3]])
    scale = {(Charger, Position): 0.5}
    x, y, z = embed(*sets, turned, scale=scale)
    np.testing.assert_allclose(x, z, atol=1e-12)
    exact = np.array([[w2(one, other, scale=scale, mismatch=100.0) for other in sets[1]] for one in sets[0]])
    sliced = np.linalg.norm(x[:, None] - y[None], axis=-1)
    assert (sliced <= exact + 1e-9).all() and (sliced > 0.5 * exact).all()


def test_a_missing_entity_is_at_least_a_mismatch_away():
    few = Levels.from_entities([[GolfBall(), Charger({Position: [0.3, 0.0]})]])
    more = Levels.from_entities([[GolfBall(), Charger({Position: [0.3, 0.0]}), Charger({Position: [0.3, 0.0]})]])
    x, y = embed(few, more, scale={(Charger, Position): 1.0}, mismatch=2.0)
    assert np.linalg.norm(x - y) == pytest.approx(2.0)


# Many levels.


def test_sliced_is_the_distance_of_a_set_and_its_translate_and_zero_for_equal_sets():
    points = rng(0).normal(size=(40, 2))
    a, b = balls(points), balls(points + np.array([0.3, 0.4]))
    assert w2_sliced(a, b, rng=rng(), scale=UNIT).value == pytest.approx(0.5)
    assert w2_sliced(a, a, rng=rng(), scale=UNIT).value == pytest.approx(0.0, abs=1e-9)


def test_sliced_is_pots_up_to_the_root_of_the_dimension():
    a, b = balls(rng(0).normal(size=(30, 2))), balls(rng(1).normal(0.2, 2.0, size=(20, 2)))
    x, y = embed(a, b, scale=UNIT)
    plain = np.sqrt(2) * ot.sliced_wasserstein_distance(x, y, n_projections=20_000, seed=0)
    ours = w2_sliced(a, b, rng=rng(), scale=UNIT)
    assert ours.value == pytest.approx(plain, abs=5 * ours.standard_error + 0.01)


@pytest.mark.parametrize("name", FAMILIES)
def test_sliced_is_symmetric_and_at_most_the_exact_distance_of_the_vectors(name):
    a, b = levels(name, 30), levels(name, 25, split="test")
    exact = np.sqrt(ot.emd2([], [], ot.dist(*embed(a, b))))
    there, back = (w2_sliced(*pair, rng=rng()) for pair in ((a, b), (b, a)))
    assert 0.0 < there.value <= exact
    assert back.value == pytest.approx(there.value, abs=4 * (there.standard_error + back.standard_error))


def test_other_transport_than_w2_is_solved_from_the_matrix_of_costs():
    a, b = levels("objectsx1-hard", 7), levels("objectsx1-medium", 9)
    costs = cost_matrix(a, b)
    assert np.sqrt(ot.emd2([], [], costs)) == pytest.approx(w2(a, b))
    scale = spread(a, b)
    one_by_one = [[w2(one, other, scale=scale) ** 2 for other in b] for one in a]
    np.testing.assert_allclose(cost_matrix(a, b, scale=scale), one_by_one)
    odd = balls([[0.0, 0.0], [0.1, 0.0], [0.2, 0.0], [0.9, 0.9]])
    others = balls([[0.0, 0.1], [0.1, 0.1], [0.2, 0.1], [-0.9, 0.0]])
    plan = ot.partial.partial_wasserstein([], [], cost_matrix(odd, others, scale=UNIT), m=0.75)
    np.testing.assert_allclose(plan.sum(axis=1), [0.25, 0.25, 0.25, 0.0], atol=1e-9)


# Contributions.


@pytest.mark.parametrize("name", FAMILIES)
def test_contributions_sum_to_the_square_of_the_distance(name):
    a, b = levels(name, 12), levels(name, 17, split="test")
    found = decompose(a, b)
    assert found.value == pytest.approx(w2(a, b), abs=1e-9)
    for parts in (found.parts, found.by_entity, found.by_factor, found.by_name):
        assert sum(parts.values()) == pytest.approx(found.value**2)
        assert min(parts.values()) >= 0.0
    assert found.by_level_a.sum() == pytest.approx(found.value**2) == found.by_level_b.sum()


def test_contributions_name_what_differs():
    def one(charge: float, gravity: float, *others) -> Levels:
        ball = GolfBall({Position: [0.0, 0.0]})
        return Levels.from_entities([[ball, Charger({segar.Charge: charge}), *others]], parameters={Gravity: gravity})

    scale = {(Charger, segar.Charge): 0.5, (GolfBall, Position): 1.0, (Parameter, Gravity): 2.0}
    found = decompose(one(0.0, 10.0), one(1.0, 11.0, Bumper()), scale=scale, mismatch=3.0)
    assert found.by_name == {
        "Bumper.unmatched": pytest.approx(9.0),
        "Charger.Charge": pytest.approx(4.0),
        "world.Gravity": pytest.approx(0.25),
        "GolfBall.Position": 0.0,
        "GolfBall.unmatched": 0.0,
        "Charger.unmatched": 0.0,
    }
    assert found.by_factor["unmatched"] == pytest.approx(9.0) and found.by_entity["world"] == pytest.approx(0.25)


# Floors.


def test_the_debiased_square_is_near_zero_for_one_distribution_and_near_the_distance_of_distributions_else():
    same = [w2_debiased(levels("empty-hard", 30, s), levels("empty-hard", 40, s, "test"), rng=rng(s)) for s in range(5)]
    squares = np.array([d.square for d in same])
    assert abs(squares.mean()) < 3 * squares.std(ddof=1) / np.sqrt(5)
    assert all(abs(d.square) < 4 * d.standard_error for d in same)
    other = w2_debiased(levels("empty-hard", 30), levels("empty-medium", 40), rng=rng())
    assert other.square > 4 * other.standard_error and other.debiased < other.value
    assert other == w2_debiased(levels("empty-hard", 30), levels("empty-medium", 40), rng=rng())


def test_a_report_by_the_reference_deals_levels_by_the_types_of_both_sets():
    """A post has the factors that balls share with it, so it makes a type of balls that the other set alone does not have."""

    class Post(Thing): ...

    with_post = [[ball, Post({Position: [0.5, 0.5]})] for ball in (GolfBall({Position: [0.1, 0]}), GolfBall())]
    a = Levels.from_entities([[GolfBall({Position: [x, 0.0]})] for x in (-0.9, 0.0, 0.9)])
    pooled = Levels.from_entities([[GolfBall({Position: [x, 0.0]})] for x in (-0.9, 0.0, 0.9)] + with_post)
    report = w2_report(a, Levels.from_entities(with_post), "reference", rng=rng(), resamples=20)
    same = resampled(cost_matrix(pooled, pooled, "reference"), 3, rng(), 20)
    assert (report.value, report.floor, report.p_value) == pytest.approx((same.value, same.floor, same.p_value))


def test_the_floor_falls_with_the_number_of_levels():
    distribution = segar.family("empty-hard")
    many = distribution.sample(300, split="test")
    floors = [w2_debiased(distribution.sample(n), many, rng=rng(), repeats=3).floor_a.mean for n in (3, 30, 300)]
    assert floors[0] > floors[1] > floors[2] > 0


def test_levels_from_a_file_have_no_distribution_to_draw_a_floor_from(tmp_path):
    levels("empty-hard", 3).save(tmp_path / "levels.npz")
    loaded = Levels.load(tmp_path / "levels.npz")
    with pytest.raises(LevelError, match="do not know their distribution"):
        w2_debiased(loaded, loaded, rng=rng())


# Tests of one distribution.


def test_mmd_is_its_definition():
    a, b = balls(rng(0).normal(size=(7, 2))), balls(rng(1).normal(size=(9, 2)))
    x, y = embed(a, b, scale=UNIT)
    h = np.median(pdist(np.concatenate([x, y])))

    def mean_kernel(p, q):
        return np.mean([[np.exp(-((u - v) ** 2).sum() / (2 * h**2)) for v in q] for u in p])

    plain = np.sqrt(mean_kernel(x, x) + mean_kernel(y, y) - 2 * mean_kernel(x, y))
    assert mmd_test(a, b, rng=rng(), resamples=19, scale=UNIT).value == pytest.approx(plain)


def test_dependence_shows_though_all_marginals_are_equal():
    generator = rng(3)
    along = generator.normal(size=(300, 1)) * 0.4
    dependent = balls(np.concatenate([along, along + 0.05 * generator.normal(size=(300, 1))], axis=1))
    independent = balls(generator.normal(size=(300, 2)) * 0.4)
    other = balls(generator.normal(size=(300, 2)) * 0.4)
    assert mmd_test(dependent, independent, rng=rng()).p_value < 0.01
    equal = mmd_test(other, independent, rng=rng())
    assert equal.p_value > 0.01 and mmd_test(dependent, independent, rng=rng()).value > equal.value


def test_a_test_repeats_and_works_on_levels_with_all_kinds_of_entities():
    a, b = levels("puttputt", 40), levels("objectsx3-easy", 40)
    assert mmd_test(a, b, rng=rng()) == mmd_test(a, b, rng=rng())
    assert mmd_test(a, b, rng=rng()).p_value < 0.01


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: w2_sliced(a, "b", rng=rng()), "w2_sliced takes level sets"),
        (lambda a: cost_matrix(a, a, "exat"), "cost_matrix: unknown mode 'exat'"),
        (lambda a: mmd_test(a, a, rng=rng(), resamples=3), "at least 19 resamples, not 3"),
        (lambda a: w2_debiased(a, a, rng=rng(), repeats=1), "at least 2 repeats"),
        (lambda a: decompose(a, None), "decompose takes level sets"),
        (
            lambda a: decompose(a, a, mismatch=-1.0),
            "decompose: mismatch must be a finite number of at least 0, not -1.0",
        ),
    ],
)
def test_wrong_options_are_named(call, message):
    with pytest.raises(LevelError, match=message):
        call(levels("empty-hard", 3))


def test_types_with_nothing_in_common_are_far_but_finite():
    a, b = (Levels.from_entities([[kind({Position: [0.1, 0.2]})] for _ in range(3)]) for kind in (Charger, Magnet))
    assert w2_sliced(a, b, rng=rng()).value == pytest.approx(np.sqrt(2 * 12))


def test_the_unit_of_exact_w2_is_the_spread_of_the_two_distributions_and_not_of_the_levels_drawn():
    easy, hard = (segar.family(name) for name in ("empty-easy", "empty-hard"))
    for n, seed in ((2, 0), (7, 3)):
        a, b = easy.sample(n, seed=seed), hard.sample(n, seed=seed)
        assert spread(a, b) == pytest.approx(spread(easy, hard))
        assert w2(a, b) == pytest.approx(w2(a, b, scale=spread(easy, hard)))
