"""Numbers of an observation that are too large to learn from, found by random play before training begins."""

import math
from collections.abc import Mapping
from itertools import islice

import numpy as np

from segar.envs import VectorEnv, play
from segar.evaluation import Random
from segar.experiments.levels.builders import Prepared
from segar.observations import StateVector

LARGE = 10.0  # a network whose weights start at the usual size learns badly from numbers beyond
SHARE = 0.01  # of the states; speeds exceed LARGE in fewer, after a collision
NUM_ENVS, MOST_STEPS = 8, 200


def large_numbers(prepared: Prepared) -> dict[str, float]:
    """The numbers that exceed ``LARGE`` in more than ``SHARE`` of the states of random play, and the largest of each.

    One episode in each of ``NUM_ENVS`` environments is played, at most ``MOST_STEPS`` of its steps. The environments, their
    seed and the policy belong to this function, so that a run has the same results with and without it. Of
    observations other than :class:`segar.observations.StateVector` nothing is known.

    Returns:
        The largest absolute value by the number's name, such as ``golfball.Hits``.
    """
    options = prepared.env_options()
    state = options["observation"] if not isinstance(options["observation"], str) else None
    if not isinstance(state, StateVector) or state.mask == "dict":
        return {}
    env = VectorEnv(prepared.level_sets[0], NUM_ENVS, seed=0, **options)
    names = env.observation.names  # type: ignore[attr-defined]
    states = [now.observation for now in islice(play(env, Random(0), env.reset()), MOST_STEPS + 1)]
    env.close()
    numbers = np.concatenate(states).astype(float).reshape(-1, len(names))
    sizes = np.where(numbers == state.missing, 0.0, np.abs(numbers))
    is_large = (sizes > LARGE).mean(axis=0) > SHARE
    return {names[k]: float(sizes[:, k].max()) for k in np.flatnonzero(is_large)}


def advice(found: Mapping[str, float], prepared: Prepared) -> str:
    """What to say of the numbers that :func:`large_numbers` found: their names, and the settings that scale them."""
    factors: dict[str, float] = {}
    for name, value in found.items():
        factor = name.split(".")[1]
        factors[factor] = max(factors.get(factor, 0.0), value)
    known = prepared.config.observation.options.get("scale", {})
    overrides = [
        f"observation.options.scale.{factor}={_round_up(value * known.get(factor, 1.0)):g}"
        for factor, value in factors.items()
    ]
    largest = ", ".join(f"{name} up to {value:,.0f}" for name, value in found.items())
    return (
        f"warning: the observation has large numbers, from which an agent learns badly: {largest} in random play. Divide"
        f" them by constants: {' '.join(overrides)}"
    )


def _round_up(value: float) -> float:
    """The least number of one digit and zeros that is not below a positive one."""
    unit = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / unit) * unit
