"""Actions as data: those of a policy on each level of a set, recorded, and what plays recorded actions."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from segar.envs import Policy, VectorEnv
from segar.errors import ActionError, SegarError
from segar.evaluation.players import Idle
from segar.evaluation.policy_evaluation import CheckedPolicy, evaluate_levels
from segar.levels import Levels


class RecordedActions:
    """The policy that plays recorded actions, each level's its own, and does nothing behind the last of them.

    >>> of = segar.suites.suite("place-few-v1")
    >>> recorded = segar.evaluation.RecordedActions(of.plans.actions)
    >>> segar.evaluation.evaluate_levels(recorded, of.test_levels, task=of.task).mean("success").value
    1.0

    Actions behind the last step of an episode do not count, but must be finite numbers.

    Args:
        actions: real numbers ``[level, step, component]``, in the range of the task. They are played on level sets of as many
            levels, whatever is observed there.

    Raises:
        ActionError: the actions have another shape, or some are not finite.
    """

    def __init__(self, actions: Any) -> None:
        self.actions = np.asarray(actions)
        if self.actions.ndim != 3 or self.actions.dtype.kind not in "fiu":
            raise ActionError(
                "RecordedActions: actions must be real numbers [level, step, component], not"
                f" {self.actions.dtype} of shape {self.actions.shape}"
            )
        with np.errstate(over="ignore"):
            self.actions = self.actions.astype(np.float32)
        wrong = np.flatnonzero(~np.isfinite(self.actions).all(axis=(1, 2)))
        if len(wrong):
            raise ActionError(
                f"RecordedActions: some actions of level {wrong[0]} are not finite float32 numbers; those behind the last step"
                " of an episode do not count, and can be 0"
            )

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``.

        Raises:
            ActionError: the actions are of another number of levels or components, or cannot be played there.
        """
        count, size = len(self.actions), self.actions.shape[2]
        if count != len(env.levels) or size != len(env.task.action_low):
            raise ActionError(
                f"RecordedActions: these are actions of {count} levels with {size} components, and what is played are"
                f" {len(env.levels)} levels with {len(env.task.action_low)} components"
            )
        if env.trials > 1 or env.action_range.is_mapped:
            option = "trials" if env.trials > 1 else "unit_actions"
            raise ActionError(
                f"RecordedActions: actions are of one episode on each level and have the range of the task; leave {option} out"
            )
        self._rows, self._idle, self._time = self.actions[env.state().state.level], Idle(), 0
        self._idle.begin(env)

    def __call__(self, observations: Any) -> np.ndarray:
        """The actions of the next step, float32 ``(n, action size)``."""
        time, self._time = self._time, self._time + 1
        return self._rows[:, time] if time < self._rows.shape[1] else self._idle(observations)


def record_actions(policy: Policy, levels: Levels, *, seed: int = 0, **options: Any) -> np.ndarray:
    """The actions that a policy takes in one episode on each level, float32 ``[level, step, component]`` in the range of the
    task, 0 behind the last step of each: what :class:`RecordedActions` plays.

    Args:
        policy, seed, options: as of :func:`segar.evaluate_policy`.

    Raises:
        SegarError: as :func:`segar.evaluate_policy`, and where there are several trials.
    """
    if options.get("trials", 1) != 1:
        raise SegarError("record_actions: actions are of one episode on each level; leave trials out")
    recorder = _Recorder(policy)
    played = evaluate_levels(recorder, levels, seed=seed, **options)
    return _joined(recorder.rows(), played.episodes.length)


class _Recorder:
    """A policy that remembers its actions: what another policy does, episode by episode."""

    def __init__(self, policy: Policy) -> None:
        self._policy = CheckedPolicy(policy)
        self._batches: list[list[np.ndarray]] = []

    def begin(self, env: VectorEnv) -> None:
        self._batches.append([])
        self._policy.begin(env)

    def __call__(self, observations: Any) -> np.ndarray:
        actions = np.array(self._policy(observations))
        self._batches[-1].append(self._policy.env.action_range.of_task(actions))
        return actions

    def rows(self) -> list[np.ndarray]:
        """The actions of each episode, in the order in which they were played, [step, component]."""
        return [row for steps in self._batches for row in np.stack(steps, axis=1)]


def _joined(rows: Sequence[np.ndarray], lengths: np.ndarray) -> np.ndarray:
    """Actions of episodes of these lengths as one array, 0 behind the last step of each."""
    steps = max(lengths)
    return np.stack(
        [np.pad(row[:length], ((0, steps - length), (0, 0))) for row, length in zip(rows, lengths, strict=True)]
    )
