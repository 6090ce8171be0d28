"""The replay of off-policy learners: a ring of the steps of several environments, which holds each observation once.

TorchRL's buffer stores a row per step. A step's next observation is the first one of the row that follows in the same
episode, so only the last observation of an episode needs a row of its own; frames take half the memory that way.
"""

import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from tensordict import TensorDict
from torch import Tensor
from torchrl.data import LazyTensorStorage, TensorDictReplayBuffer
from torchrl.data.replay_buffers.samplers import RandomSampler

CHUNK = 512  # rows of frames that are compressed together, once, however many checkpoints they go into
LEVEL = 1  # of zlib: ten times faster than the default, and differences of frames are nearly all zeros anyway


class Replay:
    """The last ``capacity`` rows of ``num_envs`` environments, in the order of their steps.

    A row is ``observation``, ``u`` (the pre-tanh action), ``reward``, ``terminated``, ``done``, and ``successor``, the row of
    the next observation. Steps of a truncated episode have one too: the last observation, which no action followed.

    Args:
        rng: draws the samples; a generator of the processor.
        device: where the rows are kept.
    """

    def __init__(self, capacity: int, num_envs: int, rng: torch.Generator, device: torch.device | str = "cpu") -> None:
        self.capacity, self.num_envs, self.device = capacity, num_envs, device
        self.sampler = StepSampler(capacity, device)
        self.buffer = TensorDictReplayBuffer(
            storage=LazyTensorStorage(capacity, device=device), sampler=self.sampler, generator=rng
        )
        self.written = 0  # rows, the overwritten ones included
        self.packed: dict[int, Tensor] = {}  # compressed frames by chunk, as long as no row of theirs has changed

    def __len__(self) -> int:
        """Number of steps that can be drawn."""
        return int(self.sampler.complete.sum())

    def add(
        self, observation: Tensor, u: Tensor, reward: Tensor, terminated: Tensor, done: Tensor, last: Tensor
    ) -> None:
        """Stores one step of all environments.

        All may lie on the processor or on the replay's device. Which episodes ended, the processor needs to know.

        Args:
            observation: before the step, [num_envs, ...].
            u: pre-tanh actions [num_envs, d].
            reward, terminated, done: [num_envs, 1].
            last: observation after the step, [num_envs, ...]; only those of finished episodes are stored.
        """
        ends = done.flatten().cpu()
        ended = ends.nonzero().flatten()
        steps, rows = self.num_envs, self.num_envs + len(ended)
        following = self.written + rows + torch.arange(steps)  # the next step's rows
        following[ended] = self.written + steps + torch.arange(len(ended))
        successor = torch.cat([following % self.capacity, torch.full((len(ended),), -1)])
        entries = {
            "observation": torch.cat([observation, last[ended.to(last.device)]]),
            "u": torch.cat([u, u.new_zeros(len(ended), u.shape[-1])]),
            "reward": torch.cat([reward, reward.new_zeros(len(ended), 1)]),
            "terminated": torch.cat([terminated, terminated.new_ones(len(ended), 1)]),
            "done": torch.cat([done, done.new_ones(len(ended), 1)]),
            "successor": successor.to(observation.device),
        }
        written = self.buffer.extend(TensorDict(entries, [rows])).cpu()
        self.sampler.wrote(written, steps, ends)
        for chunk in {int(row) // CHUNK for row in written}:
            self.packed.pop(chunk, None)
        self.written += rows

    def sample(self, size: int) -> TensorDict:
        """Steps drawn uniformly with replacement, [size], with ``("next", ...)`` as TorchRL's losses read it."""
        steps = self.buffer.sample(size)
        successors = self.buffer.storage.get(steps["successor"])
        after = {key: steps[key] for key in ("reward", "terminated", "done")}
        entries = {
            "observation": steps["observation"],
            "u": steps["u"],
            "next": TensorDict({"observation": successors["observation"], **after}, [size]),
        }
        return TensorDict(entries, [size])

    def state_dict(self) -> dict[str, Any]:
        """The rows as tensors; frames are compressed."""
        if not self.written:
            return {"written": 0}
        storage: Any = self.buffer.storage
        rows = storage.get(slice(0, min(self.written, self.capacity)))
        observation = rows["observation"].cpu()
        frames = observation.dtype == torch.uint8
        return {
            "written": self.written,
            "writer": self.buffer.writer.state_dict(),
            "complete": self.sampler.complete.clone(),
            "waiting": self.sampler.waiting.clone(),
            "observation": self._pack(observation) if frames else observation.clone(),
            "shape": list(observation.shape),
            "rows": {key: rows[key].cpu().clone() for key in ("u", "reward", "terminated", "done", "successor")},
        }

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Restores what :meth:`state_dict` returned; the owner of the generator restores the generator."""
        self.buffer.empty()
        self.packed.clear()
        self.written = state["written"]
        if not self.written:
            return
        observation = state["observation"]
        if isinstance(observation, list):
            self.packed = dict(enumerate(observation))
            shape = state["shape"]
            observation = torch.cat([unpack_frames(chunk, shape[1:], self.num_envs) for chunk in observation])
        self.buffer.extend(TensorDict({"observation": observation, **state["rows"]}, [len(observation)]))
        self.buffer.writer.load_state_dict(state["writer"])
        self.sampler.complete.copy_(state["complete"])
        self.sampler.waiting = state["waiting"].clone()

    def _pack(self, frames: Tensor) -> list[Tensor]:
        for chunk, part in enumerate(frames.split(CHUNK)):
            if chunk not in self.packed:
                self.packed[chunk] = pack_frames(part, self.num_envs)
        return [self.packed[chunk] for chunk in range(-(-len(frames) // CHUNK))]


class StepSampler(RandomSampler):
    """Draws among the rows that are steps and whose next observation is stored. The replay stores its state."""

    def __init__(self, capacity: int, device: torch.device | str) -> None:
        super().__init__()
        self.device = device
        self.complete = torch.zeros(capacity, dtype=torch.bool)
        self.waiting = torch.zeros(0, dtype=torch.int64)  # rows whose next observation comes with the next step

    def wrote(self, rows: Tensor, steps: int, done: Tensor) -> None:
        """Takes note that ``rows`` were written, the first ``steps`` of which are steps."""
        self.complete[self.waiting] = True
        self.complete[rows] = False
        self.complete[rows[:steps][done]] = True
        self.waiting = rows[:steps][~done]

    def sample(self, storage: Any, batch_size: int) -> tuple[Tensor, dict]:
        """Indices [batch_size] into the storage, with replacement."""
        rows = self.complete.nonzero().flatten()
        return rows[torch.randint(len(rows), (batch_size,), generator=self._rng)].to(self.device), {}

    def _empty(self) -> None:  # what TorchRL calls when its buffer is emptied
        self.complete.zero_()
        self.waiting = torch.zeros(0, dtype=torch.int64)


def pack_frames(frames: Tensor, stride: int) -> Tensor:
    """Frames uint8 [n, ...] as compressed bytes uint8 [m]; frames that lie ``stride`` apart should be alike."""
    changes = frames.clone()
    changes[stride:] ^= frames[:-stride]
    return torch.from_numpy(np.frombuffer(zlib.compress(changes.numpy().tobytes(), LEVEL), dtype=np.uint8).copy())


def unpack_frames(packed: Tensor, shape: list[int], stride: int) -> Tensor:
    """The frames uint8 [n, *shape] that :func:`pack_frames` was given."""
    frames = torch.from_numpy(np.frombuffer(zlib.decompress(packed.numpy().tobytes()), dtype=np.uint8).copy()).view(
        -1, *shape
    )
    for start in range(stride, len(frames), stride):
        block = frames[start : start + stride]
        block ^= frames[start - stride : start - stride + len(block)]
    return frames
