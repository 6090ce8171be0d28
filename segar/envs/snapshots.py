"""Snapshots: all that a batch of environments needs to go on from a moment, to be kept, saved, forked and restored."""

from dataclasses import dataclass, field, fields, replace
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np

from segar.engine import State
from segar.errors import SegarError
from segar.levels import Levels
from segar.support import ArchiveFormat

FORMAT = ArchiveFormat("segar-snapshot", 1, "a snapshot", "snapshot", SegarError)
STATE_ARRAYS = tuple(array.name for array in fields(State))
EPISODE_ARRAYS = ("returns", "lengths", "episodes")
MEMORY = "memory/"  # stands before the names of what observations remember
NAMES_IN_FILES = {"unresolved_contacts": "gave_up"}  # arrays whose name in files is the one that SEGAR 0.1 gave them


@dataclass
class Snapshot:
    """Running episodes at one moment; arrays lead with the environment.

    Attributes:
        state: factors, level, and the randomness of rules; see :class:`segar.engine.State`.
        returns: float64 ``(num_envs,)``, rewards of the running episode so far.
        lengths: int64 ``(num_envs,)``, its steps so far.
        episodes: int64 ``(num_envs,)``, episodes that were started.
        seed: decides, with environment and number of the episode, on which level the next one starts.
        memory: what observations show of the past, such as a frame stack, by name; empty where they show none.
    """

    state: State
    returns: np.ndarray
    lengths: np.ndarray
    episodes: np.ndarray
    seed: int
    memory: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.returns)

    def __getitem__(self, index: Any) -> Self:
        """A copy of the environments at an index, a slice, a list of indices (repeated as often as named) or a mask.

        ``snapshot[[0, 0, 1]]`` forks environment 0. Forks share episode, factors and the randomness in rules, so equal
        actions lead to equal bits until the episode ends; the next one is drawn for each place in the batch.

        Raises:
            SegarError: there is no such environment, or none is named.
        """
        try:
            rows = np.atleast_1d(np.arange(len(self))[index])
        except IndexError as error:
            raise SegarError(f"snapshot[{index!r}]: it holds {len(self)} environments: {error}") from None
        if not len(rows):
            raise SegarError(f"snapshot[{index!r}] names no environment")
        state = State(**{name: getattr(self.state, name)[rows] for name in STATE_ARRAYS})
        memory = {name: array[rows] for name, array in self.memory.items()}
        return replace(self, state=state, memory=memory, **{name: getattr(self, name)[rows] for name in EPISODE_ARRAYS})

    def copy(self) -> Self:
        return self[:]

    def save(self, path: str | PathLike[str]) -> None:
        """Write to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Levels and rules are not in the file: save the levels beside it.

        Raises:
            SegarError: the file cannot be written; what stood at ``path`` still stands there.
        """
        arrays = {_name_in_file(name): getattr(self.state, name) for name in STATE_ARRAYS}
        arrays |= {name: getattr(self, name) for name in EPISODE_ARRAYS}
        arrays |= {f"{MEMORY}{name}": array for name, array in self.memory.items()}
        FORMAT.write(Path(path), arrays, {"seed": self.seed, "memory": list(self.memory)})

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """The snapshot in a file that ``save`` wrote, here or in SEGAR 0.1.

        Raises:
            SegarError: the file is no snapshot, is incomplete, has arrays that do not fit each other, or was written by a
                newer version.
        """
        path, in_file = Path(path), [_name_in_file(name) for name in (*STATE_ARRAYS, *EPISODE_ARRAYS)]
        arrays, metadata = FORMAT.read(path, in_file)
        names = metadata.get("memory", ())  # which arrays these are, only the description says
        memory, _ = FORMAT.read(path, [f"{MEMORY}{name}" for name in names]) if names else ({}, {})
        _check_arrays(path, arrays, memory)
        return cls(
            State(**{name: arrays[_name_in_file(name)] for name in STATE_ARRAYS}),
            **{name: arrays[name] for name in EPISODE_ARRAYS},
            seed=int(metadata["seed"]),
            memory={name: memory[f"{MEMORY}{name}"] for name in names},
        )

    def check_fits(self, levels: Levels, num_envs: int) -> None:
        """Raise :class:`SegarError` unless ``num_envs`` environments on ``levels`` can go on from here.

        Levels may differ from those of the snapshot in shapes and world parameters, which are not part of a state, but
        not in which entities are there and what they hold.
        """
        if len(self) != num_envs:
            raise SegarError(
                f"this snapshot holds {len(self)} environments, and here are {num_envs}; pick or repeat some, as in"
                f" snapshot[[0, 0, 1]], or make an environment of num_envs={len(self)}"
            )
        values, level = self.state.values, self.state.level
        if values.shape[1:] != levels.values.shape[1:] or not ((level >= 0) & (level < len(levels))).all():
            raise SegarError(
                f"this snapshot is of other levels: of {values.shape[1]} entities with {values.shape[2]} columns and at"
                f" least {level.max() + 1} levels, and here are {len(levels)} levels of {levels.values.shape[1]} entities"
                f" with {levels.values.shape[2]} columns"
            )
        # What is absent stays absent; that a rule computed nan is no reason to refuse.
        strange = (np.isnan(levels.values[level]) & ~np.isnan(values)).any(axis=(1, 2))
        if strange.any():
            e = int(np.flatnonzero(strange)[0])
            raise SegarError(
                f"this snapshot is of other levels: environment {e} holds a factor that no entity has in level {level[e]}"
            )


def _name_in_file(name: str) -> str:
    """The name of an array in files."""
    return NAMES_IN_FILES.get(name, name)


def _check_arrays(path: Path, arrays: dict[str, np.ndarray], memory: dict[str, np.ndarray]) -> None:
    """Raise :class:`SegarError` unless the arrays have the dtypes and shapes of one batch of environments."""
    kinds = {"values": (np.float64, 3), "returns": (np.float64, 1), "key": (np.uint64, 1)}
    for name, array in {**arrays, **memory}.items():
        dtype, axes = kinds.get(name, (np.int64, 1)) if name in arrays else (array.dtype, array.ndim)
        if (array.dtype, array.ndim, array.shape[:1]) != (dtype, axes, (arrays["returns"].size,)):
            raise SegarError(
                f"{path}: '{name}' must be {np.dtype(dtype)} of {axes} axes and {arrays['returns'].size} environments, not"
                f" {array.dtype} of shape {array.shape}; the file was changed, save the snapshot again"
            )
