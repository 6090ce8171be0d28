"""What the agent sees."""

from segar.observations import StateVector


def looks():
    """The factors of ball and goal."""
    return StateVector(entities=["golfball", "goal"])
