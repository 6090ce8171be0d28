"""Snapshots: all that a batch of environments needs to go on from a moment, to be kept, saved, forked and restored."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np

from segar.engine import State, numbers_not_finite
from segar.errors import SegarError
from segar.levels import Levels
from segar.support import ArchiveFormat, Form

LIMIT = 4 * 2**30  # [bytes] of a snapshot whose observations remember frames
DESCRIPTION = {"seed": int, "memory?": [str], "parameters?": bool}
FORMAT = ArchiveFormat("segar-snapshot", 1, "a snapshot", "snapshot", SegarError, DESCRIPTION, LIMIT)
# Of arrays; those of others are int64.
DTYPES = {"values": "float64", "parameters": "float64", "returns": "float64", "key": "uint64"}
STATE_ARRAYS = tuple(array.name for array in fields(State))
EPISODE_ARRAYS = ("returns", "lengths", "episodes")
MOST_TRIALS = 1_000_000
MEMORY = "memory/"  # stands before the names of what observations remember


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
        parameters: float64 ``(num_envs, parameters)``, the world parameters of environments in which the caller set some, nan
            in all others; None where none was set.
    """

    state: State
    returns: np.ndarray
    lengths: np.ndarray
    episodes: np.ndarray
    seed: int
    memory: dict[str, np.ndarray] = field(default_factory=dict)
    parameters: np.ndarray | None = None

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
        return self._of({name: array[rows] for name, array in self._arrays.items()}, self.seed)

    @property
    def episode_arrays(self) -> dict[str, np.ndarray]:
        """The arrays that every snapshot has, by name."""
        return {name: getattr(self.state, name) for name in STATE_ARRAYS} | {
            name: getattr(self, name) for name in EPISODE_ARRAYS
        }

    @property
    def _arrays(self) -> dict[str, np.ndarray]:
        """All arrays by their names in a file."""
        own = {} if self.parameters is None else {"parameters": self.parameters}
        return self.episode_arrays | {f"{MEMORY}{name}": array for name, array in self.memory.items()} | own

    @classmethod
    def _of(cls, arrays: Mapping[str, np.ndarray], seed: int) -> Self:
        """The snapshot with these arrays, which have their names in a file."""
        return cls(
            State(**{name: arrays[name] for name in STATE_ARRAYS}),
            **{name: arrays[name] for name in EPISODE_ARRAYS},
            seed=seed,
            memory={name.removeprefix(MEMORY): array for name, array in arrays.items() if name.startswith(MEMORY)},
            parameters=arrays.get("parameters"),
        )

    def copy(self) -> Self:
        return self[:]

    def save(self, path: str | PathLike[str]) -> None:
        """Write to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Levels and rules are not in the file: save the levels beside it.

        Raises:
            SegarError: the file cannot be written; what stood at ``path`` still stands there.
        """
        about = {"seed": self.seed, "memory": list(self.memory), "parameters": self.parameters is not None}
        FORMAT.write(Path(path), self._arrays, about)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """The snapshot in a file that ``save`` wrote.

        Raises:
            SegarError: the file is no snapshot, is incomplete, has arrays that do not fit each other, or was written by a
                newer version.
        """
        path = Path(path)

        def forms(metadata: dict[str, Any]) -> dict[str, Form]:
            own = ["parameters"] if metadata.get("parameters") else []
            return {name: _form(name) for name in (*STATE_ARRAYS, *EPISODE_ARRAYS, *own)} | {
                f"{MEMORY}{name}": Form(None, ("environments", ...)) for name in metadata.get("memory", ())
            }

        arrays, metadata = FORMAT.read(path, forms)
        counts = [name for name, array in arrays.items() if array.dtype == np.int64 and not name.startswith(MEMORY)]
        negative = [name for name in counts if (arrays[name] < 0).any()]
        if negative or metadata["seed"] < 0 or not len(arrays["returns"]):
            what = "its seed is" if metadata["seed"] < 0 else f"numbers of '{negative[0]}' are" if negative else None
            wrong = f"{what} below 0" if what else "it holds no environments"
            raise SegarError(f"{path}: {wrong}; the file was changed, save the snapshot again")
        return cls._of(arrays, metadata["seed"])

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
        sizes: dict[str, int] = {}
        for name, array in self.episode_arrays.items():
            if not _form(name).fits(array.dtype, array.shape, sizes):
                raise SegarError(
                    f"in this snapshot, '{name}' must be {_form(name).said(sizes)}, not {array.dtype} of shape {array.shape}"
                )
            if array.dtype == np.int64 and (array < 0).any():
                raise SegarError(f"in this snapshot, environment {int((array < 0).argmax())} has a '{name}' below 0")
        parameters = levels.layout.parameters
        own = np.zeros((0, len(parameters))) if self.parameters is None else self.parameters
        if own.shape[1:] != (len(parameters),):
            raise SegarError(f"in this snapshot, 'parameters' must have {len(parameters)} columns, not {own.shape[1:]}")
        for column, parameter in enumerate(parameters):
            numbers = own[~np.isnan(own).all(axis=1), column]
            if not parameter.is_possible(numbers).all():
                raise SegarError(f"the world parameter {parameter.__name__} must be {parameter.possible_values()}")
        values, level = self.state.values, self.state.level
        if values.shape[1:] != levels.values.shape[1:] or not (level < len(levels)).all():
            raise SegarError(
                f"this snapshot is of other levels: of {values.shape[1]} entities with {values.shape[2]} columns and at"
                f" least {level.max() + 1} levels, and here are {len(levels)} levels of {levels.values.shape[1]} entities"
                f" with {levels.values.shape[2]} columns"
            )
        absent = np.isnan(levels.values[level])
        strange = (absent & ~np.isnan(values)).any(axis=(1, 2))
        if strange.any():
            e = int(np.flatnonzero(strange)[0])
            raise SegarError(
                f"this snapshot is of other levels: environment {e} holds a factor that no entity has in level {level[e]}"
            )
        wrong = ~absent & ~np.isfinite(values)
        if wrong.any():
            e = int(np.argwhere(wrong)[0, 0])
            places = numbers_not_finite(levels.layout, values[e], wrong[e])
            raise SegarError(f"in this snapshot, environment {e} has numbers that are not finite: {', '.join(places)}")


def _form(name: str) -> Form:
    """What an array of the state or of the episodes must be in a file."""
    axes = {"values": ("entities", "columns"), "parameters": ("parameters",)}.get(name, ())
    return Form(DTYPES.get(name, "int64"), ("environments", *axes))


def trial_info(trials: int, episodes: Any, lengths: Any) -> dict[str, Any]:
    """What ``info`` says of trials; nothing where each level is played once.

    Args:
        trials: episodes on each level.
        episodes, lengths: int64 ``(num_envs,)``, arrays or tensors: how many were started, and the steps of the running ones.

    Returns:
        ``trial`` (int64, from 0): which episode on its level runs; ``new_level`` (bool): whether it is the first one and no
        step was taken yet.
    """
    if trials == 1:
        return {}
    trial = (episodes - 1) % trials
    return {"trial": trial, "new_level": (trial == 0) & (lengths == 0)}
