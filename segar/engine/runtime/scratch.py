"""Scratch of one call on the stack, for kernels that are compiled for other targets and cannot be given any."""

# pyright: reportCallIssue=false, reportArgumentType=false
import math

from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array

_options = {"nogil": True, "error_model": "numpy", "_nrt": False}


@intrinsic(prefer_literal=True)
def local_floats(_context, rows, columns):
    """An array float64 ``(rows, columns)`` that is not filled and lives as long as the call; both are constants."""
    return types.Array(types.float64, 2, "C")(rows, columns), _on_stack


@intrinsic(prefer_literal=True)
def local_integers(_context, length):
    """An array int64 ``(length,)`` that is not filled and lives as long as the call; the length is a constant."""
    return types.Array(types.int64, 1, "C")(length), _on_stack


@intrinsic(prefer_literal=True)
def local_singles(_context, length):
    """An array float32 ``(length,)`` that is not filled and lives as long as the call; the length is a constant."""
    return types.Array(types.float32, 1, "C")(length), _on_stack


@njit(**_options)
def copy_numbers(target, source):
    """Copy a state ``(entities, columns)``."""
    for i in range(target.shape[0]):
        for c in range(target.shape[1]):
            target[i, c] = source[i, c]


@intrinsic
def array_at(_context, address, shape):
    """The array at an address, of a shape that is a tuple of integers; the last axis is the fastest in memory."""
    return types.Array(address.dtype, len(shape), "C")(address, shape), _at_address


@intrinsic
def array_by_number_at(_context, address, shape):
    """The array at an address; the first axis is the fastest in memory."""
    return types.Array(address.dtype, len(shape), "F")(address, shape), _at_address


def _at_address(context, builder, signature, args):
    sizes = [
        context.cast(builder, builder.extract_value(args[1], k), kind, types.intp)
        for k, kind in enumerate(signature.args[1])
    ]
    return _array(context, builder, signature.return_type, args[0], sizes)


def _on_stack(context, builder, signature, _args):
    sizes, kind = [size.literal_value for size in signature.args], signature.return_type
    with builder.goto_entry_block():  # cgutils.alloca_once would fill it, for which LLVM takes minutes
        memory = builder.alloca(ir.ArrayType(context.get_data_type(kind.dtype), max(math.prod(sizes), 1)))
    return _array(context, builder, kind, memory, [context.get_constant(types.intp, size) for size in sizes])


def _array(context, builder, kind, memory, sizes):
    """An array of numba's type ``kind`` over memory, without gaps."""
    array = make_array(kind)(context, builder)
    width = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [width]
    for size in sizes[:0:-1] if kind.layout == "C" else sizes[:-1]:
        strides.append(builder.mul(strides[-1], size))
    memory = builder.bitcast(memory, array.data.type)
    populate_array(array, memory, sizes, strides[::-1] if kind.layout == "C" else strides, width, meminfo=None)
    return array._getvalue()
