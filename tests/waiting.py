"""Waiting for what another thread or process does: for a condition, since a busy machine takes any time."""

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")

PATIENCE = 900.0  # [s] far more than any step of a test takes beside busy processes


def until(found: Callable[[], Found], pause: float = 0.02) -> Found:
    """What ``found()`` returns once it is true."""
    end = time.monotonic() + PATIENCE
    while not (now := found()):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(pause)
    return now
