"""Sends figures of runs that MLflow missed: ``segar upload run=FOLDER``, or ``root=FOLDER`` for all runs.

Runs that are at work are skipped, because they send their figures themselves.
"""

import dataclasses
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


def upload(run: str | None = None, root: str | None = None, uri: str | None = None) -> None:
    """Sends what MLflow lacks of each run, and prints how much that was.

    Args:
        run: one run folder.
        root: or the folder of all run folders; None: runs/ of the checkout.
        uri: of the store; None: the file beside the run folders, and no address that a folder names.

    Raises:
        TrackingError: some runs could not be sent; the others were.
        RunFolderError: ``run`` names no run, or there is none in ``root``.
    """
    folders = [Path(run).expanduser().resolve()] if run else run_folders(root_folder(root))
    if not folders:
        raise RunFolderError(
            f"there are no run folders in {root_folder(root)}; name one by run=FOLDER, or where they are by root=FOLDER"
        )
    failed = 0
    for folder in folders:
        try:
            print(f"{folder.name}: {upload_run(folder, uri)}", flush=True)
        except (TrackingError, RunFolderError) as error:
            if run:
                raise
            failed += 1
            print(f"{folder.name}: {error}", flush=True)
    if failed:
        raise TrackingError(f"{failed} of {len(folders)} runs could not be sent; see above. The command tries again")


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
    run_from_command_line(upload)


if __name__ == "__main__":
    main()
