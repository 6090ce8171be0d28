"""Pieces of rows that need no training here: of players, of methods that were trained elsewhere, and of files of actions."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from segar.evaluation import record_actions
from segar.experiments.benchmarking.level_sets import LevelSet, hashes_of, plays_twins, sets_of
from segar.experiments.benchmarking.playing import (
    options_of,
    play_actions,
    play_file,
    play_player,
    read_actions,
    write_actions,
)
from segar.experiments.benchmarking.policy_process import SECONDS, PolicyProcess
from segar.experiments.benchmarking.protocol import ONNX, SIDES, piece_name
from segar.experiments.benchmarking.row import Method, Piece, file_hash, read_piece, write_piece
from segar.experiments.runs.executed_code import code_after, code_of
from segar.experiments.runs.files import write_bytes
from segar.experiments.runs.versions import versions
from segar.experiments.settings import RunFolderError, without_files
from segar.suites import Suite, suite
from segar.support import content_of

ACTIONS, MODEL = "actions.npz", f"policy{ONNX}"


@dataclass(frozen=True)
class PlayerTask:
    """One piece: the method, the suite, the seed, and the folder that it is written to.

    ``policy`` names a function ``(training side, seed) -> policy`` of a method that was trained elsewhere, for whose answers
    ``seconds`` are waited, or its ONNX files; ``actions`` is the folder with its files of actions. Both are empty for the
    players of the benchmark.
    """

    method: Method
    suite: str
    seed: int
    folder: Path
    policy: str = ""
    actions: str = ""
    seconds: float = SECONDS

    def is_done(self) -> bool:
        """Whether the piece is there for this version of the suite; what was made elsewhere may have changed."""
        found = None if self.policy or self.actions else read_piece(self.folder)
        return found is not None and found.piece.suite_hash == suite(self.suite).hash


def make_piece(task: PlayerTask) -> None:
    """Plays a piece and writes it."""
    of, player = suite(task.suite), task.method.name
    sets = sets_of(of, task.seed, with_twins=plays_twins(task.method))
    made_with = {name: found for name, found in versions().items() if name != "platform"}
    code = code_of(without_files(task.method.settings))  # here, because a policy could tell of other code
    if task.method.kind == "player":
        file, episodes = "", play_player(player, of, sets, task.seed)
    elif task.method.kind == "onnx":
        given, file = onnx_file(Path(task.policy), task.suite, task.seed), MODEL
        write_bytes(task.folder / file, content_of(given, "ONNX file", RunFolderError))
        episodes = play_file(task.folder / file, of, task.method, sets, task.seed)
    else:
        if task.actions:
            path = action_file(Path(task.actions), task.suite, task.seed)
            actions, made_with["actions"] = read_actions(path), file_hash(path)
        else:
            actions = actions_of(task, of, sets)
        file, episodes = ACTIONS, play_actions(actions, of, sets, task.seed)
        write_actions(task.folder / ACTIONS, actions)
        sets = {name: sets[name] for name in actions}
    made_with |= {"code": code_after(code, print)} if code else {}
    write_piece(task.folder, Piece(of.name, of.hash, task.seed, hashes_of(sets), "", file, 0, made_with), episodes)


def action_file(folder: Path, suite: str, seed: int) -> Path:
    """The file of actions of a suite with a seed: ``<suite>-s<seed>.npz``."""
    return folder / f"{piece_name(suite, seed)}.npz"


def onnx_file(given: Path, suite: str, seed: int) -> Path:
    """The ONNX file of a suite with a seed: that file, or ``<suite>-s<seed>.onnx`` in that folder."""
    return given / f"{piece_name(suite, seed)}{ONNX}" if given.is_dir() else given


def actions_of(task: PlayerTask, of: Suite, sets: Mapping[str, LevelSet]) -> dict[str, np.ndarray]:
    """The actions that a policy takes on level sets; see :func:`segar.evaluation.record_actions` and
    :class:`segar.experiments.benchmarking.policy_process.PolicyProcess`, which says what is raised."""
    # What is seen may differ from side to side, but its numbers do not.
    options = {
        side: {**options_of(of, task.method, sets["train"].levels, side), "unit_actions": False} for side in SIDES
    }
    with PolicyProcess(task.policy, of, task.seed, options["train"], task.seconds) as policy:
        return {key: record_actions(policy, one.levels, **options[one.side]) for key, one in sets.items()}
