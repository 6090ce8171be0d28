"""The MLflow store: its address, and how it is opened, by many processes at once if need be."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from segar.experiments.runs.files import replacing
from segar.experiments.settings import (
    TrackingConfig,
    TrackingError,
    scheme,
    sqlite_address,
    with_password,
    without_password,
)
from segar.experiments.tracking.mlflow_views import VIEWS, View, tags_of_views
from segar.support import first_line, locked

STORE = "mlflow.db"  # under the root of the runs
LONGEST_OPENING = 30.0  # [s] that a process waits for others that open the store
OPENING = "it opens MLflow's store, which only one may do at a time"
SERVERS = ("http", "https")  # begin the addresses of MLflow's servers
REMOTE = (*SERVERS, "postgresql", "mysql", "mssql")  # and of all stores that may be unreachable for a while
BUSY = ("database is locked", "database table is locked", "database schema is locked")  # what SQLite says


class StoreBusy(TrackingError):
    """Another process holds the store; it will be free later."""


def store_uri(tracking: TrackingConfig, root: Path) -> str:
    """The store's address, without a password: as configured, else SQLite under ``root``, whatever the working directory."""
    return without_password(tracking.uri) if tracking.uri else sqlite_address(root / STORE)


def is_server(uri: str) -> bool:
    """Whether this is the address of an MLflow server, which has pages and keeps the files of runs."""
    return scheme(uri) in SERVERS


def open_store(tracking: TrackingConfig, root: Path) -> tuple[Any, str]:
    """An ``MlflowClient`` and the id of the experiment, with its views; all made if need be.

    One process at a time creates the database: when several do, most of them crash. A server keeps the files of runs
    where it likes; beside a database they lie under ``root``.

    Raises:
        TrackingError: the store cannot be opened; a :class:`StoreBusy` where that may be possible later.
    """
    logging.getLogger("urllib3.connectionpool").setLevel(logging.ERROR)  # it logs every retry
    logging.getLogger("mlflow.store.db.utils").setLevel(logging.CRITICAL)  # it logs a traceback for each failure
    with locked(root, StoreBusy, OPENING, LONGEST_OPENING, ".mlflow.lock"):
        if tracking.uri is None and not (root / STORE).exists():
            with replacing(root / STORE) as beside:  # half a database could never be opened again
                open_client(sqlite_address(beside))
        client = open_client(with_password(tracking.uri or store_uri(tracking, root)))
        found = calling(client.get_experiment_by_name, tracking.experiment)
        if found is None:
            place = None if is_server(client.tracking_uri) else (root / "mlflow-artifacts").as_uri()
            experiment = calling(client.create_experiment, tracking.experiment, artifact_location=place)
            found = calling(client.get_experiment, experiment)
        show_views(client, found)
        return client, found.experiment_id


def open_client(address: str) -> Any:
    """An ``MlflowClient`` of the store at this address; raises :class:`TrackingError`."""
    from mlflow import MlflowClient

    if scheme(address) == "sqlite":  # MLflow would try to open it ten times, for 102 s in all
        calling(_read_schema, address)
    return calling(MlflowClient, tracking_uri=address)


def _read_schema(address: str) -> None:
    """Raises what SQLAlchemy has against this address of an SQLite file."""
    from sqlalchemy import NullPool, create_engine, inspect, make_url

    Path(make_url(address).database or "").parent.mkdir(parents=True, exist_ok=True)  # as MLflow does
    inspect(create_engine(address, poolclass=NullPool)).get_table_names()


def runs_with(client: Any, experiment: str, **tags: str) -> list[Any]:
    """The runs that have these tags; raises :class:`TrackingError`. The first one holds no quotation mark: MLflow, which
    is asked for it alone, has no way to write one."""
    name, value = next(iter(tags.items()))
    found = calling(client.search_runs, [experiment], f"tags.{name} = '{value}'")
    return [run for run in found if tags.items() <= run.data.tags.items()]


def show_views(client: Any, experiment: Any, views: Mapping[str, View] = VIEWS) -> None:
    """Gives an experiment of MLflow's the views that it lacks; raises :class:`TrackingError`."""
    for name, value in tags_of_views(views).items():
        if experiment.tags.get(name) != value:
            calling(client.set_experiment_tag, experiment.experiment_id, name, value)


def calling(function: Any, *arguments: Any, **options: Any) -> Any:
    """The function's result; an error of MLflow, its database, the database's version or driver, or the disk
    becomes a :class:`TrackingError`."""
    from alembic.util import CommandError
    from mlflow.exceptions import MlflowException
    from sqlalchemy.exc import SQLAlchemyError

    try:
        return function(*arguments, **options)
    except (MlflowException, SQLAlchemyError, CommandError, ImportError, OSError) as error:
        said = without_password(str(error))
        reason = without_password(first_line(error))
        kind = StoreBusy if any(word in said for word in BUSY) else TrackingError
        message = f"MLflow refuses: {reason}. The run folder has what was done; tracking=none runs without MLflow"
        raise kind(message) from (error if said == str(error) else None)  # the journal has the cause, too


def replace_run(
    tracking: TrackingConfig,
    root: Path,
    name: str,
    tags: Mapping[str, str],
    same: str,
    *,
    metrics: Mapping[str, float],
    files: Mapping[Path, str | None],
    parameters: Mapping[str, Any] | None = None,
) -> None:
    """Writes a run that is no training, such as a report, in place of earlier ones of its ``kind``.

    Args:
        tags: with ``kind``.
        same: the other tag that earlier ones have alike.
        files: to the folder among the run's files that each is put into; None: none.

    Raises:
        TrackingError: the store cannot be opened, or refuses.
    """
    client, experiment = open_store(tracking, root)
    for earlier in runs_with(client, experiment, kind=tags["kind"], **{same: tags[same]}):
        calling(client.delete_run, earlier.info.run_id)
    run = calling(client.create_run, experiment, run_name=name, tags=dict(tags)).info.run_id
    for key, value in (parameters or {}).items():
        calling(client.log_param, run, key, value)
    for key, number in metrics.items():
        calling(client.log_metric, run, key, number)
    for path, place in files.items():
        calling(client.log_artifact, run, str(path), place)
    calling(client.set_terminated, run)
