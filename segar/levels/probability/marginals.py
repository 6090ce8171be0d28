"""The distributions of the factors of a level distribution, slot by slot."""

from segar.language import Factor, FloorFriction, Friction, Order, Position, Size
from segar.levels.priors import Prior, factors_needed, factors_read
from segar.levels.sampling.plan import SamplingPlan, SlotGroup
from segar.noise import Choice, Deterministic, DiscreteRangeNoise, Mixture, Noise, as_noise

NoiseByFactor = dict[type[Factor], Noise]


def marginals(plan: SamplingPlan) -> dict[str, NoiseByFactor]:
    """The distributions of all factors by slot name, and of the world parameters under ``"parameters"``.

    See :meth:`segar.LevelDistribution.marginals`.
    """
    drawn = {plan.layout.parameters[place]: prior.value for place, prior in plan.parameter_priors}
    constants = zip(plan.layout.parameters, plan.parameters.tolist(), strict=True)
    parameters: NoiseByFactor = {p: drawn.get(p) or Deterministic(value) for p, value in constants}
    parameters |= {} if plan.rule_space is None else plan.rule_space.marginals()
    noises: dict[str, NoiseByFactor] = {}
    for group in plan.groups:
        for place, slot in enumerate(group.slots):
            noises[plan.layout.names[slot]] = slot_distributions(plan, group, place)
    noises[plan.layout.names[-1]] = {Friction: parameters[FloorFriction]}
    noises["parameters"] = parameters
    return noises


def slot_distributions(plan: SamplingPlan, group: SlotGroup, place: int, only: int | None = None) -> NoiseByFactor:
    """The distributions of one slot's factors, given that the slot is filled.

    Args:
        place: of the slot among the slots of the group.
        only: index in ``layout.types`` of the type that fills it; None for any.
    """
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
            noise = prior.value if prior is not None else _undrawn(plan, slot, factor, kind)
            if factor is Order and noise == Deterministic(0.0):
                noise = _rank_distribution(plan, group, place)
            parts.setdefault(factor, []).append((noise, probability))
    return {factor: mix(found) for factor, found in parts.items() if factor not in conditional}


def _drawn(plan: SamplingPlan, slot: int, factor: type[Factor], kind: int) -> Prior | None:
    """The prior that the factor is drawn from, None for a constant; a conditional one where there is any."""
    draw = plan.draw_of(slot, factor, kind)
    return draw and next((p for p in draw.priors if factors_read(p)), draw.priors[-1])


def _undrawn(plan: SamplingPlan, slot: int, factor: type[Factor], kind: int) -> Noise:
    """The constant that a factor starts with, or the size of a shape that is chosen."""
    if factor is Position and slot in plan.fixed_positions:
        return Deterministic(plan.fixed_positions[slot])
    if factor is Size:
        for outline in plan.outlines:
            if outline.slot == slot and kind in outline.types and isinstance(outline.shapes, Choice):
                return Choice([shape.size for shape in outline.shapes.keys], outline.shapes.p)
    return plan.constant(kind, factor)


def _rank_distribution(plan: SamplingPlan, group: SlotGroup, place: int) -> Noise:
    """A random rank among all things of a level, given that this slot is filled."""
    totals = {0: 1.0}
    for other in plan.groups:
        if not all(Order in plan.layout.types[kind].declared for kind in other.types):
            continue
        values, masses = as_noise(other.count).atoms
        allowed = [(int(v), m) for v, m in zip(values, masses, strict=True) if other is not group or v > place]
        mass = sum(m for _, m in allowed)
        if not mass:
            return Deterministic(0.0)  # the slot is never filled, so no level shows the rank
        grown: dict[int, float] = {}
        for total, weight in totals.items():
            for value, m in allowed:
                grown[total + value] = grown.get(total + value, 0.0) + weight * m / mass
        totals = grown
    return mix([(DiscreteRangeNoise(0, total - 1), weight) for total, weight in totals.items()])


def mix(parts: list[tuple[Noise, float]]) -> Noise:
    """The mixture of distributions by weights that need not sum to one; equal distributions are joined."""
    weights: dict[Noise, float] = {}
    for noise, weight in parts:
        weights[noise] = weights.get(noise, 0.0) + weight
    if len(weights) == 1:
        return next(iter(weights))
    total = sum(weights.values())
    return Mixture(list(weights), [weight / total for weight in weights.values()])
