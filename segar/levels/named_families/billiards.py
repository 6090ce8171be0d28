"""The default level distribution of Billiards: ten balls in a rack, a pocket in each corner, the cue ball anywhere below."""

from segar.language import Ball, Circle, CueBall, Hole, Position, Shape, Size
from segar.levels.priors import Prior
from segar.levels.sampling.placement import ARENA_HIGH, WALL_MARGIN
from segar.noise import GaussianNoise, RandomBottomLocation

ROWS = 4  # of the rack, which holds one ball, then two, three and four
ROW_SPACING = 2**0.5 * (0.1 + 0.001)  # [m] between rows; neighbours along the sides are 2 mm apart
POCKET_SIZE = 0.3  # [m]
# [m] As near to the corner as the walls allow. In 2022 pockets were put at 0.9 and then moved here, out of the walls.
POCKET_PLACE = ARENA_HIGH - POCKET_SIZE / 2 - WALL_MARGIN

RACK = [((2 * k - row) * ROW_SPACING, row * ROW_SPACING) for row in range(ROWS) for k in range(row + 1)]
POCKETS = [(x * POCKET_PLACE, y * POCKET_PLACE) for x in (-1, 1) for y in (-1, 1)]

billiards_default_config = {
    "numbers": [(CueBall, 1), (Ball, len(RACK)), (Hole, len(POCKETS))],
    "priors": [
        Prior(Position, RandomBottomLocation(), entity_type=CueBall),
        Prior(Size, GaussianNoise(0.2, 0.01, clip=(0.1, 0.3)), entity_type=CueBall),
        Prior(Shape, Circle(POCKET_SIZE), entity_type=Hole),
    ],
    "positions": [(Ball, RACK), (Hole, POCKETS)],
    "task": "billiards",
}
