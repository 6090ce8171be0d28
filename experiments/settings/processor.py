"""What the processor of this machine can do, asked without torch, because settings are named before torch is imported."""

import os
import platform
from functools import cache

from segar.experiments.settings.errors import ConfigError

BFLOAT16 = "SEGAR_BFLOAT16"  # yes or no in place of what multiplies_bf16 finds out about the processor
LEAST = ("avx2", "fma", "f16c", "bmi2")  # features of the x86-64 processors that determinism=portable computes for


def multiplies_bf16(device: str) -> bool:
    """Whether a kind of device, 'cpu' or 'cuda', multiplies bfloat16 in hardware, or what ``SEGAR_BFLOAT16`` says instead.

    Raises:
        ConfigError: the variable is neither ``yes`` nor ``no``.
    """
    stated = os.environ.get(BFLOAT16)
    if stated not in (None, "yes", "no"):
        raise ConfigError(f"{BFLOAT16}: '{stated}' is neither yes nor no; without the variable, the processor is asked")
    return _has_bf16(device) if stated is None else stated == "yes"


@cache
def _has_bf16(device: str) -> bool:
    if device == "cuda":
        import torch

        return torch.cuda.is_available() and torch.cuda.is_bf16_supported(including_emulation=False)
    return bool(features().get("amx-bf16") or features().get("avx512bf16"))


def lacks_for_portable() -> list[str]:
    """The features that ``determinism=portable`` needs and this processor lacks."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return ["x86-64"]
    return [name for name in LEAST if not features().get(name)]


@cache
def features() -> dict[str, bool]:
    """The features of the processor by LLVM's names, with which numba compiles kernels."""
    from llvmlite import binding

    return dict(binding.get_host_cpu_features())
