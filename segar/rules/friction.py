"""Kinetic friction: it slows bodies that slide, and never turns them around."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import (
    ZERO,
    Acceleration,
    Aggregate,
    Drag,
    Framerate,
    Friction,
    Gravity,
    Mass,
    SetFactor,
    Velocity,
    is_on,
    rule,
)

SLIDING_SPEED = 1e-6  # [m/s] below this a body counts as at rest; the 2022 rule uses the same
REST_PRIORITY = 10  # above every relation and entity class, below death


@rule(relation=is_on)
def apply_friction(
    body: Tuple[Mass, Velocity, Acceleration], ground: Tuple[Friction], g: Gravity
) -> Aggregate[Acceleration]:
    """Friction of the ground on a body that slides. The force is mu g, not mu m g (paper, ``apply_friction``)."""
    m, v, a = body
    (mu,) = ground
    speed = v.norm()
    if speed < SLIDING_SPEED:
        # An explicit zero: without any aggregate the acceleration of the last sub-step would stay.
        return Aggregate[Acceleration](a, ZERO)
    return Aggregate[Acceleration](a, v * (-mu * g / (m * speed)))


@rule(relation=is_on)
def record_drag(body: Tuple[Mass, Velocity, Drag], ground: Tuple[Friction], g: Gravity) -> Aggregate[Drag]:
    """The share of friction in the acceleration, which ``come_to_rest`` compares with the speed."""
    m, v, drag = body
    (mu,) = ground
    speed = v.norm()
    if speed < SLIDING_SPEED:
        return Aggregate[Drag](drag, ZERO)
    return Aggregate[Drag](drag, v * (-mu * g / (m * speed)))


@rule(priority=REST_PRIORITY)
def come_to_rest(v: Velocity, a: Acceleration, drag: Drag, framerate: Framerate) -> SetFactor[Velocity]:
    """A body that friction alone would reverse within the sub-step keeps only what the other forces give it."""
    if drag.norm() < v.norm() * framerate:
        return None
    return SetFactor[Velocity](v, (a - drag) / framerate)
