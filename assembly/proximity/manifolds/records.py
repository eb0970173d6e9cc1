"""Parts of plane loops, and rows of contact manifolds, as kernels read them."""

from __future__ import annotations

from assembly._record import record_dtype, record_view, size_of

# A straight piece or an arc of a loop, in the coordinates of a plane.
SEGMENT = record_dtype(
    "f8",
    begin=2,
    end=2,
    center=2,  # of an arc
    radius=1,  # 0: a straight piece
    sweep=1,  # by how much an arc turns, at most a quarter; counterclockwise where positive [rad]
    low=2,  # corners of a box around it
    high=2,
)
segment_at = record_view(SEGMENT)
SEGMENT_SIZE = size_of(SEGMENT)
# A plane with coordinates: origin + x right + y up; `normal` points out of the body.
FRAME = record_dtype("f8", origin=3, right=3, up=3, normal=3)
frame_at = record_view(FRAME)
FRAME_SIZE = size_of(FRAME)
# A row of a manifold, in the axes of the first body. Where the second one is moved by a twist, a velocity v of what is
# at the origin and a turn w about that, the gap changes at the rate normal.(v + w x place).
# What it is of: a kind below, and the numbers of segments of the first and of the second region, half of one more for
# the middle of an arc; of rings and rims which end, 0 or 1, they are at.
ROW = record_dtype("f8", normal=3, place=3, gap=1, kind=1, first=1, second=1)
row_at = record_view(ROW)
ROW_SIZE = size_of(ROW)
# A corner of the first face or of the second, a crossing of their borders, where an arc of the first or of the second
# is lowest; a ring of what is full and the wall, a rim of the wall and what is full, in directions that are kept or
# nearest; of what is round on a plane the end of its line, where that ends at a border, the lowest point of a ball.
CORNER_A, CORNER_B, CROSSING, LOWEST_A, LOWEST_B, RING, NEAREST_RING, RIM, NEAREST_RIM, END, CUT, BALL = range(12)
# A cylinder or a cone about an axis.
ROUND = record_dtype(
    "f8",
    origin=3,  # a point of the axis; of a cone its apex
    axis=3,  # of a cone toward where it is
    half_angle=1,  # of a cone; 0 of a cylinder [rad]
    radius=1,  # of a cylinder; 0 of a cone
    low=1,  # from where to where it goes along the axis, from the origin
    high=1,
)
round_at = record_view(ROUND)
ROUND_SIZE = size_of(ROUND)
