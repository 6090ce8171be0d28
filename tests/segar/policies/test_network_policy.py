"""Policies by compiled networks: bits that depend on nothing but weights and observations, and draws that are keyed."""

import os
import subprocess
import sys
from json import loads

import numpy as np
import pytest
from scipy import stats

import segar
from segar.errors import SegarError
from segar.policies import Layer, Network, NetworkPolicy, kernels
from tests.places import ROOT
from tests.segar.policies.networks import KEYS, NETWORKS, Builder, actions, environments, observations

BY_NAME = pytest.mark.parametrize("name", NETWORKS)
ALLOWED = {"sqrt", "llvm.sqrt.f64"}  # IEEE 754 says every bit of a root
ELEMENTARY = ("fma", "fmuladd", "exp", "log", "pow", "sin", "cos", "tan", "floor", "ceil", "round", "sqrt")


def report(folder, **limits):
    """What ``tests.segar.policies.networks`` prints in a process with these settings of numba."""
    environment = {**os.environ, "SEGAR_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT), **limits}
    command = [sys.executable, "-m", "tests.segar.policies.networks"]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    return loads(done.stdout)


@pytest.mark.slow
def test_bits_depend_neither_on_instruction_sets_nor_on_vectorisation(tmp_path):
    host = report(tmp_path / "host")
    generic = report(
        tmp_path / "generic",
        NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_LOOP_VECTORIZE="0", NUMBA_SLP_VECTORIZE="0",
    )  # fmt: skip
    assert host["hashes"] == generic["hashes"]
    assert len({*host["hashes"].values()}) == 2 * len(NETWORKS)
    assert host["vectors"] > 0 == generic["vectors"]
    for one in (host, generic):  # nothing is reordered or contracted, and no library computes
        assert one["flags"] == []
        called = [name for name in one["declared"] if not name.startswith(("Py", "numba_"))]
        assert [name for name in called if any(word in name for word in ELEMENTARY) and name not in ALLOWED] == []


@BY_NAME
@pytest.mark.parametrize("sampled", [False, True])
def test_an_environment_acts_alike_in_any_batch_and_with_any_number_of_threads(name, sampled, eager_threads):
    network = NETWORKS[name]()
    whole = actions(network, sampled=sampled)
    np.testing.assert_array_equal(actions(network, sampled=sampled, num_threads=2), whole)
    for e in (0, 69):
        alone = actions(network, slice(e, e + 1), sampled=sampled)
        np.testing.assert_array_equal(alone[:, 0], whole[:, e])


@BY_NAME
def test_actions_lie_in_the_range_of_the_task_or_are_mapped_to_it_by_the_environment(name):
    network = NETWORKS[name]()
    unit = actions(network, unit_actions=True)
    assert (np.abs(unit) < 1).all() and unit.std() > 0.01
    low, high = np.array(network.action_low, np.float32), np.array(network.action_high, np.float32)
    np.testing.assert_array_equal(actions(network), (low + high) / 2 + (high - low) / 2 * unit)


def test_a_sum_runs_over_its_inputs_in_their_order_in_float32():
    rng, count = np.random.default_rng(0), 37
    inputs, weight = rng.normal(size=(5, count)).astype("f"), rng.normal(size=(count, 21)).astype("f")
    bias = rng.normal(size=21).astype("f")
    expected = np.tile(bias, (5, 1))
    for k in range(count):
        expected += inputs[:, k, None] * weight[k]
    found = given_by(Layer("dense", (0,), arrays={"weight": weight, "bias": bias}), inputs)
    np.testing.assert_array_equal(found, expected)
    backwards = np.tile(bias, (5, 1))
    for k in reversed(range(count)):
        backwards += inputs[:, k, None] * weight[k]
    assert (backwards != expected).any()


def given_by(layer, inputs):
    """What a layer gives for vectors."""
    first = Layer("observation", options={"scale": 1.0, "stack": 1})
    network = Network((inputs.shape[1],), (first, layer), 1, 1)
    plan = network.forward_pass(sampled=False)
    scratch, sums = np.zeros(len(inputs) * plan.width, "f"), np.zeros(kernels.ROWS * kernels.TILE, "f")
    memory = np.zeros((len(inputs), 0), "f")
    kernels.forward(plan.table, plan.places, plan.floats, inputs, memory, scratch, plan.width, sums, 0, len(inputs))
    return scratch.reshape(len(inputs), -1)[:, plan.outputs[0] :][:, : network.actions]


def test_noise_is_normal_and_independent_between_steps_components_and_episodes():
    n = len(KEYS)
    noise = [[kernels.normal(key, step, a) for step in range(3) for a in range(2)] for key in KEYS]
    columns = np.array(noise)
    assert all(stats.kstest(column, "norm").pvalue > 1e-3 for column in columns.T)
    correlations = np.corrcoef(columns.T) - np.eye(columns.shape[1])
    assert np.abs(correlations).max() < 5 / np.sqrt(n)
    assert np.abs(np.corrcoef(columns[1:, 0], columns[:-1, 0])[0, 1]) < 5 / np.sqrt(n)


def test_sampled_actions_scatter_by_the_networks_standard_deviation():
    network = NETWORKS["mlp"]()
    policy = NetworkPolicy(network, sampled=True, unit_actions=True)
    same = np.repeat(observations(network, 1, 0), len(KEYS), 0)
    policy.begin(environments(KEYS, network, unit_actions=True))
    u = np.arctanh(policy(same).astype(float))
    mean = np.arctanh(NetworkPolicy(network, unit_actions=True)(same[:1])[0].astype(float))
    hidden = outputs_in_float64(network, same[0])
    spread = np.exp(np.clip(hidden, *network.log_std_range))
    np.testing.assert_allclose((u.mean(0) - mean) / spread, 0, atol=0.08)
    np.testing.assert_allclose(u.std(0) / spread, 1, atol=0.06)


def outputs_in_float64(network, x):
    """``log_std`` of the network ``mlp``, by numpy."""
    _, first, _, second, norm, _, last, _ = network.layers
    x = np.tanh(x @ first.arrays["weight"].astype(float) + first.arrays["bias"])
    x = x @ second.arrays["weight"] + second.arrays["bias"]
    x = (x - x.mean()) / np.sqrt(x.var() + norm.options["epsilon"]) * norm.arrays["weight"] + norm.arrays["bias"]
    return x @ last.arrays["weight"] + last.arrays["bias"]


@pytest.mark.parametrize("name", ["gru", "lstm"])
def test_a_memory_is_kept_from_step_to_step_and_emptied_where_episodes_begin(name):
    network = NETWORKS[name]()
    policy = NetworkPolicy(network)
    played = []
    for _ in range(2):
        policy.begin(environments(KEYS[:3], network))
        played.append([policy(observations(network, 3, 0)) for _ in range(2)])
    np.testing.assert_array_equal(*played)
    assert (played[0][0] != played[0][1]).all()


def test_it_plays_in_evaluate_policy():
    levels = segar.family("empty-easy").sample(3, seed=0)
    env = segar.envs.VectorEnv(levels, 1, seed=0)
    one = Builder()
    width = env.single_observation_space.shape[0]
    one.dense(width, 8)
    network = one.network((width,), 8)
    found = [segar.evaluate_policy(NetworkPolicy(network, sampled=True), levels, levels, seed=s) for s in (1, 1, 2)]
    same, again, other = (one.train.of_levels("return") for one in found)
    np.testing.assert_array_equal(same, again)
    assert (same != other).any()


def test_what_does_not_fit_is_refused_with_what_is_wrong():
    network = NETWORKS["residual"]()
    policy = NetworkPolicy(network)
    for wrong in (np.zeros((2, 15, 13, 3), np.uint8), np.zeros((2, 15, 13, 6), np.float32)):
        with pytest.raises(SegarError, match=r"the network reads observations uint8 of shape \(n, 15, 13, 6\), not"):
            policy(wrong)
    with pytest.raises(SegarError, match="not list"):
        policy([1.0])
    with pytest.raises(SegarError, match=r"samples: call begin\(env\)"):
        NetworkPolicy(network, sampled=True)(observations(network, 2, 0))
    with pytest.raises(SegarError, match=r"has a memory: call begin\(env\)"):
        NetworkPolicy(NETWORKS["gru"]())(observations(NETWORKS["gru"](), 2, 0))
    ranged = NETWORKS["mlp"]()
    with pytest.raises(SegarError, match="unit_actions=True"):
        NetworkPolicy(ranged).begin(environments(KEYS[:2], ranged, unit_actions=True))
