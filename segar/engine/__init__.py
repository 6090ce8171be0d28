"""The compiled engine: the compiler makes a kernel of a world, kernels call the runtime, the simulator steps batches."""

from segar.engine.batch import State, StepResult
from segar.engine.compiler.kernel import KernelSource, generate
from segar.engine.compiler.kernel_cache import cache_folder, is_compiled, kernel_path, private_cache_folder
from segar.engine.not_finite import numbers_not_finite
from segar.engine.runtime import device, device_contacts
from segar.engine.runtime.gather import Reads, gather
from segar.engine.simulator import Simulator

__all__ = [
    "KernelSource", "Reads", "Simulator", "State", "StepResult", "cache_folder", "gather", "generate", "is_compiled",
    "kernel_path", "numbers_not_finite", "private_cache_folder",
]  # fmt: skip
