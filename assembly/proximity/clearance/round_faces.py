"""Faces that lie on a cylinder, a cone, a ball or a torus, and discs: exact hulls, and bores of walls from inside."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, tan
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.curves import Circle, curve_form
from assembly.geometry.recognition.forms import Cone, Cylinder, Plane, Sphere, Torus
from assembly.geometry.splines import bezier
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.manifolds.elementary_faces import NEARLY, nearly_elementary
from assembly.proximity.manifolds.flat_map import flat_map

__all__ = ["Round", "round_holes", "round_of", "round_parts"]

Array = NDArray[np.float64]
# A face that goes around less of a cylinder than about half is no round body.
HALF = 0.95 * pi
# [size of a face] A round hole of a file may be a curve through points of a circle, off by so much.
HOLE = 1e-4
# A ball of more than this part of a face's size is no ball that the face goes around.
LARGEST_BALL = 0.7
ROUNDED_UP = 1.0 + 1e-15


@dataclass(frozen=True, eq=False)
class Round:
    """What a face lies on.

    Attributes
    ----------
    center, axis : (3,)
        Of a ball the axis is zero.
    half : float
        Half the length of a cylinder.
    radius : float
        From outside: of the cylinder, the ball, or the tube of a torus, not less than that of the face. From inside:
        not more.
    ring : float
        Of a torus, the radius of the circle of its middles; else 0.
    outward : bool
        Whether the body is within.
    less : (float, float)
        Of a cone from outside, by how much it is narrower than the radius at its ends along the axis and against it.
    slant : float
        Of a cone from inside, the sine of the angle of its wall to the axis, along which it gets wider. Its radius is
        the level of the wall (`separation.most_in_bore`), counted from the center.
    """

    center: Array
    axis: Array
    half: float
    radius: float
    ring: float
    outward: bool
    less: tuple[float, float] = (0.0, 0.0)
    slant: float = 0.0

    @property
    def is_conical(self) -> bool:
        """Whether it is a cone."""
        return self.slant > 0.0 or any(self.less)


def _radius(radius: float, deviation: float, outward: bool) -> float:
    """A radius that the face is within, or beyond."""
    return (radius + deviation) * ROUNDED_UP if outward else (radius - deviation) / ROUNDED_UP


class _Ring(NamedTuple):
    """Circles between which a flat surface lies, the inner one only where the surface does not reach the middle."""

    inner: Circle | None
    outer: Circle
    off: float


def _ring(surface: NurbsSurface) -> _Ring | None:
    """The circles that straight lines of a flat surface go between, away from their center, as of a revolution."""
    tolerance = NEARLY * surface.size
    for around in (0, 1):
        net, weights = np.moveaxis(surface.control_points, around, 0), np.moveaxis(surface.weights, around, 0)
        if not surface.closed[around] or net.shape[1] != 2 or np.ptp(weights, axis=1).any():
            continue
        # Pieces along one of both edges of the surface.
        pieces = np.moveaxis(surface.bezier_pieces(), (around, 2 + around), (0, 1))[:, :, 0]
        sizes = np.ptp(net, axis=0).max(axis=1)
        last = int(sizes.argmax())
        outer = curve_form([pieces[:, :, last]], tolerance)
        if not isinstance(outer, Circle):
            return None
        inner = None if sizes[1 - last] <= tolerance else curve_form([pieces[:, :, 1 - last]], tolerance)
        radius = inner.radius if isinstance(inner, Circle) else 0.0
        # Points of both edges at one parameter are in one direction from the center, in the ratio of the radii.
        ends = net[:, 1 - last] - outer.center, net[:, last] - outer.center
        off = float(np.linalg.norm(ends[0] - radius / outer.radius * ends[1], axis=1).max())
        if off <= tolerance:
            return _Ring(inner if isinstance(inner, Circle) else None, outer, off)
        return None
    return None


def _disc(face: Face) -> Round | None:
    """A flat face within a circle, its outer boundary or that of its surface, as a cylinder without length."""
    flat, ring = flat_map(face.surface), _ring(face.surface)
    if ring is not None:
        circle, beside = ring.outer, ring.off
    elif flat is not None and face.outer is not None:
        found = flat.circle(face.boundary[: len(face.chains[0])], NEARLY * face.surface.size)
        if found is None:
            return None
        circle, beside = found, flat.off
    else:
        return None
    off = circle.deviation + beside
    return Round(circle.center, circle.axis, off, (circle.radius + off) * ROUNDED_UP, 0.0, True)


def round_holes(face: Face) -> list[Round]:
    """The circles of a flat face's round holes, as bores without length: all of the face is beyond each of them."""
    flat, found = flat_map(face.surface), list[tuple[Circle, float]]()
    if flat is not None:
        # The first chain goes around the face; others are clockwise, with material outside.
        for chain in face.chains[1:]:
            circle = flat.circle([face.boundary[k] for k in chain], HOLE * face.surface.size)
            if circle is not None:
                found.append((circle, circle.deviation + flat.off))
    elif isinstance(nearly_elementary(face.surface), Plane):
        ring = _ring(face.surface)
        if ring is not None and ring.inner is not None:
            found.append((ring.inner, ring.inner.deviation + ring.off))
    return [
        Round(circle.center, circle.axis, off, (circle.radius - off) / ROUNDED_UP, 0.0, False)
        for circle, off in found
        if off < circle.radius
    ]


def _cone(form: Cone, outward: bool) -> Round:
    """A cone from outside by its end circles, or from inside by its level, about the middle of its widest circle."""
    low, high = form.heights
    off, slope = form.deviation, tan(form.half_angle)
    if outward:
        # The hull of both end circles, which are moved along the axis by a deviation, too.
        pad = off + slope * (off + high * (ROUNDED_UP - 1.0))
        widest, narrowest = (_radius(height * slope, pad, True) for height in (high, low))
        center, half = form.apex + 0.5 * (low + high) * form.axis, 0.5 * (high - low) * ROUNDED_UP + off
        return Round(center, form.axis, half, widest, 0.0, True, (0.0, (widest - narrowest) / ROUNDED_UP))
    level = cos(form.half_angle) * high * slope
    center = form.apex + high * form.axis
    return Round(center, form.axis, 0.0, _radius(level, off, False), 0.0, False, slant=sin(form.half_angle))


def round_of(face: Face) -> Round | None:
    """What a face lies on, or None where that is no cylinder, cone, ball or torus, and the face no disc."""
    form = nearly_elementary(face.surface)
    if isinstance(form, Plane):
        return _disc(face)
    if not isinstance(form, (Cone, Cylinder, Sphere, Torus)):
        return None
    outward, off = form.outward == (face.sign > 0), form.deviation
    if isinstance(form, Torus):
        if not (outward and all(face.surface.closed)):
            return None
        return Round(form.center, form.axis, 0.0, _radius(form.minor, off, True), form.major, True)
    if isinstance(form, Sphere):
        if form.radius >= LARGEST_BALL * face.surface.size:
            return None
        return Round(form.center, np.zeros(3), 0.0, _radius(form.radius, off, outward), 0.0, outward)
    if outward and form.turn.angle < HALF:
        return None
    if isinstance(form, Cone):
        return _cone(form, outward)
    half = form.heights[1] * ROUNDED_UP + off
    return Round(form.point, form.axis, half, _radius(form.radius, off, outward), 0.0, outward)


def _strip(surface: NurbsSurface, direction: int, k: int) -> NurbsSurface:
    """Span k of a surface in one direction, and all of the other."""
    pieces, at = surface.bezier_pieces(), list(surface.breaks())
    part = slice(k, k + 1)
    pieces = pieces[part] if direction == 0 else pieces[:, part]
    at[direction] = at[direction][k : k + 2]
    # Joined along u, then along v.
    along_u = np.stack([bezier.joined(pieces[:, j]) for j in range(pieces.shape[1])])
    points = bezier.joined(np.moveaxis(along_u, 1, 2)).swapaxes(0, 1)
    knots = [bezier.full_knots(ends, degree) for ends, degree in zip(at, surface.degree, strict=True)]
    return NurbsSurface(points[..., :3] / points[..., 3:], knots, surface.degree, points[..., 3])


def round_parts(face: Face) -> tuple[int, list[Round | None]]:
    """What the spans of a face without a boundary lie on: the direction of the spans, and one entry per span.

    A wire with half balls on its ends is one face; its spans along it are exact. One entry where the whole face is.
    """
    whole = round_of(face)
    if whole is not None or face.boundary:
        return 0, [whole]
    for d in (0, 1):
        spans = len(face.surface.breaks()[d]) - 1
        if spans > 1:
            parts = [round_of(Face(_strip(face.surface, d, k), reversed=face.reversed)) for k in range(spans)]
            if any(part is not None for part in parts):
                return d, parts
    return 0, [None]
