"""One environment with Gymnasium's interface: the batched core with a batch of one."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from segar.envs.factors_view import SingleFactors, SingleResults
from segar.envs.vector import VectorEnv
from segar.errors import SegarError, did_you_mean
from segar.observations.pixels import Pixels
from segar.tasks.task import Task

RENDER_RESOLUTION = 256


class Env(gymnasium.Env):
    """A single environment; arguments and ``info`` are those of :class:`VectorEnv`, without the batch axis.

    ``reset(options={"level": i})`` chooses the level. ``render_mode="rgb_array"`` draws a frame of 256 x 256 pixels.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}  # noqa: RUF012 - gymnasium's attribute

    def __init__(self, levels: Any, *, render_mode: str | None = None, **options: Any) -> None:
        if render_mode not in (None, "rgb_array"):
            raise SegarError(f"no render_mode '{render_mode}'.{did_you_mean(str(render_mode), ('rgb_array',))}")
        self._batch = VectorEnv(levels, 1, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.render_mode = render_mode
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space
        self._camera = Pixels(RENDER_RESOLUTION).bind(levels, 1) if render_mode else None

    @property
    def levels(self) -> Any:
        return self._batch.levels

    @property
    def task(self) -> Task:
        return self._batch.task

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Start an episode on a level drawn uniformly, or on ``options["level"]``."""
        super().reset(seed=seed)
        options = dict(options or {})
        batch_options = {"levels": np.array([options.pop("level")])} if "level" in options else {}
        if options:
            raise SegarError(
                f"reset: unknown option '{next(iter(options))}'.{did_you_mean(next(iter(options)), ['level'])}"
            )
        observations, info = self._batch.reset(seed=seed, options=batch_options)
        return observations[0], _single(info)

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict]:
        """Advance by one step; see :meth:`VectorEnv.step`."""
        observations, reward, terminated, truncated, info = self._batch.step(np.asarray(action, np.float32)[None])
        return observations[0], float(reward[0]), bool(terminated[0]), bool(truncated[0]), _single(info)

    def render(self) -> np.ndarray | None:
        """A frame, uint8 ``(256, 256, 3)``, or None without a render mode."""
        if self._camera is None:
            return None
        state = self._batch.state().state
        frame = np.empty((1, RENDER_RESOLUTION, RENDER_RESOLUTION, 3), np.uint8)
        self._camera.begin(state.values, state.level, np.ones(1, np.bool_))
        self._camera.write(state.values, state.level, frame, np.zeros(1, np.int64))
        return frame[0]


def _single(info: dict[str, Any]) -> dict[str, Any]:
    plain = {name: array[0].item() for name, array in info.items() if isinstance(array, np.ndarray)}
    return {**plain, "factors": SingleFactors(info["factors"]), "results": SingleResults(info["results"])}
