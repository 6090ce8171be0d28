"""The compiled engine: the compiler makes a kernel of a world, the runtime is what kernels call, the simulator steps batches."""

from segar.engine.compiler.kernel import KernelSource, generate
from segar.engine.compiler.kernel_cache import cache_folder, is_compiled, kernel_path
from segar.engine.compiler.spec import Needs, needs_of
from segar.engine.runtime.gather import Reads, gather
from segar.engine.simulator import Outcome, Simulator, State

__all__ = [
    "KernelSource",
    "Needs",
    "Outcome",
    "Reads",
    "Simulator",
    "State",
    "cache_folder",
    "gather",
    "generate",
    "is_compiled",
    "kernel_path",
    "needs_of",
]
