"""Bodies that nearly fit moved to where they do: a shaft into its bore, flush faces.

For a shaft that is tilted in its bore, a bolt beside its hole or a slider that is off its rail, the many rows of a
clearance contradict each other. But if faces conform up to a small play, tilt and shift, it is known where they fit:
where their axes and planes coincide. A solve begins there as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import side_faces
from assembly.constraints.model.joint import SAME_AXIS, Joint, Side
from assembly.constraints.model.joints import ALONG, Cylindrical, Spherical
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.geometry.recognition.forms import Cone, Cylinder, Plane, Sphere
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.manifolds.ball_manifolds import seats
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces
from assembly.solve.clearance_proof import answers_at, can_prove, proven_pairs
from assembly.solve.interruption import Interruption
from assembly.studies.parting import is_stuck

if TYPE_CHECKING:
    from assembly.assembly import Assembly

__all__ = ["NearFit", "NotBelow", "Seat", "drop_farthest", "fits", "seated"]

Array = NDArray[np.float64]
# Faces that nearly fit are tilted by at most this [rad], and off by at most that part of the smaller body's size, or of
# the radius; a shaft with less than this part of its bore's radius does not fit it.
LEAN, OFF, FILLS = 0.15, 0.1, 0.8
# Normals that differ by less are parallel, and heights that differ by less of a reach are equal: parts of files are
# inexact.
PARALLEL = 1e-8
# A joint that is violated by more than this part of the worst one counts as contradicting.
CONTRADICTS = 1e-2


class NotBelow(Joint):
    """Two flat faces that are parallel, the second on the first or above it."""

    _zero = SAME_AXIS
    _free = {"height": ALONG}

    def __init__(self, frame_a: Side, frame_b: Side, name: str) -> None:
        super().__init__(frame_a, frame_b, name, "aligned", height=(None, (0.0, None)))


class _Face:
    """A face of a body at a pose: its kind, orientation and box; and the same face in the body's axes."""

    def __init__(self, body: Body, turn: Array, shift: Array, face: ElementaryFace) -> None:
        self.body, self.form, self.is_outward = body, face.form, face.is_outward
        self.turn, self.shift, self.box = turn, shift, face.box
        low, high = face.box
        middle, half = turn @ (0.5 * (low + high)) + shift, np.abs(turn) @ (0.5 * (high - low))
        self.low, self.high = middle - half, middle + half

    def at(self, point: Array) -> Array:
        """A point of the body in the scene's axes."""
        return np.asarray(self.turn @ point + self.shift)

    def near(self, other: _Face, reach: float) -> bool:
        """Whether the boxes are within a reach of each other."""
        return bool((self.low <= other.high + reach).all() and (other.low <= self.high + reach).all())


class Seat(NamedTuple):
    """Where bodies fit.

    Attributes
    ----------
    poses : (n, 7)
    move : float
        Of a scene without an objective, what would be minimized: how far bodies were moved.
    has_bores : bool
        Whether a shaft is in its bore, a cone or a ball in its seat or a ball in its socket; else only flat faces fit.
    """

    poses: Array
    move: float
    has_bores: bool


def seated(scene: Assembly, q: Array, touching: float, interruption: Interruption) -> Seat | None:
    """Where bodies that clearances keep apart, and that are stuck in each other at poses (n, 7), fit.

    Bodies of which nothing is proven count as stuck. If they cannot all fit at once, the nearest do. None if none are
    stuck, or none of their faces nearly fit.
    """
    packed = scene.packed()
    if not can_prove(packed):
        return None
    answers = answers_at(packed, scene.bodies, q, touching)
    stuck = [
        pair
        for pair, answer in zip(proven_pairs(packed, scene.bodies)[1], answers, strict=True)
        # A ball lies nearly along its socket where both cross: often a look spends its budget before it is told.
        if answer.verdict is Verdict.UNDECIDED or is_stuck(answer, touching)
    ]
    others = [item for item in scene.constraints if not isinstance(item, Clearance)]
    taken = {item.name for item in others}
    names = (name for name in map("fit {}".format, count()) if name not in taken)
    held = [fit for a, b in stuck for fit in fits((scene.bodies[a], scene.bodies[b]), q[[a, b]], names)]
    seat = None
    while held and not interruption.is_over():
        inner = type(scene)(scene.bodies)
        inner._take_constraints([*others, *(fit.joint for fit in held)])
        there = inner._from_start(q, None, {}, interruption)
        has_bores = any(not isinstance(fit.joint, NotBelow) for fit in held)
        seat = Seat(there.q.copy(), there.objective, has_bores) if np.isfinite(there.q).all() else None
        if there.success or not drop_farthest(held, there.violations):
            break
    return seat


@dataclass(frozen=True, eq=False)
class NearFit:
    """A joint by which two faces would fit, and how far two flat ones are off it; zero for round ones."""

    joint: Constraint
    off: float


def drop_farthest(held: list[NearFit], violations: Mapping[str, float]) -> bool:
    """Remove, in place, the flat faces that are farthest off among those that contradict; whether there were any.

    If not all can fit at once, such as both flanks of a key with play, or a slot's far flank beside its gib, the
    nearest do. The violations of a failed solve tell which ones contradict.
    """
    worst = max((violations[fit.joint.name] for fit in held if fit.off > 0.0), default=0.0)
    contradict = [fit for fit in held if fit.off > 0.0 and violations[fit.joint.name] >= CONTRADICTS * worst]
    if not contradict:
        return False
    held.remove(max(contradict, key=lambda fit: fit.off))
    return True


def fits(bodies: tuple[Body, Body], rows: Array, names: Iterator[str]) -> Iterator[NearFit]:
    """Joints by which faces of two bodies would fit that nearly do at poses (2, 7).

    Of flat faces one may stay off the other: not all of a stack that face each other come to touch.
    """
    reach = OFF * min(body.size for body in bodies)
    ones, others = (
        [_Face(body, turn, row[:3], face) for face in elementary_faces(first_equal(side_faces(body)))]
        for body, row, turn in zip(bodies, rows, map(rotation_matrix, rows[:, 3:]), strict=True)
    )
    axes: list[tuple[Array, Array]] = []
    flush: list[tuple[float, _Face, _Face]] = []
    for one in ones:
        for other in others:
            if not one.near(other, reach):
                continue
            if isinstance(one.form, Plane) and isinstance(other.form, Plane):
                off = _off_plane(one, other)
                if off <= reach:
                    flush.append((off, one, other))
            elif one.is_outward != other.is_outward:
                yield from (NearFit(joint, 0.0) for joint in _round(one, other, axes, names))
    # The flank of a key is near both the flank of its slot and the wall beyond: it is paired with the nearer one.
    # Projections of a body all go with the one face that they stand on.
    nearest: dict[_Face, float] = {}
    for off, one, other in flush:
        for face in (one, other):
            nearest[face] = min(off, nearest.get(face, np.inf))
    for off, one, other in flush:
        if off <= max(nearest[one], nearest[other]):
            (p, m), (q, n) = _plane(one), _plane(other)
            yield NearFit(NotBelow(one.body.frame(p, m), other.body.frame(q, -n), next(names)), off)


def _plane(face: _Face) -> tuple[Array, Array]:
    """A point of a flat face and its outward normal, in its body's axes."""
    assert isinstance(face.form, Plane)
    return face.form.point, face.form.normal if face.is_outward else -face.form.normal


def _off_plane(one: _Face, other: _Face) -> float:
    """How far two flat faces are off each other, in the middle of where both are; infinite if they cannot be flush.

    They have to be opposed, and none farther behind the other one than its wall is thick: it would be on the other
    side of the wall.
    """
    (p, m), (q, n) = _plane(one), _plane(other)
    up, down = one.turn @ m, other.turn @ n
    if not up @ down < -np.cos(LEAN):
        return float(np.inf)
    middle = 0.5 * (np.maximum(one.low, other.low) + np.minimum(one.high, other.high))
    above, below = float((middle - one.at(p)) @ up), float((middle - other.at(q)) @ down)
    if above + below < 0.0 and -above - below > min(_thickness(one), _thickness(other)):
        return float(np.inf)
    return abs(above) + abs(below)


def _thickness(face: _Face) -> float:
    """How far behind a flat face the wall of its body ends that it is one side of; infinite if nothing is behind it."""
    point, normal = _plane(face)
    found = [
        float((point - other.form.point) @ normal)
        for other in elementary_faces(first_equal(side_faces(face.body)))
        if isinstance(other.form, Plane)
        and (other.form.normal if other.is_outward else -other.form.normal) @ normal < PARALLEL - 1.0
        and _is_beside(face.box, other.box, normal)
    ]
    return min((deep for deep in found if deep > 0.0), default=float(np.inf))


def _is_beside(one: Array, other: Array, normal: Array) -> bool:
    """Whether two boxes (2, 3) meet in those directions that are across a normal."""
    across = np.abs(normal) < 0.5
    return bool(((one[0] < other[1]) & (other[0] < one[1]))[across].all())


def _round(one: _Face, other: _Face, axes: list[tuple[Array, Array]], names: Iterator[str]) -> Iterator[Constraint]:
    """The joint of a shaft and its bore, a cone or a ball and its seat, a ball and its socket; one for each axis."""
    hollow, full = (other, one) if one.is_outward else (one, other)
    h, f = hollow.form, full.form
    if isinstance(h, Sphere) and isinstance(f, Sphere) and FILLS * h.radius <= f.radius <= (1.0 + 1e-9) * h.radius:
        if np.linalg.norm(hollow.at(h.center) - full.at(f.center)) <= h.radius:
            yield Spherical(hollow.body.point(*h.center), full.body.point(*f.center), next(names))
    elif (
        isinstance(h, Cylinder) and isinstance(f, Cylinder) and FILLS * h.radius <= f.radius <= (1.0 + 1e-9) * h.radius
    ):
        if _is_near_axis((hollow, full), (h.point, h.axis), (f.point, f.axis), h.radius, axes):
            sense = np.sign((hollow.turn @ h.axis) @ (full.turn @ f.axis))
            yield Cylindrical(hollow.body.frame(h.point, h.axis), full.body.frame(f.point, sense * f.axis), next(names))
    elif isinstance(h, Cylinder | Cone) and isinstance(f, Sphere):
        for seat in seats(h, f):
            if np.linalg.norm(hollow.at(seat) - full.at(f.center)) <= f.radius:
                yield Spherical(hollow.body.point(*seat), full.body.point(*f.center), next(names))
    elif isinstance(h, Cone) and isinstance(f, Cone) and abs(h.half_angle - f.half_angle) < 1e-9:
        radius = max(f.heights) * np.tan(f.half_angle)
        if (hollow.turn @ h.axis) @ (full.turn @ f.axis) > 0.0 and _is_near_axis(
            (hollow, full), (h.apex, h.axis), (f.apex, f.axis), radius, axes
        ):
            yield Cylindrical(
                hollow.body.frame(h.apex, h.axis), full.body.frame(f.apex, f.axis), next(names), slide=0.0
            )


def _is_near_axis(
    faces: tuple[_Face, _Face],
    hollow: tuple[Array, Array],
    full: tuple[Array, Array],
    radius: float,
    axes: list[tuple[Array, Array]],
) -> bool:
    """Whether two axes, each a point and a direction of its body, nearly coincide, and are the first that do."""
    along = faces[0].turn @ hollow[1]
    off = faces[1].at(full[0]) - faces[0].at(hollow[0])
    off = off - (off @ along) * along
    if abs(along @ (faces[1].turn @ full[1])) < np.cos(LEAN) or np.linalg.norm(off) > radius:
        return False
    point = faces[0].at(hollow[0])
    for known, direction in axes:
        away = point - known
        if (
            np.linalg.norm(np.cross(along, direction)) < 1e-9
            and np.linalg.norm(np.cross(away, direction)) < 1e-9 * radius
        ):
            return False
    axes.append((point, along))
    return True
