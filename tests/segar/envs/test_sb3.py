"""SB3VecEnv: the transitions of VectorEnv in Stable-Baselines3's convention, and its algorithms on top."""

import sys
import warnings
from dataclasses import replace

import numpy as np
import pytest
import stable_baselines3 as sb3
from gymnasium import spaces
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import VecFrameStack, VecMonitor, VecNormalize

import segar
from segar.envs import SB3VecEnv, VectorEnv
from segar.observations import Pixels, leaves
from segar.rendering import View

LEVELS = segar.family("tilesx1-easy").sample(10, seed=0)
N = 6
DICT = {"state": "state", "look": Pixels(32)}


def random_actions(steps: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, N, 2)).astype(np.float32)


@pytest.mark.parametrize("observation", ["state", Pixels(32), DICT], ids=["state", "pixels", "dict"])
def test_transitions_are_those_of_the_batch(observation):
    env = SB3VecEnv(LEVELS, N, observation=observation, seed=3, max_steps=7)
    batch = VectorEnv(LEVELS, N, observation=observation, seed=3, max_steps=7)
    ends = {True: 0, False: 0}
    seen, expected = env.reset(), batch.reset()[0]
    for actions in random_actions(30):
        for ours, theirs in zip(leaves(seen), leaves(expected), strict=True):
            np.testing.assert_array_equal(ours, theirs)
        seen, rewards, dones, infos = env.step(actions)
        expected, their_rewards, terminated, truncated, info = batch.step(actions)
        assert rewards.dtype == np.float32 and dones.dtype == np.bool_
        np.testing.assert_array_equal(rewards, their_rewards.astype(np.float32))
        np.testing.assert_array_equal(dones, terminated | truncated)
        for e in range(N):
            if not dones[e]:
                assert infos[e] == {}
                continue
            final = info["final_info"]
            ends[bool(terminated[e])] += 1
            assert infos[e]["TimeLimit.truncated"] == (truncated[e] and not terminated[e])
            assert (infos[e]["episode"]["r"], infos[e]["episode"]["l"]) == (final["return"][e], final["length"][e])
            assert (infos[e]["is_success"], infos[e]["death"]) == (final["success"][e], final["death"][e])
            assert infos[e]["level"] == final["level"][e]
            for ours, theirs in zip(leaves(infos[e]["terminal_observation"]), leaves(info["final_obs"]), strict=True):
                np.testing.assert_array_equal(ours, theirs[e])
    assert ends[False] and ends[True], "episodes ended in both ways"


def test_what_was_returned_is_not_overwritten():
    env = SB3VecEnv(LEVELS, N, seed=0, max_steps=3)
    steps = [(env.reset(), None, None, [])] + [env.step(actions) for actions in random_actions(8)]
    copies = [(seen.copy(), [dict(info) for info in infos]) for seen, _, _, infos in steps]
    for actions in random_actions(8, seed=1):
        env.step(actions)
    for (seen, _, _, infos), (before, before_infos) in zip(steps, copies, strict=True):
        np.testing.assert_array_equal(seen, before)
        for info, copy in zip(infos, before_infos, strict=True):
            assert info.keys() == copy.keys()
            np.testing.assert_array_equal(info.get("terminal_observation", 0), copy.get("terminal_observation", 0))


def test_a_seed_repeats_the_episodes_and_is_used_once():
    env = SB3VecEnv(LEVELS, N)
    env.seed(5)
    first = env.reset()
    second = env.reset()
    env.seed(5)
    np.testing.assert_array_equal(env.reset(), first)
    np.testing.assert_array_equal(env.reset(), second)
    assert (first != second).any()
    np.testing.assert_array_equal(first, VectorEnv(LEVELS, N, seed=5).reset()[0])


def test_options_choose_the_levels_of_the_next_reset():
    env = SB3VecEnv(LEVELS, N, seed=0)
    env.set_options({"level": 4})
    env.reset()
    assert env.reset_infos == [{"level": 4}] * N
    env.set_options([{"level": e} for e in range(N)])
    env.reset()
    assert env.reset_infos == [{"level": e} for e in range(N)]
    env.reset()
    assert env.reset_infos == [{"level": level} for level in env.info["level"]] != [{"level": e} for e in range(N)]


@pytest.mark.parametrize("options", [{"levels": 3}, [{"level": 1}] + [{}] * (N - 1)])
def test_options_that_are_unknown_or_not_for_all_are_refused(options):
    env = SB3VecEnv(LEVELS, N, seed=0)
    env.set_options(options)
    with pytest.raises(segar.SegarError, match="give each environment the option 'level', or none"):
        env.reset()


def test_attributes_and_methods_are_those_of_the_batch():
    env = SB3VecEnv(LEVELS, N, seed=0)
    env.reset()
    assert env.get_attr("levels", [0, 2]) == [LEVELS] * 2 and not env.has_attr("no_such_thing")
    assert [snapshot.state.values.shape[0] for snapshot in env.env_method("state")] == [N] * N
    env.set_attr("stage", 2)
    assert env.get_attr("stage") == [2] * N
    env.set_attr("stage", 3)
    assert env.get_attr("stage", 1) == [3]
    for name in ("levels", "num_envs", "step"):
        with pytest.raises(segar.SegarError, match=f"'{name}' is fixed when environments are made"):
            env.set_attr(name, None)
    with pytest.raises(segar.SegarError, match="'state' is of all environments of the batch"):
        env.env_method("state", indices=[0])


def test_frames_are_given_where_they_were_asked_for():
    env = SB3VecEnv(LEVELS, 4, seed=0, render_mode="rgb_array", view=View(size=64))
    env.reset()
    assert env.render().shape == (128, 128, 3) and [image.shape for image in env.get_images()] == [(64, 64, 3)] * 4
    assert env.metadata["render_fps"] == env.vector_env.metadata["render_fps"]
    plain = SB3VecEnv(LEVELS, 4, seed=0)
    assert plain.render_mode is None and plain.get_images() == [None] * 4


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observation": ("state", Pixels(32))}, "arrays and dicts of arrays as observations.*give a dict"),
        ({"observation": {"a": {"b": "state"}}}, "arrays and dicts of arrays as observations"),
        ({"copy": False}, "'copy' is not to be chosen"),
        ({"autoreset_mode": "Disabled"}, "'autoreset_mode' is not to be chosen"),
        ({"observation": "stat"}, "state"),
    ],
)
def test_what_stable_baselines3_cannot_take_is_refused(changes, message):
    with pytest.raises(segar.SegarError, match=message):
        SB3VecEnv(LEVELS, N, **changes)


def test_a_step_without_actions_is_refused():
    env = SB3VecEnv(LEVELS, N)
    env.reset()
    with pytest.raises(segar.SegarError, match="step_async"):
        env.step_wait()


def test_without_stable_baselines3_the_extra_is_named(monkeypatch):
    monkeypatch.delitem(sys.modules, "segar.envs.sb3_env")
    monkeypatch.delitem(vars(segar.envs), "SB3VecEnv")
    find = sys.modules["importlib.util"].find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "stable_baselines3" else find(name))
    with pytest.raises(segar.SegarError, match=r"SB3VecEnv needs stable_baselines3.*pip install 'segar\[sb3\]'"):
        _ = segar.envs.SB3VecEnv


def test_actions_have_the_range_of_the_task_unless_asked_otherwise():
    wide = replace(segar.puttputt(), action_low=(-3.0, 0.0), action_high=(3.0, 1.0))
    low, high = np.float32([-3, 0]), np.float32([3, 1])
    assert SB3VecEnv(LEVELS, 2, task=wide).action_space == spaces.Box(low, high)
    assert SB3VecEnv(LEVELS, 2, task=wide, unit_actions=True).action_space == spaces.Box(-1, 1, (2,))


def quickly(algorithm, policy, env, **settings):
    model = algorithm(policy, env, seed=0, device="cpu", **settings)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return model.learn(settings.get("learning_starts", 0) + 4 * N * 8)


def test_ppo_learns_on_states_and_counts_episodes():
    env = SB3VecEnv(LEVELS, N, seed=0, max_steps=5)
    model = quickly(sb3.PPO, "MlpPolicy", env, n_steps=8, batch_size=24, n_epochs=1)
    assert len(model.ep_info_buffer) > 10 and {"r", "l", "t"} <= {*model.ep_info_buffer[0]}
    assert len(model.ep_success_buffer) == len(model.ep_info_buffer)


def test_ppo_transposes_frames_and_takes_dicts():
    frames = quickly(
        sb3.PPO, "CnnPolicy", SB3VecEnv(LEVELS, N, observation="rgb"), n_steps=8, batch_size=24, n_epochs=1
    )
    assert frames.observation_space.shape == (3, 64, 64)
    both = SB3VecEnv(LEVELS, N, observation={"state": "state", "look": Pixels(64)})
    quickly(sb3.PPO, "MultiInputPolicy", both, n_steps=8, batch_size=24, n_epochs=1)


def test_sac_learns_from_final_observations():
    env = SB3VecEnv(LEVELS, N, seed=0, max_steps=3)
    model = quickly(sb3.SAC, "MlpPolicy", env, learning_starts=12, batch_size=8, train_freq=4)
    buffer = model.replay_buffer
    at = np.argwhere(buffer.timeouts[: buffer.pos] > 0)
    assert len(at), "some episodes were truncated"
    for step, e in at:
        if step + 1 < buffer.pos:
            assert (buffer.next_observations[step, e] != buffer.observations[step + 1, e]).any()


def test_the_evaluation_of_stable_baselines3_gives_the_returns_of_episodes():
    env = SB3VecEnv(LEVELS, N, seed=0, max_steps=5)
    assert env.env_is_wrapped(Monitor) == [True] * N and env.env_is_wrapped(VecNormalize) == [False] * N
    model = sb3.PPO("MlpPolicy", env, device="cpu", n_steps=8, batch_size=24)
    env.seed(1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        returns, lengths = evaluate_policy(model, env, n_eval_episodes=N, return_episode_rewards=True)
    batch = VectorEnv(LEVELS, N, seed=1, max_steps=5)
    seen, _ = batch.reset()
    expected = {}
    while len(expected) < N:
        seen, *_, info = batch.step(model.predict(seen, deterministic=True)[0])
        ended = np.flatnonzero(info.get("_final_info", []))
        expected |= {int(e): info["final_info"]["return"][e] for e in ended if int(e) not in expected}
    assert sorted(returns) == pytest.approx(sorted(expected.values())) and set(lengths) <= set(range(1, 6))


def test_wrappers_of_stable_baselines3_work():
    with pytest.warns(UserWarning, match="already wrapped with a `Monitor`"):
        env = VecMonitor(SB3VecEnv(LEVELS, N, seed=0, max_steps=3), info_keywords=("is_success", "level"))
    env = VecNormalize(VecFrameStack(env, 2))
    env.reset()
    infos = [info for actions in random_actions(4) for info in env.step(actions)[3] if info]
    assert infos and all({"r", "l", "is_success", "level"} <= {*info["episode"]} for info in infos)
    assert all(info["terminal_observation"].shape == env.observation_space.shape for info in infos)
