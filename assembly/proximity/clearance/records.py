"""Nodes of a body's tree of cells as kernels read them, and what a proof keeps of a pair of bodies.

A node stands for a part of a body's boundary, which is within

    (the hull of four corners, or an oriented box)  +  (a disc of radius `disc` across `ruling`)  +  (a ball of `rho`)

(sums of sets). A cell is a part of one face in (u, v) and has corners; a node above cells has a box. Over the box of
one whole face that lies on a cylinder, a cone, a ball or a torus from outside stands the exact hull of that: a segment
and a disc, two discs, a point and a ball, a disc and a ball. A whole face that is the wall of a bore (a cylinder or a
ball from inside) lies nowhere nearer than `bore` to its axis, or center: what is within that is clear of it. So it is
with all of a flat face that has a round hole. Of a conical bore that is the level `room_in_bore` has.
"""

from __future__ import annotations

from collections import namedtuple

from assembly._record import record_dtype, record_view, size_of

# Geometry of a node.
NODE = record_dtype(
    "f8",
    center=3,  # of a ball around what the node stands for
    radius=1,
    axes=(3, 3),  # of an oriented box around it, one a row: of a cell its longest side first and its normal last
    half=3,  # half widths of that
    ruling=3,  # across which the disc lies: a unit vector
    disc=1,
    rho=1,
    less=2,  # of the hull of a cone, by how much its disc is smaller at the end along the first axis, and at the other
    slant=1,  # of a conical bore, the sine of the angle of its wall to its axis, along which it gets wider
    bore=1,  # how far a bore's wall, or a face beside a hole, is from the line along `ruling` by `spine`, or that point
    spine=3,  # of a piece of a wire the center of its arc, of a bore a point of its axis
    corner=(4, 3),  # of a cell; of a triangle the last two are the same
    reach=1,  # like disc and rho together, but also of the true border from its chord where the face ends before it
    pad=1,  # of a cell, what its radius is in any case
    uv=(4, 2),  # parameters of the corners
    second=3,  # of a cell, and of all its parts: bounds of |S_uu|, |S_uv|, |S_vv|
    first=2,  # of |S_u|, |S_v|
    rim_t=(3, 2),  # of a boundary curve that an edge (corner k to k + 1) is a chord of: its parameters there
    rim_second=(3, 2),  # bounds of its |c_u''|, |c_v''|
)
node_at = record_view(NODE)
NODE_SIZE = size_of(NODE)
# What a node is linked to.
LINKS = record_dtype(
    "i8",
    child=1,  # the first of two children, which follow each other; -1 where there are none yet
    face=1,  # of a cell, the number of its face among all that are packed; else -1
    form=1,  # FLAT, RULED, ROUNDED, WIRE
    rim=3,  # of an edge that is a chord of a boundary curve, the record of that; else -1
    hollow=3,  # 1: that curve bends away from the material, which is nowhere beyond the chord; -1: towards it; 0: else
)
links_at = record_view(LINKS)
LINKS_SIZE = size_of(LINKS)
# A face in a plane (ruling is its normal); one that is swept along straight lines, by a curve across them (ruling is
# their direction), or a cone about its axis (ruling); any other.
# A piece of a round wire: corners are the ends of a piece of its spine, a line or an arc about `spine`; `first` is the
# curvature of that and the radius of the wire.
FLAT, RULED, ROUNDED, WIRE = 0, 1, 2, 3
NONE = -1
# A face among all that are packed.
CELL_FACE = record_dtype(
    "i8",
    surface=1,  # its record in the table
    sign=1,  # of its outward normal, times S_u x S_v
)
cell_face_at = record_view(CELL_FACE)
CELL_FACE_SIZE = size_of(CELL_FACE)
# Trees of cells of several bodies. store: the table and pool of their surfaces and boundary curves; faces: records of
# faces (CELL_FACE); links, nodes: rows of LINKS and NODE, of which the first `used[0]` are used.
Forest = namedtuple("Forest", "store faces links nodes used")

# How many normals of contacts are tried.
GUIDES = 4
# What is known of a pair of bodies, of which the first, a, is at rest.
PAIR = record_dtype(
    "f8",
    turn=9,  # the last pose of b, seen from a, at which a look ended clear
    shift=3,
    travelled=1,  # how far points of b may have gone in all
    soonest=1,  # when that uses up the first gap of the front
    next_soonest=1,  # the same of the front that follows
    soonest_aside=1,  # and of the one that is kept while a look goes on
    part=1,  # of the way of the last look, how much is clear
    depth=1,  # of a crossing: no translation of b by less undoes it
    place=3,  # where it was found, seen from a
    known=1,  # 1: there was one, and neither body was within the other
    needed=1,  # every gap has to be larger
    touch=1,  # cells that cross by no more are no crossing
    resolution=1,  # pairs of cells that are smaller stay open
    far=1,  # the sum of the bodies' largest coordinates
    slimmer=1,  # by so much wires may be in each other: pieces of them that are parted by the distance of their spines
    way_depth=1,  # how far these may be in each other on the way of the last look, at most
    underway=1,  # of a look whose time was over, or memory full: TO_POSE, ON_ITS_WAY; else 0
    aim_part=1,  # where it looks, as a part of the way that is still to be proven
    aim_turn=9,  # and the pose there
    aim_shift=3,
    behind=1,  # how much of the way is proven by then
    origin_turn=9,  # and the pose that it begins at
    origin_shift=3,
    guides=(GUIDES, 3),  # normals of contacts, from a to b, seen from a: directions that are tried as well; or zero
)
pair_proof_at = record_view(PAIR)
PAIR_SIZE = size_of(PAIR)
COUNTS = record_dtype(
    "i8",
    root_a=1,  # rows of the trees' roots
    root_b=1,
    body_a=1,  # rows of the poses
    body_b=1,
    budget=1,  # pairs of nodes after so many stay open
    count=1,  # of pairs of nodes in the front
    next_count=1,  # and in the one that follows
    is_partial=1,  # 1: the one that follows has only the pairs that were tested, each in its row of the present one
    aside=1,  # and in the one that is kept while a look goes on
    fresh=1,  # how many there were when it was last begun; 0: it is not done with that
    earlier=1,  # of a look whose time was over, the pairs for which directions were sought until then
    opened=1,  # of pairs of cells that were left open
    asked=1,  # pairs whose gap was asked again along a kept direction
    sought=1,  # pairs for which directions were sought
    halved=1,  # cells that were halved
    stabbed=1,  # pairs of cells that were asked whether they cross
)
counts_at = record_view(COUNTS)
COUNTS_SIZE = size_of(COUNTS)
# A pair of nodes in the front, or in the queue of a look.
PARTED = record_dtype(
    "f8",
    normal=3,  # the direction, from a to b, that parts them, zero where it is not known; of spines their nearest places
    expiry=1,  # what `travelled` must stay below for that to hold
)
parted_at = record_view(PARTED)
PARTED_SIZE = size_of(PARTED)
NODES = record_dtype(
    "i8",
    a=1,
    b=1,
    how=1,  # BY_PLANE, BY_BORE_A, BY_BORE_B, BY_SPINES, BY_PLANE_OF_B, BY_SLEEVE: what parts them; OPEN_YET, LEFT_OPEN
)
nodes_at = record_view(NODES)
NODES_SIZE = size_of(NODES)
# A plane between them; the bore of a wall of a in which b is, or the other way around; the distance of two spines. Of
# a look whose time was over: nothing yet. A plane between them that moves along with b; its direction is in axes of b.
# The bore of a in which the part of b beside a is, in three ways (`sleeves.py`). Of a look that may go on: nothing, and
# no more is tried.
BY_PLANE, BY_BORE_A, BY_BORE_B, BY_SPINES, OPEN_YET, BY_PLANE_OF_B, BY_SLEEVE = 0, 1, 2, 3, 4, 5, 6
LEFT_OPEN = -1
# How a look ends. UNSWEPT: the way is too long to be proven at once; NO_ROOM: memory is full, and has to be grown;
# SPENT: the time is over. After both the next call goes on.
CLEAR, CROSSING, OPEN, NO_ROOM, UNSWEPT, SPENT = 0, 1, 2, 3, 4, 5
# What a look that is interrupted looks at: a pose alone, or the way there as well.
TO_POSE, ON_ITS_WAY = 1.0, 2.0
