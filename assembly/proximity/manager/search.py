"""The search of an update for contacts that are not known: minima of the distance from the middles of patches.

Most candidate pairs have no minimum of their own: a known one is all there is, or Newton's method goes where it went
from other pairs. Where none is found, a motion may create one.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.proximity.manager.candidates import around
from assembly.proximity.manager.extrema import (
    ALIKE,
    MINIMUM_FOUND,
    NEW,
    NOTHING,
    USELESS,
    add_extremum,
    extremum_at,
    is_alone,
    is_list_full,
)
from assembly.proximity.manager.flat_patches import are_flat, may_be_level
from assembly.proximity.manager.motion_bounds import PairSearch, ball_about
from assembly.proximity.manager.newton_regions import (
    LEFT,
    half_widths,
    keep_way,
    known_in_region,
    newton_way_at,
    stays,
    way_of,
)
from assembly.proximity.manager.overlap import is_outside
from assembly.proximity.manager.own_extrema import may_have_own

# Progress of a search. folding: whether an extremum is near a fold; visited: the number of remembered Newton
# iterations.
Progress = namedtuple("Progress", "folding visited")
# Limits of a search. curved_bound: the curvature-limited motion bound; enough: distance up to which a pair of patches
# is searched; span: least and largest gap of new minima; merge_radius: extrema nearer to each other are one.
Limits = namedtuple("Limits", "curved_bound enough span merge_radius")


@kernel(inline=True)
def is_known(codes, extrema):
    """Whether an extremum of two features is known."""
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.code_f == codes[0] and extremum.code_g == codes[1]:
            return True
    return False


@kernel(inner=True)
def search_candidate(posed, e, d, merge_radius, extrema, passed, progress):
    """Look for an extremum of the patches e of f and d of g that is not known.

    Returns the index of a new minimum, or -1; whether a motion may create one; and the Progress.
    """
    folding, visited = progress
    codes, start, inside = known_in_region(posed, e, d, extrema)
    smooth = posed.surfaces[0] >= 0
    if inside or (not smooth and are_flat(posed, codes, e, d)):
        return -1, False, Progress(folding, visited)
    if not smooth and not may_be_level(posed, codes, e, d) and is_known(codes, extrema):
        # Newton's method would go to the extremum known of the two features, or past it.
        return -1, folding, Progress(folding, visited)
    before = extrema.count[0]
    stayed, near, mine = True, start, visited
    if smooth:
        way, near, visited = stays(posed, start, half_widths(posed, e, d), passed, visited)
        stayed = way != LEFT
        if way >= 0:
            return -1, folding or newton_way_at(passed, way).no_extremum == 1.0, Progress(folding, visited)
    elif not may_have_own(posed, codes, e, d):
        # Newton's method goes to an extremum of other elements. One such sequence is followed for each pair of
        # features: it tells whether that extremum is known.
        way = way_of(passed, visited, codes)
        if way >= 0:
            return -1, folding or newton_way_at(passed, way).no_extremum == 1.0, Progress(folding, visited)
        visited = keep_way(passed, visited, codes)
    result = NOTHING
    if stayed or not folding:
        # With no fold near, a sequence that leaves is followed as well: it may lead to a known extremum.
        result = add_extremum(posed, codes, near, (0.0, 0.0, 0.0), merge_radius, extrema, 0.0)
    if extrema.count[0] > before:
        folding = folding or not is_alone(extremum_at(extrema.rows, before))
    progress = Progress(folding, visited)
    if result == ALIKE and not folding:
        # The patches are on the slope around a known extremum.
        return -1, False, progress
    if extrema.count[0] == before or result != MINIMUM_FOUND:
        # The pair has no new minimum of its own: a motion may create one.
        if visited > mine:
            newton_way_at(passed, mine).no_extremum = 1.0
        return -1, True, progress
    return before, False, progress


@kernel(inner=True)
def search_patches(posed, moving, limits, facing, extrema, passed):
    """Search the candidate pairs `facing` for unknown minima, within Limits. Returns a PairSearch."""
    curved_bound, enough, span = limits.curved_bound, limits.enough, limits.span
    rest = math.inf
    birth_bound = math.inf
    folding = False
    for k in range(extrema.count[0]):
        folding = folding or not is_alone(extremum_at(extrema.rows, k))
    progress = Progress(folding, 0)
    lo = (math.inf, math.inf, math.inf)
    hi = (-math.inf, -math.inf, -math.inf)
    for c in range(facing.found):
        if is_list_full(extrema):
            break
        bound = facing.distances[c]
        if bound > curved_bound and bound > enough:
            # An extremum there is too far for a slot, but limits the motion bound of the pair.
            rest = min(rest, bound)
            continue
        e, d = facing.pairs[c, 0], facing.pairs[c, 1]
        if bound > enough:
            # It is too far for a slot, but so near that it limits the motion bound of the ball.
            new, bears = -1, True
        else:
            new, bears, progress = search_candidate(posed, e, d, limits.merge_radius, extrema, passed, progress)
            bound = max(bound, curved_bound)
        if bears:
            birth_bound = min(birth_bound, bound)
            lo, hi = around(posed.store, moving.tree, d if moving.side == 1 else e, lo, hi)
        if new >= 0:
            extremum = extremum_at(extrema.rows, new)
            # The far sides of two bodies oppose each other, too.
            alien = extremum.gap > span[1] or extremum.gap < span[0]
            alien = alien or (extremum.gap < 0.0 and is_outside(posed, extremum))
            extremum.origin = USELESS if alien else NEW
    return PairSearch(rest, birth_bound, ball_about(moving, lo, hi, 0.0), math.inf)
