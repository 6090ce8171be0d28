"""Where labels go: beside their things, off other things, off each other, inside the picture."""

from collections.abc import Sequence
from dataclasses import dataclass

Box = tuple[float, float, float, float]  # left, top, right, bottom [px]

# Costs per share of the label's area that is hidden, or hides something.
ON_LABEL, ON_THING, OUTSIDE = 20.0, 8.0, 50.0
DIAGONAL = 0.7  # of the way to the corner of a thing's box: things are round
# Places around a thing in order of preference: direction from its middle, and what another place must be better by.
PLACES = (
    (0.0, 1.0, 0.0),
    (0.0, -1.0, 0.05),
    (1.0, 0.0, 0.1),
    (-1.0, 0.0, 0.1),
    (1.0, 1.0, 0.15),
    (-1.0, 1.0, 0.15),
    (1.0, -1.0, 0.2),
    (-1.0, -1.0, 0.2),
)
MIDDLE = (0.0, 0.0, -0.05)  # of a thing that has room for its label


@dataclass(frozen=True)
class Request:
    """A label of ``width`` x ``height`` [px] for the thing in ``around``, ``inside`` it if that is as good."""

    around: Box
    width: float
    height: float
    inside: bool = False


def place_labels(requests: Sequence[Request], things: Sequence[Box], frame: Box) -> list[Box]:
    """A box for each label, the first ones with the first choice."""
    placed: list[Box] = []
    for request in requests:
        places = (MIDDLE, *PLACES) if request.inside else PLACES
        offered = []
        for x, y, dislike in places:
            box = _box(request, x, y)
            hides = things if (x, y) != (0.0, 0.0) else ()  # in its middle, a label may hide its thing
            offered.append((_cost(box, placed, hides, frame) + dislike, box))
        placed.append(_pushed_inside(min(offered)[1], frame))
    return placed


def _box(request: Request, x: float, y: float) -> Box:
    """The label's box beside the thing, in the direction (x, y) from its middle."""
    left, top, right, bottom = request.around
    share = DIAGONAL if x and y else 1.0
    across = (left + right) / 2 + x * (share * (right - left) / 2 + request.width / 2)
    down = (top + bottom) / 2 + y * (share * (bottom - top) / 2 + request.height / 2)
    return across - request.width / 2, down - request.height / 2, across + request.width / 2, down + request.height / 2


def _cost(box: Box, placed: Sequence[Box], things: Sequence[Box], frame: Box) -> float:
    area = max((box[2] - box[0]) * (box[3] - box[1]), 1e-9)
    hidden = ON_LABEL * sum(overlap(box, other) for other in placed) + ON_THING * sum(overlap(box, t) for t in things)
    return (hidden + OUTSIDE * (area - overlap(box, frame))) / area


def overlap(a: Box, b: Box) -> float:
    """Area that two boxes share [px^2]."""
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _pushed_inside(box: Box, frame: Box) -> Box:
    right = max(frame[0] - box[0], 0.0) - max(box[2] - frame[2], 0.0)
    down = max(frame[1] - box[1], 0.0) - max(box[3] - frame[3], 0.0)
    return box[0] + right, box[1] + down, box[2] + right, box[3] + down
