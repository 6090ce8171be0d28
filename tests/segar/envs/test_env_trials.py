"""Trials: episodes in a row on one level, in every interface."""

import pickle
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from torchrl.envs.utils import check_env_specs

import segar
from segar.envs import Env, SB3VecEnv, Snapshot, TorchRLEnv, VectorEnv
from segar.observations import PreviousStep

LEVELS = segar.family("objectsx1-easy").sample(40, seed=0)
N, STEPS = 6, 4  # environments, steps of an episode


def actions_of(seed: int, steps: int, num_envs: int = N) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-1, 1, (steps, num_envs, 2)).astype(np.float32)


def levels_and_trials(env: VectorEnv, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Level and trial of the episodes that ``steps`` actions start, ``[step, env]``; episodes end by time alone."""
    _, info = env.reset()
    infos = [info] + [env.step(np.zeros((env.num_envs, 2), np.float32))[4] for _ in range(steps)]
    starts = [one for one in infos if (one["length"] == 0).all()]
    trials = [one.get("trial", np.zeros(env.num_envs, np.int64)) for one in starts]
    return np.array([one["level"] for one in starts]), np.array(trials)


@pytest.mark.parametrize("trials", [2, 3])
def test_each_level_is_played_so_often_and_drawn_as_without_trials(trials):
    options: dict[str, Any] = {"seed": 3, "max_steps": STEPS}
    once, _ = levels_and_trials(VectorEnv(LEVELS, N, **options), 12 * STEPS)
    level, trial = levels_and_trials(VectorEnv(LEVELS, N, trials=trials, **options), 12 * STEPS)
    np.testing.assert_array_equal(trial, np.broadcast_to((np.arange(13) % trials)[:, None], trial.shape))
    np.testing.assert_array_equal(level, once[np.arange(13) // trials * trials])


def test_info_says_which_trial_runs_which_one_ended_and_where_a_level_begins():
    env = VectorEnv(LEVELS, N, seed=0, max_steps=STEPS, trials=3)
    _, info = env.reset()
    assert info["new_level"].all() and info["trial"].dtype == np.int64 and not info["trial"].any()
    for t in range(1, 10 * STEPS):
        before, (*_, info) = info, env.step(actions_of(t, 1)[0])
        ended = info.get("_final_info", np.zeros(N, np.bool_))
        np.testing.assert_array_equal(info["trial"], (before["trial"] + ended) % 3)
        np.testing.assert_array_equal(info["new_level"], ended & (before["trial"] == 2))
        if ended.any():
            np.testing.assert_array_equal(info["final_info"]["trial"], np.where(ended, before["trial"], 0))
            assert not info["final_info"]["new_level"].any()


def test_chosen_levels_begin_a_row_of_trials_in_the_middle_of_another():
    env = VectorEnv(LEVELS, N, seed=0, max_steps=STEPS, trials=3)
    env.reset()
    for action in actions_of(0, STEPS + 1):
        env.step(action)
    chosen, mask = np.arange(N) + 7, np.arange(N) % 2 == 0
    _, info = env.reset(options={"levels": chosen, "reset_mask": mask})
    np.testing.assert_array_equal(info["trial"], np.where(mask, 0, 1))
    assert (info["level"][mask] == chosen[mask]).all()
    for _ in range(2):
        for action in actions_of(1, STEPS):
            *_, info = env.step(action)
        assert (info["level"][mask] == chosen[mask]).all()
    np.testing.assert_array_equal(info["trial"][mask], 2)


def test_a_seed_begins_the_rows_anew():
    env = VectorEnv(LEVELS, N, seed=4, max_steps=STEPS, trials=3)
    first = levels_and_trials(env, STEPS)
    _, info = env.reset(seed=4)
    np.testing.assert_array_equal(info["level"], first[0][0])
    assert info["new_level"].all()


def test_the_trials_of_a_level_have_a_randomness_of_their_own():
    env = VectorEnv(LEVELS, N, seed=0, max_steps=STEPS, trials=2)
    env.reset(options={"levels": np.zeros(N, np.int64)})
    first = env.state().state
    for action in actions_of(0, STEPS):
        env.step(action)
    second = env.state().state
    assert (second.level == 0).all() and (first.values == second.values)[~np.isnan(first.values)].all()
    assert len({*first.key, *second.key}) == 2 * N


def test_a_restored_snapshot_goes_on_with_its_trials(tmp_path: Path):
    options: dict[str, Any] = {"max_steps": STEPS, "trials": 3, "observation": {"s": "state", "p": PreviousStep()}}
    env = VectorEnv(LEVELS, N, seed=0, **options)
    env.reset()
    for action in actions_of(0, STEPS + 2):
        env.step(action)
    env.state().save(tmp_path / "now.npz")
    restored, pickled = VectorEnv(LEVELS, N, seed=9, **options), pickle.loads(pickle.dumps(env))
    restored.restore(Snapshot.load(tmp_path / "now.npz"))
    for action in actions_of(1, 8 * STEPS):
        seen, *_, info = env.step(action)
        for other in (restored, pickled):
            seen_there, *_, there = other.step(action)
            for name in ("level", "trial", "new_level", "return"):
                np.testing.assert_array_equal(info[name], there[name])
            assert all(np.array_equal(seen[key], seen_there[key]) for key in seen)


def test_gymnasium_resets_go_to_the_next_trial():
    env = gymnasium.make("Segar-objectsx1-easy-state-v0", num_levels=30, trials=3).unwrapped
    assert isinstance(env, Env)
    infos = [env.reset(seed=0)[1]] + [env.reset()[1] for _ in range(6)]
    assert [info["trial"] for info in infos] == [0, 1, 2, 0, 1, 2, 0]
    assert [info["new_level"] for info in infos] == [True, False, False, True, False, False, True]
    assert len({info["level"] for info in infos[:3]}) == len({info["level"] for info in infos[3:6]}) == 1
    assert env.reset(options={"level": 5})[1]["trial"] == 0 and env.reset()[1]["level"] == 5


def test_torchrl_has_entries_for_trials_and_its_masked_resets_go_to_the_next_one():
    env = TorchRLEnv(LEVELS, N, seed=0, max_steps=STEPS, trials=3)
    check_env_specs(env)
    env.set_seed(0)
    found: Any = env.rollout(9 * STEPS + 1, break_when_any_done=False)
    again = VectorEnv(LEVELS, N, seed=0, max_steps=STEPS, trials=3)
    level, trial = levels_and_trials(again, 9 * STEPS)
    begins = found["length"][..., 0] == 0
    for e in range(N):
        np.testing.assert_array_equal(found["trial"][e, begins[e], 0], trial[: int(begins[e].sum()), e])
        np.testing.assert_array_equal(found["level"][e, begins[e], 0], level[: int(begins[e].sum()), e])
    assert torch.equal(found["new_level"], begins[..., None] & (found["trial"] == 0))
    snapshot = env.state()
    assert torch.equal(env.restore(snapshot)["trial"], found["next", "trial"][:, -1])
    assert "trial" not in TorchRLEnv(LEVELS, 2, seed=0).reset()


def test_stable_baselines_says_which_trial_ended():
    env = SB3VecEnv(LEVELS, 2, seed=0, max_steps=STEPS, trials=3)
    env.reset()
    ended = []
    for action in actions_of(0, 6 * STEPS, 2):
        infos = env.step(action)[3]  # type: ignore[arg-type]
        ended += [info["trial"] for info in infos[:1] if "episode" in info]
    assert ended[:6] == [0, 1, 2, 0, 1, 2]
