"""Apexes of cones: vertices without edges, poles of a face where it has no tangent plane.

The normal n of a pair at an apex has n.e <= 0 for all directions e in which the face leaves the apex, as at another
vertex for the directions of its edges (`proximity/features/switching.py`).
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.splines.pole import limits, nearest_pole, spoke
from assembly.geometry.vec import dot, scale, sub
from assembly.proximity.brep.records import (
    FACE_RECORD,
    VERTEX_RECORD,
    face_at,
    shell_at,
    vertex_at,
)

# Sine of the angle by which a normal must lean toward a face or along an edge before the pair switches to that.
LEAN = 1e-9
# Of apexes: how near a vertex and a pole must be to coincide, how many spokes are sampled, how far from the apex a face
# takes over, and how near to it a failed Newton's method leads to the apex (the last two are parts of the domain).
APEX, SPOKES, BESIDE, NEAR_APEX = 1e-9, 16, 1e-3, 0.02


@kernel(inline=True)
def unit(a):
    """A vector of length one, or zero."""
    length = math.sqrt(dot(a, a))
    return scale(1.0 / length, a) if length > 0.0 else a


@kernel(inline=True)
def pole_point(store, surface, pole):
    """The point of a pole."""
    low, high, _closed = limits(store, surface, 1 if pole <= 2 else 0)
    return spoke(store, surface, pole, 0.5 * (low + high))[0]


@kernel(inner=True)
def is_at(store, vertex, p):
    """Whether p is the point of a vertex."""
    o = vertex_at(store.table, vertex).point
    d = sub(p, (store.pool[o], store.pool[o + 1], store.pool[o + 2]))
    return dot(d, d) <= APEX * APEX * (1.0 + dot(p, p))


@kernel(inner=True)
def from_apex(store, shell, vertex, code, n):
    """The face that takes over from the apex of a cone: code and (u, v) on the spoke along which the normal leans most.

    Where it leans along none, the given `code`, which is that of the apex.
    """
    vertex_record = vertex_at(store.table, vertex)
    best = LEAN
    found = (0.0, 0.0)
    for k in range(vertex_record.faces):
        face = store.table[vertex_record.face_list + k]
        surface = face_at(store.table, shell_at(store.table, shell).face_table + FACE_RECORD * face).surface
        for bit in range(4):
            pole = 1 << bit
            if surface_at(store.table, surface).poles & pole == 0 or not is_at(
                store, vertex, pole_point(store, surface, pole)
            ):
                continue
            low, high, _closed = limits(store, surface, 1 if pole <= 2 else 0)
            first, last, _closed = limits(store, surface, 0 if pole <= 2 else 1)
            depth = first + BESIDE * (last - first) if pole == 1 or pole == 4 else last - BESIDE * (last - first)
            for i in range(SPOKES):
                along = low + (high - low) * (i + 0.5) / SPOKES
                lean = dot(n, unit(spoke(store, surface, pole, along)[1]))
                if lean > best:
                    best = lean
                    code = face
                    found = (depth, along) if pole <= 2 else (along, depth)
    return code, found


@kernel(inner=True)
def apex_near(store, shell, code, u, v):
    """The code of the apex of a cone near a point of a face where Newton's method gave up; else that of the face."""
    solid = shell_at(store.table, shell)
    if code >= solid.faces:
        return code
    surface = face_at(store.table, solid.face_table + FACE_RECORD * code).surface
    if surface_at(store.table, surface).poles == 0:
        return code
    pole, distance = nearest_pole(store, surface, u, v)
    if distance > NEAR_APEX:
        return code
    p = pole_point(store, surface, pole)
    for k in range(solid.vertices):
        vertex = solid.vertex_table + VERTEX_RECORD * k
        if vertex_at(store.table, vertex).edges == 0 and is_at(store, vertex, p):
            return solid.faces + solid.edges + k
    return code
