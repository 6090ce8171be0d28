"""State observations: the factors of things in fixed places, float32; and those of 2022 by their names there.

Each of these is a :class:`StateVector` with some options. Its constant for a missing factor was ``missing=MISSING_2022``, and
rows that no thing fills were zero.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import gymnasium
import numpy as np

from segar import language
from segar.engine import Call, Given, Reads, Rows, call_of, gather
from segar.levels import Levels
from segar.observations.state.places import lay_out, shift_and_scale
from segar.observations.state.state_options import FACTOR_LIMIT, StateOptions
from segar.support import read_only_view


@dataclass(frozen=True)
class StateVector(StateOptions):
    """The factors of things in fixed places, float32: one after the other, or as a table ``[slots, features]``.

    Its shape depends on the distribution alone. Unless other ``entities`` are chosen, each slot that can hold a thing
    has its place, in the order of ``env.levels.layout.names``. As a vector, a slot shows the factors that its types
    have; as a table, all slots have the same columns. Where the level decides the type, there is one number per type,
    1 for the one that fills the slot. What is invisible to pixels (Invisiball's ball, what is dead or swallowed) is
    shown like everything else, unless it is not to be seen.

    Args:
        entities: what is shown, in this order: names of slots, entity types (sub-classes included) or names of types.
            In a slot that other types may fill, too, these are missing. All things where it is None.
        factors: what is shown of them, in this order: factors or their names, sub-classes included. All but the hidden
            ones, the user's own among them, where it is None.
        hidden: factors or names, sub-classes included, that are not shown; also of ``parameters``. Where no ``factors``
            are chosen, those of ``HIDDEN`` are not, either.
        form: "vector" or "table".
        slots: rows of the table; those that the levels do not need are missing. As many as needed where it is None.
        types: whether type numbers are shown; None for those slots (of a table: all, if there are such) whose type
            the level decides.
        missing: the number where an entity is absent, or lacks the factor; ``MISSING_2022`` is that of 2022.
        mask: how it is marked which numbers are not missing: None for not at all; "numbers" for one number each (1 if
            it is there) after all numbers of the vector or of the row; "dict" for observations ``{"state", "mask"}``
            of equal shapes.
        normalise: whether numbers are measured from the prior's mean in units of its spread, both estimated from 2,000
            levels; see :mod:`segar.observations.state.places`. The prior is that of ``measured_on``.
        sees_invisible: whether things are shown that are not Visible; otherwise their numbers are missing.
        parameters: world parameters or their names, sub-classes included, that are shown after all else, as the level
            has them; of a vector only.
        scale: factor or parameter, or its name, to a constant that its numbers are divided by, such as ``{Hits: 200}``
            for a counter; sub-classes included, the nearest class counts. It takes the place of ``normalise`` there.
        measured_on: levels whose distribution is the prior of ``normalise``: those that the agent is trained on, as
            :meth:`trained_on` gives them. Where it is None, the levels that are shown.

    Raises:
        SegarError: an option is unknown, or a factor is no factor or has no number.
    """

    def trained_on(self, levels: Levels) -> StateVector:
        """The observation of an agent that is trained on these levels: normalised by their distribution on all levels."""
        is_known = not self.normalise or self.measured_on is not None
        return self if is_known else replace(self, measured_on=levels[:1])  # one level knows its distribution

    def bind(self, levels: Levels, num_envs: int) -> BoundStateVector:
        """The observation at work on these levels.

        Raises:
            LevelError: they lack a chosen entity, factor or parameter, or, to be normalised, know no distribution.
            FactorError: several classes have the name of a factor or parameter that is given by name, and these levels do
                not say which is meant.
        """
        return BoundStateVector(self, levels)


class BoundStateVector:
    """:class:`StateVector` in one batch of environments.

    Attributes:
        names: what each number is, e.g. ``golfball.Position.x`` or ``world.Gravity``.
    """

    def __init__(self, state: StateVector, levels: Levels) -> None:
        state = state.on(levels.layout)
        places = lay_out(state, levels.layout)
        shift, scale = shift_and_scale(state, places, levels)
        self.names, self._mask, self._states = places.names, state.mask, levels.values.shape[1:]
        types, parameters = read_only_view(levels.types), read_only_view(levels.parameters)
        missing = float(state.missing)
        self._read = (
            types, places.reads, places.type_reads, parameters, places.parameter_reads, places.seen, shift, scale,
            missing, FACTOR_LIMIT,
        )  # fmt: skip
        self.reads: Reads | None = None
        if places.seen is None and shift is None and self._mask is None:
            self.reads = Reads(
                types, places.reads, places.type_reads, missing, FACTOR_LIMIT, parameters, places.parameter_reads
            )
        box = gymnasium.spaces.Box(-FACTOR_LIMIT, FACTOR_LIMIT, places.shape, np.float32)
        self.space: gymnasium.Space = box
        if state.mask == "dict":
            self.space = gymnasium.spaces.Dict(
                {"state": box, "mask": gymnasium.spaces.Box(0, 1, box.shape, np.float32)}
            )

    def begin(self, values: np.ndarray, level: np.ndarray, mask: np.ndarray) -> None:
        """Nothing to prepare."""

    def write(self, values: np.ndarray, level: np.ndarray, out: Any, rows: np.ndarray) -> None:
        """Fill ``out[rows]``, float32 ``[env, *space.shape]``, or both arrays of ``{"state", "mask"}``."""
        state, mask = (out["state"], out["mask"]) if self._mask == "dict" else (out, out)
        mask = mask.reshape(len(mask), -1) if self._mask is not None else None
        gather(values, level, rows, *self._read, state.reshape(len(state), -1), mask)

    def calls(self, when: str, in_rows: bool = False) -> list[Call]:
        """What ``write`` does, for other targets; see :class:`segar.observations.RunsOnTargets`.

        Where the mask stands among the numbers, ``mask`` is ``out``.
        """
        if when != "write":
            return []
        values, level = Given("float64", ("envs", *self._states)), Given("int64", ("envs",))
        table = Given("float32", ("envs", len(self.names)))
        arguments = [values, level, Rows(), *self._read, table, None if self._mask is None else table]
        sizes = {"types": ("levels", None), "parameters": ("levels", None)}
        return [call_of("gather_state", gather, arguments, sizes)]


OBJECT_FACTORS = (
    language.Charge, language.Mass, language.Magnetism, language.StoredEnergy, language.Position, language.Velocity,
    language.Acceleration, language.Alive, language.Done,
)  # fmt: skip
TILE_FACTORS = (language.Heat, language.Friction, language.Position)
THING_FACTORS: tuple[type[language.Factor], ...] = (
    language.Position, language.Velocity, language.Size, language.Mobile, language.Mass, language.Charge, language.Magnetism,
    language.StoredEnergy, language.Alive, language.Friction, language.Heat,
)  # fmt: skip
N_THINGS = 20


def ObjectState(entity: str | type[language.Entity] = "golfball", **options: Any) -> StateVector:
    """The 12 numbers of an object: those of ``OBJECT_FACTORS``."""
    return StateVector(**{"entities": (entity,), "factors": OBJECT_FACTORS, "types": False} | options)


def TileState(entity: str | type[language.Entity] = "goal", **options: Any) -> StateVector:
    """The 4 numbers of a tile: those of ``TILE_FACTORS``."""
    return StateVector(**{"entities": (entity,), "factors": TILE_FACTORS, "types": False} | options)


def AllState(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """A table of ``n_things`` rows, those of the entities named ``unique_ids`` first: of one shape for all levels."""
    return _table(language.Thing, n_things, unique_ids, options)


def AllObjects(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """Like :func:`AllState`, of objects."""
    return _table(language.Object, n_things, unique_ids, options)


def AllTiles(n_things: int = N_THINGS, unique_ids: tuple[str, ...] = (), **options: Any) -> StateVector:
    """Like :func:`AllState`, of tiles."""
    return _table(language.Tile, n_things, unique_ids, options)


def _table(
    kind: type[language.Entity], n_things: int, unique_ids: tuple[str, ...], options: dict[str, Any]
) -> StateVector:
    rows = {"form": "table", "slots": n_things, "entities": (*unique_ids, kind)}
    return StateVector(**rows | {"factors": THING_FACTORS, "types": False} | options)
