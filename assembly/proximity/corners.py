"""Corners of one solid over a face of another one: what comes next where a face lies all but flat on another one.

Of two solids only extrema of the distance are contacts. Where a face is nearly parallel to another one, the extremum is
at one corner, and jumps to the next one as the bodies turn: a step knows of the one alone, and the next one is in the
way. But every vertex and every point of an edge that has its foot on a face must stay outside of it, as long as it is
near, whichever is the lowest. Those whose cones miss the normal by little are listed beside the extrema, each a contact
of the two features that it is of.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.proximity.bounding_tree import ELEMENT, ELEMENT_FEATURE, ELEMENT_POOL, pairs_about
from assembly.proximity.overlap import is_outside
from assembly.proximity.roots import (
    CODE_F,
    CODE_G,
    CORNER,
    GAP,
    NEW,
    NOTHING,
    ORIGIN,
    ROOT_NORMAL,
    add_root,
    solids_root,
)
from assembly.proximity.shell import EDGE, FACE
from assembly.proximity.switching import TILT, feature_kind

# Rounding of gaps.
SLACK = 1e-9


@kernel(inner=True)
def is_corner(table, scene, code_f, code_g):
    """Whether two features are a face and no face, or two edges."""
    f = feature_kind(table, scene[2][2], code_f)
    g = feature_kind(table, scene[2][3], code_g)
    return (f == EDGE and g == EDGE) or ((f == FACE) != (g == FACE))


@kernel(inner=True)
def hold_roots(table, pool, scene, roots, count, work):
    """Make corners of those roots that are at one: rows that jump from corner to corner hold none of them."""
    if count == roots.shape[0]:
        return
    for k in range(count):
        codes = (np.int64(roots[k, CODE_F]), np.int64(roots[k, CODE_G]))
        if roots[k, CORNER] == 1.0 or roots[k, GAP] < -SLACK or not is_corner(table, scene, codes[0], codes[1]):
            continue
        x = (roots[k, 0], roots[k, 1], roots[k, 2], roots[k, 3])
        n = (roots[k, ROOT_NORMAL], roots[k, ROOT_NORMAL + 1], roots[k, ROOT_NORMAL + 2])
        found = solids_root(table, pool, scene, codes, x, n, roots, count, work, 1.0)
        roots[k, CORNER] = 0.0 if found == NOTHING else 1.0


@kernel(inner=True)
def add_corners(table, pool, scene, span, offsets, neglect, stack, candidates, roots, count, work):
    """Add corners with gaps in a span; how many roots there are then.

    A point just below a face is inside, where none is between; deeper ones may be behind a sheet, and edges that have
    crossed already beside the other body: roots tell of them. Where all that are near have been looked into, roots
    that are at a corner become one.
    """
    tree_f, tree_g = scene[3]
    found = pairs_about(table, pool, tree_f, tree_g, scene[0], scene[1], span[1], 0.0, TILT, stack, candidates)
    for c in range(min(found, candidates.shape[0])):
        if count == roots.shape[0]:
            break
        o = table[tree_f + ELEMENT_POOL] + ELEMENT * candidates[c, 0]
        p = table[tree_g + ELEMENT_POOL] + ELEMENT * candidates[c, 1]
        codes = (np.int64(pool[o + ELEMENT_FEATURE]), np.int64(pool[p + ELEMENT_FEATURE]))
        if not is_corner(table, scene, codes[0], codes[1]):
            continue
        start = (pool[o], pool[o + 1], pool[p], pool[p + 1])
        before = count
        count, _result = add_root(table, pool, scene, codes, start, (0.0, 0.0, 0.0), neglect, roots, count, work, 1.0)
        if count > before:
            gap = roots[before, GAP]
            of_edges = feature_kind(table, scene[2][2], codes[0]) == feature_kind(table, scene[2][3], codes[1])
            stays = (-SLACK if of_edges else span[0]) <= gap <= span[1]
            if stays and not (gap < -SLACK and is_outside(table, pool, scene, roots, before, offsets)):
                roots[before, ORIGIN] = NEW
            else:
                count = before
    if 0 <= found <= candidates.shape[0]:
        hold_roots(table, pool, scene, roots, count, work)
    return count
