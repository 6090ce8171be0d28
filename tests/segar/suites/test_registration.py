"""Gymnasium ids of suites: both sides, both observations, single and batched, without warnings of Gymnasium's."""

import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import segar
from segar.errors import SegarError, SuiteError
from segar.suites import suite, suites

IDS = sorted(id_ for id_ in gymnasium.registry if id_.startswith("Segar/"))


def test_all_suites_are_registered_on_both_sides():
    assert {f"Segar/{n}-{s}-{o}" for n in suites() for s in ("train", "test") for o in ("rgb", "state")} == set(IDS)


@pytest.mark.parametrize("id_", ["Segar/sight-mass-v1-train-state", "Segar/look-far-v1-test-rgb"])
def test_the_environment_checker_passes_without_a_warning(id_):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(id_, num_levels=3, render_mode="rgb_array")
        check_env(env.unwrapped)


@pytest.mark.parametrize("name", ["place-between-v1", "world-gravity-v1"])
def test_training_levels_are_drawn_and_test_levels_are_the_frozen_ones(name):
    train = gymnasium.make(f"Segar/{name}-train-state", seed=3).unwrapped
    test = gymnasium.make_vec(f"Segar/{name}-test-state", num_envs=4, vectorization_mode="vector_entry_point").unwrapped
    found = suite(name)
    assert train.levels == found.sample(3) and len(train.levels) == found.training_levels
    assert test.levels == found.test_levels and test.task == found.task and test.num_envs == 4
    few = gymnasium.make(f"Segar/{name}-test-state", num_levels=7).unwrapped
    assert few.levels == found.test_levels[:7]


def test_hidden_factors_are_not_observed_and_textures_are_those_of_the_side():
    shown, hidden = (gymnasium.make(f"Segar/{n}-v1-test-state", num_levels=3) for n in ("property-heavy", "sight-mass"))
    assert hidden.observation_space.shape[0] < shown.observation_space.shape[0]
    frames = [
        gymnasium.make(f"Segar/look-far-v1-{side}-rgb", num_levels=3).reset(seed=0)[0] for side in ("train", "test")
    ]
    assert not np.array_equal(*frames)


def test_wrong_arguments_are_told():
    with pytest.raises(SuiteError, match=r"look-far-v1 shows the set of textures.*'state' does not; choose rgb"):
        gymnasium.make("Segar/look-far-v1-test-state")
    with pytest.raises(SuiteError, match=r"num_levels: place-few-v1 has 200 test levels, not 201"):
        gymnasium.make("Segar/place-few-v1-test-state", num_levels=201)
    for number in (2.5, True, "3"):
        with pytest.raises(SuiteError, match=r"has 200 test levels, not|number of training levels must be"):
            gymnasium.make(f"Segar/place-few-v1-{'test' if number == 2.5 else 'train'}-state", num_levels=number)
    with pytest.raises(SegarError, match=r"unexpected keyword argument 'obs'"):
        gymnasium.make("Segar/place-few-v1-test-state", obs="rgb")


@pytest.mark.parametrize("option", [{"task": segar.puttputt()}, {"max_steps": 10}, {"sub_steps": 2}])
def test_an_id_is_its_suite_whatever_options_are_given(option):
    with pytest.raises(SuiteError, match=rf"the suite place-few-v1 says .* leave {next(iter(option))} out"):
        gymnasium.make("Segar/place-few-v1-train-state", **option)


def test_what_is_invisible_is_not_shown_where_a_suite_is_about_it():
    of = suite("sight-ball-v1")
    ball = segar.observations.StateVector(entities=["golfball"], sees_invisible=False)
    env = segar.envs.VectorEnv(num_envs=3, seed=0, **segar.suites.side_options(of, "train", observation=ball))
    assert env.reset()[0].any() and not env.step(np.zeros((3, 2), np.float32))[0].any()
    assert not segar.suites.side_options(of, "test")["observation"].sees_invisible
    with pytest.raises(SuiteError, match="StateVector shows what is invisible"):
        segar.suites.side_options(of, "train", observation=segar.observations.StateVector())
