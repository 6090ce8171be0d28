"""Results that are imported: tables of runs that another machine made, or that ``docs/results`` ships.

A folder of such tables is one that ``segar collect`` wrote. The name of a run holds a hash of its
settings, so a row with that name describes that run. Such a run counts as done and is not trained again.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import pyarrow as pa

from segar.errors import naming
from segar.experiments.evaluation.transfers import RunTask
from segar.experiments.runs.files import read_table, typed
from segar.experiments.runs.run_folder import PROBES
from segar.experiments.settings import ConfigError

RUNS, TRANSFERS = "runs.parquet", "transfers.parquet"


@dataclass(frozen=True)
class ImportedResults:
    """The runs that imported tables describe.

    Args:
        runs: labels of the runs that have results.
        transfers: pairs of a run's label and the name of a transfer's folder.
        probed: labels of the runs whose representations were probed.
    """

    runs: frozenset[str] = frozenset()
    transfers: frozenset[tuple[str, str]] = frozenset()
    probed: frozenset[str] = frozenset()

    def has_all(self, work: RunTask) -> bool:
        """Whether the tables hold all results of this task. Where they lack some, these need the weights."""
        label = work.run.label()
        tested = all((label, one.folder_name()) in self.transfers for one in work.transfers)
        return label in self.runs and tested and (work.probes is None or label in self.probed)


def read_imported_results(folders: Sequence[Path]) -> ImportedResults:
    """The runs in the tables of ``folders``; raises :class:`ConfigError` where a table is missing or not readable."""
    runs: set[str] = set()
    transfers: set[tuple[str, str]] = set()
    probed: set[str] = set()
    for folder in folders:
        if not (folder / RUNS).exists():
            raise ConfigError(
                f"imported: {folder} holds no {RUNS}; name folders of tables, such as docs/results/quick, or the results "
                "folder of another machine"
            )
        runs.update(*columns(folder / RUNS, "run"))
        transfers.update(zip(*columns(folder / TRANSFERS, "run", "transfer"), strict=True))
        probed.update(*columns(folder / PROBES, "run"))
    return ImportedResults(frozenset(runs), frozenset(transfers), frozenset(probed))


def columns(path: Path, *names: str) -> list[list[str]]:
    """Columns of a table as lists. They are empty where the file is missing or has no columns, because it has no rows."""
    with naming("imported", ConfigError):
        table = read_table(path) if path.exists() else pa.table({})
        if table.num_columns:
            table = typed(path, table, pa.schema([(name, pa.string()) for name in names]))
        return [table[name].to_pylist() if table.num_columns else [] for name in names]
