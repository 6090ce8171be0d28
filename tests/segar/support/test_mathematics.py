"""Elementary functions: errors against mpmath, special cases, laws to the bit, and nothing but IEEE arithmetic within."""

import hashlib
import inspect
import math
import re
import struct

import mpmath as mp
import numpy as np
import pytest
from numba import njit

from benchmarks import mathematics as bench
from benchmarks import mathematics_tables as derived
from segar.support import mathematics, mathematics_constants, mathematics_tables

LARGEST = {  # errors in units in the last place that the documentation names
    "exp": 0.55, "log": 0.55, "sin": 0.65, "cos": 0.65, "tan": 0.95, "tanh": 0.6, "pow": 0.55, "arctan2": 0.55, "hypot": 0.9,
}  # fmt: skip
INF, NAN, PI = math.inf, math.nan, math.pi
SMALLEST, NORMAL, LARGE = 5e-324, 2.0**-1022, 1.7976931348623157e308
HARD = {  # almost multiples of pi / 2; ends of ranges; neighbours of one; results that are subnormal or nearly infinite
    "exp": [(x,) for x in (708.0, 709.782712893384, -707.17207, -708.4, -720.3, -744.5, -745.1, 1e-300, 2.0**-60, 1.0, 0.5)],
    "log": [(x,) for x in (SMALLEST, NORMAL, LARGE, 1 - 2.0**-53, 1 + 2.0**-52, 0.9990234375, 1.001953125, 0.70710678)],
    "sin": [(x,) for x in (PI, 2 * PI, 22.0, 1e22, LARGE, 2.0**17, 2.0**17 - 1e-9, 5.319372648326541e255, 2.0**-28, 355.0)],
    "cos": [(x,) for x in (PI / 2, 1.5 * PI, 11.0, 1e22, LARGE, 2.0**17, 6381956970095103 * 2.0**797, 1e-9, 52174.0)],
    "tan": [(x,) for x in (PI / 2, PI / 4, PI, 1e22, LARGE, 6381956970095103 * 2.0**797, 2.0**-28, 11.0, 58818.468456834904)],
    "tanh": [(x,) for x in (0.25, 0.25 - 2.0**-55, 19.0, 20.0, 1e-300, SMALLEST, -0.3, 0.5, 18.7)],
    "pow": [(1.1, 7445.0), (0.9, 7000.0), (1 + 2.0**-52, 3e18), (SMALLEST, 0.5), (LARGE, 0.999), (2.0, -1074.0),
            (2.0, 1023.5), (3.0, 2.0), (-3.0, 3.0), (-1.5, -41.0), (0.9989248241614076, -590804.1648965054)],
    "arctan2": [(1.0, -1e300), (1e300, 1.0), (3e-310, 2e-310), (-LARGE, LARGE), (SMALLEST, LARGE), (1.0, 1.0),
                (0.125, 1.0), (-0.375, -1.0), (0.625, 1.0), (0.875, -1.0), (1.0, 1e15), (1e-20, -1.0)],
    "hypot": [(3.0, 4.0), (1e308, 1e308), (SMALLEST, SMALLEST), (3e-310, 4e-310), (LARGE, 1.0), (1e-160, 1e-170)],
}  # fmt: skip
SPECIAL = {  # C99, annex F
    "exp": [(0.0, 1.0), (-0.0, 1.0), (INF, INF), (-INF, 0.0), (NAN, NAN), (709.8, INF), (-745.2, 0.0), (LARGE, INF)],
    "log": [(0.0, -INF), (-0.0, -INF), (1.0, 0.0), (-1.0, NAN), (-SMALLEST, NAN), (INF, INF), (-INF, NAN), (NAN, NAN)],
    "sin": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (-INF, NAN), (NAN, NAN), (-SMALLEST, -SMALLEST)],
    "cos": [(0.0, 1.0), (-0.0, 1.0), (INF, NAN), (-INF, NAN), (NAN, NAN), (SMALLEST, 1.0)],
    "tan": [(0.0, 0.0), (-0.0, -0.0), (INF, NAN), (-INF, NAN), (NAN, NAN), (-SMALLEST, -SMALLEST)],
    "tanh": [(0.0, 0.0), (-0.0, -0.0), (INF, 1.0), (-INF, -1.0), (NAN, NAN), (LARGE, 1.0), (-SMALLEST, -SMALLEST)],
    "hypot": [(-INF, NAN, INF), (NAN, INF, INF), (NAN, 1.0, NAN), (0.0, -0.0, 0.0), (-3.0, 0.0, 3.0), (LARGE, LARGE, INF)],
    "arctan2": [
        (0.0, 0.0, 0.0), (-0.0, 0.0, -0.0), (0.0, -0.0, PI), (-0.0, -0.0, -PI), (0.0, -1.0, PI), (-0.0, -1.0, -PI),
        (0.0, 1.0, 0.0), (-0.0, 1.0, -0.0), (-1.0, 0.0, -PI / 2), (1.0, -0.0, PI / 2), (1.0, -INF, PI), (-1.0, -INF, -PI),
        (1.0, INF, 0.0), (-1.0, INF, -0.0), (INF, 1.0, PI / 2), (-INF, -1.0, -PI / 2), (INF, -INF, 3 * PI / 4),
        (-INF, -INF, -3 * PI / 4), (INF, INF, PI / 4), (-INF, INF, -PI / 4), (NAN, 1.0, NAN), (1.0, NAN, NAN),
    ],
    "pow": [
        (0.0, -3.0, INF), (-0.0, -3.0, -INF), (0.0, -2.5, INF), (-0.0, -2.0, INF), (0.0, -INF, INF), (0.0, 3.0, 0.0),
        (-0.0, 3.0, -0.0), (-0.0, 2.5, 0.0), (-1.0, INF, 1.0), (-1.0, -INF, 1.0), (1.0, NAN, 1.0), (1.0, -INF, 1.0),
        (NAN, 0.0, 1.0), (INF, -0.0, 1.0), (-2.0, 0.5, NAN), (-2.0, 3.0, -8.0), (-2.0, 2.0, 4.0), (0.5, -INF, INF),
        (2.0, -INF, 0.0), (-0.5, INF, 0.0), (-2.0, INF, INF), (-INF, -3.0, -0.0), (-INF, -2.0, 0.0), (-INF, 3.0, -INF),
        (-INF, 2.5, INF), (INF, -1.0, 0.0), (INF, 0.5, INF), (NAN, 1.0, NAN), (2.0, NAN, NAN), (10.0, 309.0, INF),
        (-10.0, 309.0, -INF), (10.0, -324.0, 0.0), (-10.0, -325.0, -0.0), (2.0, -1074.0, SMALLEST), (-2.0, 2.0**53, INF),
        (-1.0, 2.0**53 - 1, -1.0), (0.5, 1e300, 0.0), (1.5, 1e300, INF), (2.0, SMALLEST, 1.0),
    ],
}  # fmt: skip


def bits(x: float) -> bytes:
    """What a number is, to the sign of zero; all nan alike."""
    return b"nan" if x != x else struct.pack("<d", x)


@pytest.mark.parametrize("name", mathematics.__all__)
def test_errors_are_below_what_the_documentation_says(name):
    found = bench.errors(name, [getattr(mathematics, name)], bench.samples(name, 4000, np.random.default_rng(7)))
    assert np.isfinite(found).sum() > 3900
    assert np.nanmax(found) < LARGEST[name]


@pytest.mark.parametrize("name", mathematics.__all__)
def test_hard_arguments_are_no_worse(name):
    arguments = [np.array(x) for x in zip(*HARD[name], strict=True)]
    assert np.nanmax(bench.errors(name, [getattr(mathematics, name)], arguments)) < LARGEST[name]


@pytest.mark.parametrize(("name", "case"), [(name, case) for name, cases in SPECIAL.items() for case in cases])
def test_special_cases_are_those_of_c99(name, case):
    *arguments, result = case
    assert bits(getattr(mathematics, name)(*arguments)) == bits(result)


@pytest.mark.parametrize(("name", "sign"), [("sin", -1), ("tan", -1), ("tanh", -1), ("cos", 1)])
def test_odd_and_even_functions_are_so_to_the_bit(name, sign):
    function = getattr(mathematics, name)
    for x in [*np.random.default_rng(0).uniform(-50, 50, 500), *bench.everywhere(500, np.random.default_rng(0))]:
        assert function(-x) == sign * function(x)


def test_powers_of_one_and_of_zero_are_exact():
    for x in np.abs(bench.everywhere(2000, np.random.default_rng(1))):
        assert mathematics.pow(x, 1.0) == x and mathematics.pow(x, 0.0) == 1.0 and mathematics.pow(1.0, x) == 1.0


def test_whole_powers_that_are_floats_are_exact():
    for base in (2.0, 3.0, 5.0, 10.0, 0.5, 1.25):
        for exponent in range(1, 12):
            assert mathematics.pow(base, float(exponent)) == base**exponent
    assert [mathematics.pow(2.0, float(k)) for k in range(-1074, 1024)] == [
        math.ldexp(1.0, k) for k in range(-1074, 1024)
    ]


def test_hypot_is_symmetric_and_exact_on_the_axes():
    rng = np.random.default_rng(2)
    for x, y in zip(bench.everywhere(1000, rng), bench.everywhere(1000, rng), strict=True):
        length = mathematics.hypot(x, y)
        assert length == mathematics.hypot(y, x) == mathematics.hypot(-x, y) and length >= max(abs(x), abs(y))
        assert mathematics.hypot(x, 0.0) == abs(x)


@pytest.mark.parametrize("name", ["exp", "log", "tanh"])
def test_neighbours_keep_their_order(name):
    function, (low, high) = getattr(mathematics, name), bench.RANGES[name][0]
    for x in np.random.default_rng(4).uniform(low, high, 300):
        values = [function(x)]
        for _ in range(10):
            x = math.nextafter(x, INF)
            values.append(function(x))
        assert values == sorted(values)


def test_angles_turn_with_their_points():
    for y, x in np.random.default_rng(5).normal(size=(500, 2)):
        angle = mathematics.arctan2(y, x)
        assert mathematics.arctan2(-y, x) == -angle
        assert mathematics.arctan2(8.0 * y, 8.0 * x) == angle
        assert abs(mathematics.arctan2(y, -x)) + abs(angle) == pytest.approx(PI, rel=1e-15)


def test_whole_numbers_and_truths_are_taken_as_floats():
    assert mathematics.exp(1) == mathematics.exp(1.0) and mathematics.exp(True) == mathematics.exp(1.0)
    assert mathematics.pow(2, 3) == 8.0


@pytest.mark.parametrize("name", mathematics.__all__)
def test_machine_code_calls_no_library(name):
    function = getattr(mathematics, name)
    options = {"nogil": True, "error_model": "numpy", "_nrt": False}
    if len(inspect.signature(function.py_func).parameters) == 1:
        compiled = njit("float64(float64)", **options)(lambda x: function(x))
    else:
        compiled = njit("float64(float64, float64)", **options)(lambda x, y: function(x, y))
    (text,) = compiled.inspect_llvm().values()
    # The wrapper for Python's calls is no part of kernels. LLVM has machine instructions for what begins with its name.
    declared = re.findall(r'^declare .*?@"?([\w.]+)', text, re.MULTILINE)
    assert {one for one in declared if not one.startswith(("Py", "_Py", "numba_", "NRT_", "llvm."))} <= {"sqrt"}
    mathematical = r"llvm\.(sin|cos|tan|sinh|cosh|tanh|a\w*an2?|exp\d*|log\d*|pow\w*|fma|fmuladd)\."
    assert not re.search(mathematical, text) and not re.search(r" = f\w+ (fast|reassoc|contract|afn|arcp)", text)


def test_constants_are_those_that_mpmath_derives():
    for name, value in derived.constants().items():
        module = mathematics_tables if name.endswith("TABLE") else mathematics_constants
        np.testing.assert_array_equal(getattr(module, name), value, err_msg=name)


def test_the_module_names_the_version_of_its_constants():
    text = inspect.getsource(mathematics_constants) + inspect.getsource(mathematics_tables)
    assert hashlib.sha256(text.encode()).hexdigest()[:8] == mathematics.CONSTANTS


def test_mpmath_agrees_that_the_inverses_leave_exact_residues():
    with mp.workdps(60):
        for cell in range(derived.LOG_CELLS):
            inverse = mp.mpf(derived.of_logarithm(cell)[0])
            first = derived.LOG_FIRST + (cell << 44)
            for number in map(derived.number_of, (first, first + (1 << 44) - 1, first + 123456789)):
                residue = number * inverse - 1
                assert mp.mpf(float(residue)) == residue
