"""The contact manifold of two faces of bodies, where the bodies stand."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere
from assembly.kinematics.body import BodyFace
from assembly.kinematics.pose import PoseLike, pose_row, rotation_of
from assembly.proximity.manifolds.ball_manifolds import ball_rows
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces
from assembly.proximity.manifolds.flat_manifolds import flat_manifold
from assembly.proximity.manifolds.line_manifolds import line_manifold
from assembly.proximity.manifolds.manifold import Manifold
from assembly.proximity.manifolds.regions import PlaneRegion, plane_region
from assembly.proximity.manifolds.round_manifolds import SAME_ANGLE, round_manifold
from assembly.proximity.manifolds.row_derivatives import (
    all_straight,
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
    _found: _Found = field(repr=False)

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
        rows, first = self._found.rows, self._found.first
        second = np.empty((len(rows), 2, 6, 2, 6))
        for form, row, normal, place in zip(second, rows, self.normals, self.places, strict=True):
            k = 1 - first if row.of_second else first
            order = [k, 1 - k]
            normal = (1 - 2 * k) * normal
            rates = np.concatenate([normal, np.cross(place - self._origins[k], normal)])
            both = np.kron(np.eye(2), self._turns[k])
            arm = self._origins[k] - self._origins[1 - k]
            form[:] = of_both(rates, both @ row.second() @ both.T, arm).reshape(2, 6, 2, 6)[order][:, :, order]
        return second.reshape(-1, 12, 12)


def contact_manifold(
    a: BodyFace, b: BodyFace, *, poses: tuple[PoseLike, PoseLike] | None = None
) -> ContactManifold | None:
    """The contact manifold of two faces that conform, or nearly (docs/certified.md).

    Plane on plane: corners of what both trimmed faces have in common, and places on arcs. A cylinder in a bore, a cone
    in a hollow one: two rings. A ball in its socket: where it is nearest, both being whole; in a hollow cone or in a
    bore: a ring. A cylinder or a cone on a plane: the ends of a line; a ball on a plane: its point.

    Parameters
    ----------
    a, b : BodyFace
        `body.face("top")`, of two bodies.
    poses : (q_a, q_b), optional
        Of their bodies, a `Pose` or a row (7,) each; where these stand by default.

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
    q = _rows((a.body.pose, b.body.pose) if poses is None else poses)
    sides = _side(a), _side(b)
    k = int(_is_exchanged((a, b), sides))
    origins, turns = q[:, :3].copy(), np.array([rotation_of(row) for row in q[:, 3:]])
    first = turns[k].T
    found = _find(k, (sides[k], sides[1 - k]), first @ turns[1 - k], first @ (origins[1 - k] - origins[k]))
    if found is None:
        return None
    gaps, normals, places = found.told
    normals = normals @ first if k == 0 else -normals @ first
    return ContactManifold(places @ first + origins[k], normals, gaps, found.bound, origins, turns, found)


def _rows(poses: tuple[PoseLike, PoseLike]) -> Array:
    """Two poses as rows, (2, 7)."""
    if not isinstance(poses, (tuple, list, np.ndarray)) or len(poses) != 2:
        raise InputError(f"poses is {poses!r}; expected a pair, one pose for a and one for b")
    return np.array([pose_row(f"poses[{k}]", pose) for k, pose in enumerate(poses)])


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
    """Two cylinders, balls, or cones of one angle, of which one is hollow and one full; or a ball in a hollow wall."""
    if not isinstance(a, ElementaryFace) or not isinstance(b, ElementaryFace) or a.is_outward == b.is_outward:
        return None
    one, other = a.form, b.form
    for kind in (Cylinder, Sphere):
        if isinstance(one, kind) and isinstance(other, kind):
            return one, other
    if isinstance(one, Cone) and isinstance(other, Cone) and abs(one.half_angle - other.half_angle) <= SAME_ANGLE:
        return one, other
    if b.is_outward and isinstance(one, Cylinder | Cone) and isinstance(other, Sphere):
        return one, other
    if a.is_outward and isinstance(one, Sphere) and isinstance(other, Cylinder | Cone):
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
        "cylinder, a cone or a ball in a hollow one, a ball in a bore, or what is round on a plane"
    )


@dataclass(frozen=True, eq=False)
class _Found:
    """What was found of two faces: a plane or a hollow wall, and what is at x -> turn x + shift, seen from it.

    Attributes
    ----------
    first : int
        Which of the faces of a query the first one is, 0 or 1.
    sides : (Side, Side)
    turn, shift : (3, 3), (3,)
    manifold : Manifold or None
        None of a ball in what is hollow.
    known : tuple of Row or None
        Rows, where gaps, normals and places are theirs; else these are those of the manifold.
    bound : float
    """

    first: int
    sides: tuple[Side, Side]
    turn: Array
    shift: Array
    manifold: Manifold | None
    known: tuple[Row, ...] | None
    bound: float

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Rows with second derivatives, each in the axes of the body that stays; made when they are asked for."""
        if self.known is not None:
            return self.known
        (a, b), manifold = self.sides, self.manifold
        assert manifold is not None
        if isinstance(a, PlaneRegion) and isinstance(b, PlaneRegion):
            return tuple(flat_derivatives(a, b, self.turn, self.shift, manifold))
        hollow, inner = _walls(a, b)
        return tuple(round_derivatives(hollow, inner, self.turn, self.shift, manifold))

    @property
    def told(self) -> tuple[Array, Array, Array]:
        """Gaps (m,), and normals and places (m, 3) in the axes of the first body."""
        if self.known is None:
            assert self.manifold is not None
            return self.manifold.gaps, self.manifold.normals, self.manifold.places
        rows = self.known
        gaps, normals, places = (np.array([getattr(row, name) for row in rows]) for name in ("gap", "normal", "place"))
        moves = [row.of_second for row in rows]
        if any(moves):
            normals[moves] = -normals[moves] @ self.turn.T
            places[moves] = places[moves] @ self.turn.T + self.shift
        return gaps, normals, places


def _walls(a: Side | None, b: Side | None) -> tuple[Cylinder | Cone, Cylinder | Cone]:
    """The walls of a bore and a shaft, or of cones."""
    pair = _fitting(a, b)
    assert pair is not None
    assert not isinstance(pair[0], Sphere) and not isinstance(pair[1], Sphere)
    return pair[0], pair[1]


def _find(first: int, sides: tuple[Side | None, Side | None], turn: Array, shift: Array) -> _Found | None:
    """What is found of two faces, a plane or a hollow wall and another one; see `_Found`."""
    a, b = sides
    assert a is not None and b is not None
    manifold: Manifold | None
    if isinstance(a, PlaneRegion) and isinstance(b, PlaneRegion):
        manifold = flat_manifold(a, b, turn, shift)
        if manifold is None:
            return None
        # Rows of arcs go from where the manifold has them to where they are stationary.
        is_straight = all_straight(a, b, manifold)
        known = None if is_straight else tuple(flat_derivatives(a, b, turn, shift, manifold))
        return _Found(first, (a, b), turn, shift, manifold, known, manifold.bound)
    if isinstance(a, PlaneRegion) and (full := _full(b)) is not None:
        manifold = line_manifold(a, full, turn, shift)
        if manifold is None:
            return None
        rows, bound = line_derivatives(a, full, turn, shift, manifold)
        return _Found(first, (a, b), turn, shift, manifold, tuple(rows), bound)
    pair = _fitting(a, b)
    assert pair is not None
    hollow, inner = pair
    if isinstance(hollow, Sphere) and isinstance(inner, Sphere):
        socket = socket_row(hollow, inner, turn, shift)
        return None if socket is None else _Found(first, (a, b), turn, shift, None, tuple(socket[0]), socket[1])
    if not isinstance(hollow, Sphere) and isinstance(inner, Sphere):
        ring = ball_rows(hollow, inner, turn, shift)
        return None if ring is None else _Found(first, (a, b), turn, shift, None, tuple(ring[0]), ring[1])
    manifold = round_manifold(*_walls(a, b), turn, shift)
    return None if manifold is None else _Found(first, (a, b), turn, shift, manifold, None, manifold.bound)
