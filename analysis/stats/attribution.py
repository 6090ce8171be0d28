"""Which factors make the gap: levels between training and test, in which some groups of factors are of the one and the
rest of the other; what is lost on them, by ANOVA and by Shapley's values.
"""

from collections.abc import Callable, Sequence
from itertools import combinations, product
from math import factorial
from typing import Any

import numpy as np
import pandas as pd

from analysis.stats.association import require
from analysis.stats.estimate import mean_of_replicates
from analysis.tables import Floats, column
from segar.errors import SegarError
from segar.levels import REST, Groups, Levels, mixed_levels

MOST_GROUPS = 8  # 256 sets of levels


def full_factorial(groups: Sequence[str]) -> pd.DataFrame:
    """All 2^k combinations of groups: a column each, 1 where the group is as in the test level, 0 as in training."""
    if not 1 <= len(groups) <= MOST_GROUPS:
        raise SegarError(f"a full factorial design has 1 to {MOST_GROUPS} groups, not {len(groups)}; join some")
    return pd.DataFrame(list(product((0, 1), repeat=len(groups))), columns=list(groups))


def half_factorial(groups: Sequence[str]) -> pd.DataFrame:
    """Half of them, those with an even number of ones: main effects of k groups are confounded with interactions of k - 1
    groups, and no others (resolution k). It holds training levels as they are, and for even k test levels, too."""
    if len(groups) < 3:
        raise SegarError(f"half of a factorial design needs at least 3 groups, not {len(groups)}")
    design = full_factorial(groups)
    even = design.to_numpy().sum(axis=1) % 2 == 0
    return design.loc[even].reset_index(drop=True)


def play_design(
    play: Callable[[Levels], Floats],
    train: Levels,
    test: Levels,
    groups: Groups,
    design: pd.DataFrame,
    pairs: int,
    rng: np.random.Generator,
) -> pd.DataFrame:
    """What ``play`` scores on the levels of a design, one row per pair of levels and combination.

    Args:
        play: levels to a score each, float ``[n]``, e.g. the return of an agent's episode on each.
        design: of :func:`full_factorial` or :func:`half_factorial`; its columns are the groups, "rest" among them.
        pairs: how many pairs of a training and a test level, drawn at random; all combinations are played on each.

    Returns:
        ``pair``, ``train_level``, ``test_level``, a column per group (0: training, 1: test), ``value``.

    Raises:
        LevelError: the level sets do not fit each other. SegarError: the design lacks a group.
    """
    wanted = {*groups, REST}
    if set(design.columns) != wanted:
        raise SegarError(f"the design must have the columns {', '.join(sorted(wanted))}; it has {', '.join(design)}")
    i, j = rng.integers(len(train), size=pairs), rng.integers(len(test), size=pairs)
    first, second = train[i], test[j]
    parts = []
    for chosen in design.to_dict("records"):
        value = np.asarray(play(mixed_levels(first, second, groups, chosen)), np.float64)
        part = {"pair": np.arange(pairs), "train_level": i, "test_level": j}
        parts.append(pd.DataFrame(part | {str(name): int(bit) for name, bit in chosen.items()} | {"value": value}))
    return pd.concat(parts, ignore_index=True)


def shapley(table: pd.DataFrame, groups: Sequence[str], value: str = "value", level: float = 0.95) -> pd.DataFrame:
    """Shapley's share of each group in the change from training to test; the shares add up to it.

    The mean over all orders, in which groups may be changed one after the other, of what the change of the group adds.

    Args:
        table: of :func:`play_design` with a full factorial design.

    Returns:
        ``group`` (the last is "total"), ``estimate``, ``low``, ``high``, ``n`` (pairs of levels), ``p`` (two-sided),
        ``level``, ``note``, ``share`` of the total. Intervals and p are Student's over pairs.

    Raises:
        SegarError: a combination is missing for some pair.
    """
    parts = shapley_of_pairs(table, groups, value).drop(columns="pair")
    whole = float(column(parts, "total").mean())
    rows = [
        mean_of_replicates(column(parts, name), 0.0, level, sides=2).row(group=name)
        | {"share": float(column(parts, name).mean()) / whole if whole else np.nan}
        for name in parts
    ]
    return pd.DataFrame(rows)


def shapley_of_pairs(table: pd.DataFrame, groups: Sequence[str], value: str = "value") -> pd.DataFrame:
    """What :func:`shapley` takes the mean of: one row per pair, with ``pair``, a column per group, and their sum, ``total``.

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


def anova(table: pd.DataFrame, groups: Sequence[str], value: str = "value", level: float = 0.95) -> pd.DataFrame:
    """Main effects and interactions of groups, of a full factorial design, with pairs of levels as blocks.

    An effect is the mean at 1 less the mean at 0 (of an interaction: of the product of signs). Each is tested against
    its own scatter over pairs, F = t² with (1, pairs - 1) degrees of freedom.

    Returns:
        ``term`` (e.g. "position" or "position x charge"), ``order``, ``estimate``, ``low``, ``high``, ``n`` (pairs),
        ``p``, ``level``, ``note``, ``F``, ``sum_of_squares``, ``share`` of the sum over all terms.

    Raises:
        SegarError: a combination is missing for some pair.
    """
    cube = value_cube(table, groups, value)
    k = len(groups)
    rows = []
    for size in range(1, k + 1):
        for subset in combinations(range(k), size):
            sign = np.ones((2,) * k)
            for g in subset:
                sign = sign * np.array([-1.0, 1.0]).reshape([2 if h == g else 1 for h in range(k)])
            effect = (cube * sign).reshape(len(cube), -1).sum(axis=1) / 2 ** (k - 1)
            one = mean_of_replicates(effect, 0.0, level, sides=2)
            spread = float(effect.std(ddof=1)) if len(effect) > 1 else np.nan
            f = float(effect.mean() ** 2 / (spread**2 / len(effect))) if spread else np.nan
            squares = len(cube) * 2 ** (k - 2) * float(effect.mean()) ** 2
            term = " x ".join(groups[g] for g in subset)
            rows.append(one.row(term=term, order=size) | {"F": f, "sum_of_squares": squares})
    found = pd.DataFrame(rows)
    total = float(found["sum_of_squares"].to_numpy().sum())
    return found.assign(share=found["sum_of_squares"] / total if total else np.nan)


def main_effects(table: pd.DataFrame, groups: Sequence[str], value: str = "value", level: float = 0.95) -> pd.DataFrame:
    """Main effects alone, of a full or a half design: ``term``, ``estimate``, ``low``, ``high``, ``n``, ``p``, ``level``,
    ``note``; raises :class:`SegarError` if some pair lacks a combination that others have."""
    require(table, "pair", value, *groups)
    sizes = np.unique(table["pair"].to_numpy(), return_counts=True)[1]
    if len(set(sizes)) != 1 or table.duplicated(["pair", *groups]).to_numpy().any():
        raise SegarError("every pair must have every combination of the design once")
    rows = []
    for name in groups:
        means = table.pivot_table(value, "pair", name, aggfunc="mean")
        effect = (means[1] - means[0]).to_numpy(np.float64)
        rows.append(mean_of_replicates(effect, 0.0, level, sides=2).row(term=name))
    return pd.DataFrame(rows)


def value_cube(table: pd.DataFrame, groups: Sequence[str], value: str) -> Floats:
    """Values [pairs, 2, 2, ...], an axis per group."""
    require(table, "pair", value, *groups)
    ordered = table.sort_values(["pair", *groups])
    pairs = len(set(ordered["pair"]))
    expected = full_factorial(groups).to_numpy()
    if len(ordered) != pairs * len(expected) or not np.array_equal(
        ordered[list(groups)], np.tile(expected, (pairs, 1))
    ):
        raise SegarError(f"every pair must have all {len(expected)} combinations of {', '.join(groups)} once")
    return ordered[value].to_numpy(np.float64).reshape(pairs, *(2,) * len(groups))
