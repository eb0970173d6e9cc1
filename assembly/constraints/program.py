"""A scene packed into one table of integers and one pool of doubles, and its rows evaluated.

All lengths in a program are divided by the scene's length scale. Table: a header, the slot of
every body (-1: fixed), then a record a row and a record an objective term. The loop works on

    configuration  (n, 7)   poses, scaled, positions relative to a reference
    contacts       (k, 4)   parameters of every tracked pair
    records        (k, R)   what the gap's derivatives need (see `track_contact`)
    residual       (m,)     rows; jacobian (m, 12) in the twists of the row's two bodies
"""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import add, cross, dot, matvec, quaternion_product, sub
from assembly.kinematics.motion import position, relative_pose, rotation
from assembly.proximity.extremal import CLOSE, CONVERGED, LEFT_PATCH, SINGULAR, solve_pair
from assembly.proximity.free_pair import VARIABLES, free_hessian, free_rows
from assembly.proximity.start import global_start
from assembly.proximity.velocity import GAP, RECORD, add_gap_terms, gradient_row, store_record

# Header of the table.
BODIES, MOVING, CONTACTS, ROWS, TERMS, SLOTS, ROW_TABLE, TERM_TABLE, HEADER = 0, 1, 2, 3, 4, 5, 6, 7, 8
# A row: kind, its two bodies, their surface records, its contact, and whether it is one-sided (residual >= 0).
ROW = 8
KIND, BODY_F, BODY_G, SURFACE_F, SURFACE_G, CONTACT, ONE_SIDED = 0, 1, 2, 3, 4, 5, 6
CONTACT_ROW = 0
# A term: kind, body, offset of its parameters.
TERM = 4
TERM_KIND, TERM_BODY, TERM_PARAMETERS = 0, 1, 2
POINT_DISTANCE, POSTURE = 0, 1
# Behind a contact's record: whether the surfaces do not cross at it, and how far it is from a fold (det H / |H|^2).
PROPER, FOLD, CONTACT_RECORD = RECORD, RECORD + 1, RECORD + 2
# Header of the pool.
# length scale, reference point (1 to 3), weight by which the objective was divided.
SCALE, REFERENCE, WEIGHT, POOL_HEADER = 0, 1, 4, 8


@kernel(inline=True)
def load(array, o):
    return (array[o], array[o + 1], array[o + 2])


@kernel(inner=True)
def track_contact(table, pool, row, q, start, patience, records, k):
    """Newton on the pair of one row; fills its record. Returns status, parameters, the points' signed distance."""
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    turn = rotation(q, i)
    relative, shift = relative_pose(q, i, turn, j, rotation(q, j))
    status, x, _count, frame, curvature = solve_pair(
        table, pool, table[row + SURFACE_F], table[row + SURFACE_G], relative, shift, start, 1.0, patience, CLOSE
    )
    apart = sub(frame[4], frame[3])
    distance = math.sqrt(dot(apart, apart))
    if status == CONVERGED or status == SINGULAR:
        store_record(turn, shift, frame, curvature, records, k)
        # Relative curvature -H (I + beta A)^-1: indefinite means the surfaces cross beside the point.
        h = curvature[1]
        det = h[0] * h[3] - h[1] * h[2]
        norm2 = h[0] * h[0] + h[1] * h[1] + h[2] * h[2] + h[3] * h[3]
        records[k, PROPER] = 1.0 if det > -1e-9 * norm2 and h[0] + h[3] <= 0.0 else 0.0
        records[k, FOLD] = det / norm2 if norm2 > 1e-18 else 0.0
    return status, x, distance if frame[10] > 0.0 else -distance


@kernel(inner=True)
def restart_contact(table, pool, row, q, records, k):
    """As `track_contact`, from a global start."""
    i = table[row + BODY_F]
    j = table[row + BODY_G]
    relative, shift = relative_pose(q, i, rotation(q, i), j, rotation(q, j))
    status, x, _gap = global_start(table, pool, table[row + SURFACE_F], table[row + SURFACE_G], relative, shift, 1.0)
    if status == CONVERGED or status == SINGULAR:
        status, x, _distance = track_contact(table, pool, row, q, x, math.inf, records, k)
    return status, x


@kernel(inner=True)
def add_term(table, pool, term, q, gradient, hessian):
    """Value of one objective term; adds its gradient and its Hessian."""
    body = table[term + TERM_BODY]
    slot = table[table[SLOTS] + body]
    o = table[term + TERM_PARAMETERS]
    weight = pool[o]
    s = 6 * slot
    if table[term + TERM_KIND] == POINT_DISTANCE:
        p = matvec(rotation(q, body), load(pool, o + 1))
        e = add(sub(position(q, body), load(pool, o + 4)), p)
        value = weight * dot(e, e)
        if slot < 0:
            return value
        turn = cross(p, e)
        for k in range(3):
            gradient[s + k] += 2.0 * weight * e[k]
            gradient[s + 3 + k] += 2.0 * weight * turn[k]
        pp = dot(p, p) - dot(e, p)
        for k in range(3):
            hessian[s + k, s + k] += 2.0 * weight
            hessian[s + 3 + k, s + 3 + k] += 2.0 * weight * pp
            i = (k + 1) % 3
            j = (k + 2) % 3
            # d(turn)/dx = [p]x: -p_j at (k, i), +p_i at (k, j).
            hessian[s + 3 + k, s + i] -= 2.0 * weight * p[j]
            hessian[s + 3 + k, s + j] += 2.0 * weight * p[i]
            hessian[s + i, s + 3 + k] -= 2.0 * weight * p[j]
            hessian[s + j, s + 3 + k] += 2.0 * weight * p[i]
            for l in range(3):
                hessian[s + 3 + k, s + 3 + l] += weight * (p[k] * e[l] + e[k] * p[l] - 2.0 * p[k] * p[l])
        return value
    # Posture: |x - x0|^2 + s^2 4 (1 - (e.e0)^2), with c and u the scalar and vector part of e0 e^*.
    d = sub(position(q, body), load(pool, o + 1))
    c, ux, uy, uz = quaternion_product(
        (pool[o + 4], pool[o + 5], pool[o + 6], pool[o + 7]), (q[body, 3], -q[body, 4], -q[body, 5], -q[body, 6])
    )
    u = (ux, uy, uz)
    lever = weight * pool[o + 8] * pool[o + 8]
    value = weight * dot(d, d) + 4.0 * lever * dot(u, u)
    if slot < 0:
        return value
    for k in range(3):
        gradient[s + k] += 2.0 * weight * d[k]
        gradient[s + 3 + k] -= 4.0 * lever * c * u[k]
    for k in range(3):
        hessian[s + k, s + k] += 2.0 * weight
        hessian[s + 3 + k, s + 3 + k] += 2.0 * lever * c * c
        for l in range(3):
            hessian[s + 3 + k, s + 3 + l] -= 2.0 * lever * u[k] * u[l]
    return value


@kernel(inner=True)
def evaluate(table, pool, q, start, patience, free, lengths, vectors, contacts, records, residual, jacobian):
    """Evaluate all rows at q. Returns the contact whose pair was lost, or -1.

    A tracked contact is carried from `start` to its extremal pair, by steps that turn no normal by more than
    `patience`. A free one (free[k] >= 0, its place among the free ones) is evaluated at `start` itself, and its four
    rows of tangency follow the rows of the program. A one-sided row that loses its pair takes the
    nearest one there is.
    """
    for r in range(table[ROWS]):
        row = table[ROW_TABLE] + ROW * r
        k = table[row + CONTACT]
        x = (start[k, 0], start[k, 1], start[k, 2], start[k, 3])
        if free[k] < 0:
            status, x, distance = track_contact(table, pool, row, q, x, patience, records, k)
            if status != CONVERGED and status != SINGULAR:
                if table[row + ONE_SIDED] == 0:
                    return k
                # A one-sided contact is of the nearest pair, whichever that is now.
                held = status == LEFT_PATCH and distance > 0.0
                status, x = restart_contact(table, pool, row, q, records, k)
                if status != CONVERGED and status != SINGULAR:
                    if not held:
                        return k
                    for i in range(CONTACT_RECORD):
                        records[k, i] = 0.0
                    records[k, GAP] = distance
                    records[k, PROPER] = 1.0
                    records[k, FOLD] = 1.0
                elif not records[k, GAP] > 0.0:
                    return k
            residual[r] = records[k, GAP]
            gradient_row(records, k, jacobian, r)
        else:
            e = table[ROWS] + 4 * free[k]
            free_rows(
                table,
                pool,
                table[row + SURFACE_F],
                table[row + SURFACE_G],
                table[row + BODY_F],
                table[row + BODY_G],
                q,
                x,
                (lengths[k, 0], lengths[k, 1], lengths[k, 2], lengths[k, 3]),
                vectors,
                residual,
                jacobian,
                r,
                e,
            )
        contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3] = x
    return -1


@kernel(inner=True)
def objective(table, pool, q, gradient, hessian):
    """Value, gradient and Hessian of the objective; both arrays are overwritten."""
    n = gradient.size
    for i in range(n):
        gradient[i] = 0.0
        for j in range(n):
            hessian[i, j] = 0.0
    value = 0.0
    for t in range(table[TERMS]):
        value += add_term(table, pool, table[TERM_TABLE] + TERM * t, q, gradient, hessian)
    return value


@kernel(inner=True)
def add_row_terms(table, pool, r, q, contacts, free, lengths, vectors, block, records, jacobian, y, weights, hessian):
    """Upper triangle of hessian += second derivative of y . rows + J^T diag(weights) J, for row r.

    The rows of tangency of a free pair go with its row.
    """
    row = table[ROW_TABLE] + ROW * r
    f = 6 * table[table[SLOTS] + table[row + BODY_F]]
    g = 6 * table[table[SLOTS] + table[row + BODY_G]]
    k = table[row + CONTACT]
    if free[k] < 0:
        if y[r] != 0.0 or weights[r] != 0.0:
            add_gap_terms(records, k, jacobian, r, y[r], weights[r], hessian, f, g)
        return
    e = table[ROWS] + 4 * free[k]
    u = 6 * table[MOVING] + 4 * free[k]
    free_hessian(
        table,
        pool,
        table[row + SURFACE_F],
        table[row + SURFACE_G],
        table[row + BODY_F],
        table[row + BODY_G],
        q,
        (contacts[k, 0], contacts[k, 1], contacts[k, 2], contacts[k, 3]),
        (lengths[k, 0], lengths[k, 1], lengths[k, 2], lengths[k, 3]),
        (y[r], y[e], y[e + 1], y[e + 2], y[e + 3]),
        vectors,
        block,
    )
    for i in range(VARIABLES):
        base = f if i < 6 else (g - 6 if i < 12 else u - 12)
        if i < 12 and (f if i < 6 else g) < 0:
            continue
        for j in range(VARIABLES):
            other = f if j < 6 else (g - 6 if j < 12 else u - 12)
            if j < 12 and (f if j < 6 else g) < 0:
                continue
            value = block[i, j] + weights[r] * jacobian[r, i] * jacobian[r, j]
            for l in range(4):
                value += weights[e + l] * jacobian[e + l, i] * jacobian[e + l, j]
            hessian[base + i, other + j] += value
