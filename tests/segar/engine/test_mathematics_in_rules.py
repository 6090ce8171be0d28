"""Elementary functions in rules: kernels and the interpreter compute the same bits, and kernels import what they call."""

from typing import Tuple

import numpy as np
import pytest

import segar
from segar.engine import Simulator, generate
from segar.language import Number, arctan2, cos, exp, hypot, log, make, sin, tan, tanh
from segar.reference.interpreter import Interpreter, keyed_uniform
from segar.support import keyed_uniform as compiled_uniform
from tests.segar.engine.worlds import start

LEVELS = segar.family("empty-hard").sample(20, seed=0)
FUNCTIONS = "arctan2, cos, exp, hypot, log, pow, sin, tan, tanh"


@segar.rule
def mix(own: Tuple[segar.Position, segar.Charge]) -> segar.SetFactor[segar.Charge]:
    """Every function and every kind of power."""
    x, old = own
    total = exp(-hypot(x.x, x.y)) + sin(3.0 * x.x) * cos(7.0 * x.y) + tan(x.x) * tanh(x.y) + arctan2(x.y, x.x)
    total += log(2.0 + x.x) + abs(x.y) ** 1.7 + (2.0 + x.x) ** -1 + x.x**2 + abs(x.x) ** 0.5 + x.y**1 + 2.0**x.y
    return segar.SetFactor[segar.Charge](old, total + abs(x.x) ** (1.0 + abs(x.y)) + segar.random.normal(0.0, 0.1))


def test_a_kernel_and_the_interpreter_compute_the_same_bits():
    world, state = segar.World((mix,)), start(LEVELS)
    Simulator(world, LEVELS.layout).step(state, LEVELS, 1)
    interpreter = Interpreter(world, LEVELS.layout)
    for e in range(len(LEVELS)):
        expected = interpreter.step(LEVELS, e, key=int(state.key[e])).values
        np.testing.assert_array_equal(state.values[e], expected)
    ball, column = LEVELS.layout.names.index("golfball"), LEVELS.layout.columns[segar.Charge]
    assert len(np.unique(state.values[:, ball, column])) == len(LEVELS)


@pytest.mark.parametrize(("rules", "names"), [((), None), ((mix,), FUNCTIONS)])
def test_a_kernel_imports_only_the_functions_that_it_calls(rules, names):
    world = segar.World((*segar.DEFAULT_RULES, *rules))
    text = generate(LEVELS.layout, world, segar.puttputt().functions()).text
    lines = [line.split("  # ")[0] for line in text.splitlines() if "segar.support.mathematics" in line]
    assert lines == ([] if names is None else [f"from segar.support.mathematics import {names}"])


def test_keyed_numbers_are_those_of_version_0_1_0():
    """Runs of another version repeat only while these stay."""
    keys = [(0, 0, 0, (0,)), (1, 0, 0, (0,)), (0, 1, 0, (0,)), (0, 0, 1, (0,)), (0, 0, 0, (1, 2, 3))]
    stored = [0.20310281705476096, 0.039922651441566814, 0.3891968432269929, 0.507910028376233, 0.5264441259812085]
    assert [keyed_uniform(*key) for key in keys] == stored


def test_random_numbers_of_kernels_are_those_of_plain_integers():
    rng = np.random.default_rng(0)
    for _ in range(200):
        key, tick, site = rng.integers(2**64, dtype=np.uint64), rng.integers(10**6), rng.integers(10**5)
        slots = [int(s) for s in rng.integers(2**15, size=3)]
        plain = keyed_uniform(int(key), int(tick), int(site), tuple(slots))
        assert compiled_uniform(key, tick, site, *slots) == plain


@pytest.mark.parametrize("exponent", [2, 2.0, 1, 0.5, -1, -1.0])
def test_literal_exponents_become_products_roots_and_quotients(exponent):
    assert (make("action", 0) ** exponent).op != "pow"
    assert float(Number(3.7) ** exponent) == pytest.approx(3.7**exponent, rel=1e-15)


def test_other_exponents_are_powers_in_the_kernel_and_in_the_interpreter():
    assert all((make("action", 0) ** exponent).op == "pow" for exponent in (3, -2, 1.5, make("action", 1)))
    # A factor whose value happens to be two is no literal: the kernel calls pow there, and so does the interpreter.
    values = np.random.default_rng(0).uniform(0.0, 10.0, 2000)
    assert any(Number(x) ** Number(0.5) != Number(x).sqrt() for x in values)
