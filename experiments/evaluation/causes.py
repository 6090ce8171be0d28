"""What the failures of a trained agent on a suite come from: its test levels and their causal twins, played by the agent."""

import csv
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.evaluation.episodes import Agent, play_in_modes
from experiments.settings import ConfigError, EvaluateConfig, RunConfig, RunFolderError
from segar.levels import Levels
from segar.suites import Causes, Suite, Twin, Twins, causes_of, looks_like, suite, suites
from segar.support import replacing

CAUSES = "causes.csv"  # in the folder of an evaluation: a row per action mode and group of factors
EnvironmentOptions = Callable[[str], Mapping[str, Any]]


def suite_played(config: EvaluateConfig, trained: RunConfig) -> Suite:
    """The suite whose test levels have twins: the one that ``levels`` names, or that of the run.

    Raises:
        ConfigError: neither is a suite.
    """
    for name in (config.levels, trained.levels.named("test")[0]):
        if name in suites():
            return suite(name)
    raise ConfigError(
        "twins: causal twins are of the test levels of a suite, and neither levels nor the run names one; take"
        " levels=NAME, a name of `segar suites`, or leave twins out"
    )


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


def write_causes(path: Path, causes: Mapping[str, Causes]) -> None:
    """Write a table with a row per action mode and group of factors; raises :class:`RunFolderError` if that is impossible."""
    rows = [{"action_mode": mode, **row} for mode, one in causes.items() for row in one.rows()]
    with replacing(path, "the table", RunFolderError) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
