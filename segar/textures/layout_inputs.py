"""Where a state holds what enters a texture, for each entity type of a layout."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from segar.language import Entity, Layout, holds
from segar.textures.inputs import BACKGROUND, class_of_input, is_noise
from segar.textures.texture_sets import TextureSet, hidden_inputs


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
    concealed = hidden_inputs(textures, hidden)
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
            thing = class_of_input(name, layout.types)
            for t, entity in enumerate(layout.types):
                columns[t, i], constants[t, i] = _source(entity, thing, layout)
            constants[:, i] = np.where(constants[:, i] > 0, (1 - textures.shift[i]) * textures.scale[i], 0.0)
    return TypeInputs(columns, constants, noise, draws)


def _source(entity: type[Entity], thing: type, layout: Layout) -> tuple[int, float]:
    """The column that an entity type holds a factor in, or -1; and 1 if it has a factor without one, or is of a type."""
    if issubclass(thing, Entity):
        return -1, float(issubclass(entity, thing))
    held = holds(entity, thing)
    if held is None:
        return -1, 0.0
    return (layout.columns[held], 0.0) if held.width else (-1, 1.0)
