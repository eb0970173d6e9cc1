"""How far faces are inside or outside of the cone of a hollow wall, or of a half space.

About an axis a, from the apex, with the half angle alpha,

    f(x) = cos(alpha) |x across a| - sin(alpha) a.x

is zero on the cone (with -90 degrees, on the plane across a), convex, and |f(x) - f(y)| <= |x - y|. So of two faces the
least of f over one, less the most of f over the other one, is a lower bound of their distance, whatever they are. Both
are bounded face by face: from cells, and where that would not be exact (the wall, flat faces with its circle for a
hole, what fills it and its ends) from what the faces are recognized to be.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cone
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.body_cells import BodyCells, cells_of_body
from assembly.proximity.clearance.records import LINKS, NODE
from assembly.proximity.manifolds.clip import is_within
from assembly.proximity.manifolds.elementary_faces import elementary_faces
from assembly.proximity.manifolds.records import FRAME, SEGMENT
from assembly.proximity.manifolds.regions import PlaneRegion, plane_region

__all__ = ["Level"]

Array = NDArray[np.float64]
# Planes that lean by less are across an axis.
ACROSS = 1e-9


@dataclass(frozen=True, eq=False)
class Level:
    """The function f of a cone, or of a plane.

    Attributes
    ----------
    apex, axis : (3,)
        Of a plane a point and the normal.
    half_angle : float
        -pi/2 of a plane [rad].
    """

    apex: Array
    axis: Array
    half_angle: float

    def seen_from(self, turn: Array, shift: Array) -> Level:
        """The same in the axes of a body that is at x -> turn x + shift."""
        return Level((self.apex - shift) @ turn, self.axis @ turn, self.half_angle)

    def of_points(self, points: Array) -> Array:
        """f of points (..., 3)."""
        off = points - self.apex
        along = off @ self.axis
        flat = np.linalg.norm(off - along[..., None] * self.axis, axis=-1)
        return np.asarray(np.cos(self.half_angle) * flat - np.sin(self.half_angle) * along)

    def most_of_circle(self, center: Array, axis: Array, radius: float) -> float:
        """What f is at most over a disc across a unit axis: see `manifolds/round_pair.py`, `most_level`."""
        # The normals of f are at 90 degrees less |alpha| from a line along the axis.
        lean = float(np.arcsin(min(float(np.linalg.norm(np.cross(self.axis, axis))), 1.0)))
        return float(self.of_points(center)) + radius * float(np.cos(max(abs(self.half_angle) - lean, 0.0)))

    def least_of_faces(self, faces: tuple[Face, ...], wall: int | None = None) -> Array:
        """What f is at least on each face of a body, of which one may be a wall of the cone."""
        topology, cells = solid_of(faces), cells_of_body(faces)
        least = _by_face(np.minimum, self._least_of_cells(cells), cells, len(topology.faces))
        for k, face in enumerate(topology.faces):
            region, forms = plane_region(face), elementary_faces((face,))
            if region is not None:
                least[k] = max(least[k], self._least_of_region(region))
            elif self.half_angle == -0.5 * np.pi and forms and isinstance(forms[0].form, Cone):
                opposite = Level(self.apex, -self.axis, self.half_angle)
                least[k] = max(least[k], -opposite._most_of_cone(forms[0].form))
        if wall is not None:
            (one,) = elementary_faces((topology.faces[wall],))
            least[wall] = max(least[wall], -one.form.deviation)
        return least

    def most_of_faces(self, faces: tuple[Face, ...]) -> Array:
        """What f is at most on each face of a body."""
        topology, cells = solid_of(faces), cells_of_body(faces)
        most = _by_face(np.maximum, self._most_of_cells(cells), cells, len(topology.faces))
        for k, face in enumerate(topology.faces):
            region, forms = plane_region(face), elementary_faces((face,))
            if region is not None:
                most[k] = min(most[k], self._most_of_region(region))
            elif forms and isinstance(forms[0].form, Cone):
                most[k] = min(most[k], self._most_of_cone(forms[0].form))
        return most

    def _least_of_cells(self, cells: BodyCells) -> Array:
        """Of each first cell, by a plane of the cone at the side on which it is."""
        nodes = rows_of(NODE, cells.nodes)[cells.first]
        off = nodes.corner - self.apex
        middle = off.mean(axis=1)
        middle = middle - (middle @ self.axis)[:, None] * self.axis
        lengths = np.linalg.norm(middle, axis=1)
        unit = middle / np.where(lengths > 0.0, lengths, 1.0)[:, None]
        normal = np.cos(self.half_angle) * unit - np.sin(self.half_angle) * self.axis
        return np.asarray((off * normal[:, None]).sum(axis=2).min(axis=1) - _across(nodes, normal))

    def _most_of_cells(self, cells: BodyCells) -> Array:
        nodes = rows_of(NODE, cells.nodes)[cells.first]
        # The normals of f are all one of a plane.
        wider = nodes.disc + nodes.rho if self.half_angle != -0.5 * np.pi else _across(nodes, self.axis)
        return np.asarray(self.of_points(nodes.corner).max(axis=1) + wider)

    def _least_of_region(self, region: PlaneRegion) -> float:
        """Of a flat face across the axis, by how near its borders come to that; -inf where it is not across."""
        frame, segments = rows_of(FRAME, region.frame[None])[0], rows_of(SEGMENT, region.segments)
        lean = float(np.linalg.norm(np.cross(frame.normal, self.axis)))
        if lean > ACROSS:
            return -np.inf
        off = self.apex - frame.origin
        center = np.array([off @ frame.right, off @ frame.up])
        if is_within(region.segments, float(center[0]), float(center[1]), 0.0):
            nearest = 0.0
        else:
            to_circles = np.abs(np.linalg.norm(segments.center - center, axis=1) - segments.radius)
            chord = segments.end - segments.begin
            part = ((center - segments.begin) * chord).sum(axis=1) / (chord**2).sum(axis=1)
            foot = segments.begin + np.clip(part, 0.0, 1.0)[:, None] * chord
            to_chords = np.linalg.norm(foot - center, axis=1)
            nearest = float(np.where(segments.radius > 0.0, to_circles, to_chords).min())
        # Over the face a plane that leans is off by so much; borders are as far off as its curves.
        slack = 3.0 * region.deviation + 2.0 * lean * (region.size + float(np.linalg.norm(off)))
        height = float(-off @ self.axis)
        return float(np.cos(self.half_angle) * nearest - np.sin(self.half_angle) * height - slack)

    def _most_of_region(self, region: PlaneRegion) -> float:
        """Of a flat face, whose hull is that of its segments' ends and circles."""
        frame, segments = rows_of(FRAME, region.frame[None])[0], rows_of(SEGMENT, region.segments)
        axes = np.array([frame.right, frame.up])
        most = float(self.of_points(frame.origin + segments.begin @ axes).max(initial=-np.inf))
        for one in segments[segments.radius > 0.0]:
            most = max(most, self.most_of_circle(frame.origin + one.center @ axes, frame.normal, float(one.radius)))
        return most + 3.0 * region.deviation

    def _most_of_cone(self, form: Cone) -> float:
        """Of a cone, which is in the hull of its end circles."""
        ends = (
            self.most_of_circle(form.apex + height * form.axis, form.axis, height * float(np.tan(form.half_angle)))
            for height in form.heights
        )
        return max(ends) + form.deviation


def _across(nodes: np.recarray, normals: Array) -> Array:
    """How far the discs and balls of cells go along unit normals."""
    along = (nodes.ruling * normals).sum(axis=1)
    return np.asarray(nodes.disc * np.linalg.norm(normals - along[:, None] * nodes.ruling, axis=1) + nodes.rho)


def _by_face(reduce: np.ufunc, values: Array, cells: BodyCells, count: int) -> Array:
    """The least or the most of the values of each face's first cells."""
    found = np.full(count, np.inf if reduce is np.minimum else -np.inf)
    reduce.at(found, rows_of(LINKS, cells.links).face[cells.first], values)
    return found
