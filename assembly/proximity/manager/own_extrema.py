"""Which elements of two solids may have an extremum of their own, judged by one step of Newton's method.

Elements are tiles that turn by little: Newton's method finds what is in a tile from its middle in a few steps, and its
first step is right to a few percent. If that leads away from two elements and their neighbors, these have no extremum
of their own. Of a shaft in its bore a thousand pairs of elements face each other, and hardly any has an extremum.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import dot, matvec, sub
from assembly.kinematics.motion import inverse_pose
from assembly.proximity.brep.borders import feature_at, feature_of
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import TREE_ROUNDING, node_of, off_axis, seen_from, three_of, view_of
from assembly.proximity.extrema.face_edge import NO_EDGE, edge_over, point_over, step_on_face
from assembly.proximity.extrema.face_frames import own_frame
from assembly.proximity.extrema.feature_jets import NewtonLimits, edge_jet, other_jet
from assembly.proximity.extrema.projection import BESIDE
from assembly.proximity.manager.continua import kinds_of
from assembly.proximity.manager.flat_patches import may_be_level
from assembly.proximity.manager.newton_regions import half_widths, is_beside, step_of_faces
from assembly.proximity.manager.overlap import patch_at, seen_by_other

__all__ = ["may_be_over", "may_have_own"]

# Two edges may cross near two of their elements if the tangents at the middles of these cross within the first number
# of half widths (elements turn by 0.2 rad). If the sine of the angle between the edges is below the second number,
# their curvatures tell where they cross, unless these are rounding, below the third.
BEYOND, PARALLEL, STRAIGHT = 2.0, 0.2, 1e-9


@kernel(inner=True)
def may_cross(posed, codes, f, g):
    """Whether two edges may cross, seen along their common perpendicular, near two elements of theirs.

    Judged by the tangents at their middles; where these are all but parallel, as of rims about one axis, by a step of
    Newton's method for d.f' = d.g' = 0, the ends of the perpendicular d.
    """
    store = posed.store
    p, along_f, bent_f = edge_jet(store, feature_at(store.table, posed.shells[0], codes[0]), f.middle[0])
    q, along_g, bent_g = edge_jet(store, feature_at(store.table, posed.shells[1], codes[1]), g.middle[0])
    d = sub(seen_by_other(posed, 1, q), p)
    along_g = matvec(posed.pose.rotation, along_g)
    ff, fg, gg = dot(along_f, along_f), dot(along_f, along_g), dot(along_g, along_g)
    determinant, square, most = ff * gg - fg * fg, ff * gg, BEYOND
    if determinant < PARALLEL * PARALLEL * square:
        ff -= dot(d, bent_f)
        gg += dot(d, matvec(posed.pose.rotation, bent_g))
        determinant, most = ff * gg - fg * fg, BESIDE
        if abs(determinant) <= STRAIGHT * square:
            return True
    df, dg = dot(d, along_f), dot(d, along_g)
    at_f, at_g = (df * gg - dg * fg) / determinant, (df * fg - dg * ff) / determinant
    return abs(at_f) <= most * f.half[0] and abs(at_g) <= most * g.half[0]


@kernel(inner=True)
def stays_over_face(posed, side, codes, face, other):
    """Whether one step from the middles of a face's element and of an edge's or vertex's element stays near both.

    The step is not shortened. A singular pair, as of a circular edge in its bore, does not move where the distance is
    level.
    """
    store = posed.store
    surface = feature_at(store.table, posed.shells[side], codes[side])
    feature = feature_of(store, posed.shells[1 - side], codes[1 - side])
    pose = posed.pose if side == 0 else inverse_pose(posed.pose)
    t = other.middle[0]
    own = own_frame(store, surface, face.middle[0], face.middle[1])
    q, ct, ctt = other_jet(store, feature, pose, t, 0.0)
    if not own.regular:
        return True
    over = point_over(own, q, 1.0)
    edge = edge_over(own, ct, ctt) if feature.kind == EDGE else NO_EDGE
    step = step_on_face(store, feature, t, over, edge, NewtonLimits(1.0, math.inf, 1))
    if step.slides:
        return False
    e, (ax, ay) = own.rates, step.move
    return (
        abs(e[0] * ax + e[1] * ay) <= BESIDE * face.half[0]
        and abs(e[2] * ay) <= BESIDE * face.half[1]
        and (step.is_point or abs(step.dt) <= BESIDE * other.half[0])
    )


@kernel(inner=True)
def faces_stay(posed, codes, e, d):
    """`stays_over_face`, for elements of two faces."""
    store = posed.store
    surfaces = (feature_at(store.table, posed.shells[0], codes[0]), feature_at(store.table, posed.shells[1], codes[1]))
    f, g = patch_at(posed, 0, e), patch_at(posed, 1, d)
    start = (f.middle[0], f.middle[1], g.middle[0], g.middle[1])
    there, _bend = step_of_faces(store, surfaces, posed.pose, start, False)
    return is_beside(store, surfaces, there, start, half_widths(posed, e, d), BESIDE)


@kernel(inner=True)
def may_have_own(posed, codes, e, d):
    """Whether elements e and d, of features codes of two solids, may have an extremum of their own."""
    kinds = kinds_of(posed, codes)
    f, g = patch_at(posed, 0, e), patch_at(posed, 1, d)
    if kinds[0] == FACE and kinds[1] == FACE:
        return faces_stay(posed, codes, e, d)
    if kinds[0] == FACE:
        return may_be_level(posed, codes, e, d) and stays_over_face(posed, 0, codes, f, g)
    if kinds[1] == FACE:
        return may_be_level(posed, codes, e, d) and stays_over_face(posed, 1, codes, g, f)
    return kinds[0] != EDGE or kinds[1] != EDGE or may_cross(posed, codes, f, g)


@kernel(inner=True)
def may_be_over(posed, codes, e, d):
    """Whether elements may have points that are over each other along a normal of a face, if one of them is of one.

    What is beside a face may lean over it; points of the face are along its own normals.
    """
    kinds = kinds_of(posed, codes)
    if kinds[0] != FACE and kinds[1] != FACE:
        return True
    f, g = node_of(posed.store, posed.trees[0], e), node_of(posed.store, posed.trees[1], d)
    center, _around, axis = seen_from(view_of(posed.pose), g)
    apart = sub(center, three_of(f.center))
    square = dot(apart, apart)
    r = f.radius + g.radius
    r += TREE_ROUNDING * (1.0 + r + math.sqrt(square))
    if kinds[0] == FACE and not off_axis(apart, square, three_of(f.axis), f.cosine, f.sine, r):
        return True
    return kinds[1] == FACE and not off_axis(apart, square, axis, g.cosine, g.sine, r)
