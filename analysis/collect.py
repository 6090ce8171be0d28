"""``segar collect results=DIR``: makes tidy tables from the run folders of a plan.

``DIR`` is a results folder of ``segar reproduce``, whose ``plan.json`` names the runs. Written there:

``runs.parquet``           one row per finished run, see :func:`segar.analysis.collected_rows.run_row`
``transfers.parquet``      one row per run and other test set: the same figures on that test set
``levels.parquet``         one row per run, test set, action mode and level: for bootstraps over levels
``curves.parquet``         one row per run, figure and time
``probes.parquet``         the results of the probes, see :func:`segar.analysis.collected_rows.probe_rows`
``tables/<experiment>.csv``  the rows of runs and transfers that belong to an experiment
``missing.csv``            the runs and tests that are planned and not finished

Tables are replaced whole; the same runs give the same rows in the same order.
"""

import dataclasses
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pandas as pd

from segar.analysis.collected_rows import OWN, curve_rows, level_rows, probe_rows, run_row, transfer_row
from segar.analysis.distances import COMMON, count_pairs, in_one_unit, own_levels, transfer_levels
from segar.analysis.runs import shared_levels, training_sets
from segar.analysis.tables import column, keep, read_frame, select, write_csv
from segar.errors import SegarError
from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.reproduction.experiment_file import PLAN, STUDY
from segar.experiments.reproduction.grid import run_columns, varied_columns
from segar.experiments.reproduction.imported_results import RUNS, TRANSFERS
from segar.experiments.runs.files import absolute_path, read_json, replacing
from segar.experiments.runs.run_folder import (
    EVALUATIONS,
    PROBES,
    is_finished,
    of_another_agent,
    read_config,
    read_episodes,
    read_evaluation,
    read_metrics,
    read_summary,
)
from segar.experiments.settings import RunFolderError, require
from segar.support import counted

LEVELS, CURVES = "levels.parquet", "curves.parquet"
FILES = {"runs": RUNS, "transfers": TRANSFERS, "levels": LEVELS, "curves": CURVES, "probes": PROBES}  # of all tables
MOST_MISSING = 20  # runs and tests that are named one by one
TABLES, MISSING = "tables", "missing.csv"
PLAN_FORM = {
    "name": str, "scale": str, "runs": str, "elsewhere?": [str], "tracking": dict,
    "experiments": [{"name": str, "title": str, "figure": str, "study?": str, "vary?": [str],
                     "runs": [{"folder": str, "transfers": [str], "probes?": bool, "elsewhere?": bool, "whole?": bool}]}],
}  # fmt: skip
WHICH = ["family", "difficulty", "n", "algorithm", "observation", "task", "variation", "design", "seed", "run", "test"]


@dataclass(frozen=True)
class CollectConfig:
    """The results folder, and whether MLflow shows its experiments."""

    results: str  # a folder that segar reproduce made
    tracking: bool = False  # show the experiments in the store of MLflow that the plan names; it may be of others


@dataclass(frozen=True)
class Collected:
    """All tables of :data:`FILES`, and what is planned but not finished."""

    runs: pd.DataFrame
    transfers: pd.DataFrame
    levels: pd.DataFrame
    curves: pd.DataFrame
    probes: pd.DataFrame
    missing: pd.DataFrame


@dataclass
class Asked:
    """What the experiments of a plan ask of a run; each thing has the name of the first experiment that asks for it.

    Attributes:
        experiments: those that ask for the run. transfers: by their names. probes: empty where none asks for them.
    """

    experiments: list[str] = dataclasses.field(default_factory=list)
    transfers: dict[str, str] = dataclasses.field(default_factory=dict)
    probes: str = ""


def collect(config: CollectConfig) -> Collected:
    """Reads the runs, writes the tables and prints what is missing; raises :class:`RunFolderError` if there is no plan."""
    folder = absolute_path(config.results)
    plan = read_plan(folder)
    found = read_runs(plan)
    if (folder / STUDY).exists():
        found = for_study(plan, found)
    write_tables(folder, plan, found)
    runs, moved = counted(len(found.runs), "run"), counted(len(found.transfers), "transfer")
    print(f"{folder / RUNS}: {runs}; {TRANSFERS}: {moved}")
    if not found.probes.empty:
        print(f"{PROBES}: what the probes say of {counted(len(set(found.probes['run'])), 'run')}")
    print_missing(plan, found.missing, folder / MISSING)
    if config.tracking and plan["tracking"]["name"] != "none":
        from segar.analysis.experiment_runs import show_experiments

        show_experiments(folder, plan, found.runs)
    return found


def print_missing(plan: Mapping[str, Any], missing: pd.DataFrame, file: Path) -> None:
    """Prints how much of each experiment is missing, and each single run or test if there are few."""
    if len(missing) <= MOST_MISSING:
        for run, reason in pairs(missing, "run", "reason"):
            print(f"  missing: {run}: {reason}")
        return
    runs = set(missing["run"])
    for one in plan["experiments"]:
        lacking = sum(run["folder"] in runs for run in one["runs"])
        if lacking:
            print(f"  missing: {lacking} of {len(one['runs'])} runs of {one['name']}, or tests of them")
    print(f"  Each is named in {file}.")


def collect_tables(results: Path) -> None:
    """Makes the tables of a results folder: what ``segar reproduce`` calls, as the plug-in ``tables``."""
    collect(CollectConfig(str(results), tracking=True))


def read_plan(folder: Path) -> dict[str, Any]:
    """The plan that a results folder holds, with the runs ``imported`` that are taken from tables of other machines; raises
    :class:`RunFolderError` if it holds none."""
    try:
        plan = read_json(folder / PLAN, PLAN_FORM)
    except RunFolderError as error:
        raise RunFolderError(
            f"{folder} holds no {PLAN} that can be read: {error}. Name a folder that segar reproduce made: results=..."
        ) from error
    for name in (one["name"] for one in plan["experiments"]):
        require(Path(name).name == name, f"{folder / PLAN}: name", name, "one part of a path: a file is called so")
    for run in (run for one in plan["experiments"] for run in one["runs"] if run.get("elsewhere")):
        run["imported"] = run["whole"] or not is_finished(Path(plan["runs"]) / run["folder"])
    return plan


def read_runs(plan: Mapping[str, Any]) -> Collected:
    """The tables of all runs and transfers of a plan."""
    root = Path(plan["runs"])
    varied = sorted({name for one in plan["experiments"] for name in one.get("vary", ())})
    runs, transfers, missing = [], [], []
    imported = {run["folder"] for one in plan["experiments"] for run in one["runs"] if run.get("imported")}
    tables = imported_rows(plan, imported)
    transferred = set(pairs(join(tables["transfers"]), "run", "transfer"))
    probed = {run for part in tables["probes"] for run in part["run"]}
    for name, one in sorted(runs_of(plan).items()):
        folder = root / name
        if name in imported:
            lacking = {what: by for what, by in one.transfers.items() if (name, what) not in transferred}
            lacking |= {"probes": one.probes} if one.probes and name not in probed else {}
            missing += [(name, f"the imported tables lack {what}", by) for what, by in lacking.items()]
            continue
        if not is_finished(folder):
            missing.append((name, "not finished" if folder.exists() else "not begun", one.experiments[0]))
            continue
        summary = read_summary(folder, config := read_config(folder))
        place = run_columns(config, name)
        episodes = read_episodes(folder)
        place |= varied_columns(config, varied)
        if config.levels.seed != config.seed:
            place["levels.seed"] = config.levels.seed
        runs.append(run_row(folder, config, summary, episodes, place, one.experiments))
        tables["levels"].append(level_rows(episodes, {**place, "test": OWN}))
        tables["curves"].append(curve_rows(folder, place))
        if one.probes and (folder / PROBES).exists():
            tables["probes"].append(probe_rows(folder, place))
        elif one.probes:
            missing.append((name, "probes are not finished", one.probes))
        for transfer, by in one.transfers.items():
            there = folder / EVALUATIONS / transfer
            tested = read_evaluation(there)
            lacks = " is not finished" if tested is None else of_another_agent(folder, tested)
            if tested is None or lacks:
                missing.append((name, transfer + lacks, by))
                continue
            played = read_episodes(there)
            row = transfer_row(tested, played, episodes, place, transfer)
            transfers.append(row)
            tables["levels"].append(level_rows(played, {**place, "test": row["test"]}))
    tables["runs"].append(pd.DataFrame(runs))
    tables["transfers"].append(pd.DataFrame(transfers))
    order = {"runs": WHICH, "transfers": WHICH}
    joined = {name: with_level_seeds(join(parts, order.get(name, ["run"]))) for name, parts in tables.items()}
    lacking = pd.DataFrame(missing, columns=["run", "reason", "name"])
    titles = {one["name"]: one["title"] for one in plan["experiments"]}
    return Collected(**joined, missing=lacking.assign(experiment=[titles.get(name) for name in lacking["name"]]))


def for_study(plan: Mapping[str, Any], found: Collected) -> Collected:
    """The tables with what the report of a study of one's own needs beside.

    ``w2_exact_common``  of runs and transfers: exact W2 in one unit, if there are several pairs of distributions
    ``round_frames``     of runs: in so many frames every environment ends an episode
    ``episode/count``    in the curves: how many episodes the means are of
    ``level_set``        of runs, where several seeds gave the same levels: the least of these seeds
    ``levels_shared``    of runs, where level sets of a size share levels: the largest share of one that is in another

    Where level files of some runs are not here, ``w2_exact_common`` is left out and the reason printed.
    """
    root = Path(plan["runs"])
    here = [name for name in (found.runs["run"] if len(found.runs) else ()) if is_finished(root / name)]
    if not here:
        return found
    counts = [curve_rows(root / name, {"run": name}, ("episode/count",)) for name in here]
    rounds = {name: round_frames(root / name) for name in here}
    runs = with_level_sets(found.runs.assign(folder=[str(root / name) for name in found.runs["run"]]))
    runs = runs.drop(columns="folder").assign(round_frames=[rounds.get(name, np.nan) for name in runs["run"]])
    found = dataclasses.replace(found, runs=runs, curves=join([found.curves, *counts]))
    try:
        tests = [own_levels(root / run) for run in runs["run"]]
        tests += [transfer_levels(root / run, name) for run, name in pairs(found.transfers, "run", "transfer")]
        if count_pairs(tests) == 1:
            return found
        values = in_one_unit(tests)
    except SegarError as error:
        print(f"{COMMON} is left out: {error}")
        return found
    transfers = found.transfers.assign(**{COMMON: values[len(runs) :]})
    return dataclasses.replace(found, runs=runs.assign(**{COMMON: values[: len(runs)]}), transfers=transfers)


def with_level_sets(runs: pd.DataFrame) -> pd.DataFrame:
    """The rows with ``level_set`` and ``levels_shared``, where :func:`for_study` has them; ``folder`` holds the levels."""
    seeds = runs["levels.seed"].fillna(runs["seed"]) if "levels.seed" in runs else runs["seed"]
    sets, shares = training_sets(runs), [shared_levels(part) for _, part in runs.groupby(["family", "n"], dropna=False)]
    least = pd.Series(seeds).groupby(sets).transform("min").to_numpy(np.int64)
    if np.any(least != np.asarray(seeds)):
        runs = runs.assign(level_set=least)
    return runs.assign(levels_shared=max(shares)) if max(shares) > 0 else runs


def round_frames(folder: Path) -> float:
    """In how many frames every environment of a run's training ends an episode, in whole intervals between its figures: the
    number of environments times the longest episode that was seen. NaN for an algorithm that does not say how many it has."""
    environments = getattr(read_config(folder).algorithm, "num_envs", np.nan)
    metrics = read_metrics(folder).to_pandas()
    times = np.unique(column(select(metrics, name="episode/count"), "frames"))
    if not len(times) or not np.isfinite(environments):
        return float("nan")
    lengths = column(select(metrics, name="episode/length"), "value")
    longest = max(column(read_episodes(folder).to_pandas(), "length").max(), lengths.max(initial=0.0))
    every = float(np.diff(times, prepend=0).max())
    return float(np.ceil(environments * longest / every) * every)


def imported_rows(plan: Mapping[str, Any], runs: set[str]) -> dict[str, list[pd.DataFrame]]:
    """The rows of runs that the plan's imported results have, by table; each run from the first folder that has it.

    Raises:
        RunFolderError: none of the folders has one of the runs any more.
    """
    found: dict[str, list[pd.DataFrame]] = {name: [] for name in FILES}
    left, asked = set(runs), runs_of(plan)
    for folder in map(Path, plan.get("elsewhere", ())):
        tables = {name: read_frame(folder / file) for name, file in FILES.items() if (folder / file).exists()}
        here = left & set(tables["runs"]["run"]) if "runs" in tables else set()
        left -= here
        for name, table in tables.items():
            if len(table):
                found[name].append(cast(pd.DataFrame, table.loc[table["run"].isin(sorted(here))]))
        if here:
            own = found["runs"][-1]
            needed_by = [" ".join(asked[run].experiments) for run in own["run"]]
            found["runs"][-1] = own.assign(experiments=needed_by, finished=own.get("finished", ""))
    if left:
        raise RunFolderError(
            f"{min(left)} was to be found in {', '.join(plan['elsewhere']) or 'no folder'}, and is not there any more. Run "
            "segar.experiments.reproduce again: it makes a new plan"
        )
    return found


def join(parts: Sequence[pd.DataFrame], by: Sequence[str] = ("run",)) -> pd.DataFrame:
    """One table with the rows of all, sorted; empty where there are no rows."""
    there = [part for part in parts if len(part)]
    return pd.concat(there).sort_values(list(by), kind="stable", ignore_index=True) if there else pd.DataFrame()


def with_level_seeds(table: pd.DataFrame) -> pd.DataFrame:
    """The table with ``levels.seed`` in all rows, where any row has it: the seed of the run where nothing else is said."""
    if "levels.seed" not in table:
        return table
    return table.assign(**{"levels.seed": table["levels.seed"].fillna(table["seed"]).astype(np.int64)})


def runs_of(plan: Mapping[str, Any]) -> dict[str, Asked]:
    """What a plan asks of each run."""
    found: dict[str, Asked] = {}
    for experiment in plan["experiments"]:
        name = experiment["name"]
        for run in experiment["runs"]:
            one = found.setdefault(run["folder"], Asked())
            one.experiments.append(name)
            one.transfers |= {asked: name for asked in run["transfers"] if asked not in one.transfers}
            one.probes = one.probes or (name if run.get("probes", False) else "")
    return found


def write_tables(folder: Path, plan: Mapping[str, Any], found: Collected) -> None:
    """Replaces all tables of a results folder."""
    for name, file in FILES.items():
        with replacing(folder / file) as beside:
            getattr(found, name).to_parquet(beside, index=False, compression="zstd")
    for experiment in plan["experiments"]:
        if experiment["runs"]:
            write_csv(folder / TABLES / f"{experiment['name']}.csv", experiment_rows(experiment, found))
    write_csv(folder / MISSING, found.missing)


def experiment_rows(experiment: Mapping[str, Any], found: Collected) -> pd.DataFrame:
    """The rows of an experiment: its runs, and those of their transfers that belong to it."""
    wanted = {run["folder"]: set(run["transfers"]) for run in experiment["runs"]}
    runs = keep(found.runs, [run in wanted for run, _ in pairs(found.runs, "run", "run")])
    asked = [name in wanted.get(run, ()) for run, name in pairs(found.transfers, "run", "transfer")]
    parts = [part for part in (runs, keep(found.transfers, asked)) if len(part)]
    parts = [part.drop(columns=["experiments", "hours", "finished", "transfer"], errors="ignore") for part in parts]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=WHICH)


def pairs(table: pd.DataFrame, a: str, b: str) -> Iterable[tuple[str, str]]:
    """The pairs of values of two columns, one for each row; none of a table without rows."""
    return zip(table[a], table[b], strict=True) if len(table) else ()


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(collect, CollectConfig)


if __name__ == "__main__":
    main()
