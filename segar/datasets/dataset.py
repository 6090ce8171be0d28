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

from segar.datasets.manifest import LEVELS, Manifest, ShardEntry, check_files, sha256
from segar.datasets.rollouts import Rollouts
from segar.errors import SegarError
from segar.language import Factors, Layout
from segar.levels import Levels
from segar.rules import World
from segar.support import need, replacing

INTEGERS = ("episode", "step", "level")
TRUTHS = ("terminated", "truncated", "success", "death")
ENVIRONMENT, SEED = "environment", "seed"
COMPONENTS = ("x", "y")  # of a vector


@dataclass(frozen=True)
class Episode:
    """One episode of T steps.

    Attributes:
        number: of the episode in the dataset.
        level: index of the level that was played.
        seed, environment: an environment in this place of a batch, reset with this seed, plays it again.
        actions: float32 ``(T, n)``; rewards float64 ``(T,)``; terminated, truncated, success, death bool ``(T,)``.
        observations: name -> array ``(T + 1, ...)``.
        factors: name -> float64 ``(T + 1, entities)`` or ``(T + 1, entities, 2)``; nan where an entity lacks it.
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

    def __len__(self) -> int:
        return len(self.rewards)


@dataclass(frozen=True)
class Shard:
    """A part of a dataset, as arrays; see :class:`segar.datasets.Rollouts` for what a row is.

    Attributes:
        number: of the shard.
        seed: of its environments; the episode in place k was played by environment k.
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
        for place, (first, stop) in enumerate(pairwise(starts)):
            all_rows, taken = slice(first, stop), slice(first, stop - 1)
            yield Episode(
                number=int(r.episode[first]),
                level=int(r.level[first]),
                seed=self.seed,
                environment=place,
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

    table_name, observations_name = f"shard-{number:05d}.parquet", f"shard-{number:05d}.npz"
    with replacing(folder / table_name, "the table") as beside:
        parquet.write_table(table(_table(rollouts, seed, layout)), beside, compression="zstd")
    with replacing(folder / observations_name, f"shard {number}") as beside, open(beside, "wb") as file:
        np.savez_compressed(file, **dict[str, Any](rollouts.observations))
    return ShardEntry(seed, len(rollouts), {name: sha256(folder / name) for name in (table_name, observations_name)})


def read_shard(folder: Path, number: int, manifest: Manifest, layout: Layout) -> Shard:
    """A shard, checked against the manifest.

    Raises:
        SegarError: its files are not there, have other hashes than the manifest says, or do not fit each other.
    """
    need("reading a dataset", "pyarrow")
    from pyarrow import parquet

    entry = manifest.shards[number]
    check_files(folder, number, entry.files)
    observations_name, table_name = sorted(entry.files)  # .npz, .parquet
    with np.load(folder / observations_name, allow_pickle=False) as archive:
        observations = {name: archive[name] for name in manifest.arrays}
    table: Any = parquet.read_table(folder / table_name)
    columns = {name: table[name].to_numpy() for name in table.column_names}
    if {len(column) for column in (*columns.values(), *observations.values())} != {entry.rows}:
        raise SegarError(f"shard {number} of {folder} is damaged: its files do not have {entry.rows} rows each")
    actions = [columns[name] for name in columns if name.startswith("action.")]
    rollouts = Rollouts(
        **{name: columns[name] for name in (*INTEGERS, *TRUTHS, "reward")},
        action=np.stack(actions, axis=1).astype(np.float32),
        values=_values(columns, manifest, layout),
        observations=observations,
    )
    return Shard(number, entry.seed, rollouts, layout)


def _table(rollouts: Rollouts, seed: int, layout: Layout) -> dict[str, np.ndarray]:
    """The columns of a table in their order."""
    columns = {name: getattr(rollouts, name) for name in INTEGERS}
    columns[ENVIRONMENT] = rollouts.episode - rollouts.episode[0]
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
            SegarError: there is none, its manifest is damaged, or its recording did not come to an end.
        """
        folder = Path(folder)
        manifest = Manifest.read(folder)
        if len(manifest.shards) < manifest.settings.shards:
            raise SegarError(
                f"{folder} holds {len(manifest.shards)} of {manifest.settings.shards} shards: its recording was stopped;"
                " record with the same settings to complete it"
            )
        return cls(folder, manifest, Levels.load(folder / LEVELS, world))

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
