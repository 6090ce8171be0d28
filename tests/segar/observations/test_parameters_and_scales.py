"""State observations show world parameters as the level has them, and divide numbers by constants."""

from typing import Any

import numpy as np
import pytest

import segar
from segar import GoalTile, GolfBall, Gravity, Mass, Parameter, Position, Prior, Velocity
from segar.envs import TorchRLEnv, VectorEnv
from segar.errors import FactorError, LevelError
from segar.language import FloorFriction
from segar.observations import Stack, StateVector, empty_batch, simulator_reads


class Breeze(Parameter, default=0.0, unit="N"): ...


class Visits(segar.Count): ...


class Visitor(GolfBall):
    visits: Visits


@segar.rule
def count(visits: Visits, breeze: Breeze) -> segar.SetFactor[Visits]:
    return segar.SetFactor[Visits](visits, visits + 1)


def distribution(low: float, high: float) -> segar.LevelDistribution:
    return segar.LevelDistribution(
        numbers=[(Visitor, 1), (GoalTile, 1)],
        priors=[Prior(Position, segar.RandomUniformLocation())],
        parameters={Breeze: segar.UniformNoise(low, high)},
    ).with_rules([*segar.DEFAULT_RULES, count])


LEVELS = distribution(3.0, 5.0).sample(6, seed=0)
BREEZE = LEVELS.parameters[:, LEVELS.layout.parameters.index(Breeze)]
SHOWN = StateVector(entities=["golfball"], factors=[Position], parameters=[Breeze, "Gravity"])


def written(observation: Any, env: VectorEnv) -> Any:
    """The observation of the present states of ``env``, written after the step."""
    state = env.state().state
    bound = observation.bind(env.levels, env.num_envs)
    out = empty_batch(bound.space, env.num_envs)
    bound.write(state.values, state.level, out, np.arange(env.num_envs))
    return out


def test_the_simulator_shows_each_level_its_own_parameters_and_the_same_bits_as_after_the_step():
    env = VectorEnv(LEVELS, 12, observation=SHOWN, seed=0, num_threads=2)
    assert simulator_reads(env.observation) is not None
    assert env.observation.names[-2:] == ["world.Breeze", "world.Gravity"]
    seen, _ = env.reset()
    rng = np.random.default_rng(0)
    for _ in range(150):  # beyond the time limit, so that environments go on to other levels
        level = env.state().state.level
        np.testing.assert_array_equal(seen[:, -2], BREEZE[level].astype(np.float32))
        np.testing.assert_array_equal(seen[:, -1], np.float32(Gravity.default))
        np.testing.assert_array_equal(seen, written(SHOWN, env))
        assert env.single_observation_space.contains(seen[0])
        seen, *_ = env.step(rng.uniform(-1, 1, (12, 2)).astype(np.float32))
    assert len(set(seen[:, -2])) > 1


@pytest.mark.parametrize("mask", [None, "numbers", "dict"])
def test_parameters_are_never_missing(mask):
    env = VectorEnv(LEVELS, 6, observation=StateVector(entities=[], parameters=[Breeze], mask=mask), seed=0)
    seen, _ = env.reset(options={"levels": np.arange(6)})
    state = seen["state"] if mask == "dict" else seen
    np.testing.assert_array_equal(state[:, 0], BREEZE.astype(np.float32))
    if mask is not None:
        assert ((seen["mask"] if mask == "dict" else seen[:, 1:]) == 1).all()


def test_all_parameters_are_chosen_by_their_common_class_and_some_are_hidden():
    names = StateVector(entities=[], parameters=[Parameter], hidden=[FloorFriction]).bind(LEVELS, 1).names
    expected = [f"world.{p.__name__}" for p in LEVELS.layout.parameters if p is not FloorFriction]
    assert names == expected and "world.Breeze" in names


def test_what_is_shown_is_what_shows_says():
    assert SHOWN.shows(Breeze) and SHOWN.shows(Gravity)
    assert not SHOWN.shows(FloorFriction) and not StateVector().shows(Gravity)
    assert not StateVector(parameters=[Breeze], hidden=[Breeze]).shows(Breeze)


def test_parameters_are_normalised_by_their_prior():
    many = distribution(3.0, 5.0).sample(2000, seed=1)
    env = VectorEnv(many, 2000, observation=StateVector(entities=[], parameters=[Breeze], normalise=True), seed=0)
    seen, _ = env.reset(options={"levels": np.arange(2000)})
    assert abs(seen.mean()) < 0.1 and abs(seen.std() - 1) < 0.1


def test_a_state_that_goes_on_in_another_world_shows_the_parameters_of_that_world():
    env, windier = (VectorEnv(levels, 2, observation=SHOWN, seed=0)
                    for levels in (LEVELS[:2], distribution(8.0, 9.0).sample(2, seed=0)))  # fmt: skip
    before, _ = env.reset(options={"levels": np.arange(2)})
    windier.reset()
    after = windier.restore(env.state())
    np.testing.assert_array_equal(after[:, :2], before[:, :2])
    assert (after[:, 2] >= 8).all() and (before[:, 2] <= 5).all()


def test_stacks_and_torchrl_show_parameters():
    env = TorchRLEnv(LEVELS, 4, observation=Stack(SHOWN, 2), seed=0)
    start = env.reset()
    rolled = env.rollout(3)
    assert start["observation"].shape == (4, 8)
    assert set(rolled["next", "observation"][..., 6].flatten().tolist()) <= set(BREEZE.astype(np.float32).tolist())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"factors": ["Breeze"]}, r"Breeze is a world parameter, which no entity has; write parameters=\[Breeze\]"),
        ({"parameters": [Mass]}, r"Mass is a factor of entities, not a world parameter; write factors=\[Mass\]"),
        ({"parameters": ["Breze"]}, "no world parameter is called 'Breze'. Did you mean 'Breeze'"),
        ({"parameters": ["Mas"]}, "no world parameter is called 'Mas'."),
        ({"parameters": [Breeze], "form": "table"}, "belong to no row of a table; show them beside it"),
        ({"scale": {"Visist": 10}}, "scale: no factor is called 'Visist'. Did you mean 'Visits'"),
        ({"scale": {Visits: 0}}, "Visits is divided by a finite number above 0, not by 0"),
        ({"scale": 10}, "scale maps factors to numbers"),
    ],
)
def test_wrong_options_say_what_to_write(options, words):
    with pytest.raises(segar.SegarError, match=words):
        StateVector(**options)


def test_levels_without_the_parameter_are_refused():
    levels = segar.family("empty-easy").sample(1, seed=0)
    with pytest.raises(LevelError, match="these levels have no world parameter Breeze; give it in the distribution's"):
        StateVector(parameters=[Breeze]).bind(levels, 1)


def test_numbers_are_divided_by_their_constants_and_others_stay_as_they_are():
    plain = StateVector(parameters=[Breeze])
    scaled = StateVector(parameters=[Breeze], scale={Visits: 200, "Breeze": 5.0})
    env = VectorEnv(LEVELS, 6, observation=("state", plain, scaled), seed=0)
    env.reset()
    for _ in range(30):
        (_, seen, divided), *_ = env.step(np.zeros((6, 2), np.float32))
    names = plain.bind(LEVELS, 1).names
    by = np.ones(len(names), np.float32)
    by[names.index("golfball.Visits")], by[names.index("world.Breeze")] = 200, 5
    np.testing.assert_allclose(divided, seen / by, rtol=1e-6)
    np.testing.assert_array_equal(divided[:, by == 1], seen[:, by == 1])
    assert seen[:, names.index("golfball.Visits")].min() > 100


def test_the_nearest_class_decides_what_a_number_is_divided_by():
    class Weight(Mass): ...

    state = StateVector(scale={Mass: 2.0, Weight: 5.0})
    assert (state.scale_of(Mass), state.scale_of(Weight), state.scale_of(Velocity)) == (2.0, 5.0, None)


def test_a_constant_takes_the_place_of_the_prior():
    state = StateVector(entities=[], parameters=[Breeze], normalise=True, scale={Breeze: 5.0})
    env = VectorEnv(LEVELS, 6, observation=state, seed=0)
    seen, _ = env.reset(options={"levels": np.arange(6)})
    np.testing.assert_allclose(seen[:, 0], BREEZE / 5, rtol=1e-6)


def test_a_constant_for_what_is_not_shown_is_refused():
    with pytest.raises(LevelError, match="scale: no Visits is shown"):
        StateVector(entities=["goal"], scale={Visits: 200}).bind(LEVELS, 1)
    with pytest.raises(FactorError, match="scale: FloorFriction is divided by"):
        StateVector(scale={FloorFriction: float("nan")})
