"""Policies in ONNX files: they play as the model computes, forget where episodes begin, and a file that is none is named."""

from types import SimpleNamespace

import numpy as np
import onnx
import pytest
from onnx import TensorProto
from onnx.external_data_helper import set_external_data

import segar
from segar.errors import SegarError
from segar.policies import OnnxPolicy
from tests.onnx_models import linear


@pytest.mark.parametrize(("shape", "dtype"), [((5,), np.float32), ((4, 4, 3), np.uint8)])
def test_actions_are_what_the_model_computes_for_any_number_of_environments(tmp_path, shape, dtype):
    kind = TensorProto.FLOAT if dtype == np.float32 else TensorProto.UINT8
    weight, bias = linear(tmp_path / "p.onnx", shape, dtype=kind)
    policy, rng = OnnxPolicy(tmp_path / "p.onnx"), np.random.default_rng(1)
    for n in (1, 7):
        seen = rng.integers(0, 3, (n, *shape)).astype(dtype)
        expected = np.clip(seen.reshape(n, -1).astype(np.float32) @ weight + bias, -1, 1)
        np.testing.assert_allclose(policy(seen), expected, atol=1e-5)


def test_a_memory_goes_on_until_episodes_begin(tmp_path):
    _, bias = linear(tmp_path / "p.onnx", (3,), memory=4)
    policy, seen = OnnxPolicy(tmp_path / "p.onnx"), np.zeros((2, 3), np.float32)
    for _ in range(2):
        policy.begin(SimpleNamespace(num_envs=2))
        for step in range(3):
            np.testing.assert_allclose(policy(seen), np.tile(np.clip(bias + step, -1, 1), (2, 1)), atol=1e-6)
    with pytest.raises(SegarError, match="3 environments"):
        policy(np.zeros((3, 3), np.float32))
    policy = OnnxPolicy(tmp_path / "p.onnx")
    with pytest.raises(SegarError, match=r"p\.onnx: it has a memory of 0 environments, .* call begin\(env\)"):
        policy(seen[:1])
    policy.begin(SimpleNamespace(num_envs=1))
    with pytest.raises(SegarError, match="a memory of 1 environments, and cannot be played with 2 environments"):
        policy(seen)


def test_it_plays_where_policies_do(tmp_path):
    levels = segar.family("empty-easy").sample(3, seed=0, split="test")
    linear(tmp_path / "p.onnx", segar.envs.VectorEnv(levels, 1, seed=0).single_observation_space.shape)
    assert len(segar.evaluate_policy(OnnxPolicy(tmp_path / "p.onnx"), levels, levels).test.episodes) >= 3


def test_what_is_no_such_model_is_named(tmp_path):
    def refused(named, **changes):
        linear(tmp_path / "p.onnx", **{"shape": (3,), **changes})
        with pytest.raises(SegarError, match=named):
            OnnxPolicy(tmp_path / "p.onnx")

    refused("'observation' is .*dynamic", rows=4)
    refused("'observation' is tensor.double", dtype=TensorProto.DOUBLE)
    refused("'observation' is .* of shape ..n..", shape=())
    refused("'memory' is .* no other one of an input", memory="w")
    (tmp_path / "p.onnx").write_bytes(b"\x08\x01 nothing of the kind")
    with pytest.raises(SegarError, match=r"p\.onnx is no ONNX model"):
        OnnxPolicy(tmp_path / "p.onnx")
    with pytest.raises(SegarError, match="there is no ONNX file"):
        OnnxPolicy(tmp_path / "q.onnx")
    linear(tmp_path / "p.onnx", (3,))
    for wrong in (np.zeros((1, 4), np.float32), np.zeros((1, 3)), [[0.0] * 3]):
        with pytest.raises(SegarError, match=r"p\.onnx: it reads observations float32"):
            OnnxPolicy(tmp_path / "p.onnx")(wrong)


@pytest.mark.parametrize("place", ["weights", "../{folder}/weights", "{path}/weights"])
def test_a_model_reads_no_other_file_not_even_one_in_the_working_folder(tmp_path, monkeypatch, place):
    linear(tmp_path / "p.onnx", (300,))
    model = onnx.load(tmp_path / "p.onnx")
    (weight,) = (one for one in model.graph.initializer if one.name == "weight")
    (tmp_path / "weights").write_bytes(weight.raw_data)
    set_external_data(weight, place.format(folder=tmp_path.name, path=tmp_path))
    weight.ClearField("raw_data")
    (tmp_path / "p.onnx").write_bytes(model.SerializeToString())
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SegarError, match=r"p\.onnx is no ONNX model"):
        OnnxPolicy(tmp_path / "p.onnx")


def test_a_small_model_does_not_take_all_memory(tmp_path):
    linear(tmp_path / "large.onnx", (9,))
    model = onnx.load(tmp_path / "large.onnx")
    model.graph.initializer.append(onnx.numpy_helper.from_array(np.array([2**31]), "number"))
    model.graph.node.insert(0, onnx.helper.make_node("ConstantOfShape", ["number"], ["many"]))
    model.graph.node.insert(1, onnx.helper.make_node("ReduceSum", ["many"], ["none"], keepdims=0))
    model.graph.node[4].input[2] = "none"
    onnx.save(model, tmp_path / "large.onnx")
    with pytest.raises(SegarError, match=r"large.onnx: it cannot be played with 3 environments"):
        OnnxPolicy(tmp_path / "large.onnx")(np.zeros((3, 9), np.float32))


@pytest.mark.parametrize(
    "word", ["Loop", "RandomNormal", "RandomUniform", "RandomNormalLike", "Multinomial", "Bernoulli"]
)
def test_a_model_that_may_never_end_or_draws_is_refused(tmp_path, word):
    linear(tmp_path / "other.onnx", (3,))
    model = onnx.load(tmp_path / "other.onnx")
    model.graph.node.append(onnx.helper.make_node(word, ["observation"], ["late"]))
    onnx.save(model, tmp_path / "other.onnx")
    with pytest.raises(
        SegarError, match=rf"other\.onnx: it has a {word.removesuffix('Like')}, or .*; .* so (write|export)"
    ):
        OnnxPolicy(tmp_path / "other.onnx")
