"""Play recorded actions again, and compare: a dataset is what it says it is."""

from collections.abc import Mapping
from itertools import chain, repeat
from typing import Any

import numpy as np

from segar.datasets.dataset import TRUTHS, Dataset, Shard
from segar.datasets.recording import hash_of_kernel
from segar.datasets.rollouts import Policy, Rollouts, roll_out
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.language import Task
from segar.observations import OBSERVATIONS
from segar.rules import World


def check_replay(
    dataset: Dataset, *, observation: Any = None, task: Task | None = None, world: World | None = None
) -> int:
    """Play the recorded actions on the recorded levels, and return how many steps came out the same, to the bit.

    Args:
        observation: the one that was recorded. By default the one that the manifest names, if that is 'rgb' or 'state';
            else observations are not compared.
        task, world: those of the recording, if they are not the levels' own.

    Raises:
        SegarError: something came out differently; the message says in which episode and step, what, and whether rules,
            task or version are those of the recording.
    """
    settings = dataset.manifest.settings
    if observation is None and settings.observation in OBSERVATIONS:
        observation = settings.observation
    for shard in dataset:
        starts = np.flatnonzero((shard.rollouts.step == 0) & (shard.rollouts.trial == 0))
        env = VectorEnv(
            dataset.levels,
            len(starts),
            observation=observation or "state",
            task=task,
            autoreset_mode="Disabled",
            max_steps=settings.max_steps,
            sub_steps=settings.sub_steps,
            world=world,
            trials=settings.trials,
        )
        try:
            _compare(shard, _play_again(shard, starts, env), observation is not None)
        except SegarError as difference:
            if hash_of_kernel(env) == settings.kernel:
                raise
            raise SegarError(
                f"{dataset.folder} was recorded with other rules, another task ({settings.task}) or another SEGAR"
                f" ({dataset.manifest.version}); give task= and world= as they were. The first difference: {difference}"
            ) from difference
    return dataset.steps


def _play_again(shard: Shard, starts: np.ndarray, env: VectorEnv) -> Rollouts:
    """The episodes of a shard as their actions lead through them now; ``starts`` are the rows in which environments start."""
    recorded = shard.rollouts
    taken = ~np.isnan(recorded.action).any(axis=1)
    before, place = np.cumsum(taken) - taken, np.cumsum(np.isin(np.arange(len(recorded)), starts)) - 1
    time = before - before[starts][place]
    actions = np.zeros((int(time.max()) + 1, len(starts), recorded.action.shape[1]), np.float32)
    actions[time[taken], place[taken]] = recorded.action[taken]
    steps = chain(actions, repeat(np.zeros_like(actions[0])))  # after its recorded end an episode does nothing
    policy: Policy = lambda observations, info, rng: next(steps)  # noqa: E731
    first, levels = int(recorded.episode[0]), recorded.level[starts]
    return roll_out(env, levels, first, shard.seed, policy, np.random.default_rng(0))


def _compare(shard: Shard, again: Rollouts, with_observations: bool) -> None:
    """Raise :class:`SegarError` at the first row that differs."""
    recorded = shard.rollouts
    if len(recorded) != len(again) or not np.array_equal(recorded.step, again.step):
        raise SegarError(f"shard {shard.number}: episodes have other lengths when they are played again")
    for name in ("reward", *TRUTHS):
        _same(recorded, name, getattr(recorded, name), getattr(again, name))
    for slot, entity in enumerate(shard.entities):
        for factor, column in shard.layout.columns.items():
            part = np.s_[:, slot, column : column + factor.width]
            _same(recorded, f"{factor.__name__} of '{entity}'", recorded.values[part], again.values[part])
    if not with_observations:
        return
    there, here = (_forms(rollouts.observations) for rollouts in (recorded, again))
    if there != here:
        raise SegarError(f"this is not the observation that was recorded: its arrays are {here}, and there are {there}")
    for name, array in recorded.observations.items():
        _same(recorded, name, array, again.observations[name])


def _forms(observations: Mapping[str, np.ndarray]) -> dict[str, str]:
    """Shape and type of each array, without the axis of the rows."""
    return {name: f"{array.dtype}{list(array.shape[1:])}" for name, array in observations.items()}


def _same(rollouts: Rollouts, name: str, recorded: np.ndarray, again: np.ndarray) -> None:
    equal = recorded == again
    if recorded.dtype.kind == "f":
        equal |= np.isnan(recorded) & np.isnan(again)
    rows = np.flatnonzero(~equal.reshape(len(equal), -1).all(axis=1))
    if len(rows):
        where = f"episode {rollouts.episode[rows[0]]}, step {rollouts.step[rows[0]]}"
        raise SegarError(f"{where}: {name} comes out differently when the actions are played again")
