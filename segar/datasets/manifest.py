"""The manifest of a dataset: what it is made of, which shards there are, and their hashes."""

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from segar.errors import SegarError
from segar.support import __version__, first_line, from_json, misfit, replacing

FORMAT, FORMAT_VERSION = "segar-dataset", 2  # 1 where there are no trials
MANIFEST, LEVELS = "manifest.json", "levels.npz"
LONGEST = 256 * 2**20  # [bytes] of a manifest; an entry of a shard takes 300
RESTORE = "restore it from a copy, or record into another folder"


@dataclass(frozen=True)
class Settings:
    """All that decides what a dataset holds. One that was begun can only go on with the same ones.

    Attributes:
        levels: hash of the level set; ``number_of_levels`` in it.
        kernel: hash of the compiled rules, the task and the layout of entities.
        task: its name; ``max_steps`` and ``sub_steps`` are the limits in force.
        observation, policy: in words.
        seed: of the episodes.
        episodes: how many, ``episodes_per_shard`` of them in each file but the last.
        trials: episodes in a row on each level.
    """

    levels: str
    number_of_levels: int
    kernel: str
    task: str
    max_steps: int
    sub_steps: int
    observation: str
    policy: str
    seed: int
    episodes: int
    episodes_per_shard: int
    trials: int = 1

    @property
    def shards(self) -> int:
        """How many there shall be."""
        return math.ceil(self.episodes / self.episodes_per_shard)

    def episodes_of(self, shard: int) -> range:
        """The numbers of the episodes in a shard."""
        first = shard * self.episodes_per_shard
        return range(first, min(first + self.episodes_per_shard, self.episodes))


SMALLEST = {
    "number_of_levels": 1, "max_steps": 1, "sub_steps": 1, "seed": 0, "episodes": 1, "episodes_per_shard": 1,
    "trials": 1,
}  # fmt: skip
FORM = {
    "settings": {f"{one.name}{'' if one.default is MISSING else '?'}": one.type for one in fields(Settings)},
    "columns": [{str: str}],
    "arrays": {str: {"shape": [int], "dtype": str}},
    "shards": {str: {"seed": int, "rows": int, "files": {str: str}}},
}
"""The form of a manifest; see :func:`segar.support.misfit`."""
DTYPES = [str(np.dtype(code)) for code in np.typecodes["AllInteger"] + "efd?"]
"""Dtypes of observations."""


@dataclass(frozen=True)
class ShardEntry:
    """A shard that is written: its seed, its rows, and name -> SHA-256 of its files."""

    seed: int
    rows: int
    files: dict[str, str]


@dataclass(frozen=True)
class Manifest:
    """What a dataset is.

    Attributes:
        settings: see :class:`Settings`.
        columns: of the tables, in order: name, entity, factor, component ('', 'x' or 'y') and unit of each factor.
        arrays: name -> shape and type of the observation's arrays, without the axis of the rows.
        shards: number of the shard -> entry.
        version: of SEGAR, when the dataset was begun.
    """

    settings: Settings
    columns: list[dict[str, str]]
    arrays: dict[str, dict[str, Any]]
    shards: dict[int, ShardEntry] = field(default_factory=dict)
    version: str = __version__

    def with_shard(self, number: int, entry: ShardEntry) -> Self:
        return replace(self, shards=dict(sorted({**self.shards, number: entry}.items())))

    def write(self, folder: Path) -> None:
        """Replace the manifest in a folder; raises :class:`SegarError`."""
        several = self.settings.trials > 1
        content = {"format": FORMAT, "format_version": FORMAT_VERSION if several else 1, **asdict(self)}
        if not several:
            del content["settings"]["trials"]
        with replacing(folder / MANIFEST, "the manifest") as beside:
            beside.write_text(json.dumps(content, indent=1) + "\n")

    @classmethod
    def read(cls, folder: Path) -> Self:
        """The manifest in a folder.

        Raises:
            SegarError: there is none, it is damaged, names files that are not a dataset's, or a newer SEGAR wrote it.
        """
        path = folder / MANIFEST
        if not path.is_file():
            raise SegarError(f"{folder} holds no dataset: there is no {MANIFEST}")
        if path.stat().st_size > LONGEST:
            raise SegarError(f"{path} is no manifest: it is longer than {LONGEST:,} bytes")
        try:
            content = from_json(path.read_bytes())
        except (ValueError, OSError) as cause:
            raise SegarError(f"{path} is damaged: it is no JSON ({first_line(cause)}); {RESTORE}") from cause
        wrong = misfit(content, {"format": str})
        if wrong is None and content["format"] != FORMAT:
            raise SegarError(f"{path} is not the manifest of a dataset but of a {content['format']}")
        wrong = wrong or misfit(content, {"format_version": int, "version": str})
        if wrong is None and content["format_version"] > FORMAT_VERSION:
            raise SegarError(
                f"{path} was written by a newer SEGAR ({content['version']}); this one cannot read format"
                f" {content['format_version']}"
            )
        wrong = wrong or misfit(content, FORM) or _wrong_number(content)
        if wrong:
            raise SegarError(f"{path} is damaged: {wrong}; {RESTORE}")
        settings = _settings(content)
        shards = {
            int(number): ShardEntry(entry["seed"], entry["rows"], entry["files"])
            for number, entry in content["shards"].items()
        }
        return cls(settings, content["columns"], content["arrays"], shards, content["version"])


def shard_files(number: int) -> tuple[str, str]:
    """The names of a shard's files: the table, and the observations."""
    return f"shard-{number:05d}.parquet", f"shard-{number:05d}.npz"


def _settings(content: Mapping[str, Any]) -> Settings:
    """The settings in a manifest that has its form."""
    given = content["settings"]
    return Settings(**{one.name: given[one.name] for one in fields(Settings) if one.name in given})


def _wrong_number(content: Mapping[str, Any]) -> str | None:
    """What is wrong with the numbers and names of a manifest that has its form."""
    settings = content["settings"]
    for name, least in SMALLEST.items():
        if settings.get(name, least) < least:
            return f"'settings.{name}' is {settings[name]} and must be at least {least}"
    shards = _settings(content).shards
    for name, described in content["arrays"].items():
        if described["dtype"] not in DTYPES or min(described["shape"], default=0) < 0:
            return f"'arrays.{name}' is {described['dtype']} of shape {described['shape']}, which no observation is"
    for number, entry in content["shards"].items():
        if not number.isascii() or not number.isdecimal() or str(int(number)) != number or int(number) >= shards:
            return f"it names a shard '{number[:20]}', and has the shards 0 to {shards - 1}"
        if set(entry["files"]) != set(shard_files(int(number))):
            return f"shard {number} must have the files {' and '.join(shard_files(int(number)))}, and no others"
        if entry["rows"] < 1 or entry["seed"] < 0:
            return f"shard {number} has {entry['rows']} rows and the seed {entry['seed']}"
    return None


def check_same_settings(begun: Manifest, wanted: Settings, folder: Path) -> None:
    """Raise :class:`SegarError` that names each setting in which a dataset that was begun differs from ``wanted``."""
    old, new = asdict(begun.settings), asdict(wanted)
    differing = [f"{name} ({old[name]!r} there, {new[name]!r} asked for)" for name in old if old[name] != new[name]]
    if differing:
        by_version = (
            f". The kernel changes with rules, task and code; this folder was begun by SEGAR {begun.version}, and"
            " Dataset.load reads it once it is complete"
        )
        raise SegarError(
            f"{folder} holds a dataset with other settings: {'; '.join(differing)}. Ask for the same ones, or record into"
            f" another folder{by_version if old['kernel'] != new['kernel'] else ''}"
        )


def sha256(path: Path) -> str:
    """SHA-256 of a file, in hexadecimal digits."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check_files(folder: Path, number: int, files: Mapping[str, str]) -> None:
    """Raise :class:`SegarError` unless the files of a shard are there and have these hashes."""
    for name, expected in files.items():
        path = folder / name
        if not path.is_file():
            raise SegarError(
                f"shard {number} of {folder} is incomplete: there is no {name}; record again to restore it"
            )
        if sha256(path) != expected:
            raise SegarError(
                f"shard {number} of {folder} is damaged: {name} has another hash; record again to restore it"
            )
