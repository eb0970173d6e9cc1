"""Second derivatives of rows of trims (`trim.py`), times a multiplier, added to a Hessian in twists."""

from __future__ import annotations

import numpy as np

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.place import (
    OwnPlace,
    add_coordinate_curvature,
    place_at,
)
from assembly.constraints.program.records import (
    AT_PLACE,
    SIGNED,
    Iterate,
    LiftedPairs,
)
from assembly.constraints.program.row_terms import add_gram
from assembly.constraints.program.trim import add_coordinate_rate, clear, trim_of
from assembly.constraints.program.trim_sides import part_of, trim_place
from assembly.proximity.features.trim_distance import trim_distance


@kernel(
    signatures=(
        "(Tuple((i8[::1], f8[::1])), i8, "
        "Tuple((i8[::1], f8[:, ::1], f8[:, :, ::1], f8[:, ::1], f8[:, ::1], f8[::1])), "
        "i8[:, ::1], Tuple((f8[:, ::1], f8[:, ::1], f8[:, ::1], f8[::1], f8[:, ::1])), f8, f8[:, ::1])"
    ),
    allocates=True,
)
def trim_terms(scene, r, pairs, bases, point, y, hessian):
    """Upper triangle of hessian += y (second derivative of row r).

    It is exact for a place and for a signed row of a lifted pair; else the term of the change of u_q is left out. The
    row of a vector is treated as the signed distance times the part that its gradient has of the distance's gradient:
    at a solution the rest of it is a multiple of the gap's gradient.
    """
    table, pool = scene
    free, lengths, vectors, variables, guess, memory = pairs
    q, tracked, records, residual, jacobian = point
    lifted = LiftedPairs(free, lengths, vectors, variables, guess, memory)
    row = trim_of(table, r)
    k = row.contact
    o = 2 * row.side
    if row.form == AT_PLACE:
        stretch = place_at(pool, row.factor).stretch
        slopes = (y * stretch[2 * row.slot], y * stretch[2 * row.slot + 1])
        own, here = OwnPlace(row.factor, k, row.side), Iterate(q, tracked, records, residual, jacobian)
        add_coordinate_curvature(Store(table, pool), own, slopes, lifted, bases, here, hessian)
        return 0
    place = trim_place(Store(table, pool), row, tracked)
    if place.loop < 0:
        return 0
    _s, n, bend = trim_distance(Store(table, pool), place.loop, tracked[k, o], tracked[k, o + 1])
    places = np.empty((1, bases.shape[1]), np.int64)
    for b in range(bases.shape[1]):
        places[0, b] = bases[r, b]
    rates = np.zeros((1, jacobian.shape[1]))
    factor = place.factor
    if row.form != SIGNED:
        add_coordinate_rate(lifted, records, k, o, n[0], rates, 0)
        add_coordinate_rate(lifted, records, k, o + 1, n[1], rates, 0)
        factor = part_of(jacobian, r, rates, k)
        clear(rates, 0)
    # s_uu = bend t t^T, t along the loop.
    add_coordinate_rate(lifted, records, k, o, -n[1], rates, 0)
    add_coordinate_rate(lifted, records, k, o + 1, n[0], rates, 0)
    add_gram(places, rates, 0, y * factor * bend, hessian)
    return 0
