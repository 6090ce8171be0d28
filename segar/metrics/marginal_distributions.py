"""The laws that a level distribution gives to what a distance looks at: factors by entity type, counts, parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from segar.errors import LevelError
from segar.language import Entity, Factor, GlobalFriction, Parameter
from segar.levels import marginals, mix, slot_laws
from segar.noise import Affine, Choice, Deterministic, Independent, Noise, as_noise

if TYPE_CHECKING:
    from segar.levels import Group, LevelDistribution, Plan


def law_types(law: LevelDistribution) -> list[type[Entity]]:
    """The entity types that a level of the distribution can hold, in order of the layout; without the arena's floor."""
    return [t for t in law.layout.types if not issubclass(t, GlobalFriction) and count_law(law, t).support[1] > 0]


def count_law(law: LevelDistribution, entity: type[Entity]) -> Noise:
    """The law of the number of entities of a type in a level.

    Each entry of ``numbers`` adds a number that is binomial given how many of its slots are filled.
    """
    plan = law._plan
    chances = np.ones(1)
    for group in plan.groups:
        chances = np.convolve(chances, _group_count(group, _share(plan, group, entity)))
    kept = np.flatnonzero(chances)
    chances = chances[kept] / chances[kept].sum()
    return Deterministic(float(kept[0])) if len(kept) == 1 else Choice(kept.tolist(), chances.tolist())


def factor_law(law: LevelDistribution, entity: type[Entity], factor: type[Factor]) -> Noise:
    """The law of a factor of an entity that is picked at random among all entities of the type.

    As drawn: before placement draws positions again, or moves things.

    Raises:
        LevelError: the distribution has no such entities, or the factor's prior depends on other factors, so that
            its law is known through samples only.
    """
    plan = law._plan
    parts: list[tuple[Noise, float]] = []
    for group in plan.groups:
        share = _share(plan, group, entity)
        if share == 0.0:
            continue
        for place in range(len(group.slots)):
            found = slot_laws(plan, group, place, only=plan.layout.types.index(entity))
            if factor not in found:
                raise LevelError(
                    f"{law}: {entity.__name__} has no {factor.__name__} with a law of its own: its prior reads other"
                    " factors. Compare with levels drawn from the distribution, or leave it out by factors=[...]"
                )
            parts.append((found[factor], share * _filled(group, place)))
    if not parts:
        raise LevelError(f"{law} has no {entity.__name__}")
    return mix(parts)


def parameter_law(law: LevelDistribution, parameter: type[Parameter]) -> Noise:
    """The law of a world parameter; the default where the distribution does not know it."""
    known: Any = marginals(law._plan)["parameters"]
    return known.get(parameter, Deterministic(float(parameter.default)))


def component(law: Noise, axis: int) -> Noise:
    """The law of one component of a law on the plane; of a law on the line, the law itself."""
    if law.width == 1:
        return law
    if isinstance(law, Deterministic):
        return Deterministic(law.value[axis])
    if isinstance(law, Independent):
        return (law.x, law.y)[axis]
    if isinstance(law, Affine):
        return Affine(component(law.law, axis), law.scale, law.shift[axis])
    parts = getattr(law, "laws", None)
    if parts is not None:
        weights: Any = law.weights  # type: ignore[attr-defined]
        return mix([(component(part, axis), w) for part, w in zip(parts, weights, strict=True) if w > 0])
    pair = getattr(law, "components", None) or getattr(law, "_marginals", None)
    if pair is not None:
        return pair[axis]
    values, masses = law.atoms
    if abs(masses.sum() - 1) < 1e-9:
        return Choice(values[:, axis].tolist(), masses.tolist())
    return _Component(law, axis)


class _Component(Noise):
    """One component of a law on the plane of which nothing but ``sample``, ``cdf``, ``support`` and ``grid`` is known."""

    def __init__(self, law: Noise, axis: int) -> None:
        self._law, self._axis = law, axis

    def sample(self, rng: Any, size: Any = None) -> Any:
        return self._law.sample(rng, size)[..., self._axis]

    def cdf(self, x: Any) -> Any:
        x = np.asarray(x, dtype=float)
        point = np.full((*x.shape, 2), self._law.support[1 - self._axis][1])
        point[..., self._axis] = x
        return self._law.cdf(point)

    @property
    def pieces(self) -> np.ndarray:
        grid: Any = self._law.grid  # type: ignore[attr-defined]
        return np.unique(grid[self._axis])


def _share(plan: Plan, group: Group, entity: type[Entity]) -> float:
    """Probability that a filled slot of the group holds an entity of the type."""
    pairs = zip(group.types, group.probabilities, strict=True)
    return sum(p for kind, p in pairs if plan.layout.types[kind] is entity)


def _filled(group: Group, place: int) -> float:
    values, masses = as_noise(group.count).atoms
    return float(masses[values > place].sum())


def _group_count(group: Group, share: float) -> np.ndarray:
    """Probabilities of 0, 1, ... entities of a type that fills each filled slot with probability ``share``."""
    from scipy.special import bdtr

    values, masses = as_noise(group.count).atoms
    chances = np.zeros(int(values.max()) + 1)
    for value, mass in zip(values.astype(int), masses, strict=True):
        at_most = bdtr(np.arange(value + 1), value, share)
        chances[: value + 1] += mass * np.diff(at_most, prepend=0.0)
    return np.where(chances > 1e-15, chances, 0.0)
