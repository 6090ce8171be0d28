"""Runs that another machine made, or that ``docs/results`` ships: known by their rows in tables, and not trained again.

A folder of such tables is one that ``analysis.collect`` or ``analysis.ship`` wrote. A run is its settings, whose hash is
part of its name; so what a table says of a name is about that run, whoever made it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.evaluation.transfers import RunTask
from experiments.runs.run_folder import PROBES
from experiments.settings import ConfigError

RUNS, TRANSFERS = "runs.parquet", "transfers.parquet"


@dataclass(frozen=True)
class Elsewhere:
    """What tables say of runs: by name, whose results, transfers (their folder's name) and probes are there."""

    runs: frozenset[str] = frozenset()
    transfers: frozenset[tuple[str, str]] = frozenset()
    probed: frozenset[str] = frozenset()

    def has(self, work: RunTask) -> bool:
        """Whether all of this work was done. Part of it is of no use: what is left needs the weights."""
        name = work.run.label()
        tested = all((name, one.folder_name()) in self.transfers for one in work.transfers)
        return name in self.runs and tested and (work.probes is None or name in self.probed)


def read_elsewhere(folders: Sequence[Path]) -> Elsewhere:
    """What the tables in ``folders`` say; raises :class:`ConfigError` where there are none, or they are not readable."""
    runs: set[str] = set()
    transfers: set[tuple[str, str]] = set()
    probed: set[str] = set()
    for folder in folders:
        if not (folder / RUNS).exists():
            raise ConfigError(
                f"elsewhere: {folder} holds no {RUNS}; name folders of tables, such as docs/results/quick, or the results "
                "folder of another machine"
            )
        runs.update(*columns(folder / RUNS, "run"))
        transfers.update(zip(*columns(folder / TRANSFERS, "run", "transfer"), strict=True))
        probed.update(*columns(folder / PROBES, "run"))
    return Elsewhere(frozenset(runs), frozenset(transfers), frozenset(probed))


def columns(path: Path, *names: str) -> list[list[str]]:
    """Columns of a table, each a list; empty ones where there is no file, or it has no columns because it has no rows."""
    if not path.exists():
        return [[] for _ in names]
    try:
        if not pq.read_metadata(path).num_columns:
            return [[] for _ in names]
        return [column.to_pylist() for column in pq.read_table(path, columns=list(names)).columns]
    except (OSError, pa.ArrowInvalid) as error:
        raise ConfigError(f"elsewhere: {path} cannot be read: {error}") from error
