"""The features of a solid as kernels read them: records of faces, edges and vertices in one table of integers.

A shell is a header of `SHELL` integers (how many faces, edges and vertices, and where their records begin), then the
records. All offsets are absolute: into the table, or into the pool of doubles. Features are numbered faces first, then
edges, then vertices; the coordinates of a feature are (u, v) of a face, (t, 0) of an edge, (0, 0) of a vertex.

An edge is the curve S_a(c_a(t)): a plane curve c_a in the parameters of a surface S_a, t in the curve's domain. With
EDGE_SURFACE = -1 it is a curve in space, EDGE_CURVE itself. Where two faces meet, the second one's curve runs through
the same points at t_b = m0 + m1 t, to first order. An edge that is closed smoothly has no vertices (-1 both).
"""

from __future__ import annotations

# Kinds of features; and a point of an edge, or of a face, that stays where it is on it.
FACE, EDGE, VERTEX, EDGE_POINT, FACE_POINT = 0, 1, 2, 3, 4
# Header: counts, and where the records begin.
FACES, FACE_TABLE, EDGES, EDGE_TABLE, VERTICES, VERTEX_TABLE, SHELL = 0, 1, 2, 3, 4, 5, 6
# A face: its surface record, its trim (-1: no boundary), the list that names the edge of every boundary curve (-1: of
# a curve that is a point), and a flag in the pool for every cell of the surface: 0 where all of it is outside the trim.
FACE_SURFACE, FACE_TRIM, FACE_EDGES, FACE_CELL_FLAGS, FACE_RECORD = 0, 1, 2, 3, 4
# An edge: surface and curve record, its face and the other one (-1: free edge).
EDGE_SURFACE, EDGE_CURVE, EDGE_FACE_A, EDGE_FACE_B = 0, 1, 2, 3
# The same edge on the other face: surface and curve record, pool offset of m0, m1.
EDGE_SURFACE_B, EDGE_CURVE_B, EDGE_MAP = 4, 5, 6
# Vertices at its ends (-1: closed), and its cells: pool offset and count.
EDGE_START, EDGE_END, EDGE_CELLS, EDGE_CELL_COUNT, EDGE_RECORD = 7, 8, 9, 10, 11
# Doubles a cell of an edge: t from and to, center of its sphere, radius.
EDGE_CELL_SIZE = 6
# A vertex: pool offset of its point, then its edges (pairs: edge, 0 at its start or 1 at its end) and its faces.
VERTEX_POINT, VERTEX_EDGES, VERTEX_EDGE_LIST, VERTEX_FACES, VERTEX_FACE_LIST, VERTEX_RECORD = 0, 1, 2, 3, 4, 5
