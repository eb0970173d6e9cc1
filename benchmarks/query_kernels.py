# mypy: ignore-errors
"""Loops around kernels of queries, so that a time is of the kernel and not of the call; and subdivision, to compare.

Numbers that are written in a call have types of numpy: of a plain literal Numba compiles the called kernel once more.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.distance.curves.capsules import OPEN, compare_curves, compare_point
from assembly.distance.curves.point_curve import point_distance
from assembly.distance.curves.search import curve_distance


@kernel
def subdivide(squares, tolerance, stack):
    """Upper bound of a distance to a tolerance from the Bernstein coefficients of its square, and the cuts made.

    After Chang et al., "Computing the minimum distance between a point and a clamped B-spline curve" (2007) and its
    kin: the coefficients bound the square from below, its ends from above; what cannot hold the minimum is cut off, the
    rest halved.
    """
    m = squares.size
    # One by one: the check of shapes in an assignment of whole rows takes a second to compile.
    for k in range(m):
        stack[0, k] = squares[k]
    top = 1
    upper = np.sqrt(min(squares[0], squares[m - 1]))
    cuts = 0
    while top > 0 and cuts < 1_000_000:
        top -= 1
        row = stack[top]
        least = row[0]
        for k in range(1, m):
            least = min(least, row[k])
        limit = max(upper - tolerance, 0.0)
        if least >= limit * limit or top + 2 > stack.shape[0]:
            continue
        # de Casteljau at 1/2: the high half in place, the low half behind it.
        low = stack[top + 1]
        for r in range(m):
            low[r] = row[0]
            for k in range(m - 1 - r):
                row[k] = 0.5 * (row[k] + row[k + 1])
        cuts += 1
        upper = min(upper, np.sqrt(max(row[0], 0.0)))
        top += 2
    return upper, cuts


@kernel
def question_often(ra, qa, a, rb, qb, b, clearance, plane, times, out):
    """As `is_separated` answers; as `minimum_distance` where the clearance is below zero, which saves a kernel."""
    for _ in range(times):
        if clearance < 0.0 or compare_curves(a, b, clearance) == OPEN:
            curve_distance(ra, qa, rb, qb, (1e-10, clearance, np.int64(200_000), np.bool_(True)), plane, out)


@kernel
def point_question_often(record, pool, tree, points, clearance, nearest, out):
    """The same of points; `nearest` is the address of `nearest_on_curve`."""
    for i in range(points.shape[0]):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        if clearance[i] < 0.0 or compare_point(tree, x, y, z, clearance[i]) == OPEN:
            asked = (1e-10, clearance[i], np.int64(1_000_000), np.bool_(True))
            point_distance(record, pool, (x, y, z), asked, nearest, out)


@kernel
def subdivide_often(squares, times, stack):
    total = 0.0
    for _ in range(times):
        for i in range(squares.shape[0]):
            total += subdivide(squares[i], 1e-10, stack)[0]
    return total
