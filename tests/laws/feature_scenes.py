"""Pairs of features, made by placing g on f, and packed for the kernels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assembly._record import place_of
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.evaluate import (
    BREAKS_U,
    BREAKS_V,
    CELLS,
    COEFFICIENTS,
    CURVE_BREAKS,
    CURVE_COEFFICIENTS,
    CURVE_RECORD,
    SURFACE_RECORD,
)
from assembly.proximity.brep.records import (
    EDGE,
    EDGE_POINT,
    FACE,
    FACE_POINT,
    VERTEX,
)
from assembly.proximity.brep.writer import edge_over
from assembly.proximity.extrema.face_face import CONVERGED, LEFT_PATCH, NOT_CONVERGED, SINGULAR
from assembly.proximity.extrema.feature_query import FEATURE_PAIR, PAIR, feature_derivatives, find_features
from tests.laws.scenes import dome, inside, quadratic, quaternion_of, random_quaternion
from tests.laws.witness import rotated

# Places in what `find_features` writes.
POINT_F, POINT_G, NORMAL, GAP, ISOLATED, PROPER, FOLD = (
    place_of(FEATURE_PAIR, name) for name in ("point_f", "point_g", "normal", "gap", "isolated", "proper", "fold")
)
STATUS = {CONVERGED: "CONVERGED", SINGULAR: "SINGULAR", LEFT_PATCH: "LEFT_PATCH", NOT_CONVERGED: "NOT_CONVERGED"}


@dataclass(frozen=True, eq=False)
class Feature:
    """A face; an edge on a surface, or in space; a point of one, or of a face, that stays where it is; a vertex."""

    kind: int
    face: Face | None = None
    curve: NurbsCurve | None = None
    point: np.ndarray | None = None
    endless: bool = False

    def jet(self, x):
        """Point, first derivatives in body axes by what may move."""
        if self.kind == VERTEX:
            return (self.point,)
        if self.kind == EDGE_POINT:
            return Feature(EDGE, self.face, self.curve).jet(x)[:1]
        if self.kind == FACE_POINT:
            return self.face.surface.evaluate(x[0], x[1], 1)[:1]
        if self.kind == FACE:
            return self.face.surface.evaluate(x[0], x[1], 1)
        if self.face is None:
            return self.curve.evaluate(x[0], 1)
        c, d = self.curve.evaluate(x[0], 1)
        s, su, sv = self.face.surface.evaluate(c[0], c[1], 1)
        return s, su * d[0] + sv * d[1]

    def outward(self, rng, x):
        """Point and a unit vector that may be the normal of a contact."""
        p, *tangents = self.jet(x)
        if self.kind == FACE:
            n = self.face.sign * np.cross(*tangents)
        else:
            n = rng.normal(size=3)
            for t in tangents:
                n -= (n @ t) / (t @ t) * t
        return p, n / np.linalg.norm(n)


class Packed:
    """Two features in one table and one pool."""

    def __init__(self, f, g):
        self.kinds = (f.kind, g.kind)
        table, pool, at = [], [], []
        for feature in (f, g):
            surface, curve = -1, -1
            if feature.face is not None:
                record, numbers = feature.face.packed()
                surface = len(table)
                record = record.copy()
                record[[BREAKS_U, BREAKS_V, COEFFICIENTS, CELLS]] += len(pool)
                table += record.tolist()
                pool += numbers.tolist()
                assert record.size == SURFACE_RECORD
            if feature.curve is not None:
                record, numbers = feature.curve.packed()
                curve = len(table)
                record = record.copy()
                record[[CURVE_BREAKS, CURVE_COEFFICIENTS]] += len(pool)
                table += record.tolist()
                pool += numbers.tolist()
                assert record.size == CURVE_RECORD
            if feature.kind in (FACE, FACE_POINT):
                at.append(surface)
                continue
            at.append(len(table))
            if feature.kind == VERTEX:
                table += [len(pool), 0, 0, 0, 0]
                pool += feature.point.tolist()
            else:
                table += edge_over(surface, curve, feature.endless).tolist()
        self.table, self.pool = np.array(table, np.int64), np.array(pool, float)
        self.at = tuple(at)

    def solve(self, q, x, n=(0.0, 0.0, 0.0), size=4.0, turn=np.inf):
        """Status name, and what `find_features` writes."""
        out = np.empty(PAIR)
        q = np.asarray(q, float).reshape(2, 7)
        features = tuple(zip(self.kinds, self.at, strict=True))
        x, n = tuple(map(float, x)), tuple(map(float, n))
        status = find_features((self.table, self.pool), features, q, x, n, float(size), float(turn), out)
        return STATUS[status], out

    def derivatives(self, q, x, n=(0.0, 0.0, 0.0), size=4.0):
        """Rates of the parameters (4, 14), the gap's gradient (14,), its Hessian (12, 12), and the pair's residual."""
        first, hessian = np.empty((5, 14)), np.empty((12, 12))
        q = np.asarray(q, float).reshape(2, 7)
        features = tuple(zip(self.kinds, self.at, strict=True))
        x, n = tuple(map(float, x)), tuple(map(float, n))
        error, _isolated = feature_derivatives((self.table, self.pool), features, q, x, n, float(size), first, hessian)
        return first[:4], first[4], hessian, error


def plane_curve(rng, surface, at):
    """A bent curve in the parameters of a surface, through the point `at`, within the span around it."""
    span = []
    for k in range(2):
        breaks = surface.breaks()[k]
        i = min(np.searchsorted(breaks, at[k], "right") - 1, breaks.size - 2)
        span.append(0.18 * (breaks[i + 1] - breaks[i]))
    angle = rng.uniform(0.0, 6.3)
    x, y = np.linspace(-1.0, 1.0, 4), rng.uniform(-0.2, 0.2, 4)
    points = span * np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], 1)
    # One piece: differences feel the derivatives of short pieces.
    knots = np.repeat([0.0, rng.uniform(0.5, 3.0)], 4)
    curve = NurbsCurve(points, knots, 3, rng.uniform(0.9, 1.1, 4))
    t = float(curve.domain[1] * rng.uniform(0.4, 0.6))
    return NurbsCurve(points + np.asarray(at) - curve.evaluate(t), knots, 3, curve.weights), t


def space_curve(rng):
    """A bent curve in space and a parameter inside of a span."""
    count = 7
    points = np.stack([np.linspace(-1.0, 1.0, count), np.zeros(count), np.zeros(count)], 1)
    points += rng.normal(size=(count, 3)) * [0.03, 0.12, 0.12]
    knots = np.concatenate([np.zeros(4), [0.25, 0.5, 0.75], np.ones(4)]) * rng.uniform(0.5, 3.0)
    curve = NurbsCurve(points, knots, 3, rng.uniform(0.8, 1.2, count))
    return curve, float(curve.domain[1] * rng.uniform(0.3, 0.45))


def random_feature(rng, kind, in_space=None):
    """A feature and coordinates (2,) on it."""
    if kind == VERTEX:
        return Feature(VERTEX, point=rng.normal(size=3)), (0.0, 0.0)
    if kind in (EDGE, EDGE_POINT) and (rng.random() < 0.5 if in_space is None else in_space):
        curve, t = space_curve(rng)
        return Feature(kind, curve=curve), (t, 0.0)
    surface = dome(rng) if rng.random() < 0.5 else quadratic(rng)
    face = Face(surface, reversed=bool(rng.integers(2)))
    at = inside(rng, surface)
    if kind in (FACE, FACE_POINT):
        return Feature(kind, face=face), tuple(at)
    curve, t = plane_curve(rng, surface, at)
    return Feature(kind, face=face, curve=curve), (t, 0.0)


def axes(n, spin):
    """A rotation whose last column is n."""
    x = np.linalg.svd(n[None])[2][1]
    y = np.cross(n, x)
    return np.stack([np.cos(spin) * x + np.sin(spin) * y, np.cos(spin) * y - np.sin(spin) * x, n], 1)


def place(rng, f, x_f, g, x_g, gap, scale=True):
    """Poses (14,) that make (x_f, x_g) extremal with this gap, and the normal in world axes."""
    p, n = f.outward(rng, x_f)
    r, m = g.outward(rng, x_g)
    q_f = np.concatenate([rng.uniform(-3.0, 3.0, 3), random_quaternion(rng)])
    world = np.stack([rotated(q_f[None], column[None])[0] for column in np.eye(3)], 1)
    # Body g's own outward vector m becomes -n.
    matrix = world @ axes(n, 0.0) @ axes(-m, rng.uniform(0.0, 6.3)).T
    at = world @ (p + gap * n) + q_f[:3]
    e = quaternion_of(matrix)
    # The sign of an eigenvector hangs on rounding.
    e *= np.copysign(1.0, e[0]) * (np.linalg.norm(random_quaternion(rng)) if scale else 1.0)
    return np.concatenate([q_f, at - matrix @ r, e]), world @ n
