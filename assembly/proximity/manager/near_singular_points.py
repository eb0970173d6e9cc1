"""Which points of valleys between two faces are held: few of them, a step apart, at the bottom
(`proximity/manager/near_singular.py`).
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import dot, sub
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import FACE, FACE_RECORD, shell_at
from assembly.proximity.features.holding import HELD_F, HELD_G
from assembly.proximity.features.region_tests import is_feasible
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.extrema import (
    NEW,
    ROOT,
    USELESS,
    extremum_at,
)
from assembly.proximity.manager.near_singular import across_near_singular, into_near_singular

# Cosine of the angle by which a valley turns from one of its points that are held to the next.
APART = 0.5
# Points nearer than this, in parts of the scene's size, are along each other whichever way.
NEAR = 1e-3
# A root this near to a fold, det H over |H|^2, is one of a continuum as far as Newton's method can tell.
CONTINUUM = 1e-6


@kernel(inner=True)
def is_of_faces(table, posed, code_f, code_g):
    """Whether both features are faces."""
    return feature_kind(table, posed.shells[0], code_f) == FACE and feature_kind(table, posed.shells[1], code_g) == FACE


@kernel(inner=True)
def is_loose(extrema, k):
    """Whether a root is any one of a continuum, where it is by chance."""
    extremum = extremum_at(extrema, k)
    return extremum.corner == 0.0 and abs(extremum.fold) <= CONTINUUM


@kernel(inner=True)
def is_next_in_near_singular(store, posed, codes, surfaces, x, along, extrema, count):
    """Whether the point at x of a valley between two faces is to be held; `along` is the valley's direction there.

    So it is where the valley has turned far from all of the points that are known between these faces, or where these
    lie beside it rather than along it, in another valley.
    """
    p = surface_point(store.table, store.pool, surfaces[0], x[0], x[1])[0]
    for k in range(count):
        extremum = extremum_at(extrema, k)
        alike = extremum.code_f == codes[0] and extremum.code_g == codes[1]
        if alike and extremum.origin != USELESS and not is_loose(extrema, k):
            y = pair_parameters(extremum)
            step = across_near_singular(store, surfaces[0], surfaces[1], posed.pose, y)
            found, other = step.found, step.along
            way = sub(p, surface_point(store.table, store.pool, surfaces[0], y[0], y[1])[0])
            square = dot(way, way)
            part = dot(way, along)
            if found and dot(along, other) > APART and 2.0 * part * part >= square - NEAR * NEAR:
                return False
    return True


@kernel(inner=True)
def is_left_out(store, posed, extrema, k):
    """Whether root k, behind all that stay, is of a continuum and next to what is held; if not, it is held."""
    extremum = extremum_at(extrema, k)
    codes = (np.int64(extremum.code_f), np.int64(extremum.code_g))
    if (
        extremum.origin == USELESS
        or not is_loose(extrema, k)
        or not is_of_faces(store.table, posed, codes[0], codes[1])
    ):
        return False
    surfaces = (feature_at(store.table, posed.shells[0], codes[0]), feature_at(store.table, posed.shells[1], codes[1]))
    x = pair_parameters(extremum)
    step = across_near_singular(store, surfaces[0], surfaces[1], posed.pose, x)
    found, on_f, along = step.found, step.on_f, step.along
    if not found:
        return False
    if extremum.origin == NEW and not is_next_in_near_singular(store, posed, codes, surfaces, x, along, extrema, k):
        return True
    extremum.corner = HELD_F if on_f else HELD_G
    return False


@kernel(inner=True)
def hold_continua(store, posed, extrema, count):
    """Of a continuum of roots along a valley between two faces, hold those that are listed and few of the new ones.

    What Newton's method finds there are as many as it has starts, and may fill the room; one that is not next to what
    is held is left out. Returns how many roots there are then.
    """
    stay = 0
    for k in range(count):
        for l in range(ROOT):
            extrema[stay, l] = extrema[k, l]
        stay += 1
        if is_left_out(store, posed, extrema, stay - 1):
            stay -= 1
    return stay


@kernel(inner=True)
def is_on_face(store, posed, codes, side, x):
    """Whether the point at x of the face of one side is one of the body, within its boundary."""
    face = shell_at(store.table, posed.shells[side]).face_table + FACE_RECORD * codes[side]
    return is_feasible(store, FACE, face, x[2 * side], x[2 * side + 1])


@kernel(inner=True)
def sunk(store, posed, codes, held, x):
    """Where the bottom of the valley is, between two faces, across which x is; x where there is none in the faces.

    `held` says of which face it holds a point, HELD_F or HELD_G.
    """
    f = feature_at(store.table, posed.shells[0], codes[0])
    g = feature_at(store.table, posed.shells[1], codes[1])
    wide = (math.inf, math.inf, math.inf, math.inf)
    found, there, _on_f, _along = into_near_singular(store, f, g, posed.pose, x, wide)
    return there if found and is_on_face(store, posed, codes, 0 if held == HELD_F else 1, there) else x
