"""Where two features cross: Newton's method for d = 0 with least steps."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.domain import into_domain
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.vec import add, blend, cross, dot, matvec, scale, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.extrema.feature_jets import edge_advance, edge_jet, vertex_point


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


@kernel(inner=True)
def crossing_point(store, f, g, pose, x, size):
    """Coordinates where d = 0 near x, by least steps, and whether they were found."""
    previous = math.inf
    for _ in range(12):
        p, pu, pv = tangents(store, f, IDENTITY, x[0], x[1])
        q, qu, qv = tangents(store, g, pose, x[2], x[3])
        d = sub(q, p)
        off = math.sqrt(dot(d, d))
        if off <= 1e-13 * size:
            return x, True
        if off > 0.9 * previous:
            return x, False
        previous = off
        # W = J J^T over tangents of unit length: steps in lengths, the least that remove d.
        su = 1.0 / max(math.sqrt(dot(pu, pu)), 1e-300)
        sv = 1.0 / max(math.sqrt(dot(pv, pv)), 1e-300)
        tu = 1.0 / max(math.sqrt(dot(qu, qu)), 1e-300)
        tv = 1.0 / max(math.sqrt(dot(qv, qv)), 1e-300)
        a = scale(su, pu)
        b = scale(sv, pv)
        c = scale(tu, qu)
        e = scale(tv, qv)
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
        if not det > 1e-14:
            return x, False
        y = blend(d[0] / det, cross(row1, row2), d[1] / det, cross(row2, row0))
        y = add(y, scale(d[2] / det, cross(row0, row1)))
        uf, vf = within(store, f, x[0] + su * dot(a, y), x[1] + sv * dot(b, y))
        ug, vg = within(store, g, x[2] - tu * dot(c, y), x[3] - tv * dot(e, y))
        x = (uf, vf, ug, vg)
    return x, False
