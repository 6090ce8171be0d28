"""``python -m analysis.ship results=FOLDER to=docs/results/standard``: copies the tables that a report needs, made small.

Runs, transfers, probes, curves, what is missing, and the tables of studies. Numbers get six significant digits, curves at
most 40 points a run and figure (means of the points between). levels.parquet is not copied, because no report reads it.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from analysis.collect import CURVES, MISSING
from analysis.report.results import STUDIES, read_results
from analysis.tables import binned, column, mean_by, write_csv
from experiments.commands.hydra_app import run_simple_command
from experiments.reproduction.imported_results import RUNS, TRANSFERS
from experiments.runs.files import replacing
from experiments.runs.run_folder import PROBES

DIGITS = 6  # significant; errors of evaluation are in the third
ENOUGH = 2_000_000  # [bytes] of all tables together, beyond which a repository grows too fast
LEFT_OUT = {PROBES: ("note", "level"), RUNS: ("finished",)}  # columns that no report reads


@dataclass(frozen=True)
class ShipConfig:
    """The folder that is read, and the folder that is written."""

    results: str  # a folder that experiments.reproduce made
    to: str  # a folder for the small tables; its name up to the first dash is what the report calls the scale


def ship(config: ShipConfig) -> int:
    """Writes the small tables and returns their size in bytes; raises :class:`RunFolderError` if there are no runs."""
    source, out = (Path(path).expanduser().resolve() for path in (config.results, config.to))
    found = read_results(source)
    tables = {RUNS: found.runs, TRANSFERS: found.transfers, PROBES: found.probes, CURVES: thinned(found.curves)}
    written = []
    for name, table in tables.items():
        if len(table):
            small = rounded(table.drop(columns=[c for c in LEFT_OUT.get(name, ()) if c in table]))
            with replacing(out / name) as beside:
                small.to_parquet(beside, index=False, compression="zstd")
            written.append(out / name)
    if found.missing is not None:
        write_csv(out / MISSING, found.missing)
        written.append(out / MISSING)
    for study, parts in found.studies.items():
        for name, table in parts.items():
            path = out / STUDIES / study / f"{name}.csv"
            write_csv(path, table, DIGITS)
            written.append(path)
    size = sum(path.stat().st_size for path in written)
    much = "" if size <= ENOUGH else f", more than the {ENOUGH:,} that a repository should take for one scale"
    print(f"{len(written)} tables, {size:,} bytes{much}: {out}")
    return size


def rounded(table: pd.DataFrame) -> pd.DataFrame:
    """The table with six significant digits in every column of floats."""
    small = table.copy()
    for name in small.select_dtypes("float"):
        values = column(small, str(name))
        size = np.floor(np.log10(np.abs(values), where=values != 0, out=np.zeros_like(values)))
        scale = 10.0 ** (DIGITS - 1 - np.where(np.isfinite(size), size, 0))
        small[name] = np.where(np.isfinite(values), np.round(values * scale) / scale, values)
    return small


def thinned(curves: pd.DataFrame) -> pd.DataFrame:
    """Curves with one point per fortieth of their run, the mean of its points."""
    if curves.empty:
        return curves
    longest = curves.groupby("run")["frames"].transform("max").to_numpy(np.float64)
    frames = np.floor(binned(column(curves, "frames"), longest)).astype(np.int64)
    return mean_by(curves.assign(frames=frames), ["run", "name", "frames"], ["value"])


if __name__ == "__main__":
    run_simple_command(ship, ShipConfig, __doc__)
