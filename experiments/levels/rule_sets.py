"""Training levels that share few rule sets: as many as one wants, and near to or far from those of the test levels."""

from typing import Any

import numpy as np

from segar.errors import LevelError, naming
from segar.experiments.settings import RULE_SETS_DESIGN, ConfigError, LevelsConfig
from segar.hardness import Situations, make_situations
from segar.levels import Levels, share_rule_sets
from segar.metrics import rule_set_distances
from segar.support import emd

CANDIDATES = 300  # training levels whose rule sets are drawn from
LARGEST = 100  # number of rule sets that are picked among them
SETS = 1_000  # drawn at random; the nearest or the farthest of them is taken
TEST_LEVELS = 100  # whose rule sets stand for those of the test
SITUATIONS = 20  # the first test levels, in which worlds are compared


def levels_of_rule_sets(distribution: Any, config: LevelsConfig, test: Any) -> Levels:
    """Training levels that share the rule sets that the design names.

    ``rule_sets_10``: those of the first ten levels. ``rule_sets_10_near``, ``rule_sets_10_far``: of 1,000 random sets of ten,
    the one nearest to or farthest from the rule sets of the test levels in W2 of :func:`segar.metrics.dynamics_distance`.

    Raises:
        ConfigError: there are fewer levels, no rule space, or too many rule sets to pick.
    """
    number, extreme = RULE_SETS_DESIGN.fullmatch(config.design).groups()  # type: ignore[union-attr]
    levels, count = distribution.sample(config.number, seed=config.seed, split="train"), int(number)
    with naming(f"levels.design: {config.design}", ConfigError):
        return share_rule_sets(levels, picked(levels, count, extreme, test, config.seed) if extreme else count)


def picked(levels: Levels, count: int, extreme: str, test: Levels, seed: int) -> np.ndarray:
    """The levels whose rule sets are together nearest to or farthest from those of the test levels, int64 ``(count,)``."""
    pool = levels[:CANDIDATES]
    if count > min(LARGEST, len(pool)):
        raise LevelError(
            f"{count} rule sets cannot be picked among {len(pool)} levels; at most {LARGEST} can, of {CANDIDATES}"
        )
    squares = rule_set_distances(pool, test[:TEST_LEVELS], situations_of(test)) ** 2
    rng = np.random.default_rng([seed, count])
    sets = [rng.choice(len(pool), count, replace=False) for _ in range(SETS)]
    apart = [emd(squares[one]) for one in sets]
    return sets[int(np.argmin(apart) if extreme == "near" else np.argmax(apart))]


def situations_of(test: Levels) -> Situations:
    """The situations in which rule sets are compared, the same ones for equal test levels."""
    return make_situations(test[:SITUATIONS], rng=np.random.default_rng(0))
