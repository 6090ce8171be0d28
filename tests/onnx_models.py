"""Small ONNX models whose outputs are known."""

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper


def linear(path, shape, actions=2, memory=0, rows="n", dtype=TensorProto.FLOAT):
    """Writes clip(W observation + b, -1, 1) as a model; with a memory, the mean of which is added, and which counts up by one.
    Returns W and b."""
    rng, numbers = np.random.default_rng(0), int(np.prod(shape))
    weight, bias = (rng.normal(size=size).astype(np.float32) for size in ((numbers, actions), (actions,)))
    arrays = {"weight": weight, "bias": bias, "low": np.float32(-1), "high": np.float32(1), "flat": np.array([0, -1])}
    nodes = [
        helper.make_node("Cast", ["observation"], ["float"], to=TensorProto.FLOAT),
        helper.make_node("Reshape", ["float", "flat"], ["row"]),
        helper.make_node("Gemm", ["row", "weight", "bias"], ["sum"]),
    ]
    inputs = [helper.make_tensor_value_info("observation", dtype, [rows, *shape])]
    outputs = [helper.make_tensor_value_info("action", TensorProto.FLOAT, [rows, actions])]
    if memory:
        arrays["one"] = np.float32(1)
        nodes += [
            helper.make_node("ReduceMean", ["memory"], ["mean"], axes=[1], keepdims=1),
            helper.make_node("Add", ["sum", "mean"], ["all"]),
            helper.make_node("Add", ["memory", "one"], ["later"]),
        ]
        inputs.append(helper.make_tensor_value_info("memory", TensorProto.FLOAT, [rows, memory]))
        outputs.append(helper.make_tensor_value_info("later", TensorProto.FLOAT, [rows, memory]))
    nodes.append(helper.make_node("Clip", ["all" if memory else "sum", "low", "high"], ["action"]))
    constants = [numpy_helper.from_array(array, name) for name, array in arrays.items()]
    graph = helper.make_graph(nodes, "policy", inputs, outputs, constants)
    onnx.save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8), path)
    return weight, bias
