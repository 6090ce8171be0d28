"""render_mode="human": a window follows the environment, and closing it stops the drawing alone."""

import os
import subprocess
import sys

import numpy as np
import pygame
import pytest

import segar
from segar.rendering import View
from segar.rendering.window import Window

LEVELS = segar.family("empty-hard").sample(4, seed=0)


@pytest.fixture
def shown(monkeypatch):
    """The pictures that windows were asked to show."""
    pictures: list[np.ndarray] = []
    show = Window.show

    def listen(self, picture, rate):
        pictures.append(picture)
        show(self, picture, 10_000)  # do not wait

    monkeypatch.setattr(Window, "show", listen)
    return pictures


def test_a_window_shows_every_step_of_a_single_environment(shown):
    env = segar.envs.Env(LEVELS, render_mode="human", seed=0)
    env.reset(options={"level": 1})
    for _ in range(3):
        env.step(np.float32([0.5, 0.5]))
    assert env.render() is None and len(shown) == 5
    assert shown[0].shape == (544, 512, 3) and (shown[1] != shown[2]).any()
    env.close()
    env.close()


def test_a_window_shows_several_environments_side_by_side(shown):
    env = segar.envs.VectorEnv(LEVELS, 3, render_mode="human", view=View(size=64), seed=0)
    frames = segar.envs.VectorEnv(LEVELS, 3, render_mode="rgb_array", view=View(size=64), seed=0)
    env.reset()
    frames.reset()
    env.step(np.zeros((3, 2), np.float32))
    assert len(shown) == 2 and shown[0].shape == (128, 128, 3)
    first, second, third = frames.render()
    assert (shown[0] == np.block([[[first], [second]], [[third], [np.zeros_like(first)]]])).all()
    env.close()


def test_a_window_shows_the_end_of_an_episode_before_the_next_one_starts(shown):
    env = segar.envs.VectorEnv(LEVELS, 1, render_mode="human", view=View(size=64), seed=0, max_steps=1)
    single = segar.envs.Env(LEVELS, render_mode="rgb_array", view=View(size=64), seed=0, max_steps=1)
    env.reset(options={"levels": np.array([2])})
    single.reset(options={"level": 2})
    push = np.float32([1.0, 0.0])
    env.step(push[None])
    single.step(push)
    assert (shown[-1] == single.render()).all()
    env.close()


def test_an_environment_goes_on_when_somebody_closes_its_window_and_others_stay_open():
    one, other = (segar.envs.Env(LEVELS, render_mode="human", view=View(size=64), seed=0) for _ in range(2))
    one.reset()
    other.reset()
    windows = [env._camera._window for env in (one, other)]
    pygame.event.post(pygame.event.Event(pygame.WINDOWCLOSE, window=windows[0]._window))
    for _ in range(2):  # whoever looks first leaves the event to whom it concerns
        other.step(np.zeros(2, np.float32))
        one.step(np.zeros(2, np.float32))
    assert [window.is_open for window in windows] == [False, True]
    one.step(np.zeros(2, np.float32))
    other.close()


def test_pygame_is_loaded_by_the_first_frame_and_without_a_screen_the_error_says_what_to_do():
    """Both in one process, since each takes seconds to start."""
    program = (
        "import sys, segar\n"
        "frames, window = (segar.envs.Env(segar.family('empty-hard').sample(1, seed=0), render_mode=mode)\n"
        "                  for mode in ('rgb_array', 'human'))\n"
        "frames.reset()\nassert 'pygame' not in sys.modules\n"
        "frames.render()\nassert 'pygame' in sys.modules\n"
        "try:\n    window.reset()\nexcept segar.SegarError as error:\n    print(error)\n"
    )
    environment = os.environ | {"SDL_VIDEODRIVER": "no_such_driver"}
    run = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    assert run.stdout.startswith("no window can be opened:") and "SDL_VIDEODRIVER=dummy" in run.stdout
