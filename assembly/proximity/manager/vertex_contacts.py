"""Corners of one solid over a face of another one: the next contacts where two faces are almost parallel.

Contacts of two solids are extrema of the distance. Where a face is nearly parallel to another one, the extremum is at
one corner, and jumps to the next one as the bodies turn: a step that knows of the first corner alone is stopped by the
next. But every vertex and every point of an edge that has its projection on a face must stay outside of that face as
long as it is near, not only the lowest one. Those whose normal cones miss the face's normal by little are listed beside
the extrema, each as a contact of its two features. Of a curved edge they are a few points, each held in its place on
the edge: the extremum of a circular edge that lies almost flat runs around it as the bodies turn by next to nothing.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import pairs_about, three_of
from assembly.proximity.features.holding import FEATURES, HELD_F, HELD_G, POINT, TILT
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.continua import (
    SLACK,
    hold_continua,
    is_next,
    is_straight,
    kinds_of,
    next_in_socket,
)
from assembly.proximity.manager.extrema import NEW, NOTHING, add_extremum, extremum_at, is_list_full, solids_extremum
from assembly.proximity.manager.near_singular import into_near_singular
from assembly.proximity.manager.near_singular_points import (
    features_of,
    is_any_of_many,
    is_next_in_near_singular,
    is_of_faces,
    is_on_face,
)
from assembly.proximity.manager.overlap import is_outside, patch_at
from assembly.proximity.manager.own_extrema import may_be_over, may_have_own


@kernel(inner=True)
def is_vertex_contact(posed, codes):
    """Whether two features are two edges, or a face and an edge or vertex."""
    f, g = kinds_of(posed, codes)
    return (f == EDGE and g == EDGE) or ((f == FACE) != (g == FACE))


@kernel(inner=True)
def hold_extrema(posed, extrema):
    """Turn extrema that are at a corner into vertex contacts: a row that jumps between corners holds none of them."""
    if is_list_full(extrema):
        return
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        codes = (np.int64(extremum.code_f), np.int64(extremum.code_g))
        if extremum.corner > 0.0 or extremum.gap < -SLACK or not is_vertex_contact(posed, codes):
            continue
        x, n = pair_parameters(extremum), three_of(extremum.normal)
        found = solids_extremum(posed, codes, x, n, extrema, FEATURES)
        extremum.corner = 0.0 if found == NOTHING else FEATURES


@kernel(inner=True)
def add_vertex_contact(posed, codes, start, span, merge_radius, extrema, holds):
    """Add the vertex contact that is locked to two features, or to a point of one of them."""
    before = extrema.count[0]
    extremum = extremum_at(extrema.rows, before)
    add_extremum(posed, codes, start, (0.0, 0.0, 0.0), merge_radius, extrema, holds)
    if extrema.count[0] == before:
        return
    gap = extremum.gap
    f, g = kinds_of(posed, codes)
    stays = (-SLACK if f == g == EDGE else span[0]) <= gap <= span[1]
    if not stays or (gap < -SLACK and is_outside(posed, extremum)):
        extrema.count[0] = before
    else:
        extremum.origin = NEW


@kernel(inner=True)
def add_near_singular(posed, codes, start, half, span, merge_radius, extrema):
    """Hold a point of a valley that crosses a pair of patches of two faces."""
    surfaces = features_of(posed, codes)
    found, x, on_f, along = into_near_singular(posed.store, surfaces[0], surfaces[1], posed.pose, start, half)
    if not found or not is_next_in_near_singular(posed, codes, surfaces, x, along, extrema, extrema.count[0]):
        return
    if is_on_face(posed, codes, 0 if on_f else 1, x):
        add_vertex_contact(posed, codes, x, span, merge_radius, extrema, HELD_F if on_f else HELD_G)


@kernel(inner=True)
def add_vertex_contacts(posed, span, merge_radius, stack, candidates, extrema):
    """Add corners with gaps in a span.

    A point just below a face is inside, where none is between; deeper ones may be behind a sheet, and edges that have
    crossed already beside the other body: extrema tell of them. Where all that are near have been looked into, extrema
    that are at a corner become one.
    """
    hold_continua(posed, extrema)
    tree_f, tree_g = posed.trees
    found = pairs_about(posed.store, posed.trees, posed.pose, span[1], 0.0, TILT, stack, candidates)
    for c in range(min(found, candidates.shape[0])):
        if is_list_full(extrema):
            break
        f, g = patch_at(posed, 0, candidates[c, 0]), patch_at(posed, 1, candidates[c, 1])
        codes = (np.int64(f.feature), np.int64(g.feature))
        if not may_be_over(posed, codes, candidates[c, 0], candidates[c, 1]):
            continue
        start = (f.middle[0], f.middle[1], g.middle[0], g.middle[1])
        if is_of_faces(posed, codes):
            half = (f.half[0], f.half[1], g.half[0], g.half[1])
            add_near_singular(posed, codes, start, half, span, merge_radius, extrema)
            holds = next_in_socket(posed, codes, start, extrema)
            if holds != 0.0 and not is_list_full(extrema):
                add_vertex_contact(posed, codes, start, span, merge_radius, extrema, holds)
        if not is_vertex_contact(posed, codes):
            continue
        kinds = kinds_of(posed, codes)
        before = extrema.count[0]
        if may_have_own(posed, codes, candidates[c, 0], candidates[c, 1]):
            add_vertex_contact(posed, codes, start, span, merge_radius, extrema, FEATURES)
        side = 0 if kinds[0] == EDGE else 1
        if kinds[side] != EDGE or kinds[1 - side] != FACE:
            continue
        if extrema.count[0] > before and is_any_of_many(extremum_at(extrema.rows, before)):
            extrema.count[0] = before
        t, width = start[2 * side], f.half[0] if side == 0 else g.half[0]
        bends = not is_straight(posed, codes, side, t, width)
        if bends and not is_list_full(extrema) and is_next(posed, codes, side, t, extrema, extrema.count[0]):
            add_vertex_contact(posed, codes, start, span, merge_radius, extrema, POINT)
    if 0 <= found <= candidates.shape[0]:
        hold_extrema(posed, extrema)
