"""Arrays carved from a block of memory that the caller owns.

An array of its own costs a kernel some hundred nanoseconds: to allocate it, to count references to it wherever it goes,
to free it. A tick of some microseconds works in thirty. Those that are carved from one block cost nothing, and do not
keep it: the block has to be a parameter of the kernel that carves, and of inlined ones that carve for it, so that it
outlives them. A block that is made there is freed before they are used; `tests/test_house.py` lets none through.
"""

from __future__ import annotations

import math
from typing import Any

from numba import types
from numba.core import cgutils, config
from numba.np.arrayobj import make_array, populate_array

from assembly._written import written_by

__all__ = ["carve", "uncounted"]


def carve(block: Any, at: int, shape: tuple[int, ...]) -> Any:
    """The array of this shape that begins at a place of a block, (n,)."""
    return block[at : at + math.prod(shape)].reshape(shape)


def uncounted(array: Any) -> Any:
    """An array that the caller of an entry holds, as one to which nobody counts references.

    The entry's own parameters are counted wherever they go: 200 times in a warm solve, 0.1 to 0.2 us of 8.
    """
    return array


if not config.DISABLE_JIT:

    def _carved(_typing: Any, block: Any, at: Any, shape: Any) -> Any:
        carved = types.Array(block.dtype, len(shape), "C")

        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            source = make_array(signature.args[0])(context, builder, values[0])
            array = make_array(carved)(context, builder)
            size = context.get_abi_sizeof(context.get_data_type(carved.dtype))
            sides = cgutils.unpack_tuple(builder, values[2])
            strides = [context.get_constant(types.intp, size)]
            for side in sides[:0:-1]:
                strides.insert(0, builder.mul(strides[0], side))
            populate_array(
                array,
                data=builder.gep(source.data, [values[1]]),
                shape=sides,
                strides=strides,
                itemsize=context.get_constant(types.intp, size),
                # Nobody counts references to it.
                meminfo=None,
            )
            return array._getvalue()

        return carved(block, types.intp, types.UniTuple(types.intp, len(shape))), generate

    def _uncounted(_typing: Any, array: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            source = make_array(signature.args[0])(context, builder, values[0])
            source.meminfo = cgutils.get_null_value(source.meminfo.type)
            source.parent = cgutils.get_null_value(source.parent.type)
            return source._getvalue()

        return array(array), generate

    written_by(carve, _carved)
    written_by(uncounted, _uncounted)
