"""The default level distribution of Invisiball: chargers between the ball and the goal."""

from segar.language import Charge, Charger, Circle, GoalTile, GolfBall, Mass, Mobile, Object, Position, Shape, Size
from segar.levels.priors import Prior
from segar.noise import (
    DiscreteRangeNoise,
    GaussianNoise,
    RandomBottomLocation,
    RandomMiddleLocation,
    RandomTopLocation,
)

invisiball_default_config = {
    "numbers": [(Charger, DiscreteRangeNoise(1, 3)), (GoalTile, 1), (GolfBall, 1)],
    "priors": [
        Prior(Position, RandomMiddleLocation(), entity_type=Charger),
        Prior(Position, RandomBottomLocation(), entity_type=GolfBall),
        Prior(Position, RandomTopLocation(), entity_type=GoalTile),
        Prior(Shape, Circle(0.3), entity_type=GoalTile),
        Prior(Size, GaussianNoise(0.2, 0.01, clip=(0.1, 0.25)), entity_type=Object),
        Prior(Mass, 1.0),
        Prior(Mobile, True),  # chargers move, so that they tell where the ball is
        Prior(Charge, 1.0, entity_type=Charger),
    ],
    "task": "invisiball",
}
