"""Exact W2 of many runs in one unit, from their level files.

A run measures exact W2 in standard deviations of its own training and test distributions together, so that levels which are
very far away are still about two standard deviations per factor away. Such numbers compare level sets of one pair of
distributions, and not pairs with each other. Here the unit is the same for all: the spread over all of their distributions.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from segar.analysis.tables import Floats
from segar.errors import UnseenDifferenceWarning, naming
from segar.experiments.evaluation.transfers import LEVELS
from segar.experiments.levels.builders import distribution_of
from segar.experiments.runs.files import read_json
from segar.experiments.runs.own_modules import own_packages
from segar.experiments.runs.run_folder import EVALUATIONS, LEVELS_TEST, LEVELS_TRAIN, SUMMARY, TRANSFER, read_config
from segar.experiments.runs.trust import settings_of_file
from segar.experiments.settings import LevelsConfig, RunFolderError, as_data
from segar.levels import Levels
from segar.metrics import spread, w2

COMMON = "w2_exact_common"  # the column


@dataclass(frozen=True)
class LevelPair:
    """What an agent was trained and tested on: the files of the levels, and what their distributions are called."""

    train: Path
    test: Path
    distributions: tuple[str, str]


def own_levels(folder: Path) -> LevelPair:
    """The training levels and the own test levels of a run; raises :class:`SegarError` if its settings cannot be read."""
    levels = read_config(folder).levels
    return LevelPair(folder / LEVELS_TRAIN, folder / LEVELS_TEST, (_named(levels, "train"), _named(levels, "test")))


def transfer_levels(folder: Path, name: str) -> LevelPair | None:
    """The training levels of a run and the levels of the transfer in ``evaluations/<name>``; None for levels in between.

    Raises:
        SegarError: the run's settings cannot be read, or the transfer names code of a package that they do not name and that
            is not trusted.
    """
    there = folder / EVALUATIONS / name
    summary = read_json(there / SUMMARY, TRANSFER)
    if summary["transfer"].get("mixture"):
        return None
    own, trusted = own_levels(folder), own_packages(as_data(read_config(folder)))
    asked = settings_of_file(there / SUMMARY, {"transfer": summary["transfer"]}, trusted)["transfer"]
    test = LevelsConfig(train=asked["panel"], test=asked["panel"], variation=asked["variation"])
    with naming(there / SUMMARY, RunFolderError):
        return LevelPair(own.train, there / LEVELS, (own.distributions[0], _named(test, "test")))


def in_one_unit(tests: Sequence[LevelPair | None]) -> Floats:
    """Exact W2 between training and test levels of each test, float64 ``[test]``, in standard deviations of the factors over
    the distributions of all tests, each of which counts once; NaN for None.

    Raises:
        SegarError: a level file is not there or cannot be read.
    """
    files: dict[str, list[Path]] = {}
    for one in filter(None, tests):
        for name, path in zip(one.distributions, (one.train, one.test), strict=True):
            if not path.exists():
                raise RunFolderError(f"there is no {path}")
            files.setdefault(name, []).append(path)
    # The largest file, where levels stand for themselves because no distribution is saved with them.
    chosen = (max(sorted(set(files[name])), key=lambda path: path.stat().st_size) for name in sorted(files))
    unit = spread(*map(Levels.load, chosen))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnseenDifferenceWarning)  # runs say it before they train
        values = [w2(Levels.load(one.train), Levels.load(one.test), scale=unit) if one else np.nan for one in tests]
    return np.array(values, np.float64)


def count_pairs(tests: Sequence[LevelPair | None]) -> int:
    """How many pairs of training and test distributions there are."""
    return len({one.distributions for one in tests if one})


def _named(levels: LevelsConfig, which: str) -> str:
    """The name of a distribution with its variation. Its entity types are defined from now on, so that levels can be read."""
    distribution_of(levels, which)
    return " ".join(filter(None, levels.named(which)))
