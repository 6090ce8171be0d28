"""From layers to what the compiled forward pass reads: a table of operations, their weights, and places in scratch."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, field

import numpy as np

from segar.policies import kernels as k
from segar.policies.layers import MEMORY, Layer, Shape

Tensor = Hashable  # names what an operation writes: the number of a layer, or that and a word

ELEMENTWISE = {"relu": k.RELU, "tanh": k.TANH, "flatten": k.FLATTEN}
CORES = {"gru": k.GRU, "lstm": k.LSTM}


@dataclass(frozen=True, eq=False)
class ForwardPass:
    """What :func:`segar.policies.kernels.forward` needs.

    Attributes:
        table: int64 ``[operation, column]``; places: int64; floats: float32.
        width: float32 numbers of scratch per environment.
        outputs: where the outputs that were asked for begin in them.
        memory_width: float32 numbers that an environment remembers from step to step.
    """

    table: np.ndarray
    places: np.ndarray
    floats: np.ndarray
    width: int
    outputs: tuple[int, ...]
    memory_width: int


def make_forward_pass(layers: Sequence[Layer], shapes: Sequence[Shape], outputs: Sequence[int]) -> ForwardPass:
    """The forward pass that computes the outputs of these layers, and no layer that they do not need."""
    needed, program = set(outputs), _Program()
    for i in reversed(range(len(layers))):  # a layer reads earlier ones alone
        needed.update(layers[i].reads if i in needed else ())
    for i in sorted(needed):
        _add_layer(program, i, layers[i], [shapes[j] for j in layers[i].reads], shapes[i])
    offsets, width = _offsets(program, outputs)
    for row, (source, other, target) in zip(program.rows, program.tensors, strict=True):
        row[k.TARGET] = offsets[target]
        row[k.SOURCE], row[k.OTHER] = (0 if tensor is None else offsets[tensor] for tensor in (source, other))
    return ForwardPass(
        np.array(program.rows, np.int64),
        np.array(program.places, np.int64),
        np.concatenate(program.floats).astype(np.float32),
        width,
        tuple(offsets[i] for i in outputs),
        sum(MEMORY.get(layers[i].kind, 0) * shapes[i].channels for i in needed),
    )


@dataclass
class _Program:
    """Operations in their order, with names in place of offsets."""

    rows: list[list[int]] = field(default_factory=list)
    tensors: list[tuple[Tensor | None, Tensor | None, Tensor]] = field(default_factory=list)
    sizes: dict[Tensor, int] = field(default_factory=dict)
    places: list[int] = field(default_factory=list)
    floats: list[np.ndarray] = field(default_factory=list)

    def add(
        self,
        operation: int,
        given: Shape,
        gives: Shape,
        target: Tensor,
        source: Tensor | None = None,
        other: Tensor | None = None,
        numbers: tuple[int, int, int] = (1, 1, 0),
        floats: Sequence[np.ndarray | float] = (),
        places: Sequence[int] = (),
    ) -> None:
        """Append an operation; ``numbers`` are kernel, stride and padding."""
        at = (sum(map(len, self.floats)), len(self.places))
        self.rows.append([operation, 0, 0, 0, *given, *gives[1:], *numbers, *at])
        self.tensors.append((source, other, target))
        self.sizes[target] = gives.size
        self.floats += [np.atleast_1d(part).astype(np.float32) for part in floats]
        self.places += places

    def add_products(
        self,
        weight: np.ndarray,
        bias: np.ndarray,
        given: Shape,
        gives: Shape,
        target: Tensor,
        source: Tensor,
        stride: int,
    ) -> None:
        """Append a sum of products; ``weight`` is ``[kernel, kernel, input, output]``."""
        numbers, floats = (len(weight), stride, 0), [_tiles(weight, bias)]
        self.add(k.SUM_PRODUCTS, given, gives, target, source, None, numbers, floats, _windows(given, gives, stride))


def _add_layer(program: _Program, i: int, layer: Layer, given: Sequence[Shape], gives: Shape) -> None:
    """Append the operations of a layer."""
    options, arrays, reads = layer.options, layer.arrays, layer.reads
    match layer.kind:
        case "observation":
            program.add(k.OBSERVE, gives, gives, i, floats=[float(options["scale"])])
        case "dense":
            weight = arrays["weight"][None, None]
            program.add_products(weight, arrays["bias"], given[0], gives, i, reads[0], 1)
        case "convolution":
            source, padding = _padded(program, i, reads[0], given[0], int(options["padding"]))
            program.add_products(arrays["weight"], arrays["bias"], padding, gives, i, source, int(options["stride"]))
        case "max_pool":
            numbers = (int(options["kernel"]), int(options["stride"]), int(options["padding"]))
            program.add(k.MAX_POOL, given[0], gives, i, reads[0], None, numbers)
        case "relu" | "tanh" | "flatten":
            program.add(ELEMENTWISE[layer.kind], given[0], gives, i, reads[0])
        case "add":
            program.add(k.ADD, given[0], gives, i, reads[0], reads[1])
        case "layer_norm":
            floats = [float(options["epsilon"]), arrays["weight"], arrays["bias"]]
            program.add(k.LAYER_NORM, given[0], gives, i, reads[0], floats=floats)
        case "soft_argmax":
            program.add(k.SOFT_ARGMAX, given[0], gives, i, reads[0], floats=[arrays["places"].ravel()])
        case "movements":
            program.add(k.MOVEMENTS, given[0], gives, i, reads[0], floats=[float(options["factor"])])
        case "gru" | "lstm":
            _add_core(program, i, layer, given[0], gives)


def _padded(program: _Program, i: int, source: Tensor, given: Shape, padding: int) -> tuple[Tensor, Shape]:
    """The input of a convolution, with a border where it has one."""
    if padding == 0:
        return source, given
    wider = given._replace(height=given.height + 2 * padding, width=given.width + 2 * padding)
    program.add(k.PAD, given, wider, (i, "padded"), source, numbers=(1, 1, padding))
    return (i, "padded"), wider


def _add_core(program: _Program, i: int, layer: Layer, given: Shape, gives: Shape) -> None:
    """Append a GRU or an LSTM: its gates over the input, its gates over the memory, and what follows from both."""
    program.add(k.RECALL, gives, gives, (i, "memory"))
    for part, source, shape in (("input", layer.reads[0], given), ("memory", (i, "memory"), gives)):
        weight, bias = layer.arrays[f"weight_{part}"], layer.arrays[f"bias_{part}"]
        gates = Shape(1, 1, 1, len(bias))
        program.add_products(weight[None, None], bias, shape, gates, (i, "gates", part), source, 1)
    program.add(CORES[layer.kind], gives, gives, i, (i, "gates", "input"), (i, "gates", "memory"))


def _tiles(weight: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """Biases and weights as the kernel reads them, tile by tile of outputs; those that the last tile lacks are 0."""
    outputs = len(bias)
    count = -(-outputs // k.TILE)
    rows = np.zeros((1 + weight.size // outputs, count * k.TILE), np.float32)
    rows[0, :outputs], rows[1:, :outputs] = bias, weight.reshape(-1, outputs)
    return rows.reshape(len(rows), count, k.TILE).transpose(1, 0, 2).ravel()


def _windows(given: Shape, gives: Shape, stride: int) -> list[int]:
    """Where each window begins in the input."""
    image, y, z = np.indices(gives[:3])
    places = ((image * given.height + y * stride) * given.width + z * stride) * given.channels
    return places.ravel().tolist()


def _offsets(program: _Program, outputs: Sequence[int]) -> tuple[dict[Tensor, int], int]:
    """Where each tensor lies in a row of the scratch, and the row's width; what is not needed any more makes room."""
    last = {tensor: step for step, tensors in enumerate(program.tensors) for tensor in tensors if tensor is not None}
    last |= dict.fromkeys(outputs, len(program.tensors))
    offsets: dict[Tensor, int] = {}
    for step, (_, _, target) in enumerate(program.tensors):
        alive = sorted((offsets[t], offsets[t] + program.sizes[t]) for t in offsets if last[t] >= step)
        offset = 0
        for start, stop in alive:
            if start - offset >= program.sizes[target]:
                break
            offset = max(offset, stop)
        offsets[target] = offset
    return offsets, max(offsets[tensor] + program.sizes[tensor] for tensor in offsets)
