"""Distances between worlds: the same states and the same actions, and how far apart they lead.

What becomes of a state is found by roll-outs, which this room cannot make: :func:`segar.hardness.make_situations` makes the
states, the actions and the roll-outs, and the functions here take them as an argument.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol, runtime_checkable

import numpy as np

from segar.errors import LevelError
from segar.language import Entity, Factor
from segar.levels import WITHOUT_EFFECT, Levels, checks, entity_types
from segar.metrics.points import Spread, Units, shorter_way
from segar.metrics.transport import squares_between
from segar.metrics.wasserstein import Resampled, resampled
from segar.support import Estimate, aligned, counted, emd

BLOCKS = 10  # of situations, of which the jackknife leaves out one at a time
ROUNDING = 1e-12  # a smaller standard error, as a share, is what arithmetic adds


@dataclass(frozen=True, eq=False)
class Readings:
    """Which numbers of a state count, and in which units; ``R`` numbers, each one column of one slot.

    Attributes:
        slot, column: int64 ``(R,)``.
        scale: float64 ``(situations, R)``, one over the unit; 0 where the entity lacks the factor.
        periods: float64 ``(situations, R)`` in units, infinite on the line.
        part: int64 ``(situations, R)``, index in ``names``; -1 where the entity lacks the factor.
        names: entity types and factors, as ``"GolfBall.Position"``.
    """

    slot: np.ndarray
    column: np.ndarray
    scale: np.ndarray
    periods: np.ndarray
    part: np.ndarray
    names: tuple[str, ...]

    def of(self, values: np.ndarray) -> np.ndarray:
        """The numbers of states ``(..., situations, plays, slots, columns)`` in units, ``(..., situations, plays, R)``."""
        scale = self.scale[:, None]
        return np.where(scale > 0, values[..., self.slot, self.column] * scale, 0.0)


def readings_of(what: str, states: Levels, scale: Spread | None, factors: Sequence[type[Factor]] | None) -> Readings:
    """The numbers of these states that count, in units of ``scale``, ``spread(states)`` for None; what has no spread counts in
    its own unit.

    Raises:
        LevelError: in the name of the function ``what``, if there are fewer than two states, or an argument is of the wrong
            kind, or no number counts.
    """
    if len(states) < 2:
        raise LevelError(f"{what} needs at least 2 states for a standard error, not {len(states)}")
    units, layout = Units.checked(what, (states,), scale, factors).scale, states.layout
    known = entity_types(states)
    counted = {kind: _counted(kind, factors) for kind in known}
    names = tuple(f"{kind.__name__}.{f.__name__}" for kind in known for f in counted[kind])
    shape = (len(states), len(layout.slots), layout.width)
    scales, periods, part = np.zeros(shape), np.full(shape, np.inf), np.full(shape, -1)
    for kind in known:
        here = states.types == layout.types.index(kind)
        for factor in counted[kind]:
            unit = units.get((kind, factor), 0.0) or 1.0
            at = layout.columns_of(factor)
            scales[here, at] = 1 / unit
            part[here, at] = names.index(f"{kind.__name__}.{factor.__name__}")
            if factor.period is not None:
                periods[here, at] = factor.period / unit
    slot, column = np.nonzero(scales.any(axis=0))
    if not len(slot):
        raise LevelError(f"{what}: no entity of these states has a factor that counts")
    scales, periods, part = (array[:, slot, column] for array in (scales, periods, part))
    return Readings(slot, column, scales, periods, part, names)


def _counted(kind: type[Entity], factors: Sequence[type[Factor]] | None) -> list[type[Factor]]:
    return [f for f in kind.declared if f.width and (f not in WITHOUT_EFFECT if factors is None else f in factors)]


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What becomes of the same situations under several rule sets.

    Attributes:
        values: float64 ``(rule sets, situations, plays, horizons, R)``, in units; see :class:`Readings`.
        of_level: int64 ``(levels,)``, index of each level's rule set.
        horizons: steps. readings: what the numbers are.
        is_random: whether rules draw random numbers.
    """

    values: np.ndarray
    of_level: np.ndarray
    horizons: tuple[int, ...]
    readings: Readings
    is_random: bool


@runtime_checkable
class HasOutcomes(Protocol):
    """What these distances need of situations; :class:`segar.hardness.Situations` has it."""

    def outcomes(self, levels: Levels, other_chance: bool = False) -> Outcomes: ...


@dataclass(frozen=True)
class DynamicsDistance:
    """How far two worlds go apart, in standard deviations of the states that they start from.

    Attributes:
        value: root mean square over situations, plays and horizons; error: its standard error over situations.
        floor: the distance of a world from itself under other random numbers, as root mean square of both worlds; 0 where
            their rules draw none.
        by_horizon: steps to the distance after so many steps; the mean of their squares is the square of ``value``.
        by_factor: ``"GolfBall.Position"`` to its part; the sum of their squares is the square of ``value``.
        parts: (name, steps) to the part of a factor after so many steps.
        situations: how many there were.
    """

    value: float
    error: float
    floor: float
    by_horizon: Mapping[int, Estimate]
    by_factor: Mapping[str, Estimate]
    parts: Mapping[tuple[str, int], Estimate]
    situations: int

    def __str__(self) -> str:
        horizons = list(self.by_horizon)
        moved = sorted((n for n, e in self.by_factor.items() if e.value), key=lambda n: -self.by_factor[n].value)
        rows = [["after steps", *map(str, horizons), "all"]]
        rows += [[n, *(str(self.parts[n, h]) for h in horizons), str(self.by_factor[n])] for n in moved]
        rows.append(["all", *(str(self.by_horizon[h]) for h in horizons), str(Estimate(self.value, self.error))])
        return f"{aligned(rows)}\n{counted(self.situations, 'situation')}; by chance alone {self.floor:.4g}"


@dataclass(frozen=True)
class DynamicsW2(Resampled):
    """The W2 distance between the rule sets of two level sets, in standard deviations of the states.

    Attributes:
        error: standard error of ``value`` over situations, by the jackknife.
        rule_sets: how many distinct ones each set has.
    """

    error: float
    rule_sets: tuple[int, int]

    def __str__(self) -> str:
        return (
            f"{Estimate(self.value, self.error)}, 95 % of resamples of levels {self.low:.4g} to {self.high:.4g}; random"
            f" deals {self.floor:.4g}, p = {self.p_value:.2g}; {' and '.join(map(str, self.rule_sets))} rule sets"
        )


def dynamics_distance(a: Levels, b: Levels, situations: HasOutcomes) -> DynamicsDistance:
    """How far two worlds go apart from the same states under the same actions.

    d(a, b)^2 is the mean over situations, plays and horizons of the sum, over entities and factors, of the squared difference
    of the two states, in units of the factor's standard deviation. Along a factor with a period the shorter way round counts.
    A factor that an entity lacks counts nothing; it lacks it in both worlds. So d is the Euclidean distance of two lists of
    numbers, and for given situations a pseudo-metric on worlds: d(a, a) = 0, it is symmetric, and it keeps the triangle
    inequality. Rules that draw are compared under equal draws.

    Args:
        a, b: levels of which all have one rule set: one world and one row of world parameters. Their entities do not count,
            but they are in the same slots as those of the situations.
        situations: from :func:`segar.hardness.make_situations`; the same ones for all distances that are compared.

    Raises:
        LevelError: the levels have several rule sets, or other entities than the situations.

    Source: the "what if" comparison of structural causal models (Pearl 2009, chapter 7): other mechanisms, all else equal.
    """
    _require("dynamics_distance", a, b, situations)
    x, y = (_one_rule_set(levels, situations.outcomes(levels)) for levels in (a, b))
    chance = [_by_chance(*each, situations) for each in ((x, a), (y, b))]
    squares, part = _differences(x, y), x.readings.part[:, None]
    summed = {  # [situation, horizon]
        name: np.where(part == k, squares, 0.0).sum(axis=-1) for k, name in enumerate(x.readings.names)
    }
    total = sum(summed.values(), np.zeros(squares.shape[:2]))
    value, error = _root(total.mean(axis=1))
    return DynamicsDistance(
        value=value,
        error=error,
        floor=float(np.sqrt(np.mean(chance))),
        by_horizon={h: _root(total[:, k]) for k, h in enumerate(x.horizons)},
        by_factor={name: _root(each.mean(axis=1)) for name, each in summed.items()},
        parts={(name, h): _root(each[:, k]) for name, each in summed.items() for k, h in enumerate(x.horizons)},
        situations=len(total),
    )


def rule_set_distances(a: Levels, b: Levels, situations: HasOutcomes) -> np.ndarray:
    """The :func:`dynamics_distance` of the world of each level of ``a`` and that of each level of ``b``.

    Every distinct rule set is rolled out once.

    Returns:
        float64 ``(len(a), len(b))``, in standard deviations of the states.

    Raises:
        LevelError: as :func:`dynamics_distance`.
    """
    _require("rule_set_distances", a, b, situations)
    x = situations.outcomes(a)
    y = x if a is b else situations.outcomes(b)
    return np.sqrt(squared_distances(x, y, 1)[0])[np.ix_(x.of_level, y.of_level)]


def dynamics_w2(
    a: Levels, b: Levels, situations: HasOutcomes, *, rng: np.random.Generator, resamples: int = 100
) -> DynamicsW2:
    """The Wasserstein-2 distance between the rule sets of two level sets: the least cost of turning the worlds of the one into
    those of the other, where two worlds cost their :func:`dynamics_distance` squared.

    Args:
        a, b: levels, e.g. of training and test; the rules and the world parameters count, and the entities do not.
        situations: from :func:`segar.hardness.make_situations`.
        rng: of the resamples. resamples: at least 2, of bootstrap draws and of random deals.

    Raises:
        LevelError: as :func:`dynamics_distance`, or too few resamples.
    """
    _require("dynamics_w2", a, b, situations)
    checks.require_generator("dynamics_w2", rng)
    checks.require_count("dynamics_w2", "resamples", resamples, 2)
    x, y = situations.outcomes(a), situations.outcomes(b)
    both, n = _joined(x, y), len(a)
    blocks = squared_distances(both, both, BLOCKS)[:, both.of_level][..., both.of_level]
    weights = [len(part) for part in _blocks(both, BLOCKS)]
    without = [
        np.sqrt(emd(np.average(np.delete(blocks, k, 0), axis=0, weights=np.delete(weights, k))[:n, n:]))
        for k in range(len(blocks))
    ]
    return DynamicsW2(
        **vars(resampled(np.average(blocks, axis=0, weights=weights), n, rng, resamples)),
        error=float(np.sqrt((len(without) - 1) * np.var(without))),
        rule_sets=(len(x.values), len(y.values)),
    )


def _require(what: str, a: Levels, b: Levels, situations: HasOutcomes) -> None:
    checks.require_levels(what, a, b)
    if not isinstance(situations, HasOutcomes):
        raise LevelError(
            f"{what} needs situations; a {type(situations).__name__} is none. Make them of levels:"
            " segar.hardness.make_situations(levels, rng=rng)"
        )


def _one_rule_set(levels: Levels, outcomes: Outcomes) -> Outcomes:
    if len(outcomes.values) != 1:
        raise LevelError(
            f"dynamics_distance compares two worlds, and {levels!r} have {len(outcomes.values)} rule sets; take one level,"
            " as levels[0], or compare all by dynamics_w2 or rule_set_distances"
        )
    return outcomes


def _by_chance(found: Outcomes, levels: Levels, situations: HasOutcomes) -> float:
    """The squared distance of a world from itself under other random numbers."""
    if not found.is_random:
        return 0.0
    again = situations.outcomes(levels, other_chance=True)
    return float(_differences(found, again).sum(axis=-1).mean())


def _differences(x: Outcomes, y: Outcomes) -> np.ndarray:
    """Squared differences of the first rule sets, in the mean over plays, float64 ``(situations, horizons, R)``."""
    apart, periods = x.values[0] - y.values[0], x.readings.periods[:, None, None]
    flat = shorter_way(apart.reshape(-1), np.broadcast_to(periods, apart.shape).reshape(-1))
    return (flat.reshape(apart.shape) ** 2).mean(axis=1)


def squared_distances(x: Outcomes, y: Outcomes, blocks: int) -> np.ndarray:
    """Squared distances of all rule sets in each block of situations, float64 ``(blocks, rule sets of x, of y)``."""
    plays, horizons = x.values.shape[2:4]
    found = []
    for part in _blocks(x, blocks):
        one, other = (each.values[:, part].reshape(len(each.values), -1) for each in (x, y))
        differs = (one != one[0]).any(axis=0) | (other != one[0]).any(axis=0)  # few numbers do, and the others add 0
        periods = np.broadcast_to(x.readings.periods[part][:, None, None], x.values[0, part].shape).reshape(-1)[differs]
        one = one[:, differs]
        squares = squares_between(one, one if x is y else other[:, differs], periods)
        found.append(squares / (len(part) * plays * horizons))
    return np.stack(found)


def _blocks(x: Outcomes, blocks: int) -> list[np.ndarray]:
    """The situations in so many blocks, or in as many as there are situations."""
    situations = x.values.shape[1]
    return np.array_split(np.arange(situations), min(blocks, situations))


def _joined(x: Outcomes, y: Outcomes) -> Outcomes:
    """The rule sets of both, one after the other."""
    of_level = np.concatenate([x.of_level, len(x.values) + y.of_level])
    return replace(x, values=np.concatenate([x.values, y.values]), of_level=of_level)


def _root(squares: np.ndarray) -> Estimate:
    """The root of the mean of numbers ``(situations,)``, and its standard error."""
    mean = float(squares.mean())
    error = float(squares.std(ddof=1) / np.sqrt(len(squares)))
    if error <= ROUNDING * mean:  # the same in all situations
        return Estimate(float(np.sqrt(mean)))
    return Estimate(float(np.sqrt(mean)), error / (2 * float(np.sqrt(mean))))
