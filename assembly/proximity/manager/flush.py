"""False overlaps of flush bodies: extremal pairs with gaps far below zero, as of a head on a plate, beside its hole.

Where a face of one body lies on a face of the other, or slightly in it, an edge of one and a wall of the other beside
it may have opposed normals and a gap far below zero: the edge of a screw head is behind the wall of the hole that it
covers, and the bottom of a dovetail behind the top of the lip over it. The overlap at an end of such a pair is a sliver
between two opposed faces. To come apart, the bodies move along the normal of these faces, by next to nothing; that is
told by rows of the faces. A row of this pair would push along the faces instead.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import dot, matvec
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.manager.extrema import LISTED, NEW, USELESS, extremum_at
from assembly.proximity.manager.overlap import DEPTH, next_near, projection_at, seen_by_other
from assembly.proximity.manager.records import HANDED_OFF, LOST
from assembly.proximity.manager.slots import give_up

# The overlap of two bodies is a sliver at an end of a pair if faces of both are nearer to that end than the first
# number times the depth of the pair, and the cosine between their normals is less than minus the second number.
SHORT, OPPOSED = 0.1, 0.5
# Depths that are rounding, and room for faces about a point.
DEPTH_ROUNDING, FACES_ABOUT = 1e-9, 16


@kernel(inner=True)
def faces_about(posed, side, y, distance, stack, normals):
    """Write the normals of one body's faces that are within a distance of a point; how many there are. In its axes."""
    stack[0] = 0
    used = 1
    count = 0
    while used > 0 and count < normals.shape[0]:
        e, used = next_near(posed.store, posed.trees[side], y, distance, stack, used)
        if e < 0:
            break
        off, n, some = projection_at(posed, side, e, y)
        if some and abs(off) <= distance:
            normals[count, 0], normals[count, 1], normals[count, 2] = n
            count += 1
    return count


@kernel(inner=True)
def is_in_sliver(posed, c, distance, stack, normals):
    """Whether faces of both bodies are within a distance of a point, in the axes of f, and opposed to each other."""
    many = faces_about(posed, 0, c, distance, stack, normals[0])
    if many == 0:
        return False
    others = faces_about(posed, 1, seen_by_other(posed, 0, c), distance, stack, normals[1])
    for i in range(others):
        n = matvec(posed.pose.rotation, (normals[1, i, 0], normals[1, i, 1], normals[1, i, 2]))
        for l in range(many):
            if dot(n, (normals[0, l, 0], normals[0, l, 1], normals[0, l, 2])) < -OPPOSED:
                return True
    return False


@kernel(inner=True, allocates=True)
def drop_flush(manager, p, posed, extrema, tracked):
    """Mark extrema of pair p that begin or end between flush faces as USELESS, and free their slots."""
    stack = np.empty(DEPTH, np.int64)
    normals = np.empty((2, FACES_ABOUT, 3))
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        is_listed = np.int64(extremum.origin) >= LISTED
        if not extremum.gap < -DEPTH_ROUNDING or not (extremum.origin == NEW or is_listed):
            continue
        distance = -SHORT * extremum.gap
        begins = is_in_sliver(posed, three_of(extremum.point_f), distance, stack, normals)
        if not (begins or is_in_sliver(posed, three_of(extremum.point_g), distance, stack, normals)):
            continue
        if is_listed:
            give_up(manager, p, extremum, HANDED_OFF, LOST, tracked)
        extremum.origin = USELESS


@kernel(inner=True)
def any_deep(extrema):
    """Whether any extremum is deeper than rounding."""
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.gap < -DEPTH_ROUNDING and extremum.origin != USELESS:
            return True
    return False
