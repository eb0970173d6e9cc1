"""The extremal pair of any two features, faces, edges and vertices, and its record.

Everything is in the axes of body f; n is the unit normal from f towards g, d = g - f, beta = n.d. Two faces:
`proximity/extrema/face_face.py`; a face and an edge or a vertex: `face_edge.py`; neither a face: `edge_edge.py`. What
they have in common, and the formulas of the record, stand in `feature_jets.py`.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import cross, matvec, neg, sub
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.edge_edge import solve_off_face
from assembly.proximity.extrema.face_edge import face_frame, solve_on_face, turned_frame
from assembly.proximity.extrema.face_face import CLOSE, LIMIT, pair_frame, solve_pair
from assembly.proximity.extrema.feature_jets import face_side
from assembly.proximity.extrema.pair_matrix import pair_matrix
from assembly.proximity.extrema.rates import ARM_F, ARM_G, NORMAL, ZED, derivatives_at, put


@kernel(inner=True)
def two_face_frame(frame, curvature):
    """The frame of two faces, from what `solve_pair` returns."""
    n, tx, ty, pf, pg, e, t, a, c, r, beta, regular = frame
    _k, h, i, isolated = curvature
    det = h[0] * h[3] - h[1] * h[2]
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    # Relative curvature -H (I + beta A)^-1: indefinite means the surfaces cross beside the point.
    proper = det > -1e-9 * norm2 and h[0] + h[3] <= 0.0
    fold = det / norm2 if norm2 > 1e-18 else 0.0
    rate = (e[0], e[1], 0.0, e[2])
    return n, tx, ty, pf, pg, beta, face_side(a), face_side(c), rate, t, i, r, regular, isolated, proper, fold


@kernel(inline=True)
def conforms(frame):
    """Whether the relative curvature of a pair is rounding: two faces that are equally near all around it."""
    beta, f, g = frame[5], frame[6], frame[7]
    square = 0.0
    for i in range(2):
        for j in range(2):
            # Y_g^T (X_f + beta Y_f) - X_g^T Y_f
            h = g[4 + i] * (f[j] + beta * f[4 + j]) + g[6 + i] * (f[2 + j] + beta * f[6 + j])
            h -= g[i] * f[4 + j] + g[2 + i] * f[6 + j]
            square += h * h
    return square <= 1e-18


@kernel(inline=True)
def transposed(m):
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@kernel(inner=True)
def newton_on_features(table, pool, kind_f, f, kind_g, g, rotation, shift, x, n, size, turn, limit):
    """As `solve_features` for all but two faces, with the number of steps: none evaluates the pair at x."""
    if kind_f == FACE:
        status, y, parts, rates, residual, flags, fold = solve_on_face(
            table, pool, f, kind_g, g, rotation, shift, x, size, turn, limit
        )
        return status, y, face_frame(parts, rates, residual, flags, fold)
    if kind_g == FACE:
        back = transposed(rotation)
        status, y, parts, rates, residual, flags, fold = solve_on_face(
            table, pool, g, kind_f, f, back, neg(matvec(back, shift)), (x[2], x[3], x[0], x[1]), size, turn, limit
        )
        frame = turned_frame(rotation, shift, parts, rates, residual, flags, fold)
        return status, (y[2], y[3], y[0], y[1]), frame
    status, z, frame = solve_off_face(
        table, pool, kind_f, f, kind_g, g, rotation, shift, (x[0], x[2]), n, size, turn, limit
    )
    return status, (z[0], x[1], z[1], x[3]), frame


@kernel(inner=True)
def solve_features(table, pool, kind_f, f, kind_g, g, rotation, shift, x, n, size, turn):
    """Newton from x to the extremal pair of two features. Returns status, parameters and frame.

    Parameters
    ----------
    kind_f, f, kind_g, g
        FACE with a surface record, EDGE with an edge record, VERTEX with a vertex record; EDGE_POINT or FACE_POINT of
        a point that stays where it is on one, over a face.
    rotation, shift
        The pose of body g seen from body f.
    x
        (u_f, v_f, u_g, v_g); of an edge (t, 0), of a vertex (0, 0): what a feature has no use for is left alone.
    n
        A unit normal to begin from, from f towards g, or zeros: it says on which side two edges are, and stands in for
        the direction between points that coincide.
    size
        The length against which steps are measured.
    turn
        A step that would turn a normal or a tangent by more says that x was not near a pair.

    Returns
    -------
    status
        CONVERGED, SINGULAR, LEFT_PATCH (a parameter is held at an end; the frame is that of the edge's end point),
        NOT_CONVERGED.
    x
    frame
        n, tx, ty : normal and tangents, x times y = n
        pf, pg : the two points
        beta : n.(pg - pf)
        sides of f and g : (X, Y) row by row (`proximity/extrema/feature_jets.py`)
        rates of f and g : the map (11, 12, 21, 22) from tangential moves to parameters; zero at a pole
        response : H^-1 (11, 12, 21, 22)
        residual : lengths, then tilts
        regular : whether both have a tangent here
        isolated : whether the pair is no part of a continuum
        proper : whether two surfaces do not cross here, and an edge over a face is nearest here (true of other pairs)
        fold : determinant over squared norm of the equations' matrix: zero where a pair ceases to be isolated
    """
    if kind_f == FACE and kind_g == FACE:
        status, y, _count, frame, curvature = solve_pair(
            table, pool, f, g, rotation, shift, x, size, turn, CLOSE, False
        )
        return status, y, two_face_frame(frame, curvature)
    return newton_on_features(table, pool, kind_f, f, kind_g, g, rotation, shift, x, n, size, turn, LIMIT)


@kernel(inner=True)
def features_at(table, pool, kind_f, f, kind_g, g, rotation, shift, x, n, size):
    """The frame of two features at parameters x, extremal or not."""
    if kind_f == FACE and kind_g == FACE:
        frame = pair_frame(table, pool, f, g, rotation, shift, x)
        return two_face_frame(frame, pair_matrix(frame[7], frame[8], frame[10], 1e-9 / size))
    return newton_on_features(table, pool, kind_f, f, kind_g, g, rotation, shift, x, n, size, math.inf, 0)[2]


@kernel(inline=True)
def store_velocities(x, y, arm_f, arm_g, records, row):
    """z over the twists: x.v, y.v, and (x, y).(omega x n) = (y.omega, -x.omega)."""
    put(records, row, ZED, neg(x))
    put(records, row, ZED + 3, cross(x, arm_f))
    put(records, row, ZED + 6, x)
    put(records, row, ZED + 9, cross(arm_g, x))
    put(records, row, ZED + 12, neg(y))
    put(records, row, ZED + 15, cross(y, arm_f))
    put(records, row, ZED + 18, y)
    put(records, row, ZED + 21, cross(arm_g, y))
    zero = (0.0, 0.0, 0.0)
    put(records, row, ZED + 24, zero)
    put(records, row, ZED + 27, neg(y))
    put(records, row, ZED + 30, zero)
    put(records, row, ZED + 33, y)
    put(records, row, ZED + 36, zero)
    put(records, row, ZED + 39, x)
    put(records, row, ZED + 42, zero)
    put(records, row, ZED + 45, neg(x))


@kernel(inner=True)
def feature_record(turn, shift, frame, records, row):
    """Fill a record from the frame of two features in the axes of body f, whose rotation is `turn`; g is at `shift`."""
    derivatives = derivatives_at(records, row)
    n, tx, ty, _pf, pg, beta, f, g, of_f, of_g, i, _r, _regular, _isolated, _proper, _fold = frame
    normal = matvec(turn, n)
    x = matvec(turn, tx)
    y = matvec(turn, ty)
    arm_f = matvec(turn, pg)
    arm_g = matvec(turn, sub(pg, shift))
    derivatives.gap = beta
    put(records, row, NORMAL, normal)
    put(records, row, ARM_F, arm_f)
    put(records, row, ARM_G, arm_g)
    store_velocities(x, y, arm_f, arm_g, records, row)
    # s = S z, S = H^-1 [Y_g^T, -X_g^T].
    m = (
        i[0] * g[4] + i[1] * g[5],
        i[0] * g[6] + i[1] * g[7],
        -i[0] * g[0] - i[1] * g[1],
        -i[0] * g[2] - i[1] * g[3],
        i[2] * g[4] + i[3] * g[5],
        i[2] * g[6] + i[3] * g[7],
        -i[2] * g[0] - i[3] * g[1],
        -i[2] * g[2] - i[3] * g[3],
    )
    # X_f + beta Y_f
    v11 = f[0] + beta * f[4]
    v12 = f[1] + beta * f[5]
    v21 = f[2] + beta * f[6]
    v22 = f[3] + beta * f[7]
    w = (f[4], f[6], -v11, -v21, f[5], f[7], -v12, -v22)
    for j in range(4):
        s0 = m[j]
        s1 = m[4 + j]
        ax = f[0] * s0 + f[1] * s1
        ay = f[2] * s0 + f[3] * s1
        bx = v11 * s0 + v12 * s1 - (1.0 if j == 0 else 0.0)
        by = v21 * s0 + v22 * s1 - (1.0 if j == 1 else 0.0)
        derivatives.rates[0, j] = of_f[0] * ax + of_f[1] * ay
        derivatives.rates[1, j] = of_f[2] * ax + of_f[3] * ay
        derivatives.rates[2, j] = of_g[0] * bx + of_g[1] * by
        derivatives.rates[3, j] = of_g[2] * bx + of_g[3] * by
        for l in range(4):
            # s.(Y_f^T z1 - (X_f + beta Y_f)^T z2), made symmetric; z1.z2 adds a half off the diagonal.
            value = 0.5 * (s0 * w[l] + s1 * w[4 + l] + m[l] * w[j] + m[4 + l] * w[4 + j])
            derivatives.form[j, l] = value + (0.5 if l == j + 2 or j == l + 2 else 0.0)
