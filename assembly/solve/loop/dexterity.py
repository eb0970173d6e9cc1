"""Dexterity: what an end effector can do with its inputs, as a term of the objective with an exact gradient.

Rows A hold the mechanism: those of joints and contacts, without drives and limits (see `Dexterity`). Rows B are those
of the inputs. The rates V of all unknowns, one column per input, satisfy B V = 1 and change rows A as little as
possible (`solve/loop/rates.py`). J = T V is the Jacobian of the end effector, whose velocity is T v, w is a measure of
J (`solve/linear_algebra/singular_values.py`), and W = dw / dJ. With

    A^T A V + B^T Z = 0,   B V = 1,   A^T A P + B^T Y = T^T,   B P = 0,

where J = Y^T as well, p = P w_i and y = Y w_i for column i of W,

    dw = sum_i  w_i . (dT v_i) - (A p) . (dA v_i) - y . (dB v_i) - (A v_i) . (dA p) - z_i . (dB p).

The last two vanish where the rows hold. dA v takes the second derivatives H of the rows along twists, as
X_b X_a = H_ab + (gradient of rotation) . (a x b) / 2; of the second part only T^T w_i is left in the sum.
"""

from __future__ import annotations

import math
from collections import namedtuple

import numpy as np

from assembly._kernel import kernel
from assembly._record import place_of, record_dtype, record_view, size_of
from assembly.constraints.program.coordinate_hessian import add_coordinate_hessian
from assembly.constraints.program.evaluate import evaluate
from assembly.constraints.program.objective_terms import DEXTERITY, TERM, term_at, three_at
from assembly.constraints.program.primitives import coordinate
from assembly.constraints.program.records import BODY_COORDINATE, Iterate, body_coordinate_at, header_at
from assembly.constraints.program.row_terms import add_row_terms
from assembly.geometry.vec import add, cross, matvec
from assembly.kinematics.motion import rotation
from assembly.solve.linear_algebra.singular_values import measure_jacobian
from assembly.solve.loop.parameters import DIFFERENCE, KEPT, UNDETERMINED
from assembly.solve.loop.predict import predict_pairs
from assembly.solve.loop.rates import rate_system, solve_rates
from assembly.solve.loop.residuals import first_unknown, move, times

# A term in the table, followed by one `BODY_COORDINATE` per input.
DEXTERITY_TERM = record_dtype(
    "i8",
    measure=1,  # `singular_values.py`
    axes=1,  # which velocities count: bits, three of the linear one and then three of the angular one
    inputs=1,  # how many
    held=1,  # where the list of the rows that hold the mechanism begins
    held_rows=1,  # how many there are
)
dexterity_at = record_view(DEXTERITY_TERM)
INPUT_LIST, INPUT = size_of(DEXTERITY_TERM), size_of(BODY_COORDINATE)
VELOCITIES = 6
# The term's parameters in the pool, followed by the unit factor of every input.
DEXTERITY_WEIGHTS = record_dtype(
    "f8",
    weight=1,  # of the term
    arm=3,  # the end effector, in the axes of its body
    linear=1,  # factor of velocities
    angular=1,  # factor of angular velocities
    direction=6,  # along which some measures are taken
)
dexterity_weights_at = record_view(DEXTERITY_WEIGHTS)
ARM = place_of(DEXTERITY_WEIGHTS, "arm")
DIRECTION = place_of(DEXTERITY_WEIGHTS, "direction")
FACTORS = size_of(DEXTERITY_WEIGHTS)
# Outcomes of `end_effector_map`.
DETERMINED, DEPENDENT, OPEN = 0, 1, 2
# The outcome, the end effector's Jacobian, the rows that hold the mechanism, rates of inputs and what the end effector
# needs (vectors in rows): the heading's V, Z and A V; P, Y and A P.
EndEffectorMap = namedtuple("EndEffectorMap", "outcome jacobian used inputs adjoint")
InputRates = namedtuple("InputRates", "v z changes")
Adjoint = namedtuple("Adjoint", "p y loads")
# The end effector of a term: the axes that count, the arm from its body's origin, where that body's twist stands among
# the unknowns (negative: fixed), factors of velocities and angular velocities.
EndEffector = namedtuple("EndEffector", "axes arm place linear angular")


@kernel(inner=True)
def input_row(table, at, records, tracked, b, r):
    """Row r of b: the gradient of an input's coordinate."""
    asked = body_coordinate_at(table, at)
    near = tracked[asked.angle, 0] if asked.angle >= 0 else 0.0
    found = coordinate(asked.kind, asked.component, records, header_at(table, 0).contacts + asked.joint, near)
    n, h = found.n, found.h
    for side in range(2):
        s = first_unknown(table, asked.body_f if side == 0 else asked.body_g)
        if s < 0:
            continue
        sign = -1.0 if side == 0 else 1.0
        turn = cross(found.arm_f if side == 0 else found.arm_g, n)
        for i in range(3):
            b[r, s + i] += sign * n[i]
            b[r, s + 3 + i] += sign * (turn[i] + h[i])


@kernel(inner=True)
def task_rows(axes):
    """How many velocities count."""
    count = 0
    for i in range(VELOCITIES):
        count += (axes >> i) & 1
    return count


@kernel(inner=True)
def end_effector(store, term, q):
    """The end effector of a term at poses."""
    weights = dexterity_weights_at(store.pool, term.parameters)
    arm = matvec(rotation(q, term.body), three_at(store.pool, term.parameters + ARM))
    axes = dexterity_at(store.table, term.tape).axes
    return EndEffector(axes, arm, first_unknown(store.table, term.body), weights.linear, weights.angular)


@kernel(inner=True)
def end_effector_velocity(effector, v, out, column):
    """Column of out: the end effector's velocity for rates v."""
    s, r = effector.place, 0
    w = (0.0, 0.0, 0.0)
    if s >= 0:
        w = (v[s + 3], v[s + 4], v[s + 5])
    swept = cross(w, effector.arm)
    for i in range(VELOCITIES):
        if (effector.axes >> i) & 1 == 0:
            continue
        out[r, column] = 0.0
        if s >= 0 and i < 3:
            out[r, column] = effector.linear * (v[s + i] + swept[i])
        elif s >= 0:
            out[r, column] = effector.angular * w[i - 3]
        r += 1


@kernel(inner=True)
def force_along(effector, w, column, i):
    """Component i of T^T w, of the force or the moment on the end effector; w has one row per velocity that counts."""
    if (effector.axes >> i) & 1 == 0:
        return 0.0
    return (effector.linear if i < 3 else effector.angular) * w[task_rows(effector.axes & ((1 << i) - 1)), column]


@kernel(inner=True)
def force_and_moment(effector, w, column):
    """Force and moment of T^T w on the end effector itself, with w a column over the velocities that count."""
    force = (
        force_along(effector, w, column, 0),
        force_along(effector, w, column, 1),
        force_along(effector, w, column, 2),
    )
    moment = (
        force_along(effector, w, column, 3),
        force_along(effector, w, column, 4),
        force_along(effector, w, column, 5),
    )
    return force, moment


@kernel(inner=True)
def add_end_effector_force(effector, w, column, out):
    """out += T^T w, with w a column over the velocities that count."""
    s = effector.place
    if s < 0:
        return
    f, moment = force_and_moment(effector, w, column)
    turn = cross(effector.arm, f)
    for i in range(3):
        out[s + i] += f[i]
        out[s + 3 + i] += turn[i] + moment[i]


@kernel(inner=True)
def add_end_effector_bend(effector, w, column, v, gradient):
    """gradient += w . (dT v), less half of what turns do not commute by."""
    s, p = effector.place, effector.arm
    if s < 0:
        return
    f, moment = force_and_moment(effector, w, column)
    spin = (v[s + 3], v[s + 4], v[s + 5])
    bent = cross(p, cross(f, spin))
    turn = cross(add(moment, cross(p, f)), spin)
    for k in range(3):
        gradient[s + 3 + k] += bent[k] - 0.5 * turn[k]


@kernel(inner=True, allocates=True)
def used_rows(table, record, rows):
    """The rows that hold the mechanism together: those of a term's list, and those of lifted pairs."""
    header, term = header_at(table, 0), dexterity_at(table, record)
    lifted = max(rows - header.rows, 0)
    used = np.empty(term.held_rows + lifted, np.int64)
    for i in range(term.held_rows):
        used[i] = table[term.held + i]
    for i in range(lifted):
        used[term.held_rows + i] = header.rows + i
    return used


@kernel(inner=True, allocates=True)
def row_rates(bases, jacobian, used, v):
    """A v for every row of v."""
    out = np.empty((v.shape[0], used.size))
    for i in range(v.shape[0]):
        for l in range(used.size):
            out[i, l] = times(bases, jacobian, used[l], v[i])
    return out


@kernel(inner=True)
def largest_value(values):
    """The largest absolute value; infinite if a value is NaN."""
    worst = 0.0
    for value in values.flat:
        if not abs(value) <= worst:
            worst = abs(value) if abs(value) > worst else math.inf
    return worst


@kernel(inner=True, allocates=True)
def end_effector_map(store, term, bases, rows, n, point, order):
    """The end effector's Jacobian in the user's units, at a point whose rows are evaluated.

    The adjoint solutions P and Y, and with them whether the motion is OPEN, are computed from order 1 on.
    """
    term_record = term_at(store.table, term)
    residual = point.residual
    record = term_record.tape
    factors = term_record.parameters + FACTORS
    effector = end_effector(store, term_record, point.q)
    k, m = dexterity_at(store.table, record).inputs, task_rows(effector.axes)
    used = used_rows(store.table, record, rows)
    b = np.zeros((k, n))
    for i in range(k):
        input_row(store.table, record + INPUT_LIST + INPUT * i, point.records, point.tracked, b, i)
    jacobian = np.zeros((m, k))
    v = np.zeros((k, n))
    z = np.zeros((k, k))
    p = np.zeros((m, n))
    y = np.zeros((m, k))
    changes = np.zeros((k, used.size))
    exists, system = rate_system(bases, point.jacobian, used, b)
    outcome = DETERMINED if exists else DEPENDENT
    if exists:
        # Where rows do not hold, redundant ones contradict each other and idle motions move the end effector a
        # little: singular values are off by up to the square root of the residuals.
        leeway = UNDETERMINED
        for l in range(used.size):
            leeway = max(leeway, 10.0 * math.sqrt(abs(residual[used[l]])))
        g = np.zeros(n)
        h = np.zeros(k)
        missed = 0.0
        for i in range(k):
            h[i] = 1.0
            missed = max(missed, solve_rates(system, g, h, v[i], z[i]))
            h[i] = 0.0
            end_effector_velocity(effector, v[i], jacobian, i)
            for r in range(m):
                jacobian[r, i] *= store.pool[factors + i]
        unit = np.zeros((m, 1))
        for r in range(m if order > 0 else 0):
            for i in range(n):
                g[i] = 0.0
            unit[r, 0] = 1.0
            add_end_effector_force(effector, unit, 0, g)
            unit[r, 0] = 0.0
            left = solve_rates(system, g, h, p[r], y[r])
            if not left <= leeway * largest_value(g):
                outcome = OPEN
        changes = row_rates(bases, point.jacobian, used, v)
        if not max(missed, largest_value(changes)) <= leeway:
            outcome = DEPENDENT
    loads = row_rates(bases, point.jacobian, used, p)
    return EndEffectorMap(outcome, jacobian, used, InputRates(v, z, changes), Adjoint(p, y, loads))


@kernel(inner=True, allocates=True)
def bend(program, record, point, forces, inputs, rates, hessian, gradient):
    """gradient -= H v, H the second derivative of forces . rows + inputs . (values of the inputs)."""
    table = program.store.table
    n = rates.size
    for r in range(n):
        for c in range(r, n):
            hessian[r, c] = 0.0
    add_row_terms(program, point, forces, np.zeros(forces.size), hessian)
    for j in range(inputs.size):
        asked = body_coordinate_at(table, record + INPUT_LIST + INPUT * j)
        add_coordinate_hessian(
            asked.kind,
            asked.component,
            point.records,
            header_at(table, 0).contacts + asked.joint,
            inputs[j],
            hessian,
            first_unknown(table, asked.body_f),
            first_unknown(table, asked.body_g),
        )
    for r in range(n):
        for c in range(r, n):
            gradient[r] -= hessian[r, c] * rates[c]
            if c > r:
                gradient[c] -= hessian[r, c] * rates[r]


@kernel(inner=True, allocates=True)
def dexterity(program, term, count, point, order, gradient):
    """Value of the term at a point whose rows are evaluated; from order 1 on its gradient is added."""
    store, n = program.store, gradient.size
    term_record = term_at(store.table, term)
    record, o = term_record.tape, term_record.parameters
    factors, weight = o + FACTORS, dexterity_weights_at(store.pool, o).weight
    found = end_effector_map(store, term, program.structure.bases, count, n, point, order)
    jacobian, used = found.jacobian, found.used
    v, z, changes = found.inputs
    p, y, loads = found.adjoint
    if found.outcome != DETERMINED:
        return math.inf
    slopes = np.empty(jacobian.shape)
    value = measure_jacobian(dexterity_at(store.table, record).measure, store.pool, o + DIRECTION, jacobian, slopes)
    if not math.isfinite(value):
        return math.inf
    if order == 0:
        return weight * value
    effector = end_effector(store, term_record, point.q)
    m, k = jacobian.shape
    # Workspace for one combination at a time: p, y, A p as forces on all rows.
    pull = np.empty(n)
    turn = np.empty(k)
    forces = np.zeros(count)
    hessian = np.empty((n, n))
    for i in range(k):
        for c in range(n):
            pull[c] = 0.0
        for j in range(k):
            turn[j] = 0.0
        for l in range(used.size):
            forces[used[l]] = 0.0
        for r in range(m):
            w = slopes[r, i] * weight * store.pool[factors + i]
            slopes[r, i] = w
            for c in range(n):
                pull[c] += w * p[r, c]
            for j in range(k):
                turn[j] += w * y[r, j]
            for l in range(used.size):
                forces[used[l]] += w * loads[r, l]
        bend(program, record, point, forces, turn, v[i], hessian, gradient)
        if largest_value(changes[i]) > KEPT:
            for l in range(used.size):
                forces[used[l]] = changes[i, l]
            bend(program, record, point, forces, z[i], pull, hessian, gradient)
        add_end_effector_bend(effector, slopes, i, v[i], gradient)
    return weight * value


@kernel(inner=True, allocates=True)
def add_dexterities(program, count, current, order, gradient, hessian):
    """Values of all terms of this kind; from order 1 on gradients, and Hessians by differences of these."""
    store = program.store
    header = header_at(store.table, 0)
    value = 0.0
    n = gradient.size
    for t in range(header.terms):
        term = header.term_table + TERM * t
        if term_at(store.table, term).kind != DEXTERITY:
            continue
        slope = np.zeros(n)
        value += dexterity(program, term, count, current, order, slope)
        if order == 0 or not math.isfinite(value):
            continue
        for i in range(n):
            gradient[i] += slope[i]
        beside = Iterate(
            current.q.copy(),
            current.tracked.copy(),
            np.empty(current.records.shape),
            np.empty(current.residual.size),
            np.empty(current.jacobian.shape),
        )
        step = np.zeros(n)
        other = np.empty(n)
        for j in range(n):
            for i in range(n):
                other[i] = 0.0
            step[j] = DIFFERENCE
            move(store.table, current.q, step, 1.0, beside.q)
            predict_pairs(store, program.structure.bases, program.lifted, current, beside, step, 1.0)
            step[j] = 0.0
            if evaluate(program, program.lifted.guess, math.inf, beside) >= 0:
                continue
            if math.isfinite(dexterity(program, term, count, beside, 1, other)):
                for i in range(n):
                    bend = 0.5 * (other[i] - slope[i]) / DIFFERENCE
                    hessian[min(i, j), max(i, j)] += 2.0 * bend if i == j else bend
    return value
