"""Interventions on world parameters: they hold for the running episodes, in what follows from them, and in snapshots."""

import dataclasses
import pickle

import numpy as np
import pytest

import segar
from segar.envs import Snapshot, VectorEnv
from segar.errors import LevelError, SegarError
from segar.language import FloorFriction, Gravity, MaxVelocity, Parameter


class CurrentStrength(Parameter, default=1.0): ...


@segar.rule
def drift(x: segar.Position, strength: CurrentStrength) -> segar.Differential[segar.Position]:
    return segar.Differential[segar.Position](x, (0.2 * strength, 0.0))


def river(count=3, seed=0):
    base = segar.family("empty-hard")
    parameters = {CurrentStrength: segar.UniformNoise(0.5, 1.5), FloorFriction: 0.05}
    rules = (*segar.DEFAULT_RULES, drift)
    return dataclasses.replace(base, parameters=parameters).with_rules(rules).sample(count, seed=seed)


def still(env):
    return np.zeros((env.num_envs, 2), np.float32)


def ball_of(env):
    return env.factors["Position"][:, env.levels.layout.slot_index("golfball"), 0]


def test_a_world_parameter_is_set_for_the_rest_of_the_episode_and_snapshots_hold_it(tmp_path):
    env = VectorEnv(river(), num_envs=4, seed=1, max_steps=6)
    _, info = env.reset(options={"levels": np.array([0, 1, 2, 0])})
    untouched, where = env.state(), np.array([True, False, True, False])
    env.intervene("parameters", CurrentStrength, 0.0, where=where)
    before = ball_of(env)
    _, _, _, _, after = env.step(still(env))
    np.testing.assert_array_equal(ball_of(env) == before, where)
    np.testing.assert_array_equal(after["level"], info["level"])
    kept = env.state()
    kept.save(tmp_path / "kept.npz")
    moved = ball_of(env)
    env.intervene("parameters", CurrentStrength, -1.0)
    np.testing.assert_array_equal(ball_of(env), moved)
    env.step(still(env))
    assert (ball_of(env) < moved).all()
    seen = []
    for snapshot, of in (
        (kept, env),
        (Snapshot.load(tmp_path / "kept.npz"), VectorEnv(river(), 4)),
        (kept[[0, 1, 2, 3]], env),
    ):
        of.restore(snapshot)
        of.step(still(of))
        seen.append(ball_of(of))
    np.testing.assert_array_equal(seen[0], seen[1])
    np.testing.assert_array_equal(seen[0], seen[2])
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(env)).state().parameters, env.state().parameters)
    for _ in range(6):
        env.step(still(env))
    assert env.state().parameters is None  # other episodes run
    env.restore(untouched)
    start = ball_of(env)
    env.step(still(env))
    assert (ball_of(env) > start).all()


def test_an_environment_with_a_parameter_set_plays_as_on_a_level_that_has_it():
    levels = river()
    parameters = levels.parameters.copy()
    parameters[:, levels.layout.parameters.index(FloorFriction)] = 0.3
    values = levels.values.copy()
    levels.layout.set_floor(values, parameters)
    other = dataclasses.replace(levels, parameters=parameters, values=values)
    envs = [VectorEnv(one, num_envs=3, seed=1, trials=2, max_steps=20) for one in (levels, other)]
    for env in envs:
        env.reset(options={"levels": np.arange(3)})
    envs[0].intervene("parameters", FloorFriction, 0.3)
    for step in range(30):  # the second trial on the same level has it, too
        actions = np.full((3, 2), 1.0 if step in (0, 20) else 0.0, np.float32)
        seen = [env.step(actions)[0] for env in envs]
        np.testing.assert_array_equal(seen[0], seen[1])


def test_replaced_levels_and_parameters_that_are_set_go_together():
    env = VectorEnv(river(), num_envs=2, seed=1)
    env.reset(options={"levels": np.array([0, 1])})
    env.intervene("parameters", CurrentStrength, 0.0)
    env.replace_levels([0], river(1, seed=5))
    start = ball_of(env)
    _, _, _, _, info = env.step(still(env))
    np.testing.assert_array_equal(ball_of(env), start)
    np.testing.assert_array_equal(info["level"], [-1, 1])


def test_an_intervention_on_a_parameter_says_what_is_wrong():
    env = VectorEnv(river(), num_envs=2, seed=1)
    env.reset()
    with pytest.raises(SegarError, match=r"the world parameter Gravity must be a finite number from 0 to"):
        env.intervene("parameters", Gravity, -1.0)
    with pytest.raises(LevelError, match=r"no entity has a factor 'Gravity'.*intervene\('parameters', Gravity"):
        env.intervene("golfball", Gravity, 1.0)
    with pytest.raises(LevelError, match="no entity is called 'parameters'"):
        env.intervene("parameters", segar.Mass, 1.0)
    with pytest.raises(LevelError, match="environment 0: 'golfball' and 'goal' can pass each other unseen"):
        env.intervene("parameters", MaxVelocity, 1000.0)
    snapshot = env.state()
    with pytest.raises(SegarError, match="'parameters' must have 8 columns"):
        env.restore(dataclasses.replace(snapshot, parameters=np.ones((2, 2))))


def test_a_ball_cannot_be_made_so_small_that_it_passes_others_unseen():
    env = VectorEnv(segar.family("objectsx1-easy").sample(2, seed=0), num_envs=2, seed=1)
    env.reset()
    before = env.state().state.values
    env.intervene("golfball", segar.Size, 0.1)
    with pytest.raises(LevelError, match=r"environment 0: .* can pass each other unseen"):
        env.intervene("golfball", segar.Size, 1e-3)
        env.intervene("object1", segar.Size, 1e-3)
    assert not np.array_equal(env.state().state.values, before, equal_nan=True)


@pytest.mark.parametrize(
    ("factor", "value"), [(segar.Mass, -1.0), (segar.Size, 0.0), (segar.Position, (0.0, 1e31)), (segar.Charge, -1e31)]
)
def test_a_value_that_no_level_can_have_is_refused_and_changes_nothing(factor, value):
    env = VectorEnv(segar.family("empty-hard").sample(2, seed=0), 2, seed=0)
    env.reset()
    before = env.state().state.values
    with pytest.raises(LevelError, match=f"intervene: {factor.__name__} must be a"):
        env.intervene("golfball", factor, value)
    np.testing.assert_array_equal(env.state().state.values, before)
