"""Measuring in turns, and rows of the table: median, range, and the bar that the number is held to."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import segar

Clock = Callable[[], float]
Call = Callable[[], object]
WIDTHS = (50, 14, 24, 12)


@dataclass(frozen=True)
class Row:
    """One line of the table.

    Attributes:
        values: one per repeat, in ``unit``; the median is what counts.
        at_least, at_most: the bar.
        note: what else a reader should know.
    """

    what: str
    values: Sequence[float]
    unit: str = ""
    at_least: float | None = None
    at_most: float | None = None
    note: str = ""

    @property
    def median(self) -> float:
        return statistics.median(self.values)

    @property
    def bar(self) -> str:
        """The bar, with a mark where the median misses it."""
        if self.at_least is not None:
            return f">= {self.at_least:g}" + ("" if self.median >= self.at_least else " !")
        if self.at_most is not None:
            return f"<= {self.at_most:g}" + ("" if self.median <= self.at_most else " !")
        return ""

    def __str__(self) -> str:
        spread = f"{_digits(min(self.values))} to {_digits(max(self.values))}" if len(self.values) > 1 else ""
        cells = (self.what, f"{_digits(self.median)} {self.unit:<4}", spread, self.bar)
        name, *numbers = (
            f"{cell:{'<' if n == 0 else '>'}{width}}" for n, (cell, width) in enumerate(zip(cells, WIDTHS, strict=True))
        )
        return f"{name}{''.join(numbers)}  {self.note}".rstrip()


def header() -> str:
    """Names of the columns."""
    what, median, spread, bar = WIDTHS
    return f"{'':<{what}}{'median':>{median - 5}}     {'range':>{spread}}{'bar':>{bar}}"


def machine() -> str:
    """Version, processor, interpreter, and what else keeps the processor busy."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.split(":")[1].strip() for line in lines if line.startswith("model name")]
    processor = names[0] if names else platform.processor() or platform.machine()
    return (
        f"segar {segar.__version__}, {processor}, {len(names) or '?'} cores, load {load()}, Python"
        f" {platform.python_version()}, numpy {np.__version__}"
    )


def load() -> str:
    """How many processes wanted to run in the last minute: above the number of cores, wall times mean little."""
    return f"{os.getloadavg()[0]:.1f}"


def timed(function: Call, repeats: int, clock: Clock = time.perf_counter) -> list[float]:
    """Seconds of each of ``repeats`` calls."""
    (seconds,) = in_turns([function], repeats, clock)
    return seconds


def in_turns(
    functions: Sequence[Call], repeats: int, clock: Clock, prepare: Sequence[Call] | None = None
) -> list[list[float]]:
    """Seconds of each call of each function, after one that does not count.

    Taking turns lets what else happens on the machine fall on all alike.

    Args:
        prepare: called before each function, untimed.
    """
    seconds: list[list[float]] = [[] for _ in functions]
    for turn in range(repeats + 1):
        for k, function in enumerate(functions):
            if prepare is not None:
                prepare[k]()
            start = clock()
            function()
            if turn:
                seconds[k].append(clock() - start)
    return seconds


def _digits(value: float) -> str:
    """Four significant digits without an exponent."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:#.4g}".rstrip(".")


def print_parts(legend: str, parts: Sequence[Callable[[int], Iterable[Row]]], repeats: int) -> None:
    """Print the machine, the legend and, as they come, the rows of each part."""
    print(machine())
    print(f"{legend}; a ! marks a missed bar\n")
    print(header())
    for part in parts:
        for row in part(repeats):
            print(row, flush=True)
    print(f"\nload {load()}")
