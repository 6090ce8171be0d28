"""Contacts: bouncing off a wall, and the elastic exchange between two bodies."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import (
    Alive,
    Collides,
    Done,
    InfiniteEnergy,
    Mass,
    Mobile,
    Position,
    SetFactor,
    StoredEnergy,
    Velocity,
    Wall,
    WallDamping,
    rule,
    value_rule,
    where,
)

IMMOVABLE_MASS = 1e8  # [kg] a body that does not move exchanges momentum as if it were this heavy; as in 2022


@rule
def bounce(v: Velocity, collides: Collides, damping: WallDamping, wall: Wall) -> SetFactor[Velocity]:
    """The wall turns the velocity around in the axes that it blocks, and reduces both components by its damping."""
    # The wall is immovable, so momentum is not conserved here; energy is, up to damping.
    return SetFactor[Velocity](v, (1 - damping) * v * (1 - 2 * wall.normal))


@rule
def collide(
    first: Tuple[Collides, Position, Velocity, Mass, Mobile, StoredEnergy, InfiniteEnergy],
    second: Tuple[Collides, Position, Velocity, Mass, Mobile, StoredEnergy, InfiniteEnergy],
) -> Tuple[SetFactor[Velocity], SetFactor[StoredEnergy]]:
    """Elastic exchange along the line of centres; each body first gains the share of speed that the other stores."""
    _, x1, v1, m1, mobile1, e1, keeps1 = first
    _, x2, v2, m2, mobile2, e2, keeps2 = second
    u1, u2 = v1 * (1 + e2), v2 * (1 + e1)
    m1 = where(mobile1, m1, IMMOVABLE_MASS)
    m2 = where(mobile2, m2, IMMOVABLE_MASS)
    between = x2 - x1
    n = between / between.norm()
    n1, n2 = u1.dot(n), u2.dot(n)
    total = m1 + m2
    after1 = (n1 * (m1 - m2) + 2 * m2 * n2) / total
    after2 = (n2 * (m2 - m1) + 2 * m1 * n1) / total
    return (
        SetFactor[Velocity](v1, u1 + (after1 - n1) * n),
        SetFactor[Velocity](v2, u2 + (after2 - n2) * n),
        SetFactor[StoredEnergy](e1, where(keeps1, e1, 0.0)),
        SetFactor[StoredEnergy](e2, where(keeps2, e2, 0.0)),
    )


def _is_solid(collides: Collides, alive: Alive, done: Done) -> bool:
    """Only bodies that are alive and not done collide with others; walls stop all bodies."""
    return alive and not done


is_solid = value_rule(_is_solid, truth=True)
