"""Layers of networks as plain data: their kinds, the layers that they read, their weights, and their shapes."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from segar.errors import SegarError, did_you_mean

Array = np.ndarray
LARGEST = 2**24  # of any number of a layer
MOST_NUMBERS = 2**22  # that a layer gives; those of the largest CNN here give 2**17


class Shape(NamedTuple):
    """The shape of what a layer gives; a vector is one image of 1 x 1 pixels."""

    images: int
    height: int
    width: int
    channels: int

    @property
    def size(self) -> int:
        """How many numbers there are."""
        return math.prod(self)

    @property
    def is_vector(self) -> bool:
        """Whether there is one pixel."""
        return self[:3] == (1, 1, 1)

    def __str__(self) -> str:
        return str(self.channels) if self.is_vector else " x ".join(map(str, self))


@dataclass(frozen=True, eq=False)
class Layer:
    """One layer of a network.

    Attributes:
        kind: a name in :data:`KINDS`.
        reads: numbers of the layers whose outputs it reads; each is smaller than its own.
        options: its numbers, such as the stride of a convolution.
        arrays: its weights by name, float32. Outputs are the last axis: ``weight`` is ``[inputs, outputs]`` of a dense
            layer, and ``[kernel, kernel, inputs, outputs]`` of a convolution. Gates of a GRU lie in the order reset,
            update, new, those of an LSTM in the order input, forget, cell, output.
    """

    kind: str
    reads: tuple[int, ...] = ()
    options: Mapping[str, float] = field(default_factory=dict)
    arrays: Mapping[str, Array] = field(default_factory=dict)


class Kind(NamedTuple):
    """What all layers of a kind have.

    Attributes:
        reads: how many layers it reads.
        options: names and types of its numbers.
        arrays: names and numbers of axes of its weights.
        shape: function of the layer and the shapes that it reads; returns the shape of its output.
    """

    reads: int
    options: Mapping[str, type]
    arrays: Mapping[str, int]
    shape: Callable[[Layer, Sequence[Shape]], Shape]


def output_shape(layer: Layer, given: Sequence[Shape]) -> Shape:
    """The shape of a layer's output for the shapes that it reads; the first layer reads the observation's.

    Raises:
        SegarError: the kind is unknown, its numbers or weights are not those of the kind, or do not fit the input.
    """
    if layer.kind not in KINDS:
        raise SegarError(f"there is no kind of layer '{layer.kind}'.{did_you_mean(layer.kind, KINDS)}")
    kind = KINDS[layer.kind]
    if len(layer.reads) != kind.reads:
        raise SegarError(f"it must read {kind.reads} layers, not {len(layer.reads)}")
    for what, there, wanted in (("options", layer.options, kind.options), ("weights", layer.arrays, kind.arrays)):
        if set(there) != set(wanted):
            raise SegarError(f"its {what} are {sorted(there)} and not {sorted(wanted)}")
    for name, number in layer.options.items():
        right = isinstance(number, int) if kind.options[name] is int else isinstance(number, int | float)
        if not right or isinstance(number, bool) or not math.isfinite(number) or abs(number) > LARGEST:
            raise SegarError(f"its {name} must be a {kind.options[name].__name__}, not {number!r}")
    for name, array in layer.arrays.items():
        if array.dtype != np.float32 or array.ndim != kind.arrays[name] or not np.isfinite(array).all():
            raise SegarError(
                f"'{name}' must be float32 with {kind.arrays[name]} axes and finite, not {array.dtype} of shape"
                f" {array.shape}"
            )
    shape = kind.shape(layer, given)
    if shape.size > MOST_NUMBERS:
        raise SegarError(f"it gives {shape}, more than {MOST_NUMBERS:,} numbers")
    return shape


def _observation(layer: Layer, given: Sequence[Shape]) -> Shape:
    stack, (_, height, width, depth) = int(layer.options["stack"]), given[0]
    if stack < 1 or depth % stack:
        raise SegarError(f"observations of {depth} channels are no stack of {stack} images")
    return Shape(stack, height, width, depth // stack)


def _same(layer: Layer, given: Sequence[Shape]) -> Shape:
    if len(set(given)) > 1:
        raise SegarError(f"its inputs have shapes {' and '.join(map(str, given))}")
    return given[0]


def _dense(layer: Layer, given: Sequence[Shape]) -> Shape:
    return Shape(1, 1, 1, _outputs(layer.arrays["weight"], layer.arrays["bias"], _vector(given[0])))


def _outputs(weight: Array, bias: Array, inputs: int) -> int:
    """How many outputs weights make of ``inputs``."""
    if weight.shape[0] != inputs or bias.shape != weight.shape[1:] or not bias.size:
        raise SegarError(f"weights {list(weight.shape)} and biases {list(bias.shape)} do not fit {inputs} inputs")
    return len(bias)


def _vector(shape: Shape) -> int:
    if not shape.is_vector:
        raise SegarError(f"it reads a vector, and gets {shape}; flatten it")
    return shape.channels


def _convolution(layer: Layer, given: Sequence[Shape]) -> Shape:
    weight, bias, shape = layer.arrays["weight"], layer.arrays["bias"], given[0]
    kernel, across, inputs, outputs = weight.shape
    if kernel != across or inputs != shape.channels or bias.shape != (outputs,) or not outputs:
        raise SegarError(
            f"weights {list(weight.shape)} and biases {list(bias.shape)} do not fit square windows of"
            f" {shape.channels} channels"
        )
    return _windows(shape, kernel, layer)._replace(channels=outputs)


def _windows(shape: Shape, kernel: int, layer: Layer) -> Shape:
    """The shape with one pixel per window."""
    stride, padding = int(layer.options["stride"]), int(layer.options["padding"])
    if stride < 1 or padding < 0 or kernel < 1 or padding >= kernel:
        raise SegarError(f"a window of {kernel} pixels with stride {stride} and padding {padding} is not possible")
    height, width = ((side + 2 * padding - kernel) // stride + 1 for side in shape[1:3])
    if height < 1 or width < 1:
        raise SegarError(f"its window of {kernel} pixels is larger than its input, {shape}")
    return Shape(shape.images, height, width, shape.channels)


def _max_pool(layer: Layer, given: Sequence[Shape]) -> Shape:
    return _windows(given[0], int(layer.options["kernel"]), layer)


def _flatten(layer: Layer, given: Sequence[Shape]) -> Shape:
    if given[0].images != 1:
        raise SegarError(f"it reads one image, and gets {given[0]}")
    return Shape(1, 1, 1, given[0].size)


def _layer_norm(layer: Layer, given: Sequence[Shape]) -> Shape:
    width = _vector(given[0])
    if any(array.shape != (width,) for array in layer.arrays.values()) or not layer.options["epsilon"] > 0:
        raise SegarError(f"its weights and biases must be {width} numbers each, and its epsilon above 0")
    return given[0]


def _soft_argmax(layer: Layer, given: Sequence[Shape]) -> Shape:
    cells = given[0].height * given[0].width
    if layer.arrays["places"].shape != (cells, 2):
        raise SegarError(f"its places must be [{cells}, 2], not {list(layer.arrays['places'].shape)}")
    return Shape(given[0].images, 1, 1, 2 * given[0].channels)


def _core(gates: int) -> Callable[[Layer, Sequence[Shape]], Shape]:
    def shape(layer: Layer, given: Sequence[Shape]) -> Shape:
        width = len(layer.arrays["weight_memory"])
        of_input = _outputs(layer.arrays["weight_input"], layer.arrays["bias_input"], _vector(given[0]))
        of_memory = _outputs(layer.arrays["weight_memory"], layer.arrays["bias_memory"], width)
        if of_input != gates * width or of_memory != gates * width:
            raise SegarError(
                f"a {layer.kind} of width {width} has {gates * width} gates, not {of_input} and {of_memory}"
            )
        return Shape(1, 1, 1, width)

    return shape


_CORE = {"weight_input": 2, "bias_input": 1, "weight_memory": 2, "bias_memory": 1}
_WINDOW = {"stride": int, "padding": int}

KINDS: Mapping[str, Kind] = {
    "observation": Kind(0, {"scale": float, "stack": int}, {}, _observation),
    "dense": Kind(1, {}, {"weight": 2, "bias": 1}, _dense),
    "convolution": Kind(1, _WINDOW, {"weight": 4, "bias": 1}, _convolution),
    "max_pool": Kind(1, {"kernel": int, **_WINDOW}, {}, _max_pool),
    "relu": Kind(1, {}, {}, _same),
    "tanh": Kind(1, {}, {}, _same),
    "add": Kind(2, {}, {}, _same),
    "flatten": Kind(1, {}, {}, _flatten),
    "layer_norm": Kind(1, {"epsilon": float}, {"weight": 1, "bias": 1}, _layer_norm),
    "soft_argmax": Kind(1, {}, {"places": 2}, _soft_argmax),
    "movements": Kind(1, {"factor": float}, {}, lambda layer, given: Shape(1, 1, 1, given[0].size)),
    "gru": Kind(1, {}, _CORE, _core(3)),
    "lstm": Kind(1, {}, _CORE, _core(4)),
}
MEMORY = {"gru": 1, "lstm": 2}  # numbers that each output of such a layer remembers
