"""Kernels for other targets: the same bits as natively, in a WebAssembly runtime and as object files that a linker loads."""

import os
import re
import shutil
from typing import Any

import numpy as np
import pytest

import segar
from segar import Ball, Charge, ConflictError, GoalTile, GolfBall, Position, RuleError, SegarError, families
from segar.engine import TARGETS, Given, Rows, Scratch, Simulator, TargetKernel, build_kernel, call_of
from segar.engine.compiler.kernel import CONFLICT
from segar.engine.targets import build, numba_ir
from segar.engine.targets.build import COMPILED
from segar.engine.targets.wasm_linker import leb, link, padded, signed_leb
from segar.envs import VectorEnv, build_environment
from segar.levels import TASK_LEVELS
from segar.observations import OneOf, Stack
from tests.places import ROOT
from tests.segar.engine.random_rules import mixed_levels, worlds_of_random_rules
from tests.segar.engine.targets.functions import doubled, foreign
from tests.segar.engine.targets.machines import MACHINES, Aarch64Machine, WasmMachine
from tests.segar.engine.targets.twin import Twin
from tests.segar.engine.test_definition import double_if_charged, halve
from tests.segar.engine.worlds import random_states

LARGEST = {"rgb": 40_000, "textures": 60_000}  # bytes of a built-in world with its frames
ENDS = 0.05  # of the environments that start anew in a step
QUICK = sorted({*MACHINES} - {"aarch64"})  # the emulated processor plays in tests of its own
SEED = 2**63 + 5  # of which every bit counts


def play(env: VectorEnv, target: str, steps: int, rng: np.random.Generator) -> Twin:
    """An environment beside its twin for so many steps, in which episodes end and start anew; all bits agree."""
    observation, _ = env.reset()
    twin = Twin(env, target)
    twin.machine.place({"episodes": np.zeros(env.num_envs, np.int64)})
    twin.start(np.arange(env.num_envs))
    low, high = env.single_action_space.low, env.single_action_space.high
    for step in range(steps):
        assert (step, twin.differences()) == (step, [])
        assert twin.observes(observation), f"observations differ in step {step}"
        actions = rng.uniform(1.2 * low, 1.2 * high, env.action_space.shape).astype(np.float32)
        observation, _, terminated, truncated, _ = env.step(actions)
        twin.step(actions)
        ended = terminated | truncated | (rng.random(env.num_envs) < ENDS)
        if ended.any():
            assert twin.differences() == []
            observation, _ = env.reset(options={"reset_mask": ended})
            twin.start(np.flatnonzero(ended))
    return twin


def environment(name: str, observation: Any, count: int = 20) -> VectorEnv:
    levels = segar.family(name).sample(count, seed=4)
    return VectorEnv(levels, count, observation=observation, seed=SEED, autoreset_mode="Disabled")


def test_a_world_plays_to_the_bit_in_wasm():
    twin = play(environment("objectsx1-hard", "rgb"), "wasm", 30, np.random.default_rng(0))
    assert (twin.machine.imports, len(twin.kernel.code) < LARGEST["rgb"]) == ([], True)


@pytest.mark.slow
@pytest.mark.parametrize("observation", ["rgb", "textures"])
@pytest.mark.parametrize("name", [*families(), *TASK_LEVELS])
def test_every_named_world_plays_to_the_bit_in_wasm_and_is_small(name, observation):
    twin = play(environment(name, observation, 100), "wasm", 60, np.random.default_rng(1))
    assert (twin.machine.imports, len(twin.kernel.code) < LARGEST[observation]) == ([], True)


@pytest.mark.slow  # `make test-aarch64` runs these alone, and lacks nothing
@pytest.mark.skipif(
    os.environ.get("SEGAR_AARCH64") != "required" and not all(map(shutil.which, Aarch64Machine.tools)),
    reason=f"needs {' and '.join(Aarch64Machine.tools)}",
)
@pytest.mark.parametrize(
    "name", ["empty-hard", "objectsx3-hard", "tilesx3-hard", "hazardtilesx3-hard", "billiards", "invisiball"]
)
def test_a_world_plays_to_the_bit_on_aarch64(name):
    play(environment(name, "rgb"), "aarch64", 200, np.random.default_rng(4))


def test_every_sub_step_agrees_without_the_task():
    """300 sub-steps of 100 levels, compared after each."""
    env = environment("objectsx1-hard", "state", 100)
    env.reset()
    twin = Twin(env, "wasm")
    state = env._episodes.now.state
    state.values[..., 6:8] *= 3  # velocities, so that much is hit
    twin.machine.place({"state_values": state.values})
    for sub_step in range(300):
        env.simulator.step(state, env.levels, 1)
        twin.machine.call(twin.calls.step, {}, twin.sizes, {"sub_steps": 1, "with_task": 0}, 100)
        assert (sub_step, twin.differences()) == (sub_step, [])
    assert state.contacts.sum() > 100


@pytest.mark.slow
def test_rules_that_contradict_each_other_are_told_as_natively():
    goal = GoalTile({Position: (0.8, 0.8)})
    levels = segar.Levels.from_entities([[GolfBall({Charge: 0.0}), goal, Ball({Charge: q})] for q in (0.0, 0.0, 1.0)])
    env = VectorEnv(levels, 3, world=segar.World([halve, double_if_charged]), seed=0, autoreset_mode="Disabled")
    env.reset(options={"levels": [0, 1, 2]})
    twin = Twin(env, "wasm")
    actions = np.zeros((3, 2), np.float32)
    twin.step(actions)
    with pytest.raises(ConflictError, match=r"^environment 2: halve .* and double_if_charged .* set Mass of 'ball'"):
        env.step(actions)
    assert twin.differences() == []
    assert not twin.machine["errors"][:2].any()
    rules = [env.simulator.source.rules[k].name for k in twin.machine["errors"][2, 3:]]
    assert (twin.machine["errors"][2, 0], rules) == (CONFLICT, ["halve", "double_if_charged"])


@pytest.mark.slow
@pytest.mark.parametrize("target", QUICK)
def test_worlds_of_random_rules_agree(target):
    levels = mixed_levels(np.random.default_rng(0))
    for seed, world in worlds_of_random_rules(20, levels):
        simulator, rng = Simulator(world, levels.layout), np.random.default_rng(seed)
        state = random_states(levels, 30, rng)
        env = VectorEnv(levels, 30, world=world, seed=0, autoreset_mode="Disabled")
        env.reset()
        env._episodes.now.state = state
        twin = Twin(env, target)
        for sub_step in range(20):
            try:
                simulator.step(state, levels, 1)
            except (ConflictError, RuleError):
                break
            twin.machine.call(twin.calls.step, {}, twin.sizes, {"sub_steps": 1, "with_task": 0}, 30)
            assert (seed, sub_step, twin.differences()) == (seed, sub_step, [])


@pytest.mark.parametrize("target", QUICK)
def test_a_call_of_one_s_own_function(target):
    call = call_of("doubled", doubled, [np.arange(5.0), Rows(), Scratch(float, 5), Given("float64", ("rows",))], {})
    kernel = build_kernel([call.entry], target, {"mine": "yes"})
    machine = MACHINES[target](kernel)
    machine.place({**call.arrays, "rows": np.array([3, 1]), "out": np.zeros(5)})
    machine.call(call.entry, {}, {"rows": 2}, {}, 2)
    assert list(machine["out"]) == [0.0, 2.0, 0.0, 6.0, 0.0]
    assert kernel.description["mine"] == "yes"


def test_a_function_that_other_targets_lack_is_named():
    call = call_of("foreign", foreign, [np.arange(5.0), Rows(), Given("float64", ("rows",))], {})
    for target in TARGETS:
        with pytest.raises(SegarError, match=r"foreign calls .*gamma, which other targets .* do not have"):
            build_kernel([call.entry], target)


def test_unknown_targets_and_observations_are_refused():
    env = environment("empty-easy", "state", 1)
    with pytest.raises(SegarError, match=r"target .*'cuda'.*native.*wasm"):
        build_environment(env, "cuda")
    composed = VectorEnv(env.levels, 1, observation=("state", Stack(OneOf(["rgb"]), 2)), seed=0)
    with pytest.raises(SegarError, match=r"the observation BoundOneOf has no compiled form for other targets"):
        build_environment(composed, "wasm")


@pytest.mark.slow
def test_what_numba_makes_is_kept_and_damage_is_mended(tmp_path, monkeypatch):
    monkeypatch.setenv("SEGAR_CACHE_DIR", str(tmp_path))
    call = call_of("doubled", doubled, [np.arange(5.0), Rows(), Scratch(float, 5), Given("float64", ("rows",))], {})
    made = build_kernel([call.entry], "wasm").code
    (kept,) = tmp_path.glob("t_*.ir")
    kept.write_bytes(kept.read_bytes()[:-1] + b"?")
    build._code.cache_clear()  # which this process keeps beside the file
    assert build_kernel([call.entry], "wasm").code == made
    monkeypatch.setattr(numba_ir.subprocess, "run", lambda *_, **__: pytest.fail("it was made again"))
    build._code.cache_clear()
    assert build_kernel([call.entry], "wasm").code == made


@pytest.mark.slow
def test_too_little_stack_ends_in_a_trap():
    import wasmtime

    call = call_of(
        "doubled", doubled, [np.arange(5.0), Rows(), Scratch(float, 50_000), Given("float64", ("rows",))], {}
    )
    kernel = build_kernel([call.entry], "wasm")
    machine = WasmMachine(kernel)
    machine.place({**call.arrays, "rows": np.array([3]), "out": np.zeros(5)})
    machine.call(call.entry, {}, {"rows": 1}, {}, 1)
    assert machine["out"][3] == 6.0
    small = WasmMachine(TargetKernel("wasm", with_stack(call, 1024), kernel.description))
    small.place({**call.arrays, "rows": np.array([3]), "out": np.zeros(5)})
    with pytest.raises(wasmtime.Trap):
        small.call(call.entry, {}, {"rows": 1}, {}, 1)


def with_stack(call, stack: int) -> bytes:
    from segar.engine.targets.wasm import wasm_module

    return wasm_module([call.entry], numba_ir.intermediate_code([call.entry]), {}, stack)


@pytest.mark.parametrize("number", [0, 1, 63, 64, 127, 128, 300, 2**20, 2**31 - 1])
def test_numbers_of_webassembly(number):
    def value(data: bytes) -> int:
        return sum((byte & 127) << 7 * k for k, byte in enumerate(data))

    assert value(leb(number)) == value(padded(number)) == number
    assert len(padded(number)) == 5
    assert value(signed_leb(number)) == number
    assert not signed_leb(number)[-1] & 64


def test_the_linker_refuses_what_it_does_not_know():
    imports = b"\2" + leb(9) + b"\1\3env\1f\0\0"
    with pytest.raises(SegarError, match="the module imports f, which a page cannot give it"):
        link(b"\0asm\1\0\0\0" + imports, ["f"], 1024)
    with pytest.raises(SegarError, match=r"version 2 of the section 'linking' only"):
        link(b"\0asm\1\0\0\0" + b"\0" + leb(9) + b"\7linking\1", ["f"], 1024)


def test_compiled_functions_stand_in_rooms_whose_source_decides_the_code():
    compiled = {
        path.relative_to(ROOT / "segar").parts[0]
        for path in (ROOT / "segar").rglob("*.py")
        if re.search(r"^@(numba\.)?(njit|cached|vectorize)\b", path.read_text(), re.MULTILINE)
    }
    others = {"metrics", "experiments"}  # the latter is a link in a checkout, and a folder in an sdist
    assert compiled <= set(COMPILED) | others, "these are not called by environments"
    assert set(COMPILED) <= {path.name for path in (ROOT / "segar").iterdir()}
