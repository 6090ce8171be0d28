"""The rules of the 2022 simulator where ours are mended, to prove that the engine can be bent that far.

``docs/reference/differences-from-2022.md`` says what is corrected and why. Constants and orders of operation: REFERENCE,
sections 6 to 8.
"""

from typing import Tuple  # as the paper writes rules

from segar import Acceleration, Aggregate, Charge, Friction, Gravity, Magnetism, Mobile, Position, SetFactor, Velocity
from segar.language import ZERO, Collides, Heat, InfiniteEnergy, Mass, StoredEnergy, is_on, rule, where
from segar.rules import World, accelerate, consume, kill_condition, move, stop_condition

IMMOVABLE_MASS = 1e8  # [kg]


@rule
def lorentz_law(
    source: Tuple[Position, Velocity, Charge, Magnetism],
    target: Tuple[Position, Velocity, Charge, Mass, Acceleration],
) -> Aggregate[Acceleration]:
    """In the order of operations of 2022, since magnets amplify rounding errors of slow bodies."""
    (x1, v1, q1, b1), (x2, v2, q2, m2, a) = source, target
    if m2 == 0:
        return Aggregate[Acceleration](a, ZERO)
    n, w = x2 - x1, v2 - v1
    electric = magnetic = ZERO
    if n.norm() != 0:  # coincident bodies made 2022 raise
        electric = q1 * q2 * n.unit_vector() / n.norm() ** 2
    if w.norm() != 0:
        magnetic = q2 * w.norm() * b1 * w.unit_vector().tangent_vector() / w.norm() ** 2
    return Aggregate[Acceleration](a, (magnetic + electric) / m2)


@rule(relation=is_on)
def apply_friction(
    body: Tuple[Mass, Velocity, Acceleration], ground: Tuple[Friction], g: Gravity
) -> Aggregate[Acceleration]:
    """Friction without rest: it overshoots zero, and says nothing about a body that does not slide."""
    m, v, a = body
    (mu,) = ground
    if v.norm() < 1e-6:
        return None
    return Aggregate[Acceleration](a, -v.sign() * (mu * g) * (v.abs() / v.norm()) / m)


@rule(relation=is_on)
def apply_burn(body: Tuple[Mass, Mobile], ground: Tuple[Heat]) -> SetFactor[Mass]:
    """Ground without heat sets the mass too: to itself."""
    m, mobile = body
    (heat,) = ground
    return SetFactor[Mass](m, m * (1 - 0.1 * heat)) if mobile else None


Body = Tuple[Collides, Position, Velocity, Mass, Mobile, StoredEnergy, InfiniteEnergy]


@rule
def collide(first: Body, second: Body) -> Tuple[SetFactor[Velocity], SetFactor[StoredEnergy]]:
    """The energy flag is inverted, and that of the first body speaks for both."""
    _, x1, v1, m1, mobile1, e1, keeps = first
    _, x2, v2, m2, mobile2, e2, _ = second
    u1, u2 = v1 * (1 + e2), v2 * (1 + e1)
    m1, m2 = where(mobile1, m1, IMMOVABLE_MASS), where(mobile2, m2, IMMOVABLE_MASS)
    n = (x2 - x1).unit_vector()
    t = n.tangent_vector()
    n1, n2 = u1.dot(n), u2.dot(n)
    after1 = (n1 * (m1 - m2) + 2 * m2 * n2) / (m1 + m2)
    after2 = (n2 * (m2 - m1) + 2 * m1 * n1) / (m1 + m2)
    return (
        SetFactor[Velocity](v1, after1 * n + u1.dot(t) * t),
        SetFactor[Velocity](v2, after2 * n + u2.dot(t) * t),
        SetFactor[StoredEnergy](e1, where(keeps, 0.0, e1)),
        SetFactor[StoredEnergy](e2, where(keeps, 0.0, e2)),
    )


# In 2022 both were evaluated in both stages, with all effects.
stop_twice = rule(priority=stop_condition.priority, recheck=True)(stop_condition.function)


def world_in(walls: float) -> World:
    """The rules of 2022 in an arena with walls that far from its middle [m]."""
    rules = (move, lorentz_law, apply_friction, apply_burn, stop_twice, kill_condition, consume, accelerate)
    return World(rules, pair_contact=collide, walls=walls)
