"""A distribution in words, for ``segar describe`` and notebooks: its entities, and the distributions of their factors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.language import Factor, Position, Shape
from segar.levels import Draw, LevelDistribution, factors_needed
from segar.noise import Choice, Deterministic, Empirical, Noise, as_noise

CONDITIONAL_SAMPLE = 2000  # levels that show a factor whose distribution depends on others
SPLIT = "describe"
NOTHING: dict[str, Any] = dict.fromkeys(("mean", "sd", "low", "high"))  # is known of a distribution


@dataclass(frozen=True)
class Described:
    """The distribution of one factor of one entity; of shapes, which are no numbers, the shape or a choice of shapes.

    Attributes:
        reads: names of the factors that decide it level by level; the distribution is then that in 2,000 levels.
    """

    entity: str
    factor: type[Factor]
    law: Any
    reads: tuple[str, ...] = ()

    def row(self) -> dict[str, Any]:
        """Distribution, mean, standard deviation and support, of distributions on the plane as pairs; None if unknown."""
        depends = f"depends on {', '.join(self.reads)}; drawn: " if self.reads else ""
        numbers = _numbers(self.law) if isinstance(self.law, Noise) and self.law.width else NOTHING
        return {"entity": self.entity, "factor": self.factor.__name__, "law": f"{depends}{self.law!r}", **numbers}


def described(distribution: LevelDistribution) -> list[Described]:
    """The distributions of all factors, entity by entity, and of the world parameters."""
    found = []
    shapes, conditional = _shapes(distribution), _conditional(distribution)
    for entity, laws in distribution.marginals().items():
        found += [Described(entity, factor, law) for factor, law in laws.items()]
        found += [*conditional.get(entity, ()), *shapes.get(entity, ())]
    return found


def composition(distribution: LevelDistribution) -> dict[str, dict[str, Any]]:
    """By entity: its ``types``, their ``probabilities``, whether it is ``optional``, and the probability that it is
    ``there``."""
    plan, found = distribution.plan, {}
    for group in plan.groups:
        values, masses = as_noise(group.count).atoms
        shares: dict[str, float] = {}
        for kind, probability in zip(group.types, group.probabilities, strict=True):
            name = plan.layout.types[kind].__name__
            shares[name] = shares.get(name, 0.0) + float(probability)
        for place, slot in enumerate(group.slots):
            found[plan.layout.names[slot]] = {
                "types": list(shares),
                "probabilities": list(shares.values()),
                "optional": plan.layout.slots[slot].optional,
                "there": float(masses[values > place].sum()),
            }
    floor = plan.layout.slots[-1]
    return found | {floor.name: {"types": ["GlobalFriction"], "probabilities": [1.0], "optional": False, "there": 1.0}}


@dataclass(frozen=True)
class Varying:
    """What varies between levels, alike for some entities: their number, their type, a factor or a world parameter.

    Attributes:
        law: its distribution, or a random shape; of types, a choice of names.
        unit: of its values, empty where it has none.
    """

    title: str
    entities: list[str]
    law: Any
    unit: str = ""


def varying(distribution: LevelDistribution) -> list[Varying]:
    """Every marginal that is not constant: numbers of entities, then types, factors and world parameters."""
    plan = distribution.plan
    laws = [([plan.layout.names[slot] for slot in group.slots], as_noise(group.count)) for group in plan.groups]
    found = [Varying("number", names, law) for names, law in laws if len(law.atoms[0]) > 1]
    alike: dict[Any, Varying] = {}
    for name, slot in composition(distribution).items():
        if len(slot["types"]) > 1:
            law = Choice(slot["types"], slot["probabilities"])
            alike.setdefault(law, Varying("type", [], law)).entities.append(name)
    for one in described(distribution):
        if not is_constant(one.law):
            title = one.factor.__name__ + (f" (depends on {', '.join(one.reads)})" if one.reads else "")
            unit = Position.unit if one.factor is Shape else one.factor.unit
            alike.setdefault((title, one.law), Varying(title, [], one.law, unit)).entities.append(one.entity)
    return found + list(alike.values())


def together(names: Sequence[str]) -> str:
    """Names in a row, three or more that count on as ``"ball1 to ball10"``."""
    runs: list[list[str]] = []
    for name in names:
        if runs and name == _next_name(runs[-1][-1]):
            runs[-1].append(name)
        else:
            runs.append([name])
    return ", ".join(f"{run[0]} to {run[-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def _next_name(name: str) -> str | None:
    """The name that counts on after this one, as ``ball10`` after ``ball9``; None if the name has no number."""
    stem = name.rstrip("0123456789")
    return None if stem == name else f"{stem}{int(name.removeprefix(stem)) + 1}"


def _shapes(distribution: LevelDistribution) -> dict[str, list[Described]]:
    found: dict[str, list[Described]] = {}
    for outline in distribution.plan.outlines:
        name = distribution.layout.names[outline.slot]
        found.setdefault(name, []).append(Described(name, Shape, outline.shapes))
    return found


def _conditional(distribution: LevelDistribution) -> dict[str, list[Described]]:
    """What ``marginals`` leaves out, as it is in some levels; entities that share their priors share a distribution."""
    plan, known = distribution.plan, distribution.marginals()
    draws: dict[tuple[int, type[Factor]], list[Draw]] = {}
    for draw in plan.draws:
        if draw.factor not in known[plan.layout.names[draw.slot]]:
            draws.setdefault((draw.slot, draw.factor), []).append(draw)
    alike: dict[Any, list[int]] = {}
    for (slot, factor), mine in draws.items():
        alike.setdefault((factor, *((draw.types, draw.priors) for draw in mine)), []).append(slot)
    found: dict[str, list[Described]] = {}
    levels = distribution.sample(CONDITIONAL_SAMPLE, split=SPLIT) if alike else None
    for (factor, *parts), slots in alike.items():
        assert levels is not None
        values = levels.sampled_values[:, slots, plan.layout.columns_of(factor)].reshape(-1, factor.width)
        values = values[~np.isnan(values[:, 0])]
        needed = {one for _, priors in parts for prior in priors for one in factors_needed(prior)}
        reads = sorted(f.__name__ if owner is None else f"{owner}.{f.__name__}" for owner, f in needed)
        law = Empirical(values if factor.width == 2 else values[:, 0])
        for slot in slots:
            name = plan.layout.names[slot]
            found.setdefault(name, []).append(Described(name, factor, law, tuple(reads)))
    return found


def _numbers(law: Noise) -> dict[str, Any]:
    try:
        mean, deviation = np.asarray(law.mean, float), np.sqrt(np.asarray(law.var, float))
        support = np.asarray(law.support, float).reshape(-1, 2)
    except PriorError:  # a user's distribution need not have a distribution function
        return NOTHING
    if isinstance(law, Deterministic):
        deviation = np.zeros_like(mean)
    found = {"mean": mean, "sd": deviation, "low": support[:, 0], "high": support[:, 1]}
    return {name: value.tolist() if np.size(value) > 1 else float(np.ravel(value)[0]) for name, value in found.items()}


def is_constant(law: Any) -> bool:
    """Whether a factor with this distribution, or this shape, is the same in all levels."""
    if isinstance(law, Choice):
        return len(set(law.keys)) == 1
    return isinstance(law, Deterministic) if isinstance(law, Noise) else not law.is_random
