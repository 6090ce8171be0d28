"""Videos of a policy at play."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from segar.envs import VectorEnv
from segar.levels import Levels
from segar.rendering import View, write_video

FORMATS = ("mp4", "gif")
VIEW = View(size=384)


def film(
    path: Path,
    policy: Any,
    levels: Levels,
    level: int,
    env_options: Mapping[str, Any],
    *,
    rng: torch.Generator | None,
    seed: int,
) -> int:
    """Films one episode of a policy (:class:`experiments.algorithms.learner.Policy`) on a level; returns how many frames it has.

    Args:
        path: ends in .mp4 or .gif.
        rng: source of sampled actions; None plays the deterministic policy.
        seed: of the environment, for physics that is random.

    Raises:
        SegarError: the extra ``render`` is not installed, or the file cannot be written.
    """
    options = dict(autoreset_mode="Disabled", render_mode="rgb_array", view=VIEW)
    env = VectorEnv(levels, 1, seed=seed, **options, **env_options)
    try:
        return write_video(path, _frames(env, policy, level, rng, seed), env.metadata["render_fps"])
    finally:
        env.close()


def _frames(env: VectorEnv, policy: Any, level: int, rng: torch.Generator | None, seed: int) -> Iterator[np.ndarray]:
    observation, _ = env.reset(seed=seed, options={"levels": np.array([level])})
    if hasattr(policy, "begin"):
        policy.begin(env)
    yield _frame(env)
    over = False
    while not over:
        observation, _, terminated, truncated, _ = env.step(policy.act(observation, rng=rng))
        yield _frame(env)
        over = bool(terminated[0] or truncated[0])


def _frame(env: VectorEnv) -> np.ndarray:
    frames = env.render()
    assert frames is not None  # the render mode is rgb_array
    return frames[0]
