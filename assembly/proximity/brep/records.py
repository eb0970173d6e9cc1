"""The features of a solid as kernels read them: records of faces, edges and vertices in one table of integers.

A shell is a header, then the records. All offsets are absolute: into the table, or into the pool of doubles. Features
are numbered faces first, then edges, then vertices; the coordinates of a feature are (u, v) of a face, (t, 0) of an
edge, (0, 0) of a vertex.

An edge is the curve S_a(c_a(t)): a plane curve c_a in the parameters of a surface S_a, t in the curve's domain. With
surface -1 it is a curve in space itself. Where two faces meet, the second one's curve runs through the same points at
t_b = m0 + m1 t, to first order. An edge that is closed smoothly has no vertices (-1 both).
"""

from __future__ import annotations

from collections import namedtuple

from assembly._record import record_dtype, record_view, size_of

# Kinds of features; and a point of an edge, or of a face, that stays where it is on it.
FACE, EDGE, VERTEX, EDGE_POINT, FACE_POINT = 0, 1, 2, 3, 4
# A feature, or a point of one, by its kind and by where the record of its surface, its edge or its vertex is in the
# table.
Feature = namedtuple("Feature", "kind record")
# A header: numbers of features, and where their records begin in the table.
SHELL_DTYPE = record_dtype(
    "i8",
    faces=1,
    face_table=1,
    edges=1,
    edge_table=1,
    vertices=1,
    vertex_table=1,
)
shell_at = record_view(SHELL_DTYPE)
SHELL = size_of(SHELL_DTYPE)
# A face.
FACE_DTYPE = record_dtype(
    "i8",
    surface=1,  # its surface's record
    trim=1,  # its trim's record; -1: no boundary
    edges=1,  # the list of its boundary curves' edges in the table; in it -1: the curve is a point
    cell_flags=1,  # in the pool a flag for every cell of the surface; 0: all of it is outside the trim
)
face_at = record_view(FACE_DTYPE)
FACE_RECORD = size_of(FACE_DTYPE)
# An edge, S_a(c_a(t)).
EDGE_DTYPE = record_dtype(
    "i8",
    surface=1,  # record of S_a; -1: the edge is a curve in space
    curve=1,  # record of c_a, or of the curve in space
    face_a=1,  # number of its face
    face_b=1,  # of the other face; -1: a free edge
    surface_b=1,  # the same edge on the other face: surface
    curve_b=1,  # and curve
    map=1,  # where m0 and m1 are in the pool
    start=1,  # vertices at its ends, by number; -1 both: it is closed
    end=1,
    cells=1,  # where its cells begin in the pool
    cell_count=1,
)
edge_at = record_view(EDGE_DTYPE)
EDGE_RECORD = size_of(EDGE_DTYPE)
# Doubles a cell of an edge: t from and to, center of its sphere, radius.
EDGE_CELL_SIZE = 6
# A vertex.
VERTEX_DTYPE = record_dtype(
    "i8",
    point=1,  # where it is in the pool
    edges=1,  # number of edges that end there
    edge_list=1,  # where these are in the table, pairs: edge, 0 at its start or 1 at its end
    faces=1,  # number of faces around it
    face_list=1,  # where these are in the table
)
vertex_at = record_view(VERTEX_DTYPE)
VERTEX_RECORD = size_of(VERTEX_DTYPE)
