"""Shards: a Parquet table of scalars and factors, and an NPZ file of the observations, row by row."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from segar.datasets.manifest import Manifest, ShardEntry, check_files, sha256
from segar.datasets.rollouts import Rollouts
from segar.errors import SegarError
from segar.language import Layout
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
        factor = self.layout.factor(name)
        first = self.layout.columns[factor]
        found = self.rollouts.values[:, :, first : first + factor.width]
        return found if factor.width == 2 else found[:, :, 0]

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
