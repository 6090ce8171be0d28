"""The world ``empty-hard`` written directly in numba: one ball in local variables, a goal, four walls."""

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
    DIAGONAL,
    DONE,
    DX,
    DY,
    FLOOR_FRICTION,
    FRAMERATE,
    GOAL_FRICTION,
    GOAL_HEAT,
    GOAL_RADIUS,
    GOAL_X,
    GOAL_Y,
    GRAVITY,
    MASS,
    MAX_CONTACTS,
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


@njit(**AS_KERNELS)
def step_empty(
    body, goal, world, actions, sub_steps, reward, terminated, success, death, contacts, unresolved_contacts
):
    """One ball, a goal and four walls."""
    for e in range(len(body)):
        x, y, vx, vy = body[e, 0, X], body[e, 0, Y], body[e, 0, VX], body[e, 0, VY]
        ax, ay, dx, dy = body[e, 0, AX], body[e, 0, AY], body[e, 0, DX], body[e, 0, DY]
        mass, r, visible = body[e, 0, MASS], body[e, 0, RADIUS], body[e, 0, VISIBLE]
        mobile, alive, done = body[e, 0, MOBILE] != 0.0, body[e, 0, ALIVE] != 0.0, body[e, 0, DONE] != 0.0
        gx, gy, heat = goal[e, GOAL_X], goal[e, GOAL_Y], goal[e, GOAL_HEAT]
        reach = r + goal[e, GOAL_RADIUS] + TOUCH
        on_floor, on_goal = world[e, FLOOR_FRICTION] * world[e, GRAVITY], goal[e, GOAL_FRICTION] * world[e, GRAVITY]
        min_mass, max_speed, min_speed = world[e, MIN_MASS], world[e, MAX_SPEED], world[e, MIN_SPEED]
        damping, framerate = 1.0 - world[e, WALL_DAMPING], world[e, FRAMERATE]
        dt = 1.0 / framerate
        if mass != 0.0:
            vx += 2.0 * min(max(np.float64(actions[e, 0]), -1.0), 1.0) / mass
            vy += 2.0 * min(max(np.float64(actions[e, 1]), -1.0), 1.0) / mass
        over = False
        for _ in range(sub_steps):
            # Friction of the floor and of the goal, heat of the goal.
            speed = math.sqrt(vx * vx + vy * vy)
            hot = False
            ax = ay = 0.0
            if (x - gx) * (x - gx) + (y - gy) * (y - gy) <= reach * reach:
                if speed >= AT_REST:
                    brake = -on_goal / (mass * speed)
                    ax += vx * brake
                    ay += vy * brake
                hot = mobile and heat != 0.0
            if speed >= AT_REST:
                brake = -on_floor / (mass * speed)
                ax += vx * brake
                ay += vy * brake
            dx, dy = ax, ay
            if not (mobile and alive):
                ax = ay = 0.0
            if not mass >= min_mass:
                mass = ax = ay = vx = vy = visible = 0.0
                alive = False
            elif hot:
                mass *= 1.0 - 0.1 * heat
                if not mass >= min_mass:
                    mass = ax = ay = vx = vy = visible = 0.0
                    alive = False
            # Velocity.
            if not (mobile and alive):
                vx = vy = 0.0
            else:
                if not math.sqrt(dx * dx + dy * dy) < math.sqrt(vx * vx + vy * vy) * framerate:
                    vx, vy = (ax - dx) / framerate, (ay - dy) / framerate
                else:
                    vx += ax * dt
                    vy += ay * dt
                speed = math.sqrt(vx * vx + vy * vy)
                if not speed <= max_speed:
                    vx *= max_speed / speed
                    vy *= max_speed / speed
            # Position.
            if not math.sqrt(vx * vx + vy * vy) < min_speed:
                x += vx * dt
                y += vy * dt
            # Walls.
            if abs(x) + r > 1.0 or abs(y) + r > 1.0:
                x, y, vx, vy, hits, jammed = bounce_alone(x, y, vx, vy, r, damping, min_speed, dt)
                contacts[e] += hits
                unresolved_contacts[e] += jammed
            far = math.sqrt((x - gx) * (x - gx) + (y - gy) * (y - gy)) / DIAGONAL
            over = done or not alive or far <= 0.01
            if over:
                break
        far = math.sqrt((x - gx) * (x - gx) + (y - gy) * (y - gy)) / DIAGONAL
        reward[e] = -(far * far) if alive else -(far * far) - 100.0
        terminated[e] = over
        success[e] = alive and not done and far <= 0.01
        death[e] = not alive
        body[e, 0, X], body[e, 0, Y], body[e, 0, VX], body[e, 0, VY] = x, y, vx, vy
        body[e, 0, AX], body[e, 0, AY], body[e, 0, DX], body[e, 0, DY] = ax, ay, dx, dy
        body[e, 0, MASS], body[e, 0, ALIVE], body[e, 0, VISIBLE] = mass, np.float64(alive), visible


@njit(**AS_KERNELS)
def bounce_alone(x, y, vx, vy, r, damping, min_speed, remaining):
    """A ball that has reached through walls: back to the contact, bounce, and on for the time that is left."""
    contacts, moving = 0, not math.sqrt(vx * vx + vy * vy) < min_speed
    while contacts < MAX_CONTACTS:
        total, rewinds, early = 0.0, 0, False
        while rewinds < MAX_REWINDS:
            time = wall_time(x, y, vx, vy, r)
            if not time > 0.0:
                break
            rewinds += 1
            if not total + time < remaining + 1e-6:
                early = True
                break
            total += time
            if moving:
                x -= vx * time
                y -= vy * time
        if rewinds == 0:
            return x, y, vx, vy, contacts, False
        contacts += 1
        across, along = wall_axes(x, y, r)
        if not early or across * x * vx + along * y * vy > 0.0:
            vx = vx * damping * (1.0 - 2.0 * across)
            vy = vy * damping * (1.0 - 2.0 * along)
        if early:
            x, y = inside(x, r), inside(y, r)
        remaining = min(max(total, 0.0), remaining)
        moving = not math.sqrt(vx * vx + vy * vy) < min_speed
        if moving:
            x += vx * remaining
            y += vy * remaining
    return inside(x, r), inside(y, r), vx, vy, contacts, True


@njit(**AS_KERNELS)
def wall_time(x, y, vx, vy, r):
    """Time to move back until a disc does not reach through a wall; 0 where it does not."""
    px, py = abs(x) + r - 1.0, abs(y) + r - 1.0
    time = 0.0
    if px > 0.0:
        time = px / abs(vx)
    if py > 0.0:
        time = max(time, py / abs(vy))
    return time + TOUCH / math.sqrt(vx * vx + vy * vy) if time > 0.0 else 0.0


@njit(**AS_KERNELS)
def wall_axes(x, y, r):
    """1 in the axis that the nearest wall blocks, else 0; twice 1 exactly in the diagonal of a corner."""
    gap_x, gap_y = 1.0 - (abs(x) + r), 1.0 - (abs(y) + r)
    return np.float64(gap_x <= gap_y), np.float64(gap_y <= gap_x)


@njit(**AS_KERNELS)
def inside(x, r):
    """A coordinate put back between the walls."""
    limit = max(1.0 - r - TOUCH, 0.0)
    return min(max(x, -limit), limit)
