"""Named changes to a level distribution: other physics, another ball, one more thing on the way.

``levels.variation=ball_mass`` changes the training and the test distribution, ``levels.test_variation=...`` the test
distribution alone. A variation of your own is ``module:function``: it takes a :class:`segar.LevelDistribution` and returns
another one.
"""

import dataclasses
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from segar.experiments.settings import import_object
from segar.language import FloorFriction, GoalTile, GolfBall, Gravity, Mass, Parameter, Position
from segar.levels import LevelDistribution, Prior
from segar.noise import Noise, RandomBottomLocation, RandomTopLocation, RandomUniformLocation, UniformNoise
from segar.rules import DEFAULT_RULES, RuleSpace, apply_friction, lorentz_law, lorentz_law_r2, record_drag, templates
from segar.tasks import with_conditions

Variation = Callable[[LevelDistribution], LevelDistribution]

MASSES = UniformNoise(0.3, 3.0)  # [kg] of the ball: one push gives velocities that differ by a factor of ten
GRAVITIES = UniformNoise(5.0, 15.0)  # [m/s^2] around the default of 10


def with_prior(prior: Prior) -> Variation:
    """The variation that adds a prior."""
    return lambda dist: dataclasses.replace(dist, priors=(*dist.priors, prior))


def with_parameter(parameter: type[Parameter], value: Any) -> Variation:
    """The variation that gives a world parameter another value or distribution."""
    return lambda dist: dataclasses.replace(dist, parameters={**dict(dist.parameters), parameter: value})


def with_rules(change: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> Variation:
    """The variation that makes another rule set of the default one."""
    return lambda dist: dist.with_rules(change(DEFAULT_RULES))


def without(*rules: Any) -> Variation:
    """The variation that leaves out some of the default rules."""
    return with_rules(lambda known: tuple(rule for rule in known if rule not in rules))


def with_rule_space(part: str, by: str) -> Variation:
    """The variation in which each level draws its rules, from one part of the built-in rule space."""
    return lambda dist: dist.with_rules(part_of_rules(part, by))


@cache
def part_of_rules(part: str, by: str) -> RuleSpace:
    """One part of the built-in rule space, which takes a tenth of a second to split."""
    return templates.dynamics_space().split(part, by)


def shifted(mass: Noise, friction: Noise, ball: Noise, goal: Noise) -> Variation:
    """The variation with another mass of the ball [kg], friction of the floor, and places where ball and goal start."""

    def change(dist: LevelDistribution) -> LevelDistribution:
        priors = [
            Prior(Mass, mass, entity_type=GolfBall),
            Prior(Position, ball, entity_type=GolfBall),
            Prior(Position, goal, entity_type=GoalTile),
        ]
        drawn = {(one.factor, one.entity_type) for one in priors}
        others = [one for one in dist.priors if (one.factor, one.entity_type) not in drawn]
        changed = dataclasses.replace(dist, priors=(*others, *priors))
        return with_parameter(FloorFriction, friction)(changed)

    return change


VARIATIONS: Mapping[str, Variation] = {
    "ball_mass": with_prior(Prior(Mass, MASSES, entity_type=GolfBall)),
    "ball_heavy": with_prior(Prior(Mass, 3.0, entity_type=GolfBall)),
    "gravity_range": with_parameter(Gravity, GRAVITIES),
    "gravity_2.5": with_parameter(Gravity, 2.5),
    "gravity_40": with_parameter(Gravity, 40.0),
    "friction_0.2": with_parameter(FloorFriction, 0.2),
    "friction_0.8": with_parameter(FloorFriction, 0.8),
    "frictionless": without(apply_friction, record_drag),
    "without_fields": without(lorentz_law),
    "fields_r2": with_rules(lambda known: tuple(lorentz_law_r2 if rule is lorentz_law else rule for rule in known)),
    "moderate": shifted(UniformNoise(0.8, 1.2), UniformNoise(0.4, 0.6), RandomBottomLocation(), RandomTopLocation()),
    "heavy_smooth": shifted(
        UniformNoise(1.5, 2.0), UniformNoise(0.15, 0.25), RandomBottomLocation(), RandomUniformLocation()
    ),
    "light_rough": shifted(
        UniformNoise(0.4, 0.6), UniformNoise(0.8, 1.0), RandomUniformLocation(), RandomTopLocation()
    ),
    "conditions": with_conditions,
    "rule_space": with_rule_space("train", "combinations"),
    "rule_space_unseen": with_rule_space("test", "combinations"),
    "rule_space_train_rules": with_rule_space("train", "rules"),
    "rule_space_unseen_rules": with_rule_space("test", "rules"),
}


def vary(distribution: LevelDistribution, name: str, place: str) -> LevelDistribution:
    """The distribution changed by the variation of that name; unchanged where the name is empty.

    Raises:
        ConfigError: there is no such variation; the message names ``place``.
    """
    if not name:
        return distribution
    change = import_object(name, place, "variation", VARIATIONS)
    return dataclasses.replace(change(distribution), name=f"{distribution.name or 'levels'}+{name}")
