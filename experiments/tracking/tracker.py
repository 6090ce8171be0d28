"""Trackers show the figures of a run while it runs: in MLflow, to which a thread sends them in batches, or nowhere.

Training never waits for the store and never ends because of it. No run is ever 'active' in the process, so that many
runs can share one process (joblib reuses its workers).
"""

import sys
import threading
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from segar.experiments.settings import RunConfig, RunFolderError, TrackingError, scheme
from segar.experiments.tracking.mlflow_store import REMOTE, StoreBusy
from segar.experiments.tracking.mlflow_sync import RunSync

LONGEST_PAUSE = 60.0  # [s] between attempts, while the store is away
LAST_WAIT = 30.0  # [s] that the end of a run waits for the store


class Tracker:
    """Sends the figures of a run to where they are shown: this one to nowhere, as ``tracking=none`` wants."""

    def finish(self, status: str, files: Sequence[Path] = ()) -> None:
        """Sends what is left, these files, and how the run ended: FINISHED, FAILED or KILLED."""


def start_tracking(config: RunConfig, folder: Path, rows: Sequence[dict[str, Any]]) -> Tracker:
    """The tracker that the configuration names; a resumed run is the same run in the store.

    Args:
        rows: those of ``metrics.parquet``, which may grow but not change otherwise. What is appended is sent, too.

    Raises:
        TrackingError: a store on this machine cannot be opened. A server that does not answer may come back, and a
            database that another process holds may be free again: the tracker says so, and tries again.
    """
    if config.tracking.name == "none":
        return Tracker()
    sync = RunSync(config, folder)
    if scheme(sync.state.store) not in REMOTE:
        with suppress(StoreBusy):
            sync.open()
    return MLflowTracker(sync, config.tracking.interval, rows)


class MLflowTracker(Tracker):
    """Sends to MLflow every ``interval`` seconds, in a thread; see :mod:`segar.experiments.tracking.mlflow_sync`."""

    def __init__(self, sync: RunSync, interval: float, rows: Sequence[dict[str, Any]]) -> None:
        sync.replace_if_ahead(len(rows))
        self.sync, self.interval, self.rows = sync, max(interval, 0.05), rows
        self.files: Sequence[Path] = ()
        self.status = "RUNNING"
        self.missed = False
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="tracking", daemon=True)
        self._thread.start()

    def finish(self, status: str, files: Sequence[Path] = ()) -> None:
        """Sends the rest, and waits for that at most :data:`LAST_WAIT`. Prints how to send what could not be sent."""
        self.status, self.files = status, files
        self._ending.set()
        self._thread.join(LAST_WAIT)
        left = len(self.rows) - self.sync.state.sent
        if self.missed or left or self._thread.is_alive():
            _warn(
                f"MLflow at {self.sync.state.store} has not got all of this run: {left} figures are left. They are in "
                f"the run folder; this sends them: {self.sync.command}"
            )

    def _work(self) -> None:
        pause = self.interval
        while True:
            ending = self._ending.wait(pause)
            pause = self.interval if self._send() else min(2 * pause, LONGEST_PAUSE)
            if ending:
                return

    def _send(self) -> bool:
        """Sends what waits; returns whether that succeeded. Prints the first failure in a row, and its end."""
        try:
            self.sync.send(self.rows[:], self.files, self.status)
        except (TrackingError, RunFolderError) as error:
            if not self.missed and not self._ending.is_set():
                _warn(f"{error}. The run goes on; what MLflow misses is sent when it answers again")
            self.missed = True
            return False
        if self.missed:
            _warn(f"MLflow at {self.sync.state.store} answers again, and has all figures")
        self.missed = False
        return True


def _warn(message: str) -> None:
    print(message, file=sys.stderr, flush=True)
