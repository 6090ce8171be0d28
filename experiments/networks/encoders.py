"""From observations to representations: CNNs that read frames, and an MLP that reads vectors.

Frames are uint8 ``[..., height, width, depth]``, channels last, as environments return them; on the device they become
numbers from 0 to 1 in the same layout. A CNN may compute in bfloat16; its output and all later layers are float32.
:func:`initialize` draws Glorot-uniform weights and sets biases to 0.

A CNN of your own is a function like :func:`nature`; the encoder's name is then ``module:function``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise

import torch
from torch import Tensor, nn

from segar.experiments.networks.frame_conv import WHITE, FrameConv
from segar.experiments.networks.keypoints import Keypoints, cut
from segar.experiments.networks.shared_frames import are_stacks, places_of_frames
from segar.experiments.settings import ConfigError, DrQConfig, PPOConfig, import_object
from segar.experiments.settings.processor import multiplies_bf16

REPRESENTATION = 256  # numbers in phi(s) of the CNNs that end with a dense layer


def make_encoder(config: PPOConfig | DrQConfig, observation_shape: tuple[int, ...]) -> MLP | FrameEncoder:
    """The encoder that reads observations of a shape; ``.width`` is the size of its representation.

    Args:
        config: its ``encoder`` names the CNN that reads frames, or 'mlp', which refuses them; an MLP of these ``widths``
            reads vectors in any case; ``precision`` is the number format of a CNN, see :func:`precision_of`.
        observation_shape: ``(d,)`` for vectors, ``(height, width, depth)`` for frames.

    Raises:
        ConfigError: it cannot read observations of that shape.
    """
    if len(observation_shape) == 1:
        return MLP(observation_shape[0], config.widths)
    if len(observation_shape) != 3 or config.encoder == "mlp":
        fix = (
            "an MLP reads vectors" if len(observation_shape) == 3 else "vectors are [d], frames [height, width, depth]"
        )
        raise ConfigError(f"algorithm.encoder: '{config.encoder}' cannot read {list(observation_shape)}; {fix}")
    height, width, depth = observation_shape
    name = config.encoder if ":" in config.encoder else f"{__name__}:{config.encoder}"
    make: Callable[[int, int, int], nn.Module] = import_object(name, "algorithm.encoder")
    try:
        trunk = make(height, width, depth)
        encoder = (StackEncoder if isinstance(trunk, Keypoints) else FrameEncoder)(trunk, config.precision)
        with torch.no_grad():
            encoder.width = encoder.eval()(torch.zeros(1, *observation_shape, dtype=torch.uint8)).shape[-1]
        encoder.train()
    except RuntimeError as error:  # torch's own, of a kernel larger than what it should read
        raise ConfigError(
            f"algorithm.encoder: '{config.encoder}' cannot read {height} x {width} frames: {error}"
        ) from error
    return encoder


@torch.compiler.assume_constant_result  # the capabilities of a processor cannot be traced
def precision_of(name: str, device: str = "cpu") -> torch.dtype:
    """The number format that 'bf16', 'fp32' or 'auto' means on a kind of device, 'cpu' or 'cuda'.

    'auto' is bfloat16 where the processor multiplies it in hardware: it makes the training of a CNN 1.4 to 3 times
    faster, and moves log-probabilities by about 1e-3.
    """
    if name == "auto":
        return torch.bfloat16 if multiplies_bf16(device) else torch.float32
    return {"bf16": torch.bfloat16, "fp32": torch.float32}[name]


class MLP(nn.Module):
    """Vectors float32 [..., d] -> representation [..., widths[-1]]: dense layers with ReLU after each.

    With widths 256 and 256: 256 d + 66 048 parameters.
    """

    def __init__(self, inputs: int, widths: tuple[int, ...]) -> None:
        super().__init__()
        sizes = (inputs, *widths)
        layers = [m for a, b in pairwise(sizes) for m in (nn.Linear(a, b), nn.ReLU())]
        self.layers = nn.Sequential(*layers)
        self.width = widths[-1]

    def prepare(self, observation: Tensor, done: Tensor) -> Tensor:
        """See :meth:`FrameEncoder.prepare`; there is nothing to do for vectors."""
        return observation

    def forward(self, observation: Tensor) -> Tensor:
        """The representation."""
        return self.layers(observation)


class FrameEncoder(nn.Module):
    """Frames uint8 [..., height, width, depth] -> representation float32 [..., width], by a CNN.

    Args:
        trunk: float [n, depth, height, width] -> [n, width]. It gets numbers from 0 to 1, or, if it has a
            :class:`FrameConv`, from 0 to 255.
        precision: what the trunk computes in, see :func:`precision_of`; its weights are float32 either way.

    Attributes:
        width: of the representation, which :func:`make_encoder` finds.
    """

    width: int

    def __init__(self, trunk: nn.Module, precision: str = "auto") -> None:
        super().__init__()
        self.trunk, self.precision = trunk, precision
        self.scale = None if any(isinstance(part, FrameConv) for part in trunk.modules()) else 1.0 / WHITE
        self.trunk.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def prepare(self, observation: Tensor, done: Tensor) -> Tensor:
        """A rollout's observations [T, N, ...] in the form in which :meth:`forward` reads any part of them several times.

        ``done`` [T, N, 1] says after which steps episodes ended.
        """
        return observation

    def forward(self, frames: Tensor) -> Tensor:
        """The representation; frames of any leading shape."""
        shape = frames.shape[:-3]
        frames = frames if len(shape) == 1 else frames.reshape(-1, *frames.shape[-3:])
        x = frames.permute(0, 3, 1, 2)  # a view: channels stay last in memory, as the convolutions like them
        precision = precision_of(self.precision, x.device.type)
        x = x.to(precision)
        x = x if self.scale is None else x * self.scale
        with torch.autocast(x.device.type, precision, enabled=precision != torch.float32):
            representation = self.trunk(x)
        return representation.float().reshape(*shape, -1)


class StackEncoder(FrameEncoder):
    """A :class:`FrameEncoder` whose CNN reads each frame of a stack by itself first, and then joins the results.

    Stacks of successive steps share frames. :meth:`prepare` therefore puts the distinct frames of a rollout into a pool and
    replaces stacks by indices into it, so that each frame is read once, however many stacks of a batch hold it.

    Args:
        trunk: see :class:`segar.experiments.networks.keypoints.Keypoints`.
    """

    trunk: Keypoints
    pool: Tensor | None = None  # the distinct frames of the rollout that was prepared last
    follows = False  # whether batches show successive steps, see :func:`successive`
    before: tuple[Tensor, Tensor] | None = (
        None  # of the last batch, [n, stack, ...]: its frames in squares, what was seen
    )

    def prepare(self, observation: Tensor, done: Tensor) -> Tensor:
        """The places of each stack's frames in the pool, int64 [T, N, stack]."""
        stack = self.trunk.stack
        done = done[..., 0]
        *older, newest = (frames.flatten(0, 1) for frames in observation.tensor_split(stack, -1))
        if are_stacks(observation, done, stack):
            older = [frames[: observation.shape[1]] for frames in older]  # of the first step
            places = torch.from_numpy(places_of_frames(done.cpu().numpy(), stack))
        else:
            places = torch.arange(stack * len(newest)).view(stack, *observation.shape[:2]).movedim(0, -1)
        self.pool = self._cut_all((*older, newest))
        return places.to(observation.device)

    def _cut_all(self, parts: Sequence[Tensor]) -> Tensor:
        """All frames in squares, in the memory of the last rollout's where they are as many."""
        pool = self.pool
        if pool is None or len(pool) != sum(map(len, parts)) or pool.device != parts[0].device:
            return torch.cat([self.trunk.squares(frames) for frames in parts])
        for frames, squares in zip(parts, pool.split([len(frames) for frames in parts]), strict=True):
            cut(frames, squares)
        return pool

    def forward(self, frames: Tensor) -> Tensor:
        """The representation; frames, or their places in the pool, of any leading shape."""
        trunk = self.trunk
        precision = precision_of(self.precision, frames.device.type)
        with torch.autocast(frames.device.type, precision, enabled=precision != torch.float32):
            if frames.dtype == torch.int64:
                assert self.pool is not None  # prepare has filled it
                shape = frames.shape[:-1]
                seen = self._look_at(self.pool, frames, precision).unflatten(0, (-1, trunk.stack))
            else:
                shape = frames.shape[:-3]
                each = frames.reshape(-1, *frames.shape[-3:]).tensor_split(trunk.stack, -1)
                squares = torch.stack([trunk.squares(one) for one in each], 1)
                seen = self._see(squares, precision)
            representation = trunk.join(seen)
        return representation.float().reshape(*shape, -1)

    def _look_at(self, pool: Tensor, places: Tensor, precision: torch.dtype) -> Tensor:
        """The points in the frames at places in a pool."""
        if torch.compiler.is_compiling():  # how many are distinct depends on the data, and shapes must not
            return self.trunk.look(pool.index_select(0, places.flatten()).to(precision))
        distinct, which = places.unique(return_inverse=True)
        seen = self.trunk.look(pool.index_select(0, distinct).to(precision))
        return seen.index_select(0, which.flatten())

    def _see(self, squares: Tensor, precision: torch.dtype) -> Tensor:
        """The points in frames [n, stack, ...]; those of older frames that the last batch showed are known."""
        look, before = self.trunk.look, self.before
        follows = self.follows and not torch.is_grad_enabled()
        if not follows or before is None or before[0].shape != squares.shape or self.trunk.stack == 1:
            seen = look(squares.flatten(0, 1).to(precision)).unflatten(0, squares.shape[:2])
        else:
            older, known = (part.flatten(1).view(torch.int64) for part in (squares[:, :-1], before[0][:, 1:]))
            fresh = (older != known).any(1).nonzero().flatten()
            rest = squares[fresh, :-1].flatten(0, 1)
            found = look(torch.cat([squares[:, -1], rest]).to(precision))
            newest, rest = found.tensor_split([len(squares)])
            seen = torch.cat([before[1][:, 1:], newest.unsqueeze(1)], 1)
            seen[fresh, :-1] = rest.unflatten(0, (-1, self.trunk.stack - 1))
        if follows:
            self.before = squares, seen
        return seen


@contextmanager
def successive(network: object) -> Iterator[None]:
    """Lets the :class:`StackEncoder` of ``network`` read no frame twice inside the block.

    The batches that it reads without gradients must show successive steps of the same environments, and its weights must
    not change. Rows that do not follow from the last batch are read as a whole.
    """
    encoders = _stack_encoders(network)
    try:
        for encoder in encoders:
            encoder.follows = True
        yield
    finally:
        for encoder in encoders:
            encoder.follows, encoder.before = False, None


def forget_frames(network: object) -> None:
    """Let the :class:`StackEncoder` of ``network`` read the next batch as a whole, inside a block of :func:`successive`."""
    for encoder in _stack_encoders(network):
        encoder.before = None


def _stack_encoders(network: object) -> list[StackEncoder]:
    parts = network.modules() if isinstance(network, nn.Module) else ()
    return [part for part in parts if isinstance(part, StackEncoder)]


def small(height: int, width: int, depth: int) -> nn.Sequential:
    """A small fast CNN: 16 8x8 filters of stride 4, 32 4x4 of stride 2, 32 3x3, dense 256, each with ReLU.

    For 64 x 64 x 3: 151 888 parameters.
    """
    return _plain_cnn(height, width, depth, (16, 32, 32))


def keypoints(height: int, width: int, depth: int) -> Keypoints:
    """The points at which 16 filters respond, and their movements from frame to frame, then dense 256 twice, each with ReLU.

    It needs far fewer steps than the other CNNs where positions matter; see :mod:`segar.experiments.networks.keypoints`. Each
    further frame of a stack costs as much as the first. For 64 x 64 x 3: 79 664 parameters.
    """
    return Keypoints(height, width, depth)


def nature(height: int, width: int, depth: int) -> nn.Sequential:
    """The CNN of Mnih et al. (2015): 32 8x8 filters of stride 4, 64 4x4 of stride 2, 64 3x3, then dense 256 (there 512).

    For 64 x 64 x 3: 338 336 parameters.
    """
    return _plain_cnn(height, width, depth, (32, 64, 64))


def impala(height: int, width: int, depth: int) -> nn.Sequential:
    """IMPALA's residual CNN (Espeholt et al. 2018), channels 16, 32, 32, then ReLU, dense 256, ReLU.

    Each block: 3x3 convolution, 3x3 max-pool of stride 2, two residual units. For 64 x 64 x 3: 622 144 parameters.
    """
    return _residual_cnn(height, width, depth, (16, 32, 32))


def impala_15(height: int, width: int, depth: int) -> nn.Sequential:
    """:func:`impala` with 15 channels in the first block, as in the 2022 code. For 64 x 64 x 3: 620 708 parameters."""
    return _residual_cnn(height, width, depth, (15, 32, 32))


def _plain_cnn(height: int, width: int, depth: int, channels: tuple[int, int, int]) -> nn.Sequential:
    first, second, third = channels
    layers = (FrameConv(depth, first, 8, 4), nn.Conv2d(first, second, 4, 2), nn.Conv2d(second, third, 3))
    convolutions = nn.Sequential(*(part for layer in layers for part in (layer, nn.ReLU(inplace=True))))
    return _with_dense(convolutions, height, width, depth)


def _residual_cnn(height: int, width: int, depth: int, channels: tuple[int, ...]) -> nn.Sequential:
    blocks = [ResidualBlock(a, b) for a, b in pairwise((depth, *channels))]
    blocks[0].entry = FrameConv(depth, channels[0], 3, padding=1)
    return _with_dense(nn.Sequential(*blocks, nn.ReLU()), height, width, depth)


def _with_dense(convolutions: nn.Sequential, height: int, width: int, depth: int) -> nn.Sequential:
    with torch.no_grad():
        features = convolutions(torch.zeros(1, depth, height, width)).numel()
    dense = nn.Linear(features, REPRESENTATION)
    return nn.Sequential(convolutions, nn.Flatten(), dense, nn.ReLU())


class ResidualBlock(nn.Module):
    """A block of :func:`impala`: images [n, inputs, height, width] -> [n, outputs, height / 2, width / 2]."""

    def __init__(self, inputs: int, outputs: int) -> None:
        super().__init__()
        self.entry = nn.Conv2d(inputs, outputs, 3, padding=1)
        self.pool = nn.MaxPool2d(3, stride=2, padding=1)
        self.residuals = nn.ModuleList(
            nn.Sequential(
                nn.ReLU(),
                nn.Conv2d(outputs, outputs, 3, padding=1),
                nn.ReLU(inplace=True),
                nn.Conv2d(outputs, outputs, 3, padding=1),
            )
            for _ in range(2)
        )

    def forward(self, x: Tensor) -> Tensor:
        """The images after convolution, pooling and both residual units."""
        x = self.pool(self.entry(x))
        for residual in self.residuals:
            x = x + residual(x)
        return x


def initialize(module: nn.Module, rng: torch.Generator) -> None:
    """Glorot-uniform weights and zero biases for every dense and convolutional layer, drawn from ``rng``."""
    for layer in module.modules():
        if isinstance(layer, nn.Linear | nn.Conv2d):
            nn.init.xavier_uniform_(layer.weight, generator=rng)
            if layer.bias is not None:
                nn.init.zeros_(layer.bias)


def cnn_2022(height: int, width: int, depth: int) -> nn.Sequential:
    """The CNN of the 2022 code: 3x3 filters of stride 2, channels 32, 64, 128, 256, each with ReLU.

    The representation is the last layer, 4096 numbers for 64 x 64 frames; 388 416 parameters.
    """
    layers: list[nn.Module] = []
    for channels in (32, 64, 128, 256):
        layers += [nn.Conv2d(depth, channels, 3, stride=2, padding=1), nn.ReLU(inplace=True)]
        depth = channels
    return nn.Sequential(*layers, nn.Flatten())
