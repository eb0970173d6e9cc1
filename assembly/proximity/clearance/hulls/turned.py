"""Surfaces that a profile draws as it turns about an axis: how far from the axis they are, at least and at most."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.curves import Circle, curve_form
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.clearance.hulls.discs import Discs

__all__ = ["Turned", "turned_surface"]

Array = NDArray[np.float64]
# How far control points may be from circles, in parts of the surface's size; how far they are is taken from radii.
NEARLY = 1e-10


class Turned(NamedTuple):
    """A surface of circles about an axis, or arcs of them, with its profile in the hull of its control points.

    Attributes
    ----------
    center, axis : (3,)
    heights, radii : (m,)
        Of the control points of the profile, heights over the center and distances from the axis.
    off : float
        How far the surface is from one with this profile, at most.
    """

    center: Array
    axis: Array
    heights: Array
    radii: Array
    off: float

    @property
    def discs(self) -> Discs:
        """Discs whose hull contains all that is no farther than `off` from it."""
        count = len(self.radii)
        return Discs(self.center + self.heights[:, None] * self.axis, np.tile(self.axis, (count, 1)), self.radii)

    @property
    def least(self) -> float:
        """How far from the axis it is, at least."""
        return float(self.radii.min()) - self.off


def turned_surface(surface: NurbsSurface) -> Turned | None:
    """What a surface is if it is of circles about one axis on which control points lead the same ways."""
    tolerance = NEARLY * surface.size
    for way in (0, 1):
        # Around and along: pieces and control points.
        pieces = np.moveaxis(surface.bezier_pieces(), (way, way + 2), (0, 2))
        weights = pieces[..., 3]
        if np.ptp(weights / weights[:1, :, :1], axis=(1, 3)).max() > NEARLY:
            continue
        net = pieces[..., :3] / weights[..., None]
        widest = np.unravel_index(int(np.ptp(net, axis=(0, 2)).max(axis=-1).argmax()), net.shape[1:4:2])
        circle = curve_form([pieces[:, widest[0], :, widest[1]]], tolerance)
        if not isinstance(circle, Circle):
            continue
        off = net - circle.center
        heights = off @ circle.axis
        across = off - heights[..., None] * circle.axis
        shape = across[:, widest[0], :, widest[1]][:, None, :, None]
        grown = (across[:1, :, :1] * shape[:1, :, :1]).sum(axis=-1) / (shape[:1, :, :1] ** 2).sum(axis=-1)
        beside = np.linalg.norm(across - grown[..., None] * shape, axis=-1) + np.abs(heights - heights[:1, :, :1])
        if beside.max() <= tolerance and grown.min() >= -NEARLY:
            radii = circle.radius * np.maximum(grown.ravel(), 0.0)
            most = circle.deviation * max(float(grown.max()), 1.0) + float(beside.max())
            return Turned(circle.center, circle.axis, heights[0, :, 0].ravel(), radii, most)
    return None
