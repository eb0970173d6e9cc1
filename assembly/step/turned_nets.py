"""Control nets of surfaces of revolution, filled at once: for `surfaces`."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import cross, dot, sub


@kernel(
    signatures="(f8[:, ::1], f8[:, ::1], f8[::1], f8[::1], f8, f8[:, :, ::1], f8[:, ::1])",
    exact=True,
)
def fill_turned(profile, ring, origin, axis, near, net, weights):
    """Fill control points and weights of a profile that is turned about an axis.

    Parameters
    ----------
    profile : (n, 4)
        Homogeneous control points.
    ring : (m, 3)
        Homogeneous control points (cosine, sine, weight) of the arc of the unit circle that it turns by.
    origin, axis : (3,)
        A point of the axis, and its unit direction.
    near : float
        Points of the profile nearer to the axis than this are put on it: they become poles.
    net, weights : (m, n, 3), (m, n)
    """
    base, way = (origin[0], origin[1], origin[2]), (axis[0], axis[1], axis[2])
    for k in range(profile.shape[0]):
        weight = profile[k, 3]
        point = (profile[k, 0] / weight, profile[k, 1] / weight, profile[k, 2] / weight)
        along = dot(sub(point, base), way)
        foot = (base[0] + along * way[0], base[1] + along * way[1], base[2] + along * way[2])
        out = sub(point, foot)
        if np.sqrt(dot(out, out)) < near:
            out = (0.0, 0.0, 0.0)
        across = cross(way, out)
        for j in range(ring.shape[0]):
            c, s, w = ring[j, 0], ring[j, 1], ring[j, 2]
            weights[j, k] = w * weight
            for i in range(3):
                net[j, k, i] = (w * foot[i] + c * out[i] + s * across[i]) / w
