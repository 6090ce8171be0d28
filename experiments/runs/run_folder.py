"""The run folder: all files of a run. Analysis reads nothing else.

``config.yaml``           the settings; ``read_config`` makes the :class:`RunConfig` again
``levels_train.npz``      the levels that were trained on; ``levels_test.npz`` those that were tested on
``checkpoint/``           ``latest.pt``: weights and the state to resume from (tensors and plain data, nothing pickled);
                          ``previous.pt``: the one before it
``episodes.parquet``      one row per evaluation episode, see :data:`EPISODE_SCHEMA`
``metrics.parquet``       one row per figure and time, see :data:`METRIC_SCHEMA`
``played.parquet``        which levels were played how often in each interval, where levels are endless or a curriculum chooses
                          them, see :data:`segar.experiments.curricula.played_log.PLAYED_SCHEMA`
``versions.json``         libraries, commit, fingerprints of the code and of the data files that own code read, content
                          hashes of the level sets, and what decided the last bits (``arithmetic``: precision, threads,
                          instruction set, limits, processor)
``summary.json``          the final figures; written last, so it is there if and only if the run is finished
``journal.jsonl``         when the run was started, stopped, went wrong (with the traceback), and finished
``tracking.json``         how much of it was sent to MLflow; ``tracking_replaced.json``: that of a run which was thrown away
``sweeps.json``           further sweeps that asked for the run when it was finished
``evaluations/``          results of ``segar evaluate``, and of transfers, each with its code and with the
                          ``frames`` of the weights that it is of
``probes.parquet``        how well probes predict the factors, see :mod:`segar.experiments.evaluation.probing`
"""

import dataclasses
import json
import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import yaml

from segar.experiments.runs.files import absolute_path, read_json, read_table, typed, write_parquet, write_text
from segar.experiments.runs.own_modules import folders_of, modules_named, own_packages
from segar.experiments.runs.trust import settings_of_file, signed
from segar.experiments.settings import ConfigError, RunConfig, RunFolderError, as_data, run_config, without_password
from segar.support import LOCK, UNFINISHED, WORKSPACE, __version__, content_of, locked, read_yaml, remove_unfinished

CONFIG = "config.yaml"
LONGEST = 2**20  # [bytes] of the settings of a run
LEVELS_TRAIN = "levels_train.npz"
LEVELS_TEST = "levels_test.npz"
JOURNAL = "journal.jsonl"
CHECKPOINTS = "checkpoint"
CHECKPOINT = "checkpoint/latest.pt"
PREVIOUS = "checkpoint/previous.pt"
DAMAGED = "checkpoint/damaged.pt"  # a newest checkpoint that could not be read
EPISODES = "episodes.parquet"
METRICS = "metrics.parquet"
PLAYED = "played.parquet"
EVALUATIONS = "evaluations"
PROBES = "probes.parquet"
VERSIONS = "versions.json"
SUMMARY = "summary.json"
SYNC_STATE = "tracking.json"  # how much of the run was sent to MLflow
SWEEPS = "sweeps.json"
REPLACED = "tracking_replaced.json"  # that of the run which this one replaces, and which MLflow still has

RESULTS = "results/"  # begins the names of further columns: what the task says of an episode's last state
EPISODE_SCHEMA = pa.schema(
    [
        ("levels", pa.string()),  # "train" or "test"
        ("action_mode", pa.string()),  # "deterministic" or "sampled"
        ("level", pa.int64()),  # index in the level set
        ("return", pa.float64()),  # every reward counted
        ("return_ref", pa.float64()),  # without the last reward, as the 2022 implementation reported it
        ("length", pa.int64()),  # steps
        ("success", pa.bool_()),
        ("death", pa.bool_()),
    ]
)
METRIC_SCHEMA = pa.schema(
    [
        ("name", pa.string()),  # e.g. "episode/return", "evaluation/test/success/deterministic", "w2/exact"
        ("frames", pa.int64()),  # environment steps trained so far
        ("seconds", pa.float64()),  # of training so far
        ("value", pa.float64()),
    ]
)

# Earlier releases said less.
ARITHMETIC = {**dict.fromkeys(("instruction_set?", "precision?", "device?", "determinism?", "processor?"), str),
              "threads?": int, "limits?": dict}  # fmt: skip
VERSIONS_FORM = {
    "python": str, "libraries": {str: (str, None)}, "git": ({"commit": str, "changed": bool}, None), "code": {str: str},
    "levels?": {str: str}, "arithmetic?": ARITHMETIC, "arithmetic_before?": [ARITHMETIC],
}  # fmt: skip

EVALUATION = {
    "frames?": (int, None), "code?": {str: str}, "changed_code?": [str], "planner?": dict, "players?": {str: dict},
}  # fmt: skip
TRANSFER = {"transfer": {
    "label": str, "panel": str, "variation": str, "observation": {"name": str, "options": dict}, "test_count": int,
    "mixture?": ({"groups": dict, "changed": [str]}, None),
}}  # fmt: skip


def root_folder(root: str | None) -> Path:
    """Absolute path of the folder that holds run folders and MLflow's store; None means ``runs/`` of the checkout, or here."""
    return absolute_path(root) if root else WORKSPACE / "runs"


def runs_root(config: RunConfig) -> Path:
    """Absolute path of the folder that holds the folder of this run."""
    return root_folder(config.root)


def folder_path(config: RunConfig) -> Path:
    """Absolute path of the run's folder."""
    return absolute_path(config.folder) if config.folder else runs_root(config) / config.label()


def is_finished(folder: Path) -> bool:
    """Whether the run in ``folder`` is finished."""
    return (folder / SUMMARY).exists()


def sweeps_of(folder: Path, config: RunConfig) -> tuple[str, ...]:
    """The names of the sweeps that a run is of: its own, and those that asked for it when it was finished."""
    path = folder / SWEEPS
    further = read_json(path, {"sweeps": [str]})["sweeps"] if path.exists() else []
    return tuple(name for name in (config.tracking.sweep, *further) if name)


def join_sweep(folder: Path, name: str) -> None:
    """Notes that a sweep asks for the finished run in ``folder``; raises :class:`RunFolderError`."""
    config = read_config(folder)
    known = sweeps_of(folder, config)
    if name and name not in known:
        write_json(folder / SWEEPS, {"sweeps": [*(one for one in known if one != config.tracking.sweep), name]})


@contextmanager
def use_run_folder(config: RunConfig) -> Iterator[Path]:
    """The run's folder, made if need be, and locked against other processes inside the block.

    Raises:
        RunFolderError: the folder holds another run, or something else; another process is at work in it; or
            ``config`` forbids to resume the run that it holds.
    """
    folder = folder_path(config)
    with lock(folder):
        _occupy(folder, config)
        remove_unfinished(folder)
        yield folder


def lock(folder: Path) -> AbstractContextManager[None]:
    """Keeps other processes out of a run folder inside the block; raises :class:`RunFolderError` if one is at work there."""
    return locked(folder, RunFolderError, "wait for it, or choose folder=...")


def is_locked(folder: Path) -> bool:
    """Whether a process is at work in a run folder."""
    try:
        with lock(folder):
            return False
    except RunFolderError:
        return True


def run_folders(root: Path) -> list[Path]:
    """The run folders directly under ``root``."""
    return sorted(path.parent for path in root.glob(f"*/{CONFIG}"))


def _occupy(folder: Path, config: RunConfig) -> None:
    """Writes the settings into an empty folder; raises :class:`RunFolderError` if it holds another run or no run."""
    if (folder / CONFIG).exists():
        # Read before anything is removed: a folder that holds no run must stay.
        there = read_config(folder, set(modules_named(as_data(config))))
        if config.restart:
            empty(folder, config)
            return
        others = [*sorted(differences(there.identity(), config.identity())), *_other_precision(folder, config)]
        if others:
            shown = "; ".join(others[:3]) + ("; ..." if len(others) > 3 else "")
            raise RunFolderError(
                f"{folder} holds another run: {shown}. Choose another folder=..., or throw that run away with restart=true"
            )
        if not config.resume and not is_finished(folder):
            raise RunFolderError(
                f"{folder} holds this run, unfinished, and resume=false forbids to go on with it. Go on with resume=true, "
                "throw it away with restart=true, or choose another folder=..."
            )
        return
    foreign = sorted(p.name for p in folder.iterdir() if p.name != LOCK and not p.name.startswith(UNFINISHED))
    if foreign:
        raise RunFolderError(
            f"{folder} holds no run but is not empty: {', '.join(foreign[:3])}. Choose another folder=..."
        )
    _write_settings(folder, config)


def empty(folder: Path, config: RunConfig) -> None:
    """Removes the run in a folder, and no other files, and writes the settings of the run that begins there.

    What MLflow has of it is removed when the new run is sent; see :mod:`segar.experiments.tracking.mlflow_sync`.
    """
    if (folder / SYNC_STATE).exists():
        (folder / SYNC_STATE).replace(folder / REPLACED)
    names = (SUMMARY, PROBES, EPISODES, METRICS, PLAYED, VERSIONS, LEVELS_TRAIN, LEVELS_TEST, JOURNAL, CONFIG)
    for name in names:  # the summary first, because it says that the run is finished
        (folder / name).unlink(missing_ok=True)
    for part in (CHECKPOINTS, EVALUATIONS):
        if (folder / part).exists():
            shutil.rmtree(folder / part)
    _write_settings(folder, config)


def _write_settings(folder: Path, config: RunConfig) -> None:
    """Writes the settings, signed, so that they mean the same on every machine and can be read from any working directory.

    The task of named levels is named, the places of the modules that are named are added, and a password in the store's
    address is left out. ``algorithm.precision=auto`` stays; ``versions.json`` says what it was.
    """
    uri = config.tracking.uri
    tracking = dataclasses.replace(config.tracking, uri=uri and without_password(uri))
    data = as_data(dataclasses.replace(config, tracking=tracking).resolved())
    data["module_path"] = list(dict.fromkeys((*config.module_path, *folders_of(data))))
    write_text(folder / CONFIG, signed(yaml.safe_dump(data, sort_keys=False)))


def differences(there: Mapping[str, Any], here: Mapping[str, Any], place: str = "") -> Iterator[str]:
    """Sentences that name the settings in which two runs, or the methods of two rows, differ."""
    for key in {**there, **here}:
        a, b = there.get(key), here.get(key)
        if isinstance(a, Mapping) and isinstance(b, Mapping):
            yield from differences(a, b, f"{place}{key}.")
        elif a != b:
            yield f"{place}{key} is {a!r} there and {b!r} here"


def _other_precision(folder: Path, config: RunConfig) -> Iterator[str]:
    """A sentence where ``config`` sets another precision than the run in the folder was computed in; ``auto`` sets none."""
    there, here = precision_in(folder), getattr(config.algorithm, "precision", None)
    if there and here not in (None, "auto", there):
        yield f"algorithm.precision is {there!r} there and {here!r} here"


def precision_in(folder: Path) -> str:
    """The precision that the run in ``folder`` is computed in, ``bf16`` or ``fp32``; empty where the folder does not say."""
    return read_versions(folder).get("arithmetic", {}).get("precision", "")


def computed_as_begun(folder: Path, config: RunConfig) -> RunConfig:
    """The settings with the precision in which the run in ``folder`` was begun, where they say ``auto``; where the folder says
    none, with the one that ``auto`` means on this machine."""
    begun = precision_in(folder)
    if begun and getattr(config.algorithm, "precision", None) == "auto":
        return config.with_precision(begun)
    return config.computed_here()


def read_config(folder: Path, trusted: Collection[str] = ()) -> RunConfig:
    """The settings of the run in ``folder``.

    Args:
        trusted: modules or packages that the settings may name, whoever wrote them; see
            :func:`segar.experiments.runs.trust.settings_of_file`.

    Raises:
        RunFolderError: there are no settings, they are not readable, or they name code that is not trusted.
    """
    path = Path(folder) / CONFIG
    try:
        text = content_of(path.absolute(), "file of settings", RunFolderError, LONGEST)
        data = read_yaml(text)
        if not isinstance(data, Mapping):
            raise ConfigError("it holds no settings")
        data = settings_of_file(path, data, trusted, text.decode())
        if not own_packages(data):
            data = {**data, "module_path": ()}  # no folder is looked into without need
        return run_config(data)
    except RunFolderError:
        raise
    except ValueError as error:
        raise RunFolderError(f"cannot read the settings of a run from {path}: {error}") from error


def read_summary(folder: Path, config: RunConfig | None = None) -> dict[str, Any]:
    """The final figures; raises :class:`RunFolderError` if the run is not finished, or is not the one of these settings."""
    path = Path(folder) / SUMMARY
    if not path.exists():
        raise RunFolderError(f"the run in {folder} is not finished: there is no {SUMMARY}")
    summary = read_json(path, {"frames": int, "seconds": float, "evaluation_seconds?": float})
    if min(summary[name] for name in ("frames", "seconds", "evaluation_seconds") if name in summary) < 0:
        raise RunFolderError(f"{path}: frames and seconds cannot be below 0; restore the file")
    by_this = read_versions(folder).get("libraries", {}).get("segar") == __version__  # which gave it its name
    if config is not None and by_this and summary.get("label", own := config.label()) != own:
        raise RunFolderError(f"{folder / CONFIG} was edited: it is that of {own}, and the run is {summary['label']}")
    return summary


def read_evaluation(place: Path) -> dict[str, Any] | None:
    """The summary of an evaluation, whose folder is in ``evaluations/`` of a run; None where there is none. That of a transfer
    says which it is of; raises :class:`RunFolderError` where it has another form."""
    path = Path(place) / SUMMARY
    form = TRANSFER if path.parent.name.startswith("transfer-") else {}
    return read_json(path, EVALUATION | form) if path.exists() else None


def of_another_agent(folder: Path, evaluation: Mapping[str, Any]) -> str:
    """What to say behind the name of an evaluation of other weights than a finished run has, such as those that it had while
    it was unfinished; empty where it is of the run's weights, and for unfinished runs."""
    if not is_finished(folder):
        return ""
    frames, own = evaluation.get("frames"), read_summary(folder)["frames"]
    return "" if frames in (None, own) else f" is of the agent after {frames:,} frames, and the run has {own:,}"


def read_versions(folder: Path, begun: bool = False) -> dict[str, Any]:
    """Libraries, commit, code fingerprint and level hashes of the run; empty before it has begun, unless it must have
    ``begun``: then :class:`RunFolderError` says that the file is not there."""
    path = Path(folder) / VERSIONS
    return read_json(path, VERSIONS_FORM) if begun or path.exists() else {}


def read_episodes(folder: Path) -> pa.Table:
    """The evaluation episodes, :data:`EPISODE_SCHEMA`, of a run or of an evaluation; raises :class:`RunFolderError`."""
    table = read_table(path := Path(folder) / EPISODES, schema=EPISODE_SCHEMA)
    trial = pa.schema([("trial", pa.int64())])  # which stands beside them where there are several on a level
    return typed(path, table, trial) if "trial" in table.schema.names else table


def read_metrics(folder: Path) -> pa.Table:
    """The figures over time, :data:`METRIC_SCHEMA`; raises :class:`RunFolderError` if they are not readable."""
    table = read_table(path := Path(folder) / METRICS, schema=METRIC_SCHEMA)
    if is_finished(folder) and max(table["frames"].to_pylist(), default=0) != read_summary(folder)["frames"]:
        raise RunFolderError(f"{path} does not end with the run, whose frames {SUMMARY} says; restore the file")
    return table


def read_played(folder: Path) -> pa.Table:
    """Which levels were played in each interval, :data:`segar.experiments.curricula.played_log.PLAYED_SCHEMA`; raises
    :class:`RunFolderError` if that is not readable, as in the folder of a run without a curriculum and with a fixed set."""
    return read_table(Path(folder) / PLAYED)


def write_rows(path: Path, rows: Sequence[Mapping[str, Any]], schema: pa.Schema) -> None:
    """Replaces a table by ``rows``; columns beyond ``schema`` follow it. Raises :class:`RunFolderError`."""
    table = pa.Table.from_pylist(list(rows), schema=schema)
    more = [name for name in (rows[0] if rows else ()) if name not in schema.names]
    for name in more:
        table = table.append_column(name, pa.array([row.get(name) for row in rows]))
    write_parquet(path, table)


def write_json(path: Path, data: Any) -> None:
    """Replaces a JSON file by ``data``; raises :class:`RunFolderError`."""
    write_text(path, json.dumps(data, indent=2) + "\n")
