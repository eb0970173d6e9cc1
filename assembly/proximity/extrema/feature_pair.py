"""The extremal pair of any two features, faces, edges and vertices, and its record.

Everything is in the axes of body f; n is the unit normal from f towards g, d = g - f, beta = n.d. Two faces:
`proximity/extrema/face_face.py`; a face and an edge or a vertex: `face_edge.py`; neither a face: `edge_edge.py`. What
they have in common, and the formulas of the record, stand in `feature_jets.py`.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import cross, matvec, neg, sub
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.edge_edge import solve_off_face
from assembly.proximity.extrema.face_edge import face_frame, solve_on_face, turned_frame
from assembly.proximity.extrema.face_face import CLOSE, LIMIT, pair_frame, solve_pair
from assembly.proximity.extrema.feature_jets import FeatureFrame, face_side, offset_side
from assembly.proximity.extrema.pair_matrix import pair_matrix
from assembly.proximity.extrema.rates import ARM_F, ARM_G, NORMAL, ZED, derivatives_at, put


@kernel(inner=True)
def two_face_frame(frame, matrix):
    """The frame of two faces, from their `PairFrame` and `PairMatrix`."""
    h = matrix.h
    e = frame.rates_f
    det = h[0] * h[3] - h[1] * h[2]
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    # Relative curvature -H (I + beta A)^-1: indefinite means the surfaces cross beside the point.
    proper = det > -1e-9 * norm2 and h[0] + h[3] <= 0.0
    fold = det / norm2 if norm2 > 1e-18 else 0.0
    return FeatureFrame(
        normal=frame.normal,
        tangent_x=frame.tangent_x,
        tangent_y=frame.tangent_y,
        point_f=frame.point_f,
        point_g=frame.point_g,
        gap=frame.gap,
        side_f=face_side(frame.shape_f),
        side_g=face_side(frame.shape_g),
        rates_f=(e[0], e[1], 0.0, e[2]),
        rates_g=frame.rates_g,
        response=matrix.inverse,
        residual=frame.residual,
        regular=frame.regular,
        isolated=matrix.isolated,
        proper=proper,
        fold=fold,
    )


@kernel(inline=True)
def conforms(frame):
    """Whether the relative curvature of a pair is rounding: two faces that are equally near all around it."""
    f, g = frame.side_f, frame.side_g
    v11, v12, v21, v22 = offset_side(f, frame.gap)
    # Y_g^T (X_f + beta Y_f) - X_g^T Y_f
    h11 = (g.y11 * v11 + g.y21 * v21) - (g.x11 * f.y11 + g.x21 * f.y21)
    h12 = (g.y11 * v12 + g.y21 * v22) - (g.x11 * f.y12 + g.x21 * f.y22)
    h21 = (g.y12 * v11 + g.y22 * v21) - (g.x12 * f.y11 + g.x22 * f.y21)
    h22 = (g.y12 * v12 + g.y22 * v22) - (g.x12 * f.y12 + g.x22 * f.y22)
    return h11 * h11 + h12 * h12 + h21 * h21 + h22 * h22 <= 1e-18


@kernel(inline=True)
def transposed(m):
    return (m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8])


@kernel(inner=True)
def newton_on_features(store, kind_f, f, kind_g, g, pose, x, n, size, turn, limit):
    """As `solve_features` for all but two faces, with the number of steps: none evaluates the pair at x."""
    if kind_f == FACE:
        found = solve_on_face(store, f, kind_g, g, pose, x, size, turn, limit)
        return found.status, found.parameters, face_frame(found)
    if kind_g == FACE:
        back = transposed(pose.rotation)
        found = solve_on_face(
            store,
            g,
            kind_f,
            f,
            RelativePose(back, neg(matvec(back, pose.shift))),
            (x[2], x[3], x[0], x[1]),
            size,
            turn,
            limit,
        )
        u, v, t, s = found.parameters
        return found.status, (t, s, u, v), turned_frame(pose, found)
    status, z, frame = solve_off_face(store, kind_f, f, kind_g, g, pose, (x[0], x[2]), n, size, turn, limit)
    return status, (z[0], x[1], z[1], x[3]), frame


@kernel(inner=True)
def solve_features(store, kind_f, f, kind_g, g, pose, x, n, size, turn):
    """Newton from x to the extremal pair of two features. Returns status, parameters and `FeatureFrame`.

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
        Its parameters.
    frame
        Where it is (`proximity/extrema/feature_jets.py`).
    """
    if kind_f == FACE and kind_g == FACE:
        found = solve_pair(store, f, g, pose, x, size, turn, CLOSE, False)
        return found.status, found.parameters, two_face_frame(found.frame, found.matrix)
    return newton_on_features(store, kind_f, f, kind_g, g, pose, x, n, size, turn, LIMIT)


@kernel(inner=True)
def features_at(store, kind_f, f, kind_g, g, pose, x, n, size):
    """The frame of two features at parameters x, extremal or not."""
    if kind_f == FACE and kind_g == FACE:
        frame = pair_frame(store, f, g, pose, x)
        return two_face_frame(frame, pair_matrix(frame.shape_f, frame.shape_g, frame.gap, 1e-9 / size))
    return newton_on_features(store, kind_f, f, kind_g, g, pose, x, n, size, math.inf, 0)[2]


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
    f, g, i = frame.side_f, frame.side_g, frame.response
    of_f, of_g = frame.rates_f, frame.rates_g
    x = matvec(turn, frame.tangent_x)
    y = matvec(turn, frame.tangent_y)
    arm_f = matvec(turn, frame.point_g)
    arm_g = matvec(turn, sub(frame.point_g, shift))
    derivatives.gap = frame.gap
    put(records, row, NORMAL, matvec(turn, frame.normal))
    put(records, row, ARM_F, arm_f)
    put(records, row, ARM_G, arm_g)
    store_velocities(x, y, arm_f, arm_g, records, row)
    # s = S z, S = H^-1 [Y_g^T, -X_g^T].
    m = (
        i[0] * g.y11 + i[1] * g.y12,
        i[0] * g.y21 + i[1] * g.y22,
        -i[0] * g.x11 - i[1] * g.x12,
        -i[0] * g.x21 - i[1] * g.x22,
        i[2] * g.y11 + i[3] * g.y12,
        i[2] * g.y21 + i[3] * g.y22,
        -i[2] * g.x11 - i[3] * g.x12,
        -i[2] * g.x21 - i[3] * g.x22,
    )
    v11, v12, v21, v22 = offset_side(f, frame.gap)
    w = (f.y11, f.y21, -v11, -v21, f.y12, f.y22, -v12, -v22)
    for j in range(4):
        s0 = m[j]
        s1 = m[4 + j]
        ax = f.x11 * s0 + f.x12 * s1
        ay = f.x21 * s0 + f.x22 * s1
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
