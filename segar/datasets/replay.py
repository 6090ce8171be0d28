"""Play recorded actions again, and compare: a dataset is what it says it is."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import chain, repeat
from typing import Any

import numpy as np

from segar.datasets.episodes import Episode, roll_out
from segar.datasets.recipe import hash_of_kernel, levels_of, recipe_of
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.language import Task
from segar.observations import OBSERVATIONS
from segar.rules import World


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
        recorded = list(dataset.iterate_episodes(numbers))
        n = len(numbers) // recipe.trials
        env = VectorEnv(levels, n, observation=observation or "state", task=task, world=world, **limits)
        played = np.array([int(one.infos["level"][0]) for one in recorded[:: recipe.trials]])
        actions = _actions([one.actions for one in recorded], recipe.trials)
        again = roll_out(env, played, recipe.seed_of(batch), lambda observations, actions=actions: next(actions))
        try:
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


def _actions(recorded: list[np.ndarray], trials: int) -> Iterator[np.ndarray]:
    """The actions of all environments in each step; after its recorded end an environment does nothing."""
    rows = [np.concatenate(recorded[at : at + trials]) for at in range(0, len(recorded), trials)]
    whole = np.zeros((max(map(len, rows)), len(rows), recorded[0].shape[1]), np.float32)
    for row, actions in enumerate(rows):
        whole[: len(actions), row] = actions
    return chain(whole, repeat(np.zeros_like(whole[0])))


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
                raise SegarError(
                    f"{where}, step {rows[0]}: {key} comes out differently when the actions are played again"
                )


def _arrays(tree: Any, name: str) -> Iterable[tuple[str, np.ndarray]]:
    """The arrays of tuples and dicts, with where they stand."""
    if not isinstance(tree, (Mapping, tuple)):
        yield name, np.asarray(tree)
        return
    for key, part in tree.items() if isinstance(tree, Mapping) else enumerate(tree):
        yield from _arrays(part, f"{name}.{key}")
