"""The state observations of 2022 by their names there: each is a :class:`StateVector` with some options.

Its constant for a missing factor was ``missing=MISSING_2022``, and rows that no thing fills were zero.
"""

from typing import Any

from segar.language import (
    Acceleration,
    Alive,
    Charge,
    Done,
    Entity,
    Factor,
    Friction,
    Heat,
    Magnetism,
    Mass,
    Mobile,
    Object,
    Position,
    Size,
    StoredEnergy,
    Thing,
    Tile,
    Velocity,
)
from segar.observations.state.state_vector import StateVector

OBJECT_FACTORS = (Charge, Mass, Magnetism, StoredEnergy, Position, Velocity, Acceleration, Alive, Done)
TILE_FACTORS = (Heat, Friction, Position)
THING_FACTORS: tuple[type[Factor], ...] = (
    Position, Velocity, Size, Mobile, Mass, Charge, Magnetism, StoredEnergy, Alive, Friction, Heat,
)  # fmt: skip
N_THINGS = 20


def ObjectState(entity: str | type[Entity] = "golfball", **options: Any) -> StateVector:
    """The 12 numbers of an object: those of ``OBJECT_FACTORS``."""
    return _state({"entities": (entity,), "factors": OBJECT_FACTORS}, options)


def TileState(entity: str | type[Entity] = "goal", **options: Any) -> StateVector:
    """The 4 numbers of a tile: those of ``TILE_FACTORS``."""
    return _state({"entities": (entity,), "factors": TILE_FACTORS}, options)


def AllState(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """A table of ``n_things`` rows, those of the entities named ``unique_ids`` first: of one shape for all levels."""
    return _table(Thing, n_things, unique_ids, options)


def AllObjects(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """Like :func:`AllState`, of objects."""
    return _table(Object, n_things, unique_ids, options)


def AllTiles(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """Like :func:`AllState`, of tiles."""
    return _table(Tile, n_things, unique_ids, options)


def _table(kind: type[Entity], n_things: int, unique_ids: tuple[str, ...], options: dict[str, Any]) -> StateVector:
    table = {"form": "table", "slots": n_things, "entities": (*unique_ids, kind), "factors": THING_FACTORS}
    return _state(table, options)


def _state(preset: dict[str, Any], options: dict[str, Any]) -> StateVector:
    """Without type numbers, as in 2022; ``options`` override the preset."""
    return StateVector(**{"types": False, **preset, **options})
