"""Values of four lanes in kernels: (x, y, z, w) as one vector value. Without JIT the names work on numpy 4-vectors."""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import config
from numba.core.datamodel import models
from numba.extending import intrinsic, overload, register_model

__all__ = ["lane", "load_lanes", "store_lanes", "store_xyz"]


class _LanesType(types.Type):
    def __init__(self) -> None:
        super().__init__(name="Lanes4")


_lanes = _LanesType()
_VECTOR = ir.VectorType(ir.DoubleType(), 4)
_I32 = ir.IntType(32)


@register_model(_LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _VECTOR)


if config.DISABLE_JIT:

    def load_lanes(array: np.ndarray, offset: int) -> Any:
        """Four consecutive doubles of a flat array."""
        return array[offset : offset + 4].copy()

    def lane(value: Any, index: int) -> float:
        """One component of a four-lane value."""
        return float(value[index])

    def store_lanes(value: Any, array: np.ndarray, offset: int) -> None:
        """Write all four lanes to a flat array."""
        array[offset : offset + 4] = value

    def store_xyz(value: Any, array: np.ndarray, offset: int) -> None:
        """Write lanes 0 to 2 to a flat array."""
        array[offset : offset + 3] = value[:3]

else:

    @intrinsic
    def load_lanes(_typing: Any, array: Any, offset: Any) -> Any:
        """Four consecutive doubles of a flat array."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
            pointer = builder.bitcast(builder.gep(data, [arguments[1]]), _VECTOR.as_pointer())
            return builder.load(pointer, align=8)

        return _lanes(array, offset), generate

    @intrinsic
    def lane(_typing: Any, value: Any, index: Any) -> Any:
        """One component of a four-lane value; the index is a literal."""
        if not isinstance(index, types.IntegerLiteral):
            return None

        def generate(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.extract_element(arguments[0], _I32(signature.args[1].literal_value))

        return types.float64(value, index), generate

    @intrinsic
    def store_lanes(_typing: Any, value: Any, array: Any, offset: Any) -> Any:
        """Write all four lanes to a flat array."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[1])(context, builder, arguments[1]).data
            pointer = builder.bitcast(builder.gep(data, [arguments[2]]), _VECTOR.as_pointer())
            builder.store(arguments[0], pointer, align=8)
            return context.get_dummy_value()

        return types.none(value, array, offset), generate

    @intrinsic
    def store_xyz(_typing: Any, value: Any, array: Any, offset: Any) -> Any:
        """Write lanes 0 to 2 to a flat array."""

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            data = context.make_array(signature.args[1])(context, builder, arguments[1]).data
            for k in range(3):
                place = builder.gep(data, [builder.add(arguments[2], arguments[2].type(k))])
                builder.store(builder.extract_element(arguments[0], _I32(k)), place)
            return context.get_dummy_value()

        return types.none(value, array, offset), generate

    def _spread(builder: Any, scalar: Any) -> Any:
        first = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), scalar, _I32(0))
        return builder.shuffle_vector(
            first, ir.Constant(_VECTOR, ir.Undefined), ir.Constant(ir.VectorType(_I32, 4), [0, 0, 0, 0])
        )

    def _register(symbol: Any, instruction: str) -> None:
        flags = ("contract",)

        @intrinsic
        def vector_vector(_typing: Any, x: Any, y: Any) -> Any:
            def generate(_c: Any, builder: Any, _s: Any, a: Any) -> Any:
                return getattr(builder, instruction)(a[0], a[1], flags=flags)

            return _lanes(x, y), generate

        @intrinsic
        def scalar_vector(_typing: Any, x: Any, y: Any) -> Any:
            def generate(_c: Any, builder: Any, _s: Any, a: Any) -> Any:
                return getattr(builder, instruction)(_spread(builder, a[0]), a[1], flags=flags)

            return _lanes(types.float64, y), generate

        def of_vectors(x: Any, y: Any) -> Any:
            return vector_vector(x, y)

        def of_scalar(x: Any, y: Any) -> Any:
            return scalar_vector(x, y)

        @overload(symbol)
        def _operator(x: Any, y: Any) -> Any:  # the same signature as those two, as Numba asks
            if not isinstance(y, _LanesType):
                return None
            return of_vectors if isinstance(x, _LanesType) else of_scalar if isinstance(x, types.Float) else None

    _register(operator.add, "fadd")
    _register(operator.sub, "fsub")
    _register(operator.mul, "fmul")
