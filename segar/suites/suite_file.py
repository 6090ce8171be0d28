"""A suite, read from its files, every part of which is compared with its hash."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial
from os import PathLike
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from segar.errors import SuiteError, did_you_mean, naming
from segar.hardness import Plan, plan
from segar.language import Factor, Task, all_subclasses
from segar.levels import LevelDistribution, Levels, family, hash_of_levels, read_distribution
from segar.suites.rules_by_name import RULES, rules_of
from segar.suites.suite_names import AXES, DATA, SIDES, SUFFIX, suites
from segar.support import data_in, is_whole
from segar.tasks import TASKS, make_task

FORMAT = 1
HASH_DIGITS = 16
LEVELS, PLANS = ".levels.npz", ".plans.npz"
SEEDS = 2**64
LONGEST = 2**20  # [bytes] of the text of a suite; those that come with SEGAR have 4,000
LOOKS = ("baseline", "close", "far")  # sets of textures that a suite can have
HASHED = ("train", "test", "levels", "plans", "suite")
TEST_SEED = 0
SEARCH, SAMPLES, ITERATIONS = 3, 128, 10  # of the planner: its random numbers, candidates and rounds on each test level


@dataclass(frozen=True, eq=False, repr=False)
class Suite:
    """A training distribution, a test distribution, and the test levels that all methods are compared on.

    Attributes:
        name: with its version, such as ``"place-between-v1"``. axis: one of :data:`AXES`. shift: the kind of the difference.
        says: what differs, in a sentence.
        train, test: the level distributions.
        test_levels: the frozen levels of the test.
        find_plans: makes :attr:`plans`.
        training_levels: how many levels a method trains on, unless it draws levels without end.
        task: what is played.
        hidden: factors that no observation of states may show.
        textures: the sets of textures of training and of the test, which agents see as frames; empty where any observation
            will do.
        unsolved: how many levels were left out of the test because the planner found no way to solve them.
        hash: sixteen digits that change with anything that a result depends on.
        hashes: those of its parts: train, test, levels, plans.
    """

    name: str
    axis: str
    shift: str
    says: str
    train: LevelDistribution
    test: LevelDistribution
    test_levels: Levels
    find_plans: Callable[[], Plan]
    training_levels: int
    task: Task
    hidden: tuple[type[Factor], ...]
    textures: tuple[str, ...]
    unsolved: int
    hash: str
    hashes: Mapping[str, str]

    @cached_property
    def plans(self) -> Plan:
        """The best episode that was found on each test level, with the actions that certify it.

        Those of the suites that come with SEGAR are in no file, so that nothing that plays a test can read them: the search
        that froze the test makes them again, to the bit, in 5 to 20 s.

        Raises:
            SuiteError: they are not those that were frozen.
        """
        found = self.find_plans()
        if (digits := hash_of_plans(found)) != self.hashes["plans"]:
            raise SuiteError(_changed(self.name, "plans", digits, self.hashes["plans"]))
        return found

    def __getstate__(self) -> dict[str, Any]:
        return {**vars(self), "hashes": dict(self.hashes)}

    def training_side(self, seed: int) -> TrainingSide:
        """What a method with this seed may know of the suite; raises as :meth:`sample`."""
        shared = {
            one.name: getattr(self, one.name) for one in dataclasses.fields(TrainingSide) if hasattr(self, one.name)
        }
        return TrainingSide(**{**shared, "textures": self.textures[:1]}, seed=seed, levels=self.sample(seed))

    def __repr__(self) -> str:
        return f"<suite {self.name}: {self.axis}, {self.shift}; {len(self.test_levels)} test levels; {self.hash}>"

    def sample(self, seed: int, n: int | None = None) -> Levels:
        """Levels to train on, none of which is a level of the test; ``training_levels`` of them where ``n`` is None.

        Raises:
            SuiteError: the seed or the number is none. LevelError: there are not as many.
        """
        if not is_whole(seed) or not 0 <= seed < SEEDS:
            raise SuiteError(f"{self.name}: a seed is a whole number from 0 to 2^64 - 1, not {seed!r}")
        if n is not None and (not is_whole(n) or n < 1):
            raise SuiteError(f"{self.name}: the number of training levels must be a whole number from 1 up, not {n!r}")
        return self.train.sample(self.training_levels if n is None else n, seed=seed, apart_from=self.test_levels)


@dataclass(frozen=True, eq=False, repr=False)
class TrainingSide:
    """The training side of a suite with a seed: all that a method may know. Neither test levels nor their distribution are
    here.

    Attributes:
        name, axis, train, training_levels, task, hidden, hash: of the suite. textures: the set of training alone, or none.
        seed: of the method and of its training levels. levels: these.
    """

    name: str
    axis: str
    train: LevelDistribution
    training_levels: int
    task: Task
    hidden: tuple[type[Factor], ...]
    textures: tuple[str, ...]
    hash: str
    seed: int
    levels: Levels

    def sample(self, seed: int, n: int | None = None) -> Levels:
        """Levels to train on: :attr:`levels`, or of another seed or number those of the distribution. Raises as
        :meth:`Suite.sample`."""
        if seed == self.seed and n in (None, len(self.levels)):
            return self.levels
        return self.train.sample(self.training_levels if n is None else n, seed=seed)


_tests_are_hidden = False


def hide_tests() -> None:
    """From here on, this process reads no suite: it acts for a method, which sees training sides alone."""
    global _tests_are_hidden
    _tests_are_hidden = True


@cache
def suite(name: str) -> Suite:
    """The suite of that name, see :func:`suites`.

    Raises:
        SuiteError: there is no such suite, or a file of it is not what it was when the suite was frozen.
    """
    if name not in suites():
        hint = did_you_mean(str(name), suites())
        if str(name).endswith(SUFFIX) or "/" in str(name):
            hint = f" A suite in a file is read by segar.suites.read_suite({str(name)!r})."
        raise SuiteError(f"there is no suite '{name}'.{hint}")
    return read_suite(DATA / f"{name}{SUFFIX}")


def outline(name: str) -> dict[str, Any]:
    """What the file of a suite says, as data and before any hash is compared; raises :class:`SuiteError`."""
    return _read(DATA / f"{name}{SUFFIX}")


def read_suite(path: str | PathLike[str]) -> Suite:
    """The suite of a file, whose levels lie beside it; so may its plans.

    The file is data: distributions are read as text of constructors, rules by their names in :data:`segar.suites.RULES`, and
    nothing in it is imported or called.

    Raises:
        SuiteError: the file is no suite, or something in it or beside it has another hash than it says; or this process acts
            for a method, see :func:`hide_tests`.
    """
    path = Path(path)
    found = _read(path)
    hidden = tuple(_factor(path, name) for name in found["hidden"])
    given = {side: distribution_of(path, found, side) for side in SIDES}
    with naming(path, SuiteError):
        levels = Levels.load(path.with_suffix(LEVELS), world=given["test"].world)
    hashes = {
        "train": given["train"].hash,
        "test": given["test"].hash,
        "levels": hash_of_levels(levels),
        "plans": found["hashes"]["plans"],
    }
    hashes["suite"] = suite_hash(found, hashes)
    for what in HASHED:
        if hashes[what] != found["hashes"][what]:
            raise SuiteError(_changed(path, what, hashes[what], found["hashes"][what]))
    task = task_from(path, found["task"]["name"], found["task"]["options"])
    file = path.with_suffix(PLANS)
    search = partial(_plans_again, path, given["test"], len(levels), task)
    return Suite(
        **{key: found[key] for key in ("name", "axis", "shift", "says", "training_levels", "unsolved")},
        train=given["train"],
        test=given["test"],
        test_levels=levels,
        find_plans=partial(_plans_in, file) if file.exists() else search,
        task=task,
        hidden=hidden,
        textures=tuple(found["textures"]),
        hash=hashes["suite"],
        hashes=MappingProxyType({what: value for what, value in hashes.items() if what != "suite"}),
    )


_WHERE = {
    "train": "the training distribution, [train]",
    "test": "the test distribution, [test]",
    "levels": "the file of test levels beside it",
    "plans": "what the planner finds, or the file of plans beside it,",
    "suite": "the description (name, axis, shift, task, hidden, training_levels or rules)",
}


def _changed(where: object, what: str, here: str, there: str) -> str:
    """What is said of a part whose hash is another one."""
    return (
        f"{where}: {_WHERE[what]} is not what was frozen: its hash is {here}, and the suite says {there}. Results on it compare"
        " with no others; an edited suite gets a name and a version of its own, and hashes of its own"
    )


def _plans_in(path: Path) -> Plan:
    with naming(path, SuiteError):
        return Plan.load(path)


def _plans_again(path: Path, test: LevelDistribution, number: int, task: Task) -> Plan:
    return solved_levels(path, test, number, task, SAMPLES, ITERATIONS)[1]


def solved_levels(
    path: Path, test: LevelDistribution, number: int, task: Task, samples: int, iterations: int
) -> tuple[Levels, Plan, int]:
    """The first levels that the planner solves, their plans, and how many others it met before the last of them."""
    levels = test.sample(number + number // 4 + 1, seed=TEST_SEED, split="test")
    rng = np.random.default_rng(SEARCH)
    plans = plan(levels, task, rng=rng, samples=samples, iterations=iterations)
    chosen = np.flatnonzero(plans.solved)[:number]
    if len(chosen) < number:
        raise SuiteError(
            f"{path}: the planner solves only {len(chosen)} of {len(levels)} levels of the test; choose a distribution whose"
            " levels can be solved, or a larger search: samples, iterations"
        )
    return levels[chosen], plans[chosen], int(chosen[-1]) + 1 - number


_SIDE = {"rules": str, "distribution": str}
_FORM = {
    "format": int,
    "name": str,
    "axis": str,
    "shift": str,
    "says": str,
    "training_levels": int,
    "test_levels": int,
    "hidden": [str],
    "textures": [str],
    "unsolved": int,
    "task": {"name": str, "options": {str: (bool, int, float, str)}},
    "train": _SIDE,
    "test": _SIDE,
    "hashes": dict.fromkeys(HASHED, str),
}


def suite_hash(description: Mapping[str, Any], hashes: Mapping[str, str]) -> str:
    """Sixteen digits of all that a result depends on: the description, and the hashes of distributions, levels and plans."""
    parts = {
        key: description[key]
        for key in ("name", "axis", "shift", "training_levels", "hidden", "textures", "unsolved", "task")
    }
    parts |= {"rules": [description[side]["rules"] for side in SIDES]}
    parts |= {"hashes": [hashes[what] for what in HASHED[:-1]]}
    text = json.dumps(parts, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]


def _read(path: Path) -> dict[str, Any]:
    """The description in a file, of which all keys and kinds of values are right."""
    if _tests_are_hidden:
        raise SuiteError(
            f"{path.stem}: a policy sees the training side of a suite alone, which its function is given; no test can be read"
            " in its process"
        )
    found = data_in(path, "a suite", SuiteError, lambda text: tomllib.loads(text.decode()), LONGEST, _FORM, only=True)
    if found["format"] != FORMAT:
        raise SuiteError(f"{path}: format {found['format']} is not the one that this version reads, {FORMAT}")
    known = (("name", [path.stem]), ("axis", AXES), ("task.name", TASKS), ("train.rules", RULES), ("test.rules", RULES))
    for key, names in known:
        value = found
        for part in key.split("."):
            value = value[part]
        if value not in names:
            raise SuiteError(f"{path}: {key}: '{value}' is not known here.{did_you_mean(str(value), names)}")
    if found["textures"] and (len(found["textures"]) != 2 or not set(found["textures"]) <= set(LOOKS)):
        raise SuiteError(f"{path}: textures must be none or two of {', '.join(LOOKS)}, not {found['textures']}")
    if found["training_levels"] < 1:
        raise SuiteError(f"{path}: training_levels must be 1 or more, not {found['training_levels']}")
    return found


def distribution_of(path: Path, found: Mapping[str, Any], side: str) -> LevelDistribution:
    """The distribution that a description has for training or test."""
    origin = dataclasses.replace(family("empty-hard"), task=found["task"]["name"])  # its names are SEGAR's alone
    with naming(f"{path}: [{side}]", SuiteError):
        read = read_distribution(found[side]["distribution"], origin)
        return dataclasses.replace(read, name=f"{found['name']}-{side}", world=rules_of(found[side]["rules"]))


def task_from(path: Path, name: str, options: Mapping[str, Any]) -> Task:
    """The built-in task of this name with these options; raises :class:`SuiteError` where there is none, or it does not take
    them."""
    with naming(f"{path}: task", SuiteError):
        return make_task(name, options, trusted=())


def _factor(path: Path, name: str) -> type[Factor]:
    known = {kind.__name__: kind for kind in all_subclasses(Factor) if kind.__module__.startswith("segar.")}
    if name not in known:
        raise SuiteError(f"{path}: hidden: no factor is called '{name}'.{did_you_mean(name, known)}")
    return known[name]


def hash_of_plans(plans: Plan) -> str:
    """Sixteen digits of what certifies the plans: the actions, and what they come to."""
    found = hashlib.sha256(f"{plans.task} {plans.seed}".encode())
    for array in (plans.solved, plans.died, plans.steps, plans.returns, plans.actions, plans.values):
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:HASH_DIGITS]
