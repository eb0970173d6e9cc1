"""Arrays that a table of their addresses lends to a kernel.

Every array that Python gives to a kernel costs 0.1 to 0.2 us a call: to read what it is, and to count references to it
wherever it goes. What is called time and again with the same arrays takes a table of their addresses instead, made
once. Whoever makes it keeps the arrays, and makes another one where an array is exchanged.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numba import types
from numba.core import config
from numba.np import numpy_support
from numba.np.arrayobj import make_array, populate_array

from assembly._written import written_by

__all__ = ["lent_array", "lent_table"]

# Columns of a table: the address of an array, and as many sides as it may have.
SIDES = 3


def lent_table(arrays: Sequence[Any]) -> Any:
    """The table (n, 4) of arrays that are contiguous: a row for each, its address and its sides.

    Whoever takes it keeps the arrays as well.
    """
    table = np.zeros((len(arrays), 1 + SIDES), dtype=np.int64)
    for row, array in zip(table, arrays, strict=True):
        assert array.flags.c_contiguous
        row[0], row[1 : 1 + array.ndim] = array.ctypes.data, array.shape
    return table


def lent_array(item: str, axes: int) -> Callable[[Any, int], Any]:
    """A function (table, row): the array of doubles ("f8") or integers ("i8") in a row of a table of lent arrays."""
    kind: Any = ctypes.c_double if item == "f8" else ctypes.c_int64

    def lent(table: Any, row: int) -> Any:
        address, *sides = table[row].tolist()
        shape = tuple(sides[:axes])
        if not math.prod(shape):
            return np.empty(shape, item)
        return np.ctypeslib.as_array(ctypes.cast(address, ctypes.POINTER(kind)), shape)

    if not config.DISABLE_JIT:
        array_type = types.Array(numpy_support.from_dtype(np.dtype(item)), axes, "C")

        def written(_typing: Any, table: Any, row: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                rows = make_array(signature.args[0])(context, builder, values[0])
                first = builder.mul(values[1], context.get_constant(types.intp, 1 + SIDES))
                places = [builder.add(first, context.get_constant(types.intp, k)) for k in range(1 + axes)]
                numbers = [builder.load(builder.gep(rows.data, [place])) for place in places]
                array = make_array(array_type)(context, builder)
                data = context.get_data_type(array_type.dtype)
                size = context.get_constant(types.intp, context.get_abi_sizeof(data))
                strides = [size]
                for side in numbers[:1:-1]:
                    strides.insert(0, builder.mul(strides[0], side))
                populate_array(
                    array,
                    data=builder.inttoptr(numbers[0], data.as_pointer()),
                    shape=numbers[1:],
                    strides=strides,
                    itemsize=size,
                    # Nobody counts references to it.
                    meminfo=None,
                )
                return array._getvalue()

            return array_type(table, types.intp), generate

        written_by(lent, written)

    return lent
