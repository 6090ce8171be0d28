"""Pairs of distribution functions, one pair for each marginal of two level sets or distributions."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np

from segar.errors import LevelError
from segar.language import Entity, Factor, Parameter
from segar.levels import LevelDistribution, Levels, checks, entity_types, gather, moments
from segar.metrics import marginal_distributions
from segar.metrics.points import cut, relevant_factors
from segar.noise import Noise, Wrapped, ks_candidates, ks_line

GRID = 512  # steps of probability at which the curve of two distributions is taken
ROUNDING = 1e-12  # that two computations of one probability may differ by

Curve = tuple[np.ndarray, np.ndarray]
"""F and G at the same points in ascending order, each float64 ``[points]``, beginning anywhere and ending in (1, 1)."""

FLAT: Curve = (np.ones(1), np.ones(1))
"""The curve of a marginal that is the same on both sides."""


@dataclass(frozen=True)
class TwoSamples:
    """A marginal of two level sets; ``rank`` and ``level`` are kept so that levels can be dealt anew cheaply."""

    name: str
    x: np.ndarray
    y: np.ndarray
    level_x: np.ndarray
    level_y: np.ndarray

    @cached_property
    def rank(self) -> np.ndarray:
        """Of each value among all values of both sets, equal ones alike."""
        return np.unique(np.concatenate([self.x, self.y]), return_inverse=True)[1]

    def curve(self) -> Curve:
        return self._curve(np.arange(len(self.rank)) < len(self.x))

    def _curve(self, first: np.ndarray) -> Curve:
        places = self.rank.max() + 1
        f, g = (
            np.bincount(self.rank[mask], minlength=places).cumsum() / max(mask.sum(), 1) for mask in (first, ~first)
        )
        return f, g

    def largest_difference(self) -> float:
        f, g = self.curve()
        return float(np.abs(f - g).max())

    def dealt(self, first: np.ndarray, n: int) -> Curve:
        """The curve after the pooled levels were dealt anew: ``first`` bool ``[levels of both]``, ``n`` in the first set."""
        in_first = first[np.concatenate([self.level_x, n + self.level_y])]
        # A deal may leave a set without any entity of a type: then there is the count alone, as for given sets.
        return FLAT if in_first.all() or not in_first.any() else self._curve(in_first)


@dataclass(frozen=True)
class SampleAgainstDistribution:
    """A marginal of a level set, and the distribution of that marginal in a distribution."""

    name: str
    sample: np.ndarray
    level: np.ndarray
    noise: Noise

    def curve(self) -> Curve:
        return self._curve(slice(None))

    def parts(self, n: int, count: int) -> Iterator[Curve]:
        """The curve of each of ``count`` level sets that follow each other in the sample, ``n`` levels each."""
        ends = np.searchsorted(self.level, np.arange(count + 1) * n)
        for i, j in pairwise(ends):
            yield self._curve(slice(i, j)) if j > i else FLAT

    @cached_property
    def _noise_at_values(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rank of each value of the sample, and the distribution's function at the distinct values and just before them."""
        at, rank = np.unique(self.sample, return_inverse=True)
        g = np.asarray(self.noise.cdf(at), dtype=float)
        return rank, g, np.maximum(g - np.asarray(self.noise.pmf(at), dtype=float), 0.0)

    def _curve(self, part: slice) -> Curve:
        """Both functions just before a part's values and at them: between these F is constant and G monotonic."""
        rank, g, before = self._noise_at_values
        ranks = np.sort(rank[part])
        last = np.flatnonzero(np.append(ranks[1:] != ranks[:-1], True))  # of each distinct value
        places, f = ranks[last], (last + 1) / len(ranks)
        f = np.stack([np.append(0.0, f[:-1]), f], axis=1).ravel()
        return np.append(f, 1.0), np.append(np.stack([before[places], g[places]], axis=1), 1.0)

    @property
    def is_constant(self) -> bool:
        """Whether the distribution and all of the sample are one and the same number."""
        _, g, before = self._noise_at_values
        return len(g) == 1 and before[0] == 0.0 and g[0] == 1.0

    def largest_difference(self) -> float:
        f, g = self.curve()
        return _without_rounding(float(np.abs(f - g).max()))


@dataclass(frozen=True)
class TwoDistributions:
    """A marginal of two distributions."""

    name: str
    a: Noise
    b: Noise

    def curve(self) -> Curve:
        """Both functions at the quantiles of both distributions in steps of 1/512, at their atoms, and just before these."""
        if self.a == self.b:
            return FLAT
        at = ks_candidates(self.a, self.b, GRID - 1)
        return np.append(self.a.cdf(at), 1.0), np.append(self.b.cdf(at), 1.0)

    def largest_difference(self) -> float:
        return 0.0 if self.a == self.b else _without_rounding(ks_line(self.a, self.b))


Marginal = TwoSamples | SampleAgainstDistribution | TwoDistributions


def factor_marginals(what: str, a: Any, b: Any, factors: Sequence[type[Factor]] | None) -> list[Any]:
    """The marginals of two sides, each levels or a distribution, in the name of the function ``what``.

    Of a sample against a sample, the states that episodes start in count; against a distribution, states as drawn.
    """
    for one in (a, b):
        if not isinstance(one, (Levels, LevelDistribution)):
            raise LevelError(
                f"{what} compares level sets (segar.Levels) and distributions (segar.LevelDistribution);"
                f" a {type(one).__name__} is not supported"
            )
    sides = [_Side(one, as_drawn=not (isinstance(a, Levels) and isinstance(b, Levels))) for one in (a, b)]
    checks.require_factors(what, factors, a, b)
    types = list(dict.fromkeys(t for side in sides for t in side.types()))
    found = []
    for entity in types:
        found.append(_marginal(f"{entity.__name__}.count", *(side.count(entity) for side in sides)))
        if all(entity in side.types() for side in sides):
            for factor in relevant_factors(entity, factors):
                values = [side.values(entity, factor) for side in sides]
                for axis in range(factor.width):
                    name = f"{entity.__name__}.{factor.__name__}{('', '.x', '.y')[axis + factor.width - 1]}"
                    found.append(_marginal(name, *(_axis(v, axis) for v in values)))
    parameters = dict.fromkeys(p for side in sides for p in side.one.layout.parameters)
    for parameter in parameters:
        if factors is None or parameter in factors:
            found.append(_marginal(f"world.{parameter.__name__}", *(side.parameter(parameter) for side in sides)))
    return found


Values = Noise | tuple[np.ndarray, np.ndarray]
"""A distribution; or values float64 ``[k]`` (``[k, width]`` for all components) and the level of each, int ``[k]``."""


@dataclass(frozen=True)
class _Side:
    """One side of a comparison."""

    one: Levels | LevelDistribution
    as_drawn: bool

    def types(self) -> list[type[Entity]]:
        if not isinstance(self.one, Levels):
            return marginal_distributions.possible_types(self.one)
        return entity_types(self.one)

    def count(self, entity: type[Entity]) -> Values:
        if not isinstance(self.one, Levels):
            return marginal_distributions.count_distribution(self.one, entity)
        return gather(self.one, [entity], [], self.one.values).counts.astype(float), np.arange(len(self.one))

    def values(self, entity: type[Entity], factor: type[Factor]) -> Values:
        if not isinstance(self.one, Levels):
            return _cut_noise(marginal_distributions.factor_distribution(self.one, entity, factor), factor)
        if self.as_drawn:
            found = gather(self.one, [entity], [factor], self.one.sampled_values)
        else:
            found = moments.gather_state(self.one, entity, [factor])
        return cut(found.points, factor), np.repeat(np.arange(len(self.one)), found.counts)

    def parameter(self, parameter: type[Parameter]) -> Values:
        if not isinstance(self.one, Levels):
            return _cut_noise(marginal_distributions.parameter_distribution(self.one, parameter), parameter)
        return cut(moments.gather_parameters(self.one, [parameter]).points[:, 0], parameter), np.arange(len(self.one))


def _cut_noise(noise: Noise, factor: type[Factor]) -> Noise:
    return noise if factor.period is None else Wrapped(noise, factor.period)


def _axis(values: Values, axis: int) -> Values:
    return (
        marginal_distributions.component(values, axis) if isinstance(values, Noise) else (values[0][:, axis], values[1])
    )


def _marginal(name: str, a: Values, b: Values) -> Marginal:
    if isinstance(a, Noise):
        return TwoDistributions(name, a, b) if isinstance(b, Noise) else SampleAgainstDistribution(name, *b, a)
    if isinstance(b, Noise):
        return SampleAgainstDistribution(name, *a, b)
    return TwoSamples(name, a[0], b[0], a[1], b[1])


def _without_rounding(value: float) -> float:
    return 0.0 if value < ROUNDING else min(value, 1.0)
