"""The features of a solid as kernels read them: records of faces, edges and vertices in one table of integers.

A shell is a header of `SHELL` integers (how many faces, edges and vertices, and where their records begin), then the
records. All offsets are absolute: into the table, or into the pool of doubles. Features are numbered faces first, then
edges, then vertices; the coordinates of a feature are (u, v) of a face, (t, 0) of an edge, (0, 0) of a vertex.

An edge is the curve S_a(c_a(t)): a plane curve c_a in the parameters of a surface S_a, t in the curve's domain. With
EDGE_SURFACE = -1 it is a curve in space, EDGE_CURVE itself. Where two faces meet, the second one's curve runs through
the same points at t_b = m0 + m1 t, to first order. An edge that is closed smoothly has no vertices (-1 both).
"""

from __future__ import annotations

from assembly._record import place_of, record_dtype, record_view, size_of

# Kinds of features; and a point of an edge, or of a face, that stays where it is on it.
FACE, EDGE, VERTEX, EDGE_POINT, FACE_POINT = 0, 1, 2, 3, 4
# Header: counts, and where the records begin.
SHELL_RECORD = record_dtype(
    "i8",
    faces=1,
    face_table=1,
    edges=1,
    edge_table=1,
    vertices=1,
    vertex_table=1,
)
shell_at = record_view(SHELL_RECORD)
FACES = place_of(SHELL_RECORD, "faces")
FACE_TABLE = place_of(SHELL_RECORD, "face_table")
EDGES = place_of(SHELL_RECORD, "edges")
EDGE_TABLE = place_of(SHELL_RECORD, "edge_table")
VERTICES = place_of(SHELL_RECORD, "vertices")
VERTEX_TABLE = place_of(SHELL_RECORD, "vertex_table")
SHELL = size_of(SHELL_RECORD)
# A face: its surface record, its trim (-1: no boundary), the list that names the edge of every boundary curve (-1: of
# a curve that is a point), and a flag in the pool for every cell of the surface: 0 where all of it is outside the trim.
FACE_FIELDS = record_dtype(
    "i8",
    surface=1,
    trim=1,
    edges=1,
    cell_flags=1,
)
face_at = record_view(FACE_FIELDS)
FACE_SURFACE = place_of(FACE_FIELDS, "surface")
FACE_TRIM = place_of(FACE_FIELDS, "trim")
FACE_EDGES = place_of(FACE_FIELDS, "edges")
FACE_CELL_FLAGS = place_of(FACE_FIELDS, "cell_flags")
FACE_RECORD = size_of(FACE_FIELDS)
# An edge: surface and curve record, its face and the other one (-1: free edge).
# The same edge on the other face: surface and curve record, pool offset of m0, m1.
# Vertices at its ends (-1: closed), and its cells: pool offset and count.
EDGE_FIELDS = record_dtype(
    "i8",
    surface=1,
    curve=1,
    face_a=1,
    face_b=1,
    surface_b=1,
    curve_b=1,
    map=1,
    start=1,
    end=1,
    cells=1,
    cell_count=1,
)
edge_at = record_view(EDGE_FIELDS)
EDGE_SURFACE = place_of(EDGE_FIELDS, "surface")
EDGE_CURVE = place_of(EDGE_FIELDS, "curve")
EDGE_FACE_A = place_of(EDGE_FIELDS, "face_a")
EDGE_FACE_B = place_of(EDGE_FIELDS, "face_b")
EDGE_SURFACE_B = place_of(EDGE_FIELDS, "surface_b")
EDGE_CURVE_B = place_of(EDGE_FIELDS, "curve_b")
EDGE_MAP = place_of(EDGE_FIELDS, "map")
EDGE_START = place_of(EDGE_FIELDS, "start")
EDGE_END = place_of(EDGE_FIELDS, "end")
EDGE_CELLS = place_of(EDGE_FIELDS, "cells")
EDGE_CELL_COUNT = place_of(EDGE_FIELDS, "cell_count")
EDGE_RECORD = size_of(EDGE_FIELDS)
# Doubles a cell of an edge: t from and to, center of its sphere, radius.
EDGE_CELL_SIZE = 6
# A vertex: pool offset of its point, then its edges (pairs: edge, 0 at its start or 1 at its end) and its faces.
VERTEX_FIELDS = record_dtype(
    "i8",
    point=1,
    edges=1,
    edge_list=1,
    faces=1,
    face_list=1,
)
vertex_at = record_view(VERTEX_FIELDS)
VERTEX_POINT = place_of(VERTEX_FIELDS, "point")
VERTEX_EDGES = place_of(VERTEX_FIELDS, "edges")
VERTEX_EDGE_LIST = place_of(VERTEX_FIELDS, "edge_list")
VERTEX_FACES = place_of(VERTEX_FIELDS, "faces")
VERTEX_FACE_LIST = place_of(VERTEX_FIELDS, "face_list")
VERTEX_RECORD = size_of(VERTEX_FIELDS)
