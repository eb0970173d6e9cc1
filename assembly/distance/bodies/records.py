"""A body as a tree of Bezier patches in its own coordinates, made once and kept: no pose is in it.

A leaf of the tree that is packed is a whole patch: of a face, or of one of the curves that bound trimmed faces, which
is a patch of degree 0 in v. Above these stand groups of patches, which have a ball alone; below them halves, which are
made when a search first asks for them, and stay. With x, y in [-1/2, 1/2] on a patch its model says

    |S - (middle + Su x + Sv y + Suu x^2 / 2 + Suv x y + Svv y^2 / 2)| <= point_doubt,

and the first and second derivatives of S are within their own doubts of those of the model.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._record import place_of, record_dtype, record_view, size_of

__all__ = [
    "ALL",
    "BALL",
    "BENDS",
    "BODY_HEAD",
    "CUT",
    "GROUP",
    "INSIDE",
    "LINKS",
    "MIDDLE",
    "MODEL",
    "NODE",
    "NODE_LINKS",
    "NONE",
    "OUTSIDE",
    "PATCH",
    "PATCH_SIZE",
    "PATCH_SPAN",
    "SLOPES",
    "SPAN",
    "SPINE",
    "SPINE_SIZE",
    "TREE_NODE",
    "TREE_STATE",
    "UNPLACED",
    "USED",
    "BodyTree",
    "body_head_at",
    "node_links_at",
    "patch_at",
    "patch_span_at",
    "spine_at",
    "tree_node_at",
    "tree_state_at",
]

# The patch of a node that is a group of patches; no halves, no trim, no spine, no boundary curve.
GROUP = NONE = -1
# What of a node has been computed. More of it is, when a search first asks.
BALL, MODEL, ALL = 0, 1, 2
# Where a node is against the boundary of its face. CUT: the boundary may pass through it.
INSIDE, CUT, OUTSIDE, UNPLACED = 0, 1, 2, 3
# table, pool: what packing wrote, integers and doubles; links, nodes, nets: integers and doubles of nodes, and their
# control points, (w x, w y, w z, w) row by row, then their places, all x, all y, all z.
BodyTree = namedtuple("BodyTree", "table pool links nodes nets")

# The body, at the start of the pool.
BODY_HEAD = record_dtype(
    "f8",
    reach=1,  # the largest distance of a control point from the center [length]
    error=1,  # how far the packed patches may be from the given faces [length]
    weight_ratio=1,  # the largest quotient of two weights of one patch
    rational=1,  # 1: weights of a patch differ
    patches=1,  # whole patches, of faces and of boundary curves
    degree=1,  # the largest sum of the degrees of a patch
    center=3,  # what was subtracted from all points [length]
    half=3,  # half extents of the box about the center that has all of it [length]
)
body_head_at = record_view(BODY_HEAD)
# A whole patch in the table.
PATCH = record_dtype(
    "i8",
    degree_u=1,
    degree_v=1,
    face=1,  # number of the face that it is of
    curve=1,  # number of the face's boundary curve; NONE: a patch of the face
    sign=1,  # 1, or -1 where the outward normal of its face is -Su x Sv
    single=1,  # 1: the surface of its face has no other patch
    node=1,  # the node that is all of it
    net=1,  # where its control points begin
    tables_u=1,  # where in the pool the tables of its degrees begin
    tables_v=1,
    span=1,  # where in the pool its PATCH_SPAN is
    trim=1,  # where in the table the trim of its face is; NONE: all of it is of the face
    spine=1,  # where in the pool its SPINE is; NONE: it is neither an elementary surface nor a line or a circle
    border=1,  # of a trimmed plane: the first patch of its face's boundary, one after the other; NONE
)
patch_at = record_view(PATCH)
PATCH_SIZE = size_of(PATCH)
# The parameters of a whole patch on its surface, of a boundary curve (t, 0).
PATCH_SPAN = record_dtype("f8", low_u=1, high_u=1, low_v=1, high_v=1)
patch_span_at = record_view(PATCH_SPAN)
SPAN = size_of(PATCH_SPAN)
# An elementary surface on which a patch lies (`spines.py`), in the body's coordinates about its center. A line is a
# cylinder of no radius, a circle a torus with a tube of none.
SPINE = record_dtype(
    "f8",
    kind=1,
    center=3,  # of a cylinder: the middle of its axis; of a plane: that of its patches [length]
    axis=3,  # unit; of a plane its normal
    radius=1,  # of the sphere, the cylinder or the tube [length]
    major=1,  # radius of the circle of a torus [length]
    half=1,  # half the length of a cylinder; how far patches on a plane are from the center [length]
    off=1,  # how far the patch may be from it [length]
)
spine_at = record_view(SPINE)
SPINE_SIZE = size_of(SPINE)
# The beginning of the links.
TREE_STATE = record_dtype("i8", nodes=1, nets=1)  # how many nodes and doubles of nets are used
tree_state_at = record_view(TREE_STATE)
USED = size_of(TREE_STATE)
# A node, its integers, behind TREE_STATE.
NODE_LINKS = record_dtype(
    "i8",
    halves=1,  # the first of its two halves, the other one is next to it; NONE
    patch=1,  # number of the patch that it is of; GROUP
    depth=1,  # halvings
    known=1,  # BALL, MODEL (without doubts of derivatives) or ALL of it
    net=1,  # where its control points begin
    place=1,  # INSIDE, CUT, OUTSIDE or UNPLACED
    spine=1,  # where in the pool the SPINE is on which all of it lies; NONE
)
node_links_at = record_view(NODE_LINKS)
LINKS = size_of(NODE_LINKS)
# A node, its doubles.
TREE_NODE = record_dtype(
    "f8",
    middle=3,  # [length]
    slopes=6,  # Su, Sv
    bends=9,  # Suu, Suv, Svv
    point_doubt=1,
    slope_doubt=1,
    bend_doubt=1,
    radius=1,  # of a ball about the middle that has all control points [length]
    extent=1,  # size of the model: rounding is a part of it [length]
    length_u=1,  # longer than its curves along u; of a group: the diameter of its ball [length]
    length_v=1,
    away=1,  # how far the net may be from what it stands for [length]
    low_u=1,  # its box of parameters in the unit square of its patch
    high_u=1,
    low_v=1,
    high_v=1,
    support=2,  # of a group or a whole patch, along a direction, as a and as b of the latest search [length]
)
tree_node_at = record_view(TREE_NODE)
MIDDLE = place_of(TREE_NODE, "middle")
SLOPES = place_of(TREE_NODE, "slopes")
BENDS = place_of(TREE_NODE, "bends")
NODE = size_of(TREE_NODE)
