"""Experiments in MLflow: one parent run each, with its table as artifact; the training runs are the children.

A training run that several experiments share is the child of the first one; its tag ``figure`` names all figures and its
tag ``experiments`` all experiments, so that each can be searched for; its colour is its family's. A second call changes
nothing.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from segar.analysis.plotting.style import colours
from segar.analysis.tables import column
from segar.experiments.settings import TrackingConfig, construct, without_password
from segar.experiments.tracking.mlflow_store import calling, open_store, runs_with, show_views, store_uri
from segar.experiments.tracking.mlflow_sync import read_sync_state
from segar.experiments.tracking.mlflow_views import COLOUR, VIEWS_OF_PAPER

PARENT = "mlflow.parentRunId"  # MLflow's own tag, by which its pages nest runs


def show_experiments(results: Path, plan: Mapping[str, Any], runs: pd.DataFrame) -> None:
    """Makes or renews the parents, and tags the children; raises :class:`TrackingError` if the store refuses."""
    tracking, root = construct(TrackingConfig, plan["tracking"], "tracking"), Path(plan["runs"])
    client, mlflow_experiment = open_store(tracking, root)
    show_views(client, calling(client.get_experiment, mlflow_experiment), VIEWS_OF_PAPER)
    figures: dict[str, list[str]] = {}
    parents: dict[str, str] = {}
    for experiment in plan["experiments"]:
        parent = parent_of(client, mlflow_experiment, experiment, results)
        own = [run["folder"] for run in experiment["runs"]]
        for name, value in figures_of(runs, own).items():
            calling(client.log_metric, parent, name, value)
        for path in artifacts_of(results, experiment):
            calling(client.log_artifact, parent, str(path))
        calling(client.set_terminated, parent)
        for run in own:
            parents.setdefault(run, parent)
            figures.setdefault(run, []).append(experiment["figure"] or experiment["name"])
    shared = {} if runs.empty else {str(a): str(b) for a, b in zip(runs["run"], runs["experiments"], strict=True)}
    drawn = colours_of(runs)
    for run, parent in parents.items():
        mark = read_sync_state(root / run)
        if mark is None or mark.run_id is None or without_password(mark.store) != store_uri(tracking, root):
            continue
        tags = {PARENT: parent, "figure": ", ".join(figures[run]), "experiments": shared.get(run, "")}
        tags |= {COLOUR: drawn[run]} if run in drawn else {}
        for name, value in tags.items():
            calling(client.set_tag, mark.run_id, name, value)


def colours_of(runs: pd.DataFrame) -> dict[str, str]:
    """For each run the colour that its family has in the figures, too."""
    if runs.empty:
        return {}
    families = colours(map(str, runs["family"]))
    return {str(run): families[str(family)] for run, family in zip(runs["run"], runs["family"], strict=True)}


def parent_of(client: Any, mlflow_experiment: str, experiment: Mapping[str, Any], results: Path) -> str:
    """The id of the parent run of an experiment of these results; made if there is none."""
    tags = {"kind": "experiment", "experiments": experiment["name"], "results": str(results)}
    if found := runs_with(client, mlflow_experiment, **tags):
        return found[0].info.run_id
    tags |= {"figure": experiment["figure"], "title": experiment["title"]}
    made = calling(client.create_run, mlflow_experiment, run_name=f"{experiment['name']} ({results.name})", tags=tags)
    return made.info.run_id


def figures_of(runs: pd.DataFrame, own: Sequence[str]) -> dict[str, float]:
    """Means over the finished runs of an experiment, as metrics of its parent."""
    if runs.empty or not own:
        return {}
    part = runs.loc[runs["run"].isin(list(own))]
    shown = {
        "evaluation/gap/deterministic": "gap_deterministic",
        "evaluation/gap/sampled": "gap_sampled",
        "evaluation/test/success/deterministic": "success_test_deterministic",
        "ks": "ks",
        **{f"w2/{name.removeprefix('w2_')}": name for name in part.columns if name.startswith("w2_")},
    }
    means = {name: float(column(part, place).mean()) for name, place in shown.items() if len(part)}
    return {"runs": float(len(part)), **means}


def artifacts_of(results: Path, experiment: Mapping[str, Any]) -> list[Path]:
    """The table of an experiment and the files of its study, as far as they are there."""
    table = results / "tables" / f"{experiment['name']}.csv"
    study = results / "studies" / experiment["name"]
    return [path for path in (table, *sorted(study.glob("*"))) if path.is_file()]
