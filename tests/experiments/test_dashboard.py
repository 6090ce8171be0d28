"""The dashboard listens on loopback only, and says what to do when it cannot start."""

import socket

import pytest

from experiments.config import TrackingConfig
from experiments.dashboard import DashboardConfig, require_free, serve, server_command
from experiments.errors import ConfigError, TrackingError


def test_without_a_store_it_says_what_to_run(tmp_path):
    with pytest.raises(TrackingError, match=f"no {tmp_path}/mlflow.db. Run something first"):
        serve(DashboardConfig(root=str(tmp_path)))


def test_a_taken_port_is_named_with_the_way_out(tmp_path):
    (tmp_path / "mlflow.db").touch()
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        port = other.getsockname()[1]
        with pytest.raises(TrackingError, match=f"port {port} is taken .*choose another one: port={port + 1}"):
            serve(DashboardConfig(root=str(tmp_path), port=port))
    require_free(port)


def test_the_server_listens_on_this_machine_alone_with_one_worker(tmp_path):
    (tmp_path / "mlflow.db").touch()
    command = " ".join(server_command(DashboardConfig(root=str(tmp_path), port=5123)))
    assert "--host 127.0.0.1 --port 5123 --workers 1" in command
    assert f"--backend-store-uri sqlite:///{tmp_path}/mlflow.db" in command


def test_it_looks_where_runs_write(tmp_path):
    from experiments.mlflow_store import store_uri

    (tmp_path / "mlflow.db").touch()
    assert store_uri(TrackingConfig(), tmp_path) in server_command(DashboardConfig(root=str(tmp_path)))


def test_a_port_that_is_none_is_refused():
    with pytest.raises(ConfigError, match="port: 70000 is not allowed; it must be between 1 and 65535"):
        DashboardConfig(port=70000)
