"""Frames that the stacks of a rollout share: each stack has one new frame, and the others are those of the stack before."""

import numpy as np
import torch
from torch import Tensor

from segar.support import cached

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


def places_of_frames(done: np.ndarray, stack: int) -> np.ndarray:
    """Where each frame of each stack is among the distinct ones, int64 ``[T, N, stack]``, the newest frame last.

    Distinct are, ``[stack - 1 + T, N]`` one after the other: the older frames of the first stacks, oldest first, then the
    newest frame of each stack. An episode's first stack is its first frame, ``stack`` times.

    Args:
        done: bool ``[T, N]``; whether an episode ended with that step, so that the next stack begins another.
    """
    steps, num_envs = done.shape
    begun = np.full((steps, num_envs), 1 - stack)  # the step with which the episode began, if it did in the rollout
    begun[1:] = np.where(done[:-1], np.arange(1, steps)[:, None], 1 - stack)
    begun = np.maximum.accumulate(begun, 0)
    seen = np.arange(steps)[:, None, None] - np.arange(stack)[::-1]  # the step at which each frame was the newest
    return (np.maximum(seen, begun[..., None]) + stack - 1) * num_envs + np.arange(num_envs)[:, None]


def are_stacks(observation: Tensor, done: Tensor, stack: int) -> bool:
    """Whether observations, uint8 ``[T, N, height, width, depth]``, are stacks of successive frames, the newest last, in which
    an episode begins with its first frame ``stack`` times; ``done`` is bool ``[T, N]``."""
    if stack == 1:  # nothing is shared, and nothing to be compared
        return True
    if observation.device.type != "cpu":
        return are_stacks_by_torch(observation, done, stack)
    steps, num_envs, height, width, depth = observation.shape
    own = depth // stack
    older = np.zeros((width, depth), np.uint8)  # all bits are set where an older frame than the newest has its channels
    older[:, : depth - own] = 255
    rows = observation.reshape(steps, num_envs, height, width * depth).numpy()
    return _are_stacks(rows, done.numpy(), older.ravel(), own, depth)


def are_stacks_by_torch(observation: Tensor, done: Tensor, stack: int) -> bool:
    """:func:`are_stacks` by torch's operators, which a GPU has, too."""
    frames = observation.unflatten(-1, (stack, -1))
    begins = done[:-1, :, None, None, None, None]
    expected = torch.where(begins, frames[1:, ..., -1:, :], frames[:-1, ..., 1:, :])
    return torch.equal(frames[1:, ..., :-1, :], expected)


@cached(**_options)
def _are_stacks(observation, done, older, own, depth):
    for t in range(1, len(observation)):
        for n in range(observation.shape[1]):
            for y in range(observation.shape[2]):
                now, then = observation[t, n, y], observation[t - 1, n, y, own:]  # what is seen again lies in front
                different = np.uint8(0)
                if done[t - 1, n]:
                    for i in range(len(now)):
                        newest = now[i - i % depth + depth - own + i % own]
                        different = np.uint8(different | ((now[i] ^ newest) & older[i]))
                else:
                    for i in range(len(then)):
                        different = np.uint8(different | np.uint8(np.uint8(now[i] ^ then[i]) & older[i]))
                if different:
                    return False
    return True
