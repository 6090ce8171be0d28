"""One environment with Gymnasium's interface: the batched core with a batch of one."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from segar.envs.vector import VectorEnv
from segar.errors import SegarError, did_you_mean
from segar.language import SingleFactors, SingleResults, Task
from segar.levels import Levels
from segar.observations import map_leaves
from segar.rendering import RENDER_MODES, Camera, View, episode_verdict


class Env(gymnasium.Env):
    """A single environment; arguments and ``info`` are those of :class:`VectorEnv`, without the batch axis.

    >>> env = segar.envs.Env(segar.family("empty-hard").sample(10, seed=0), seed=0)
    >>> observation, info = env.reset(seed=0)
    >>> observation, reward, terminated, truncated, info = env.step(env.action_space.sample())
    >>> info["length"]
    1

    ``reset(options={"level": i})`` chooses the level. With ``render_mode="rgb_array"``, :meth:`render` gives a picture for
    people; with "human", a window shows one after every step. ``view`` says how they look.
    """

    metadata = {"render_modes": RENDER_MODES, "render_fps": 20}  # noqa: RUF012 - gymnasium's attribute

    def __init__(
        self, levels: Levels, *, render_mode: str | None = None, view: View | None = None, **options: Any
    ) -> None:
        self._batch = VectorEnv(levels, 1, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.render_mode = render_mode
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space
        self.metadata = {**type(self).metadata, "render_fps": self._batch.metadata["render_fps"]}
        self._camera = None
        if render_mode is not None:
            self._camera = Camera(levels, self._batch.simulator.world, self.task, 1, render_mode, view)
        self._verdict: str | None = None  # how the episode ended, '' while it goes on; None before the first reset

    @property
    def levels(self) -> Levels:
        return self._batch.levels

    @property
    def task(self) -> Task:
        return self._batch.task

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """Start an episode on a level drawn uniformly, or on ``options["level"]``."""
        super().reset(seed=seed)
        options = dict(options or {})
        batch_options = {"levels": np.array([options.pop("level")])} if "level" in options else {}
        if options:
            raise SegarError(
                f"reset: unknown option '{next(iter(options))}'.{did_you_mean(next(iter(options)), ['level'])}"
            )
        observations, info = self._batch.reset(seed=seed, options=batch_options)
        self._show("")
        return _first(observations), _single(info)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict]:
        """Advance by one step; see :meth:`VectorEnv.step`."""
        observations, rewards, ends, time_outs, batch_info = self._batch.step(np.asarray(action, np.float32)[None])
        terminated, truncated, info = bool(ends[0]), bool(time_outs[0]), _single(batch_info)
        self._show(episode_verdict(info, terminated, truncated))
        return _first(observations), float(rewards[0]), terminated, truncated, info

    def render(self) -> np.ndarray | None:
        """A frame, uint8 ``view.shape``; None without a render mode, and for 'human', where a window shows it.

        Raises:
            SegarError: there was no reset before, or no window can be opened.
        """
        if self._camera is None:
            return None
        if self._verdict is None:
            raise SegarError("call reset() before render()")
        frames = self._camera.render(self._batch.state(), [self._verdict])
        return frames[0] if frames is not None else None

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._camera is not None:
            self._camera.close()

    def _show(self, verdict: str) -> None:
        """Note how the episode ended, and show the state where the render mode is a window."""
        self._verdict = verdict
        if self.render_mode == "human":
            self.render()


def _first(observations: Any) -> Any:
    """The observation of the only environment."""
    return map_leaves(lambda array: array[0], observations)


def _single(info: dict[str, Any]) -> dict[str, Any]:
    """The info of the only environment: numbers and truths instead of arrays."""
    plain = {name: array.item(0) for name, array in info.items() if type(array) is np.ndarray}
    return {**plain, "factors": SingleFactors(info["factors"]), "results": SingleResults(info["results"])}
