"""Probes of finished runs: what they measure of a representation, and ``probes.parquet``, which holds the results.

The code that probes is a plug-in: the entry point ``default`` of the group ``segar.probes``, a function of the run folder
and a :class:`ProbeConfig` that returns a ``pandas.DataFrame``. It is loaded only where a run is probed.
"""

import dataclasses
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

import pyarrow as pa

from segar.errors import SegarError
from segar.experiments.commands.plugin import find_plugin
from segar.experiments.runs.executed_code import fingerprint
from segar.experiments.runs.files import read_table, write_parquet
from segar.experiments.runs.run_folder import (
    METRIC_SCHEMA,
    METRICS,
    PROBES,
    SYNC_STATE,
    folder_path,
    lock,
    read_metrics,
    write_json,
    write_rows,
)
from segar.experiments.settings import (
    ActionMode,
    Count,
    CountFrom0,
    RunConfig,
    RunFolderError,
    Settings,
    TrackingError,
    as_data,
    require,
    require_known,
    that,
)
from segar.experiments.tracking.mlflow_sync import RunSync, files_of, read_sync_state

ABOUT = b"segar"  # key of the file's metadata: the settings ("asked"), the fingerprint of the code, the seconds
TRAINED, IDENTITY = "trained", "identity"
ON_BOTH = (TRAINED, IDENTITY)  # are probed on training and test levels, the others on test levels only
BOUNDS, READOUTS, KSG = ("jsd", "infonce", "smile"), ("ridge", "mlp"), "ksg"
REPRESENTATIONS = (TRAINED, "random encoder", "pixel PCA", IDENTITY, "shuffled")
EVERYTHING = (*BOUNDS, *READOUTS, KSG)
PREFIX = "probes/"  # begins the names of figures


def check_representations(place: str, representations: Mapping[str, Sequence[str]]) -> None:
    """Raises :class:`ConfigError` unless representations and their probes are known."""
    for name, probes in representations.items():
        require_known(place, name, REPRESENTATIONS)
        is_list = isinstance(probes, Sequence) and not isinstance(probes, str)
        allowed = f"a list of {', '.join(EVERYTHING)}, and one of them other than {KSG}, which only adds to readouts"
        require(is_list and any(probe != KSG for probe in probes), f"{place}.{name}", probes, allowed)
        for probe in probes:
            require_known(f"{place}.{name}", probe, EVERYTHING)


@dataclass(frozen=True)
class ProbeConfig(Settings):
    """What the probes of a run measure. The defaults measure everything, which takes minutes."""

    frames: Count = 5000  # of training levels, and as many of test levels
    num_envs: Count = 128  # episodes that are played at once; ksg needs 100
    # Actions are sampled, as in 2022; deterministic ones play one level again and again in the same way.
    mode: ActionMode = "sampled"
    replicates: Count = 5  # of critics, which give the intervals of accuracies
    steps: Count = 300  # of each critic
    batch: Annotated[int, that(lambda n: n >= 2, "at least 2")] = 128
    # For the accuracy as in 2022, which had ten episodes of at most 101.
    paper_frames: Annotated[int, that(lambda n: n >= 64, "at least 64, one batch")] = 1000
    paper_replicates: CountFrom0 = 5  # of that; 0: none
    # The probes of each representation: bounds, readouts, and ksg, which belongs to the readouts.
    representations: Annotated[Mapping[str, Sequence[str]], check_representations] = field(
        default_factory=lambda: dict.fromkeys(REPRESENTATIONS, EVERYTHING)
    )


def is_probed(run: RunConfig, config: ProbeConfig) -> bool:
    """Whether the run's folder holds what the installed probes measure with these settings."""
    about = read_about(folder_path(run))
    return about is not None and about["asked"] == as_data(config) and about["code"] == code_of_probes()


find_probes = cache(partial(find_plugin, "segar.probes", "default"))  # the plug-in that probes
print_at_once = partial(print, flush=True)  # so that logs can be read while they are written


def probe_finished(run: RunConfig, config: ProbeConfig, say: Callable[[str], None] = print_at_once) -> dict[str, float]:
    """Probes a finished run: writes ``probes.parquet``, adds to the run's figures, sends these to MLflow; returns them.

    Raises:
        ConfigError: no probes are installed.
        RunFolderError: the run cannot be probed; the message says which run, why, and what to do.
    """
    folder, probe = folder_path(run), find_probes().load()
    say(f"{run.label()}: probes")
    began = time.perf_counter()
    try:
        table = pa.Table.from_pandas(probe(folder, config), preserve_index=False)
    except SegarError as error:
        raise RunFolderError(
            f"the probes of {run.label()} failed: {error}. The run is kept, and the same command probes it again; "
            "settings of probes are probes.<scale>...=, and grids.<experiment>.probes=false leaves them out"
        ) from error
    took = time.perf_counter() - began
    rows = table.to_pylist()
    figures = figures_of(rows)
    about = {"asked": as_data(config), "code": code_of_probes(), "seconds": took}
    with lock(folder):
        add_figures(folder, figures, took)
        described = table.replace_schema_metadata({ABOUT: json.dumps(about).encode()})
        write_parquet(folder / PROBES, described)  # last: it is there if and only if the figures are
        send_to_tracker(run, folder, say)
    say(f"{run.label()}: probed in {took:.1f} s, accuracy {figures.get(PREFIX + 'accuracy/test', float('nan')):.3f}")
    of_trained = [row for row in rows if row["representation"] == TRAINED and row["levels"] == "test"]
    if notes := [row["note"] for row in of_trained if row.get("note")]:
        say(
            f"{len(notes)} of {len(of_trained)} results on test levels have a note, most often: {max(notes, key=notes.count)}"
        )
    return figures


def read_about(folder: Path) -> dict[str, Any] | None:
    """The settings of the probes of a run (``asked``), the fingerprint of their ``code``, and their ``seconds``; None
    where the run was not probed, or its file is damaged, so that it is probed again."""
    try:
        return json.loads((read_table(folder / PROBES, []).schema.metadata or {})[ABOUT])
    except (KeyError, ValueError):
        return None


def code_of_probes() -> str:
    """A fingerprint of the code that measures, not of the library that is measured."""
    return fingerprint(find_probes().module)


def figures_of(rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """The figures of a run: accuracies, those of controls, and how well each factor is read on test levels."""
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
    """Writes these figures after those of training, in place of those of earlier probes; MLflow is to get them again."""
    rows = read_metrics(folder).to_pylist()
    kept = [row for row in rows if not row["name"].startswith(PREFIX)]
    frames = max((row["frames"] for row in kept), default=0)
    seconds = max((row["seconds"] for row in rows), default=0.0) + took  # later than any: MLflow shows the latest
    new = [{"name": name, "frames": frames, "seconds": seconds, "value": value} for name, value in figures.items()]
    mark = read_sync_state(folder)
    if mark is not None and mark.sent > len(kept):
        write_json(folder / SYNC_STATE, dataclasses.asdict(dataclasses.replace(mark, sent=len(kept))))
    write_rows(folder / METRICS, kept + new, METRIC_SCHEMA)


def send_to_tracker(run: RunConfig, folder: Path, say: Callable[[str], None]) -> None:
    """Sends MLflow what it lacks of a tracked run; where that fails, ``say`` gets the error and the command to repeat it."""
    if run.tracking.name == "none":
        return
    sync = RunSync(run, folder)
    try:
        sync.send(read_metrics(folder).to_pylist(), files_of(folder), "FINISHED")
    except TrackingError as error:
        say(f"{error}. It lacks the probes of this run; this sends them: {sync.command}")
