"""The device on which networks compute, and what decides the last bits of what they compute."""

import platform
from typing import Any

import torch

from segar.envs import VectorEnv
from segar.experiments.commands.kernels import limits_in_force
from segar.experiments.settings import ConfigError, RunConfig


def usable_device(name: str) -> torch.device:
    """The device of this name, e.g. ``cpu``, ``cuda``, ``cuda:1``; raises :class:`ConfigError` where it cannot be used."""
    try:
        device = torch.device(name)
        torch.empty(0, device=device)
    except (RuntimeError, AssertionError, NotImplementedError) as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0]
        raise ConfigError(
            f"algorithm.device: '{name}' cannot be used here ({reason}); algorithm.device=cpu computes on the processor"
        ) from error
    return device


def require_one_device(device: torch.device, env: VectorEnv) -> None:
    """Raises :class:`ConfigError` where a policy is on another device than environments that run on a GPU."""
    if env.runs_on_gpu and (device.type != env.device.type or (device.index or 0) != (env.device.index or 0)):
        raise ConfigError(
            f"algorithm.device: the policy is on {device} and the environments on {env.device}; take one of them"
        )


def arithmetic(config: RunConfig) -> dict[str, Any]:
    """What decides the last bits of a run with these settings in this process, as plain data for ``versions.json``.

    ``precision`` is the one that is set, or the one that ``auto`` means on this machine.

    ``instruction_set`` is that of torch's own kernels; ``limits`` are the variables by which the libraries were held to other
    kernels than those for this processor.
    """
    algorithm = config.computed_here().algorithm
    return {
        "determinism": config.determinism,
        "device": getattr(algorithm, "device", "cpu"),
        "precision": getattr(algorithm, "precision", "fp32"),
        "threads": torch.get_num_threads(),
        "instruction_set": torch.backends.cpu.get_cpu_capability(),
        "limits": limits_in_force(),
        "processor": torch.cpu.get_capabilities().get("cpu_name", platform.machine()),
    }
