"""Levels are as probable as their distribution says: against frequencies, closed forms and entropies."""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

import segar
from segar import GaussianNoise, Gravity, LevelDistribution, Position, Prior, RandomUniformLocation, Shape, UniformNoise
from segar.errors import LevelError, PlacementError, PriorError
from segar.language import Charge, Charger, Circle, Mass, Mobile, Order, Size, Square, StoredEnergy, Thing, ThingFactory
from segar.language.entities import Ball, Bumper, Damper, GoalTile, GolfBall, Object, SandTile, Tile
from segar.levels import Dependent, content_hash
from segar.noise import Deterministic

ANYWHERE = Prior(Position, RandomUniformLocation())


def weight(size: Size) -> float:
    return 20.0 * size**2 if size > 0.2 else 1.0


def is_positive(q: Charge) -> bool:
    return q > 0.0


def column(levels: segar.Levels, slot: int, factor: type) -> np.ndarray:
    return levels.sampled_values[:, slot, levels.layout.columns[factor]]


def changed(levels: segar.Levels, slot: int, factor: type, value: float) -> segar.Levels:
    values = levels.sampled_values.copy()
    values[:, slot, levels.layout.columns[factor]] = value
    return dataclasses.replace(levels, sampled_values=values)


CONDITIONAL = LevelDistribution(
    [(Ball, 2), (GoalTile, 1)],
    [
        ANYWHERE,
        Prior(Size, UniformNoise(0.1, 0.3), entity_type=Ball),
        Prior(Mass, Dependent(GaussianNoise(1.0, 0.1, clip=(0.9, 1.2)), shift=0.5, scale=weight), entity_type=Ball),
        Prior(Charge, UniformNoise(-1.0, 1.0)),
        Prior(Mobile, segar.noise.Bernoulli(0.25), relation=is_positive),
    ],
)
CROWDED = LevelDistribution(
    [(ThingFactory({Bumper: 0.25, Damper: 0.75}), segar.DiscreteRangeNoise(1, 3)), (SandTile, 1)],
    [
        ANYWHERE,
        Prior(StoredEnergy, GaussianNoise(1.0, 0.1), entity_type=Bumper),
        Prior(
            Shape,
            segar.noise.Choice([Circle(0.3), Square(0.5), segar.RandomConvexHull(0.3)], [0.2, 0.3, 0.5]),
            Tile,
        ),
    ],
    parameters={Gravity: UniformNoise(8.0, 12.0)},
    min_distance=0.4,
)


@pytest.mark.parametrize(
    "dist",
    [*map(segar.family, ["empty-medium", "objectsx3-hard", "tilesx1-hard", "billiards"]), CONDITIONAL, CROWDED],
    ids=["empty", "objects", "tiles", "billiards", "conditional", "crowded"],
)
def test_the_entropy_is_the_mean_negative_log_probability(dist):
    probability = dist.log_prob(dist.sample(4000, seed=1))
    assert probability.shape == (4000,) and probability.dtype == np.float64 and np.isfinite(probability).all()
    entropy = dist.entropy(4000)
    error = math.hypot(entropy.error, probability.std() / math.sqrt(4000))
    assert abs(entropy.value + probability.mean()) < 4 * error


def test_the_entropy_of_independent_factors_is_exact():
    distribution = GaussianNoise(1.0, 0.1)
    priors = [Prior(Mass, distribution), Prior(Position, RandomUniformLocation())]
    entropy = LevelDistribution([(Ball, 1)], priors, {Gravity: UniformNoise(8, 12)}).entropy(100)
    expected = distribution.entropy() + RandomUniformLocation().entropy() + math.log(4)
    assert entropy.value == pytest.approx(expected, abs=1e-12) and entropy.error < 1e-12


def test_levels_of_atoms_are_drawn_as_often_as_their_probability_says():
    dist = LevelDistribution(
        [(ThingFactory({Bumper: 0.25, Charger: 0.75}), segar.DiscreteRangeNoise(0, 2)), (SandTile, 1)],
        [
            Prior(Mobile, segar.noise.Bernoulli(0.3), entity_type=Thing),
            Prior(Charge, segar.noise.Choice([-1.0, 1.0], [0.4, 0.6]), entity_type=Charger),
            Prior(Mass, segar.noise.Choice([1.0, 3.0], [0.1, 0.9]), relation=is_positive),
            Prior(Shape, segar.noise.Choice([Circle(0.3), Square(0.5)], [0.25, 0.75]), entity_type=SandTile),
        ],
        positions=[(Object, [(0.5, 0.5), (-0.5, -0.5)]), (SandTile, [(0.0, 0.0)])],
    )
    levels = dist.sample(20_000)
    probability = np.exp(dist.log_prob(levels))
    text = np.array([row.tobytes() for row in np.nan_to_num(levels.sampled_values, nan=-9.0)])
    _, first, count = np.unique(text, return_index=True, return_counts=True)
    expected = probability[first] * len(levels)
    assert probability[first].sum() > 0.99  # nearly all levels that there are have been seen
    many = expected > 5
    assert ((count[many] - expected[many]) ** 2 / expected[many]).sum() < stats.chi2(many.sum()).ppf(0.999)
    assert dist.entropy(4000).value == pytest.approx(-np.log(probability).mean(), abs=0.05)


def test_a_random_hull_that_is_chosen_half_of_the_time_is_half_as_dense():
    often, always = (
        LevelDistribution([(SandTile, 1)], [Prior(Shape, shape)])
        for shape in (
            segar.noise.Choice([Circle(0.3), segar.RandomConvexHull(0.3)]),
            segar.RandomConvexHull(0.3),
        )
    )
    levels = often.sample(40)
    hull = levels.shape_kind[:, 0] == 2
    expected = np.where(hull, math.log(0.5) + always.log_prob(levels), math.log(0.5))
    assert 10 < hull.sum() < 30 and np.allclose(often.log_prob(levels), expected)
    assert (always.log_prob(levels)[~hull] == -math.inf).all()


@pytest.mark.parametrize(("first", "second"), [(Mass, Charge), (Charge, Mass)])
def test_what_a_distribution_reads_is_drawn_before_it(first, second):
    def same(x: first) -> float:
        return x

    same.__annotations__["x"] = first  # the module's annotations are texts, and a text knows no argument of a test
    priors = [Prior(second, Dependent(UniformNoise(0.0, 0.1), shift=same)), Prior(first, UniformNoise(3.0, 4.0))]
    levels = LevelDistribution([(Ball, 1)], priors).sample(50)
    gap = column(levels, 0, second) - column(levels, 0, first)
    assert gap.min() >= 0.0 and gap.max() <= 0.1


def test_the_acceptance_of_two_uniform_points_has_a_closed_form():
    d, side = 0.4, 1.9
    close = (math.pi * d**2 * side**2 - 8 / 3 * d**3 * side + d**4 / 2) / side**4  # two uniform points in a square
    dist = LevelDistribution([(Ball, 2)], [ANYWHERE], min_distance=d)
    share = dist.acceptance(20_000)
    assert abs(share.value - (1 - close)) < 4 * share.error
    levels = dist.sample(50)
    accepted, error = dist.log_acceptance(levels)
    assert (np.abs(accepted - math.log1p(-close)) < 4 * error).all() and (error < 1e-3).all()
    plain = dist.log_prob(levels, normalised=False)
    assert np.allclose(plain, 2 * -math.log(side**2) - math.log(2))  # the last: the two ranks in the pile
    assert np.allclose(dist.log_prob(levels), plain - accepted)


def test_what_cannot_be_drawn_has_no_probability():
    dist = segar.family("objectsx1-hard")
    levels = dist.sample(20)
    ball, goal, crowd = 0, 1, 2
    for slot, factor, value in [(ball, Mass, 7.0), (ball, Size, 0.5), (goal, Order, column(levels, ball, Order)[0])]:
        probability = dist.log_prob(changed(levels, slot, factor, value))
        assert probability[0] == -math.inf, factor
    types = levels.types.copy()
    types[:, crowd] = -1
    assert (dist.log_prob(dataclasses.replace(levels, types=types)) == -math.inf).all()
    assert (dist.log_prob(changed(levels, ball, Position, 0.97)) == -math.inf).all()
    assert np.isfinite(dist.log_prob(levels)).all()


def test_a_level_whose_things_are_too_close_has_no_probability():
    near, far = (LevelDistribution([(Ball, 2)], [ANYWHERE], min_distance=d) for d in (0.2, 0.5))
    levels = near.sample(2000)
    x = levels.layout.columns[Position]
    distance = np.linalg.norm(np.diff(levels.sampled_values[:, :2, x : x + 2], axis=1)[:, 0], axis=-1)
    assert np.array_equal(far.log_prob(levels) == -math.inf, distance <= 0.5)
    ratio = np.exp(far.log_prob(levels) - near.log_prob(levels))  # both densities integrate to one
    assert ratio.mean() == pytest.approx(1.0, abs=4 * ratio.std() / math.sqrt(len(levels)))


def test_levels_of_another_distribution_are_refused():
    with pytest.raises(LevelError, match=r"golfball, goal, object1.*not those of level distribution 'empty-easy'"):
        segar.family("empty-easy").log_prob(segar.family("objectsx1-hard").sample(2))


def opposite(q: Charge) -> float:
    return -q


def follow() -> LevelDistribution:
    """Charged things whose charges are about minus the golf ball's."""
    distribution = Dependent(GaussianNoise(0.0, 0.1), shift=opposite, of="golfball")
    priors = [
        ANYWHERE,
        Prior(Charge, UniformNoise(1.0, 2.0), entity_type=GolfBall),
        Prior(Charge, distribution, entity_type=Charger),
    ]
    return LevelDistribution([(Charger, 2), (GolfBall, 1), (GoalTile, 1)], priors)


def test_a_distribution_may_depend_on_a_factor_of_another_entity():
    dist = follow()
    levels = dist.sample(2000)
    ball = column(levels, levels.layout.slot_index("golfball"), Charge)
    apart = np.stack([column(levels, slot, Charge) + ball for slot in (0, 1)])
    assert np.abs(apart).max() < 0.5 and apart.std() == pytest.approx(0.1, rel=0.05)
    assert abs(np.corrcoef(apart)[0, 1]) < 0.08 > abs(np.corrcoef(apart[0], ball)[0, 1])
    assert Charge not in dist.marginals()["charger1"] and "of='golfball'" in str(dist.explain(Charger, Charge))
    rest = dist.log_prob(levels) - stats.norm(0, 0.1).logpdf(apart).sum(axis=0)
    assert np.ptp(rest) < 1e-9  # places, ranks and the golf ball's charge are equally probable wherever they are


@pytest.mark.parametrize(
    ("numbers", "priors", "message"),
    [
        ([(Charger, 1)], [], r"there is no entity 'golfball'. Known: charger"),
        ([(Charger, 1), (GolfBall, segar.DiscreteRangeNoise(0, 1))], [], "reads 'golfball', which not every level has"),
        (
            [(Charger, 1), (GolfBall, 1)],
            [Prior(Charge, Dependent(UniformNoise(0, 1), opposite, of="charger"), entity_type=GolfBall)],
            r"need each other's factors: \w+.Charge -> \w+.Charge -> \w+.Charge",
        ),
    ],
)
def test_an_entity_that_cannot_be_read_is_named(numbers, priors, message):
    distribution = Dependent(GaussianNoise(0.0, 0.1), shift=opposite, of="golfball")
    with pytest.raises(PriorError, match=message):
        LevelDistribution(numbers, [ANYWHERE, Prior(Charge, distribution, entity_type=Charger), *priors])


def test_an_entity_that_lacks_what_is_read_is_named():
    distribution = Dependent(GaussianNoise(0.0, 0.1), shift=opposite, of="goal")
    with pytest.raises(PriorError, match="its distribution reads Charge, which GoalTile lacks"):
        LevelDistribution([(Charger, 1), (GoalTile, 1)], [ANYWHERE, Prior(Charge, distribution, entity_type=Charger)])
    with pytest.raises(PriorError, match="of must be the name of an entity, such as 'golfball', not <class"):
        Dependent(GaussianNoise(0.0, 0.1), shift=opposite, of=GolfBall)


def test_a_level_with_a_dependent_distribution_is_as_probable_as_by_hand():
    distribution = GaussianNoise(1.0, 0.1, clip=(0.9, 1.2))
    priors = [
        ANYWHERE,
        Prior(Size, UniformNoise(0.1, 0.3)),
        Prior(Mass, Dependent(distribution, shift=0.5, scale=weight)),
    ]
    levels = LevelDistribution([(Ball, 1)], priors).sample(400)
    size, mass = column(levels, 0, Size), column(levels, 0, Mass)
    scale = np.where(size > 0.2, 20 * size**2, 1.0)
    z = (mass - 0.5) / scale
    low, high = np.isclose(z, 0.9, atol=1e-12), np.isclose(z, 1.2, atol=1e-12)
    by_hand = stats.norm(1.0, 0.1).logpdf(z) - np.log(scale)
    by_hand[low], by_hand[high] = stats.norm.logcdf(-1.0), stats.norm.logsf(2.0)
    expected = by_hand - math.log(0.2) - math.log(1.9**2)
    assert low.sum() > 20 and high.any() and np.allclose(levels.distribution.log_prob(levels), expected)


def test_a_changed_dependence_is_another_distribution():
    def twice(size: Size) -> float:
        return 2.0 * size

    def thrice(size: Size) -> float:
        return 3.0 * size

    def doubled(size: Size) -> float:
        return 2.0 * size

    distributions = [Dependent(UniformNoise(0.9, 1.1), scale=function) for function in (twice, thrice, doubled)]
    hashes = [LevelDistribution([(Ball, 1)], [Prior(Mass, one)]).hash for one in distributions]
    assert hashes[0] != hashes[1] and hashes[0] == hashes[2]
    assert distributions[0] == distributions[2] != distributions[1]
    read = [Dependent(UniformNoise(0, 1), opposite, of=name) for name in (None, "a", "b", "a")]
    assert len({content_hash(one) for one in read}) == 3 and read[2] != read[1] == read[3]


def pulled(g: Gravity) -> float:
    return g


def charged(q: Charge) -> float:
    return q


def placed(x: Position) -> float:
    return x.norm()


HALVES = UniformNoise(0.5, 1.0)
SHAPES = Prior(Shape, segar.noise.Choice([Circle(0.3), Circle(0.5)]))


def balls(*priors: Prior) -> LevelDistribution:
    return LevelDistribution([(Ball, 1)], priors)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Dependent(HALVES, shift=pulled), r"shift: .*pulled.* only numbers of one entity"),
        (lambda: Dependent(HALVES, scale="twice"), r"scale must be a finite number or a typed function"),
        (lambda: Dependent(3), r"needs a distribution on the line, not 3"),
        (lambda: Prior(Position, Dependent(HALVES)), r"for factors that are one real number"),
        (lambda: LevelDistribution([(GoalTile, 1)], [Prior(Size, Dependent(HALVES, shift=charged))]),
         r"reads Charge, which GoalTile lacks; give the prior an entity_type"),
        (lambda: balls(Prior(Mass, Dependent(HALVES, scale=placed))), r"its distribution reads Position, which is drawn last"),
        (lambda: balls(SHAPES, Prior(Mass, Dependent(HALVES, scale=weight))),
         r"reads Size, which for Ball is that of a shape that is chosen later"),
        (lambda: balls(Prior(Mass, Dependent(HALVES, scale=charged)), Prior(Charge, 0.0)).sample(1),
         r"level 0 .*with shift 0 and scale 0, which Mass cannot be"),
    ],
)  # fmt: skip
def test_a_dependence_that_cannot_be_meant_is_refused(make, message):
    with pytest.raises(PriorError, match=message):
        make()


def test_an_order_that_may_be_zero_leaves_open_how_it_came_about():
    dist = LevelDistribution([(Ball, 1)], [Prior(Order, segar.DiscreteRangeNoise(0, 2))])
    with pytest.raises(PriorError, match=r"Order of 'ball' may be drawn as 0"):
        dist.log_prob(dist.sample(2))
    fixed = LevelDistribution([(Ball, 1)], [Prior(Order, segar.DiscreteRangeNoise(1, 4))])
    assert np.allclose(fixed.log_prob(fixed.sample(3)), math.log(0.25))


def test_an_acceptance_too_rare_to_estimate_is_an_error_that_says_what_to_do():
    dist = LevelDistribution([(Ball, 2)], [ANYWHERE], min_distance=0.1)
    levels = dist.sample(2)
    wide = LevelDistribution([(Ball, 2)], [ANYWHERE], min_distance=2.7)
    assert wide.acceptance(2000).value == 0.0
    with pytest.raises(PlacementError, match=r"too rare to be estimated; use log_prob\(levels, normalised=False\)"):
        wide.log_prob(levels)


def test_an_explanation_names_the_winner_the_losers_and_their_ranks():
    dist = segar.family("objectsx3-hard")
    found = dist.explain("golfball", Size)
    assert found.winner is not None and found.value == GaussianNoise(0.2, 0.01, clip=(0.1, 0.3))
    assert [c.verdict for c in found.candidates] == [
        "wins: specificity 5 (entity type Object, 3 classes deep)",
        "does not apply: GolfBall is no Tile",
    ]
    both = LevelDistribution([(Ball, 1)], [Prior(Mass, 2.0), Prior(Mass, 3.0, entity_type=Ball)])
    assert [c.verdict.split(":")[0] for c in both.explain(Ball, Mass).candidates] == ["wins", "loses"]
    assert both.explain(Ball, Mass).value == 3.0
    assert both.explain(Ball, Charge).source == "Ball's own; no prior sets it"


def test_where_relations_decide_the_explanation_says_so():
    story = str(CONDITIONAL.explain("ball1", Mobile))
    assert story.startswith("Mobile of Ball 'ball1': decided level by level\n")
    assert "relation=is_positive): wins where its relation holds: specificity 1 (relation is_positive)" in story


def test_parameters_and_fixed_places_are_explained_too():
    assert CROWDED.explain(None, Gravity).value == UniformNoise(8.0, 12.0)
    assert segar.family("objectsx1-hard").explain(None, Gravity).source == "the default"
    fixed = LevelDistribution([(GolfBall, 1)], [ANYWHERE], positions=[(GolfBall, [(0.5, 0.0)])])
    assert fixed.explain("golfball", Position).source == "fixed by positions="


@pytest.mark.parametrize(
    ("entity", "factor", "message"),
    [
        ("golfbal", Size, r"no entity 'golfbal'. Did you mean 'golfball'\?"),
        ("object1", Size, "'object1' may be one of Charger, Magnet"),
        (SandTile, Size, "no SandTile is in numbers"),
        (GoalTile, Mass, "GoalTile has no Mass"),
        ("golfball", "Mass", "takes a factor class such as segar.Mass, not 'Mass'"),
    ],
)
def test_a_question_that_has_no_answer_is_refused(entity, factor, message):
    with pytest.raises(PriorError, match=message):
        segar.family("objectsx3-hard").explain(entity, factor)


def test_a_thing_that_always_starts_at_a_place_is_there_whatever_its_prior():
    dist = LevelDistribution([(GolfBall, 1), (Ball, 1)], [ANYWHERE], positions=[(GolfBall, [(0.5, -0.25)])])
    found = dist.marginals()
    assert found["golfball"][Position] == Deterministic((0.5, -0.25)) != found["ball"][Position]
