"""Which factors make the gap: levels between training and test, in which some groups of factors are of the one and the
rest of the other; what is lost on them, by Shapley's values.
"""

from collections.abc import Sequence
from itertools import combinations, product
from math import factorial
from typing import Any

import numpy as np
import pandas as pd

from segar.analysis.stats.association import require
from segar.analysis.tables import Floats, column
from segar.errors import SegarError

MOST_GROUPS = 8  # 256 sets of levels


def full_factorial(groups: Sequence[str]) -> pd.DataFrame:
    """All 2^k combinations of groups: a column each, 1 where the group is as in the test level, 0 as in training."""
    if {*groups} & {"pair", "value", "total"} or len({*groups}) < len(groups):
        raise SegarError(f"groups must have names of their own, and none is pair, value or total: {', '.join(groups)}")
    if not 1 <= len(groups) <= MOST_GROUPS:
        raise SegarError(f"a full factorial design has 1 to {MOST_GROUPS} groups, not {len(groups)}; join some")
    return pd.DataFrame(list(product((0, 1), repeat=len(groups))), columns=list(groups))


def shapley_of_pairs(table: pd.DataFrame, groups: Sequence[str], value: str = "value") -> pd.DataFrame:
    """Shapley's share of each group in the change from training to test: one row per pair of levels, with ``pair``, a column
    per group, and their sum, ``total``, which is the change.

    A share is the mean over all orders, in which groups may be changed one after the other, of what the change of the group
    adds.

    Args:
        table: one row per pair and combination of :func:`full_factorial`, with ``pair``, a column per group, and ``value``.

    Raises:
        SegarError: a combination is missing for some pair.
    """
    cube = value_cube(table, groups, value)
    k = len(groups)
    parts: dict[str, Any] = {"pair": sorted(set(table["pair"]))}
    for place, name in enumerate(groups):
        others = [g for g in range(k) if g != place]
        added = np.zeros(len(cube))
        for size in range(k):
            weight = factorial(size) * factorial(k - 1 - size) / factorial(k)
            for subset in combinations(others, size):
                without = tuple(int(g in subset) for g in range(k))
                with_it = tuple(1 if g == place else bit for g, bit in enumerate(without))
                added += weight * (cube[(slice(None), *with_it)] - cube[(slice(None), *without)])
        parts[name] = added
    parts["total"] = cube[(slice(None), *(1,) * k)] - cube[(slice(None), *(0,) * k)]
    return pd.DataFrame(parts)


def value_cube(table: pd.DataFrame, groups: Sequence[str], value: str) -> Floats:
    """Values [pairs, 2, 2, ...], an axis per group."""
    require(table, "pair", value, *groups)
    ordered = table.sort_values(["pair", *groups])
    pairs = len(set(ordered["pair"]))
    expected = np.tile(full_factorial(groups), (pairs, 1))
    if not np.array_equal(ordered[list(groups)], expected):
        raise SegarError(f"every pair must have all {2 ** len(groups)} combinations of {', '.join(groups)} once")
    return column(ordered, value).reshape(pairs, *(2,) * len(groups))
