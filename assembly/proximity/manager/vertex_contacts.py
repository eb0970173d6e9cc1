"""Corners of one solid over a face of another one: what comes next where a face lies all but flat on another one.

Of two solids only extrema of the distance are contacts. Where a face is nearly parallel to another one, the extremum is
at one corner, and jumps to the next one as the bodies turn: a step knows of the one alone, and the next one is in the
way. But every vertex and every point of an edge that has its foot on a face must stay outside of it, as long as it is
near, whichever is the lowest. Those whose cones miss the normal by little are listed beside the extrema, each a contact
of the two features that it is of. Of a curved edge that is a point here and there which stays where it is on the edge:
the extremum of a rim that lies almost flat runs around it as the bodies turn by next to nothing.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import cross, dot
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import ELEMENT, element_at, pairs_about, three_of, tree_at
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.features.holding import FEATURES, HELD_F, HELD_G, POINT, TILT
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.extrema import (
    NEW,
    NOTHING,
    add_extremum,
    extremum_at,
    solids_extremum,
)
from assembly.proximity.manager.near_singular import into_near_singular
from assembly.proximity.manager.near_singular_points import (
    hold_continua,
    is_next_in_near_singular,
    is_of_faces,
    is_on_face,
)
from assembly.proximity.manager.overlap import is_outside

# Rounding of gaps.
SLACK = 1e-9
# Cosine of the angle by which an edge turns from one of its points that are held to the next; an edge is straight whose
# parts turn by less than this.
NEXT, STRAIGHT = 0.75, 0.02


@kernel(inner=True)
def is_vertex_contact(table, posed, code_f, code_g):
    """Whether two features are a face and no face, or two edges."""
    f = feature_kind(table, posed.shells[0], code_f)
    g = feature_kind(table, posed.shells[1], code_g)
    return (f == EDGE and g == EDGE) or ((f == FACE) != (g == FACE))


@kernel(inner=True)
def hold_extrema(store, posed, extrema, count, work):
    """Make corners of those roots that are at one: rows that jump from corner to corner hold none of them."""
    if count == extrema.shape[0]:
        return
    for k in range(count):
        extremum = extremum_at(extrema, k)
        codes = (np.int64(extremum.code_f), np.int64(extremum.code_g))
        if (
            extremum.corner > 0.0
            or extremum.gap < -SLACK
            or not is_vertex_contact(store.table, posed, codes[0], codes[1])
        ):
            continue
        x, n = pair_parameters(extremum), three_of(extremum.normal)
        found = solids_extremum(store, posed, codes, x, n, extrema, count, work, FEATURES)
        extremum.corner = 0.0 if found == NOTHING else FEATURES


@kernel(inner=True)
def is_next(store, posed, codes, side, start, width, extrema, count):
    """Whether the middle of a part of an edge, at `start`, is to be held over the face that the other feature is.

    So it is where the edge is bent, and has turned far from all of its points that are known over that face.
    """
    edge = feature_at(store.table, posed.shells[side], codes[side])
    _p, along, bent = edge_jet(store, edge, start[2 * side])
    side_of = cross(along, bent)
    if width * width * dot(side_of, side_of) < STRAIGHT * STRAIGHT * dot(along, along) * dot(along, along):
        return False
    along = unit(along)
    for k in range(count):
        extremum = extremum_at(extrema, k)
        if extremum.code_f == codes[0] and extremum.code_g == codes[1]:
            _p, other, _bent = edge_jet(store, edge, extremum.parameters[2 * side])
            if dot(along, unit(other)) > NEXT:
                return False
    return True


@kernel(inner=True)
def add_vertex_contact(store, posed, codes, start, span, offsets, merge_radius, extrema, count, work, holds):
    """Add the corner that holds on to two features, or to a point of an edge; how many roots there are then."""
    before = count
    extremum = extremum_at(extrema, before)
    count, _result = add_extremum(
        store, posed, codes, start, (0.0, 0.0, 0.0), merge_radius, extrema, count, work, holds
    )
    if count == before:
        return count
    gap = extremum.gap
    of_edges = (
        feature_kind(store.table, posed.shells[0], codes[0])
        == feature_kind(store.table, posed.shells[1], codes[1])
        == EDGE
    )
    stays = (-SLACK if of_edges else span[0]) <= gap <= span[1]
    if not stays or (gap < -SLACK and is_outside(store, posed, extrema, before, offsets)):
        return before
    extremum.origin = NEW
    return count


@kernel(inner=True)
def add_near_singular(store, posed, codes, start, half, span, offsets, merge_radius, extrema, count, work):
    """Hold a point of a valley that crosses a pair of patches of two faces; how many roots there are then."""
    surfaces = (feature_at(store.table, posed.shells[0], codes[0]), feature_at(store.table, posed.shells[1], codes[1]))
    found, x, on_f, along = into_near_singular(store, surfaces[0], surfaces[1], posed.pose, start, half)
    if not found or not is_next_in_near_singular(store, posed, codes, surfaces, x, along, extrema, count):
        return count
    if not is_on_face(store, posed, codes, 0 if on_f else 1, x):
        return count
    held = HELD_F if on_f else HELD_G
    return add_vertex_contact(store, posed, codes, x, span, offsets, merge_radius, extrema, count, work, held)


@kernel(inner=True)
def add_vertex_contacts(store, posed, span, offsets, merge_radius, stack, candidates, extrema, count, work):
    """Add corners with gaps in a span; how many roots there are then.

    A point just below a face is inside, where none is between; deeper ones may be behind a sheet, and edges that have
    crossed already beside the other body: roots tell of them. Where all that are near have been looked into, roots
    that are at a corner become one.
    """
    tree_f, tree_g = posed.trees
    count = hold_continua(store, posed, extrema, count)
    found = pairs_about(store, tree_f, tree_g, posed.pose, span[1], 0.0, TILT, stack, candidates)
    for c in range(min(found, candidates.shape[0])):
        if count == extrema.shape[0]:
            break
        o = tree_at(store.table, tree_f).element_pool + ELEMENT * candidates[c, 0]
        p = tree_at(store.table, tree_g).element_pool + ELEMENT * candidates[c, 1]
        f, g = element_at(store.pool, o), element_at(store.pool, p)
        codes = (np.int64(f.feature), np.int64(g.feature))
        start = (f.middle[0], f.middle[1], g.middle[0], g.middle[1])
        if is_of_faces(store.table, posed, codes[0], codes[1]):
            half = (f.half[0], f.half[1], g.half[0], g.half[1])
            count = add_near_singular(
                store, posed, codes, start, half, span, offsets, merge_radius, extrema, count, work
            )
        if not is_vertex_contact(store.table, posed, codes[0], codes[1]):
            continue
        count = add_vertex_contact(
            store, posed, codes, start, span, offsets, merge_radius, extrema, count, work, FEATURES
        )
        side = 0 if feature_kind(store.table, posed.shells[0], codes[0]) == EDGE else 1
        other = feature_kind(store.table, posed.shells[1 - side], codes[1 - side])
        is_rim = other == FACE and feature_kind(store.table, posed.shells[side], codes[side]) == EDGE
        width = f.half[0] if side == 0 else g.half[0]
        if is_rim and count < extrema.shape[0]:
            if is_next(store, posed, codes, side, start, width, extrema, count):
                count = add_vertex_contact(
                    store, posed, codes, start, span, offsets, merge_radius, extrema, count, work, POINT
                )
    if 0 <= found <= candidates.shape[0]:
        hold_extrema(store, posed, extrema, count, work)
    return count
