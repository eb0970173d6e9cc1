"""How far two bodies are apart, with a proof: faces, sheets and solids, trimmed, at any poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays, read_only
from assembly.distance.bodies.query import Nearest, bodies_apart
from assembly.distance.piece_search import SPENT
from assembly.errors import InputError, integer, positive
from assembly.geometry.faces.face import Face
from assembly.kinematics.pose import PoseLike, rotation_of
from assembly.proximity.features.features import Feature, Shape, faces_of, pose_of
from assembly.proximity.features.parting import are_balls, parting_translation
from assembly.proximity.features.places import body_tree, feature_at, is_behind, is_closed, normals_at, shells_of

__all__ = ["BodyDistance", "DistanceStatus", "beyond", "distance", "distance_at"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
_BUDGET = 200_000
# A cosine beyond which the way between nearest points is along a normal, so that the point is within a face.
_ALONG = 1.0 - 1e-9


class DistanceStatus(Enum):
    """Why a query ended; the value says what that means."""

    CONVERGED = "the two bounds are within the tolerance of each other"
    ENCLOSED = "one body lies wholly inside the other one; the bounds are those of their surfaces"
    ROUNDED = "the bounds are as close as doubles let them be at coordinates of this size, not within the tolerance"
    BUDGET_SPENT = "the budget was spent first: the bounds are true and wide; allow more pairs"


@dataclass(frozen=True, eq=False)
class BodyDistance(ReadOnlyArrays):
    """Bounds of the distance of the surfaces of two bodies.

    Attributes
    ----------
    lower, upper : float
        lower <= distance <= upper, rounding included.
    points : (2, 3)
        A point of a and a point of b, world coordinates, `upper` apart or less but for the rounding of their
        coordinates.
    status : DistanceStatus
    evaluations : int
        Number of pairs of parts that were processed.
    """

    lower: float
    upper: float
    points: Array
    status: DistanceStatus
    evaluations: int
    _where: tuple[tuple[Faces, Faces], Nearest, Array] = field(repr=False)

    def __post_init__(self) -> None:
        """Nothing to protect: the points of a search are read-only."""

    @property
    def converged(self) -> bool:
        """Whether the bounds are within the tolerance."""
        return self.status in (DistanceStatus.CONVERGED, DistanceStatus.ENCLOSED)

    @cached_property
    def translation(self) -> Array | None:
        """The shortest translation (3,) of b found that parts the bodies, one of which is inside; None elsewhere.

        Computed when it is read, in some tenths of a second. It is as long as needed along its direction; for convex
        bodies none is shorter up to rounding, for others one may be.
        """
        if self.status is not DistanceStatus.ENCLOSED:
            return None
        faces, _found, q = self._where
        return read_only(parting_translation(faces, q))

    @property
    def depth(self) -> float | None:
        """The length of `translation`."""
        return None if self.translation is None else float(np.linalg.norm(self.translation))

    @property
    def proved(self) -> bool:
        """Whether the bounds are within the tolerance, and for bodies inside each other no translation is shorter.

        The latter is known for balls only.
        """
        if self.status is DistanceStatus.ENCLOSED:
            return are_balls(self._where[0])
        return self.converged

    @cached_property
    def normal(self) -> Array | None:
        """A unit vector (3,) from a towards b: the outward normal of a, or of b reversed, where a point is on a face.

        None where both are on edges or vertices.
        """
        faces, found, q = self._where
        for side, sign in ((0, 1.0), (1, -1.0)):
            if self.features[side].kind == "face":
                return read_only(sign * rotation_of(q[side, 3:]) @ normals_at(faces[side], found.spot(side))[0])
        return None

    @cached_property
    def features(self) -> tuple[Feature, Feature]:
        """The faces, edges or vertices on which the points are."""
        faces, found, q = self._where
        first, second = (
            feature_at(faces[k], found.spot(k), rotation_of(q[k, 3:]).T @ (self.points[k] - q[k, :3])) for k in range(2)
        )
        return first, second


def distance(
    a: Shape,
    b: Shape,
    *,
    poses: tuple[PoseLike | None, PoseLike | None] = (None, None),
    tolerance: float = 1e-10,
    budget: int | None = None,
) -> BodyDistance:
    """Certified bounds of the distance of two bodies: solids, sheets or single faces, trimmed.

    Parameters
    ----------
    a, b : Body, Face, NurbsSurface, or several faces
        Faces given together share their edges and vertices.
    poses : (q_a, q_b), optional
        A `Pose` or a row (7,) each; a body's own by default, else the identity.
    tolerance : float
        How far the two bounds may be apart, in the units of the shapes.
    budget : int, optional
        Pairs of parts that may be looked at; 200,000 by default. The bounds are true whatever it is.

    Returns
    -------
    BodyDistance
        Bodies whose surfaces meet are 0 apart. Where a closed body has the other one inside, and their surfaces do not
        meet, the status is ENCLOSED, in both orders.

    Raises
    ------
    InputError, TypeError
        Shapes without faces, wrong poses, coordinates of 1e150 and more, a tolerance or a budget that is not positive.

    Notes
    -----
    Trees of a shape's parts are kept with its faces and reused by later queries at other poses.
    """
    faces = faces_of("a", a), faces_of("b", b)
    if not isinstance(poses, (tuple, list, np.ndarray)) or len(poses) != 2:
        raise InputError(f"poses is {poses!r}; expected a pair, one pose for a and one for b")
    q = np.empty((2, 7))
    q[0], q[1] = pose_of("poses[0]", a, poses[0]), pose_of("poses[1]", b, poses[1])
    tolerance = positive("tolerance", tolerance)
    return distance_at(faces, q, tolerance, _BUDGET if budget is None else integer("budget", budget, 1, 2**40))


def distance_at(faces: tuple[Faces, Faces], q: Array, tolerance: float, pairs: int) -> BodyDistance:
    """The same of faces at poses q (2, 7) that are known to be right, as those of a scene are."""
    found = bodies_apart(body_tree(faces[0]), body_tree(faces[1]), q, tolerance, pairs)
    status = _status(found, tolerance)
    if status is DistanceStatus.CONVERGED and found.lower > 0.0 and _is_enclosed(faces, q, found, tolerance):
        status = DistanceStatus.ENCLOSED
    return BodyDistance(found.lower, found.upper, found.points, status, found.pairs, (faces, found, q))


class Beyond(NamedTuple):
    """Whether two bodies are proven to be farther apart than a length, and whether one may be inside of the other."""

    is_apart: bool
    may_nest: bool


def beyond(a: Shape, b: Shape, q: Array, length: float, budget: int) -> Beyond:
    """Whether surfaces at poses q (2, 7) are farther apart than a length, as far as a budget tells."""
    faces = faces_of("a", a), faces_of("b", b)
    found = bodies_apart(body_tree(faces[0]), body_tree(faces[1]), q, length, budget, length)
    return Beyond(found.lower > length, found.is_boxed(0) or found.is_boxed(1))


def _status(found: Nearest, tolerance: float) -> DistanceStatus:
    if found.upper - found.lower <= tolerance:
        return DistanceStatus.CONVERGED
    return DistanceStatus.BUDGET_SPENT if found.status == SPENT else DistanceStatus.ROUNDED


def _is_enclosed(faces: tuple[Faces, Faces], q: Array, found: Nearest, tolerance: float) -> bool:
    """Whether one of two bodies whose surfaces are apart lies wholly inside the other one."""
    for outer in range(2):
        if not found.is_boxed(outer) or not _holds(faces[outer], q[outer], found, outer):
            continue
        shells = shells_of(faces[1 - outer])
        if len(shells) == 1 or _holds_all(faces[outer], shells, q[[outer, 1 - outer]], tolerance):
            return True
    return False


def _holds_all(outer: Faces, shells: tuple[Faces, ...], q: Array, tolerance: float) -> bool:
    """Whether a body has all shells of another one inside."""
    for shell in shells:
        found = bodies_apart(body_tree(outer), body_tree(shell), q, tolerance, _BUDGET)
        if found.upper - found.lower > tolerance or not found.is_boxed(0) or not _holds(outer, q[0], found, 0):
            return False
    return True


def _holds(faces: Faces, q: Array, found: Nearest, side: int) -> bool:
    """Whether the body on a side of nearest points has the other one's inside."""
    if not is_closed(faces):
        return False
    if abs(found.facing(side)) > _ALONG:
        return found.facing(side) < 0.0
    turn = rotation_of(q[3:])
    here, there = (turn.T @ (found.points[k] - q[:3]) for k in (side, 1 - side))
    way = there - here
    return is_behind(faces, found.spot(side), here, way / float(np.linalg.norm(way)))
