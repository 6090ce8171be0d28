"""Entropy of level distributions, and the share of positions that placement accepts.

Positions are drawn from their priors until no two things are too close: their distribution is that of the priors given this
event, and its density the priors' divided by the event's probability, the acceptance. It depends on which things there
are, and is estimated from draws.
"""

import math
from functools import lru_cache

import numpy as np

from segar.errors import PlacementError
from segar.language import Order, Position, Size
from segar.levels.level_data import LevelData, Provenance
from segar.levels.probability import log_prob
from segar.levels.sampling.draws import CHUNK, Streams, draw_first_positions, draw_unplaced
from segar.levels.sampling.placement import too_close
from segar.levels.sampling.plan import SamplingPlan, SlotGroup
from segar.noise import Choice, Noise, as_noise
from segar.support import Estimate, __version__

# Draws of the positions of all things from which an acceptance is estimated: to 0.1 % where it is a half.
ACCEPTANCE_DRAWS = 200_000


def acceptance(plan: SamplingPlan, streams: Streams, draws: int) -> Estimate:
    """The share of first tries to place the things of a level that are not refused, over ``draws`` levels."""
    accepted = 0
    for start in range(0, draws, CHUNK):
        origin = Provenance(None, "", __version__, 0, "", np.arange(start, min(start + CHUNK, draws)))
        block = LevelData.empty(plan.vertices, plan.layout, origin)
        draw_unplaced(plan, streams, block)
        accepted += int((~draw_first_positions(plan, streams, block)).sum())
    return _share(accepted, draws)


def log_acceptance(plan: SamplingPlan, found: log_prob.LogProbability) -> tuple[np.ndarray, np.ndarray]:
    """Logarithm of the acceptance of each level's things, and its standard error, float64 ``(n,)`` each."""
    value, error = np.zeros(len(found.places)), np.zeros(len(found.places))
    if not log_prob.is_conditioned(plan):
        return value, error
    kinds, place = np.unique(np.sort(found.places, axis=1), axis=0, return_inverse=True)
    for k, kind in enumerate(kinds):
        noises = tuple(found.distributions[i] for i in kind if i >= 0)
        share = acceptance_of(noises, plan.min_distance)
        if not share.value:
            raise PlacementError(
                f"the acceptance of {len(noises)} things is below {3 / ACCEPTANCE_DRAWS:.0e}, too rare to be estimated;"
                " use log_prob(levels, normalised=False)"
            )
        value[place.ravel() == k] = math.log(share.value)
        error[place.ravel() == k] = share.error / share.value
    return value, error


def entropy(plan: SamplingPlan, levels: LevelData) -> Estimate:
    """Entropy of the distribution [nats]: in closed form, plus the mean over its ``levels`` of what has none."""
    found = log_prob.log_probability(plan, levels)
    accepted, spread = log_acceptance(plan, found)
    rest = accepted - found.other
    drawn = float(rest.std(ddof=1)) / math.sqrt(len(rest))
    return Estimate(simple_entropy(plan) + float(rest.mean()), math.hypot(drawn, float(spread.mean())))


def simple_entropy(plan: SamplingPlan) -> float:
    """Entropy of counts, types, and all factors whose distribution is the same in all levels."""
    total = sum(prior.value.entropy() for _, prior in plan.parameter_priors)
    total += 0.0 if plan.rule_space is None else plan.rule_space.entropy()
    for group in plan.groups:
        count = as_noise(group.count)
        total += count.entropy()
        for place, slot in enumerate(group.slots):
            filled = float(count.atoms[1][count.atoms[0] > place].sum())
            total += filled * _slot_entropy(plan, group, slot)
    return float(total)


def _slot_entropy(plan: SamplingPlan, group: SlotGroup, slot: int) -> float:
    """Entropy of the type that fills a slot, and of its simple factors."""
    total = Choice(group.types, group.probabilities).entropy()
    for kind, probability in zip(group.types, group.probabilities, strict=True):
        for factor in plan.layout.types[kind].declared:
            if not factor.width or (factor is Size and plan.size_follows_shape(slot, kind)):
                continue
            noise = plan.law(slot, factor, kind)
            if not isinstance(noise, Noise) or (factor is Position and log_prob.is_conditioned(plan)):
                continue
            if factor is not Order or noise.pmf(0.0) == 0:
                total += probability * noise.entropy()
        outline = plan.outline_of(slot, kind)
        if outline is not None and log_prob.outline_is_simple(plan, outline):
            total += probability * outline.choice.entropy()
    return total


@lru_cache(maxsize=256)
def acceptance_of(noises: tuple[Noise, ...], min_distance: float) -> Estimate:
    """The share of places, drawn from these distributions, of which no two are too close."""
    if len(noises) < 2:
        return Estimate(1.0)
    rng, accepted = np.random.default_rng(0), 0
    for start in range(0, ACCEPTANCE_DRAWS, CHUNK):
        count = min(CHUNK, ACCEPTANCE_DRAWS - start)
        position = np.stack([np.asarray(noise.sample(rng, count), dtype=float) for noise in noises], axis=1)
        accepted += int((~too_close(position, min_distance)).sum())
    return _share(accepted, ACCEPTANCE_DRAWS)


def _share(accepted: int, draws: int) -> Estimate:
    share = accepted / draws
    return Estimate(share, math.sqrt(share * (1 - share) / draws))
