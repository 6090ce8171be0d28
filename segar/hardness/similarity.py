"""How alike levels are in what they do and in what they ask for: same actions, and same best actions."""

from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from segar.errors import LevelError, SegarError
from segar.hardness.planner import Plan
from segar.hardness.rollouts import Episodes, Starts, make_starts, trace, uniform_actions
from segar.language import Factor, Position, Task
from segar.levels import Levels, checks


def dynamics_distances(
    a: Levels,
    b: Levels,
    task: Task | None = None,
    *,
    rng: np.random.Generator,
    sequences: int = 16,
    horizon: int = 20,
    factors: Sequence[type[Factor]] = (Position,),
    seed: int = 0,
) -> np.ndarray:
    """How differently each level of ``a`` and each level of ``b`` answer the same actions, float64 ``(len(a), len(b))``.

    d(x, y)^2 is the mean over sequences and steps of sum |(x_t - x_0) - (y_t - y_0)|^2, summed over the ``factors`` of all
    entities: what counts is what became of things, not where they were. Entities are matched by slot; one that is absent
    does not move. What an episode has ended stands still. So it is the Euclidean distance of two responses: it is
    symmetric, keeps the triangle inequality, and is zero for levels that differ in nothing that the actions (or time)
    bring to light, e.g. only in where the goal is.

    Args:
        rng: draws ``sequences`` sequences of ``horizon`` uniform actions, the same ones for all levels.
        factors: of which the unit is the distance's; Position gives metres.
        seed: of the randomness in rules: matched, too, between level i of ``a`` and level i of ``b``.

    Raises:
        LevelError: the two sets have different layouts, or lack one of the factors.
        SegarError: sequences or horizon make no sense.
    """
    checks.require_levels("dynamics_distances", a, b)
    checks.require_generator("dynamics_distances", rng)
    checks.require_factors("dynamics_distances", factors, a, b)
    if a.layout != b.layout:
        raise LevelError("dynamics_distances: these level sets have different entities; compare sets of one layout")
    parts = [a.layout.columns_of(a.layout.factor(factor.__name__)) for factor in factors]
    columns = [column for part in parts for column in range(a.layout.width)[part]]
    checks.require_count("dynamics_distances", "sequences", sequences, 1)
    checks.require_count("dynamics_distances", "steps as horizon", horizon, 1)
    starts = make_starts(a, task, seed), make_starts(b, task, seed)
    actions = uniform_actions(starts[0].task, sequences, horizon, rng)
    square = np.zeros((len(a), len(b)))
    for sequence in actions:
        x, y = (_response(each, sequence, columns) for each in starts)
        square += np.stack([((response - y) ** 2).sum(axis=1) for response in x])
    return np.sqrt(square / (sequences * horizon))


def policy_similarity(a: Plan | Episodes, b: Plan | Episodes, gamma: float = 0.99) -> np.ndarray:
    """The policy similarity metric of the levels' first states under the oracle, float64 ``(len(a), len(b))``.

    d(x, y) = |pi(x) - pi(y)| + gamma W1(d)(P(x), P(y)) (Agarwal, Machado, Castro and Bellemare 2021, equation 1), where pi
    plays the plan's actions. A plan leads to one next state, so W1 is the distance of the two; after its end an episode
    stays where it is and does nothing. So levels are close that are played in the same way, however different they look.

    Args:
        a, b: oracle plans; or what a scripted player did (:attr:`Hardness.scripted`), to take it for the oracle.

    Raises:
        SegarError: gamma is not in [0, 1), or the actions of the two have different sizes.
    """
    _check(a, b, gamma)
    total = np.zeros((len(a.steps), len(b.steps)))
    for t in range(int(max(a.steps.max(), b.steps.max()))):
        total += gamma**t * cdist(_actions(a, t), _actions(b, t))
    return total


def _response(starts: Starts, sequence: np.ndarray, columns: list[int]) -> np.ndarray:
    """What the actions changed in each level, step after step, ``(levels, steps * entities * columns)``."""
    n = len(starts.levels)
    states, _ = trace(starts, np.arange(n), np.repeat(sequence[None], n, axis=0))
    states = states[..., columns]
    return np.nan_to_num(states[:, 1:] - states[:, :1]).reshape(n, -1)


def _actions(plan: Plan | Episodes, step: int) -> np.ndarray:
    """What is done in each level at a step, nothing where the time of that plan's task is over."""
    return plan.actions[:, step] if step < plan.actions.shape[1] else np.zeros_like(plan.actions[:, 0])


def _check(a: Plan | Episodes, b: Plan | Episodes, gamma: float) -> None:
    for one in (a, b):
        if not isinstance(one, (Plan, Episodes)):
            raise SegarError(
                f"policy_similarity compares plans, or episodes of a script; a {type(one).__name__} is neither"
            )
    if not 0 <= gamma < 1:
        raise SegarError(f"gamma must be at least 0 and less than 1, not {gamma}")
    if a.actions.shape[-1] != b.actions.shape[-1]:
        raise SegarError(f"actions of {a.actions.shape[-1]} and of {b.actions.shape[-1]} numbers cannot be compared")
