"""What an observation says that it shows changes it; what it hides cannot be told from it, to the bit."""

from typing import Any

import numpy as np
import pytest

import segar
from segar import Charge, Count, Factor, Flag, Mass, Velocity
from segar.observations import Colour, Multi, OneOf, Pixels, PreviousActions, Stack, StateVector, TexturedPixels
from segar.observations.protocol import empty_batch, leaves

THINGS = (
    segar.GolfBall, segar.Ball, segar.Charger, segar.Magnet, segar.Bumper, segar.Damper, segar.SandTile, segar.MagmaTile,
    segar.GoalTile,
)  # fmt: skip
LEVELS = segar.LevelDistribution(
    numbers=[(kind, 1) for kind in THINGS], priors=[segar.Prior(segar.Position, segar.RandomUniformLocation())]
).sample(3, seed=0)
FACTORS = LEVELS.layout.factors
STATES = [
    StateVector(),
    StateVector(hidden=[Mass, Velocity]),
    StateVector(factors=[Charge, segar.Acceleration], mask="dict", normalise=True),
    StateVector(form="table", slots=12, hidden=["Position"], mask="numbers", missing=-1000.0),
    StateVector(sees_invisible=False),
    Multi(
        {
            "velocity": StateVector(factors=[Velocity]),
            "past": PreviousActions(2),
            "mass": (StateVector(factors=[Mass]),),
        }
    ),
    Stack(StateVector(hidden=[Charge]), 3),
    OneOf([StateVector(factors=[Mass, Charge], types=False), StateVector(factors=[Charge, Mass], types=False)]),
]
FRAMES = [
    Pixels(),
    Multi([Pixels(), StateVector(factors=[Mass])]),
    Stack(
        Pixels(colours={segar.Ball: Colour((0, 0, 0), (200, 90, 9), Mass, (0.0, 2.0))}),
        2,
    ),
    TexturedPixels(hidden=(Charge,)),
    OneOf([TexturedPixels(hidden=(Charge,)), Pixels()], per="level"),
]


def seen_after(observation: Any, factor: type[Factor] | None) -> list[np.ndarray]:
    """All arrays that are observed of two environments per level: at the start, if ``factor`` is None; else after an
    intervention on this factor, alone, of everything that has it; and after an intervention and an action."""
    n, level = 2 * len(LEVELS), np.repeat(np.arange(len(LEVELS)), 2)
    bound, values = observation.bind(LEVELS, n), LEVELS.values[level].copy()
    out, rows, everywhere = empty_batch(bound.space, n), np.arange(n), np.ones(n, np.bool_)
    if hasattr(bound, "start"):
        bound.start(np.arange(n).astype(np.uint64) * 977, level, everywhere)
    bound.begin(values, level, everywhere)
    bound.write(values, level, out, rows)
    if factor is not None:
        columns = slice(LEVELS.layout.columns[factor], LEVELS.layout.columns[factor] + factor.width)
        values[:, :, columns] = other(factor, values[:, :, columns])
    bound.begin(values, level, everywhere)
    bound.write(values, level, out, rows)
    found = [array.copy() for array in leaves(out)]
    if hasattr(bound, "advance"):
        bound.advance(np.full((n, 2), 0.5, np.float32))
    bound.write(values, level, out, rows)
    return found + [array.copy() for array in leaves(out)]


def other(factor: type[Factor], values: np.ndarray) -> np.ndarray:
    """Another value that the factor may have, for each entity; nan stays nan."""
    if issubclass(factor, Flag):
        return 1 - values
    if issubclass(factor, Count):
        return -values
    return values * 0.9 + 0.07


def is_changed(observation: Any, factor: type[Factor]) -> bool:
    before, after = seen_after(observation, None), seen_after(observation, factor)
    return not all(np.array_equal(a, b) for a, b in zip(before, after, strict=True))


@pytest.mark.parametrize("factor", FACTORS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("observation", STATES, ids=range(len(STATES)))
def test_a_state_changes_with_a_factor_exactly_if_it_says_that_it_shows_it(observation, factor):
    assert is_changed(observation, factor) == observation.shows(factor)


@pytest.mark.parametrize("factor", FACTORS, ids=lambda f: f.__name__)
@pytest.mark.parametrize("observation", FRAMES, ids=range(len(FRAMES)))
def test_a_frame_does_not_change_with_a_factor_that_it_hides(observation, factor):
    if not observation.shows(factor):
        assert not is_changed(observation, factor)
    elif factor is not segar.language.Order:  # which shows where things overlap
        assert is_changed(observation, factor)


def test_each_of_these_observations_shows_something_and_hides_something():
    for observation in STATES + FRAMES:
        shown = [observation.shows(factor) for factor in FACTORS]
        assert any(shown) and not all(shown)
