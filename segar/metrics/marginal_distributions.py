"""The distributions of factors, of numbers of entities and of world parameters under a level distribution."""

from typing import Any

import numpy as np
import scipy

from segar.errors import LevelError
from segar.language import Entity, Factor, GlobalFriction, Parameter
from segar.levels import LevelDistribution, SamplingPlan, SlotGroup, marginals, mix, slot_distributions
from segar.noise import Affine, Choice, Deterministic, Noise, as_noise


def possible_types(distribution: LevelDistribution) -> list[type[Entity]]:
    """The entity types that a level of the distribution can hold, in order of the layout; without the arena's floor."""
    return [
        t
        for t in distribution.layout.types
        if not issubclass(t, GlobalFriction) and count_distribution(distribution, t).support[1] > 0
    ]


def count_distribution(distribution: LevelDistribution, entity: type[Entity]) -> Noise:
    """The distribution of the number of entities of a type in a level.

    Each entry of ``numbers`` adds a number that is binomial given how many of its slots are filled.
    """
    plan = distribution.plan
    chances = np.ones(1)
    for group in plan.groups:
        chances = np.convolve(chances, _group_count(group, _share(plan, group, entity)))
    kept = np.flatnonzero(chances)
    chances = chances[kept] / chances[kept].sum()
    return Deterministic(float(kept[0])) if len(kept) == 1 else Choice(kept.tolist(), chances.tolist())


def factor_distribution(distribution: LevelDistribution, entity: type[Entity], factor: type[Factor]) -> Noise:
    """The distribution of a factor of an entity that is picked at random among all entities of the type.

    As drawn: before placement draws positions again, or moves things.

    Raises:
        LevelError: the distribution has no such entities, or the factor's prior depends on other factors, so that
            its distribution is known through samples only.
    """
    plan = distribution.plan
    parts: list[tuple[Noise, float]] = []
    for group in plan.groups:
        share = _share(plan, group, entity)
        if share == 0.0:
            continue
        for place in range(len(group.slots)):
            found = slot_distributions(plan, group, place, only=plan.layout.types.index(entity))
            if factor not in found:
                raise LevelError(
                    f"{distribution}: {entity.__name__} has no {factor.__name__} with a distribution of its own: its prior"
                    " reads other factors. Compare with levels drawn from the distribution, or leave it out by factors=[...]"
                )
            values, masses = as_noise(group.count).atoms
            parts.append((found[factor], share * float(masses[values > place].sum())))
    if not parts:
        raise LevelError(f"{distribution} has no {entity.__name__}")
    return mix(parts)


def parameter_distribution(distribution: LevelDistribution, parameter: type[Parameter]) -> Noise:
    """The distribution of a world parameter; the default where the distribution does not know it."""
    known: Any = marginals(distribution.plan)["parameters"]
    return known.get(parameter, Deterministic(float(parameter.default)))


def component(noise: Noise, axis: int) -> Noise:
    """The distribution of component ``axis`` (0 or 1) of a distribution on the plane; one on the line itself."""
    if noise.width == 1:
        return noise
    if isinstance(noise, Deterministic):
        return Deterministic(noise.value[axis])
    if isinstance(noise, Affine):
        return Affine(component(noise.law, axis), noise.scale, noise.shift[axis])
    parts = getattr(noise, "laws", None)
    if parts is not None:
        weights: Any = noise.weights  # type: ignore[attr-defined]
        return mix([(component(part, axis), w) for part, w in zip(parts, weights, strict=True) if w > 0])
    if noise.components is not None:
        return noise.components[axis]
    values, masses = noise.atoms
    if abs(masses.sum() - 1) < 1e-9:
        return Choice(values[:, axis].tolist(), masses.tolist())
    return _Component(noise, axis)


class _Component(Noise):
    """One component of a distribution on the plane, from its ``sample``, ``cdf``, ``support`` and ``grid`` alone."""

    def __init__(self, noise: Noise, axis: int) -> None:
        self._noise, self._axis = noise, axis

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self._noise.sample(rng, size)[..., self._axis]

    def cdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        point = np.full((*x.shape, 2), self._noise.support[1 - self._axis][1])
        point[..., self._axis] = x
        return self._noise.cdf(point)

    @property
    def pieces(self) -> np.ndarray:
        grid: Any = self._noise.grid  # type: ignore[attr-defined]
        return np.unique(grid[self._axis])


def _share(plan: SamplingPlan, group: SlotGroup, entity: type[Entity]) -> float:
    """Probability that a filled slot of the group holds an entity of the type."""
    pairs = zip(group.types, group.probabilities, strict=True)
    return sum(p for kind, p in pairs if plan.layout.types[kind] is entity)


def _group_count(group: SlotGroup, share: float) -> np.ndarray:
    """Probabilities of 0, 1, ... entities of a type that fills each filled slot with probability ``share``."""
    values, masses = as_noise(group.count).atoms
    chances = np.zeros(int(values.max()) + 1)
    for value, mass in zip(values.astype(int), masses, strict=True):
        at_most = scipy.special.bdtr(np.arange(value + 1), value, share)
        chances[: value + 1] += mass * np.diff(at_most, prepend=0.0)
    return np.where(chances > 1e-15, chances, 0.0)
