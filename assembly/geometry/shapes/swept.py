"""Makers of surfaces that curves sweep or span: revolutions and lofts; and shapes that are joined into one."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import ceil, cos, pi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from assembly.errors import InputError, items, number
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.solids import Profile, closed_profile, plane_around
from assembly.geometry.splines import bezier
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["joined", "loft", "revolution"]

Array = NDArray[np.float64]
# Parts of a profile's size within which it is on the axis.
_ON_AXIS = 1e-12
_MOST = 3  # degree across a loft


def _around(curve: NurbsCurve, angle: float, name: str | None) -> NurbsSurface:
    """A curve of (radius, z) turned about the z axis from the x axis: u runs around, v along the curve."""
    parts = max(1, ceil(angle / (0.5 * pi) - 1e-9))
    step = angle / parts
    turns = 0.5 * step * np.arange(2 * parts + 1)
    heavy = np.where(np.arange(turns.size) % 2, cos(0.5 * step), 1.0)
    ring = np.column_stack([np.cos(turns), np.sin(turns)]) / heavy[:, None]
    if angle == 2.0 * pi:
        ring[-1] = ring[0]
    r, z = curve.control_points.T
    points = np.empty((turns.size, r.size, 3))
    points[..., :2] = ring[:, None, :] * r[None, :, None]
    points[..., 2] = z
    knots = bezier.full_knots(np.linspace(0.0, angle * float(r.max()), parts + 1), 2)
    weights = np.outer(heavy, curve.weights)
    return NurbsSurface(points, (knots, curve.knots), (2, curve.degree), weights, name=name)


def _on_axis(curve: NurbsCurve, size: float) -> bool:
    return bool((np.abs(curve.control_points[:, 0]) <= _ON_AXIS * size).all())


def revolution(profile: Profile, angle: float = 2.0 * pi, *, name: str | None = None) -> Any:
    """The surface or solid that a plane profile of (radius, z) sweeps about the z axis, starting at the x axis.

    One open curve makes a surface, whose outward normal is on the right of the curve: away from the axis for a curve
    that goes up. A closed profile makes a solid: one wall for every curve ("wall", or "wall 1", "wall 2" ..., in the
    order of the curves; curves on the axis make none), and, if the angle is less than a whole turn, the flat faces
    "start" and "end". On walls u runs around the axis, and v is the curve's parameter.

    Parameters
    ----------
    profile : NurbsCurve, Loop, or sequence of NurbsCurve
        Plane curves; x is the radius and not negative, y is z.
    angle : float
        How far it turns, up to a whole turn [rad].
    name : str, optional
        Of the surface of an open curve.

    Returns
    -------
    NurbsSurface, or tuple of Face

    Raises
    ------
    InputError
        An angle that is not positive or is larger than a whole turn, a negative radius, a profile of several curves
        that does not close, or a profile on the axis.
    """
    turn = number("angle", angle)
    if not 1e-9 <= turn <= 2.0 * pi * (1.0 + 1e-15):
        raise InputError(f"angle is {turn:g}; expected a positive angle, a whole turn (2 pi) at most")
    turn = min(turn, 2.0 * pi)
    if isinstance(profile, NurbsCurve) and not profile.closed:
        _check_radii([profile])
        return _around(profile, turn, name)
    curves = closed_profile("profile", profile)
    _check_radii(curves)
    size = max(float(np.abs(curve.control_points).max()) for curve in curves)
    # Counterclockwise about the material, which is on the left.
    cap = Face(plane_around(curves, 0.0), curves)
    ordered = [cap.boundary[k] for k in cap.chains[0]]
    forward = np.allclose(ordered[0].evaluate(ordered[0].domain[0]), curves[0].evaluate(curves[0].domain[0]))
    given = ordered if forward else ordered[::-1]
    walls = [curve for curve in given if not _on_axis(curve, size)]
    names = ["wall"] if len(walls) == 1 else [f"wall {k + 1}" for k in range(len(walls))]
    faces = [Face(_around(curve, turn, label)) for curve, label in zip(walls, names, strict=True)]
    if turn < 2.0 * pi:
        faces += [_end(curves, 0.0, "start"), _end(curves, turn, "end")]
    return tuple(faces)


def _check_radii(curves: Sequence[NurbsCurve]) -> None:
    """Raise where a profile is on the other side of the axis, or all of it on it."""
    for k, curve in enumerate(curves):
        if curve.control_points.shape[1] != 2:
            raise InputError(f"profile[{k}] is a curve in space; expected a plane curve of (radius, z)")
    points = np.concatenate([curve.control_points for curve in curves])
    size = float(np.abs(points).max())
    low = float(points[:, 0].min())
    if low < -_ON_AXIS * size:
        raise InputError(f"profile has a control point of radius {low:g}; expected radii of zero or more")
    if all(_on_axis(curve, size) for curve in curves):
        raise InputError("profile is on the axis; expected one that is beside it")


def _end(curves: Sequence[NurbsCurve], angle: float, name: str) -> Face:
    """The flat end of a revolution at an angle, outward along the turn at its end and against it at its start."""
    flat = plane_around(curves, 0.0)
    c, s = (1.0, 0.0) if angle == 0.0 else (float(np.cos(angle)), float(np.sin(angle)))
    # (u, v, 0) comes to (u c, u s, v), with Su x Sv = (s, -c, 0).
    rotation = np.array([[c, 0.0, s], [s, 0.0, -c], [0.0, 1.0, 0.0]])
    return Face(flat.transformed(rotation), curves, name=name, reversed=angle != 0.0)


def loft(curves: Iterable[NurbsCurve], *, name: str | None = None) -> NurbsSurface:
    """The surface through several curves: u runs along the curves, v from the first to the last.

    Between two curves it is ruled; through more of them it is a spline of degree 3 at most, with parameters by the mean
    distance of the curves' control points. Curves of other degrees and knots are raised to common ones, exactly.

    Parameters
    ----------
    curves : sequence of NurbsCurve
        Two or more in space, in the same sense; all closed or none.
    name : str, optional

    Raises
    ------
    InputError
        Fewer than two curves, curves in the plane, two equal neighbors, closed and open curves together, or weights so
        different that weights between the curves are not positive.
    """
    given = items("curves", curves, "two curves or more")
    for k, curve in enumerate(given):
        if not isinstance(curve, NurbsCurve):
            raise TypeError(f"curves[{k}] is {curve!r}; expected a NurbsCurve")
        if curve.control_points.shape[1] != 3:
            raise InputError(f"curves[{k}] is a plane curve; expected a curve in space")
    if len(given) < 2:
        raise InputError(f"curves is {len(given)} curve; expected two or more")
    if len({curve.closed for curve in given}) > 1:
        raise InputError("curves has closed and open ones; expected all closed or none")
    rows, knots, degree = _alike(given)
    steps = np.linalg.norm(np.diff(rows[..., :3] / rows[..., 3:], axis=0), axis=-1).mean(axis=-1)
    if not (steps > 0.0).all():
        k = int(np.argmin(steps))
        raise InputError(f"curves[{k}] and curves[{k + 1}] are equal; expected different curves")
    at = np.concatenate([[0.0], np.cumsum(steps)])
    across = min(_MOST, len(given) - 1)
    # Knots by averaging parameters (The NURBS Book, 9.8), so that the equations can be solved.
    inner = [float(at[k : k + across].mean()) for k in range(1, len(at) - across)]
    across_knots = np.concatenate([np.repeat(at[0], across + 1), inner, np.repeat(at[-1], across + 1)])
    points = np.linalg.solve(_collocation(at, across_knots, across), rows.reshape(len(given), -1)).reshape(rows.shape)
    if not (points[..., 3] > 0.0).all():
        raise InputError(
            "curves has weights so different that weights between them are not positive; expected more similar ones"
        )
    net = points.swapaxes(0, 1)
    return NurbsSurface(net[..., :3] / net[..., 3:], (knots, across_knots), (degree, across), net[..., 3], name=name)


def _alike(curves: Sequence[NurbsCurve]) -> tuple[Array, Array, int]:
    """Homogeneous control points (curves, n, 4) of one degree and one knot vector, over the mean of their domains."""
    degree = max(curve.degree for curve in curves)
    length = float(np.mean([np.ptp(curve.domain) for curve in curves]))
    parts = []
    for curve in curves:
        pieces = bezier.elevation(curve.degree, degree) @ curve.bezier_pieces()
        at = curve.breaks()
        parts.append((pieces, (at - at[0]) / (at[-1] - at[0])))
    every = np.unique(np.concatenate([at for _, at in parts]))
    # Breaks that differ by rounding are one.
    breaks = every[np.append(True, np.diff(every) > 1e-12)]
    breaks[-1] = 1.0
    rows = []
    for pieces, at in parts:
        cut = [_part(pieces, at, a, b) for a, b in zip(breaks[:-1], breaks[1:], strict=True)]
        rows.append(bezier.joined(np.stack(cut)))
    return np.stack(rows), bezier.full_knots(length * breaks, degree), degree


def _part(pieces: Array, at: Array, low: float, high: float) -> Array:
    """Bezier points of a curve between two places of one of its pieces."""
    k = min(max(int(np.searchsorted(at, 0.5 * (low + high), "right")) - 1, 0), len(at) - 2)
    whole = at[k + 1] - at[k]
    a, b = max((low - at[k]) / whole, 0.0), min((high - at[k]) / whole, 1.0)
    points: Array = pieces[k]
    if b < 1.0 - 1e-12:
        points = bezier.divided(points, b)[0]
    if a > 1e-12:
        points = bezier.divided(points, a / b)[1]
    return points


def _collocation(at: Array, knots: Array, degree: int) -> Array:
    """Values of the B-splines at places, (places, splines)."""
    from scipy.interpolate import BSpline

    return np.asarray(BSpline.design_matrix(at, knots, degree).toarray())


def joined(*shapes: Any, **named: Any) -> tuple[Face, ...]:
    """The faces of several shapes as one shape, with distinct names.

    Shapes given by keyword have the keyword before their faces' names: `joined(base=plate, boss=cylinder)` has "base
    top" and "boss wall". Among shapes given without keywords, a name that is taken gets a number: "top", "top 2". A
    face without a name is called "face" with a number.

    Parameters
    ----------
    *shapes, **named : NurbsSurface, Face, or several of them
        In this order.

    Raises
    ------
    TypeError
        Something else.
    InputError
        Nothing at all.
    """
    parts = [("", f"shapes[{k}]", shape) for k, shape in enumerate(shapes)]
    parts += [(f"{word} ", word, shape) for word, shape in named.items()]
    faces: list[Face] = []
    taken: set[str] = set()
    for before, label, shape in parts:
        alone = isinstance(shape, (NurbsSurface, Face))
        for k, part in enumerate([shape] if alone else items(label, shape, "a NurbsSurface, a Face, or several")):
            if not isinstance(part, (NurbsSurface, Face)):
                raise TypeError(f"{label} holds {part!r}; expected a NurbsSurface or a Face")
            own = part.name or ("" if alone and before else f"face {k + 1}")
            name = _free_name(f"{before}{own}".strip(), taken)
            taken.add(name)
            face = part if isinstance(part, Face) else Face(part)
            faces.append(face.transformed(name=name))
    if not faces:
        raise InputError("shapes are none; expected one or more")
    return tuple(faces)


def _free_name(name: str, taken: set[str]) -> str:
    """A name, or the first of "name 2", "name 3" ... that is free."""
    found, number_of = name, 2
    while found in taken:
        found, number_of = f"{name} {number_of}", number_of + 1
    return found
