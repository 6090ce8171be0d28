"""The level distributions of PuttPutt: the default one, as the paper prints it, and one thing in the middle."""

from segar.language import (
    Ball,
    Bumper,
    Charge,
    Charger,
    Circle,
    Damper,
    FireTile,
    Friction,
    GoalTile,
    GolfBall,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mass,
    Mobile,
    Object,
    Position,
    RandomConvexHull,
    SandTile,
    Shape,
    Size,
    ThingFactory,
    Tile,
)
from segar.levels.priors import Prior
from segar.noise import (
    DiscreteRangeNoise,
    GaussianMixtureNoise,
    GaussianNoise,
    RandomBottomLocation,
    RandomEdgeLocation,
    RandomMiddleLocation,
    RandomTopLocation,
    UniformNoise,
)

PLUS_OR_MINUS_ONE = GaussianMixtureNoise(means=[-1.0, 1.0], stds=[0.1, 0.1])

puttputt_default_config = {
    "numbers": [
        (ThingFactory([Charger, Magnet, Bumper, Damper, Ball]), DiscreteRangeNoise(1, 2)),
        (ThingFactory({SandTile: 0.4, MagmaTile: 0.2, Hole: 0.2, FireTile: 0.2}), DiscreteRangeNoise(1, 2)),
        (GoalTile, 1),
        (GolfBall, 1),
    ],
    "priors": [
        Prior(Position, RandomEdgeLocation(), entity_type=Object),
        Prior(Position, RandomMiddleLocation(), entity_type=Tile),
        Prior(Position, RandomBottomLocation(), entity_type=GolfBall),
        Prior(Position, RandomTopLocation(), entity_type=GoalTile),
        Prior(Shape, RandomConvexHull(0.3), entity_type=Tile),
        Prior(Shape, Circle(0.3), entity_type=GoalTile),
        Prior(Shape, Circle(0.4), entity_type=Hole),
        Prior(Size, GaussianNoise(0.2, 0.01, clip=(0.1, 0.3)), entity_type=Object),
        Prior(Size, GaussianNoise(1.0, 0.01, clip=(0.5, 1.1)), entity_type=Tile),
        Prior(Mass, 1.0),
        Prior(Mobile, False),
        Prior(Mobile, True, entity_type=Ball),
        Prior(Mobile, True, entity_type=GolfBall),
        Prior(Charge, PLUS_OR_MINUS_ONE, entity_type=Charger),
        Prior(Magnetism, PLUS_OR_MINUS_ONE, entity_type=Magnet),
        Prior(Friction, UniformNoise(0.2, 1.0), entity_type=SandTile),
    ],
}

ANYTHING = ThingFactory([Charger, Magnet, Bumper, Damper, Object, SandTile, MagmaTile, Hole, FireTile])

puttputt_random_middle_config = {
    "numbers": [(ANYTHING, 1), (GoalTile, 1), (GolfBall, 1)],
    "priors": [
        Prior(Position, RandomMiddleLocation()),
        Prior(Position, RandomBottomLocation(), entity_type=GolfBall),
        Prior(Position, RandomTopLocation(), entity_type=GoalTile),
        Prior(Shape, RandomConvexHull(0.3), entity_type=Tile),
        Prior(Shape, Circle(0.3), entity_type=GoalTile),
        Prior(Size, GaussianNoise(0.2, 0.01, clip=(0.1, 0.3)), entity_type=Object),
        Prior(Size, GaussianNoise(1.0, 0.01, clip=(0.5, 1.5)), entity_type=Tile),
        Prior(Mass, 1.0),
        Prior(Mobile, True),
        Prior(Charge, PLUS_OR_MINUS_ONE, entity_type=Charger),
        Prior(Magnetism, PLUS_OR_MINUS_ONE, entity_type=Magnet),
        Prior(Friction, UniformNoise(0.2, 1.0), entity_type=SandTile),
    ],
}
