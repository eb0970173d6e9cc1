"""Coordinates of joints at poses, for what is decided before a solve."""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.constraints.program.primitives import coordinate, place_frames
from assembly.constraints.program.records import JOINT_RECORD, header_at, joint_at


@kernel(signatures="(i8[::1], f8[::1], f8[:, ::1], i8[:, ::1], f8[:, ::1], f8[::1])")
def coordinates_at(table, pool, q, asked, records, values):
    """Write the values of coordinates (joint, kind, component) at the scaled poses q; angles are those nearest zero."""
    for k in range(asked.shape[0]):
        joint = joint_at(table, header_at(table, 0).joint_table + JOINT_RECORD * asked[k, 0])
        place_frames(pool, joint.frames, q, joint.body_f, joint.body_g, records, 0)
        values[k] = coordinate(asked[k, 1], asked[k, 2], records, 0, 0.0).value
