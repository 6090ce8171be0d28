"""Probes of finished runs: what is asked about their representations, and ``probes.parquet``, where the answers lie.

What probes are is a matter of ``analysis.probes``, which is imported by name and only where a run is probed: what trains
does not depend on it.
"""

from __future__ import annotations

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from experiments.runs.executed_code import fingerprint
from experiments.runs.files import replacing
from experiments.runs.run_folder import (
    MARK,
    METRIC_SCHEMA,
    METRICS,
    PROBES,
    folder_path,
    lock,
    read_metrics,
    write_json,
    write_rows,
)
from experiments.settings import (
    ACTION_MODES,
    ConfigError,
    RunConfig,
    RunFolderError,
    TrackingError,
    as_data,
    construct,
    import_object,
    require,
    require_known,
)
from experiments.tracking.mlflow_sync import Delivery, files_of, read_mark
from segar.errors import SegarError

PROBER = "analysis.probes.table:probe_run"  # (run folder, ProbeConfig) -> pandas.DataFrame
ABOUT = b"segar"  # in the file's metadata: what was asked, by which code, and how long it took
TRAINED, IDENTITY = "trained", "identity"
ON_BOTH = (TRAINED, IDENTITY)  # are probed on training and test levels, the others on test levels
BOUNDS, READOUTS, KSG = ("jsd", "infonce", "smile"), ("ridge", "mlp"), "ksg"
REPRESENTATIONS = (TRAINED, "random encoder", "pixel PCA", IDENTITY, "shuffled")
EVERYTHING = (*BOUNDS, *READOUTS, KSG)
PREFIX = "probes/"  # begins the names of figures
# What one core of a small server took: per pair that a critic saw, and for the rest at 5,000 frames.
SECONDS_PER_SAMPLE = 9e-6
SECONDS = {"ridge": 0.4, "mlp": 2.6, "ksg": 0.3, "paper": 1.2}


@dataclass(frozen=True)
class ProbeConfig:
    """What is asked about a run. The defaults ask everything, which takes minutes."""

    frames: int = 5000  # of training levels, and as many of test levels
    num_envs: int = 128  # episodes that are played at once; ksg needs 100
    mode: str = "sampled"  # actions, as in 2022; deterministic ones play one level again and again in the same way
    replicates: int = 5  # of critics, which give the intervals of accuracies
    steps: int = 300  # of each critic
    batch: int = 128
    paper_frames: int = 1000  # for the accuracy as in 2022, which had ten episodes of at most 101
    paper_replicates: int = 5  # of that; 0: none
    # What is asked of each representation: bounds, readouts, and ksg, which belongs to the readouts.
    representations: Mapping[str, Sequence[str]] = field(
        default_factory=lambda: dict.fromkeys(REPRESENTATIONS, EVERYTHING)
    )

    def __post_init__(self) -> None:
        for name in ("frames", "num_envs", "replicates", "steps"):
            require(getattr(self, name) >= 1, name, getattr(self, name), "at least 1")
        require(self.batch >= 2, "batch", self.batch, "at least 2")
        require(self.paper_frames >= 64, "paper_frames", self.paper_frames, "at least 64, one batch")
        require(self.paper_replicates >= 0, "paper_replicates", self.paper_replicates, "0 or more")
        require_known("mode", self.mode, ACTION_MODES)
        for name, asked in self.representations.items():
            require_known("representations", name, REPRESENTATIONS)
            require(not isinstance(asked, str), f"representations.{name}", asked, f"a list of {', '.join(EVERYTHING)}")
            for one in asked:
                require_known(f"representations.{name}", one, EVERYTHING)


def probe_settings(data: Mapping[str, Any], place: str) -> ProbeConfig:
    """The settings that a group states; raises :class:`ConfigError` that begins with ``place``."""
    try:
        return construct(ProbeConfig, data, "")
    except ConfigError as error:
        raise ConfigError(f"{place}: {error}") from error


def assumed_seconds(config: ProbeConfig, speed: float) -> float:
    """How long one thread may take for a run whose agent makes ``speed`` frames per second in training."""
    seconds = 2 * config.frames / speed + SECONDS["paper"] * config.paper_replicates
    for name, asked in config.representations.items():
        sets = 2 if name in ON_BOTH else 1
        objectives = ("infonce" in asked) + bool({"jsd", "smile"} & {*asked})
        steps = 2 * config.replicates * config.steps * config.batch  # 2 folds
        readouts = sum(SECONDS[one] for one in asked if one in SECONDS) * config.frames / ProbeConfig.frames
        seconds += sets * (objectives * steps * SECONDS_PER_SAMPLE + readouts)
    return seconds


def is_probed(run: RunConfig, config: ProbeConfig) -> bool:
    """Whether this was asked about the run by the probes as they are now."""
    about = read_about(folder_path(run))
    return about is not None and about["asked"] == as_data(config) and about["code"] == code_of_probes()


def probe_finished(run: RunConfig, config: ProbeConfig, say: Callable[[str], None] | None = None) -> dict[str, float]:
    """Probes a finished run: writes ``probes.parquet``, adds to the run's figures, tells MLflow; returns the figures.

    Raises:
        RunFolderError: it cannot be probed; the message says which run, why, and what to do.
    """
    folder, say = folder_path(run), say or say_at_once
    say(f"{run.label()}: probes")
    began = time.perf_counter()
    try:
        table = pa.Table.from_pandas(import_object(PROBER, "probes")(folder, config), preserve_index=False)
    except SegarError as error:
        raise RunFolderError(
            f"the probes of {run.label()} failed: {error}. The run is kept, and the same command probes it again; "
            "settings of probes are probes.<scale>...=, and grids.<experiment>.probes=false leaves them out"
        ) from error
    took = time.perf_counter() - began
    figures = figures_of(table.to_pylist())
    about = {"asked": as_data(config), "code": code_of_probes(), "seconds": took}
    with lock(folder):
        add_figures(folder, figures, took)
        with replacing(folder / PROBES) as beside:  # last: it is there if and only if the figures are
            pq.write_table(table.replace_schema_metadata({ABOUT: json.dumps(about).encode()}), beside)
        tell(run, folder, say)
    say(f"{run.label()}: probed in {took:.1f} s, accuracy {figures.get(PREFIX + 'accuracy/test', float('nan')):.3f}")
    return figures


def say_at_once(message: str) -> None:
    """Prints; logs are looked at while they are written."""
    print(message, flush=True)


def read_about(folder: Path) -> dict[str, Any] | None:
    """What was asked about the run in ``folder`` (``asked``), by which ``code``, in how many ``seconds``; None: nothing was."""
    try:
        return json.loads((pq.read_schema(folder / PROBES).metadata or {})[ABOUT])
    except (OSError, KeyError, ValueError):  # no file, no file of ours, or a damaged one: it is made again
        return None


def code_of_probes() -> str:
    """A fingerprint of what measures, not of the library that is measured."""
    return fingerprint(PROBER.partition(":")[0])


def figures_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """What stands beside gap, W2 and KS: accuracies, those of controls, and how well each factor is read on test levels."""
    found = {}
    for row in rows:
        name = None
        trained = row["representation"] == TRAINED
        if row["factor"] == "all" and row["quantity"] == "accuracy" and row["probe"] in ("jsd", "paper"):
            kind = "accuracy" if row["probe"] == "jsd" else "accuracy_of_2022"
            which = () if trained else (row["representation"],)
            name = "/".join((kind, row["levels"], *which))
        elif trained and row["levels"] == "test" and row["probe"] == "ridge" and row["quantity"] in ("r2", "accuracy"):
            name = f"{row['quantity']}/{row['factor']}"
        if name is not None and row["estimate"] is not None and row["estimate"] == row["estimate"]:
            found[PREFIX + name] = float(row["estimate"])
    return found


def add_figures(folder: Path, figures: Mapping[str, float], took: float) -> None:
    """Puts these figures behind those of training, instead of any from earlier probes, which MLflow is then sent again."""
    rows = read_metrics(folder).to_pylist()
    kept = [row for row in rows if not row["name"].startswith(PREFIX)]
    frames = max((row["frames"] for row in kept), default=0)
    seconds = max((row["seconds"] for row in rows), default=0.0) + took  # later than any: MLflow shows the latest
    new = [{"name": name, "frames": frames, "seconds": seconds, "value": value} for name, value in figures.items()]
    mark = read_mark(folder)
    if mark is not None and mark.sent > len(kept):
        write_json(folder / MARK, dataclasses.asdict(dataclasses.replace(mark, sent=len(kept))))
    write_rows(folder / METRICS, kept + new, METRIC_SCHEMA)


def tell(run: RunConfig, folder: Path, say: Callable[[str], None]) -> None:
    """Sends MLflow what it lacks of the run, if it is told of it at all; what it misses is told, with the way out."""
    if run.tracking.name == "none":
        return
    try:
        Delivery(run, folder).send(read_metrics(folder).to_pylist(), files_of(folder), "FINISHED")
    except TrackingError as error:
        say(f"{error}. It lacks the probes of this run; this sends them: python -m experiments.upload run={folder}")
