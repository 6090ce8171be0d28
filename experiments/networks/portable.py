"""From modules of torch to the layers of :class:`segar.policies.Network`.

Only the modules that stand here have such layers. They are looked up by their exact class, because a sub-class may
compute something else.
"""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from torch import Tensor, nn

from segar.experiments.networks.encoders import MLP, FrameEncoder, StackEncoder, _ResidualBlock
from segar.experiments.networks.frame_conv import FrameConv
from segar.experiments.networks.keypoints import MOVED, Keypoints
from segar.experiments.settings import ConfigError
from segar.policies import Layer

WAY_OUT = "Evaluate it without portable=true, which plays by torch"


class Layers:
    """Layers that are made one after the other, from an observation on."""

    def __init__(self) -> None:
        self.made: list[Layer] = []

    def add(self, kind: str, *reads: int, options: Mapping[str, float] | None = None, **arrays: np.ndarray) -> int:
        """Append a layer; returns its number."""
        weights = {name: np.array(array, np.float32, order="C") for name, array in arrays.items()}
        self.made.append(Layer(kind, reads, options or {}, weights))
        return len(self.made) - 1

    def add_module(self, module: nn.Module, source: int, place: str) -> int:
        """Append what a module computes of the output of layer ``source``; returns the number of its last layer.

        Raises:
            ConfigError: it has no portable form; the message names it by its ``place`` in the policy.
        """
        add = MODULES.get(type(module))
        if add is None:
            raise ConfigError(
                f"portable: '{place}' of the policy is a {type(module).__module__}.{type(module).__qualname__}, which"
                f" has no portable form. {WAY_OUT}, or build the network of"
                f" {', '.join(sorted(kind.__name__ for kind in MODULES if not kind.__name__.startswith('_')))}"
            )
        hooks = {"forward hooks": [*module._forward_hooks.values(), *module._forward_pre_hooks.values()]}
        _require(place, hooks, {"forward hooks": []})
        return add(self, module, source, place)

    def add_encoder(self, encoder: nn.Module, place: str) -> int:
        """Append the observation and an encoder that reads it; returns the number of the layer that gives phi."""
        if type(encoder) is MLP:
            return self.add_module(encoder, self._observation(), place)
        if type(encoder) is FrameEncoder:
            scale = 1.0 if encoder.scale is None else encoder.scale
            return self.add_module(encoder.trunk, self._observation(scale), f"{place}.trunk")
        if type(encoder) is StackEncoder:
            return self.add_module(encoder.trunk, self._observation(stack=encoder.trunk.stack), f"{place}.trunk")
        raise ConfigError(f"portable: '{place}' is a {type(encoder).__name__}, which has no portable form. {WAY_OUT}")

    def add_core(self, cells: nn.Module, source: int) -> int:
        """Append one GRU or LSTM of torch, of a single layer."""
        kind = {nn.GRU: "gru", nn.LSTM: "lstm"}[type(cells)]  # type: ignore[index]
        return self.add(
            kind,
            source,
            weight_input=_array(cells.weight_ih_l0).T,
            bias_input=_array(cells.bias_ih_l0),
            weight_memory=_array(cells.weight_hh_l0).T,
            bias_memory=_array(cells.bias_hh_l0),
        )

    def _observation(self, scale: float = 1.0, stack: int = 1) -> int:
        """The layer of the observation, which several encoders may read."""
        options = {"scale": scale, "stack": stack}
        if not self.made:
            return self.add("observation", options=options)
        if self.made[0].options != options:
            raise ConfigError(f"portable: two encoders read the observation in different forms. {WAY_OUT}")
        return 0


def _array(tensor: Any) -> np.ndarray:
    """A weight as an array."""
    assert isinstance(tensor, Tensor)
    return tensor.detach().cpu().numpy()


def _sequential(layers: Layers, module: Any, source: int, place: str) -> int:
    for name, part in enumerate(module):  # also one that stands there twice
        source = layers.add_module(part, source, f"{place}.{name}")
    return source


def _mlp(layers: Layers, module: MLP, source: int, place: str) -> int:
    return layers.add_module(module.layers, source, f"{place}.layers")


def _linear(layers: Layers, module: nn.Linear, source: int, place: str) -> int:
    weight = _array(module.weight)
    bias = np.zeros(len(weight)) if module.bias is None else _array(module.bias)
    return layers.add("dense", source, weight=weight.T, bias=bias)


def _convolution(layers: Layers, module: nn.Conv2d, source: int, place: str) -> int:
    weight = _array(module.divided_weight if isinstance(module, FrameConv) else module.weight)
    return _add_convolution(layers, module, source, place, weight, None if module.bias is None else _array(module.bias))


def _add_convolution(
    layers: Layers, module: nn.Conv2d, source: int, place: str, weight: np.ndarray, bias: np.ndarray | None
) -> int:
    """A convolution with these weights, torch's ``[output, input, row, column]``, and biases, if any."""
    stride, padding = (_one_number(getattr(module, name), f"{place}: {name}") for name in ("stride", "padding"))
    _require(place, vars(module), {"dilation": (1, 1), "groups": 1, "padding_mode": "zeros"})
    bias = np.zeros(len(weight)) if bias is None else bias
    options = {"stride": stride, "padding": padding}
    return layers.add("convolution", source, options=options, weight=weight.transpose(2, 3, 1, 0), bias=bias)


def _require(place: str, found: Mapping[str, Any], usual: Mapping[str, Any]) -> None:
    """Raises :class:`ConfigError` unless the settings of a module are those that have a portable form."""
    for name, value in usual.items():
        if found[name] != value:
            raise ConfigError(f"portable: '{place}' has {name} {found[name]!r}, which has no portable form. {WAY_OUT}")


def _one_number(value: Any, what: str) -> int:
    """The number that stands for both sides of a window."""
    if isinstance(value, tuple) and len({*value}) == 1:
        value = value[0]
    if not isinstance(value, int):
        raise ConfigError(
            f"portable: '{what}' is {value!r}, and must be one number for both sides to have a portable form. {WAY_OUT}"
        )
    return value


def _max_pool(layers: Layers, module: nn.MaxPool2d, source: int, place: str) -> int:
    _require(place, vars(module), {"dilation": 1, "ceil_mode": False, "return_indices": False})
    names = {"kernel": "kernel_size", "stride": "stride", "padding": "padding"}
    options = {name: _one_number(getattr(module, theirs), f"{place}: {theirs}") for name, theirs in names.items()}
    return layers.add("max_pool", source, options=options)


def _layer_norm(layers: Layers, module: nn.LayerNorm, source: int, place: str) -> int:
    width = module.normalized_shape[-1]
    _require(place, vars(module), {"normalized_shape": (width,)})
    weight, bias = (
        np.full(width, missing) if given is None else _array(given)
        for given, missing in ((module.weight, 1.0), (module.bias, 0.0))
    )
    return layers.add("layer_norm", source, options={"epsilon": module.eps}, weight=weight, bias=bias)


def _flatten(layers: Layers, module: nn.Flatten, source: int, place: str) -> int:
    _require(place, vars(module), {"start_dim": 1, "end_dim": -1})
    return layers.add("flatten", source)


def _residual_block(layers: Layers, module: _ResidualBlock, source: int, place: str) -> int:
    x = layers.add_module(module.entry, source, f"{place}.entry")
    x = layers.add_module(module.pool, x, f"{place}.pool")
    for name, residual in enumerate(module.residuals):
        x = layers.add("add", x, layers.add_module(residual, x, f"{place}.residuals.{name}"))
    return x


def _keypoints(layers: Layers, module: Keypoints, source: int, place: str) -> int:
    x = layers.add("relu", layers.add_module(module.first, source, f"{place}.first"))
    sharpness = _array(module.sharpness)
    weight, bias = _array(module.second.weight) * sharpness[:, None, None, None], _array(module.second.bias) * sharpness
    x = _add_convolution(layers, module.second, x, f"{place}.second", weight, bias)
    x = layers.add("soft_argmax", x, places=_places(module))
    return layers.add_module(module.dense, layers.add("movements", x, options={"factor": MOVED}), f"{place}.dense")


def _places(module: Keypoints) -> np.ndarray:
    """x and y of each cell of the map [cells, 2]. Torch's ``linspace`` gives other bits on other processors."""
    down = _array(module.places)[:, 1]
    columns = int((down == down[0]).sum())
    y, x = np.meshgrid(*(np.linspace(-1, 1, count) for count in (len(down) // columns, columns)), indexing="ij")
    return np.stack([x.ravel(), y.ravel()], 1)


def _plain(kind: str) -> Callable[[Layers, Any, int, str], int]:
    return lambda layers, module, source, place: layers.add(kind, source)


def _nothing(layers: Layers, module: Any, source: int, place: str) -> int:
    return source


MODULES: Mapping[type[nn.Module], Callable[[Layers, Any, int, str], int]] = {
    nn.Sequential: _sequential,
    MLP: _mlp,
    nn.Linear: _linear,
    nn.Conv2d: _convolution,
    FrameConv: _convolution,
    nn.MaxPool2d: _max_pool,
    nn.ReLU: _plain("relu"),
    nn.Tanh: _plain("tanh"),
    nn.Flatten: _flatten,
    nn.Identity: _nothing,
    nn.LayerNorm: _layer_norm,
    _ResidualBlock: _residual_block,
    Keypoints: _keypoints,
}
