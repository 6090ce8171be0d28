"""What a page takes of a run folder: the network that plays without torch, what it observes, and what probes found in it.

Settings are read as plain data, and nothing that they name is imported.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from segar.errors import SegarError
from segar.levels import Levels
from segar.observations import OBSERVATIONS, Observation, trained_on
from segar.policies import NETWORK_FILE, Network
from segar.support import DAMAGE, first_line, need

CONFIG, LEVELS_TRAIN, PROBES = "config.yaml", "levels_train.npz", "probes.parquet"  # files of a run folder
IN_EVALUATIONS = f"evaluations/*/{NETWORK_FILE}"
SHOWN = {"representation": "trained", "probe": "ridge", "quantity": "r2", "levels": "test"}  # of the table of probes
NUMBERS = ("estimate", "low", "high")
MOST_ROWS = 100_000  # of a table of probes


@dataclass(frozen=True)
class RunPolicy:
    """A network of a run.

    Attributes:
        place: its file.
        observations: what the agent of the run observes, in the units of its training levels, by its name in the settings;
            empty where no settings are there.
        probes: component of a factor, such as ``goal.Position.x``, to R² on test levels of a linear probe of what the
            network's encoder gives, and to its interval; empty where the run was not probed.
    """

    network: Network
    place: Path
    observations: Mapping[str, Observation] = field(default_factory=dict)
    probes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)


def read_policy(path: Path, *, observes: bool = True) -> RunPolicy:
    """The network in a file, or the newest one in the folder of a run or of an evaluation.

    Args:
        observes: whether the settings of the run say what the policy observes.

    Raises:
        SegarError: there is none, which says how to write it; or something cannot be read, or is the user's own observation.
    """
    if not path.exists():
        raise SegarError(f"there is no {path}; name a network's file, or the folder of a run")
    if not path.is_dir():
        return RunPolicy(Network.load(path), path)
    is_evaluation = (path / NETWORK_FILE).exists()
    found = [path / NETWORK_FILE] if is_evaluation else sorted(path.glob(IN_EVALUATIONS), key=_written)
    if not found:
        raise SegarError(
            f"{path}: there is no {NETWORK_FILE}, neither here nor in {IN_EVALUATIONS}, which plays without torch; write"
            f" it by: python -m experiments.evaluate run={path} portable=true"
        )
    run = path.parent.parent if is_evaluation and not (path / CONFIG).exists() else path
    observations = _observation(run) if observes and (run / CONFIG).exists() else {}
    probes = _probes(run / PROBES) if (run / PROBES).exists() else {}
    return RunPolicy(Network.load(found[-1]), found[-1], observations, probes)


def _written(path: Path) -> float:
    return path.stat().st_mtime


def _observation(run: Path) -> dict[str, Observation]:
    """What the agent of a run observes, by its name in the settings."""
    advice = "say what the policy reads by --observation"
    need("reading the settings of a run", "yaml")
    import yaml

    path = run / CONFIG
    try:
        settings = yaml.safe_load(path.read_text(encoding="utf-8"))
        name, options = settings["observation"]["name"], settings["observation"].get("options") or {}
    except (yaml.YAMLError, UnicodeDecodeError, TypeError, KeyError, AttributeError) as error:
        raise SegarError(f"{path} holds no settings of a run ({type(error).__name__}); {advice}") from error
    if name not in OBSERVATIONS or not isinstance(options, Mapping):
        raise SegarError(f"{path}: the observation {name!r} is not one of SEGAR, and is not imported; {advice}")
    try:
        made = OBSERVATIONS[name](**options)
    except (TypeError, SegarError) as error:
        raise SegarError(f"{path}: the observation {name!r} cannot be made: {error}; {advice}") from error
    train = run / LEVELS_TRAIN
    is_known = not hasattr(made, "trained_on") or not train.exists()
    return {name: made if is_known else trained_on(made, Levels.load(train))}


def _probes(path: Path) -> dict[str, tuple[float, float, float]]:
    """R² of linear probes in a run's table, with intervals."""
    need("reading the probes of a run", "pyarrow")
    from pyarrow import ArrowException, parquet

    advice = "probe the run again, or take the file out of the folder"
    try:
        with parquet.ParquetFile(path) as file:
            rows = file.metadata.num_rows
        if rows <= MOST_ROWS:
            is_shown = [(column, "==", value) for column, value in SHOWN.items()]
            table = parquet.read_table(path, columns=["factor", *NUMBERS], filters=is_shown)
            return {
                str(one["factor"]): (float(one["estimate"]), float(one["low"]), float(one["high"]))
                for one in table.to_pylist()
                if all(
                    one[name] is not None and math.isfinite(one[name]) for name in NUMBERS
                )  # it varies on these levels
            }
    except (ArrowException, *DAMAGE) as cause:
        raise SegarError(f"{path} holds no probes of a run: {first_line(cause)}; {advice}") from cause
    raise SegarError(f"{path} has {rows:,} rows, and a table of probes {MOST_ROWS:,} at most; {advice}")
