"""Kernels for NVIDIA GPUs: their PTX, executed on this processor, gives the bits of native kernels."""

import json
from dataclasses import dataclass, field
from typing import Any
from unittest import mock

import numpy as np
import pytest

from segar import Levels, SegarError, World, families, family
from segar.engine import BY_NUMBER, Argument, Entry, Simulator, State, StepResult, build_kernel, step_entry
from segar.engine.targets.ptx import DESCRIPTION
from segar.levels.named_families import TASK_LEVELS
from segar.tasks import task_of
from tests.segar.engine.random_rules import mixed_levels, worlds_of_random_rules
from tests.segar.engine.targets.ptx_machine import PTXMachine, UnknownPTX
from tests.segar.engine.worlds import random_states

LEVELS, SUB_STEPS = 100, 300
BLOCKS, THREADS = 3, 32  # fewer threads than environments: each takes more than one


@dataclass
class Pair:
    """A simulator, and the same world's PTX on the machine, side by side in equal states."""

    simulator: Simulator
    levels: Levels
    state: State
    result: StepResult = field(init=False)
    errors: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        one = self.simulator
        self.entry = step_entry(one.world, one.layout, one.task, BY_NUMBER)
        self.machine = PTXMachine(build_kernel([self.entry], "ptx").code.decode())
        count, arrays = len(self.state.level), vars(one.arrays_of(self.levels))
        self.result, self.errors = StepResult.empty(count), np.zeros((count, 5), np.int64)
        self.sizes = {"envs": count, "levels": len(self.levels), "corners": arrays["vertex"].shape[2]}
        self.theirs: dict[str, Any] = {f"level_{name}": array for name, array in arrays.items()}
        for kind, batch in (("state", self.state), ("result", self.result)):
            self.theirs |= {f"{kind}_{name}": array.copy("F") for name, array in vars(batch).items()}
        self.theirs["errors"] = self.errors.copy()
        self.theirs["actions"] = np.zeros((count, len(one.task.action_low)), np.float32)

    def act(self, actions: np.ndarray | None, sub_steps: int) -> None:
        """A step on both sides."""

        def note(_: Simulator, errors: np.ndarray, *others: Any) -> None:
            unset = self.errors[:, 0] == 0  # kernels on a GPU keep the first
            self.errors[unset] = errors[unset]

        with mock.patch.object(Simulator, "raise_errors", note):
            self.simulator.act(self.state, self.levels, actions, self.result, sub_steps=sub_steps)
        if actions is not None:
            self.theirs["actions"][:] = actions
        numbers = {"sub_steps": sub_steps, "with_task": actions is not None}
        given = [(numbers | self.theirs)[one.name] for one in self.entry.arguments]
        sizes = [self.sizes[name] for name in self.entry.sizes]
        self.machine.launch(self.entry.name, BLOCKS, THREADS, [0, len(self.errors), *sizes, *given])

    def differences(self) -> list[str]:
        """Names of the arrays whose bits differ; of a nan, which bits it has does not count."""
        ours = {f"state_{name}": array for name, array in vars(self.state).items()} | {"errors": self.errors}
        ours |= {f"result_{name}": array for name, array in vars(self.result).items()}
        return [name for name, array in ours.items() if bits(array) != bits(self.theirs[name])]


def bits(array: np.ndarray) -> bytes:
    array = np.array(array, order="C")
    if array.dtype.kind == "f":
        array[np.isnan(array)] = np.nan
    return array.tobytes()


def assert_equal_bits(pair: Pair, rng: Any) -> None:
    """The same for SUB_STEPS sub-steps, in steps of the task and in single sub-steps."""
    task, count = pair.simulator.task, len(pair.errors)
    done = 0
    while done < SUB_STEPS:
        actions = rng.uniform(-1.2, 1.2, (count, len(task.action_low))).astype(np.float32)
        pair.act(actions, task.sub_steps)
        assert pair.differences() == [], f"after {done} sub-steps and a step"
        pair.act(None, 1)
        assert pair.differences() == [], f"after {done} sub-steps, a step and a sub-step"
        done += task.sub_steps + 1


def pair_of(levels: Levels, world: World | None = None) -> Pair:
    state = State.empty(len(levels), levels.layout)
    state.values[:], state.level[:] = levels.values, np.arange(len(levels))
    state.key[:] = np.random.default_rng(1).integers(0, 2**63, len(levels))
    return Pair(Simulator(world or levels.world or World(), levels.layout, task_of(levels)), levels, state)


@pytest.mark.slow
@pytest.mark.parametrize("name", [*families(), *TASK_LEVELS])
def test_ptx_gives_the_bits_of_the_native_kernel_in_every_family(name):
    pair = pair_of(family(name).sample(LEVELS, seed=0))
    assert_equal_bits(pair, np.random.default_rng(2))
    assert pair.result.success.dtype == bool and (pair.state.contacts.sum() > 100 or name != "objectsx3-hard")


@pytest.mark.slow
def test_ptx_gives_the_bits_of_the_native_kernel_in_worlds_of_random_rules():
    levels = mixed_levels(np.random.default_rng(0))
    for seed, world in worlds_of_random_rules(4, levels):
        rng = np.random.default_rng(seed)
        assert_equal_bits(Pair(Simulator(world, levels.layout), levels, random_states(levels, LEVELS, rng)), rng)


MADE = """
import math
import numpy as np
from numba import njit

@njit(error_model="numpy", nogil=True, _nrt=False)
def made(start, stop, factor, whole, flag, x, y):
    for e in range(start, stop):
        y[e] = {formula}
"""
MADE_ARGUMENTS = (
    *(Argument("factor", "float64"), Argument("whole", "int64"), Argument("flag", "bool")),
    *(Argument(name, "float64", ("things",)) for name in "xy"),
)


FORMULAS = (
    "math.sqrt(abs(x[e])) / factor",
    "np.floor(x[e]) + np.ceil(x[e]) * 3.0 - np.rint(x[e]) + math.trunc(x[e])",
    "np.float64(np.float32(x[e]) * np.float32(factor) + np.float32(whole))",
    "x[e] * factor + whole if flag else min(max(x[e], -0.0), 1e300)",
    "np.float64((np.int64(x[e]) * whole) >> 3) + np.int64(x[e]) % 7 + np.int64(x[e]) // 5",
    "np.float64(np.uint64(whole) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(11)) * 2.0**-53",
    "math.copysign(factor, x[e]) * (1.0 if math.isfinite(x[e]) else 2.0)",
)


def test_arithmetic_is_that_of_the_processor_and_a_kernel_says_what_it_is():
    """All formulas in one kernel, since each kernel takes seconds to compile."""
    lines = "\n        ".join(f"y[e, {k}] = {one}" for k, one in enumerate(FORMULAS))
    text = MADE.replace("y[e] = {formula}", lines)
    arguments = (*MADE_ARGUMENTS[:4], Argument("y", "float64", ("things", len(FORMULAS)), BY_NUMBER))
    code = build_kernel([Entry("made", text, arguments, "things")], "ptx").code.decode()
    said = json.loads(code.splitlines()[0].removeprefix(DESCRIPTION))
    assert said["target"] == "ptx" and said["exports"][0]["arguments"][-1][-1] == BY_NUMBER
    machine, rng = PTXMachine(code), np.random.default_rng(0)
    x = np.concatenate([rng.normal(size=50), rng.normal(size=50) * 1e6, [0.0, -0.0, 5e-324, -2.5, 3.5, 0.5]])
    scope: dict[str, Any] = {}
    exec(text, scope)
    theirs, ours = np.zeros((len(x), len(FORMULAS)), order="F"), np.zeros((len(x), len(FORMULAS)))
    for factor, whole, flag in ((0.1, 3, True), (-1e-310, -5, False)):
        scope["made"](0, len(x), factor, whole, flag, x, ours)
        machine.launch("made", 2, 16, [0, len(x), len(x), factor, whole, flag, x, theirs])
        assert bits(ours) == bits(theirs)


def test_functions_that_a_gpu_lacks_are_refused_by_name():
    formula = "np.exp(x[e]) + np.arctan2(x[e], factor)"
    with pytest.raises(SegarError, match=r"made calls (?=.*\batan2.* which other).*\bexp.* which other"):
        build_kernel([Entry("made", MADE.format(formula=formula), MADE_ARGUMENTS, "things")], "ptx")


KERNEL = """
.version 7.0
.target sm_70
.address_size 64
.visible .entry made(
	.param .u64 made_param_0
)
{
	.reg .b64 	%rd<3>;
	LINE
	ret;
}
"""


@pytest.mark.parametrize("line", ["fma.rn.f64 %rd1, %rd1, %rd1, %rd1;", "sin.approx.f64 %rd1, %rd1;", "bar.sync 0;"])
def test_the_machine_refuses_what_it_does_not_know(line):
    with pytest.raises(UnknownPTX, match="line 10"):
        PTXMachine(KERNEL.replace("LINE", line))


def test_the_machine_gives_what_was_never_written_a_pattern():
    text = KERNEL.replace(".reg", ".local .align 8 .b8 __local_depot0[16];\n.reg", 1)
    lines = "ld.param.b64 %rd1, [made_param_0]; ld.local.b64 %rd2, [__local_depot0+8]; st.global.b64 [%rd1], %rd2;"
    out = np.zeros(1, np.uint64)
    PTXMachine(text.replace("LINE", lines.replace("; ", ";\n"))).launch("made", 1, 1, [out])
    assert out[0] == 0xA5A5A5A5A5A5A5A5
