"""The portable network of a trained policy, and an agent that plays by it instead of by torch."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import torch

from segar.envs import VectorEnv
from segar.errors import SegarError
from segar.experiments.algorithms.drq import DrQPolicy
from segar.experiments.algorithms.ppg import PPGPolicy
from segar.experiments.algorithms.ppo import PPOPolicy
from segar.experiments.algorithms.recurrent_ppo import RecurrentPolicy
from segar.experiments.algorithms.sac import GaussianActor, SACPolicy
from segar.experiments.networks.portable import WAY_OUT, Layers
from segar.experiments.settings import ConfigError
from segar.language import Task
from segar.policies import Network, NetworkPolicy

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
