"""Pieces of rows that need no training here: of players, of methods that were trained elsewhere, and of files of actions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.benchmarking.level_sets import LevelSet, hashes_of, plays_twins, sets_of
from experiments.benchmarking.playing import options_of, planned, play_actions, play_player, read_actions, write_actions
from experiments.benchmarking.protocol import piece_name
from experiments.benchmarking.row import Method, Piece, file_hash, read_piece, write_piece
from experiments.runs.executed_code import code_after, code_of
from experiments.runs.versions import versions
from experiments.settings import ConfigError, import_object, without_files
from segar.evaluation import record_actions
from segar.suites import Suite, suite

ACTIONS = "actions.npz"


@dataclass(frozen=True)
class PlayerTask:
    """One piece: the method, the suite, the seed, and the folder that it is written to.

    ``policy`` names a function ``(suite, seed) -> policy`` of a method that was trained elsewhere; ``actions`` is the folder
    with its files of actions. Both are empty for the players of the benchmark.
    """

    method: Method
    suite: str
    seed: int
    folder: Path
    policy: str = ""
    actions: str = ""

    def is_done(self) -> bool:
        """Whether the piece is there for this version of the suite; what was made elsewhere may have changed."""
        found = read_piece(self.folder)
        return (
            not (self.policy or self.actions) and found is not None and found.piece.suite_hash == suite(self.suite).hash
        )


def make_piece(task: PlayerTask) -> dict[str, float]:
    """Plays a piece and writes it; returns nothing to show."""
    of, player = suite(task.suite), task.method.name
    sets = sets_of(of, task.seed, with_twins=plays_twins(task.method))
    found = versions()
    made_with = {name: found[name] for name in ("python", "libraries", "git")}
    if task.method.kind == "player":
        file, episodes = "", play_player(player, of, sets, task.seed)
    else:
        if task.actions:
            path = action_file(Path(task.actions), task.suite, task.seed)
            actions, made_with["actions"] = read_actions(path), file_hash(path)
        elif task.policy:
            import_object(task.policy, "policy")  # first, so that the files it names are known from here on
            code = code_of(without_files(task.policy, "policy"))
            actions = actions_of(task.policy, of, sets, task)
            made_with["code"] = code_after(code, print)
        else:
            actions = planned(of, sets, task.seed)
        file, episodes = ACTIONS, play_actions(actions, of, sets, task.seed)
        write_actions(task.folder / ACTIONS, actions)
        sets = {name: sets[name] for name in actions}
    write_piece(task.folder, Piece(of.name, of.hash, task.seed, hashes_of(sets), "", file, 0, made_with), episodes)
    return {}


def action_file(folder: Path, suite: str, seed: int) -> Path:
    """The file of actions of a suite with a seed: ``<suite>-s<seed>.npz``."""
    return folder / f"{piece_name(suite, seed)}.npz"


def actions_of(name: str, of: Suite, sets: Mapping[str, LevelSet], task: PlayerTask) -> dict[str, np.ndarray]:
    """The actions that a policy takes, which ``name``, ``module:attribute``, makes for a suite and a seed; see
    :func:`segar.evaluation.record_actions`.

    Raises:
        ConfigError: there is no such function, or what it returns is no policy.
    """
    make: Callable[..., Any] = import_object(name, "policy")
    made = make(of, task.seed) if callable(make) else None
    if not callable(made):
        raise ConfigError(
            f"policy: {name} must be a function of a suite and a seed that returns a policy, a function of observations; it"
            f" {'returns ' + type(made).__name__ if callable(make) else 'is ' + type(make).__name__}"
        )
    found = {}
    for key, one in sets.items():  # what is seen may differ from side to side
        options = {**options_of(of, task.method, sets["train"].levels, one.side), "unit_actions": False}
        found[key] = record_actions(made, one.levels, **options)
    return found
