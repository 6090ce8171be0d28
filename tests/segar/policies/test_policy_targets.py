"""Networks on other targets: the same actions to the bit as natively."""

from dataclasses import replace

import numpy as np
import pytest

from segar.engine import build_kernel
from segar.policies import Network, NetworkPolicy
from segar.support import mathematics
from tests.segar.engine.targets.machines import MACHINES
from tests.segar.policies.networks import KEYS, NETWORKS, actions, observations

QUICK = ("points", "lstm")  # which have layers of all kinds between them, but for "gru" and "flatten"


@pytest.mark.parametrize("target", ["wasm", pytest.param("native", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    "name", [name if name in QUICK else pytest.param(name, marks=pytest.mark.slow) for name in NETWORKS]
)
def test_networks_act_to_the_bit(name, target):
    network = NETWORKS[name]()
    call = NetworkPolicy(network, sampled=True).call()
    machine = MACHINES[target](build_kernel([call.entry], target))
    expected = actions(network, sampled=True)
    envs = dict.fromkeys(("envs", "rows"), expected.shape[1])
    values = None if network.value is None else squashed_values(network)
    shapes = {one.name: (one.shape, one.dtype) for one in call.entry.arguments}
    given = {name: shapes[name] for name in ("memory", "scratch", "steps", "actions", "values", "observations")}
    arrays = {key: np.zeros([envs.get(size, size) for size in shape], dtype) for key, (shape, dtype) in given.items()}
    machine.place({**call.arrays, **arrays, "keys": KEYS[: envs["rows"]], "rows": np.arange(envs["rows"])})
    for step in range(len(expected)):
        machine.place({"observations": observations(network, envs["rows"], step).reshape(envs["rows"], -1)})
        machine.call(call.entry, {}, envs, {}, envs["rows"])
        assert (step, machine["actions"].tobytes()) == (step, expected[step].tobytes())
        if values is None:
            assert not machine["values"].any()
        else:
            squashed = [np.float32(mathematics.tanh(np.float64(value))) for value in machine["values"]]
            assert (step, squashed) == (step, values[step, :, 0].tolist())


def squashed_values(network: Network) -> np.ndarray:
    """tanh of the values, as actions without noise of a network whose mean is the value."""
    assert network.value is not None
    return actions(replace(network, mean=network.value, log_std=network.value, action_low=(), action_high=()))
