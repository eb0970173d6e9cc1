"""Makers of solids whose faces are trimmed: plates with holes, discs, cams, whatever a plane profile sweeps.

Lengths are in the user's unit, angles in radians. All curves and surfaces are exact; outward normals point out of the
material. Solids are extruded along z, from -height/2 to height/2, so that the xy-plane halves them.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import atan2, cos, hypot, pi, sin
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.errors import InputError, extent, number, real_array, vector
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.loop import TOLERANCE, Loop
from assembly.geometry.shapes.plane_curves import arc_through, circle, segment
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import smooth_parts
from assembly.geometry.splines.surface import NurbsSurface

__all__ = [
    "Profile",
    "cam",
    "closed_profile",
    "extrusion",
    "plane_around",
    "plate",
    "plate_with_slot",
    "solid_cylinder",
    "trimmed_plane",
]

Array = NDArray[np.float64]
Profile = Loop | NurbsCurve | Sequence[NurbsCurve]
# How far the plane of a trimmed face goes on around its outer loop, as a part of the loop's extents: what runs over
# the edge of the face stays on the surface.
_MARGIN = 0.0625


def _rectangle(x: float, y: float) -> list[NurbsCurve]:
    """Counterclockwise around the origin from the corner (-x/2, -y/2): front, right, back, left."""
    corners = [(-0.5 * x, -0.5 * y), (0.5 * x, -0.5 * y), (0.5 * x, 0.5 * y), (-0.5 * x, 0.5 * y)]
    return [segment(corners[k], corners[(k + 1) % 4]) for k in range(4)]


def _loop(name: str, curves: NurbsCurve | Iterable[NurbsCurve]) -> Loop:
    """A loop that closes; whether it crosses itself is found when a face is made of it."""
    return Loop.unchecked(curves, TOLERANCE, (0.0, 0.0), name)


def closed_profile(name: str, profile: Any) -> list[NurbsCurve]:
    """The curves of a closed plane profile, cut at corners inside them."""
    if not isinstance(profile, (Loop, NurbsCurve, Iterable)) or isinstance(profile, (str, bytes)):
        raise TypeError(f"{name} is {profile!r}; expected a Loop, a closed NurbsCurve, or several that close")
    curves = profile.curves if isinstance(profile, Loop) else profile
    return [part for curve in _loop(name, curves).curves for part in smooth_parts(curve)]


def _several(name: str, profiles: Any) -> list[list[NurbsCurve]]:
    if isinstance(profiles, (Loop, NurbsCurve)) or not isinstance(profiles, Iterable):
        raise TypeError(f"{name} is {profiles!r}; expected a sequence of closed profiles")
    return [closed_profile(f"{name}[{k}]", profile) for k, profile in enumerate(profiles)]


def plane_around(curves: Iterable[NurbsCurve], z: float) -> NurbsSurface:
    """The plane S(u, v) = (u, v, z) over the box of some curves and a margin."""
    boxes = [curve.bounding_box() for curve in curves]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    margin = _MARGIN * float((high - low).max())
    (x0, y0), (x1, y1) = (low - margin).tolist(), (high + margin).tolist()
    points = [[[x0, y0, z], [x0, y1, z]], [[x1, y0, z], [x1, y1, z]]]
    return NurbsSurface(points, ([x0, x0, x1, x1], [y0, y0, y1, y1]), (1, 1))


def trimmed_plane(outer: Profile, holes: Iterable[Profile] = (), *, name: str | None = None) -> Face:
    """The part of the xy-plane inside a closed profile and outside others, with the normal +z; S(u, v) = (u, v, 0).

    The surface itself extends slightly beyond the outer profile.

    Parameters
    ----------
    outer : Loop, NurbsCurve, or sequence of NurbsCurve
        Plane curves in x and y that close.
    holes : sequence of the same
    name : str, optional

    Raises
    ------
    ValueError
        Profiles that do not close, cross themselves or each other, or curves in space.
    """
    return _cap(closed_profile("outer", outer), _several("holes", holes), 0.0, name, False)


def _cap(outer: list[NurbsCurve], holes: list[list[NurbsCurve]], z: float, name: str | None, reversed: bool) -> Face:
    return Face(plane_around(outer, z), outer, holes, name=name, reversed=reversed)


def _wall(curve: NurbsCurve, height: float, name: str) -> Face:
    """What a plane curve with material on its left sweeps along z: u runs along the curve, v is z + height/2."""
    half = 0.5 * height
    points = np.empty((len(curve.control_points), 2, 3))
    points[..., :2] = curve.control_points[:, None]
    points[..., 2] = [-half, half]
    weights = np.column_stack([curve.weights, curve.weights])
    knots = (curve.knots, np.array([0.0, 0.0, height, height]))
    return Face(NurbsSurface(points, knots, (curve.degree, 1), weights, name=name))


def _extruded(
    outer: list[NurbsCurve],
    holes: list[list[NurbsCurve]],
    height: float,
    names: Sequence[str],
    hole_names: Sequence[Sequence[str]],
) -> tuple[Face, ...]:
    """Walls in the order of the curves, with their names; bottom and top."""
    top = _cap(outer, holes, 0.5 * height, "top", False)
    bottom = _cap(outer, holes, -0.5 * height, "bottom", True)
    walls: list[Face] = []
    sides = [(outer, names, 1.0), *zip(holes, hole_names, [-1.0] * len(holes), strict=True)]
    for (curves, labels, sense), chain in zip(sides, top.chains, strict=True):
        boundary = [top.boundary[k] for k in chain]
        # The cap has the curves with material on the left, so some are run the other way round.
        ordered = boundary if sense * _loop("profile", curves).area > 0.0 else boundary[::-1]
        walls += [_wall(curve, height, name) for curve, name in zip(ordered, labels, strict=True)]
    return (*walls, bottom, top)


def _numbered(label: str, count: int) -> list[str]:
    return [label] if count == 1 else [f"{label} {k + 1}" for k in range(count)]


def extrusion(profile: Profile, height: float, holes: Iterable[Profile] = ()) -> tuple[Face, ...]:
    """The solid that a closed plane profile sweeps along z, from -height/2 to height/2.

    Faces are one wall for every curve of the profile ("wall", or "wall 1", "wall 2", ...), those of the holes
    ("hole 1", or "hole 1 wall 1", ...), "bottom" and "top". On a wall u is the curve's parameter and v the height.

    Parameters
    ----------
    profile : Loop, NurbsCurve, or sequence of NurbsCurve
        Plane curves in x and y that close, in either sense; smooth, but where two of them join.
    height : float
    holes : sequence of the same
        Through holes inside the profile.

    Raises
    ------
    ValueError
        A height that is not positive, or profiles that do not close, cross themselves or each other.
    """
    outer, inner = closed_profile("profile", profile), _several("holes", holes)
    hole_names = []
    for k, hole in enumerate(inner):
        label = "hole" if len(inner) == 1 else f"hole {k + 1}"
        hole_names.append(_numbered(label if len(hole) == 1 else f"{label} wall", len(hole)))
    return _extruded(outer, inner, extent("height", height), _numbered("wall", len(outer)), hole_names)


def solid_cylinder(radius: float, height: float) -> tuple[Face, ...]:
    """A solid cylinder about the z axis, from z = -height/2 to height/2: faces "wall", "bottom" and "top".

    The wall is that of `cylinder`; the ends are planes trimmed by circles.
    """
    return extrusion(circle(extent("radius", radius), (0.0, 0.0)), height)


def plate(x: float, y: float, z: float, holes: Iterable[ArrayLike] = ()) -> tuple[Face, ...]:
    """A box about the origin with round holes through it along z.

    Faces are "front" (-y), "right" (+x), "back" (+y), "left" (-x), "hole 1", "hole 2" ..., "bottom" (-z) and
    "top" (+z).

    Parameters
    ----------
    x, y, z : float
        Extents along the axes.
    holes : sequence of (center_x, center_y, radius)

    Raises
    ------
    ValueError
        Extents or radii that are not positive, holes that leave the plate or run into each other.
    """
    extents = extent("x", x), extent("y", y)
    height = extent("z", z)
    if isinstance(holes, (str, bytes)) or not isinstance(holes, Iterable):
        raise TypeError(f"holes is {holes!r}; expected a sequence of (center_x, center_y, radius)")
    circles: list[tuple[float, float, float]] = []
    for k, hole in enumerate(holes):
        cx, cy, r = vector(f"holes[{k}]", hole).tolist()
        extent(f"holes[{k}][2]", r)
        if abs(cx) + r >= 0.5 * extents[0] or abs(cy) + r >= 0.5 * extents[1]:
            raise InputError(f"holes[{k}] is ({cx:g}, {cy:g}, {r:g}); expected a circle inside the plate")
        for j, (ox, oy, other) in enumerate(circles):
            if hypot(cx - ox, cy - oy) <= r + other:
                raise InputError(f"holes[{k}] is ({cx:g}, {cy:g}, {r:g}); expected a circle clear of holes[{j}]")
        circles.append((cx, cy, r))
    inner = [[circle(r, (cx, cy))] for cx, cy, r in circles]
    names = [[f"hole {k + 1}"] for k in range(len(inner))]
    return _extruded(_rectangle(*extents), inner, height, ("front", "right", "back", "left"), names)


def plate_with_slot(
    x: float, y: float, z: float, length: float, width: float, *, center: ArrayLike = (0.0, 0.0), angle: float = 0.0
) -> tuple[Face, ...]:
    """A box about the origin with a slot through it along z; the slot has round ends.

    Faces are those of `plate`, and "slot right", "slot left" (the flat sides, right and left when looking along the
    slot), "slot end" and "slot start" (the round ends, ahead and behind).

    Parameters
    ----------
    x, y, z : float
        Extents along the axes.
    length, width : float
        Of the slot, from end to end and across; longer than wide. A pin as wide as the slot travels length - width.
    center : (2,)
        Of the slot.
    angle : float
        From the x axis to the slot [rad].

    Raises
    ------
    ValueError
        Extents that are not positive, a slot that is not longer than wide or leaves the plate.
    """
    extents = extent("x", x), extent("y", y)
    height = extent("z", z)
    long, wide = extent("length", length), extent("width", width)
    if long <= wide:
        raise InputError(f"length is {long:g}; expected more than the width of the slot, {wide:g}")
    middle = vector("center", center, 2)
    turn = number("angle", angle)
    r, reach = 0.5 * wide, 0.5 * (long - wide)
    along = np.array([cos(turn), sin(turn)])
    across = np.array([-sin(turn), cos(turn)])
    if (np.abs(middle) + reach * np.abs(along) + r >= 0.5 * np.array(extents)).any():
        raise InputError(
            f"length, width, center and angle are {long:g}, {wide:g}, {middle.tolist()} and {turn:g}; "
            f"expected a slot inside the plate of {extents[0]:g} by {extents[1]:g}"
        )
    ahead, behind = middle + reach * along, middle - reach * along
    # Clockwise, with the material of the plate on the left: the left side ahead, around, the right side back.
    start = atan2(across[1], across[0])
    slot = [
        segment(behind + r * across, ahead + r * across),
        arc_through(ahead, r, start, -pi),
        segment(ahead - r * across, behind - r * across),
        arc_through(behind, r, start + pi, -pi),
    ]
    names = [["slot left", "slot end", "slot right", "slot start"]]
    return _extruded(_rectangle(*extents), [slot], height, ("front", "right", "back", "left"), names)


def cam(radii: ArrayLike, height: float, bore: float) -> tuple[Face, ...]:
    """A disc cam about the z axis with a round bore: faces "cam", "bore", "bottom" and "top".

    The profile is the closed cubic spline, continuous in curvature, through points at equal angles around the axis;
    it begins at the first of them, on the x axis.

    Parameters
    ----------
    radii : (n,)
        Distances of the points from the axis, four or more; for example
        `base + lift * (1 - np.cos(np.linspace(0, 2 * np.pi, 24, endpoint=False))) / 2`.
    height : float
        Along the axis.
    bore : float
        Radius of the bore.

    Raises
    ------
    ValueError
        Fewer than four radii, dimensions that are not positive, a bore that runs into the profile.
    """
    distances = real_array("radii", radii, ("n",))
    if distances.size < 4 or (distances <= 0.0).any():
        raise InputError(f"radii is {distances.tolist()}; expected four or more positive numbers")
    r = extent("bore", bore)
    count = distances.size
    angles = 2.0 * pi * np.arange(count) / count
    points = distances[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
    # On a uniform cubic spline a knot's point is a sixth of two control points and four sixths of the one between.
    row = np.arange(count)
    sixths = np.zeros((count, count))
    for shift, part in ((-1, 1.0), (0, 4.0), (1, 1.0)):
        sixths[row, (row + shift) % count] += part / 6.0
    control = np.linalg.solve(sixths, points)
    around = np.concatenate([control[-1:], control, control[:2]])
    step = float(np.linalg.norm(np.diff(points, axis=0, append=points[:1]), axis=1).mean())
    profile = NurbsCurve(around, step * np.arange(-3.0, count + 4.0), 3)
    nearest = float(np.linalg.norm(profile.evaluate(np.linspace(*profile.domain, 16 * count)), axis=1).min())
    if r >= nearest:
        raise InputError(f"bore is {r:g}; expected less than the least radius of the profile, {nearest:g}")
    return _extruded([profile], [[circle(r, (0.0, 0.0))]], extent("height", height), ("cam",), [["bore"]])
