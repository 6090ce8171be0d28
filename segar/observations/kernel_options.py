"""How the kernels of observations are compiled."""

from typing import Any

from segar.support import is_plain

# The kernels allocate nothing, so numba's counting of references to arrays, which costs as much as drawing, is off. Compiled
# code is kept for other processes, but not that of plain twins: numba would load either for the other.
KERNEL_OPTIONS: dict[str, Any] = {"nogil": True, "cache": not is_plain(), "error_model": "numpy", "_nrt": False}
