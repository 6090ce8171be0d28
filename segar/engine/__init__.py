"""The compiled engine: the compiler makes a kernel of a world, kernels call the runtime, the simulator steps batches."""

from segar.support import lazy_face

__getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
