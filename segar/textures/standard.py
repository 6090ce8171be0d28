"""What the shipped sets have in common: their inputs, the units of these, and the things that must look different."""

from collections.abc import Sequence

import numpy as np

from segar.errors import SegarError
from segar.language import (
    Alive,
    Ball,
    Bumper,
    Charge,
    Charger,
    Damper,
    Density,
    Entity,
    FireTile,
    Friction,
    GoalTile,
    GolfBall,
    Heat,
    Hole,
    MagmaTile,
    Magnet,
    Magnetism,
    Mass,
    SandTile,
    Tile,
)
from segar.textures.inputs import BACKGROUND, is_noise
from segar.textures.samples import UNIFORM, Laws
from segar.textures.texture_sets import TextureSet

# Those of 2022; two by which a goal is told from a hole, and from a tile of the same heat and friction; and one by which the
# ball is told from an object of the same charge.
INPUTS = (
    BACKGROUND,
    *("Heat", "Friction", "Charge", "Magnetism", "Density", "StoredEnergy", "Mass", "Alive"),
    *("Consumes", "GoalTile", "GolfBall"),
    *("noise_1", "noise_2", "noise_3"),
)

# The feature 0 of these is their default, so that a thing whose mass is hidden looks like one of 1 kg.
CENTRED = {"Mass": 1.0, "Density": 1.0}

# What a task is about: it must stand out from everything else.
CHIEF = (GolfBall, GoalTile)

# Each kind of thing, and tiles where all are hot and rough.
KINDS: tuple[Entity, ...] = (
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
    Magnet({Magnetism: 1.0}),
    Charger({Charge: 1.0}),
    *(kind({Heat: 0.7, Friction: 0.7}) for kind in (Tile, GoalTile, Hole)),
)
EXTREMES: tuple[Entity, ...] = (
    *(Ball({Mass: 0.3}), Ball({Mass: 3.0}), Ball({Density: 0.0}), Ball({Density: 2.0}), Ball({Alive: False})),
    Charger({Charge: 2.0}),
)


def units(inputs: Sequence[str] = INPUTS, laws: Laws = UNIFORM) -> tuple[np.ndarray, np.ndarray]:
    """Shift and scale of inputs, float64 ``[input]`` each: a feature is in standard deviations of the input.

    Raises:
        SegarError: there is no distribution for an input.
    """
    for name in inputs:
        if name not in laws and name != BACKGROUND and not is_noise(name):
            raise SegarError(f"no distribution says how much the input '{name}' varies; known: {', '.join(laws)}")
    spreads = [float(laws[name].var) ** 0.5 if name in laws else 1.0 for name in inputs]
    return np.array([CENTRED.get(name, 0.0) for name in inputs]), 1.0 / np.array(spreads)


def looks(textures: TextureSet, things: Sequence[Entity] = KINDS + EXTREMES) -> np.ndarray:
    """Features of the floor and of things without noise, float64 ``[1 + thing, input]``."""
    return np.stack([textures.background(), *(textures.features(textures.values(thing)) for thing in things)])
