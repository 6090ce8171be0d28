"""Frames in an array need no pygame: it is loaded when the first is drawn, and where it is missing they are plain."""

import sys
import warnings

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import segar
from segar.observations import Pixels
from segar.rendering import View

LEVELS = segar.family("objectsx1-hard").sample(4, seed=0)


@pytest.fixture
def no_pygame(monkeypatch):
    find = sys.modules["importlib.util"].find_spec
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None if name == "pygame" else find(name))


@pytest.mark.parametrize("size", [64, 66, 200, 512])
def test_without_pygame_frames_show_what_pixels_show(no_pygame, size):
    view = View(size=size)
    env = segar.envs.VectorEnv(LEVELS, 3, seed=0, render_mode="rgb_array", view=view)
    side = min(size // 4 * 4, 256)
    pixels = segar.envs.VectorEnv(LEVELS, 3, seed=0, observation=Pixels(side))
    env.reset()
    pixels.reset()
    actions = np.full((3, 2), 0.4, np.float32)
    env.step(actions)
    seen = pixels.step(actions)[0]
    with pytest.warns(UserWarning, match=r"pygame is not installed.*pip install 'segar\[render\]'"):
        frames = env.render()
    assert [frame.shape for frame in frames] == [view.shape] * 3
    at = np.arange(size) * side // size
    for frame, drawn in zip(frames, seen, strict=True):
        np.testing.assert_array_equal(frame[:size], drawn[at[:, None], at])
        assert not frame[size:].any()
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it is warned once
        env.render()


def test_without_pygame_the_checker_of_gymnasium_passes(no_pygame):
    env = gymnasium.make("Segar-empty-hard-state-v0", num_levels=2, render_mode="rgb_array")
    assert env.unwrapped.metadata["render_modes"] == ["rgb_array"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", "pygame is not installed", UserWarning)
        check_env(env.unwrapped)
