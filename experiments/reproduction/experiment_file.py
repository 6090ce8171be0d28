"""An experiment as data: a grid of runs, other levels that its agents are tested on, claims, and what needs no training.

One file of ``conf/experiment/``, or one that ``segar study`` is given, is one experiment. It is plain YAML, which
:func:`experiment_at` reads::

    title: Gap against W2 out of distribution    # required; all other keys may be left out
    figure: 4a                                   # of the paper
    grid:                                        # runs: every combination, see GridConfig; what is not named is the scale's
      families: [empty, my_lab.levels:windy]     # families of several difficulties, or distributions by name
      counts: [1, 10]
      algorithms: [base, curl]                   # choices of the group algorithm, or own ones; base is the scale's
      vary: {algorithm.gamma: [0.9, 0.99]}       # any other settings
    transfers:                                   # further tests of the trained agents, see TransferConfig
      - difficulty: harder
      - observation: textures_far
    attribution:                                 # agents are also tested between training and test levels: in these groups
      position: [Position]                       # of factors, in every combination
      rules: [World]                             # World stands for the rules, with those of a rule space
    probes: true                                 # ask what the representations know of the factors
    study: w2                                    # a study that needs no training
    options: {seeds: 20}                         # of the study, by name
    claims:                                      # what the runs are asked, see ClaimConfig
      distance: {says: The gap is worse farther away., test: correlation, expected: negative}  # or positive, or none
    scales:                                      # at a scale that is not named here, the experiment is not run; none: at all
      quick: {counts: [3], options: {seeds: 10}}     # what differs there: keys of grid, and transfers, probes, options
      paper: {}                                  # nothing differs

A grid, a study, or both are needed; transfers, attribution and probes stand beside a grid.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields
from typing import Annotated, Any

from segar.errors import did_you_mean
from segar.experiments.levels.variations import VARIATIONS
from segar.experiments.runs.run_folder import RESULTS
from segar.experiments.settings import (
    DIFFICULTIES,
    ConfigError,
    Count,
    CountFrom0,
    Design,
    Difficulty,
    Family,
    LevelCount,
    PositiveOrNull,
    construct,
    is_distribution,
    one_of,
    one_or_own,
    require,
    that,
)
from segar.levels import RESERVED_GROUPS, SEPARATOR

PLAN, STUDY = "plan.json", "study.yaml"  # in a results folder: what is run, and what a study of one's own asks
BASE = "base"  # in a grid: the algorithm, observation or task of the scale
SCALES = ("smoke", "quick", "standard", "paper")
MOST_GROUPS = 4  # 30 sets of levels in between, with the rest
STEPS = {"harder": 1, "easier": -1}  # difficulties relative to that of the training levels


def check_transfers(place: str, transfers: Sequence[TransferConfig] | None) -> None:
    """Raises :class:`ConfigError` unless something differs in each transfer, also from the other transfers."""
    for i, transfer in enumerate(transfers or ()):
        differs = transfer != TransferConfig()
        require(differs, f"{place}[{i}]", {}, "a family, difficulty, variation or observation that differs")
        stated = {name: value for name, value in vars(transfer).items() if value is not None}
        require(transfer not in (transfers or ())[:i], f"{place}[{i}]", stated, "another transfer than those before it")


def check_groups(place: str, groups: Mapping[str, Sequence[str]]) -> None:
    """Raises :class:`ConfigError` unless there are few groups, and each lists factors; which there are say the levels."""
    require(len(groups) <= MOST_GROUPS, place, list(groups), f"at most {MOST_GROUPS} groups")
    for name, members in groups.items():
        listed = not isinstance(members, str) and bool(members) and all(isinstance(one, str) for one in members)
        require(listed, f"{place}.{name}", members, "a list of factors and parameters, such as [Position, Size]")
        other = f"another name: {', '.join(RESERVED_GROUPS)} are taken"
        require(name not in RESERVED_GROUPS, f"{place}.{name}", name, other)
        require(SEPARATOR not in name, f"{place}.{name}", name, f"a name without {SEPARATOR}")


def check_vary(place: str, vary: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` unless each setting has a list of values, and is none that the grid has a name for."""
    for name, values in vary.items():
        require(name not in OF_GRID, f"{place}.{name}", name, f"varied by grid.{OF_GRID.get(name)}")
        holds = isinstance(values, list | tuple) and 0 < len({*map(repr, values)}) == len(values)
        require(holds, f"{place}.{name}", values, "a list of values, each once")


def entry(about: str, default: Any = MISSING) -> Any:
    """A key of a file, of which ``--help`` and the schema of files say what it is about; required where it has no default."""
    given: dict[str, Any] = {"default_factory": dict} if default == {} else {"default": default}
    return field(**given, metadata={"description": about})


# Settings that a grid varies by a name of its own.
OF_GRID = {
    "levels.train": "families", "levels.count": "counts", "levels.seed": "level_sets", "levels.design": "designs",
    "levels.variation": "variations", "algorithm": "algorithms", "observation": "observations", "task": "tasks",
    "scale.frames": "frames", "evaluation.interval": "interval", "seed": "seeds",
}  # fmt: skip
NOT_EMPTY = that(bool, "one or more")
EACH_ONCE = that(lambda values: len(set(values)) == len(values), "a list in which each stands once")
SIGNS = {"negative": -1, "positive": 1, "none": 0}
OF_TASK = re.compile(rf"{RESULTS}.+_(train|test)")  # columns of what the task says of the last state of episodes
FEWEST_BLOCKS = 3  # that an interval should be of: docs/decisions/0012-few-blocks.md
# What each test takes beside where, tested_on and margin; one of the user's own takes nothing else.
TESTS = {"correlation": ("of", "against", "given"), "difference": ("of", "between"), "mean": ("of",)}
OF_TESTS = ("of", "against", "given", "between")
# Of the runs of a study, without the settings that it varies and without the action mode behind some names.
COLUMNS = (
    "family", "difficulty", "panel", "n", "log_n", "cell", "algorithm", "observation", "task", "variation", "design", "seed",
    "agent", "levels", "frames", "hours", "gap", "gap_ref", "gap_se", "ks", "radius", "entropy", "effective_number", "w2",
    *(f"w2_{mode}" for mode in ("exact", "exact_common", "reference", "paper")),
    *(f"{name}_{levels}" for name in ("eta", "se", "success", "death", "length", "episodes") for levels in ("train", "test")),
)  # fmt: skip


def check_between(place: str, between: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` unless there is at most one column, with two different values."""
    pairs = all(
        isinstance(values, list | tuple) and len({*map(str, values)}) == 2 == len(values) for values in between.values()
    )
    check_columns(place, between)
    wanted = "one column with two different values, such as {algorithm: [curl, ppo]}"
    require(len(between) < 2 and pairs, place, dict(between), wanted)


def check_column(place: str, name: str) -> None:
    """Raises :class:`ConfigError` unless runs may have the column, or it is that of a setting or of the task's own results."""
    short = re.sub(r"_(deterministic|sampled)$", "", name)
    if "." not in name and short not in COLUMNS and not OF_TASK.fullmatch(short):
        raise ConfigError(
            f"{place}: the runs have no column '{name}'.{did_you_mean(name, COLUMNS)} A result of the task itself is named as "
            f"{RESULTS}NAME_test"
        )


def check_columns(place: str, names: Iterable[str]) -> None:
    """:func:`check_column` of each name."""
    for name in names:
        check_column(place, name)


def check_claims(place: str, claims: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` unless each claim is one."""
    for name, claim in claims.items():
        claim_config(claim, f"{place}.{name}")


def claim_config(claim: Any, place: str) -> ClaimConfig:
    """The claim that plain data states; raises :class:`ConfigError` that begins with the ``place``."""
    require(isinstance(claim, Mapping), place, claim, "settings of a claim, such as says and test")
    if True in claim or "on" in claim:
        raise ConfigError(f"{place}: name the levels of a transfer by tested_on: ...; YAML takes the key `on` for true")
    if False in claim:
        raise ConfigError(
            f"{place}: name the column that is tested by of: ...; YAML takes the keys `off` and `no` for false"
        )
    if {"says", "test"} <= {*claim} and "expected" not in claim:
        raise ConfigError(f"{place}.expected: say what you expect: {', '.join(SIGNS)} (none: that there is no effect)")
    found = construct(ClaimConfig, claim, place)
    taken = TESTS.get(found.test, ())
    for key in OF_TESTS:
        if key in claim and key not in taken:
            raise ConfigError(
                f"{place}.{key}: it would say nothing beside test: {found.test}, which takes "
                f"{', '.join((*taken, 'where', 'tested_on', 'margin'))}"
            )
    return found


Names = Annotated[tuple[str, ...], NOT_EMPTY, EACH_ONCE]
VariationName = Annotated[str, one_or_own(("", *VARIATIONS))]
VariationNames = Annotated[tuple[VariationName, ...], NOT_EMPTY, EACH_ONCE]


@dataclass(frozen=True)
class GridConfig:
    """Runs: every combination. What is left out, or is empty in what differs at a scale, is as the scale has it."""

    families: Annotated[tuple[Family, ...], EACH_ONCE] = entry("of several difficulties; or single distributions", ())
    difficulties: Annotated[tuple[Difficulty, ...], EACH_ONCE] = entry("of the families that have several", ())
    counts: Annotated[tuple[LevelCount, ...], EACH_ONCE] = entry("numbers of training levels", ())
    seeds: Count | None = entry(
        "how many agents of each kind, from `seed` upwards, each with a level set of its own", None
    )
    nested: bool = entry(
        "level sets of a seed contain each other; false: each number of levels has seeds of its own", True
    )
    level_sets: Count | None = entry("how many level sets instead, each with as many agents as there are seeds", None)
    frames: Count | None = entry("of each run", None)
    algorithms: Names = entry("choices of the group algorithm", (BASE,))
    observations: Names = entry("choices of the group observation", (BASE,))
    tasks: Names = entry("choices of the group task", (BASE,))
    designs: Annotated[tuple[Design, ...], NOT_EMPTY, EACH_ONCE] = entry("how training levels are picked", ("iid",))
    variations: VariationNames = entry("names in segar.experiments.levels.variations", ("",))
    interval: CountFrom0 | None = entry(
        "frames between evaluations on the test levels; None: as the scale has it", None
    )
    vary: Annotated[Mapping[str, Any], check_vary] = entry("other settings: name to values", {})


@dataclass(frozen=True)
class TransferConfig:
    """Other test levels, or another look of them, for agents that are trained already. None: as in training."""

    family: Family | None = entry("or a distribution; None: as in training", None)
    difficulty: Annotated[str, one_of(*DIFFICULTIES, *STEPS)] | None = entry(
        "agents without a harder one are left out", None
    )
    variation: VariationName | None = entry("of the levels", None)
    observation: str | None = entry("a choice of the group observation", None)


Transfers = Annotated[tuple[TransferConfig, ...], check_transfers]
Test = Annotated[str, one_or_own(TESTS)]
Column = Annotated[str, check_column]
Between = Annotated[Mapping[str, Any], check_between]


@dataclass(frozen=True)
class ClaimConfig:
    """A statement about the runs that a test decides, by the rules of the paper's claims.

    ``correlation``: Pearson's r of ``of`` and ``against`` given the columns ``given``. ``difference``: the mean of ``of`` at
    the first value of ``between`` less that at the second, over pairs of runs that are equal otherwise. ``mean``: the mean
    of ``of``. Intervals are those of blocks: all runs on one level set stay together, or all of a panel where a correlation
    compares panels, because it is over several, and nothing that is given tells them apart.
    """

    says: str = entry("the statement")
    test: Test = entry("correlation, difference, mean, or module:function(runs) -> segar.analysis.stats Estimate")
    expected: Annotated[str, one_of(*SIGNS)] = entry(
        "negative or positive, which is the sign; none: that there is no effect"
    )
    of: Column = entry(
        "a column of the table of runs, such as gap, success_test, eta_test, w2, results/NAME_test", "gap"
    )
    against: Column = entry("of a correlation; w2 is exact W2, of several pairs of distributions in one unit", "w2")
    given: Annotated[tuple[str, ...], check_columns] = entry("of a correlation: panel, log_n, cell, or columns", ())
    between: Between = entry("of a difference: column to two values", {})
    where: Annotated[Mapping[str, Any], check_columns] = entry("only the runs with these values", {})
    tested_on: str = entry("the label of a transfer, whose levels are meant instead of the run's own test levels", "")
    margin: PositiveOrNull = entry(
        "a smaller effect does not matter; null: 0.3 of an r, else 0.2 standard deviations", None
    )

    def __post_init__(self) -> None:
        has_values = self.test != "difference" or bool(self.between)
        require(has_values, "between", {}, "a column with two values, for a difference")
        is_other = self.test != "correlation" or self.of not in (self.against, *self.given)
        require(is_other, "of", self.of, "another column than those that it is correlated with, or that are given")


@dataclass(frozen=True)
class ExperimentConfig:
    """What one file of ``conf/experiment/`` says."""

    title: str = entry("what the experiment is about")
    figure: str = entry("of the paper", "")
    grid: Mapping[str, Any] = entry("of GridConfig; empty: nothing is trained", {})
    transfers: Transfers = entry("other levels, or looks, that the trained agents are tested on", ())
    attribution: Annotated[Mapping[str, Sequence[str]], check_groups] = entry("groups of factors", {})
    probes: bool = entry("ask what the agents' representations know of the factors, as probes.<scale> says", False)
    claims: Annotated[Mapping[str, Any], check_claims] = entry("name to ClaimConfig", {})
    study: str = entry("needs no training: a plug-in, see segar.experiments.commands.plugin", "")
    options: Mapping[str, Any] = entry("of the study, by name", {})
    scales: Mapping[str, Any] = entry("what differs there, of the grid and of Others; none: all", {})


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
    for key in ("transfers", "probes", "attribution", "claims"):
        fits = bool(config.grid) or not getattr(config, key)
        require(fits, f"{place}.{key}", data.get(key), "beside a grid of agents")
    construct(GridConfig, config.grid, f"{place}.grid")
    if not config.scales:
        return settings_at(name, config, {}, place)
    at = {known: settings_at(name, config, one, f"{place}.scales.{known}") for known, one in config.scales.items()}
    return at.get(scale)


def settings_at(name: str, config: ExperimentConfig, changes: Any, place: str) -> Experiment:
    """The experiment with what its file changes at a scale; raises :class:`ConfigError`."""
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
    """The panel that agents trained in this one are tested in; None if there is no harder, or easier, one.

    Raises:
        ConfigError: a family of several difficulties is named without one, for agents whose levels have none.
    """
    if transfer.family and is_distribution(transfer.family):
        return transfer.family
    wanted = transfer.difficulty or difficulty
    if not difficulty and (wanted in STEPS or not transfer.family):
        return None if wanted else family
    if not wanted:
        raise ConfigError(
            f"transfers: {family} has no difficulty, so name one: {{family: {transfer.family}, difficulty: hard}}"
        )
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
