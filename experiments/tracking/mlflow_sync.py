"""What MLflow has of a run, and what it still lacks: the same figures as in the run folder, each sent once.

The run folder is what is delivered: the rows of ``metrics.parquet`` in their order, then files, then how the run ended.
``tracking.json`` marks how far that has come, so a delivery that was cut off goes on from there: by the run itself, when
the run is gone on with, or by ``python -m experiments.upload``. A row always has the same time, so that one which is
sent again, because the mark could not be written, is the same point to MLflow.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from experiments.runs.run_folder import EPISODES, MARK, SUMMARY, runs_root, write_json
from experiments.settings import RunConfig, cell_of, flat
from experiments.tracking.mlflow_store import calling, open_store, store_uri

BATCH = 1000  # metrics in one call, at most; MLflow's limit
VALUE_LENGTH = 500  # of a parameter, in characters


@dataclass
class Mark:
    """How much of a run has been delivered, and where to."""

    store: str  # its address
    experiment: str
    begun: int  # [ms] since 1970; when the run was begun
    run_id: str | None = None
    sent: int = 0  # rows of metrics.parquet
    files: list[str] = dataclasses.field(default_factory=list)
    status: str | None = None  # MLflow's word for how the run stands


class Delivery:
    """Delivers one run; not for use by two threads at once."""

    def __init__(self, config: RunConfig, folder: Path) -> None:
        self.config, self.folder = config, folder
        self.client: Any = None
        here = Mark(store_uri(config.tracking, runs_root(config)), config.tracking.experiment, int(time.time() * 1000))
        there = read_mark(folder)
        is_same = there is not None and (there.store, there.experiment) == (here.store, here.experiment)
        self.mark = there if there is not None and is_same else here

    def open(self) -> Any:
        """Finds the run in the store, or begins it there; returns the store's client; raises :class:`TrackingError`."""
        if self.client is not None:
            return self.client
        client, experiment = open_store(self.config.tracking, runs_root(self.config))
        if self.mark.run_id is None:
            self.keep_mark()  # what the run is found by, should this process be killed before it knows the id
            self.mark.run_id = calling(self._find_or_create, client, experiment)
            self.keep_mark()
        self.client = client
        return client

    def send(self, rows: Sequence[Mapping[str, Any]], files: Sequence[Path], status: str) -> None:
        """Delivers what is not delivered yet of these rows of ``metrics.parquet`` and these files, and the status.

        Raises:
            TrackingError: the store cannot be reached, or refuses; what it took is marked.
            RunFolderError: the mark cannot be written.
        """
        client = self.open()
        if status == "RUNNING":
            self._say(status)
        self.mark.sent = min(self.mark.sent, len(rows))  # a run that was killed goes on from fewer rows
        while self.mark.sent < len(rows):
            batch = rows[self.mark.sent : self.mark.sent + BATCH]
            calling(client.log_batch, self.mark.run_id, metrics=[self._metric(row) for row in batch])
            self.mark.sent += len(batch)
            self.keep_mark()
        for path in files:
            if path.name not in self.mark.files:
                calling(client.log_artifact, self.mark.run_id, str(path))
                self.mark.files.append(path.name)
                self.keep_mark()
        self._say(status)

    def lacks(self, rows: int, files: Sequence[Path], status: str) -> bool:
        """Whether :meth:`send` would have anything to do."""
        mark = self.mark
        whole = mark.sent >= rows and {path.name for path in files} <= {*mark.files} and mark.status == status
        return mark.run_id is None or not whole

    def keep_mark(self) -> None:
        """Writes the mark; raises :class:`RunFolderError`."""
        write_json(self.folder / MARK, dataclasses.asdict(self.mark))

    def _say(self, status: str) -> None:
        if status != self.mark.status:
            calling(
                self.client.set_terminated if status != "RUNNING" else self.client.update_run, self.mark.run_id, status
            )
            self.mark.status = status
            self.keep_mark()

    def _metric(self, row: Mapping[str, Any]) -> Any:
        from mlflow.entities import Metric

        return Metric(row["name"], row["value"], self.mark.begun + int(1000 * row["seconds"]), row["frames"])

    def _find_or_create(self, client: Any, experiment: str) -> str:
        from mlflow.entities import Param, RunTag

        tags = {**tags_of(self.config), "run_folder": str(self.folder), "begun": str(self.mark.begun)}
        wanted = " and ".join(f"tags.{name} = '{tags[name]}'" for name in ("run_folder", "begun"))
        found = client.search_runs([experiment], wanted, max_results=1)
        run = found[0] if found else client.create_run(experiment, self.mark.begun, tags, self.config.label())
        run_id = run.info.run_id
        parameters = [Param(k, str(v)[:VALUE_LENGTH]) for k, v in flat(self.config.identity()).items()]
        client.log_batch(run_id, params=parameters, tags=[RunTag(k, v) for k, v in tags.items()])
        return run_id


def files_of(folder: Path) -> list[Path]:
    """The files of a run that MLflow gets, as far as they are there."""
    return [folder / name for name in (SUMMARY, EPISODES) if (folder / name).exists()]


def tags_of(config: RunConfig) -> dict[str, str]:
    """What MLflow can find a run by."""
    cell = cell_of(config)
    return {
        "config_hash": config.hash(),
        "sweep": config.tracking.sweep,
        "family": cell.family,
        "difficulty": cell.difficulty,
        "n": str(cell.count),
        "seed": str(cell.seed),
        "algorithm": config.algorithm.name,
        "observation": config.observation.name,
        "test": config.levels.test_distribution,
    }


def read_mark(folder: Path) -> Mark | None:
    """How much of the run in ``folder`` has been delivered; None where nobody has begun to."""
    path = folder / MARK
    return Mark(**json.loads(path.read_text())) if path.exists() else None
