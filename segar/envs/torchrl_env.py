"""TorchRL's interface: a batched ``EnvBase`` over :class:`segar.envs.VectorEnv`."""

from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.vector import AutoresetMode
from tensordict import TensorDict, TensorDictBase
from torchrl.data import Binary, Bounded, Composite, Unbounded
from torchrl.envs import EnvBase

from segar.envs.level_pool import LevelPool
from segar.envs.snapshots import Snapshot
from segar.envs.vector import VectorEnv
from segar.errors import SegarError
from segar.levels import Levels
from segar.observations import ObservationLike

# Entries about the running episode, from the info of VectorEnv, and their dtypes; each has the shape [num_envs, 1].
EPISODE_KEYS = {
    "level": torch.int64,
    "return": torch.float64,
    "length": torch.int64,
    "success": torch.bool,
    "death": torch.bool,
}
TRIAL_KEYS = {"trial": torch.int64, "new_level": torch.bool}  # where there are several


class TorchRLEnv(EnvBase):
    """A batch of environments with batch size ``[num_envs]``.

    Entries of a step: the observation, under ``"pixels"`` if it is a frame (uint8, e.g. ``[num_envs, 64, 64, 3]``), else
    under ``"observation"`` (float32, e.g. ``[num_envs, d]``), a dict's parts under their names, a tuple's under
    ``("observation", "0")`` and so on; ``"reward"`` float32, ``"done"``, ``"terminated"``, ``"truncated"`` bool; and about
    the running episode ``"level"`` (index in ``levels``), ``"return"`` (all rewards so far), ``"length"``,
    ``"success"``, ``"death"``, with several trials also ``"trial"`` and ``"new_level"``; all of these
    ``[num_envs, 1]``. Nothing is reset by a step, so that a finished
    episode's last observation stays readable; ``reset`` honours TorchRL's ``"_reset"`` mask, and takes
    ``levels=`` (int array ``[num_envs]``) to choose the levels that start. Tensors share the memory of the engine's
    arrays, which later steps do not overwrite. Actions: float32 ``[num_envs, action size]`` in the task's range. With
    ``device="cuda"`` all tensors lie on that GPU, where the episodes run.

    Arguments are those of :class:`segar.envs.VectorEnv` but for ``autoreset_mode``, ``copy`` and ``true_factors``; it also says
    what it raises; and :class:`SegarError` if a part of the observation is named like another entry.

    >>> env = TorchRLEnv(segar.family("empty-hard").sample(10, seed=0), num_envs=64, seed=0)
    >>> env.rollout(30, break_when_any_done=False)["next", "reward"].shape
    torch.Size([64, 30, 1])
    """

    def __init__(
        self, levels: Levels, num_envs: int, *, observation: ObservationLike = "state", **options: Any
    ) -> None:
        fixed = {"autoreset_mode": AutoresetMode.DISABLED, "copy": True, "true_factors": False}
        for name in fixed.keys() & options.keys():
            raise SegarError(f"TorchRLEnv: '{name}' is not to be chosen; TorchRL has its own convention")
        vector_env = VectorEnv(levels, num_envs, observation=observation, **fixed, **options)
        super().__init__(device=vector_env.device, batch_size=torch.Size([num_envs]))
        self.vector_env = vector_env
        self._episode_keys = EPISODE_KEYS | (TRIAL_KEYS if vector_env.trials > 1 else {})
        space = self.vector_env.single_observation_space
        seen = _named(space)
        for name in seen.keys() & {*self._episode_keys, "action", "reward", "done", "terminated", "truncated", "next"}:
            raise SegarError(f"TorchRLEnv: an observation's part cannot be called '{name}', as another entry is")
        self.observation_spec = Composite(
            {key: _spec(part, num_envs) for key, part in seen.items()}
            | {key: _column(num_envs, t) for key, t in self._episode_keys.items()},
            shape=self.batch_size,
        ).to(self.device)
        self.action_spec = _bounded(self.vector_env.action_space, torch.float32).to(self.device)
        self.reward_spec = _column(num_envs, torch.float32).to(self.device)
        self.done_spec = Composite(
            {key: _column(num_envs, torch.bool) for key in ("done", "terminated", "truncated")}, shape=self.batch_size
        ).to(self.device)
        self._next_seed: int | None = None

    def _step(self, tensordict: TensorDictBase) -> TensorDictBase:
        action = tensordict.get("action").detach()
        observation, reward, terminated, truncated, info = self.vector_env.step(action)
        return self._tensordict(observation, info, terminated=terminated, truncated=truncated, reward=reward)

    def _reset(self, tensordict: TensorDictBase | None = None, *, levels: Any = None, **_: Any) -> TensorDictBase:
        options: dict[str, Any] = {"levels": levels}
        if tensordict is not None and "_reset" in tensordict.keys():
            options["reset_mask"] = tensordict.get("_reset").reshape(self.num_envs)
        seed, self._next_seed = self._next_seed, None
        observation, info = self.vector_env.reset(seed=seed, options=options)
        after = self._tensordict(observation, info)
        if tensordict is not None:
            # TorchRL keeps the unmasked rows of what it was given, and pads what it was not given with zeros: give it all.
            tensordict.update({key: value for key, value in after.items() if key not in tensordict.keys()})
        return after

    def render(self) -> torch.Tensor:
        """A frame of each environment, uint8 ``[num_envs, height, width, 3]``.

        Raises:
            SegarError: the environments have no ``render_mode="rgb_array"``.
        """
        frames = self.vector_env.render()
        if frames is None:
            raise SegarError("TorchRLEnv: render() needs environments with render_mode='rgb_array'")
        return torch.from_numpy(np.stack(frames))

    def state(self) -> Snapshot:
        """A copy of everything that decides how the episodes go on; see :meth:`segar.envs.VectorEnv.state`."""
        return self.vector_env.state()

    def restore(self, snapshot: Snapshot, pool: LevelPool | None = None) -> TensorDict:
        """Go on from a snapshot, on the levels of a pool where one is given; return the entries of a reset, about the episodes
        that run in the snapshot."""
        observation = self.vector_env.restore(snapshot, pool)
        return self._tensordict(observation, self.vector_env.info())

    def _set_seed(self, seed: int | None) -> None:
        self._next_seed = seed

    def _tensordict(self, observation: Any, info: dict[str, Any], **outcome: np.ndarray) -> TensorDict:
        """The entries of a step that ends ``terminated`` or ``truncated`` with a ``reward``, or of a reset without these."""
        given = {key: _tensor(column, self.num_envs) for key, column in outcome.items()}
        never = {
            key: torch.zeros(self.num_envs, dtype=torch.bool, device=self.device) for key in ("terminated", "truncated")
        }
        columns = never | given | {key: _tensor(info[key], self.num_envs) for key in self._episode_keys}
        columns["done"] = columns["terminated"] | columns["truncated"]
        if "reward" in outcome:
            columns["reward"] = columns["reward"].to(torch.float32)
        entries = {key: _tensor(part, self.num_envs) for key, part in _named(observation).items()}
        entries |= {key: column[:, None] for key, column in columns.items()}
        return TensorDict._new_unsafe(entries, batch_size=self.batch_size, device=self.device)

    @property
    def num_envs(self) -> int:
        """Number of environments in the batch."""
        return self.batch_size[0]

    def close(self, *, raise_if_closed: bool = True) -> None:
        """Close the batch of environments."""
        super().close(raise_if_closed=raise_if_closed)
        self.vector_env.close()


def _named(observation: Any) -> dict[str, Any]:
    """The entries of an observation, or of its space, by key."""
    if isinstance(observation, (dict, spaces.Dict)):
        return dict(observation.items())
    is_frame = not isinstance(observation, (tuple, spaces.Tuple)) and observation.dtype in (np.uint8, torch.uint8)
    return {"pixels" if is_frame else "observation": observation}


def _parts(observation: Any) -> dict[str, Any]:
    """The parts of a tuple or dict, or of its space, by key."""
    if isinstance(observation, (dict, spaces.Dict)):
        return dict(observation.items())
    return {str(k): part for k, part in enumerate(observation)}


def _spec(space: spaces.Space, num_envs: int) -> Any:
    if isinstance(space, (spaces.Dict, spaces.Tuple)):
        return Composite(
            {key: _spec(part, num_envs) for key, part in _parts(space).items()}, shape=torch.Size([num_envs])
        )
    assert isinstance(space, spaces.Box)
    if space.dtype == np.uint8:
        return _bounded(space, torch.uint8).expand(num_envs, *space.shape)
    return Unbounded(shape=torch.Size((num_envs, *space.shape)), dtype=torch.float32)


def _tensor(part: Any, num_envs: int) -> Any:
    if isinstance(part, (np.ndarray, torch.Tensor)):
        return torch.as_tensor(part)
    return TensorDict({key: _tensor(p, num_envs) for key, p in _parts(part).items()}, batch_size=[num_envs])


def _bounded(space: Any, dtype: torch.dtype) -> Bounded:
    return Bounded(torch.from_numpy(space.low), torch.from_numpy(space.high), shape=space.shape, dtype=dtype)


def _column(num_envs: int, dtype: torch.dtype) -> Binary | Unbounded:
    shape = torch.Size([num_envs, 1])
    return Binary(n=1, shape=shape, dtype=dtype) if dtype == torch.bool else Unbounded(shape=shape, dtype=dtype)
