"""Views that stores offer: they find training runs, and show what runs have."""

import base64
import json
import zlib

import pytest

from segar.experiments.dashboard import links
from segar.experiments.evaluation.probing import figures_of
from segar.experiments.runs.run_folder import read_metrics
from segar.experiments.settings import EvaluationConfig, ScaleConfig, TrackingConfig, flat
from segar.experiments.tracking.mlflow_store import open_store, show_views
from segar.experiments.tracking.mlflow_views import TAG, VIEWS, VIEWS_OF_PAPER, link, packed
from segar.experiments.training.run import run
from tests.experiments.short_runs import short_run


def state_of(tag):
    """What MLflow's pages read out of the value of a tag."""
    kind, _, written = json.loads(tag)["state"].partition(";")
    assert kind == "deflate"
    return json.loads(zlib.decompress(base64.b64decode(written)))


PROBE = {"representation": "trained", "factor": "all", "quantity": "accuracy", "levels": "test", "estimate": 0.5}


def keys_of(chart, kind):
    """The metrics (kind "METRIC") or parameters ("PARAM") that a chart draws."""
    axes = [chart[name] for name in ("xaxis", "yaxis") if name in chart]
    lists = {"METRIC": ("selectedMetrics", "selectedMetricKeys"), "PARAM": ("selectedParams",)}[kind]
    return {axis["key"] for axis in axes if axis["type"] == kind}.union(*(chart.get(name, ()) for name in lists))


def test_views_draw_nothing_but_figures_and_parameters_that_runs_have(tmp_path):
    config = short_run(
        tmp_path / "run",
        scale=ScaleConfig(frames=64 * 16),  # enough for episodes to end
        evaluation=EvaluationConfig(episodes=2, distances=("exact", "reference")),
    )
    metrics = {row["name"] for row in read_metrics(run(config).folder).to_pylist()}
    metrics |= figures_of([{**PROBE, "probe": "jsd"}, {**PROBE, "probe": "paper"}]).keys()
    views = [*VIEWS.values(), *VIEWS_OF_PAPER.values()]
    for chart in (chart for view in views for chart in state_of(packed(**view))["compareRunCharts"]):
        drawn, named = keys_of(chart, "METRIC"), keys_of(chart, "PARAM")
        assert drawn and drawn <= metrics
        assert named <= flat(config.identity()).keys()


def test_a_view_is_written_as_the_pages_read_it():
    rows = [
        {"heading": "First", "charts": [{"curve": ["a"]}, {"curve": ["b"]}]},
        {"heading": "Second", "charts": [{"curve": ["c"]}]},
    ]
    tag = packed("Both", rows, "3a")
    state = state_of(tag)
    assert json.loads(tag)["name"] == "Both"
    assert [(one["name"], one["columns"]) for one in state["compareRunSections"]] == [("First", 2), ("Second", 1)]
    place = {one["uuid"]: one["name"] for one in state["compareRunSections"]}
    drawn = [(place[one["metricSectionId"]], one["metricKey"]) for one in state["compareRunCharts"]]
    assert drawn == [("First", "a"), ("First", "b"), ("Second", "c")]
    assert len({one["uuid"] for one in state["compareRunCharts"]}) == 3
    assert state["searchFilter"] == "tags.figure LIKE '%3a%' and tags.family LIKE '%'"


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """A store with a training run of figures 3a and 4b, one of 5b, and their parent, which has all figures."""
    root = tmp_path_factory.mktemp("store")
    client, experiment = open_store(TrackingConfig(), root)
    for name, tags in {
        "one": {"family": "empty", "figure": "3a, 4b"},
        "other": {"family": "empty", "figure": "5b"},
        "parent": {"kind": "experiment", "figure": "3a"},
    }.items():
        client.create_run(experiment, run_name=name, tags=tags)
    return root


def test_a_view_of_the_paper_finds_the_training_runs_of_its_figure_and_the_others_find_all(store):
    client, experiment = open_store(TrackingConfig(), store)
    show_views(client, client.get_experiment(experiment), VIEWS_OF_PAPER)
    tags = client.get_experiment(experiment).tags
    found = {
        name: {one.info.run_name for one in client.search_runs([experiment], state_of(tags[TAG + name])["searchFilter"])}
        for name in (*VIEWS, *VIEWS_OF_PAPER)
    }  # fmt: skip
    assert found["figure-3a"] == found["figure-4b"] == {"one"}
    assert found["figure-5b"] == {"other"}
    assert found["figure-3b"] == set()
    assert all(found[name] == {"one", "other"} for name in VIEWS)


def test_a_store_from_before_gets_the_views_when_it_is_opened_or_shown(store):
    client, experiment = open_store(TrackingConfig(), store)
    client.set_experiment_tag(experiment, TAG + "learning", "an older one")
    client.delete_experiment_tag(experiment, TAG + "gap-against-n")
    for name in VIEWS_OF_PAPER:
        if TAG + name in client.get_experiment(experiment).tags:
            client.delete_experiment_tag(experiment, TAG + name)
    lines = links(store, "http://127.0.0.1:5123")
    assert lines[0] == f"  Gap against W2 (segar): {link('http://127.0.0.1:5123', experiment, 'gap-against-w2')}"
    assert len(lines) == len(VIEWS)  # none for the empty experiment that MLflow makes
    tags = client.get_experiment(experiment).tags
    assert {name: tags[TAG + name] for name in VIEWS} == {name: packed(**view) for name, view in VIEWS.items()}


def test_files_lie_beside_a_database_that_is_named_and_not_where_one_happens_to_be(tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    tracking = TrackingConfig(uri=f"sqlite:///{tmp_path / 'named.db'}")
    client, experiment = open_store(tracking, tmp_path / "root")
    assert client.get_experiment(experiment).artifact_location == (tmp_path / "root" / "mlflow-artifacts").as_uri()
