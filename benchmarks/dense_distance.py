"""Nearest points of two bodies by dense sampling inside trims and along boundaries, then minimization by scipy.

Nothing here knows of cells, bounds or Newton's method on pairs: what it finds is an upper bound of the distance, and
the distance itself where the samples are dense enough for every minimum that may be the least.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial import cKDTree

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface

__all__ = ["Sampled", "circle_distance", "least_distance"]

Array = NDArray[np.float64]
# One of so many samples tells how far two bodies are apart around it.
COARSE = 100


class Sampled:
    """Samples of faces: of their insides and of their boundary curves, with a tree over them."""

    def __init__(self, faces: Iterable[Face], count: int = 30000) -> None:
        self.faces = list(faces)
        per = int(np.sqrt(count / len(self.faces)))
        rows, points = [], []
        for k, face in enumerate(self.faces):
            u, v = (x.ravel() for x in np.meshgrid(*(np.linspace(*ends, per) for ends in face.surface.domain)))
            inside = face.contains(u, v)
            rows.append(np.column_stack([np.full(u.size, k), np.full(u.size, -1), u, v])[inside])
            points.append(face.surface.evaluate(*rows[-1][:, 2:].T))
            for index, curve in enumerate(face.boundary):
                t = np.linspace(*curve.domain, max(per, 60))
                rows.append(np.column_stack([np.full(t.size, k), np.full(t.size, index), t, 0.0 * t]))
                points.append(face.surface.evaluate(*into(face.surface, curve.evaluate(t)).T))
        self.rows, self.points = np.concatenate(rows), np.concatenate(points)
        self.tree = cKDTree(self.points)
        self.size = float(np.linalg.norm(np.ptp(self.points, axis=0)))
        self.spacing = 1.5 * self.size / per

    def limits(self, row: Array) -> list[tuple[float | None, float | None]]:
        """The domain of a sample's coordinates."""
        face, curve = self.faces[int(row[0])], int(row[1])
        if curve >= 0:
            return [face.boundary[curve].domain]
        closed = face.surface.closed
        return [(None, None) if closed[k] else face.surface.domain[k] for k in range(2)]

    def at(self, row: Array, c: Array) -> tuple[Array, Array]:
        """Point and its derivatives (3, coordinates) where a sample has coordinates c."""
        face, curve = self.faces[int(row[0])], int(row[1])
        if curve < 0:
            u, v = into(face.surface, np.asarray(c)[None])[0]
            p, su, sv = face.surface.evaluate(u, v, 1)
            return p, np.column_stack([su, sv])
        at, along = face.boundary[curve].evaluate(c[0], 1)
        u, v = into(face.surface, at[None])[0]
        p, su, sv = face.surface.evaluate(u, v, 1)
        return p, (su * along[0] + sv * along[1])[:, None]

    def holds(self, row: Array, c: Array) -> bool:
        """Whether a point of a face is inside its trim."""
        face = self.faces[int(row[0])]
        return row[1] >= 0 or bool(face.contains(*into(face.surface, np.asarray(c)[None])[0]))


def into(surface: NurbsSurface, points: Array) -> Array:
    """Parameters (n, 2) wrapped, and held at the ends."""
    columns = []
    for k in range(2):
        low, high = surface.domain[k]
        x = points[:, k]
        columns.append(low + np.mod(x - low, high - low) if surface.closed[k] else np.clip(x, low, high))
    return np.column_stack(columns)


def polished(a: Sampled, row_a: Array, b: Sampled, row_b: Array, turn: Array, shift: Array) -> float:
    """The least distance near two samples, or infinity where the minimum is outside a trim."""
    limits = a.limits(row_a) + b.limits(row_b)
    split = len(a.limits(row_a))

    def square(c: Array) -> tuple[float, Array]:
        p, dp = a.at(row_a, c[:split])
        q, dq = b.at(row_b, c[split:])
        d = turn @ q + shift - p
        return 0.5 * float(d @ d), np.concatenate([-d @ dp, d @ (turn @ dq)])

    c = np.concatenate([row_a[2 : 2 + split], row_b[2 : 2 + len(limits) - split]])
    for _ in range(3):
        # Restarted: its model of the curvature is poor where it began.
        found = minimize(square, c, jac=True, method="L-BFGS-B", bounds=limits, options={"ftol": 0.0, "gtol": 1e-15})
        c = found.x
    if not (a.holds(row_a, c[:split]) and b.holds(row_b, c[split:])):
        return np.inf
    return float(np.sqrt(2.0 * found.fun))


def least_distance(a: Sampled, b: Sampled, turn: Array, shift: Array, candidates: int = 16) -> float:
    """The distance of two sampled bodies, the second one turned and shifted."""
    points = b.points @ turn.T + shift
    slack = a.spacing + b.spacing
    # From far away a tree's nearest point takes long: it is looked for where a few samples tell that it may count.
    few = points[::COARSE]
    known = a.tree.query(few)[0]
    apart, beside = cKDTree(few).query(points)
    may = known[beside] - apart <= known.min() + slack
    distance, nearest = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    distance[may], nearest[may] = a.tree.query(points[may])
    best = float(distance.min())
    left = distance.copy()
    kinds = np.column_stack([b.rows[:, :2], a.rows[nearest, :2]])
    for _ in range(candidates):
        j = int(np.argmin(left))
        if not left[j] < distance.min() + slack:
            break
        best = min(best, polished(a, a.rows[nearest[j]], b, b.rows[j], turn, shift))
        same = (kinds == kinds[j]).all(axis=1)
        left[same & (np.linalg.norm(points - points[j], axis=1) < 4.0 * b.spacing)] = np.inf
    return best


def circle_distance(first: float, second: float, turn: Array, shift: Array) -> float:
    """The distance of two circles of these radii around z axes: a dense search, then golden sections.

    From a point of the first circle to the second one there is a closed form.
    """

    def distance(angle: Array) -> Array:
        p = first * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
        local = (p - shift) @ turn
        return np.hypot(np.hypot(local[..., 0], local[..., 1]) - second, local[..., 2])

    angles = np.linspace(0.0, 2.0 * np.pi, 3000, endpoint=False)
    values = distance(angles)
    lowest = angles[(values <= np.roll(values, 1)) & (values <= np.roll(values, -1))]
    low, high = lowest - angles[1], lowest + angles[1]
    part = 0.5 * (np.sqrt(5.0) - 1.0)
    for _ in range(80):
        a, b = high - part * (high - low), low + part * (high - low)
        left = distance(a) < distance(b)
        low, high = np.where(left, low, a), np.where(left, b, high)
    return float(distance(0.5 * (low + high)).min())
