"""Any runs as one table, and what they say: means of runs that differ by their seeds alone, with intervals over level sets.

A *block* is a level set: all runs on the training levels of one distribution that one ``levels.seed`` gives, whatever their
number, the agent, the algorithm, or the levels that the agent is tested on. Seeds that give the same levels are one block.
Results of a block are not independent, so that intervals are taken over blocks, and not over runs. Of fewer than three
blocks there is no interval.
"""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from segar.analysis.level_sets import first_of_equal, largest_share, levels_of
from segar.analysis.stats.association import keys
from segar.analysis.stats.estimate import ALIKE
from segar.analysis.stats.resampling import mean_of_units
from segar.analysis.tables import column, keep, select, write_table
from segar.cli import table as text_table
from segar.errors import SegarError, did_you_mean
from segar.experiments.reproduction.experiment_file import FEWEST_BLOCKS
from segar.experiments.runs.run_folder import root_folder
from segar.experiments.runs.run_rows import FINISHED, as_columns, chosen_rows, copies_warning, in_short
from segar.support import counted

SEEDS = ("seed", "levels.seed")  # settings in which repetitions differ
# The columns that say from which distribution, and how, training levels are taken, as far as a table has them: those of
# read_runs, then those of `segar collect`. Test levels are none of them: the same agents tested twice are no new level set.
TRAINED_ON = (
    "levels.train", "levels.variation", "levels.design", "family", "difficulty", "variation", "design",
)  # fmt: skip
# The columns that say between which distributions a distance is measured.
MEASURED_BETWEEN = (
    "levels.train", "levels.variation", "levels.test", "levels.test_variation", "family", "difficulty", "variation", "test",
)  # fmt: skip
SUMMARISED = ("w2_exact", "gap_deterministic", "success_train_deterministic", "success_test_deterministic")
SHARES = ("success_", "death_")  # begin the names of figures that are shares of episodes
LEVEL_SETS, AGENTS = "level sets", "agents"  # what an interval is over
SHARED_LEVELS = (
    "warning: the level sets share levels: up to {:.0%} of one are in another, because one file has few levels. Intervals"
    " over such level sets are too short. Take a distribution, or a file with many more levels than a level set has."
)
SAME_LEVELS = "Several levels.seed gave the same levels, such as all levels of a file: these count as one level set."


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

    What a run does not have is missing (NaN or None). A run that lies in several folders counts once, and a warning names them.

    Args:
        folders: that hold run folders, or are run folders; none: runs/ of the checkout.
        sweep: only the runs with this ``tracking.sweep``.

    Raises:
        RunFolderError: a folder does not exist, or there is no such run.
    """
    places = [root_folder(str(folder)) for folder in folders] or [root_folder(None)]
    rows = chosen_rows(places, sweep)
    if said := copies_warning(rows):
        warnings.warn(said.removeprefix("warning: "), stacklevel=2)
    return pd.DataFrame(as_columns(rows))


def summarise(runs: pd.DataFrame, figures: Sequence[str] = SUMMARISED, by: Sequence[str] | None = None) -> pd.DataFrame:
    """Means of figures over the finished runs of each combination of settings, with 95 % intervals over level sets.

    The columns are those of ``by``; ``figure``; ``estimate``, ``low``, ``high``, ``n`` (units that the interval is over), ``p``
    (of 0, two-sided), ``level``, ``note``; ``unit``: "level sets", or "agents" where all runs of a combination share one level
    set, whose interval then says nothing about other level sets; ``runs`` that count, and ``level_sets``.

    A level set counts once, with the mean of its runs. The interval is Student's over level sets; that of a share, such as
    success, ends at 0 and 1. Of fewer than three units there is none, as ``note`` says.

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
            blocks, runs_of_block = training_sets(mine), column(mine, name)
            level_sets = sorted(set(blocks))
            unit = LEVEL_SETS if len(level_sets) > 1 else AGENTS
            means = [float(runs_of_block[blocks == one].mean()) for one in level_sets]
            units = means if unit == LEVEL_SETS else runs_of_block
            ends = (0.0, 1.0) if name.startswith(SHARES) else (-np.inf, np.inf)
            found = mean_of_units(units, unit, *ends, chance=0.0)
            counts = {"unit": unit, "runs": len(mine), "level_sets": len(level_sets)}
            rows.append(found.row(**values, figure=name) | counts)
    return pd.DataFrame(rows)


def summary_text(rows: Sequence[Mapping[str, Any]], path: Path | None = None) -> str:
    """What :func:`summarise` finds, as text for a terminal, with what to know about it.

    Args:
        rows: as of :func:`segar.experiments.runs.run_rows.as_columns`; at least one is finished.
        path: a file ``.csv`` or ``.parquet``, into which the means of all figures are written, not only of those in the text.

    Raises:
        RunFolderError: the file cannot be written.
    """
    runs = pd.DataFrame(rows)
    done, by = finished(runs), settings_varied(runs)
    if path is not None:
        write_table(path, summarise(runs, numeric_figures(runs), by))
    found = summarise(runs)
    figures, shown = list(dict.fromkeys(found["figure"])), in_short(done.to_dict("records"), by)
    lines = []
    for values, part in _groups(found, by):
        cells = {row["figure"]: _with_interval(row) for row in part.to_dict("records")}
        first = part.iloc[0]
        counts = int(first["runs"]), int(first["level_sets"])
        lines.append([*(values[name] for name in shown), *counts, *(cells[name] for name in figures)])
    head = [*shown, "runs", "level sets", *(name.removesuffix("_deterministic") for name in figures)]
    return "\n".join([text_table(head, lines), *notes(runs, done, found)])


def numeric_figures(runs: pd.DataFrame) -> list[str]:
    """The columns of figures of a table of :func:`read_runs`: the numbers behind ``state`` that have a mean, which standard
    errors have not."""
    behind = runs.iloc[:, list(runs.columns).index("state") + 1 :].select_dtypes(["number", "bool"])
    return [name for name in behind if np.isfinite(column(runs, name)).any() and not name.startswith("gap_se_")]


def notes(runs: pd.DataFrame, done: pd.DataFrame, found: pd.DataFrame) -> Iterator[str]:
    """Sentences about a summary: which runs are left out, and over what its intervals are."""
    if len(done) < len(runs):
        yield f"Not finished, and not counted: {len(runs) - len(done)} of {len(runs)} runs; their states stand above."
    about_sets = list(about_level_sets(done))
    yield from about_sets
    lacking = found[found["runs"] == 0] if len(found) else found
    for name in dict.fromkeys(lacking["figure"]):
        yield f"Some combinations have no {name}."
    there = keep(found, found["n"] > 0)
    over_sets, over_agents = (select(there, unit=unit) for unit in (LEVEL_SETS, AGENTS))
    if np.isfinite(column(over_sets, "low")).any():
        yield "Intervals are of 95 %, over level sets: a level set counts once, with the mean of its runs."
    for n in sorted({int(n) for n in over_sets["n"] if n < FEWEST_BLOCKS}):
        yield f"{counted(n, 'level set')}: no interval. It takes {FEWEST_BLOCKS}; sweep levels.seed."
    if ALIKE in set(there["note"]):
        yield "Units with equal results have no interval: others need not have these results, too."
    if np.any(column(over_agents, "n") > 1):
        seeds = ",".join(map(str, sorted({int(seed) for seed in done["seed"]})))
        cross = "" if SAME_LEVELS in about_sets else f" Cross the seeds: --multirun seed={seeds} levels.seed={seeds}"
        yield (
            "Runs on one level set alone (one levels.seed) differ by their agents: their intervals are over agents, and say "
            f"nothing about other levels.{cross}"
        )
    if 1 in set(there["n"]):
        yield "A mean of one run has no interval; sweep seed and levels.seed."
    if (pairs := number_of_pairs(done)) > 1 and "w2_exact" in set(found["figure"]):
        yield (
            f"w2_exact has a unit for each of the {pairs} pairs of training and test distributions: compare it within a pair. "
            "segar.analysis.gap_plot measures all pairs in one unit."
        )


def about_level_sets(done: pd.DataFrame, by: Sequence[str] | None = None) -> Iterator[str]:
    """Sentences about seeds that gave the same levels, or levels that are in other level sets, too.

    Args:
        done: finished runs.
        by: columns; level sets of runs with equal values are compared. None: those of :func:`settings_varied`.
    """
    by = settings_varied(done) if by is None else by
    parts = [part for _, part in _groups(done, by)]
    if any(len(set(training_sets(part))) < len(set(_named_sets(part)[0])) for part in parts):
        yield SAME_LEVELS
    if (share := max(map(shared_levels, parts), default=0.0)) > 0:
        yield SHARED_LEVELS.format(share)


def finished(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows of finished runs; all, where a table does not say how far runs are. Raises :class:`SegarError` if none is."""
    done = select(runs, state=FINISHED) if "state" in runs else runs
    if done.empty:
        raise SegarError("no run is finished; segar runs says how far they are")
    return done


def settings_varied(runs: pd.DataFrame) -> list[str]:
    """The settings in which finished runs differ, but for their seeds: of the columns between ``run`` and ``state``."""
    names = [str(name) for name in runs.columns]
    if "state" not in names:
        raise SegarError("the table does not say which columns are settings; name those to group by")
    done = finished(runs)
    settings = names[names.index("run") + 1 : names.index("state")]
    return [name for name in settings if name not in SEEDS and len(set(map(str, done[name]))) > 1]


def training_sets(runs: pd.DataFrame) -> NDArray[Any]:
    """The names of the level sets that the runs were trained on, text ``[runs]``, equal for runs of one block.

    That is the distribution with its variation and design, and the seed of the levels. Smaller sets of a seed are parts of
    larger ones, and test levels make no difference. Seeds that gave the same levels of a distribution, as all levels of a
    file, are one level set, if the table has the column ``folder`` and the folders hold the levels.

    Raises:
        SegarError: no column says it, or a level file cannot be read.
    """
    names, among = _named_sets(runs)
    first = first_of_equal(levels_of(names, runs), among)
    return np.array([first[name] for name in names])


def shared_levels(runs: pd.DataFrame) -> float:
    """The largest share of a level set that lies in another one of the same file, 0 to 1; 0 where nothing is known.

    Two sets with the same levels are one, see :func:`training_sets`. Raises :class:`SegarError` as that function.
    """
    names, among = _named_sets(runs)
    return largest_share(levels_of(names, runs, of_files=True), among)


def _named_sets(runs: pd.DataFrame) -> tuple[NDArray[Any], dict[int, int]]:
    """The numbers of the level sets by their settings, ``[runs]``, and of each that of its distribution, variation, design."""
    names = [name for name in TRAINED_ON if name in runs]
    seeds = [runs[name] for name in ("levels.seed", "seed") if name in runs]
    if not names and not seeds:
        raise SegarError("no column says on which level set a run was trained, such as levels.train and levels.seed")
    taken_from = names_of(runs, names)
    if seeds:  # segar collect leaves levels.seed empty where it is the seed of the run
        first, *rest = seeds
        names, runs = [*names, "of seed"], runs.assign(**{"of seed": first.fillna(rest[0]) if rest else first})
    found = names_of(runs, names)
    return found, dict(zip(found, taken_from, strict=True))


def names_of(table: pd.DataFrame, columns: Sequence[str]) -> NDArray[Any]:
    """:func:`segar.analysis.stats.association.keys` of settings, which may have no value in some rows."""
    return keys(table.assign(**{name: [str(value) for value in table[name]] for name in columns}), columns)


def number_of_pairs(runs: pd.DataFrame) -> int:
    """Of how many pairs of training and test distributions a table has distances, as far as its columns say."""
    if "levels.test" in runs and "levels.train" in runs:  # left out, it is that of training
        runs = runs.assign(**{"levels.test": runs["levels.test"].fillna(runs["levels.train"])})
    return len(set(names_of(runs, [name for name in MEASURED_BETWEEN if name in runs])))


def column_name(runs: pd.DataFrame, name: str) -> str:
    """The column that a name means: itself, ``w2`` for exact W2 (in one unit, where the table has that), ``gap`` for
    ``gap_deterministic``, ``count`` for ``levels.count``; raises :class:`SegarError` if there is none, or several."""
    known = [str(one) for one in runs.columns]
    for one in (name, f"{name}_exact_common", f"{name}_exact", f"{name}_deterministic"):
        if one in known:
            return one
    ends = [one for one in known if one.endswith(f".{name}")]
    if len(ends) == 1:
        return ends[0]
    several = f" It could be {' or '.join(ends)}." if ends else did_you_mean(name, known)
    raise SegarError(f"the runs have no column '{name}'.{several}")


def number_column(runs: pd.DataFrame, name: str) -> str:
    """The column that a name means, as :func:`column_name`; raises :class:`SegarError` also where it holds no numbers."""
    found = column_name(runs, name)
    try:
        column(runs, found)
    except (TypeError, ValueError):
        words = list(dict.fromkeys(str(one) for one in runs[found] if not isinstance(one, int | float)))
        raise SegarError(
            f"the column {found} holds text, such as '{words[0]}', and numbers are needed; name a column of numbers"
        ) from None
    return found


def _groups(table: pd.DataFrame, by: Sequence[str]) -> Iterator[tuple[dict[str, Any], pd.DataFrame]]:
    """The values of the columns ``by`` and the rows that have them, in order of first appearance; one group without any."""
    for _, part in table.groupby(names_of(table, by), sort=False, dropna=False):
        yield {name: part[name].iloc[0] for name in by}, part.reset_index(drop=True)


def _with_interval(row: Mapping[str, Any]) -> str:
    if not np.isfinite(row["estimate"]):
        return "-"
    interval = f" [{row['low']:.3g}, {row['high']:.3g}]" if np.isfinite(row["low"]) else ""
    return f"{row['estimate']:.3g}{interval}"
