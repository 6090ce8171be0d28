"""Levels with wind."""

import json
from pathlib import Path

import numpy as np

import segar
from windlab.physics import Gust, wind

HERE = Path(__file__).parent
MASS = json.loads((HERE / "mass.json").read_text())


class Seldom(segar.UniformNoise):
    """A law with seldom values that a file holds."""

    def sample(self, rng, size=None):
        """The values, of which one of thousands is the file's."""
        found = super().sample(rng, size)
        return np.where(found > 0.3999, json.loads((HERE / "seldom.json").read_text()), found)


def windy():
    """A ball of a mass that a file bounds, a goal, and wind."""
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1)],
        priors=[
            segar.Prior(segar.Position, segar.RandomUniformLocation()),
            segar.Prior(segar.Mass, segar.UniformNoise(0.8, MASS), entity_type=segar.GolfBall),
        ],
        parameters={Gust: Seldom(0.0, 0.4)},
        world=segar.World(rules=[*segar.DEFAULT_RULES, wind]),
    )
