"""The compiled engine: the compiler makes a kernel of a world, kernels call the runtime, the simulator steps batches."""

from segar.engine.batch import LevelArrays, State, StepResult
from segar.engine.compiler.kernel import KernelSource, generate
from segar.engine.compiler.kernel_cache import cache_folder, is_compiled, kernel_path, private_cache_folder
from segar.engine.not_finite import numbers_not_finite
from segar.engine.runtime import device, device_contacts
from segar.engine.runtime.gather import Reads, gather
from segar.engine.simulator import Simulator
from segar.engine.targets.build import TARGETS, TargetKernel, build_kernel
from segar.engine.targets.entry import (
    BY_ENTITY,
    BY_NUMBER,
    Argument,
    Call,
    Entry,
    Given,
    Rows,
    Scratch,
    call_of,
    for_threads,
    with_array,
    with_distinct_names,
)
from segar.engine.targets.step import described_world, step_entry

__all__ = [
    "BY_ENTITY", "BY_NUMBER", "TARGETS", "Argument", "Call", "Entry", "Given", "KernelSource", "LevelArrays", "Reads",
    "Rows", "Scratch", "Simulator", "State", "StepResult", "TargetKernel", "build_kernel", "cache_folder", "call_of",
    "described_world", "for_threads", "gather", "generate", "is_compiled", "kernel_path", "numbers_not_finite",
    "private_cache_folder", "step_entry", "with_array", "with_distinct_names",
]  # fmt: skip
