"""What a function would read once, when it is compiled, and keep for all time is refused where the function is defined."""

import collections
import itertools
import random
import time
import types
from functools import partial

import numpy as np
import pytest

import segar
import segar.language.symbols
from segar.errors import PriorError, RuleError
from segar.language.rule_definition import rule, value_rule

RNG, PLAIN, LEGACY = np.random.default_rng(5), random.Random(5), np.random.RandomState(5)
COUNTER = itertools.count()
TIMES = 0


class Weather:
    """An object of the author's, with a generator of its own."""

    def __init__(self):
        self.rng = np.random.default_rng(5)

    def wind(self):
        """A truth that is seldom."""
        return self.rng.random() < 1e-9


class Visits:
    """An object of the author's that counts."""

    number = 0

    def seen(self):
        """How often it was asked."""
        self.number += 1
        return self.number


class Slotted:
    """An object of the author's without a dictionary."""

    __slots__ = ("number",)


WEATHER, VISITS = Weather(), Visits()
STEPS, COUNTS, LONG = (step for step in range(10**6)), np.zeros(1), [0] * 1000
SPACE, SLOTTED = types.SimpleNamespace(number=0), Slotted()
SLOTTED.number = 0


def counts_by_a_name():
    global TIMES
    TIMES += 1
    return TIMES


def counts_by_an_attribute(of):
    of.number += 1
    return of.number


def counts_in_a_long_list():
    LONG[0] += 1
    return LONG[0]


def helper():
    """A helper of the author's that draws."""
    return float(RNG.integers(10**9))


def after_many(count):
    """What two calls do not tell from a constant."""
    return 1.0 if count > 10**6 else 2.0


SOURCES = {
    "random.random": lambda: random.random(),
    "random.choice, the same": lambda: float(random.choice([1, 1])),
    "a seldom truth of random": lambda: 1.0 if random.random() < 1e-9 else 0.0,
    "a generator of Python": lambda: PLAIN.gauss(0.0, 1.0),
    "a generator of numpy": lambda: float(RNG.normal()),
    "a seldom truth of numpy": lambda: 1.0 if RNG.random() < 1e-9 else 0.0,
    "numpy's global generator": lambda: np.random.normal(),  # noqa: NPY002
    "an old generator of numpy": lambda: float(LEGACY.rand() < 1e-9),
    "a helper": helper,
    "an object's generator": lambda: 1.0 if WEATHER.wind() else 0.0,
    "a clock": time.time,
    "a fast clock": lambda: time.perf_counter(),
    "a counter": lambda: float(next(COUNTER)),
    "a list that grows": lambda rows=[]: float(len(rows.append(0) or rows)),
    "a list that grows long": lambda rows=[]: after_many(len(rows.append(0) or rows)),
    "a count in a dictionary": lambda kept={}: after_many(kept.setdefault("n", kept.pop("n", 0) + 1)),
    "a count by a name": lambda: after_many(counts_by_a_name()),
    "a count of an object": lambda: after_many(VISITS.seen()),
    "a counter that decides late": lambda: after_many(next(COUNTER)),
    "a generator": lambda: after_many(next(STEPS)),
    "a queue": lambda rows=collections.deque(): after_many(len(rows.append(0) or rows)),
    "an array": lambda: after_many(np.add(COUNTS, 1, out=COUNTS)[0]),
    "a namespace": lambda: after_many(counts_by_an_attribute(SPACE)),
    "slots": lambda: after_many(counts_by_an_attribute(SLOTTED)),
    "a long list": lambda: after_many(counts_in_a_long_list()),
}
READ_ONCE = r"draws from a generator of random numbers|computes something else when it is called again"


def states():
    """The states of all generators above."""
    generators = [RNG.bit_generator.state, WEATHER.rng.bit_generator.state, LEGACY.get_state()[2], PLAIN.getstate()]
    return repr([*generators, random.getstate(), np.random.get_state()[2]])  # noqa: NPY002


def in_a_rule(read):
    @rule
    def drift(mass: segar.Mass) -> segar.SetFactor[segar.Mass]:
        return segar.SetFactor[segar.Mass](mass, read())


def in_a_condition(read):
    @rule
    def drift(mass: segar.Mass) -> segar.SetFactor[segar.Mass]:
        return segar.SetFactor[segar.Mass](mass, 1.0) if mass > read() else None


def in_a_relation(read):
    def near(o1: tuple[segar.Position], o2: tuple[segar.Position]) -> bool:
        return abs(o1[0][0] - o2[0][0]) < read()

    segar.relation(near)


def in_a_reward(read):
    def reward(ball: segar.GolfBall) -> float:
        return ball[segar.Mass] * read()

    value_rule(reward, truth=False)


def in_a_task(read):
    def reward(ball: segar.GolfBall) -> float:
        return ball[segar.Mass] + read()

    segar.Task("odd", act=segar.puttputt().act, reward=reward).functions()


def in_a_dependent_law(read):
    def shift(mass: segar.Mass) -> float:
        return mass * read()

    segar.levels.Dependent(segar.UniformNoise(0, 1), shift=shift)


PLACES = [in_a_rule, in_a_condition, in_a_relation, in_a_reward, in_a_task, in_a_dependent_law]


@pytest.mark.parametrize("define", PLACES)
@pytest.mark.parametrize("read", SOURCES.values(), ids=SOURCES)
def test_a_function_that_reads_what_changes_is_refused_and_generators_stay(define, read):
    before = states()
    with pytest.raises((RuleError, PriorError), match=READ_ONCE):
        define(read)
    assert states() == before


def test_draws_of_our_own_and_generators_that_are_named_without_a_draw_are_allowed():
    kept = partial(lambda rng, x: x, RNG)

    @rule
    def drift(mass: segar.Mass) -> segar.SetFactor[segar.Mass]:
        return segar.SetFactor[segar.Mass](mass, kept(mass) + segar.random.normal(0.0, 1.0))

    @rule
    def jump(mass: segar.Mass) -> segar.SetFactor[segar.Mass]:
        return segar.SetFactor[segar.Mass](mass, 2.0) if segar.random.bernoulli(0.1) and mass < 1 else None


def test_a_function_with_two_modules_that_name_each_other_is_traced():
    def reward(ball: segar.GolfBall) -> float:
        return ball[segar.Mass] * (segar.language.values.math.pi if hasattr(segar, "language") else np.pi)

    value_rule(reward, truth=False)
