"""Operands of certified queries: curves, surfaces, points and convex hulls, checked before a kernel reads them."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError, real_array
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["checked_operand", "coordinates", "dimension", "is_formula", "is_spline", "share_a_point"]

Array = NDArray[np.float64]
_DOUBLE = np.dtype(np.float64)


def checked_operand(name: str, value: Any) -> Any:
    """A shape as it is, or an array of doubles."""
    if isinstance(value, (NurbsCurve, NurbsSurface)) or is_formula(value):
        return value
    if type(value) is not np.ndarray and not isinstance(value, (list, tuple, np.ndarray)):
        raise TypeError(
            f"{name} is {value!r}; expected a NurbsCurve, a FormulaCurve, a NurbsSurface, "
            "a point (d,) or vertices (k, d)"
        )
    try:
        shape = np.shape(value)
    except ValueError:
        raise InputError(f"{name} is {value!r}; expected a point (d,) or vertices (k, d)") from None
    if len(shape) not in (1, 2) or shape[-1] not in (2, 3):
        raise InputError(f"{name} has shape {shape}; expected (d,) or (k, d) with d = 2 or 3")
    array = real_array(name, value, shape if len(shape) == 1 else ("k", shape[1]))
    if not float(np.abs(array).max()) < 1e100:
        raise InputError(f"{name} has the coordinate {np.abs(array).max():g}; expected coordinates below 1e100")
    return array


def is_formula(value: Any) -> bool:
    """Whether this is a FormulaCurve; a module that nobody imported has made none."""
    module = sys.modules.get("assembly.geometry.splines.formula_curve")
    return module is not None and isinstance(value, module.FormulaCurve)


def dimension(shape: Any) -> int:
    """2 or 3."""
    if type(shape) is np.ndarray:
        return int(shape.shape[-1])
    if isinstance(shape, NurbsCurve):
        return int(shape.control_points.shape[1])
    if isinstance(shape, NurbsSurface):
        return 3
    return int(shape.dimension)


def is_spline(shape: Any) -> bool:
    """Whether the kernels for splines know it; a hull of one vertex is a point."""
    if type(shape) is np.ndarray:
        return shape.ndim == 1 or len(shape) == 1
    return isinstance(shape, (NurbsCurve, NurbsSurface))


def coordinates(point: Any, d: int) -> tuple[float, float, float] | None:
    """Those of an array (d,) that needs no checks, with a zero for the plane; None for anything else."""
    if type(point) is not np.ndarray or point.shape != (d,) or point.dtype is not _DOUBLE:
        return None
    if d == 3:
        x, y, z = point.tolist()
    else:
        x, y = point.tolist()
        z = 0.0
    # False for NaN.
    return (x, y, z) if -1e100 < x < 1e100 and -1e100 < y < 1e100 and -1e100 < z < 1e100 else None


def share_a_point(a: Any, b: Any) -> bool:
    """Whether two shapes are one, or have a control point in common that both pass through, as an end of curves."""
    if a is b:
        return True
    if isinstance(a, NurbsSurface) or isinstance(b, NurbsSurface):
        return False
    first, second = _given_points(a), _given_points(b)
    return bool((first[:, None] == second[None]).all(axis=2).any())


def _given_points(shape: Any) -> Array:
    """Control points that a curve passes through: where a knot has the multiplicity of the degree."""
    if type(shape) is np.ndarray:
        return np.asarray(shape.reshape(1, -1))
    p = shape.degree
    inner = shape.knots[1:-1]
    # The control point i is the curve's point at the knot i + 1 = ... = i + p.
    windows = np.lib.stride_tricks.sliding_window_view(inner, p)
    return np.asarray(shape.control_points[windows[:, 0] == windows[:, -1]])
