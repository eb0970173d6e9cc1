"""Shafts in bores and balls in sockets: of which pairs of bodies a wall of one fits around the other, and where."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.contact import side_faces
from assembly.constraints.packing.corners import body_of
from assembly.constraints.packing.scene import Packed
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cylinder, Sphere
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.manifolds.elementary_faces import elementary_faces

__all__ = ["Fit", "fits_of"]

Array = NDArray[np.float64]
# The thinnest shaft, or ball, that fits a bore, in parts of its radius, and what rounding may do to equal ones.
THINNEST, ROUNDED = 0.9, 1e-9


class _Wall(NamedTuple):
    """A cylinder or a ball among the faces of a body: number of the face, whether it is full, its form."""

    number: int
    is_outward: bool
    form: Cylinder | Sphere


class Fit(NamedTuple):
    """Two faces of a pair of bodies, of which one is a bore or a socket, and the other a shaft or a ball that fits it.

    Attributes
    ----------
    numbers : (int, int)
        Of the faces, of the first body and of the second.
    bodies : (int, int)
        Rows of the poses: of the body with the bore, and of the shaft.
    bore, shaft : Cylinder or Sphere
        Both of one kind.
    """

    numbers: tuple[int, int]
    bodies: tuple[int, int]
    bore: Cylinder | Sphere
    shaft: Cylinder | Sphere

    @property
    def is_by_rims(self) -> bool:
        """Whether rims keep both faces apart, and a row of one face on the other is implied."""
        return isinstance(self.bore, Cylinder)

    def holds(self, q: Array) -> bool:
        """Whether the shaft is in the bore where bodies are at poses (n, 7), along some of its axis; or the ball."""
        one, other = (rotation_matrix(q[body, 3:]) for body in self.bodies)
        most = self.bore.radius - THINNEST * self.shaft.radius
        if isinstance(self.bore, Sphere) or isinstance(self.shaft, Sphere):
            assert isinstance(self.bore, Sphere) and isinstance(self.shaft, Sphere)
            off = other @ self.shaft.center + q[self.bodies[1], :3] - one @ self.bore.center - q[self.bodies[0], :3]
            return float(np.linalg.norm(off)) <= most
        axis, along = one @ self.bore.axis, other @ self.shaft.axis
        cosine = float(axis @ along)
        low, high = self.bore.heights
        place = other @ self.shaft.point + q[self.bodies[1], :3] - one @ self.bore.point - q[self.bodies[0], :3]
        ends = sorted(float(place @ axis) + cosine * height for height in self.shaft.heights)
        low, high = max(low, ends[0]), min(high, ends[1])
        if low >= high:
            return False
        middle = place + (0.5 * (low + high) - float(place @ axis)) / cosine * along
        off = middle - float(middle @ axis) * axis
        return float(np.linalg.norm(off)) <= most


@lru_cache(maxsize=256)
def _walls(faces: tuple[Face, ...]) -> tuple[_Wall, ...]:
    """The cylinders and balls among a body's faces."""
    return tuple(
        _Wall(number, one.is_outward, one.form)
        for number, face in enumerate(faces)
        for one in elementary_faces((face,))
        if isinstance(one.form, Cylinder | Sphere)
    )


def fits_of(packed: Packed, bodies: Sequence[Body]) -> dict[int, list[Fit]]:
    """Of every pair of a packed scene's clearances the bores that fit shafts, and sockets; no pair without any.

    Parameters
    ----------
    packed : Packed
    bodies : sequence of Body
    """
    number = {id(body): k for k, body in enumerate(bodies)}
    found: dict[int, list[Fit]] = {}
    for k, sides in enumerate(packed.kept_pairs):
        rows = [number[id(body_of(side))] for side in sides]
        for one in _walls(side_faces(sides[0])):
            for other in _walls(side_faces(sides[1])):
                if one.is_outward == other.is_outward or type(one.form) is not type(other.form):
                    continue
                bore, shaft = (other, one) if one.is_outward else (one, other)
                thin = THINNEST * bore.form.radius
                if thin <= shaft.form.radius <= (1.0 + ROUNDED) * bore.form.radius:
                    held = (rows[1], rows[0]) if one.is_outward else (rows[0], rows[1])
                    found.setdefault(k, []).append(Fit((one.number, other.number), held, bore.form, shaft.form))
    return found
