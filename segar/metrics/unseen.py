"""What a distance does not see: in what level sets differ that it leaves out."""

import warnings
from collections.abc import Sequence

import numpy as np
import scipy

from segar.errors import UnseenDifferenceWarning
from segar.language import Entity, Factor, Order, Parameter, Tile
from segar.levels import (
    LevelDistribution,
    Levels,
    active_options,
    checks,
    entity_types,
    moments,
    rule_space_of,
    shared_rule_sets,
)
from segar.metrics.points import IRRELEVANT, Spread, all_parameters, relevant_factors
from segar.rules import World

LEFT_OUT = tuple(factor for factor in IRRELEVANT if factor is not Order)
"""The factors that the mode ``exact`` leaves out and of which the numbers count; of Order, which of two tiles lies on top."""

SIGNIFICANT = 1e-3  # two-sample test below which values speak against one distribution
# Differences of a mean, and of a spread, in spreads: beyond what a sample of 2000 levels makes by chance.
MATERIAL = 0.2
STAND_IN = 200  # levels that stand for a distribution


def unseen_differences(
    a: Levels | LevelDistribution, b: Levels | LevelDistribution, mode: str = "exact"
) -> tuple[str, ...]:
    """In what two level sets differ that a distance between them does not see, one text each.

    No distance sees rules and contacts. The modes ``reference`` and ``paper`` of :func:`segar.metrics.w2` do not see world
    parameters, and ``reference`` takes entity types that have the same factors for one. The mode ``exact``, KS and all
    other distances see these, and leave out what things have at the start of Visible, Alive, Done, Acceleration, Drag and
    Density, and by their Order, which of two tiles lies on top of the other.

    Where both sets have one rule space and their rule sets have different distributions, a text says which share of the second
    set's rule sets occurs in the first. Distances take the parameters of rules as numbers;
    :func:`segar.metrics.dynamics_w2` compares what the rules do.

    Whether numbers differ is decided by mean and spread of the distributions that the levels come from, and by a
    two-sample test of the levels at hand. Rules differ if one set has a rule that the other lacks; levels from a file know
    the names of their rules only.

    >>> here, there = (segar.Levels.from_entities([[segar.Ball()]], {segar.Gravity: g}) for g in (9.8, 3.7))
    >>> segar.metrics.unseen_differences(here, there, "reference")
    ("parameter Gravity: 9.8 against 3.7; mode 'exact' sees it",)

    Args:
        mode: of w2; "exact" also stands for all distances that have no mode.

    Raises:
        LevelError: not two level sets or distributions.
    """
    sets = [_levels(one) for one in (a, b)]
    found, of_rules = [], _parameters_of_rules(*sets)
    if mode != "exact":
        found += [
            f"parameter {p.__name__}: {_ranges(sets, Parameter, p)}; mode 'exact' sees it"
            for p in all_parameters(*sets)
            if p not in of_rules and _differ(sets, Parameter, p)
        ]
    else:
        present = [entity_types(one) for one in sets]
        found += [
            f"factor {factor.__name__} of {kind.__name__}: {_ranges(sets, kind, factor)}; modes 'reference' and 'paper' see it"
            for kind in present[0]
            for factor in LEFT_OUT
            if kind in present[1] and factor in kind.declared and _differ(sets, kind, factor)
        ]
        tiles = [kind for kind in present[0] if issubclass(kind, Tile) and Order in kind.declared]
        found += _piles(sets, [kind for kind in tiles if kind in present[1]])
    if mode == "reference":
        found += _merged_types(sets)
    if of_rules and _rule_sets_differ(*sets, parameters=of_rules):
        found.append(_shared(*sets, mode=mode))
    return (*found, *_rules(*sets))


def warn_of_unseen(
    what: str,
    a: Levels | LevelDistribution,
    b: Levels | LevelDistribution,
    mode: str = "exact",
    factors: Sequence[type[Factor]] | None = None,
    scale: Spread | None = None,
) -> tuple[str, ...]:
    """The :func:`unseen_differences`, after one warning that names them; none where the caller chose the ``factors``. Where the
    caller chose the ``scale``, also what differs and has no weight because it has no spread there."""
    found = unseen_differences(a, b, mode) if factors is None else ()
    if scale is not None and mode == "exact":
        found += _without_weight([_levels(one) for one in (a, b)], scale, factors)
    if found:
        of_mode = f" in mode '{mode}'" if mode != "exact" else ""
        warnings.warn(
            f"{what}{of_mode} does not see that the level sets differ in {len(found)} respect{'s'[: len(found) > 1]}: "
            + ". ".join(found),
            UnseenDifferenceWarning,
            stacklevel=3,  # who called the measure
        )
    return found


def _levels(one: Levels | LevelDistribution) -> Levels:
    if isinstance(one, LevelDistribution):
        return one.sample(STAND_IN, seed=0, split="unseen differences")
    checks.require_levels("unseen_differences", one)
    return one


def _without_weight(sets: Sequence[Levels], scale: Spread, factors: Sequence[type[Factor]] | None) -> tuple[str, ...]:
    """The factors and world parameters in which the sets differ, and that have no spread in ``scale``."""
    present = [entity_types(one) for one in sets]
    owned = [(kind, f) for kind in present[0] if kind in present[1] for f in relevant_factors(kind, factors)]
    owned += [(Parameter, p) for p in all_parameters(*sets) if factors is None or p in factors]
    return tuple(
        f"{'parameter' if owner is Parameter else 'factor'} {factor.__name__}"
        f"{'' if owner is Parameter else f' of {owner.__name__}'}: {_ranges(sets, owner, factor)}; it has no spread in the"
        " given scale, and so no weight"
        for owner, factor in owned
        if not scale.get((owner, factor), 0.0) > 0.0 and _differ(sets, owner, factor)
    )


def _piles(sets: Sequence[Levels], kinds: Sequence[type[Entity]]) -> list[str]:
    """The pairs of kinds of tiles of which another one lies on top in each set; the topmost tile carries things."""
    sources = [levels.provenance.distribution for levels in sets]
    if sources[0] and sources[0] == sources[1]:
        return []
    found = []
    for k, kind in enumerate(kinds):
        for other in kinds[k + 1 :]:
            x, y = (_above(levels, kind, other) for levels in sets)
            if not (len(x) and len(y)):
                continue
            apart = x.max() < y.min() or y.max() < x.min()
            if apart or scipy.stats.mannwhitneyu(x, y).pvalue < SIGNIFICANT:
                found.append(
                    f"factor Order: {kind.__name__} lies above {other.__name__} in {x.mean():.0%} against {y.mean():.0%} of"
                    " their pairs; modes 'reference' and 'paper' see the numbers"
                )
    return found


def _above(levels: Levels, kind: type[Entity], other: type[Entity]) -> np.ndarray:
    """In how many pairs of a level's tiles of two kinds the one of ``kind`` lies above, a tie counted half, as a share of
    them, float64 ``[level]``; levels without such a pair are left out."""
    types, order = levels.layout.types, levels.values[..., levels.layout.columns[Order]]
    one, two = (levels.types == types.index(which) for which in (kind, other))
    first, second = one.any(axis=0), two.any(axis=0)  # slots that hold such a tile in some level
    pairs = one[:, first, None] & two[:, None, second]
    difference = order[:, first, None] - order[:, None, second]  # the lowest order lies on top
    above = np.where(pairs, (difference < 0) + 0.5 * (difference == 0), 0.0).sum(axis=(1, 2))
    number = pairs.sum(axis=(1, 2))
    return above[number > 0] / number[number > 0]


def _values(levels: Levels, owner: type, factor: type[Factor]) -> np.ndarray:
    """The numbers of a factor of one entity type, or of a world parameter, float64 ``[number, component]``."""
    if owner is Parameter:
        return moments.gather_parameters(levels, [factor]).points  # type: ignore[list-item]
    return moments.gather_state(levels, owner, [factor]).points


def _differ(sets: Sequence[Levels], owner: type, factor: type[Factor]) -> bool:
    return any(_component_differs(sets, owner, factor, k) for k in range(factor.width))


def _component_differs(sets: Sequence[Levels], owner: type, factor: type[Factor], k: int) -> bool:
    x, y = (_values(levels, owner, factor)[:, k] for levels in sets)
    if len(np.unique(np.concatenate([x, y]))) == 1:
        return False
    method = "exact" if max(len(x), len(y)) <= 1000 else "asymp"
    if scipy.stats.ks_2samp(x, y, method=method).pvalue < SIGNIFICANT:  # type: ignore[union-attr]
        return True
    sources = [levels.provenance.distribution for levels in sets]
    if sources[0] and sources[0] == sources[1]:
        return False
    (mean_x, spread_x), (mean_y, spread_y) = (
        _mean_and_spread(levels, values, owner, factor, k) for levels, values in zip(sets, (x, y), strict=True)
    )
    return max(abs(mean_x - mean_y), abs(spread_x - spread_y)) > MATERIAL * max(spread_x, spread_y)


def _mean_and_spread(
    levels: Levels, values: np.ndarray, owner: type, factor: type[Factor], k: int
) -> tuple[float, float]:
    """Mean and spread under the distribution that the levels come from; of the values where none is known."""
    known = moments.source_moments(levels).get((owner, factor))
    if known is None:
        return float(values.mean()), float(values.std())
    return float(known[0][k]), float(np.sqrt(known[1][k]))


def _ranges(sets: Sequence[Levels], owner: type, factor: type[Factor]) -> str:
    """The ranges of the numbers in both sets; of a vector, of its first component that differs."""
    k = next((k for k in range(factor.width) if _component_differs(sets, owner, factor, k)), 0)
    ends = [(values.min(), values.max()) for values in (_values(levels, owner, factor)[:, k] for levels in sets)]
    return " against ".join(f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}" for low, high in ends)


def _merged_types(sets: Sequence[Levels]) -> list[str]:
    """The entity types of the user's in one set that the mode ``reference`` takes for types of the other.

    Types of SEGAR with the same factors differ by the values of these alone, which the mode sees.
    """
    present = [entity_types(levels) for levels in sets]
    found = []
    for mine, others, place in ((*present, "first"), (*present[::-1], "second")):
        numbers = [{f for f in kind.declared if f.width} for kind in others]
        own = [kind for kind in mine if kind not in others and kind.__module__.partition(".")[0] != "segar"]
        merged = [kind.__name__ for kind in own if {f for f in kind.declared if f.width} in numbers]
        if merged:
            found.append(f"entity {', '.join(merged)}: only in the {place} set; mode 'exact' tells it from others")
    return found


def _parameters_of_rules(a: Levels, b: Levels) -> tuple[type[Parameter], ...]:
    """The parameters that say which rules hold in a level, with their constants, where both sets have the same ones."""
    first, second = (None if levels.world is None else levels.world.space for levels in (a, b))
    if first is None or second is None or first.parameters != second.parameters:
        return ()
    return first.parameters


def _rule_sets_differ(a: Levels, b: Levels, parameters: Sequence[type[Parameter]]) -> bool:
    """Whether the rule sets have different distributions: by their rule spaces, and of levels made by hand by a test of each
    parameter."""
    if all(levels.provenance.distribution for levels in (a, b)):
        return rule_space_of(a).content != rule_space_of(b).content
    columns = [[_values(levels, Parameter, p)[:, 0] for levels in (a, b)] for p in parameters]
    tested = [scipy.stats.ks_2samp(x, y).pvalue for x, y in columns]  # type: ignore[union-attr]
    return min(tested) < SIGNIFICANT / len(tested)


def _shared(a: Levels, b: Levels, mode: str) -> str:
    """Which share of the second set's rule sets is in the first set, in words."""
    known = {row.tobytes() for row in active_options(a)}
    options = np.mean([row.tobytes() in known for row in active_options(b)])
    numbers = (
        "their parameters count as numbers" if mode == "exact" else "mode 'exact' takes their parameters as numbers"
    )
    return (
        f"rule sets: {len(shared_rule_sets(b, a)) / len(b):.0%} of the second set's occur in the first,"
        f" {options:.0%} but for their constants; {numbers}, and segar.metrics.dynamics_w2 compares what they do"
    )


def _rules(a: Levels, b: Levels) -> list[str]:
    """What only one of the sets has of rules and contacts, as one text; none where they are the same."""
    if a.world is b.world and a.provenance.rules == b.provenance.rules:
        return []
    by_name = any(levels.world is None and levels.provenance.rules for levels in (a, b))
    of_a, of_b = (_rules_of(levels, by_name) for levels in (a, b))
    only = [
        ", ".join(dict.fromkeys(text for key, text in x.items() if key not in y))
        for x, y in ((of_a, of_b), (of_b, of_a))
    ]
    texts = [
        f"{names} only in the {place} set" for names, place in zip(only, ("first", "second"), strict=True) if names
    ]
    return [f"rules: {' and '.join(texts)}; no distance sees them"] if texts else []


def _rules_of(levels: Levels, by_name: bool) -> dict[str, str]:
    """What decides whether two rules are the same, to what they are called.

    Args:
        by_name: the rules alone, by their names, because the other levels know no more.
    """
    world = levels.world or World()
    if by_name:
        named = levels.provenance.rules if levels.world is None else ()
        names = [place.partition(" (")[0] for place in named or [rule.where for rule in world.rules]]
        return {name: name for name in names}
    found = {f"{rule.where} {rule.priority} {rule.tree!r} {_relation(rule)}": rule.where for rule in world.rules}
    for name in ("limit", "wall_contact", "pair_contact", "solid"):
        rule = getattr(world, name)
        found[f"{name} {rule and (rule.where, repr(rule.tree))}"] = f"{name}={rule and rule.where}"
    found |= {f"on_contact {rule.where} {rule.tree!r}": rule.where for rule in world.on_contact}
    return found | {f"walls {world.walls}": f"walls={world.walls:g}"}


def _relation(rule: object) -> str:
    relation = getattr(rule, "relation", None)
    return "" if relation is None else repr(getattr(relation, "truth", relation))
