"""MLflow: a store that many processes may start at once, and that may go away without stopping or losing anything."""

import contextlib
import dataclasses
import json
import os
import resource
import socket
import sqlite3
import subprocess
import sys
import threading

import pytest
from filelock import FileLock
from mlflow.entities import ViewType

from segar.experiments.runs.executed_code import executed_code
from segar.experiments.runs.run_folder import METRICS, SYNC_STATE, read_metrics, read_played, read_versions, write_json
from segar.experiments.settings import LevelsConfig, RunConfig, RunFolderError, TrackingConfig, TrackingError
from segar.experiments.tracking import mlflow_store, mlflow_sync
from segar.experiments.tracking.mlflow_store import open_store, store_uri
from segar.experiments.tracking.tracker import Tracker, start_tracking
from segar.experiments.training import run as run_module
from segar.experiments.training.run import run
from segar.experiments.upload import upload
from segar.support import WORKSPACE
from tests.experiments.short_runs import Killed, before_iteration, run_killed, same_results, short_run, stop
from tests.experiments.tracking.mlflow_server import has_each_figure_once
from tests.experiments.tracking.started_run import start
from tests.synthetic_runs import settings, write_run
from tests.waiting import until


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    """The folder of a store that two processes, each in its own working directory, have made at once."""
    root, *places = (tmp_path_factory.mktemp(name) for name in ("store", "here", "there"))
    here = "import sys, mlflow; from tests.experiments.tracking.started_run import start; print(flush=True)"
    code = f"{here}; sys.stdin.read(); start({str(root)!r}, 1)"
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    command = [sys.executable, "-W", "ignore", "-c", code]
    environment = {**os.environ, "PYTHONPATH": str(WORKSPACE)}
    with subprocess.Popen(command, cwd=places[1], env=environment, text=True, **pipes) as other:
        other.stdout.readline()  # it has imported all
        other.stdin.close()
        with contextlib.chdir(places[0]):
            start(str(root), 0)
        errors = other.stderr.read()
    assert other.returncode == 0 and "figures are left" not in errors, errors
    assert [[*place.iterdir()] for place in places] == [[], []]  # no mlflow.db nor mlruns where the user happens to be
    return root


def runs(store):
    client, experiment = open_store(TrackingConfig(), store)
    return client, client.search_runs([experiment])


def run_in(store, folder):
    client, found = runs(store)
    (one,) = (run for run in found if run.data.tags["run_folder"] == str(folder))
    return client, one


def rows(*values):
    return [
        {"name": "episode/length", "frames": k, "seconds": k / 10, "value": value} for k, value in enumerate(values)
    ]


def test_first_starts_side_by_side_share_one_store_with_the_frames_and_times_of_all_figures(store):
    client, found = runs(store)
    assert sorted((run.data.tags["seed"], run.info.status) for run in found) == [("0", "FINISHED"), ("1", "FINISHED")]
    _, one = run_in(store, store / "0")
    history = client.get_metric_history(one.info.run_id, "episode/return")
    assert [(point.step, point.value) for point in history] == [(k, -k) for k in range(5)]
    assert [point.timestamp - one.info.start_time for point in history] == [0, 500, 1000, 1500, 2000]
    assert one.data.params["algorithm.gamma"] == "0.999"


def test_a_run_that_goes_on_is_the_same_run_and_sends_nothing_twice_and_its_files_lie_beside_the_store(store, tmp_path):
    (tmp_path / "summary.json").write_text("{}")
    sent = rows(7.0, 8.0, 9.0)
    for part, status in ((sent[:2], "KILLED"), (sent, "FINISHED")):
        tracker = start_tracking(RunConfig(root=str(store), seed=5), store / "5", part)
        tracker.finish(status, [tmp_path / "summary.json"] * (status == "FINISHED"))
    client, one = run_in(store, store / "5")
    assert one.info.status == "FINISHED"
    assert [file.path for file in client.list_artifacts(one.info.run_id)] == ["summary.json"]
    assert one.info.artifact_uri.startswith((store / "mlflow-artifacts").as_uri())
    assert store_uri(TrackingConfig(), store) == f"sqlite:///{store}/mlflow.db"
    assert [point.value for point in client.get_metric_history(one.info.run_id, "episode/length")] == [7.0, 8.0, 9.0]


@pytest.mark.parametrize(("seed", "how"), [(1, {"restart": True}), (2, {"stale": "anew"})], ids=["restart", "anew"])
def test_a_run_that_is_trained_again_replaces_the_earlier_one(store, tmp_path, monkeypatch, seed, how):
    levels = LevelsConfig(
        "empty-easy", count=2, test_count=3, seed=seed, test_seed=seed
    )  # of which a store has each once
    config = short_run(tmp_path / "run", root=str(store), tracking=TrackingConfig(), levels=levels)
    run(config)
    if "stale" in how:
        other = lambda config: {**executed_code(config), "learner": "another"}  # noqa: E731
        monkeypatch.setattr(run_module, "executed_code", other)
    assert run(dataclasses.replace(config, **how)).trained
    client, one = run_in(store, tmp_path / "run")  # the only one
    assert one.info.status == "FINISHED"
    deleted = client.search_runs([one.info.experiment_id], run_view_type=ViewType.DELETED_ONLY)
    of_folder = [run.data.tags for run in deleted if run.data.tags["run_folder"] == str(tmp_path / "run")]
    assert [tags["config_hash"] for tags in of_folder] == [one.data.tags["config_hash"]]
    made, tags = read_versions(tmp_path / "run"), one.data.tags
    assert (tags["mlflow.source.name"], tags["mlflow.source.type"]) == ("segar.experiments.train", "LOCAL") and tags[
        "mlflow.user"
    ]
    assert tags["mlflow.source.git.commit"] == made["git"]["commit"]
    inputs = {tag.value: one_of.dataset for one_of in one.inputs.dataset_inputs for tag in one_of.tags}
    assert {which: found.digest for which, found in inputs.items()} == made["levels"]
    assert inputs["train"].name == "empty-easy" and json.loads(inputs["test"].source)["uri"] == str(tmp_path / "run")


def test_a_folder_of_runs_that_moved_gets_its_store_anew_where_it_is(tmp_path):
    config = short_run(tmp_path, root=str(tmp_path / "runs"), tracking=TrackingConfig())
    folder = run(dataclasses.replace(config, folder=None)).folder
    moved = (tmp_path / "runs").rename(tmp_path / "moved")
    (moved / "mlflow.db").unlink()
    upload(root=str(moved))
    _, one = run_in(moved, moved / folder.name)
    assert one.info.artifact_uri.startswith((moved / "mlflow-artifacts").as_uri()) and not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_a_run_of_another_store_is_not_deleted_when_it_is_trained_again(tmp_path):
    config = short_run(tmp_path / "run", root=str(tmp_path), tracking=TrackingConfig())
    run(config)
    elsewhere = TrackingConfig(uri=f"sqlite:///{tmp_path}/other.db")
    run(dataclasses.replace(config, restart=True, tracking=elsewhere))
    assert len(runs(tmp_path)[1]) == 1


def test_a_mark_that_was_not_written_leads_to_no_second_run_and_no_second_point(store):
    config = RunConfig(root=str(store), seed=6)
    tracker = start_tracking(config, store / "6", rows(7.0))
    tracker.finish("FAILED")
    before = (store / "6" / SYNC_STATE).read_text()
    (store / "6" / SYNC_STATE).write_text(
        json.dumps({**json.loads(before), "run_id": None, "sent": 0})
    )  # killed in between
    tracker = start_tracking(config, store / "6", rows(7.0))
    tracker.finish("FINISHED")
    client, one = run_in(store, store / "6")
    assert [point.value for point in client.get_metric_history(one.info.run_id, "episode/length")] == [7.0]


@pytest.mark.parametrize("moment", ["in training", "before the summary"])
def test_a_run_that_lost_figures_which_it_had_sent_has_each_once(store, tmp_path, monkeypatch, moment):
    levels = LevelsConfig("empty-easy", count="endless", test_count=3)
    config = short_run(
        tmp_path / "run", root=str(store), tracking=TrackingConfig(), checkpoint_interval=1000.0, levels=levels
    )
    if moment == "in training":
        run_killed(config, 3)
    else:
        with monkeypatch.context() as patch, pytest.raises(Killed):
            patch.setattr(run_module, "write_json", stop)
            run(config)
    run(config)
    whole = run(short_run(tmp_path / "whole", levels=levels)).folder
    assert same_results(tmp_path / "run", whole) and read_played(tmp_path / "run").equals(read_played(whole))
    client, one = run_in(store, tmp_path / "run")
    assert has_each_figure_once(client, one.info.run_id, tmp_path / "run")


def test_a_run_that_is_killed_while_the_store_takes_figures_which_it_loses_has_each_once(store, monkeypatch):
    config, folder = RunConfig(root=str(store), seed=8, tracking=TrackingConfig(interval=1000.0)), store / "8"
    sync = mlflow_sync.RunSync(config, folder)
    sync.send(rows(7.0), [], "RUNNING")
    log_batch = sync.client.log_batch
    monkeypatch.setattr(sync.client, "log_batch", lambda *args, **more: stop(log_batch(*args, **more)))
    with pytest.raises(Killed):
        sync.send(rows(7.0, 8.0, 9.0), [], "RUNNING")
    start_tracking(config, folder, rows(7.0)).finish("FINISHED")
    client, one = run_in(store, folder)
    assert [point.value for point in client.get_metric_history(one.info.run_id, "episode/length")] == [7.0]


def test_figures_are_sent_in_batches(store, monkeypatch):
    config, sent = RunConfig(root=str(store), seed=7, tracking=TrackingConfig(interval=1000.0)), []
    tracker = start_tracking(config, store / "7", sent)
    sizes = []
    log_batch = tracker.sync.client.log_batch

    def count(run_id, metrics=(), **more):
        sizes.append(len(metrics))
        log_batch(run_id, metrics=metrics, **more)

    monkeypatch.setattr(tracker.sync.client, "log_batch", count)
    sent += rows(*range(1500))
    assert sizes == []
    tracker.finish("FINISHED")
    assert sizes == [1000, 500]


def test_telemetry_is_off_and_nothing_is_asked_of_the_network(store, monkeypatch):
    for name in ("MLFLOW_DISABLE_TELEMETRY", "DO_NOT_TRACK"):
        assert os.environ[name] == "true"

    def refuse(*_, **__):
        raise AssertionError("something was asked of the network")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    tracker = start_tracking(RunConfig(root=str(store), seed=8), store / "8", [])
    tracker.finish("FINISHED")
    assert not tracker.missed


@pytest.mark.parametrize(
    "uri", ["sqlite:////proc/nowhere/mlflow.db", "nonsense://here", "sqlite:////proc", f"sqlite:///{__file__}", "newer"]
)
def test_a_store_that_cannot_be_opened_is_told_at_once_with_the_way_out(tmp_path, uri, monkeypatch):
    monkeypatch.setattr("time.sleep", None)  # MLflow waits longer and longer between ten attempts
    if uri == "newer":
        uri = f"sqlite:///{tmp_path}/newer.db"
        with sqlite3.connect(tmp_path / "newer.db") as database:
            database.execute("CREATE TABLE alembic_version AS SELECT 'of-next-year' AS version_num")
    config = RunConfig(root=str(tmp_path), tracking=TrackingConfig(uri=uri))
    with pytest.raises(TrackingError, match=r"MLflow refuses: .*tracking=none runs without MLflow"):
        start_tracking(config, tmp_path / "run", [])


def test_a_database_whose_driver_is_missing_ends_no_run_and_it_says_what_is_left(tmp_path, capfd):
    tracking = TrackingConfig(uri="mysql+mysqlconnector://nobody@127.0.0.1:1/x")
    folder = run(short_run(tmp_path / "run", root=str(tmp_path), tracking=tracking)).folder
    said = capfd.readouterr().err
    assert f"this sends them: segar upload run={folder}" in said and "Traceback" not in said
    with pytest.raises(TrackingError, match="MLflow refuses: No module named 'mysql'"):
        open_store(tracking, tmp_path)


def test_a_folder_with_quotation_marks_in_its_name_is_found_again(tmp_path):
    root = tmp_path / 'it\'s "mine"'
    for restart in (False, True):
        folder = run(short_run(root / "run", root=str(root), tracking=TrackingConfig(), restart=restart)).folder
    _, one = run_in(root, folder)
    assert one.info.status == "FINISHED"


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


def test_without_tracking_there_is_no_store(tmp_path):
    tracker = start_tracking(RunConfig(root=str(tmp_path), tracking=TrackingConfig(name="none")), tmp_path, [])
    assert type(tracker) is Tracker
    tracker.finish("FINISHED")
    assert list(tmp_path.iterdir()) == []


class Server:
    """Stands for a tracking server, and for MLflow's client of it: answers while it is up, and keeps what it is told."""

    def __init__(self):
        self.up, self.calls, self.points, self.files, self.status = True, 0, [], [], None

    def open(self, tracking, root):
        self.answer()
        return self, "0"

    def answer(self):
        self.calls += 1
        if not self.up:
            raise TrackingError("MLflow refuses: nobody is there")

    def search_runs(self, *_, **__):
        return []

    def create_run(self, *_, **__):
        self.answer()
        return type("Run", (), {"info": type("Info", (), {"run_id": "7"})})

    def log_batch(self, run_id, metrics=(), **_):
        self.answer()
        self.points += [(one.key, one.step, one.value) for one in metrics]

    def log_inputs(self, *_):
        self.answer()

    def log_artifact(self, run_id, path):
        self.answer()
        self.files.append(os.path.basename(path))

    def update_run(self, run_id, status):
        self.answer()
        self.status = status

    set_terminated = update_run


@pytest.fixture
def server(monkeypatch):
    server = Server()
    monkeypatch.setattr(mlflow_sync, "open_store", server.open)
    return server


REMOTE = TrackingConfig(uri="http://127.0.0.1:9", interval=0.0)


def points(folder):
    return [(row["name"], row["frames"], row["value"]) for row in read_metrics(folder).to_pylist()]


def test_a_server_that_goes_away_and_comes_back_misses_nothing(tmp_path, server, capfd):
    def go(_):
        server.up, server.calls = False, 0

    def miss(_):
        until(lambda: server.calls > 1)

    def come(_):
        server.up = True

    events = zip((2, 3, 4), (go, miss, come), strict=True)
    with contextlib.ExitStack() as stack:
        for number, happens in events:
            stack.enter_context(before_iteration(number, happens))
        folder = run(short_run(tmp_path / "run", tracking=REMOTE)).folder
    assert server.points == points(folder)
    assert (sorted(server.files), server.status) == (["episodes.parquet", "summary.json"], "FINISHED")
    said = capfd.readouterr().err
    assert (
        said.count("MLflow refuses: nobody is there. The run goes on; what MLflow misses is sent when it answers") == 1
    )
    assert said.count("MLflow at http://127.0.0.1:9 answers again, and has all figures") == 1


def test_an_upload_that_finds_no_runs_says_where_it_looked(tmp_path):
    with pytest.raises(RunFolderError, match=f"there are no run folders in {tmp_path}; name one by run=FOLDER"):
        upload(root=str(tmp_path))


def test_a_server_that_is_never_there_stops_nothing_and_gets_all_by_a_command_later(tmp_path, server, capfd):
    server.up = False
    folder = run(short_run(tmp_path / "runs" / "one", tracking=REMOTE)).folder
    assert f"this sends them: segar upload run={folder} uri={REMOTE.uri}\n" in capfd.readouterr().err
    with pytest.raises(TrackingError, match="nobody is there"):
        upload(run=str(folder), uri=REMOTE.uri)
    server.up = True
    upload(root=str(tmp_path / "runs"), uri=REMOTE.uri)
    assert server.points == points(folder)
    assert server.status == "FINISHED"
    assert capfd.readouterr().out == f"one: sent {len(points(folder))} figures to http://127.0.0.1:9\n"
    upload(root=str(tmp_path / "runs"), uri=REMOTE.uri)
    assert capfd.readouterr().out == "one: MLflow has all of it\n"
    assert len(server.points) == len(points(folder))


@pytest.mark.usefixtures("finished")
def test_an_upload_of_many_names_those_that_fail_and_sends_the_others(tmp_path, server, capfd):
    spoiled = write_run(settings(tmp_path, folder=str(tmp_path / "spoiled"), seed=1))
    (spoiled / METRICS).write_bytes(b"not a table")
    with pytest.raises(TrackingError, match="1 of 2 runs could not be sent"):
        upload(root=str(tmp_path), uri=REMOTE.uri)
    sent, left = capfd.readouterr().out.splitlines()
    assert sent.startswith("run: sent ") and "metrics.parquet" in left
    assert server.status == "FINISHED"


@pytest.mark.parametrize(
    "named",
    [{"uri": "http://evil.example:80"}, {"uri": "sqlite:////elsewhere/of_mine.db"}, {"uri": None, "root": "elsewhere"}],
)
def test_a_folder_of_others_does_not_choose_where_it_is_sent_to(tmp_path, server, named):
    """Neither an address, nor a file beside which the store of its root would lie; what is named is made by nobody."""
    config = settings(tmp_path / "theirs")
    tracking, root = TrackingConfig(uri=named["uri"]), str(tmp_path / named.get("root", "theirs"))
    folder = tmp_path / "theirs" / "run"
    write_run(dataclasses.replace(config, folder=str(folder), root=root, tracking=tracking))
    for asked in ({"run": str(folder)}, {"root": str(tmp_path / "theirs")}):
        with pytest.raises(TrackingError, match=r"names the store|could not be sent"):
            upload(**asked)
    assert server.points == [] and not (tmp_path / "elsewhere").exists()


def test_another_store_gets_the_whole_run(tmp_path, server):
    folder = write_run(settings(tmp_path, tracking=REMOTE))
    for uri in (REMOTE.uri, "http://elsewhere:5000"):
        server.points = []
        upload(run=str(folder), uri=uri)
        assert server.points == points(folder)


def test_a_store_that_another_process_opens_ends_no_run_and_gets_all_when_it_is_free(tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(mlflow_store, "LONGEST_OPENING", 0.1)
    config = short_run(tmp_path / "run", root=str(tmp_path), tracking=TrackingConfig(interval=0.0))
    with FileLock(tmp_path / ".mlflow.lock"):
        folder = run(config).folder
    assert "this sends them: segar upload" in capfd.readouterr().err
    upload(run=str(folder))
    _, one = run_in(tmp_path, folder)
    assert one.info.status == "FINISHED"


@pytest.mark.slow
def test_a_locked_database_ends_no_run_and_gets_all_when_it_is_free(tmp_path, capfd):
    open_store(TrackingConfig(), tmp_path)
    other = sqlite3.connect(tmp_path / "mlflow.db", isolation_level=None)
    other.execute("BEGIN EXCLUSIVE")
    folder = run(short_run(tmp_path / "run", root=str(tmp_path), tracking=TrackingConfig(interval=0.0))).folder
    other.execute("ROLLBACK")
    other.close()
    said = capfd.readouterr().err
    assert "has not got all of this run" in said and "Traceback" not in said
    until(lambda: all(thread.name != "tracking" for thread in threading.enumerate()))  # its last attempt
    upload(run=str(folder))
    _, one = run_in(tmp_path, folder)
    assert one.info.status == "FINISHED"


def test_the_password_of_a_server_stands_in_no_file_nor_message_and_a_run_goes_on_without_it(tmp_path, server, capfd):
    server.up = False
    tracking = TrackingConfig(uri="http://me:s3cret@127.0.0.1:9", interval=0.0)
    run_killed(short_run(tmp_path / "run", tracking=tracking), 2)
    server.up = True
    folder = run(short_run(tmp_path / "run", tracking=tracking)).folder
    assert server.points == points(folder)
    upload(run=str(folder), uri="http://me@127.0.0.1:9")
    assert "s3cret" not in "".join(capfd.readouterr())
    for path in folder.rglob("*"):
        assert path.is_dir() or b"s3cret" not in path.read_bytes(), path
    assert json.loads((folder / SYNC_STATE).read_text())["store"] == "http://me@127.0.0.1:9"


def test_a_message_of_mlflow_is_told_without_a_password():
    def fail():
        raise OSError("API request to https://me:s3cret@host/api failed\nhttps://me:s3cret@host")

    with pytest.raises(TrackingError, match=r"API request to https://me@host/api failed\.") as caught:
        mlflow_store.calling(fail)
    assert caught.value.__cause__ is None  # whose text the journal would hold


@pytest.mark.parametrize("change", [{"store": 3}, {"begun": "0' OR '1'='1"}, {"sent": None}, {"more": 1}])
def test_what_says_how_much_was_sent_is_refused_in_another_form(tmp_path, change):
    write_json(tmp_path / SYNC_STATE, {"store": "sqlite:///x", "experiment": "segar", "begun": 1} | change)
    with pytest.raises(RunFolderError, match=f"{SYNC_STATE}: '?{next(iter(change))}"):
        mlflow_sync.read_sync_state(tmp_path)
