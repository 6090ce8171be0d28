"""Which kernels torch's libraries choose: the fastest for this processor, or those that unlike processors have in common."""

import os
import sys

from segar.experiments.settings import ConfigError
from segar.experiments.settings.processor import BFLOAT16, lacks_for_portable

# The libraries read these once, when they compute for the first time.
PORTABLE = {
    "ATEN_CPU_CAPABILITY": "avx2",  # of torch's own kernels
    "ONEDNN_MAX_CPU_ISA": "AVX2",  # of convolutions
    # Of matrix products. On processors that Intel did not make, MKL reads AVX2 as AUTO, which is another branch there. This is
    # the only one that it takes on all.
    "MKL_CBWR": "COMPATIBLE",
}
# What a user can set to limit the kernels of the libraries that a run computes with.
LIMITS = (
    *PORTABLE, "DNNL_MAX_CPU_ISA", "ONEDNN_DEFAULT_FPMATH_MODE", "MKL_ENABLE_INSTRUCTIONS", "NUMBA_CPU_NAME",
    "NUMBA_CPU_FEATURES", "NPY_DISABLE_CPU_FEATURES", "OPENBLAS_CORETYPE", BFLOAT16,
)  # fmt: skip


def limits_in_force() -> dict[str, str]:
    """The variables of :data:`LIMITS` that are set, with their values."""
    return {name: os.environ[name] for name in LIMITS if name in os.environ}


def are_portable() -> bool:
    """Whether a run with ``determinism=portable`` chose the kernels of this process."""
    return _chosen == "portable"


def choose_kernels(determinism: str) -> None:
    """Sets the variables that ``determinism`` wants, over what they were; ``machine`` wants none.

    Call it before torch is imported. A process keeps the kernels of its first run.

    Raises:
        ConfigError: torch is imported with other kernels, or this processor has not got the portable ones.
    """
    global _chosen
    if determinism == "portable":
        if lacking := lacks_for_portable():
            raise ConfigError(
                f"determinism: portable needs a processor with {', '.join(lacking)}, which this one lacks"
            )
        if "torch" in sys.modules and _chosen != "portable" and not _FOUND:
            variables = " ".join(f"{name}={value}" for name, value in PORTABLE.items())
            raise ConfigError(
                "determinism: torch was imported before, and chooses its kernels only once. Start the run with portable in a"
                f" process of its own, or set the variables before Python starts: {variables}"
            )
        os.environ.update(PORTABLE)
    elif are_portable() and not _FOUND:
        raise ConfigError(
            "determinism: this process has portable kernels, those of an earlier run, and torch chooses its kernels only once."
            " Start the run with machine in a process of its own"
        )
    _chosen = determinism


_FOUND = all(os.environ.get(name) == value for name, value in PORTABLE.items())  # set before Python started
_chosen = ""
