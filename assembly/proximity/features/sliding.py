"""Pairs of faces that are straight along each other and begin to tilt: down the slope, to the boundary that ends it.

Parallel flat faces are nearest all over, and a flat face and a cylinder along a line; once they tilt, Newton's method
has no step there. The height of g over the tangent plane of f falls along w, the tangential part of g's normal m over
m.n: all of w if both are flat, otherwise its component along the valley.
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, blend, dot, matvec
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.brep.borders import feature_at, nearest_edge
from assembly.proximity.brep.records import (
    EDGE_RECORD,
    FACE_RECORD,
    face_at,
    shell_at,
)
from assembly.proximity.extrema.face_frames import own_frame, pair_frame
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.extrema.pair_matrix import null_ways, pair_matrix

# Relative curvature, in 1 / size, below which faces are straight along each other; the slope below which there is none;
# a distance, in sizes, that leads beyond every boundary.
STRAIGHT, LEVEL, FAR = 1e-9, 1e-12, 1e3


@kernel(inner=True)
def border_ahead(store, shell, code, at, move, pose, way):
    """The edge of a face through which a motion of its parameters, far beyond its boundary, leaves it.

    `at` are (u, v), `move` what is added to them, `pose` how the body is turned and shifted.

    Returns
    -------
    code, (t, 0), and how far that is along a unit way; infinitely far where the face has no boundary.
    """
    solid = shell_at(store.table, shell)
    if face_at(store.table, solid.face_table + FACE_RECORD * code).trim < 0:
        return code, at, math.inf
    code, found = nearest_edge(store, shell, code, at[0] + move[0], at[1] + move[1])
    edge = solid.edge_table + EDGE_RECORD * (code - solid.faces)
    p = add(matvec(pose.rotation, edge_jet(store, edge, found[0])[0]), pose.shift)
    return code, found, dot(way, p)


@kernel(inner=True)
def slide_off(store, shells, pose, codes, x, size):
    """Slide two faces that are straight along each other and tilted down the slope, to the boundary that ends it.

    Returns whether there is such a boundary, the two features then, and the coordinates.
    """
    f = feature_at(store.table, shells[0], codes[0])
    g = feature_at(store.table, shells[1], codes[1])
    frame = pair_frame(store, f, g, pose, x)
    tx, ty, e, t = frame.tangent_x, frame.tangent_y, frame.rates_f, frame.rates_g
    straight = STRAIGHT / size
    matrix = pair_matrix(frame.shape_f, frame.shape_g, frame.gap, straight)
    h = matrix.h
    if matrix.isolated or not frame.regular:
        return False, codes, x
    m = matvec(pose.rotation, own_frame(store, g, x[2], x[3]).normal)
    lean = 1.0 / dot(m, frame.normal)
    wx = lean * dot(m, tx)
    wy = lean * dot(m, ty)
    if abs(h[0]) + abs(h[1]) + abs(h[2]) + abs(h[3]) > straight:
        _v, w = null_ways(h)
        along = w[0] * wx + w[1] * wy
        wx = along * w[0]
        wy = along * w[1]
    slope = math.sqrt(wx * wx + wy * wy)
    if not slope > LEVEL:
        return False, codes, x
    way = blend(wx / slope, tx, wy / slope, ty)
    wx *= FAR * size / slope
    wy *= FAR * size / slope
    # Parameters are linear in length on a flat face, and along a valley.
    on_f = (e[0] * wx + e[1] * wy, e[2] * wy)
    on_g = (t[0] * wx + t[1] * wy, t[2] * wx + t[3] * wy)
    edge_f, at_f, way_f = border_ahead(store, shells[0], codes[0], (x[0], x[1]), on_f, IDENTITY, way)
    edge_g, at_g, way_g = border_ahead(store, shells[1], codes[1], (x[2], x[3]), on_g, pose, way)
    if way_f <= way_g:
        return way_f < math.inf, (edge_f, codes[1]), (at_f[0], at_f[1], x[2], x[3])
    return True, (codes[0], edge_g), (x[0], x[1], at_g[0], at_g[1])
