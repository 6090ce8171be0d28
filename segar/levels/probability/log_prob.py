"""Log probabilities of levels under their distribution: a sum over all that was drawn for them.

The reference measure is a product: counting measure for how many entities there are, their types, choices of shapes, the
ranks in the pile and every atom of a distribution; length for every number with a density; area for a position and for each
vertex of a random hull. What placement does afterwards (moving overlapping things apart) is a function of what was
drawn, so it adds nothing: levels are taken as they were drawn, ``sampled_values``.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from segar.errors import PriorError
from segar.language import CIRCLE, HULL, BaseShape, FloorFriction, Friction, Order, Position, Size, Tile
from segar.levels.level_data import LevelData
from segar.levels.priors import Prior, factors_read
from segar.levels.sampling.conditional_draws import shift_and_scale, where_prior_applies
from segar.levels.sampling.placement import too_close
from segar.levels.sampling.plan import Draw, Outline, SamplingPlan
from segar.noise import Deterministic, Noise, as_noise


@dataclass(frozen=True)
class LogProbability:
    """Log probabilities of ``n`` levels, float64 ``(n,)`` each, without the share of positions that placement accepts.

    Attributes:
        simple: what has an entropy in closed form: counts, types, and factors whose distribution is the same in all levels.
        other: conditional factors, ranks in the pile, random hulls, and positions where placement conditions them.
        places: int ``(n, slots)``, index in ``distributions`` for each thing's position, -1 where there is none.
        distributions: the distributions of positions.
    """

    simple: np.ndarray
    other: np.ndarray
    places: np.ndarray
    distributions: tuple[Noise, ...]


def log_probability(plan: SamplingPlan, levels: LevelData) -> LogProbability:
    """The log probabilities of levels that have the plan's layout; -inf where a level cannot be drawn."""
    n = len(levels.types)
    found = LogProbability(
        np.zeros(n), np.zeros(n), np.full((n, len(plan.layout.slots)), -1), position_distributions(plan)
    )
    found.simple[:] += _composition(plan, levels) + _parameters(plan, levels)
    ranked = np.zeros(levels.types.shape, dtype=bool)
    for group in plan.groups:
        for slot in group.slots:
            for kind in dict.fromkeys(group.types):
                rows = np.flatnonzero(levels.types[:, slot] == kind)
                if len(rows):
                    _add_factors(plan, levels, found, ranked, slot, kind, rows)
    for outline in plan.outlines:
        rows = np.flatnonzero(np.isin(levels.types[:, outline.slot], outline.types))
        target = found.simple if outline_is_simple(plan, outline) else found.other
        target[rows] += _outline(plan, levels, outline, rows)
    found.other[:] += _ranks(plan, levels, ranked)
    if Position in plan.layout.columns:
        position = levels.sampled_values[:, :, plan.layout.columns_of(Position)]
        found.other[too_close(position, plan.min_distance)] = -np.inf
    return found


def position_distributions(plan: SamplingPlan) -> tuple[Noise, ...]:
    """All distributions that some thing's position can have, each once."""
    found: list[Noise] = [*map(Deterministic, plan.fixed_positions.values())]
    found += [
        as_noise(prior.value) for draw in plan.draws if issubclass(draw.factor, Position) for prior in draw.priors
    ]
    if Position in plan.layout.columns:
        constants = plan.templates[:, plan.layout.columns_of(Position)].tolist()
        found += [Deterministic(place) for place in constants if not math.isnan(place[0])]
    return tuple(dict.fromkeys(found))


def is_conditioned(plan: SamplingPlan) -> bool:
    """Whether placement can refuse positions: two things may have one, and must keep a distance or may coincide."""
    slots = [slot for group in plan.groups for slot in group.slots if plan.layout.slots[slot].may_have(Position)]
    atoms = any(len(noise.atoms[0]) for noise in position_distributions(plan))
    return len(slots) > 1 and (plan.min_distance > 0 or atoms)


def outline_is_simple(plan: SamplingPlan, outline: Outline) -> bool:
    """Whether a level shows which shape was chosen, so that its entropy is that of the choice."""
    shapes = dict.fromkeys(outline.choice.keys)
    if any(shape.is_random for shape in shapes):
        return False
    return sum(shape.kind == CIRCLE for shape in shapes) < 2 or not _circle_is_hidden(plan, outline)


def _composition(plan: SamplingPlan, levels: LevelData) -> np.ndarray:
    """Log probability of the number of entities and of their types, float64 ``(n,)``."""
    total = np.where(levels.types[:, -1] == len(plan.layout.types) - 1, 0.0, -np.inf)
    for group in plan.groups:
        kinds = levels.types[:, list(group.slots)]
        count = (kinds >= 0).sum(axis=1)
        total += as_noise(group.count).log_prob(count)
        total[((kinds[:, :-1] < 0) & (kinds[:, 1:] >= 0)).any(axis=1)] = -np.inf  # a slot is filled behind an empty one
        mass = np.zeros(len(plan.layout.types))
        np.add.at(mass, list(group.types), group.probabilities)
        with np.errstate(divide="ignore"):
            total += np.where(kinds >= 0, np.log(mass)[kinds], 0.0).sum(axis=1)
    return total


def _parameters(plan: SamplingPlan, levels: LevelData) -> np.ndarray:
    drawn = {column: prior.value for column, prior in plan.parameter_priors}
    total = np.zeros(len(levels.types))
    of_rules = plan.rule_columns
    if plan.rule_space is not None:
        total += plan.rule_space.log_prob(levels.parameters[:, of_rules])
    for column, constant in enumerate(plan.parameters.tolist()):
        if column in of_rules:
            continue
        total += drawn.get(column, Deterministic(constant)).log_prob(levels.parameters[:, column])
    floor = levels.parameters[:, plan.layout.parameters.index(FloorFriction)]
    same = levels.sampled_values[:, -1, plan.layout.columns[Friction]] == floor
    return np.where(same, total, -np.inf)


def _add_factors(
    plan: SamplingPlan,
    levels: LevelData,
    found: LogProbability,
    ranked: np.ndarray,
    slot: int,
    kind: int,
    rows: np.ndarray,
) -> None:
    """Add the log probabilities of the factors of one slot's entities of one type."""
    conditioned = is_conditioned(plan)
    for factor in plan.layout.types[kind].declared:
        if not factor.width or (factor is Size and plan.size_follows_shape(slot, kind)):
            continue
        value = levels.sampled_values[rows, slot, plan.layout.columns_of(factor)]
        value = value if factor.width == 2 else value[:, 0]
        noise = plan.law(slot, factor, kind)
        if factor is Order and _may_be_zero(noise):
            ranked[rows, slot] = _is_ranked(plan, levels, noise, slot, rows)
        if isinstance(noise, Noise):
            term = np.asarray(noise.log_prob(value))
            which = np.full(len(rows), found.distributions.index(noise) if factor is Position else -1)
        else:
            term, which = _conditional(plan, levels, noise, rows, value, found.distributions)
        term = np.where(ranked[rows, slot], 0.0, term) if factor is Order else term
        if factor is Position:
            found.places[rows, slot] = which
        simple = isinstance(noise, Noise) and not (factor is Position and conditioned)
        (found.simple if simple else found.other)[rows] += term


def _conditional(
    plan: SamplingPlan,
    levels: LevelData,
    draw: Draw,
    rows: np.ndarray,
    value: np.ndarray,
    positions: tuple[Noise, ...],
) -> tuple[np.ndarray, np.ndarray]:
    """Log probabilities of a factor by the prior that counts in each level, float64 ``(rows,)``; and for positions the
    index of the distribution in ``positions``, int ``(rows,)``, else -1."""
    term, which = np.full(len(rows), -np.inf), np.full(len(rows), -1)

    def index_of(noise: Noise) -> int:
        return positions.index(noise) if issubclass(draw.factor, Position) else -1

    if factors_read(draw.priors[-1]):  # where no relation holds, the constant of the type stands
        for kind in np.unique(levels.types[rows, draw.slot]):
            of_kind = levels.types[rows, draw.slot] == kind
            constant = plan.constant(kind, draw.factor)
            term[of_kind], which[of_kind] = constant.log_prob(value[of_kind]), index_of(constant)
    for prior in reversed(draw.priors):
        applies = where_prior_applies(plan, levels, draw, prior, rows)
        scaling = shift_and_scale(plan, levels, draw.slot, prior.value, rows[applies])
        if scaling is not None:
            term[applies] = prior.value.log_prob(value[applies], *scaling)
        else:
            noise = as_noise(prior.value)
            term[applies], which[applies] = noise.log_prob(value[applies]), index_of(noise)
    return term, which


def _may_be_zero(noise: Noise | Draw) -> bool:
    if isinstance(noise, Draw):
        return any(as_noise(prior.value).pmf(0.0) > 0 for prior in noise.priors) or bool(factors_read(noise.priors[-1]))
    return noise.pmf(0.0) > 0


def _is_ranked(plan: SamplingPlan, levels: LevelData, noise: Noise | Draw, slot: int, rows: np.ndarray) -> np.ndarray:
    """Whether the heights of one slot's entities are random ranks: the constant zero asks for one."""
    if isinstance(noise, Draw):
        zero: Callable[[Prior], bool] = lambda prior: as_noise(prior.value) == Deterministic(0.0)  # noqa: E731
        if all(zero(p) or as_noise(p.value).pmf(0.0) == 0 for p in noise.priors) and not factors_read(noise.priors[-1]):
            held = np.zeros(len(rows), dtype=bool)
            for prior in reversed(noise.priors):
                held[where_prior_applies(plan, levels, noise, prior, rows)] = zero(prior)
            return held
    elif noise == Deterministic(0.0):
        return np.ones(len(rows), dtype=bool)
    raise PriorError(
        f"the Order of '{plan.layout.names[slot]}' may be drawn as 0, which asks for a random rank, so a level does not"
        " show which of the two it was; let its distribution start at 1"
    )


def _ranks(plan: SamplingPlan, levels: LevelData, ranked: np.ndarray) -> np.ndarray:
    """Log probability of distinct random ranks among all things of a level, float64 ``(n,)``."""
    if Order not in plan.layout.columns:
        return np.zeros(len(ranked))
    order = levels.sampled_values[:, :, plan.layout.columns[Order]]
    among, drawn = (~np.isnan(order)).sum(axis=1), ranked.sum(axis=1)
    height = np.where(ranked, order, -1.0 - np.arange(order.shape[1]))
    height.sort(axis=1)
    distinct = (height[:, 1:] > height[:, :-1]).all(axis=1)
    possible = ((order == np.rint(order)) & (order >= 0) & (order < among[:, None])) | ~ranked
    log_share = scipy.special.gammaln(among - drawn + 1) - scipy.special.gammaln(among + 1)
    return np.where(distinct & possible.all(axis=1), log_share, -np.inf)


def _outline(plan: SamplingPlan, levels: LevelData, outline: Outline, rows: np.ndarray) -> np.ndarray:
    """Log probability of the chosen shape and, if it is random, of its vertices, float64 ``(rows,)``."""
    mass, density = np.zeros(len(rows)), np.zeros(len(rows))
    for shape, p in zip(outline.choice.keys, outline.choice.p or (), strict=True):
        same = _has_shape(plan, levels, outline, shape, rows)
        if not shape.is_random:
            mass[same] += p
        elif same.any():
            hulls = levels.vertices[rows[same], outline.slot]
            count = levels.vertex_count[rows[same], outline.slot]
            density[same] += p * np.exp(shape.log_prob([hull[:k] for hull, k in zip(hulls, count, strict=True)]))
    with np.errstate(divide="ignore"):
        return np.log(np.where(mass > 0, mass, density))


def _has_shape(
    plan: SamplingPlan, levels: LevelData, outline: Outline, shape: BaseShape, rows: np.ndarray
) -> np.ndarray:
    """Whether a thing may have this shape, by what the level shows."""
    slot = outline.slot
    same = levels.shape_kind[rows, slot] == shape.kind
    if shape.kind == HULL and not shape.is_random:
        room = levels.vertices.shape[2]
        padded = np.zeros((room, 2))
        padded[: len(shape.vertices)] = shape.vertices[:room]
        same &= (levels.vertex_count[rows, slot] == len(shape.vertices)) & (levels.vertices[rows, slot] == padded).all(
            axis=(1, 2)
        )
    if Size in plan.layout.columns:
        size = plan.layout.columns[Size]
        if not outline.size_is_drawn:
            same &= levels.sampled_values[rows, slot, size] == shape.size
        elif shape.kind == HULL or not _circle_is_hidden(plan, outline):
            same &= levels.values[rows, slot, size] == shape.size
    return same


def _circle_is_hidden(plan: SamplingPlan, outline: Outline) -> bool:
    """Whether a circle's own size leaves no trace: an object's circle has the size that is drawn for the object."""
    tiles = all(issubclass(plan.layout.types[kind], Tile) for kind in outline.types)
    return outline.size_is_drawn and not tiles
