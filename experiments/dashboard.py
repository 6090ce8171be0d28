"""MLflow's pages over the results, on this machine alone: ``segar dashboard port=5000``."""

import os
import socket
import sys
from pathlib import Path

from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.runs.run_folder import root_folder
from segar.experiments.settings import TrackingConfig, TrackingError, require
from segar.experiments.tracking.mlflow_store import STORE, calling, open_client, show_views, store_uri
from segar.experiments.tracking.mlflow_views import TAG, VIEWS, VIEWS_OF_PAPER, link

HOST = "127.0.0.1"  # loopback: no other machine can reach it
UNUSED = "Default"  # the experiment that every store of MLflow's has from the beginning


def serve(root: str | None = None, port: int = 5000) -> None:
    """Replaces this process by MLflow's server.

    Args:
        root: the folder that holds the run folders and the store; None: runs/ of the checkout.
        port: where a browser finds the pages.

    Raises:
        ConfigError: there is no such port.
        TrackingError: there is no store, or the port is not free.
    """
    require(0 < port < 65536, "port", port, "between 1 and 65535")
    folder, address = root_folder(root), f"http://{HOST}:{port}"
    command = server_command(folder, port)
    require_free(port)
    os.environ["MLFLOW_SERVER_ENABLE_JOB_EXECUTION"] = "false"  # a job runner that nothing here uses; 20 s to start
    # An experiment lies under the root: no request may name another folder, such as file:///etc, for its files.
    os.environ["MLFLOW_ARTIFACT_LOCATION_MAX_LENGTH"] = "0"
    os.environ["PYTHONWARNINGS"] = "ignore"  # the user cannot do anything about those of the server's libraries
    print(f"Results of {folder}: {address} (in a few seconds). Ctrl-C stops it.")
    print(*links(folder, address), sep="\n", flush=True)
    os.execv(command[0], command)


def server_command(folder: Path, port: int) -> list[str]:
    """The command that starts the server; raises :class:`TrackingError` if there is no store in the folder."""
    if not (folder / STORE).exists():
        raise TrackingError(
            f"there is nothing to show yet: no {folder / STORE}. Run something first, for example "
            "`segar reproduce scale=smoke`, or name another folder with root=..."
        )
    artifacts = (folder / "mlflow-artifacts").as_uri()
    stores = ["--backend-store-uri", store_uri(TrackingConfig(), folder), "--default-artifact-root", artifacts]
    # Below critical, uvicorn logs every request, and calls Ctrl-C an error with a traceback.
    quiet = ["--workers", "1", "--uvicorn-opts", "--log-level=critical"]
    address = ["--host", HOST, "--port", str(port), *quiet]
    return [sys.executable, "-m", "mlflow", "server", *address, *stores]


def links(folder: Path, address: str) -> list[str]:
    """One line for each view of each experiment in the store of a folder, with where the server at this address shows it; adds
    missing views. Raises :class:`TrackingError`."""
    client = open_client(store_uri(TrackingConfig(), folder))
    lines = []
    for experiment in calling(client.search_experiments):
        if experiment.name != UNUSED:
            show_views(client, experiment)
            shown = VIEWS | {name: view for name, view in VIEWS_OF_PAPER.items() if f"{TAG}{name}" in experiment.tags}
            for name, view in shown.items():
                lines.append(f"  {view['title']} ({experiment.name}): {link(address, experiment.experiment_id, name)}")
    return lines


def require_free(port: int) -> None:
    """Raises :class:`TrackingError` if a process listens on the port already."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # a port that was closed a moment ago is free
        try:
            probe.bind((HOST, port))
        except OSError as error:
            raise TrackingError(
                f"port {port} is taken or forbidden ({error.strerror}); choose another one: port={port + 1}"
            ) from error


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(serve)


if __name__ == "__main__":
    main()
