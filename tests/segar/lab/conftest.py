"""A lab that tests read: a space of four options, so that its kernel is compiled soon."""

import numpy as np
import pytest

import segar
from segar import Mass, UniformNoise
from segar.lab import Grader, Lab
from segar.noise import Choice
from segar.rules import RuleSpace
from segar.rules.templates import central_force, drag, portal, uniform_field

WORLD = 9  # has a force of exponent 1.5, and a drag

SPACE = RuleSpace(
    [
        central_force("force", Mass, Mass, exponent=Choice([0.0, 1.5, 3.0]), strength=UniformNoise(0.5, 1.0)),
        drag("drag", coefficient=UniformNoise(0.25, 2.0)),
        uniform_field("field", Mass, x=UniformNoise(-1, 1), y=UniformNoise(-1, 1)),
        portal("gate", x=0.3, y=0.3, to_x=-0.5, to_y=UniformNoise(-0.5, 0.5)),
    ],
    active=2,
    exclusive=[("field", "gate")],
)
DISTRIBUTION = segar.family("objectsx1-hard").with_rules(SPACE)


@pytest.fixture(scope="session")
def lab() -> Lab:
    """A world with a force of exponent 1.5 and a drag, seen without noise."""
    return Lab(DISTRIBUTION, world=WORLD, noise=0.0)


@pytest.fixture(scope="session")
def grader(lab) -> Grader:
    return Grader(lab)


def replayed(lab, ask, actions, set=None, parameters=None):
    """The states that an environment goes through, float64 ``(steps, entities, columns)``, and whether there was success."""
    level, own = lab.levels[ask["level"]], lab.hidden.parameters.copy()
    for name, value in (parameters or {}).items():
        own[0, [p.__name__ for p in level.layout.parameters].index(name)] = value
    level = level.with_parameters(own)
    env = segar.envs.VectorEnv(level, 1, task=lab.task, seed=7, autoreset_mode="Disabled")
    env.reset(options={"levels": [0]})
    for entity, factors in (set or {}).items():
        for name, value in factors.items():
            env.intervene(entity, level.layout.factor(name), np.array(value))
    states, success = [env.state().state.values[0]], False
    for action in np.asarray(actions, np.float32):
        _, _, terminated, _, info = env.step(action[None])
        states.append(env.state().state.values[0])
        success |= bool(info["success"][0])
        if terminated[0]:
            break
    return np.array(states), success
