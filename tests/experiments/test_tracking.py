"""MLflow: a store that many processes may start at once, at one place whatever the working directory."""

import dataclasses
import os
import resource
import socket
import subprocess
import sys

import pytest

from experiments.config import RunConfig, TrackingConfig
from experiments.errors import TrackingError
from experiments.run_folder import CHECKOUT
from experiments.tracking import NoTracker, open_store, start_tracking, store_uri

START = """
import sys
from pathlib import Path
from experiments.config import RunConfig
from experiments.tracking import start_tracking

config = RunConfig(root=sys.argv[1], seed=int(sys.argv[2]))
tracker = start_tracking(config, Path(sys.argv[1]) / sys.argv[2], {"seed": sys.argv[2]})
for frames in range(5):
    tracker.log({"episode/return": -frames}, frames)
tracker.finish(finished=True)
"""


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """The folder of a store that four processes, each in its own working directory, have made at once."""
    root = tmp_path_factory.mktemp("store")
    processes = []
    for number in range(4):
        cwd = tmp_path_factory.mktemp(f"cwd{number}")
        environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
        command = [sys.executable, "-W", "ignore", "-c", START, str(root), str(number)]
        processes.append((cwd, subprocess.Popen(command, cwd=cwd, env=environment, stderr=subprocess.PIPE, text=True)))
    for cwd, process in processes:
        _, errors = process.communicate()
        assert process.returncode == 0, errors
        assert list(cwd.iterdir()) == []  # no mlflow.db nor mlruns where the user happens to be
    return root


def runs(store):
    client, experiment = open_store(TrackingConfig(), store)
    return client, client.search_runs([experiment])


def test_first_starts_side_by_side_share_one_store(store):
    _, found = runs(store)
    assert sorted(run.data.tags["seed"] for run in found) == ["0", "1", "2", "3"]
    assert {run.info.status for run in found} == {"FINISHED"}


def test_figures_arrive_with_their_frames(store):
    client, found = runs(store)
    history = client.get_metric_history(found[0].info.run_id, "episode/return")
    assert [(point.step, point.value) for point in history] == [(k, -k) for k in range(5)]
    assert found[0].data.params["algorithm.gamma"] == "0.999"


def test_artifacts_lie_beside_the_store(store):
    _, found = runs(store)
    assert found[0].info.artifact_uri.startswith((store / "mlflow-artifacts").as_uri())
    assert store_uri(TrackingConfig(), store) == f"sqlite:///{store}/mlflow.db"


def test_a_run_that_goes_on_is_the_same_run(store):
    config = RunConfig(root=str(store), seed=0)
    before = len(runs(store)[1])
    tracker = start_tracking(config, store / "0", {"seed": "0"})
    tracker.finish(finished=True)
    assert len(runs(store)[1]) == before


def test_an_artifact_is_stored_with_the_run(store, tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    tracker = start_tracking(RunConfig(root=str(store), seed=0), store / "0")
    tracker.artifact(tmp_path / "summary.json")
    tracker.finish(finished=False)
    client, found = runs(store)
    (run,) = (run for run in found if run.data.tags["run_folder"] == str(store / "0"))
    assert run.info.status == "FAILED"
    assert [file.path for file in client.list_artifacts(run.info.run_id)] == ["summary.json"]


def test_figures_are_sent_in_batches(store, monkeypatch):
    config = dataclasses.replace(RunConfig(root=str(store), seed=0), tracking=TrackingConfig(interval=1000.0))
    tracker = start_tracking(config, store / "0")
    sizes = []
    log_batch = tracker.client.log_batch

    def count(run_id, metrics=(), **more):
        sizes.append(len(metrics))
        log_batch(run_id, metrics=metrics, **more)

    monkeypatch.setattr(tracker.client, "log_batch", count)
    for frames in range(150):
        tracker.log({f"loss/{k}": 0.0 for k in range(10)}, frames)
    assert sizes == []
    tracker.finish(finished=True)
    assert sizes == [1000, 500]


def test_telemetry_is_off_and_nothing_is_asked_of_the_network(store, monkeypatch):
    for name in ("MLFLOW_DISABLE_TELEMETRY", "DO_NOT_TRACK"):
        assert os.environ[name] == "true"

    def refuse(*_, **__):
        raise AssertionError("something was asked of the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    start_tracking(RunConfig(root=str(store), seed=0), store / "0").finish(finished=True)


@pytest.mark.parametrize("uri", ["sqlite:////proc/nowhere/mlflow.db", "nonsense://here"])
def test_a_store_that_cannot_be_opened_is_told_with_the_way_out(tmp_path, uri):
    config = RunConfig(root=str(tmp_path), tracking=TrackingConfig(uri=uri))
    with pytest.raises(TrackingError, match=r"MLflow refuses: .*tracking=none runs without MLflow"):
        start_tracking(config, tmp_path / "run")


def test_a_disk_too_full_for_the_store_leaves_none_that_could_not_be_opened_later(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, before[1]))
    try:
        with pytest.raises(TrackingError, match="MLflow refuses"):
            open_store(TrackingConfig(), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not (tmp_path / "mlflow.db").exists()
    open_store(TrackingConfig(), tmp_path)


def test_a_store_that_fails_while_training_stops_nothing_and_loses_nothing(store):
    tracker = start_tracking(RunConfig(root=str(store), seed=0, tracking=TrackingConfig(interval=0.0)), store / "0")
    client, tracker.client = tracker.client, Broken()
    with pytest.warns(UserWarning, match="MLflow refuses: the disk is full"):
        tracker.log({"episode/length": 7.0}, 1)
    tracker.log({"episode/length": 8.0}, 2)  # it warns once
    with pytest.raises(TrackingError, match="MLflow refuses: the disk is full"):
        tracker.finish(finished=True)
    tracker.client = client
    tracker.finish(finished=True)
    assert [point.value for point in client.get_metric_history(tracker.run_id, "episode/length")] == [7.0, 8.0]


class Broken:
    """A client of a store that has no room."""

    def log_batch(self, *_, **__):
        raise OSError("the disk is full")


def test_without_tracking_there_is_no_store(tmp_path):
    tracker = start_tracking(RunConfig(root=str(tmp_path), tracking=TrackingConfig(name="none")), tmp_path)
    assert isinstance(tracker, NoTracker)
    tracker.finish(finished=True)
    assert list(tmp_path.iterdir()) == []
