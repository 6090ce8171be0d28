"""Wind that pushes the ball to the right."""

import segar
from windlab.helper import STRENGTH


class Gust(segar.Parameter, default=0.2):
    """How strong the wind blows."""


GAIN = 2.0


@segar.rule
def wind(ball: segar.GolfBall, gust: Gust) -> segar.Aggregate[segar.Acceleration]:
    """Blows to the right."""
    return segar.Aggregate[segar.Acceleration](ball[segar.Acceleration], (GAIN * STRENGTH * gust, 0.0))
