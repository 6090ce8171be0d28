"""Networks as data: they come back from files as they were, and what does not fit is refused by name."""

import json

import numpy as np
import pytest
import torch

from segar.errors import SegarError
from segar.policies import Layer, Network
from segar.policies.layers import KINDS
from tests.segar.policies.networks import NETWORKS, VECTORS, Builder, actions

BY_NAME = pytest.mark.parametrize("name", NETWORKS)
START = Layer("observation", options={"scale": 1.0, "stack": 1})


def array(*shape):
    return np.broadcast_to(np.float32(1), shape)  # of any size, and no memory


def dense(inputs, outputs, *reads):
    return Layer("dense", reads or (0,), arrays={"weight": array(inputs, outputs), "bias": array(outputs)})


def test_the_example_networks_have_layers_of_all_kinds():
    assert {layer.kind for make in NETWORKS.values() for layer in make().layers} == set(KINDS)


@BY_NAME
def test_a_network_from_a_file_acts_as_the_one_that_was_saved(name, tmp_path):
    network = NETWORKS[name]()
    network.save(tmp_path / "network.npz")
    again = Network.load(tmp_path / "network.npz")
    for sampled in (False, True):
        np.testing.assert_array_equal(actions(again, sampled=sampled), actions(network, sampled=sampled))


def test_weights_of_8_bits_are_those_of_torch():
    """Where they are above the least normal number of 16 bits; below it they have more bits than torch's."""
    rng = np.random.default_rng(1)
    sizes = np.exp2(rng.uniform(-22, 15, (300, 200))) * rng.choice((-1, 1), (300, 200))
    layer = Layer("dense", (0,), arrays={"weight": sizes.astype(np.float32), "bias": sizes[0].astype(np.float32)})
    network = Network((300,), (START, layer), mean=1, log_std=1)
    found = network.in_float8().layers[1].arrays
    halves = network.in_float16().layers[1].arrays
    np.testing.assert_array_equal(found["bias"], halves["bias"])
    of_torch = torch.from_numpy(halves["weight"]).to(torch.float8_e5m2).float().numpy()
    normal = np.abs(halves["weight"]) >= 2.0**-14
    assert 0.5 < normal.mean() < 0.9
    np.testing.assert_array_equal(found["weight"][normal], of_torch[normal])
    assert (np.abs(found["weight"] - halves["weight"]) <= np.abs(halves["weight"]) / 8).all()


@pytest.mark.parametrize(
    ("layers", "message"),
    [
        ([], "a network must have layers, and has none"),
        ([dense(7, 2)], "the first layer of a network, and no other, must be of the kind 'observation'"),
        ([START, START], "the first layer of a network, and no other"),
        ([START, dense(8, 2)], r"layer 1 \(dense\): weights \[8, 2\] and biases \[2\] do not fit 7 inputs"),
        ([START, dense(7, 2, 1)], r"layer 1 \(dense\) reads layers \[1\], which do not all come before it"),
        ([START, Layer("dens", (0,))], "there is no kind of layer 'dens'. Did you mean 'dense'?"),
        ([START, Layer("dense", (0,))], r"layer 1 \(dense\): its weights are \[\] and not \['bias', 'weight'\]"),
        ([START, Layer("add", (0,))], "it must read 2 layers, not 1"),
        ([START, dense(7, 2), Layer("add", (0, 1))], "its inputs have shapes 7 and 2"),
        ([START, Layer("movements", (0,), {"factor": np.inf})], "its factor must be a float, not inf"),
        ([START, Layer("dense", (0,), {}, {"weight": array(7, 2), "bias": array(2) * np.nan})], "'bias' must be float32"),
        ([Layer("observation", options={"scale": 1.0, "stack": 3})], "observations of 7 channels are no stack of 3"),
        ([START, Layer("layer_norm", (0,), {"epsilon": 0.1}, {"weight": array(7), "bias": array(6)})], "must be 7 numbers"),
        ([START, Layer("max_pool", (0,), {"kernel": 2, "stride": 1, "padding": 0})], "window of 2 pixels is larger"),
        ([START, Layer("max_pool", (0,), {"kernel": 2, "stride": 0, "padding": 0})], "stride 0 and padding 0 is not"),
        ([START, Layer("soft_argmax", (0,), {}, {"places": array(3, 2)})], r"its places must be \[1, 2\], not \[3, 2\]"),
        (
            [START, Layer("gru", (0,), {}, {"weight_input": array(7, 8), "bias_input": array(8), "weight_memory": array(2, 6),
                                            "bias_memory": array(6)})],
            "a gru of width 2 has 6 gates, not 8 and 6",
        ),
        ([START, dense(7, 2**23)], "more than 4,194,304 numbers"),
    ],
)  # fmt: skip
def test_layers_that_do_not_fit_are_refused_by_name(layers, message):
    with pytest.raises(SegarError, match=message):
        Network(VECTORS, tuple(layers), len(layers) - 1, len(layers) - 1)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mean": 5}, "mean must be the number of a layer that gives a vector, not 5"),
        ({"mean": 0}, "mean has 7 components, and log_std 2"),
        ({"log_std_range": (2.0, 1.0)}, "log_std_range must be two finite numbers in their order"),
        ({"action_low": (0.0,)}, r"action_low must be 2 finite numbers, not \[0.0\]"),
        ({"observation_shape": (7, 7)}, r"vectors \[d\] or frames \[height, width, depth\], not \[7, 7\]"),
    ],
)
def test_a_network_that_is_none_is_refused(changes, message):
    fine = {"observation_shape": VECTORS, "layers": (START, dense(7, 2)), "mean": 1, "log_std": 1}
    assert Network(**fine).actions == 2
    with pytest.raises(SegarError, match=message):
        Network(**{**fine, **changes})


def test_one_layer_remembers_at_most():
    one = Builder()
    for _ in range(2):
        one.add("gru", weight_input=(7, 21), bias_input=(21,), weight_memory=(7, 21), bias_memory=(21,))
    with pytest.raises(SegarError, match="one layer with a memory at most"):
        one.network(VECTORS, 7)


def rewritten(path, change):
    """Writes the file again with another description."""
    with np.load(path) as archive:
        arrays = dict(archive)
    described = json.loads(arrays["metadata"].tobytes())
    change(described, arrays)
    arrays["metadata"] = np.frombuffer(json.dumps(described).encode(), np.uint8)
    with open(path, "wb") as file:
        np.savez_compressed(file, **arrays)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d, a: d.update(format_version=2), "written by a newer SEGAR"),
        (lambda d, a: d.update(format="segar-levels"), "is not a network file"),
        (lambda d, a: d.pop("mean"), "'mean' is absent"),
        (lambda d, a: d["layers"][1].update(kind="os.system"), "there is no kind of layer 'os.system'"),
        (lambda d, a: d["layers"][1].update(reads=[9]), r"reads layers \[9\]"),
        (lambda d, a: a.update({"1/weight": a["1/weight"][:-1]}), r"layer 1 \(dense\): .* do not fit 7 inputs"),
        (lambda d, a: a.update({"1/weight": a["1/weight"].astype(float)}), "'1/weight' must be float32"),
        (lambda d, a: a.pop("1/bias"), "it has no array '1/bias'"),
        (lambda d, a: a.update({"1/bias": a["1/bias"] * np.nan}), "'bias' must be float32 with 1 axes and finite"),
        (lambda d, a: d.update(observation_shape=[2**40]), "observations must be vectors"),
    ],
)
def test_a_file_that_was_changed_is_refused_with_what_is_wrong(change, message, tmp_path):
    path = tmp_path / "network.npz"
    NETWORKS["mlp"]().save(path)
    rewritten(path, change)
    with pytest.raises(SegarError, match=message) as raised:
        Network.load(path)
    assert str(path) in str(raised.value)


def test_half_a_file_is_refused(tmp_path):
    path = tmp_path / "network.npz"
    NETWORKS["mlp"]().save(path)
    path.write_bytes(path.read_bytes()[:-200])
    with pytest.raises(SegarError, match="is not a network file, or only part of one"):
        Network.load(path)
