"""Contacts in plain Python, written a second time: what the kernels' contacts are compared with.

Bodies are discs. After positions advanced, the contact that has lasted longest is found, of a body with a wall or with
another body; everything moves back by that time; and so on until nothing overlaps. The contact found last came first:
its bodies exchange velocities there, and everything goes on for the time that was taken back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from segar.language import Mobile, Number, Position, VectorValue, Velocity
from segar.reference.reference_state import TOUCH, Scene

MAX_CONTACTS = 64  # contacts that one sub-step resolves before it gives up the rest of its time
MAX_REWINDS = 256  # moves back before one contact
MAX_SEPARATIONS = 50  # passes that push overlapping bodies apart after a sub-step gave up
REST_OVERLAP = 1e-7  # [m] bodies that move alike and overlap deeper than this are pushed apart
TIME_TOLERANCE = 1e-6  # [s] by which a contact may lie before the sub-step's begin

Rates = dict[int, VectorValue]


@dataclass(frozen=True)
class ContactRules:
    """What the world says about contacts, as functions of slots.

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


def move(scene: Scene, rates: Rates, time: float) -> None:
    """Move everything along its rate for ``time`` [s]."""
    for slot, rate in rates.items():
        _place(scene, slot, scene.vector(slot, Position) + rate * time)


def resolve_contacts(scene: Scene, rules: ContactRules, rates: Rates, passed: float) -> tuple[int, bool]:
    """Resolve all contacts of the last ``passed`` seconds; returns (contacts, whether the time was given up)."""
    for count in range(MAX_CONTACTS):
        taken_back, contact, too_early = _rewind(scene, rules, rates, passed)
        if contact is None:
            return count, False
        _exchange(scene, rules, contact, too_early)
        passed = min(max(taken_back, 0.0), passed)
        rates = rules.rates()
        move(scene, rates, passed)
    _separate(scene, rules)
    return MAX_CONTACTS, True


def _rewind(scene: Scene, rules: ContactRules, rates: Rates, passed: float) -> tuple[float, Contact | None, bool]:
    """Move back to the first contact: (time moved back, that contact, whether it began before the sub-step)."""
    taken_back, last = 0.0, None
    for _ in range(MAX_REWINDS):
        contact = _longest_ago(scene, rules)
        if contact is None:
            break
        last = contact
        if not taken_back + contact.time < passed + TIME_TOLERANCE:
            return taken_back, last, True
        taken_back += contact.time
        move(scene, rates, -contact.time)
    return taken_back, last, False


def _exchange(scene: Scene, rules: ContactRules, contact: Contact, too_early: bool) -> None:
    """What has been in contact since before the sub-step is put right in place, and exchanges only if it approaches."""
    i, j = contact.body, contact.other
    x, v = scene.vector(i, Position), scene.vector(i, Velocity)
    if j is None:
        axes = _blocked(x, scene.radius(i), scene.walls)
        outward = (axes * x).dot(v) > 0
        if outward or not too_early:
            rules.hit_wall(i, axes)
        if too_early:
            _push_inside(scene, i)
        return
    approach = (v - scene.vector(j, Velocity)).dot(scene.vector(j, Position) - x) > 0
    if approach or not too_early:
        rules.hit_body(i, j)
    if too_early:
        _push_apart(scene, i, j)


def _longest_ago(scene: Scene, rules: ContactRules) -> Contact | None:
    """The contact that began longest ago; of equals the first, where walls come first and then bodies in order."""
    found: list[Contact] = []
    bodies = scene.bodies
    solid = {b: rules.solid(b) for b in bodies}
    for n, i in enumerate(bodies):
        found.append(Contact(_time_in_wall(scene, i), i, None))
        found += [Contact(_time_in_body(scene, i, j), i, j) for j in bodies[n + 1 :] if solid[i] and solid[j]]
    overlapping = [c for c in found if c.time > 0]
    return max(overlapping, key=lambda c: c.time, default=None)


def _time_in_wall(scene: Scene, i: int) -> float:
    x, v, r = scene.vector(i, Position), scene.vector(i, Velocity), scene.radius(i)
    beyond = [(abs(x.x) + r - scene.walls, abs(v.x)), (abs(x.y) + r - scene.walls, abs(v.y))]
    times = [depth / speed for depth, speed in beyond if depth > 0]
    return max(times) + TOUCH / v.norm() if times else 0.0


def _time_in_body(scene: Scene, i: int, j: int) -> float:
    """The positive root t of |d + w t| = reach, where d is the distance and w the speed of approach.

    Infinite for what overlaps, moves alike, and could be pushed apart.
    """
    d = scene.vector(j, Position) - scene.vector(i, Position)
    w = scene.vector(i, Velocity) - scene.vector(j, Velocity)
    reach = scene.radius(i) + scene.radius(j) + TOUCH
    c = d.dot(d) - reach * reach
    a, b = w.dot(w), w.dot(d)
    if c > 0:
        return 0.0
    if a == 0:
        hard = scene.radius(i) + scene.radius(j) - REST_OVERLAP
        stuck = hard > 0 and d.dot(d) < hard * hard and (_is_movable(scene, i) or _is_movable(scene, j))
        return float("inf") if stuck else 0.0
    return ((b * b - a * c).sqrt() - b) / a + TOUCH / a.sqrt()


def _blocked(x: VectorValue, r: float, walls: float) -> VectorValue:
    """1 in the axis of the nearest wall, else 0; both 1 exactly on a corner's diagonal."""
    gaps = [min(walls - (c + r), c - r + walls) for c in x]
    return VectorValue(float(gaps[0] <= gaps[1]), float(gaps[1] <= gaps[0]))


def _separate(scene: Scene, rules: ContactRules) -> None:
    """Push bodies apart and into the arena until no two overlap."""
    bodies = scene.bodies
    for _ in range(MAX_SEPARATIONS):
        moved = False
        for n, i in enumerate(bodies):
            for j in bodies[n + 1 :] if rules.solid(i) else []:
                d = scene.vector(j, Position) - scene.vector(i, Position)
                reach = scene.radius(i) + scene.radius(j)
                if rules.solid(j) and d.dot(d) < reach * reach:
                    _push_apart(scene, i, j)
                    moved = True
            _push_inside(scene, i)
        if not moved:
            return


def _push_inside(scene: Scene, i: int) -> None:
    limit = max(scene.walls - scene.radius(i) - TOUCH, 0.0)
    x = scene.vector(i, Position)
    px, py = (min(max(float(c), -limit), limit) for c in x)
    _place(scene, i, VectorValue(px, py))


def _push_apart(scene: Scene, i: int, j: int) -> None:
    """Only what is mobile moves; two of a kind share the way."""
    xi, xj = scene.vector(i, Position), scene.vector(j, Position)
    d = (xj - xi).norm()
    depth = scene.radius(i) + scene.radius(j) + 2 * TOUCH - d
    if depth <= 0:
        return
    n = (xj - xi) / d if d > 0 else VectorValue(1.0, 0.0)
    free = [_is_movable(scene, s) for s in (i, j)]
    share = Number(0.5 if free[0] == free[1] else free[0])
    _place(scene, i, xi - n * (depth * share))
    _place(scene, j, xj + n * (depth * (1 - share)))


def _is_movable(scene: Scene, slot: int) -> bool:
    return not scene.has(slot, Mobile) or bool(scene.scalar(slot, Mobile))


def _place(scene: Scene, slot: int, x: VectorValue) -> None:
    scene.write(slot, scene.column(slot, Position), (float(x.x), float(x.y)))
