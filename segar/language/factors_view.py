"""The true factors of a batch and the results of its task, gathered when they are read."""

from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any

import numpy as np

from segar.errors import LevelError, SegarError, did_you_mean
from segar.language.entities import Entity
from segar.language.layout import Layout


class OnAccess(Mapping[str, Any]):
    """Named values that are computed when they are read, by the ``__getitem__`` of a sub-class, which sets ``_names``."""

    _names: Collection[str]

    def __contains__(self, name: object) -> bool:
        return name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __eq__(self, other: object) -> bool:
        """Whether the other mapping holds equal arrays, nan equal to nan."""
        if not isinstance(other, Mapping) or self.keys() != other.keys():
            return False
        return all(_same(np.asarray(self[name]), np.asarray(other[name])) for name in self)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(self._names)})"


class Factors(OnAccess):
    """Factor name to float64 ``(num_envs, entities)``, vectors ``(num_envs, entities, 2)``; nan where an entity lacks it.

    The object belongs to the step that returned it. If a caller still holds it when the next step begins, it gets a copy
    of the state.
    """

    def __init__(self, layout: Layout, values: np.ndarray, rows: np.ndarray | None = None, num_envs: int = 0) -> None:
        self._layout, self._values, self._rows, self._num_envs = layout, values, rows, num_envs
        self._names = self._columns = layout.by_name

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the entities, in the order of the arrays' second axis."""
        return self._layout.names

    def slots(self, entity_type: type[Entity]) -> list[int]:
        """Places in the arrays' second axis where only entities of this type can be; raises :class:`LevelError`."""
        slots = self._layout.slots
        found = [k for k, slot in enumerate(slots) if all(issubclass(t, entity_type) for t in slot.types)]
        if not found:
            raise LevelError(f"none of these levels' entities, {', '.join(self.entities)}, is a {entity_type.__name__}")
        return found

    def __getitem__(self, name: str) -> np.ndarray:
        if name not in self._columns:
            raise LevelError(f"no entity has a factor '{name}'.{did_you_mean(name, self._columns)}")
        factor, column = self._columns[name]
        part = self._values[:, :, column : column + factor.width]
        if self._rows is not None:
            full = np.full((self._num_envs, *part.shape[1:]), np.nan)
            full[self._rows] = part
            part = full
        return part.copy() if factor.width == 2 else part[:, :, 0].copy()

    def keep(self) -> None:
        """Take a copy of the state, since the batch is about to change."""
        self._values = self._values.copy()


class Results(OnAccess):
    """The results of a task in the state that ``factors`` hold: name to array ``(num_envs, ...)``, computed when read."""

    def __init__(self, functions: Mapping[str, Callable[[Factors], np.ndarray]], factors: Factors) -> None:
        self._functions, self._factors, self._names = functions, factors, functions

    def __getitem__(self, name: str) -> Any:
        if name not in self._functions:
            raise SegarError(f"this task has no result '{name}'.{did_you_mean(name, self._functions)}")
        return self._functions[name](self._factors)


class SingleResults(OnAccess):
    """The results of a batch of one: numbers and truths, or arrays where a result is one; see :class:`Results`."""

    def __init__(self, batch: Results) -> None:
        self._batch = self._names = batch

    def __getitem__(self, name: str) -> Any:
        value = np.asarray(self._batch[name])[0]
        return value.item() if value.ndim == 0 else value


class SingleFactors(OnAccess):
    """The factors of a batch of one: float64 ``(entities,)`` or ``(entities, 2)``; see :class:`Factors`."""

    def __init__(self, batch: Factors) -> None:
        self._batch = self._names = batch

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the entities, in the order of the arrays' first axis."""
        return self._batch.entities

    def slots(self, entity_type: type[Entity]) -> list[int]:
        """Places in the arrays' first axis where only entities of this type can be."""
        return self._batch.slots(entity_type)

    def __getitem__(self, name: str) -> np.ndarray:
        return self._batch[name][0]


def _same(a: np.ndarray, b: np.ndarray) -> bool:
    return np.array_equal(a, b, equal_nan=a.dtype.kind == "f" and b.dtype.kind == "f")
