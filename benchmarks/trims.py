"""Inside tests and nearest points on the boundary of faces, judged by another winding number, and what they cost."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from benchmarks.figures import figure
from benchmarks.timing import compare

ABOUT = """\
Faces on a plane with an outer loop and three holes, each a random rational curve of degree 1 to 5. Half of the points
are anywhere, half at known distances of 1e-3 to 1e-13 beside the curves. The first are judged by the winding number
of polygons with 20,000 corners a loop, and, where a polygon could be wrong, by the side of the nearest point of the
true curve, found by Newton's method."""

Array = NDArray[np.float64]
_CORNERS = 20_000
# Polygons of so many corners are nearer to their curves than this.
_NEAR = 1e-5
_CENTERS = ((0.7, 0.0), (-0.7, 0.1), (0.0, 0.8))


def _blob(rng: np.random.Generator, center: tuple[float, float], radius: float) -> NurbsCurve:
    degree = int(rng.integers(1, 6))
    n = int(rng.integers(max(degree + 1, 5), 12))
    angle = (np.arange(n) + rng.uniform(-0.3, 0.3, n)) * 2.0 * np.pi / n
    points = radius * (1.0 + 0.3 * rng.uniform(-1, 1, (n, 1))) * np.column_stack([np.cos(angle), np.sin(angle)])
    weights = rng.uniform(0.5, 2.0, n)
    points, weights = np.vstack([points, points[:1]]) + center, np.append(weights, weights[0])
    knots = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, n + 2 - degree), np.ones(degree)])
    return NurbsCurve(points, knots, degree, weights)


def _loops(seed: int) -> tuple[NurbsCurve, list[NurbsCurve]]:
    rng = np.random.default_rng(seed)
    return _blob(rng, (0.0, 0.0), 3.0), [_blob(rng, center, 0.25) for center in _CENTERS]


def _polygon_winding(polygon: Array, u: Array, v: Array) -> NDArray[np.int64]:
    """Winding number of a closed polygon around points, from its parts that run one way in u."""
    total = np.zeros(u.shape, dtype=np.int64)
    ways = np.sign(np.diff(polygon[:, 0])).astype(int)
    turns = np.flatnonzero(np.diff(ways)) + 1
    for begin, stop in zip([0, *turns], [*turns, len(ways)], strict=True):
        if ways[begin]:
            x, y = polygon[begin : stop + 1][:: ways[begin]].T
            passes = (u >= x[0]) & (u < x[-1])
            total[passes] += ways[begin] * (v[passes] > np.interp(u[passes], x, y))
    return total


def _judge(face: Face, u: Array, v: Array) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """The side of points that are not on the boundary, and which could be judged."""
    winding = np.zeros(u.shape, dtype=np.int64)
    near = np.full(u.shape, np.inf)
    side = np.zeros(u.shape)
    sure = np.ones(u.shape, dtype=bool)
    for curve in face.boundary:
        t = np.unique(np.concatenate([np.linspace(*curve.domain, _CORNERS), curve.breaks()]))
        polygon = curve.evaluate(t)
        winding += _polygon_winding(polygon, u, v)
        # Candidates for the true curve: points near its polygon, by the corners within a little more than a chord.
        reach = _NEAR + float(np.hypot(*np.diff(polygon, axis=0).T).max())
        distance, corner = cKDTree(polygon).query(np.column_stack([u, v]), distance_upper_bound=reach)
        for k in np.flatnonzero(np.isfinite(distance)):
            at = t[corner[k]]
            for _ in range(20):
                c, d, h = curve.evaluate(at, 2)
                e = c - (u[k], v[k])
                at = float(np.clip(at - (e @ d) / (d @ d + e @ h), *curve.domain))
            c, d = curve.evaluate(at, 1)
            e = np.array([u[k], v[k]]) - c
            if np.hypot(*e) < near[k]:
                near[k] = np.hypot(*e)
                side[k] = np.sign(d[0] * e[1] - d[1] * e[0])
                # Near a knot the foot may be at a corner, where one tangent does not tell the side.
                sure[k] = np.abs(curve.breaks() - at).min() > 1e-4
    close = near < _NEAR
    return np.where(close, side, np.where(winding == 1, 1, -1)).astype(np.int64), sure | ~close


def _beside(face: Face, rng: np.random.Generator, count: int) -> tuple[Array, Array]:
    """Points (count, 2) beside the curves, and their signed distances, away from corners."""
    points, offs = [], []
    for curve in face.boundary:
        t = rng.uniform(*curve.domain, count // 4)
        # A knot may be a corner: within reach of it, the other side of the corner is nearer.
        t = t[np.abs(t[:, None] - curve.breaks()).min(axis=1) > 0.02]
        c, d = curve.evaluate(t, 1)
        left = np.column_stack([-d[:, 1], d[:, 0]]) / np.linalg.norm(d, axis=1)[:, None]
        off = rng.choice([-1.0, 1.0], t.size) * 10.0 ** rng.uniform(-13, -3, t.size)
        points.append(c + off[:, None] * left)
        offs.append(off)
    return np.concatenate(points), np.concatenate(offs)


def run(quick: bool) -> dict[str, Any]:
    """Sides of points, then times."""
    plane = shapes.plane(10.0, 10.0)
    faces = [Face(plane, *_loops(seed)) for seed in range(3 if quick else 50)]
    each = 1_000 if quick else 11_000
    right = judged = beside = beside_right = 0
    error = 0.0
    for seed, face in enumerate(faces):
        rng = np.random.default_rng(1000 + seed)
        u, v = rng.uniform(-4.5, 4.5, (2, each))
        wanted, sure = _judge(face, u, v)
        right += int((face.locate(u, v) == wanted)[sure].sum())
        judged += int(sure.sum())
        points, off = _beside(face, rng, each + each // 4)
        boundary = np.concatenate([curve.evaluate(np.linspace(*curve.domain, 999)) for curve in face.boundary])
        on = 1e-12 * float(np.linalg.norm(np.ptp(boundary, axis=0)))
        # The size of the boundary by samples, and roundings of coordinates: a little beside 1e-12 either is right.
        clear = np.abs(np.abs(off) / on - 1.0) > 0.01
        sides = face.locate(*points.T)
        beside_right += int((sides == np.where(np.abs(off) < on, 0, np.sign(off)))[clear].sum())
        beside += int(clear.sum())
        error = max(error, float(np.abs(face.trim_distance(*points.T) - off).max()))
    rng = np.random.default_rng(0)
    u, v = rng.uniform(-4.5, 4.5, (2, 1_000 if quick else 20_000))
    angle = np.linspace(0.0, 2.0 * np.pi, 101)
    corners = 4.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    corners[-1] = corners[0]
    hundred = [NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(corners[:-1], corners[1:], strict=True)]
    loops = _loops(0)
    square = [NurbsCurve([corners[k], corners[(k + 25) % 100]], [0, 0, 1, 1], 1) for k in (0, 25, 50, 75)]
    calls: dict[str, Callable[[], object]] = {
        "inside test": lambda: [face.locate(u, v) for face in faces],
        "nearest on the boundary": lambda: [face.trim_distance(u, v) for face in faces],
        "a face of four lines": lambda: Face(plane, square),
        "a face of four rational loops": lambda: Face(plane, *loops),
        "a face of 100 lines": lambda: Face(plane, hundred),
        "a face of 100 lines, and its area": lambda: Face(plane, hundred).area(),
    }
    rows = compare(calls, repeats=3 if quick else 11)
    seconds = {row["who"]: row["seconds"] for row in rows}
    points_a_call = u.size * len(faces)
    figures = [
        figure("points anywhere, on the right side", "count", right, of=judged, reach=judged),
        figure("points 1e-13 to 1e-3 beside a curve, on the right side or on it", "count", beside_right, of=beside,
               reach=beside),
        figure("distance of these to the boundary", "error", error, reach=1e-12),
        figure("inside test, a point in bulk", "seconds", seconds["inside test"] / points_a_call, reach=1e-6),
        figure("nearest on the boundary, a point in bulk", "seconds",
               seconds["nearest on the boundary"] / points_a_call, reach=5e-6),
        figure("a face of 100 curves made and checked", "seconds", seconds["a face of 100 lines"], reach=20e-3),
    ]  # fmt: skip
    return {"about": ABOUT, "rows": rows, "figures": figures}
