"""What the failures of a trained agent come from: its test levels and their causal twins, played by the agent."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from segar.errors import naming
from segar.experiments.evaluation.episodes import Agent, play_in_modes
from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import ConfigError, EvaluateConfig, RunConfig, is_level_file
from segar.levels import Levels
from segar.suites import Causes, Suite, Twin, Twins, causes_of, looks_like, own_suite, suite, suites

CAUSES = "causes.csv"  # in the folder of an evaluation: a row per action mode and group of factors
EnvironmentOptions = Callable[[str], Mapping[str, Any]]


def suite_played(config: EvaluateConfig, trained: RunConfig, levels: Levels) -> Suite:
    """The suite whose test levels have twins: the one that ``levels`` names, or that of the run. Else the run's training
    distribution and that of the ``levels`` that are played are one.

    Raises:
        ConfigError: the levels that are played are training levels or those of a file, which no test distribution gave; or
            one of the two is no :class:`segar.LevelDistribution`.
    """
    for name in (config.levels, trained.levels.named("test")[0]):
        if name in suites():
            return suite(name)
    if config.levels == "train" or is_level_file(config.levels):
        raise ConfigError(
            f"twins: causal twins are of levels of a test distribution, and {config.levels} are none; take levels=test, or the"
            " name of a distribution or of a suite, or leave twins out"
        )
    tested = trained.levels if config.levels == "test" else dataclasses.replace(trained.levels, test=config.levels)
    run = Prepared(dataclasses.replace(trained, levels=tested))
    name = " to ".join(" ".join(tested.named(side)).strip() for side in ("train", "test"))
    with naming("twins", ConfigError):
        return own_suite(run.train_distribution, run.test_distribution, levels, task=run.task, name=name)


def play_twins(
    policy: Agent, twins: Twins, options_of: EnvironmentOptions, modes: Sequence[str], seed: int
) -> dict[str, Causes]:
    """Action mode to what failures come from, by one episode on each test level and on each twin.

    Args:
        options_of: the options of environments in which an agent plays levels of the suite as those of ``"train"`` or of
            ``"test"`` look.
    """
    found = {}
    for mode in modes:

        def success(levels: Levels, twin: Twin | None, mode: str = mode) -> np.ndarray:
            options = options_of(looks_like(twins.suite, twin))
            rows = play_in_modes(policy, "twins", levels, options, seed, (mode,))
            return np.array([row["success"] for row in sorted(rows, key=lambda row: row["level"])], float)

        found[mode] = causes_of(twins, success)
    return found
