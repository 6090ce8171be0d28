"""Elementary functions: their speed beside those of the C library, and, as a command, their errors:
``python -m benchmarks.mathematics`` measures the table ``docs/reference/mathematics.csv`` anew."""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
from numba import njit

from benchmarks.measure import Row, in_turns
from segar.experiments.commands.command_line import run_from_command_line
from segar.support import mathematics

NUMBERS = 4096  # arguments of a measurement
ROUNDS = 20  # measurements for each repeat
ARGUMENTS = 200_000  # of each function in the table of errors
BITS = 120  # of the exact results
TABLE = Path(__file__).parent.parent / "docs" / "reference" / "mathematics.csv"
EXACT = {"arctan2": mp.atan2, "pow": mp.power}
RANGES = {  # of arguments as they are in worlds
    "exp": [(-10.0, 10.0)],
    "log": [(0.0, 10.0)],
    "sin": [(-10.0, 10.0)],
    "cos": [(-10.0, 10.0)],
    "tan": [(-10.0, 10.0)],
    "tanh": [(-3.0, 3.0)],
    "pow": [(0.0, 10.0), (-3.0, 3.0)],
    "arctan2": [(-2.0, 2.0), (-2.0, 2.0)],
    "hypot": [(-2.0, 2.0), (-2.0, 2.0)],
}


def speed(repeats: int) -> Iterator[Row]:
    """Time beside the C library's: of sums over an array, and of chains in which each argument needs the last result."""
    for name, ranges in RANGES.items():
        rng = np.random.default_rng(0)
        arguments = [rng.uniform(low, high, NUMBERS) for low, high in ranges]
        for what, build in (("sum", _sum), ("chain", _chain)):
            calls = [build(function, arguments) for function in (getattr(mathematics, name), library(name))]
            ours, others = in_turns(calls, ROUNDS * repeats, time.perf_counter)
            ratios = [a / b for a, b in zip(ours, others, strict=True)]
            yield Row(f"{name}, {what}, SEGAR / C library", [float(np.median(ratios))], at_most=1.1)


def library(name: str) -> Any:
    """The C library's function, as numba calls it."""
    if name == "pow":
        return njit(error_model="numpy")(lambda x, y: x**y)
    function = getattr(math, {"arctan2": "atan2"}.get(name, name))
    if name in ("arctan2", "hypot"):
        return njit(error_model="numpy")(lambda x, y: function(x, y))
    return njit(error_model="numpy")(lambda x: function(x))


def _sum(function: Any, arguments: list[np.ndarray]) -> Callable[[], float]:
    @njit(error_model="numpy")
    def one(x):
        total = 0.0
        for i in range(len(x)):
            total += function(x[i])
        return total

    @njit(error_model="numpy")
    def two(x, y):
        total = 0.0
        for i in range(len(x)):
            total += function(x[i], y[i])
        return total

    return lambda: (one if len(arguments) == 1 else two)(*arguments)


def _chain(function: Any, arguments: list[np.ndarray]) -> Callable[[], float]:
    @njit(error_model="numpy")
    def one(x):
        last = 0.0
        for i in range(len(x)):
            last = function(x[i] + 0.0 * last)
        return last

    @njit(error_model="numpy")
    def two(x, y):
        last = 0.0
        for i in range(len(x)):
            last = function(x[i] + 0.0 * last, y[i])
        return last

    return lambda: (one if len(arguments) == 1 else two)(*arguments)


def samples(name: str, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Arguments of a function: half as they are in worlds, half from the whole range of exponents."""
    near = [rng.uniform(low, high, count // 2) for low, high in RANGES[name]]
    n = count - count // 2
    if name == "exp":
        far = [rng.uniform(-745.0, 709.7, n)]
    elif name == "pow":
        base = np.abs(everywhere(n, rng))
        far = [base, rng.uniform(-744.0, 709.0, n) / np.log(base)]
    elif name in ("arctan2", "hypot"):
        x = everywhere(n, rng, -1000, 1000)
        far = [x, x * np.ldexp(rng.uniform(-1.0, 1.0, n), rng.integers(-20, 20, n))]
    else:
        far = [np.abs(x) if name == "log" else x for x in [everywhere(n, rng)]]
    return [np.concatenate(pair) for pair in zip(near, far, strict=True)]


def everywhere(count: int, rng: np.random.Generator, low: int = -1074, high: int = 1024) -> np.ndarray:
    """Numbers with evenly distributed exponents, signs and digits."""
    return rng.choice([-1.0, 1.0], count) * np.ldexp(rng.uniform(1.0, 2.0, count), rng.integers(low, high, count))


def errors(name: str, functions: list[Any], arguments: list[np.ndarray]) -> np.ndarray:
    """Errors in units in the last place of the exact result, float64 ``(functions, arguments)``; nan where that overflows."""
    exact, found = EXACT.get(name) or getattr(mp, name), np.empty((len(functions), len(arguments[0])))
    with mp.workprec(BITS):
        for k, numbers in enumerate(zip(*(x.tolist() for x in arguments), strict=True)):
            true = exact(*map(mp.mpf, numbers))
            unit = max(mp.frexp(true)[1] - 53, -1074) if true else -1074
            for row, function in enumerate(functions):
                value = function(*numbers)
                found[row, k] = mp.ldexp(mp.mpf(value) - true, -unit) if math.isfinite(value) else np.nan
    return np.abs(found)


def main(n: int = ARGUMENTS) -> None:
    """Write the table of the errors of each function, from ``n`` arguments."""
    with TABLE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["function", "arguments", "largest", "mean", "largest_of_libm", "mean_of_libm"])
        for name in RANGES:
            arguments = samples(name, n, np.random.default_rng(1))
            found = errors(name, [getattr(mathematics, name), library(name)], arguments)
            numbers = [f"{f(row):.3f}" for row in found for f in (np.nanmax, np.nanmean)]
            table.writerow([name, n, *numbers])
            file.flush()
            print(name, *numbers, flush=True)


if __name__ == "__main__":
    run_from_command_line(main)
