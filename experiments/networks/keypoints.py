"""A CNN that outputs positions: each filter becomes the point at which it responds (spatial soft-argmax).

As in Finn et al. (2016), "Deep spatial autoencoders for visuomotor learning", extended to stacks of frames: all frames
pass the same filters, and the dense layers read the points in the newest frame and their movements from frame to frame.
"""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn import functional as F

from segar.experiments.networks.frame_conv import FrameConv
from segar.observations import copy_squares

SHARPNESS = 5.0  # of the soft-argmax at first; learned, one number per filter
MOVED = 5.0  # factor on movements: between two frames, entities move by a small part of the picture
TINY = 1e-30
COLOURS = 3
FILTERS = 16  # whose points are found
OUTPUTS = 256  # of the dense layers
STRIDE = 4  # of the first layer, whose kernel is two strides wide


class Keypoints(nn.Module):
    """Stacks of frames -> 256 numbers: 16 8x8 filters of stride 4, 16 3x3 ones, soft-argmax, and dense layers.

    A depth that is a multiple of 3 is a stack of depth / 3 frames in colour, the newest one last; any other depth is a stack
    of so many grey frames. Each frame is read by itself (:meth:`look`), cut into squares as large as the stride
    (:meth:`squares`): the first layer is then a convolution over 2x2 squares.
    """

    places: Tensor  # [cells, 3]: x and y of each cell of the map, and 1

    def __init__(self, height: int, width: int, depth: int) -> None:
        super().__init__()
        self.stack = depth // COLOURS if depth % COLOURS == 0 else depth
        self.first = FrameConv(depth // self.stack, 16, 2 * STRIDE, STRIDE)
        self.second = nn.Conv2d(16, FILTERS, 3)
        with torch.no_grad():
            rows, columns = self.second(self.first(torch.zeros(1, depth // self.stack, height, width))).shape[-2:]
        self.sharpness = nn.Parameter(torch.full((FILTERS,), SHARPNESS))
        y, x = torch.meshgrid(torch.linspace(-1, 1, rows), torch.linspace(-1, 1, columns), indexing="ij")
        places = torch.stack([x.flatten(), y.flatten(), torch.ones(rows * columns)], 1)
        self.register_buffer("places", places, persistent=False)
        points = 2 * FILTERS * self.stack
        self.dense = nn.Sequential(nn.Linear(points, OUTPUTS), nn.ReLU(), nn.Linear(OUTPUTS, OUTPUTS), nn.ReLU())

    @staticmethod
    def squares(frames: Tensor) -> Tensor:
        """Frames uint8 [n, height, width, channels] as squares of 4x4 pixels: [n, height / 4, width / 4, 16 channels]."""
        n, height, width, channels = frames.shape
        squares = frames.new_empty(n, height // STRIDE, width // STRIDE, STRIDE * STRIDE * channels)
        cut(frames, squares)
        return squares

    def look(self, squares: Tensor) -> Tensor:
        """The point at which each filter responds in a frame, from -1 to 1: float32 [n, (x, y), filter]."""
        x = squares.permute(0, 3, 1, 2)  # channels stay last in memory
        x = F.relu_(F.conv2d(x, self._first_of_squares(), self.first.bias))
        weight = self.second.weight * self.sharpness[:, None, None, None]
        answers = F.conv2d(x, weight, self.second.bias * self.sharpness)  # type: ignore[operator]
        with torch.autocast(x.device.type, enabled=False):
            return SoftArgmax.apply(answers.permute(0, 2, 3, 1).flatten(1, 2), self.places)  # type: ignore[no-any-return]

    def join(self, points: Tensor) -> Tensor:
        """The dense layers' output [n, 256] for the points in a stack [n, stack, (x, y), filter] and their movements."""
        moved = (points[:, 1:] - points[:, :-1]) * MOVED
        return self.dense(torch.cat([points[:, -1:], moved], 1).flatten(1))

    def _first_of_squares(self) -> Tensor:
        """The first layer's weights for squares: [filter, (row, column, channel), 2, 2]."""
        weight = self.first.divided_weight
        parts = weight.unflatten(3, (2, STRIDE)).unflatten(2, (2, STRIDE))  # filter, channel, above, row, left, column
        return parts.permute(0, 3, 5, 1, 2, 4).flatten(1, 3).contiguous(memory_format=torch.channels_last)


def cut(frames: Tensor, squares: Tensor) -> None:
    """Fills ``squares``, see :meth:`Keypoints.squares`."""
    if frames.device.type == "cpu":
        copy_squares(frames.numpy(), squares.numpy(), STRIDE)
    else:
        squares.copy_(squares_by_torch(frames))


def squares_by_torch(frames: Tensor) -> Tensor:
    """:meth:`Keypoints.squares` by torch's operators, which a GPU has, too."""
    _, height, width, _ = frames.shape
    whole = frames[:, : height // STRIDE * STRIDE, : width // STRIDE * STRIDE]
    parts = whole.unflatten(2, (-1, STRIDE)).unflatten(1, (-1, STRIDE))  # n, row, dy, column, dx, channel
    return parts.transpose(2, 3).flatten(3)


class SoftArgmax(torch.autograd.Function):
    """Answers [n, cells, filters], places [cells, 3] -> the mean place of each filter, float32 [n, 2, filters], in which
    cells count by the exponential of their answer. Derivatives in closed form take two thirds of the time of those that
    autograd finds."""

    @staticmethod
    def forward(ctx: Any, answers: Tensor, places: Tensor) -> Tensor:
        """The points."""
        # One maximum for all filters is much faster to find than one each. Filters far below it point to the middle.
        numbers = answers.to(places.dtype)
        highest = numbers.flatten(1).amax(1)[:, None, None]
        weights = (numbers - highest if numbers is answers else numbers.sub_(highest)).exp_()
        sums = places.t() @ weights
        total = sums[:, 2:] + TINY
        points = sums[:, :2] / total
        ctx.save_for_backward(weights, total, points, places)
        ctx.dtype = answers.dtype
        return points

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None]:
        """The derivative by the answers."""
        weights, total, points, places = ctx.saved_tensors
        by_sums = gradients[0] / total
        by_sums = torch.cat([by_sums, -(by_sums * points).sum(1, keepdim=True)], 1)
        return (places @ by_sums).mul_(weights).to(ctx.dtype), None
