"""The device on which networks compute."""

import torch

from experiments.settings import ConfigError


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
