"""What counts as a whole number where one is asked for."""

from typing import Any, TypeGuard

import numpy as np


def is_whole(value: Any) -> TypeGuard[int]:
    """Whether the value is an integer of Python or numpy, and no truth."""
    return isinstance(value, (int, np.integer)) and not isinstance(value, (bool, np.bool_))
