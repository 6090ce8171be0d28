"""Every registered id keeps Gymnasium's contract."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import segar

IDS = sorted(id_ for id_ in gymnasium.registry if id_.startswith("Segar-"))
QUICK = ("Segar-empty-hard-state-v0", "Segar-objectsx1-hard-rgb-linear-v0", "Segar-billiards-rgb-v0")
make = gymnasium.make


def test_all_families_and_tasks_are_registered_in_both_observations() -> None:
    expected = {f"Segar-{f}-{o}{r}-v0" for f in segar.families() for o in ("rgb", "state") for r in ("", "-linear")}
    expected |= {f"Segar-{t}-{o}-v0" for t in ("puttputt", "billiards", "invisiball") for o in ("rgb", "state")}
    assert len(segar.families()) == 30 and expected == set(IDS)


@pytest.mark.parametrize("id_", ["Segar-empty-hard-state-v0", "segar:Segar-empty-hard-state-linear-v0"])
def test_gymnasium_calls_no_id_out_of_date(id_: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        make(id_, num_levels=2)


@pytest.mark.parametrize("id_", [pytest.param(id_, marks=[pytest.mark.slow] * (id_ not in QUICK)) for id_ in IDS])
def test_the_environment_checker_passes(id_: str) -> None:
    env = make(id_, num_levels=3, render_mode="rgb_array")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped)


@pytest.mark.slow
def test_linear_ids_reward_minus_the_distance_and_the_others_its_square() -> None:
    rewards = []
    for suffix in ("", "-linear"):
        env = make(f"Segar-empty-medium-state{suffix}-v0", num_levels=5, seed=0)
        env.reset(options={"level": 2})
        rewards.append(env.step(np.array([0.3, 0.1], np.float32))[1])
    assert rewards[0] == pytest.approx(-(rewards[1] ** 2))


def test_make_vec_gives_the_native_batch() -> None:
    env = gymnasium.make_vec(
        "Segar-empty-hard-state-v0", num_envs=6, num_levels=5, vectorization_mode="vector_entry_point"
    )
    assert isinstance(env.unwrapped, segar.envs.VectorEnv)
    assert env.reset(seed=0)[0].shape == (6, 16)


def test_train_and_test_splits_share_no_level() -> None:
    sets = [make("Segar-empty-hard-state-v0", num_levels=50, split=s).unwrapped.levels for s in ("train", "test")]
    places = [{tuple(level[:2, :2].ravel()) for level in levels.values} for levels in sets]
    assert len(places[0]) == len(places[1]) == 50 and not places[0] & places[1]


def test_a_single_environment_is_the_batched_one_without_the_batch_axis() -> None:
    levels = segar.family("objectsx1-hard").sample(5, seed=0)
    single, batch = segar.envs.Env(levels), segar.envs.VectorEnv(levels, 1)
    assert np.array_equal(single.reset(seed=3)[0], batch.reset(seed=3)[0][0])
    for _ in range(40):
        action = single.action_space.sample()
        one, many = single.step(action), batch.step(action[None])
        assert one[1] == many[1][0] and one[2] == many[2][0] and one[3] == many[3][0]
        if one[2] or one[3]:
            break
        np.testing.assert_array_equal(one[0], many[0][0])
