"""The dashboard listens on loopback only, and says what to do when it cannot start."""

import json
import os
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import psutil
import pytest

from segar.experiments.dashboard import require_free, serve, server_command
from segar.experiments.settings import ConfigError, TrackingConfig, TrackingError
from segar.experiments.tracking.mlflow_store import open_store
from segar.experiments.tracking.mlflow_views import VIEWS, link, tags_of_views
from segar.support import WORKSPACE
from tests.experiments.tracking.mlflow_server import free_port
from tests.waiting import PATIENCE, until


def test_without_a_store_it_says_what_to_run(tmp_path):
    with pytest.raises(TrackingError, match=f"no {tmp_path}/mlflow.db. Run something first"):
        serve(str(tmp_path))


def test_a_taken_port_is_named_with_the_way_out(tmp_path):
    (tmp_path / "mlflow.db").touch()
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(TrackingError, match=f"port {port} is taken .*choose another one: port={port + 1}"):
            serve(str(tmp_path), port)
    require_free(port)


def test_the_server_listens_on_this_machine_alone_with_one_worker(tmp_path):
    (tmp_path / "mlflow.db").touch()
    command = " ".join(server_command(tmp_path, 5123))
    assert "--host 127.0.0.1 --port 5123 --workers 1" in command
    assert f"--backend-store-uri sqlite:///{tmp_path}/mlflow.db" in command


def test_a_port_that_is_none_is_refused():
    with pytest.raises(ConfigError, match="port: 70000 is not allowed; it must be between 1 and 65535"):
        serve(port=70000)


@pytest.mark.slow
def test_the_pages_are_served_on_loopback_tell_nobody_and_end_with_ctrl_c(tmp_path):
    client, experiment = open_store(TrackingConfig(), tmp_path)
    client.create_run(experiment, run_name="one")
    port = free_port()
    command = [sys.executable, "-m", "segar.experiments.dashboard", f"root={tmp_path}", f"port={port}"]
    environment = {**os.environ, "PYTHONPATH": str(WORKSPACE)}
    with subprocess.Popen(
        command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True, preexec_fn=interruptible
    ) as process:
        try:
            until(lambda: said_by(port, "health") or process.poll() is not None)
            asked = f"api/2.0/mlflow/experiments/get?experiment_id={experiment}"
            tags = json.loads(said_by(port, asked))["experiment"]["tags"]
            assert {tag["key"] for tag in tags} == tags_of_views().keys()
            assert status_of_experiment(port, artifact_location="file:///etc") == 400
            assert status_of_experiment(port) == 200
            assert json.loads(said_by(port, "ajax-api/3.0/mlflow/ui-telemetry"))["disable_ui_telemetry"] is True
            with pytest.raises(OSError), socket.create_connection((address_of_this_machine(), port), 5):
                pass
        finally:
            process.send_signal(signal.SIGINT)
            said, _ = process.communicate()
    assert f"http://127.0.0.1:{port} (in a few seconds)" in said
    assert all(link(f"http://127.0.0.1:{port}", experiment, name) in said for name in VIEWS)


def interruptible():
    """Heeds Ctrl-C, although whoever starts the tests may ignore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def said_by(port, path):
    """What the server answers; empty while it does not."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/{path}", timeout=PATIENCE) as answer:
            return answer.read().decode()
    except (urllib.error.URLError, ConnectionError, TimeoutError):
        return ""


def status_of_experiment(port, **settings):
    """The server's answer to who wants to make an experiment."""
    body = json.dumps({"name": "of somebody", **settings}).encode()
    url = f"http://127.0.0.1:{port}/api/2.0/mlflow/experiments/create"
    try:
        with urllib.request.urlopen(urllib.request.Request(url, body, {"Content-Type": "application/json"})) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def address_of_this_machine():
    """An address by which other machines reach this one, or a loopback address that is not the dashboard's."""
    found = [one.address for cards in psutil.net_if_addrs().values() for one in cards if one.family == socket.AF_INET]
    return next((address for address in found if not address.startswith("127.")), "127.0.0.2")
