"""Bounds of the first and second derivatives of surfaces and trim curves over boxes of their parameters.

With S = A / w, one rational Bezier piece, and P = A_u w - A w_u:

    S_u = P / w^2,    S_uu = (P_u w - 2 P w_u) / w^3,    S_uv = (P_v w - 2 P w_v) / w^3.

The numerators are made as Bezier nets, whose longest points bound them. Bounds of their terms one by one would not see
that they cancel: the twist S_uv of a cylinder would not come out as zero.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.chord_bounds import bound_chords
from assembly.proximity.clearance.net_bounds import bound_surface

__all__ = ["chord_bounds", "surface_bounds"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


def surface_bounds(surface: NurbsSurface, low: Array, high: Array) -> tuple[Array, Array]:
    """Bounds over boxes of (u, v).

    Parameters
    ----------
    surface : NurbsSurface
    low, high : (n, 2)
        Corners of the boxes, which may go over knots and, where the surface is closed, over its seam.

    Returns
    -------
    first : (n, 2)
        Of |S_u|, |S_v|.
    second : (n, 3)
        Of |S_uu|, |S_uv|, |S_vv|.
    """
    boxes, found = np.empty((len(low), 4)), np.zeros((len(low), 5))
    boxes[:, ::2], boxes[:, 1::2] = low, high
    at_u, at_v = surface.breaks()
    closed = np.array(surface.closed, dtype=np.int64)
    # Seen from the middle: derivatives are the same, and nets of what is beyond a knot by little would be off by the
    # rounding of far coordinates over the square of that little. Kernels take arrays that may be written.
    pieces = np.array(surface.bezier_pieces())
    ends = surface.control_points.reshape(-1, 3)
    pieces[..., :3] -= pieces[..., 3:] * (0.5 * (ends.min(axis=0) + ends.max(axis=0)))
    bound_surface(pieces, np.array(at_u), np.array(at_v), closed, boxes, found)
    return found[:, :2], found[:, 2:]


def chord_bounds(curve: NurbsCurve, t: Array) -> tuple[Array, Indices]:
    """Bounds over intervals t (n, 2) of a plane curve, and to which side of its chords it bends.

    Returns
    -------
    second : (n, 2)
        Of |c_u''| and |c_v''|.
    hollow : (n,) of int
        To which side of its chord, and of the chords of all its parts, a boundary curve is. 1: left, where the material
        of a face is; -1: right; 0: not known. Left is where its control polygon over the interval, of one span or of
        several after another, turns right only, and by less than half a turn in all: then so do the polygons of its
        parts.
    """
    second, hollow = np.zeros((len(t), 2)), np.zeros(len(t), dtype=np.int64)
    bound_chords(np.array(curve.bezier_pieces()), np.array(curve.breaks()), np.ascontiguousarray(t), second, hollow)
    return second, hollow
