"""What the signs on things are like, for all who draw them: pictures by pygame, and the page of a playground.

Lengths are in pixels of an arena of 512 pixels where they are not shares of a radius. Colours are red, green and blue.
"""

from typing import Any

SIGNS: dict[str, Any] = {
    "goal_rings": (0.68, 0.36),  # shares of the radius
    "goal_dot": 2.5,
    "hole_steps": ((1.0, 60), (0.93, 40), (0.86, 20), (0.79, 0)),  # shares of the outline, and grey
    "dots": {"widest": 20, "closer": 12, "size": 1.1},  # closer with friction
    "waves": {"widest": 30, "closer": 16, "width": 1.3},  # closer with heat
    "chevrons": {"count": 8, "least": 4, "more": 7, "most": 14, "push": (190, 255, 60), "brake": (255, 170, 90)},
    "bolts": {"count": 4, "inside": 4.5, "size": 1.8},
    "agent": {"outside": 3.5, "width": 1.8, "colour": (255, 240, 120)},
    "dead": {"side": 1.3, "width": 4, "colour": (230, 40, 40), "grey": (120, 120, 124)},
    "sign": {
        "alone": 0.9,
        "beside": 0.65,
        "apart": 0.42,
        "weakest": 0.55,
    },  # of charges and magnets, shares of the radius
}
