"""A curve as Bezier pieces in homogeneous coordinates, as kernels of certified queries read it.

    C(x) = sum_i B_i^n(x) w_i P_i / sum_i B_i^n(x) w_i,    0 <= x <= 1 on every span,

with B_i^n(x) = C(n, i) x^i (1 - x)^(n - i). Points are relative to a center of the curve: an offset costs no digits.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly._lanes import lane, load_lanes, store_xyz
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.geometry.splines.evaluate import find_span, into_domain

# A curve of Bezier pieces in the table.
BEZIER_CURVE = record_dtype(
    "i8",
    degree=1,
    spans=1,
    rational=1,  # 1: weights differ
    breaks=1,  # where in the pool the ends of the spans begin
    binomials=1,  # where in the pool binomials of the degree begin
    middle=1,  # where in the pool the weights of derivatives at the middle begin
    pieces=1,  # where in the pool their rows (w x, w y, w z, w) begin
    tree=1,  # where in the pool boxes of the tree over the spans begin
    squares=1,  # where in the pool coefficients of |X|^2, w X and w^2 of every span begin
    square_binomials=1,  # where in the pool binomials of twice the degree begin
)
bezier_curve_at = record_view(BEZIER_CURVE)
RECORD = size_of(BEZIER_CURVE)
# The head of its pool.
BEZIER_HEAD = record_dtype(
    "f8",
    reach=1,  # the largest distance of a control point from the center [length]
    error=1,  # how far the packed curve may be from the one that was given [length]
    center=3,  # origin of the positions [length]
    weight_ratio=1,  # the largest quotient of two weights
)
bezier_head_at = record_view(BEZIER_HEAD)
REACH = place_of(BEZIER_HEAD, "reach")
ERROR = place_of(BEZIER_HEAD, "error")
CENTER = place_of(BEZIER_HEAD, "center")
WEIGHT_RATIO = place_of(BEZIER_HEAD, "weight_ratio")
HEAD = size_of(BEZIER_HEAD)
# A box of the tree over the spans: center and half extents; first the root, then its left subtree, then its right one.
BOX = 6
# Half a unit in the last place of one.
UNIT = 1.1102230246251565e-16


@kernel(inner=True)
def bezier_value(rows, o, pool, binomials, n, x):
    """Homogeneous point of the piece whose rows of four begin at o, by Horner's rule from the nearer end."""
    if x <= 0.5:
        rest = 1.0 - x
        y = x / rest
        v = load_lanes(rows, o + 4 * n)
        for i in range(n - 1, -1, -1):
            v = pool[binomials + i] * load_lanes(rows, o + 4 * i) + y * v
    else:
        rest = x
        y = (1.0 - x) / rest
        v = load_lanes(rows, o)
        for i in range(1, n + 1):
            v = pool[binomials + i] * load_lanes(rows, o + 4 * i) + y * v
    scale = 1.0
    for _ in range(n):
        scale *= rest
    return scale * v


@kernel(inner=True)
def bezier_derivatives(rows, o, pool, binomials, n, x):
    """As `bezier_value`, with the first and second derivative; n >= 1."""
    b = binomials + n + 1
    c = b + n + 1
    p = load_lanes(rows, o + 4 * n)
    q = load_lanes(rows, o + 4 * (n - 1))
    zero = 0.0 * p
    if x <= 0.5:
        rest = 1.0 - x
        y = x / rest
        v = p
        d = zero
        h = zero
        after = p
        second = zero
        for i in range(n - 1, -1, -1):
            q = load_lanes(rows, o + 4 * i)
            v = pool[binomials + i] * q + y * v
            first = after - q
            d = pool[b + i] * first + y * d
            if i < n - 1:
                h = pool[c + i] * (second - first) + y * h
            second = first
            after = q
    else:
        rest = x
        y = (1.0 - x) / rest
        before = load_lanes(rows, o)
        v = before
        d = zero
        h = zero
        second = zero
        for i in range(1, n + 1):
            q = load_lanes(rows, o + 4 * i)
            v = pool[binomials + i] * q + y * v
            first = q - before
            d = pool[b + i - 1] * first + y * d
            if i > 1:
                h = pool[c + i - 2] * (first - second) + y * h
            second = first
            before = q
    scale = 1.0
    for _ in range(n - 2):
        scale *= rest
    if n == 1:
        return rest * v, d, zero
    return (scale * rest * rest) * v, (n * scale * rest) * d, (n * (n - 1.0) * scale) * h


@kernel(signatures="(i8[::1], f8[::1], f8[::1], b1, i8, f8[::1])")
def evaluate_pieces(record, pool, t, closed, order, out):
    """As `evaluate_curve` (`geometry/splines/evaluate.py`), from Bezier pieces, which are accurate at any degree."""
    curve = bezier_curve_at(record, 0)
    count = t.size
    n = curve.degree
    for i in range(count):
        x, fits = into_domain(pool, curve.breaks, curve.spans, int(closed), t[i])
        if not fits:
            return i
        span = find_span(pool, curve.breaks, curve.spans, x)
        low = pool[curve.breaks + span]
        width = pool[curve.breaks + span + 1] - low
        rows = curve.pieces + 4 * (n + 1) * span
        v, d, h = bezier_derivatives(pool, rows, pool, curve.binomials, n, min(max((x - low) / width, 0.0), 1.0))
        w = 1.0 / lane(v, 3)
        p = w * v
        q = w * (d - lane(d, 3) * p)
        store_xyz(p, out, 3 * i)
        for j in range(3):
            out[3 * i + j] += bezier_head_at(pool, 0).center[j]
        if order >= 1:
            store_xyz((1.0 / width) * q, out, 3 * (count + i))
        if order >= 2:
            bend = w * (h - (2.0 * lane(d, 3)) * q - lane(h, 3) * p)
            store_xyz((1.0 / (width * width)) * bend, out, 3 * (2 * count + i))
    return -1
