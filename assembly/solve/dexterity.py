"""Dexterity: what the tip of a mechanism can do with its inputs, as a term of the objective with an exact gradient.

Rows of joints and contacts (drives and limits left out) and of the inputs make A; rates v of all unknowns for unit
rates of the inputs solve A v = e, and J = T v is the Jacobian of the tip, whose velocity T v is. With singular values
s_i of J,

    manipulability      product of s_i: sqrt(det J J^T), or sqrt(det J^T J) of a narrow J (paper 001, eq. 1)
    inverse condition   s_min / s_max
    isotropy            (product of s_i^2)^(1/r) / (mean of s_i^2)
    smallest            s_min
    force               1 / |J^T u|: the force along u that inputs of unit norm hold

For a measure w with W = dw / dJ, and L = A^+T T^T W, one for every input,

    dw = W . (dT v) - sum_i L_i . (dA v_i),

where dA v_i takes the second derivatives of the rows: X_b X_a = H_ab + (gradient of rotation) . (a x b) / 2.
A small multiple of the identity under A leaves motions at rest that move no tip.
"""

from __future__ import annotations

import math

import numpy as np

from assembly._kernel import kernel
from assembly.constraints.primitives import add_coordinate_hessian, coordinate
from assembly.constraints.program import (
    CONTACT_RECORD,
    CONTACTS,
    DRIVE,
    JOINTS,
    MOVING,
    ONE_SIDED,
    ROW,
    ROW_TABLE,
    ROWS,
    TERM_TABLE,
    TERMS,
    add_row_terms,
    evaluate,
)
from assembly.constraints.terms import DEXTERITY, TERM, TERM_BODY, TERM_KIND, TERM_PARAMETERS, TERM_TAPE, load
from assembly.geometry.vec import cross, matvec
from assembly.kinematics.motion import rotation
from assembly.solve.rows import add_row, carry, move, slot

# The record of a term in the table: measure, task, number of inputs; then for each: kind, component, joint, angle,
# bodies f and g.
MEASURE, TASK, INPUTS, INPUT_LIST, INPUT = 0, 1, 2, 3, 6
MANIPULABILITY, INVERSE_CONDITION, ISOTROPY, SMALLEST, FORCE = 0, 1, 2, 3, 4
POSITION, ROTATION, POSE = 0, 1, 2
# Its parameters in the pool: weight, the tip on its body, factors of lengths and of turns, direction (6), then a factor
# for every input.
WEIGHT, ARM, LINEAR, ANGULAR, DIRECTION, FACTORS = 0, 1, 4, 5, 6, 12
# Weight of the identity under A, whose rows are of order one; and what counts as a rate that nothing determines.
REST, UNDETERMINED = 1e-7, 1e-6
# Step of the differences of the gradient that make the Hessian, which only speeds the loop.
STEP = 1e-6
SWEEPS = 30


@kernel(inner=True)
def orthogonalize(b, d, beta):
    """Householder's factorization of b (p, n), p >= n: R above the diagonal and in d, reflectors below, in place."""
    p, n = b.shape
    for c in range(n):
        norm = 0.0
        for r in range(c, p):
            norm += b[r, c] * b[r, c]
        norm = math.sqrt(norm)
        pivot = b[c, c]
        alpha = -norm if pivot > 0.0 else norm
        d[c] = alpha
        b[c, c] = pivot - alpha
        beta[c] = 1.0 / (norm * (norm + abs(pivot))) if norm > 0.0 else 0.0
        for j in range(c + 1, n):
            s = 0.0
            for r in range(c, p):
                s += b[r, c] * b[r, j]
            s *= beta[c]
            for r in range(c, p):
                b[r, j] -= s * b[r, c]


@kernel(inner=True)
def reflect(b, beta, c, x):
    """Reflector c applied to x (p,)."""
    s = 0.0
    for r in range(c, b.shape[0]):
        s += b[r, c] * x[r]
    s *= beta[c]
    for r in range(c, b.shape[0]):
        x[r] -= s * b[r, c]


@kernel(inner=True)
def least_squares(b, d, beta, x):
    """x (p,), a right side, becomes the solution in its first n places."""
    n = b.shape[1]
    for c in range(n):
        reflect(b, beta, c, x)
    for c in range(n - 1, -1, -1):
        s = x[c]
        for j in range(c + 1, n):
            s -= b[c, j] * x[j]
        x[c] = s / d[c]


@kernel(inner=True)
def dual_squares(b, d, beta, x):
    """x (p,), with a right side in its first n places, becomes the shortest y with A^T y equal to it."""
    n = b.shape[1]
    for c in range(n):
        s = x[c]
        for j in range(c):
            s -= b[j, c] * x[j]
        x[c] = s / d[c]
    for r in range(n, b.shape[0]):
        x[r] = 0.0
    for c in range(n - 1, -1, -1):
        reflect(b, beta, c, x)


@kernel(inner=True)
def singular_values(u, v, s):
    """One-sided Jacobi: u (a, b) becomes left vectors, v (b, b) right ones, s (b,) their values, in no order."""
    a, b = u.shape
    for i in range(b):
        for j in range(b):
            v[i, j] = 1.0 if i == j else 0.0
    for _sweep in range(SWEEPS):
        turned = False
        for i in range(b):
            for j in range(i + 1, b):
                p = 0.0
                q = 0.0
                r = 0.0
                for k in range(a):
                    p += u[k, i] * u[k, i]
                    q += u[k, j] * u[k, j]
                    r += u[k, i] * u[k, j]
                if abs(r) <= 1e-15 * math.sqrt(p * q) or r == 0.0:
                    continue
                turned = True
                zeta = (q - p) / (2.0 * r)
                t = (1.0 if zeta >= 0.0 else -1.0) / (abs(zeta) + math.sqrt(1.0 + zeta * zeta))
                c = 1.0 / math.sqrt(1.0 + t * t)
                for k in range(a):
                    x = u[k, i]
                    u[k, i] = c * (x - t * u[k, j])
                    u[k, j] = c * (t * x + u[k, j])
                for k in range(b):
                    x = v[k, i]
                    v[k, i] = c * (x - t * v[k, j])
                    v[k, j] = c * (t * x + v[k, j])
        if not turned:
            break
    for i in range(b):
        norm = 0.0
        for k in range(a):
            norm += u[k, i] * u[k, i]
        s[i] = math.sqrt(norm)
        for k in range(a):
            u[k, i] = u[k, i] / s[i] if s[i] > 0.0 else 0.0


@kernel(inner=True)
def measure_values(measure, s, slope):
    """A measure of singular values s, and its derivatives by them."""
    b = s.size
    low = 0
    high = 0
    for i in range(b):
        slope[i] = 0.0
        low = i if s[i] < s[low] else low
        high = i if s[i] > s[high] else high
    if measure == SMALLEST:
        slope[low] = 1.0
        return s[low]
    if measure == INVERSE_CONDITION:
        if not s[high] > 0.0:
            return 0.0
        value = s[low] / s[high]
        slope[low] += 1.0 / s[high]
        slope[high] -= value / s[high]
        return value
    product = 1.0
    mean = 0.0
    for i in range(b):
        product *= s[i]
        mean += s[i] * s[i] / b
        slope[i] = 1.0
        for j in range(b):
            if j != i:
                slope[i] *= s[j]
    if measure == MANIPULABILITY:
        return product
    value = product ** (2.0 / b) / mean if mean > 0.0 else 0.0
    for i in range(b):
        slope[i] = 2.0 / b * value * ((1.0 / s[i] if s[i] > 0.0 else 0.0) - s[i] / mean) if mean > 0.0 else 0.0
    return value


@kernel(inner=True)
def input_row(table, at, records, tracked, b, r):
    """Row r of b: the gradient of an input's coordinate."""
    angle = table[at + 3]
    near = tracked[angle, 0] if angle >= 0 else 0.0
    k = table[CONTACTS] + table[at + 2]
    _value, n, arm_f, arm_g, h = coordinate(table[at], table[at + 1], records, k, near)
    for side in range(2):
        s = slot(table, table[at + 4 + side])
        if s < 0:
            continue
        sign = -1.0 if side == 0 else 1.0
        turn = cross(arm_f if side == 0 else arm_g, n)
        for i in range(3):
            b[r, s + i] += sign * n[i]
            b[r, s + 3 + i] += sign * (turn[i] + h[i])


@kernel(inner=True)
def task_rows(task):
    return 6 if task == POSE else 3


@kernel(inner=True)
def tip_velocity(pool, o, task, p, v, s, out, column):
    """Column of out: the tip's velocity for rates v; s is the place of its body's twist, p its arm."""
    for i in range(task_rows(task)):
        out[i, column] = 0.0
    if s < 0:
        return
    w = (v[s + 3], v[s + 4], v[s + 5])
    swept = cross(w, p)
    if task != ROTATION:
        for i in range(3):
            out[i, column] = pool[o + LINEAR] * (v[s + i] + swept[i])
    if task != POSITION:
        first = 0 if task == ROTATION else 3
        for i in range(3):
            out[first + i, column] = pool[o + ANGULAR] * w[i]


@kernel(inner=True)
def add_tip_force(pool, o, task, p, w, column, s, out):
    """out += T^T w, with w a column over the task."""
    if s < 0:
        return
    if task != ROTATION:
        f = (pool[o + LINEAR] * w[0, column], pool[o + LINEAR] * w[1, column], pool[o + LINEAR] * w[2, column])
        turn = cross(p, f)
        for i in range(3):
            out[s + i] += f[i]
            out[s + 3 + i] += turn[i]
    if task != POSITION:
        first = 0 if task == ROTATION else 3
        for i in range(3):
            out[s + 3 + i] += pool[o + ANGULAR] * w[first + i, column]


@kernel(inner=True, allocates=True)
def rate_system(table, record, bases, rows, n, point):
    """A with a little identity under it, factorized: (b, d, beta), the rows used, and their number."""
    _q, tracked, records, _residual, jacobian = point
    inputs = table[record + INPUTS]
    used = np.empty(rows, np.int64)
    count = 0
    for r in range(rows):
        row = table[ROW_TABLE] + ROW * r
        if r >= table[ROWS] or (table[row + ONE_SIDED] == 0 and table[row + DRIVE] == 0):
            used[count] = r
            count += 1
    b = np.zeros((count + inputs + n, n))
    for l in range(count):
        add_row(bases, jacobian, used[l], 1.0, b[l])
    for i in range(inputs):
        input_row(table, record + INPUT_LIST + INPUT * i, records, tracked, b, count + i)
    for i in range(n):
        b[count + inputs + i, i] = REST
    d = np.empty(n)
    beta = np.empty(n)
    orthogonalize(b, d, beta)
    return b, d, beta, used, count


@kernel(inner=True, allocates=True)
def tip_rates(table, pool, record, o, body, system, q, rates, jacobian):
    """Rates of all unknowns for unit rates of the inputs, and the tip's Jacobian in the user's units.

    Returns the largest rate that misses what it should be: inputs that depend on each other.
    """
    b, d, beta, _used, count = system
    n = b.shape[1]
    task = table[record + TASK]
    p = matvec(rotation(q, body), load(pool, o + ARM))
    s = slot(table, body)
    x = np.empty(b.shape[0])
    worst = 0.0
    for i in range(table[record + INPUTS]):
        for r in range(x.size):
            x[r] = 0.0
        x[count + i] = 1.0
        for c in range(n):
            reflect(b, beta, c, x)
        for r in range(n, x.size):
            worst = max(worst, abs(x[r]))
        for c in range(n - 1, -1, -1):
            value = x[c]
            for j in range(c + 1, n):
                value -= b[c, j] * rates[i, j]
            rates[i, c] = value / d[c]
        tip_velocity(pool, o, task, p, rates[i], s, jacobian, i)
        for r in range(task_rows(task)):
            jacobian[r, i] *= pool[o + FACTORS + i]
    return worst


@kernel(inner=True, allocates=True)
def tip_slack(table, pool, record, o, body, system, q):
    """The largest part of the tip's motion that neither the rows nor the inputs determine."""
    b, d, beta, _used, _count = system
    p, n = b.shape
    task = table[record + TASK]
    arm = matvec(rotation(q, body), load(pool, o + ARM))
    s = slot(table, body)
    unit = np.zeros((6, 1))
    x = np.empty(p)
    worst = 0.0
    for i in range(task_rows(task)):
        for r in range(n):
            x[r] = 0.0
        unit[i, 0] = 1.0
        add_tip_force(pool, o, task, arm, unit, 0, s, x)
        unit[i, 0] = 0.0
        size = 0.0
        for r in range(n):
            size = max(size, abs(x[r]))
        dual_squares(b, d, beta, x)
        for r in range(p - n, p):
            worst = max(worst, abs(REST * x[r]) / size if size > 0.0 else 0.0)
    return worst


@kernel(inner=True, allocates=True)
def measure_jacobian(table, pool, record, o, jacobian, slopes):
    """A measure of the tip's Jacobian; its derivatives by the entries into `slopes`."""
    m, k = jacobian.shape
    measure = table[record + MEASURE]
    if measure == FORCE:
        square = 0.0
        for i in range(k):
            t = 0.0
            for r in range(m):
                t += pool[o + DIRECTION + r] * jacobian[r, i]
            for r in range(m):
                slopes[r, i] = pool[o + DIRECTION + r] * t
            square += t * t
        value = 1.0 / math.sqrt(square) if square > 0.0 else math.inf
        for r in range(m):
            for i in range(k):
                slopes[r, i] *= -value / square if square > 0.0 else 0.0
        return value
    wide = k > m
    a = k if wide else m
    b = m if wide else k
    u = np.empty((a, b))
    v = np.empty((b, b))
    for i in range(a):
        for j in range(b):
            u[i, j] = jacobian[j, i] if wide else jacobian[i, j]
    s = np.empty(b)
    slope = np.empty(b)
    singular_values(u, v, s)
    value = measure_values(measure, s, slope)
    for r in range(m):
        for i in range(k):
            slopes[r, i] = 0.0
            for l in range(b):
                slopes[r, i] += slope[l] * (v[r, l] * u[i, l] if wide else u[r, l] * v[i, l])
    return value


@kernel(inner=True, allocates=True)
def dexterity(table, pool, term, shape, rows, loose, room, point, order, gradient):
    """Value of the term at a point whose rows are evaluated; from order 1 on its gradient is added."""
    bases = shape[0]
    q = point[0]
    n = gradient.size
    record = table[term + TERM_TAPE]
    o = table[term + TERM_PARAMETERS]
    body = table[term + TERM_BODY]
    inputs = table[record + INPUTS]
    task = table[record + TASK]
    weight = pool[o + WEIGHT]
    system = rate_system(table, record, bases, rows, n, point)
    rates = np.empty((inputs, n))
    jacobian = np.empty((task_rows(task), inputs))
    slopes = np.empty((task_rows(task), inputs))
    worst = tip_rates(table, pool, record, o, body, system, q, rates, jacobian)
    value = measure_jacobian(table, pool, record, o, jacobian, slopes)
    if not worst <= UNDETERMINED or not math.isfinite(value):
        return math.inf
    if order == 0:
        return weight * value
    b, d, beta, used, count = system
    s = slot(table, body)
    p = matvec(rotation(q, body), load(pool, o + ARM))
    x = np.empty(b.shape[0])
    y = np.empty(rows)
    none = np.zeros(rows)
    hessian = np.empty((n, n))
    push = np.empty(n)
    for i in range(inputs):
        factor = weight * pool[o + FACTORS + i]
        for r in range(n):
            x[r] = 0.0
            push[r] = 0.0
            for c in range(r, n):
                hessian[r, c] = 0.0
        for r in range(slopes.shape[0]):
            slopes[r, i] *= factor
        add_tip_force(pool, o, task, p, slopes, i, s, x)
        dual_squares(b, d, beta, x)
        for r in range(n):
            if not abs(REST * x[count + inputs + r]) <= UNDETERMINED * abs(factor):
                return math.inf
        for r in range(rows):
            y[r] = 0.0
        for l in range(count):
            y[used[l]] = x[l]
            add_row(bases, point[4], used[l], x[l], push)
        add_row_terms(table, pool, loose, room, bases, point, y, none, hessian)
        for j in range(inputs):
            at = record + INPUT_LIST + INPUT * j
            add_coordinate_hessian(
                table[at],
                table[at + 1],
                point[2],
                table[CONTACTS] + table[at + 2],
                x[count + j],
                hessian,
                slot(table, table[at + 4]),
                slot(table, table[at + 5]),
            )
            add_input_push(table, at, point, x[count + j], push)
        v = rates[i]
        for r in range(n):
            total = 0.0
            for c in range(n):
                total += (hessian[r, c] if c >= r else hessian[c, r]) * v[c]
            gradient[r] -= total
        for body_slot in range(table[MOVING]):
            w = 6 * body_slot + 3
            turn = cross((push[w], push[w + 1], push[w + 2]), (v[w], v[w + 1], v[w + 2]))
            for k in range(3):
                gradient[w + k] -= 0.5 * turn[k]
        if s >= 0 and task != ROTATION:
            linear = pool[o + LINEAR]
            force = (linear * slopes[0, i], linear * slopes[1, i], linear * slopes[2, i])
            turn = cross(p, cross(force, (v[s + 3], v[s + 4], v[s + 5])))
            for k in range(3):
                gradient[s + 3 + k] += turn[k]
    return weight * value


@kernel(inner=True)
def add_input_push(table, at, point, factor, push):
    """push += factor times the gradient of an input's coordinate."""
    angle = table[at + 3]
    near = point[1][angle, 0] if angle >= 0 else 0.0
    k = table[CONTACTS] + table[at + 2]
    _value, n, arm_f, arm_g, h = coordinate(table[at], table[at + 1], point[2], k, near)
    for side in range(2):
        s = slot(table, table[at + 4 + side])
        if s < 0:
            continue
        sign = -factor if side == 0 else factor
        turn = cross(arm_f if side == 0 else arm_g, n)
        for i in range(3):
            push[s + i] += sign * n[i]
            push[s + 3 + i] += sign * (turn[i] + h[i])


@kernel(inner=True, allocates=True)
def add_dexterities(table, pool, shape, rows, loose, room, here, order, gradient, hessian):
    """Values of all terms of this kind; from order 1 on gradients, and Hessians by differences of these."""
    value = 0.0
    n = gradient.size
    for t in range(table[TERMS]):
        term = table[TERM_TABLE] + TERM * t
        if table[term + TERM_KIND] != DEXTERITY:
            continue
        slope = np.zeros(n)
        value += dexterity(table, pool, term, shape, rows, loose, room, here, order, slope)
        if order == 0 or not math.isfinite(value):
            continue
        for i in range(n):
            gradient[i] += slope[i]
        beside = (
            here[0].copy(),
            here[1].copy(),
            np.empty((table[CONTACTS] + table[JOINTS], CONTACT_RECORD)),
            np.empty(here[3].size),
            np.empty(here[4].shape),
        )
        step = np.zeros(n)
        other = np.empty(n)
        for j in range(n):
            for i in range(n):
                other[i] = 0.0
            step[j] = STEP
            move(table, here[0], step, 1.0, beside[0])
            carry(table, pool, shape[0], loose[0], loose[1], here[1], here[2], step, 1.0, loose[4])
            step[j] = 0.0
            if evaluate(table, pool, loose[4], math.inf, loose, room, beside) >= 0:
                continue
            if math.isfinite(dexterity(table, pool, term, shape, rows, loose, room, beside, 1, other)):
                for i in range(n):
                    bend = 0.5 * (other[i] - slope[i]) / STEP
                    hessian[min(i, j), max(i, j)] += 2.0 * bend if i == j else bend
    return value
