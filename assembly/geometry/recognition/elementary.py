"""What a surface is, exactly: found from samples, proven of all its points, and kept with it."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from assembly.errors import positive
from assembly.geometry.recognition.bounds import deviation_of, local_net, with_apex_of
from assembly.geometry.recognition.fits import Fit, fits, loose_of
from assembly.geometry.recognition.forms import (
    Cone,
    Cylinder,
    Extrusion,
    Form,
    Freeform,
    Plane,
    Revolution,
    Sphere,
    Torus,
)
from assembly.geometry.recognition.nets import Net, Samples, exactness, has_no_motion, net_of, samples_of
from assembly.geometry.recognition.swept import lines_of, rings_of
from assembly.geometry.recognition.turns import turn_of
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["elementary_form", "is_plane"]

Array = NDArray[np.float64]
# What a difference of points and a scalar product may be off, in parts of the largest coordinate.
_DOT = 4.0 * UNIT
# The least area of a parallelogram, in parts of its size squared, whose normal is known without samples.
_AREA = 1e-6
# Where points of a surface are taken, in parts of its domain, to see that it is no plane: at none of its symmetries.
_PARTS = np.array([0.0, 0.29, 0.61, 1.0])
_known: WeakKeyDictionary[NurbsSurface, dict[float | None, Form]] = WeakKeyDictionary()
# Tolerances to which a surface is seen to be no plane.
_bent: WeakKeyDictionary[NurbsSurface, set[float]] = WeakKeyDictionary()


def elementary_form(surface: NurbsSurface, tolerance: float | None = None) -> Form:
    """What a surface is: the first of plane, cylinder, cone, sphere, torus, extrusion, revolution that it is exactly.

    Its degrees, knots, weights and parameters do not matter; what is found is proven of all its points by Bezier
    points of an equation. A sphere whose radius is beyond some thousand sizes, and a torus whose tube meets its axis,
    are not told from other surfaces.

    Parameters
    ----------
    surface : NurbsSurface
        All of it counts, whatever a face leaves of it.
    tolerance : float, optional
        How far it may be off [length]. By default 1e-12 of its size and the rounding of its coordinates.

    Returns
    -------
    Plane, Cylinder, Cone, Sphere, Torus, Extrusion, Revolution or Freeform
        In the coordinates of the surface, the same one for every call.
    """
    if tolerance is not None:
        tolerance = positive("tolerance", tolerance)
    known = _known.setdefault(surface, {})
    if tolerance not in known:
        known[tolerance] = _recognized(surface, tolerance)
    return known[tolerance]


def is_plane(surface: NurbsSurface, tolerance: float) -> bool:
    """Whether `elementary_form` is a plane, with a tenth of its work of most surfaces that are not.

    Four points within `tolerance` of a plane span a tetrahedron whose edges d from one corner have
    |det(d_1, d_2, d_3)| <= 2 tolerance (|d_1 x d_2| + |d_2 x d_3| + |d_3 x d_1|), up to the square of that.
    """
    known = _known.get(surface, {}).get(tolerance)
    if known is not None:
        return isinstance(known, Plane)
    if tolerance in _bent.get(surface, ()):
        return False
    if surface.size > 0.0 and not surface.is_parallelogram:
        u, v = (low + (high - low) * _PARTS for low, high in surface.domain)
        points = surface.evaluate(u[:, None], v).reshape(-1, 3)
        ways = points - points[0]
        # The longest way, the one farthest beside it, and how far the others are out of the plane of both.
        first = ways[int(np.argmax(np.einsum("ij,ij->i", ways, ways)))]
        areas = np.cross(first, ways)
        normal = areas[int(np.argmax(np.einsum("ij,ij->i", areas, areas)))]
        # Three areas, each at most the square of the size; half of the bound again for what is left out.
        if float(np.abs(ways @ normal).max()) > 9.0 * (tolerance + _exactness(surface)) * surface.size**2:
            _bent.setdefault(surface, set()).add(tolerance)
            return False
    return isinstance(elementary_form(surface, tolerance), Plane)


def _exactness(surface: NurbsSurface) -> float:
    """How far a surface may be off by its own rounding."""
    low, high = surface.bounding_box()
    return exactness(surface.size, float(np.maximum(-low, high).max()))


def _recognized(surface: NurbsSurface, tolerance: float | None) -> Form:
    size = surface.size
    if not size > 0.0:
        return Freeform()
    low, high = surface.bounding_box()
    if tolerance is None:
        tolerance = _exactness(surface)
    allowed = tolerance / size
    if surface.is_parallelogram:
        way, other = (np.diff(surface.control_points, axis=d).reshape(2, 3)[0] for d in (0, 1))
        normal = np.cross(way, other)
        if float(np.linalg.norm(normal)) > _AREA * size * size:
            plane = _plane(surface, net_of(surface), normal, tolerance / size)
            if plane is not None:
                return plane
    # Most of what is none of these is told by that, at a tenth of the time.
    if has_no_motion(surface.bezier_pieces(), 0.5 * low + 0.5 * high, size, loose_of(allowed)):
        return Freeform()
    net = net_of(surface)
    samples = samples_of(net)
    if not len(samples.points):
        return Freeform()
    plane = _plane(surface, net, samples.normals.mean(axis=0), allowed)
    return plane or _round(net, samples, allowed) or _swept(net, samples, allowed)


def _length(net: Net, deviation: float) -> float:
    """A deviation in the coordinates of the surface, with what rounding may add."""
    return float(net.size * (deviation + net.rounding))


def _placed(net: Net, point: Array) -> Array:
    """A point in the coordinates of the surface."""
    placed: Array = net.middle + net.size * point
    return placed


def _plane(surface: NurbsSurface, net: Net, upward: Array, allowed: float) -> Plane | None:
    """The plane that a net is; its normal is on the side of another vector."""
    points = net.points.reshape(-1, 3)
    middle = points.mean(axis=0)
    normal = np.linalg.svd(points - middle, full_matrices=False)[2][2]
    if float(np.abs((points - middle) @ normal).max()) > allowed:
        return None
    if normal @ upward < 0.0:
        normal = -normal
    # The control points tell it themselves, with nothing computed of them.
    point = _placed(net, middle)
    off = float(np.abs((surface.control_points - point) @ normal).max())
    return Plane(point, normal, off + _DOT * float(np.abs(surface.control_points).max()))


def _round(net: Net, samples: Samples, allowed: float) -> Form | None:
    """The cylinder, cone, sphere or torus that a net is."""
    for fit in fits(samples, allowed):
        place = len(samples.points) // 2
        if fit.kind == "cone":
            fit = with_apex_of(net, fit, allowed)
        off = deviation_of(net, fit, samples.points[place], allowed)
        if off <= allowed:
            return _form(net, fit, _is_outward(fit, samples.points[place], samples.normals[place]), _length(net, off))
    return None


def _is_outward(fit: Fit, point: Array, normal: Array) -> bool:
    """Whether a normal goes away from the axis or the center, or the circle of a tube."""
    away = point - fit.origin
    if fit.kind != "sphere":
        flat = away - (away @ fit.axes[2]) * fit.axes[2]
        if fit.kind == "torus":
            flat = away - fit.shape[0] * flat / np.linalg.norm(flat)
        away = flat
    return bool(away @ normal > 0.0)


def _form(net: Net, fit: Fit, outward: bool, deviation: float) -> Form:
    origin, axis, size = _placed(net, fit.origin), fit.axes[2], net.size
    if fit.kind == "sphere":
        return Sphere(origin, float(fit.shape[0]) * size, outward, deviation)
    turn = turn_of(net, fit.origin, fit.axes)
    if fit.kind == "torus":
        major, minor = (fit.shape * size).tolist()
        return Torus(origin, axis, major, minor, turn, outward, deviation)
    local, weights = local_net(net, fit)
    along = local[:, 2:] / weights
    low, high = float(along.min()), float(along.max())
    if fit.kind == "cone":
        heights = (max(low, 0.0) * size, high * size)
        return Cone(origin, axis, float(fit.shape[0]), heights, turn, outward, deviation)
    middle, half = 0.5 * (low + high), 0.5 * (high - low) * size
    point = _placed(net, fit.origin + middle * axis)
    return Cylinder(point, axis, float(fit.shape[0]) * size, (-half, half), turn, outward, deviation)


def _swept(net: Net, samples: Samples, allowed: float) -> Form:
    lines = lines_of(net, allowed)
    if lines is not None:
        return Extrusion(lines.direction, lines.along, _length(net, lines.deviation))
    rings = rings_of(net, samples, allowed)
    if rings is not None:
        turn = turn_of(net, rings.origin, rings.axes)
        return Revolution(_placed(net, rings.origin), rings.axes[2], rings.around, turn, _length(net, rings.deviation))
    return Freeform()
