"""Points of the splines of a file, in the parameters of our surfaces: tables are filled and evaluated, for `tracks`."""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.splines.evaluate import curve_lanes, spline_curve_at, xyz

# A place nearer to an end of an arc than this part of half the arc is at that end.
_AT_END = 1e-14
# Most steps to a root; halving takes 53.
_STEPS = 200


@kernel(signatures="(f8[:, ::1], f8[::1], f8[:, ::1], i8[::1], f8[::1])", allocates=True)
def fill_table(points, knots, powers, record, pool):
    """Fill record and pool of an open spline from its homogeneous control points (n, 4), x and y or x, y and z first.

    As `curve_tables.bezier_tables` does for plane curves. `powers` is `bezier.power_matrix` of the degree. False
    where a value is not finite or a knot is smaller than the one before it.
    """
    p, n = powers.shape[0] - 1, points.shape[0]
    arc = spline_curve_at(record, 0)
    spans = 0
    pool[0] = knots[p]
    for j in range(p, n):
        if not knots[j + 1] >= knots[j]:
            return False
        if knots[j + 1] > knots[j]:
            spans += 1
            pool[spans] = knots[j + 1]
    arc.degree = p
    arc.spans = spans
    arc.breaks = 0
    arc.coefficients = spans + 1
    arc.closed = 0
    d, bezier = np.empty((p + 1, 4)), np.empty((p + 1, 4))
    place = spans + 1
    finite = spans > 0
    for j in range(p, n):
        a, b = knots[j], knots[j + 1]
        if not b > a:
            continue
        for k in range(p + 1):
            for i in range(p + 1):
                for lane in range(4):
                    d[i, lane] = points[j - p + i, lane]
            for r in range(1, p + 1):
                t = a if r <= p - k else b
                for i in range(p, r - 1, -1):
                    left = knots[j - p + i]
                    alpha = (t - left) / (knots[j + 1 + i - r] - left)
                    for lane in range(4):
                        d[i, lane] = (1.0 - alpha) * d[i - 1, lane] + alpha * d[i, lane]
            for lane in range(4):
                bezier[k, lane] = d[p, lane]
        scale = 0.5**p
        for m in range(p + 1):
            for lane in range(4):
                total = 0.0
                for k in range(p + 1):
                    total += powers[m, k] * bezier[k, lane]
                pool[place + 4 * m + lane] = total * scale
                finite = finite and np.isfinite(total * scale)
            scale *= 2.0 / (b - a)
        place += 4 * (p + 1)
    return finite


@kernel(inner=True, exact=True)
def _mapped(way, x):
    """Our parameter for one of OCCT's, as `profiles.Turning` has it; the same one if `way` begins with 0."""
    spans, low, high, radius = way[0], way[1], way[2], way[3]
    if spans == 0.0:
        return x
    step = (high - low) / spans
    k = math.floor((x - low) / step)
    s = math.tan(0.5 * (x - low - (k + 0.5) * step)) / math.tan(0.25 * step)
    # An end that two arcs share has one value, whichever arc it is computed from.
    if s >= 1.0 - _AT_END:
        k += 1.0
    if abs(s) >= 1.0 - _AT_END:
        s = -1.0
    turns = math.floor(k / spans)
    begin = radius * (low + (k - turns * spans) * step + turns * (high - low))
    return begin + 0.5 * (1.0 + s) * radius * step


@kernel(inner=True)
def _point(record, pool, ways, t):
    """The point at a parameter of OCCT's, each coordinate mapped."""
    arc = spline_curve_at(record, 0)
    low, high = pool[arc.breaks], pool[arc.breaks + arc.spans]
    a, _d, _h = curve_lanes(Store(record, pool), 0, min(max(_mapped(ways[0], t), low), high))
    x, y, z = xyz(a)
    return _mapped(ways[1], x), _mapped(ways[2], y), z


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], f8[::1], f8[:, ::1])")
def fill_points(record, pool, ways, t, out):
    """Points at parameters of OCCT's; parameters beyond an end of the curve give the point at that end.

    `ways` (3, 4) are the maps of the parameter, of x and of y: the number of arcs (0: unchanged), the first and
    the last angle, and the length of a radian. `out` has two or three columns.
    """
    for k in range(t.size):
        x, y, z = _point(record, pool, ways, t[k])
        out[k, 0], out[k, 1] = x, y
        if out.shape[1] == 3:
            out[k, 2] = z


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], i8[::1], f8[:, ::1], f8[::1])")
def find_crossings(record, pool, ways, axes, brackets, roots):
    """Parameters at which coordinates of a curve take given values, each in a bracket: Chandrupatla's method.

    As `crossings` does for any function. `axes` says which coordinate (0: the first, 1: the second). A row of
    `brackets` has two parameters, the coordinate minus the value at each of them, and the value.
    """
    for n in range(roots.size):
        x1, x2, f1, f2, wanted = brackets[n, 0], brackets[n, 1], brackets[n, 2], brackets[n, 3], brackets[n, 4]
        part = 0.5
        x3, f3 = x2, f2
        roots[n] = x1
        for _count in range(_STEPS):
            x = x1 + part * (x2 - x1)
            u, v, _z = _point(record, pool, ways, x)
            f = (u if axes[n] == 0 else v) - wanted
            if (f > 0.0) == (f1 > 0.0):
                x3, f3 = x1, f1
            else:
                x3, f3 = x2, f2
                x2, f2 = x1, f1
            x1, f1 = x, f
            best = x1 if abs(f1) < abs(f2) else x2
            least = (1e-15 + 1e-15 * abs(best)) / abs(x2 - x1)
            if least > 0.5 or f1 == 0.0:
                roots[n] = x1 if f1 == 0.0 else best
                break
            xi, phi = (x1 - x2) / (x3 - x2), (f1 - f2) / (f3 - f2)
            part = 0.5
            if phi * phi < xi and (1.0 - phi) ** 2 < 1.0 - xi:
                part = f1 / (f2 - f1) * f3 / (f2 - f3) + (x3 - x1) / (x2 - x1) * f1 / (f3 - f1) * f2 / (f3 - f2)
            part = min(max(part, least), 1.0 - least)
