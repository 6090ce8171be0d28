"""Tables as text."""

from collections.abc import Sequence


def aligned(rows: Sequence[Sequence[str]]) -> str:
    """Rows of as many cells each, in columns as wide as their longest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "\n".join("  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)).rstrip() for row in rows)


def counted(number: int, thing: str) -> str:
    """A number of things in words, such as ``1 run`` or ``1,000 runs``."""
    return f"{number:,} {thing}{'s' * (number != 1)}"
