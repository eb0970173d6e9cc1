"""Pairs of features, made by placing g on f, and the kernels of `feature_pair.py` behind one door for tests."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.curve import NurbsCurve
from assembly.geometry.face import Face
from assembly.geometry.spline import (
    BREAKS_U,
    BREAKS_V,
    CELLS,
    COEFFICIENTS,
    CURVE_BREAKS,
    CURVE_COEFFICIENTS,
    CURVE_RECORD,
    SURFACE_RECORD,
)
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extremal import CONVERGED, LEFT_PATCH, NOT_CONVERGED, SINGULAR
from assembly.proximity.feature_pair import feature_record, solve_features
from assembly.proximity.shell import EDGE, EDGE_CURVE, EDGE_END, EDGE_RECORD, EDGE_START, EDGE_SURFACE, FACE, VERTEX
from assembly.proximity.velocity import RATES, RECORD, ZED, add_gap_terms, gradient_row
from tests.laws.scenes import dome, inside, quadratic, quaternion_of, random_quaternion
from tests.laws.witness import rotated

STATUS = {CONVERGED: "CONVERGED", SINGULAR: "SINGULAR", LEFT_PATCH: "LEFT_PATCH", NOT_CONVERGED: "NOT_CONVERGED"}
# What `run` writes after the four parameters.
POINT_F, POINT_G, NORMAL_AT, BETA, REGULAR, ISOLATED, PROPER, FOLD, RESIDUAL, OUT = 4, 7, 10, 13, 14, 15, 16, 17, 18, 22


@dataclass(frozen=True, eq=False)
class Feature:
    """A face; an edge on a surface, or in space; a vertex."""

    kind: int
    face: Face | None = None
    curve: NurbsCurve | None = None
    point: np.ndarray | None = None
    endless: bool = False

    def jet(self, x):
        """Point, first derivatives in body axes."""
        if self.kind == VERTEX:
            return (self.point,)
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
            if feature.kind == FACE:
                at.append(surface)
                continue
            at.append(len(table))
            if feature.kind == VERTEX:
                table += [len(pool), 0, 0, 0, 0]
                pool += feature.point.tolist()
            else:
                edge = [-1] * EDGE_RECORD
                edge[EDGE_SURFACE], edge[EDGE_CURVE] = surface, curve
                edge[EDGE_START] = edge[EDGE_END] = -1 if feature.endless else 0
                table += edge
        self.table, self.pool = np.array(table, np.int64), np.array(pool, float)
        self.at = tuple(at)
        self.records = np.zeros((1, RECORD))

    def solve(self, q, x, n=(0.0, 0.0, 0.0), size=4.0, turn=np.inf):
        """Status, and what `run` writes."""
        out = np.empty(OUT)
        status = run(
            self.table,
            self.pool,
            self.kinds[0],
            self.at[0],
            self.kinds[1],
            self.at[1],
            np.asarray(q, float).reshape(2, 7),
            tuple(map(float, x)),
            tuple(map(float, n)),
            float(size),
            float(turn),
            self.records,
            out,
        )
        return STATUS[status], out

    def gradient(self):
        """The gap's gradient over the twists (12,), of the pair solved last."""
        row = np.empty((1, 12))
        one_gradient(self.records, row)
        return row[0].copy()

    def hessian(self):
        """The upper triangle made full (12, 12)."""
        row, out = np.zeros((1, 12)), np.zeros((12, 12))
        one_hessian(self.records, row, out)
        return np.triu(out) + np.triu(out, 1).T

    def rates(self):
        """Rates of (u_f, v_f, u_g, v_g) over the twists (4, 12)."""
        r = self.records[0]
        return r[RATES : RATES + 16].reshape(4, 4) @ r[ZED : ZED + 48].reshape(4, 12)


@kernel
def run(table, pool, kind_f, f, kind_g, g, q, x, n, size, turn, records, out):
    turn_f = rotation(q, 0)
    relative, shift = relative_pose(q, 0, turn_f, 1, rotation(q, 1))
    status, y, frame = solve_features(table, pool, kind_f, f, kind_g, g, relative, shift, x, n, size, turn)
    feature_record(turn_f, shift, frame, records, 0)
    for k in range(4):
        out[k] = y[k]
        out[18 + k] = frame[11][k]
    for k in range(3):
        out[4 + k] = frame[3][k]
        out[7 + k] = frame[4][k]
        out[10 + k] = frame[0][k]
    out[13] = frame[5]
    out[14] = 1.0 if frame[12] else 0.0
    out[15] = 1.0 if frame[13] else 0.0
    out[16] = 1.0 if frame[14] else 0.0
    out[17] = frame[15]
    return status


@kernel
def one_gradient(records, row):
    gradient_row(records, 0, row, 0)


@kernel
def one_hessian(records, row, out):
    add_gap_terms(records, 0, row, 0, 1.0, 0.0, out, 0, 6)


def plane_curve(rng, surface, at):
    """A bent curve in the parameters of a surface, through the point `at`, within the span around it."""
    span = []
    for k in range(2):
        breaks = surface.breaks()[k]
        i = min(np.searchsorted(breaks, at[k], "right") - 1, breaks.size - 2)
        span.append(0.2 * (breaks[i + 1] - breaks[i]))
    angle = rng.uniform(0.0, 6.3)
    t = np.linspace(-1.0, 1.0, 6)
    x, y = t, rng.uniform(-0.5, 0.5) * t * t + 0.05 * rng.normal(size=6)
    points = np.stack([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], 1)
    knots = np.concatenate([np.zeros(4), [0.35, 0.7], np.ones(4)]) * rng.uniform(0.5, 3.0)
    weights = rng.uniform(0.8, 1.2, 6)
    curve = NurbsCurve(points * span, knots, 3, weights)
    t = float(curve.domain[1] * 0.5)
    return NurbsCurve(points * span + np.asarray(at) - curve.evaluate(t), knots, 3, weights), t


def space_curve(rng):
    """A bent curve in space and a parameter inside of a span."""
    count = 7
    points = np.stack([np.linspace(-1.0, 1.0, count), np.zeros(count), np.zeros(count)], 1)
    points += rng.normal(size=(count, 3)) * [0.05, 0.25, 0.25]
    knots = np.concatenate([np.zeros(4), [0.25, 0.5, 0.75], np.ones(4)]) * rng.uniform(0.5, 3.0)
    curve = NurbsCurve(points, knots, 3, rng.uniform(0.8, 1.2, count))
    return curve, float(curve.domain[1] * rng.uniform(0.3, 0.45))


def random_feature(rng, kind, in_space=None):
    """A feature and coordinates (2,) on it."""
    if kind == VERTEX:
        return Feature(VERTEX, point=rng.normal(size=3)), (0.0, 0.0)
    if kind == EDGE and (rng.random() < 0.5 if in_space is None else in_space):
        curve, t = space_curve(rng)
        return Feature(EDGE, curve=curve), (t, 0.0)
    surface = dome(rng) if rng.random() < 0.5 else quadratic(rng)
    face = Face(surface, reversed=bool(rng.integers(2)))
    at = inside(rng, surface)
    if kind == FACE:
        return Feature(FACE, face=face), tuple(at)
    curve, t = plane_curve(rng, surface, at)
    return Feature(EDGE, face=face, curve=curve), (t, 0.0)


def axes(n, spin):
    """A rotation whose last column is n."""
    x = np.linalg.svd(n[None])[2][1]
    y = np.cross(n, x)
    return np.stack([np.cos(spin) * x + np.sin(spin) * y, np.cos(spin) * y - np.sin(spin) * x, n], 1)


def place(rng, f, x_f, g, x_g, gap, scale=True):
    """Poses (14,) that make (x_f, x_g) extremal with this gap, and the normal in the axes of f."""
    p, n = f.outward(rng, x_f)
    r, m = g.outward(rng, x_g)
    q_f = np.concatenate([rng.uniform(-3.0, 3.0, 3), random_quaternion(rng)])
    world = np.stack([rotated(q_f[None], column[None])[0] for column in np.eye(3)], 1)
    # Body g's own outward vector m becomes -n.
    matrix = world @ axes(n, 0.0) @ axes(-m, rng.uniform(0.0, 6.3)).T
    at = world @ (p + gap * n) + q_f[:3]
    e = quaternion_of(matrix) * (np.linalg.norm(random_quaternion(rng)) if scale else 1.0)
    return np.concatenate([q_f, at - matrix @ r, e]), n
