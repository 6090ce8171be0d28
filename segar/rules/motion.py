"""Motion: position changes by velocity, velocity by acceleration; immobile and dead objects stand still."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import (
    ZERO,
    Acceleration,
    Alive,
    Differential,
    Mass,
    MaxVelocity,
    MinMass,
    MinVelocity,
    Mobile,
    Position,
    SetFactor,
    Velocity,
    Visible,
    rule,
)

STOP_PRIORITY = 20  # above come_to_rest: a body that cannot move stands still
KILL_PRIORITY = 30  # death overrides all other effects


@rule
def move(x: Position, v: Velocity, min_v: MinVelocity) -> Differential[Position]:
    """Position grows by velocity; below the smallest speed a body does not move."""
    if v.norm() < min_v:
        return Differential[Position](x, ZERO)
    return Differential[Position](x, v)


@rule
def accelerate(v: Velocity, a: Acceleration) -> Differential[Velocity]:
    """Velocity grows by acceleration."""
    return Differential[Velocity](v, a)


@rule(priority=STOP_PRIORITY)
def stop_condition(
    mobile: Mobile, alive: Alive, v: Velocity, a: Acceleration
) -> Tuple[SetFactor[Velocity], SetFactor[Acceleration]]:
    """An immobile or dead body has neither velocity nor acceleration."""
    if mobile and alive:
        return None
    return SetFactor[Velocity](v, ZERO), SetFactor[Acceleration](a, ZERO)


@rule(priority=KILL_PRIORITY, recheck=True)
def kill_condition(
    m: Mass, v: Velocity, visible: Visible, a: Acceleration, alive: Alive, min_mass: MinMass
) -> Tuple[SetFactor[Mass], SetFactor[Velocity], SetFactor[Alive], SetFactor[Acceleration], SetFactor[Visible]]:
    """A body that has lost its mass dies, stops and vanishes."""
    if m >= min_mass:
        return None
    return (
        SetFactor[Mass](m, 0.0),
        SetFactor[Velocity](v, ZERO),
        SetFactor[Alive](alive, False),
        SetFactor[Acceleration](a, ZERO),
        SetFactor[Visible](visible, False),
    )


@rule
def speed_limit(v: Velocity, max_v: MaxVelocity) -> SetFactor[Velocity]:
    """No body is faster than the largest speed."""
    speed = v.norm()
    if speed <= max_v:
        return None
    return SetFactor[Velocity](v, v * (max_v / speed))
