"""Contacts as the kernels run them. The text below the first line is copied into a module that worlds of one layout share, and
that below the second, which calls what the rules became, into the module of each world.

State and shapes are those of :mod:`segar.engine.runtime.geometry`. Scratch: ``U[entity, axis]``, displacement rates;
``W[entity, column]``, of which contacts use the first three; ``L``, lists of integers. Everything is plain Python.
"""

# pyright: reportUndefinedVariable=false
import math

import numpy as np

from segar.engine.runtime.geometry import THRESHOLD, X, njit, radius

# Columns and slots; the generated module puts its own in their place.
VX = 0
COLLIDERS = MOVERS = np.zeros(0, np.int64)
COLLIDER_BITS = ORDER_AT = NEAR_AT = ROOM = 0
MANY_BODIES = CONTACT_MOVES = False
LOW, HIGH = -1.0, 1.0  # [m] walls of the arena

# The generated module defines these from the world's rules.


def solid(V, bits, i): ...  # type: ignore[no-untyped-def]
def movable(V, bits, i): ...  # type: ignore[no-untyped-def]
def rates(V, U, bits, P): ...  # type: ignore[no-untyped-def]
def hit_wall(V, bits, P, err, i, nx, ny): ...  # type: ignore[no-untyped-def]
def hit_body(V, bits, P, err, i, j): ...  # type: ignore[no-untyped-def]


# --- copied from here on ---
REST_OVERLAP = 1e-7  # [m] bodies that move alike and overlap deeper than this are pushed apart
REACH = 2.0  # a body can be off by twice its way in a sub-step from where it was listed: one back, one on
WALL = 0  # in place of the second body of a contact with a wall; of two bodies the second is never slot 0


@njit
def wall_time(V, r, i):
    """Time to move back until body ``i`` no longer reaches through a wall; 0 where it does not."""
    x, y = V[i, X], V[i, X + 1]
    vx, vy = V[i, VX], V[i, VX + 1]
    px = max(x + r - HIGH, LOW - (x - r))
    py = max(y + r - HIGH, LOW - (y - r))
    time = 0.0
    if px > 0.0:
        time = px / abs(vx)
    if py > 0.0:
        time = max(time, py / abs(vy))
    if time > 0.0:
        time += THRESHOLD / math.sqrt(vx * vx + vy * vy)
    return time


@njit
def pair_time(V, ri, rj, i, j):
    """Time to move back until bodies ``i`` and ``j`` just do not touch; 0 where they do not.

    No time helps what overlaps and moves alike: infinite, or 0 where it hardly overlaps.
    """
    dx = V[j, X] - V[i, X]
    dy = V[j, X + 1] - V[i, X + 1]
    reach = ri + rj + THRESHOLD
    gap2 = dx * dx + dy * dy - reach * reach
    if gap2 > 0.0:
        return 0.0
    wx = V[i, VX] - V[j, VX]
    wy = V[i, VX + 1] - V[j, VX + 1]
    speed = math.sqrt(wx * wx + wy * wy)
    if speed == 0.0:
        hard = ri + rj - REST_OVERLAP
        return np.inf if hard > 0.0 and dx * dx + dy * dy < hard * hard else 0.0
    along = (wx * dx + wy * dy) / speed
    return (math.sqrt(along * along - gap2) - along + THRESHOLD) / speed


@njit
def blocked_axes(V, r, i):
    """Which axes the nearest wall of body ``i`` blocks: (1, 0), (0, 1), or (1, 1) exactly in a corner's diagonal."""
    gap_x = min(HIGH - (V[i, X] + r), V[i, X] - r - LOW)
    gap_y = min(HIGH - (V[i, X + 1] + r), V[i, X + 1] - r - LOW)
    return (1.0 if gap_x <= gap_y else 0.0), (1.0 if gap_y <= gap_x else 0.0)


@njit
def push_inside(V, r, i):
    """Put body ``i`` back inside the walls; the largest bodies go to the middle."""
    limit = max(HIGH - r - THRESHOLD, 0.0)
    V[i, X] = min(max(V[i, X], -limit), limit)
    V[i, X + 1] = min(max(V[i, X + 1], -limit), limit)


@njit
def push_apart(V, ri, rj, share, i, j):
    """Move overlapping bodies apart along their line of centres; ``share`` of the way falls to ``i``."""
    dx = V[j, X] - V[i, X]
    dy = V[j, X + 1] - V[i, X + 1]
    d = math.sqrt(dx * dx + dy * dy)
    depth = ri + rj + 2.0 * THRESHOLD - d
    if depth <= 0.0:
        return
    nx, ny = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
    V[i, X] -= nx * depth * share
    V[i, X + 1] -= ny * depth * share
    V[j, X] += nx * depth * (1.0 - share)
    V[j, X + 1] += ny * depth * (1.0 - share)


@njit
def margin_of(U, i, time):
    """How far body ``i`` can get in ``time`` from its present place, and still touch [m]; 0 for no time."""
    if time == 0.0:
        return 0.0
    return REACH * math.sqrt(U[i, 0] * U[i, 0] + U[i, 1] * U[i, 1]) * time + THRESHOLD


@njit
def measure_bodies(V, W, U, bits, kind, hull_radius, time):
    """Write what lists need of each body: ``W[body, 1]`` its radius, ``W[body, 2]`` how far it can get in ``time`` from
    its present place, ``W[body, 0]`` the left edge of both together, infinite for an absent body."""
    for a in range(len(COLLIDERS)):
        i = COLLIDERS[a]
        W[i, 1] = radius(V, kind, hull_radius, i)
        W[i, 2] = margin_of(U, i, time)
        W[i, 0] = V[i, X] - W[i, 1] - W[i, 2] if (bits[i] & COLLIDER_BITS) == COLLIDER_BITS else np.inf


@njit
def sort_bodies(W, L):
    """Order the bodies in ``L[ORDER_AT:]`` by their left edge. The last order is nearly right: insertion is fast."""
    for a in range(1, len(COLLIDERS)):
        i = L[ORDER_AT + a]
        left = W[i, 0]
        b = a
        while b > 0 and W[L[ORDER_AT + b - 1], 0] > left:
            L[ORDER_AT + b] = L[ORDER_AT + b - 1]
            b -= 1
        L[ORDER_AT + b] = i


@njit
def any_touch(V, W, U, bits, kind, hull_radius, L):
    """As ``may_touch``, for many bodies: only those whose extents in x overlap are compared."""
    measure_bodies(V, W, U, bits, kind, hull_radius, 0.0)
    sort_bodies(W, L)
    for a in range(len(COLLIDERS)):
        i = L[ORDER_AT + a]
        if W[i, 0] == np.inf:
            return False
        x, y, r = V[i, X], V[i, X + 1], W[i, 1]
        if abs(x) + r > HIGH or abs(y) + r > HIGH:
            return True
        right = x + r + THRESHOLD
        for b in range(a + 1, len(COLLIDERS)):
            j = L[ORDER_AT + b]
            if W[j, 0] > right:
                break
            reach = r + W[j, 1] + THRESHOLD
            dx = V[j, X] - x
            dy = V[j, X + 1] - y
            if dx * dx + dy * dy <= reach * reach:
                return True
    return False


@njit
def list_near(V, W, U, bits, kind, hull_radius, L, time):
    """List walls and pairs that can meet within ``time`` in ``L[NEAR_AT:]``, as ``first << 16 | second``; returns how many."""
    n = 0
    measure_bodies(V, W, U, bits, kind, hull_radius, time)
    if MANY_BODIES:
        sort_bodies(W, L)
    for a in range(len(COLLIDERS)):
        i = L[ORDER_AT + a] if MANY_BODIES else COLLIDERS[a]
        if W[i, 0] == np.inf:
            continue
        x, y, r = V[i, X], V[i, X + 1], W[i, 1] + W[i, 2]
        right = x + r
        if abs(x) + r > HIGH or abs(y) + r > HIGH:
            L[NEAR_AT + n] = (i << 16) | WALL
            n += 1
        for b in range(a + 1, len(COLLIDERS)):
            j = L[ORDER_AT + b] if MANY_BODIES else COLLIDERS[b]
            if MANY_BODIES:
                if W[j, 0] > right:
                    break
            elif W[j, 0] == np.inf:
                continue
            reach = r + W[j, 1] + W[j, 2]
            dx = V[j, X] - x
            dy = V[j, X + 1] - y
            if dx * dx + dy * dy <= reach * reach:
                L[NEAR_AT + n] = (min(i, j) << 16) | max(i, j)
                n += 1
    return n


@njit
def list_faster(V, W, U, L, near, i, time):
    """List again what body ``i`` can meet, if it has become faster since it was listed; returns the new number of entries.

    Entries may stand in the list twice. Negative where there is no room for them.
    """
    margin = margin_of(U, i, time)
    if margin <= W[i, 2]:
        return near
    if near + len(COLLIDERS) > ROOM:
        return -1
    W[i, 2] = margin
    x, y, r = V[i, X], V[i, X + 1], W[i, 1] + margin
    L[NEAR_AT + near] = (i << 16) | WALL
    near += 1
    for a in range(len(COLLIDERS)):
        j = COLLIDERS[a]
        reach = r + W[j, 1] + W[j, 2]
        dx = V[j, X] - x
        dy = V[j, X + 1] - y
        if j != i and W[j, 0] < np.inf and dx * dx + dy * dy <= reach * reach:
            L[NEAR_AT + near] = (min(i, j) << 16) | max(i, j)
            near += 1
    return near


@njit
def share_of(first, second):
    """How much of a separation the first of two bodies moves, given which of them can move."""
    if first == second:
        return 0.5
    return 1.0 if first else 0.0


@njit
def translate(V, U, time):
    """Move all bodies along their displacement rates ``U`` for ``time``."""
    for m in range(len(MOVERS)):
        i = MOVERS[m]
        V[i, X] += U[i, 0] * time
        V[i, X + 1] += U[i, 1] * time


@njit
def approaching(V, i, j):
    """Whether two bodies come nearer to each other."""
    dx, dy = V[j, X] - V[i, X], V[j, X + 1] - V[i, X + 1]
    wx, wy = V[i, VX] - V[j, VX], V[i, VX + 1] - V[j, VX + 1]
    return wx * dx + wy * dy > 0.0


# --- copied from here on, with what the rules became ---
MAX_CONTACTS = 64  # contacts that one sub-step resolves; the rest of its time is left out then
MAX_REWINDS = 256  # rewinds before one contact
MAX_SEPARATIONS = 50  # passes that push overlapping bodies apart where contacts were left unresolved


@njit
def find_contact(V, W, bits, L, near):
    """The contact with the longest time to move back among those listed: (time, its entry); time 0 for none.

    Of equally long ones the first entry counts, so that the order of the list does not matter.
    """
    best, found = 0.0, 0
    for n in range(near):
        entry = L[NEAR_AT + n]
        i, j = entry >> 16, entry & 65535
        time = wall_time(V, W[i, 1], i) if j == WALL else pair_time(V, W[i, 1], W[j, 1], i, j)
        if time > best or (time == best and time > 0.0 and entry < found):
            if j != WALL and not (solid(V, bits, i) and solid(V, bits, j)):
                continue
            if j != WALL and time == np.inf and not (movable(V, bits, i) or movable(V, bits, j)):
                continue
            best, found = time, entry
    return best, found


@njit
def separate(V, bits, kind, hull_radius):
    """Push bodies apart and into the arena until nothing overlaps, at most 50 passes."""
    for _ in range(MAX_SEPARATIONS):
        moved = False
        for a in range(len(COLLIDERS)):
            i = COLLIDERS[a]
            if (bits[i] & COLLIDER_BITS) != COLLIDER_BITS:
                continue
            ri = radius(V, kind, hull_radius, i)
            if not solid(V, bits, i):
                push_inside(V, ri, i)
                continue
            for b in range(a + 1, len(COLLIDERS)):
                j = COLLIDERS[b]
                if (bits[j] & COLLIDER_BITS) != COLLIDER_BITS or not solid(V, bits, j):
                    continue
                rj = radius(V, kind, hull_radius, j)
                dx, dy = V[j, X] - V[i, X], V[j, X + 1] - V[i, X + 1]
                if dx * dx + dy * dy < (ri + rj) * (ri + rj):
                    push_apart(V, ri, rj, share_of(movable(V, bits, i), movable(V, bits, j)), i, j)
                    moved = True
            push_inside(V, ri, i)
        if not moved:
            return


@njit
def exchange(V, bits, kind, hull_radius, P, err, i, j, early):
    """Apply the rule of contact to body ``i`` and a wall or body ``j``; ``early``: in contact before the sub-step."""
    if j == WALL:
        nx, ny = blocked_axes(V, radius(V, kind, hull_radius, i), i)
        if not early or nx * V[i, X] * V[i, VX] + ny * V[i, X + 1] * V[i, VX + 1] > 0.0:
            hit_wall(V, bits, P, err, i, nx, ny)
        if early:
            push_inside(V, radius(V, kind, hull_radius, i), i)
    else:
        if not early or approaching(V, i, j):
            hit_body(V, bits, P, err, i, j)
        if early:
            share = share_of(movable(V, bits, i), movable(V, bits, j))
            push_apart(V, radius(V, kind, hull_radius, i), radius(V, kind, hull_radius, j), share, i, j)


@njit
def resolve_contacts(V, W, U, bits, kind, hull_radius, P, err, L, dt):
    """Find the first contact, move back to it, exchange, go on; returns (contacts, whether some were left unresolved).

    A contact that would need more time than has passed was there before this sub-step (a body pinned, grown, or at rest
    in contact): it is resolved in place, by an exchange if the bodies approach and by pushing them apart. Only walls and
    pairs in the list of near ones are tested: no body gets farther from its first place than it moves in a sub-step, so
    one list serves until a contact makes a body faster.
    """
    contacts, near, remaining, time_span = 0, -1, dt, dt + 1e-6
    while contacts < MAX_CONTACTS:
        if near < 0:
            near = list_near(V, W, U, bits, kind, hull_radius, L, time_span)
        total, found, early, rewinds = 0.0, 0, False, 0
        while rewinds < MAX_REWINDS:
            time, entry = find_contact(V, W, bits, L, near)
            if not time > 0.0:
                break
            found = entry
            rewinds += 1
            if not total + time < remaining + 1e-6:
                early = True
                break
            total += time
            translate(V, U, -time)
        if rewinds == 0:
            return contacts, False
        contacts += 1
        i, j = found >> 16, found & 65535
        exchange(V, bits, kind, hull_radius, P, err, i, j, early)
        remaining = min(max(total, 0.0), remaining)
        rates(V, U, bits, P)
        translate(V, U, remaining)
        near = -1 if early or CONTACT_MOVES else list_faster(V, W, U, L, near, i, time_span)
        if near >= 0 and j != WALL:
            near = list_faster(V, W, U, L, near, j, time_span)
    separate(V, bits, kind, hull_radius)
    return contacts, True
