"""Stable-Baselines3's interface: a ``VecEnv`` over :class:`segar.envs.VectorEnv`. No other file of segar imports it."""

import time
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from segar.envs.vector import VectorEnv
from segar.errors import SegarError
from segar.levels import Levels
from segar.observations import ObservationLike, map_leaves
from segar.support import need

need("SB3VecEnv", "stable_baselines3")

from stable_baselines3.common.monitor import Monitor  # noqa: E402
from stable_baselines3.common.vec_env.base_vec_env import VecEnv  # noqa: E402

Indices = int | Iterable[int] | None


class SB3VecEnv(VecEnv):
    """A batch of environments for Stable-Baselines3, stepped by one call of the compiled kernel.

    >>> env = SB3VecEnv(segar.family("empty-hard").sample(10, seed=0), num_envs=64, seed=0)

    trains as any other: ``stable_baselines3.PPO("MlpPolicy", env, n_steps=32, batch_size=512).learn(100_000)``.

    Observations and the action space are those of :class:`segar.envs.VectorEnv`: frames are uint8 with the channels last,
    which Stable-Baselines3 transposes itself, and actions have the task's range. Rewards are float32.

    ``infos[e]`` is empty while an episode goes on. Where one ended it holds ``terminal_observation``,
    ``TimeLimit.truncated``, ``episode`` (``r``, ``l`` and ``t``: return, length, seconds since the environments were made,
    as ``Monitor`` has them, so that neither ``Monitor`` nor ``VecMonitor`` is needed), ``level``, ``is_success`` and
    ``death``, with several trials also ``trial``. ``reset_infos[e]`` holds the ``level`` that a reset chose.

    The environments of a batch have one seed and one set of attributes. So ``seed(s)`` seeds the batch with ``s``;
    ``env_method`` calls the method of ``vector_env`` once, and returns what it returned for each environment; ``get_attr``
    gives the attribute of ``vector_env`` for each; ``set_attr`` sets new attributes of all, and refuses those that are
    fixed when environments are made. ``set_options({"level": i})`` chooses the level of the next reset.

    Args:
        levels, num_envs, observation, options: as of :class:`segar.envs.VectorEnv`; an observation may be an array or a
            dict of arrays.

    Attributes:
        vector_env: the batch; its methods ``state``, ``restore``, ``intervene``, ``replace_levels`` and ``set_level_weights``
            may be used between steps.
        info: the info of the batch's last step or reset, with all true factors; see :class:`segar.envs.VectorEnv`.

    Raises:
        SegarError: as :class:`segar.envs.VectorEnv`, and where the observation is a tuple or a dict of dicts.
    """

    def __init__(
        self, levels: Levels, num_envs: int, *, observation: ObservationLike = "state", **options: Any
    ) -> None:
        for name in ("autoreset_mode", "copy"):
            if name in options:
                raise SegarError(f"SB3VecEnv: '{name}' is not to be chosen; Stable-Baselines3 has its own convention")
        self.vector_env = VectorEnv(levels, num_envs, observation=observation, **options)
        space = self.vector_env.single_observation_space
        parts = space.values() if isinstance(space, spaces.Dict) else [space]
        if not all(isinstance(part, spaces.Box) for part in parts):
            raise SegarError(
                f"SB3VecEnv: Stable-Baselines3 knows arrays and dicts of arrays as observations, not {space}; give a dict"
            )
        self.info: dict[str, Any] = {}
        self._actions: np.ndarray | None = None
        self._began = time.time()
        self._own = frozenset(vars(self.vector_env))
        super().__init__(num_envs, space, self.vector_env.single_action_space)
        self.metadata = {**self.vector_env.metadata}

    def reset(self) -> Any:
        """Start new episodes in all environments; return the observations ``(num_envs, ...)``."""
        levels = [options.get("level") for options in self._options]
        unknown = {name for options in self._options for name in options} - {"level"}
        if unknown or (None in levels and set(levels) != {None}):
            raise SegarError(
                f"set_options: give each environment the option 'level', or none, not {self._options[:2]}..."
            )
        chosen = {} if None in levels else {"levels": np.array(levels)}
        observations, self.info = self.vector_env.reset(seed=self._seeds[0], options=chosen)
        self.reset_infos = [{"level": level} for level in self.info["level"].tolist()]
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: np.ndarray) -> None:
        """Note the actions, ``(num_envs, action size)``, of the step that :meth:`step_wait` takes."""
        self._actions = actions

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Take the step; return observations, rewards float32, dones bool, infos, which all lead with ``num_envs``."""
        if self._actions is None:
            raise SegarError("SB3VecEnv: call step_async(actions) before step_wait()")
        observations, rewards, terminated, truncated, self.info = self.vector_env.step(self._actions)
        self._actions = None
        dones = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if dones.any():
            self._describe_ends(infos, np.flatnonzero(dones), terminated)
        return observations, rewards.astype(np.float32), dones, infos

    def _describe_ends(self, infos: list[dict[str, Any]], ended: np.ndarray, terminated: np.ndarray) -> None:
        """Fill the infos of the environments whose episodes ended."""
        last, final = self.info["final_obs"], self.info["final_info"]
        seconds = round(time.time() - self._began, 6)
        for e in ended.tolist():
            infos[e] = {
                "terminal_observation": map_leaves(lambda array, e=e: array[e].copy(), last),
                "TimeLimit.truncated": not terminated[e],
                "episode": {"r": float(final["return"][e]), "l": int(final["length"][e]), "t": seconds},
                "level": int(final["level"][e]),
                "is_success": bool(final["success"][e]),
                "death": bool(final["death"][e]),
            }
            if self.vector_env.trials > 1:
                infos[e]["trial"] = int(final["trial"][e])

    def close(self) -> None:
        """Close the window, if there is one."""
        self.vector_env.close()

    def get_images(self) -> Sequence[np.ndarray | None]:
        """A frame of each environment, uint8; None for each without ``render_mode="rgb_array"``."""
        frames = self.vector_env.render()
        return [None] * self.num_envs if frames is None else list(frames)

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """The attribute of the batch, once for each of these environments."""
        return [getattr(self.vector_env, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set a new attribute of the batch.

        Raises:
            SegarError: environments have the attribute from the start, or not all environments are named.
        """
        self._require_all("set_attr", attr_name, indices)
        if hasattr(type(self.vector_env), attr_name) or attr_name in self._own:
            raise SegarError(f"set_attr: '{attr_name}' is fixed when environments are made; make others instead")
        setattr(self.vector_env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the batch once; return what it returned, once for each environment.

        Raises:
            SegarError: not all environments are named.
        """
        self._require_all("env_method", method_name, indices)
        found = getattr(self.vector_env, method_name)(*method_args, **method_kwargs)
        return [found] * self.num_envs

    def env_is_wrapped(self, wrapper_class: type, indices: Indices = None) -> list[bool]:
        """Whether environments do what a wrapper does: True for ``Monitor``, whose infos they give, else False."""
        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]

    def _require_all(self, method: str, name: str, indices: Indices) -> None:
        if {*self._get_indices(indices)} != {*range(self.num_envs)}:
            raise SegarError(
                f"{method}: '{name}' is of all environments of the batch; it cannot be asked of some of them"
            )
