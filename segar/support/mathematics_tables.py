"""The tables of :mod:`segar.support.mathematics`, computed from what they are: only the last rounding is not exact."""

from collections.abc import Sequence
from decimal import Decimal, localcontext

import numpy as np

DIGITS = 40  # of the computations; a number in two parts has 32
EXP_CELLS, LOG_CELLS = 128, 256
LOG_FIRST = 0x3FE6A80000000000  # bits of the first number of the first cell of the logarithm; one is within a cell
LOG_GRID = 42  # bits behind the point of what is summed without rounding


def powers() -> np.ndarray:
    """2^(i / 128), and the relative rest that its rounding leaves."""
    with localcontext(prec=DIGITS):
        step = (Decimal(2).ln() / EXP_CELLS).exp()
        exact = [step**i for i in range(EXP_CELLS)]
        return np.array([part for x in exact for part in (float(x), float(x / Decimal(float(x)) - 1))])


def logarithms() -> np.ndarray:
    """An inverse c' of few bits for each cell, and -log(c') in two parts, the first on a grid; and a zero, which makes four.

    With so few bits z c' - 1 is a float for each z of the cell.
    """
    edges = (LOG_FIRST + (np.arange(LOG_CELLS + 1) << 44)).view(np.float64)
    low, high = edges[:-1], edges[1:]
    grid = np.where(low >= 1, 512, 256)
    inverses = np.where((low < 1) & (high >= 1), 1.0, np.rint(2 / (low + high) * grid) / grid)
    with localcontext(prec=DIGITS):
        exact = [-Decimal(inverse).ln() for inverse in inverses.tolist()]
        upper = [round(x * 2**LOG_GRID) / 2**LOG_GRID for x in exact]
        lower = [float(x - Decimal(part)) for x, part in zip(exact, upper, strict=True)]
    return np.stack([inverses, upper, lower, np.zeros(LOG_CELLS)], axis=1).ravel()


def angles() -> np.ndarray:
    """The angles of eight tangents from 0 on, in two parts, on four rays: before and behind the x axis' right half, the y axis,
    and the x axis' left half."""
    with localcontext(prec=DIGITS):
        first, right = [_arctan(Decimal(c) / 4) for c in range(8)], 2 * _arctan(Decimal(1))
        return _in_two_parts(
            [*first, *(right - a for a in first), *(2 * right - a for a in first), *(right + a for a in first)]
        )


def _arctan(tangent: Decimal) -> Decimal:
    """The arcus tangent, by Euler's series."""
    square = tangent * tangent
    total, term, k = Decimal(0), tangent / (1 + square), 0
    while total + term != total:
        total, k = total + term, k + 1
        term *= 2 * k * square / ((2 * k + 1) * (1 + square))
    return total


def _in_two_parts(exact: Sequence[Decimal]) -> np.ndarray:
    return np.array([part for x in exact for part in (float(x), float(x - Decimal(float(x))))])


EXP_TABLE, LOG_TABLE, ATAN_TABLE = powers(), logarithms(), angles()
