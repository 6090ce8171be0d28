"""What enters a texture: factors of the state, what an entity is, noise; and where a state holds it.

An input is one of

* ``"background"``: 1 for the floor of the arena, 0 for every thing;
* a factor with one column, such as ``"Charge"``: its value in the state, also of a sub-class of it;
* a factor without value, such as ``"Consumes"``: 1 for entities that have it;
* an entity type, such as ``"GoalTile"``: 1 for it and its sub-types;
* noise, ``"noise_1"`` and so on: drawn anew for every thing from N(0, 1) clipped to [-1, 1].
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from segar.errors import SegarError, did_you_mean
from segar.language import Entity, Factor, Layout, concrete_factors, holds

if TYPE_CHECKING:
    from segar.textures.texture_sets import TextureSet

BACKGROUND = "background"
NOISE = "noise"
NOISE_CLIP = 1.0  # draws from N(0, 1) are clipped to plus or minus this, as in 2022

_NOISE_NAME = re.compile(rf"{NOISE}_[1-9]\d*$")


@dataclass(frozen=True)
class TypeInputs:
    """Where the features of each entity type come from.

    The feature of input i for an entity of type t is ``(values[column] - shift[i]) * scale[i]`` with ``column =
    columns[t, i]`` where that is not -1; for ``noise[i] >= 0`` it is ``scale[i]`` times that draw of the thing; else
    ``constants[t, i]``. A value that is not finite gives 0.

    Attributes:
        columns: int64 ``[type, input]``, -1 where no factor of the state is read.
        constants: float64 ``[type, input]``: features of markers and entity types; 0 for what is absent or hidden.
        noise: int64 ``[input]``: which of a thing's draws, -1 for inputs that are no noise.
        draws: how many draws a thing needs.
    """

    columns: np.ndarray
    constants: np.ndarray
    noise: np.ndarray
    draws: int


def type_inputs(textures: TextureSet, layout: Layout, hidden: Iterable[Any] = ()) -> TypeInputs:
    """Where a layout's entity types hold what the textures show.

    Args:
        hidden: inputs that enter as 0: classes or names of factors and entity types, or names of other inputs.

    Raises:
        SegarError: something hidden is not an input, or an input is neither known here nor in the layout.
    """
    concealed = {name_of_input(h) for h in hidden}
    for name in sorted(concealed - set(textures.inputs)):
        raise SegarError(
            f"textures '{textures.name}' do not show '{name}', so it cannot be hidden."
            f"{did_you_mean(name, textures.inputs)}"
        )
    columns = np.full((len(layout.types), len(textures.inputs)), -1, np.int64)
    constants = np.zeros(columns.shape)
    noise = np.full(len(textures.inputs), -1, np.int64)
    draws = 0
    for i, name in enumerate(textures.inputs):
        if is_noise(name):
            # A hidden noise is still drawn, so that hiding it changes no other draw.
            noise[i] = draws if name not in concealed else -1
            draws += 1
        elif name != BACKGROUND and name not in concealed:
            thing = _class_named(name, layout.types)
            for t, entity in enumerate(layout.types):
                columns[t, i], constants[t, i] = _source(entity, thing, layout)
            constants[:, i] = np.where(constants[:, i] > 0, (1 - textures.shift[i]) * textures.scale[i], 0.0)
    return TypeInputs(columns, constants, noise, draws)


def entity_values(inputs: Sequence[str], entity: Entity) -> np.ndarray:
    """What an entity gives to inputs, float64 ``[input]``: nan for factors that it lacks, 0 for background and noise.

    Raises:
        SegarError: an input is neither known here nor a factor of the entity.
    """
    values = np.zeros(len(inputs))
    for i, name in enumerate(inputs):
        if name == BACKGROUND or is_noise(name):
            continue
        thing = _class_named(name, (type(entity),), entity.factors)
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


def _source(entity: type[Entity], thing: type, layout: Layout) -> tuple[int, float]:
    """The column that an entity type holds a factor in, or -1; and 1 if it has a factor without one, or is of a type."""
    if issubclass(thing, Entity):
        return -1, float(issubclass(entity, thing))
    held = holds(entity, thing)
    if held is None:
        return -1, 0.0
    return (layout.columns[held], 0.0) if held.width else (-1, 1.0)


def _class_named(name: str, types: Sequence[type[Entity]], factors: Iterable[type[Factor]] = ()) -> type:
    """The factor or entity type called so: among these and their parents, else any that is defined."""
    nearby = [*factors, *(factor for entity in types for factor in entity.declared), *types]
    known = [parent for cls in nearby for parent in cls.__mro__ if issubclass(parent, (Factor, Entity))]
    known += [*concrete_factors(), *_entity_types()]
    for found in known:
        if found.__name__ == name:
            if issubclass(found, Factor) and found.width > 1:
                raise SegarError(
                    f"the texture input '{name}' has two components; a texture can only show single numbers"
                )
            return found
    names = (cls.__name__ for cls in known)
    raise SegarError(f"the texture input '{name}' is neither a factor nor an entity type.{did_you_mean(name, names)}")


def _entity_types() -> list[type[Entity]]:
    """All entity types that are defined, in order of definition."""
    found, stack = [], list(Entity.__subclasses__())
    while stack:
        cls = stack.pop(0)
        stack[:0] = cls.__subclasses__()
        found.append(cls)
    return found
