"""What the agent sees."""

import json
from pathlib import Path

import segar
from segar.observations import StateVector


def looks():
    """The factors of ball and goal, of which a file scales one."""
    scale = json.loads((Path(__file__).parent / "scale.json").read_text())
    return StateVector(entities=["golfball", "goal"], scale={segar.Mass: scale})
