"""The contact manifold of two faces of bodies, where the bodies stand."""

from __future__ import annotations

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

    def rates(self) -> tuple[Array, Array]:
        """Derivatives of the gaps by the twists of the bodies of a and of b, (m, 6) each.

        A twist is a velocity of the body's origin and an angular velocity, in world axes.
        """
        a, b = (np.hstack([self.normals, np.cross(self.places - at, self.normals)]) for at in self._origins)
        return -a, b


def contact_manifold(a: BodyFace, b: BodyFace, *, poses: tuple[Pose, Pose] | None = None) -> ContactManifold | None:
    """The contact manifold of two faces that conform, or nearly (docs/certified.md).

    Plane on plane: corners of what both trimmed faces have in common, and places on arcs. A cylinder in a bore, a cone
    in a hollow one: two rings. A cylinder or a cone on a plane: the ends of a line; a ball on a plane: its point.

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
    first = one.matrix[:3, :3]
    turn, shift = first.T @ other.matrix[:3, :3], (other.position - one.position) @ first
    found = _found((a, b), (_side(a), _side(b)), turn, shift)
    if found is None:
        return None
    origins = np.array([one.position, other.position])
    return ContactManifold(
        found.places @ first.T + one.position, found.normals @ first.T, found.gaps, found.bound, origins
    )


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


def _fitting(a: Side | None, b: Side | None) -> tuple[Cylinder | Cone, Cylinder | Cone] | None:
    """Two cylinders, or cones of one angle, of which one is hollow and one full."""
    if not isinstance(a, ElementaryFace) or not isinstance(b, ElementaryFace) or a.is_outward == b.is_outward:
        return None
    one, other = a.form, b.form
    if isinstance(one, Cylinder) and isinstance(other, Cylinder):
        return one, other
    if isinstance(one, Cone) and isinstance(other, Cone) and abs(one.half_angle - other.half_angle) <= SAME_ANGLE:
        return one, other
    return None


def _found(
    faces: tuple[BodyFace, BodyFace], sides: tuple[Side | None, Side | None], turn: Array, shift: Array
) -> Manifold | None:
    """The manifold in the axes of the first body, the second one at x -> turn x + shift."""
    a, b = sides
    back, from_b = turn.T, -turn.T @ shift
    exchanged: Manifold | None
    if isinstance(a, PlaneRegion) and isinstance(b, PlaneRegion):
        return flat_manifold(a, b, turn, shift)
    if isinstance(a, PlaneRegion) and (full := _full(b)) is not None:
        return line_manifold(a, full, turn, shift)
    if isinstance(b, PlaneRegion) and (full := _full(a)) is not None:
        exchanged = line_manifold(b, full, back, from_b)
    elif (pair := _fitting(a, b)) is not None:
        if isinstance(a, ElementaryFace) and not a.is_outward:
            return round_manifold(*pair, turn, shift)
        exchanged = round_manifold(pair[1], pair[0], back, from_b)
    else:
        kinds = " and a ".join(face.kind for face in faces)
        raise InputError(
            f"a and b are {faces[0]!r} and {faces[1]!r}, a {kinds}; expected planes with edges of lines and arcs, a "
            "cylinder or a cone in a hollow one, or what is round on a plane"
        )
    return None if exchanged is None else exchanged.turned(turn, shift)
