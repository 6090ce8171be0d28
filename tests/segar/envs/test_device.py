"""Environments on a GPU: the same episodes as on the processor, to the bit.

A stub plays the driver, and executes the PTX; the slow tests ask a GPU, too, where there is one.
"""

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import torch
from torchrl.envs.utils import check_env_specs

import segar
from segar.engine.cuda.driver import Driver
from segar.envs import TorchRLEnv, VectorEnv, device_episodes
from segar.envs.device_episodes import GPU, STEPS_BETWEEN_CHECKS
from segar.errors import ActionError, LevelError, RuleError, SegarError
from segar.observations import OneOf, Pixels, PreviousActions, PreviousStep, Stack, StateVector
from tests.segar.engine.cuda.stub_driver import StubDriver

N = 12


A_GPU = pytest.mark.skipif(not torch.cuda.is_available(), reason="this machine has no GPU")


@pytest.fixture(params=["stub", pytest.param("GPU", marks=[pytest.mark.slow, A_GPU])])
def stub(request, monkeypatch) -> StubDriver | None:
    """A driver in whose stead the PTX machine works, on tensors of the processor; None where it is a GPU's own."""
    if request.param == "GPU":
        return None
    found = StubDriver()
    monkeypatch.setattr(device_episodes, "open_gpu", lambda device: GPU(Driver(found).device(), torch.device("cpu")))
    return found


@pytest.fixture(scope="module")
def levels() -> Any:
    return segar.family("objectsx1-hard").sample(7, seed=0)


def actions_of(seed: int, steps: int, high: float = 1.2) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-high, high, (steps, N, 2)).astype(np.float32)


def same(host: Any, device: Any) -> bool:
    """Whether both have equal bits."""
    if isinstance(host, (dict, tuple)):
        keys = host if isinstance(host, dict) else range(len(host))
        return len(host) == len(device) and all(same(host[key], device[key]) for key in keys)
    return device.dtype == torch.from_numpy(host).dtype and host.tobytes() == device.cpu().numpy().tobytes()


NOT_THERE = ("factors", "_factors")


def same_info(host: dict[str, Any], device: dict[str, Any]) -> bool:
    shared = [name for name in host if name not in (*NOT_THERE, "final_info")]
    if "final_info" in host:
        assert same_info(host["final_info"], device["final_info"])
    return all(same(host[name], device[name]) for name in shared)


def play_both(host: VectorEnv, device: VectorEnv, actions: np.ndarray) -> int:
    """Compare everything over an episode or more; returns how many episodes ended."""
    ended = 0
    for env_actions in actions:
        ours, theirs = host.step(env_actions), device.step(torch.from_numpy(env_actions))
        for a, b in zip(ours[:4], theirs[:4], strict=True):
            assert same(a, b)
        assert same_info(ours[4], theirs[4])
        ended += int((ours[2] | ours[3]).sum())
    return ended


OBSERVATIONS = {
    "state": "state",
    "rgb": "rgb",
    "textures": "textures",
    "table": StateVector(form="table", mask="dict", normalise=True),
    "grey": Pixels(32, channels="first", grey=True),
    "stack": Stack(Pixels(32), 2),
    "textures_stack4": "textures_stack4",
    "stack of a stack": Stack(Stack(Pixels(32), 2), 2),
    "several": {
        "look": (Stack("state", 3), Stack(Pixels(32), 2)),
        "past": (PreviousActions(2), Stack(PreviousActions(2), 2)),
    },
    "two sizes": (Pixels(32), Pixels(36, grey=True)),
}


@pytest.mark.parametrize(
    "name",
    [
        "state",
        "several",
        *(pytest.param(name, marks=pytest.mark.slow) for name in OBSERVATIONS if name not in ("state", "several")),
    ],
)
def test_episodes_are_those_of_the_processor(stub, levels, name):
    options: dict[str, Any] = {"observation": OBSERVATIONS[name], "seed": 3, "max_steps": 5}
    host, device = VectorEnv(levels, N, **options), VectorEnv(levels, N, device="cuda", **options)
    ours, theirs = host.reset(), device.reset()
    assert same(ours[0], theirs[0]) and same_info(ours[1], theirs[1])
    assert play_both(host, device, actions_of(0, 17)) >= 3 * N
    if stub is not None:
        launched = {name for name, *_ in stub.launches}
        assert {"check_actions", "advance_range", "count_rows", "start_episodes"} < launched
        assert len(device.single_observation_space.shape or ()) < 3 or {"draw_rows", "paint_rows"} < launched


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_trials_are_those_of_the_processor(stub, levels, mode):
    options: dict[str, Any] = {"seed": 3, "max_steps": 4, "trials": 3, "autoreset_mode": mode}
    host, device = VectorEnv(levels, N, **options), VectorEnv(levels, N, device="cuda", **options)
    assert same_info(host.reset()[1], device.reset()[1])
    play_both(host, device, actions_of(0, 10))
    chosen, mask = np.arange(N) % 7, np.arange(N) % 3 == 0
    given = {"levels": chosen, "reset_mask": mask}
    assert same_info(
        host.reset(options=given)[1], device.reset(options={**given, "reset_mask": torch.from_numpy(mask)})[1]
    )
    play_both(host, device, actions_of(1, 20))
    assert same_info(host.reset()[1], device.reset()[1])


def test_seeds_of_their_own_are_refused(stub, levels):
    host, device = VectorEnv(levels, N), VectorEnv(levels, N, device="cuda")
    host.reset(seed=[*range(N)])
    for call in (lambda: device.reset(seed=[*range(N)]), lambda: device.restore(host.state())):
        with pytest.raises(SegarError, match="on a GPU, environments cannot have seeds of their own"):
            call()


def test_what_a_gpu_does_not_remember_over_trials_is_refused(stub, levels):
    with pytest.raises(SegarError, match="the observation BoundPreviousStep has no compiled form for a GPU"):
        VectorEnv(levels, N, device="cuda", trials=2, observation=PreviousStep())


@pytest.mark.parametrize("mode", ["SameStep", "NextStep", "Disabled"])
def test_masks_levels_and_unit_actions_are_those_of_the_processor(stub, levels, mode):
    options: dict[str, Any] = {"autoreset_mode": mode, "unit_actions": True, "seed": 5, "copy": False}
    host, device = VectorEnv(levels, N, **options), VectorEnv(levels, N, device="cuda", **options)
    chosen, mask = np.arange(N) % 7, np.arange(N) % 3 == 0
    assert same(
        host.reset(options={"levels": chosen})[0], device.reset(options={"levels": torch.from_numpy(chosen)})[0]
    )
    play_both(host, device, actions_of(1, 3))
    ours, theirs = (
        host.reset(options={"reset_mask": mask}),
        device.reset(options={"reset_mask": torch.from_numpy(mask)}),
    )
    assert same(ours[0], theirs[0]) and same_info(ours[1], theirs[1])
    play_both(host, device, actions_of(2, 3))
    assert same(host.reset(seed=8)[0], device.reset(seed=8)[0])


@pytest.mark.parametrize("name", [pytest.param("rgb", marks=pytest.mark.slow), "several"])
def test_snapshots_go_from_one_to_the_other(stub, levels, name):
    observation = OBSERVATIONS[name]
    host, device = (
        VectorEnv(levels, N, seed=1, observation=observation),
        VectorEnv(levels, N, seed=2, device="cuda", observation=observation),
    )
    host.reset()
    device.reset()
    play = actions_of(3, 4)
    for one in play:
        device.step(torch.from_numpy(one))
    snapshot = device.state()
    assert snapshot.lengths.tolist() == [4] * N
    seen = host.restore(snapshot)
    assert same(seen, device._episodes.observe())
    play_both(host, device, actions_of(4, 4))
    later = host.state()
    other = VectorEnv(levels, N, device="cuda", observation=observation)
    without = replace(later, memory={})  # as of an environment that showed nothing of the past
    assert same(host.restore(without), other.restore(without))
    assert same(host.restore(later), other.restore(later))
    play_both(host, other, actions_of(5, 4))
    again = pickle.loads(pickle.dumps(other))
    play_both(host, again, actions_of(6, 2))


def test_torchrl_environments_are_those_of_the_processor(stub, levels):
    host, device = (TorchRLEnv(levels, N, seed=4, max_steps=3, **where) for where in ({}, {"device": "cuda"}))
    check_env_specs(device)
    host.set_seed(6)
    device.set_seed(6)
    ours, theirs = host.reset(), device.reset()
    for one in actions_of(8, 7):
        ours, theirs = (
            env.step(td.set("action", torch.from_numpy(one))) for env, td in ((host, ours), (device, theirs))
        )
        assert set(ours["next"].keys()) == set(theirs["next"].keys())
        assert all(torch.equal(ours["next", key], theirs["next", key].cpu()) for key in ours["next"].keys())
        ours, theirs = host.step_mdp(ours), device.step_mdp(theirs)
        if ours["done"].any():
            ours, theirs = (env.reset(td.set("_reset", td["done"])) for env, td in ((host, ours), (device, theirs)))
            assert all(torch.equal(ours[key], theirs[key].cpu()) for key in theirs.keys() & ours.keys())
    later = host.state()
    assert all(torch.equal(part, device.restore(later)[key].cpu()) for key, part in host.restore(later).items())


@pytest.mark.parametrize("name", ["state", "several"])
def test_interventions_are_those_of_the_processor(stub, levels, name):
    options: dict[str, Any] = {"seed": 1, "observation": OBSERVATIONS[name]}
    host, device = VectorEnv(levels, N, **options), VectorEnv(levels, N, device="cuda", **options)
    host.reset()
    device.reset()
    for size in (0.5, 0.2):
        assert same(host.intervene("golfball", segar.Size, size), device.intervene("golfball", segar.Size, size))
        play_both(host, device, actions_of(6, 2))
    assert same(host.intervene("golfball", segar.Mass, 3.0), device.intervene("golfball", segar.Mass, 3.0))
    play_both(host, device, actions_of(7, 2))


def test_tensors_are_the_callers_to_keep_unless_copy_is_false(stub, levels):
    kept, overwritten = (VectorEnv(levels, N, seed=1, device="cuda", copy=copy) for copy in (True, False))
    kept.reset()
    overwritten.reset()
    zero = torch.zeros(N, 2)
    assert kept.step(zero)[0].data_ptr() != (second := kept.step(zero)[0]).data_ptr() and second.shape[0] == N
    assert overwritten.step(zero)[0].data_ptr() == overwritten.step(zero)[0].data_ptr()


def test_an_action_that_is_not_finite_is_told_some_steps_later(stub, levels):
    env = VectorEnv(levels, N, seed=1, device="cuda")
    env.reset()
    actions = torch.zeros(N, 2)
    actions[4, 1] = torch.nan
    env.step(actions)
    with pytest.raises(ActionError, match=r"the action of environment 4 was not finite; .* seen up to 1 steps later"):
        env.state()
    env.reset()
    env.step(actions)
    with pytest.raises(ActionError, match="environment 4"):
        for _ in range(STEPS_BETWEEN_CHECKS):
            env.step(torch.zeros(N, 2))


@pytest.mark.slow
def test_a_state_that_is_not_finite_is_told(stub, levels):
    @segar.rule
    def burst(mass: segar.Mass) -> segar.SetFactor[segar.Mass]:
        return segar.SetFactor[segar.Mass](mass, mass * 1e200)

    env = VectorEnv(levels, N, seed=1, device="cuda", world=segar.World(rules=(*segar.DEFAULT_RULES, burst)))
    env.reset()
    for _ in range(3):
        env.step(torch.zeros(N, 2))
    with pytest.raises(RuleError, match=r"Mass of '\w+' is inf \(changed by .*burst.* seen up to 3 steps later"):
        env.state()


@pytest.mark.parametrize(
    ("actions", "said"),
    [
        (torch.zeros(N, 3), r"must be real numbers of shape \(12, 2\), not torch.float32 of shape \(12, 3\)"),
        (torch.zeros(N, 2, dtype=torch.bool), "not torch.bool"),
        ("left", r"actions must be numbers of shape \(12, 2\)"),
    ],
)
def test_wrong_actions_are_refused(stub, levels, actions, said):
    env = VectorEnv(levels, N, device="cuda")
    with pytest.raises(SegarError, match=r"call reset\(\) before step"):
        env.step(torch.zeros(N, 2))
    env.reset()
    with pytest.raises(ActionError, match=said):
        env.step(actions)


def test_wrong_masks_are_refused(stub, levels):
    env = VectorEnv(levels, N, device="cuda")
    with pytest.raises(SegarError, match="the first reset must start all environments"):
        env.reset(options={"reset_mask": torch.arange(N) > 3})
    env.reset()
    with pytest.raises(LevelError, match=r"'reset_mask' must be bool of shape \(12,\), not torch.int64"):
        env.reset(options={"reset_mask": torch.arange(N)})


def test_what_needs_the_processor_is_refused(stub, levels):
    with pytest.raises(SegarError, match="BoundOneOf has no compiled form for a GPU, which a state, 'rgb'"):
        VectorEnv(levels, N, device="cuda", observation=Stack(OneOf(["rgb"]), 2))
    with pytest.raises(SegarError, match="render_mode='rgb_array' draws on the processor: use device='cpu'"):
        VectorEnv(levels, N, device="cuda", render_mode="rgb_array")


@pytest.mark.parametrize("device", ["gpu", "mps", -7, "cuda:x"])
def test_unknown_devices_are_refused(levels, device):
    with pytest.raises(SegarError, match="device must be 'cpu', 'cuda', or 'cuda:1'"):
        VectorEnv(levels, N, device=device)


@pytest.mark.skipif(torch.backends.cuda.is_built(), reason="this torch is built with CUDA")
def test_a_torch_without_cuda_is_told(levels):
    with pytest.raises(SegarError, match=r"device='cuda' needs a torch that is built with CUDA, and this one \(.*\)"):
        VectorEnv(levels, N, device="cuda")


@pytest.mark.skipif(torch.backends.cuda.is_built(), reason="this machine may have a GPU")
def test_a_machine_without_a_driver_is_told(levels, monkeypatch):
    monkeypatch.setattr(torch.backends.cuda, "is_built", lambda: True)
    with pytest.raises(SegarError, match="no NVIDIA driver"):
        VectorEnv(levels, N, device="cuda:1")
