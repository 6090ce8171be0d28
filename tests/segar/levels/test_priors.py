"""Priors: which one counts, and what is refused when they are written down."""

import numpy as np
import pytest

import segar
from segar import Ball, GaussianNoise, LevelDistribution, Prior, RandomEdgeLocation, RandomUniformLocation, UniformNoise
from segar.errors import PriorError
from segar.language import Charger, Circle, FloorFriction, GlobalFriction, Gravity, Label, StoredEnergy, Thing, is_equal
from segar.language.entities import Bumper, Damper, GoalTile, GolfBall, Magnet, Object, SandTile, ThingFactory, Tile
from segar.language.factors import ID, Charge, Friction, Heat, Mass, Mobile, Order, Position, Shape, Size, Velocity

ANYWHERE = Prior(Position, RandomUniformLocation())


class BigCharger(Charger):
    label: Label = "bigcharger"


class Temperature(segar.Scalar, default=20.0, unit="degC"): ...


class Floors(segar.Count): ...


class HotTemperature(Temperature, default=90.0): ...


class Ember(Tile):
    temperature: Temperature = 300.0
    label: Label = "ember"


class Oven(Tile):
    temperature: HotTemperature
    label: Label = "oven"


def is_positive(q: Charge) -> bool:
    return q > 0.0


def is_heavy(m: Mass) -> bool:
    return m > 1.0


def column(levels: segar.Levels, name: str, factor: type) -> np.ndarray:
    return levels.sampled_values[:, levels.layout.slot_index(name), levels.layout.columns[factor]]


def sizes_of(entity: type, priors: list[Prior]) -> np.ndarray:
    levels = LevelDistribution([(entity, 1)], [ANYWHERE, *priors]).sample(5)
    return column(levels, levels.layout.names[0], Size)


ORDER_OF_SPECIFICITY = [
    Prior(Size, 0.30),
    Prior(Size, 0.31, relation=is_equal(Mass, 1.0)),
    Prior(Size, 0.32, entity_type=Thing),
    Prior(Size, 0.33, entity_type=Object),
    Prior(Size, 0.34, entity_type=Charger),
    Prior(Size, 0.35, entity_type=BigCharger),
    Prior(Size, 0.36, relation=is_equal(Label, "bigcharger")),
    Prior(Size, 0.37, relation=is_equal(ID, "")),
]


@pytest.mark.parametrize("many", range(1, len(ORDER_OF_SPECIFICITY) + 1))
@pytest.mark.parametrize("direction", [1, -1])
def test_the_more_specific_prior_wins_in_whatever_order_they_are_given(many, direction):
    sizes = sizes_of(BigCharger, ORDER_OF_SPECIFICITY[:many][::direction])
    assert (sizes == ORDER_OF_SPECIFICITY[many - 1].value).all()


def test_a_prior_for_chargers_leaves_other_objects_alone():
    priors = [Prior(Size, 0.2, entity_type=Object), Prior(Size, 0.3, entity_type=Charger)]
    assert (sizes_of(Charger, priors) == 0.3).all() and (sizes_of(Magnet, priors) == 0.2).all()


def test_a_prior_on_a_factor_reaches_its_sub_classes_and_a_prior_on_those_goes_first():
    numbers = [(Ember, 1), (Oven, 1)]
    levels = LevelDistribution(numbers, [ANYWHERE, Prior(Temperature, 50.0)]).sample(2)
    assert (column(levels, "oven", HotTemperature) == 50.0).all()
    assert (column(levels, "ember", Temperature) == 50.0).all()
    both = [ANYWHERE, Prior(Temperature, 50.0), Prior(HotTemperature, 70.0)]
    levels = LevelDistribution(numbers, both).sample(2)
    assert (column(levels, "oven", HotTemperature) == 70.0).all()
    assert (column(levels, "ember", Temperature) == 50.0).all()


def test_a_relation_on_the_label_picks_entities_by_type():
    priors = [ANYWHERE, Prior(Mass, 1.0), Prior(Mass, 3.0, relation=is_equal(Label, "magnet"))]
    levels = LevelDistribution([(Ball, 1), (Magnet, 1)], priors).sample(2)
    assert (column(levels, "ball", Mass) == 1.0).all() and (column(levels, "magnet", Mass) == 3.0).all()


@pytest.mark.parametrize("kind", [None, Ball])
def test_a_relation_on_a_number_makes_one_factor_depend_on_another(kind):
    priors = [
        ANYWHERE,
        Prior(Mass, UniformNoise(1.0, 2.0), entity_type=kind),
        Prior(Mass, UniformNoise(5.0, 6.0), entity_type=kind, relation=is_positive),
        Prior(Charge, UniformNoise(-1.0, 1.0)),
    ]
    levels = LevelDistribution([(Ball, 1)], priors).sample(200)
    charge, mass = column(levels, "ball", Charge), column(levels, "ball", Mass)
    assert 60 < (charge > 0).sum() < 140
    assert np.array_equal(mass >= 5.0, charge > 0)


def test_relations_that_both_hold_and_disagree_are_an_error_that_names_both():
    def is_very_heavy(m: Mass) -> bool:
        return m > 1.5

    priors = [ANYWHERE, Prior(Mass, UniformNoise(1, 2)), Prior(Charge, 1, relation=is_heavy)]
    priors.append(Prior(Charge, 2, relation=is_very_heavy))
    with pytest.raises(PriorError, match=r"level \d+.*relation=is_\w*heavy\).*relation=is_\w*heavy\) both hold"):
        LevelDistribution([(Ball, 1)], priors).sample(50)


def test_conditional_priors_that_need_each_other_are_an_error():
    with pytest.raises(PriorError, match=r"need each other's factors: \w+ -> \w+ -> \w+"):
        LevelDistribution(
            [(Ball, 1)], [ANYWHERE, Prior(Mass, 2.0, relation=is_positive), Prior(Charge, 2.0, relation=is_heavy)]
        )


def test_priors_on_parameters_give_a_value_per_level():
    priors = [ANYWHERE, Prior(Gravity, UniformNoise(8.0, 12.0))]
    levels = LevelDistribution([(Ball, 1)], priors, parameters={FloorFriction: UniformNoise(0.1, 0.2)}).sample(100)
    gravity = levels.parameters[:, levels.layout.parameters.index(Gravity)]
    friction = levels.parameters[:, levels.layout.parameters.index(FloorFriction)]
    assert 8 <= gravity.min() < 9 and 11 < gravity.max() <= 12 and len(np.unique(gravity)) == 100
    assert np.array_equal(column(levels, "global_friction", Friction), friction)


def test_the_size_of_a_round_object_drives_its_circle_and_that_of_a_tile_follows_its_shape():
    priors = [ANYWHERE, Prior(Size, GaussianNoise(0.25, 0.01)), Prior(Shape, Circle(0.4), entity_type=GoalTile)]
    levels = LevelDistribution([(Ball, 1), (GoalTile, 1), (SandTile, 1)], priors).sample(50)
    size = levels.values[:, :, levels.layout.columns[Size]]
    drawn = levels.sampled_values[:, :, levels.layout.columns[Size]]
    assert np.array_equal(size[:, 0], drawn[:, 0]) and np.ptp(drawn[:, 0]) > 0
    assert (size[:, 1] == 0.4).all() and np.abs(drawn[:, 1] - 0.25).max() < 0.1
    assert (size[:, 2] == 1.0).all() and np.abs(drawn[:, 2] - 0.25).max() < 0.1


def test_priors_for_types_that_are_not_there_are_left_aside():
    assert len(LevelDistribution([(Ball, 1)], [Prior(Charge, 1.0, entity_type=Charger)]).sample(1)) == 1


@pytest.mark.parametrize(
    ("priors", "message"),
    [
        ([Prior(Mass, 1.0), Prior(Mass, 2.0)], r"same condition.*Prior\(Mass, 1.0\) and Prior\(Mass, 2.0\)"),
        (
            [Prior(Size, 0.2, entity_type=Object), Prior(Size, 0.2, entity_type=Object)],
            r"same condition.*entity_type=Object\) and .*entity_type=Object\)",
        ),
        (
            [Prior(Mass, 1.0, relation=is_equal(Label, "ball")), Prior(Mass, 2.0, relation=is_equal(Label, "ball"))],
            "same condition",
        ),
        ([Prior(Temperature, 3.0)], "no entity in numbers has Temperature"),
        ([Prior(Mass, 1.0, entity_type=GoalTile)], "no GoalTile in numbers has Mass. .*Friction"),
        ([Prior(Friction, 1.0, entity_type=Ball)], "no Ball in numbers has Friction. Known: .*Mass.*Velocity"),
        ([Prior(Gravity, 9.0), Prior(Gravity, 8.0)], "Gravity"),
    ],
)
def test_priors_that_contradict_or_miss_are_refused_at_construction(priors, message):
    with pytest.raises(PriorError, match=message):
        LevelDistribution([(Ball, 1), (GoalTile, 1)], [ANYWHERE, *priors])


def test_a_misspelt_meaning_gets_the_nearest_factor():
    class Charges(segar.Scalar): ...

    with pytest.raises(PriorError, match=r"no entity in numbers has Charges. Did you mean 'Charge'\?"):
        LevelDistribution([(Ball, 1)], [Prior(Charges, 1.0)])


def test_two_equally_specific_priors_of_a_type_with_two_parents_are_an_error():
    class Spiky(Object): ...

    class Sticky(Object): ...

    class Cactus(Spiky, Sticky): ...

    priors = [Prior(Mass, 1.0, entity_type=Spiky), Prior(Mass, 2.0, entity_type=Sticky)]
    with pytest.raises(PriorError, match=r"Mass of Cactus.*equally specific.*entity_type=Cactus"):
        LevelDistribution([(Cactus, 1)], priors)
    assert LevelDistribution([(Cactus, 1)], [*priors, Prior(Mass, 3.0, entity_type=Cactus)]).sample(1)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        *(
            (
                lambda factor=factor, value=value: Prior(factor, value),
                rf"{factor.__name__} takes (a|two) numbers?, not ",
            )
            for factor, values in (
                (Mass, ("2.5", b"2.5", True, np.True_, np.array(True), np.array("2.5"))),
                (Gravity, ("2.5", True)),
                (Floors, ("2", True, np.True_)),
                (segar.Velocity, (("1", "2"), (True, False), (0.5, True), np.array([True, False]))),
            )
            for value in values
        ),
        (lambda: Prior(Mass, "heavy"), r"Prior\(Mass, 'heavy'\): Mass takes a number"),
        (lambda: Prior(Position, UniformNoise(0, 1)), r"on the line does not suit.*Independent\(x, y\)"),
        (lambda: Prior(Mass, RandomEdgeLocation()), "on the plane does not suit a factor on the line"),
        (lambda: Prior(Position, RandomEdgeLocation), r"write RandomEdgeLocation\(\)"),
        (lambda: Prior(Mobile, UniformNoise(0, 1)), "Mobile needs a distribution of whole numbers"),
        (lambda: Prior(Mobile, segar.DiscreteRangeNoise(0, 2)), "Mobile takes True or False"),
        (lambda: Prior(Shape, 0.3), "Shape takes a shape such as Circle"),
        (lambda: Prior(Shape, UniformNoise(0, 1)), "must be a Choice of shapes"),
        (lambda: Prior(Size, -0.2), r"Prior\(Size, -0.2\): it must be a positive number"),
        (lambda: Prior(Gravity, -1.0), r"outside the bounds .* of Gravity"),
        (lambda: Prior(Gravity, UniformNoise(-3, -2)), r"outside the bounds .* of Gravity"),
        (lambda: Prior(Gravity, 9.0, entity_type=Ball), "Gravity belongs to the world"),
        (lambda: Prior(Label, "x"), "text belongs to the entity type"),
        (lambda: Prior(segar.language.Collides, True), "a marker has no value"),
        (lambda: Prior("Mass", 1.0), "must be a factor class"),
        (lambda: Prior(Mass, 1.0, entity_type=ThingFactory([Ball])), "entity_type must be an entity class"),
        (lambda: Prior(Friction, 0.1, entity_type=GlobalFriction), r"write Prior\(FloorFriction, ...\)"),
        (lambda: Prior(Mass, 1.0, relation=segar.is_on), "must be about one entity"),
        (lambda: Prior(Position, (3.0, 0.0)), r"outside the arena, which reaches from -1.0 to 1.0"),
        (lambda: Prior(Position, (0.0, -1.1), entity_type=Ball), r"outside the arena, which reaches from -1.0 to 1.0"),
        (lambda: Prior(Velocity, [1.0, 2.0, 3.0]), "Velocity takes two numbers"),
    ],
)
def test_a_prior_that_cannot_be_meant_is_refused(make, message):
    with pytest.raises(PriorError, match=message):
        make()


def test_a_distribution_that_leaves_the_bounds_is_reported_with_the_level():
    wide = LevelDistribution([(Ball, 1)], [Prior(Size, GaussianNoise(0.1, 0.1))], name="wide")
    with pytest.raises(PriorError, match=r"'wide', level \d+ \(seed 3, split 'test'\): Prior\(Size, .*clip"):
        wide.sample(100, seed=3, split="test")


def test_the_floor_keeps_its_friction_when_a_prior_speaks_of_all_friction():
    levels = LevelDistribution([(GoalTile, 1)], [Prior(Friction, 0.7), Prior(Heat, 0.1)]).sample(1)
    assert column(levels, "goal", Friction)[0] == 0.7 and column(levels, "global_friction", Friction)[0] == 0.05


def test_marginals_are_the_distributions_that_levels_follow():
    numbers = [(GolfBall, 1), (ThingFactory({Bumper: 0.25, Damper: 0.75}), segar.DiscreteRangeNoise(0, 1))]
    priors = [
        ANYWHERE,
        Prior(StoredEnergy, UniformNoise(0.5, 1.0), entity_type=Bumper),
        Prior(Mass, GaussianNoise(1, 0.1)),
    ]
    dist = LevelDistribution(numbers, priors, parameters={Gravity: UniformNoise(8, 12)})
    distributions, levels = dist.marginals(), dist.sample(5000)
    for name in ("golfball", "object1"):
        present = levels.types[:, levels.layout.slot_index(name)] >= 0
        for factor in (StoredEnergy, Mass, Charge, Order):
            drawn = np.sort(column(levels, name, factor)[present])
            share = np.searchsorted(drawn, drawn, side="right") / len(drawn)
            apart = np.abs(share - distributions[name][factor].cdf(drawn)).max()
            assert apart < 1.95 / np.sqrt(len(drawn)), (name, factor)
    assert distributions["parameters"][Gravity] == UniformNoise(8, 12)
    assert distributions["global_friction"][Friction].mean == 0.05


def test_numbers_of_numpy_are_values_of_priors():
    for number in (np.float32(2.0), np.int64(2), np.array(2.0), np.array(2, np.uint8)):
        assert Prior(Mass, number).value == Prior(Floors, number).value == 2.0
    assert Prior(Velocity, np.array([1, 2])).value == (1.0, 2.0)
