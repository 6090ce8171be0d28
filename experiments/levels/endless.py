"""Training levels without end: each one of a stream comes once, and follows from distribution, seed and index alone."""

import inspect
from dataclasses import dataclass
from typing import Any

from segar.experiments.levels.builders import LevelFile, Prepared
from segar.experiments.levels.suite_levels import SuiteLevels
from segar.experiments.settings import ConfigError
from segar.levels import Levels

BLOCK = 512  # levels that are drawn at once, which takes little longer than to draw a tenth of them


@dataclass
class Stream:
    """The levels of the training split of one seed, in the order of their indices.

    Attributes:
        distribution: what they are drawn from. apart_from: levels that are passed over, such as those of a suite's test.
        seed: which stream. next: the index from which the next level is looked for.
        block: levels that were drawn ahead; used: how many of them were taken.
    """

    distribution: Any
    seed: int
    apart_from: Levels | None = None
    next: int = 0
    block: Levels | None = None
    used: int = 0

    def take(self, n: int) -> Levels:
        """The next ``n`` levels, and goes on behind them."""
        if self.block is None or self.used + n > len(self.block):
            apart = {} if self.apart_from is None else {"apart_from": self.apart_from}
            drawn: Levels = self.distribution.sample(
                max(n, BLOCK), seed=self.seed, split="train", start=self.next, **apart
            )
            self.block, self.used = drawn, 0
        levels = self.block[self.used : self.used + n]
        self.used += n
        self.next = int(levels.provenance.indices[-1]) + 1
        return levels


def stream_of(prepared: Prepared) -> Stream:
    """The stream of training levels that the settings name, from its beginning.

    Raises:
        ConfigError: their distribution has no levels without end.
    """
    found, config = prepared.train_distribution, prepared.config.levels
    if isinstance(found, SuiteLevels):
        return Stream(found.suite.train, config.seed, found.suite.test_levels)
    if isinstance(found, LevelFile):
        raise ConfigError(
            f"levels.count: the file {found.path} has {len(found)} levels and no others, so they are not endless; give a"
            " number of them, or name a distribution: levels.train=..."
        )
    if "start" not in inspect.signature(found.sample).parameters:
        raise ConfigError(
            f"levels.count: sample of {config.train} takes no start, the index of the first level that is drawn, so levels"
            " are not endless; add it, as segar.LevelDistribution.sample has it, or give a number of levels"
        )
    return Stream(found, config.seed)


def target_of(prepared: Prepared) -> Any:
    """What training levels are meant to be drawn from: the distribution behind a suite, a file or a fixed set."""
    found = prepared.train_distribution
    return found.suite.train if isinstance(found, SuiteLevels) else found
