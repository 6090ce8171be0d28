"""Levels with wind."""

import json
from pathlib import Path

import segar
from windlab.physics import Gust, wind

MASS = json.loads((Path(__file__).parent / "mass.json").read_text())


def windy():
    """A ball of a mass that a file bounds, a goal, and wind."""
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1)],
        priors=[
            segar.Prior(segar.Position, segar.RandomUniformLocation()),
            segar.Prior(segar.Mass, segar.UniformNoise(0.8, MASS), entity_type=segar.GolfBall),
        ],
        parameters={Gust: segar.UniformNoise(0.0, 0.4)},
        world=segar.World(rules=[*segar.DEFAULT_RULES, wind]),
    )
