"""Views: pages of charts over the runs in MLflow, already filtered and arranged: for any runs, and for the paper's figures.

MLflow's pages keep a view as a tag of the experiment, so that these stand in the menu "Views" of every store and have an
address. How such a tag is written is not a promise of MLflow's: this is how the versions that ``pyproject.toml`` allows do it.
"""

import base64
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import yaml

TAG = "mlflow.sharedViewState."  # begins the names of these tags
COLOUR = "mlflow.runColor"  # the tag that says in which colour a run is drawn
PAGES: Mapping[str, Any] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_bytes())
Chart = Mapping[str, Any]


@dataclass(frozen=True)
class View:
    """What is shown of which runs."""

    title: str
    rows: tuple[tuple[str, tuple[Chart, ...]], ...]  # heading and charts side by side, from top to bottom
    figure: str = ""  # the runs of this figure of the paper; none: all runs

    @property
    def wanted(self) -> str:
        """The search that finds the runs; their parents, which have no family, are left out."""
        of_figure = f"tags.figure LIKE '%{self.figure}%' and " if self.figure else ""
        return f"{of_figure}tags.family LIKE '%'"


def scatter(x: str, y: str, x_is: str = "METRIC") -> Chart:
    """A point per run; what lies on x is a "METRIC" or a "PARAM"."""
    axes = {"xaxis": {"key": x, "type": x_is}, "yaxis": {"key": y, "type": "METRIC"}}
    return {"type": "SCATTER", **axes, "runsCountToCompare": 1000}


def curve(metric: str) -> Chart:
    """A curve per run, against frames."""
    return {"type": "LINE", "metricKey": metric, "selectedMetricKeys": [metric]}


def parallel(parameters: tuple[str, ...], metrics: tuple[str, ...]) -> Chart:
    """A line per run through an axis for each of these, in the colour of its last metric."""
    chosen = {"selectedParams": [*parameters], "selectedMetrics": [*metrics]}
    return {"type": "PARALLEL", **chosen, "showAllRuns": True}


CHARTS: Mapping[str, Callable[..., Chart]] = {"scatter": scatter, "curve": curve, "parallel": parallel}


def view_of(title: str, rows: Sequence[Mapping[str, Any]], figure: str = "") -> View:
    """A view as the file has it."""
    charts = [[CHARTS[kind](*of) for one in row["charts"] for kind, of in one.items()] for row in rows]
    return View(title, tuple((row["heading"], tuple(some)) for row, some in zip(rows, charts, strict=True)), figure)


VIEWS, VIEWS_OF_PAPER = (
    {name: view_of(**one) for name, one in PAGES[part].items()} for part in ("views", "views_of_paper")
)


def tags_of_views(views: Mapping[str, View] = VIEWS) -> dict[str, str]:
    """The tags of an experiment in which MLflow's pages find the views."""
    return {f"{TAG}{name}": packed(view) for name, view in views.items()}


def link(address: str, experiment: str, name: str) -> str:
    """Where a browser finds a view: ``address`` is that of the server, ``experiment`` the id that MLflow has given it."""
    query = {"workflowType": "machine_learning", "compareRunsMode": "CHART", "viewStateShareKey": name}
    return f"{address}/#/experiments/{experiment}/runs?{urlencode(query)}"


def packed(view: View) -> str:
    """The value of the tag of a view."""
    state = {
        "searchFilter": view.wanted,
        **PAGES["page"],
        "compareRunCharts": [
            {"uuid": f"{row}-{place}", "metricSectionId": f"{row}", **PAGES["chart"], **chart}
            for row, (_, charts) in enumerate(view.rows)
            for place, chart in enumerate(charts)
        ],
        "compareRunSections": [
            {"uuid": f"{row}", "name": heading, **PAGES["section"], "columns": len(charts)}
            for row, (heading, charts) in enumerate(view.rows)
        ],
    }
    written = base64.b64encode(zlib.compress(json.dumps(state).encode())).decode()
    return json.dumps({"name": view.title, "createdAt": 0, "updatedAt": 0, "state": f"deflate;{written}"})
