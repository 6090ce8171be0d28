"""Where the figures of runs are compared: MLflow, told in batches by a thread of its own.

Training never waits for the store and never ends because of it. No run is ever 'active' in the process, so that many
runs can share one process (joblib reuses its workers).
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

from experiments.settings import RunConfig, RunFolderError, TrackingError
from experiments.tracking.mlflow_store import is_remote
from experiments.tracking.mlflow_sync import Delivery

LONGEST_PAUSE = 60.0  # [s] between attempts, while the store is away
LAST_WAIT = 30.0  # [s] that the end of a run waits for the store


class Tracker(Protocol):
    """Tells somebody about a run while it runs."""

    def begin(self, rows: list[dict[str, Any]]) -> None:
        """From now on, tells what is appended to ``rows``, those of ``metrics.parquet``."""
        ...

    def finish(self, status: str, files: Sequence[Path] = ()) -> None:
        """Tells what is left, these files, and how the run ended: FINISHED, FAILED or KILLED."""
        ...


def start_tracking(config: RunConfig, folder: Path) -> Tracker:
    """The tracker that the configuration asks for; a run that was begun before goes on as the same run.

    Raises:
        TrackingError: a store on this machine cannot be opened. A server that does not answer may come back: the
            tracker says so, and tries again.
    """
    if config.tracking.name == "none":
        return NoTracker()
    delivery = Delivery(config, folder)
    if not is_remote(delivery.mark.store):
        delivery.open()
    return MLflowTracker(delivery, config.tracking.interval)


class NoTracker:
    """Tells nobody."""

    def begin(self, rows: list[dict[str, Any]]) -> None:
        """Does nothing."""

    def finish(self, status: str, files: Sequence[Path] = ()) -> None:
        """Does nothing."""


class MLflowTracker:
    """Delivers to MLflow every ``interval`` seconds, in a thread; see :mod:`experiments.tracking.mlflow_sync`."""

    def __init__(self, delivery: Delivery, interval: float) -> None:
        self.delivery, self.interval = delivery, max(interval, 0.05)
        self.rows: Sequence[dict[str, Any]] = []
        self.files: Sequence[Path] = ()
        self.status = "RUNNING"
        self.missed = False
        self._ending = threading.Event()
        self._thread = threading.Thread(target=self._work, name="tracking", daemon=True)

    def begin(self, rows: list[dict[str, Any]]) -> None:
        """Starts to deliver; ``rows`` may grow, and nothing else."""
        self.rows = rows
        self._thread.start()

    def finish(self, status: str, files: Sequence[Path] = ()) -> None:
        """Delivers the rest; waits for that, but not for ever. What could not be delivered is told, with the way out."""
        self.status, self.files = status, files
        self._ending.set()
        if not self._thread.is_alive():
            self._thread.start()
        self._thread.join(LAST_WAIT)
        if self.missed or self._thread.is_alive():
            left = len(self.rows) - self.delivery.mark.sent
            _tell(
                f"MLflow at {self.delivery.mark.store} has not got all of this run: {left} figures are left. They are in "
                f"the run folder; this sends them: python -m experiments.upload run={self.delivery.folder}"
            )

    def _work(self) -> None:
        pause = self.interval
        while True:
            ending = self._ending.wait(pause)
            pause = self.interval if self._deliver() else min(2 * pause, LONGEST_PAUSE)
            if ending:
                return

    def _deliver(self) -> bool:
        """Sends what waits; whether that went well. Tells of the first failure in a row, and of its end."""
        try:
            self.delivery.send(self.rows[:], self.files, self.status)
        except (TrackingError, RunFolderError) as error:
            if not self.missed and not self._ending.is_set():
                _tell(f"{error}. The run goes on; what MLflow misses is sent when it answers again")
            self.missed = True
            return False
        if self.missed:
            _tell(f"MLflow at {self.delivery.mark.store} answers again, and has all figures")
        self.missed = False
        return True


def _tell(message: str) -> None:
    print(message, file=sys.stderr, flush=True)
