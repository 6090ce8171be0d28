"""What a model of textures must be able to show before it is shipped, with a margin over what the tests ask."""

from __future__ import annotations

import numpy as np

from segar.entities import Entity, GoalTile, GolfBall
from segar.errors import SegarError
from segar.factors import Charge, Friction, Heat, Magnetism
from segar.textures import TextureSet, linear_read_out, look_distances
from segar.textures.inputs import is_noise
from segar.textures.samples import UNIFORM, family_laws
from segar.textures.standard import KINDS

READ_OUT = 0.957  # least R^2 of a factor that is shown, on held-out things; the tests ask for 0.95
HIDDEN = 0.015  # largest R^2 of a factor that is hidden; the tests allow 0.02
TOLD_APART = 0.99  # least share of things that are told from all others, whatever their noise; the tests ask for 0.98
FLOOR = 60.0  # [grey levels] least difference between a thing and the floor; the tests ask for 40
CHIEF = 50.0  # [grey levels] least difference between the ball or the goal and anything else; the tests ask for 40


def refuse_below_bars(textures: TextureSet) -> None:
    """Let a set pass whose models all meet the bars.

    Raises:
        SegarError: one does not; it names the models, and the factors and things in question.
    """
    found = [f"model {model}: {said}" for model in range(len(textures)) for said in shortfalls(textures, model)]
    if found:
        raise SegarError(
            f"textures '{textures.name}' must not be shipped:\n  "
            + "\n  ".join(found)
            + "\nTrain longer, or from another seed."
        )


def shortfalls(textures: TextureSet, model: int = 0) -> list[str]:
    """What a model does not show as it must, in words; empty if it meets the bars."""
    return [*_unread(textures, model), *_unhidden(textures, model), *_confused(textures, model)]


def _unread(textures: TextureSet, model: int) -> list[str]:
    laws = {"uniform": UNIFORM, "families'": {**UNIFORM, **family_laws()}}
    return [
        f"{name} is read with an R^2 of {share:.3f} under the {which} marginals, below {READ_OUT}"
        for which, law in laws.items()
        for name, share in linear_read_out(textures, model, rng=np.random.default_rng(0), laws=law).items()
        if not is_noise(name) and share < READ_OUT
    ]


def _unhidden(textures: TextureSet, model: int) -> list[str]:
    factors = [name for name in textures.inputs if name in UNIFORM]
    found = []
    for hidden in (factors[::2], factors[1::2]):
        read = linear_read_out(textures, model, rng=np.random.default_rng(1), hidden=hidden)
        for name in hidden:
            if read[name] > HIDDEN:
                found.append(f"{name} is hidden, and read with an R^2 of {read[name]:.3f}, above {HIDDEN}")
    return found


def _confused(textures: TextureSet, model: int) -> list[str]:
    distances = look_distances(textures, model, rng=np.random.default_rng(2))
    nearest, itself = distances.argmin(axis=-1), np.arange(1, 1 + len(KINDS))
    found = []
    if (nearest == itself).mean() < TOLD_APART:
        draw, thing = np.nonzero(nearest != itself)
        names = ["the floor", *map(_named, KINDS)]
        pairs = sorted({f"{names[k + 1]} for {names[nearest[d, k]]}" for d, k in zip(draw, thing, strict=True)})
        share = (nearest == itself).mean()
        found.append(f"{share:.1%} of things are told apart, below {TOLD_APART:.0%}; taken are {', '.join(pairs)}")
    for thing, row in zip(KINDS, distances.mean(axis=0), strict=True):
        others = [kind for kind in KINDS if type(kind) is not type(thing)]
        to_others = [row[1 + k] for k, kind in enumerate(KINDS) if type(kind) is not type(thing)]
        if row[0] < FLOOR:
            found.append(f"{_named(thing)} differs by {row[0]:.0f} grey levels from the floor, less than {FLOOR:.0f}")
        if isinstance(thing, GolfBall | GoalTile) and min(to_others) < CHIEF:
            other = _named(others[int(np.argmin(to_others))])
            found.append(
                f"{_named(thing)} differs by {min(to_others):.0f} grey levels from {other}, less than {CHIEF:.0f}"
            )
    return found


def _named(thing: Entity) -> str:
    """Its type, and what it has that is not usual for it, such as "Charger of Charge 1"."""
    usual = type(thing)()
    own = [f for f in (Charge, Friction, Heat, Magnetism) if f in thing.factors and float(thing[f]) != float(usual[f])]
    facts = " and ".join(f"{factor.__name__} {float(thing[factor]):g}" for factor in own)
    return type(thing).__name__ + (f" of {facts}" if facts else "")
