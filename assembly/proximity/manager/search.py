"""The search of a look for contacts that are not known: minima of the distance from the middles of patches.

Most pairs of patches that face each other have none of their own: one that is known is all there is, or Newton's method
goes where it went from others. Where none is found a motion may bring one forth. Near a fold, where two roots merge,
starts are led down the slope of the gap as well.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, dot, matvec, scale, sub
from assembly.proximity.extrema.projection import slide_down
from assembly.proximity.manager.candidates import around, element_ball
from assembly.proximity.manager.extrema import (
    ALIKE,
    MINIMUM_FOUND,
    NEW,
    NOTHING,
    USELESS,
    add_extremum,
    extremum_at,
    is_alone,
)
from assembly.proximity.manager.motion_bounds import MotionBall, PairSearch
from assembly.proximity.manager.newton_regions import LEFT, half_widths, is_known, newton_way_at, stays
from assembly.proximity.manager.overlap import is_outside

# Starts that a look leads down the slope of the gap, because Newton's method found no minimum from there.
SLIDES_A_LOOK = 6


@kernel(inner=True)
def search_candidate(store, posed, e, d, merge_radius, extrema, count, work, passed, state):
    """Look for a root of the patches e of f and d of g that is not known.

    Returns how many roots there are; which one is a new minimum, or -1; whether a motion may bring one forth; and the
    state: whether a root is near a fold, how many ways there are in `passed`, how many starts went down a slope.
    """
    folding, visited, slides = state
    codes, start, inside, folds = is_known(store, posed, e, d, extrema, count)
    folding = folding or folds
    if inside:
        return count, -1, False, (folding, visited, slides)
    smooth = posed.surfaces[0] >= 0
    before = count
    stayed, near, half, mine = True, start, (0.0, 0.0, 0.0, 0.0), visited
    if smooth:
        half = half_widths(store, posed.trees, (e, d))
        way, near, visited = stays(store, posed.surfaces, posed.pose, start, half, passed, visited)
        stayed = way != LEFT
        if way >= 0:
            return count, -1, folding or newton_way_at(passed, way).barren == 1.0, (folding, visited, slides)
    result = NOTHING
    if stayed or not folding:
        # Where nothing folds, it tells whether it goes to a root that is known.
        count, result = add_extremum(
            store, posed, codes, near, (0.0, 0.0, 0.0), merge_radius, extrema, count, work, 0.0
        )
    if count > before:
        folding = folding or not is_alone(extrema, before)
    minimum = result == MINIMUM_FOUND or (result == ALIKE and extremum_at(extrema, count).fold > 0.0)
    if folding and smooth and stayed and not minimum and slides < SLIDES_A_LOOK:
        # Near a fold Newton's method may go to the saddle, past the minimum beside it.
        if count > before:
            before += 1
        slides += 1
        stride = element_ball(store, posed.trees[0], e)[1]
        start, stayed = slide_down(store, posed.surfaces[0], posed.surfaces[1], posed.pose, start, stride, half)
        if stayed and count < extrema.shape[0]:
            count, result = add_extremum(
                store, posed, codes, start, (0.0, 0.0, 0.0), merge_radius, extrema, count, work, 0.0
            )
    if result == ALIKE and not folding:
        # On the slopes around a root that is known.
        return count, -1, False, (folding, visited, slides)
    if count == before or result != MINIMUM_FOUND:
        # Patches that face each other and hold no root of their own.
        if visited > mine:
            newton_way_at(passed, mine).barren = 1.0
        return count, -1, True, (folding, visited, slides)
    return count, before, False, (folding, visited, slides)


@kernel(inner=True)
def search_patches(
    store, posed, moving, limits, span, offsets, merge_radius, facing, found, extrema, count, work, passed
):
    """Look into `found` pairs of patches for minima that are not known: new ones where their gaps are in a span.

    The `limits` are the flank and how near is near enough to look into. Returns a PairSearch.
    """
    flank, enough = limits
    candidates, distances = facing
    free = math.inf
    fertile = math.inf
    folding = False
    for k in range(count):
        folding = folding or not is_alone(extrema, k)
    state = (folding, 0, 0)
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for c in range(found):
        if count == extrema.shape[0]:
            break
        bound = distances[c]
        if bound > flank and bound > enough:
            # Whatever root is there is not near enough for a place, and bounds what the bodies may go;
            free = min(free, bound)
            continue
        if bound > enough:
            # in a crowd, what the ball around it may go.
            new, bears = -1, True
        else:
            count, new, bears, state = search_candidate(
                store,
                posed,
                candidates[c, 0],
                candidates[c, 1],
                merge_radius,
                extrema,
                count,
                work,
                passed,
                state,
            )
            bound = max(bound, flank)
        if bears:
            fertile = min(fertile, bound)
            lo, hi = around(store, moving.tree, candidates[c, moving.side], lo, hi)
        if new >= 0:
            gap = extremum_at(extrema, new).gap
            # The far sides of two bodies oppose each other, too.
            alien = gap > span[1] or gap < span[0]
            alien = alien or (gap < 0.0 and is_outside(store, posed, extrema, new, offsets))
            extremum_at(extrema, new).origin = USELESS if alien else NEW
    d = sub(hi, lo)
    center = scale(0.5, add(lo, hi))
    place = add(matvec(moving.turn, center), moving.shift)
    return PairSearch(count, free, fertile, MotionBall(center, place, 0.5 * math.sqrt(dot(d, d))), math.inf)
