"""An experiment as data: a grid of runs, other levels that its agents are tested on, and what needs no training.

One file of ``conf/experiment/`` is one experiment. It says for each scale what differs there; at a scale that it does not
name, it is not run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from experiments.levels.mixed_levels import RESERVED, SEPARATOR
from experiments.levels.variations import VARIATIONS
from experiments.settings import DIFFICULTIES, ConfigError, construct, require, require_design, require_known
from segar.errors import did_you_mean
from segar.levels import families

BASE = "base"  # in a grid: the algorithm, observation or task of the scale
SCALES = ("smoke", "quick", "standard", "paper")
MOST_GROUPS = 4  # 30 sets of levels in between, with the rest
STEPS = {"harder": 1, "easier": -1}  # difficulties relative to that of the training levels


@dataclass(frozen=True)
class GridConfig:
    """Runs: every combination. What is None or empty is as the scale has it."""

    families: tuple[str, ...] = ()
    difficulties: tuple[str, ...] = ()
    counts: tuple[int, ...] = ()
    seeds: int | None = None  # how many
    frames: int | None = None
    algorithms: tuple[str, ...] = (BASE,)  # files of conf/algorithm
    observations: tuple[str, ...] = (BASE,)  # files of conf/observation
    tasks: tuple[str, ...] = (BASE,)  # files of conf/task
    designs: tuple[str, ...] = ("iid",)  # how training levels are picked, see experiments.settings.require_design
    variations: tuple[str, ...] = ("",)  # names in experiments.levels.variations
    interval: int | None = None  # frames between evaluations on the test levels; None: as the scale has it


@dataclass(frozen=True)
class TransferConfig:
    """Other test levels, or another look of them, for agents that are trained already. None: as in training."""

    family: str | None = None
    difficulty: str | None = None  # or harder, or easier; agents for which there is none such are left out
    variation: str | None = None
    observation: str | None = None  # a file of conf/observation


@dataclass(frozen=True)
class ExperimentConfig:
    """What one file of ``conf/experiment/`` says."""

    title: str
    figure: str = ""  # of the paper
    grid: Mapping[str, Any] = field(default_factory=dict)  # of GridConfig; empty: nothing is trained
    transfers: tuple[TransferConfig, ...] = ()
    # Groups of factors, by name: agents are tested on levels between training and test, too, in every combination.
    attribution: Mapping[str, Sequence[str]] = field(default_factory=dict)
    probes: bool = False  # ask what the agents' representations know of the factors, as probes.<scale> says
    study: str = ""  # a module of analysis that needs no training: python -m <study> --output DIR
    options: Mapping[str, Any] = field(default_factory=dict)  # of the study: --name value
    scales: Mapping[str, Any] = field(default_factory=dict)  # what differs there, of the grid and of Others


@dataclass(frozen=True)
class Others:
    """What may differ at a scale beside the grid."""

    transfers: tuple[TransferConfig, ...] | None = None
    probes: bool | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


OTHERS = tuple(f.name for f in fields(Others))


@dataclass(frozen=True)
class Experiment:
    """An experiment at one scale."""

    name: str
    title: str
    figure: str
    grid: GridConfig | None
    transfers: tuple[TransferConfig, ...]
    study: str
    options: Mapping[str, Any]
    probes: bool = False
    attribution: Mapping[str, Sequence[str]] = field(default_factory=dict)


def experiment_at(name: str, data: Mapping[str, Any], scale: str) -> Experiment | None:
    """The experiment that a file says, at a scale; None if it is not run there.

    Raises:
        ConfigError: a setting is unknown or wrong; the message says where, as ``grids.<name>...``.
    """
    place = f"grids.{name}"
    config = construct(ExperimentConfig, data, place)
    require(bool(config.grid) or bool(config.study), place, dict(data), "an experiment with a grid, a study, or both")
    require(bool(config.grid) or not config.transfers, f"{place}.transfers", "transfers", "beside a grid of agents")
    require(bool(config.grid) or not config.probes, f"{place}.probes", True, "beside a grid of agents")
    require(bool(config.grid) or not config.attribution, f"{place}.attribution", "groups", "beside a grid of agents")
    check_groups(config.attribution, f"{place}.attribution")
    for i, transfer in enumerate(config.transfers):
        check_transfer(transfer, f"{place}.transfers[{i}]")
    check_grid(construct(GridConfig, config.grid, f"{place}.grid"), f"{place}.grid")
    at = {known: settings_at(name, config, known, f"{place}.scales.{known}") for known in config.scales}
    return at.get(scale)


def settings_at(name: str, config: ExperimentConfig, scale: str, place: str) -> Experiment:
    """The experiment at a scale that its file names; raises :class:`ConfigError`."""
    changes = config.scales[scale]
    if not isinstance(changes, Mapping):
        raise ConfigError(f"{place}: {changes!r} is no group of settings; where nothing differs it is {{}}")
    other = construct(Others, {key: changes[key] for key in OTHERS if key in changes}, place)
    changed = {key: value for key, value in changes.items() if key not in OTHERS}
    if not config.grid and changed:
        raise ConfigError(f"{place}: the experiment has no grid, so {', '.join(changed)} cannot differ")
    unknown = [key for key in other.options if key not in config.options]
    if unknown:
        raise ConfigError(f"{place}.options: there is no '{unknown[0]}'.{did_you_mean(unknown[0], config.options)}")
    options = {**config.options, **other.options}
    transfers = config.transfers if other.transfers is None else other.transfers
    probes = config.probes if other.probes is None else other.probes
    require(bool(config.grid) or not probes, f"{place}.probes", True, "beside a grid of agents")
    for i, transfer in enumerate(transfers):
        check_transfer(transfer, f"{place}.transfers[{i}]")
    grid = construct(GridConfig, {**config.grid, **changed}, place) if config.grid else None
    if grid is not None:
        check_grid(grid, place)
    return Experiment(
        name, config.title, config.figure, grid, transfers, config.study, options, probes, config.attribution
    )


def check_grid(grid: GridConfig, place: str) -> None:
    """Raises :class:`ConfigError` that names the entry which is no family, difficulty, number or variation."""
    known = [name.rsplit("-", 1)[0] for name in families()]
    for key, names in (("families", known), ("difficulties", DIFFICULTIES)):
        for i, name in enumerate(getattr(grid, key)):
            require_known(f"{place}.{key}[{i}]", name, list(dict.fromkeys(names)))
    for i, name in enumerate(grid.designs):
        require_design(f"{place}.designs[{i}]", name)
    for i, count in enumerate(grid.counts):
        require(count >= 1, f"{place}.counts[{i}]", count, "at least 1")
    for key in ("seeds", "frames"):
        value = getattr(grid, key)
        require(value is None or value >= 1, f"{place}.{key}", value, "at least 1")
    require(grid.interval is None or grid.interval >= 0, f"{place}.interval", grid.interval, "0 or more")
    for i, name in enumerate(grid.variations):
        check_variation(name, f"{place}.variations[{i}]")
    for key in ("algorithms", "observations", "tasks", "designs", "variations"):
        require(bool(getattr(grid, key)), f"{place}.{key}", [], "one or more")


def check_transfer(transfer: TransferConfig, place: str) -> None:
    """Raises :class:`ConfigError` unless something differs, and is known."""
    changed = [f.name for f in fields(transfer) if getattr(transfer, f.name) is not None]
    require(bool(changed), place, {}, "a family, difficulty, variation or observation that differs")
    if transfer.difficulty is not None:
        require_known(f"{place}.difficulty", transfer.difficulty, (*DIFFICULTIES, *STEPS))
    if transfer.family is not None:
        require_known(f"{place}.family", transfer.family, list(dict.fromkeys(n.rsplit("-", 1)[0] for n in families())))
    if transfer.variation is not None:
        check_variation(transfer.variation, f"{place}.variation")


def check_groups(groups: Mapping[str, Sequence[str]], place: str) -> None:
    """Raises :class:`ConfigError` unless there are few groups, and each lists factors; which there are say the levels."""
    require(len(groups) <= MOST_GROUPS, place, list(groups), f"at most {MOST_GROUPS} groups")
    for name, members in groups.items():
        listed = not isinstance(members, str) and bool(members) and all(isinstance(one, str) for one in members)
        require(listed, f"{place}.{name}", members, "a list of factors and parameters, such as [Position, Size]")
        require(name not in RESERVED, f"{place}.{name}", name, f"another name: {', '.join(RESERVED)} are taken")
        require(SEPARATOR not in name, f"{place}.{name}", name, f"a name without {SEPARATOR}")


def check_variation(name: str, place: str) -> None:
    """Raises :class:`ConfigError` unless it is empty, a name, or ``module:function``."""
    if name and ":" not in name:
        require_known(place, name, list(VARIATIONS))


def other_panel(family: str, difficulty: str, transfer: TransferConfig) -> str | None:
    """The panel that agents trained in this one are tested in; None if there is no harder, or easier, one."""
    wanted = transfer.difficulty or difficulty
    if wanted in STEPS:
        place = DIFFICULTIES.index(difficulty) + STEPS[wanted]
        if not 0 <= place < len(DIFFICULTIES):
            return None
        wanted = DIFFICULTIES[place]
    return f"{transfer.family or family}-{wanted}"


def chosen_names(asked: Sequence[str], known: Sequence[str]) -> list[str]:
    """The experiments that were asked for, all if none were; raises :class:`ConfigError` for an unknown one."""
    for name in asked:
        if name not in known:
            raise ConfigError(f"experiments: there is no experiment '{name}'.{did_you_mean(name, known)}")
    return [name for name in known if not asked or name in asked]
