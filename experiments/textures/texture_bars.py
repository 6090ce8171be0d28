"""What a model of textures must be able to show before it is shipped, with a margin over what the tests ask."""

import numpy as np

from segar.errors import SegarError
from segar.language import Charge, Entity, Friction, Heat, Magnetism
from segar.textures import (
    CHIEF,
    KINDS,
    UNIFORM,
    TextureSet,
    family_laws,
    is_noise,
    linear_read_out,
    look_distances,
    looks,
)

READ_OUT = 0.957  # least R^2 of a factor that is shown, on held-out things; the tests ask for 0.95
HIDDEN = 0.015  # largest R^2 of a factor that is hidden; the tests allow 0.02
TOLD_APART = 0.99  # least share of things that are told from all others, whatever their noise; the tests ask for 0.98
FLOOR = 60.0  # [grey levels] least difference between a thing and the floor; the tests ask for 40
APART = 60.0  # [grey levels] least difference between the ball or the goal and anything else; the tests ask for 50
# [grey levels] least difference of mean colours, which are what is seen of small things: of the ball or the goal from
# anything else, and of anything from the floor
COLOUR_APART, COLOUR_FLOOR = 20.0, 40.0


def refuse_below_bars(textures: TextureSet) -> None:
    """Let a set pass whose models all meet the bars.

    Raises:
        SegarError: one does not; it names the models, and the factors and things in question.
    """
    found = [
        f"model {model}: {shortfall}" for model in range(len(textures)) for shortfall in shortfalls(textures, model)
    ]
    if found:
        raise SegarError(
            f"textures '{textures.name}' must not be shipped:\n  "
            + "\n  ".join(found)
            + "\nTrain longer, or from another seed."
        )


def shortfalls(textures: TextureSet, model: int = 0) -> list[str]:
    """What a model does not show as it must, in words; empty if it meets the bars."""
    return [
        *_unread(textures, model),
        *_unhidden(textures, model),
        *_confused(textures, model),
        *_alike(textures, model),
    ]


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
    return found


def _alike(textures: TextureSet, model: int) -> list[str]:
    """What is too much like the floor, and what like the ball or the goal, in pixels or in mean colour."""
    plain = textures.patches(looks(textures, KINDS), model).astype(float)
    colours = plain.mean(axis=(1, 2))
    in_colour = np.sqrt(((colours[1:, None] - colours) ** 2).mean(axis=-1))
    in_pixels = look_distances(textures, model, rng=np.random.default_rng(3)).mean(axis=0)
    found = []
    for what, distances, floor, apart in (
        ("", in_pixels, FLOOR, APART),
        (" in mean colour", in_colour, COLOUR_FLOOR, COLOUR_APART),
    ):
        for thing, row in zip(KINDS, distances, strict=True):
            pairs = [(row[0], "the floor", floor)]
            if isinstance(thing, CHIEF):
                others = zip(KINDS, row[1:], strict=True)
                pairs += [(far, _named(kind), apart) for kind, far in others if type(kind) is not type(thing)]
            far, other, least = min(pairs, key=lambda pair: pair[0] - pair[2])
            if far < least:
                found.append(
                    f"{_named(thing)} differs by {far:.1f} grey levels{what} from {other}, less than {least:g}"
                )
    return found


def _named(thing: Entity) -> str:
    """Its type, and what it has that is not usual for it, such as "Charger of Charge 1"."""
    usual = type(thing)()
    own = [f for f in (Charge, Friction, Heat, Magnetism) if f in thing.factors and float(thing[f]) != float(usual[f])]
    facts = " and ".join(f"{factor.__name__} {float(thing[factor]):g}" for factor in own)
    return type(thing).__name__ + (f" of {facts}" if facts else "")
