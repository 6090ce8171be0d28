"""A recorded dataset: its manifest, its levels, and its shards, checked while they are read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from segar.datasets.manifest import LEVELS, Manifest, check_files
from segar.datasets.shards import Episode, Shard, read_shard
from segar.errors import SegarError
from segar.levels import Levels
from segar.rules import World


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
    def load(cls, folder: str | PathLike[str], world: World | None = None) -> Dataset:
        """The dataset in a folder.

        Args:
            world: the rules, where the levels have rules of their own, which files do not hold.

        Raises:
            SegarError: there is none, its manifest is damaged, or its recording did not come to an end.
        """
        folder = Path(folder)
        manifest = Manifest.read(folder)
        if not manifest.is_complete:
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
