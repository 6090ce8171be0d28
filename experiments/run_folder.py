"""The run folder: what a run leaves behind, and the only thing that analysis reads.

``config.yaml``           the settings; ``read_config`` makes the :class:`RunConfig` again
``levels_train.npz``      the levels that were trained on; ``levels_test.npz`` those that were tested on
``checkpoint/``           ``latest.pt``: weights, and what it takes to go on (tensors and plain data, nothing pickled)
``episodes.parquet``      one row per evaluation episode, see :data:`EPISODE_SCHEMA`
``metrics.parquet``       one row per figure and time, see :data:`METRIC_SCHEMA`
``versions.json``         libraries, commit, fingerprint of the code, content hashes of the level sets
``summary.json``          the final figures; written last, so it is there if and only if the run is finished
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import yaml

from experiments.atomic import TEMPORARY, remove_unfinished, replacing, write_text
from experiments.config import RunConfig, as_data, run_config
from experiments.errors import ConfigError, RunFolderError

CHECKOUT = Path(__file__).resolve().parent.parent

CONFIG = "config.yaml"
LEVELS_TRAIN = "levels_train.npz"
LEVELS_TEST = "levels_test.npz"
CHECKPOINT = "checkpoint/latest.pt"
EPISODES = "episodes.parquet"
METRICS = "metrics.parquet"
VERSIONS = "versions.json"
SUMMARY = "summary.json"
LOCK = ".lock"

EPISODE_SCHEMA = pa.schema(
    [
        ("levels", pa.string()),  # "train" or "test"
        ("action_mode", pa.string()),  # "deterministic" or "sampled"
        ("level", pa.int64()),  # index in the level set
        ("return", pa.float64()),  # every reward counted
        ("return_ref", pa.float64()),  # without the last reward, as the 2022 implementation reported it
        ("length", pa.int64()),  # steps
        ("success", pa.bool_()),
        ("death", pa.bool_()),
    ]
)
METRIC_SCHEMA = pa.schema(
    [
        ("name", pa.string()),  # e.g. "episode/return", "evaluation/test/success/deterministic", "w2/exact"
        ("frames", pa.int64()),  # environment steps trained so far
        ("seconds", pa.float64()),  # of training so far
        ("value", pa.float64()),
    ]
)


def runs_root(config: RunConfig) -> Path:
    """Absolute path under which run folders and MLflow's store lie."""
    return Path(config.root).expanduser().resolve() if config.root else CHECKOUT / "runs"


def folder_path(config: RunConfig) -> Path:
    """Absolute path of the run's folder."""
    return Path(config.folder).expanduser().resolve() if config.folder else runs_root(config) / config.label()


def is_finished(folder: Path) -> bool:
    """Whether a run went through there."""
    return (folder / SUMMARY).exists()


@contextmanager
def claim(config: RunConfig) -> Iterator[Path]:
    """The run's folder, made if need be, and locked against other processes inside the block.

    Raises:
        RunFolderError: it holds another run, or something else, or another process is at it.
    """
    folder = folder_path(config)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        lock = open(folder / LOCK, "a")  # noqa: SIM115 - held open, hence locked, until the block ends
    except OSError as error:
        raise RunFolderError(f"cannot use the run folder {folder}: {error.strerror}") from error
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunFolderError(f"another process is running in {folder}; wait for it, or choose folder=...") from None
        _occupy(folder, config)
        remove_unfinished(folder)
        yield folder


def _occupy(folder: Path, config: RunConfig) -> None:
    """Writes the settings into an empty folder; raises :class:`RunFolderError` if it holds another run or no run."""
    if (folder / CONFIG).exists():
        there = read_config(folder)  # also before clearing: what is not a run of ours is not ours to remove
        if config.restart:
            _clear(folder)
            write_text(folder / CONFIG, yaml.safe_dump(as_data(config), sort_keys=False))
            return
        differences = list(_differences(there.identity(), config.identity()))
        if differences:
            shown = "; ".join(differences[:3]) + ("; ..." if len(differences) > 3 else "")
            raise RunFolderError(
                f"{folder} holds another run: {shown}. Choose another folder=..., or throw that run away with restart=true"
            )
        return
    foreign = sorted(p.name for p in folder.iterdir() if p.name != LOCK and not p.name.startswith(TEMPORARY))
    if foreign:
        raise RunFolderError(
            f"{folder} holds no run but is not empty: {', '.join(foreign[:3])}. Choose another folder=..."
        )
    write_text(folder / CONFIG, yaml.safe_dump(as_data(config), sort_keys=False))


def _differences(there: Mapping[str, Any], here: Mapping[str, Any], place: str = "") -> Iterator[str]:
    """Sentences that name the settings in which two runs differ."""
    for key in sorted({*there, *here}):
        a, b = there.get(key), here.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from _differences(a, b, f"{place}{key}.")
        elif a != b:
            yield f"{place}{key} is {a!r} there and {b!r} here"


def _clear(folder: Path) -> None:
    """Removes a run's files, and nothing else."""
    names = (SUMMARY, EPISODES, METRICS, VERSIONS, LEVELS_TRAIN, LEVELS_TEST, CONFIG)  # the sign of completion first
    for name in names:
        (folder / name).unlink(missing_ok=True)
    if (folder / CHECKPOINT).exists():
        shutil.rmtree((folder / CHECKPOINT).parent)


def read_config(folder: Path) -> RunConfig:
    """The settings of the run in ``folder``; raises :class:`RunFolderError` if there are none or they are not readable."""
    path = Path(folder) / CONFIG
    try:
        data = yaml.safe_load(path.read_text())
        if not isinstance(data, Mapping):
            raise ConfigError("it holds no settings")
        return run_config(data)
    except (OSError, ValueError, yaml.YAMLError) as error:
        raise RunFolderError(f"cannot read the settings of a run from {path}: {error}") from error


def read_summary(folder: Path) -> dict[str, Any]:
    """The final figures; raises :class:`RunFolderError` if the run is not finished."""
    path = Path(folder) / SUMMARY
    if not path.exists():
        raise RunFolderError(f"the run in {folder} is not finished: there is no {SUMMARY}")
    return json.loads(path.read_text())


def read_versions(folder: Path) -> dict[str, Any]:
    """Libraries, commit, code fingerprint and level hashes of the run."""
    return json.loads((Path(folder) / VERSIONS).read_text())


def read_episodes(folder: Path) -> pa.Table:
    """The evaluation episodes, :data:`EPISODE_SCHEMA`."""
    return pq.read_table(Path(folder) / EPISODES)


def read_metrics(folder: Path) -> pa.Table:
    """The figures over time, :data:`METRIC_SCHEMA`."""
    return pq.read_table(Path(folder) / METRICS)


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> None:
    """Replaces a table by ``rows``; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        pq.write_table(pa.Table.from_pylist(list(rows), schema=schema), os.fspath(beside))


def write_json(path: Path, data: Mapping[str, Any]) -> None:
    """Replaces a JSON file by ``data``; raises :class:`RunFolderError`."""
    write_text(path, json.dumps(data, indent=2) + "\n")
