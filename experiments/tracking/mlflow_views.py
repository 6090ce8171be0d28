"""Views: pages of charts over the runs in MLflow, already filtered and arranged: for any runs, and for the paper's figures.

MLflow's pages keep a view as a tag of the experiment, so that these stand in the menu "Views" of every store and have an
address. How such a tag is written is not a promise of MLflow's: this is how the versions that ``pyproject.toml`` allows do it.
"""

import base64
import json
import zlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import yaml

TAG = "mlflow.sharedViewState."  # begins the names of these tags
COLOUR = "mlflow.runColor"  # the tag that says in which colour a run is drawn
PAGES: Mapping[str, Any] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_bytes())
Chart = Mapping[str, Any]
View = Mapping[str, Any]  # its title, its rows of charts from top to bottom, and its figure
VIEWS: dict[str, View] = PAGES["views"]
VIEWS_OF_PAPER: dict[str, View] = PAGES["views_of_paper"]


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


def tags_of_views(views: Mapping[str, View] = VIEWS) -> dict[str, str]:
    """The tags of an experiment in which MLflow's pages find the views."""
    return {f"{TAG}{name}": packed(**view) for name, view in views.items()}


def link(address: str, experiment: str, name: str) -> str:
    """Where a browser finds a view: ``address`` is that of the server, ``experiment`` the id that MLflow has given it."""
    query = {"workflowType": "machine_learning", "compareRunsMode": "CHART", "viewStateShareKey": name}
    return f"{address}/#/experiments/{experiment}/runs?{urlencode(query)}"


def packed(title: str, rows: Sequence[Mapping[str, Any]], figure: str = "") -> str:
    """The value of the tag of a view of the runs of a figure of the paper, or of all runs.

    The search that finds them leaves out their parents, which have no family.
    """
    of_figure = f"tags.figure LIKE '%{figure}%' and " if figure else ""
    charts = [[CHARTS[kind](*of) for one in row["charts"] for kind, of in one.items()] for row in rows]
    state = {
        "searchFilter": f"{of_figure}tags.family LIKE '%'",
        **PAGES["page"],
        "compareRunCharts": [
            {"uuid": f"{row}-{place}", "metricSectionId": f"{row}", **PAGES["chart"], **chart}
            for row, some in enumerate(charts)
            for place, chart in enumerate(some)
        ],
        "compareRunSections": [
            {"uuid": f"{row}", "name": one["heading"], **PAGES["section"], "columns": len(charts[row])}
            for row, one in enumerate(rows)
        ],
    }
    written = base64.b64encode(zlib.compress(json.dumps(state).encode())).decode()
    return json.dumps({"name": title, "createdAt": 0, "updatedAt": 0, "state": f"deflate;{written}"})
