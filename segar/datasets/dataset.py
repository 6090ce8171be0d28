"""A recorded dataset: its manifest, its levels, and its shards, checked while they are read.

A shard is a Parquet table of scalars and factors, and an NPZ file of the observations, row by row.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np

from segar.datasets.manifest import LEVELS, MANIFEST, RESTORE, Manifest, ShardEntry, check_files, sha256, shard_files
from segar.datasets.rollouts import Rollouts
from segar.errors import SegarError
from segar.language import Factors, Layout
from segar.levels import Levels, hash_of_levels
from segar.rules import World
from segar.support import DAMAGE, LIMIT_VARIABLE, Form, file_limit, first_line, need, open_npz, replacing

INTEGERS = ("episode", "step", "level")
TRUTHS = ("terminated", "truncated", "success", "death")
ENVIRONMENT, SEED = "environment", "seed"
TRIAL = "trial"  # a column where there are several
COMPONENTS = ("x", "y")  # of a vector
ACTION = "action."  # how the names of the columns of actions begin
LIMIT = 4 * 2**30  # [bytes] of a shard with frames


@dataclass(frozen=True)
class Episode:
    """One episode of T steps.

    Attributes:
        number: of the episode in the dataset.
        level: index of the level that was played.
        seed, environment: an environment in this place of a batch, reset with this seed, plays it again; where it is
            not the first trial, after as many further resets.
        actions: float32 ``(T, n)``; rewards float64 ``(T,)``; terminated, truncated, success, death bool ``(T,)``.
        observations: name -> array ``(T + 1, ...)``.
        factors: name -> float64 ``(T + 1, entities)`` or ``(T + 1, entities, 2)``; nan where an entity lacks it.
        trial: which episode in a row on its level it is, from 0.
    """

    number: int
    level: int
    seed: int
    environment: int
    actions: np.ndarray
    rewards: np.ndarray
    terminated: np.ndarray
    truncated: np.ndarray
    success: np.ndarray
    death: np.ndarray
    observations: dict[str, np.ndarray]
    factors: dict[str, np.ndarray]
    trial: int = 0

    def __len__(self) -> int:
        return len(self.rewards)


@dataclass(frozen=True)
class Shard:
    """A part of a dataset, as arrays; see :class:`segar.datasets.Rollouts` for what a row is.

    Attributes:
        number: of the shard.
        seed: of its environments; the episode in place k was played by environment k, or the k-th row of trials.
        rollouts: what happened.
        layout: what the axes of ``rollouts.values`` mean.
    """

    number: int
    seed: int
    rollouts: Rollouts
    layout: Layout

    @property
    def entities(self) -> tuple[str, ...]:
        """Names of the entities, in the order of the factors' axis."""
        return self.layout.names

    def factor(self, name: str) -> np.ndarray:
        """A factor of all entities, float64 ``(rows, entities)`` or ``(rows, entities, 2)``; nan where one lacks it.

        Raises:
            LevelError: no entity has such a factor.
        """
        return Factors(self.layout, self.rollouts.values)[name]

    def episodes(self) -> Iterator[Episode]:
        """The episodes, one after the other."""
        r = self.rollouts
        starts = [*np.flatnonzero(r.step == 0), len(r)]
        trials = int(r.trial.max()) + 1
        for place, (first, stop) in enumerate(pairwise(starts)):
            all_rows, taken = slice(first, stop), slice(first, stop - 1)
            yield Episode(
                number=int(r.episode[first]),
                level=int(r.level[first]),
                seed=self.seed,
                environment=place // trials,
                trial=int(r.trial[first]),
                actions=r.action[taken],
                rewards=r.reward[taken],
                **{name: getattr(r, name)[taken] for name in TRUTHS},
                observations={name: array[all_rows] for name, array in r.observations.items()},
                factors={factor.__name__: self.factor(factor.__name__)[all_rows] for factor in self.layout.factors},
            )


def factor_columns(layout: Layout) -> list[dict[str, str]]:
    """What the factors' columns of a table are called and mean: those that some entity of a slot may have."""
    return [
        {
            "name": f"{slot.name}.{factor.__name__}" + (f".{component}" if component else ""),
            "entity": slot.name,
            "factor": factor.__name__,
            "component": component,
            "unit": factor.unit,
        }
        for slot in layout.slots
        for factor in layout.factors
        if any(factor in t.declared for t in slot.types)
        for component in (COMPONENTS if factor.width == 2 else ("",))
    ]


def write_shard(folder: Path, number: int, rollouts: Rollouts, seed: int, layout: Layout) -> ShardEntry:
    """Write a shard's two files and return its entry for the manifest."""
    from pyarrow import parquet, table

    table_name, observations_name = shard_files(number)
    with replacing(folder / table_name, "the table") as beside:
        parquet.write_table(table(_table(rollouts, seed, layout)), beside, compression="zstd")
    with replacing(folder / observations_name, f"shard {number}") as beside, open(beside, "wb") as file:
        np.savez_compressed(file, **dict[str, Any](rollouts.observations))
    return ShardEntry(seed, len(rollouts), {name: sha256(folder / name) for name in (table_name, observations_name)})


def read_shard(folder: Path, number: int, manifest: Manifest, layout: Layout) -> Shard:
    """A shard, checked against the manifest.

    Raises:
        SegarError: its files are not there, have other hashes than the manifest says, do not fit the manifest or each
            other, or would take more memory than the limit (see ``docs/reference/files.md``).
    """
    need("reading a dataset", "pyarrow")
    entry = manifest.shards[number]
    check_files(folder, number, entry.files)
    table_name, observations_name = shard_files(number)
    columns = _read_table(folder / table_name, entry.rows, manifest)
    actions = [columns[name] for name in columns if name.startswith(ACTION)]
    forms = {
        name: Form(described["dtype"], (entry.rows, *described["shape"])) for name, described in manifest.arrays.items()
    }
    with open_npz(folder / observations_name, "file of observations", SegarError, LIMIT) as npz:
        observations = npz.read(forms)
    rollouts = Rollouts(
        **{name: columns[name] for name in (*INTEGERS, *TRUTHS, "reward")},
        trial=columns.get(TRIAL, np.zeros(entry.rows, np.int64)),
        action=np.stack(actions, axis=1),
        values=_values(columns, manifest, layout),
        observations=observations,
    )
    _check_rows(rollouts, number, manifest, folder / table_name)
    return Shard(number, entry.seed, rollouts, layout)


def _read_table(path: Path, rows: int, manifest: Manifest) -> dict[str, np.ndarray]:
    """The columns of a shard's table. Their names, types and length are checked before they are read."""
    from pyarrow import ArrowException, parquet, types

    settings = manifest.settings
    trial = (TRIAL,) if settings.trials > 1 else ()
    most = settings.episodes_per_shard * (settings.max_steps + 1)
    if rows > most:
        raise SegarError(f"{path}: its manifest says {rows:,} rows, and the episodes of a shard have {most:,} at most")
    try:
        with parquet.ParquetFile(path) as file:
            schema: Any = file.schema_arrow
            numbers = {name: k for k, name in enumerate(n for n in schema.names if n.startswith(ACTION))}
            expected = {name: types.is_int64 for name in (*INTEGERS, *trial, ENVIRONMENT)} | {SEED: types.is_uint64}
            expected |= dict.fromkeys(numbers, types.is_float32) | {"reward": types.is_float64}
            expected |= dict.fromkeys(TRUTHS, types.is_boolean)
            expected |= dict.fromkeys((column["name"] for column in manifest.columns), types.is_float64)
            fits = list(expected) == schema.names and all(expected[f.name](f.type) for f in schema)
            if not fits or [f"{ACTION}{k}" for k in numbers.values()] != list(numbers) or not numbers:
                raise SegarError(
                    f"{path}: its columns are not those that the manifest says; record again to restore it"
                )
            if file.metadata.num_rows != rows:
                raise SegarError(f"{path} has {file.metadata.num_rows:,} rows, and its manifest says {rows:,}")
            if rows * len(expected) * 8 > file_limit(LIMIT, path.stat().st_size):
                raise SegarError(
                    f"{path} would take {rows * len(expected) * 8:,} bytes; if you know where it comes from, set the"
                    f" environment variable {LIMIT_VARIABLE} to a larger number of megabytes"
                )
            table: Any = file.read()
            table.validate(full=True)
    except SegarError:
        raise
    except (ArrowException, *DAMAGE) as cause:
        raise SegarError(f"{path} is damaged: {first_line(cause)}; record again to restore it") from cause
    if any(table[name].null_count or len(table[name]) != rows for name in table.column_names):
        raise SegarError(f"{path} is damaged: numbers are absent from it; record again to restore it")
    return {name: table[name].to_numpy() for name in table.column_names}


def _check_rows(rollouts: Rollouts, number: int, manifest: Manifest, path: Path) -> None:
    """Raise :class:`SegarError` unless the rows are the shard's episodes, one after the other, on levels of the dataset."""
    starts = rollouts.step == 0
    goes_on = (np.diff(rollouts.step) == 1) & (np.diff(rollouts.episode) == 0) & (np.diff(rollouts.level) == 0)
    in_order = starts[0] and (starts[1:] | goes_on).all()
    of_row, trial = np.divmod(rollouts.episode, manifest.settings.trials)
    in_order &= (rollouts.trial == trial).all() and ((np.diff(of_row) == 1) | (np.diff(rollouts.level) == 0)).all()
    if not in_order or rollouts.episode[starts].tolist() != list(manifest.settings.episodes_of(number)):
        raise SegarError(f"{path}: its rows are not the episodes of shard {number}, step by step; record again")
    for level in rollouts.level[(rollouts.level < 0) | (rollouts.level >= manifest.settings.number_of_levels)][:1]:
        raise SegarError(
            f"{path}: it names level {level}, and the dataset has {manifest.settings.number_of_levels}; record again"
        )


def _table(rollouts: Rollouts, seed: int, layout: Layout) -> dict[str, np.ndarray]:
    """The columns of a table in their order."""
    columns = {name: getattr(rollouts, name) for name in INTEGERS}
    trials = int(rollouts.trial.max()) + 1
    if trials > 1:
        columns[TRIAL] = rollouts.trial
    columns[ENVIRONMENT] = (rollouts.episode - rollouts.episode[0]) // trials
    columns[SEED] = np.full(len(rollouts), seed, np.uint64)
    columns |= {f"action.{k}": rollouts.action[:, k] for k in range(rollouts.action.shape[1])}
    columns["reward"] = rollouts.reward
    columns |= {name: getattr(rollouts, name) for name in TRUTHS}
    for column in factor_columns(layout):
        slot, at = _place(column, layout)
        columns[column["name"]] = rollouts.values[:, slot, at]
    return columns


def _values(columns: Mapping[str, np.ndarray], manifest: Manifest, layout: Layout) -> np.ndarray:
    """The states that a table holds, float64 ``[row, entity, column]``; nan where no entity has the factor."""
    values = np.full((len(columns["step"]), len(layout.slots), layout.width), np.nan)
    for column in manifest.columns:
        slot, at = _place(column, layout)
        values[:, slot, at] = columns[column["name"]]
    return values


def _named(column: Mapping[str, str]) -> tuple[str | None, ...]:
    """A column without its unit, which says nothing about where its numbers belong."""
    return tuple(column.get(key) for key in ("name", "entity", "factor", "component"))


def _place(column: Mapping[str, str], layout: Layout) -> tuple[int, int]:
    """Slot and column of a state that a column of the table holds."""
    first = layout.columns[layout.factor(column["factor"])]
    return layout.slot_index(column["entity"]), first + (column["component"] == "y")


@dataclass(frozen=True, eq=False)
class Dataset:
    """Recorded episodes in a folder.

    Attributes:
        folder: where.
        manifest: settings, columns and hashes.
        levels: what was played.
    """

    folder: Path
    manifest: Manifest
    levels: Levels

    @classmethod
    def load(cls, folder: str | PathLike[str], world: World | None = None) -> Self:
        """The dataset in a folder.

        Args:
            world: the rules, where the levels have rules of their own, which files do not hold.

        Raises:
            SegarError: there is none, its manifest is damaged, its levels are not those that were recorded, or its
                recording did not come to an end.
        """
        folder = Path(folder)
        manifest = Manifest.read(folder)
        if len(manifest.shards) < manifest.settings.shards:
            raise SegarError(
                f"{folder} holds {len(manifest.shards)} of {manifest.settings.shards} shards: its recording was stopped;"
                " record with the same settings to complete it"
            )
        levels = Levels.load(folder / LEVELS, world)
        if (hash_of_levels(levels), len(levels)) != (manifest.settings.levels, manifest.settings.number_of_levels):
            raise SegarError(
                f"{folder / LEVELS} holds other levels than those that were recorded: the manifest has another hash of"
                f" them; {RESTORE}"
            )
        here = factor_columns(levels.layout)
        if [_named(column) for column in manifest.columns] != [_named(column) for column in here]:
            raise SegarError(f"{folder / MANIFEST}: its columns are not the factors of {LEVELS}; {RESTORE}")
        return cls(folder, manifest, levels)

    def __len__(self) -> int:
        """Number of episodes."""
        return self.manifest.settings.episodes

    def __iter__(self) -> Iterator[Shard]:
        """The shards, one in memory at a time; raises :class:`SegarError` at one that is not as the manifest says."""
        return (self.shard(number) for number in self.manifest.shards)

    def shard(self, number: int) -> Shard:
        """One shard; raises :class:`SegarError` where there is none or it is not as the manifest says."""
        if number not in self.manifest.shards:
            raise SegarError(f"{self.folder} has shards 0 to {len(self.manifest.shards) - 1}, no shard {number}")
        return read_shard(self.folder, number, self.manifest, self.levels.layout)

    def episodes(self) -> Iterator[Episode]:
        """All episodes in order."""
        for shard in self:
            yield from shard.episodes()

    def check(self) -> None:
        """Raise :class:`SegarError` unless all files are there and have the hashes that the manifest says."""
        for number, entry in self.manifest.shards.items():
            check_files(self.folder, number, entry.files)

    @property
    def rows(self) -> int:
        """Number of states."""
        return sum(entry.rows for entry in self.manifest.shards.values())

    @property
    def steps(self) -> int:
        """Number of actions."""
        return self.rows - len(self)
