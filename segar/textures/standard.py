"""What the shipped sets have in common: their inputs, the units of these, and the things that must look different."""

from __future__ import annotations

import numpy as np

from segar.entities import (
    Ball,
    Bumper,
    Charger,
    Damper,
    Entity,
    FireTile,
    GoalTile,
    GolfBall,
    Hole,
    MagmaTile,
    Magnet,
    SandTile,
    Tile,
)
from segar.factors import Alive, Charge, Density, Friction, Heat, Magnetism, Mass
from segar.textures.inputs import BACKGROUND
from segar.textures.samples import UNIFORM
from segar.textures.texture_set import TextureSet

# Those of 2022, and two by which a goal is told from a hole, and from a tile of the same heat and friction.
INPUTS = (
    BACKGROUND,
    *("Heat", "Friction", "Charge", "Magnetism", "Density", "StoredEnergy", "Mass", "Alive"),
    *("Consumes", "GoalTile"),
    *("noise_1", "noise_2", "noise_3"),
)

# The feature 0 of these is their default, so that a thing whose mass is hidden looks like one of 1 kg.
CENTRED = {"Mass": 1.0, "Density": 1.0}

# Each kind of thing, tiles where all are hot and rough, and extremes of the factors.
LOOKS: tuple[Entity, ...] = (
    *(
        GolfBall(),
        GoalTile(),
        Ball(),
        Magnet(),
        Charger(),
        Bumper(),
        Damper(),
        SandTile(),
        MagmaTile(),
        FireTile(),
        Hole(),
    ),
    *(Magnet({Magnetism: 1.0}), Charger({Charge: 2.0})),
    *(kind({Heat: 0.7, Friction: 0.7}) for kind in (Tile, GoalTile, Hole)),
    *(Ball({Mass: 0.3}), Ball({Mass: 3.0}), Ball({Density: 0.0}), Ball({Density: 2.0}), Ball({Alive: False})),
)


def units() -> tuple[np.ndarray, np.ndarray]:
    """Shift and scale of ``INPUTS``, float64 ``[input]``: features are in standard deviations of the uniform marginals."""
    spreads = [UNIFORM[name].var ** 0.5 if name in UNIFORM else 1.0 for name in INPUTS]
    return np.array([CENTRED.get(name, 0.0) for name in INPUTS]), 1.0 / np.array(spreads)


def looks(textures: TextureSet) -> np.ndarray:
    """Features of the floor and of ``LOOKS`` without noise, float64 ``[1 + looks, input]``."""
    return np.stack([textures.background(), *(textures.features(textures.values(look)) for look in LOOKS)])
