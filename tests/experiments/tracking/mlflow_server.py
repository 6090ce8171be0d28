"""A real MLflow server on this machine, which a test can stop and start again; and what it has of a run."""

import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

from mlflow import MlflowClient

from segar.experiments.runs.run_folder import read_metrics
from segar.experiments.settings import EvaluationConfig, PPOConfig, ScaleConfig, TrackingConfig
from tests.experiments.short_runs import short_run
from tests.waiting import PATIENCE, until


def free_port():
    """A port on which nobody listens."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class MLflowServer:
    """Serves a store, by default one under ``folder``, at the same address whenever it is up; files lie under ``folder``."""

    def __init__(self, folder, store=None):
        self.folder, self.process = folder, None
        self.store = store or f"sqlite:///{folder / 'server.db'}"
        self.port = free_port()
        self.uri = f"http://127.0.0.1:{self.port}"

    def start(self):
        """Starts it, and waits until it answers."""
        command = [sys.executable, *f"-m mlflow server --workers 1 --host 127.0.0.1 --port {self.port}".split()]
        command += ["--backend-store-uri", self.store]
        command += ["--artifacts-destination", str(self.folder / "artifacts")]
        environment = {**os.environ, "MLFLOW_SERVER_ENABLE_JOB_EXECUTION": "false", "MLFLOW_DISABLE_TELEMETRY": "true"}
        with open(self.folder / "server.log", "ab") as log:
            self.process = subprocess.Popen(
                command, cwd=self.folder, env=environment, stdout=log, stderr=log, start_new_session=True
            )
        until(lambda: self.answers() or self.process.poll() is not None, 0.1)
        assert self.process.poll() is None, (self.folder / "server.log").read_text()

    def answers(self):
        try:
            with urllib.request.urlopen(f"{self.uri}/health", timeout=PATIENCE) as response:
                return response.status == 200
        except (urllib.error.URLError, ConnectionError, TimeoutError):
            return False

    def stop(self):
        """Ends it with all its workers."""
        if self.process is not None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()
            self.process = None


def long_run(tmp_path, uri, **changes):
    """The settings of a run of 40 iterations that tells the store at ``uri`` at once."""
    return short_run(
        tmp_path / "run",
        tracking=TrackingConfig(uri=uri, interval=0.1, **changes),
        root=str(tmp_path),
        scale=ScaleConfig(frames=64 * 40),
        algorithm=PPOConfig(num_envs=8, num_steps=8, widths=(8,)),
        evaluation=EvaluationConfig(episodes=2, distances=("exact",)),
    )


def logged(uri, name, experiment="segar"):
    """What the store has of the only run of an experiment: the run, its files, and one figure over time."""
    client = MlflowClient(tracking_uri=uri)
    (one,) = client.search_runs([client.get_experiment_by_name(experiment).experiment_id])
    files = sorted(file.path for file in client.list_artifacts(one.info.run_id))
    return one, files, [(point.step, point.value) for point in client.get_metric_history(one.info.run_id, name)]


def in_folder(folder, name):
    """One figure over time, as the run folder has it."""
    rows = read_metrics(folder).to_pylist()
    return [(row["frames"], row["value"]) for row in rows if row["name"] == name]


def has_each_figure_once(client, run_id, folder):
    """Whether the store has all figures of a run folder, each once, and no other."""
    histories = [client.get_metric_history(run_id, name) for name in client.get_run(run_id).data.metrics]
    there = sorted((point.key, point.step, point.value) for points in histories for point in points)
    return there == sorted((row["name"], row["frames"], row["value"]) for row in read_metrics(folder).to_pylist())
