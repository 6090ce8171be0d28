"""The world ``objectsx3-hard`` written directly in numba: four discs, some charged or magnetic, a goal, four walls."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from benchmarks.handwritten_columns import (
    ALIVE,
    AS_KERNELS,
    AT_REST,
    AX,
    AY,
    CHARGE,
    DIAGONAL,
    DONE,
    DX,
    DY,
    ENERGY,
    FLOOR_FRICTION,
    FRAMERATE,
    GOAL_FRICTION,
    GOAL_HEAT,
    GOAL_RADIUS,
    GOAL_X,
    GOAL_Y,
    GRAVITY,
    IMMOVABLE,
    KEEPS,
    MAGNETISM,
    MASS,
    MAX_CONTACTS,
    MAX_PASSES,
    MAX_REWINDS,
    MAX_SPEED,
    MIN_MASS,
    MIN_SPEED,
    MOBILE,
    RADIUS,
    TOUCH,
    VISIBLE,
    VX,
    VY,
    WALL_DAMPING,
    X,
    Y,
)

BODIES = 4  # the golf ball comes first
BALL = 0
WALL = -1  # in place of the second body


@njit(**AS_KERNELS)
def step_objects(
    body, goal, world, actions, sub_steps, reward, terminated, success, death, contacts, unresolved_contacts
):
    """Four discs, a goal and four walls."""
    for e in range(len(body)):
        b, floor, w = body[e], goal[e], world[e]
        dt = 1.0 / w[FRAMERATE]
        if b[BALL, MASS] != 0.0:
            b[BALL, VX] += 2.0 * min(max(np.float64(actions[e, 0]), -1.0), 1.0) / b[BALL, MASS]
            b[BALL, VY] += 2.0 * min(max(np.float64(actions[e, 1]), -1.0), 1.0) / b[BALL, MASS]
        over = False
        for _ in range(sub_steps):
            find_accelerations(b, floor, w)
            change_velocities(b, w, dt)
            move(b, w[MIN_SPEED], dt)
            if any_touch(b):
                hits, jammed = resolve(b, 1.0 - w[WALL_DAMPING], w[MIN_SPEED], dt)
                contacts[e] += hits
                unresolved_contacts[e] += jammed
            over = b[BALL, DONE] != 0.0 or b[BALL, ALIVE] == 0.0 or distance_to_goal(b, floor) <= 0.01
            if over:
                break
        far = distance_to_goal(b, floor)
        alive = b[BALL, ALIVE] != 0.0
        reward[e] = -(far * far) if alive else -(far * far) - 100.0
        terminated[e] = over
        success[e] = alive and b[BALL, DONE] == 0.0 and far <= 0.01
        death[e] = not alive


@njit(**AS_KERNELS)
def distance_to_goal(b, floor):
    """Distance of ball and goal as a share of the arena's diagonal."""
    dx, dy = b[BALL, X] - floor[GOAL_X], b[BALL, Y] - floor[GOAL_Y]
    return math.sqrt(dx * dx + dy * dy) / DIAGONAL


@njit(**AS_KERNELS)
def find_accelerations(b, floor, w):
    """Fields, friction and heat of all bodies; what is too light dies, and stops once all forces are known."""
    for i in range(BODIES):
        vx, vy, mass = b[i, VX], b[i, VY], b[i, MASS]
        mobile, alive = b[i, MOBILE] != 0.0, b[i, ALIVE] != 0.0
        speed = math.sqrt(vx * vx + vy * vy)
        ax = ay = 0.0
        for j in range(BODIES):
            charge, magnetism = b[j, CHARGE], b[j, MAGNETISM]
            if i != j and (charge != 0.0 or magnetism != 0.0):
                fx = fy = 0.0
                if charge != 0.0:
                    rx, ry = b[i, X] - b[j, X], b[i, Y] - b[j, Y]
                    r2 = rx * rx + ry * ry
                    if r2 != 0.0:
                        force = charge * b[i, CHARGE] / (r2 * math.sqrt(r2))
                        fx, fy = rx * force, ry * force
                if magnetism != 0.0:
                    wx, wy = vx - b[j, VX], vy - b[j, VY]
                    w2 = wx * wx + wy * wy
                    if w2 != 0.0:
                        force = b[i, CHARGE] * magnetism / w2
                        fx -= wy * force
                        fy += wx * force
                if mass != 0.0:
                    ax += fx * (1.0 / mass)
                    ay += fy * (1.0 / mass)
        dx = dy = 0.0
        gx, gy = b[i, X] - floor[GOAL_X], b[i, Y] - floor[GOAL_Y]
        reach = b[i, RADIUS] + floor[GOAL_RADIUS] + TOUCH
        if gx * gx + gy * gy <= reach * reach:
            if speed >= AT_REST:
                brake = -floor[GOAL_FRICTION] * w[GRAVITY] / (mass * speed)
                dx += vx * brake
                dy += vy * brake
                ax += vx * brake
                ay += vy * brake
            if mobile and floor[GOAL_HEAT] != 0.0:
                b[i, MASS] = mass * (1.0 - 0.1 * floor[GOAL_HEAT])
        if speed >= AT_REST:
            brake = -w[FLOOR_FRICTION] * w[GRAVITY] / (mass * speed)
            dx += vx * brake
            dy += vy * brake
            ax += vx * brake
            ay += vy * brake
        b[i, DX], b[i, DY] = dx, dy
        if not (mobile and alive):
            ax = ay = 0.0
        if not mass >= w[MIN_MASS]:
            ax = ay = b[i, MASS] = 0.0
        b[i, AX], b[i, AY] = ax, ay


@njit(**AS_KERNELS)
def change_velocities(b, w, dt):
    """Velocities from accelerations; death, rest and the speed limit."""
    for i in range(BODIES):
        if not b[i, MASS] >= w[MIN_MASS]:
            b[i, MASS] = b[i, VX] = b[i, VY] = b[i, AX] = b[i, AY] = b[i, ALIVE] = b[i, VISIBLE] = 0.0
        elif b[i, MOBILE] == 0.0 or b[i, ALIVE] == 0.0:
            b[i, VX] = b[i, VY] = 0.0
        else:
            vx, vy, ax, ay, dx, dy = b[i, VX], b[i, VY], b[i, AX], b[i, AY], b[i, DX], b[i, DY]
            if math.sqrt(dx * dx + dy * dy) < math.sqrt(vx * vx + vy * vy) * w[FRAMERATE]:
                vx += ax * dt
                vy += ay * dt
            else:
                vx, vy = (ax - dx) / w[FRAMERATE], (ay - dy) / w[FRAMERATE]
            speed = math.sqrt(vx * vx + vy * vy)
            if not speed <= w[MAX_SPEED]:
                vx *= w[MAX_SPEED] / speed
                vy *= w[MAX_SPEED] / speed
            b[i, VX], b[i, VY] = vx, vy


@njit(**AS_KERNELS)
def move(b, min_speed, time):
    """Everything along its velocity, backwards for a negative time."""
    for i in range(BODIES):
        if not math.sqrt(b[i, VX] * b[i, VX] + b[i, VY] * b[i, VY]) < min_speed:
            b[i, X] += b[i, VX] * time
            b[i, Y] += b[i, VY] * time


@njit(**AS_KERNELS)
def any_touch(b):
    """Whether anything reaches through a wall or into another body."""
    for i in range(BODIES):
        x, y, r = b[i, X], b[i, Y], b[i, RADIUS]
        if abs(x) + r > 1.0 or abs(y) + r > 1.0:
            return True
        for j in range(i + 1, BODIES):
            dx, dy, reach = b[j, X] - x, b[j, Y] - y, r + b[j, RADIUS] + TOUCH
            if dx * dx + dy * dy <= reach * reach:
                return True
    return False


@njit(**AS_KERNELS)
def resolve(b, damping, min_speed, remaining):
    """Back to the first contact, exchange, and on for the time that is left, until nothing touches."""
    contacts = 0
    while contacts < MAX_CONTACTS:
        total, rewinds, early, first, second = 0.0, 0, False, 0, WALL
        while rewinds < MAX_REWINDS:
            time, i, j = find_contact(b)
            if not time > 0.0:
                break
            first, second = i, j
            rewinds += 1
            if not total + time < remaining + 1e-6:
                early = True
                break
            total += time
            move(b, min_speed, -time)
        if rewinds == 0:
            return contacts, False
        contacts += 1
        if second == WALL:
            bounce(b, first, damping, early)
        else:
            collide(b, first, second, early)
        remaining = min(max(total, 0.0), remaining)
        move(b, min_speed, remaining)
    separate(b)
    return contacts, True


@njit(**AS_KERNELS)
def find_contact(b):
    """The contact that takes the longest time to move back: (time, body, body or wall); of equal ones the first."""
    best, first, second = 0.0, 0, WALL
    for i in range(BODIES):
        time = wall_time(b, i)
        if time > best:
            best, first, second = time, i, WALL
        for j in range(i + 1, BODIES):
            time = pair_time(b, i, j)
            if time > best and is_solid(b, i) and is_solid(b, j):
                stuck = time == np.inf and b[i, MOBILE] == 0.0 and b[j, MOBILE] == 0.0
                if not stuck:
                    best, first, second = time, i, j
    return best, first, second


@njit(**AS_KERNELS)
def is_solid(b, i):
    return b[i, ALIVE] != 0.0 and b[i, DONE] == 0.0


@njit(**AS_KERNELS)
def wall_time(b, i):
    """Time to move back until a body does not reach through a wall; 0 where it does not."""
    px, py = abs(b[i, X]) + b[i, RADIUS] - 1.0, abs(b[i, Y]) + b[i, RADIUS] - 1.0
    time = 0.0
    if px > 0.0:
        time = px / abs(b[i, VX])
    if py > 0.0:
        time = max(time, py / abs(b[i, VY]))
    return time + TOUCH / math.sqrt(b[i, VX] * b[i, VX] + b[i, VY] * b[i, VY]) if time > 0.0 else 0.0


@njit(**AS_KERNELS)
def pair_time(b, i, j):
    """Time to move back until two bodies do not touch; infinite where no time helps."""
    dx, dy = b[j, X] - b[i, X], b[j, Y] - b[i, Y]
    reach = b[i, RADIUS] + b[j, RADIUS] + TOUCH
    gap2 = dx * dx + dy * dy - reach * reach
    if gap2 > 0.0:
        return 0.0
    wx, wy = b[i, VX] - b[j, VX], b[i, VY] - b[j, VY]
    speed = math.sqrt(wx * wx + wy * wy)
    if speed == 0.0:
        hard = b[i, RADIUS] + b[j, RADIUS] - TOUCH
        return np.inf if hard > 0.0 and dx * dx + dy * dy < hard * hard else 0.0
    along = (wx * dx + wy * dy) / speed
    return (math.sqrt(along * along - gap2) - along + TOUCH) / speed


@njit(**AS_KERNELS)
def bounce(b, i, damping, early):
    """A body meets the nearest wall."""
    gap_x, gap_y = 1.0 - (abs(b[i, X]) + b[i, RADIUS]), 1.0 - (abs(b[i, Y]) + b[i, RADIUS])
    nx, ny = np.float64(gap_x <= gap_y), np.float64(gap_y <= gap_x)
    if not early or nx * b[i, X] * b[i, VX] + ny * b[i, Y] * b[i, VY] > 0.0:
        b[i, VX] = b[i, VX] * damping * (1.0 - 2.0 * nx)
        b[i, VY] = b[i, VY] * damping * (1.0 - 2.0 * ny)
    if early:
        put_inside(b, i)


@njit(**AS_KERNELS)
def collide(b, i, j, early):
    """Elastic exchange of two bodies, which first gain the share of speed that the other one stores."""
    dx, dy = b[j, X] - b[i, X], b[j, Y] - b[i, Y]
    approaching = (b[i, VX] - b[j, VX]) * dx + (b[i, VY] - b[j, VY]) * dy > 0.0
    if not early or approaching:
        length = math.sqrt(dx * dx + dy * dy)
        nx, ny = dx / length, dy / length
        ux, uy = b[i, VX] * (1.0 + b[j, ENERGY]), b[i, VY] * (1.0 + b[j, ENERGY])
        wx, wy = b[j, VX] * (1.0 + b[i, ENERGY]), b[j, VY] * (1.0 + b[i, ENERGY])
        mi = b[i, MASS] if b[i, MOBILE] != 0.0 else IMMOVABLE
        mj = b[j, MASS] if b[j, MOBILE] != 0.0 else IMMOVABLE
        ni, nj = ux * nx + uy * ny, wx * nx + wy * ny
        gain_i = (ni * (mi - mj) + 2.0 * mj * nj) / (mi + mj) - ni
        gain_j = (nj * (mj - mi) + 2.0 * mi * ni) / (mi + mj) - nj
        b[i, VX], b[i, VY] = ux + nx * gain_i, uy + ny * gain_i
        b[j, VX], b[j, VY] = wx + nx * gain_j, wy + ny * gain_j
        if b[i, KEEPS] == 0.0:
            b[i, ENERGY] = 0.0
        if b[j, KEEPS] == 0.0:
            b[j, ENERGY] = 0.0
    if early:
        push_apart(b, i, j)


@njit(**AS_KERNELS)
def push_apart(b, i, j):
    """Two overlapping bodies part along their line of centres; only what is mobile goes, if anything is."""
    share = 0.5 if b[i, MOBILE] == b[j, MOBILE] else b[i, MOBILE]
    dx, dy = b[j, X] - b[i, X], b[j, Y] - b[i, Y]
    d = math.sqrt(dx * dx + dy * dy)
    depth = b[i, RADIUS] + b[j, RADIUS] + 2.0 * TOUCH - d
    if depth > 0.0:
        nx, ny = (dx / d, dy / d) if d > 0.0 else (1.0, 0.0)
        b[i, X] -= nx * depth * share
        b[i, Y] -= ny * depth * share
        b[j, X] += nx * depth * (1.0 - share)
        b[j, Y] += ny * depth * (1.0 - share)


@njit(**AS_KERNELS)
def put_inside(b, i):
    """Put a body back between the walls."""
    limit = max(1.0 - b[i, RADIUS] - TOUCH, 0.0)
    b[i, X] = min(max(b[i, X], -limit), limit)
    b[i, Y] = min(max(b[i, Y], -limit), limit)


@njit(**AS_KERNELS)
def separate(b):
    """Push bodies apart and inside until nothing overlaps, at most 50 times over."""
    for _ in range(MAX_PASSES):
        moved = False
        for i in range(BODIES):
            if is_solid(b, i):
                for j in range(i + 1, BODIES):
                    dx, dy, reach = b[j, X] - b[i, X], b[j, Y] - b[i, Y], b[i, RADIUS] + b[j, RADIUS]
                    if is_solid(b, j) and dx * dx + dy * dy < reach * reach:
                        push_apart(b, i, j)
                        moved = True
            put_inside(b, i)
        if not moved:
            return
