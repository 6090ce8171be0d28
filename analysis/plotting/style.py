"""How figures look: colours that colour-blind readers can tell apart, one marker per difficulty, readable sizes."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import matplotlib

# Okabe and Ito's palette, in an order that also differs in lightness.
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# For what has an order: light to dark, and unlike the families' colours.
SEQUENCE = ("#EFB03A", "#CC4778", "#5B02A3", "#2A788E", "#7AD151", "#777777", "#000000")
MARKERS = ("o", "s", "^", "D", "v", "P", "X")
KNOWN = {"easy": 0, "medium": 1, "hard": 2, "empty": 0, "objectsx1": 1, "tilesx1": 2, "hazardtilesx1": 3}

LINE_WIDTH = 1.5

SETTINGS = matplotlib.rc_params_from_file(Path(__file__).with_name("segar.mplstyle"), use_default_template=False)


def applied() -> Any:
    """A context in which matplotlib draws in this style, whatever the user's own settings."""
    return matplotlib.rc_context({**matplotlib.rcParamsDefault, "backend": "agg", **SETTINGS})  # type: ignore[arg-type]


def colours(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name; the paper's families always have the same one."""
    return _assign(names, PALETTE)


def shades(names: Iterable[str]) -> dict[str, str]:
    """A colour for each name from light to dark; the paper's difficulties always have the same one."""
    return _assign(names, SEQUENCE)


def markers(names: Iterable[str]) -> dict[str, str]:
    """A marker for each name; the paper's difficulties always have the same one."""
    return _assign(names, MARKERS)


def ordered(names: Iterable[str]) -> list[str]:
    """Names without repetition: the paper's in the paper's order, then the others by letter."""
    return sorted(set(names), key=lambda name: (KNOWN.get(name, len(KNOWN)), name))


def _assign(names: Iterable[str], choices: tuple[str, ...]) -> dict[str, str]:
    names = ordered(names)
    taken = {KNOWN[name] for name in names if name in KNOWN}
    free = [i for i in range(len(choices)) if i not in taken] or list(range(len(choices)))
    others = [name for name in names if name not in KNOWN]
    extra = {name: choices[free[i % len(free)]] for i, name in enumerate(others)}
    return {name: extra.get(name) or choices[KNOWN[name]] for name in names}
