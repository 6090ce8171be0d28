"""A CNN that reads off where things are: each filter becomes the point at which it answers (spatial soft-argmax).

As in Finn et al. (2016), "Deep spatial autoencoders for visuomotor learning", with what a stack of frames adds: all frames
pass the same filters, and the dense layers see the points in the newest frame and how far they moved from frame to frame.
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from experiments.frame_conv import FrameConv

SHARPNESS = 5.0  # of the soft-argmax at first; learned, one number per filter
MOVED = 5.0  # movements are shown this much enlarged: between frames, things move by a small part of the picture
TINY = 1e-30
COLOURS = 3
FILTERS = 16  # whose points are found


class Keypoints(nn.Module):
    """Numbers from 0 to 255, [n, depth, height, width] -> [n, 256]: 16 8x8 filters of stride 4, 16 3x3 ones, soft-argmax.

    A depth that is a multiple of 3 is so many frames in colour, the newest one last; any other is as many in grey.
    """

    places: Tensor  # [3, cells]: x and y of each cell of the map, and 1; no buffer, which functional modules take for a weight

    def __init__(self, height: int, width: int, depth: int, outputs: int = 256) -> None:
        super().__init__()
        self.frames = depth // COLOURS if depth % COLOURS == 0 else depth
        self.first = FrameConv(depth // self.frames, 16, 8, 4)
        self.second = nn.Conv2d(16, FILTERS, 3)
        with torch.no_grad():
            rows, columns = self.second(self.first(torch.zeros(1, depth // self.frames, height, width))).shape[-2:]
        self.sharpness = nn.Parameter(torch.full((FILTERS,), SHARPNESS))
        y, x = torch.meshgrid(torch.linspace(-1, 1, rows), torch.linspace(-1, 1, columns), indexing="ij")
        self.places = torch.stack([x.flatten(), y.flatten(), torch.ones(rows * columns)])
        points = 2 * FILTERS * self.frames
        self.dense = nn.Sequential(nn.Linear(points, outputs), nn.ReLU(), nn.Linear(outputs, outputs), nn.ReLU())

    def _apply(self, fn: Callable[[Tensor], Tensor], recurse: bool = True) -> Keypoints:
        super()._apply(fn, recurse)
        self.places = fn(self.places)  # moves with the weights
        return self

    def forward(self, x: Tensor) -> Tensor:
        """What the dense layers make of points and movements."""
        points = self.points(x)
        moved = (points[:, 1:] - points[:, :-1]) * MOVED
        return self.dense(torch.cat([points[:, -1:], moved], 1).flatten(1))

    def points(self, x: Tensor) -> Tensor:
        """Where each filter answers in each frame, from -1 to 1: float32 [n, frames, (x, y), filter]."""
        n, first, second = self.frames, self.first, self.second
        x = F.conv2d(x, self._first_of_all_frames(), first.bias.repeat(n), 4)  # type: ignore[union-attr]
        weight = (second.weight * self.sharpness[:, None, None, None]).repeat(n, 1, 1, 1)
        answers = F.conv2d(F.relu_(x), weight, (second.bias * self.sharpness).repeat(n), groups=n)  # type: ignore[operator]
        with torch.autocast(x.device.type, enabled=False):
            answers = answers.permute(0, 2, 3, 1).flatten(1, 2).float()
            # One maximum for all filters is much faster to find than one each. Filters far below it point to the middle.
            highest = answers.detach().flatten(1).amax(1)[:, None, None]
            sums = self.places @ (answers - highest).exp_()
            return (sums[:, :2] / (sums[:, 2:] + TINY)).unflatten(2, (n, -1)).transpose(1, 2)

    def _first_of_all_frames(self) -> Tensor:
        """One convolution that does for each frame what ``first`` does for one: twice as fast as taking them apart."""
        weight = self.first.divided_weight
        depth = weight.shape[1]
        shifted = [F.pad(weight, (0, 0, 0, 0, i * depth, (self.frames - 1 - i) * depth)) for i in range(self.frames)]
        return torch.cat(shifted).contiguous(memory_format=torch.channels_last)
