"""The worlds of the soak: every named family and task, crowds under random parameters, and rules that nobody would write."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

import segar
from segar.engine.compiler.kernel import generate
from segar.engine.simulator import Simulator
from segar.envs import REWARDS
from segar.errors import ConflictError, RuleError
from segar.language.factors import Charge, InfiniteEnergy, Magnetism, Mass, Mobile, Position, Size, StoredEnergy
from segar.language.task import Task
from segar.levels.level_set import Levels
from segar.levels.named_families import OBJECTS, TASK_LEVELS, TILES
from segar.reference.interpreter import Interpreter
from segar.rules import DEFAULT_RULES
from segar.tasks.puttputt_task import puttputt
from segar.tasks.registry import task_of
from tests.segar.engine.random_rules import Author, mixed_levels

NUM_LEVELS = 500
CROWDS = 4
RULE_SETS = 6
QUARRELS = 4
TRIALS = 20


@dataclass(frozen=True)
class Case:
    """A world to play in.

    Attributes:
        rules_may_fail: the rules are random: they may divide by zero and contradict each other.
        refused: rule sets that were an error when the world was built, before this one was not.
    """

    name: str
    simulator: Simulator
    levels: Levels
    rules_may_fail: bool = False
    refused: int = 0


def cases(seed: int) -> Iterator[tuple[str, int]]:
    """Names of all cases, each with the number that :func:`make_case` draws its random parts from."""
    names = [f"{name} {reward}" for name in segar.families() for reward in REWARDS.values()] + list(TASK_LEVELS)
    for kind, count in (("crowd", CROWDS), ("rules", RULE_SETS), ("quarrel", QUARRELS)):
        names += [f"{kind} {n}" for n in range(count)]
    return ((name, seed * 1000 + n) for n, name in enumerate(names))


def make_case(name: str, seed: int) -> Case:
    """The case of that name, compiled."""
    kind, _, which = name.partition(" ")
    rng = np.random.default_rng(seed)
    if kind == "crowd":
        return _default_rules(name, random_crowd(rng).sample(NUM_LEVELS, seed=seed))
    if kind in ("rules", "quarrel"):
        return random_rules(name, rng, kind == "quarrel")
    levels = segar.family(kind).sample(NUM_LEVELS, seed=seed)
    return _default_rules(name, levels, puttputt(which) if which else task_of(levels))


def random_crowd(rng: np.random.Generator) -> segar.LevelDistribution:
    """Many objects and some tiles, of masses, charges and sizes, and in a world, that no named family has."""
    n = int(rng.integers(5, 25))
    size = rng.uniform(0.5, 0.9) / n**0.5
    speed, rate = float(rng.choice([2.0, 10.0, 100.0])), float(rng.choice([20.0, 100.0, 400.0]))
    return segar.LevelDistribution(
        numbers=[(segar.GolfBall, 1), (segar.GoalTile, 1), (OBJECTS, n), (TILES, int(rng.integers(0, 3)))],
        priors=[
            segar.Prior(Position, segar.RandomUniformLocation()),
            segar.Prior(Size, segar.UniformNoise(0.3 * size, size), entity_type=segar.Object),
            segar.Prior(Mass, segar.UniformNoise(0.2, 5.0)),
            segar.Prior(Charge, segar.GaussianNoise(0.0, rng.uniform(0.1, 3.0)), entity_type=segar.Object),
            segar.Prior(Magnetism, segar.GaussianNoise(0.0, rng.uniform(0.1, 1.0)), entity_type=segar.Magnet),
            segar.Prior(StoredEnergy, segar.UniformNoise(-1.0, 1.0), entity_type=segar.Object),
            segar.Prior(InfiniteEnergy, bool(rng.integers(2)), entity_type=segar.Object),
            segar.Prior(Mobile, True),
        ],
        parameters={
            segar.Gravity: segar.UniformNoise(0.0, 20.0),
            segar.language.FloorFriction: segar.UniformNoise(0.0, 0.2),
            segar.language.WallDamping: segar.UniformNoise(0.0, 0.5),
            segar.language.MaxVelocity: speed,
            segar.language.Framerate: max(rate, speed / (0.3 * size)),  # so that nothing passes another thing unseen
        },
        min_distance=0.0,
    )


def random_rules(name: str, rng: np.random.Generator, quarrels: bool) -> Case:
    """Random rules, among the default ones or alone, on levels with mixed and optional slots.

    Args:
        quarrels: whether the rules contradict each other, or make nan, in some levels; otherwise they do in none.
    """
    refused = 0
    while True:
        author, levels = Author(rng), mixed_levels(rng, NUM_LEVELS, small=True)
        # Few priorities, so that rules meet that are equally specific.
        rules = [
            replace(rule, priority=rule.priority % 3) for rule in (author.rule() for _ in range(rng.integers(3, 7)))
        ]
        rules += DEFAULT_RULES if rng.random() < 0.7 else (segar.move, segar.rules.accelerate)
        world = segar.World([rules[i] for i in rng.permutation(len(rules))])
        try:
            generate(levels.layout, world, puttputt().functions())
        except (RuleError, ConflictError):  # too many paths, or a contradiction that holds in every state
            refused += 1
            continue
        failures = count_failures(world, levels)
        if 0 < failures < TRIALS / 2 if quarrels else failures == 0:
            return Case(name, Simulator(world, levels.layout), levels, True, refused)


def count_failures(world: segar.World, levels: Levels) -> int:
    """In how many of the first levels the rules contradict each other, or make what is nan or infinite, at once.

    Where they do in most, every episode would end in its first step, and show nothing.
    """
    interpreter, failures = Interpreter(world, levels.layout), 0
    for level in range(TRIALS):
        try:
            values = interpreter.step(levels, level, n=3).values
            failures += bool((np.isfinite(values) == np.isnan(levels.values[level])).any())
        except ConflictError:
            failures += 1
    return failures


def _default_rules(name: str, levels: Levels, task: Task | None = None) -> Case:
    return Case(name, Simulator(segar.World(), levels.layout, task or puttputt()), levels)
