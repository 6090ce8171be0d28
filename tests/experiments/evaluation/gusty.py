"""Levels in gusts of wind: a rule draws, so that two episodes of one level differ."""

import segar


@segar.rule
def gusts(v: segar.Velocity) -> segar.Differential[segar.Velocity]:
    """What the wind adds to a velocity in a sub-step."""
    return segar.Differential[segar.Velocity](v, (segar.random.normal(), segar.random.normal()))


WINDY = segar.family("empty-easy").with_rules((*segar.DEFAULT_RULES, gusts))
