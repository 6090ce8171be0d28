"""Plays the levels of a suite by a network, by recorded actions, or by a player without training: equal bits everywhere."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from segar.envs import Policy
from segar.evaluation import Idle, PlayedEpisodes, Random, RecordedActions, Scripted, evaluate_levels, play_episodes
from segar.experiments.benchmarking.level_sets import LevelSet, number_of_levels, sets_of
from segar.experiments.benchmarking.protocol import CONTROL, ONNX, SIDES, TWIN
from segar.experiments.benchmarking.row import EPISODES, Method, Piece
from segar.experiments.levels.builders import Prepared
from segar.experiments.settings import LevelsConfig, ObservationConfig, RunConfig, RunFolderError, construct
from segar.levels import Levels, hash_of_levels
from segar.policies import Network, NetworkPolicy, OnnxPolicy
from segar.suites import RANDOM_PLAYS, Suite, plans_on
from segar.support import Form, open_npz

SEED = 0  # of the environments


def options_of(suite: Suite, method: Method, train: Levels, side: str) -> dict[str, Any]:
    """Options of the environments in which a network plays levels of a side: it observes them as it did in training."""
    seen = construct(ObservationConfig, method.settings.get("observation", {}), "observation")
    run = RunConfig(levels=LevelsConfig(train=suite.name), observation=seen)
    return Prepared(run).env_options(train=train, which=side)


def policy_in(file: Path) -> tuple[Policy, bool]:
    """The policy in a file of a row, a network or an ONNX model, and whether its actions lie in [-1, 1] in any task."""
    if file.suffix == ONNX:
        return OnnxPolicy(file), False
    return NetworkPolicy(Network.load(file), unit_actions=True), True


def play_file(file: Path, suite: Suite, method: Method, sets: Mapping[str, LevelSet], seed: int) -> pa.Table:
    """The episodes of the policy in a file, without noise, one on each level."""
    policy, unit = policy_in(file)
    options = {side: {**options_of(suite, method, sets["train"].levels, side), "unit_actions": unit} for side in SIDES}
    played = {name: play_each(one.levels, policy, options[one.side]) for name, one in sets.items()}
    return table_of(suite, seed, sets, played)


def play_actions(actions: Mapping[str, np.ndarray], suite: Suite, sets: Mapping[str, LevelSet], seed: int) -> pa.Table:
    """The episodes of actions, float32 ``[level, step, component]`` in the task's range, one on each level of the sets that
    have some; behind the last step nothing is done."""
    found = {}
    for name, given in actions.items():
        if name not in sets:
            raise RunFolderError(
                f"{suite.name}, seed {seed}: there are actions of '{name}', and the level sets are {', '.join(sets)}"
            )
        levels = sets[name].levels
        shape = (len(levels), len(suite.task.action_low))
        if given.ndim != 3 or (given.shape[0], given.shape[2]) != shape:
            raise RunFolderError(
                f"{suite.name}, seed {seed}: actions of the {name} levels must be [{shape[0]} levels, steps, {shape[1]}], not"
                f" {list(given.shape)}"
            )
        found[name] = evaluate_levels(RecordedActions(given), levels, seed=SEED, task=suite.task).episodes
    return table_of(suite, seed, sets, found)


def play_each(levels: Levels, policy: Policy, options: Mapping[str, Any], plays: int = 1) -> PlayedEpisodes:
    """``plays`` episodes on each level."""
    return play_episodes(levels, np.tile(np.arange(len(levels)), plays), policy, seed=SEED, **options)


def play_player(player: str, suite: Suite, sets: Mapping[str, LevelSet], seed: int) -> pa.Table:
    """The episodes of a player that needs no file; the planner searches."""
    options = {"task": suite.task}
    if player == "planner":
        plans = {side: plans_on(suite, side, one.levels, seed) for side, one in sets.items()}
        return play_actions({side: one.actions for side, one in plans.items()}, suite, sets, seed)
    if player == "random":
        played = {
            side: play_each(one.levels, Random(seed, SIDES.index(side)), options, RANDOM_PLAYS)
            for side, one in sets.items()
        }
    else:
        policy = {"idle": Idle, "script": Scripted}[player]()
        played = {name: play_each(one.levels, policy, options) for name, one in sets.items()}
    return table_of(suite, seed, sets, played)


def table_of(suite: Suite, seed: int, sets: Mapping[str, LevelSet], played: Mapping[str, PlayedEpisodes]) -> pa.Table:
    """Episodes as a table, :data:`EPISODES`."""
    parts = []
    for name, episodes in played.items():
        n, found = len(episodes), episodes.columns()
        found["level"] = sets[name].numbers[found["level"]]
        columns = {"suite": [suite.name] * n, "seed": np.full(n, seed), "levels": [name] * n}
        parts.append(pa.table({name: pa.array({**columns, **found}[name]) for name in EPISODES.names}, EPISODES))
    return pa.concat_tables(parts)


def write_actions(path: Path, actions: Mapping[str, np.ndarray]) -> None:
    """Writes actions by level set, npz without pickle."""
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez_compressed(path, **{side: np.asarray(one, np.float32) for side, one in actions.items()})  # type: ignore[arg-type]


def read_actions(path: Path) -> dict[str, np.ndarray]:
    """Actions by level set; raises :class:`RunFolderError` unless they are finite float32 ``[level, step, component]``."""
    with open_npz(path, "file of actions", RunFolderError) as npz:
        names = [name for name in npz.names if name in SIDES or name.startswith((TWIN, CONTROL))]
        if "test" not in names:
            raise RunFolderError(
                f"{path} has no array 'test': float32 [levels, steps, components], and 'train' beside it"
            )
        found = npz.read({side: Form("float32", (f"{side} levels", f"{side} steps", "components")) for side in names})
    for side, array in found.items():
        if not np.isfinite(array).all():
            raise RunFolderError(f"{path}: some actions of '{side}' are not finite")
    return found


def replay(method: Method, piece: Piece, suite: Suite, folder: Path) -> pa.Table:
    """The episodes of a piece, played again by what its row holds.

    Raises:
        SegarError: training levels are not those of the row, or its file cannot be read.
    """
    sets = sets_of(suite, piece.seed, number_of_levels(method), with_twins=not {*piece.levels} <= {*SIDES})
    for name, there in piece.levels.items():
        here = hash_of_levels(sets[name].levels) if name in sets else "none"
        if here != there:
            raise RunFolderError(
                f"{folder.name}: the {name} levels of {suite.name} with seed {piece.seed} are not those that the row was"
                f" made on: {here} here, {there} there"
            )
    if method.kind == "player":
        return play_player(method.name, suite, sets, piece.seed)
    if method.kind == "actions":
        return play_actions(read_actions(folder / piece.file), suite, sets, piece.seed)
    return play_file(folder / piece.file, suite, method, sets, piece.seed)
