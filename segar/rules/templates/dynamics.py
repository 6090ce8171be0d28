"""The built-in rule space: the default physics is one point of it."""

from segar.language import ZERO, Acceleration, Aggregate, Charge, Magnetism, Mass, rule
from segar.noise import DiscreteRangeNoise, Mixture, Noise, UniformNoise
from segar.rules.default_rules import DEFAULT_RULES
from segar.rules.fields import lorentz_law
from segar.rules.friction import apply_friction, record_drag
from segar.rules.rule_option import RuleOption
from segar.rules.rule_space import RuleSpace
from segar.rules.templates.changes import contagion, growth, sharing, unlocking
from segar.rules.templates.forces import (
    SIGNED,
    anchor_spring,
    central_force,
    drag,
    magnetic_field,
    pair_spring,
    rotating_field,
    uniform_field,
)
from segar.rules.templates.places import drifting, hiding, one_way_wall, portal

EXPONENT = UniformNoise(0.0, 3.0)


@rule
def free_motion(a: Acceleration) -> Aggregate[Acceleration]:
    """Without a force there is no acceleration; without this rule the last one would stay."""
    return Aggregate[Acceleration](a, ZERO)


def dynamics_space(active: int | Noise | None = None) -> RuleSpace:
    """A space of 29 options over the objects and the goal that all named families have.

    The default rules are the options ``lorentz`` and ``friction`` together; the rest of them hold in every level.

    Args:
        active: how many options are active; None for 2 to 4.
    """
    options = [
        RuleOption("lorentz", lorentz_law, words="the Lorentz law between charged bodies and magnets"),
        RuleOption("friction", [apply_friction, record_drag], words="kinetic friction of the floor"),
        central_force("charge_constant", exponent=0),
        central_force("charge_inverse", exponent=1),
        central_force("charge_cubic", exponent=3),
        central_force("gravitation", Mass, Mass, exponent=2),
        central_force("gravitation_inverse", Mass, Mass, exponent=1),
        central_force("magnet_square", Magnetism, Charge, exponent=2),
        central_force("magnet_inverse", Magnetism, Charge, exponent=1),
        pair_spring("springs"),
        anchor_spring("anchor"),
        drag("viscous_drag", 1),
        drag("turbulent_drag", 2),
        uniform_field("electric_field"),
        uniform_field("slope", Mass),
        rotating_field("vortex"),
        rotating_field("charge_vortex", Charge),
        magnetic_field("magnetic_field"),
        portal("portal"),
        portal("wide_portal", radius=0.2),
        one_way_wall("one_way_x", 0),
        one_way_wall("one_way_y", 1),
        growth("charge_growth", Charge),
        growth("magnet_growth", Magnetism),
        contagion("contagion", Charge),
        sharing("sharing", Charge),
        drifting("drifting_goal"),
        hiding("hidden_goal"),
        unlocking("unlocking"),
    ]
    always = [free_motion, *(r for r in DEFAULT_RULES if r not in (lorentz_law, apply_friction, record_drag))]
    exclusive = [("contagion", "sharing"), ("portal", "wide_portal")]
    return RuleSpace(options, DiscreteRangeNoise(2, 4) if active is None else active, always, exclusive)


def law_space() -> RuleSpace:
    """A space for the search of laws, in which no level has a rule set that training on :func:`dynamics_space` has.

    Its options are those of ``dynamics_space()``, and two forces whose exponents are constants. Constants have densities
    between the values that they have there, and a combination of options is none of its training part.
    """
    known = dynamics_space()
    options = [
        RuleOption(o.name, o.rules, {p: _between(law) for p, law in o.constants.items()}, o.on_contact, words=o.words)
        for o in known.options
    ]
    options.append(central_force("charge_power", exponent=EXPONENT, strength=_between(SIGNED)))
    options.append(central_force("mass_power", Mass, Mass, exponent=EXPONENT, strength=_between(SIGNED)))
    exclusive = [[known.names[k] for k in group] for group in known.exclusive]
    return RuleSpace(options, known.count, known.always, exclusive).unlike(known.split("train"))


def _between(law: Noise) -> Noise:
    """A distribution over the numbers between those of a distribution with three values or more; not between signs."""
    values, _ = law.atoms
    sides = values[values < 0], values[values > 0]
    if len(values) < 3:
        return law
    if min(map(len, sides)) > 1 and sum(map(len, sides)) == len(values):
        return Mixture([UniformNoise(side.min(), side.max()) for side in sides], (0.5, 0.5))
    return UniformNoise(values.min(), values.max())
