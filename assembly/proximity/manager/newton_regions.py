"""Whether a pair of patches has a known extremum, or one to which Newton's method from their middles stays near.

Pairs of patches that face each other are tiles of where two bodies may touch. Newton's method finds what is in a tile
from its middle, in a few steps; a sequence that leaves the tile and its neighbors goes to what other tiles have.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import record_dtype, record_view, size_of
from assembly.geometry.splines.domain import is_within
from assembly.proximity.extrema.face_face import bent_at_most, move_pair, pair_step
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.pair_matrix import FLAT, across_first, is_the_only_one, pair_matrix
from assembly.proximity.extrema.projection import BESIDE
from assembly.proximity.features.holding import POINT
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.extrema import extremum_at
from assembly.proximity.manager.overlap import patch_at

# How many steps; a sequence has arrived when a step turns normals by less than this [rad].
STEPS, LAST_BEND = 6, 0.02
# What became of a sequence.
LEFT, STAYED = -1, -2
# Sequences are one if their first steps lead as close together as this part of a patch.
TOGETHER = 0.25
# A sequence that was followed.
NEWTON_WAY = record_dtype(
    "f8",
    parameters=4,  # where its first step led; of elements of solids their two features
    no_extremum=1,  # 1: it came to no extremum of its own
)
newton_way_at = record_view(NEWTON_WAY)
PASSED = size_of(NEWTON_WAY)


@kernel(inline=True)
def half_widths(posed, e, d):
    """Half the widths, in parameters, of the patches e of f and d of g."""
    f, g = patch_at(posed, 0, e), patch_at(posed, 1, d)
    return (f.half[0], f.half[1], g.half[0], g.half[1])


@kernel(inline=True)
def is_beside(store, surfaces, x, y, half, part):
    """Whether parameters x are within a part of half widths from y, on both surfaces."""
    f, g = surfaces[0], surfaces[1]
    return is_within(store, f, x[0], x[1], y[0], y[1], part * half[0], part * half[1]) and is_within(
        store, g, x[2], x[3], y[2], y[3], part * half[2], part * half[3]
    )


@kernel(inner=True)
def known_in_region(posed, e, d, extrema):
    """The features of elements e and d, the parameters of their middles, whether a known extremum is all there is."""
    f, g = patch_at(posed, 0, e), patch_at(posed, 1, d)
    codes = (np.int64(f.feature), np.int64(g.feature))
    start = (f.middle[0], f.middle[1], g.middle[0], g.middle[1])
    half = half_widths(posed, e, d)
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.code_f != codes[0] or extremum.code_g != codes[1]:
            continue
        if not is_the_only_one(extremum.fold) or extremum.corner >= POINT:
            # A held point is no extremum: the nearest point of the edge, or of the face, may be beside it.
            continue
        if is_beside(posed.store, posed.surfaces, pair_parameters(extremum), start, half, BESIDE):
            return codes, start, True
    return codes, start, False


@kernel(inner=True)
def way_of(passed, count, codes):
    """Which of the `count` sequences in `passed` is from elements of two features of solids; -1: none."""
    for way in range(count):
        features = newton_way_at(passed, way).parameters
        if features[0] == codes[0] and features[1] == codes[1]:
            return way
    return -1


@kernel(inner=True)
def keep_way(passed, count, codes):
    """Keep a sequence from elements of two features of solids, if there is room; how many there are."""
    if count == passed.shape[0]:
        return count
    led = newton_way_at(passed, count)
    led.parameters[0], led.parameters[1] = float(codes[0]), float(codes[1])
    led.no_extremum = 0.0
    return count + 1


@kernel(inner=True)
def step_of_faces(store, surfaces, pose, x, is_cut):
    """Where one step of Newton's method for two faces leads from x, and by how much it turns a normal [rad].

    With `is_cut` the step is shortened so that it turns no normal by much. Without a tangent plane the result is x.
    """
    f, g = surfaces
    frame = pair_frame(store, f, g, pose, x)
    if not frame.regular:
        return x, 0.0
    a, c, r = frame.shape_f, frame.shape_g, frame.residual
    matrix = pair_matrix(a, c, frame.gap, FLAT)
    inverse, _level = across_first(a, c, r, matrix.k, matrix.h, matrix.inverse, FLAT)
    step_f, step_g, bend_f, bend_g = pair_step(a, c, r, matrix.k, inverse, 1.0)
    # The step is cut on each surface by itself, as in `solve_pair`.
    factor_f = bent_at_most(bend_f) if is_cut else 1.0
    factor_g = bent_at_most(bend_g) if is_cut else 1.0
    step_f = (factor_f * step_f[0], factor_f * step_f[1])
    step_g = (factor_g * step_g[0], factor_g * step_g[1])
    there, _held, _way = move_pair(store, f, g, pose.rotation, x, frame, step_f, step_g)
    return there, max(bend_f, bend_g)


@kernel(inner=True)
def stays(posed, start, half, passed, count):
    """Whether Newton's method from `start` stays beside it, within BESIDE times half widths in (u, v) and (s, t).

    Returns STAYED or LEFT, or which of the `count` earlier sequences in `passed` (n, PASSED) it joins; where it ended;
    and how many sequences there are now.
    """
    store, surfaces, pose = posed.store, posed.surfaces, posed.pose
    x = start
    for step in range(STEPS):
        there, bend = step_of_faces(store, surfaces, pose, x, True)
        if not bend > LAST_BEND:
            return STAYED, x, count
        x = there
        if not is_beside(store, surfaces, x, start, half, BESIDE):
            return LEFT, x, count
        if step == 0:
            for way in range(count):
                there = pair_parameters(newton_way_at(passed, way))
                if is_beside(store, surfaces, x, there, half, TOGETHER):
                    return way, x, count
            if count < passed.shape[0]:
                led = newton_way_at(passed, count)
                for l in range(4):
                    led.parameters[l] = x[l]
                led.no_extremum = 0.0
                count += 1
    return STAYED, x, count
