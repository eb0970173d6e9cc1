"""Contacts that are lower pairs: of a bore and a pin of its radius, or of a socket and a ball of its radius.

Two such faces that are in each other touch all over or nowhere. The distance of two cylinders of one radius has extrema
where their axes cross, whatever the angle between these: a row of one extremum would hold there, with the pin through
the wall of its bore. So where the faces overlap, the contact is the joint that puts one axis on the other, or one
center, and has its rows. From farther away, where a pin is beside its hole, it is a contact like others.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.contact import Contact, side_faces
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Cylindrical, Spherical
from assembly.constraints.model.objectives import Objective
from assembly.constraints.packing.places import names_of_whole
from assembly.geometry.recognition.forms import Cylinder, Sphere
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.manifolds.elementary_faces import ElementaryFace, elementary_faces

__all__ = ["LowerPair", "lower_pairs"]

Array = NDArray[np.float64]
# Radii are equal that differ by no more than this part of them.
EQUAL = 1e-9
# Cosine of the angle by which a shaft leans in its bore at most.
UPRIGHT = 0.7


@dataclass(frozen=True, eq=False)
class LowerPair:
    """A contact of a hollow face and of a full one of its radius.

    Attributes
    ----------
    number : int
        Of the contact among its scene's constraints.
    bodies : (Body, Body)
        Of the hollow face, and of the full one.
    faces : (ElementaryFace, ElementaryFace)
    joints : (Joint, Joint)
        What the contact is where axes point the same way, and where they are opposed; of a ball one and the same.
    """

    number: int
    bodies: tuple[Body, Body]
    faces: tuple[ElementaryFace, ElementaryFace]
    joints: tuple[Joint, Joint]

    def at(self, poses: Mapping[Body, Array]) -> Joint | None:
        """The joint that the contact is where bodies are at these poses (7,); None where its faces do not overlap."""
        rows = [poses[body] for body in self.bodies]
        turns = [rotation_matrix(row[3:]) for row in rows]
        h, f = self.faces[0].form, self.faces[1].form
        if isinstance(h, Sphere) and isinstance(f, Sphere):
            off = turns[1] @ f.center + rows[1][:3] - turns[0] @ h.center - rows[0][:3]
            return self.joints[0] if np.linalg.norm(off) < h.radius else None
        assert isinstance(h, Cylinder) and isinstance(f, Cylinder)
        axis, along = turns[0] @ h.axis, turns[1] @ f.axis
        cosine = float(axis @ along)
        if abs(cosine) < UPRIGHT:
            return None
        ends = [
            [float(axis @ (turn @ corner + row[:3])) for corner in product(*face.box.T)]
            for turn, row, face in zip(turns, rows, self.faces, strict=True)
        ]
        low, high = max(map(min, ends)), min(map(max, ends))
        if low >= high:
            return None
        # Where the axis of the shaft is in the middle of what is along both.
        point, origin = turns[1] @ f.point + rows[1][:3], turns[0] @ h.point + rows[0][:3]
        off = point + (0.5 * (low + high) - axis @ point) / cosine * along - origin
        if not np.linalg.norm(off - (axis @ off) * axis) < h.radius:
            return None
        return self.joints[0 if cosine > 0.0 else 1]


def lower_pairs(
    constraints: Sequence[Constraint], objectives: Sequence[tuple[float, Objective]] = ()
) -> list[LowerPair]:
    """The contacts that may be lower pairs.

    One with trims or places is of whole surfaces, and what is one-sided may open. Beside a least gap a contact has
    a place.
    """
    if any(isinstance(item, Clearance) and item.minimum > 0.0 for item in constraints):
        return []
    trimmed = names_of_whole(constraints, objectives)
    found = []
    for number, item in enumerate(constraints):
        if isinstance(item, Contact) and not item.unilateral and not item.minimum and item.name not in trimmed:
            pair = _lower_pair(number, item)
            if pair is not None:
                found.append(pair)
    return found


def _lower_pair(number: int, contact: Contact) -> LowerPair | None:
    """What a contact of two single faces may be."""
    sides = [side_faces(contact.a), side_faces(contact.b)]
    if any(len(faces) != 1 for faces in sides):
        return None
    found = [elementary_faces(faces) for faces in sides]
    if not (found[0] and found[1]) or found[0][0].is_outward == found[1][0].is_outward:
        return None
    order = (1, 0) if found[0][0].is_outward else (0, 1)
    faces = found[order[0]][0], found[order[1]][0]
    both = contact.body_a, contact.body_b
    bodies = both[order[0]], both[order[1]]
    h, f, name = faces[0].form, faces[1].form, contact.name
    if isinstance(h, Sphere) and isinstance(f, Sphere) and _is_equal(h.radius, f.radius):
        ball = Spherical(bodies[0].point(*h.center), bodies[1].point(*f.center), name)
        return LowerPair(number, bodies, faces, (ball, ball))
    if isinstance(h, Cylinder) and isinstance(f, Cylinder) and _is_equal(h.radius, f.radius):
        bore = bodies[0].frame(h.point, h.axis)
        joints = [Cylindrical(bore, bodies[1].frame(f.point, sense * f.axis), name) for sense in (1.0, -1.0)]
        return LowerPair(number, bodies, faces, (joints[0], joints[1]))
    return None


def _is_equal(radius: float, other: float) -> bool:
    return abs(radius - other) <= EQUAL * radius
