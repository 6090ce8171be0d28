"""Forces at a distance: charges and moving magnets."""

from typing import Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import ZERO, Acceleration, Aggregate, Charge, Magnetism, Mass, Position, Velocity, rule, sqrt, where


@rule
def lorentz_law(
    source: Tuple[Position, Velocity, Charge, Magnetism],
    target: Tuple[Position, Velocity, Charge, Mass, Acceleration],
) -> Aggregate[Acceleration]:
    """The paper's Lorentz law: q1 q2 / r^2 along the line, and q2 b1 / |w| across the relative velocity w.

    The magnetic part is independent of the distance, as printed; :func:`lorentz_law_r2` decays with it.
    """
    x1, v1, q1, b1 = source
    x2, v2, q2, m2, a = target
    force = ZERO
    if q1:
        away = x2 - x1
        r2 = away.dot(away)
        force = away * where(r2 != 0, q1 * q2 / (r2 * sqrt(r2)), 0.0)
    if b1:
        w = v2 - v1
        w2 = w.dot(w)
        force = force + w.tangent_vector() * where(w2 != 0, q2 * b1 / w2, 0.0)
    return Aggregate[Acceleration](a, force * where(m2 != 0, 1 / m2, 0.0))


@rule
def lorentz_law_r2(
    source: Tuple[Position, Velocity, Charge, Magnetism],
    target: Tuple[Position, Velocity, Charge, Mass, Acceleration],
) -> Aggregate[Acceleration]:
    """The Lorentz force with a magnetic part that grows with the relative speed and decays as 1/r^2."""
    x1, v1, q1, b1 = source
    x2, v2, q2, m2, a = target
    away = x2 - x1
    r2 = away.dot(away)
    if m2 == 0 or r2 == 0:
        return Aggregate[Acceleration](a, ZERO)
    electric = away * (q1 * q2 / sqrt(r2))
    magnetic = (v2 - v1).tangent_vector() * (q2 * b1)
    return Aggregate[Acceleration](a, (electric + magnetic) / (r2 * m2))
