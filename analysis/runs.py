"""Any runs as one table, and what they say: means of runs that differ by their seeds alone, with intervals over level sets.

A *block* is a level set: all runs on the training levels that one ``levels.seed`` gives, whatever their number, agent or
algorithm. Results of a block are not independent, so that intervals are taken over blocks, and not over runs.
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from analysis.stats.association import labels
from analysis.stats.estimate import Estimate, mean_of_replicates
from analysis.tables import column, performance, select
from experiments.runs.run_folder import EPISODES, read_episodes, root_folder
from experiments.runs.run_rows import FINISHED, RunRow, as_columns, run_rows
from experiments.settings import ACTION_MODES, RunFolderError
from segar.cli import table as text_table
from segar.errors import SegarError, did_you_mean

SEEDS = ("seed", "levels.seed")  # settings in which repetitions differ
# The columns that say on which level set a run was trained and tested, as far as a table has them: those
# of read_runs, and behind levels.seed those of analysis.collect.
BLOCK = (
    "levels.train", "levels.test", "levels.variation", "levels.test_variation", "levels.design", "levels.test_seed",
    "levels.seed", "family", "difficulty", "variation", "design",
)  # fmt: skip
SUMMARISED = ("w2_exact", "gap_deterministic", "success_train_deterministic", "success_test_deterministic")
SHARES = ("success_", "death_")  # begin the names of figures that are shares of episodes
LEVEL_SETS, AGENTS = "level sets", "agents"  # what an interval is over


def read_runs(*folders: str | Path, sweep: str | None = None) -> pd.DataFrame:
    """One row per run, finished or not, of any sweep.

    ``run``       the name of its folder
    settings      those that tell the runs apart, and some that are always there, by their names on the command line:
                  ``levels.train``, ``levels.count``, ``levels.seed``, ``algorithm.name``, ``seed``
    ``state``     "finished", or how far the run is
    figures       e.g. ``w2_exact``, ``ks``, ``gap_deterministic``, ``success_test_sampled``, and of the task's own
                  results ``results/<name>_test_deterministic``
    ``gap_se_deterministic``, ``gap_se_sampled``  standard errors of the gaps over episodes
    ``problem``   why a run failed
    ``folder``    its path

    What a run does not have is missing (NaN or None).

    Args:
        folders: that hold run folders, or are run folders; none: runs/ of the checkout.
        sweep: only the runs with this ``tracking.sweep``.

    Raises:
        RunFolderError: a folder does not exist, or there is no such run.
    """
    places = [root_folder(str(folder)) for folder in folders] or [root_folder(None)]
    rows = [row for row in run_rows(places) if sweep in (None, row.sweep)]
    if not rows:
        which = f" of the sweep {sweep}" if sweep else ""
        raise RunFolderError(f"there is no run{which} in {', '.join(map(str, places))}")
    found = pd.DataFrame(as_columns(rows))
    errors = pd.DataFrame([_errors(row) for row in rows])
    return pd.concat([found.drop(columns=["problem", "folder"]), errors, found[["problem", "folder"]]], axis=1)


def summarise(runs: pd.DataFrame, figures: Sequence[str] = SUMMARISED, by: Sequence[str] | None = None) -> pd.DataFrame:
    """Means of figures over the finished runs of each combination of settings, with 95 % intervals over level sets.

    The columns are those of ``by``; ``figure``; ``estimate``, ``low``, ``high``, ``n`` (units that the interval is over), ``p``
    (of 0, two-sided), ``level``, ``note``; ``unit``: "level sets", or "agents" where all runs of a combination share one level
    set, whose interval then says nothing about other level sets; ``runs`` that count, and ``level_sets``.

    A level set counts once, with the mean of its runs. The interval is Student's over level sets; that of a share, such as
    success, ends at 0 and 1.

    Args:
        runs: as :func:`read_runs` gives them.
        figures: columns, or short names as of :func:`column_name`.
        by: columns to group by; None: the settings in which the runs differ, but for their seeds.

    Raises:
        SegarError: a column does not exist, or no run is finished.
    """
    done = finished(runs)
    names = [column_name(runs, name) for name in figures if figures is not SUMMARISED or name in runs]
    by = settings_varied(runs) if by is None else [column_name(runs, name) for name in by]
    rows = []
    for values, part in _groups(done, by):
        for name in names:
            mine = cast(pd.DataFrame, part[part[name].notna()])
            blocks, runs_of_block = labels(mine, blocks_of(mine)), column(mine, name)
            level_sets = sorted(set(blocks))
            unit = LEVEL_SETS if len(level_sets) > 1 else AGENTS
            means = [float(runs_of_block[blocks == one].mean()) for one in level_sets]
            units = means if unit == LEVEL_SETS else runs_of_block
            found = mean_of_replicates(units, 0.0, sides=2) if len(units) else Estimate.missing(0, "no run has it")
            if name.startswith(SHARES):
                found = dataclasses.replace(found, low=np.clip(found.low, 0, 1), high=np.clip(found.high, 0, 1))
            counts = {"unit": unit, "runs": len(mine), "level_sets": len(level_sets)}
            rows.append(found.row(**values, figure=name) | counts)
    return pd.DataFrame(rows)


def summary_text(rows: Sequence[Mapping[str, Any]]) -> str:
    """What :func:`summarise` finds, as text for a terminal, with what to know about it; ``rows`` as of
    :func:`experiments.runs.run_rows.as_columns`, of which at least one is finished."""
    runs = pd.DataFrame(rows)
    done, by = finished(runs), settings_varied(runs)
    found = summarise(runs)
    figures = list(dict.fromkeys(found["figure"]))
    lines = []
    for values, part in _groups(found, by):
        cells = {row["figure"]: _with_interval(row) for row in part.to_dict("records")}
        first = part.iloc[0]
        lines.append(
            [*values.values(), int(first["runs"]), int(first["level_sets"]), *(cells[name] for name in figures)]
        )
    head = [*by, "runs", "level sets", *(name.removesuffix("_deterministic") for name in figures)]
    return "\n".join([text_table(head, lines), *notes(runs, done, found)])


def notes(runs: pd.DataFrame, done: pd.DataFrame, found: pd.DataFrame) -> Iterator[str]:
    """Sentences about a summary: which runs are left out, and over what its intervals are."""
    if len(done) < len(runs):
        yield f"{len(runs) - len(done)} of {len(runs)} runs are not finished and do not count; their states stand above."
    lacking = found[found["runs"] == 0] if len(found) else found
    for name in dict.fromkeys(lacking["figure"]):
        yield f"Some combinations have no {name}."
    units = {unit for unit, n in zip(found["unit"], found["n"], strict=True) if n > 1}
    if LEVEL_SETS in units:
        yield "Intervals are of 95 %, over level sets: a level set counts once, with the mean of its runs."
    if AGENTS in units:
        seeds = ",".join(map(str, sorted({int(seed) for seed in done["seed"]})))
        yield (
            "Runs on one level set alone (one levels.seed) differ by their agents: these intervals are over agents, and say "
            f"nothing about other levels. Cross the seeds: --multirun seed={seeds} levels.seed={seeds}"
        )
    if 1 in set(found["n"]):
        yield "A mean of one run has no interval; sweep seed and levels.seed."


def finished(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows of finished runs; all, where a table does not say how far runs are. Raises :class:`SegarError` if none is."""
    done = select(runs, state=FINISHED) if "state" in runs else runs
    if done.empty:
        raise SegarError("no run is finished; python -m experiments.results says how far they are")
    return done


def settings_varied(runs: pd.DataFrame) -> list[str]:
    """The settings in which finished runs differ, but for their seeds: of the columns between ``run`` and ``state``."""
    names = [str(name) for name in runs.columns]
    if "state" not in names:
        raise SegarError("the table does not say which columns are settings; name those to group by")
    done = finished(runs)
    settings = names[names.index("run") + 1 : names.index("state")]
    return [name for name in settings if name not in SEEDS and len(set(map(str, done[name]))) > 1]


def blocks_of(runs: pd.DataFrame) -> list[str]:
    """The columns that say on which level set a run was trained, see :data:`BLOCK`; raises :class:`SegarError`."""
    names = [name for name in BLOCK if name in runs]
    if "levels.seed" not in runs and "seed" in runs:
        names.append("seed")  # of the tables of analysis.collect, where a run's seed is that of its levels, too
    if not names:
        raise SegarError(
            "no column says on which level set a run was trained, such as levels.seed; name them as blocks"
        )
    return names


def column_name(runs: pd.DataFrame, name: str) -> str:
    """The column that a name means: itself, ``w2`` for ``w2_exact``, ``gap`` for ``gap_deterministic``, ``count`` for
    ``levels.count``; raises :class:`SegarError` if there is none, or several."""
    known = [str(one) for one in runs.columns]
    for one in (name, f"{name}_exact", f"{name}_deterministic"):
        if one in known:
            return one
    ends = [one for one in known if one.endswith(f".{name}")]
    if len(ends) == 1:
        return ends[0]
    several = f" It could be {' or '.join(ends)}." if ends else did_you_mean(name, known)
    raise SegarError(f"the runs have no column '{name}'.{several}")


def _errors(row: RunRow) -> dict[str, float]:
    """The standard errors of a run's gaps, from its episodes."""
    if row.state != FINISHED or not (row.folder / EPISODES).exists():
        return {}
    episodes = read_episodes(row.folder).to_pandas()
    parts = {mode: select(episodes, action_mode=mode) for mode in ACTION_MODES}
    return {f"gap_se_{mode}": performance(part)["gap_se"] for mode, part in parts.items() if len(part)}


def _groups(table: pd.DataFrame, by: Sequence[str]) -> Iterator[tuple[dict[str, Any], pd.DataFrame]]:
    """The values of the columns ``by`` and the rows that have them, in order of first appearance; one group without any."""
    if not by:
        yield {}, table
        return
    keys = labels(table, by)
    for key in dict.fromkeys(keys):
        part = cast(pd.DataFrame, table[keys == key]).reset_index(drop=True)
        yield {name: part[name].iloc[0] for name in by}, part


def _with_interval(row: Mapping[str, Any]) -> str:
    if not np.isfinite(row["estimate"]):
        return "-"
    interval = f" [{row['low']:.3g}, {row['high']:.3g}]" if np.isfinite(row["low"]) else ""
    return f"{row['estimate']:.3g}{interval}"
