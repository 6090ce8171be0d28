"""Play recorded actions again: a dataset is what it says it is, and files of human play hold levels and actions alone."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from itertools import chain
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from segar.datasets.episodes import Episode, episode_of, roll_out
from segar.datasets.recipe import hash_of_kernel, levels_of, reading, recipe_of
from segar.envs import VectorEnv, play
from segar.errors import SegarError, naming
from segar.language import Task
from segar.levels import Levels, levels_from_data
from segar.observations import OBSERVATIONS, leaves
from segar.rules import World
from segar.support import __version__, check_form, check_size, data_in, from_handwritten_json, shown
from segar.tasks import task_of

# Of recordings of human play.
FORMAT, VERSION = "segar-play", 1
LIMIT = 4 * 2**30  # [bytes] of states and observations
EPISODE = {
    "level": int, "seed": int, "actions": [[float]], "return": float, "terminated": bool, "truncated": bool, "success": bool,
}  # fmt: skip
FORM = {
    "format": str, "version": int, "segar": str, "task": (str, None), "seed": int, "levels": dict, "episodes": [EPISODE],
}  # fmt: skip
"""The form of a recording; see :func:`segar.support.misfit`."""


def check_replay(dataset: Any, *, observation: Any = None, task: Task | None = None, world: World | None = None) -> int:
    """Play the recorded actions of a Minari dataset on its levels, and return how many steps came out the same, to the bit.

    Args:
        dataset: one that :func:`segar.datasets.record` made.
        observation: the one that was recorded. By default the one that the recipe names, if it is a name; else observations
            are not compared.
        task, world: those of the recording, if they are not the levels' own.

    Raises:
        SegarError: something came out differently; the message says in which episode and step, what, and whether rules,
            task or version are those of the recording. Or the dataset has no recipe.
    """
    recipe, levels, steps = recipe_of(dataset), levels_of(dataset, world), 0
    if observation is None and recipe.observation in OBSERVATIONS:
        observation = recipe.observation
    limits = {name: getattr(recipe, name) for name in ("max_steps", "sub_steps", "trials", "unit_actions")}
    for batch, numbers in enumerate(recipe.numbers()):
        n = len(numbers) // recipe.trials
        with reading(dataset.storage.data_path):
            recorded = list(dataset.iterate_episodes(numbers))
            played = np.array([int(one.infos["level"][0]) for one in recorded[:: recipe.trials]])
            actions = _steps_of([one.actions for one in recorded], recipe.trials)
        env = VectorEnv(levels, n, observation=observation or "state", task=task, world=world, **limits)
        try:
            again = roll_out(env, played, recipe.seed_of(batch), lambda observations, actions=actions: next(actions))
            for number, there, here in zip(numbers, recorded, again, strict=True):
                _compare(f"episode {number}", there, here, observation is not None)
                steps += len(here)
        except SegarError as difference:
            if hash_of_kernel(env) == recipe.kernel:
                raise
            raise SegarError(
                f"'{dataset.id}' was recorded with other rules, another task ({recipe.task}) or another SEGAR"
                f" ({recipe.version}); give task= and world= as they were. The first difference: {difference}"
            ) from difference
    return steps


def _steps_of(recorded: list[np.ndarray], trials: int) -> Iterator[np.ndarray]:
    """The actions of all environments in each step; after its recorded end an environment does nothing."""
    rows = [np.concatenate(recorded[at : at + trials]) for at in range(0, len(recorded), trials)]
    whole = np.zeros((max(map(len, rows)), len(rows), recorded[0].shape[1]), np.float32)
    for row, actions in enumerate(rows):
        whole[: len(actions), row] = actions
    return chain(whole, _after_the_end())


def _after_the_end() -> Iterator[np.ndarray]:
    """What is asked for where an episode goes on after all recorded ones have ended: raises :class:`SegarError`."""
    raise SegarError("an episode has another length when its actions are played again")
    yield


def _compare(where: str, there: Any, here: Episode, with_observations: bool) -> None:
    """Raise :class:`SegarError` at the first number in which a recorded episode differs from the one that was played again."""
    if len(there.rewards) != len(here):
        raise SegarError(f"{where} has another length when its actions are played again")
    names = ("rewards", "terminations", "truncations", "infos", *(("observations",) if with_observations else ()))
    for name in names:
        ours, theirs = dict(_arrays(getattr(there, name), name)), dict(_arrays(getattr(here, name), name))
        forms = [{key: (one.dtype.name, one.shape[1:]) for key, one in arrays.items()} for arrays in (ours, theirs)]
        if forms[0] != forms[1]:
            raise SegarError(f"{where}: this is not what was recorded: {name} are {forms[1]}, and there are {forms[0]}")
        for key, array in ours.items():
            equal = (array == theirs[key]) | (array != array) & (theirs[key] != theirs[key])  # nan where there is none
            rows = np.flatnonzero(~equal.reshape(len(equal), -1).all(axis=1))
            if len(rows):
                raise SegarError(f"{where}, step {rows[0]}: {key} comes out differently when actions are played again")


def _arrays(tree: Any, name: str) -> Iterable[tuple[str, np.ndarray]]:
    """The arrays of tuples and dicts, with where they stand."""
    if not isinstance(tree, (Mapping, tuple)):
        yield name, np.asarray(tree)
        return
    for key, part in tree.items() if isinstance(tree, Mapping) else enumerate(tree):
        yield from _arrays(part, f"{name}.{key}")


def read_play(
    path: str | PathLike[str], *, observation: Any = "state", task: Task | None = None, world: World | None = None
) -> tuple[Levels, list[Episode]]:
    """The levels and the episodes of a recording of human play, which are played again to the same returns and ends.

    An episode has what its environment observes when the recorded actions are taken; the file holds no observations. One
    that the player left before its end is neither terminated nor truncated.

    Args:
        observation: what the episodes observe, as :class:`segar.envs.VectorEnv` takes it.
        task, world: those that were played, where the file names none that is built in.

    Raises:
        SegarError: the file is no recording, is damaged, or names a task or rules of its maker's own; or an episode has
            another return or end when its actions are played again.
    """
    path = Path(path)
    data = data_in(path, "a recording of play", SegarError, from_handwritten_json)
    check_form(str(path), data, "a recording of play", FORMAT, VERSION, FORM, SegarError)
    levels = levels_from_data(data["levels"], path, "levels.", world)
    with naming(path):
        task = task or task_of(replace(levels, task=data["task"] or levels.task))
        env = VectorEnv(levels, 1, observation=observation, task=task, seed=0, autoreset_mode="Disabled", world=world)
    _check_memory(path, data["episodes"], env)
    by = f"; SEGAR {shown(data['segar'])} recorded it, and this is {__version__}"
    return levels, [_play_again(env, said, f"{path}: episodes[{k}]", by) for k, said in enumerate(data["episodes"])]


def _check_memory(path: Path, episodes: list[dict[str, Any]], env: VectorEnv) -> None:
    """Raise :class:`SegarError` where states and observations of all episodes would take more memory than the limit."""
    observations, _ = env.reset(seed=0)
    state = env.state().state.values.nbytes + sum(array.nbytes for array in leaves(observations))
    states = sum(min(len(episode["actions"]), env.task.max_steps) + 1 for episode in episodes)
    check_size(path, states * state, "recording of play", SegarError, LIMIT)


def _play_again(env: VectorEnv, said: dict[str, Any], at: str, by: str) -> Episode:
    """An episode as its actions lead through it.

    Args:
        at: where it stands, for messages.
        by: how the message about a difference ends.
    """
    if not 0 <= said["level"] < len(env.levels):
        raise SegarError(f"{at}.level: must be 0 to {len(env.levels) - 1}, not {said['level']}")
    if said["seed"] < 0:
        raise SegarError(f"{at}.seed: must not be negative, and is {said['seed']}")
    actions = _read_actions(said["actions"], len(env.task.action_low), f"{at}.actions")
    start = env.reset(seed=said["seed"], options={"levels": np.array([said["level"]])})
    steps, taken = [], iter(actions[:, None])
    with naming(at):
        for now in play(env, lambda observations: next(taken), start):
            steps.append(now)
            if now.time == len(actions) or not now.running[0]:
                break
    last = steps[-1]
    if last.time < len(actions):
        raise SegarError(f"{at}.actions: there are {len(actions)}, and the episode ends after {last.time} of them{by}")
    flags = {"terminated": last.terminated, "truncated": last.truncated, "success": last.info["success"]}
    again = {"return": float(last.info["return"][0]), **{name: bool(flag[0]) for name, flag in flags.items()}}
    for name, value in again.items():
        if said[name] != value:
            raise SegarError(f"{at}.{name}: is {said[name]}, and {value} when the actions are played again{by}")
    options = {"level": said["level"], "seed": said["seed"], "environment": 0}
    return episode_of(env, steps, 0, options)


def _read_actions(given: list[list[float]], width: int, at: str) -> np.ndarray:
    """The actions of an episode, float32 ``(T, width)``."""
    if not given:
        raise SegarError(f"{at}: there must be one at least")
    for time, action in enumerate(given):
        if len(action) != width:
            raise SegarError(f"{at}[{time}]: must be {width} numbers, not {len(action)}")
    stated = np.array(given, np.float64)
    with np.errstate(over="ignore"):
        actions = stated.astype(np.float32)
    for time, k in np.argwhere(actions != stated)[:1].tolist():
        raise SegarError(f"{at}[{time}][{k}]: {stated[time, k]} is no number of float32, in which actions are recorded")
    return actions
