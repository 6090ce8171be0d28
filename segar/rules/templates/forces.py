"""Templates of forces: between bodies, towards a place, against motion, and in fields.

A force acts on bodies that have Mass and Acceleration; the acceleration is the force by the mass. All options of these
templates add to Acceleration, so any of them can be active together.
"""

# Hints of rules name factors and constants that are arguments of the template, which pyright takes for variables.
# pyright: reportInvalidTypeForm=false

import math
from numbers import Real
from typing import Any, Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.errors import RuleError
from segar.language import Acceleration, Aggregate, Charge, Factor, Mass, Position, VectorValue, Velocity, sqrt, where
from segar.noise import Choice, Noise
from segar.rules.rule_option import RuleOption
from segar.rules.templates.arguments import made_constant, require_numbers

SIGNED = Choice([-1.0, -0.5, 0.5, 1.0])
POSITIVE = Choice([0.25, 0.5, 1.0, 2.0])
PLACE = Choice([-0.5, 0.0, 0.5])  # [m], a coordinate in the arena


def central_force(
    name: str, source: type[Factor] = Charge, target: type[Factor] = Charge, exponent: Any = 2, strength: Any = SIGNED
) -> RuleOption:
    """A force along the line between two bodies: ``strength * s * t / r**exponent`` away from the source, where s and t are
    the factors of source and target, r [m] is their distance; positive strengths repel like ones.

    Args:
        exponent: any number; 0 is a force that distance does not change, -1 a spring of length 0. A distribution makes it a
            constant that each level draws.
        strength: [N m^exponent] by the units of both factors; a number or a distribution.
    """
    require_numbers(name, source, target)
    k = made_constant(name, "strength", 0.0)
    s, t = source.__name__, target.__name__
    way = "bodies away from each other" if s == t else f"what has the {t} away from what has the {s}"
    words = f"a force {{{k.__name__}}} x {s} x {t} / distance^{{exponent}} pushes {way}"
    if isinstance(exponent, Noise):
        n = made_constant(name, "exponent", 2.0)

        def central_power(
            one: Tuple[Position, source],
            other: Tuple[Position, target, Mass, Acceleration],
            strength: k,
            exponent: n,
        ) -> Aggregate[Acceleration]:
            x1, s = one
            x2, t, m, a = other
            away = x2 - x1
            r2 = away.dot(away)
            per_r2 = r2 ** (-0.5 * (exponent + 1.0))
            return Aggregate[Acceleration](a, away * where((r2 != 0) & (m != 0), strength * s * t * per_r2 / m, 0.0))

        constants = {k: strength, n: exponent}
        return RuleOption(name, central_power, constants, words=words.replace("{exponent}", f"{{{n.__name__}}}"))
    power = -0.5 * (_finite(name, "exponent", exponent) + 1.0)

    def central_force(
        one: Tuple[Position, source], other: Tuple[Position, target, Mass, Acceleration], strength: k
    ) -> Aggregate[Acceleration]:
        x1, s = one
        x2, t, m, a = other
        away = x2 - x1
        r2 = away.dot(away)
        per_r2 = _power_of_square(r2, power)
        return Aggregate[Acceleration](a, away * where((r2 != 0) & (m != 0), strength * s * t * per_r2 / m, 0.0))

    return RuleOption(name, central_force, {k: strength}, words=words.replace("{exponent}", f"{exponent:g}"))


def pair_spring(name: str, stiffness: Any = POSITIVE, length: Any = 0.5) -> RuleOption:
    """Springs between any two bodies: ``stiffness * (r - length)`` towards each other.

    Args:
        stiffness: [N/m].
        length: at rest [m].
    """
    k, rest = made_constant(name, "stiffness", 0.0, "N/m"), made_constant(name, "length", 0.5, "m", (0.0, 4.0))

    def pair_spring(
        one: Tuple[Position, Mass], other: Tuple[Position, Mass, Acceleration], stiffness: k, length: rest
    ) -> Aggregate[Acceleration]:
        x1, _ = one
        x2, m, a = other
        away = x2 - x1
        r = away.norm()
        pull = where((r != 0) & (m != 0), stiffness * (length - r) / (r * m), 0.0)
        return Aggregate[Acceleration](a, away * pull)

    words = f"springs of stiffness {{{k.__name__}}} N/m and length {{{rest.__name__}}} m between bodies"
    return RuleOption(name, pair_spring, {k: stiffness, rest: length}, words=words)


def anchor_spring(name: str, stiffness: Any = POSITIVE, x: Any = PLACE, y: Any = PLACE) -> RuleOption:
    """A spring of length 0 from each body to a place.

    Args:
        stiffness: [N/m].
        x, y: of the place [m].
    """
    k = made_constant(name, "stiffness", 0.0, "N/m")
    cx, cy = made_constant(name, "x", 0.0, "m", (-1.0, 1.0)), made_constant(name, "y", 0.0, "m", (-1.0, 1.0))

    def anchor_spring(place: Position, m: Mass, a: Acceleration, stiffness: k, x: cx, y: cy) -> Aggregate[Acceleration]:
        back = VectorValue(x - place.x, y - place.y)
        return Aggregate[Acceleration](a, back * where(m != 0, stiffness / m, 0.0))

    words = f"a spring of {{{k.__name__}}} N/m and length 0 pulls bodies to ({{{cx.__name__}}}, {{{cy.__name__}}}) m"
    return RuleOption(name, anchor_spring, {k: stiffness, cx: x, cy: y}, words=words)


def drag(name: str, power: float = 1, coefficient: Any = POSITIVE) -> RuleOption:
    """A force against the velocity: ``coefficient * |v|**power``.

    Args:
        power: 1 for viscous, 2 for turbulent drag; from 1 up.
        coefficient: [N (s/m)^power].
    """
    if _finite(name, "power", power) < 1:
        raise RuleError(f"drag '{name}': the power must be 1 or more, not {power!r}; apply_friction is one of power 0")
    c = made_constant(name, "coefficient", 0.0, "", (0.0, 1e6))

    def drag(v: Velocity, m: Mass, a: Acceleration, coefficient: c) -> Aggregate[Acceleration]:
        v2 = v.dot(v)
        speed = _power_of_square(v2, 0.5 * (power - 1.0)) if power != 1 else 1.0
        return Aggregate[Acceleration](a, v * where((v2 != 0) & (m != 0), -coefficient * speed / m, 0.0))

    words = f"a drag {{{c.__name__}}} x speed^{power:g} against the velocity"
    return RuleOption(name, drag, {c: coefficient}, words=words)


def uniform_field(name: str, factor: type[Factor] = Charge, x: Any = SIGNED, y: Any = SIGNED) -> RuleOption:
    """A force that is the same everywhere: ``(x, y)`` times the factor of the body.

    Args:
        x, y: [N] by the unit of the factor.
    """
    require_numbers(name, factor)
    fx, fy = made_constant(name, "x", 0.0), made_constant(name, "y", 0.0)

    def uniform_field(body: Tuple[factor, Mass, Acceleration], x: fx, y: fy) -> Aggregate[Acceleration]:
        q, m, a = body
        return Aggregate[Acceleration](a, VectorValue(x, y) * where(m != 0, q / m, 0.0))

    words = f"a uniform force ({{{fx.__name__}}}, {{{fy.__name__}}}) N x {factor.__name__}"
    return RuleOption(name, uniform_field, {fx: x, fy: y}, words=words)


def rotating_field(name: str, factor: type[Factor] = Mass, strength: Any = SIGNED) -> RuleOption:
    """A force around the middle of the arena: ``strength`` times the factor and the distance from the middle, to the left of
    the way out; positive strengths drive bodies counter-clockwise.

    Args:
        strength: [N/m] by the unit of the factor.
    """
    require_numbers(name, factor)
    k = made_constant(name, "strength", 0.0, "N/m")

    def rotating_field(body: Tuple[Position, factor, Mass, Acceleration], strength: k) -> Aggregate[Acceleration]:
        x, q, m, a = body
        return Aggregate[Acceleration](a, VectorValue(-x.y, x.x) * where(m != 0, strength * q / m, 0.0))

    words = f"a force {{{k.__name__}}} N/m x {factor.__name__} x distance from the middle, counter-clockwise around it"
    return RuleOption(name, rotating_field, {k: strength}, words=words)


def magnetic_field(name: str, factor: type[Factor] = Charge, strength: Any = SIGNED) -> RuleOption:
    """A force across the velocity, which turns it: ``strength`` times the factor and the speed, to the left.

    Args:
        strength: [N s/m] by the unit of the factor.
    """
    require_numbers(name, factor)
    k = made_constant(name, "strength", 0.0, "N s/m")

    def magnetic_field(body: Tuple[Velocity, factor, Mass, Acceleration], strength: k) -> Aggregate[Acceleration]:
        v, q, m, a = body
        return Aggregate[Acceleration](a, VectorValue(-v.y, v.x) * where(m != 0, strength * q / m, 0.0))

    words = f"a force {{{k.__name__}}} N s/m x {factor.__name__} x speed to the left of the velocity"
    return RuleOption(name, magnetic_field, {k: strength}, words=words)


def _power_of_square(r2: Any, power: float) -> Any:
    """``r2**power``; by roots and products where the power is a multiple of a half, which is exact and fast."""
    halves = round(2 * abs(power))
    if abs(2 * abs(power) - halves) > 1e-12 or halves > 12:
        return r2**power
    value: Any = sqrt(r2) if halves % 2 else 1.0
    for _ in range(halves // 2):
        value = value * r2
    return 1 / value if power < 0 else value


def _finite(name: str, what: str, value: Any) -> float:
    """The number; raises :class:`RuleError` where it is none that is finite."""
    if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
        raise RuleError(f"the template '{name}': the {what} must be a finite number, not {value!r}")
    return float(value)
