"""Makers of common shapes, all of them exact rational surfaces.

Lengths are in the user's unit, angles in radians. Outward is Su x Sv. Knots are lengths as well: along lines
and circles the parameter runs over the arc length, so that |Su| and |Sv| are near one. Full circles are the
quadratic of nine points (Piegl & Tiller, The NURBS Book, section 7.5) with equally spaced double knots.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, extent, number, vector
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.path import Path
from assembly.geometry.splines.bezier import full_knots
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["box", "cone", "cylinder", "ellipsoid", "paper_clip", "pipe", "plane", "sphere", "torus"]

Array = NDArray[np.float64]
_HALF = sqrt(0.5)  # the cosine of half a quarter turn
# The unit circle, counterclockwise from (1, 0), and its weights.
_CIRCLE = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
_CIRCLE_WEIGHTS = np.array([1.0, _HALF, 1.0, _HALF, 1.0, _HALF, 1.0, _HALF, 1.0])
# The half circle from (0, -1) over (1, 0) to (0, 1).
_MERIDIAN = np.array([[0, -1], [1, -1], [1, 0], [1, 1], [0, 1]], dtype=float)
_MERIDIAN_WEIGHTS = _CIRCLE_WEIGHTS[:5]


def _arc_knots(length: float, quarters: int) -> Array:
    return full_knots(np.linspace(0.0, length, quarters + 1), 2)


def _line_knots(low: float, high: float) -> Array:
    return np.array([low, low, high, high])


def _revolution(
    profile: Array, weights: Array, around: float, knots: Array, degree: int, name: str | None
) -> NurbsSurface:
    """Turn a profile (n, 2) of (radius, z) about the z axis; u runs around over [0, around]."""
    points = np.empty((9, len(profile), 3))
    points[..., :2] = _CIRCLE[:, None, :] * profile[None, :, :1]
    points[..., 2] = profile[:, 1]
    return NurbsSurface(
        points, (_arc_knots(around, 4), knots), (2, degree), np.outer(_CIRCLE_WEIGHTS, weights), name=name
    )


def plane(width: float, height: float, *, name: str | None = None) -> NurbsSurface:
    """A rectangle in the xy-plane about the origin, with the normal +z; S(u, v) = (u, v, 0).

    Parameters
    ----------
    width, height : float
        Extents in x and y.
    """
    return _rectangle(extent("width", width), extent("height", height), np.eye(3), np.zeros(3), name)


def _rectangle(width: float, height: float, rotation: Array, offset: Array, name: str | None) -> NurbsSurface:
    """A rectangle moved by x -> rotation x + offset."""
    x, y = 0.5 * width, 0.5 * height
    points = np.array([[[-x, -y, 0.0], [-x, y, 0.0]], [[x, -y, 0.0], [x, y, 0.0]]]) @ rotation.T + offset
    return NurbsSurface(points, (_line_knots(-x, x), _line_knots(-y, y)), (1, 1), name=name)


def sphere(radius: float, *, name: str | None = None) -> NurbsSurface:
    """A sphere about the origin: u runs around the z axis, v from the south pole to the north pole.

    The domain is [0, 2 pi radius] x [0, pi radius], from the +x side; u is closed, and Su = 0 at the poles.
    """
    r = extent("radius", radius)
    return _revolution(r * _MERIDIAN, _MERIDIAN_WEIGHTS, 2.0 * pi * r, _arc_knots(pi * r, 2), 2, name)


def ellipsoid(a: float, b: float, c: float, *, name: str | None = None) -> NurbsSurface:
    """The ellipsoid (x/a)^2 + (y/b)^2 + (z/c)^2 = 1, with u and v as on a sphere.

    The domain is [0, 2 pi m] x [0, pi n] with the mean squares m^2 = (a^2 + b^2)/2 and n^2 = (m^2 + c^2)/2.
    """
    a, b, c = extent("a", a), extent("b", b), extent("c", c)
    m = sqrt(0.5 * (a * a + b * b))
    n = sqrt(0.5 * (m * m + c * c))
    ball = _revolution(_MERIDIAN, _MERIDIAN_WEIGHTS, 2.0 * pi * m, _arc_knots(pi * n, 2), 2, name)
    return NurbsSurface(ball.control_points * [a, b, c], ball.knots, ball.degree, ball.weights, name=name)


def cylinder(radius: float, height: float, *, name: str | None = None) -> NurbsSurface:
    """The lateral surface of a cylinder about the z axis, from z = -height/2 to height/2.

    The domain is [0, 2 pi radius] x [0, height]; u runs around the axis and is closed.
    """
    r, h = extent("radius", radius), extent("height", height)
    profile = np.array([[r, -0.5 * h], [r, 0.5 * h]])
    return _revolution(profile, np.ones(2), 2.0 * pi * r, _line_knots(0.0, h), 1, name)


def cone(radius: float, height: float, top_radius: float = 0.0, *, name: str | None = None) -> NurbsSurface:
    """The lateral surface of a cone about the z axis, or of a frustum.

    The base is at z = -height/2; the apex, a pole where Su = 0, or the top circle is at z = height/2.
    The domain is [0, pi (radius + top_radius)] x [0, slant]; u runs around the axis and is closed.

    Parameters
    ----------
    radius, height : float
        Of the base, and along the axis.
    top_radius : float
        0 for a cone, else the radius of the top.
    """
    r, h = extent("radius", radius), extent("height", height)
    top = number("top_radius", top_radius)
    if top < 0.0:
        raise InputError(f"top_radius is {top:g}; expected zero or a positive number")
    top = extent("top_radius", top) if top > 0.0 else top
    profile = np.array([[r, -0.5 * h], [top, 0.5 * h]])
    slant = float(np.hypot(h, r - top))
    return _revolution(profile, np.ones(2), pi * (r + top), _line_knots(0.0, slant), 1, name)


def torus(major_radius: float, minor_radius: float, *, name: str | None = None) -> NurbsSurface:
    """A torus about the z axis: u runs around the axis, v around the tube, both closed.

    The domain is [0, 2 pi major_radius] x [0, 2 pi minor_radius]; (0, 0) is the outermost point on the x axis.

    Parameters
    ----------
    major_radius : float
        From the axis to the center of the tube.
    minor_radius : float
        Of the tube, smaller than the major radius.
    """
    major, minor = extent("major_radius", major_radius), extent("minor_radius", minor_radius)
    if minor >= major:
        raise InputError(f"minor_radius is {minor:g}; expected less than major_radius, {major:g}")
    profile = minor * _CIRCLE + [major, 0.0]
    return _revolution(profile, _CIRCLE_WEIGHTS, 2.0 * pi * major, _arc_knots(2.0 * pi * minor, 4), 2, name)


def box(x: float, y: float, z: float) -> tuple[Face, ...]:
    """A box about the origin, of six faces.

    Their names are left (-x), right (+x), front (-y), back (+y), bottom (-z) and top (+z).

    Parameters
    ----------
    x, y, z : float
        Extents along the axes.
    """
    extents = np.array([extent("x", x), extent("y", y), extent("z", z)])
    faces = []
    for axis, names in enumerate((("left", "right"), ("front", "back"), ("bottom", "top"))):
        for side, name in zip((-1.0, 1.0), names, strict=True):
            # The first direction lies so that the two and the outward normal are right-handed.
            first, second = (axis + 1) % 3, (axis + 2) % 3
            if side < 0.0:
                first, second = second, first
            rotation = np.zeros((3, 3))
            rotation[first, 0], rotation[second, 1], rotation[axis, 2] = 1.0, 1.0, side
            offset = rotation[:, 2] * 0.5 * extents[axis]
            faces.append(Face(_rectangle(extents[first], extents[second], rotation, offset, name)))
    return tuple(faces)


def _across(path: Path) -> Array:
    """A unit vector across the path's start: along the axis of its first bend, or any."""
    tangent = path.start_direction
    axes = (np.cross(piece.tangent, piece.toward) for piece in path.pieces if piece.toward is not None)
    normal = next(axes, np.eye(3)[np.argmin(np.abs(tangent))])
    normal = normal - normal @ tangent * tangent
    return np.asarray(normal / np.linalg.norm(normal))


def pipe(path: Path, radius: float, caps: bool = True, *, name: str | None = None) -> NurbsSurface:
    """A round wire along a path of lines and arcs; with its caps it is one surface.

    u runs along the path with speed one at the joints of the center line (over the chords of its pieces), v
    around the wire over [0, 2 pi radius], closed. Half balls close the ends, each one more span of u with a
    pole where Sv = 0. A closed path gives a wire without ends, closed in u too. Where the path comes near
    itself the wire is not checked against itself.

    Parameters
    ----------
    path : Path
        Center line, for example `Path().line(10).arc(4, pi, toward=(1, 0, 0))`.
    radius : float
        Of the wire; smaller than that of every arc.
    caps : bool
        Whether an open path's wire ends in half balls, or is open.

    Raises
    ------
    ValueError
        An empty path, an arc that is not wider than the wire, or a closed path in space along which the
        cross section comes back twisted.
    """
    if not isinstance(path, Path):
        raise TypeError(f"path is {path!r}; expected a Path")
    r = extent("radius", radius)
    if not path.pieces:
        raise InputError("path has no pieces; expected at least one line or arc")
    if path.smallest_radius <= r:
        raise InputError(f"path has an arc of radius {path.smallest_radius:g}; expected more than the wire's, {r:g}")

    def ring(center: Array, tangent: Array, normal: Array) -> Array:
        """The nine points around a center; clockwise about the tangent, so that outward is Su x Sv."""
        return center + r * (_CIRCLE[:, :1] * normal + _CIRCLE[:, 1:] * np.cross(normal, tangent))

    first = normal = _across(path)
    rows = [ring(path.start, path.start_direction, normal)]
    weights, spans = [1.0], []
    for piece in path.pieces:
        middle, weight = piece.middle(rows[-1])
        normal = piece.carried(normal)
        tangent = piece.carried(piece.tangent)
        # Once more across the tangent: rounding must not add up along a long path.
        normal = normal - normal @ tangent * tangent
        normal /= np.linalg.norm(normal)
        rows += [middle, ring(piece.end(), tangent, normal)]
        weights += [weight, 1.0]
        spans.append(piece.span)
    if path.closed:
        if np.linalg.norm(normal - first) > 1e-9:
            raise InputError("path is closed, but its cross section comes back twisted; expected a plane closed path")
        rows[-1] = rows[0]
    elif caps:
        # A quarter turn about the tip of the center line: pole, corner, ring, or the other way round.
        behind, ahead = -r * path.start_direction, r * path.end_direction
        pole, far_pole = np.tile(path.start + behind, (9, 1)), np.tile(path.end + ahead, (9, 1))
        rows = [pole, rows[0] + behind, *rows, rows[-1] + ahead, far_pole]
        weights = [1.0, _HALF, *weights, _HALF, 1.0]
        spans = [2.0 * r * _HALF, *spans, 2.0 * r * _HALF]
    knots = full_knots(np.concatenate([[0.0], np.cumsum(spans)]), 2)
    around = _arc_knots(2.0 * pi * r, 4)
    return NurbsSurface(np.stack(rows), (knots, around), (2, 2), np.outer(weights, _CIRCLE_WEIGHTS), name=name)


def paper_clip(
    length: float = 33.0,
    width: float = 8.0,
    wire_radius: float = 0.5,
    *,
    gap: float | None = None,
    legs: ArrayLike | None = None,
    name: str | None = None,
) -> NurbsSurface:
    """A Gem paper clip: a wire of four straight legs and three half turns, in a flat spiral.

    It lies in the xz-plane with its long axis along z, and its bounding box is centered on the origin. The
    spiral runs from the outer free end, up the left side, over the top, down the right side, around the
    bottom, up beside the first leg, and over into the inner free end. See `pipe` for u and v.

    Parameters
    ----------
    length, width : float
        Outer extents in z and x.
    wire_radius : float
        Of the round wire.
    gap : float, optional
        Clear distance between neighboring legs; the wire radius by default.
    legs : (3,), optional
        Straight lengths of the first, third and fourth leg, none longer than the second, which the outer
        extents fix; by default 70, 80 and 55 percent of it.

    Raises
    ------
    ValueError
        Dimensions that leave no room, or with which the wire would run into itself.
    """
    r = extent("wire_radius", wire_radius)
    outer_length, outer_width = extent("length", length), extent("width", width)
    pitch = 2.0 * r + (r if gap is None else extent("gap", gap))
    # Radii of the center line's bends: over the top, around the bottom, and the inner one.
    top = 0.5 * outer_width - r
    bottom, inner = top - 0.5 * pitch, top - pitch
    if inner <= r:
        raise InputError(
            f"width is {outer_width:g}; expected more than {4.0 * r + 2.0 * pitch:g} "
            f"for wire_radius {r:g} and {pitch - 2.0 * r:g} between the legs"
        )
    second = outer_length - 2.0 * r - top - bottom
    if second <= 0.0:
        raise InputError(f"length is {outer_length:g}; expected more than {outer_length - second:g} for these bends")
    first, third, fourth = second * np.array([0.7, 0.8, 0.55]) if legs is None else vector("legs", legs)
    # No leg passes the ends of the second one, so that legs keep the pitch from each other and bends nest.
    if min(first, third, fourth) <= 0.0 or max(first, third) > second or fourth > third:
        raise InputError(
            f"legs is ({first:g}, {third:g}, {fourth:g}); expected positive lengths, the first and third at most "
            f"{second:g}, the fourth at most as long as the third"
        )
    start = (-top, 0.0, 0.5 * outer_length - r - top - first)
    path = Path(start, (0.0, 0.0, 1.0)).line(first).arc(top, pi, (1.0, 0.0, 0.0)).line(second)
    path = path.arc(bottom, pi, (-1.0, 0.0, 0.0)).line(third).arc(inner, pi, (1.0, 0.0, 0.0)).line(fourth)
    return pipe(path, r, name=name)
