"""A face again, with boundary curves that have been cut into parts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import TOLERANCE, Loop
from assembly.geometry.faces.loop_seams import segment
from assembly.geometry.splines.curve import NurbsCurve

__all__ = ["with_cuts"]

# Control points of one curve, in a loop and in the boundary made of it, differ by less than this part of its size.
_SAME = 1e-6


def _is_moved(curve: NurbsCurve, other: NurbsCurve) -> bool:
    """Whether a curve is another one, moved."""
    if curve is other:
        return True
    if curve.degree != other.degree or not np.array_equal(curve.knots, other.knots):
        return False
    shift = curve.control_points - other.control_points
    return bool(np.ptp(shift, axis=0).max() <= _SAME * curve.size) and np.allclose(curve.weights, other.weights)


def _loop_with_cuts(loop: Loop, boundary: Sequence[NurbsCurve], parts: Sequence[Sequence[NurbsCurve]]) -> Loop:
    """A loop in which curves of the boundary are replaced by their parts; seams and pole edges stay."""
    curves: list[NurbsCurve] = []
    for curve in loop.curves:
        found = next((k for k, other in enumerate(boundary) if len(parts[k]) > 1 and _is_moved(curve, other)), None)
        curves.extend([curve] if found is None else parts[found])
    return Loop.unchecked(curves, loop.tolerance, loop.period, "loop")


def with_cuts(face: Face, parts: Sequence[Sequence[NurbsCurve]]) -> Face:
    """The face with every boundary curve replaced by its parts, in their order.

    Its loops have the parts as well, unless they touch at a pole: then the boundary is cut where they do, and they are
    not.

    Parameters
    ----------
    face
    parts
        For every curve of `face.boundary` the curves that it falls into, one where it is not cut.
    """
    outer = face.outer
    if outer is None and not all(face.surface.closed):
        # The edge of the surface, seams and pole edges and all.
        (a, b), (c, d) = face.surface.domain
        corners = np.array([[a, c], [b, c], [b, d], [a, d]])
        edges = [segment(corners[k], corners[(k + 1) % 4]) for k in range(4)]
        outer = Loop.unchecked(edges, TOLERANCE, face.surface._periods, "outer")
    boundary = face.boundary
    made = Face(
        face.surface,
        None if outer is None else _loop_with_cuts(outer, boundary, parts),
        [_loop_with_cuts(hole, boundary, parts) for hole in face.holes],
        name=face.name,
        reversed=face.reversed,
    )
    return made if len(made.boundary) == sum(map(len, parts)) else face._of_parts(parts)
