"""Networks of policies as plain data, which can be saved, read by anybody, and computed on any processor."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike
from pathlib import Path
from typing import Any, Self

import numpy as np

from segar.errors import SegarError, naming
from segar.policies.forward_pass import ForwardPass, make_forward_pass
from segar.policies.layers import MEMORY, Layer, Shape, output_shape
from segar.support import ArchiveFormat, Form

DESCRIPTION = {
    "observation_shape": [int],
    "layers": [{"kind": str, "reads": [int], "options": {str: float}, "arrays": [str]}],
    "mean": int,
    "log_std": int,
    "value": (int, None),
    "log_std_range": [float],
    "action_low": [float],
    "action_high": [float],
}
FORMAT = ArchiveFormat("segar-network", 1, "a network", "network file", SegarError, DESCRIPTION)
NETWORK_FILE = "network.npz"  # in the folder of an evaluation, of the network that played
ONE_NUMBER = Shape(1, 1, 1, 1)
LONGEST_SIDE = 2**16  # of an observation
MOST_OF_16_BITS = float(np.finfo(np.float16).max)


@dataclass(frozen=True, eq=False)
class Network:
    """A policy's network: an observation becomes the mean and the logarithm of the standard deviation of an action, and, of
    some networks, the value of what is observed.

    The policy is the distribution of tanh(u), with u normal per component, mapped linearly to the actions' range.

    >>> weight, bias = np.zeros((3, 2), np.float32), np.zeros(2, np.float32)
    >>> start = segar.policies.Layer("observation", options={"scale": 1.0, "stack": 1})
    >>> dense = segar.policies.Layer("dense", (0,), arrays={"weight": weight, "bias": bias})
    >>> segar.policies.Network((3,), (start, dense), mean=1, log_std=1).actions
    2

    Attributes:
        observation_shape: ``(d,)`` of vectors, which are float32, or ``(height, width, depth)`` of frames, uint8.
        layers: in an order in which each reads only earlier ones. The first one is of the kind ``observation``: it
            multiplies the observation by its ``scale``, and splits the depth of frames into a ``stack`` of images.
        mean, log_std: numbers of the layers that give these.
        log_std_range: the bounds that ``log_std`` is held to.
        value: number of the layer that gives the return which a critic expects; None where there is none. It decides no
            action. Its unit is that of the rewards by which the critic learned, discounted.
        action_low, action_high: the range of each component of an action; from -1 to 1 where they are empty.
        shapes: of what the layers give.

    Raises:
        SegarError: layers or weights do not fit each other; the message names the layer.
    """

    observation_shape: tuple[int, ...]
    layers: tuple[Layer, ...]
    mean: int
    log_std: int
    log_std_range: tuple[float, float] = (-20.0, 2.0)
    action_low: tuple[float, ...] = ()
    action_high: tuple[float, ...] = ()
    value: int | None = None
    shapes: tuple[Shape, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        shapes = _shapes(self.observation_shape, self.layers)
        object.__setattr__(self, "shapes", shapes)
        if sum(layer.kind in MEMORY for layer in self.layers) > 1:
            raise SegarError("a network has one layer with a memory at most")
        for name, i in (("mean", self.mean), ("log_std", self.log_std)):
            if not 0 <= i < len(shapes) or not shapes[i].is_vector:
                raise SegarError(f"a network's {name} must be the number of a layer that gives a vector, not {i}")
        if shapes[self.mean] != shapes[self.log_std]:
            raise SegarError(f"mean has {shapes[self.mean]} components, and log_std {shapes[self.log_std]}")
        if self.value is not None and not (0 <= self.value < len(shapes) and shapes[self.value] == ONE_NUMBER):
            raise SegarError(f"a network's value must be the number of a layer that gives one number, not {self.value}")
        low, high = self.log_std_range
        if not (math.isfinite(low) and math.isfinite(high) and low <= high):
            raise SegarError(f"log_std_range must be two finite numbers in their order, not {low} and {high}")
        object.__setattr__(self, "log_std_range", (float(low), float(high)))
        for name, default in (("action_low", -1.0), ("action_high", 1.0)):
            bounds = tuple(map(float, getattr(self, name))) or (default,) * self.actions
            if len(bounds) != self.actions or not np.isfinite(bounds).all():
                raise SegarError(f"{name} must be {self.actions} finite numbers, not {list(bounds)}")
            object.__setattr__(self, name, bounds)

    @property
    def actions(self) -> int:
        """How many components an action has."""
        return self.shapes[self.mean].channels

    @property
    def dtype(self) -> np.dtype:
        """The dtype of observations."""
        return np.dtype(np.uint8 if len(self.observation_shape) == 3 else np.float32)

    def in_float16(self) -> Self:
        """The network with each weight rounded to the nearest number of 16 bits, for files of half the size.

        Raises:
            SegarError: a weight is too large for 16 bits; the message names its layer.
        """
        layers = []
        for i, layer in enumerate(self.layers):
            with np.errstate(over="ignore"):
                arrays = {name: array.astype(np.float16).astype(np.float32) for name, array in layer.arrays.items()}
            large = [name for name, array in arrays.items() if not np.isfinite(array).all()]
            if large:
                raise SegarError(
                    f"layer {i} ({layer.kind}): some numbers of '{large[0]}' are larger than {MOST_OF_16_BITS:,.0f}, which 16"
                    " bits do not hold; keep the weights as float32"
                )
            layers.append(replace(layer, arrays=arrays))
        return replace(self, layers=tuple(layers))

    def in_float8(self) -> Self:
        """The network of :meth:`in_float16` with 2 of the 10 bits of each weight's fraction, for still smaller files; biases
        keep all of them.

        Raises:
            SegarError: as of :meth:`in_float16`.
        """
        layers = []
        for layer in self.in_float16().layers:
            parts = {name: np.frexp(array) for name, array in layer.arrays.items() if name.startswith("weight")}
            short = {name: np.ldexp(np.rint(part * 8) / 8, exponent) for name, (part, exponent) in parts.items()}
            layers.append(replace(layer, arrays={**layer.arrays, **short}))
        return replace(self, layers=tuple(layers))

    def forward_pass(self, sampled: bool, *, valued: bool = False) -> ForwardPass:
        """What the compiled forward pass reads; it gives the mean; where actions are ``sampled``, ``log_std``; and, where it is
        asked for and there is one, the value."""
        value = () if self.value is None or not valued else (self.value,)
        return make_forward_pass(self.layers, self.shapes, (self.mean, *((self.log_std,) if sampled else ()), *value))

    def save(self, path: str | PathLike[str]) -> None:
        """Write to ``path`` (npz without pickle). An existing file is replaced only by a complete one.

        Raises:
            SegarError: the file cannot be written; what stood at ``path`` still stands there.
        """
        layers = [
            {"kind": layer.kind, "reads": layer.reads, "options": dict(layer.options), "arrays": list(layer.arrays)}
            for layer in self.layers
        ]
        described = {name: getattr(self, name) for name in DESCRIPTION} | {"layers": layers}
        arrays = {_key(i, name): array for i, layer in enumerate(self.layers) for name, array in layer.arrays.items()}
        FORMAT.write(Path(path), arrays, described)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Self:
        """The network in a file that ``save`` wrote. Nothing in the file is run or unpickled.

        Raises:
            SegarError: the file is no network, is incomplete, its layers do not fit each other, or it was written by a
                newer version.
        """
        path = Path(path)

        def forms(metadata: dict[str, Any]) -> dict[str, Form]:
            return {
                _key(i, name): Form("float32", (..., ))
                for i, layer in enumerate(metadata["layers"])
                for name in layer["arrays"]
            }  # fmt: skip

        arrays, described = FORMAT.read(path, forms)
        layers = []
        for i, one in enumerate(described["layers"]):
            weights = {name: arrays[_key(i, name)] for name in one["arrays"]}
            layers.append(Layer(one["kind"], tuple(one["reads"]), one["options"], weights))
        try:
            return cls(
                tuple(described["observation_shape"]),
                tuple(layers),
                described["mean"],
                described["log_std"],
                *(tuple(described[name]) for name in ("log_std_range", "action_low", "action_high")),
                value=described["value"],
            )
        except SegarError as error:
            raise SegarError(f"{path}: {error}; the file was changed, save the network again") from error


def _key(layer: int, name: str) -> str:
    """The name of an array in files."""
    return f"{layer}/{name}"


def _shapes(observation_shape: Sequence[int], layers: Sequence[Layer]) -> tuple[Shape, ...]:
    """The shapes of what the layers give."""
    if len(observation_shape) not in (1, 3) or not all(0 < side <= LONGEST_SIDE for side in observation_shape):
        raise SegarError(
            f"observations must be vectors [d] or frames [height, width, depth], not {list(observation_shape)}"
        )
    *sides, depth = observation_shape
    height, width = sides or (1, 1)
    observation = Shape(1, height, width, depth)
    if not layers:
        raise SegarError("a network must have layers, and has none")
    shapes: list[Shape] = []
    for i, layer in enumerate(layers):
        if (layer.kind == "observation") != (i == 0):
            raise SegarError("the first layer of a network, and no other, must be of the kind 'observation'")
        if any(not 0 <= j < i for j in layer.reads):
            raise SegarError(
                f"layer {i} ({layer.kind}) reads layers {list(layer.reads)}, which do not all come before it"
            )
        with naming(f"layer {i} ({layer.kind})"):
            shapes.append(output_shape(layer, [shapes[j] for j in layer.reads] or [observation]))
    return tuple(shapes)
