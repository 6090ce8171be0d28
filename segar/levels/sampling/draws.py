"""Drawing levels: arrays of levels are filled column by column, as the plan says.

Each factor of each entity is drawn from its own stream, keyed by (distribution, seed, split, slot, factor),
and within it level i comes from counter i (:mod:`segar.support.counter_rng`). So levels do not depend on each other, nor on how
many are drawn at once.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from segar.errors import LevelError, PlacementError, PriorError
from segar.language import CIRCLE, HULL, BaseShape, Factor, Object, Order, Position, Size, Tile
from segar.levels.level_data import LevelData
from segar.levels.priors import Prior, factors_read, specificity
from segar.levels.sampling import placement
from segar.levels.sampling.conditional_draws import shift_and_scale, where_prior_applies
from segar.levels.sampling.plan import Draw, Outline, SamplingPlan
from segar.noise import Noise
from segar.support import LevelGenerator, stream_key

CHUNK = 4096  # levels that are drawn together: their columns fit the processor's cache


@dataclass(frozen=True)
class Streams:
    """Where the randomness of one split of a distribution comes from."""

    name: str
    identity: str
    seed: int
    split: str

    def generator(self, levels: np.ndarray, *site: Any, attempt: int = 0) -> LevelGenerator:
        """The generator for what is drawn at ``site``; int64 ``levels`` are indices in the split."""
        return LevelGenerator(stream_key(self.identity, self.seed, self.split, *site), levels, attempt)

    def where(self, level: Any) -> str:
        """Names a level in messages."""
        return f"{self.name}, level {int(level)} (seed {self.seed}, split '{self.split}')"


def draw_levels(plan: SamplingPlan, streams: Streams, levels: LevelData) -> None:
    """Draw empty levels, in place.

    Raises:
        PlacementError: the things of a level find no place.
        PriorError: a distribution gave a value that its factor cannot take.
    """
    for start in range(0, len(levels), CHUNK):
        part = levels.at(slice(start, start + CHUNK))
        draw_unplaced(plan, streams, part)
        sizes = draw_outlines(plan, streams, part)
        draw_positions(plan, streams, part)
        draw_orders(plan, streams, part)
        set_initial_values(plan, streams, part, sizes)


def draw_unplaced(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """What is drawn before things get a shape and a place: types, parameters and factors."""
    draw_types(plan, streams, block)
    draw_parameters(plan, streams, block)
    draw_factors(plan, streams, block)


def draw_types(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """Which entities a level has: counts, then types; and their constant factors."""
    n = len(block.provenance.indices)
    for place, group in enumerate(plan.groups):
        count: Any = group.count
        if isinstance(count, Noise):
            count = np.asarray(count.sample(streams.generator(block.provenance.indices, "count", place), n))
        for k, slot in enumerate(group.slots):
            types: Any = group.types
            if len(types) > 1:
                rng = streams.generator(block.provenance.indices, "type", plan.layout.names[slot])
                types = rng.choice(group.types, size=n, p=group.probabilities)
            block.types[:, slot] = np.where(k < count, types, -1)
    block.types[:, -1] = len(plan.layout.types) - 1  # the arena's floor, the last slot of every layout
    block.sampled_values[:] = plan.templates[block.types]  # the last template, which -1 picks, is all nan


def draw_parameters(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """World parameters of each level, and the floor's friction, which is one of them."""
    block.parameters[:] = plan.parameters
    for column, prior in plan.parameter_priors:
        rng = streams.generator(block.provenance.indices, "parameter", prior.factor.__name__)
        block.parameters[:, column] = _sample(streams, prior, prior.factor, rng, block.provenance.indices)
    if plan.rule_space is not None:
        draws = partial(streams.generator, block.provenance.indices, "rules")
        block.parameters[:, plan.rule_columns] = plan.rule_space.sample(draws, len(block.provenance.indices))
    plan.layout.set_floor(block.sampled_values, block.parameters)


def draw_factors(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """All factors with a distribution or a conditional value, but positions."""
    for draw in plan.draws:
        if not issubclass(draw.factor, Position):
            draw_factor(plan, streams, block, draw, np.flatnonzero(_holds(block.types, draw)))


def draw_factor(
    plan: SamplingPlan, streams: Streams, block: LevelData, draw: Draw, rows: np.ndarray, attempt: int = 0
) -> None:
    """One factor of one slot in the levels ``rows``: the value without condition, then those whose relation holds."""
    site = plan.layout.names[draw.slot], draw.factor.__name__
    target = block.sampled_values[:, draw.slot, plan.layout.columns_of(draw.factor)]
    levels = block.provenance.indices[rows]
    conditional: list[tuple[Prior, np.ndarray]] = []
    for k, prior in reversed(list(enumerate(draw.priors))):
        if not factors_read(prior) and not prior.is_random:
            continue  # a constant stands in the template already
        rng = streams.generator(levels, *site, *([k] if k else []), attempt=attempt)
        scaling = shift_and_scale(plan, block, draw.slot, prior.value, rows)
        applies = where_prior_applies(plan, block, draw, prior, rows)
        value = _sample(streams, prior, draw.factor, rng, levels, scaling, applies)
        value = value.reshape(len(levels), draw.factor.width)
        if not factors_read(prior):
            target[rows] = value
            continue
        target[rows] = np.where(applies[:, None], value, target[rows])
        conditional.append((prior, applies))
    _check_unambiguous(streams, conditional, levels)


def draw_outlines(plan: SamplingPlan, streams: Streams, block: LevelData) -> np.ndarray:
    """Shapes; and Size, which without a prior of its own is the shape's.

    Returns:
        The size of each thing's shape, float64 ``(n, entities)``, nan where there is none.
    """
    sizes = np.full(block.types.shape, np.nan)
    for outline in plan.outlines:
        rows = np.flatnonzero(_holds(block.types, outline))
        site = plan.layout.names[outline.slot], "Shape"
        chosen = outline.choice.sample_index(streams.generator(block.provenance.indices[rows], *site), len(rows))
        for k, shape in enumerate(outline.choice.keys):
            _draw_outline(plan, streams, block, outline, shape, rows[chosen == k])
            sizes[rows[chosen == k], outline.slot] = shape.size
    return sizes


def draw_positions(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """Positions; anew for levels in which two things come too close, at most 100 times."""
    again = np.flatnonzero(draw_first_positions(plan, streams, block))
    draws = _drawn_positions(plan)
    for attempt in range(1, placement.PLACEMENT_TRIES if draws else 1):
        if not len(again):
            return
        for draw in draws:
            rows = again[_holds(block.types[again], draw)]
            draw_factor(plan, streams, block, draw, rows, attempt)
        again = again[
            placement.too_close(block.sampled_values[again, :, plan.layout.columns_of(Position)], plan.min_distance)
        ]
    if len(again):
        raise _no_place(plan, streams, block, int(again[0]), len(draws) > 0)


def draw_first_positions(plan: SamplingPlan, streams: Streams, block: LevelData) -> np.ndarray:
    """The first try to place the things of each level; whether two of them came too close, bool ``(n,)``."""
    if Position not in plan.layout.columns:
        return np.zeros(len(block.provenance.indices), dtype=bool)
    columns = plan.layout.columns_of(Position)
    for slot, place in plan.fixed_positions.items():
        block.sampled_values[block.types[:, slot] >= 0, slot, columns] = place
    for draw in _drawn_positions(plan):
        draw_factor(plan, streams, block, draw, np.flatnonzero(_holds(block.types, draw)))
    return placement.too_close(block.sampled_values[:, :, columns], plan.min_distance)


def _drawn_positions(plan: SamplingPlan) -> list[Draw]:
    return [draw for draw in plan.draws if issubclass(draw.factor, Position) and draw.slot not in plan.fixed_positions]


def draw_orders(plan: SamplingPlan, streams: Streams, block: LevelData) -> None:
    """Heights in the pile: things whose Order is 0 get distinct random ranks among all things of the level."""
    if Order not in plan.layout.columns:
        return
    order = block.sampled_values[:, :, plan.layout.columns[Order]]
    ranks = placement.random_ranks(streams.generator(block.provenance.indices, "Order"), ~np.isnan(order))
    np.copyto(order, ranks, where=order == 0)


def set_initial_values(plan: SamplingPlan, streams: Streams, block: LevelData, sizes: np.ndarray) -> None:
    """Set the values that the simulation starts from: tiles and hulls get the size of their shape, overlaps are fixed."""
    block.values[:] = block.sampled_values
    if Size in plan.layout.columns:
        is_tile = np.array([*(issubclass(t, Tile) for t in plan.layout.types), False])
        follows = (block.shape_kind == HULL) | (is_tile[block.types] & (block.shape_kind == CIRCLE))
        np.copyto(block.values[:, :, plan.layout.columns[Size]], sizes, where=follows)
    stuck = placement.fix_levels(block)
    if len(stuck):
        raise _stuck(plan, streams, block, int(stuck[0]))


def _holds(types: np.ndarray, drawn: Draw | Outline) -> np.ndarray:
    """In which levels the slot holds one of the types that something is drawn for, bool ``(n,)``."""
    return np.logical_or.reduce([types[:, drawn.slot] == kind for kind in drawn.types])


def _sample(
    streams: Streams,
    prior: Prior,
    factor: type[Factor],
    rng: LevelGenerator,
    levels: np.ndarray,
    scaling: tuple[np.ndarray, np.ndarray] | None = None,
    needed: np.ndarray | None = None,
) -> np.ndarray:
    """Draws of the prior for ``levels``, float64 ``(n,)`` or ``(n, 2)``; those that are ``needed`` (None: all) are
    checked against what the factor can take. ``scaling``: shift and scale of a dependent distribution."""
    shape = (len(levels), 2) if factor.width == 2 else (len(levels),)
    if not prior.is_random:
        return np.broadcast_to(np.asarray(prior.value, dtype=float), shape)
    noise = prior.value if scaling is None else prior.value.law
    value = np.asarray(noise.sample(rng, len(levels)), dtype=float)
    if value.shape != shape:
        raise PriorError(f"{prior}: the distribution's sample(rng, {len(levels)}) has shape {value.shape}, not {shape}")
    if scaling is not None:
        value = scaling[0] + scaling[1] * value
        value = np.where(scaling[1] == 0, np.nan, value)
    wrong = ~factor.is_possible(value).reshape(len(levels), factor.width).all(axis=1)
    if needed is not None:
        wrong &= needed
    if wrong.any():
        row = np.flatnonzero(wrong)[0]
        scaled = "" if scaling is None else f" with shift {scaling[0][row]:g} and scale {scaling[1][row]:g}"
        raise PriorError(
            f"{streams.where(levels[row])}: {prior} gave {value[row]}{scaled}, which {factor.__name__} cannot be: it must be"
            f" {factor.possible_values()}; clip the distribution or choose another"
        )
    return value


def _check_unambiguous(streams: Streams, conditional: list[tuple[Prior, np.ndarray]], levels: np.ndarray) -> None:
    """Raise :class:`PriorError` where the relations of two equally specific, differing priors hold."""
    for k, (prior, applies) in enumerate(conditional):
        for rival, other in conditional[:k]:
            both = applies & other
            if both.any() and specificity(prior) == specificity(rival) and prior.value != rival.value:
                raise PriorError(
                    f"{streams.where(levels[both.argmax()])}: {prior} and {rival} both hold and are equally specific;"
                    " make their relations exclude each other"
                )


def _draw_outline(
    plan: SamplingPlan, streams: Streams, block: LevelData, outline: Outline, shape: BaseShape, rows: np.ndarray
) -> None:
    slot = outline.slot
    block.set_shape(rows, slot, shape)
    if not outline.size_is_drawn and Size in plan.layout.columns:
        block.sampled_values[rows, slot, plan.layout.columns[Size]] = shape.size
    if shape.is_random and shape.kind == HULL and len(rows):
        hulls = shape.sample(
            streams.generator(block.provenance.indices[rows], plan.layout.names[slot], "hull"), len(rows)
        )
        block.vertices[rows, slot], block.vertex_count[rows, slot] = pad_hulls(hulls, plan.vertices, shape)


def pad_hulls(hulls: list[np.ndarray], room: int, owner: Any) -> tuple[np.ndarray, np.ndarray]:
    """Vertices float64 ``(n, room, 2)``, zero padded, and their counts; raises :class:`LevelError` if one has more."""
    count = np.array([len(hull) for hull in hulls])
    if count.max() > room:
        raise LevelError(
            f"{owner!r} drew a hull of {count.max()} vertices, and there is room for {room}; set max_vertices"
        )
    padded = np.zeros((len(hulls), room, 2))
    padded[np.arange(room) < count[:, None]] = np.concatenate(hulls)
    return padded, count


def _no_place(plan: SamplingPlan, streams: Streams, block: LevelData, row: int, drawn: bool) -> PlacementError:
    i, j, distance = placement.closest_pair(block.sampled_values[row, :, plan.layout.columns_of(Position)])
    a, b = plan.layout.names[i], plan.layout.names[j]
    tries = f"after {placement.PLACEMENT_TRIES} tries" if drawn else "by their fixed positions"
    return PlacementError(
        f"{streams.where(block.provenance.indices[row])}: {tries} '{a}' and '{b}' are {distance:.3g} apart, and centres must be"
        f" more than {plan.min_distance:g} apart. Use fewer things, wider location priors, or a smaller min_distance"
    )


def _stuck(plan: SamplingPlan, streams: Streams, block: LevelData, row: int) -> PlacementError:
    is_object = [t >= 0 and issubclass(plan.layout.types[t], Object) for t in block.types[row]]
    position = np.where(np.array(is_object)[:, None], block.values[row, :, plan.layout.columns_of(Position)], np.nan)
    i, j, distance = placement.closest_pair(position)
    names, sizes = plan.layout.names, block.values[row, :, plan.layout.columns[Size]]
    if not np.isfinite(distance):
        widest = int(np.nanargmax(sizes))
        return PlacementError(
            f"{streams.where(block.provenance.indices[row])}: '{names[widest]}' (size {sizes[widest]:.3g}) does not fit between"
            " the walls, which stand 2 apart. Make it smaller"
        )
    return PlacementError(
        f"{streams.where(block.provenance.indices[row])}: things do not fit into the arena without overlap after"
        f" {placement.OVERLAP_PASSES} passes; the tightest are '{names[i]}' (size {sizes[i]:.3g}) and '{names[j]}'"
        f" (size {sizes[j]:.3g}). Use fewer or smaller things"
    )
