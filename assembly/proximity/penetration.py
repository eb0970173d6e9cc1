"""The pair of two shells that cross: how they would come apart, and where they are deepest in each other on that way.

Nearest points say nothing where shells cross: all crossing points are at distance zero. The pair wanted has normals
that oppose each other and a negative gap. Two faces without boundaries have it by `global_start`. Of other shells, g is
moved along the normal of the crossing until they are apart; from the nearest points there the pair is followed on the
way back (`switching.py`), through touching, to a negative gap.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.spline import SIGN
from assembly.geometry.vec import add, blend, cross, dot, neg, scale
from assembly.proximity.crossing import tangents
from assembly.proximity.extremal import CONVERGED, NOT_CONVERGED, SINGULAR
from assembly.proximity.nearest import APART, search
from assembly.proximity.shell import EDGES, FACE, FACE_RECORD, FACE_SURFACE, FACE_TABLE, FACE_TRIM, FACES, VERTICES
from assembly.proximity.start import global_start
from assembly.proximity.switching import feature_at, feature_kind, track_features

# A pair of shells that cross was found.
PENETRATING = 3
# The first move apart, as a part of the size; it is doubled so many times at most.
FIRST, DOUBLINGS = 0.02, 7
# Steps of the way back, and how often one may be halved.
STEPS, HALVINGS = 12, 8
# Shells that are apart by this part of the size may seem to cross: rounding says so of those that touch.
TOUCHING = 1e-12


@kernel(inner=True)
def has_one_face(table, shell):
    """Whether a shell is one face without a boundary."""
    if table[shell + FACES] != 1 or table[shell + EDGES] != 0 or table[shell + VERTICES] != 0:
        return False
    return table[table[shell + FACE_TABLE] + FACE_TRIM] < 0


@kernel(inner=True)
def face_normal(table, pool, shell, code, turn, u, v):
    """The outward unit normal of a face, turned; zero where it has none."""
    record = table[shell + FACE_TABLE] + FACE_RECORD * code
    zero = (0.0, 0.0, 0.0)
    _p, su, sv = tangents(table, pool, FACE, record, turn, zero, u, v)
    n = cross(su, sv)
    length = math.sqrt(dot(n, n))
    if not length > 0.0:
        return zero
    return scale(float(table[table[record + FACE_SURFACE] + SIGN]) / length, n)


@kernel(inner=True)
def walk_back(table, pool, shell_f, shell_g, turn, shift, away, f, g, x, size):
    """The pair of g moved by `away`, followed until g is back: status, features, coordinates, normal, gap."""
    none = (0.0, 0.0, 0.0)
    done = 0.0
    step = 1.0 / STEPS
    n = none
    gap = 0.0
    halved = 0
    while done < 1.0:
        part = min(done + step, 1.0)
        place = blend(1.0, shift, 1.0 - part, away)
        status, next_f, next_g, y, frame, _switches = track_features(
            table, pool, shell_f, shell_g, turn, place, f, g, x, n, size, 1.0
        )
        if status != CONVERGED and status != SINGULAR:
            if halved == HALVINGS:
                return NOT_CONVERGED, f, g, x, n, gap
            halved += 1
            step *= 0.5
            continue
        f = next_f
        g = next_g
        x = y
        n = frame[0]
        gap = frame[5]
        done = part
    return CONVERGED, f, g, x, n, gap


@kernel(inner=True, allocates=True)
def deepest(table, pool, shell_f, shell_g, turn, shift, f, g, x, size):
    """The pair of two shells that cross at x of features f and g.

    Returns
    -------
    Whether it was found, features, coordinates, a normal near that of the pair (zero: none), gap.
    """
    none = (0.0, 0.0, 0.0)
    if has_one_face(table, shell_f) and has_one_face(table, shell_g):
        a = feature_at(table, shell_f, 0)
        b = feature_at(table, shell_g, 0)
        status, y, gap = global_start(table, pool, a, b, turn, shift, size)
        return status == CONVERGED or status == SINGULAR, 0, 0, y, none, gap
    same = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    best = (False, f, g, x, none, -math.inf)
    for attempt in range(3):
        m = none
        if attempt == 0 and feature_kind(table, shell_f, f) == FACE:
            m = face_normal(table, pool, shell_f, f, same, x[0], x[1])
        elif attempt == 1 and feature_kind(table, shell_g, g) == FACE:
            m = neg(face_normal(table, pool, shell_g, g, turn, x[2], x[3]))
        elif attempt == 2 and not best[0]:
            # From one body's origin to the other's, for want of a normal.
            length = math.sqrt(dot(shift, shift))
            m = scale(1.0 / length, shift) if length > 1e-9 * size else (0.0, 0.0, 1.0)
        if dot(m, m) < 0.5:
            continue
        reach = FIRST * size
        for _ in range(DOUBLINGS):
            away = scale(reach, m)
            status, cf, cg, y, _gap, _lower, _effort = search(
                table, pool, shell_f, shell_g, turn, add(shift, away), size, math.inf
            )
            if status == APART:
                found, cf, cg, y, n, gap = walk_back(table, pool, shell_f, shell_g, turn, shift, away, cf, cg, y, size)
                if found == CONVERGED and TOUCHING * size >= gap > best[5]:
                    best = (True, cf, cg, y, n, gap)
                break
            reach *= 2.0
    return best
