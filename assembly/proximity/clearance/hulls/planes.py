"""A plane between two bodies, by the hulls of their faces, of which each is within its body's convex hull.

Asked is a unit vector n with min n.b - max n.a > 0 over the points of both bodies. The point of least norm in all of
b - a is along the best one. It is approached by Frank and Wolfe's method: from w toward the point of b - a that is
farthest back along w, to where the norm is least on the way.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.hulls.body_hulls import BodyHulls
from assembly.proximity.clearance.hulls.pair import ROUNDING

__all__ = ["normal_between"]

Array = NDArray[np.float64]
# Steps after which bodies count as parted by no plane, as do those that are nearer than this part of the smaller one.
STEPS, NEAR = 40, 1e-3


def normal_between(a: BodyHulls, b: BodyHulls) -> Array | None:
    """The normal (3,), from the first body to the second in the same axes, of a plane between them.

    None where none is found.
    """
    rounding = ROUNDING * max(float(np.abs(body.discs.centers).max() + body.discs.radii.max()) for body in (a, b))
    way = b.ball[0] - a.ball[0]
    near = max(rounding, NEAR * min(a.ball[1], b.ball[1]))
    for _ in range(STEPS):
        size = float(np.linalg.norm(way))
        if size <= near:
            return None
        normal = way / size
        end_a, reach_a = _farthest(a, normal)
        end_b, reach_b = _farthest(b, -normal)
        if -reach_b - reach_a > rounding:
            return normal
        step = end_b - end_a - way
        length = float(step @ step)
        if length == 0.0:
            return None
        way = way + min(1.0, max(0.0, -float(way @ step) / length)) * step
    return None


def _farthest(body: BodyHulls, normal: Array) -> tuple[Array, float]:
    """A point of a body's hulls that is farthest along a unit vector, and how far the body reaches, at most."""
    discs = body.discs
    reaches = discs.reach(normal[None])[:, 0]
    pads = np.repeat(body.pad, np.diff(np.append(body.first, len(reaches))))
    k = int(np.argmax(reaches + pads))
    across = normal - (discs.axes[k] @ normal) * discs.axes[k]
    size = float(np.linalg.norm(across))
    rim = discs.radii[k] * across / size if size > 0.0 else np.zeros(3)
    return discs.centers[k] + rim + pads[k] * normal, float(reaches[k] + pads[k])
