"""Makes suites: freezes test levels, finds the plans that solve them, and measures whether a suite is fit for comparisons."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from segar.errors import SuiteError
from segar.evaluation import Idle, play_episodes
from segar.hardness import Plan, make_starts, plan, random_episodes, replay
from segar.language import Factor, Task
from segar.levels import LevelDistribution, Levels, hash_of_levels, written
from segar.rules import World
from segar.suites.suite_file import (
    FORMAT,
    HASH_DIGITS,
    HASHED,
    ITERATIONS,
    LEVELS,
    PLANS,
    SAMPLES,
    SEARCH,
    SIDES,
    SUFFIX,
    TEST_SEED,
    Suite,
    distribution_of,
    hash_of_plans,
    read_suite,
    solved_levels,
    suite_hash,
    task_from,
)
from segar.tasks import task_of

TEST_LEVELS, OWN_TRAINING_LEVELS = 200, 100
PLAYS = 20  # random episodes per level
LEAST_SOLVED = 0.99  # share of test levels that the planner solves
MOST_BY_CHANCE = 0.2  # share that idle and random play may solve


@dataclass(frozen=True)
class Admission:
    """What a suite is measured by before methods are compared on it; shares of the test levels.

    Attributes:
        planner: solved by the stored plans, played again. idle: by doing nothing. random: by uniform actions, on average.
    """

    planner: float
    idle: float
    random: float

    @property
    def is_fit(self) -> bool:
        """Whether the levels can be solved, and neither idle nor random play solves many of them."""
        return self.planner >= LEAST_SOLVED and max(self.idle, self.random) <= MOST_BY_CHANCE


def admission(suite: Suite, plays: int = PLAYS) -> Admission:
    """Play the plans of a suite again, do nothing on its test levels, and play ``plays`` random episodes on each."""
    starts = make_starts(suite.test_levels, suite.task, TEST_SEED)
    solved, _ = random_episodes(starts, plays, np.random.default_rng(SEARCH))
    certified = suite.plans.solved & replay(suite.test_levels, suite.plans, suite.task)
    every = np.arange(len(suite.test_levels))
    idle = play_episodes(suite.test_levels, every, Idle(), seed=TEST_SEED, task=suite.task).success
    return Admission(float(certified.mean()), float(idle.mean()), float(solved.mean()))


def freeze(
    path: str | PathLike[str],
    *,
    axis: str,
    shift: str,
    says: str,
    train: LevelDistribution,
    test: LevelDistribution,
    training_levels: int,
    rules: tuple[str, str] = ("default", "default"),
    task: str = "puttputt",
    options: Mapping[str, Any] | None = None,
    hidden: Sequence[type[Factor]] = (),
    textures: Sequence[str] = (),
    test_levels: int = TEST_LEVELS,
    samples: int = SAMPLES,
    iterations: int = ITERATIONS,
) -> Suite:
    """Write a suite: ``path``, which ends in ``.toml``, and beside it its test levels and the plans that solve them.

    Args:
        axis: one of :data:`segar.suites.AXES`. shift: the kind of the difference. says: what differs, in a sentence.
        train, test: distributions that can be written as text; their rules are those that ``rules`` names.
        training_levels: how many levels a method trains on.
        rules: names of :data:`segar.suites.RULES`, of training and test.
        task, options: a name of :data:`segar.tasks.TASKS`, and its arguments.
        hidden: factors that no observation of states may show.
        textures: the sets of textures of training and test, or none.
        test_levels: how many are frozen: the first ones of the split ``test`` that the planner solves.
        samples, iterations: of the planner, see :func:`segar.hardness.plan`.

    Raises:
        SuiteError: there is no such task, or it has no such options; a distribution is not the same when it is read from its
            text; the suite is not one that can be read; or the files cannot be written, or are those of another suite. Nothing
            is written then.
    """
    path = Path(path)
    made = task_from(path, task, options or {})
    levels, plans, unsolved = solved_levels(path, test, test_levels, made, samples, iterations)
    description: dict[str, Any] = {
        "format": FORMAT,
        "name": path.stem,
        "axis": axis,
        "shift": shift,
        "says": says,
        "training_levels": training_levels,
        "test_levels": test_levels,
        "textures": list(textures),
        "unsolved": unsolved,
        "hidden": [factor.__name__ for factor in hidden],
        "task": {"name": task, "options": dict(options or {})},
    }
    for side, distribution, name in zip(SIDES, (train, test), rules, strict=True):
        description[side] = {"rules": name, "distribution": written(distribution)}
    named = {side: distribution_of(path, description, side) for side in SIDES}
    for side, distribution in zip(SIDES, (train, test), strict=True):
        if named[side].hash != distribution.hash or _rules(named[side]) != _rules(distribution):
            raise SuiteError(
                f"{path}: the distribution of {side} is not the same when it is read from its text with the rules"
                f" '{description[side]['rules']}'; see segar.levels.written for what has no text, and segar.suites.RULES"
            )
    hashes = {side: distribution.hash for side, distribution in named.items()}
    hashes |= {"levels": hash_of_levels(levels), "plans": hash_of_plans(plans)}
    hashes["suite"] = suite_hash(description, hashes)
    text = _toml({**description, "hashes": {what: hashes[what] for what in HASHED}})
    return _written(path, levels, plans, text)


def own_suite(
    train: LevelDistribution, test: LevelDistribution, levels: Levels, *, task: Task | None = None, name: str = "own"
) -> Suite:
    """A suite of distributions of one's own, with any rules and any task, for :func:`segar.suites.twins`,
    :func:`segar.suites.find_causes` and :func:`segar.evaluate_on_suite`.

    It is in no file and not frozen; :func:`freeze` writes suites that others can read.

    Args:
        levels: of the test, drawn from ``test``.
        task: what is played; that of the levels where it is None.
        name: of the suite in tables.

    Raises:
        SuiteError: training or test is no :class:`segar.LevelDistribution`, of which alone one can say which factors differ.
    """
    for side, distribution in zip(SIDES, (train, test), strict=True):
        if not isinstance(distribution, LevelDistribution):
            raise SuiteError(f"{name}: {side} must be a LevelDistribution, not {distribution!r}")
    played = task_of(levels) if task is None else task
    plans = plan(levels, played, rng=np.random.default_rng(SEARCH), samples=64, iterations=5)
    hashes = {"train": train.hash, "test": test.hash, "levels": hash_of_levels(levels), "plans": hash_of_plans(plans)}
    whole = hashlib.sha256(json.dumps(hashes).encode()).hexdigest()[:HASH_DIGITS]
    return Suite(
        name, "", "", "", train, test, levels, lambda: plans, OWN_TRAINING_LEVELS, played, (), (), 0, whole, hashes
    )


def _written(path: Path, levels: Levels, plans: Plan, text: str) -> Suite:
    """The suite, read from its files, which are put beside each other once all of them are right."""
    try:
        with TemporaryDirectory(dir=path.parent, prefix=f".{path.stem}-") as folder:
            made = Path(folder) / path.name
            levels.save(made.with_suffix(LEVELS))
            plans.save(made.with_suffix(PLANS))
            made.write_text(text, encoding="utf-8")
            try:
                found = read_suite(made)
            except SuiteError as error:
                raise SuiteError(str(error).replace(str(made), str(path))) from error
            if path.exists() and (there := read_suite(path)).hash != found.hash:
                raise SuiteError(
                    f"{path} is another suite, {there.hash}, on which results may stand; give the new one, {found.hash},"
                    " another version in its name, or remove the old files first"
                )
            for suffix in (LEVELS, PLANS, SUFFIX):
                made.with_suffix(suffix).replace(path.with_suffix(suffix))
    except OSError as error:
        raise SuiteError(f"{path}: the suite cannot be written: {error.strerror or error}") from error
    return read_suite(path)


def _rules(distribution: LevelDistribution) -> list[str]:
    """The names of the rules; constants and activities of a rule space are in the hash of the distribution."""
    world = distribution.world or World()
    return [rule.name for rule in (*world.rules, *world.on_contact)]


def _toml(description: Mapping[str, Any]) -> str:
    """The text of a description; texts of several lines stand between three quotation marks."""
    lines, tables = [], []
    for key, value in description.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{key}]", *(f"{name} = {_value(item)}" for name, item in value.items())]
        else:
            lines.append(f"{key} = {_value(value)}")
    return "\n".join([*lines, *tables]) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, str) and "\n" in value:
        return f"'''\n{value}'''"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{name} = {_value(item)}" for name, item in value.items()) + "}"
    return json.dumps(value, ensure_ascii=False)
