"""Few points of a continuum of extrema become rows: of an edge that lies on a face, of a valley between two faces.

Where an edge has the same distance from a face all along, as boundary edges of two flush plates have, Newton's method
finds as many extrema as it has starts. Along a straight edge the gap is affine: both ends are corners with rows of
their own, which imply all points between. On a curved edge a few points are held in place, one for each 40 degrees or
so by which it turns; where the edge is tilted, its extremum is isolated and becomes a row beside these.

A ball in a socket of the same radius has no extremum, or one at any point. Points of the hollow face are held there,
with normals as far apart as the tangents at held points of an edge.
"""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at, surface_point
from assembly.geometry.vec import cross, dot, matvec, scale
from assembly.proximity.brep.apexes import unit
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import three_of
from assembly.proximity.extrema.feature_jets import edge_jet, edge_limits
from assembly.proximity.features.holding import HELD_F, HELD_G, POINT
from assembly.proximity.features.solid_contact import pair_parameters
from assembly.proximity.manager.extrema import NEW, ROOT, USELESS, extremum_at
from assembly.proximity.manager.near_singular import across_near_singular
from assembly.proximity.manager.near_singular_points import features_of, is_loose, is_next_in_near_singular

# Cosine of the angle by which an edge turns from one held point to the next; a part of an edge that turns by less than
# the second number [rad] is straight.
NEXT, STRAIGHT = 0.75, 0.02
# A bulge fills a hollow if their Gaussian curvatures differ by no more than this part.
ALIKE_BENT = 0.05
# Rounding of gaps.
SLACK = 1e-9


@kernel(inner=True)
def kinds_of(posed, codes):
    """What two features are: faces, edges or vertices."""
    table, shells = posed.store.table, posed.shells
    return feature_kind(table, shells[0], codes[0]), feature_kind(table, shells[1], codes[1])


@kernel(inner=True)
def is_straight(posed, codes, side, t, width):
    """Whether an edge, with the curvature that it has at t, hardly turns over a width of its parameter."""
    _p, along, bent = edge_jet(posed.store, feature_at(posed.store.table, posed.shells[side], codes[side]), t)
    side_of = cross(along, bent)
    square = dot(along, along)
    return width * width * dot(side_of, side_of) < STRAIGHT * STRAIGHT * square * square


@kernel(inner=True)
def is_next(posed, codes, side, t, extrema, count):
    """Whether the tangent at t is far from those at the edge's points over the same face among the first `count`."""
    store = posed.store
    edge = feature_at(store.table, posed.shells[side], codes[side])
    along = unit(edge_jet(store, edge, t)[1])
    for k in range(count):
        extremum = extremum_at(extrema.rows, k)
        if extremum.code_f == codes[0] and extremum.code_g == codes[1]:
            other = edge_jet(store, edge, extremum.parameters[2 * side])[1]
            if dot(along, unit(other)) > NEXT:
                return False
    return True


@kernel(inner=True)
def width_of(posed, codes, side):
    """The width of the parameter of an edge."""
    low, high, _endless = edge_limits(posed.store, feature_at(posed.store.table, posed.shells[side], codes[side]))
    return high - low


@kernel(inner=True)
def bulge_at(posed, side, code, u, v):
    """Gaussian curvature of a face of one body, made negative in a hollow, and its outward normal in the axes of f.

    A saddle counts as flat: zero.
    """
    store = posed.store
    surface = feature_at(store.table, posed.shells[side], code)
    _p, su, sv, suu, suv, svv = surface_point(store.table, store.pool, surface, u, v)
    sign = float(surface_at(store.table, surface).sign)
    n = scale(sign, unit(cross(su, sv)))
    e, f, g = dot(su, su), dot(su, sv), dot(sv, sv)
    l, m, k = dot(n, suu), dot(n, suv), dot(n, svv)
    area = e * g - f * f
    curvature = max(l * k - m * m, 0.0) / area if area > 0.0 else 0.0
    if side == 1:
        n = matvec(posed.pose.rotation, n)
    # A hollow bends toward its outward normal.
    return (-curvature if l + k > 0.0 else curvature), n


@kernel(inner=True)
def next_in_socket(posed, codes, x, extrema):
    """Which face a point is held on, the hollow one of two that fill each other: HELD_F, HELD_G or 0.

    It is held if the normal has turned far from those at all known points between the two faces.
    """
    bulge_f, n_f = bulge_at(posed, 0, codes[0], x[0], x[1])
    bulge_g, n_g = bulge_at(posed, 1, codes[1], x[2], x[3])
    if not bulge_f * bulge_g < 0.0 or abs(bulge_f + bulge_g) > ALIKE_BENT * abs(bulge_f):
        return 0.0
    n = n_f if bulge_f < 0.0 else scale(-1.0, n_g)
    for k in range(extrema.count[0]):
        extremum = extremum_at(extrema.rows, k)
        if extremum.code_f == codes[0] and extremum.code_g == codes[1] and extremum.origin != USELESS:
            if dot(n, three_of(extremum.normal)) > NEXT:
                return 0.0
    return HELD_F if bulge_f < 0.0 else HELD_G


@kernel(inner=True)
def is_implied_on_edge(posed, codes, side, extrema, k):
    """Whether extremum k, a point of an edge that lies on a face, is implied by others; if not, it is held."""
    extremum = extremum_at(extrema.rows, k)
    t = extremum.parameters[2 * side]
    if extremum.origin == NEW:
        # Of edges that have crossed the crossing is no corner.
        has_corners = extremum.gap >= -SLACK and is_straight(posed, codes, side, t, width_of(posed, codes, side))
        if has_corners or not is_next(posed, codes, side, t, extrema, k):
            return True
    extremum.corner = POINT
    return False


@kernel(inner=True)
def is_implied_in_valley(posed, codes, extrema, k):
    """`is_implied_on_edge`, for a point of a valley between two faces."""
    extremum = extremum_at(extrema.rows, k)
    surfaces = features_of(posed, codes)
    x = pair_parameters(extremum)
    step = across_near_singular(posed.store, surfaces[0], surfaces[1], posed.pose, x)
    if not step.found:
        return False
    if extremum.origin == NEW and not is_next_in_near_singular(posed, codes, surfaces, x, step.along, extrema, k):
        return True
    extremum.corner = HELD_F if step.on_f else HELD_G
    return False


@kernel(inner=True)
def is_implied(posed, extrema, k):
    """Whether extremum k, the last one kept, is of a continuum and implied by others; if not, it is held."""
    extremum = extremum_at(extrema.rows, k)
    if extremum.origin == USELESS or not is_loose(extremum):
        return False
    codes = (np.int64(extremum.code_f), np.int64(extremum.code_g))
    f, g = kinds_of(posed, codes)
    if f == FACE and g == FACE:
        return is_implied_in_valley(posed, codes, extrema, k)
    if (f == EDGE and g == FACE) or (f == FACE and g == EDGE):
        return is_implied_on_edge(posed, codes, 0 if f == EDGE else 1, extrema, k)
    return False


@kernel(inner=True)
def hold_continua(posed, extrema):
    """Hold the listed points of each continuum of extrema and a few of the new ones, and drop the others.

    Otherwise what Newton's method finds on a continuum could fill the list.
    """
    rows = extrema.rows
    stay = 0
    for k in range(extrema.count[0]):
        for l in range(ROOT):
            rows[stay, l] = rows[k, l]
        stay += 1
        if is_implied(posed, extrema, stay - 1):
            stay -= 1
    extrema.count[0] = stay
