"""One environment with Gymnasium's interface: the batched core with a batch of one."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from segar.envs.checks import actions_of, known_options, options_of, require_known, seed_of, whole_number
from segar.envs.vector import VectorEnv
from segar.language import Factors, Task
from segar.levels import Levels
from segar.observations import map_leaves
from segar.rendering import RENDER_MODES, Camera, View, episode_verdict

OF_BATCHES = {"num_envs", "autoreset_mode"}  # which a single environment does not take


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
        require_known(options, known_options(VectorEnv) - OF_BATCHES)
        self._batch = VectorEnv(levels, 1, autoreset_mode=AutoresetMode.DISABLED, **options)
        self.render_mode, self._view = render_mode, view
        self.observation_space = self._batch.single_observation_space
        self.action_space = self._batch.single_action_space
        offered = ("render_modes", "render_fps")
        self.metadata = {**type(self).metadata, **{key: self._batch.metadata[key] for key in offered}}
        self._camera = self._new_camera()
        self._verdict = ""  # how the episode ended, '' while it goes on

    def __getstate__(self) -> dict[str, Any]:
        """A pickle holds all but the camera, which may have a window."""
        return {name: value for name, value in vars(self).items() if name != "_camera"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._camera = self._new_camera()

    @property
    def levels(self) -> Levels:
        return self._batch.levels

    @property
    def task(self) -> Task:
        return self._batch.task

    @property
    def factors(self) -> Factors:
        """The true factors of all entities in the present state, without the batch axis; see :attr:`VectorEnv.factors`."""
        return Factors(self.levels.layout, {name: array[0] for name, array in self._batch.factors.items()})

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict]:
        """Start an episode on a level drawn uniformly, or on ``options["level"]``; or the next trial on the same level, see
        :meth:`VectorEnv.reset`.

        The options of a recorded episode start it again: ``level``, ``seed`` (unless one is given), ``environment``, the place
        in the batch that recorded it, and ``trial``.
        """
        given = options_of(options, ("level", "seed", "environment", "trial"))
        level, place, trial = given.get("level"), given.get("environment", 0), given.get("trial", 0)
        seed = given.get("seed") if seed is None else seed
        super().reset(seed=None if seed is None else seed_of(seed))
        trial = whole_number("reset: option 'trial'", trial, 0, self._batch.trials - 1)
        batch_options = {"environment": place}
        if level is not None:
            batch_options["levels"] = np.array([whole_number("reset: option 'level'", level, 0, len(self.levels) - 1)])
        observations, info = self._batch.reset(seed=[seed] if place else seed, options=batch_options)
        for _ in range(trial):
            observations, info = self._batch.reset()
        self._show("")
        return _first(observations), _single(info)

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict]:
        """Advance by one step; see :meth:`VectorEnv.step`."""
        actions = actions_of(action, self.action_space.shape or ())[None]
        observations, rewards, ends, time_outs, batch_info = self._batch.step(actions)
        terminated, truncated, info = bool(ends[0]), bool(time_outs[0]), _single(batch_info)
        self._show(episode_verdict(info, terminated, truncated))
        return _first(observations), float(rewards[0]), terminated, truncated, info

    def replace_levels(self, indices: Any, levels: Levels) -> None:
        """Take other levels for the episodes that begin from now on; see :meth:`VectorEnv.replace_levels`."""
        self._batch.replace_levels(indices, levels)
        if self._camera is not None:
            self._camera.show_levels(self._batch.pool.levels)

    def set_level_weights(self, weights: Any) -> None:
        """Draw levels with these weights from now on; see :meth:`VectorEnv.set_level_weights`."""
        self._batch.set_level_weights(weights)

    def render(self) -> np.ndarray | None:
        """A frame, uint8 ``view.shape``; None without a render mode, and for 'human', where a window shows it.

        Raises:
            SegarError: there was no reset before, or no window can be opened.
        """
        if self._camera is None:
            return None
        self._batch.require_open("render")
        frames = self._camera.render(self._batch.state(), [self._verdict])
        return frames[0] if frames is not None else None

    def close(self) -> None:
        """Close the window, if there is one; nothing can be played afterwards."""
        self._batch.close()
        if self._camera is not None:
            self._camera.close()

    def _new_camera(self) -> Camera | None:
        """What draws for people; None without a render mode."""
        if self.render_mode is None:
            return None
        return Camera(self._batch.pool.levels, self._batch.simulator.world, self.task, 1, self.render_mode, self._view)

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
    return {
        name: _single(part) if isinstance(part, dict) else part.item() if part.ndim == 1 else part[0]
        for name, part in info.items()
        if f"_{name}" in info
    }
