"""What the names in the settings of a run stand for: levels, task and observation."""

import dataclasses
import inspect
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from segar.cli import load_playable
from segar.envs import VectorEnv
from segar.errors import LevelError, RuleError, SegarError, did_you_mean
from segar.experiments.levels.rule_sets import levels_of_rule_sets
from segar.experiments.levels.suite_levels import levels_of_suite, observation_of_suite
from segar.experiments.levels.variations import vary
from segar.experiments.settings import (
    DEFAULT_TASK,
    DESIGNS,
    MATCHED_DESIGNS,
    MECHANISM_DESIGN,
    OWN_TASK,
    RULE_SETS_DESIGN,
    TARGET_DESIGN,
    ConfigError,
    LevelsConfig,
    ObservationConfig,
    RunConfig,
    as_data,
    import_object,
    level_file,
    named_distributions,
)
from segar.language import Order, Task, code_place
from segar.levels import (
    LEVEL_ARRAYS,
    RULES,
    LevelDistribution,
    Levels,
    family,
    mechanisms,
    moments,
    with_mechanisms,
    with_room,
)
from segar.metrics import design, matched_set, w2
from segar.observations import OBSERVATIONS, trained_on
from segar.support import object_name
from segar.tasks import TASKS

ENVS_PER_THREAD = 128  # with fewer, waking a thread after each call of the policy costs more time than it saves
RESULT_ENVS = 7  # in which results are tried; no number that arrays have by chance
INDEPENDENT_SETS = 5  # of training levels; their mean W2 to the test levels is the unit of designs such as w2_x1.2


@dataclass(frozen=True)
class LevelFile:
    """The levels of a file, of which some are taken as if they were sampled."""

    path: Path
    levels: Levels

    @property
    def world(self) -> Any:
        """Their rules."""
        return self.levels.world

    @property
    def task(self) -> str | None:
        """The name of the task that they are for."""
        return self.levels.task

    def __len__(self) -> int:
        return len(self.levels)

    def sample(self, n: int, seed: int = 0, split: str = "train") -> Levels:
        """The first ``n`` levels for seed 0, and for another seed ``n`` different ones in random order, whatever the split.

        Of one seed, a smaller ``n`` gives the first of more. Raises :class:`ConfigError` if there are fewer.
        """
        if n > len(self):
            raise ConfigError(f"levels: {self.path} has {len(self)} levels, not {n}; {split} levels are taken from it")
        order = np.random.default_rng(seed).permutation(len(self)) if seed else np.arange(len(self))
        return self.levels[order[:n]]


def make_levels(config: LevelsConfig) -> tuple[Levels, Levels]:
    """Training and test levels; raises :class:`ConfigError` for an unknown distribution."""
    return Prepared(RunConfig(levels=config)).level_sets


def distribution_of(config: LevelsConfig, which: str) -> Any:
    """The distribution, varied as ``config`` says, of the ``"train"`` or the ``"test"`` levels; raises :class:`ConfigError`."""
    name, variation = config.named(which)
    place, place_of_variation = f"levels.{which}", "levels.variation" if which == "train" else "levels.test_variation"
    path = level_file(name, place)
    of_suite = levels_of_suite(name, which, place)
    if of_suite is not None:
        if variation:
            raise ConfigError(f"{place_of_variation}: the suite {name} is frozen and cannot be varied")
        if which == "test" and config.test_seed:
            raise ConfigError(
                f"levels.test_seed: the test levels of the suite {name} are frozen, and no seed draws others; leave it out"
            )
        return of_suite
    if path is None:
        return vary(find_distribution(name, place), variation, place_of_variation)
    if which == "test" and config.test is None:
        raise ConfigError(
            f"levels.test: the training levels are those of {path}, so name the test levels, too: levels.test=..."
        )
    if variation:
        raise ConfigError(f"{place_of_variation}: the levels of {path} are fixed and cannot be varied")
    return LevelFile(path, levels_in(path, config.world, place, "levels.world"))


def levels_in(path: Path, world: str | None, place: str, setting: str) -> Levels:
    """The levels of a file, in the world that ``module:attribute`` names, or in the one of the default rules.

    Args:
        place: the setting that names the file.
        setting: the one that names the world.

    Raises:
        SegarError: it is no level file, or the world cannot be had, or its levels have rules of their own and no world is
            named; the message says which setting names it.
    """
    try:
        return load_playable(str(path), world)
    except LevelError as error:  # which names the option of the command segar
        raise ConfigError(f"{place}: {str(error).replace('--world ', f'{setting}=')}") from error


def in_own_world(levels: Levels, config: LevelsConfig, which: str) -> Levels:
    """Levels from the file of a run, with the rules of the ``"train"`` or the ``"test"`` distribution, which no file holds."""
    if not levels.provenance.rules or levels.world is not None:
        return levels
    return dataclasses.replace(levels, world=distribution_of(config, which).world)


def pick_levels(distribution: Any, config: LevelsConfig, test: Any) -> Any:
    """The training levels that the settings ask for; raises :class:`LevelError` where no levels meet their design."""
    if TARGET_DESIGN.fullmatch(config.design):
        return levels_at_target(distribution, config, test)
    if config.design != "iid" and hasattr(distribution, "suite"):
        raise ConfigError(
            f"levels.design: the suite {distribution.suite.name} draws its training levels; leave {config.design} out"
        )
    if config.design == "iid":  # a user's own distribution need not be a LevelDistribution for this design
        return distribution.sample(config.number, seed=config.seed, split="train")
    if RULE_SETS_DESIGN.fullmatch(config.design):
        return levels_of_rule_sets(distribution, config, test)
    if MECHANISM_DESIGN.fullmatch(config.design):
        return levels_with_mechanism(distribution, config, test)
    if config.design in MATCHED_DESIGNS:
        return matched_set(distribution, config.number, test=test, seed=config.seed, **MATCHED_DESIGNS[config.design])
    if config.design not in DESIGNS:
        return own_design(distribution, config, test)
    nuisance = [Order] if config.design == "nuisance_only" else []
    return design(distribution, config.number, config.design, seed=config.seed, nuisance=nuisance)  # type: ignore[arg-type]


def own_design(distribution: Any, config: LevelsConfig, test: Any) -> Levels:
    """The training levels that the user's function ``design(distribution, count, seed, test)`` picks.

    Raises:
        ConfigError: it returns something else, or another number of levels.
    """
    levels = import_object(config.design, "levels.design")(distribution, config.number, config.seed, test)
    if not isinstance(levels, Levels) or len(levels) != config.number:
        made = f"{len(levels)} levels" if isinstance(levels, Levels) else type(levels).__name__
        raise ConfigError(f"levels.design: {config.design} returns {made}, not {config.number} levels (segar.Levels)")
    return levels


def levels_with_mechanism(distribution: Any, config: LevelsConfig, test: Levels) -> Levels:
    """Training levels of which a part has one mechanism, such as the prior on mass, of the distribution of the test levels.

    ``Mass_of_test_30``: the first 30 % of the levels; all else in them is as in training. Units of factors are those of all
    levels that can be drawn so.

    Raises:
        ConfigError: one of the distributions is no :class:`segar.LevelDistribution`, they have no such mechanism or the same
            one, or their levels do not fit into one set.
    """
    name, percent = MECHANISM_DESIGN.fullmatch(config.design).groups()  # type: ignore[union-attr]
    other, place = test.distribution, f"levels.design: {config.design}"
    if not isinstance(distribution, LevelDistribution) or not isinstance(other, LevelDistribution):
        raise ConfigError(f"{place} is of training and test levels that are drawn from level distributions")
    before, after = mechanisms(distribution), mechanisms(other)
    if name not in after or name == RULES:
        known = [one for one in after if one != RULES]
        raise ConfigError(f"{place}: the test distribution has no mechanism '{name}'.{did_you_mean(name, known)}")
    if before.get(name) == after[name]:
        raise ConfigError(f"{place}: training and test levels have the same {name}; levels.test_variation changes it")
    changed = with_mechanisms(distribution, other, [name])

    def drawn(n: int, seed: int, split: str) -> Levels:
        own, given = distribution.sample(n, seed=seed, split=split), changed.sample(n, seed=seed, split=split)
        if own.layout != given.layout:
            raise ConfigError(f"{place}: levels with the {name} of the test have other slots, types or parameters")
        own, given, k = with_room(own, given), with_room(given, own), round(n * int(percent) / 100)
        parts = {one: (getattr(given, one)[:k], getattr(own, one)[k:]) for one in LEVEL_ARRAYS}
        made = dataclasses.replace(own.provenance, name=f"{own.provenance.name}, {config.design}", distribution="")
        arrays: dict[str, Any] = {one: np.concatenate(pair) for one, pair in parts.items()}
        return dataclasses.replace(own, **arrays, provenance=made, distribution=None)

    levels = drawn(config.number, config.seed, "train")
    spread = drawn(moments.SPREAD_SAMPLE, 0, "spread")
    return dataclasses.replace(levels, moments=moments.moments_of_levels(spread))


def levels_at_target(distribution: Any, config: LevelsConfig, test: Any) -> Any:
    """Training levels whose W2 to the test levels is the one that the design names, within 1 %.

    Raises:
        ConfigError: no training levels have that distance; the message names the distances that can be reached.
    """
    relative, number = TARGET_DESIGN.fullmatch(config.design).groups()  # type: ignore[union-attr]
    target, unit = float(number), 1.0
    if relative:
        pool = distribution.sample(INDEPENDENT_SETS * config.number, seed=config.seed, split="train")
        sets = np.arange(len(pool)).reshape(INDEPENDENT_SETS, -1)
        unit = float(np.mean([w2(pool[one], test) for one in sets]))
    try:
        return design(distribution, config.number, "target", seed=config.seed, test=test, target=target * unit)
    except LevelError as error:
        times = f", which is {target:g} times the {unit:.4g} of independent levels" if relative else ""
        raise ConfigError(f"levels.design: {config.design} cannot be had{times}. {error}") from error


def find_distribution(name: str, place: str) -> Any:
    """The level distribution that is named by a family or by ``module:attribute``; raises :class:`ConfigError`."""
    if ":" in name:
        found = import_object(name, place)
        if not hasattr(found, "sample") and callable(found):
            found = found()
        if not hasattr(found, "sample"):
            raise ConfigError(f"{place}: '{name}' is no level distribution, nor a function that makes one")
        return found
    try:
        return family(name)
    except SegarError as error:
        near = did_you_mean(name, named_distributions())
        raise ConfigError(f"{place}: there is no level family or suite '{name}'.{near}") from error


@dataclass(frozen=True)
class Prepared:
    """A configuration with what its names stand for: each is made once, when it is first asked for.

    What cannot be made raises :class:`ConfigError` then.
    """

    config: RunConfig

    @cached_property
    def train_distribution(self) -> Any:
        """What the training levels are drawn from."""
        return distribution_of(self.config.levels, "train")

    @cached_property
    def test_distribution(self) -> Any:
        """What the test levels are drawn from."""
        return distribution_of(self.config.levels, "test")

    @cached_property
    def level_sets(self) -> tuple[Levels, Levels]:
        """The training and the test levels."""
        levels = self.config.levels
        train, test = self.train_distribution, self.test_distribution
        test_levels = test.sample(levels.test_count, seed=levels.test_seed, split="test")
        return pick_levels(train, levels, test_levels), test_levels

    @cached_property
    def task_name(self) -> str:
        """The name of the task that is played, on all levels of a run: the one that is chosen, or that of the training levels.

        Raises:
            ConfigError: a level file names a task that is not built in, or a variation gives named levels another task.
        """
        config = self.config
        if config.task.name != OWN_TASK:
            return config.task.name
        found, chosen = self.train_distribution, config.resolved().task.name
        levels = found if isinstance(found, LevelDistribution | LevelFile) else found.sample(1, seed=0, split="train")
        name = levels.task or DEFAULT_TASK
        if isinstance(found, LevelFile) and name not in TASKS:
            raise ConfigError(
                f"levels.train: the levels of {found.path} were saved for the task '{name}', which a level file does not hold;"
                f" give task={name}"
            )
        if chosen not in (OWN_TASK, name):
            raise ConfigError(
                f"levels.variation: {config.levels.variation} gives levels for the task '{name}', and those of"
                f" {config.levels.train} are for '{chosen}'. Choose one of them: task={name} or task={chosen}"
            )
        return name

    @cached_property
    def task(self) -> Task:
        """The task that is played on all levels of the run."""
        config, own = self.config, self.config.task.name == OWN_TASK
        _import_own_levels(config.levels)
        suite = levels_of_suite(config.levels.train, "train", "levels.train")
        if suite and own:
            return suite.task_of(config)
        place = f"levels.train: the task that {config.levels.train} names" if own else "task.name"
        return _find(self.task_name, config.task.options, "task", place)

    @cached_property
    def observations(self) -> Mapping[str, Any]:
        """What the agent observes of the ``"train"`` and of the ``"test"`` levels, which look different in some suites."""
        _import_own_levels(self.config.levels)
        seen = {which: observation_seen(self.config, which) for which in ("train", "test")}
        return {which: _find(one.name, one.options, "observation", "observation.name") for which, one in seen.items()}

    def check_names(self) -> None:
        """Raises :class:`ConfigError` if the levels, the task or the observation cannot be made.

        Levels may define what the others name, so they are first.
        """
        _ = self.train_distribution, self.test_distribution, self.task, self.observations

    def env_options(
        self, num_envs: int | None = None, train: Levels | None = None, which: str = "train"
    ) -> dict[str, Any]:
        """Keyword arguments of ``VectorEnv`` and ``TorchRLEnv`` that the configuration states, for any levels.

        Args:
            num_envs: how many environments a policy steps at a time; few of them are stepped by fewer threads.
            train: the levels that the agent is trained on, whatever levels it plays: what it observes may depend on them.
                None where nothing is played, or training levels are.
            which: whether the ``"train"`` or the ``"test"`` levels of the run are played.
        """
        most = self.config.num_threads if num_envs is None else max(num_envs // ENVS_PER_THREAD, 1)
        task, seen = self.task, self.observations[which]
        return {
            "observation": seen if train is None else trained_on(seen, train),
            "task": task,
            "num_threads": min(self.config.num_threads, most),
            "trials": self.config.trials,
            "unit_actions": True,  # which policies give, whatever the range of the task
        }


def _import_own_levels(config: LevelsConfig) -> None:
    """Imports the modules of own levels, which may define what a task or an observation names, such as a parameter."""
    for setting, name in as_data(config).items():
        if isinstance(name, str) and object_name(name):
            import_object(name, f"levels.{setting}")


def observation_seen(config: RunConfig, which: str = "train") -> ObservationConfig:
    """What an agent of these settings observes of the ``"train"`` or the ``"test"`` levels: its suite may hide or show things.

    Raises:
        ConfigError: the suite shows textures, and the observation shows none.
    """
    suite = levels_of_suite(config.levels.train, "train", "levels.train")
    return config.observation if suite is None else observation_of_suite(suite.suite, config.observation, which)


def check_observations(prepared: Prepared, train: Levels, test: Levels) -> None:
    """Raises :class:`ConfigError` if the agent would not observe the same numbers in the test levels as in training, or could
    not play its task there."""
    config = prepared.config
    seen = VectorEnv(train, 1, seed=0, **prepared.env_options(train=train))
    try:
        shown = VectorEnv(test, 1, seed=0, **prepared.env_options(train=train, which="test"))
    except RuleError as error:
        raise ConfigError(
            f"levels.test: the task {prepared.task_name} of the training levels cannot be played in levels of"
            f" {config.levels.test_distribution}: {str(error).partition('; choose the task')[0]}. Test on levels that have what"
            " the task needs"
        ) from error
    space, other = seen.single_observation_space, shown.single_observation_space
    names, others = (list(getattr(env.observation, "names", ())) for env in (seen, shown))
    if space.shape == other.shape and type(space) is type(other) and names == others:
        return
    only = [*(f"{name} in training" for name in names if name not in others),
            *(f"{name} in the test" for name in others if name not in names)]  # fmt: skip
    differs = f"shape {space.shape} in training, {other.shape} in the test" + (f"; only {only[0]}" if only else "")
    raise ConfigError(
        f"levels.test: observation={config.observation.name} does not show the same in levels of"
        f" {config.levels.test_distribution} as in those of {config.levels.train} ({differs}). Test on levels with the same"
        " entities, choose the entities that a state shows, or observe pixels, which fit all levels"
    )


def check_results(prepared: Prepared, train: Levels, test: Levels) -> list[str]:
    """The names of the results that are several numbers per environment, of which tables have no columns, where the task is
    the user's.

    Raises:
        ConfigError: a result cannot be computed of the states at a reset, twice the same, or is no number.
    """
    several: dict[str, None] = {}
    options = prepared.env_options(train=train)
    for levels in (train, test):
        env = VectorEnv(levels, RESULT_ENVS, seed=0, **options)
        env.reset()
        for name, function in env.task.results.items():
            result = f"the task {env.task.name}: its result '{name}', {code_place(function)},"
            fix = (
                "A result is a function of env.factors, a mapping of names to arrays that lead with the environment, such"
                " as factors['Position'][:, 0], and returns an array (num_envs, ...), a row for each environment"
            )
            try:
                values, again = function(env.factors), function(env.factors)
            except Exception as error:  # the user's code may raise anything
                raise ConfigError(f"{result} raises {type(error).__name__}: {error}. {fix}") from error
            shape = np.shape(values)
            if shape[:1] != (RESULT_ENVS,):
                raise ConfigError(f"{result} has the shape {shape} for {RESULT_ENVS} environments. {fix}")
            if np.asarray(values).dtype.kind not in "biuf":
                raise ConfigError(
                    f"{result} is made of {type(np.asarray(values).flat[0]).__name__}, not of numbers or truths, so that no"
                    f" table could hold its mean. {fix}"
                )
            several |= {name: None} if len(shape) > 1 else {}
            if repr(np.asarray(values).tolist()) != repr(np.asarray(again).tolist()):
                raise ConfigError(
                    f"{result} differs when it is computed again of the same factors. It may draw random numbers, read a clock,"
                    " or count its calls, so nobody could repeat it. Compute it from the factors alone"
                )
        env.close()
    return [] if prepared.task_name in TASKS else list(several)


def _find(name: str, options: Mapping[str, Any], group: str, place: str) -> Any:
    """The task or observation that ``name``, which ``place`` states, stands for; a function or class is called with
    ``options``."""
    known: Mapping[str, Any] = TASKS if group == "task" else OBSERVATIONS
    found = import_object(name, place, group, known)
    if not callable(found):
        if options:
            made = "a task" if group == "task" else "an observation"
            raise ConfigError(
                f"{group}.options: {name} is {made}, which is made already, so {', '.join(options)} would say nothing. Name a"
                f" function that takes {'it' if len(options) == 1 else 'them'} and returns the {group}"
            )
        return found
    known_options = inspect.signature(found).parameters
    takes_any = any(one.kind is one.VAR_KEYWORD for one in known_options.values())
    for option in options:
        if option not in known_options and not takes_any:
            raise ConfigError(f"{group}.options: {name} has no '{option}'.{did_you_mean(option, known_options)}")
    if group == "task":
        _require_finite(name, options, known_options)
    try:
        return found(**options)
    except (TypeError, SegarError) as error:
        raise ConfigError(f"{group}.options: {error}") from error
    except Exception as error:  # the user's code may raise anything
        given = ", ".join(f"{option}={value!r}" for option, value in options.items()) or "no options"
        raise ConfigError(f"{group}.options: {name} with {given} raises {type(error).__name__}: {error}") from error


def _require_finite(name: str, options: Mapping[str, Any], known: Mapping[str, inspect.Parameter]) -> None:
    """Raises :class:`ConfigError` where an option of a task is, or holds, a number that is not finite, unless the default of
    the option is such a number itself."""
    for option, value in options.items():
        default = known[option].default if option in known else None
        found = next(_not_finite(value, f"task.options.{option}"), None)
        if found is not None and next(_not_finite(default, ""), None) is None:
            place, number = found
            raise ConfigError(
                f"{place}: the number must be finite, not {number!r}, of which the task {name} would make wrong comparisons or"
                " rewards without a word. A task function whose option may be infinite says so by its default"
            )


def _not_finite(value: Any, place: str) -> Iterator[tuple[str, float]]:
    """The numbers that are not finite in an option's plain data, with their places."""
    if isinstance(value, float) and not math.isfinite(value):
        yield place, value
    elif isinstance(value, Mapping | list | tuple):
        parts = value.items() if isinstance(value, Mapping) else enumerate(value)
        for key, part in parts:
            yield from _not_finite(part, f"{place}.{key}")
