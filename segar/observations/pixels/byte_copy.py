"""Copying and clearing bytes within compiled kernels by the C library's memcpy and memset, and by loops, their plain twins.

Most spans that are drawn are 5 to 30 bytes long, and no two alike. The processor mispredicts the end of a loop over bytes,
which takes longer than the copying.
"""

from typing import Any

from numba import njit
from numba.core import cgutils, types
from numba.extending import intrinsic

from segar.observations.kernel_options import KERNEL_OPTIONS
from segar.support import is_plain


@njit(**KERNEL_OPTIONS)
def plain_copy_bytes(to, to_byte, source, source_byte, count):
    """The plain twin of :func:`_copy_bytes`."""
    target, origin = to.reshape(-1), source.reshape(-1)
    for k in range(count):
        target[to_byte + k] = origin[source_byte + k]


@njit(**KERNEL_OPTIONS)
def plain_clear_bytes(to, to_byte, count):
    """The plain twin of :func:`_clear_bytes`."""
    target = to.reshape(-1)
    for k in range(count):
        target[to_byte + k] = 0


def _copy_bytes(typing_context: Any, to: Any, to_byte: Any, source: Any, source_byte: Any, count: Any) -> Any:
    """``to[to_byte : to_byte + count] = source[source_byte : source_byte + count]``, counted in bytes from the starts of
    two contiguous uint8 arrays of any shape. Nothing is checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        there = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        here = _pointer(context, builder, signature.args[2], arguments[2], arguments[3])
        cgutils.raw_memcpy(builder, there, here, arguments[4], 1)
        return context.get_dummy_value()

    return types.void(to, types.intp, source, types.intp, types.intp), generate


def _clear_bytes(typing_context: Any, to: Any, to_byte: Any, count: Any) -> Any:
    """``to[to_byte : to_byte + count] = 0``, counted as in :func:`_copy_bytes`."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        there = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        cgutils.memset(builder, there, arguments[2], 0)
        return context.get_dummy_value()

    return types.void(to, types.intp, types.intp), generate


def _pointer(context: Any, builder: Any, kind: Any, array: Any, offset: Any) -> Any:
    """The address of a byte of an array."""
    return cgutils.pointer_add(builder, context.make_array(kind)(context, builder, array).data, offset)


copy_bytes: Any = plain_copy_bytes if is_plain() else intrinsic(_copy_bytes)
clear_bytes: Any = plain_clear_bytes if is_plain() else intrinsic(_clear_bytes)
