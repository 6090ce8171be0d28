"""Views: pages of charts over the runs in MLflow, already filtered and arranged: for any runs, and for the paper's figures.

MLflow's pages keep a view as a tag of the experiment, so that these stand in the menu "Views" of every store and have an
address. How such a tag is written is not a promise of MLflow's: this is how the versions that ``pyproject.toml`` allows do it.
"""

import base64
import json
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlencode

TAG = "mlflow.sharedViewState."  # begins the names of these tags
COLOUR = "mlflow.runColor"  # the tag that says in which colour a run is drawn
HEIGHT = 440  # [pixels] of a chart
Chart = Mapping[str, Any]

GAP = "evaluation/gap/deterministic"
SUCCESS = "evaluation/test/success/deterministic"
COUNT, PANEL = "levels.count", "levels.train"  # parameters, as the settings are called


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
    return {
        "type": "SCATTER",
        "xaxis": {"key": x, "type": x_is},
        "yaxis": {"key": y, "type": "METRIC"},
        "runsCountToCompare": 1000,
    }


def curve(metric: str) -> Chart:
    """A curve per run, against frames."""
    return {"type": "LINE", "metricKey": metric, "selectedMetricKeys": [metric]}


def parallel(parameters: tuple[str, ...], metrics: tuple[str, ...]) -> Chart:
    """A line per run through an axis for each of these, in the colour of its last metric."""
    chosen = {"selectedParams": [*parameters], "selectedMetrics": [*metrics]}
    return {"type": "PARALLEL", **chosen, "showAllRuns": True}


# MLflow writes the names of metrics beside the axes; what these are, and their units, stand in the headings.
THE_GAP = "Gap [return on test less training levels]"
AGAINST_W2 = (
    (f"{THE_GAP} against W2 [standard deviations]", (scatter("w2/exact", GAP), scatter("w2/reference", GAP))),
)
AGAINST_N = (
    (
        f"{THE_GAP} and W2 [standard deviations] against the number of levels",
        (scatter(COUNT, GAP, "PARAM"), scatter(COUNT, "w2/exact", "PARAM")),
    ),
    ("A line per run", (parallel((PANEL, COUNT), ("w2/exact", "ks", SUCCESS, GAP)),)),
)
LEARNING = (("Return and success of training episodes", (curve("episode/return"), curve("episode/success"))),)
AGAINST_KNOWLEDGE = (
    (
        f"{THE_GAP} against the accuracy of probes, and as in 2022 [share, chance 0.5]",
        (scatter("probes/accuracy/test", GAP), scatter("probes/accuracy_of_2022/test", GAP)),
    ),
)
VIEWS = {  # of every store
    "gap-against-w2": View("Gap against W2", AGAINST_W2),
    "gap-against-n": View("Gap and W2 against the number of levels", AGAINST_N),
    "learning": View("Learning", LEARNING),
}
VIEWS_OF_PAPER = {  # of stores with a reproduction, which says to which figures a run belongs
    "figure-3a": View("Figure 3a: gap against W2", AGAINST_W2, "3a"),
    "figure-3b": View("Figure 3b: gap and W2 against the number of levels", AGAINST_N, "3b"),
    "figure-4b": View("Figure 4b: gap against what the representation knows", AGAINST_KNOWLEDGE, "4b"),
    "figure-5b": View("Figure 5b: learning", LEARNING, "5b"),
}


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
        "orderByKey": f"params.`{PANEL}`",  # by anything but time: then children are not folded away under their parents
        "orderByAsc": True,
        "startTime": "ALL",
        "lifecycleFilter": "Active",
        "datasetsFilter": [],
        "modelVersionFilter": "All Runs",
        "selectedColumns": [f"tags.`{name}`" for name in ("family", "difficulty", "n", "algorithm", "seed")],
        "runsHiddenMode": "SHOW_ALL",
        "compareRunCharts": [
            {"uuid": f"{row}-{place}", "metricSectionId": f"{row}", "deleted": False, "isGenerated": False, **chart}
            for row, (_, charts) in enumerate(view.rows)
            for place, chart in enumerate(charts)
        ],
        "compareRunSections": [
            {
                "uuid": f"{row}",
                "name": heading,
                "display": True,
                "isReordered": True,
                "deleted": False,
                "isGenerated": False,
                "columns": len(charts),
                "cardHeight": HEIGHT,
            }
            for row, (heading, charts) in enumerate(view.rows)
        ],
        "isAccordionReordered": True,  # else these come after those that MLflow makes of all metrics
        "hideEmptyCharts": True,
        "groupBy": None,
    }
    written = base64.b64encode(zlib.compress(json.dumps(state).encode())).decode()
    return json.dumps({"name": view.title, "createdAt": 0, "updatedAt": 0, "state": f"deflate;{written}"})
