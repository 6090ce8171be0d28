"""What the processor of this machine can do, asked without torch, because settings are named before torch is imported."""

import platform
from functools import cache

LEAST = ("avx2", "fma", "f16c", "bmi2")  # features of the x86-64 processors that determinism=portable computes for


@cache
def multiplies_bf16(device: str) -> bool:
    """Whether a kind of device, 'cpu' or 'cuda', multiplies bfloat16 in hardware."""
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
