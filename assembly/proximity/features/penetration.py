"""The pair of two B-rep bodies that cross: a way out, and where they are deepest in each other along it.

Nearest points say nothing where bodies cross: all crossing points are at distance zero. The pair wanted has normals
that oppose each other and a negative gap. For two faces without boundaries `global_start` finds it. Otherwise g is
moved along normals of the faces that cross (`proximity/features/separating_normals.py`) until the bodies are apart;
from the nearest points there the pair is followed on the way back (`switching.py`), through touching, to a negative
gap.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, dot, scale
from assembly.kinematics.motion import IDENTITY, RelativePose
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import face_at, shell_at
from assembly.proximity.extrema.face_face import CONVERGED, SINGULAR
from assembly.proximity.extrema.global_start import global_start
from assembly.proximity.features.global_search import CROSSING, FoundPair, nearest_of_shells
from assembly.proximity.features.separating_normals import (
    WAYS,
    add_end_ways,
    add_way,
    add_ways,
    points_of,
    sum_of,
    way_at,
)
from assembly.proximity.features.switching import track_features

# A pair of shells that cross was found.
PENETRATING = 3
# The first move apart, as a part of the size; it is doubled so many times at most.
FIRST, DOUBLINGS = 0.02, 7
# Steps of the way back, and how often one may be halved.
STEPS, HALVINGS = 12, 8
# Relative accuracy of the nearest points on the way out: all points of parallel faces are equally near.
ROUGH = 0.01
# Bodies apart by less than this part of the size may seem to cross, by rounding.
SEEMING_OVERLAP = 1e-12
# A move by this part of the size parts what only touches.
PARTED = 1e-6


@kernel(inner=True)
def has_one_face(table, shell):
    """Whether a shell is one face without a boundary."""
    solid = shell_at(table, shell)
    if solid.faces != 1 or solid.edges != 0 or solid.vertices != 0:
        return False
    return face_at(table, solid.face_table).trim < 0


@kernel(inner=True)
def walk_back(store, shells, pose, away, codes, x, size):
    """The pair of g moved by `away`, followed until g is back."""
    done = 0.0
    step = 1.0 / STEPS
    n = (0.0, 0.0, 0.0)
    gap = 0.0
    halved = 0
    while done < 1.0:
        part = min(done + step, 1.0)
        place = blend(1.0, pose.shift, 1.0 - part, away)
        there = track_features(store, shells, RelativePose(pose.rotation, place), codes, x, n, size, 1.0)
        if there.status != CONVERGED and there.status != SINGULAR:
            if halved == HALVINGS:
                return FoundPair(False, codes, x, n, gap)
            halved += 1
            step *= 0.5
            continue
        codes = there.codes
        x = there.x
        n = there.frame.normal
        gap = there.frame.gap
        done = part
    return FoundPair(True, codes, x, n, gap)


@kernel(inner=True)
def ways_out(store, shells, pose, codes, x, size, ways):
    """Ways in which two shells that cross at x of two features may come apart; how many there are."""
    f, g = points_of(codes, x)
    count = add_ways(store, shells[0], f, IDENTITY.rotation, 1.0, size, ways, 0)
    count = add_ways(store, shells[1], g, pose.rotation, -1.0, size, ways, count)
    # The way out of a corner lies between the walls' normals.
    count = add_way(sum_of(ways, count), ways, count)
    # Flush bodies meet all along edges, also where another face leads out sooner.
    count = add_end_ways(store, shells[0], f, IDENTITY.rotation, 1.0, size, ways, count)
    return add_end_ways(store, shells[1], g, pose.rotation, -1.0, size, ways, count)


@kernel(inner=True, allocates=True)
def deepest(store, shells, pose, codes, x, size):
    """The pair of two shells that cross at x of two features."""
    shell_f, shell_g = shells
    none = (0.0, 0.0, 0.0)
    if has_one_face(store.table, shell_f) and has_one_face(store.table, shell_g):
        a = feature_at(store.table, shell_f, 0)
        b = feature_at(store.table, shell_g, 0)
        status, y, gap = global_start(store, a, b, pose, size)
        # The far side of a thin body may be nearer than where it is in the other one.
        if (status == CONVERGED or status == SINGULAR) and gap <= SEEMING_OVERLAP * size:
            return FoundPair(True, (0, 0), y, none, gap)
    ways = np.empty((WAYS, 3))
    count = ways_out(store, shells, pose, codes, x, size, ways)
    best = FoundPair(False, codes, x, none, -math.inf)
    other = best
    for attempt in range(2):
        if attempt == 1:
            # From one body's origin to the other's, where no normal leads out.
            count = add_way(
                pose.shift if dot(pose.shift, pose.shift) > 1e-18 * size * size else (0.0, 0.0, 1.0), ways, 0
            )
        reach = FIRST * size
        # The shortest way out, of all of them.
        for _ in range(DOUBLINGS):
            for k in range(count):
                away = scale(reach, way_at(ways, k))
                place = add(pose.shift, away)
                out = nearest_of_shells(store, shells, RelativePose(pose.rotation, place), size, ROUGH)
                if out.status == CROSSING or not out.lower > 0.0:
                    continue
                back = walk_back(store, shells, pose, away, out.codes, out.x, size)
                gap = back.gap
                if not back.found or not SEEMING_OVERLAP * size >= gap > best.gap:
                    continue
                if gap < -reach:
                    # The way back led to another pair: the bodies are not deeper than they were moved.
                    if gap > other.gap:
                        other = back
                    continue
                if gap >= -SEEMING_OVERLAP * size:
                    # They touch here. If they only touch, the least move parts them. Where they touch along a line or
                    # all over a face the search may not prove that; then it suffices that it finds no crossing.
                    place = add(pose.shift, scale(PARTED / reach * size, away))
                    parted = nearest_of_shells(store, shells, RelativePose(pose.rotation, place), size, ROUGH)
                    if parted.status == CROSSING:
                        continue
                best = back
            if best.found:
                return best
            reach *= 2.0
    return other
