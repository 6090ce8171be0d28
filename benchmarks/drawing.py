"""Frames: drawn alone, with physics and in stacks, in all forms; and painting when episodes start."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

import segar
from benchmarks.environments import NUM_ENVS, play, random_actions
from benchmarks.measure import Row, in_turns, timed
from segar.observations.composed.stack import Stack
from segar.observations.pixels.solid_colours import Pixels
from segar.observations.pixels.textured import TexturedPixels

FAMILY = "objectsx3-hard"
LEVELS = 200
FRAMES = 10  # per environment and measurement
STEPS = 16
WARM_UP = 30  # steps until things are where play takes them
FORMS = {
    "solid colours": Pixels(),
    "grey": TexturedPixels(grey=True),
    "channels first": TexturedPixels(channels="first"),
    "following factors": TexturedPixels(follow=True),
    "filters": TexturedPixels("baseline"),
}


def drawing(repeats: int) -> Iterator[Row]:
    """Textured frames of 64 x 64 x 3 in millions per core-second, and what starting episodes costs."""
    env = played(TexturedPixels())
    yield Row(f"frames {FAMILY}, textures", frame_rates(env, 3 * repeats), "M/s", at_least=0.3)
    actions = random_actions(STEPS)
    rolls = timed(lambda: play(env, actions), repeats, time.process_time)
    rates = [NUM_ENVS * STEPS / s / 1e6 for s in rolls]
    yield Row(f"VectorEnv {FAMILY} textures", rates, "M/s", at_least=0.2, note="physics, frames, resets")
    yield from stacked(repeats)
    for name, observation in FORMS.items():
        yield Row(f"frames {FAMILY}, {name}", frame_rates(played(observation), repeats), "M/s")
    for family in (FAMILY, "tilesx3-hard"):
        seconds = timed(starting(family), repeats, time.process_time)
        yield Row(f"paint {NUM_ENVS} new levels of {family}", [s * 1e3 for s in seconds], "ms", at_most=100)


def stacked(repeats: int) -> Iterator[Row]:
    """Steps with four frames, in millions per core-second and beside those with one."""
    actions = random_actions(STEPS)
    for name, copy, bar in (("", False, 1.5), (", copied", True, None)):
        envs = [played(observation, copy=copy) for observation in (TexturedPixels(), Stack(TexturedPixels(), 4))]
        one, four = in_turns([partial(play, env, actions) for env in envs], 3 * repeats, time.process_time)
        yield Row(f"VectorEnv {FAMILY} four frames{name}", [NUM_ENVS * STEPS / s / 1e6 for s in four], "M/s")
        yield Row("  four frames / one frame", [b / a for a, b in zip(one, four, strict=True)], "x", at_most=bar)


def played(observation: Any, copy: bool = True) -> segar.envs.VectorEnv:
    """Environments in the middle of play."""
    levels = segar.family(FAMILY).sample(LEVELS, seed=0)
    env = segar.envs.VectorEnv(levels, NUM_ENVS, observation=observation, seed=0, copy=copy)
    env.reset()
    for action in random_actions(WARM_UP):
        env.step(action)
    return env


def frame_rates(env: segar.envs.VectorEnv, repeats: int) -> list[float]:
    """Millions of frames per core-second."""
    state, rows = env.state().state, np.arange(NUM_ENVS)
    frames = np.zeros((NUM_ENVS, *env.single_observation_space.shape), np.uint8)  # type: ignore[misc]

    def draw() -> None:
        for _ in range(FRAMES):
            env.observation.write(state.values, state.level, frames, rows)

    return [NUM_ENVS * FRAMES / s / 1e6 for s in timed(draw, repeats, time.process_time)]


def starting(family: str) -> Any:
    """A call that makes the patterns and backgrounds of environments that all start on a level of their own."""
    levels = segar.family(family).sample(NUM_ENVS, seed=0)
    bound, level, everywhere = TexturedPixels().bind(levels, NUM_ENVS), np.arange(NUM_ENVS), np.ones(NUM_ENVS, np.bool_)

    def start() -> None:
        bound.start(level.astype(np.uint64), level, everywhere)
        bound.begin(levels.values, level, everywhere)

    return start
