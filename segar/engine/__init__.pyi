from .batch import State as State, StepResult as StepResult
from .compiler.kernel import KernelSource as KernelSource, generate as generate
from .compiler.kernel_cache import is_compiled as is_compiled, kernel_path as kernel_path
from .not_finite import numbers_not_finite as numbers_not_finite
from .runtime.gather import Reads as Reads, gather as gather
from .simulator import Simulator
from .targets.build import TARGETS as TARGETS, TargetKernel as TargetKernel, build_kernel as build_kernel
from .targets.entry import (
    BY_NUMBER as BY_NUMBER,
    Argument as Argument,
    Call as Call,
    Entry as Entry,
    Given as Given,
    Rows as Rows,
    Scratch as Scratch,
    call_of as call_of,
    for_threads as for_threads,
    with_array as with_array,
    with_distinct_names as with_distinct_names,
)
from .targets.step import described_world as described_world, step_entry as step_entry

__all__ = ["Simulator"]
