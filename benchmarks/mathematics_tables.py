"""Derive the constants and tables of :mod:`segar.support.mathematics` with mpmath.

``python -m benchmarks.mathematics_tables`` writes the module of constants. A test compares both modules with what stands here.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import mpmath as mp

import segar.support

DIGITS = 400  # of all computations: 2 / pi has 1200 bits
EXP_CELLS = 128
LOG_CELLS = 256
LOG_FIRST = 0x3FE6A80000000000  # bits of the first number of the first cell; one is within a cell
LOG_GRID = 42  # bits behind the point of what is summed without rounding
LARGEST_RESIDUE = mp.mpf(0.86) / 256  # of z * inverse - 1 within a cell of the logarithm
LIMBS = 38  # of 32 bits: of 2 / pi for the largest exponent
SIN_START = -5 / 32  # near -1 / 6, and short: this multiple of r^3 is taken apart
PI_BITS = 36  # of the parts of pi / 2 that are multiplied with up to 17 bits

TARGET = Path(segar.support.__file__).with_name("mathematics_constants.py")
HEADER = '''"""Constants of :mod:`segar.support.mathematics`. By ``python -m benchmarks.mathematics_tables``; do not edit."""

import numpy as np

'''


def main() -> None:
    TARGET.write_text(
        text_of({name: value for name, value in constants().items() if not name.endswith("TABLE")}), encoding="utf-8"
    )
    print(f"wrote {TARGET}")


def constants() -> dict[str, Any]:
    """All constants by their names: floats, and lists of floats or of whole numbers."""
    with mp.workdps(DIGITS):
        ln2 = mp.log(2)
        step = ln2 / EXP_CELLS
        found: dict[str, Any] = {
            "EXP_INVERSE": float(1 / step),
            "EXP_STEP_HIGH": (high := short(step, 42)),
            "EXP_STEP_LOW": float(step - high),
            "LN2_HIGH": (high := short(ln2, LOG_GRID)),
            "LN2_LOW": float(ln2 - high),
            "TWO_OVER_PI": float(2 / mp.pi),
            "SIN_START": SIN_START,
        }
        for name, part in zip(("PI_2_A", "PI_2_B", "PI_2_C"), parts(mp.pi / 2, PI_BITS, 2), strict=True):
            found[name] = part
        found["PI_2_HIGH"] = float(mp.pi / 2)
        found["PI_2_LOW"] = float(mp.pi / 2 - found["PI_2_HIGH"])
        quarter = mp.pi**2 / 16 * (1 + mp.mpf(2) ** -12)
        polynomials = {
            "EXP": (4, -step / 2, step / 2, lambda r: (mp.expm1(r) - r) / r**2),
            "LOG": (5, -LARGEST_RESIDUE, LARGEST_RESIDUE, lambda r: (mp.log1p(r) - r + r**2 / 2) / r**3),
            "POW": (6, -LARGEST_RESIDUE, LARGEST_RESIDUE, lambda r: (mp.log1p(r) - r + r**2 / 2) / r**3),
            "SIN": (7, 0, quarter, lambda z: (mp.sin(mp.sqrt(z)) / mp.sqrt(z) - 1) / z - SIN_START),
            "COS": (6, 0, quarter, lambda z: (mp.cos(mp.sqrt(z)) - 1 + z / 2) / z**2),
            "ATAN": (7, 0, mp.mpf(1) / 64, lambda z: (mp.atan(mp.sqrt(z)) / mp.sqrt(z) - 1) / z),
            "TANH": (8, 0, mp.mpf(1) / 16, lambda z: (mp.tanh(mp.sqrt(z)) / mp.sqrt(z) - 1) / z),
        }
        for name, (terms, low, high, function) in polynomials.items():
            for k, coefficient in enumerate(fitted(function, low, high, terms)):
                found[f"{name}_{k}"] = coefficient
        for name, coefficient in zip(("TAN_ABOVE_{}", "TAN_BELOW_{}"), tangent(quarter), strict=True):
            found |= {name.format(k): float(c) for k, c in coefficient.items()}
        found["EXP_TABLE"] = [x for i in range(EXP_CELLS) for x in of_power(mp.mpf(2) ** (mp.mpf(i) / EXP_CELLS))]
        found["LOG_TABLE"] = [x for i in range(LOG_CELLS) for x in of_logarithm(i)]
        found["ATAN_TABLE"] = [x for q in range(4) for c in range(8) for x in of_angle(q, mp.mpf(c) / 4)]
        found["TWO_OVER_PI_LIMBS"] = [0, 0]  # zeros for small exponents
        found["TWO_OVER_PI_LIMBS"] += [int(mp.floor(2 / mp.pi * 2 ** (32 * (k + 1)))) % 2**32 for k in range(LIMBS)]
    return found


def short(value: Any, bits: int) -> float:
    """The nearest number with this many bits behind the point."""
    return float(mp.nint(value * mp.mpf(2) ** bits) / mp.mpf(2) ** bits)


def parts(value: Any, bits: int, count: int) -> list[float]:
    """Parts of so many bits, ``count`` of them, and the rest as a float: their sum is the value."""
    found = []
    for k in range(1, count + 1):
        found.append(short(value, bits * k - 1))
        value -= found[-1]
    return [*found, float(value)]


def fitted(function: Callable[[Any], Any], low: Any, high: Any, terms: int) -> list[float]:
    """Coefficients, lowest first, of the polynomial through the function's values at Chebyshev's points, rounded."""
    # No point is zero, where these functions are quotients of zeros.
    return [float(c) for c in reversed(mp.chebyfit(function, [low, high * (1 + mp.mpf(2) ** -30)], terms))]


def tangent(high: Any) -> tuple[dict[int, Any], dict[int, Any]]:
    """Coefficients n, by powers from 1 on, and d, from 2 on, of tan r = r (1 + n1 z + ...) / (1 - z / 2 + d2 z^2 + ...) with
    z = r^2, through the tangent at Chebyshev's points of [0, high]."""
    above, below = (1, 2, 3, 4), (2, 3, 4)
    points = [high / 2 * (1 + mp.cos(mp.pi * (k + mp.mpf(1) / 2) / 7)) for k in range(7)]
    slopes = [mp.tan(mp.sqrt(z)) / mp.sqrt(z) for z in points]
    rows = [[*(z**k for k in above), *(-t * z**k for k in below)] for z, t in zip(points, slopes, strict=True)]
    solved = mp.lu_solve(mp.matrix(rows), mp.matrix([t * (1 - z / 2) - 1 for z, t in zip(points, slopes, strict=True)]))
    return dict(zip(above, solved, strict=False)), dict(zip(below, list(solved)[len(above) :], strict=True))


def of_power(value: Any) -> tuple[float, float]:
    """A number, and the relative rest that its rounding leaves."""
    return (high := float(value)), float(value / high - 1)


def of_logarithm(cell: int) -> tuple[float, float, float, float]:
    """An inverse c' of few bits for a cell, and -log(c') in two parts, the first on a grid; and a zero, which makes four.

    With so few bits z c' - 1 is a float for each z of the cell.
    """
    low, high = (number_of(LOG_FIRST + ((cell + k) << 44)) for k in (0, 1))
    grid = 512 if low >= 1 else 256
    inverse = mp.mpf(1) if low < 1 <= high else mp.nint(2 / (low + high) * grid) / grid
    assert max(abs(low * inverse - 1), abs(high * inverse - 1)) < LARGEST_RESIDUE
    value = -mp.log(inverse)
    return float(inverse), (part := short(value, LOG_GRID)), float(value - part), 0.0


def of_angle(quarter: int, tangent: Any) -> tuple[float, float]:
    """In two parts, the angle between the positive x axis and the ray of a tangent that stands in one of four places: before
    and behind the x axis' right half, the y axis, and the x axis' left half."""
    value = (mp.atan(tangent), mp.pi / 2 - mp.atan(tangent), mp.pi - mp.atan(tangent), mp.pi / 2 + mp.atan(tangent))[
        quarter
    ]
    return (high := float(value)), float(value - high)


def number_of(bits: int) -> Any:
    """The positive number that these bits are."""
    return mp.mpf((bits & (2**52 - 1)) + 2**52) * mp.mpf(2) ** ((bits >> 52) - 1075)


def text_of(constants: dict[str, Any]) -> str:
    """The source of the module."""
    lines = [f"{name} = {value!r}" for name, value in constants.items() if isinstance(value, float)]
    for name, values in constants.items():
        if not isinstance(values, float):
            kind = "np.float64" if isinstance(values[0], float) else "np.uint64"
            lines += ["", f"{name} = np.array(", "    [", *wrapped(map(repr, values)), "    ],", f"    {kind},", ")"]
            lines[-1] += "  # fmt: skip"
    return HEADER + "\n".join(lines) + "\n"


def wrapped(words: Iterable[str]) -> Iterable[str]:
    """Lines of a list."""
    line = " " * 7
    for word in words:
        if len(line) + len(word) > 117:
            yield line
            line = " " * 7
        line += f" {word},"
    yield line


if __name__ == "__main__":
    main()
