"""The faces of a body as kernels restrict them: Bezier pieces of surfaces, of their normals and of boundary curves.

Restricted to [x0, x1], the k-th Bezier point of degree n is the blossom of n - k times x0 and k times x1 (Piegl &
Tiller, The NURBS Book, section 5.3). The Bezier points over a box span a hull that holds the surface over it.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of

# A face in the table; one record behind the other from the table's beginning.
FACE_NETS_DTYPE = record_dtype(
    "i8",
    rows=1,  # Bezier points of a piece in u
    columns=1,  # and in v
    normal_rows=1,  # of the normal, as well
    normal_columns=1,
    spans_u=1,
    spans_v=1,
    closed_u=1,
    closed_v=1,
    points=1,  # where the homogeneous points are in the pool: spans of u before those of v, rows within
    normals=1,  # of the outward normal, times a positive function; zero at poles
    slack=1,  # bounds of the error of each piece's normals
    poles=1,  # 1.0 if a piece has a pole: zeros among its normals are expected
    breaks_u=1,  # ends of the spans
    breaks_v=1,
    extent=1,  # the largest coordinate
    reversed=1,  # whether the outward normal is -Su x Sv
    is_rational=1,
    pole_bits=1,  # edges that are one point, see `NurbsSurface`
    trim=1,  # its trim in the table; -1: the face is the whole surface
    boundary=1,  # boxes (u from and to, v from and to) that hold the boundary together
    boundary_boxes=1,  # their number
)
face_nets_at = record_view(FACE_NETS_DTYPE)
FACE_NETS = size_of(FACE_NETS_DTYPE)
# A boundary curve in the table.
CURVE_NET_DTYPE = record_dtype(
    "i8",
    degree=1,
    spans=1,
    points=1,  # homogeneous points (degree + 1, 3) of every span in the pool
    breaks=1,
    slack=1,  # bounds of the error of points in u and in v
)
curve_net_at = record_view(CURVE_NET_DTYPE)
CURVE_NET = size_of(CURVE_NET_DTYPE)
# A part of a span in a list of them: which span, from where to where in its unit interval.
CUT_DTYPE = record_dtype("f8", span=1, low=1, high=1)
cut_at = record_view(CUT_DTYPE)
CUT = size_of(CUT_DTYPE)


@kernel(inner=True)
def write_blossom(degree, low_times, low, high, work, at):
    """Weights of Bezier points in the blossom with `low_times` arguments low and all others high."""
    work[at] = 1.0
    for r in range(degree):
        x = low if r < low_times else high
        work[at + r + 1] = x * work[at + r]
        for i in range(r, 0, -1):
            work[at + i] = (1.0 - x) * work[at + i] + x * work[at + i - 1]
        work[at] = (1.0 - x) * work[at]


@kernel(inner=True)
def restrict_net(pool, first, shape, box, work, at):
    """Bezier points of a piece (rows, columns, components) over a box of its unit square, to a place of the workspace.

    The workspace behind them needs room for as many numbers again, and for the weights of its longer side.
    """
    rows, columns, components = shape
    line = columns * components
    middle = at + rows * line
    weights = middle + rows * line
    for k in range(rows):
        write_blossom(rows - 1, rows - 1 - k, box[0], box[1], work, weights)
        for j in range(line):
            work[middle + k * line + j] = work[weights] * pool[first + j]
        for i in range(1, rows):
            weight = work[weights + i]
            for j in range(line):
                work[middle + k * line + j] += weight * pool[first + i * line + j]
    for l in range(columns):
        write_blossom(columns - 1, columns - 1 - l, box[2], box[3], work, weights)
        for k in range(rows):
            target = at + k * line + l * components
            source = middle + k * line
            for m in range(components):
                work[target + m] = work[weights] * work[source + m]
            for j in range(1, columns):
                for m in range(components):
                    work[target + m] += work[weights + j] * work[source + j * components + m]


@kernel(inner=True, exact=True)
def _blossom(block, line, ends, work, at):
    """The blossom of numbers (place, count, stride) of a block; `ends`: how many arguments are the lower end, and the
    lower and the upper end.
    """
    first, count, stride = line
    low_times, low, high = ends
    for i in range(count):
        work[at + i] = block[first + stride * i]
    for r in range(count - 1):
        x = low if r < low_times else high
        for i in range(count - 1 - r):
            work[at + i] = (1.0 - x) * work[at + i] + x * work[at + i + 1]
    return work[at]


@kernel(inner=True)
def restrict_points(pool, first, shape, box, work, at):
    """As `restrict_net` for homogeneous points (rows, columns), by de Casteljau steps: points in a plane stay in it."""
    rows, columns = shape
    line = 4 * columns
    middle = at + rows * line
    spare = middle + rows * line
    for k in range(rows):
        ends = rows - 1 - k, box[0], box[1]
        for j in range(line):
            work[middle + k * line + j] = _blossom(pool, (first + j, rows, line), ends, work, spare)
    for k in range(rows):
        for l in range(columns):
            ends = columns - 1 - l, box[2], box[3]
            for m in range(4):
                source = middle + k * line + m
                work[at + k * line + 4 * l + m] = _blossom(work, (source, columns, 4), ends, work, spare)


@kernel(inner=True)
def curve_box(pool, curve, cut, work, at):
    """Box around a part (span, low, high) of a plane curve: u from and to, v from and to."""
    span, low, high = cut
    count = curve.degree + 1
    first = curve.points + 3 * count * span
    u0, u1, v0, v1 = math.inf, -math.inf, math.inf, -math.inf
    for k in range(count):
        write_blossom(count - 1, count - 1 - k, low, high, work, at)
        x, y, w = 0.0, 0.0, 0.0
        for i in range(count):
            weight = work[at + i]
            x += weight * pool[first + 3 * i]
            y += weight * pool[first + 3 * i + 1]
            w += weight * pool[first + 3 * i + 2]
        u0, u1 = min(u0, x / w), max(u1, x / w)
        v0, v1 = min(v0, y / w), max(v1, y / w)
    off_u, off_v = pool[curve.slack], pool[curve.slack + 1]
    return u0 - off_u, u1 + off_u, v0 - off_v, v1 + off_v


@kernel(inner=True)
def _write_spans(pool, breaks, interval, out, at):
    """Parts of spans, (breaks, spans) of a direction, that an interval inside the domain is cut into; their number."""
    first, spans = breaks
    low, high = interval
    start = 0
    while start < spans - 1 and pool[first + start + 1] <= low:
        start += 1
    stop = start
    while stop < spans - 1 and pool[first + stop + 1] < high:
        stop += 1
    for span in range(start, stop + 1):
        begin, end = pool[first + span], pool[first + span + 1]
        cut = cut_at(out, at + CUT * (span - start))
        cut.span = span
        # The first and the last span extend beyond the domain.
        cut.low = (low - begin) / (end - begin) if span == start else 0.0
        cut.high = (high - begin) / (end - begin) if span == stop else 1.0
    return stop - start + 1


@kernel(inner=True)
def write_cuts(pool, breaks, closed, interval, out, at):
    """Parts of spans that an interval of a parameter is cut into, at most two more than there are spans; their number.

    In a closed direction the interval is wrapped; in an open one, if it is outside, it is extended to the nearer end.
    """
    first, spans = breaks
    begin, end = pool[first], pool[first + spans]
    low, high = interval
    if not closed:
        return _write_spans(pool, breaks, (min(low, end), max(high, begin)), out, at)
    period = end - begin
    turns = math.floor((low - begin) / period)
    low, high = max(low - turns * period, begin), high - turns * period
    if high - low >= period:
        low, high = begin, end
    count = _write_spans(pool, breaks, (low, min(high, end)), out, at)
    if high > end:
        # The rest of the interval is beyond the seam, from the low end of the domain on.
        count += _write_spans(pool, breaks, (begin, high - period), out, at + CUT * count)
    return count


@kernel(inner=True)
def write_box_cuts(pool, face, box, work):
    """Write the parts in u, then those in v, of a box in (u, v), from the workspace's beginning; returns both numbers
    and the place behind the parts.
    """
    count_u = write_cuts(pool, (face.breaks_u, face.spans_u), face.closed_u == 1, (box[0], box[1]), work, 0)
    at = CUT * count_u
    count_v = write_cuts(pool, (face.breaks_v, face.spans_v), face.closed_v == 1, (box[2], box[3]), work, at)
    return count_u, count_v, at + CUT * count_v


@kernel(inline=True)
def piece_of_cuts(face, work, i, j, count_u):
    """The piece of the i-th part in u and the j-th in v, and its box in the unit square."""
    u = cut_at(work, CUT * i)
    v = cut_at(work, CUT * (count_u + j))
    return int(u.span) * face.spans_v + int(v.span), (u.low, u.high, v.low, v.high)


@kernel(inner=True)
def write_hull(pool, face, box, work):
    """Box around a surface over a box in (u, v), as two points; the workspace is overwritten."""
    count_u, count_v, at = write_box_cuts(pool, face, box, work)
    low, high = (math.inf, math.inf, math.inf), (-math.inf, -math.inf, -math.inf)
    points = face.rows * face.columns
    for i in range(count_u):
        for j in range(count_v):
            piece, inside = piece_of_cuts(face, work, i, j, count_u)
            restrict_points(pool, face.points + 4 * points * piece, (face.rows, face.columns), inside, work, at)
            for k in range(points):
                w = work[at + 4 * k + 3]
                x, y, z = work[at + 4 * k] / w, work[at + 4 * k + 1] / w, work[at + 4 * k + 2] / w
                low = (min(low[0], x), min(low[1], y), min(low[2], z))
                high = (max(high[0], x), max(high[1], y), max(high[2], z))
    return low, high
