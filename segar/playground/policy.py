"""What a page needs of a policy: the module that acts, its weights, and whether it fits what it reads and does there."""

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from segar.errors import SegarError
from segar.playground.modules import Blobs, described_module
from segar.policies import Network, NetworkPolicy

Weights = Literal["float32", "float16", "float8"]
WEIGHTS = ("float32", "float16", "float8")


def described_policy(
    policy: Network | NetworkPolicy, sets: list[dict[str, Any]], weights: Weights, blobs: Blobs
) -> dict[str, Any]:
    """A policy with its module.

    Args:
        sets: those of the page, as :func:`segar.playground.world.described_set` makes them.
        weights: "float32", or "float16" or "float8" for a smaller page, which plays the network with rounded weights.

    Raises:
        SegarError: the policy reads another observation, or its actions have another range; or weights are too large.
    """
    if not isinstance(policy, (Network, NetworkPolicy)):
        raise SegarError(
            f"policy must be a segar.policies.Network or a NetworkPolicy, not {type(policy).__name__}; make one of a run by"
            " segar evaluate run=FOLDER portable=true, and load its network.npz by Network.load"
        )
    if weights not in WEIGHTS:
        raise SegarError(f"weights must be {', '.join(WEIGHTS[:-1])} or {WEIGHTS[-1]}, not {weights!r}")
    if isinstance(policy, Network):
        policy = NetworkPolicy(policy)
    for one in sets:
        _check(policy, one)
    if weights != WEIGHTS[0]:
        rounded = policy.network.in_float16() if weights == "float16" else policy.network.in_float8()
        policy = NetworkPolicy(rounded, sampled=policy.sampled)
    count = sum(array.size for layer in policy.network.layers for array in layer.arrays.values())
    return {
        "module": described_module({"act": [policy.call()]}, {"envs": 1, "rows": 1}, 0, blobs),
        "reads": sets[0]["observations"][0]["name"],
        "sampled": policy.sampled,
        "value": policy.network.value is not None,
        "count": count,
        "weights": weights,
        "size": count * int(weights.removeprefix("float")) // 8,
    }


def _check(policy: NetworkPolicy, described: Mapping[str, Any]) -> None:
    """Raise :class:`SegarError` unless the policy reads the first observation of a set, and acts in its task's range."""
    network, title, task = policy.network, described["title"], described["task"]
    seen = described["observations"][0]
    mine = f"{network.dtype.name} of shape {network.observation_shape}"
    theirs = f"{seen['dtype']} of shape {tuple(seen['shape'])}"
    if mine != theirs:
        raise SegarError(
            f"the policy reads {mine}, and the first observation of the page ({seen['name']}, in the levels '{title}') is"
            f" {theirs}; give the observation that it was trained on as the first one"
        )
    ranges = [np.array(bounds, np.float32).tolist() for bounds in (network.action_low, network.action_high)]
    of_task = [np.array(task[name], np.float32).tolist() for name in ("action_low", "action_high")]
    if ranges != of_task:
        raise SegarError(
            f"the policy acts from {ranges[0]} to {ranges[1]}, and the task {task['name']} of the levels '{title}' takes"
            f" actions from {of_task[0]} to {of_task[1]}; give levels of the task that it was trained on, or task="
        )
    if policy.unit_actions:
        raise SegarError(
            "a page takes actions in the task's range, and this policy gives them from -1 to 1; give NetworkPolicy(network)"
            " without unit_actions=True"
        )
