"""What is checked before a plan is made, so that a wrong name ends the plan, and not its runs."""

import dataclasses
from collections.abc import Iterable
from typing import Any

from experiments.evaluation.transfers import RunTask
from experiments.levels.builders import check_observations, distribution_of, environment_options
from experiments.levels.mixed_levels import check_fits, places
from experiments.reproduction.experiment_file import Experiment
from experiments.settings import ConfigError, LevelsConfig, RunConfig, import_object
from segar.errors import LevelError, SegarError

PICTURES = ("rgb", "textures")  # how the names of observations begin that fit all levels


def check_objects(runs: Iterable[RunConfig]) -> None:
    """Raises :class:`ConfigError` for the first run whose levels, task, observation or algorithm cannot be made.

    Each is made once, however many runs have it, so that a wrong name ends a plan, and not its runs.
    """
    seen: set[str] = set()

    def is_new(*settings: Any) -> bool:
        known = repr(settings) in seen
        seen.add(repr(settings))
        return not known

    for run in runs:
        levels, algorithm = dataclasses.replace(run.levels, count=1, seed=0), run.algorithm
        try:
            if is_new(levels):
                for which in ("train", "test"):
                    distribution_of(levels, which)
            if is_new(run.task, run.observation):
                environment_options(run)
            for name in (algorithm.learner, getattr(algorithm, "encoder", "")):
                if ":" in name and not name.startswith("experiments.") and is_new(name):
                    import_object(name, "algorithm")
        except SegarError as error:
            raise ConfigError(f"{run.label()}: {error}") from error


def check_transfers(works: Iterable[RunTask]) -> None:
    """Raises :class:`ConfigError` if an agent that sees states would not see the same numbers in the levels of a transfer."""
    seen = set()
    for work in works:
        for transfer in (one for one in work.transfers if one.mixture is None):
            there = dataclasses.replace(
                work.run.levels, test=transfer.panel, test_variation=transfer.variation, count=1, seed=0
            )
            run = dataclasses.replace(work.run, observation=transfer.observation, levels=there)
            kind = repr((there, run.observation, run.task))
            if kind in seen or run.observation.name.startswith(PICTURES):
                continue
            seen.add(kind)
            try:
                check_observations(run, *(distribution_of(there, which).sample(1) for which in ("train", "test")))
            except ConfigError as error:
                raise ConfigError(f"transfers: {transfer.label}: {error}") from error


def check_groups(experiment: Experiment, levels: LevelsConfig) -> None:
    """Raises :class:`ConfigError` unless training and test levels can be mixed and have the factors of the groups."""
    train, test = (distribution_of(levels, which).sample(1, seed=0, split=which) for which in ("train", "test"))
    try:
        check_fits(train, test)
        places(train, experiment.attribution)
    except LevelError as error:
        raise ConfigError(f"grids.{experiment.name}.attribution: {levels.train}: {error}") from error
