"""The search of an update (`proximity/manager/update.py`) for contacts of two round wires, by their centerlines.

The gap of two wires is the distance of their centerlines less both radii, so contacts are minima of that distance.
Boxes, each an interval of length on a part of either centerline, are halved until it is known how many minima each of
them holds (`proximity/manager/centerlines/box.py`); where a box becomes almost a point without an answer, projections
tell (`minima.py`). So no contact is missed. A box that excludes minima by a margin still does after any motion shorter
than that margin: this gives the motion bound.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.vec import cross, dot, matvec_t, scale
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.centerlines.box import (
    BARREN,
    BOX,
    CONVEX,
    EMPTY,
    UNKNOWN,
    FreeEnds,
    Lengths,
    PosedParts,
    box_of,
    centerline_box_at,
    difference_at,
)
from assembly.proximity.manager.centerlines.minima import convex_minimum, near_singular_minima
from assembly.proximity.manager.extrema import (
    NEW,
    NOTHING,
    USELESS,
    add_surface_extremum,
    extremum_at,
    is_known_one,
    is_list_full,
    write_frame,
)
from assembly.proximity.manager.motion_bounds import PairSearch, ball_about, no_ball
from assembly.proximity.manager.parameters import FINE, LARGEST_BALL, REFINED, SPARSE, THIN
from assembly.proximity.manager.wires import (
    PART,
    both_radii,
    centerline_at,
    centerline_part_at,
    centerline_place,
    centerline_point,
    wire_at,
    wire_parameters,
)

# Room for boxes that wait.
BOXES = 2048
# Where a known extremum is on the centerlines: part and length from its middle of either.
KNOWN_PLACE = record_dtype("f8", part_f=1, at_f=1, part_g=1, at_g=1)
known_place_at = record_view(KNOWN_PLACE)
MARK = size_of(KNOWN_PLACE)
# A known contact is at a minimum if the slopes of the distance there are below this.
AT_EXTREMUM = 1e-9
# Newton's method on the surfaces has stayed at its minimum if the gap changed by no more than this.
ASTRAY = 1e-9
# Centerlines nearer than this cross, and have no direction from one to the other.
MEETING = 1e-12


# Limits of a search [over the size of the scene]. least: the least gap; near: contacts are sought up to this beyond the
# least gap; reach: the query margin, beyond the least gap as well; curved_bound: the curvature-limited motion bound;
# merge_radius: extrema nearer to each other are one; rho: a motion by a length d turns no tangent by more than d / rho.
CenterlineLimits = namedtuple("CenterlineLimits", "least near reach curved_bound merge_radius rho")


@kernel(inline=True)
def line_of(posed, side):
    """The record of one centerline."""
    return centerline_at(posed.store.table, posed.centerlines[side])


@kernel(inline=True)
def open_ends(posed, box):
    """The free ends of two centerlines at which a box is."""
    line, centerline = line_of(posed, 0), line_of(posed, 1)
    parts = parts_of(posed, box.part_f, box.part_g)
    free_f = line.closed == 0
    free_g = centerline.closed == 0
    half_f = centerline_part_at(parts.pool, parts.f).half
    half_g = centerline_part_at(parts.pool, parts.g).half
    return FreeEnds(
        start_f=free_f and box.part_f == 0 and box.from_f <= -half_f,
        end_f=free_f and box.part_f == line.parts - 1 and box.to_f >= half_f,
        start_g=free_g and box.part_g == 0 and box.from_g <= -half_g,
        end_g=free_g and box.part_g == centerline.parts - 1 and box.to_g >= half_g,
    )


@kernel(inline=True)
def parts_of(posed, i, j):
    """Part i of the centerline of f, and j of that of g."""
    f = line_of(posed, 0).part_pool + PART * np.int64(i)
    g = line_of(posed, 1).part_pool + PART * np.int64(j)
    return PosedParts(posed.store.pool, f, g, posed.pose)


@kernel(inner=True)
def mark_known(posed, extrema, marks):
    """Where on the centerlines known extrema are that are at a minimum: part and length of either; NaN for others."""
    store, surfaces = posed.store, posed.surfaces
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        x = pair_parameters(extremum)
        i, s = centerline_place(store, posed.centerlines[0], surfaces[0], x[0], x[1])
        j, t = centerline_place(store, posed.centerlines[1], surfaces[1], x[2], x[3])
        mark = known_place_at(marks, k)
        mark.part_f, mark.at_f = float(i), s
        mark.part_g, mark.at_g = float(j), t
        there = difference_at(parts_of(posed, i, j), s, t)
        d = there.d
        slopes = abs(dot(d, there.tangent_f)) + abs(dot(d, there.tangent_g))
        if extremum.origin == USELESS or not slopes <= AT_EXTREMUM * math.sqrt(dot(d, d)):
            # It is of far sides, at a half ball, or not yet at its minimum: boxes there are searched all the same.
            mark.part_f = math.nan


@kernel(inner=True)
def is_marked(boxes, b, marks, count):
    """Whether a known extremum is in box b."""
    box = centerline_box_at(boxes, b)
    for k in range(count):
        mark = known_place_at(marks, k)
        if (
            mark.part_f == box.part_f
            and mark.part_g == box.part_g
            and box.from_f <= mark.at_f <= box.to_f
            and box.from_g <= mark.at_g <= box.to_g
        ):
            return True
    return False


@kernel(inline=True)
def across_both(f, g):
    """A unit vector perpendicular to two tangents; where centerlines cross, any such vector will do."""
    n = cross(f, g)
    length = math.sqrt(dot(n, n))
    if length < MEETING:
        # The tangents are parallel: perpendicular to the first one.
        n = cross(f, (1.0, 0.0, 0.0) if abs(f[0]) < 0.7 else (0.0, 1.0, 0.0))
        length = math.sqrt(dot(n, n))
    return scale(1.0 / length, n)


@kernel(inner=True)
def add_minimum(posed, i, j, s, t, merge_radius, extrema):
    """Add the contact at lengths s and t along parts i and j, if it is none of the known ones."""
    if is_list_full(extrema):
        return
    store, surfaces = posed.store, posed.surfaces
    f, g = posed.centerlines
    there = difference_at(parts_of(posed, i, j), s, t)
    d = there.d
    length = math.sqrt(dot(d, d))
    way = scale(1.0 / length, d) if length >= MEETING else across_both(there.tangent_f, there.tangent_g)
    u_f, v_f = wire_parameters(store, f, surfaces[0], i, s, way)
    u_g, v_g = wire_parameters(store, g, surfaces[1], j, t, matvec_t(posed.pose.rotation, scale(-1.0, way)))
    start = (u_f, v_f, u_g, v_g)
    gap = length - both_radii(store, posed.centerlines)
    before = extrema.count[0]
    extremum = extremum_at(extrema.rows, before)
    found = add_surface_extremum(posed, start, merge_radius, extrema)
    if found == NOTHING or not abs(extremum.gap - gap) <= ASTRAY:
        # At a fold Newton's method may find nothing, or another extremum: the centerlines' minimum is then taken as it
        # is.
        extrema.count[0] = before
        frame = pair_frame(store, surfaces[0], surfaces[1], posed.pose, start)
        if not frame.regular:
            return
        write_frame(extremum, start, frame, 0.0)
        if is_known_one(posed, extrema, merge_radius):
            return
        extrema.count[0] = before + 1
    if extrema.count[0] > before:
        extremum.origin = NEW


@kernel(inline=True)
def around_box(pool, o, box, side, lo, hi):
    """The box (lo, hi) enlarged to contain the interval of one centerline that a search box covers."""
    begin, end = (box.from_f, box.to_f) if side == 0 else (box.from_g, box.to_g)
    half = 0.5 * (end - begin)
    middle = centerline_point(pool, o, begin + half)[0]
    return (
        (min(lo[0], middle[0] - half), min(lo[1], middle[1] - half), min(lo[2], middle[2] - half)),
        (max(hi[0], middle[0] + half), max(hi[1], middle[1] + half), max(hi[2], middle[2] + half)),
    )


@kernel(inline=True)
def halves(boxes, b):
    """Halve box b along the longer of its two intervals; the second half becomes box b + 1."""
    for m in range(BOX):
        boxes[b + 1, m] = boxes[b, m]
    first, second = centerline_box_at(boxes, b), centerline_box_at(boxes, b + 1)
    if first.to_f - first.from_f >= first.to_g - first.from_g:
        first.to_f = second.from_f = 0.5 * (first.from_f + first.to_f)
    else:
        first.to_g = second.from_g = 0.5 * (first.from_g + first.to_g)


@kernel(inner=True)
def add_minima(posed, box, ends, what, merge_radius, places, extrema):
    """Add the minima in a box. Returns whether it certainly holds no others."""
    i = np.int64(box.part_f)
    j = np.int64(box.part_g)
    parts = parts_of(posed, i, j)
    part = Lengths(box.from_f, box.to_f, box.from_g, box.to_g)
    certain = True
    settled = False
    if what == CONVEX:
        s, t = 0.5 * (box.from_f + box.to_f), 0.5 * (box.from_g + box.to_g)
        found, s, t, settled = convex_minimum(parts, part, ends, s, t)
        if found:
            add_minimum(posed, i, j, s, t, merge_radius, extrema)
    if not settled:
        many, level, certain = near_singular_minima(parts, part, ends, places)
        if level:
            # The minimum is as low all along a curve: a few points of it, farther apart, stand for all.
            bend = max(centerline_part_at(parts.pool, parts.f).bend, centerline_part_at(parts.pool, parts.g).bend)
            merge_radius = max(merge_radius, SPARSE / bend)
        for m in range(many):
            add_minimum(posed, i, j, places[m, 0], places[m, 1], merge_radius, extrema)
    return certain


@kernel(inner=True)
def search_centerlines(posed, moving, limits, boxes, waiting, workspaces, extrema):
    """Look for all contacts of two wires with gaps up to `near`, of CenterlineLimits; known ones are in the list.

    `moving` is the body that moves. The first `waiting` boxes hold all that is within the reach. `workspaces` are
    memory for the marks of known extrema, and for the minima of a box.

    Returns a PairSearch.
    """
    pool = posed.store.pool
    near, reach, curved_bound = limits.near, limits.reach, limits.curved_bound
    line, centerline = line_of(posed, 0), line_of(posed, 1)
    radii = both_radii(posed.store, posed.centerlines) + limits.least
    sharpest = max(wire_at(pool, line.numbers).sharpest, wire_at(pool, centerline.numbers).sharpest)
    known = extrema.count[0]
    marks, places = workspaces
    mark_known(posed, extrema, marks)
    rest = reach
    birth_bound = math.inf
    sure = math.inf
    refined = 0
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    while waiting > 0:
        b = waiting - 1
        box = centerline_box_at(boxes, b)
        parts = parts_of(posed, box.part_f, box.part_g)
        ends = open_ends(posed, box)
        part = Lengths(box.from_f, box.to_f, box.from_g, box.to_g)
        low, what, margin = box_of(parts, part, ends, radii + reach, limits.rho)
        low -= radii
        # A box that is neither searched nor free of minima may hold one as near as the box itself.
        hollow = what == EMPTY or what == BARREN
        allowed = max(low, margin) if low <= near or hollow else low
        if allowed >= reach and (low > near or hollow):
            waiting = b
            continue
        bend = 0.5 * max(box.to_f - box.from_f, box.to_g - box.from_g) * sharpest
        halve = what == UNKNOWN and low <= near and bend > THIN
        if not halve and allowed < curved_bound and refined < REFINED and bend > FINE:
            halve = True
            refined += 1
        if halve and waiting < boxes.shape[0]:
            halves(boxes, b)
            waiting += 1
            continue
        if low <= near and not hollow and not (what == CONVEX and is_marked(boxes, b, marks, known)):
            certain = add_minima(posed, box, ends, what, limits.merge_radius, places, extrema)
            if halve or is_list_full(extrema) or not certain:
                # The box may hold a minimum that is not known.
                allowed = low
        waiting = b
        if allowed >= LARGEST_BALL * reach and allowed >= curved_bound:
            rest = min(rest, allowed)
            continue
        if allowed < curved_bound:
            # Beyond this motion a contact may be created beside a near one: an accepted pose then needs an update.
            sure = min(sure, allowed)
            allowed = curved_bound
        birth_bound = min(birth_bound, allowed)
        lo, hi = around_box(pool, parts.g if moving.side == 1 else parts.f, box, moving.side, lo, hi)
    ball = ball_about(moving, lo, hi, limits.rho) if birth_bound < math.inf else no_ball()
    return PairSearch(rest, birth_bound, ball, sure)
