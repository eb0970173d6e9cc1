"""The contact manifold of two faces of bodies, where the bodies stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import Pose
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces
from assembly.proximity.manifolds.flat_manifolds import flat_manifold
from assembly.proximity.manifolds.line_manifolds import line_manifold
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.regions import PlaneRegion, plane_region
from assembly.proximity.manifolds.round_manifolds import SAME_ANGLE, round_manifold
from assembly.proximity.manifolds.row_derivatives import (
    flat_derivatives,
    line_derivatives,
    round_derivatives,
    socket_row,
)
from assembly.proximity.manifolds.second_rates import Row, of_both

__all__ = ["ContactManifold", "contact_manifold"]

Array = NDArray[np.float64]
Side = PlaneRegion | ElementaryFace


@dataclass(frozen=True, eq=False)
class ContactManifold(ReadOnlyArrays):
    """The few points that determine the contact of two conforming faces, in the world.

    Attributes
    ----------
    places : (m, 3)
        Points of the face of b.
    normals : (m, 3)
        From a to b.
    gaps : (m,)
        Along the normals; negative where b is within a.
    bound : float
        No gap of the whole pair is less; rounding and the deviations of the faces from their kinds are subtracted.
    """

    places: Array
    normals: Array
    gaps: Array
    bound: float
    _origins: Array = field(repr=False)
    _turns: Array = field(repr=False)
    # Each with which body stays, 0 or 1, in whose axes it is.
    _rows: tuple[tuple[int, Row], ...] = field(repr=False)

    def rates(self) -> tuple[Array, Array]:
        """Row of the gaps by the twists of the bodies of a and of b, (m, 6) each.

        A twist is a velocity of the body's origin and an angular velocity, in world axes.
        """
        a, b = (np.hstack([self.normals, np.cross(self.places - at, self.normals)]) for at in self._origins)
        return -a, b

    def second_rates(self) -> Array:
        """Second derivatives of the gaps by the twists of the body of a, then of b: (m, 12, 12), symmetric.

        Along x + t v, exp(t w) e with constant twists a gap's second derivative is twist^T second twist. Of two rows
        there is none at a kink: of the lowest point of an arc where planes are flush (it is no row there), and of the
        nearest direction of a ring where axes meet, or of a ball where centers do, which is taken to stay there.
        """
        second = np.empty((len(self._rows), 2, 6, 2, 6))
        for form, (k, row), normal, place in zip(second, self._rows, self.normals, self.places, strict=True):
            order = [k, 1 - k]
            normal = (1 - 2 * k) * normal
            rates = np.concatenate([normal, np.cross(place - self._origins[k], normal)])
            both = np.kron(np.eye(2), self._turns[k])
            arm = self._origins[k] - self._origins[1 - k]
            form[:] = of_both(rates, both @ row.second() @ both.T, arm).reshape(2, 6, 2, 6)[order][:, :, order]
        return second.reshape(-1, 12, 12)


def contact_manifold(a: BodyFace, b: BodyFace, *, poses: tuple[Pose, Pose] | None = None) -> ContactManifold | None:
    """The contact manifold of two faces that conform, or nearly (docs/certified.md).

    Plane on plane: corners of what both trimmed faces have in common, and places on arcs. A cylinder in a bore, a cone
    in a hollow one: two rings. A ball in its socket: where it is nearest, both being whole. A cylinder or a cone on a
    plane: the ends of a line; a ball on a plane: its point.

    Parameters
    ----------
    a, b : BodyFace
        `body.face("top")`, of two bodies.
    poses : (Pose, Pose), optional
        Of their bodies; where these stand by default.

    Returns
    -------
    ContactManifold or None
        None where the faces do not face each other, or have nothing in common as seen along the normal, or the axis.

    Raises
    ------
    InputError, TypeError
        Two faces of one body, or kinds of faces that have no manifold.
    """
    for name, face in (("a", a), ("b", b)):
        if not isinstance(face, BodyFace):
            raise TypeError(f"{name} is {face!r}; expected a face of a body, body.face(...)")
    if a.body is b.body:
        raise InputError(f"a and b are {a!r} and {b!r}, of one body; expected faces of two bodies")
    one, other = (a.body.pose, b.body.pose) if poses is None else _checked(poses)
    sides = _side(a), _side(b)
    is_exchanged = _is_exchanged((a, b), sides)
    order = (1, 0) if is_exchanged else (0, 1)
    poses = one, other
    found = _found(sides[order[0]], sides[order[1]], poses[order[0]], poses[order[1]])
    if found is None:
        return None
    rows, bound = found
    origins, turns = (np.array(parts) for parts in zip(*((p.position, p.matrix[:3, :3]) for p in poses), strict=True))
    stays = [order[1] if row.of_second else order[0] for row in rows]
    normals = np.array([(1 - 2 * k) * turns[k] @ row.normal for k, row in zip(stays, rows, strict=True)])
    places = np.array([turns[k] @ row.place + origins[k] for k, row in zip(stays, rows, strict=True)])
    gaps = np.array([row.gap for row in rows])
    return ContactManifold(places, normals, gaps, bound, origins, turns, tuple(zip(stays, rows, strict=True)))


def _checked(poses: tuple[Pose, Pose]) -> tuple[Pose, Pose]:
    if not isinstance(poses, (tuple, list)) or len(poses) != 2 or not all(isinstance(p, Pose) for p in poses):
        raise TypeError(f"poses is {poses!r}; expected two poses")
    return poses[0], poses[1]


def _side(face: BodyFace) -> Side | None:
    region = plane_region(face.face)
    if region is not None:
        return region
    return next(iter(elementary_faces((face.face,))), None)


def _full(side: Side | None) -> Cylinder | Cone | Sphere | None:
    """What is round and full, that may lie on a plane."""
    if isinstance(side, ElementaryFace) and side.is_outward and isinstance(side.form, Cylinder | Cone | Sphere):
        return side.form
    return None


def _fitting(a: Side | None, b: Side | None) -> tuple[Cylinder | Cone | Sphere, Cylinder | Cone | Sphere] | None:
    """Two cylinders, balls, or cones of one angle, of which one is hollow and one full."""
    if not isinstance(a, ElementaryFace) or not isinstance(b, ElementaryFace) or a.is_outward == b.is_outward:
        return None
    one, other = a.form, b.form
    for kind in (Cylinder, Sphere):
        if isinstance(one, kind) and isinstance(other, kind):
            return one, other
    if isinstance(one, Cone) and isinstance(other, Cone) and abs(one.half_angle - other.half_angle) <= SAME_ANGLE:
        return one, other
    return None


def _is_exchanged(faces: tuple[BodyFace, BodyFace], sides: tuple[Side | None, Side | None]) -> bool:
    """Whether rows are sought with the second face first: a plane under what is round, or a hollow wall."""
    a, b = sides
    if isinstance(a, PlaneRegion) and (isinstance(b, PlaneRegion) or _full(b) is not None):
        return False
    if isinstance(b, PlaneRegion) and _full(a) is not None:
        return True
    if _fitting(a, b) is not None:
        return isinstance(a, ElementaryFace) and a.is_outward
    kinds = " and a ".join(face.kind for face in faces)
    raise InputError(
        f"a and b are {faces[0]!r} and {faces[1]!r}, a {kinds}; expected planes with edges of lines and arcs, a "
        "cylinder, a cone or a ball in a hollow one, or what is round on a plane"
    )


def _found(a: Side | None, b: Side | None, one: Pose, other: Pose) -> tuple[Sequence[Row], float] | None:
    """Rows, each in the axes of the body that stays, and the bound of all gaps; a plane or a hollow wall is first."""
    first = one.matrix[:3, :3]
    turn, shift = first.T @ other.matrix[:3, :3], (other.position - one.position) @ first
    manifold: Manifold | None
    if isinstance(a, PlaneRegion) and isinstance(b, PlaneRegion):
        manifold = flat_manifold(a, b, turn, shift)
        return None if manifold is None else (flat_derivatives(a, b, turn, shift, manifold), manifold.bound)
    if isinstance(a, PlaneRegion) and (full := _full(b)) is not None:
        manifold = line_manifold(a, full, turn, shift)
        return None if manifold is None else line_derivatives(a, full, turn, shift, manifold)
    pair = _fitting(a, b)
    assert pair is not None
    hollow, inner = pair
    if isinstance(hollow, Sphere) or isinstance(inner, Sphere):
        assert isinstance(hollow, Sphere) and isinstance(inner, Sphere)
        return socket_row(hollow, inner, turn, shift)
    manifold = round_manifold(hollow, inner, turn, shift)
    return None if manifold is None else (round_derivatives(hollow, inner, turn, shift, manifold), manifold.bound)
