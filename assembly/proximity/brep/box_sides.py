"""Where boxes in (u, v) lie relative to the trims of faces: all inside, all outside, or neither."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry.faces.trim import trim_side
from assembly.proximity.brep.bezier_nets import FACE_NETS, face_nets_at

# Of a box: whether all of it is inside the trim, all of it outside, or a boundary curve may enter it.
CLEAR, OUTSIDE, ENTERED = 0, 1, 2
# Rounding of parameters, relative.
_ROUNDING = 1e-14


@kernel(inline=True)
def _meets(low, high, other_low, other_high, period):
    """Whether two intervals meet, whole periods apart where there is one."""
    if period == 0.0:
        return low <= other_high and other_low <= high
    # Move the second one up by the fewest periods that bring its end to the first one's beginning, or beyond.
    return other_low + math.ceil((low - other_high) / period) * period <= high


@kernel(inline=True)
def _domain(pool, breaks, spans, closed):
    """The low end of a direction, its period (0: none), and the rounding error of parameters."""
    low, high = pool[breaks], pool[breaks + spans]
    return low, high - low if closed == 1 else 0.0, _ROUNDING * max(abs(low), abs(high))


@kernel(signatures="(i8[::1], f8[::1], i8[::1], f8[:, ::1], i8[::1])")
def write_sides(table, pool, faces, boxes, out):
    """CLEAR, OUTSIDE or ENTERED for boxes (n, 4), u from and to and v from and to, of faces.

    A box that no boundary curve enters is on one side: that of its middle.
    """
    for i in range(faces.size):
        face = face_nets_at(table, FACE_NETS * faces[i])
        out[i] = CLEAR
        if face.trim < 0:
            continue
        _u, period_u, slack_u = _domain(pool, face.breaks_u, face.spans_u, face.closed_u)
        _v, period_v, slack_v = _domain(pool, face.breaks_v, face.spans_v, face.closed_v)
        u0, u1 = boxes[i, 0] - slack_u, boxes[i, 1] + slack_u
        v0, v1 = boxes[i, 2] - slack_v, boxes[i, 3] + slack_v
        for k in range(face.boundary_boxes):
            at = face.boundary + 4 * k
            if _meets(u0, u1, pool[at], pool[at + 1], period_u) and _meets(
                v0, v1, pool[at + 2], pool[at + 3], period_v
            ):
                out[i] = ENTERED
                break
        if out[i] == CLEAR:
            u, v = 0.5 * (boxes[i, 0] + boxes[i, 1]), 0.5 * (boxes[i, 2] + boxes[i, 3])
            if trim_side(Store(table, pool), face.trim, u, v) < 0:
                out[i] = OUTSIDE
