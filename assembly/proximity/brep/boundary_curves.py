"""The boundary curves of faces as curves in space: C(t) = S(c(t)), sampled, measured and projected onto."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from math import sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import CORNER, between, crease_knots
from assembly.geometry.splines.evaluate import BREAKS_U, BREAKS_V, COEFFICIENTS, CURVE_RECORD, SPANS_U, SPANS_V
from assembly.proximity.brep.boundary_points import along_boundaries, nearest_on_boundaries

__all__ = ["Batch", "Rim", "Survey", "cross", "survey_of", "turn"]

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
# Gauss points of an interval between samples; the middle one shows how far the curve bulges.
_GAUSS = np.array([-sqrt(0.6), 0.0, sqrt(0.6)])
_GAUSS_WEIGHTS = np.array([5.0, 8.0, 5.0]) / 18.0
# A place is good enough when it is known to this part of the tolerance.
_CLOSE = 1e-3


def cross(a: Array, b: Array) -> Array:
    """Cross products of vectors (..., 3), for a few of them much faster than numpy's."""
    x, y, z = a[..., 0], a[..., 1], a[..., 2]
    p, q, r = b[..., 0], b[..., 1], b[..., 2]
    return np.stack([y * r - z * q, z * p - x * r, x * q - y * p], axis=-1)


def turn(a: Array, b: Array) -> Array:
    """Angles between vectors (..., 3), right to rounding for small ones too."""
    across = cross(a, b)
    angle: Array = np.arctan2(np.sqrt((across**2).sum(axis=-1)), (a * b).sum(axis=-1))
    return angle


class Rim:
    """One boundary curve of a face, or a part of one, in space.

    Attributes
    ----------
    number : int
        Of the face among those of the body.
    index : int
        Of the boundary curve of the face that it is or is a part of.
    curve : NurbsCurve
        Plane curve in the parameters of the face.
    anchored : bool
        Whether its ends are vertices; False for a closed curve without corners.
    samples : (n, 4)
        Parameters and points along it, its ends among them.
    balls : (n - 1, 4)
        Centers and radii of balls between samples that it runs through, by samples.
    middle : (3,)
        The mean point along it.
    length : float
        In space.
    """

    def __init__(self, number: int, index: int, curve: NurbsCurve, tolerance: float) -> None:
        self.number = number
        self.index = index
        self.curve = curve
        self.tolerance = tolerance
        self.anchored = True
        self.samples: Array
        self.balls: Array
        self.middle: Array
        self.length: float

    @property
    def ends(self) -> Array:
        """Where it begins and ends, (2, 3)."""
        return self.samples[[0, -1], 1:]

    @property
    def closed(self) -> bool:
        """Whether the two ends are one point."""
        gap = self.samples[-1, 1:] - self.samples[0, 1:]
        return bool(gap @ gap <= self.tolerance**2)

    @property
    def is_point(self) -> bool:
        """Whether it is too short to be an edge."""
        return self.length <= self.tolerance

    def parts(self, at: ArrayLike) -> list[Rim]:
        """The rims, not yet measured, that it falls into when it is cut at increasing parameters."""
        cuts = np.concatenate([self.curve.domain[:1], np.asarray(at, dtype=float), self.curve.domain[1:]])
        curves = [between(self.curve, low, high) for low, high in zip(cuts[:-1], cuts[1:], strict=True)]
        return [Rim(self.number, self.index, curve, self.tolerance) for curve in curves]


class Survey:
    """The faces of a body packed for evaluation along their boundary curves.

    Parts of a boundary curve are evaluated from the whole one: they keep its parameter.
    """

    def __init__(self, faces: Sequence[Face], tolerance: float) -> None:
        self.tolerance = tolerance
        tables: list[Indices] = [np.empty(0, dtype=np.int64)]
        pools: list[Array] = [np.empty(0)]
        at = [0, 0]

        def add(table: Indices, pool: Array) -> None:
            tables.append(table)
            pools.append(pool)
            at[0] += table.size
            at[1] += pool.size

        self.surfaces: list[int] = []
        self.curves: list[int] = []
        self.spans: list[int] = []
        for face in faces:
            if not face.boundary:
                self.surfaces.append(-1)
                self.curves.append(-1)
                self.spans.append(0)
                continue
            record, pool = face.surface._tables
            record = record.copy()
            record[[BREAKS_U, BREAKS_V, COEFFICIENTS]] += at[1]
            self.surfaces.append(at[0])
            self.spans.append(int(record[SPANS_U] + record[SPANS_V]))
            add(record, pool)
            table, pool = face.packed_trim(at[0], at[1])
            self.curves.append(int(trim_at(table, 0).first))
            add(table, pool)
        self.table, self.pool = np.concatenate(tables), np.concatenate(pools)

    def measure(self, boundaries: Iterable[Rim]) -> None:
        """Sample rims and find their lengths."""
        fresh = list(boundaries)
        if not fresh:
            return
        stations, counts = [], []
        for boundary in fresh:
            at = boundary.curve.breaks()
            each = max(4, -(-(12 + 4 * self.spans[boundary.number]) // (at.size - 1)))
            t = np.append((at[:-1, None] + np.diff(at)[:, None] * (np.arange(each) / each)).ravel(), at[-1])
            stations.append(t)
            counts.append(t.size)
        t = np.concatenate(stations)
        stops = np.cumsum(counts)
        rows = np.repeat(np.arange(len(fresh)), counts)
        # Intervals between samples of one rim.
        first = np.delete(np.arange(t.size), stops - 1)
        half = 0.5 * (t[first + 1] - t[first])
        nodes = (t[first] + half)[:, None] + half[:, None] * _GAUSS
        batch = Batch(self, fresh)
        points, _, _ = batch.along(rows, t)
        inner, rates, _ = batch.along(np.repeat(rows[first], 3), nodes.ravel())
        inner = inner.reshape(-1, 3, 3)
        lengths = 2.0 * half * (np.sqrt((rates**2).sum(axis=1)).reshape(-1, 3) @ _GAUSS_WEIGHTS)
        centers = 0.5 * (points[first] + points[first + 1])
        spread = np.concatenate([inner, points[first][:, None]], axis=1) - centers[:, None]
        # The curve between the five points of an interval strays little beyond them.
        reach = 1.25 * np.sqrt((spread**2).sum(axis=2).max(axis=1))
        samples, balls = np.column_stack([t, points]), np.column_stack([centers, reach])
        begins = np.cumsum([0, *(count - 1 for count in counts)])[:-1]
        totals = np.add.reduceat(lengths, begins)
        moments = np.add.reduceat(lengths[:, None] * centers, begins)
        middles = moments / np.maximum(totals, 1e-300)[:, None]
        for k, (boundary, count) in enumerate(zip(fresh, counts, strict=True)):
            boundary.samples = samples[stops[k] - count : stops[k]]
            boundary.balls = balls[begins[k] : begins[k] + count - 1]
            boundary.length = float(totals[k])
            boundary.middle = middles[k]

    def corners(self, boundaries: Sequence[Rim]) -> dict[Rim, Array]:
        """Parameters inside the domains of rims where the tangent in space jumps."""
        knots = [crease_knots(boundary.curve) for boundary in boundaries]
        rows = np.repeat(np.arange(len(boundaries)), [at.size for at in knots])
        if not rows.size:
            return {}
        at = np.concatenate(knots)
        batch = Batch(self, boundaries)
        _, before, _ = batch.along(rows, np.nextafter(at, -np.inf))
        _, after, _ = batch.along(rows, at)
        bent = turn(before, after) > CORNER
        return {boundaries[k]: at[bent & (rows == k)] for k in np.unique(rows[bent]).tolist()}

    def close_with_corners(self, boundaries: Sequence[Rim]) -> NDArray[np.bool_]:
        """Whether the tangents of closed rims jump from their ends to their beginnings."""
        batch = Batch(self, boundaries)
        domains = np.array([boundary.curve.domain for boundary in boundaries]).reshape(-1, 2)
        rows = np.arange(len(boundaries))
        _, starts, _ = batch.along(rows, domains[:, 0])
        _, ends, _ = batch.along(rows, domains[:, 1])
        return np.asarray(turn(ends, starts) > CORNER)


@lru_cache(maxsize=16)
def survey_of(faces: tuple[Face, ...], tolerance: float) -> Survey:
    """The survey of a body's faces, which several look at one after the other."""
    return Survey(faces, tolerance)


class Batch:
    """Several rims of a survey, by their place in a sequence."""

    def __init__(self, survey: Survey, boundaries: Sequence[Rim]) -> None:
        self.survey = survey
        self.rims = boundaries
        numbers = np.array([boundary.number for boundary in boundaries], dtype=np.int64)
        self.surfaces = np.array(survey.surfaces, dtype=np.int64)[numbers]
        first = np.array(survey.curves, dtype=np.int64)[numbers]
        self.curves = first + CURVE_RECORD * np.array([boundary.index for boundary in boundaries], dtype=np.int64)

    def along(self, which: Indices, t: Array) -> tuple[Array, Array, Array]:
        """Points, derivatives and Su x Sv at parameters (m,) of rims (m,), each (m, 3)."""
        out = np.empty((t.size, 9))
        t = np.ascontiguousarray(t)
        along_boundaries(self.survey.table, self.survey.pool, self.surfaces, self.curves, which, t, out)
        return out[:, :3], out[:, 3:6], out[:, 6:]

    def nearest(self, which: Indices, points: Array, guess: Array) -> tuple[Array, Array]:
        """Parameters (m,) of the nearest points of rims (m,), and distances of points (m, 3) near them."""
        closed = np.array([boundary.closed for boundary in self.rims])
        begins = np.cumsum([0, *(len(boundary.samples) for boundary in self.rims)])
        samples = np.concatenate([boundary.samples for boundary in self.rims])
        out = np.empty((which.size, 2))
        nearest_on_boundaries(
            (self.survey.table, self.survey.pool),
            (self.surfaces, self.curves, closed, begins, samples),
            np.ascontiguousarray(which),
            np.ascontiguousarray(points),
            np.ascontiguousarray(guess),
            _CLOSE * self.survey.tolerance,
            out,
        )
        return out[:, 0], out[:, 1]
