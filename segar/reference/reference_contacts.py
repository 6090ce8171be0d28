"""Contacts in plain Python, written a second time: what the kernels' contacts are compared with.

Bodies are discs. After positions advanced, the contact that has lasted longest is found, of a body with a wall or with
another body. All bodies move back by that time, and this is repeated until none overlap. The contact found last came
first: its bodies exchange velocities there, and all bodies move on for the time that was taken back.
"""

from collections.abc import Callable
from dataclasses import dataclass

from segar.language import Mobile, Number, Position, VectorValue, Velocity
from segar.reference.reference_state import TOUCH, ReferenceState

MAX_CONTACTS = 64  # contacts that one sub-step resolves; the rest of its time is left out then
MAX_REWINDS = 256  # moves back before one contact
MAX_SEPARATIONS = 50  # passes that push overlapping bodies apart where contacts were left unresolved
REST_OVERLAP = 1e-7  # [m] bodies that move alike and overlap deeper than this are pushed apart
TIME_TOLERANCE = 1e-6  # [s] by which a contact may lie before the sub-step's begin

Rates = dict[int, VectorValue]


@dataclass(frozen=True)
class ContactRules:
    """The rules of a world for contacts, as functions of slots.

    Attributes:
        solid: whether a body collides with other bodies.
        hit_wall: the wall's effect on a body, given the axes that are blocked.
        hit_body: the exchange between two bodies.
        rates: at which rates all things move now.
    """

    solid: Callable[[int], bool]
    hit_wall: Callable[[int, VectorValue], None]
    hit_body: Callable[[int, int], None]
    rates: Callable[[], Rates]


@dataclass(frozen=True)
class Contact:
    """A body, what it touches (None: a wall), and how long ago [s] that began."""

    time: float
    body: int
    other: int | None


def move(state: ReferenceState, rates: Rates, time: float) -> None:
    """Move all things along their rates for ``time`` [s]."""
    for slot, rate in rates.items():
        _place(state, slot, state.vector(slot, Position) + rate * time)


def resolve_contacts(state: ReferenceState, rules: ContactRules, rates: Rates, passed: float) -> tuple[int, bool]:
    """Resolve all contacts of the last ``passed`` seconds; returns (contacts, whether some are unresolved)."""
    for count in range(MAX_CONTACTS):
        taken_back, contact, too_early = _rewind(state, rules, rates, passed)
        if contact is None:
            return count, False
        _exchange(state, rules, contact, too_early)
        passed = min(max(taken_back, 0.0), passed)
        rates = rules.rates()
        move(state, rates, passed)
    _separate(state, rules)
    return MAX_CONTACTS, True


def _rewind(
    state: ReferenceState, rules: ContactRules, rates: Rates, passed: float
) -> tuple[float, Contact | None, bool]:
    """Move back to the first contact: (time moved back, that contact, whether it began before the sub-step)."""
    taken_back, last = 0.0, None
    for _ in range(MAX_REWINDS):
        contact = _longest_ago(state, rules)
        if contact is None:
            break
        last = contact
        if not taken_back + contact.time < passed + TIME_TOLERANCE:
            return taken_back, last, True
        taken_back += contact.time
        move(state, rates, -contact.time)
    return taken_back, last, False


def _exchange(state: ReferenceState, rules: ContactRules, contact: Contact, too_early: bool) -> None:
    """Apply the rule of contact. Bodies in contact since before the sub-step exchange velocities only if they approach,
    and are pushed apart."""
    i, j = contact.body, contact.other
    x, v = state.vector(i, Position), state.vector(i, Velocity)
    if j is None:
        axes = _blocked(x, state.radius(i), state.walls)
        outward = (axes * x).dot(v) > 0
        if outward or not too_early:
            rules.hit_wall(i, axes)
        if too_early:
            _push_inside(state, i)
        return
    approach = (v - state.vector(j, Velocity)).dot(state.vector(j, Position) - x) > 0
    if approach or not too_early:
        rules.hit_body(i, j)
    if too_early:
        _push_apart(state, i, j)


def _longest_ago(state: ReferenceState, rules: ContactRules) -> Contact | None:
    """The contact that began longest ago; of equals the first, where walls come first and then bodies in order."""
    found: list[Contact] = []
    bodies = state.bodies
    solid = {b: rules.solid(b) for b in bodies}
    for n, i in enumerate(bodies):
        found.append(Contact(_time_in_wall(state, i), i, None))
        found += [Contact(_time_in_body(state, i, j), i, j) for j in bodies[n + 1 :] if solid[i] and solid[j]]
    overlapping = [c for c in found if c.time > 0]
    return max(overlapping, key=lambda c: c.time, default=None)


def _time_in_wall(state: ReferenceState, i: int) -> float:
    x, v, r = state.vector(i, Position), state.vector(i, Velocity), state.radius(i)
    beyond = [(abs(x.x) + r - state.walls, abs(v.x)), (abs(x.y) + r - state.walls, abs(v.y))]
    times = [depth / speed for depth, speed in beyond if depth > 0]
    return max(times) + TOUCH / v.norm() if times else 0.0


def _time_in_body(state: ReferenceState, i: int, j: int) -> float:
    """The positive root t of |d + w t| = reach, where d is the distance and w the speed of approach.

    Infinite for what overlaps, moves alike, and could be pushed apart.
    """
    d = state.vector(j, Position) - state.vector(i, Position)
    w = state.vector(i, Velocity) - state.vector(j, Velocity)
    reach = state.radius(i) + state.radius(j) + TOUCH
    c = d.dot(d) - reach * reach
    a, b = w.dot(w), w.dot(d)
    if c > 0:
        return 0.0
    if a == 0:
        hard = state.radius(i) + state.radius(j) - REST_OVERLAP
        stuck = hard > 0 and d.dot(d) < hard * hard and (_is_movable(state, i) or _is_movable(state, j))
        return float("inf") if stuck else 0.0
    return ((b * b - a * c).sqrt() - b) / a + TOUCH / a.sqrt()


def _blocked(x: VectorValue, r: float, walls: float) -> VectorValue:
    """1 in the axis of the nearest wall, else 0; both 1 exactly on a corner's diagonal."""
    gaps = [min(walls - (c + r), c - r + walls) for c in x]
    return VectorValue(float(gaps[0] <= gaps[1]), float(gaps[1] <= gaps[0]))


def _separate(state: ReferenceState, rules: ContactRules) -> None:
    """Push bodies apart and into the arena until no two overlap."""
    bodies = state.bodies
    for _ in range(MAX_SEPARATIONS):
        moved = False
        for n, i in enumerate(bodies):
            for j in bodies[n + 1 :] if rules.solid(i) else []:
                d = state.vector(j, Position) - state.vector(i, Position)
                reach = state.radius(i) + state.radius(j)
                if rules.solid(j) and d.dot(d) < reach * reach:
                    _push_apart(state, i, j)
                    moved = True
            _push_inside(state, i)
        if not moved:
            return


def _push_inside(state: ReferenceState, i: int) -> None:
    limit = max(state.walls - state.radius(i) - TOUCH, 0.0)
    x = state.vector(i, Position)
    px, py = (min(max(float(c), -limit), limit) for c in x)
    _place(state, i, VectorValue(px, py))


def _push_apart(state: ReferenceState, i: int, j: int) -> None:
    """Only what is mobile moves; two of a kind share the way."""
    xi, xj = state.vector(i, Position), state.vector(j, Position)
    d = (xj - xi).norm()
    depth = state.radius(i) + state.radius(j) + 2 * TOUCH - d
    if depth <= 0:
        return
    n = (xj - xi) / d if d > 0 else VectorValue(1.0, 0.0)
    free = [_is_movable(state, s) for s in (i, j)]
    share = Number(0.5 if free[0] == free[1] else free[0])
    _place(state, i, xi - n * (depth * share))
    _place(state, j, xj + n * (depth * (1 - share)))


def _is_movable(state: ReferenceState, slot: int) -> bool:
    return not state.has(slot, Mobile) or bool(state.scalar(slot, Mobile))


def _place(state: ReferenceState, slot: int, x: VectorValue) -> None:
    state.write(slot, state.column(slot, Position), (float(x.x), float(x.y)))
