"""Sends to MLflow what it missed while it was away: ``python -m experiments.upload run=FOLDER``, or ``root=FOLDER`` for all.

Runs that are at work are left alone: they do it themselves.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from experiments.commands.hydra_app import run_simple_command
from experiments.runs.journal import read_journal
from experiments.runs.run_folder import METRICS, lock, read_config, read_metrics, run_folders
from experiments.settings import CHECKOUT, RunFolderError, TrackingError
from experiments.tracking.mlflow_sync import Delivery, files_of

STATUS = {"finished": "FINISHED", "failed": "FAILED"}  # of a run whose journal ends so; all others were cut off


@dataclass(frozen=True)
class UploadConfig:
    """Which runs, and where to."""

    run: str | None = None  # one run folder
    root: str | None = None  # or all run folders under this one; None: runs/ of the checkout
    uri: str | None = None  # of the store; None: the one that the run was told of


def upload(config: UploadConfig, say: Callable[[str], None] = print) -> None:
    """Delivers what each run that tracks to MLflow still has to deliver, and says what that was.

    Raises:
        TrackingError: some could not be delivered; the others are.
        RunFolderError: ``run`` names no run.
    """
    folders = [absolute(config.run)] if config.run else run_folders(absolute(config.root or str(CHECKOUT / "runs")))
    failed = 0
    for folder in folders:
        try:
            say(f"{folder.name}: {upload_run(folder, config.uri)}")
        except (TrackingError, RunFolderError) as error:
            if config.run:
                raise
            failed += 1
            say(f"{folder.name}: {error}")
    if failed:
        raise TrackingError(
            f"{failed} of {len(folders)} runs could not be sent; see above. The same command tries again"
        )


def upload_run(folder: Path, uri: str | None = None) -> str:
    """Delivers what is left of one run; returns what that was.

    Raises:
        TrackingError: the store does not answer, or refuses.
        RunFolderError: there is no run, or a process is at it.
    """
    config = read_config(folder)
    if uri is not None:
        config = dataclasses.replace(config, tracking=dataclasses.replace(config.tracking, name="mlflow", uri=uri))
    if config.tracking.name == "none":
        return "it was run without MLflow; uri=... names a store"
    with lock(folder):
        rows = read_metrics(folder).to_pylist() if (folder / METRICS).exists() else []
        journal = read_journal(folder)
        status = STATUS.get(journal[-1]["event"], "KILLED") if journal else "KILLED"
        delivery = Delivery(config, folder)
        if not delivery.lacks(len(rows), files_of(folder), status):
            return "MLflow has all of it"
        before = min(delivery.mark.sent, len(rows))
        delivery.send(rows, files_of(folder), status)
    return f"sent {len(rows) - before} figures to {delivery.mark.store}"


def absolute(path: str) -> Path:
    """The path from the root of the file system."""
    return Path(path).expanduser().resolve()


if __name__ == "__main__":
    run_simple_command(upload, UploadConfig, __doc__)
