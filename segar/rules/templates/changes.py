"""Templates of change: factors that decay, grow or pass from body to body, and locks that open."""

# Hints of rules name factors and constants that are arguments of the template, which pyright takes for variables.
# pyright: reportInvalidTypeForm=false

from typing import Any, Tuple  # noqa: UP035 - the paper writes rules with typing.Tuple

from segar.language import Differential, Factor, Mass, Mobile, SetFactor, Velocity, where
from segar.noise import Choice
from segar.rules.rule_option import RuleOption
from segar.rules.templates.arguments import made_constant, require_numbers, require_scalars

RATE = Choice([-1.0, -0.3, 0.3])  # [1/s]


def growth(name: str, factor: type[Factor], rate: Any = RATE) -> RuleOption:
    """A factor of bodies that grows by ``rate`` times itself per second, or decays where the rate is negative.

    Args:
        rate: [1/s].
    """
    require_scalars(name, factor)
    r = made_constant(name, "rate", 0.0, "1/s")

    def growth(body: Tuple[factor, Velocity], rate: r) -> Differential[factor]:
        value, _ = body
        return Differential[factor](value, rate * value)

    return RuleOption(
        name, growth, {r: rate}, words=f"{factor.__name__} grows by {{{r.__name__}}} of itself per second"
    )


def contagion(name: str, factor: type[Factor]) -> RuleOption:
    """Bodies that touch both get the factor of the one that has more of it, in size."""
    require_numbers(name, factor)

    def contagion(one: Tuple[factor, Velocity], other: Tuple[factor, Velocity]) -> SetFactor[factor]:
        (theirs, _), (own, _) = one, other
        return SetFactor[factor](own, where(abs(theirs) > abs(own), theirs, own))

    words = f"bodies that touch both get the {factor.__name__} that is greater in size"
    return RuleOption(name, on_contact=contagion, words=words)


def sharing(name: str, factor: type[Factor]) -> RuleOption:
    """Bodies that touch share a factor: both get the mean, so the sum stays."""
    require_scalars(name, factor)

    def sharing(one: Tuple[factor, Velocity], other: Tuple[factor, Velocity]) -> SetFactor[factor]:
        (theirs, _), (own, _) = one, other
        return SetFactor[factor](own, 0.5 * (theirs + own))

    return RuleOption(name, on_contact=sharing, words=f"bodies that touch both get the mean of their {factor.__name__}")


def unlocking(name: str) -> RuleOption:
    """An immobile body becomes mobile when a mobile one touches it."""

    def unlocking(key: Tuple[Mobile, Mass], lock: Tuple[Mobile, Mass]) -> SetFactor[Mobile]:
        (is_key, _), (is_open, _) = key, lock
        return SetFactor[Mobile](is_open, where(is_key, 1.0, where(is_open, 1.0, 0.0)))

    return RuleOption(name, on_contact=unlocking, words="a mobile body that touches an immobile one sets it free")
