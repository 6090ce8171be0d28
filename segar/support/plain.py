"""The switch between code that is fast by a trick and its plain twin, which gives the same bits."""

import os
from functools import cache


@cache
def is_plain() -> bool:
    """Whether the process runs plain twins: the environment variable ``SEGAR_PLAIN`` is set to anything but 0.

    The variable is read once, on the first call; a later change has no effect in the process.
    """
    return os.environ.get("SEGAR_PLAIN", "0") not in ("", "0")
