"""Pairs of faces with a loop beside the contact, and points of the solve's loop whose contacts are free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import assembly as asm
from assembly.constraints.program import records as layout
from assembly.constraints.program import row_terms
from assembly.constraints.program.evaluate import evaluate
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.proximity.extrema.lifted_pair import coordinate_lengths
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.loop.residuals import arrange
from tests.laws.loop_point import LoopPoint, room_of_shape
from tests.laws.scenes import dome, placed

LOOPS = ("circle", "polygon", "spline")
SURFACES = ("torus", "ellipsoid", "dome")


def circle(center, radius):
    """Nine rational points, counterclockwise."""
    turns = np.arange(9) * 0.25 * np.pi
    weights = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    points = radius * np.stack([np.cos(turns), np.sin(turns)], 1) / weights[:, None]
    points[-1] = points[0]
    return NurbsCurve(points + center, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, weights)


def polygon(points):
    """Straight lines from corner to corner."""
    points = np.asarray(points, float)
    ends = np.roll(points, -1, axis=0)
    return [NurbsCurve([a, b], [0.0, 0.0, 1.0, 1.0], 1) for a, b in zip(points, ends, strict=True)]


def arcs(points, bulge):
    """Arcs from corner to corner, outward by this part of each chord; inward where it is negative."""
    points = np.asarray(points, float)
    curves = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        out = bulge * np.array([b[1] - a[1], a[0] - b[0]])
        # Of a quadratic with weights 1, w, 1 the middle is w / (1 + w) of the way to its inner point.
        half = 2.0 * np.arctan(2.0 * abs(bulge))
        w = np.cos(half)
        curves.append(NurbsCurve([a, 0.5 * (a + b) + out * (1.0 + w) / w, b], [0, 0, 0, 1, 1, 1], 2, [1.0, w, 1.0]))
    return curves


def spline(rng, center, radius, count=7):
    """A closed cubic spline, continuous in curvature, around a center."""
    turns = 2.0 * np.pi * np.arange(count) / count
    points = np.stack([np.cos(turns), np.sin(turns)], 1) * radius * rng.uniform(0.85, 1.15, (count, 1))
    return NurbsCurve(center + np.concatenate([points, points[:3]]), np.arange(-3.0, count + 4.0), 3)


def loop_beside(rng, kind, uv, radius, inside, corner=False):
    """A loop whose nearest point is about a tenth of its radius from uv, or whose nearest point is a corner."""
    angle = rng.uniform(0.0, 2.0 * np.pi)
    way = np.array([np.cos(angle), np.sin(angle)])
    if kind in ("polygon", "arcs"):
        turns = angle + (0.0 if corner else 0.2 * np.pi) + 0.4 * np.pi * np.arange(5)
        reach = radius if corner else radius * np.cos(0.2 * np.pi)
        center = np.asarray(uv) - (reach + (-0.1 if inside else 0.1) * radius) * way
        # A fifth of an edge aside, so that nothing is symmetric.
        if not corner:
            center = center + 0.2 * radius * np.array([-way[1], way[0]])
        points = center + radius * np.stack([np.cos(turns), np.sin(turns)], 1)
        return polygon(points) if kind == "polygon" else arcs(points, 0.08)
    if kind == "circle":
        return circle(np.asarray(uv) - (0.9 if inside else 1.1) * radius * way, radius)
    curve = spline(rng, np.zeros(2), radius)
    # From the point in this direction a step along the normal.
    at = np.linspace(*curve.domain, 400)
    points, rates = curve.evaluate(at, 1)
    k = int(np.argmax(points @ way))
    normal = np.array([-rates[k, 1], rates[k, 0]]) / np.linalg.norm(rates[k])
    foot = points[k] + (0.1 if inside else -0.1) * radius * normal
    return NurbsCurve(curve.control_points + np.asarray(uv) - foot, curve.knots, 3)


@dataclass(frozen=True, eq=False)
class TrimScene:
    """Two moving bodies in contact at x (4,), a trim on one of them, its loop's curves, poses (2, 7)."""

    scene: asm.Assembly
    trim: asm.TrimContact
    faces: tuple[Face, Face]
    curves: list[NurbsCurve]
    q: np.ndarray
    x: np.ndarray

    @property
    def side(self):
        return self.trim.side

    @property
    def uv(self):
        return self.x[2 * self.side : 2 * self.side + 2]

    def tracked(self, x=None, sides=()):
        """The solve's values of the contact: coordinates, no features, no normal; the sides of a loop with corners."""
        tracked = np.zeros((int(self.scene.packed().table[layout.TRACKED]), TRACK))
        tracked[0, :4] = self.x if x is None else x
        tracked[len(tracked) - len(sides) :, 0] = sides
        return tracked

    def at(self, q, x=None, sides=()):
        """A point of the solve with the contact tracked from x."""
        return LoopPoint(self.scene, q, self.tracked(x, sides))


def _surface(rng, kind):
    if kind == "torus":
        return asm.shapes.torus(rng.uniform(1.8, 2.4), rng.uniform(0.6, 0.9))
    if kind == "ellipsoid":
        return asm.shapes.ellipsoid(*rng.uniform(1.0, 2.0, 3))
    return dome(rng)


def trim_scene(seed, surface, loop, side, form, keep="on", gap=0.0, inside=True, corner=False):
    """A convex place of a surface with a loop against an ellipsoid."""
    rng = np.random.default_rng(seed)
    own, other = _surface(rng, surface), asm.shapes.ellipsoid(*rng.uniform(0.5, 1.0, 3))
    uv = []
    for k in range(2):
        breaks = own.breaks()[k]
        middle = 0 if surface == "torus" and k == 1 else (breaks.size - 1) // 2
        uv.append(breaks[middle] + rng.uniform(0.3, 0.7) * (breaks[middle + 1] - breaks[middle]))
    v = other.breaks()[1]
    there = [rng.uniform(0.3, 0.7) * breaks[1] for breaks in (other.breaks()[0], v)]
    radius = 0.06 * float(np.ptp(own.domain, axis=1).min())
    curves = loop_beside(rng, loop, uv, radius, inside, corner)
    curves = curves if isinstance(curves, list) else [curves]
    faces, places = [Face(own), Face(other)], [uv, there]
    if side == "b":
        faces, places = faces[::-1], places[::-1]
    q_f = np.concatenate([rng.normal(size=3), rng.normal(size=4)])
    q_f[3:] /= np.linalg.norm(q_f[3:])
    q_g = placed(faces[0], places[0], q_f, faces[1], places[1], gap, rng.uniform(0.0, 6.3))
    bodies = [asm.Body(n, f, q[:3], q[3:]) for n, f, q in zip("fg", faces, (q_f, q_g), strict=True)]
    scene = asm.Assembly(bodies)
    contact = asm.Contact(*bodies, "contact")
    trim = asm.TrimContact(contact, curves, keep, form, side=side, name="trim")
    scene.constrain(contact, trim)
    return TrimScene(scene, trim, tuple(faces), curves, scene.q, np.concatenate(places))


class FreePoint:
    """The rows at poses and contact coordinates x (4,), which are unknowns of their own."""

    def __init__(self, case, q, x, lengths=None, sides=()):
        base = case.at(case.q)
        self.table, self.pool, packed = base.table, base.pool, base.packed
        rows, moving = int(self.table[layout.ROWS]), int(self.table[layout.MOVING])
        self.rows, self.n = rows + 4, 6 * moving + 4
        scaled = np.array(q, dtype=float)
        scaled[:, :3] = (scaled[:, :3] - packed.reference) / packed.scale
        self.point = layout.Iterate(
            scaled,
            np.zeros_like(base.point.tracked),
            np.ones_like(base.point.records),
            np.empty(self.rows),
            np.zeros((self.rows, base.point.jacobian.shape[1])),
        )
        if lengths is None:
            lengths = np.empty((1, 4))
            row = self.table[layout.ROW_TABLE]
            surfaces = self.table[row + layout.SURFACE_F], self.table[row + layout.SURFACE_G]
            coordinate_lengths(self.table, self.pool, *surfaces, tuple(case.x), lengths, 0)
        self.lengths = lengths
        self.loose = base.loose._replace(free=np.zeros(1, dtype=np.int64), lengths=lengths)
        self.shape = room_of_shape(self.table, self.rows, self.n, self.table[:0])
        arrange(self.table, self.loose.free, self.shape, self.rows, self.n)
        start = case.tracked(x, sides)
        self.program = base.program._replace(structure=self.shape, lifted=self.loose)
        assert evaluate(self.program, start, np.inf, self.point) < 0

    @property
    def residual(self):
        return self.point.residual

    def jacobian(self):
        """Dense, (rows, n): twists of both bodies, then the coordinates times their lengths."""
        return np.concatenate([self.point.jacobian[:, :12], self.point.jacobian[:, 12:16]], 1)

    def row_terms(self, y, weights):
        """Second derivative of y . rows + J^T diag(weights) J, (n, n)."""
        hessian = np.zeros((self.n, self.n))
        row_terms.add_row_terms(self.program, self.point, y, weights, hessian)
        return np.triu(hessian) + np.triu(hessian, 1).T
