"""Python Optimal Transport, loaded on first use and without the back ends that it would load."""

from __future__ import annotations

import os
from types import ModuleType

TRANSPORT_STEPS = (
    10_000_000  # of the network simplex, at most; POT's own 100 000 are too few for some 500 x 200 problems
)


def pot() -> ModuleType:
    """The library, without torch, jax, cupy and tensorflow.

    POT imports whatever of these is installed, which costs seconds; numpy is all that is used here.
    """
    for backend in ("PYTORCH", "JAX", "CUPY", "TENSORFLOW"):
        os.environ.setdefault(f"POT_BACKEND_DISABLE_{backend}", "1")
    import ot

    return ot
