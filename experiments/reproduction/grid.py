"""The runs of an experiment's grid: every combination of what it names, as settings, and as columns of a table."""

import dataclasses
import math
from collections.abc import Collection, Hashable, Iterable, Mapping, Sequence
from functools import cache
from itertools import product
from typing import Any

from omegaconf import OmegaConf

from segar.experiments.commands.hydra_app import compose
from segar.experiments.commands.overrides import MOST_RUNS
from segar.experiments.reproduction.experiment_file import BASE, GridConfig
from segar.experiments.settings import (
    GridPoint,
    RunConfig,
    as_data,
    config_at,
    flat,
    grid_point,
    is_distribution,
    require,
    run_config,
)

KINDS = ("algorithm", "observation", "task", "variation", "design")  # columns that may tell agents apart
NUMBERS_OF_LEVELS = ("n", "levels", "log_n", "cell")  # columns that say how many training levels there are
AGENT_SEED, LEVEL_SEED = "seed of the agent", "seed of the levels"  # columns of a study's runs
KIND = ".kind"  # ends the names of columns without the settings that a grid varies


def grid_runs(grid: GridConfig, base: RunConfig) -> Iterable[RunConfig]:
    """A run for every combination of the grid, seed after seed.

    Each seed is that of an agent and of its level set, so that no two agents of a kind share one, unless ``level_sets`` says
    how many level sets there are; then each of them has all agents. Where level sets are not ``nested``, the seeds go on from
    one number of levels to the next.
    """
    scale, names = base.scale, list(grid.vary)
    panels = list(panels_of(grid.families or scale.families, grid.difficulties or scale.difficulties))
    kinds = (grid.algorithms, grid.observations, grid.tasks, grid.variations, grid.designs, panels)
    counts, number = grid.counts or scale.counts, (grid.seeds or scale.seeds) * (grid.level_sets or 1)
    number *= math.prod(map(len, (*grid.vary.values(), *kinds, counts)))
    require(number <= MOST_RUNS, "grid", f"{number} runs", f"at most {MOST_RUNS:,} runs")
    seeds = range(base.seed, base.seed + (grid.seeds or scale.seeds))
    sets = range(base.seed, base.seed + (grid.level_sets or 0))
    pairs = product(seeds, sets) if grid.level_sets else ((seed, seed) for seed in seeds)
    places = product(pairs, product(*grid.vary.values()), *kinds, enumerate(counts))
    frames = grid.frames or scale.frames
    interval = base.evaluation.interval if grid.interval is None else grid.interval
    for (seed, level_set), varied, algorithm, observation, task, variation, design, panel, (k, n) in places:
        before = 0 if grid.nested else k
        seed, level_set = seed + before * len(seeds), level_set + before * (grid.level_sets or len(seeds))
        cell = config_at(base, GridPoint(*panel, n, seed))
        run = dataclasses.replace(
            cell,
            levels=dataclasses.replace(cell.levels, seed=level_set, variation=variation, design=design),
            algorithm=on_device_of(base, chosen("algorithm", algorithm, base)),
            observation=chosen("observation", observation, base),
            task=chosen("task", task, base),
            scale=dataclasses.replace(scale, frames=frames),
            evaluation=dataclasses.replace(base.evaluation, interval=interval),
        )
        yield with_settings(run, dict(zip(names, varied, strict=True))) if names else run


def on_device_of(base: RunConfig, algorithm: Any) -> Any:
    """The settings of an algorithm with the device of ``base``, which says where all runs of a plan compute."""
    names = [name for name in ("device", "env_device") if hasattr(base.algorithm, name) and hasattr(algorithm, name)]
    return dataclasses.replace(algorithm, **{name: getattr(base.algorithm, name) for name in names})


def panels_of(families: Sequence[str], difficulties: Sequence[str]) -> Iterable[tuple[str, str]]:
    """Family and difficulty of each panel: all difficulties of a family, none of a single distribution."""
    for family in families:
        yield from [(family, "")] if is_distribution(family) else product([family], difficulties)


def with_settings(run: RunConfig, values: Mapping[str, Any]) -> RunConfig:
    """The run with other values of settings, by dotted names; raises :class:`ConfigError` for a wrong name or value."""
    data = as_data(run)
    groups = {name.partition(".")[0] for name in values}
    varied = OmegaConf.create({group: data[group] for group in data if group in groups})  # each node costs time
    for name, value in values.items():
        OmegaConf.update(varied, name, value, merge=False, force_add=True)
    return run_config({**data, **OmegaConf.to_container(varied)})  # type: ignore[arg-type]


def run_columns(config: RunConfig, name: str) -> dict[str, Any]:
    """What a run is, in columns that all tables of results share; ``name`` is that of its folder."""
    cell, levels = grid_point(config), config.levels
    return {
        "family": cell.family,
        "difficulty": cell.difficulty,
        "n": cell.count,
        "algorithm": config.algorithm.name,
        "observation": name_with_options(config.observation.name, config.observation.options),
        "task": name_with_options(task_column(config), config.task.options),
        "variation": levels.variation,
        "design": levels.design,
        "seed": cell.seed,
        "run": name,
    }


def task_column(config: RunConfig) -> str:
    """The task's name in tables, without its module."""
    return config.task.name.rpartition(":")[2]


def name_with_options(name: str, options: Mapping[str, Any]) -> str:
    """A name with the options that differ from the defaults, e.g. ``textures(hidden=Mass)``."""
    shown = (f"{k}={'+'.join(map(str, v)) if isinstance(v, list | tuple) else v}" for k, v in sorted(options.items()))
    return f"{name}({','.join(shown)})" if options else name


def varied_columns(config: RunConfig, varied: Iterable[str]) -> dict[str, str]:
    """The settings that a grid varies, by their dotted names, as tables of results have them.

    Where the grid varies settings of the observation or of the task, ``observation.kind`` or ``task.kind`` is what remains of
    it without these: the columns ``observation`` and ``task`` contain their options.
    """
    stated, varied = {**flat(as_data(config)), **flat(config.identity())}, list(varied)
    found = {name: str(stated.get(name)) for name in varied}
    parts = (("observation", config.observation, config.observation.name), ("task", config.task, task_column(config)))
    for group, part, whole in parts:
        if any(name.startswith(f"{group}.") for name in varied):
            others = {key: one for key, one in flat(part.options).items() if f"{group}.options.{key}" not in varied}
            name = "" if f"{group}.name" in varied else whole
            found[group + KIND] = name_with_options(name, others)
    return found


def pair_columns(by: str, panels: Iterable[str], levels: str, kinds: Iterable[str]) -> list[str]:
    """The columns in which two runs are equal that differ in the column ``by`` alone: not itself, nor what it contains, such as
    ``observation.options.gain`` where whole observations are compared.

    Args:
        panels: the columns of the panel that runs with either value share.
        levels: the column that tells level sets apart.
        kinds: columns that tell kinds of agents apart.
    """
    size = [] if by in NUMBERS_OF_LEVELS else ["n"]
    apart = [one for one in kinds if by != "agent" and not one.startswith(f"{by}.")]
    return [one for one in (*panels, *size, levels, AGENT_SEED, *apart) if one != by]


def kind_columns(known: Collection[str]) -> list[str]:
    """The columns of :data:`KINDS`, of which a table has ``known``; ``observation.kind`` in place of ``observation``."""
    return [f"{name}{KIND}" if f"{name}{KIND}" in known else name for name in KINDS if name in known]


def compares_panels(panels: Iterable[Hashable], given: Iterable[Iterable[Hashable]]) -> bool:
    """Whether a correlation over these rows compares their ``panels``: there are several, and none of the columns of names that
    are given tells them all apart, as panel and cell do. Then a panel is a block of the statistics."""
    panels = list(panels)
    several = len(set(panels)) > 1
    return several and not any(len({*zip(names, panels, strict=True)}) == len({*names}) for names in map(list, given))


def chosen(group: str, name: str | None, base: RunConfig) -> Any:
    """The settings of a group that its choice of this name states, or those of ``base``.

    Raises:
        ConfigError: there is no such choice.
    """
    return getattr(base if name in (BASE, None) else _composed(f"{group}={name}"), group)


@cache
def _composed(choice: str) -> RunConfig:
    return compose([choice])
