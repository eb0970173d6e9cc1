"""Which points of valleys between two faces are rows: few, a step apart, at the bottom (`near_singular.py`)."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import dot, sub
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import FACE, FACE_RECORD, shell_at
from assembly.proximity.extrema.pair_matrix import CONTINUUM
from assembly.proximity.features.holding import HELD_F
from assembly.proximity.features.region_tests import is_feasible
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.extrema import USELESS, extremum_at
from assembly.proximity.manager.near_singular import across_near_singular, into_near_singular

# Cosine of the angle by which a valley turns from one held point to the next.
APART = 0.5
# Points nearer than this [over the size of the scene] count as along each other in any direction.
NEAR = 1e-3


@kernel(inner=True)
def is_of_faces(posed, codes):
    """Whether both features are faces."""
    table, shells = posed.store.table, posed.shells
    return feature_kind(table, shells[0], codes[0]) == FACE and feature_kind(table, shells[1], codes[1]) == FACE


@kernel(inline=True)
def features_of(posed, codes):
    """The records of a feature of f and of one of g."""
    table, shells = posed.store.table, posed.shells
    return feature_at(table, shells[0], codes[0]), feature_at(table, shells[1], codes[1])


@kernel(inline=True)
def is_any_of_many(extremum):
    """Whether an extremum is one of a continuum as far as Newton's method can tell."""
    return abs(extremum.fold) <= CONTINUUM


@kernel(inner=True)
def is_loose(extremum):
    """Whether an extremum is an arbitrary point of a continuum and not held in place."""
    return extremum.corner == 0.0 and is_any_of_many(extremum)


@kernel(inner=True)
def is_next_in_near_singular(posed, codes, surfaces, x, along, extrema, count):
    """Whether the point at x of a valley between two faces is to be held; `along` is the valley's direction there.

    It is held if the valley's direction is far from that at all known points between these faces, or if these lie
    beside it rather than along it: then they are of another valley.
    """
    store = posed.store
    p = surface_point(store.table, store.pool, surfaces[0], x[0], x[1]).point
    for k in range(count):
        extremum = extremum_at(extrema.rows, k)
        alike = extremum.code_f == codes[0] and extremum.code_g == codes[1]
        if alike and extremum.origin != USELESS and not is_loose(extremum):
            y = pair_parameters(extremum)
            step = across_near_singular(store, surfaces[0], surfaces[1], posed.pose, y)
            way = sub(p, surface_point(store.table, store.pool, surfaces[0], y[0], y[1]).point)
            square = dot(way, way)
            part = dot(way, along)
            if step.found and dot(along, step.along) > APART and 2.0 * part * part >= square - NEAR * NEAR:
                return False
    return True


@kernel(inner=True)
def is_on_face(posed, codes, side, x):
    """Whether the point at x of the face of one side is one of the body, within its boundary."""
    face = shell_at(posed.store.table, posed.shells[side]).face_table + FACE_RECORD * codes[side]
    return is_feasible(posed.store, FACE, face, x[2 * side], x[2 * side + 1])


@kernel(inner=True)
def sunk(posed, codes, held, x):
    """The bottom of the valley at x between two faces; x itself if there is none on the face.

    `held` is HELD_F or HELD_G: the face on which the point is held.
    """
    f, g = features_of(posed, codes)
    wide = (math.inf, math.inf, math.inf, math.inf)
    found, there, _on_f, _along = into_near_singular(posed.store, f, g, posed.pose, x, wide)
    return there if found and is_on_face(posed, codes, 0 if held == HELD_F else 1, there) else x
