"""Where two features cross: Newton's method for d = 0 with steps of least length."""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly._newton import damped_newton
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.extrema.feature_jets import edge_advance, edge_jet, vertex_point

# Points closer than this part of the size coincide; a step has to reduce the distance below this part of it.
MET, FALL = 1e-13, 0.9
CrossingQuery = namedtuple("CrossingQuery", "store f g pose size")
# The distance of two points, the vector from the first to the second, and the tangents of both features.
CrossingPoint = namedtuple("CrossingPoint", "merit d pu pv qu qv")


@kernel(inner=True)
def tangents(store, feature, pose, u, v):
    """Point and tangents of a feature, moved by a pose."""
    zero = (0.0, 0.0, 0.0)
    if feature.kind == FACE:
        p, su, sv, _uu, _uv, _vv = surface_point(store.table, store.pool, feature.record, u, v)
    elif feature.kind == EDGE:
        p, su, _tt = edge_jet(store, feature.record, u)
        sv = zero
    else:
        p = vertex_point(store, feature.record)
        su = zero
        sv = zero
    return add(matvec(pose.rotation, p), pose.shift), matvec(pose.rotation, su), matvec(pose.rotation, sv)


@kernel(inner=True)
def within(store, feature, u, v):
    """Coordinates wrapped, or held at the ends of the domain."""
    if feature.kind == FACE:
        u, v, _clamped = into_domain(store, feature.record, u, v)
        return u, v
    return (edge_advance(store, feature.record, u, 0.0) if feature.kind == EDGE else u), v


@kernel(inline=True)
def _look(query, x):
    p, pu, pv = tangents(query.store, query.f, IDENTITY, x[0], x[1])
    q, qu, qv = tangents(query.store, query.g, query.pose, x[2], x[3])
    d = sub(q, p)
    return CrossingPoint(math.sqrt(dot(d, d)), d, pu, pv, qu, qv)


@kernel(inline=True)
def _least_step(query, x, at):
    """The step of least length that removes d, and whether there is none."""
    d = at.d
    # W = J J^T over tangents of unit length: steps in lengths.
    su = 1.0 / max(math.sqrt(dot(at.pu, at.pu)), 1e-300)
    sv = 1.0 / max(math.sqrt(dot(at.pv, at.pv)), 1e-300)
    tu = 1.0 / max(math.sqrt(dot(at.qu, at.qu)), 1e-300)
    tv = 1.0 / max(math.sqrt(dot(at.qv, at.qv)), 1e-300)
    a = scale(su, at.pu)
    b = scale(sv, at.pv)
    c = scale(tu, at.qu)
    e = scale(tv, at.qv)
    xx = a[0] * a[0] + b[0] * b[0] + c[0] * c[0] + e[0] * e[0]
    xy = a[0] * a[1] + b[0] * b[1] + c[0] * c[1] + e[0] * e[1]
    xz = a[0] * a[2] + b[0] * b[2] + c[0] * c[2] + e[0] * e[2]
    yy = a[1] * a[1] + b[1] * b[1] + c[1] * c[1] + e[1] * e[1]
    yz = a[1] * a[2] + b[1] * b[2] + c[1] * c[2] + e[1] * e[2]
    zz = a[2] * a[2] + b[2] * b[2] + c[2] * c[2] + e[2] * e[2]
    row0 = (xx, xy, xz)
    row1 = (xy, yy, yz)
    row2 = (xz, yz, zz)
    det = dot(row0, cross(row1, row2))
    if at.merit <= MET * query.size or not det > 1e-14:
        return (0.0, 0.0, 0.0, 0.0), True
    y = blend(d[0] / det, cross(row1, row2), d[1] / det, cross(row2, row0))
    y = add(y, scale(d[2] / det, cross(row0, row1)))
    return (su * dot(a, y), sv * dot(b, y), -tu * dot(c, y), -tv * dot(e, y)), False


@kernel(inline=True)
def _move(query, x, part, step):
    uf, vf = within(query.store, query.f, x[0] + part * step[0], x[1] + part * step[1])
    ug, vg = within(query.store, query.g, x[2] + part * step[2], x[3] + part * step[3])
    return uf, vf, ug, vg


_nearest = kernel(inner=True)(damped_newton(_look, _least_step, _move, steps=12, shortenings=0, fall=FALL))


@kernel(inner=True)
def crossing_point(store, f, g, pose, x, size):
    """Coordinates where d = 0 near x, by steps of least length, and whether they were found."""
    x, at, _last = _nearest(CrossingQuery(store, f, g, pose, size), x)
    return x, at.merit <= MET * size
