"""The sheet: how a kernel finds the table that it writes observations to, by the table's address in memory.

Each step has a new table, and threads that wait inside a kernel hold the arguments of an earlier call. They therefore
hold a sheet, int64 ``(1,)``, in which the owner of the call writes the address of the present table.
"""

# pyright: reportCallIssue=false
import numpy as np
from numba import types
from numba.extending import intrinsic
from numba.np.arrayobj import make_array, populate_array


def make_sheet() -> np.ndarray:
    """A sheet without a table."""
    return np.zeros(1, np.int64)


def sheet_with(sheet: np.ndarray, table: np.ndarray) -> np.ndarray:
    """The same sheet, which now leads to the table: float32 ``(num_envs, ...)``, contiguous, kept by the caller."""
    sheet[0] = table.ctypes.data
    return sheet


@intrinsic
def table_on(_context, sheet, rows, columns):
    """The table that the sheet leads to, float32 ``(rows, columns)``, rows one after the other."""
    kind = types.Array(types.float32, 2, "C")

    def generate(context, builder, signature, args):
        address = builder.load(make_array(signature.args[0])(context, builder, args[0]).data)
        rows, columns = (
            context.cast(builder, a, t, types.intp) for a, t in zip(args[1:], signature.args[1:], strict=True)
        )
        table = make_array(kind)(context, builder)
        pointer = builder.inttoptr(address, table.data.type)
        size = context.get_constant(types.intp, 4)
        strides = [builder.mul(columns, size), size]
        populate_array(table, pointer, [rows, columns], strides, size, meminfo=None)
        return table._getvalue()

    return kind(sheet, rows, columns), generate
