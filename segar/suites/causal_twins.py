"""Causal twins: test levels of a suite, each with one thing set as a training level has it, so that failures have causes."""

import dataclasses
import hashlib
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from segar.errors import SuiteError, did_you_mean
from segar.hardness import PLAN_ARRAYS, Plan, plan, replay
from segar.language import Position
from segar.levels import (
    ENTITIES,
    LEVEL_ARRAYS,
    Levels,
    drawn_mechanisms,
    hash_of_levels,
    mechanisms,
    set_as,
    with_mechanisms,
    with_room,
)
from segar.suites.suite_file import HASH_DIGITS, Suite
from segar.support import counted, is_whole

PLACE, KINDS, RULES_GROUP, LOOK, OTHERS, ALL_THAT_DIFFERS = "place", "entities", "rules", "look", "others", "all"
"""Names of groups; any other group has the name of its factor or world parameter."""
NAMES = {Position.__name__: PLACE, ENTITIES: KINDS, "World": RULES_GROUP}
SAYS = {
    PLACE: "where things are",
    KINDS: "how many things there are, and of which types",
    RULES_GROUP: "the rules and their constants",
    LOOK: "the textures",
    OTHERS: "all other factors that vary",
    ALL_THAT_DIFFERS: "all that differs between training and test",
}
Part = TypeVar("Part", Levels, Plan)
SPLIT = "twins"  # of the levels that give factors
BLOCK, MOST_BLOCKS = 512, 40  # levels that give factors, drawn at once; and how often
MOST_TRIES = 40  # levels that are tried as a twin of one level
SEARCHES = ((8, 1), (64, 5), (128, 10))  # samples and iterations of the planner; the next one where no plan was found


@dataclass(frozen=True, eq=False, repr=False)
class Twin:
    """Twins of all test levels in one group of factors; arrays lead with the test level.

    Attributes:
        group: such as ``"place"`` or ``"Mass"``. says: what it is, in words.
        differs: whether training and test differ in it; where they do not, its twins show what chance does.
        levels: twin i is of test level i; where there is none, it is the test level itself.
        found: bool ``(n,)``, whether there is a twin: another level, which the planner solves.
        plans: the episodes that certify that.
        textures: the set of textures that the twin is seen in; empty where any observation will do.
    """

    group: str
    says: str
    differs: bool
    levels: Levels
    found: np.ndarray
    plans: Plan
    textures: str = ""

    def __repr__(self) -> str:
        kind = "differs" if self.differs else "a control"
        return f"<twins in {self.group}, {kind}: {int(self.found.sum())} of {len(self.found)} levels>"


@dataclass(frozen=True, eq=False, repr=False)
class Twins:
    """The twins of a suite.

    Attributes:
        suite: whose they are. seed: of the draws.
        test_levels: the levels that have twins.
        groups: first those in which training and test differ.
    """

    suite: Suite
    seed: int
    test_levels: Levels
    groups: tuple[Twin, ...]

    def __repr__(self) -> str:
        text = ", ".join(f"{one.group} ({int(one.found.sum())})" for one in self.groups)
        return f"<twins of {counted(len(self.test_levels), 'level')} of {self.suite.name}: {text}; {self.hash}>"

    def __getitem__(self, group: str) -> Twin:
        """The twins of a group; raises :class:`SuiteError` that names those that there are."""
        known = {one.group: one for one in self.groups}
        if group not in known:
            raise SuiteError(f"{self.suite.name} has no twins in '{group}'.{did_you_mean(str(group), known)}")
        return known[group]

    @property
    def differing(self) -> tuple[str, ...]:
        """The groups in which training and test differ; none where the test asks for more of the same."""
        return tuple(one.group for one in self.groups if one.differs)

    @property
    def note(self) -> str:
        """What a reader has to know of suites whose training and test levels have one distribution, or that have no twin; empty
        for others."""
        if not any(one.found.any() for one in self.groups):
            return f"no level of {self.suite.name} has a twin: the planner solved no draw, or the task says of none 'success'"
        if self.differing:
            return ""
        return (
            f"training and test levels of {self.suite.name} have one distribution: no factor differs, and all twins are"
            " controls. A failure on its test comes from the levels that were trained on, not from a factor"
        )

    @cached_property
    def hash(self) -> str:
        """Sixteen digits of all twins; equal where they are equal to the bit."""
        found = hashlib.sha256(f"{self.suite.hash} {self.seed}".encode())
        for one in self.groups:
            found.update(f"{one.group} {one.textures} {hash_of_levels(one.levels)}".encode() + one.found.tobytes())
        return found.hexdigest()[:HASH_DIGITS]

    def replayed(self, group: str) -> np.ndarray:
        """Whether the plan of each twin of a group, played again, gives what it says, to the bit; bool ``(n,)``."""
        one = self[group]
        return one.plans.solved & replay(one.levels, one.plans, self.suite.task)


def twins(suite: Suite, *, seed: int = 0, n: int | None = None, groups: Sequence[str] | None = None) -> Twins:
    """The twins of the test levels of a suite: each differs from its level in one group of factors, and in nothing else.

    That group is set as a training level has it: its mechanism is that of the training distribution, and all other
    mechanisms are those of the test. Entities of the same types give the values, jointly within the group. A twin is kept
    if things fit where they are, and if the planner solves it; else another draw is tried.

    Groups are those in which training and test differ, one for each factor or parameter, then, where there are several,
    all of them together; and as controls, which training and test draw alike, ``place``, ``entities`` and all ``others``. A
    failure on a level that is none on a control is chance, not a cause.

    Everything follows from suite and seed, so twins are made anew instead of being stored; ``hash`` says whether two
    programs have the same ones. It takes some seconds.

    Args:
        n: of how many test levels the twins are kept, the first ones; all where it is None. Fewer are the first of more.
        groups: the names of those that are wanted; all where it is None.

    Raises:
        SuiteError: there is no such group, or ``n`` is out of range.
    """
    most = len(suite.test_levels)
    if n is not None and (not is_whole(n) or not 1 <= n <= most):
        raise SuiteError(f"twins of {suite.name}: n must be 1 to {most}, the number of test levels, not {n!r}")
    known = _groups(suite)
    for name in () if groups is None else groups:
        if name not in known:
            raise SuiteError(f"{suite.name} has no twins in '{name}'.{did_you_mean(str(name), known)}")
    made = []
    for name, (factors, differs) in known.items():
        if groups is None or name in groups:
            made.append(_look(suite) if name == LOOK else _twin(suite, name, factors, differs, seed))
    count = most if n is None else int(n)
    return Twins(suite, seed, suite.test_levels[:count], tuple(_first(one, count) for one in made))


def groups_in_words(suite: Suite) -> dict[str, str]:
    """Name of each group in which training and test of a suite differ, and what it is; none for one distribution."""
    return {name: _in_words(suite, name) for name, (_, differs) in _groups(suite).items() if differs}


def _in_words(suite: Suite, group: str) -> str:
    kind = "factor" if group in suite.test.layout.by_name else "world parameter"
    return SAYS.get(group, f"the {kind} {group}")


def _groups(suite: Suite) -> dict[str, tuple[tuple[str, ...], bool]]:
    """Name of each group to its mechanisms and whether training and test differ in it."""
    of_train, of_test = mechanisms(suite.train), mechanisms(suite.test)
    differing = [name for name in of_test if of_test[name] != of_train.get(name)]
    found: dict[str, tuple[tuple[str, ...], bool]] = {NAMES.get(name, name): ((name,), True) for name in differing}
    if len(differing) > 1:
        found[ALL_THAT_DIFFERS] = (tuple(differing), True)
    if suite.textures and suite.textures[0] != suite.textures[1]:
        found[LOOK] = ((), True)
    drawn = drawn_mechanisms(suite.test) - set(differing)
    for name in NAMES:
        if name in drawn:
            found[NAMES[name]] = ((name,), False)
    others = tuple(sorted(drawn - set(NAMES)))
    return found | ({OTHERS: (others, False)} if others else {})


def _first(one: Twin, count: int) -> Twin:
    """The twins of the first test levels."""
    plans = one.plans[np.arange(count)]
    return dataclasses.replace(one, levels=one.levels[:count], found=one.found[:count], plans=plans)


def _look(suite: Suite) -> Twin:
    """The same levels in the textures of training."""
    every = np.ones(len(suite.test_levels), np.bool_)
    return Twin(LOOK, SAYS[LOOK], True, suite.test_levels, every, suite.plans, suite.textures[0])


def _twin(suite: Suite, group: str, names: tuple[str, ...], differs: bool, seed: int) -> Twin:
    """The twins in one group: draws are tried until the planner solves one, level by level."""
    donors = _Donors(suite, names, seed)
    rng = np.random.default_rng([seed, *group.encode()])
    levels, min_distance = suite.test_levels, donors.distribution.min_distance
    n = len(levels)
    found, left = np.zeros(n, np.bool_), np.arange(n)
    made: Levels | None = None
    plans = _no_plans(levels, suite)
    for _ in range(MOST_TRIES):
        taken, given = donors.next_for(levels[left])
        left = left[taken]  # no more entities of these types come
        if not len(left):
            break
        tried, fits = set_as(levels[left], given, names, min_distance)
        if fits.any():
            rows, tried = left[fits], tried[np.flatnonzero(fits)]
            certified = _certified(tried, suite, rng)
            solved = np.flatnonzero(certified.solved)
            made = _like(levels, tried) if made is None else made
            if len(solved):
                made = _put(made, LEVEL_ARRAYS, rows[solved], tried[solved])
                plans = _joined(plans, rows[solved], certified[solved])
                found[rows[solved]] = True
        left = left[~found[left]]
        if not len(left):
            break
    says = _in_words(suite, group)
    textures = suite.textures[1] if suite.textures else ""
    return Twin(group, says, differs, levels if made is None else made, found, plans, textures)


class _Donors:
    """Levels that give factors: the test distribution with some mechanisms of training, each level given once.

    Unless entities themselves are set, a level gets factors from one whose entities have the same types.
    """

    def __init__(self, suite: Suite, names: tuple[str, ...], seed: int) -> None:
        self.distribution = with_mechanisms(suite.test, suite.train, names)
        self.seed, self.blocks = seed, 0
        self.by_types = not {ENTITIES, "World"} & set(names) and any(n in suite.test.layout.by_name for n in names)
        self.waiting: dict[bytes, list[int]] = {}
        self.levels: Levels | None = None

    def next_for(self, levels: Levels) -> tuple[np.ndarray, Levels]:
        """Which of the levels get one, bool ``(n,)``, and those that these get."""
        keys = [row.tobytes() if self.by_types else b"" for row in levels.types]
        while self.blocks < MOST_BLOCKS and any(keys.count(key) > len(self.waiting.get(key, ())) for key in set(keys)):
            self._draw()
        chosen = [self.waiting[key].pop(0) if self.waiting.get(key) else -1 for key in keys]
        taken = np.array(chosen) >= 0
        assert self.levels is not None
        return taken, self.levels[np.array(chosen)[taken]]

    def _draw(self) -> None:
        start, self.blocks = self.blocks * BLOCK, self.blocks + 1
        self.levels = self.distribution.sample(start + BLOCK, seed=self.seed, split=SPLIT)
        for k, row in enumerate(self.levels.types[start:], start):
            self.waiting.setdefault(row.tobytes() if self.by_types else b"", []).append(k)


def _certified(levels: Levels, suite: Suite, rng: np.random.Generator) -> Plan:
    """Plans for levels, of larger and larger searches where smaller ones find none."""
    best, left = None, np.arange(len(levels))
    for samples, iterations in SEARCHES:
        found = plan(levels[left], suite.task, rng=rng, samples=samples, iterations=iterations)
        best = found if best is None else _joined(best, left, found)
        left = np.flatnonzero(~best.solved)
        if not len(left):
            break
    assert best is not None
    return best


def _no_plans(levels: Levels, suite: Suite) -> Plan:
    """Plans of levels that nobody solved."""
    n, task = len(levels), suite.task
    never, actions = np.zeros(n, np.bool_), np.zeros((n, task.max_steps, len(task.action_low)), np.float32)
    return Plan(never, never, np.zeros(n, np.int64), np.zeros(n), actions, levels.values, task.name, 0, 0)


def _joined(plans: Plan, rows: np.ndarray, others: Plan) -> Plan:
    """The plans with those of ``others`` in these rows."""
    return _put(dataclasses.replace(plans, rollouts=plans.rollouts + others.rollouts), PLAN_ARRAYS, rows, others)


def _like(levels: Levels, twins: Levels) -> Levels:
    """The levels in the world of the twins, with as much room for vertices."""
    origin = dataclasses.replace(twins.provenance, indices=levels.provenance.indices)
    made = dataclasses.replace(levels, world=twins.world, provenance=origin, distribution=None)
    return with_room(made, twins)


def _put(whole: Part, names: Collection[str], rows: np.ndarray, others: Part) -> Part:
    """Levels or plans with those of ``others`` in these rows of the arrays of these names."""
    arrays = {name: getattr(whole, name).copy() for name in names}
    for name, array in arrays.items():
        array[rows] = getattr(others, name)
    return dataclasses.replace(whole, **arrays)
