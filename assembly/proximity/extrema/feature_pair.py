"""The extremal pair of any two features, faces, edges and vertices, and its record.

Everything is in the axes of body f; n is the unit normal from f towards g, d = g - f, beta = n.d. Two faces:
`proximity/extrema/face_face.py`; a face and an edge or a vertex: `face_edge.py`; neither a face: `edge_edge.py`. What
they have in common, and the formulas of the record, stand in `feature_jets.py`.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.kinematics.motion import inverse_pose
from assembly.proximity.brep.records import FACE
from assembly.proximity.extrema.edge_edge import solve_off_face
from assembly.proximity.extrema.face_edge import face_frame, solve_on_face, turned_frame
from assembly.proximity.extrema.face_face import LAST_TURN, LIMIT, solve_pair
from assembly.proximity.extrema.face_frames import pair_frame
from assembly.proximity.extrema.feature_jets import FeatureFrame, NewtonLimits, face_side
from assembly.proximity.extrema.pair_matrix import FLAT, fold_of, is_no_saddle, pair_matrix


@kernel(inner=True)
def two_face_frame(frame, matrix):
    """The frame of two faces, from their `PairFrame` and `PairMatrix`."""
    h = matrix.h
    e = frame.rates_f
    fold = fold_of(h, 1.0)
    # Relative curvature -H (I + beta A)^-1: indefinite means the surfaces cross beside the point.
    proper = is_no_saddle(fold) and h[0] + h[3] <= 0.0
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
def conforms(frame, offset):
    """Whether the relative curvature of a pair is zero to rounding: both faces are equally near all around it."""
    f, g = frame.side_f, frame.side_g
    v11, v12, v21, v22 = offset
    # Y_g^T (X_f + beta Y_f) - X_g^T Y_f
    h11 = (g.y11 * v11 + g.y21 * v21) - (g.x11 * f.y11 + g.x21 * f.y21)
    h12 = (g.y11 * v12 + g.y21 * v22) - (g.x11 * f.y12 + g.x21 * f.y22)
    h21 = (g.y12 * v11 + g.y22 * v21) - (g.x12 * f.y11 + g.x22 * f.y21)
    h22 = (g.y12 * v12 + g.y22 * v22) - (g.x12 * f.y12 + g.x22 * f.y22)
    return h11 * h11 + h12 * h12 + h21 * h21 + h22 * h22 <= 1e-18


@kernel(inner=True)
def newton_on_features(store, f, g, pose, x, n, limits):
    """As `solve_features` for all but two faces, within `NewtonLimits`."""
    if f.kind == FACE:
        found = solve_on_face(store, f.record, g, pose, x, limits)
        return found.status, found.parameters, face_frame(found)
    if g.kind == FACE:
        found = solve_on_face(store, g.record, f, inverse_pose(pose), (x[2], x[3], x[0], x[1]), limits)
        u, v, t, s = found.parameters
        return found.status, (t, s, u, v), turned_frame(pose, found)
    status, z, frame = solve_off_face(store, f, g, pose, (x[0], x[2]), n, limits)
    return status, (z[0], x[1], z[1], x[3]), frame


@kernel(inner=True)
def solve_features(store, f, g, pose, x, n, size, turn):
    """Newton from x to the extremal pair of two features. Returns status, parameters and `FeatureFrame`.

    Parameters
    ----------
    f, g
        Each a `Feature`; EDGE_POINT or FACE_POINT for a point fixed on an edge or a face, over a face.
    pose
        The pose of body g seen from body f.
    x
        (u_f, v_f, u_g, v_g); of an edge (t, 0), of a vertex (0, 0): coordinates that a feature lacks are unchanged.
    n
        A unit normal from f towards g to begin with, or zeros. It tells on which side of each other two edges are, and
        replaces the direction between points that coincide.
    size
        The length against which steps are measured.
    turn
        [rad] Where a step would turn a normal or a tangent by more, x was not near a pair.

    Returns
    -------
    status
        CONVERGED, SINGULAR, LEFT_PATCH (a parameter is held at an end; the frame is that of the edge's end point),
        NOT_CONVERGED.
    x
        The parameters of the pair.
    frame
        Its `FeatureFrame` (`proximity/extrema/feature_jets.py`).
    """
    if f.kind == FACE and g.kind == FACE:
        found = solve_pair(store, (f.record, g.record), pose, x, size, turn, LAST_TURN, False)
        return found.status, found.parameters, two_face_frame(found.frame, found.matrix)
    return newton_on_features(store, f, g, pose, x, n, NewtonLimits(size, turn, LIMIT))


@kernel(inner=True)
def features_at(store, f, g, pose, x, n, size):
    """The frame of two features at parameters x, extremal or not."""
    if f.kind == FACE and g.kind == FACE:
        frame = pair_frame(store, f.record, g.record, pose, x)
        return two_face_frame(frame, pair_matrix(frame.shape_f, frame.shape_g, frame.gap, FLAT / size))
    return newton_on_features(store, f, g, pose, x, n, NewtonLimits(size, math.inf, 0))[2]
