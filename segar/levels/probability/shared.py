"""How likely two distributions draw the same level: exactly, from the atoms of their distributions.

A level has a probability above 0 where all that was drawn for it is an atom: the constants, the values of discrete
distributions, and the places of things that were moved out of a wall in both directions, which all lie in one point, the
corner. Two levels are the same where :func:`segar.levels.apart.near_levels` says so for a distance of 0.
"""

import dataclasses
import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from segar.errors import PriorError
from segar.language import CIRCLE, HULL, BaseShape, Factor, Position, Size, Tile
from segar.levels.apart import WITHOUT_EFFECT, are_comparable
from segar.levels.priors import factors_read
from segar.levels.probability.entropy import acceptance_of
from segar.levels.sampling.placement import ARENA_HIGH, ARENA_LOW, WALL_MARGIN
from segar.levels.sampling.plan import SamplingPlan, SlotGroup
from segar.noise import MixtureNoise, Noise, as_noise
from segar.support import Estimate

MOST_STATES = 200_000  # kinds of levels that are kept apart
NEGLIGIBLE = 1e-24  # probability of two levels of a kind, below which it counts as 0
FAR = 1e3  # [m] beyond all places

Box = tuple[float, float, float, float]  # [m] lowest and highest x, lowest and highest y of where a thing was drawn
States = dict[tuple[Any, ...], int]


@dataclass(frozen=True)
class _Atom:
    """What something is with a probability of ``mass``; of a thing, where it was drawn, and by which distribution."""

    mass: float
    boxes: tuple[Box, ...] = ()
    places: tuple[Noise, ...] = ()


Atoms = dict[Any, _Atom]
"""What something can be to how likely it is that."""


def shared_probability(plan: SamplingPlan, other: SamplingPlan, n: int) -> Estimate:
    """The probability that a level of ``other`` is one of ``n`` independent levels of ``plan``.

    The value is exact, with an error of 0, where no two things can be drawn too close to each other. Elsewhere the error
    bounds what the minimal distance between things takes off.

    Raises:
        PriorError: a factor with atoms depends on other factors, or there are too many kinds of levels.
    """
    if not are_comparable(plan.layout, other.layout):
        return Estimate(0.0)
    states: States = {(1.0, 1.0, (), (), ()): 1}
    for mine, theirs in zip(plan.groups, other.groups, strict=True):
        states = _with_group(states, plan, mine, other, theirs)
    if not states:  # before rule sets are listed, of which there can be very many
        return Estimate(0.0)
    for one, two in zip(_parameters(plan), _parameters(other), strict=True):
        states = _joined(states, one, two)
    least = most = 0.0
    for (p, q, boxes, of_p, of_q), number in states.items():
        low, high = _kept(boxes, plan.min_distance)
        low_q, high_q = _kept(boxes, other.min_distance)
        (a, b), (c, d) = (_accepted(places, one) for places, one in ((of_p, plan), (of_q, other)))
        least += number * (q * low_q / d) * _among(p * low / b, n)
        most += number * min(q * high_q / c, 1.0) * _among(p * high / a, n)
    return Estimate((least + most) / 2, (most - least) / 2)


def _among(p: float, n: int) -> float:
    """The probability that at least one of ``n`` draws is one that has the probability ``p``."""
    return 1.0 if p >= 1 else -math.expm1(n * math.log1p(-p))


def _joined(states: States, mine: Atoms, theirs: Atoms) -> States:
    """All combinations of states with what both can be; those that count alike are one."""
    found: States = {}
    common = [(atom, theirs[key]) for key, atom in mine.items() if key in theirs]
    for (p, q, boxes, of_p, of_q), number in states.items():
        for one, two in common:
            if p * one.mass * q * two.mass < NEGLIGIBLE:
                continue
            state = p * one.mass, q * two.mass, boxes + one.boxes, of_p + one.places, of_q + two.places
            found[state] = found.get(state, 0) + number
        if len(found) > MOST_STATES:
            raise _too_many()
    return found


def _too_many() -> PriorError:
    return PriorError(
        f"there are more than {MOST_STATES:,} kinds of levels with a probability; sample levels, and count those that are"
        " shared"
    )


def _parameters(plan: SamplingPlan) -> Iterator[Atoms]:
    """The atoms of each world parameter; those of a rule space are together the last."""
    drawn, of_rules = {column: prior.value for column, prior in plan.parameter_priors}, plan.rule_columns
    for column, constant in enumerate(plan.parameters.tolist()):
        if column not in of_rules:
            yield _line_atoms(as_noise(drawn.get(column, constant)))
    if plan.rule_space is None:
        yield {(): _Atom(1.0)}
        return
    space, found = plan.rule_space, {}
    for active, mass in zip(space.combinations.active, space.combinations.probability.tolist(), strict=True):
        chosen = [option for option, is_active in zip(space.options, active, strict=True) if is_active]
        values = [_line_atoms(law) for option in chosen for law in option.constants.values()]
        if len(found) + math.prod(map(len, values)) > MOST_STATES:
            raise PriorError(
                f"the rule space has more than {MOST_STATES:,} rule sets with a probability; sample, and count"
            )
        for constants in product(*(one.items() for one in values)):
            key = (tuple(active.tolist()), *(value for value, _ in constants))
            found[key] = _Atom(mass * math.prod(atom.mass for _, atom in constants))
    yield found


def _with_group(states: States, plan: SamplingPlan, mine: SlotGroup, other: SamplingPlan, theirs: SlotGroup) -> States:
    """The states with the entities of one group of slots, which holds as many as both plans can draw."""
    found: States = {}
    for count, (one, two) in enumerate(zip(_counts(mine), _counts(theirs), strict=True)):
        filled = _joined(states, one, two)
        for slot in mine.slots[:count]:
            filled = _joined(filled, _entity(plan, mine, slot), _entity(other, theirs, slot)) if filled else filled
        for state, number in filled.items():
            found[state] = found.get(state, 0) + number
    return found


def _counts(group: SlotGroup) -> list[Atoms]:
    """The probability of each number of entities."""
    return [{(): _Atom(float(as_noise(group.count).pmf(count)))} for count in range(len(group.slots) + 1)]


def _entity(plan: SamplingPlan, group: SlotGroup, slot: int) -> Atoms:
    """What the entity of a slot can be with a probability, if there is one."""
    found: Atoms = {}
    for kind, mass in zip(group.types, group.probabilities, strict=True):
        values = _values(plan, slot, kind) if mass else {}
        for shape, of_shape in _shapes(plan, slot, kind) if values else ():
            for size, of_size in _sizes(plan, slot, kind, shape):
                for place, at in _places(plan, slot, kind, shape, size).items():
                    for value, atom in values.items():
                        key = kind, value, _shape_key(shape), size, place
                        whole = mass * of_shape * of_size * at.mass * atom.mass
                        before = found[key].mass if key in found else 0.0
                        found[key] = dataclasses.replace(at, mass=before + whole)
    return found


def _values(plan: SamplingPlan, slot: int, kind: int) -> Atoms:
    """The atoms of all factors that count, but size and position."""
    found: Atoms = {(): _Atom(1.0)}
    for factor in plan.layout.types[kind].declared:
        if factor.width and factor not in WITHOUT_EFFECT and not issubclass(factor, (Size, Position)):
            atoms = _atoms_of(plan, slot, factor, kind)
            if len(found) * len(atoms) > MOST_STATES:
                raise _too_many()
            pairs = product(found.items(), atoms.items())
            found = {(*key, *value): _Atom(one.mass * two.mass) for (key, one), (value, two) in pairs}
        if not found:
            break
    return found


def _atoms_of(plan: SamplingPlan, slot: int, factor: type[Factor], kind: int) -> Atoms:
    """The atoms of a factor; raises :class:`PriorError` where these depend on other factors."""
    noise = plan.law(slot, factor, kind)
    if isinstance(noise, Noise):
        return _line_atoms(noise)
    laws = [getattr(prior.value, "law", prior.value) for prior in noise.priors]
    if factors_read(noise.priors[-1]) or any(len(as_noise(law).atoms[0]) for law in laws):
        raise PriorError(
            f"{noise.priors[0]}: a {factor.__name__} that depends on other factors has no probability of its own; sample"
            " levels, and count those that are shared"
        )
    return {}


def _shapes(plan: SamplingPlan, slot: int, kind: int) -> list[tuple[BaseShape | None, float]]:
    """Shapes that have a probability."""
    outline = plan.outline_of(slot, kind)
    if outline is None:
        return [(None, 1.0)]
    chosen = zip(outline.choice.keys, outline.choice.p or (), strict=True)
    return [(shape, p) for shape, p in chosen if p and not shape.is_random]


def _shape_key(shape: BaseShape | None) -> Any:
    return None if shape is None else (shape.kind, tuple(map(tuple, shape.vertices)) if shape.kind == HULL else ())


def _sizes(plan: SamplingPlan, slot: int, kind: int, shape: BaseShape | None) -> list[tuple[float | None, float]]:
    """Sizes in which episodes start: those of hulls and of round tiles are their shape's."""
    if Size not in plan.layout.types[kind].declared:
        return [(None, 1.0)]
    is_tile = issubclass(plan.layout.types[kind], Tile)
    if shape is not None and (shape.kind == HULL or is_tile or plan.size_follows_shape(slot, kind)):
        return [(float(shape.size), 1.0)]
    return [(value[0], atom.mass) for value, atom in _atoms_of(plan, slot, Size, kind).items()]


def _places(plan: SamplingPlan, slot: int, kind: int, shape: BaseShape | None, size: float | None) -> Atoms:
    """Points in which a thing starts with a probability, once it is moved out of walls."""
    if Position not in plan.layout.types[kind].declared:
        return {(): _Atom(1.0)}
    noise = plan.law(slot, Position, kind)
    if not isinstance(noise, Noise):
        raise PriorError(f"{noise.priors[0]}: places that depend on other factors have no probability of their own")
    low, high = (0.0, 0.0), (0.0, 0.0)
    if shape is not None and shape.kind == HULL:
        corners = np.asarray(shape.vertices)
        low, high = tuple(corners.min(axis=0).tolist()), tuple(corners.max(axis=0).tolist())
    elif shape is not None and shape.kind == CIRCLE and size is not None:
        low, high = (-size / 2,) * 2, (size / 2,) * 2
    ends = [(ARENA_LOW - one + WALL_MARGIN, ARENA_HIGH - two - WALL_MARGIN) for one, two in zip(low, high, strict=True)]
    return {at: _Atom(mass, (box,), (noise,)) for at, (mass, box) in _in_walls(noise, *ends).items() if mass > 0}


def _in_walls(noise: Noise, of_x: tuple[float, float], of_y: tuple[float, float]) -> dict[Any, tuple[float, Box]]:
    """The points with a probability of a place that is moved between walls, its mass, and where it was drawn."""
    if noise.components is not None:
        x, y = (_on_line(part, *ends) for part, ends in zip(noise.components, (of_x, of_y), strict=True))
        return {(a, b): (p * q, (*r, *s)) for (a, (p, r)), (b, (q, s)) in product(x.items(), y.items())}
    found: dict[Any, tuple[float, Box]] = {}
    if isinstance(noise, MixtureNoise):
        for part, weight in zip(noise.laws, noise.weights, strict=True):
            for at, (mass, box) in _in_walls(part, of_x, of_y).items():
                before, other = found.get(at, (0.0, box))
                wide = min(box[0], other[0]), max(box[1], other[1]), min(box[2], other[2]), max(box[3], other[3])
                found[at] = before + weight * mass, wide
        return found
    (values, masses), f = noise.atoms, lambda x, y: float(noise.cdf(np.array([x, y])))
    for value, mass in zip(values.tolist(), masses.tolist(), strict=True):
        found[tuple(value)] = mass, (value[0], value[0], value[1], value[1])
    (x0, x1), (y0, y1) = of_x, of_y
    corners = {
        (x0, y0): (f(x0, y0), (-FAR, x0, -FAR, y0)), (x0, y1): (f(x0, FAR) - f(x0, y1), (-FAR, x0, y1, FAR)),
        (x1, y0): (f(FAR, y0) - f(x1, y0), (x1, FAR, -FAR, y0)),
        (x1, y1): (1 - f(x1, FAR) - f(FAR, y1) + f(x1, y1), (x1, FAR, y1, FAR)),
    }  # fmt: skip
    return found | {at: one for at, one in corners.items() if one[0] > 0}


def _on_line(noise: Noise, low: float, high: float) -> dict[float, tuple[float, tuple[float, float]]]:
    """The numbers with a probability of one that is moved between ``low`` and ``high``, its mass, and where it was drawn."""
    (first, last), found = noise.support, {}
    below, above = float(noise.cdf(low)), 1.0 - float(noise.cdf(high)) + float(noise.pmf(high))
    if below > 0:
        found[low] = below, (min(first, low), low)
    if above > 0:
        found[high] = above, (high, max(last, high))
    for value, mass in zip(*(one.tolist() for one in noise.atoms), strict=True):
        if low < value < high:
            found[value] = mass, (value, value)
    return found


def _kept(boxes: tuple[Box, ...], min_distance: float) -> tuple[float, float]:
    """Least and largest share of places, drawn in these boxes, that a minimal distance accepts."""
    low = 1.0
    for one, two in combinations(boxes, 2):
        gaps = [
            (max(two[k] - one[k + 1], one[k] - two[k + 1], 0.0), max(two[k + 1] - one[k], one[k + 1] - two[k]))
            for k in (0, 2)
        ]
        nearest, farthest = (math.hypot(*ends) for ends in zip(*gaps, strict=True))
        if farthest <= min_distance:
            return 0.0, 0.0
        low = 0.0 if nearest <= min_distance else low
    return low, 1.0


def _accepted(places: tuple[Noise, ...], plan: SamplingPlan) -> tuple[float, float]:
    """Least and largest share of all places of such things that the minimal distance accepts: one number where it takes off
    none, else three standard errors around an estimate."""
    boxes = tuple((*x, *y) for x, y in (noise.support for noise in places))
    if _kept(boxes, plan.min_distance)[0] == 1.0:
        return 1.0, 1.0
    found = acceptance_of(tuple(sorted(places, key=repr)), plan.min_distance)
    return max(found.value - 3 * found.error, 1e-12), min(found.value + 3 * found.error, 1.0)


def _line_atoms(noise: Noise) -> Atoms:
    values, masses = noise.atoms
    return {tuple(np.atleast_1d(v).tolist()): _Atom(m) for v, m in zip(values, masses.tolist(), strict=True) if m > 0}
