"""What of a run MLflow has: the figures of its run folder, each sent once.

A run is sent in an order: the rows of ``metrics.parquet``, then files, then how the run ended. ``tracking.json`` in the run
folder says how far that has come. So what was cut off goes on from there, by the run itself when it is resumed, or by
``segar upload``. A row always has the same time: one that is sent again, because ``tracking.json`` could
not be written, is the same point to MLflow. A run that is thrown away, so that another one is trained in its folder, stands
in ``tracking_replaced.json`` until it is deleted in MLflow, too. So does a run that was killed after it had sent figures which
its last checkpoint does not have: MLflow gets the run anew when it is resumed.
"""

from __future__ import annotations

import dataclasses
import json
import re
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from segar.experiments.runs.files import read_json
from segar.experiments.runs.run_folder import (
    EPISODES,
    PLAYED,
    REPLACED,
    SUMMARY,
    SYNC_STATE,
    read_versions,
    runs_root,
    write_json,
)
from segar.experiments.settings import RunConfig, flat, grid_point, without_password
from segar.experiments.tracking.mlflow_store import calling, open_store, runs_with, store_uri

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import DatasetInput, Metric

BATCH = 1000  # metrics in one call, at most; MLflow's limit
UNNAMEABLE = re.compile(r"[^/\w.\- :]")  # characters that the names of metrics cannot have; a task's results may
VALUE_LENGTH = 500  # of a parameter, in characters


@dataclasses.dataclass
class SyncState:
    """How much of a run was sent, and to which store."""

    store: str  # its address
    experiment: str
    begun: int  # [ms] since 1970; when the run was begun
    run_id: str | None = None
    sent: int = 0  # rows of metrics.parquet
    tried: int = 0  # rows that the store may have: those sent, and those whose sending was begun
    files: list[str] = dataclasses.field(default_factory=list)
    status: str | None = None  # MLflow's word for how the run stands


SYNC_FORM = {"store": str, "experiment": str, "begun": int, "run_id?": (str, None), "sent?": int, "tried?": int,
             "files?": [str], "status?": (str, None)}  # fmt: skip


class RunSync:
    """Sends one run to MLflow; not for use by two threads at once."""

    def __init__(self, config: RunConfig, folder: Path) -> None:
        self.config, self.folder = config, folder
        self.client: MlflowClient | None = None
        store = store_uri(config.tracking, runs_root(config))
        state = read_sync_state(folder)
        if state is None or (without_password(state.store), state.experiment) != (store, config.tracking.experiment):
            state = SyncState(store, config.tracking.experiment, int(time.time() * 1000))
        self.state = dataclasses.replace(state, store=store)

    @property
    def command(self) -> str:
        """What sends the store all that it lacks of this run."""
        uri = self.config.tracking.uri
        return f"segar upload run={self.folder}" + (f" uri={without_password(uri)}" if uri else "")

    def open(self) -> MlflowClient:
        """Finds or creates the run in the store; returns the store's client; raises :class:`TrackingError`."""
        if self.client is not None:
            return self.client
        client, experiment = open_store(self.config.tracking, runs_root(self.config))
        self._delete_replaced(client, experiment)
        if self.state.run_id is None:
            self.write_state()  # if this process is killed before it knows the id, the run is found by this
            self.state.run_id = calling(self._find_or_create, client, experiment)
            self.write_state()
        self.client = client
        return client

    def replace_if_ahead(self, rows: int) -> None:
        """Begins the run anew in the store where that may have more than its first ``rows`` rows.

        A run that was killed is resumed with fewer rows, and its next ones are made again. Those that were sent before would
        stand twice in MLflow, which can delete a run but no single figure.
        """
        if max(self.state.sent, self.state.tried) > rows:
            (self.folder / SYNC_STATE).replace(self.folder / REPLACED)
            self.state = SyncState(self.state.store, self.state.experiment, self.state.begun)
            self.client = None

    def send(self, rows: Sequence[Mapping[str, Any]], files: Sequence[Path], status: str) -> None:
        """Sends the status, and those of these rows of ``metrics.parquet`` and of these files that were not sent yet.

        Raises:
            TrackingError: the store cannot be reached, or refuses; what it took is noted.
            RunFolderError: ``tracking.json`` cannot be written.
        """
        client, state = self.open(), self.state
        if status == "RUNNING":
            self._send_status(client, status)
        while state.sent < len(rows):
            batch = rows[state.sent : state.sent + BATCH]
            state.tried = state.sent + len(batch)
            self.write_state()
            calling(client.log_batch, state.run_id, metrics=[self._metric(row) for row in batch])
            state.sent = state.tried
            self.write_state()
        for path in files:
            if path.name not in state.files:
                calling(client.log_artifact, state.run_id, str(path))
                state.files.append(path.name)
                self.write_state()
        self._send_status(client, status)

    def is_complete(self, rows: int, files: Sequence[Path], status: str) -> bool:
        """Whether the store has this many rows, these files and this status."""
        state = self.state
        has_files = {path.name for path in files} <= {*state.files}
        return state.run_id is not None and state.sent >= rows and has_files and state.status == status

    def write_state(self) -> None:
        """Writes ``tracking.json``; raises :class:`RunFolderError`."""
        write_json(self.folder / SYNC_STATE, dataclasses.asdict(self.state))

    def _send_status(self, client: MlflowClient, status: str) -> None:
        if status != self.state.status:
            send = client.update_run if status == "RUNNING" else client.set_terminated
            calling(send, self.state.run_id, status)
            self.state.status = status
            self.write_state()

    def _metric(self, row: Mapping[str, Any]) -> Metric:
        from mlflow.entities import Metric

        name = UNNAMEABLE.sub("_", row["name"])
        return Metric(name, row["value"], self.state.begun + int(1000 * row["seconds"]), row["frames"])

    def _delete_replaced(self, client: MlflowClient, experiment: str) -> None:
        """Deletes the run that this one replaces, if it is in this store and experiment; others stay there."""
        replaced = read_sync_state(self.folder, REPLACED)
        if replaced is None:
            return
        if (replaced.store, replaced.experiment) == (self.state.store, self.state.experiment):
            # None where a user has deleted it.
            for earlier in runs_with(client, experiment, begun=str(replaced.begun), run_folder=str(self.folder)):
                calling(client.delete_run, earlier.info.run_id)
        (self.folder / REPLACED).unlink()

    def _find_or_create(self, client: MlflowClient, experiment: str) -> str:
        from mlflow.entities import Param, RunTag
        from mlflow.tracking.context.registry import resolve_tags

        made = read_versions(self.folder)
        # MLflow's own: the user, the kind of the source.
        tags = {**resolve_tags(), "mlflow.source.name": "segar.experiments.train"}
        if made.get("git"):
            tags["mlflow.source.git.commit"] = made["git"]["commit"]
        tags |= {**tags_of(self.config), "run_folder": str(self.folder), "begun": str(self.state.begun)}
        found = runs_with(client, experiment, begun=tags["begun"], run_folder=tags["run_folder"])
        run = found[0] if found else client.create_run(experiment, self.state.begun, tags, self.config.label())
        run_id = run.info.run_id
        parameters = [Param(k, str(v)[:VALUE_LENGTH]) for k, v in flat(self.config.identity()).items()]
        client.log_batch(run_id, params=parameters, tags=[RunTag(k, v) for k, v in tags.items()])
        client.log_inputs(run_id, self._datasets(made.get("levels", {})))
        return run_id

    def _datasets(self, hashes: Mapping[str, str]) -> list[DatasetInput]:
        """The level sets of the run, as MLflow shows what a run was made from."""
        from mlflow.entities import Dataset, DatasetInput, InputTag

        names = {"train": self.config.levels.train, "test": self.config.levels.test_distribution}
        source = json.dumps({"uri": str(self.folder)})
        return [
            DatasetInput(Dataset(names[which], digest, "local", source), [InputTag("mlflow.data.context", which)])
            for which, digest in hashes.items()
        ]


def files_of(folder: Path) -> list[Path]:
    """The files of a run that MLflow gets, as far as they exist."""
    return [folder / name for name in (SUMMARY, EPISODES, PLAYED) if (folder / name).exists()]


def tags_of(config: RunConfig) -> dict[str, str]:
    """The tags by which MLflow finds a run."""
    point = grid_point(config)
    return {
        "config_hash": config.hash,
        "sweep": config.tracking.sweep,
        "family": point.family,
        "difficulty": point.difficulty,
        "n": str(point.count),
        "seed": str(point.seed),
        "algorithm": config.algorithm.name,
        "observation": config.observation.name,
        "test": config.levels.test_distribution,
    }


def read_sync_state(folder: Path, name: str = SYNC_STATE) -> SyncState | None:
    """How much of the run in ``folder`` was sent, by the file of this name; None where nothing was."""
    path = folder / name
    return SyncState(**read_json(path, SYNC_FORM, only=True)) if path.exists() else None
