"""What all rows of the benchmark share: the budgets, players without training, names."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from segar.errors import did_you_mean
from segar.experiments.runs.files import absolute_path
from segar.experiments.settings import ConfigError
from segar.suites import CORE, suites
from segar.support import ROWS

ALL = "all"  # all suites that come with SEGAR
# Frames of training on each suite with each seed; None: as many as ``scale.frames`` says.
BUDGETS: Mapping[str, int | None] = {"laptop": 200_000, "server": 5_000_000, "open": None}
# Rows without training, which ``algorithm=`` may name, and what each of them does.
PLAYERS: Mapping[str, str] = {
    "idle": "does nothing",
    "random": "acts uniformly at random",
    "script": "the scripted player of the task, which sees the true factors",
    "planner": "the best actions that a search in the simulator finds",
}
# The rows that scores are made of: 0 is the better of the first two on each level, 1 is the third.
REFERENCES = ("idle", "random", "planner")
# Players that know more than a policy may: the true factors, or the simulator.
PRIVILEGED = ("script", "planner")
# The version of the protocol by which levels are drawn from what a row is; rows of different ones do not compare.
PROTOCOL = 2
# The folder of the rows that come with SEGAR.
SHIPPED = ROWS
# How names of files of ONNX models end.
ONNX = ".onnx"
SIDES = ("train", "test")
# How names of sets of causal twins begin: where training and test differ in the group of factors, and where they do not.
TWIN, CONTROL = "twin-", "control-"


def suites_named(names: Sequence[str]) -> tuple[str, ...]:
    """The suites that names stand for, each once: names of suites, ``core`` or ``all``; raises :class:`ConfigError`."""
    found: dict[str, None] = {}
    for name in names:
        known = {"core": CORE, ALL: suites(), **{one: (one,) for one in suites()}}
        if name not in known:
            raise ConfigError(f"suite: no suite is called '{name}'.{did_you_mean(name, known)}")
        found |= dict.fromkeys(known[name])
    return tuple(found)


def piece_name(suite: str, seed: int) -> str:
    """The name of the part of a row that is one suite with one seed."""
    return f"{suite}-s{seed}"


def row_folder(name: str, places: Sequence[Path]) -> Path:
    """The folder of a row: a path, or a name in the first of some places that has it; raises :class:`ConfigError`."""
    for folder in (absolute_path(name), *(place / name for place in places)):
        if (folder / "row.json").exists():
            return folder.resolve()
    known = sorted({path.parent.name for place in places for path in place.glob("*/row.json")})
    raise ConfigError(
        f"verify: there is no row '{name}'.{did_you_mean(name, known)} Rows: {', '.join(known) or 'none'}"
    )
