"""Bezier patches of faces, about a center, as a tree of a body takes them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.distance.bodies.bezier_nets import write_nets, write_points
from assembly.distance.bodies.records import NONE
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier_pieces import UNIT

__all__ = ["PatchBlock", "is_trimmed", "patches_of"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PatchBlock:
    """Patches of the same degrees of one face, or of one of its boundary curves.

    Attributes
    ----------
    nets : (n, p + 1, q + 1, 4)
        Homogeneous control points about the center, weights at most one.
    spans : (n, 4)
        Low u, high u, low v, high v of each patch on its surface; of a boundary curve its t, and 0 to 1.
    face : int
    curve : int
        NONE: patches of the face.
    sign : int
        1, or -1 where the outward normal is -Su x Sv.
    trimmed : bool
        Whether parts of the patches may be outside of the face.
    error : float
        How far the patches may be from what was given.
    lightest : float
        The least weight.
    """

    nets: Array
    spans: Array
    face: int
    curve: int
    sign: int
    trimmed: bool
    error: float
    lightest: float

    @property
    def degree(self) -> tuple[int, int]:
        """Along u and v."""
        return self.nets.shape[1] - 1, self.nets.shape[2] - 1


def is_trimmed(face: Face) -> bool:
    """Whether a face is less than its surface: its boundary has a curve that is not on an edge of the domain."""
    if face.outer is None and not face.holes:
        return False
    surface = face.surface
    for curve in face.boundary:
        points = curve.control_points
        edges = [
            bool((points[:, axis] == end).all())
            for axis in range(2)
            if not surface.closed[axis]
            for end in surface.domain[axis]
        ]
        if not any(edges):
            return True
    return False


def patches_of(face: Face, number: int, center: Array) -> PatchBlock:
    """The patches of a face's surface.

    The packed patches are within `error` of the given ones: control points are moved to the center (one rounding of
    what is left), multiplied by their weights (two) and turned into Bezier points by p + q steps of at most eight
    roundings each; all errors are parts of the largest distance from the center. A rational point is a quotient of two
    such sums, which doubles that.
    """
    surface = face.surface
    (n, m), (p, q) = surface.weights.shape, surface.degree
    points = np.empty((n, m, 4))
    given = surface.control_points.flatten(), surface.weights.flatten()
    reach, lightest = write_points(given, tuple(center.tolist()), points.reshape(-1))
    error = (1.0 if lightest == 1.0 else 2.0) * 16.0 * (p + q + 4) * UNIT * 2.0 * reach
    at_u, at_v = surface.breaks()
    spans_u, spans_v = at_u.size - 1, at_v.size - 1
    spans = np.empty((spans_u, spans_v, 4))
    spans[..., 0], spans[..., 1] = at_u[:-1, None], at_u[1:, None]
    spans[..., 2], spans[..., 3] = at_v[:-1], at_v[1:]
    if spans_u == spans_v == 1 and (n, m) == (p + 1, q + 1) and surface._is_clamped:
        nets = points[None]
    else:
        flat = np.empty(4 * (spans_u * spans_v * (p + 1) + 1) * (q + 1))
        rows = np.empty(4 * (spans_u * m + 1) * (p + 1))
        write_nets(points.ravel(), (surface.knots[0].copy(), surface.knots[1].copy()), (n, m, p, q), rows, flat)
        nets = flat[: flat.size - 4 * (q + 1)].reshape(-1, p + 1, q + 1, 4)
        if lightest == 1.0:
            nets[..., 3] = 1.0
        else:
            lightest = float(nets[..., 3].min())
    return PatchBlock(nets, spans.reshape(-1, 4), number, NONE, face.sign, is_trimmed(face), error, lightest)
