"""Run folders in, tidy tables out: one row per run and action mode, and the names of the runs that are missing."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from experiments.atomic import replacing
from experiments.cells import Cell, cell_of, design_hash
from experiments.config import RunConfig
from experiments.errors import RunFolderError
from experiments.run_folder import CONFIG, is_finished, read_config, read_episodes, read_metrics, read_versions

W2 = "w2/"  # begins the names of the distances among a run's metrics


@dataclass(frozen=True)
class Run:
    """A run folder whose settings could be read."""

    folder: Path
    config: RunConfig
    cell: Cell
    design: str  # what all cells of one experiment share, see experiments.cells.design_hash


@dataclass(frozen=True)
class Grid:
    """The cells that a table should have: every combination."""

    families: Sequence[str]
    difficulties: Sequence[str]
    counts: Sequence[int]
    seeds: Sequence[int]

    def cells(self) -> list[Cell]:
        """All of them, in the order of a nested loop."""
        return [Cell(*place) for place in product(self.families, self.difficulties, self.counts, self.seeds)]


@dataclass(frozen=True)
class Missing:
    """A cell without a row, and why."""

    cell: Cell
    reason: str


def find_runs(root: Path) -> tuple[list[Run], dict[Path, str]]:
    """The runs in the folders directly under ``root``, and why folders that look like runs are none."""
    runs, unreadable = [], {}
    for folder in sorted(path.parent for path in root.glob(f"*/{CONFIG}")):
        try:
            config = read_config(folder)
        except RunFolderError as error:
            unreadable[folder] = str(error)
        else:
            runs.append(Run(folder, config, cell_of(config), design_hash(config)))
    return runs, unreadable


def read_runs(runs: Iterable[Run]) -> tuple[pd.DataFrame, list[Missing]]:
    """One row per finished run and action mode, and why the other runs have none.

    Columns: the cell (``family``, ``difficulty``, ``n``, ``seed``), ``observation``, ``algorithm``, ``frames``,
    ``action_mode``, what :func:`performance` returns, ``w2_<mode>`` for each distance of the run, ``code`` (its
    fingerprint), ``design`` and ``run`` (the folder's name).
    """
    rows: list[dict[str, Any]] = []
    missing = []
    for run in runs:
        if not is_finished(run.folder):
            missing.append(Missing(run.cell, f"not finished ({run.folder.name})"))
            continue
        try:
            rows.extend(read_rows(run))
        except (OSError, KeyError, ValueError, json.JSONDecodeError) as error:  # named in the report, the others count
            missing.append(Missing(run.cell, f"not readable ({run.folder.name}): {type(error).__name__}: {error}"))
    table = pd.DataFrame(rows)
    return (table.sort_values(KEY, ignore_index=True) if rows else table), missing


KEY = ["family", "difficulty", "n", "seed", "action_mode"]


def read_rows(run: Run) -> list[dict[str, Any]]:
    """The rows of one finished run, one per action mode."""
    metrics = read_metrics(run.folder).to_pandas()
    last = metrics.groupby("name", sort=True)["value"].last()
    distances = {f"w2_{name.removeprefix(W2)}": value for name, value in last.items() if str(name).startswith(W2)}
    cell, config = run.cell, run.config
    place = {"family": cell.family, "difficulty": cell.difficulty, "n": cell.count, "seed": cell.seed}
    what = {"observation": config.observation.name, "algorithm": config.algorithm.name}
    source = {"code": read_versions(run.folder)["code"], "design": run.design, "run": run.folder.name}
    episodes = read_episodes(run.folder).to_pandas()
    return [
        {**place, **what, "frames": int(metrics["frames"].max()), "action_mode": mode}
        | performance(part)
        | {**distances, **source}
        for mode, part in episodes.groupby("action_mode", sort=True)
    ]


def performance(episodes: pd.DataFrame) -> dict[str, float]:
    """How a run did on its levels, from its evaluation episodes in one action mode.

    ``eta_train`` and ``eta_test`` (mean full return), ``gap`` = test - train, ``se_train``, ``se_test`` and ``gap_se``,
    ``success_train``, ``death_test`` and so on (shares), ``gap_ref`` (of returns without the last reward, as the 2022
    implementation counts), ``episodes_train`` and ``episodes_test``.

    All training levels are played, so ``eta_train`` errs only where episodes on one level differ; test levels are a
    sample, so ``eta_test`` errs as the mean of independent levels does.
    """
    row: dict[str, float] = {}
    reference = {}
    sampled = "sampled" in set(episodes["action_mode"])
    for levels in ("train", "test"):
        part = select(episodes, levels=levels)
        if part.empty:
            raise ValueError(f"there is no evaluation episode on {levels} levels")
        level = column(part, "level")
        eta, error = level_mean(level, column(part, "return"), fixed=levels == "train", sampled=sampled)
        row |= {f"eta_{levels}": eta, f"se_{levels}": error}
        row |= {f"{name}_{levels}": float(column(part, name).mean()) for name in ("success", "death", "length")}
        row[f"episodes_{levels}"] = len(part)
        reference[levels] = level_mean(level, column(part, "return_ref"), fixed=True, sampled=False)[0]
    row["gap"] = row["eta_test"] - row["eta_train"]
    row["gap_se"] = float(np.hypot(row["se_train"], row["se_test"]))
    row["gap_ref"] = reference["test"] - reference["train"]
    return row


def level_mean(
    level: NDArray[np.float64], returns: NDArray[np.float64], *, fixed: bool, sampled: bool
) -> tuple[float, float]:
    """Mean over levels of the mean return on each, and its standard error; ``level`` and ``returns`` are [episodes].

    Levels that are a sample: the error of a mean of independent levels, NaN for one level. Levels that are ``fixed``:
    the error that repeated episodes on a level show. Where each was played once there is nothing to see it from: with
    deterministic actions it is zero, with ``sampled`` ones the error of a sample of levels is an upper bound.
    """
    _, place, count = np.unique(level, return_inverse=True, return_counts=True)
    means = np.bincount(place, returns) / count
    if fixed and (count > 1).all():
        variance = np.bincount(place, (returns - means[place]) ** 2) / (count - 1)
        return float(means.mean()), float(np.sqrt((variance / count).sum()) / len(count))
    if fixed and not sampled:
        return float(means.mean()), 0.0
    error = means.std(ddof=1) / np.sqrt(len(means)) if len(means) > 1 else np.nan
    return float(means.mean()), float(error)


def write_csv(path: Path, table: pd.DataFrame) -> None:
    """Replaces a CSV file, and makes its folder; raises :class:`RunFolderError`."""
    with replacing(path) as beside:
        table.to_csv(beside, index=False, lineterminator="\n")


def select(table: pd.DataFrame, **equal: Any) -> pd.DataFrame:
    """The rows in which each named column has the given value, numbered anew."""
    mask = np.ones(len(table), bool)
    for name, value in equal.items():
        mask &= np.asarray(table[name] == value)
    return cast(pd.DataFrame, table[mask]).reset_index(drop=True)


def column(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """A column as float64."""
    return table[name].to_numpy(dtype=np.float64)


def missing_cells(table: pd.DataFrame, grid: Grid, known: Sequence[Missing] = ()) -> list[Missing]:
    """The cells of ``grid`` that no row has, with the reason where ``known`` has one."""
    there = set() if table.empty else {Cell(*place) for place in table[KEY[:4]].itertuples(index=False, name=None)}
    reasons = {missing.cell: missing.reason for missing in known}
    return [Missing(cell, reasons.get(cell, "no run")) for cell in grid.cells() if cell not in there]
