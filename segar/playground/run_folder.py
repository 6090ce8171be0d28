"""What a page takes of a run folder, or of a row of the benchmark: the network that plays without torch, what it observes,
and what probes found in it.

Settings are read as plain data, and nothing that they name is imported: own tasks, factors and parameters are those of the
levels that are played.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from os.path import getmtime
from pathlib import Path
from typing import Any

from segar.errors import SegarError, naming
from segar.language import Task
from segar.levels import Levels
from segar.observations import OBSERVATIONS, Observation, trained_on
from segar.policies import NETWORK_FILE, Network, load
from segar.suites import Suite, named_observation
from segar.support import ROWS, data_in, need, read_table, resolve, shown
from segar.tasks import make_task, task_of

CONFIG, LEVELS_TRAIN, PROBES = "config.yaml", "levels_train.npz", "probes.parquet"  # files of a run folder
IN_EVALUATIONS = f"evaluations/*/{NETWORK_FILE}"
SHOWN = {"representation": "trained", "probe": "ridge", "quantity": "r2", "levels": "test"}  # of the table of probes
NUMBERS = ("estimate", "low", "high")
PART = {"name": str, "options?": (dict, None)}
SETTINGS = {"observation": PART, "task?": PART}
ROW = "row.json"  # of a row of the benchmark
ROW_FORM = {
    "kind": str,
    "settings": {"observation?": PART},
    "pieces": [{"suite": str, "suite_hash": str, "seed": int, "file": str}],
}
OF_LEVELS, PUTTPUTT = "levels", "puttputt"  # the task of the levels, and of levels that name none
MOST_ROWS = 100_000  # of a table of probes
LONGEST = 2**20  # [bytes] of the settings of a run


@dataclass(frozen=True)
class RunPolicy:
    """A network, and what is known of the run that trained it.

    Attributes:
        place: the network's file.
        observations: what it reads, in the units of the run's training levels, by its name; empty where that is not known.
        task: what the run plays; None where its settings are not there.
        probes: component of a factor, such as ``goal.Position.x``, to R² on test levels of a linear probe of what the
            network's encoder gives, and to its interval; empty where the run was not probed.
        test_observations: what it reads on the test of a suite, of a row. seed: of the row's training levels.
    """

    network: Network
    place: Path
    observations: Mapping[str, Observation] = field(default_factory=dict)
    task: Task | None = None
    probes: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    test_observations: Mapping[str, Observation] | None = None
    seed: int = 0


def read_policy(
    path: Path, levels: Levels, *, observations: Mapping[str, Observation] | None = None, task: str | None = None
) -> RunPolicy:
    """The network in a file, or the newest one in the folder of a run or of an evaluation.

    Args:
        levels: which it shall play. They define what the settings of the run name: the task, where it is theirs, and factors
            and parameters that an observation shows. Nothing else is imported.
        observations: what the policy reads, instead of what the settings say; in the units of the run's training levels, too.
        task: the name of the task, instead of what the settings say; with the run's options, where the run plays this one.

    Raises:
        SegarError: there is none, which says how to write it; or something cannot be read; or the settings name a task or an
            observation of the user's own that the levels do not bring.
    """
    place, run = _network_of(path)
    network, settings, seen = Network.load(place), {}, observations or {}
    if (run / CONFIG).exists():
        settings = _settings(run / CONFIG)
        seen = seen or _observation(run / CONFIG, settings)
        if (run / LEVELS_TRAIN).exists():
            train = Levels.load(run / LEVELS_TRAIN, levels.world)
            seen = {name: trained_on(one, train) for name, one in seen.items()}
    probes = _probes(run / PROBES) if (run / PROBES).exists() else {}
    return RunPolicy(network, place, seen, _task(run / CONFIG, settings, levels, task), probes)


def read_row_policy(folder: Path, suite: Suite) -> RunPolicy:
    """The first network of a row of the benchmark that was trained on a suite and is here, or else its first one, which is
    fetched where the row is published.

    Raises:
        SegarError: the row has none, or was made with another version of the suite; or its file cannot be read or fetched.
    """
    path = folder / ROW
    advice = "; make the row again with segar benchmark"
    row = data_in(path, "a description of a row", SegarError, limit=LONGEST, form=ROW_FORM, advice=advice)
    networks = row["pieces"] if row["kind"] == "networks" and "observation" in row["settings"] else []
    pieces = [one for one in networks if one["suite"] == suite.name]
    if not pieces:
        known = ", ".join(dict.fromkeys(one["suite"] for one in networks)) or f"'{row['kind']}' alone"
        raise SegarError(f"{path} has no network of {suite.name}, and has {known}; take another row")
    places = [folder / Path(one["file"]).name for one in pieces]
    place, piece = next((one for one in zip(places, pieces, strict=True) if one[0].exists()), (places[0], pieces[0]))
    if piece["suite_hash"] != suite.hash:
        raise SegarError(
            f"{path}: the network of {suite.name} was trained on another version of the suite; train it again"
        )
    train, seen = suite.sample(piece["seed"]), row["settings"]["observation"]
    observations = []
    for side in ("train", "test"):
        name, options = named_observation(suite, side, seen["name"], seen.get("options"))
        made = resolve(name, OBSERVATIONS, "observation", ())(**options)
        observations.append({seen["name"]: trained_on(made, train)})
    is_published = not place.exists() and folder.parent == ROWS
    network = load(folder.name, suite.name, piece["seed"]).network if is_published else Network.load(place)
    return RunPolicy(network, place, observations[0], suite.task, {}, observations[1], piece["seed"])


def _network_of(path: Path) -> tuple[Path, Path]:
    """The file of a network, and the folder of its run; no such folder is known of a file that is named itself."""
    if not path.exists():
        raise SegarError(f"there is no {path}; name a network's file, or the folder of a run")
    if not path.is_dir():
        return path, path
    is_evaluation = (path / NETWORK_FILE).exists()
    found = [path / NETWORK_FILE] if is_evaluation else sorted(path.glob(IN_EVALUATIONS), key=getmtime)
    if not found:
        raise SegarError(
            f"{path}: there is no {NETWORK_FILE}, neither here nor in {IN_EVALUATIONS}, which plays without torch; write"
            f" it by: segar evaluate run={path} portable=true"
        )
    return found[-1], path.parent.parent if is_evaluation and not (path / CONFIG).exists() else path


def _settings(path: Path) -> dict[str, Any]:
    """The settings of a run that are read here."""
    need("reading the settings of a run", "yaml")
    from segar.support import read_yaml

    advice = "; say --observation and --task, and move the file away"
    return data_in(path, "a file of settings", SegarError, read_yaml, LONGEST, SETTINGS, advice=advice)


def _observation(path: Path, settings: Mapping[str, Any]) -> dict[str, Observation]:
    """What the agent of a run observes, by its name in the settings."""
    advice = "say what the policy reads by --observation"
    name, options = settings["observation"]["name"], settings["observation"].get("options") or {}
    try:
        return {name: resolve(name, OBSERVATIONS, "observation", ())(**options)}
    except (TypeError, SegarError) as error:
        raise SegarError(f"{path}: the observation {shown(name)} cannot be made ({error}); {advice}") from error


def _task(path: Path, settings: Mapping[str, Any], levels: Levels, wanted: str | None) -> Task | None:
    """The task of a run with its options, or the one that is wanted."""
    said = settings.get("task")
    if said is None:
        return None if wanted is None else make_task(wanted)
    name = (levels.task or PUTTPUTT) if said["name"] == OF_LEVELS else said["name"]
    if wanted is not None:
        return make_task(wanted, said.get("options") if wanted == name else None)
    options = said.get("options")
    with naming(f"{path}: the task {shown(name)} cannot be made"):
        return task_of(levels, options) if name == levels.task else make_task(name, options, trusted=())


def _probes(path: Path) -> dict[str, tuple[float, float, float]]:
    """R² of linear probes in a run's table, with intervals."""
    table = read_table(path, "table of probes", SegarError, [*SHOWN, "factor", *NUMBERS])
    if table.num_rows > MOST_ROWS:
        raise SegarError(
            f"{path} has {table.num_rows:,} rows, and a table of probes {MOST_ROWS:,} at most; probe the run again"
        )
    rows = [[one[name] for name in ("factor", *NUMBERS)] for one in table.to_pylist() if SHOWN.items() <= one.items()]
    # What does not vary has no R².
    known = [row for row in rows if None not in row and all(map(math.isfinite, row[1:]))]
    return {str(factor): (float(r2), float(low), float(high)) for factor, r2, low, high in known}
