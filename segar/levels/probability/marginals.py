"""The laws of the factors of a level distribution, slot by slot."""

from __future__ import annotations

from segar.language import Factor, FloorFriction, Friction, Order, Position, Size
from segar.levels.priors import Prior, factors_needed, factors_read
from segar.levels.sampling.plan import Group, Plan
from segar.noise import Choice, Deterministic, DiscreteRangeNoise, Mixture, Noise, as_noise

Laws = dict[type[Factor], Noise]


def marginals(plan: Plan) -> dict[str, Laws]:
    """Slot name to factor to law, and ``"parameters"`` to parameter to law; see ``LevelDistribution.marginals``."""
    drawn = {plan.layout.parameters[place]: prior.value for place, prior in plan.parameter_priors}
    constants = zip(plan.layout.parameters, plan.parameters.tolist(), strict=True)
    parameters: Laws = {p: drawn.get(p) or Deterministic(value) for p, value in constants}
    laws: dict[str, Laws] = {}
    for group in plan.groups:
        for place, slot in enumerate(group.slots):
            laws[plan.layout.names[slot]] = slot_laws(plan, group, place)
    laws[plan.layout.names[-1]] = {Friction: parameters[FloorFriction]}
    laws["parameters"] = parameters
    return laws


def slot_laws(plan: Plan, group: Group, place: int, only: int | None = None) -> Laws:
    """The laws of one slot's factors, given that it is filled; ``only``: by that type, an index in ``layout.types``."""
    parts: dict[type[Factor], list[tuple[Noise, float]]] = {}
    conditional: set[type[Factor]] = set()
    slot = group.slots[place]
    for kind, probability in zip(group.types, group.probabilities, strict=True):
        if only is not None and kind != only:
            continue
        for factor in plan.layout.types[kind].declared:
            if not factor.width:
                continue
            prior = _drawn(plan, slot, factor, kind)
            if prior is not None and factors_needed(prior):
                conditional.add(factor)
                continue
            law = prior.value if prior is not None else _undrawn(plan, slot, factor, kind)
            if factor is Order and law == Deterministic(0.0):
                law = _rank_law(plan, group, place)
            parts.setdefault(factor, []).append((law, probability))
    return {factor: mix(found) for factor, found in parts.items() if factor not in conditional}


def _drawn(plan: Plan, slot: int, factor: type[Factor], kind: int) -> Prior | None:
    """The prior that the factor is drawn from, None for a constant; a conditional one where there is any."""
    for draw in plan.draws:
        if draw.slot == slot and draw.factor is factor and kind in draw.types:
            return next((p for p in draw.priors if factors_read(p)), draw.priors[-1])
    return None


def _undrawn(plan: Plan, slot: int, factor: type[Factor], kind: int) -> Noise:
    """The constant that a factor starts with, or the size of a shape that is chosen."""
    if factor is Position and slot in plan.fixed_positions:
        return Deterministic(plan.fixed_positions[slot])
    if factor is Size:
        for outline in plan.outlines:
            if outline.slot == slot and kind in outline.types and isinstance(outline.shapes, Choice):
                return Choice([shape.size for shape in outline.shapes.keys], outline.shapes.p)
    column = plan.layout.columns[factor]
    value = plan.templates[kind, column : column + factor.width].tolist()
    return Deterministic(value if factor.width == 2 else value[0])


def _rank_law(plan: Plan, group: Group, place: int) -> Noise:
    """A random rank among all things of a level, given that this slot is filled."""
    totals = {0: 1.0}
    for other in plan.groups:
        if not all(Order in plan.layout.types[kind].declared for kind in other.types):
            continue
        values, masses = as_noise(other.count).atoms
        allowed = [(int(v), m) for v, m in zip(values, masses, strict=True) if other is not group or v > place]
        mass = sum(m for _, m in allowed)
        grown: dict[int, float] = {}
        for total, weight in totals.items():
            for value, m in allowed:
                grown[total + value] = grown.get(total + value, 0.0) + weight * m / mass
        totals = grown
    return mix([(DiscreteRangeNoise(0, total - 1), weight) for total, weight in totals.items()])


def mix(parts: list[tuple[Noise, float]]) -> Noise:
    """The mixture of laws by weights that need not sum to one; equal laws are joined."""
    weights: dict[Noise, float] = {}
    for law, weight in parts:
        weights[law] = weights.get(law, 0.0) + weight
    if len(weights) == 1:
        return next(iter(weights))
    total = sum(weights.values())
    return Mixture(list(weights), [weight / total for weight in weights.values()])
