"""The true factors of a batch, gathered when they are asked for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from segar.engine.layout import Layout
from segar.errors import LevelError, did_you_mean


class Factors(Mapping[str, np.ndarray]):
    """Factor name to float64 ``(num_envs, entities)``, vectors ``(num_envs, entities, 2)``; nan where one is lacking.

    It belongs to the step that returned it: if it is still held when the next step begins, it keeps a copy of its own.
    """

    def __init__(self, layout: Layout, values: np.ndarray, rows: np.ndarray | None = None, num_envs: int = 0) -> None:
        self._layout, self._values, self._rows, self._num_envs = layout, values, rows, num_envs
        self._columns = layout.by_name

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the entities, in the order of the arrays' second axis."""
        return self._layout.names

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

    def __contains__(self, name: object) -> bool:
        return name in self._columns

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    def __eq__(self, other: object) -> bool:
        return same_factors(self, other)

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"Factors({', '.join(self._columns)})"

    def keep(self) -> None:
        """Take a copy of the state, since the batch is about to change."""
        self._values = self._values.copy()


class SingleFactors(Mapping[str, np.ndarray]):
    """The factors of a batch of one: float64 ``(entities,)`` or ``(entities, 2)``; see :class:`Factors`."""

    def __init__(self, batch: Factors) -> None:
        self._batch = batch

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the entities, in the order of the arrays' first axis."""
        return self._batch.entities

    def __getitem__(self, name: str) -> np.ndarray:
        return self._batch[name][0]

    def __iter__(self) -> Iterator[str]:
        return iter(self._batch)

    def __len__(self) -> int:
        return len(self._batch)

    def __eq__(self, other: object) -> bool:
        return same_factors(self, other)

    __hash__ = None  # type: ignore[assignment]


def same_factors(a: Mapping[str, np.ndarray], b: object) -> bool:
    """Whether two mappings hold equal arrays, nan equal to nan."""
    if not isinstance(b, Mapping) or a.keys() != b.keys():
        return False
    return all(np.array_equal(a[name], b[name], equal_nan=True) for name in a)
