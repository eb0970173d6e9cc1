"""Records in blocks of memory: fields with names at a place of a flat array.

Tables and pools of a scene are flat arrays of integers and of doubles, so that a kernel takes one address. What stands
where is told once, by a NumPy dtype; `record_view` makes of it a function that a kernel and Python call alike, whose
result reads and writes the fields in the block itself. In a kernel it is the cast of a pointer, and costs nothing; in
Python it costs a microsecond, and `rows_of` and `place_of` serve what is done often there.

A record does not keep its block: as with `_carve.py`, the block has to outlive it.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Callable
from typing import Any

import numpy as np
from numba.core import config, types
from numba.core.errors import TypingError
from numba.np import numpy_support
from numba.np.arrayobj import make_array

from assembly._written import written_by

__all__ = ["Store", "place_of", "record_dtype", "record_view", "rows_of", "size_of"]

# What kernels read of a scene: `table`, the flat array of its integers (records of surfaces, faces, trees and rows, and
# places in the pool), and `pool`, the flat array of its doubles.
Store = namedtuple("Store", "table pool")


def record_dtype(item: str, /, **fields: int | tuple[int, ...]) -> np.dtype[Any]:
    """The dtype of a record whose fields are all integers ("i8") or all doubles ("f8").

    A field is one number (1), or an array of this length or shape.
    """
    parts = [(name, item) if shape == 1 else (name, item, shape) for name, shape in fields.items()]
    return np.dtype(parts, align=True)


def size_of(dtype: np.dtype[Any]) -> int:
    """How many items of a block a record takes."""
    return dtype.itemsize // 8


def place_of(dtype: np.dtype[Any], field: str) -> int:
    """Where a field begins in its record, in items of a block."""
    assert dtype.fields is not None
    return int(dtype.fields[field][1]) // 8


def rows_of(dtype: np.dtype[Any], rows: Any) -> Any:
    """The records that begin in the rows of an array, as one array of records, (n,): it has a column a field."""
    return np.ndarray((len(rows),), dtype, rows, strides=rows.strides[:1]).view(np.recarray)


def record_view(dtype: np.dtype[Any]) -> Callable[[Any, Any], Any]:
    """A function (block, at): the record that begins at a place of a flat block, or in row `at` of one of two axes.

    A kernel may take a view before it asks whether there is a record. In Python it is None where the block has none.
    """
    scalar = np.dtype((np.record, dtype))
    assert dtype.fields is not None
    item = next(iter(dtype.fields.values()))[0].base
    complaint = f"a record of {item} is read from what is no array of them"

    def view(block: Any, at: Any) -> Any:
        if block.dtype != item:
            raise TypeError(complaint)
        flat = block[at : at + size_of(dtype)] if block.ndim == 1 else block[at, : size_of(dtype)]
        return flat.view(scalar)[0] if flat.size == size_of(dtype) else None

    if not config.DISABLE_JIT:
        kind = numpy_support.from_dtype(dtype)

        def cast(_typing: Any, block: Any, at: Any) -> Any:
            if not isinstance(block, types.Array) or numpy_support.as_dtype(block.dtype) != item:
                raise TypingError(complaint)

            def generate(context: Any, builder: Any, signature: Any, values: Any) -> Any:
                array = make_array(signature.args[0])(context, builder, values[0])
                place = values[1]
                if signature.args[0].ndim == 2:
                    place = builder.mul(place, builder.extract_value(array.shape, 1))
                return builder.bitcast(builder.gep(array.data, [place]), context.get_value_type(kind))

            return kind(block, at), generate

        written_by(view, cast)

    return view
