"""The portable network of a trained policy, and an agent that plays by it instead of by torch.

Only the modules that stand here have layers in :class:`segar.policies.Network`. They are looked up by their exact class,
because a sub-class may compute something else.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch
from torch import nn

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.experiments.algorithms.drq import DrQPolicy
from segar.experiments.algorithms.ppg import PPGPolicy
from segar.experiments.algorithms.ppo import PPOPolicy
from segar.experiments.algorithms.recurrent_ppo import RecurrentPolicy
from segar.experiments.algorithms.sac import GaussianActor, SACPolicy
from segar.experiments.networks.encoders import MLP, FrameEncoder, ResidualBlock, StackEncoder
from segar.experiments.networks.frame_conv import FrameConv
from segar.experiments.networks.keypoints import MOVED, Keypoints
from segar.experiments.settings import ConfigError
from segar.language import Task
from segar.policies import Layer, Network, NetworkPolicy

WAY_OUT = "Evaluate it without portable=true, which plays by torch"
Outputs = dict[str, Any]  # mean, log_std, log_std_range and value, as segar.policies.Network has them


def network_of(policy: object, observation_shape: tuple[int, ...], task: Task) -> Network:
    """The network by which a policy of one of the built-in algorithms acts, with the task's range of actions.

    It computes in float32, also where the policy's CNN computes in bfloat16.

    Args:
        observation_shape: of what the policy observes.

    Raises:
        ConfigError: the policy, or a part of it, has no portable form.
    """
    make = POLICIES.get(type(policy))
    if make is None:
        raise ConfigError(
            f"portable: the policy is a {type(policy).__module__}.{type(policy).__qualname__}, and only those of the"
            f" built-in algorithms have a portable form. {WAY_OUT}"
        )
    layers = Layers()
    outputs = make(layers, policy)
    try:
        low, high = tuple(task.action_low), tuple(task.action_high)
        return Network(observation_shape, tuple(layers.made), **outputs, action_low=low, action_high=high)
    except SegarError as error:
        raise ConfigError(f"portable: the policy's network has no portable form: {error}. {WAY_OUT}") from error


class PortableAgent:
    """Plays by a network, with the same bits on every processor; see :class:`segar.policies.NetworkPolicy`.

    Args:
        num_threads: threads over the batch.
    """

    def __init__(self, network: Network, num_threads: int) -> None:
        self.without_noise, self.sampled = (
            NetworkPolicy(network, sampled=sampled, unit_actions=True, num_threads=num_threads)
            for sampled in (False, True)
        )

    def begin(self, env: VectorEnv) -> None:
        """Episodes start in ``env``."""
        self.without_noise.begin(env)
        self.sampled.begin(env)

    def act(self, observation: np.ndarray, *, rng: torch.Generator | None) -> np.ndarray:
        """Actions float32 [n, actions]; deterministic where ``rng`` is None. Draws of sampled actions depend on the
        episodes that :meth:`begin` saw start, and not on ``rng``."""
        return (self.without_noise if rng is None else self.sampled)(observation)


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
                f" {', '.join(sorted(kind.__name__ for kind in MODULES))}"
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


def _ppo(layers: Layers, policy: PPOPolicy) -> Outputs:
    actor = policy.actor
    hidden = layers.add_encoder(actor.encoder, "actor.encoder")
    outputs = _heads(layers, hidden, actor, "actor.")
    *own, head = policy.value  # an encoder of its own stands before the head

    def add_value() -> int:
        reads = layers.add_encoder(own[0], "value.0") if own else hidden
        return layers.add_module(head, reads, f"value.{len(own)}")

    return outputs | _value(layers, add_value)


def _recurrent(layers: Layers, policy: RecurrentPolicy) -> Outputs:
    hidden = layers.add_core(policy.cells, layers.add_encoder(policy.encoder, "encoder"))
    return _heads(layers, hidden, policy, "") | _value(layers, lambda: layers.add_module(policy.value, hidden, "value"))


def _sac(layers: Layers, policy: SACPolicy) -> Outputs:
    actor = policy.actor
    return _heads(layers, layers.add_encoder(actor.trunk, "actor.trunk"), actor, "actor.")


def _drq(layers: Layers, policy: DrQPolicy) -> Outputs:
    projection, actor = policy.actor
    assert isinstance(actor, GaussianActor)
    x = layers.add_module(projection, layers.add_encoder(policy.encoder, "encoder"), "actor.0")
    return _heads(layers, layers.add_module(actor.trunk, x, "actor.1.trunk"), actor, "actor.1.")


def _heads(layers: Layers, hidden: int, policy: Any, place: str) -> Outputs:
    """The two heads of a policy, which read the same layer."""
    mean, log_std = (layers.add_module(getattr(policy, name), hidden, f"{place}{name}") for name in ("mean", "log_std"))
    return {"mean": mean, "log_std": log_std, "log_std_range": policy.log_std_range}


def _value(layers: Layers, add: Callable[[], int]) -> Outputs:
    """What a critic expects. A critic without a portable form is left out, because no action depends on it."""
    before = len(layers.made)
    try:
        return {"value": add()}
    except ConfigError:
        del layers.made[before:]
        return {}


POLICIES: Mapping[type, Callable[[Layers, Any], Outputs]] = {
    PPOPolicy: _ppo,
    PPGPolicy: _ppo,
    RecurrentPolicy: _recurrent,
    SACPolicy: _sac,
    DrQPolicy: _drq,
}


def _array(tensor: Any, otherwise: Any = None) -> np.ndarray:
    """A weight as an array; ``otherwise`` where the module has none."""
    return otherwise if tensor is None else tensor.detach().cpu().numpy()


def _sequential(layers: Layers, module: Any, source: int, place: str) -> int:
    for name, part in enumerate(module):  # also one that stands there twice
        source = layers.add_module(part, source, f"{place}.{name}")
    return source


def _linear(layers: Layers, module: nn.Linear, source: int, place: str) -> int:
    weight = _array(module.weight)
    return layers.add("dense", source, weight=weight.T, bias=_array(module.bias, np.zeros(len(weight))))


def _convolution(layers: Layers, module: nn.Conv2d, source: int, place: str) -> int:
    weight = _array(module.divided_weight if isinstance(module, FrameConv) else module.weight)
    return _add_convolution(layers, module, source, place, weight, _array(module.bias, np.zeros(len(weight))))


def _add_convolution(
    layers: Layers, module: nn.Conv2d, source: int, place: str, weight: np.ndarray, bias: np.ndarray
) -> int:
    """A convolution with these weights, torch's ``[output, input, row, column]``, and biases."""
    stride, padding = (_one_number(getattr(module, name), f"{place}: {name}") for name in ("stride", "padding"))
    _require(place, vars(module), {"dilation": (1, 1), "groups": 1, "padding_mode": "zeros"})
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
    weight, bias = _array(module.weight, np.ones(width)), _array(module.bias, np.zeros(width))
    return layers.add("layer_norm", source, options={"epsilon": module.eps}, weight=weight, bias=bias)


def _flatten(layers: Layers, module: nn.Flatten, source: int, place: str) -> int:
    _require(place, vars(module), {"start_dim": 1, "end_dim": -1})
    return layers.add("flatten", source)


def _residual_block(layers: Layers, module: ResidualBlock, source: int, place: str) -> int:
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


MODULES: Mapping[type[nn.Module], Callable[[Layers, Any, int, str], int]] = {
    nn.Sequential: _sequential,
    MLP: lambda layers, module, source, place: layers.add_module(module.layers, source, f"{place}.layers"),
    nn.Linear: _linear,
    nn.Conv2d: _convolution,
    FrameConv: _convolution,
    nn.MaxPool2d: _max_pool,
    nn.ReLU: _plain("relu"),
    nn.Tanh: _plain("tanh"),
    nn.Flatten: _flatten,
    nn.Identity: lambda layers, module, source, place: source,
    nn.LayerNorm: _layer_norm,
    ResidualBlock: _residual_block,
    Keypoints: _keypoints,
}
