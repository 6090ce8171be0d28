"""What enters a texture: factors of the state, the type of an entity, noise.

An input is one of

* ``"background"``: 1 for the floor of the arena, 0 for every thing;
* a factor with one column, such as ``"Charge"``: its value in the state, also of a sub-class of it;
* a factor without value, such as ``"Consumes"``: 1 for entities that have it;
* an entity type, such as ``"GoalTile"``: 1 for it and its sub-types;
* noise, ``"noise_1"`` and so on: drawn anew for every thing from N(0, 1) clipped to [-1, 1].
"""

import re
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import Entity, Factor, all_subclasses, concrete_factors

BACKGROUND = "background"
NOISE = "noise"
NOISE_CLIP = 1.0  # draws from N(0, 1) are clipped to plus or minus this, as in 2022

_NOISE_NAME = re.compile(rf"{NOISE}_[1-9]\d*$")


def entity_values(inputs: Sequence[str], entity: Entity) -> np.ndarray:
    """What an entity gives to inputs, float64 ``[input]``: nan for factors that it lacks, 0 for background and noise.

    Raises:
        SegarError: an input is neither known here nor a factor of the entity.
    """
    values = np.zeros(len(inputs))
    for i, name in enumerate(inputs):
        if name == BACKGROUND or is_noise(name):
            continue
        thing = class_of_input(name, (type(entity),), entity.factors)
        if issubclass(thing, Entity):
            values[i] = isinstance(entity, thing)
            continue
        held = thing if thing in entity.factors else next((f for f in entity.factors if issubclass(f, thing)), None)
        if not thing.width:
            values[i] = held is not None
        else:
            values[i] = np.nan if held is None else float(entity[held])
    return values


def name_of_input(thing: Any) -> str:
    """The name of an input that is given as a factor, an entity type, or its name."""
    return thing.__name__ if isinstance(thing, type) else str(thing)


def is_noise(name: str) -> bool:
    """Whether it is the name of a noise input."""
    return _NOISE_NAME.match(name) is not None


def class_of_input(name: str, types: Sequence[type[Entity]], factors: Iterable[type[Factor]] = ()) -> type:
    """The factor or entity type called so: among these and their parents, else any that is defined."""
    nearby = [*factors, *(factor for entity in types for factor in entity.declared), *types]
    known = [parent for cls in nearby for parent in cls.__mro__ if issubclass(parent, (Factor, Entity))]
    known += [*concrete_factors(), *all_subclasses(Entity)]
    for found in known:
        if found.__name__ == name:
            if issubclass(found, Factor) and found.width > 1:
                raise SegarError(
                    f"the texture input '{name}' has two components; a texture can only show single numbers"
                )
            return found
    names = (cls.__name__ for cls in known)
    raise SegarError(f"the texture input '{name}' is neither a factor nor an entity type.{did_you_mean(name, names)}")
