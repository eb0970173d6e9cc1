"""Peers that may not be installed: each maker returns None where they are not."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline
from scipy.spatial.transform import Rotation

import assembly as asm

__all__ = ["homogeneous_spline", "occt_curves", "occt_evaluator", "occt_pairs", "occt_points"]

Array = NDArray[np.float64]
# Point, Su, Sv, Suu, Suv, Svv.
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2))


def homogeneous_spline(surface: asm.NurbsSurface) -> Callable[[Array], list[Array]]:
    """scipy's B-spline of (w x, w y, w z, w): the six arrays (n, 4) at parameters (n, 2), without the quotient rule."""
    weights = surface.weights[..., None]
    coefficients = np.concatenate([surface.control_points * weights, weights], axis=2)
    spline = NdBSpline(surface.knots, coefficients, surface.degree)
    return lambda parameters: [spline(parameters, nu=order) for order in ORDERS]


def _occt() -> Any | None:
    """Names of OCCT as one namespace."""
    try:
        wanted = ("gp", "Geom", "GeomAdaptor", "Extrema", "BRepBuilderAPI", "BRepExtrema")
        modules = [import_module(f"OCP.{name}") for name in wanted]
    except ImportError:
        return None
    names: dict[str, Any] = {}
    for module in modules:
        names.update(vars(module))
    try:
        arrays = import_module("OCP.collections")
        listed = ("Array2_gp_Pnt", "Array2_double", "Array1_double", "Array1_int", "Array1_gp_Pnt")
        kinds = [getattr(arrays, name) for name in listed]
    except ImportError:  # OCCT 7
        points, others = import_module("OCP.TColgp"), import_module("OCP.TColStd")
        kinds = [points.TColgp_Array2OfPnt]
        kinds += [getattr(others, f"TColStd_{name}") for name in ("Array2OfReal", "Array1OfReal", "Array1OfInteger")]
        kinds.append(points.TColgp_Array1OfPnt)
    names.update(zip(("Points", "Weights", "Knots", "Counts", "PointRow"), kinds, strict=True))
    return type("Occt", (), names)


def _occt_surface(occt: Any, surface: asm.NurbsSurface) -> Any:
    """An adaptor of the surface."""
    n, m, _ = surface.control_points.shape
    points, weights = occt.Points(1, n, 1, m), occt.Weights(1, n, 1, m)
    for i in range(n):
        for j in range(m):
            points.SetValue(i + 1, j + 1, occt.gp_Pnt(*surface.control_points[i, j].tolist()))
            weights.SetValue(i + 1, j + 1, float(surface.weights[i, j]))
    (u, of_u), (v, of_v) = (_occt_knots(occt, row) for row in surface.knots)
    made = occt.Geom_BSplineSurface(points, weights, u, v, of_u, of_v, *surface.degree)
    return occt.GeomAdaptor_Surface(made)


def _occt_knots(occt: Any, row: Array) -> tuple[Any, Any]:
    """Distinct knots, and how often each is there."""
    values, times = np.unique(row, return_counts=True)
    knots, counts = occt.Knots(1, values.size), occt.Counts(1, values.size)
    for k, (value, time) in enumerate(zip(values, times, strict=True)):
        knots.SetValue(k + 1, float(value))
        counts.SetValue(k + 1, int(time))
    return knots, counts


def _occt_edge(occt: Any, curve: asm.NurbsCurve) -> Any:
    """The curve as an edge."""
    n = len(curve.control_points)
    points, weights = occt.PointRow(1, n), occt.Knots(1, n)
    for i in range(n):
        points.SetValue(i + 1, occt.gp_Pnt(*curve.control_points[i].tolist()))
        weights.SetValue(i + 1, float(curve.weights[i]))
    made = occt.Geom_BSplineCurve(points, weights, *_occt_knots(occt, curve.knots), curve.degree)
    return occt.BRepBuilderAPI_MakeEdge(made).Edge()


def occt_curves(a: asm.NurbsCurve, b: asm.NurbsCurve, tolerance: float) -> Callable[[], float] | None:
    """OCCT's least distance of two curves."""
    occt = _occt()
    if occt is None:
        return None
    edges = _occt_edge(occt, a), _occt_edge(occt, b)
    return lambda: float(occt.BRepExtrema_DistShapeShape(*edges, tolerance).Value())


def occt_evaluator(surface: asm.NurbsSurface, u: float, v: float) -> Callable[[], None] | None:
    """One call of OCCT's D2 at (u, v)."""
    occt = _occt()
    if occt is None:
        return None
    adaptor = _occt_surface(occt, surface)
    out = [occt.gp_Pnt(), *(occt.gp_Vec() for _ in range(5))]
    return lambda: adaptor.D2(u, v, *out)


def occt_pairs(
    surfaces: list[tuple[asm.NurbsSurface, asm.NurbsSurface]], q: Array, starts: Array, tolerance: float = 1e-10
) -> list[Callable[[], Any]] | None:
    """OCCT's local search, a callable a pair; `occt_points` reads what it returns."""
    occt = _occt()
    if occt is None:
        return None
    searches: list[Callable[[], Any]] = []
    for pair, rows, start in zip(surfaces, q, starts.tolist(), strict=True):
        turns = Rotation.from_quat(rows[:, 3:], scalar_first=True)
        f, g = (
            _occt_surface(occt, surface.transformed(turn.as_matrix(), row[:3]))
            for surface, row, turn in zip(pair, rows, turns, strict=True)
        )
        searches.append(partial(occt.Extrema_GenLocateExtSS, f, g, *start, tolerance, tolerance))
    return searches


def occt_points(extremum: Any) -> Array | None:
    """The two points (2, 3), or None where the search gave up."""
    if not extremum.IsDone():
        return None
    pair = (extremum.PointOnS1().Value(), extremum.PointOnS2().Value())
    return np.array([[p.X(), p.Y(), p.Z()] for p in pair])
