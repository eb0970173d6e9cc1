"""Flat surfaces whose parameters are lengths along two directions, and curves on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.curves import Circle, curve_form
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["FlatMap", "flat_map"]

Array = NDArray[np.float64]
# How far the corners of a flat face may be from a parallelogram, in parts of their largest coordinate.
FLAT = 1e-12


@dataclass(frozen=True, eq=False)
class FlatMap:
    """A flat surface as (u, v) -> origin + u along + v across, and how far it is from that."""

    origin: Array
    along: Array
    across: Array
    off: float

    def image(self, curve: NurbsCurve) -> Array:
        """Homogeneous Bezier points (pieces, degree + 1, 4) in space of a curve of (u, v)."""
        pieces = curve.bezier_pieces()
        w = pieces[..., -1:]
        space = self.origin * w + pieces[..., :1] * self.along + pieces[..., 1:2] * self.across
        return np.concatenate([space, w], axis=-1)

    def points(self, curve: NurbsCurve) -> Array:
        """The Bezier points in space (n, 3) of a curve of (u, v)."""
        net = curve.bezier_pieces().reshape(-1, 3)
        u, v = net[:, :1] / net[:, 2:], net[:, 1:2] / net[:, 2:]
        return np.asarray(self.origin + u * self.along + v * self.across)

    def circle(self, curves: Sequence[NurbsCurve], tolerance: float | None = None) -> Circle | None:
        """The circle in space that curves of (u, v), one after another, go along, to a tolerance [length]."""
        if max(curve.degree for curve in curves) < 2:
            return None
        circle = curve_form([self.image(curve) for curve in curves], tolerance)
        return circle if isinstance(circle, Circle) else None


def flat_map(surface: NurbsSurface) -> FlatMap | None:
    """The map of a flat surface whose parameters are lengths along two directions."""
    net = surface.control_points
    if net.shape != (2, 2, 3) or np.ptp(surface.weights) > 0.0:
        return None
    bent = float(np.abs(net[1, 1] - net[1, 0] - net[0, 1] + net[0, 0]).max())
    if bent > FLAT * float(np.abs(net).max()):
        return None
    (u0, u1), (v0, v1) = surface.domain
    along, across = (net[1, 0] - net[0, 0]) / (u1 - u0), (net[0, 1] - net[0, 0]) / (v1 - v0)
    return FlatMap(net[0, 0] - u0 * along - v0 * across, along, across, bent)
