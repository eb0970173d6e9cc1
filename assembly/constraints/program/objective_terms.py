"""The terms of an objective: values, gradients and Hessians in twists.

point distance   weight |p - target|^2
posture          weight |x - x0|^2 + lever 4 sin^2(angle / 2), from a pose (x0, e0)
potential        -force . p, p a point of a body
tape             weight times a user's expression

Dexterities are in `solve/loop/dexterity.py`, places of contacts in `constraints/program/place.py`.
"""

from __future__ import annotations

import math

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.constraints.program.envelope import clear_upper
from assembly.constraints.program.hessian_blocks import block_row, is_blocked, spot
from assembly.constraints.program.records import header_at, pool_header_at, tape_at
from assembly.constraints.program.tapes import place_tape
from assembly.geometry.vec import add, cross, dot, matvec, quaternion_product, sub
from assembly.kinematics.motion import position, rotation

# A term.
TERM_RECORD = record_dtype(
    "i8",
    kind=1,  # POINT_DISTANCE, ...
    body=1,  # -1: none
    parameters=1,  # where these are in the pool
    tape=1,  # where the record of its tape or dexterity is
    follows=1,  # 1: a posture whose reference is the start of each solve
    contact=1,  # of a place: the contact that is drawn to it
    side=1,  # of a place: on the face of f (0) or of g (1)
    rows=1,  # of a place: 2 for a point, 1 for a line
)
term_at = record_view(TERM_RECORD)
TERM = size_of(TERM_RECORD)
POINT_DISTANCE, POSTURE, TAPE_TERM, DEXTERITY, POTENTIAL, PLACE = 0, 1, 2, 3, 4, 5
# Parameters of a point distance.
POINT_DISTANCE_FIELDS = record_dtype(
    "f8",
    weight=1,
    point=3,  # in the axes of its body
    target=3,
)
point_distance_at = record_view(POINT_DISTANCE_FIELDS)
# Parameters of a posture.
POSTURE_FIELDS = record_dtype(
    "f8",
    weight=1,  # of the square of the distance
    position=3,  # of the reference
    quaternion=4,  # of the reference
    lever=1,  # of 4 sin^2(angle / 2)
)
posture_at = record_view(POSTURE_FIELDS)
# Parameters of a potential.
POTENTIAL_FIELDS = record_dtype(
    "f8",
    force=3,  # in the axes of the world
    point=3,  # where it acts, in the axes of its body
    offset=1,  # value at the origin
)
potential_at = record_view(POTENTIAL_FIELDS)
POSTURE_QUATERNION = place_of(POSTURE_FIELDS, "quaternion")
POSTURE_PARAMETERS = size_of(POSTURE_FIELDS)


@kernel(inline=True)
def three_at(array, o):
    return (array[o], array[o + 1], array[o + 2])


@kernel(inner=True)
def point_distance(pool, o, q, body, s, order, gradient, hessian):
    """Value of weight |p - target|^2; from order 1 on, add its derivatives at s, where the body's twist begins."""
    term = point_distance_at(pool, o)
    weight = term.weight
    p = matvec(rotation(q, body), (term.point[0], term.point[1], term.point[2]))
    e = add(sub(position(q, body), (term.target[0], term.target[1], term.target[2])), p)
    value = weight * dot(e, e)
    if s < 0 or order == 0:
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
        hessian[s + i, s + 3 + k] -= 2.0 * weight * p[j]
        hessian[s + j, s + 3 + k] += 2.0 * weight * p[i]
        for l in range(k, 3):
            hessian[s + 3 + k, s + 3 + l] += weight * (p[k] * e[l] + e[k] * p[l] - 2.0 * p[k] * p[l])
    return value


@kernel(inner=True)
def posture(pool, o, q, body, s, order, gradient, hessian):
    """|x - x0|^2 and 4 sin^2(angle / 2), with c and u the scalar and vector part of e0 e^*."""
    term = posture_at(pool, o)
    weight, lever = term.weight, term.lever
    turn = term.quaternion
    d = sub(position(q, body), (term.position[0], term.position[1], term.position[2]))
    c, ux, uy, uz = quaternion_product(
        (turn[0], turn[1], turn[2], turn[3]), (q[body, 3], -q[body, 4], -q[body, 5], -q[body, 6])
    )
    u = (ux, uy, uz)
    value = weight * dot(d, d) + 4.0 * lever * dot(u, u)
    if s < 0 or order == 0:
        return value
    for k in range(3):
        gradient[s + k] += 2.0 * weight * d[k]
        gradient[s + 3 + k] -= 4.0 * lever * c * u[k]
    for k in range(3):
        hessian[s + k, s + k] += 2.0 * weight
        hessian[s + 3 + k, s + 3 + k] += 2.0 * lever * c * c
        for l in range(k, 3):
            hessian[s + 3 + k, s + 3 + l] -= 2.0 * lever * u[k] * u[l]
    return value


@kernel(inner=True)
def potential(pool, o, q, body, s, order, gradient, hessian):
    """-force . p, with p = x + R a: its gradient is (-force, force x R a); its Hessian in rotations is that of R a."""
    term = potential_at(pool, o)
    force = (term.force[0], term.force[1], term.force[2])
    arm = matvec(rotation(q, body), (term.point[0], term.point[1], term.point[2]))
    value = term.offset - dot(force, add(position(q, body), arm))
    if s < 0 or order == 0:
        return value
    turn = cross(force, arm)
    along = dot(force, arm)
    for k in range(3):
        gradient[s + k] -= force[k]
        gradient[s + 3 + k] += turn[k]
        hessian[s + 3 + k, s + 3 + k] += along
        for l in range(k, 3):
            hessian[s + 3 + k, s + 3 + l] -= 0.5 * (force[k] * arm[l] + arm[k] * force[l])
    return value


@kernel(inner=True)
def tape_term(store, term, q, order, workspace, entries, gradient, hessian):
    """Weight times the one value of a tape."""
    header = header_at(store.table, 0)
    term_record = term_at(store.table, term)
    inputs, outputs, work = workspace
    weight = store.pool[term_record.parameters]
    size = pool_header_at(store.pool, 0).scale
    # The tape of a term has the same record as the tape of a row, and one value.
    tape = term_record.tape
    expression = tape_at(store.table, tape)
    end = place_tape(store, tape, q, inputs)
    call_address(header.run_tape_address, (store.table, store.pool, expression.first_order, inputs, work, outputs))
    value = weight * outputs[0]
    count = expression.bodies
    bodies = expression.body_list
    if order == 0 or not math.isfinite(value):
        return value if math.isfinite(value) else math.inf
    for b in range(count):
        s = 6 * store.table[header.unknown_blocks + store.table[bodies + b]]
        if s >= 0:
            for i in range(3):
                gradient[s + i] += weight * size * outputs[1 + 6 * b + i]
                gradient[s + 3 + i] += weight * outputs[4 + 6 * b + i]
    inputs[end] = weight
    call_address(header.run_tape_address, (store.table, store.pool, expression.second_order, inputs, work, outputs))
    for b in range(count):
        at = 6 * store.table[header.unknown_blocks + store.table[bodies + b]]
        for c in range(count):
            other = 6 * store.table[header.unknown_blocks + store.table[bodies + c]]
            if at < 0 or other < at:
                continue
            row, column = spot(entries, at, other)
            for i in range(6):
                for j in range(6):
                    factor = (size if i < 3 else 1.0) * (size if j < 3 else 1.0)
                    hessian[row + i, column + j] += factor * outputs[6 * count * (6 * b + i) + 6 * c + j]
    return value


@kernel(inner=True)
def body_term(pool, term, q, order, s, gradient, hessian):
    """A term of one body, whose derivatives are added at s: a point distance, a potential or a posture."""
    if term.kind == POINT_DISTANCE:
        return point_distance(pool, term.parameters, q, term.body, s, order, gradient, hessian)
    if term.kind == POTENTIAL:
        return potential(pool, term.parameters, q, term.body, s, order, gradient, hessian)
    return posture(pool, term.parameters, q, term.body, s, order, gradient, hessian)


@kernel(inner=True)
def recenter(store, q):
    """Set the reference of postures that have none of their own to the present poses of their bodies."""
    header = header_at(store.table, 0)
    for t in range(header.terms):
        term = term_at(store.table, header.term_table + TERM * t)
        if term.kind == POSTURE and term.follows == 1:
            reference = posture_at(store.pool, term.parameters)
            for k in range(3):
                reference.position[k] = q[term.body, k]
            for k in range(4):
                reference.quaternion[k] = q[term.body, 3 + k]


@kernel(inner=True)
def objective(store, q, order, workspace, entries, gradient, hessian):
    """Value of the objective. From order 1 on the gradient and the upper triangle of the Hessian are overwritten.

    `entries`, a `Sparsity`, says where the Hessian has entries (`constraints/program/envelope.py`).
    """
    header = header_at(store.table, 0)
    if order > 0:
        for i in range(gradient.size):
            gradient[i] = 0.0
        clear_upper(entries, gradient.size, hessian)
    blocked = order > 0 and is_blocked(entries)
    value = 0.0
    for t in range(header.terms):
        at = header.term_table + TERM * t
        term = term_at(store.table, at)
        if term.kind == POINT_DISTANCE or term.kind == POSTURE or term.kind == POTENTIAL:
            s = 6 * store.table[header.unknown_blocks + term.body]
            if blocked and s >= 0:
                block = block_row(entries.blocks, s, s)
                slopes, curvature = gradient[s : s + 6], hessian[block : block + 6]
                value += body_term(store.pool, term, q, 1, 0, slopes, curvature)
            else:
                value += body_term(store.pool, term, q, order, s, gradient, hessian)
        elif term.kind == TAPE_TERM:
            value += tape_term(store, at, q, order, workspace, entries, gradient, hessian)
    return value
