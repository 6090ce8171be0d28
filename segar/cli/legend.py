"""One picture with all the signs that people have to know."""

import numpy as np

from segar.envs import VectorEnv
from segar.language import (
    Alive,
    Ball,
    Bumper,
    Charge,
    Charger,
    Circle,
    Damper,
    Done,
    Entity,
    FireTile,
    Friction,
    GoalTile,
    GolfBall,
    Heat,
    Hexagon,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mobile,
    Object,
    Position,
    SandTile,
    Shape,
    Square,
    StoredEnergy,
    Tile,
    Triangle,
    Velocity,
    Visible,
)
from segar.levels import Levels
from segar.rendering import View

THINGS: tuple[Entity, ...] = (
    GolfBall({Position: (-0.6, 0.6), Velocity: (3.0, -1.0)}),
    GoalTile({Position: (0.7, 0.7), Heat: 0.4}),
    Ball({Position: (-0.2, 0.6), Alive: False}),
    Ball({Position: (0.2, 0.6), Visible: False}),
    Charger({Position: (-0.6, 0.1), Charge: -0.2}),
    Charger({Position: (-0.1, 0.1), Charge: 1.5, Magnetism: 0.5}),
    Magnet({Position: (0.4, 0.1), Magnetism: 1.0}),
    Bumper({Position: (-0.6, -0.4)}),
    Damper({Position: (-0.1, -0.4), StoredEnergy: -1.0}),
    Object({Position: (0.4, -0.35), Mobile: False, Done: True}),
    SandTile({Position: (0.6, -0.6), Shape: Triangle(0.7), Friction: 0.9}),
    MagmaTile({Position: (0.75, 0.15), Shape: Square(0.35)}),
    FireTile({Position: (-0.5, -0.8), Shape: Circle(0.35)}),
    Hole({Position: (0.1, -0.8), Shape: Hexagon(0.4)}),
    Tile({Position: (-0.2, 0.9), Shape: Square(0.15)}),
)


def legend(size: int = 768) -> np.ndarray:
    """A level in which everything has a sign, uint8 ``View(size).shape``."""
    env = VectorEnv(Levels.from_entities([THINGS]), 1, render_mode="rgb_array", view=View(size=size), seed=0)
    env.reset()
    frames = env.render()
    assert frames is not None
    return frames[0]
