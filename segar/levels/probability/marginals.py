"""The distributions of the factors of a level distribution, slot by slot."""

from segar.language import Factor, FloorFriction, Friction, Order, Size
from segar.levels.sampling.plan import Draw, SamplingPlan, SlotGroup
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
            noise = plan.law(slot, factor, kind)
            if isinstance(noise, Draw):
                conditional.add(factor)
                continue
            outline = plan.outline_of(slot, kind)
            if factor is Size and outline is not None and plan.size_follows_shape(slot, kind):
                noise = Choice([shape.size for shape in outline.choice.keys], outline.choice.p)
            if factor is Order and noise == Deterministic(0.0):
                noise = _rank_distribution(plan, group, place)
            parts.setdefault(factor, []).append((noise, probability))
    return {factor: mix(found) for factor, found in parts.items() if factor not in conditional}


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
