"""A rule never decides by what it is traced with: Python's numbers, the interpreter and the kernel agree, or it is refused."""

import collections.abc
import contextlib
import copy
import dataclasses
import fractions
import functools
import json
import math
import numbers
import operator
import pickle
import statistics
from threading import Thread
from typing import Any, SupportsIndex, Tuple

import numpy as np
import pydantic
import pytest
from omegaconf import OmegaConf

import segar
from segar import Interpreter, Levels, RuleError, Scalar, rule
from segar.engine.simulator import Simulator
from segar.errors import PriorError
from segar.language import Number, exp, sin, sqrt, value_rule, where
from segar.language.symbols import deciding_by, make, walk
from segar.levels.conditional import Dependent
from tests.segar.engine.worlds import start, uncompiled

TABLE = {0.0: 3.0, 1.0: 5.0, 2.0: 7.0}
WITH_DEFAULT = collections.defaultdict(float, TABLE)
VALUES = (0.0, -0.0, 0.5, 1.0, 1.5, 2.0, 3.0, -1.0, 1e-9, 4.25)


class Settings:
    """An author's own object, of which rules use a number and a method."""

    strength = 3.0

    def typed(self, x):
        """Not the same for a symbol."""
        return 1.0 if type(x) is float else 2.0

    @classmethod
    def read(cls):
        """What no rule names may be written in any way."""
        try:
            return type(cls)
        except KeyError:
            return None


SETTINGS = Settings()


@dataclasses.dataclass(frozen=True, slots=True, order=True)
class Data:
    """What Python writes for it, such as its repr, asks for classes and uses 'is'."""

    rate: float = 0.5

    def twice(self, m):
        return 2 * m

    @property
    def half(self):
        return self.rate / 2


DATA = Data()


class Model(pydantic.BaseModel):
    rate: float = 0.5


MODEL, CONFIG = Model(), OmegaConf.create({"rates": [0.5]})


class Strict:
    """An object without attributes that refuses to be asked for one."""

    __slots__ = ()

    def __getattr__(self, name):
        raise ZeroDivisionError

    def __call__(self, m):
        return m + 1.0


STRICT = Strict()


@functools.lru_cache
def cached(x):
    """Twice x."""
    return 2.0 * x


@functools.singledispatch
def dispatched(x):
    """One for what is no number."""
    return 1.0


@dispatched.register
def _(x: float):
    return x


def caught(m):
    try:
        return float(m)
    except TypeError:
        return 0.0


def suppressed(m):
    with contextlib.suppress(Exception):
        return round(m)
    return 1.0


def matched_literal(m):
    match m:
        case 1.0:
            return 5.0
        case float():
            return 6.0
    return 7.0


def matched_type(m):
    match m:
        case int():
            return 5.0
        case str() | None:
            return 6.0
    return 7.0


def matched_truth(m):
    match m > 1:
        case True:
            return 5.0
    return 7.0


def of_truth(truth):
    return 1.0 if truth else 0.0


RIGHT = {
    "in a tuple": lambda m: of_truth(m in (1.0, 2.0)),
    "in a range": lambda m: of_truth(m in range(3)),
    "isinstance float": lambda m: of_truth(isinstance(m, float)),
    "isinstance int": lambda m: of_truth(isinstance(m, int)),
    "isinstance of several": lambda m: of_truth(isinstance(m, int | float)),
    "isinstance of a number": lambda m: of_truth(isinstance(m, numbers.Real)),
    "isinstance bool": lambda m: of_truth(isinstance(m > 1, bool)),
    "is None": lambda m: of_truth(m is None) + of_truth(m is not None),
    "match a literal": matched_literal,
    "match a type": matched_type,
    "singledispatch": lambda m: dispatched(m),
    "a cache of constants": lambda m: cached(2.0) * m,
    "an object's number": lambda m: SETTINGS.strength * m,
    "settings of libraries": lambda m: MODEL.rate * m + CONFIG.rates[0],
    "an object that refuses": lambda m: STRICT(m),
    "a dataclass": lambda m: DATA.rate * m + DATA.twice(m) + DATA.half,
    "a number of numpy": lambda m: np.float64(2.0) * m,
    "sorted": lambda m: sorted([m, 1.0, 2.5])[1],
    "min and max": lambda m: min(m, 1.0) + max([m, 1.0, 2.0]),
    "sum and product": lambda m: sum([m, 1.0]) + math.prod([m, 2.0]),
    "reduce": lambda m: functools.reduce(operator.add, [m, m]),
    "any": lambda m: of_truth(any(m == k for k in (1, 2))),
    "count": lambda m: [1.0, 2.0].count(m) * 1.0,
    "index": lambda m: [1.0, 2.0, m].index(m) * 1.0,
    "or": lambda m: m or 3.0,
    "not": lambda m: of_truth(not m),
    "hasattr": lambda m: of_truth(hasattr(m, "is_integer")),
    "hasattr of a container": lambda m: of_truth(hasattr(m, "__iter__") or hasattr(m, "__len__")),
    "isinstance of a container": lambda m: of_truth(isinstance(m, collections.abc.Iterable | collections.abc.Sized)),
    "a fraction": lambda m: fractions.Fraction(1, 2) * m,
    "sum of truths": lambda m: (m > 1) + (m > 2),
    "difference of truths": lambda m: (m > 1) - (m > 2),
    "negative truth": lambda m: -(m > 1),
    "a truth as a number": lambda m: (m > 1) * 2.0,
    "a power of a truth": lambda m: (m > 1) ** 2,
    "abs of a truth": lambda m: abs(m > 1),
    "a part of a truth": lambda m: (m > 1) / 2,
    "equal truths": lambda m: of_truth((m > 1) == (m > 2)),
    "ordered truths": lambda m: of_truth((m > 1) < (m > 0)),
    "a count of truths": lambda m: True + (m > 1) + (m > 2) + (m > 3),
    "a root of a truth": lambda m: sqrt(m > 1) * 0.1,
    "a quotient by a choice": lambda m: 1.0 / (1.0 / where(m > 1, 1.0, 0.0)),
    "a quotient by a function": lambda m: 1.0 / (1.0 / exp(-1000.0 - m)),
    "a truth and a truth": lambda m: of_truth((m > 1) & (m < 2) | (m == 3)),
}

REFUSED = {
    "in a set": lambda m: of_truth(m in {1.0, 2.0}),
    "in a dictionary": lambda m: of_truth(m in TABLE),
    "a default": lambda m: WITH_DEFAULT[m],
    "hash": lambda m: of_truth(hash(m) == 1),
    "str": lambda m: of_truth(str(m) == "1.0"),
    "repr": lambda m: of_truth(repr(m) == "1.0"),
    "format": lambda m: of_truth(f"{m:.1f}" == "1.0"),
    "type is": lambda m: of_truth(type(m) is float),
    "class": lambda m: of_truth(m.__class__ == float),  # noqa: E721
    "id": lambda m: id(m) % 2 * 1.0,
    "is": lambda m: of_truth(m is SETTINGS.strength),
    "is_ of operator": lambda m: of_truth(operator.is_not(m > 1, True)),
    "match a truth": matched_truth,
    "a method that asks for a type": lambda m: SETTINGS.typed(m),
    "try": caught,
    "suppress": suppressed,
    "int": lambda m: int(m) * 1.0,
    "float": lambda m: float(m),
    "int of a truth": lambda m: int(m > 1) * 1.0,
    "round": lambda m: round(m) * 1.0,
    "floor": lambda m: math.floor(m) * 1.0,
    "mod": lambda m: m % 2,
    "is_integer": lambda m: of_truth(m.is_integer()),
    "imag": lambda m: of_truth(m.imag == 0),
    "isnan": lambda m: of_truth(math.isnan(m)),
    "length": lambda m: len(m),
    "has an index": lambda m: of_truth(hasattr(m, "__index__")),
    "is an array": lambda m: of_truth(hasattr(m, "__array__")),
    "isinstance of an index": lambda m: of_truth(isinstance(m, SupportsIndex)),
    "a place": lambda m: [1.0, 2.0][m],
    "None": lambda m: of_truth(m == None),  # noqa: E711
    "a text": lambda m: of_truth(m != "x"),
    "copy": lambda m: copy.copy(m),
    "pickle": lambda m: of_truth(pickle.dumps(m) == b""),
    "json": lambda m: of_truth(json.dumps(m) == "1.0"),
    "mean": lambda m: statistics.mean([m, 1.0]),
    "numbers and truths": lambda m: of_truth(m & True),
    "an array": lambda m: np.array([m, 1.0]).sum(),
    "in an array": lambda m: of_truth(m in np.array([1.0, 2.0])),
    "numpy catches": lambda m: of_truth(np.array_equal([m], [1.0])),
    "numpy's where": lambda m: np.where(m > 1, 1.0, 0.0),
    "a ufunc": lambda m: np.floor(m),
}


def own(name: str, function: Any) -> tuple[type[Scalar], Any]:
    """A factor, and a rule that sets it to the function's value."""
    factor = type(Scalar)("Out" + "".join(filter(str.isalnum, name.title())), (Scalar,), {"__module__": __name__})

    def sets(m: segar.Charge, old: factor) -> segar.SetFactor[factor]:  # type: ignore[valid-type]
        return segar.SetFactor[factor](old, function(m))

    return factor, rule(sets)


@pytest.mark.parametrize("simulator", [uncompiled, pytest.param(Simulator, marks=pytest.mark.compiled)])
def test_what_is_not_refused_is_the_same_in_the_kernel_in_the_interpreter_and_in_python(simulator):
    outs = {name: own(name, function) for name, function in RIGHT.items()}
    kind = type("Thing", (segar.Ball,), {"__annotations__": {f"out{n}": f for n, (f, _) in enumerate(outs.values())}})
    rng = np.random.default_rng(0)
    charges = [*VALUES, *rng.uniform(-1.0, 4.0, 10)]
    levels = Levels.from_entities([[kind({segar.Charge: m, segar.Position: (0.0, 0.0)})] for m in charges])
    task = segar.Task("idle", act=idle)
    world = segar.World(rules=[made for _, made in outs.values()])
    state, columns = start(levels), levels.layout.columns
    simulator(world, levels.layout, task).step(state, levels)
    interpreter = Interpreter(world, levels.layout, task)
    for n, charge in enumerate(charges):
        np.testing.assert_array_equal(interpreter.step(levels, n).values, state.values[n])
        for name, (factor, _) in outs.items():
            assert state.values[n, 0, columns[factor]] == RIGHT[name](float(charge)), (name, charge)


@pytest.mark.parametrize("name", RIGHT)
def test_a_distribution_computes_the_same(name):
    def shift(m: segar.Charge) -> float:
        return RIGHT[name](m)

    found, _ = Dependent(segar.UniformNoise(0, 1), shift).shift_and_scale(lambda *_: np.array(VALUES), len(VALUES))
    np.testing.assert_allclose(found, [float(RIGHT[name](m)) for m in VALUES], rtol=1e-14)


def idle(v: segar.Velocity, action: segar.Action) -> segar.SetFactor[segar.Velocity]:
    return segar.SetFactor[segar.Velocity](v, (action[0], action[1]))


@pytest.mark.parametrize("name", REFUSED)
def test_what_would_be_decided_once_is_refused_with_its_line(name):
    line = r"\.py:\d+\) \(line \d+: `.+`\): .*(not known while|rule cannot|rule computes|cannot be combined)"
    line += r"|JSON serializable|'&' and '\|'|has no len\(\)"
    with pytest.raises(RuleError, match=line):
        own(name, REFUSED[name])


def reads_a_set_of_labels(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
    return 1.0 if o1[0] in {"ball"} else 0.0


def starts_with(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
    return 1.0 if o1[0].startswith("ba") else 0.0


def shows_a_label(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
    return 1.0 if f"{o1[0]}" == "ball" else 0.0


def has_a_label(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
    return 1.0 if o1[0] else 0.0


def compares_labels(o1: Tuple[segar.language.Label], o2: Tuple[segar.language.Label]) -> float:
    return 1.0 if o1[0] == o2[0] else 0.0


def compares_a_label_with_a_number(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
    return 1.0 if o1[0] == 3 else 0.0


def asks_what_an_entity_is(thing: segar.language.Object) -> float:
    return 1.0 if isinstance(thing, segar.Ball) else 0.0


def compares_an_action(mass: segar.Mass, action: segar.Action) -> float:
    return 1.0 if action == (0.0, 0.0) else 0.0


def counts_an_action(mass: segar.Mass, action: segar.Action) -> float:
    return 1.0 if len(action) == 2 else 0.0


@pytest.mark.parametrize(
    "function",
    [
        *(reads_a_set_of_labels, starts_with, shows_a_label, has_a_label, compares_labels),
        *(compares_a_label_with_a_number, asks_what_an_entity_is, compares_an_action, counts_an_action),
    ],
)
def test_texts_entities_and_actions_are_refused_where_their_value_is_asked_for(function):
    with pytest.raises(RuleError, match=rf"{function.__name__}.*line \d+.*not known while the rule is compiled"):
        value_rule(function, truth=False)


def test_a_label_can_be_looked_for_in_a_tuple():
    def counted(o1: Tuple[segar.language.Label, segar.Mass]) -> float:
        return 1.0 if isinstance(o1[0], str) and o1[0] in ("ball", "cueball") else 0.0

    assert value_rule(counted, truth=False).tree


def test_another_thread_compiles_while_a_rule_is_traced():
    symbol, seen = make("parameter", segar.Gravity), []
    with deciding_by(lambda _: True), pytest.raises(RuleError, match="sets, keys and caches"):
        thread = Thread(target=lambda: seen.append({symbol: 1}))
        thread.start()
        thread.join()
        assert len(seen) == 1
        hash(symbol)


def test_operands_come_before_what_is_computed_of_them_each_once():
    x = make("parameter", segar.Gravity)
    for _ in range(5000):
        x = x + 0.5 * x
    order = walk(x)
    place = {symbol: n for n, symbol in enumerate(order)}
    assert len(order) == len(place) == 10002
    assert all(place[a] < n for n, symbol in enumerate(order) for a in symbol.args if a in place)
    assert pickle.loads(pickle.dumps(x)) is x
    assert Number(1.0) == 1.0


def unrolled(steps: int, step: Any) -> Any:
    """A rule that takes this many steps."""

    def relax(c: segar.Charge) -> segar.SetFactor[segar.Charge]:
        x = c
        for _ in range(steps):
            x = step(x)
        return segar.SetFactor[segar.Charge](c, x)

    return rule(relax)


def test_a_rule_with_two_thousand_steps_runs_alike_in_the_kernel_and_in_the_interpreter():
    world = segar.World(rules=[unrolled(2000, lambda x: x + 0.001 * (2.0 - x))])
    levels = segar.family("empty-hard").sample(2, seed=0)
    state = start(levels)
    uncompiled(world, levels.layout).step(state, levels)
    np.testing.assert_array_equal(state.values[1], Interpreter(world, levels.layout).step(levels, 1).values)


def test_a_rule_that_would_compile_for_minutes_is_refused_with_its_name_and_the_limit():
    layout = segar.family("empty-hard").layout
    for slow in (unrolled(6000, lambda x: x * x + 0.5), unrolled(400, sin)):
        with pytest.raises(RuleError, match=r"relax .*test_values.* has 12,\d+ operations .* at most 10,000 of a rule"):
            Simulator(segar.World(rules=[slow]), layout)


def test_a_distribution_refuses_an_expression_that_it_cannot_write():
    def weight(size: segar.Size) -> float:
        x = size
        for _ in range(60):
            x = x + 0.5 * x
        return x

    def is_large(size: segar.Size) -> bool:
        return weight(size) > 1.0

    with pytest.raises(PriorError, match=r"weight .*operations where its loops are written out.* at most 400"):
        Dependent(segar.UniformNoise(0.0, 1.0), scale=weight)
    with pytest.raises(PriorError, match=r"Prior\(Mass, ...\): is_large has .* at most 400"):
        segar.Prior(segar.Mass, 1.0, relation=is_large)


def test_a_vector_of_the_same_type_can_be_made_and_long_expressions_have_a_short_text():
    def turned(v: segar.Velocity) -> segar.SetFactor[segar.Velocity]:
        return segar.SetFactor[segar.Velocity](v, type(v)(-v.y, v.x))

    assert rule(turned).tree
    one, other = (unrolled(2000, lambda x, rate=rate: x + rate * (2.0 - x)) for rate in (0.001, 0.002))
    assert repr(one.tree) != repr(other.tree)
    assert len(repr(one.tree)) < 20_000
