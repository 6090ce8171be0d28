"""Mutation: levels that differ from given ones in a few factors, which are drawn anew from the priors of the distribution."""

import dataclasses
from dataclasses import dataclass

import numpy as np

from segar.errors import LevelError
from segar.language import Order, Position, Size
from segar.levels.checks import require_generator
from segar.levels.distribution import LevelDistribution
from segar.levels.level_data import LEVEL_ARRAYS, OUTLINE, LevelData, Provenance
from segar.levels.level_set import Levels
from segar.levels.mixing import differing
from segar.levels.sampling.placement import fix_levels
from segar.levels.sampling.plan import SamplingPlan
from segar.noise import Noise
from segar.support import __version__, is_whole

MOST_TRIES = 100  # a level is mutated anew at least so often, as placement tries 100 times
AT_ONCE, OF_ONE = 512, 16  # mutations that are tried side by side, and how many of them of one level


@dataclass(frozen=True)
class Site:
    """What one change draws anew.

    Attributes:
        slot: the slot of an entity, None for a world parameter.
        columns: of the values of the slot, or of the parameters.
        arrays: what else is taken of the slot: its shape, or its shape and type.
    """

    slot: int | None
    columns: slice
    arrays: tuple[str, ...] = ()


def mutate(levels: Levels, rng: np.random.Generator, changes: int = 1) -> Levels:
    """Levels that each differ from the given one by ``changes`` changes in a row.

    A change is one of a factor, a position, a shape, an entity or a world parameter.

    What changes is drawn anew from its prior. Changes that the distribution cannot draw together with what stays (two things
    too close, a relation of a conditional prior that holds no more) are refused, and others are tried, so that
    ``distribution.log_prob`` is finite for each mutated level. Overlaps are fixed as in sampled levels.

    Args:
        levels: as they were sampled from a distribution, or mutated.
        rng: decides what changes, and to what.
        changes: at least 1.

    Returns:
        As many levels, whose provenance names no distribution, since no seed and index draw them again.

    Raises:
        LevelError: the levels know no distribution; it draws nothing; or a level admits no change.
        SegarError: ``rng`` is no generator.
        PriorError: the distribution has no ``log_prob``, see :meth:`segar.LevelDistribution.log_prob`.
    """
    distribution = levels.distribution
    if not isinstance(distribution, LevelDistribution):
        raise LevelError(
            f"{levels!r} know no distribution from which factors could be drawn anew; sample levels from one"
        )
    require_generator("mutate", rng)
    if not is_whole(changes) or changes < 1:
        raise LevelError(f"changes must be a whole number above 0, not {changes!r}")
    sites = mutable_sites(distribution.plan)
    if not sites:
        raise LevelError(f"{distribution} draws nothing but ranks in the pile, so its levels cannot be mutated")
    origin = levels.provenance
    provenance = Provenance(origin.name, "", __version__, 0, "", origin.indices, origin.rules)
    mutated = dataclasses.replace(levels, provenance=provenance)
    for _ in range(changes):
        mutated = _changed_once(distribution, sites, mutated, rng)
    return mutated


def _changed_once(
    distribution: LevelDistribution, sites: list[Site], levels: Levels, rng: np.random.Generator
) -> Levels:
    """The levels with one change each; raises :class:`LevelError`."""
    mutated = {name: getattr(levels, name).copy() for name in LEVEL_ARRAYS}
    left, tries = np.arange(len(levels)), 0
    while tries < MOST_TRIES:
        each = min(max(AT_ONCE // len(left), 1), OF_ONE)
        tries += each
        rows = np.repeat(left, each)
        donors = distribution.sample(len(rows), seed=int(rng.integers(2**63)), split="mutation")
        arrays, changed = _exchanged(levels[rows], donors, sites, rng.integers(len(sites), size=len(rows)))
        tried = levels[rows].writable(**arrays)
        fits = (changed & _can_be_drawn(distribution, tried)).reshape(len(left), each)
        done = fits.any(axis=1)
        first = np.flatnonzero(done) * each + fits[done].argmax(axis=1)  # of each level, the first one that fits
        for name, array in arrays.items():
            mutated[name][left[done]] = array[first]
        left = left[~done]
        if not len(left):
            return dataclasses.replace(levels, **mutated)
    raise LevelError(
        f"level {left[0]}: {tries} tries to change something gave no other level that {distribution} can draw; leave this"
        " level out"
    )


def mutable_sites(plan: SamplingPlan) -> list[Site]:
    """All that the plan draws, each with what it changes; ranks in the pile are left as they are."""
    layout = plan.layout
    parameters = [column for column, _ in plan.parameter_priors] + plan.rule_columns
    sites = [Site(None, slice(column, column + 1)) for column in parameters]
    for slot, factor in dict.fromkeys((draw.slot, draw.factor) for draw in plan.draws):
        is_place = issubclass(factor, Position) and slot in plan.fixed_positions
        if not is_place and not issubclass(factor, Order):
            sites.append(Site(slot, layout.columns_of(factor)))
    size = layout.columns_of(Size) if Size in layout.columns else slice(0)
    sites += [Site(outline.slot, size, OUTLINE) for outline in plan.outlines if outline.is_random]
    for group in plan.groups:
        if isinstance(group.count, Noise) or len(group.types) > 1:
            sites += [Site(slot, slice(layout.width), ("types", *OUTLINE)) for slot in group.slots]
    return sites


def _exchanged(
    levels: Levels, donors: Levels, sites: list[Site], chosen: np.ndarray
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """The arrays of levels with the chosen sites of donors, and whether these changed what is drawn, bool ``(n,)``.

    Args:
        chosen: int ``(n,)``, indices of sites.
    """
    arrays = {name: getattr(levels, name).copy() for name in LEVEL_ARRAYS}
    for k, site in enumerate(sites):
        rows = np.flatnonzero(chosen == k)
        if site.slot is None:
            arrays["parameters"][rows, site.columns] = donors.parameters[rows, site.columns]
        else:
            _exchange(arrays, donors, site, site.slot, rows)
    for name in ("sampled_values", "values"):
        donors.layout.set_floor(arrays[name], arrays["parameters"])
    return arrays, differing(levels, arrays, ("types", "sampled_values", "parameters", *OUTLINE))


def _exchange(arrays: dict[str, np.ndarray], donors: Levels, site: Site, slot: int, rows: np.ndarray) -> None:
    """Take what a slot has at one site of donors: whole entities of another type, or parts of entities of the same one."""
    ours, theirs = arrays["types"][rows, slot], donors.types[rows, slot]
    is_entity = "types" in site.arrays
    rows = rows[ours != theirs] if is_entity else rows[(ours == theirs) & (ours >= 0)]
    order = donors.layout.columns.get(Order)
    for name in ("sampled_values", "values"):
        before = arrays[name][rows, slot]
        taken = before.copy()
        taken[:, site.columns] = getattr(donors, name)[rows, slot, site.columns]
        if order is not None and is_entity:
            had, has = ~np.isnan(before[:, order]), ~np.isnan(taken[:, order])
            taken[had & has, order] = before[had & has, order]
        arrays[name][rows, slot] = taken
    for name in site.arrays:
        arrays[name][rows, slot] = getattr(donors, name)[rows, slot]


def _can_be_drawn(distribution: LevelDistribution, tried: LevelData) -> np.ndarray:
    """Whether the distribution can draw each of these levels, bool ``(n,)``; fixes their overlaps in place."""
    layout = tried.layout
    if Position in layout.columns:
        place = layout.columns_of(Position)
        tried.values[:, :, place] = tried.sampled_values[:, :, place]
    stuck = fix_levels(tried)
    fits = np.isfinite(distribution.log_prob(Levels(**vars(tried)), normalised=False))
    fits[stuck] = False
    return fits
