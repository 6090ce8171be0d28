"""How probable levels are under their distribution: a sum over what was drawn for them.

The reference measure is a product: counting measure for how many entities there are, their types, choices of shapes, the
ranks in the pile and every atom of a law; length for every number with a density; area for a position and for each
vertex of a random hull. What placement does afterwards (moving overlapping things apart) is a function of what was
drawn, so it adds nothing: levels are taken as they were drawn, ``sampled_values``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.language import CIRCLE, HULL, BaseShape, Factor, FloorFriction, Friction, Order, Position, Size, Tile
from segar.levels.priors import Prior, factors_needed, factors_read
from segar.levels.sampling.conditional_draws import claimed, dependence
from segar.levels.sampling.placement import too_close
from segar.levels.sampling.plan import Draw, Outline, Plan
from segar.noise import Choice, Deterministic, Noise, as_noise


@dataclass(frozen=True)
class LogProbability:
    """Log probabilities of ``n`` levels, float64 ``(n,)`` each, without the share of positions that placement accepts.

    Attributes:
        simple: what has an entropy in closed form: counts, types, and factors whose law is the same in all levels.
        other: conditional factors, ranks in the pile, random hulls, and positions where placement conditions them.
        places: int ``(n, slots)``, index in ``laws`` of the law of each thing's position, -1 where there is none.
        laws: laws of positions.
    """

    simple: np.ndarray
    other: np.ndarray
    places: np.ndarray
    laws: tuple[Noise, ...]


def log_probability(plan: Plan, levels: Any) -> LogProbability:
    """The log probabilities of levels that have the plan's layout; -inf where a level cannot be drawn."""
    n = len(levels.types)
    found = LogProbability(
        np.zeros(n), np.zeros(n), np.full((n, len(plan.layout.slots)), -1), tuple(position_laws(plan))
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
        x = plan.layout.columns[Position]
        found.other[too_close(levels.sampled_values[:, :, x : x + 2], plan.min_distance)] = -np.inf
    return found


def position_laws(plan: Plan) -> dict[Noise, int]:
    """All laws that some thing's position can have, numbered."""
    laws: dict[Noise, int] = {}
    for place in plan.fixed_positions.values():
        laws.setdefault(Deterministic(place), len(laws))
    for draw in plan.draws:
        if issubclass(draw.factor, Position):
            for prior in draw.priors:
                laws.setdefault(as_noise(prior.value), len(laws))
    if Position in plan.layout.columns:
        x = plan.layout.columns[Position]
        for place in plan.templates[:, x : x + 2].tolist():
            if not math.isnan(place[0]):
                laws.setdefault(Deterministic(place), len(laws))
    return laws


def is_conditioned(plan: Plan) -> bool:
    """Whether placement can refuse positions: two things may have one, and must keep a distance or may coincide."""
    slots = [slot for group in plan.groups for slot in group.slots if plan.layout.slots[slot].may_have(Position)]
    atoms = any(len(law.atoms[0]) for law in position_laws(plan))
    return len(slots) > 1 and (plan.min_distance > 0 or atoms)


def law_of(plan: Plan, slot: int, factor: type[Factor], kind: int) -> Noise | Draw:
    """The law of a factor of one slot's entities of one type, or the draw if it depends on other factors."""
    if factor is Position and slot in plan.fixed_positions:
        return Deterministic(plan.fixed_positions[slot])
    for draw in plan.draws:
        if draw.slot == slot and draw.factor is factor and kind in draw.types:
            simple = len(draw.priors) == 1 and not factors_needed(draw.priors[0])
            return as_noise(draw.priors[0].value) if simple else draw
    column = plan.layout.columns[factor]
    value = plan.templates[kind, column : column + factor.width].tolist()
    return Deterministic(value if factor.width == 2 else value[0])


def size_follows_shape(plan: Plan, slot: int, kind: int) -> bool:
    """Whether the size of one slot's entities of one type is that of the shape that is chosen for them."""
    mine = [o for o in plan.outlines if o.slot == slot and kind in o.types]
    return any(isinstance(o.shapes, Choice) and not o.size_is_drawn for o in mine)


def outline_is_simple(plan: Plan, outline: Outline) -> bool:
    """Whether a level shows which shape was chosen, so that its entropy is that of the choice."""
    if isinstance(outline.shapes, BaseShape):
        return not outline.shapes.is_random
    if any(shape.is_random for shape in outline.shapes.keys):
        return False
    circles = [shape for shape in dict.fromkeys(outline.shapes.keys) if shape.kind == CIRCLE]
    return len(circles) < 2 or not _circle_is_hidden(plan, outline)


def _composition(plan: Plan, levels: Any) -> np.ndarray:
    """Of how many entities there are, and of which types."""
    total = np.where(levels.types[:, -1] == len(plan.layout.types) - 1, 0.0, -np.inf)
    for group in plan.groups:
        kinds = levels.types[:, list(group.slots)]
        count = (kinds >= 0).sum(axis=1)
        total += as_noise(group.count).log_prob(count)
        total[_has_hole(kinds)] = -np.inf
        mass = np.zeros(len(plan.layout.types))
        np.add.at(mass, list(group.types), group.probabilities)
        with np.errstate(divide="ignore"):
            total += np.where(kinds >= 0, np.log(mass)[kinds], 0.0).sum(axis=1)
    return total


def _has_hole(kinds: np.ndarray) -> Any:
    """Whether a slot is filled behind an empty one."""
    return ((kinds[:, :-1] < 0) & (kinds[:, 1:] >= 0)).any(axis=1)


def _parameters(plan: Plan, levels: Any) -> np.ndarray:
    drawn = {column: prior.value for column, prior in plan.parameter_priors}
    total = np.zeros(len(levels.types))
    for column, constant in enumerate(plan.parameters.tolist()):
        total += drawn.get(column, Deterministic(constant)).log_prob(levels.parameters[:, column])
    floor = levels.parameters[:, plan.layout.parameters.index(FloorFriction)]
    same = levels.sampled_values[:, -1, plan.layout.columns[Friction]] == floor
    return np.where(same, total, -np.inf)


def _add_factors(
    plan: Plan, levels: Any, found: LogProbability, ranked: np.ndarray, slot: int, kind: int, rows: np.ndarray
) -> None:
    """Add the factors of one slot's entities of one type."""
    conditioned = is_conditioned(plan)
    for factor in plan.layout.types[kind].declared:
        if not factor.width or (factor is Size and size_follows_shape(plan, slot, kind)):
            continue
        column = plan.layout.columns[factor]
        value = levels.sampled_values[rows, slot, column : column + factor.width]
        value = value if factor.width == 2 else value[:, 0]
        law = law_of(plan, slot, factor, kind)
        if factor is Order and _may_be_zero(law):
            ranked[rows, slot] = _is_ranked(plan, levels, law, slot, rows)
        if isinstance(law, Noise):
            term, which = (
                np.asarray(law.log_prob(value)),
                np.full(len(rows), found.laws.index(law) if factor is Position else -1),
            )
        else:
            term, which = _conditional(plan, levels, law, rows, value, found.laws)
        term = np.where(ranked[rows, slot], 0.0, term) if factor is Order else term
        if factor is Position:
            found.places[rows, slot] = which
        simple = isinstance(law, Noise) and not (factor is Position and conditioned)
        (found.simple if simple else found.other)[rows] += term


def _conditional(
    plan: Plan, levels: Any, draw: Draw, rows: np.ndarray, value: np.ndarray, laws: tuple[Noise, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Log probabilities of a factor by the prior that counts in each level, and for positions the law's number."""
    term, which = np.full(len(rows), -np.inf), np.full(len(rows), -1)
    if factors_read(draw.priors[-1]):  # where no relation holds, the constant of the type stands
        for kind in np.unique(levels.types[rows, draw.slot]):
            column = plan.layout.columns[draw.factor]
            constant = plan.templates[kind, column : column + draw.factor.width]
            law = Deterministic(constant.tolist() if draw.factor.width == 2 else float(constant[0]))
            mine = levels.types[rows, draw.slot] == kind
            term[mine] = law.log_prob(value[mine])
            which[mine] = laws.index(law) if issubclass(draw.factor, Position) else -1
    for prior in reversed(draw.priors):
        claim = claimed(plan, levels, draw, prior, rows) if factors_read(prior) else np.ones(len(rows), dtype=bool)
        scaling = dependence(plan, levels, draw.slot, prior.value, rows[claim])
        law = as_noise(prior.value) if scaling is None else None
        term[claim] = prior.value.log_prob(value[claim], *scaling) if scaling else law.log_prob(value[claim])  # type: ignore[union-attr]
        if issubclass(draw.factor, Position):
            which[claim] = laws.index(law)  # type: ignore[arg-type]
    return term, which


def _may_be_zero(law: Noise | Draw) -> bool:
    if isinstance(law, Draw):
        return any(as_noise(prior.value).pmf(0.0) > 0 for prior in law.priors) or bool(factors_read(law.priors[-1]))
    return law.pmf(0.0) > 0


def _is_ranked(plan: Plan, levels: Any, law: Noise | Draw, slot: int, rows: np.ndarray) -> np.ndarray:
    """Whether the heights of one slot's entities are random ranks: the constant zero asks for one."""
    if isinstance(law, Draw):
        zero: Callable[[Prior], bool] = lambda prior: as_noise(prior.value) == Deterministic(0.0)  # noqa: E731
        if all(zero(p) or as_noise(p.value).pmf(0.0) == 0 for p in law.priors) and not factors_read(law.priors[-1]):
            held = np.zeros(len(rows), dtype=bool)
            for prior in reversed(law.priors):
                claim = claimed(plan, levels, law, prior, rows) if factors_read(prior) else np.ones(len(rows), bool)
                held[claim] = zero(prior)
            return held
    elif law == Deterministic(0.0):
        return np.ones(len(rows), dtype=bool)
    raise PriorError(
        f"the Order of '{plan.layout.names[slot]}' may be drawn as 0, which asks for a random rank, so a level does not"
        " show which of the two it was; let its law start at 1"
    )


def _ranks(plan: Plan, levels: Any, ranked: np.ndarray) -> np.ndarray:
    """Of distinct random ranks among all things of a level."""
    from scipy.special import gammaln

    if Order not in plan.layout.columns:
        return np.zeros(len(ranked))
    order = levels.sampled_values[:, :, plan.layout.columns[Order]]
    among, drawn = (~np.isnan(order)).sum(axis=1), ranked.sum(axis=1)
    height = np.where(ranked, order, -1.0 - np.arange(order.shape[1]))
    height.sort(axis=1)
    distinct = (height[:, 1:] > height[:, :-1]).all(axis=1)
    possible = ((order == np.rint(order)) & (order >= 0) & (order < among[:, None])) | ~ranked
    return np.where(distinct & possible.all(axis=1), gammaln(among - drawn + 1) - gammaln(among + 1), -np.inf)


def _outline(plan: Plan, levels: Any, outline: Outline, rows: np.ndarray) -> np.ndarray:
    """Of the shape that was chosen and, if that is random, of its vertices."""
    law = Choice([outline.shapes]) if isinstance(outline.shapes, BaseShape) else outline.shapes
    mass, density = np.zeros(len(rows)), np.zeros(len(rows))
    for shape, p in zip(law.keys, law.p or (), strict=True):
        same = _has_shape(plan, levels, outline, shape, rows)
        if not shape.is_random:
            mass[same] += p
        elif same.any():
            hulls = levels.vertices[rows[same], outline.slot]
            count = levels.vertex_count[rows[same], outline.slot]
            density[same] += p * np.exp(shape.log_prob([hull[:k] for hull, k in zip(hulls, count, strict=True)]))
    with np.errstate(divide="ignore"):
        return np.log(np.where(mass > 0, mass, density))


def _has_shape(plan: Plan, levels: Any, outline: Outline, shape: BaseShape, rows: np.ndarray) -> np.ndarray:
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


def _circle_is_hidden(plan: Plan, outline: Outline) -> bool:
    """Whether a circle's own size leaves no trace: an object's circle has the size that is drawn for the object."""
    tiles = all(issubclass(plan.layout.types[kind], Tile) for kind in outline.types)
    return outline.size_is_drawn and not tiles
