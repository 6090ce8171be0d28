"""Snapshots: saved, restored and forked episodes go on to the bit, and differ by nothing but what was changed."""

from typing import Tuple  # as the paper writes rules

import numpy as np
import pytest

import segar
from segar import GolfBall, Mass, Position, SegarError, SetFactor, Velocity
from segar.envs import Snapshot, VectorEnv
from segar.envs.snapshots import EPISODE_ARRAYS, STATE_ARRAYS


@segar.rule
def shake(body: Tuple[Velocity, Mass]) -> SetFactor[Velocity]:
    v, m = body
    return SetFactor[Velocity](v, v + segar.Vector((segar.random.normal(0.0, 0.1), 0.0)) / m)


DIST = segar.LevelDistribution(
    numbers=[(GolfBall, 1), (segar.GoalTile, 1)], priors=[segar.Prior(Position, segar.RandomUniformLocation())]
).with_rules((segar.move, shake))
LEVELS = DIST.sample(5, seed=0)
ACTIONS = np.random.default_rng(0).uniform(-1, 1, (20, 6, 2)).astype(np.float32)


def some_steps(env: VectorEnv, actions: np.ndarray) -> list[np.ndarray]:
    """Observations, rewards, ends and positions of some steps, joined along their first axis."""
    trail = []
    for a in actions:
        observations, reward, terminated, truncated, info = env.step(a)
        trail.append((observations, reward, terminated, truncated, info["level"], info["factors"]["Position"]))
    return [np.stack(parts) for parts in zip(*trail, strict=True)]


def same(a: list[np.ndarray], b: list[np.ndarray]) -> bool:
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(a, b, strict=True))


@pytest.fixture
def running() -> VectorEnv:
    """Six environments in the midst of their episodes, which last 20 steps."""
    env = VectorEnv(LEVELS, 6, seed=1, max_steps=20)
    env.reset()
    some_steps(env, ACTIONS[:7])
    return env


def test_forks_with_equal_actions_are_equal_to_the_bit_though_rules_are_random(running):
    fork = VectorEnv(LEVELS, 4, seed=2, autoreset_mode="Disabled")
    fork.restore(running.state()[[3, 3, 5, 3]])
    trails = some_steps(fork, np.repeat(ACTIONS[:, 3:4], 4, axis=1))
    assert all(np.array_equal(t[:, 0], t[:, k], equal_nan=True) for t in trails for k in (1, 3))
    assert not np.array_equal(trails[5][:, 0], trails[5][:, 2], equal_nan=True)


def test_a_fork_goes_on_as_the_environment_that_it_was_taken_from(running):
    fork = VectorEnv(LEVELS, 1, seed=2)
    fork.restore(running.state()[4])
    there = some_steps(running, ACTIONS[:10])
    assert same([t[:, 4:5] for t in there], some_steps(fork, ACTIONS[:10, 4:5]))


def test_one_difference_has_its_consequence_and_no_other(running):
    """Twice the mass takes half the speed from the same push, and half the jitter from the same draws."""
    fork = VectorEnv(LEVELS, 2, seed=0, sub_steps=1)
    snapshot = running.state()[[0, 0]]
    for factor in (Position, Velocity):  # at rest, far from walls
        column = LEVELS.layout.columns[factor]
        snapshot.state.values[:, 0, column : column + 2] = 0.0
    fork.restore(snapshot)
    fork.intervene("golfball", Mass, 2.0, where=np.array([False, True]))
    _, _, _, _, info = fork.step(np.array([[0.5, 0.1], [0.5, 0.1]], np.float32))
    v = info["factors"]["Velocity"][:, 0]
    np.testing.assert_allclose(v[0], 2 * v[1], rtol=1e-14)
    np.testing.assert_array_equal(info["factors"]["Position"][0, 1], info["factors"]["Position"][1, 1])


def test_a_snapshot_that_was_saved_and_loaded_goes_on_to_the_bit_beyond_the_end_of_episodes(running, tmp_path):
    running.state().save(tmp_path / "snapshot.npz")
    there = some_steps(running, ACTIONS)
    assert there[3].any(), "some episodes end on the way"
    again = VectorEnv(LEVELS, 6, seed=9, max_steps=20)
    again.restore(Snapshot.load(tmp_path / "snapshot.npz"))
    assert same(there, some_steps(again, ACTIONS))


def test_a_snapshot_is_a_copy(running):
    snapshot = running.state()
    part = snapshot[[0, 1]]
    part.state.values[:] = 7.0
    running.intervene("golfball", Mass, 3.0)
    assert not (snapshot.state.values == 7.0).any()
    assert (snapshot.state.values[:, 0, LEVELS.layout.columns[Mass]] == 1.0).all()
    assert len(snapshot) == 6 and len(part) == 2 and len(snapshot[-1]) == 1
    assert len(snapshot[np.arange(6) < 4]) == 4


def test_environments_that_a_snapshot_does_not_hold_are_refused(running):
    snapshot = running.state()
    with pytest.raises(SegarError, match=r"snapshot\[\[0, 6\]\]: it holds 6 environments"):
        snapshot[[0, 6]]
    with pytest.raises(SegarError, match=r"snapshot\[6\]: it holds 6 environments"):
        snapshot[6]
    with pytest.raises(SegarError, match=r"names no environment"):
        snapshot[6:]


def test_a_snapshot_of_another_size_or_of_other_levels_is_refused(running):
    snapshot = running.state()
    with pytest.raises(SegarError, match=r"holds 6 environments, and here are 2; pick .*, as in snapshot\["):
        VectorEnv(LEVELS, 2).restore(snapshot)
    snapshot.state.level[:] = 4
    with pytest.raises(SegarError, match="at least 5 levels, and here are 3 levels of 3 entities"):
        VectorEnv(LEVELS[:3], 6).restore(snapshot)
    levels = segar.family("tilesx1-hard").sample(5, seed=0)
    with pytest.raises(SegarError, match=r"of 3 entities with .* and here are 5 levels of 4 entities"):
        snapshot.check_fits(levels, 6)


def test_files_that_are_no_snapshots_are_refused(tmp_path):
    path = tmp_path / "snapshot.npz"
    with pytest.raises(SegarError, match="there is no snapshot"):
        Snapshot.load(path)
    LEVELS.save(path)
    with pytest.raises(SegarError, match="is not a snapshot"):
        Snapshot.load(path)


def test_a_saved_snapshot_has_the_arrays_that_segar_0_1_reads(running, tmp_path):
    running.state().save(tmp_path / "snapshot.npz")
    with np.load(tmp_path / "snapshot.npz") as archive:
        assert set(archive.files) == {*STATE_ARRAYS, *EPISODE_ARRAYS, "metadata"}
