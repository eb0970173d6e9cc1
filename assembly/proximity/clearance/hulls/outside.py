"""Whether a body whose boundary does not meet another one's is outside of it.

It is if every connected part of its boundary has a point from which a half line leads away without meeting the other
boundary. A half line from p along d does not meet a face that is below p along a vector n with n.d >= 0, nor one that
is around a hollow along whose axis it leads. Two points of one boundary that are nearer to each other than to the
other boundary are on the same side of that: so faces count as connected that come so near.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.hulls.body_hulls import BodyHulls
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.hollows import depths_within

__all__ = ["is_outside"]

Array = NDArray[np.float64]
# How far from a right angle two unit vectors are at most that count as across each other, or parallel.
ALONG = 4e-16
# Products that are taken at most to tell of half lines.
MOST = 200_000_000


def is_outside(body: BodyHulls, other: BodyHulls, normals: Array, reach: Array, apart: float, rounding: float) -> bool:
    """Whether it is told of all of a body's boundary that it is outside of another body.

    Parameters
    ----------
    body, other : BodyHulls
        In the same axes.
    normals : (k, 3)
        Unit vectors.
    reach : (f, k)
        How far the other body's faces reach along them.
    apart : float
        How far the two boundaries are apart, at least.
    rounding : float
        What heights may be off.
    """
    if len(body.points) * len(other.of_face) * len(normals) ** 2 > MOST:
        return False
    below = body.points @ normals.T
    beyond = (below[:, None] - reach > rounding).astype(np.float32)
    leads = (normals @ normals.T >= -ALONG).astype(np.float32)
    # Of every point, face and half line, whether it does not meet the face.
    misses = np.zeros(beyond.shape, dtype=bool)
    misses[beyond @ leads > 0.0] = True
    axes = np.array([hollow.axis for _, hollow in other.hollows]).reshape(-1, 3)
    open_ended = [other.hollows[k] for k in np.flatnonzero(axes.any(axis=1))]
    inside = depths_within([hollow for _, hollow in open_ended], Discs.of_points(body.points)) > rounding
    for k in np.flatnonzero(inside.any(axis=1)).tolist():
        face, hollow = open_ended[k]
        along = normals @ hollow.axis
        leads_along = ((normals - along[:, None] * hollow.axis) ** 2).sum(axis=1) <= ALONG**2
        if hollow.is_one_sided:
            leads_along &= along > 0.0
        misses[:, face] |= inside[k, :, None] & leads_along
    leaves = np.zeros(len(body.of_face), dtype=bool)
    # The points of which a half line misses all faces.
    free, _ = np.nonzero(np.asarray(misses.all(axis=1)))
    leaves[body.owner[free]] = True
    if leaves.all() or not leaves.any():
        return bool(leaves.all())
    label = _connected(body, 0.5 * apart)
    return bool(np.isin(label, label[leaves]).all())


def _connected(body: BodyHulls, near: float) -> NDArray[np.int64]:
    """Of every face the number of the part that it belongs to, of those that come that near to each other."""
    order = np.argsort(body.points[:, 0], kind="stable")
    x = body.points[order, 0]
    count = np.searchsorted(x, x + near, side="right") - np.arange(len(x)) - 1
    one = np.repeat(np.arange(len(x)), count)
    other = one + 1 + np.arange(len(one)) - np.repeat(np.cumsum(count) - count, count)
    one, other = order[one], order[other]
    close = ((body.points[one] - body.points[other]) ** 2).sum(axis=1) <= near**2
    label = np.arange(len(body.of_face))
    pairs = {*zip(body.owner[one[close]].tolist(), body.owner[other[close]].tolist(), strict=True)}
    for a, b in pairs:
        if label[a] != label[b]:
            label[label == label[a]] = label[b]
    return label
