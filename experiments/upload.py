"""Sends figures of runs that MLflow missed: ``segar upload run=FOLDER``, or ``root=FOLDER`` for all runs.

Runs that are at work are skipped, because they send their figures themselves.
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from segar.experiments.commands.command_line import run_from_command_line
from segar.experiments.runs.journal import read_journal
from segar.experiments.runs.run_folder import (
    METRICS,
    lock,
    read_config,
    read_metrics,
    root_folder,
    run_folders,
    runs_root,
)
from segar.experiments.settings import RunFolderError, TrackingError
from segar.experiments.tracking.mlflow_store import STORE, sqlite_address, store_uri
from segar.experiments.tracking.mlflow_sync import RunSync, files_of
from segar.support import counted

STATUS = {"finished": "FINISHED", "failed": "FAILED"}  # of a run whose journal ends so; all others were cut off


@dataclass(frozen=True)
class UploadConfig:
    """Which runs, and where to."""

    run: str | None = None  # one run folder
    root: str | None = None  # or all run folders under this one; None: runs/ of the checkout
    uri: str | None = None  # of the store; None: the file beside the run folders, and no address that a folder names


def upload(config: UploadConfig, say: Callable[[str], None] = print) -> None:
    """Sends what MLflow lacks of each run, and prints how much that was.

    Raises:
        TrackingError: some runs could not be sent; the others were.
        RunFolderError: ``run`` names no run, or there is none in ``root``.
    """
    folders = [Path(config.run).expanduser().resolve()] if config.run else run_folders(root_folder(config.root))
    if not folders:
        raise RunFolderError(
            f"there are no run folders in {root_folder(config.root)}; name one by run=FOLDER, or where they are by root=FOLDER"
        )
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
    """Sends what MLflow lacks of one run; returns how much that was, as text.

    Run folders may be of others: what they name is no place to send anything to, unless the caller says so by ``uri``.

    Raises:
        TrackingError: the store does not answer, or refuses; or the folder names another one than the file beside it.
        RunFolderError: there is no run, or a process is at work in its folder.
    """
    config, beside = read_config(folder), folder.resolve().parent
    if config.tracking.name == "none" and uri is None:
        return "it was run without MLflow; uri=... names a store"
    named = store_uri(config.tracking, runs_root(config) if config.folder else beside)
    if uri is None and named != sqlite_address(beside / STORE):
        raise TrackingError(
            f"{folder} names the store {named}; nothing is sent to an address because a folder names it: uri={named} says that"
            " it may"
        )
    tracking = dataclasses.replace(config.tracking, name="mlflow", uri=uri)
    config = dataclasses.replace(config, tracking=tracking, root=str(beside))
    with lock(folder):
        rows = read_metrics(folder).to_pylist() if (folder / METRICS).exists() else []
        journal = read_journal(folder)
        status = STATUS.get(journal[-1]["event"], "KILLED") if journal else "KILLED"
        sync = RunSync(config, folder)
        sync.replace_if_ahead(len(rows))
        if sync.is_complete(len(rows), files_of(folder), status):
            return "MLflow has all of it"
        before = sync.state.sent
        sync.send(rows, files_of(folder), status)
    return f"sent {counted(len(rows) - before, 'figure')} to {sync.state.store}"


def main() -> None:
    """The command, with what the command line states."""
    run_from_command_line(upload, UploadConfig)


if __name__ == "__main__":
    main()
