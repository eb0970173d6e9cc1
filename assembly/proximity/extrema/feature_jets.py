"""Edges and vertices beside faces: the curve of an edge, and the condition of each kind of feature on a contact normal.

An edge is C(t) = S(c(t)), a plane curve in the parameters of a surface, or a curve in space:

    C_t = S_u c_1' + S_v c_2',    C_tt = S_uu c_1'^2 + 2 S_uv c_1' c_2' + S_vv c_2'^2 + S_u c_1'' + S_v c_2''.

While the contact point moves by a over a feature and the unit normal n changes by dn (both tangential, two numbers
each), they are (a, dn) = (X s, Y s) for some s in the plane:

    face     X = I,       Y = A             A the shape operator with respect to n
    edge     X = [t 0],   Y = [k t, l e]    t the tangent, e across it, k = -n.C_tt / |C_t|^2
    vertex   X = 0,       Y = l I           l a curvature: all of Y has the unit 1 / length

X^T Y is symmetric, so Y^T a - X^T dn = 0 says the same without s. With z = (z1, z2) of `proximity/extrema/rates.py` and
the gap beta the motion of a pair of any two features is

    H s = Y_g^T z1 - X_g^T z2,    H = Y_g^T (X_f + beta Y_f) - X_g^T Y_f,
    beta'' = s.(Y_f^T z1 - (X_f + beta Y_f)^T z2) + z1.z2 + the terms of rotation of `proximity/extrema/rates.py`.

For two faces this is the form of `proximity/extrema/face_face.py`; for a face and a curve it is paper 001, eqs. 22 to
24, corrected.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import (
    curve_lanes,
    spline_curve_at,
    surface_point,
    xyz,
)
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.proximity.brep.records import (
    EDGE_POINT,
    FACE_POINT,
    VERTEX,
    edge_at,
    vertex_at,
)
from assembly.proximity.extrema.pair_matrix import RANK

# Newton's own matrix is damped below this ratio: its residuals are right to rounding, unlike the rates it stands for.
FINE = 1e-13
# Residuals below this part of the size are rounding.
RESIDUAL_ROUNDING = 2e-15
# The same where the equations are singular: there a step would be a rounding error divided by nearly zero.
SLACK = 1e-13
# At the end of an edge, a slope (or a length over the size) that leads beyond it by less than this is rounding.
BEYOND = 1e-12

# How Newton's method goes on a pair of features.
NewtonLimits = namedtuple(
    "NewtonLimits",
    [
        "size",  # the length against which steps are measured
        "turn",  # [rad] where a step would turn a normal or a tangent by more, no pair is near
        "steps",  # at most so many; with 0 the pair is evaluated where it is
    ],
)
# What a feature asks of a contact normal: the two matrices X and Y above, entry by entry.
FeatureSide = namedtuple("FeatureSide", ["x11", "x12", "x21", "x22", "y11", "y12", "y21", "y22"])
# Everything about a pair of any two features at some parameters, extremal or not, in the axes of body f.
FeatureFrame = namedtuple(
    "FeatureFrame",
    [
        "normal",  # unit normal from f towards g
        "tangent_x",
        "tangent_y",  # tangent_x times tangent_y is the normal
        "point_f",
        "point_g",
        "gap",  # beta = normal.(point_g - point_f)
        "side_f",  # a `FeatureSide`
        "side_g",
        "rates_f",  # map (11, 12, 21, 22) from tangential moves to parameters; zero at a pole
        "rates_g",
        "response",  # H^-1 (11, 12, 21, 22), damped where H is singular
        "residual",  # (r1x, r1y, r2x, r2y): lengths, then tilts
        "regular",  # whether both have a tangent here
        "isolated",  # whether the pair is no part of a continuum
        "proper",  # two faces: they do not cross; a face and an edge: the edge is nearest here; else True
        "fold",  # determinant over squared norm of the equations' matrix: zero where a pair ceases to be isolated
    ],
)


@kernel(inner=True)
def edge_jet(store, edge, t):
    """C, C_t, C_tt of an edge in body axes."""
    edge_record = edge_at(store.table, edge)
    c, d, h = curve_lanes(store, edge_record.curve, t)
    p = xyz(c)
    q = xyz(d)
    w = xyz(h)
    r = edge_record.surface
    if r < 0:
        return p, q, w
    u, v, _clamped = into_domain(store, r, p[0], p[1])
    s, su, sv, suu, suv, svv = surface_point(store.table, store.pool, r, u, v)
    bent = add(blend(q[0] * q[0], suu, 2.0 * q[0] * q[1], suv), scale(q[1] * q[1], svv))
    return s, blend(q[0], su, q[1], sv), add(bent, blend(w[0], su, w[1], sv))


@kernel(inline=True)
def vertex_point(store, vertex):
    o = vertex_at(store.table, vertex).point
    return (store.pool[o], store.pool[o + 1], store.pool[o + 2])


@kernel(inline=True)
def edge_limits(store, edge):
    """Low and high end of t, and whether the edge has no ends."""
    edge_record = edge_at(store.table, edge)
    c = spline_curve_at(store.table, edge_record.curve)
    o = c.breaks
    return store.pool[o], store.pool[o + c.spans], edge_record.start < 0


@kernel(inner=True)
def edge_advance(store, edge, t, dt):
    """t moved by dt: wrapped on an edge without ends, else held at its end."""
    lo, hi, endless = edge_limits(store, edge)
    t += dt
    if endless:
        if t < lo or t > hi:
            t -= (hi - lo) * math.floor((t - lo) / (hi - lo))
        return min(max(t, lo), hi)
    return min(max(t, lo), hi)


@kernel(inner=True)
def edge_held(store, edge, t, dt):
    """Whether t is at an end and dt leads beyond it."""
    lo, hi, endless = edge_limits(store, edge)
    return not endless and ((t <= lo and dt < 0.0) or (t >= hi and dt > 0.0))


@kernel(inner=True)
def edge_stride(store, edge):
    """How far in t one step may go along a straight part: all of a single span with ends, else 1/16 of the edge."""
    lo, hi, endless = edge_limits(store, edge)
    return (
        hi - lo
        if spline_curve_at(store.table, edge_at(store.table, edge).curve).spans == 1 and not endless
        else 0.0625 * (hi - lo)
    )


@kernel(inline=True)
def face_side(a):
    """(X, Y) of a face with shape operator a (11, 12, 22)."""
    return FeatureSide(1.0, 0.0, 0.0, 1.0, a[0], a[1], a[1], a[2])


@kernel(inline=True)
def edge_side(tx, ty, k, unit):
    """(X, Y) of an edge with unit tangent (tx, ty)."""
    return FeatureSide(tx, 0.0, ty, 0.0, k * tx, -unit * ty, k * ty, unit * tx)


@kernel(inline=True)
def vertex_side(unit):
    return FeatureSide(0.0, 0.0, 0.0, 0.0, unit, 0.0, 0.0, unit)


@kernel(inline=True)
def inverse(h, size, rank):
    """The inverse of a 2x2 matrix whose entries are up to `size`, and whether it is regular.

    Where it is (nearly) singular the inverse is damped: it gives the least step, so that a pair of a continuum stays.
    """
    det = h[0] * h[3] - h[1] * h[2]
    norm = abs(h[0]) + abs(h[1]) + abs(h[2]) + abs(h[3])
    # The smallest singular value is at least |det| / norm.
    if abs(det) > 100.0 * rank * size * norm:
        i = 1.0 / det
        return (i * h[3], -i * h[1], -i * h[2], i * h[0]), True
    damping = rank * size
    damping *= damping
    # (H^T H + damping I)^-1 H^T = (det adj H + damping H^T) / (det^2 + damping |H|^2 + damping^2): nothing cancels.
    norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
    i = 1.0 / (det * det + damping * (norm2 + damping))
    j = i * det
    i *= damping
    return (
        j * h[3] + i * h[0],
        i * h[2] - j * h[1],
        i * h[1] - j * h[2],
        j * h[0] + i * h[3],
    ), abs(det) > rank * size * norm


@kernel(inline=True)
def offset_side(side, beta):
    """X + beta Y (11, 12, 21, 22): how a point at the distance beta above a feature moves."""
    return (
        side.x11 + beta * side.y11,
        side.x12 + beta * side.y12,
        side.x21 + beta * side.y21,
        side.x22 + beta * side.y22,
    )


@kernel(inline=True)
def pair_response(f, g, beta, unit):
    """H^-1 of two sides, damped where H is singular."""
    v11, v12, v21, v22 = offset_side(f, beta)
    h = (
        g.y11 * v11 + g.y21 * v21 - g.x11 * f.y11 - g.x21 * f.y21,
        g.y11 * v12 + g.y21 * v22 - g.x11 * f.y12 - g.x21 * f.y22,
        g.y12 * v11 + g.y22 * v21 - g.x12 * f.y11 - g.x22 * f.y21,
        g.y12 * v12 + g.y22 * v22 - g.x12 * f.y12 - g.x22 * f.y22,
    )
    return inverse(h, unit * (1.0 + abs(beta) * unit), RANK)[0]


@kernel(inner=True)
def across(a, b):
    """A unit vector orthogonal to the unit vector a (any, if a = 0), as close to the direction of b as possible."""
    w = sub(b, scale(dot(a, b), a))
    ww = dot(w, w)
    if ww > 1e-20 * dot(b, b) and ww > 1e-290:
        return scale(1.0 / math.sqrt(ww), w)
    # Any: the axis that a is farthest from.
    x = abs(a[0])
    y = abs(a[1])
    z = abs(a[2])
    if z <= x and z <= y:
        w = cross(a, (0.0, 0.0, 1.0))
    elif y <= x:
        w = cross(a, (0.0, 1.0, 0.0))
    else:
        w = cross(a, (1.0, 0.0, 0.0))
    ww = dot(w, w)
    return scale(1.0 / math.sqrt(ww), w) if ww > 0.0 else (0.0, 0.0, 1.0)


@kernel(inner=True)
def other_jet(store, other, pose, t, s):
    """Point, C_t, C_tt, moved by a pose: of an edge at t, or (with zero derivatives) of a vertex or a held point."""
    zero = (0.0, 0.0, 0.0)
    if other.kind == VERTEX:
        return add(matvec(pose.rotation, vertex_point(store, other.record)), pose.shift), zero, zero
    if other.kind == FACE_POINT:
        p = surface_point(store.table, store.pool, other.record, t, s).point
        return add(matvec(pose.rotation, p), pose.shift), zero, zero
    p, ct, ctt = edge_jet(store, other.record, t)
    if other.kind == EDGE_POINT:
        return add(matvec(pose.rotation, p), pose.shift), zero, zero
    return add(matvec(pose.rotation, p), pose.shift), matvec(pose.rotation, ct), matvec(pose.rotation, ctt)
