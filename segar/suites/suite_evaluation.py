"""Plays a suite whole: a policy on training levels of a seed and on the test levels, with scores from the frozen plans."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from segar.envs import Policy
from segar.errors import SuiteError
from segar.evaluation import (
    Baselines,
    Evaluation,
    Idle,
    LevelSetResult,
    Random,
    evaluate_levels,
    play_episodes,
    require_modes,
    require_options,
)
from segar.hardness import Plan, plan
from segar.levels import Levels
from segar.metrics import w2
from segar.suites.sides import FIXED, require_free, side_options
from segar.suites.suite_file import SIDES, Suite

ENVIRONMENT_SEED = 0  # of the environments, as of the plans
RANDOM_PLAYS = 20  # episodes on each level by a random player, whose means are floors of scores
# The seeds of the random players on the test levels, whose mean is the floor: those of the benchmark.
RANDOM_SEEDS = range(1, 6)
SAMPLES, ITERATIONS = 64, 5  # of the planner's search on training levels; its plans of the test come with the suite
_OWN = ("seed", "training_levels", "observation", "episodes", "environment_seed", "scores", "distances")


def evaluate_on_suite(
    policy: Policy,
    suite: Suite,
    seed: int = 1,
    *,
    training_levels: int | None = None,
    observation: Any = "state",
    episodes: int = 1,
    environment_seed: int = ENVIRONMENT_SEED,
    scores: bool = False,
    distances: Sequence[Any] = (),
    **options: Any,
) -> Evaluation:
    """What a policy achieves on a suite: on the training levels of a seed, and on the frozen test levels.

    >>> of = segar.suites.suite("look-far-v1")
    >>> still = lambda frames: np.zeros((len(frames), 2), np.float32)
    >>> found = segar.evaluate_on_suite(still, of, seed=1, observation="rgb_stack2")
    >>> found.train.levels, found.test.levels
    (200, 200)

    The suite says what is played, what states hide, and which textures frames have on each side. All else is as of
    :func:`segar.evaluate_policy`.

    Args:
        policy: as of :func:`segar.evaluate_policy`.
        suite: what :func:`segar.suites.suite` or :func:`segar.suites.read_suite` gives.
        seed: of the training levels, ``suite.sample(seed)``.
        training_levels: how many of them; as many as the suite says where it is None.
        observation: as of :func:`segar.suites.observation_on`. A normalised one has the units of training on both sides.
        episodes: on each level.
        environment_seed: of the environments, for tasks and frames in which chance plays a part.
        scores: also make the scores. On test levels the planner is the suite's frozen plans; on training levels it is searched,
            which takes about 0.1 s per level. Idle and random play are those of the benchmark, whatever the policy and the
            seed of the environments.
        distances: modes of :func:`segar.metrics.w2` between training and test levels to measure.
        options: of :class:`segar.envs.VectorEnv`, such as ``unit_actions`` and ``num_threads``, as in training; but for those
            that the suite decides.

    Raises:
        SuiteError: the suite does not show this observation, or decides an option. SegarError: an argument is out of range.
        ActionError: as of :func:`segar.evaluate_policy`.
    """
    require_modes(distances)
    given = {"training_levels": training_levels, "observation": observation, "episodes": episodes}
    given |= {"environment_seed": environment_seed, "scores": scores, **options}
    found = {side: evaluate_on_side(policy, suite, side, seed, **given) for side in SIDES}
    sides = (suite.sample(seed, training_levels), suite.test_levels) if distances else ()
    apart = {mode: float(w2(*sides, mode=mode)) for mode in distances}
    return Evaluation(**found, w2=apart)


def evaluate_on_side(
    policy: Policy,
    suite: Suite,
    side: str,
    seed: int = 1,
    *,
    training_levels: int | None = None,
    observation: Any = "state",
    episodes: int = 1,
    environment_seed: int = ENVIRONMENT_SEED,
    scores: bool = False,
    **options: Any,
) -> LevelSetResult:
    """What a policy achieves on one side of a suite, ``"train"`` or ``"test"``; arguments as of :func:`evaluate_on_suite`."""
    if not isinstance(suite, Suite):
        raise SuiteError(
            f"evaluate_on_suite: suite must be a suite, such as segar.suites.suite('place-few-v1'), not {suite!r}"
        )
    if not isinstance(scores, bool):
        raise SuiteError(f"evaluate_on_suite: scores must be True or False, not {scores!r}")
    require_free(suite, options)
    require_options("evaluate_on_suite", options, _OWN, FIXED)
    played = side_options(suite, side, seed, training_levels=training_levels, observation=observation)
    found = evaluate_levels(policy, episodes=episodes, seed=environment_seed, **played, **options)
    if not scores:
        return found
    threads = options.get("num_threads", 1)
    return dataclasses.replace(found, baselines=baselines_on(suite, side, played["levels"], seed, threads))


def baselines_on(suite: Suite, side: str, levels: Levels, seed: int, num_threads: int = 1) -> Baselines:
    """The baselines of the levels of a side, as the rows of the benchmark make them.

    Args:
        levels: those of the side. seed: that of training levels; those of the test have one floor for all seeds.
    """
    options = {"task": suite.task, "num_threads": num_threads}
    every, stream = np.arange(len(levels)), SIDES.index(side)
    idle = play_episodes(levels, every, Idle(), seed=ENVIRONMENT_SEED, **options).returns
    random = [
        play_episodes(
            levels, np.tile(every, RANDOM_PLAYS), Random(one, stream), seed=ENVIRONMENT_SEED, **options
        ).returns.reshape(RANDOM_PLAYS, -1)
        for one in (RANDOM_SEEDS if side == "test" else (seed,))
    ]
    plans = plans_on(suite, side, levels, seed, num_threads)
    return Baselines(np.mean(random, axis=(0, 1)), idle, plans.returns, plans)


def plans_on(suite: Suite, side: str, levels: Levels, seed: int, num_threads: int = 1) -> Plan:
    """The best known episodes on the levels of a side: the plans that come with the test, and a search on training levels."""
    if side == "test":
        return suite.plans
    rng = np.random.default_rng(seed)
    return plan(levels, suite.task, rng=rng, samples=SAMPLES, iterations=ITERATIONS, num_threads=num_threads)
