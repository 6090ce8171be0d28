"""Where the figures of runs are compared: MLflow, written in batches through its client.

No run is ever 'active' in the process, so that many runs can share one process (joblib reuses its workers). The run
folder holds the same figures; tracking is for looking at them.
"""

from __future__ import annotations

import fcntl
import time
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from experiments import runtime
from experiments.atomic import replacing
from experiments.config import RunConfig, TrackingConfig
from experiments.errors import TrackingError
from experiments.run_folder import runs_root

STORE = "mlflow.db"  # under the root of the runs
BATCH = 1000  # metrics in one call, at most; MLflow's limit
VALUE_LENGTH = 500  # of a parameter, in characters


class Tracker(Protocol):
    """What a run says about itself while it runs."""

    def log(self, figures: Mapping[str, float], frames: int) -> None:
        """Notes figures at ``frames``; they may be sent later."""
        ...

    def artifact(self, path: Path) -> None:
        """Stores a file with the run."""
        ...

    def finish(self, finished: bool) -> None:
        """Sends what is left and says whether the run went through."""
        ...


def start_tracking(config: RunConfig, folder: Path, tags: Mapping[str, str] | None = None) -> Tracker:
    """The tracker that the configuration asks for; a run that was begun before goes on under its old id.

    Raises:
        TrackingError: the store cannot be opened.
    """
    if config.tracking.name == "none":
        return NoTracker()
    return MLflowTracker(config, folder, dict(tags or {}))


class NoTracker:
    """Tells nobody."""

    def log(self, figures: Mapping[str, float], frames: int) -> None:
        """Does nothing."""

    def artifact(self, path: Path) -> None:
        """Does nothing."""

    def finish(self, finished: bool) -> None:
        """Does nothing."""


class MLflowTracker:
    """Sends figures to MLflow every few seconds."""

    def __init__(self, config: RunConfig, folder: Path, tags: dict[str, str]) -> None:
        self.interval = config.tracking.interval
        self.client, experiment = open_store(config.tracking, runs_root(config))
        known = {"config_hash": config.hash(), "run_folder": str(folder), "sweep": config.tracking.sweep, **tags}
        self.run_id = _calling(self._find_or_create, experiment, config, known)
        self.waiting: list[tuple[str, float, int, int]] = []  # name, value, time [ms], frames
        self.sent = time.monotonic()
        self.warned = False

    def _find_or_create(self, experiment: str, config: RunConfig, tags: Mapping[str, str]) -> str:
        wanted = f"tags.config_hash = '{tags['config_hash']}' and tags.run_folder = '{tags['run_folder']}'"
        found = self.client.search_runs([experiment], wanted, max_results=1)
        if found:
            run_id = found[0].info.run_id
            self.client.update_run(run_id, status="RUNNING")
        else:
            run_id = self.client.create_run(experiment, run_name=config.label()).info.run_id
        from mlflow.entities import Param, RunTag

        # Parameters cannot be changed once logged; equal ones may be logged again.
        parameters = [Param(k, str(v)[:VALUE_LENGTH]) for k, v in _flat(config.identity())]
        self.client.log_batch(run_id, params=parameters, tags=[RunTag(k, v) for k, v in tags.items()])
        return run_id

    def log(self, figures: Mapping[str, float], frames: int) -> None:
        """Notes figures; sends all that wait if the last time was long ago."""
        now = int(time.time() * 1000)
        self.waiting.extend((name, float(value), now, frames) for name, value in figures.items())
        if time.monotonic() - self.sent > self.interval:
            self.sent = time.monotonic()
            try:
                self.send()
            except TrackingError as error:  # training goes on; all that waits is tried again, at the latest at the end
                if not self.warned:
                    warnings.warn(str(error), stacklevel=2)
                self.warned = True

    def send(self) -> None:
        """Sends all that waits; raises :class:`TrackingError`, and keeps it waiting, if the store refuses."""
        from mlflow.entities import Metric

        while self.waiting:
            batch = self.waiting[:BATCH]
            _calling(self.client.log_batch, self.run_id, metrics=[Metric(*entry) for entry in batch])
            del self.waiting[: len(batch)]

    def artifact(self, path: Path) -> None:
        """Stores a file with the run."""
        _calling(self.client.log_artifact, self.run_id, str(path))

    def finish(self, finished: bool) -> None:
        """Sends what is left and closes the run."""
        self.send()
        _calling(self.client.set_terminated, self.run_id, status="FINISHED" if finished else "FAILED")


def store_uri(tracking: TrackingConfig, root: Path) -> str:
    """The store's address: as configured, else SQLite under ``root``, whatever the working directory."""
    return tracking.uri or f"sqlite:///{root / STORE}"


def open_store(tracking: TrackingConfig, root: Path) -> tuple[Any, str]:
    """An ``MlflowClient`` and the id of the experiment, both made if need be.

    One process at a time creates the database: when several do, most of them crash.

    Raises:
        TrackingError: the store cannot be opened.
    """
    runtime.set_environment()
    from mlflow import MlflowClient

    root.mkdir(parents=True, exist_ok=True)
    with open(root / ".mlflow.lock", "a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if tracking.uri is None and not (root / STORE).exists():
            with replacing(root / STORE) as beside:  # half a database could never be opened again
                _calling(MlflowClient, tracking_uri=f"sqlite:///{beside}")
        client = _calling(MlflowClient, tracking_uri=store_uri(tracking, root))
        found = _calling(client.get_experiment_by_name, tracking.experiment)
        if found is not None:
            return client, found.experiment_id
        artifacts = (root / "mlflow-artifacts").as_uri() if tracking.uri is None else None
        return client, _calling(client.create_experiment, tracking.experiment, artifact_location=artifacts)


def _calling(function: Any, *arguments: Any, **options: Any) -> Any:
    """The function's result; what MLflow, its database or the disk refuses becomes one :class:`TrackingError`."""
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    try:
        return function(*arguments, **options)
    except (MlflowException, SQLAlchemyError, OSError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise TrackingError(
            f"MLflow refuses: {reason}. The run folder has all figures; tracking=none runs without MLflow"
        ) from error


def _flat(data: Mapping[str, Any], place: str = "") -> list[tuple[str, Any]]:
    """Dotted names and values of nested settings."""
    pairs = []
    for key, value in data.items():
        name = f"{place}{key}"
        pairs += _flat(value, f"{name}.") if isinstance(value, Mapping) else [(name, value)]
    return pairs
