"""Where a shank sits in a hole: the circle of the hole and that of the shank that come together."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from assembly.constraints.model.joint import Sense
from assembly.constraints.model.mate_features import one_feature, refused
from assembly.errors import InputError
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import rotation_matrix
from assembly.selection.edges import BodyEdge
from assembly.selection.selection import EQUAL, are_parallel

__all__ = ["Seats", "found_seats"]

# A shank of this part more than its hole still fits it: parts of files are off by so much.
_FITS = 1e-6
# Distances that differ by this part are equal, so that rounding does not choose.
_EVEN = 1e-9


class Seats(NamedTuple):
    """The circles at which hole and shank sit, and whether the outward normals there are aligned or opposed."""

    hole: BodyEdge
    shank: BodyEdge
    axes: Sense


def found_seats(hole: Any, shank: Any, said: Sequence[Any] | None) -> Seats:
    """The seats of a hole and a shank, faces or edges, or those that were said."""
    for name, value in (("hole", hole), ("shank", shank)):
        is_round = isinstance(value, BodyFace) and value.kind == "cylinder"
        if not is_round and not (isinstance(value, BodyEdge) and value.kind == "circle"):
            refused(name, value, "a cylinder or a circle of a body")
    _check_order(hole, shank)
    if said is not None:
        try:
            first, second = said
        except (TypeError, ValueError):
            raise InputError(f"seats is {said!r}; expected two circles, of the hole and of the shank") from None
        edges = one_feature(first), one_feature(second)
        for k, (edge, side) in enumerate(zip(edges, (hole, shank), strict=True)):
            if not (isinstance(edge, BodyEdge) and edge.kind == "circle"):
                refused(f"seats[{k}]", edge, "a circle of a body")
            if edge.body is not side.body:
                raise InputError(f"seats[{k}] is on body {edge.body.name!r}; expected one of {side.body.name!r}")
            off = np.linalg.norm(np.cross(edge.center - side.center, side.axis))
            if not are_parallel(edge.axis, side.axis) or off > EQUAL * side.body.size:
                raise InputError(
                    f"seats[{k}] is {edge!r}, about another axis than {side!r}; expected one about its axis"
                )
        return Seats(*edges, "opposed")
    mouths, bottoms = _ends("hole", hole)
    ends, shoulders = _ends("shank", shank)
    if shoulders:
        # Where a hole has no mouth on a flat face there is still a bottom.
        return _nearest(mouths or bottoms, shoulders, "opposed")
    if bottoms and not isinstance(hole, BodyEdge):
        return _nearest(bottoms, ends, "opposed")
    both_edges = isinstance(hole, BodyEdge) or isinstance(shank, BodyEdge)
    return _nearest(mouths, ends, "opposed" if both_edges else "aligned")


def _check_order(hole: Any, shank: Any) -> None:
    """Raise where a hole is no hole, a shank no shank, or the shank is larger."""
    for name, value, hollow in (("hole", hole, True), ("shank", shank, False)):
        if isinstance(value, BodyFace) and value.is_hole != hollow:
            came, expected = ("hollow", "full") if value.is_hole else ("full", "hollow")
            raise InputError(
                f"{name} is {value!r}, a {came} cylinder; expected a {expected} one: Insert takes the hole first, then "
                "the shank"
            )
    if shank.radius > hole.radius * (1.0 + _FITS) and isinstance(hole, BodyFace) and isinstance(shank, BodyFace):
        raise InputError(
            f"shank is {shank!r} of radius {shank.radius:.9g}, hole {hole!r} of radius {hole.radius:.9g}; expected a "
            "shank that fits"
        )


def _ends(name: str, value: Any) -> tuple[list[BodyEdge], list[BodyEdge]]:
    """Circles at which a cylinder ends on flat faces across its axis: convex ones, and ones that are not."""
    if isinstance(value, BodyEdge):
        return [value], []
    found = [edge for edge in value.body.edges.of(value).circles(axis=value.axis) if _is_on_plane(edge, value)]
    if not found:
        raise InputError(
            f"{name} is {value!r}, which ends at no circle on a flat face across its axis; expected one that does, or "
            "an edge"
        )
    concave = [edge for edge in found if edge.is_convex is False]
    return [edge for edge in found if edge.is_convex is not False], concave


def _is_on_plane(edge: BodyEdge, wall: BodyFace) -> bool:
    return any(
        face is not wall and face.kind == "plane" and are_parallel(face.normal, wall.axis) for face in edge.faces
    )


def _nearest(holes: list[BodyEdge], shanks: list[BodyEdge], axes: Sense) -> Seats:
    """The two circles that need no turning around where the bodies stand, of several the nearest."""
    if not holes or not shanks:
        side = "hole" if not holes else "shank"
        raise InputError(
            f"{side} has no circle to sit at other than those of the other side; expected seats=(circle, circle)"
        )
    pairs, hole_size = list(product(holes, shanks)), holes[0].body.size
    sense = 1.0 if axes == "aligned" else -1.0
    upright = [pair for pair in pairs if sense * _cosine(*pair) > 0.0] or pairs
    gaps = [float(np.linalg.norm(a.body.pose.apply(a.center) - b.body.pose.apply(b.center))) for a, b in upright]
    # The first of those that are as near.
    k = int(np.argmax(np.array(gaps) <= min(gaps) + _EVEN * (hole_size + min(gaps))))
    return Seats(*upright[k], axes)


def _cosine(hole: BodyEdge, shank: BodyEdge) -> float:
    """Of the angle between the outward normals at two circles, in the world."""
    n, m = (rotation_matrix(edge.body.q[3:]) @ edge.frame().axes[:, 2] for edge in (hole, shank))
    return float(n @ m)
