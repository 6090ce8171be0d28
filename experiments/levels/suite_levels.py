"""The levels of suites, under the names by which runs know them."""

import dataclasses
from dataclasses import dataclass
from typing import Any

from segar.errors import SuiteError, naming
from segar.experiments.settings import ConfigError, ObservationConfig, RunConfig
from segar.language import Task
from segar.levels import Levels
from segar.suites import Suite, named_observation, suite, suites


@dataclass(frozen=True)
class SuiteLevels:
    """The training or the test levels of a suite, as a distribution: those of training are drawn, those of the test frozen."""

    suite: Suite
    which: str  # train or test

    @property
    def world(self) -> Any:
        """Their rules."""
        return getattr(self.suite, self.which).world

    @property
    def task(self) -> str:
        """The name of their task."""
        return str(self.suite.train.task)

    def task_of(self, config: RunConfig) -> Task:
        """What is played; raises :class:`ConfigError` where options ask for something else."""
        if config.task.options:
            raise ConfigError(
                f"task.options: the suite {self.suite.name} says what is played, so that results compare; take its levels"
                f" without it, or leave {', '.join(config.task.options)} out"
            )
        return self.suite.task

    def sample(self, n: int, seed: int = 0, split: str = "train") -> Levels:
        """``n`` training levels of a seed, none of which is a test level; or the first ``n`` of the test, whatever the seed.

        Raises:
            ConfigError: the test has fewer.
        """
        if self.which == "train":
            return self.suite.sample(seed, n)
        if n > len(self.suite.test_levels):
            raise ConfigError(
                f"levels.test_count: the suite {self.suite.name} has {len(self.suite.test_levels)} test levels, not {n}"
            )
        return self.suite.test_levels[:n]


def observation_of_suite(suite: Suite, observation: ObservationConfig, which: str) -> ObservationConfig:
    """An observation with what the suite says of it: factors that states hide, and the textures that frames show.

    Args:
        which: whose textures, those of the ``"train"`` or of the ``"test"`` levels.

    Raises:
        ConfigError: the suite is about textures, and the observation shows none, or asks for a set.
    """
    try:
        name, options = named_observation(suite, which, observation.name, observation.options)
    except SuiteError as error:
        raise ConfigError(str(error)) from error
    return dataclasses.replace(observation, name=name, options=options)


def levels_of_suite(name: str, which: str, place: str) -> SuiteLevels | None:
    """The levels of the suite of that name; None where no suite has it. Raises :class:`ConfigError` for a damaged one."""
    if name not in suites():
        return None
    with naming(place, ConfigError):
        return SuiteLevels(suite(name), which)
