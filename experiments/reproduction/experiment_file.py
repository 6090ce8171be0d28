"""An experiment as data: a grid of runs, other levels that its agents are tested on, and what needs no training.

One file of ``conf/experiment/`` is one experiment. It is plain YAML, which :func:`experiment_at` reads::

    title: Gap against W2 out of distribution    # required; all other keys may be left out
    figure: 4a                                   # of the paper
    grid:                                        # runs: every combination, see GridConfig; what is not named is the scale's
      families: [empty, objectsx1]
      counts: [1, 10]
      algorithms: [base, curl]                   # choices of the group algorithm; base is the scale's
    transfers:                                   # further tests of the trained agents, see TransferConfig
      - difficulty: harder
      - observation: textures_far
    attribution:                                 # agents are also tested between training and test levels: in these groups
      position: [Position]                       # of factors, in every combination
    probes: true                                 # ask what the representations know of the factors
    study: w2                                    # a study that needs no training
    options: {seeds: 20}                         # of the study, by name
    scales:                                      # at a scale that is not named here, the experiment is not run
      quick: {counts: [3], options: {seeds: 10}}     # what differs there: keys of grid, and transfers, probes, options
      paper: {}                                  # nothing differs

A grid, a study, or both are needed; transfers, attribution and probes stand beside a grid.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Annotated, Any

from experiments.levels.mixed_levels import RESERVED, SEPARATOR
from experiments.levels.variations import VARIATIONS
from experiments.settings import (
    DIFFICULTIES,
    ConfigError,
    Count,
    CountFrom0,
    Design,
    Difficulty,
    Family,
    construct,
    one_of,
    require,
    require_known,
    that,
)
from segar.errors import did_you_mean

BASE = "base"  # in a grid: the algorithm, observation or task of the scale
SCALES = ("smoke", "quick", "standard", "paper")
MOST_GROUPS = 4  # 30 sets of levels in between, with the rest
STEPS = {"harder": 1, "easier": -1}  # difficulties relative to that of the training levels


def check_transfers(place: str, transfers: Sequence[TransferConfig] | None) -> None:
    """Raises :class:`ConfigError` unless something differs in each transfer."""
    for i, transfer in enumerate(transfers or ()):
        differs = transfer != TransferConfig()
        require(differs, f"{place}[{i}]", {}, "a family, difficulty, variation or observation that differs")


def check_groups(place: str, groups: Mapping[str, Sequence[str]]) -> None:
    """Raises :class:`ConfigError` unless there are few groups, and each lists factors; which there are say the levels."""
    require(len(groups) <= MOST_GROUPS, place, list(groups), f"at most {MOST_GROUPS} groups")
    for name, members in groups.items():
        listed = not isinstance(members, str) and bool(members) and all(isinstance(one, str) for one in members)
        require(listed, f"{place}.{name}", members, "a list of factors and parameters, such as [Position, Size]")
        require(name not in RESERVED, f"{place}.{name}", name, f"another name: {', '.join(RESERVED)} are taken")
        require(SEPARATOR not in name, f"{place}.{name}", name, f"a name without {SEPARATOR}")


def check_variation(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless it is empty, a name, or ``module:function``."""
    if name and ":" not in name:
        require_known(place, name, VARIATIONS)


NOT_EMPTY = that(bool, "one or more")
Names = Annotated[tuple[str, ...], NOT_EMPTY]
VariationName = Annotated[str, check_variation]


@dataclass(frozen=True)
class GridConfig:
    """Runs: every combination. What is None or empty is as the scale has it."""

    families: tuple[Family, ...] = ()
    difficulties: tuple[Difficulty, ...] = ()
    counts: tuple[Count, ...] = ()
    seeds: Count | None = None  # how many
    frames: Count | None = None
    algorithms: Names = (BASE,)  # choices of the group algorithm
    observations: Names = (BASE,)  # choices of the group observation
    tasks: Names = (BASE,)  # choices of the group task
    designs: Annotated[tuple[Design, ...], NOT_EMPTY] = ("iid",)  # how training levels are picked
    variations: Annotated[tuple[VariationName, ...], NOT_EMPTY] = ("",)  # names in experiments.levels.variations
    interval: CountFrom0 | None = None  # frames between evaluations on the test levels; None: as the scale has it


@dataclass(frozen=True)
class TransferConfig:
    """Other test levels, or another look of them, for agents that are trained already. None: as in training."""

    family: Family | None = None
    difficulty: Annotated[str, one_of(*DIFFICULTIES, *STEPS)] | None = None  # agents without a harder one are left out
    variation: VariationName | None = None
    observation: str | None = None  # a choice of the group observation


Transfers = Annotated[tuple[TransferConfig, ...], check_transfers]


@dataclass(frozen=True)
class ExperimentConfig:
    """What one file of ``conf/experiment/`` says."""

    title: str
    figure: str = ""  # of the paper
    grid: Mapping[str, Any] = field(default_factory=dict)  # of GridConfig; empty: nothing is trained
    transfers: Transfers = ()
    attribution: Annotated[Mapping[str, Sequence[str]], check_groups] = field(default_factory=dict)
    probes: bool = False  # ask what the agents' representations know of the factors, as probes.<scale> says
    study: str = ""  # needs no training: a plug-in, see experiments.reproduction.plugin
    options: Mapping[str, Any] = field(default_factory=dict)  # of the study, by name
    scales: Mapping[str, Any] = field(default_factory=dict)  # what differs there, of the grid and of Others


@dataclass(frozen=True)
class Others:
    """What may differ at a scale beside the grid."""

    transfers: Transfers | None = None
    probes: bool | None = None
    options: Mapping[str, Any] = field(default_factory=dict)


OTHERS = tuple(f.name for f in fields(Others))


@dataclass(frozen=True)
class Experiment(ExperimentConfig):
    """An experiment at one scale: what its file says, and what differs there."""

    name: str = ""
    grid: GridConfig | None = None  # type: ignore[assignment]


def experiment_at(name: str, data: Mapping[str, Any], scale: str) -> Experiment | None:
    """The experiment that a file says, at a scale; None if it is not run there.

    Raises:
        ConfigError: a setting is unknown or wrong, at whatever scale; the message says where, as ``grids.<name>...``.
    """
    place = f"grids.{name}"
    config = construct(ExperimentConfig, data, place)
    require(bool(config.grid) or bool(config.study), place, dict(data), "an experiment with a grid, a study, or both")
    for key in ("transfers", "probes", "attribution"):
        require(
            bool(config.grid) or not getattr(config, key), f"{place}.{key}", data.get(key), "beside a grid of agents"
        )
    construct(GridConfig, config.grid, f"{place}.grid")
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
    for key in other.options:
        if key not in config.options:
            raise ConfigError(f"{place}.options: there is no '{key}'.{did_you_mean(key, config.options)}")
    probes = config.probes if other.probes is None else other.probes
    require(bool(config.grid) or not probes, f"{place}.probes", True, "beside a grid of agents")
    here = {
        "grid": construct(GridConfig, {**config.grid, **changed}, place) if config.grid else None,
        "transfers": config.transfers if other.transfers is None else other.transfers,
        "options": {**config.options, **other.options},
        "probes": probes,
    }
    return Experiment(**{**vars(config), **here}, name=name)


def other_panel(family: str, difficulty: str, transfer: TransferConfig) -> str | None:
    """The panel that agents trained in this one are tested in; None if there is no harder, or easier, one."""
    wanted = transfer.difficulty or difficulty
    if wanted in STEPS:
        place = DIFFICULTIES.index(difficulty) + STEPS[wanted]
        if not 0 <= place < len(DIFFICULTIES):
            return None
        wanted = DIFFICULTIES[place]
    return f"{transfer.family or family}-{wanted}"


def chosen_names(requested: Sequence[str], known: Sequence[str]) -> list[str]:
    """The experiments that were requested, all if none were; raises :class:`ConfigError` for an unknown one."""
    for name in requested:
        if name not in known:
            raise ConfigError(f"experiments: there is no experiment '{name}'.{did_you_mean(name, known)}")
    return [name for name in known if not requested or name in requested]
