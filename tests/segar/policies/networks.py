"""Small networks with random weights that have layers of every kind; and the bits of their actions, printed as JSON."""

import hashlib
import json
import sys
from types import SimpleNamespace

import numpy as np

from segar.policies import Layer, Network, NetworkPolicy

FRAMES, VECTORS = (15, 13, 6), (7,)


class Builder:
    """Appends layers with random weights."""

    def __init__(self, scale: float = 1.0, stack: int = 1) -> None:
        self.rng = np.random.default_rng(3)
        self.layers = [Layer("observation", options={"scale": scale, "stack": stack})]

    def add(self, kind: str, *reads: int, options=None, **shapes: tuple[int, ...]) -> int:
        reads = reads or (len(self.layers) - 1,)
        size = max(int(np.prod(shape[:-1])) for shape in (*shapes.values(), (1,)))
        arrays = {n: (self.rng.normal(size=s) / np.sqrt(size)).astype(np.float32) for n, s in shapes.items()}
        self.layers.append(Layer(kind, reads, options or {}, arrays))
        return len(self.layers) - 1

    def dense(self, inputs: int, outputs: int, *reads: int) -> int:
        return self.add("dense", *reads, weight=(inputs, outputs), bias=(outputs,))

    def convolution(self, kernel: int, inputs: int, outputs: int, stride: int = 1, padding: int = 0) -> int:
        options = {"stride": stride, "padding": padding}
        return self.add("convolution", options=options, weight=(kernel, kernel, inputs, outputs), bias=(outputs,))

    def network(self, shape: tuple[int, ...], width: int, critic: bool = True, **more) -> Network:
        hidden = len(self.layers) - 1
        mean, log_std = self.dense(width, 2, hidden), self.dense(width, 2, hidden)
        value = self.dense(width, 1, hidden) if critic else None
        return Network(shape, tuple(self.layers), mean, log_std, (-3.0, 2.0), value=value, **more)


def dense() -> Builder:
    one = Builder()
    one.dense(7, 33)
    one.add("tanh")
    one.dense(33, 18)
    one.add("layer_norm", options={"epsilon": 1e-5}, weight=(18,), bias=(18,))
    return one


RANGE = {"action_low": (-2.0, 0.0), "action_high": (1.0, 3.0)}


def mlp() -> Network:
    return dense().network(VECTORS, 18, **RANGE)


def residual() -> Network:
    one = Builder(scale=1 / 255)
    one.convolution(3, 6, 5, padding=1)
    pooled = one.add("max_pool", options={"kernel": 3, "stride": 2, "padding": 1})
    one.add("relu")
    one.convolution(3, 5, 5, padding=1)
    one.add("add", pooled, len(one.layers) - 1)
    one.convolution(4, 5, 17, stride=2)
    one.add("flatten")
    one.dense(3 * 2 * 17, 20)
    return one.network(FRAMES, 20)


def points() -> Network:
    one = Builder(scale=1 / 255, stack=2)
    one.convolution(4, 3, 17, stride=2, padding=1)
    convolved = one.add("relu")
    one.add("add", convolved, one.add("max_pool", options={"kernel": 3, "stride": 1, "padding": 1}))
    one.add("soft_argmax", places=(7 * 6, 2))
    one.add("movements", options={"factor": 5.0})
    return one.network(FRAMES, 17 * 2 * 2, critic=False)


def core(kind: str, gates: int) -> Network:
    one, width = dense(), 9
    one.add(
        kind, weight_input=(18, gates * width), bias_input=(gates * width,), weight_memory=(width, gates * width),
        bias_memory=(gates * width,),
    )  # fmt: skip
    return one.network(VECTORS, width, **RANGE)


NETWORKS = {
    "mlp": mlp, "residual": residual, "points": points, "gru": lambda: core("gru", 3), "lstm": lambda: core("lstm", 4),
}  # fmt: skip


KEYS = np.random.default_rng(5).integers(0, 2**63, 4000).astype(np.uint64)


def environments(keys: np.ndarray, network: Network, unit_actions: bool = False) -> SimpleNamespace:
    """What a policy reads of environments in which episodes of these keys start."""
    low, high = (np.array(bounds, np.float32) for bounds in (network.action_low, network.action_high))
    low, high = (-np.ones_like(low), np.ones_like(high)) if unit_actions else (low, high)
    space = SimpleNamespace(shape=low.shape, low=low, high=high)
    snapshot = SimpleNamespace(state=SimpleNamespace(key=keys))
    return SimpleNamespace(num_envs=len(keys), single_action_space=space, state=lambda: snapshot)


def observations(network: Network, n: int, step: int) -> np.ndarray:
    rng = np.random.default_rng(step)
    if network.dtype == np.uint8:
        return rng.integers(0, 256, (n, *network.observation_shape), dtype=np.uint8)
    return rng.normal(size=(n, *network.observation_shape)).astype(np.float32)


def actions(network: Network, rows: slice = slice(0, 70), **options) -> np.ndarray:
    """Actions ``[step, environment, component]`` of three steps of some of 70 environments."""
    policy = NetworkPolicy(network, **options)
    policy.begin(environments(KEYS[rows], network, options.get("unit_actions", False)))
    return np.stack([policy(observations(network, 70, step)[rows]) for step in range(3)])


def main() -> None:
    """Print hashes of actions, and what the compiled functions call and how, as JSON."""
    from segar.policies.kernels import act, forward

    found = {}
    for name, make in NETWORKS.items():
        for sampled in (False, True):
            found[f"{name} {sampled}"] = hashlib.sha256(actions(make(), sampled=sampled).tobytes()).hexdigest()
    text = "\n".join(text for function in (forward, act) for text in function.inspect_llvm().values())
    declared = {line.split("@")[1].split("(")[0] for line in text.splitlines() if line.startswith("declare")}
    arithmetic = {word for line in text.splitlines() for word in line.split() if " = f" in line and word in FLAGS}
    vectors = sum(" x float>" in line and " = fmul" in line for line in text.splitlines())
    json.dump(
        {"hashes": found, "declared": sorted(declared), "flags": sorted(arithmetic), "vectors": vectors}, sys.stdout
    )


FLAGS = {"fast", "reassoc", "contract", "nnan", "ninf", "nsz", "arcp", "afn"}

if __name__ == "__main__":
    main()
