"""What the failures of a trained agent on a suite come from: its test levels and their causal twins, played by the agent."""

import csv
import dataclasses
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.evaluation.episodes import Agent, play_in_modes
from experiments.settings import ConfigError, EvaluateConfig, RunConfig, RunFolderError
from segar.levels import Levels
from segar.suites import Causes, Suite, Twin, Twins, causes_of, suite, suites
from segar.support import replacing

CAUSES = "causes.csv"  # in the folder of an evaluation: a row per action mode and group of factors
EnvironmentOptions = Callable[[RunConfig], Mapping[str, Any]]


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
    policy: Agent, twins: Twins, trained: RunConfig, options_of: EnvironmentOptions, modes: Sequence[str], seed: int
) -> dict[str, Causes]:
    """Action mode to what failures come from, by one episode on each test level and on each twin.

    Args:
        options_of: the options of environments by which an agent of these settings plays.
    """
    found = {}
    for mode in modes:

        def success(levels: Levels, twin: Twin | None, mode: str = mode) -> np.ndarray:
            options = options_of(in_textures(trained, _textures(twins.suite, twin)))
            rows = play_in_modes(policy, "twins", levels, options, seed, (mode,))
            return np.array([row["success"] for row in sorted(rows, key=lambda row: row["level"])], float)

        found[mode] = causes_of(twins, success)
    return found


def in_textures(run: RunConfig, textures: str) -> RunConfig:
    """The settings of a run that sees this set of textures; as they are where any observation will do."""
    if not textures:
        return run
    seen = dataclasses.replace(run.observation, options={**run.observation.options, "textures": textures})
    return dataclasses.replace(run, observation=seen)


def write_causes(path: Path, causes: Mapping[str, Causes]) -> None:
    """Write a table with a row per action mode and group of factors; raises :class:`RunFolderError` if that is impossible."""
    rows = [{"action_mode": mode, **row} for mode, one in causes.items() for row in one.rows()]
    with replacing(path, "the table", RunFolderError) as beside, beside.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)


def _textures(played: Suite, twin: Twin | None) -> str:
    if twin is not None:
        return twin.textures
    return played.textures[1] if played.textures else ""
