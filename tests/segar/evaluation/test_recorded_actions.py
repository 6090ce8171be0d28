"""Recorded actions: what was recorded plays again to the bit, level set by level set, and what does not fit is refused."""

import dataclasses

import numpy as np
import pytest

import segar
from segar.errors import ActionError, SegarError
from segar.evaluation import RecordedActions, evaluate_levels, record_actions

LEVELS = segar.family("tilesx1-medium").sample(7, seed=3)
WIDE = dataclasses.replace(segar.puttputt(), action_low=(-2.0, -2.0), action_high=(5.0, 5.0), max_steps=20)
TASK = {"task": WIDE}


class Turning:
    """A policy with a memory, which takes the same array for its actions in every step."""

    def begin(self, env):
        self.time, self.actions = 0, np.zeros((env.num_envs, 2), np.float32)

    def __call__(self, seen):
        self.time += 1
        self.actions[:] = 2.0 * np.tanh(seen[:, 2:4] + np.sin(self.time))
        return self.actions


@pytest.mark.parametrize("unit_actions", [False, True])
def test_recorded_actions_play_the_episodes_of_their_policy_to_the_bit(unit_actions):
    actions = record_actions(Turning(), LEVELS, unit_actions=unit_actions, **TASK)
    played = evaluate_levels(Turning(), LEVELS, unit_actions=unit_actions, **TASK).episodes
    again = evaluate_levels(RecordedActions(actions), LEVELS, observation="rgb", **TASK).episodes
    assert actions.dtype == np.float32 and actions.shape == (7, played.length.max(), 2)
    assert (again.returns == played.returns).all() and (again.length == played.length).all()
    for row, length in zip(actions, played.length, strict=True):
        assert not row[length:].any()


def test_each_level_has_its_own_actions_in_whatever_order_level_sets_are_played():
    recorded = RecordedActions(record_actions(Turning(), LEVELS, **TASK))
    whole = evaluate_levels(recorded, LEVELS, **TASK)
    env = segar.envs.VectorEnv(LEVELS, 3, **TASK)
    env.reset(options={"levels": np.array([6, 0, 6])})
    recorded.begin(env)  # is left off
    assert (recorded(None) == recorded.actions[[6, 0, 6], 0]).all()
    again = segar.evaluate_policy(recorded, LEVELS, LEVELS, episodes=3, **TASK)
    for found in (again.train, again.test):
        assert (found.episodes.returns.reshape(3, 7) == whole.episodes.returns).all()


def test_nothing_is_done_behind_the_last_recorded_step():
    recorded = RecordedActions(np.ones((7, 1, 2)))
    env = segar.envs.VectorEnv(LEVELS, 7, **TASK)
    env.reset(options={"levels": np.arange(7)})
    recorded.begin(env)
    assert recorded(None).all() and not recorded(None).any()


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((7, 2)), r"must be real numbers \[level, step, component\], not float64 of shape \(7, 2\)"),
        (np.full((7, 3, 2), np.nan), "some actions of level 0 are not finite"),
        (np.full((7, 3, 2), 1e300), "some actions of level 0 are not finite"),
        (np.zeros((6, 3, 2)), "are actions of 6 levels with 2 components, and what is played are 7 levels with 2"),
        (np.zeros((7, 3, 1)), "are actions of 7 levels with 1 components"),
    ],
)
def test_actions_that_do_not_fit_are_refused(actions, message):
    with pytest.raises(ActionError, match=message):
        evaluate_levels(RecordedActions(actions), LEVELS, **TASK)


def test_options_that_would_change_what_actions_mean_are_refused():
    recorded = RecordedActions(np.zeros((7, 3, 2)))
    for options in ({"trials": 2}, {"unit_actions": True}):
        with pytest.raises(ActionError, match=f"leave {next(iter(options))} out"):
            evaluate_levels(recorded, LEVELS, **options, **TASK)
    with pytest.raises(SegarError, match="leave trials out"):
        record_actions(Turning(), LEVELS, trials=2)
