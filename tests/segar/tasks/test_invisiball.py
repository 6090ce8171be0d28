"""Invisiball: PuttPutt whose ball is not seen once it has been pushed, though it rolls on."""

import numpy as np
import pytest

import segar
from segar.envs import Env, VectorEnv
from segar.rendering import View
from tests.segar.tasks.play import at_random, by_script, episodes

LEVELS = segar.family("invisiball").sample(40, seed=0)
BALL = LEVELS.layout.slot_index("golfball")
WHITE = (255, 255, 255)


def actions(step: int, num_envs: int = 16) -> np.ndarray:
    return np.random.default_rng(step).uniform(-1, 1, (num_envs, 2)).astype(np.float32)


def test_the_ball_is_invisible_from_the_first_action_on():
    env = VectorEnv(LEVELS, 16, seed=0, autoreset_mode="Disabled")
    _, info = env.reset(seed=0)
    assert (info["factors"]["Visible"][:, BALL] == 1).all()
    for step in range(5):
        info = env.step(actions(step))[-1]
        visible = info["factors"]["Visible"]
        assert (visible[:, BALL] == 0).all() and np.nanmin(np.delete(env.factors["Visible"], BALL, axis=1)) == 1


@pytest.mark.slow
def test_physics_and_reward_are_those_of_puttputt():
    ours = VectorEnv(LEVELS, 16, seed=0, autoreset_mode="Disabled")
    theirs = VectorEnv(LEVELS, 16, seed=0, autoreset_mode="Disabled", task=segar.puttputt())
    assert ours.task.name == "invisiball-squared" and theirs.task.name == "puttputt-squared"
    ours.reset(seed=0), theirs.reset(seed=0)
    for step in range(50):
        a, b = ours.step(actions(step)), theirs.step(actions(step))
        for x, y in zip(a[:4], b[:4], strict=True):
            assert np.array_equal(x, y)
        for name in set(a[4]["factors"]) - {"Visible"}:
            np.testing.assert_array_equal(a[4]["factors"][name], b[4]["factors"][name])


def test_the_ball_tells_where_it_is_by_what_it_does_to_the_chargers():
    env = VectorEnv(LEVELS, 16, seed=0, autoreset_mode="Disabled")
    env.reset(seed=0)
    x = env.factors["Position"]
    for _ in range(5):
        env.step(np.zeros((16, 2), np.float32))
    moved = np.linalg.norm(env.factors["Position"] - x, axis=-1)
    present = ~np.isnan(moved[:, :3])
    assert (moved[:, :3][present] > 0).all()


def test_the_scripted_player_sees_more_than_the_agent_and_arrives():
    env = VectorEnv(LEVELS, 24, seed=0)
    random, scripted = (episodes(env, policy)["success"] for policy in (at_random(), by_script(env)))
    assert scripted.mean() > 0.9 > 0.5 > random.mean()


def test_a_reset_shows_the_ball_again_and_people_see_an_outline_of_it_after():
    env = Env(LEVELS, render_mode="rgb_array", view=View(labels=False, line=False), seed=0)
    for _ in range(2):
        _, info = env.reset(seed=0)
        full = white_share(env.render(), info["factors"]["Position"][BALL])
        _, _, _, _, info = env.step(np.zeros(2, np.float32))
        outline = white_share(env.render(), info["factors"]["Position"][BALL])
        assert full > 0.4 and 0.02 < outline < 0.3


def white_share(frame: np.ndarray, position: np.ndarray) -> float:
    """Share of white in the square of the ball's width around a position."""
    side = len(frame)
    column, row = (round(side * (1 + c) / 2) for c in (position[0], -position[1]))
    half = round(0.085 * side / 2)
    return float((frame[row - half : row + half, column - half : column + half] == WHITE).all(axis=-1).mean())
