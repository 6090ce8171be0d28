"""The rows that a run or a test of it has in each table, from what lies in its folder."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from segar.analysis.tables import keep, pick, read_frame
from segar.experiments.reproduction.grid import name_with_options, varied_columns
from segar.experiments.runs.executed_code import combined
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import PROBES, read_metrics, read_versions
from segar.experiments.runs.run_rows import figures_of_run
from segar.experiments.runs.versions import computed_with
from segar.experiments.settings import RunConfig, panel_parts
from segar.levels import SEPARATOR

OWN = "own"  # the test set that a run has by itself
# The figures over time that reports draw.
CURVES_OF = ("episode/return", "episode/success", "evaluation/test/return/deterministic")
STATED = ("algorithm.encoder", "algorithm.gamma", "algorithm.reward_transform")  # settings that reports print
PROBE_DIGITS = {"estimate": 3, "low": 3, "high": 3, "entropy": 3, "p": 4}  # after the point, in the table of probes


def run_row(
    folder: Path,
    config: RunConfig,
    summary: Mapping[str, Any],
    episodes: pa.Table,
    place: Mapping[str, Any],
    experiments: Sequence[str],
) -> dict[str, Any]:
    """A row of ``runs.parquet``: the settings of a run and its results.

    ``experiments`` (joined by spaces), the place, the settings of :data:`STATED`, ``hash``, ``frames``, ``hours`` of training
    and evaluation, the figures of :func:`segar.experiments.runs.run_rows.figures_of_run`, ``finished``, and what
    :func:`software` gives.
    """
    seconds = summary["seconds"] + summary.get("evaluation_seconds", 0.0)
    ends = [entry["time"] for entry in read_journal(folder) if entry["event"] == "finished"]
    return {
        "experiments": " ".join(experiments),
        **place,
        **varied_columns(config, STATED),
        "test": OWN,
        "hash": config.hash,
        "frames": summary["frames"],
        "test_levels": config.levels.test_count,
        **figures_of_run(summary, episodes),
        "hours": seconds / 3600,
        "finished": ends[-1] if ends else "",
        **software(read_versions(folder, begun=True)),
    }


def software(versions: Mapping[str, Any]) -> dict[str, str]:
    """``code`` (fingerprint), ``commit`` (of the checkout, a + behind it if files differed; empty outside of one),
    ``libraries`` (Python and what decides results, with their versions) and ``computed_with`` (instruction set, precision,
    threads, processor) of a run's versions.json."""
    git = versions["git"]
    libraries = {"python": versions["python"], **versions["libraries"]}
    code = {name: part for name, part in versions["code"].items() if name != "levels"}  # data: each run has its own
    return {
        "code": combined(code),
        "commit": git["commit"] + ("+" if git["changed"] else "") if git else "",
        "libraries": ", ".join(f"{name} {version}" for name, version in libraries.items() if version),
        "computed_with": computed_with(versions),
    }


def transfer_row(
    summary: Mapping[str, Any], played: pa.Table, episodes: pa.Table, place: Mapping[str, Any], folder: str
) -> dict[str, Any]:
    """What an agent achieved on other levels, named ``test``, beside what it achieves on its training levels."""
    asked = summary["transfer"]
    mixture = asked.get("mixture") or {}
    family, difficulty = panel_parts(asked["panel"])
    trained = episodes.filter(pc.field("levels") == "train")
    whole = pa.concat_tables([trained, played], promote_options="default")
    return {
        **place,
        "test": asked["label"],
        "test_family": family,
        "test_difficulty": difficulty,
        "test_variation": asked["variation"],
        "test_observation": name_with_options(asked["observation"]["name"], asked["observation"]["options"]),
        "test_changed": SEPARATOR.join(mixture.get("changed", ())),
        "test_groups": SEPARATOR.join(mixture.get("groups", ())),
        "test_levels": asked["test_count"],
        "transfer": folder,
        **figures_of_run(summary, whole),
    }


def level_rows(episodes: pa.Table, place: Mapping[str, Any]) -> pd.DataFrame:
    """Means over the episodes on each level: ``return``, ``return_ref``, ``length``, ``success``, ``death``, ``episodes``."""
    table = episodes.to_pandas().assign(run=place["run"], test=place["test"])
    groups = table.groupby(["run", "test", "levels", "action_mode", "level"], sort=True, dropna=False)
    means = cast(pd.DataFrame, groups[["return", "return_ref", "length", "success", "death"]].mean())
    return means.assign(episodes=groups.size()).reset_index()


def curve_rows(folder: Path, place: Mapping[str, Any], names: Sequence[str] = CURVES_OF) -> pd.DataFrame:
    """The figures over time that are drawn: ``run``, ``name``, ``frames``, ``value``."""
    metrics = read_metrics(folder).to_pandas().assign(run=place["run"])
    return pick(keep(metrics, metrics["name"].isin(names)), ["run", "name", "frames", "value"])


def probe_rows(folder: Path, place: Mapping[str, Any]) -> pd.DataFrame:
    """The run's table of :func:`segar.analysis.probes.table.probe_run` behind the columns that say what the run is; its ``n``,
    of independent units, is called ``units`` here, where ``n`` counts training levels.

    So that the file stays small, numbers are rounded to below their errors, and the nats of single factors are left out:
    they are ``fraction`` times ``entropy``.
    """
    table = read_frame(folder / PROBES).drop(columns="run").rename(columns={"n": "units"})
    table = cast(pd.DataFrame, table.loc[(table["factor"] == "all") | (table["quantity"] != "information")])
    table = table.assign(**{name: table[name].astype("float32").round(digits) for name, digits in PROBE_DIGITS.items()})
    for k, (name, value) in enumerate(place.items()):
        table.insert(k, name, value)
    return table
