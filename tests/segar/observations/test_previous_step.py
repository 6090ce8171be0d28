"""The last step as an observation, remembered over the trials of a level, and vectors that are joined into one."""

from typing import Any

import numpy as np
import pytest

import segar
from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.observations import Joined, PreviousActions, PreviousStep, Stack, StateVector

LEVELS = segar.family("objectsx1-easy").sample(20, seed=0)
N, STEPS = 5, 4


def actions_of(seed: int, steps: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1.3, 1.3, (steps, N, 2)).astype(np.float32)


@pytest.mark.parametrize("trials", [1, 3])
def test_it_shows_the_begin_of_episodes_and_the_last_step_on_the_level(trials):
    seen_as = PreviousStep(reward_scale=2.0)
    env = VectorEnv(LEVELS, N, observation=seen_as, seed=0, max_steps=STEPS, trials=trials)
    seen, info = env.reset()
    begins, actions, rewards = np.ones(N), np.zeros((N, 2)), np.zeros(N)
    for now in actions_of(0, 8 * STEPS):
        parts = [begins[:, None], actions, rewards[:, None] / 2]
        np.testing.assert_array_equal(seen, np.concatenate(parts, 1).astype(np.float32))
        assert env.observation_space.contains(seen)
        seen, rewards, terminated, truncated, info = env.step(now)
        actions, ended = now.clip(-1, 1), terminated | truncated
        if ended.any():
            last = np.concatenate([np.zeros((N, 1)), actions, rewards[:, None] / 2], 1).astype(np.float32)
            np.testing.assert_array_equal(info["final_obs"][ended], last[ended])
        begins = ended.astype(float)
        forgets = info.get("new_level", ended)
        actions, rewards = np.where(forgets[:, None], 0, actions), np.where(forgets, 0, rewards)


def test_stacks_tuples_and_joined_vectors_hand_on_what_was_before():
    parts: dict[str, Any] = {
        "alone": PreviousStep(),
        "joined": Joined(["state", PreviousStep()]),
        "stack": Stack(PreviousStep(), 2),
        "tuple": (PreviousStep(), "state"),
    }
    env = VectorEnv(LEVELS, N, observation=parts, seed=0, max_steps=STEPS, trials=2)
    seen, _ = env.reset()
    for now in actions_of(1, 5 * STEPS):
        alone = seen["alone"]
        for other in (seen["joined"][:, -4:], seen["stack"][:, -4:], seen["tuple"][0]):
            np.testing.assert_array_equal(other, alone)
        seen, *_ = env.step(now)
        goes_on = seen["alone"][:, 0] == 0
        np.testing.assert_array_equal(seen["stack"][goes_on, :-4], alone[goes_on])


def test_joined_vectors_are_those_of_a_tuple_one_after_the_other():
    parts = [StateVector(normalise=True), PreviousActions(2), "state", PreviousStep()]
    envs = [VectorEnv(LEVELS, N, observation=one, seed=0, max_steps=STEPS) for one in (Joined(parts), tuple(parts))]
    (seen, _), (apart, _) = (env.reset() for env in envs)
    names: Any = envs[0].observation
    assert len(names.names) == seen.shape[1] and names.names[-4:] == [
        "episode.begins",
        "action.0",
        "action.1",
        "reward",
    ]
    for now in actions_of(2, 3 * STEPS):
        np.testing.assert_array_equal(seen, np.concatenate(apart, 1))
        seen, apart = (env.step(now)[0] for env in envs)


def test_the_named_observation_has_the_options_of_a_state():
    made = segar.observations.OBSERVATIONS["state_past"](hidden=[segar.Mass], reward_scale=5.0)
    env = VectorEnv(LEVELS, 2, observation=made, seed=0)
    plain = VectorEnv(LEVELS, 2, observation=StateVector(hidden=[segar.Mass]), seed=0)
    assert env.single_observation_space.shape == (plain.single_observation_space.shape[0] + 4,)
    assert not made.shows(segar.Mass) and made.shows(segar.Position)


def test_a_snapshot_of_another_observation_is_as_if_the_episode_had_started_now():
    env, plain = (VectorEnv(LEVELS, N, observation=one, seed=0, trials=2) for one in (PreviousStep(), "state"))
    for one in (env, plain):
        one.reset()
        one.step(actions_of(0, 1)[0])
    seen = env.restore(plain.state())
    np.testing.assert_array_equal(seen, np.tile(np.float32([1, 0, 0, 0]), (N, 1)))


@pytest.mark.parametrize("scale", [0, -1.0, np.inf, True, "2"])
def test_a_wrong_scale_is_refused(scale):
    with pytest.raises(SegarError, match="PreviousStep: reward_scale must be a finite number above 0"):
        PreviousStep(reward_scale=scale)


@pytest.mark.parametrize(("parts", "says"), [([], "at least one"), ("state", "a list of observations")])
def test_joining_nothing_is_refused(parts, says):
    with pytest.raises(SegarError, match=says):
        Joined(parts)


@pytest.mark.parametrize("part", ["rgb", StateVector(form="table"), ("state",)])
def test_what_is_no_vector_is_not_joined(part):
    with pytest.raises(SegarError, match="Joined: it joins vectors of float32, and its part number 1 is"):
        VectorEnv(LEVELS, 2, observation=Joined(["state", part]))
