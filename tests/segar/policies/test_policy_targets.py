"""Networks on other targets: the same actions to the bit as natively."""

import numpy as np
import pytest

from segar.engine import build_kernel
from segar.policies import NetworkPolicy
from tests.segar.engine.targets.machines import MACHINES
from tests.segar.policies.networks import KEYS, NETWORKS, actions, observations


@pytest.mark.parametrize("target", sorted(MACHINES))
def test_networks_act_to_the_bit(target):
    for name, make in NETWORKS.items():
        network = make()
        call = NetworkPolicy(network, sampled=True).call()
        machine = MACHINES[target](build_kernel([call.entry], target))
        expected = actions(network, sampled=True)
        envs = dict.fromkeys(("envs", "rows"), expected.shape[1])
        shapes = {one.name: (one.shape, one.dtype) for one in call.entry.arguments}
        given = {name: shapes[name] for name in ("memory", "scratch", "steps", "actions", "observations")}
        arrays = {
            key: np.zeros([envs.get(size, size) for size in shape], dtype) for key, (shape, dtype) in given.items()
        }
        machine.place({**call.arrays, **arrays, "keys": KEYS[: envs["rows"]], "rows": np.arange(envs["rows"])})
        for step in range(len(expected)):
            machine.place({"observations": observations(network, envs["rows"], step).reshape(envs["rows"], -1)})
            machine.call(call.entry, {}, envs, {}, envs["rows"])
            assert (name, step, machine["actions"].tobytes()) == (name, step, expected[step].tobytes())
