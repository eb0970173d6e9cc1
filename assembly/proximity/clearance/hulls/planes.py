"""A plane between two bodies, by the hulls of their faces, of which each is within its body's convex hull.

Asked is a unit vector n with min n.b - max n.a > 0 over the points of both bodies. The point of least norm in all of
b - a is along the best one. It is approached by the fully corrective method of Frank and Wolfe: w is the point of least
norm in the hull of some points of b - a, to which the one that is farthest back along w is added.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from assembly.proximity.clearance.hulls.body_hulls import BodyHulls
from assembly.proximity.clearance.hulls.pair import ROUNDING

__all__ = ["normal_between"]

Array = NDArray[np.float64]
# Steps after which bodies count as parted by no plane, as do those that are nearer than this part of the smaller one.
STEPS, NEAR = 20, 1e-3
# How hard weights are held to a sum of one, against lengths in parts of how far points of both bodies may be apart.
HELD = 1e3


def normal_between(a: BodyHulls, b: BodyHulls) -> Array | None:
    """The normal (3,), from the first body to the second in the same axes, of a plane between them.

    None where none is found.
    """
    rounding = ROUNDING * max(float(np.abs(body.discs.centers).max() + body.discs.radii.max()) for body in (a, b))
    way = b.ball[0] - a.ball[0]
    near = max(rounding, NEAR * min(a.ball[1], b.ball[1]))
    # Of points themselves all may be zero: a corner that lies on the other body's.
    scale = float(np.linalg.norm(way)) + a.ball[1] + b.ball[1]
    points = np.empty((0, 3))
    for _ in range(STEPS):
        size = float(np.linalg.norm(way))
        if size <= near:
            return None
        normal = way / size
        end_a, reach_a = _farthest(a, normal)
        end_b, reach_b = _farthest(b, -normal)
        if -reach_b - reach_a > rounding:
            return normal
        points = np.vstack([points, end_b - end_a])
        weights, _ = nnls(np.vstack([points.T / scale, np.full(len(points), HELD)]), np.array([0.0, 0.0, 0.0, HELD]))
        way, points = weights @ points / weights.sum(), points[weights > 0.0]
    return None


def _farthest(body: BodyHulls, normal: Array) -> tuple[Array, float]:
    """A point that is farthest along a unit vector of the narrowest hulls of all faces, and how far it is."""
    discs = body.discs
    reaches = discs.reach(normal[None])[:, 0]
    of_hulls = np.maximum.reduceat(reaches, body.first) + body.pad
    face = int(np.argmax(np.minimum.reduceat(of_hulls, body.of_face)))
    hulls = slice(body.of_face[face], body.of_face[face + 1] if face + 1 < len(body.of_face) else len(of_hulls))
    hull = hulls.start + int(np.argmin(of_hulls[hulls]))
    own = slice(body.first[hull], body.first[hull + 1] if hull + 1 < len(body.first) else len(reaches))
    k = own.start + int(np.argmax(reaches[own]))
    across = normal - (discs.axes[k] @ normal) * discs.axes[k]
    size = float(np.linalg.norm(across))
    rim = discs.radii[k] * across / size if size > 0.0 else np.zeros(3)
    return discs.centers[k] + rim + body.pad[hull] * normal, float(of_hulls[hull])
