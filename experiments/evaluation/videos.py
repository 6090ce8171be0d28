"""Videos of a policy at play."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch

from experiments.evaluation.episodes import Agent, actions_of
from segar.envs import VectorEnv, play
from segar.levels import Levels
from segar.rendering import View, write_video

VIEW = View(size=384)


def record_video(
    path: Path,
    policy: Agent,
    levels: Levels,
    level: int,
    env_options: Mapping[str, Any],
    *,
    rng: torch.Generator | None,
    seed: int,
) -> int:
    """Record one episode of a policy on a level; return the number of frames.

    Args:
        path: ends in .mp4 or .gif.
        rng: source of sampled actions; None plays the deterministic policy.
        seed: of the environment, for physics that is random.

    Raises:
        SegarError: the extra ``render`` is not installed, or the file cannot be written.
    """
    options = dict(autoreset_mode="Disabled", render_mode="rgb_array", view=VIEW)
    env = VectorEnv(levels, 1, seed=seed, **options, **env_options)

    def frames() -> Iterator[np.ndarray]:
        start = env.reset(seed=seed, options={"levels": np.array([level])})
        for _ in play(env, actions_of(policy, env, rng), start):
            images = env.render()
            assert images is not None  # the render mode is rgb_array
            yield images[0]

    try:
        return write_video(path, frames(), env.metadata["render_fps"])
    finally:
        env.close()
