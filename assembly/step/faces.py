"""Faces of OCCT as trimmed NURBS faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError
from assembly.geometry.faces.boundary import OVERSHOOT
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.step.chains import chained, head_to_tail
from assembly.step.edges import Edges
from assembly.step.occt import occt
from assembly.step.profiles import Unreadable
from assembly.step.surfaces import Patch
from assembly.step.trims import curves_of, edge_curves
from assembly.step.wires import Wire, outermost

__all__ = ["Read", "read_face"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Read:
    """A face, and what was not exact about it [mm]: of its surface, and of the ends of its edges."""

    face: Face
    deviation: float
    gap: float


class _Loop(NamedTuple):
    """The boundary curves of a wire, and what was not exact about them: a deviation in (u, v), and a gap [mm].

    Of their ends and those of their neighbors `tolerance` [mm] forgives.
    """

    curves: list[NurbsCurve]
    tolerance: float
    deviation: float
    gap: float


def _loop(wire: Wire, where: Patch, edges: Edges, factors: Array) -> _Loop | None:
    """The curves of a wire, their u and v multiplied; None where nothing is left of it but seams and poles."""
    if not wire.edges or wire.is_bare:
        return None
    drawn = edge_curves(wire, where, edges)
    drawn, ends, gap = chained(drawn if wire.ordered else head_to_tail(drawn, where), where)
    return _Loop(curves_of(drawn, ends, factors), drawn.tolerance, drawn.deviation, gap)


def _scaled(where: Patch, scale: float) -> tuple[NurbsSurface, Array]:
    """The surface in another unit, and the factors of u and v that go with it."""
    factors = np.array([scale if along.is_length else 1.0 for along in (where.u, where.v)])
    surface = where.surface
    if scale == 1.0:
        return surface, factors
    knots = [factor * row for factor, row in zip(factors, surface.knots, strict=True)]
    return NurbsSurface(scale * surface.control_points, knots, surface.degree, surface.weights), factors


def read_face(face: Any, edges: Edges, name: str | None, scale: float = 1.0) -> Read:
    """A face of OCCT, its surface and its loops.

    Parameters
    ----------
    face
        TopoDS_Face.
    edges
        Those of the solid, with their numbers.
    name : str, optional
    scale : float
        Our unit of length in a millimeter.

    Raises
    ------
    Unreadable
        Saying why.
    """
    o = occt()
    forward = o.as_face(face.Oriented(o.TopAbs_FORWARD))
    try:
        surface, wires, where = edges.laid(forward)
        made_surface, factors = _scaled(where, scale)
        around = outermost(wires, surface, forward)
        outer: list[NurbsCurve] | None = None
        holes: list[list[NurbsCurve]] = []
        gap, deviation = 0.0, where.deviation
        # What the file says of its edges and vertices, and at least what faces forgive by themselves.
        tolerance = OVERSHOOT * made_surface.size
        for k, wire in enumerate(wires):
            made = _loop(wire, where, edges, factors)
            if made is None:
                continue
            gap, deviation = max(gap, made.gap), max(deviation, made.deviation)
            tolerance = max(tolerance, scale * made.tolerance)
            if k == around:
                outer = made.curves
            else:
                holes.append(made.curves)
        reverse = face.Orientation() == o.TopAbs_REVERSED
        made_face = Face(made_surface, outer, holes, name=name, reversed=reverse, tolerance=tolerance)
        if outer is None and not holes:
            # The edge of a surface that is damaged may bound no face, which is otherwise found when it is asked for.
            _ = made_face.boundary
        return Read(made_face, deviation, gap)
    except InputError as error:
        raise Unreadable(str(error)) from error
