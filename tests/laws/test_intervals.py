"""Intervals hold what they say: every operation of a tape, random expressions, and bounds of formula curves."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import assembly as asm
from assembly._record import Store
from assembly.geometry import interval
from assembly.geometry.expression import formula, tape
from assembly.geometry.expression.instructions import compact, packed
from assembly.geometry.expression.tape_bounds import JUMP, KINK, SMOOTH, bound_outputs

CASADI = {name: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
MOVES = ("INPUT", "OUTPUT", "CONST", "ASSIGN", "LIFT")
ELEMENTARY = [name for name in tape.OPERATIONS if name not in MOVES]
KINKED = {"FABS", "SIGN", "COPYSIGN", "FMIN", "FMAX", "LT", "LE", "EQ", "NE", "NOT", "AND", "OR", "IF_ELSE_ZERO"}
KINKED |= {"FLOOR", "CEIL", "FMOD", "REMAINDER", "ATAN2"}
# Exponents that make even, odd and negative powers, among others.
ENDS = [-3.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 2.5, -1e-3, 1e-3]


def elementary(name, a, b):
    """Bounds of one operation over two intervals, and what it tells."""
    code = tape.OPERATIONS.index(name)
    instructions = [[tape.INPUT, 0, 0, 0], [tape.INPUT, 1, 1, 0], [code, 2, 0, 1], [tape.OUTPUT, 0, 2, 0]]
    y = np.full(2, 0.123)
    table = np.ravel([4, 0, 3, *np.ravel(instructions)])
    told = bound_outputs(table, np.zeros(0), 0, np.array([*a, *b]), np.zeros(6), y)
    return y, told


def intervals(rng, count):
    """Pairs of intervals of all widths, some with ends at special places, some one point."""
    for k in range(count):
        pair = []
        for _ in range(2):
            middle = rng.choice(ENDS) if k % 3 == 0 else rng.normal() * 10.0 ** rng.uniform(-3, 2)
            width = 0.0 if k % 7 == 0 else 10.0 ** rng.uniform(-9, 1)
            side = rng.integers(3)
            pair.append((middle - width * (side != 1), middle + width * (side != 0)))
        yield pair


@pytest.mark.parametrize("name", ELEMENTARY)
def test_every_operation_is_enclosed(name, cases):
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    function = ca.Function("f", [u, v], [ca.SX.binary(CASADI[f"OP_{name}"], u, v)])
    rng = np.random.default_rng(tape.OPERATIONS.index(name))
    told_of_none = 0
    for a, b in intervals(rng, cases(50, 150)):
        (lo, hi), told = elementary(name, a, b)
        assert not (math.isnan(lo) or math.isnan(hi)) and lo <= hi
        x, y = rng.uniform(*a, 60), rng.uniform(*b, 60)
        x[:2], y[:2] = a, b
        if name in ("EQ", "NE"):
            x[2:4] = y[2:4] = np.clip(x[2:4], *b)
            if not (a[0] <= x[2] <= a[1]):
                x[2:4] = a
        values = np.array(function.map(60)(x[None], y[None])).ravel()
        values = values[np.isfinite(values)]
        # Each side of an operation rounds; what it rounds to is inside too.
        assert (values >= lo).all() and (values <= hi).all(), (a, b)
        told_of_none += told != SMOOTH
    assert (told_of_none > 0) == (name in KINKED)


def test_what_no_bound_is_known_of_is_the_line():
    for name, a in (("SQRT", (-2.0, -1.0)), ("LOG", (-2.0, -1.0)), ("INV", (-1.0, 1.0)), ("TAN", (1.0, 2.0))):
        assert elementary(name, a, a)[0].tolist() == [-math.inf, math.inf]
    assert elementary("LOG", (0.0, 1.0), (0.0, 0.0))[0][0] == -math.inf
    assert elementary("MUL", (0.0, 0.0), (-math.inf, math.inf))[0].tolist() == [-math.inf, math.inf]


def test_rounding_is_outward():
    third, tenth = elementary("DIV", (1.0, 1.0), (3.0, 3.0))[0], elementary("MUL", (0.1, 0.1), (3.0, 3.0))[0]
    assert third[0] < 1.0 / 3.0 < third[1] and tenth[0] < 0.1 * 3.0 < tenth[1]
    # No wider than a few units.
    assert third[1] - third[0] < 4 * interval.EPSILON


T = ca.SX.sym("t")
LEAVES = st.one_of(st.just(T), st.floats(-3, 3).map(ca.SX))
UNARY = [ca.sin, ca.cos, ca.exp, ca.atan, ca.tanh, ca.erf, ca.fabs, lambda x: x**2, lambda x: x**3, lambda x: -x]
UNARY += [lambda x: ca.sqrt(1 + x * x), lambda x: 1 / (2 + ca.sin(x)), lambda x: ca.log(1 + x * x), ca.asinh]
BINARY = [lambda x, y: x + y, lambda x, y: x - y, lambda x, y: x * y, ca.fmin, ca.fmax, ca.hypot]
EXPRESSIONS = st.recursive(
    LEAVES,
    lambda inner: st.one_of(
        st.tuples(st.sampled_from(UNARY), inner).map(lambda c: c[0](c[1])),
        st.tuples(st.sampled_from(BINARY), inner, inner).map(lambda c: c[0](c[1], c[2])),
    ),
    max_leaves=8,
)


@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(EXPRESSIONS, st.floats(-3, 3), st.floats(1e-9, 2))
def test_random_expressions_are_enclosed(expression, start, width):
    values = ca.vertcat(expression, ca.jacobian(expression, T))
    function = compact("f", T, values)
    packed_function = packed(function)
    y = np.zeros(4)
    work = np.zeros(2 * packed_function.table[tape.WORK])
    x = np.array([start, start + width])
    told = bound_outputs(packed_function.table, packed_function.constants, 0, x, work, y)
    samples = np.clip(np.linspace(*x, 101), *x)
    found = np.array(function.map(101)(samples[None]))
    for row, (lo, hi) in zip(found, y.reshape(2, 2), strict=True):
        row = row[np.isfinite(row)]
        assert (row >= lo).all() and (row <= hi).all()
    assert told in (SMOOTH, KINK, JUMP)


CURVES = [
    asm.curves.heart(0.1, angle=20.0, center=(1.0, -2.0)),
    asm.curves.ranunculoid(0.2),
    asm.curves.ellipse((2.0, 0.3), angle=40.0),
    asm.curves.involute(0.4),
    asm.curves.fish(1.3, angle=10.0),
    asm.curves.lissajous((1.0, 0.5), (3, 4), 20.0),
    asm.curves.helix(0.5, 0.3, 2.0, center=(1e3, 0.0, 0.0)),
    asm.curves.euler_spiral(0.7, angle=100.0),
]
# Third derivatives have no public method: CasADi's own, of two more formulas.
FORMULAS = [
    ((-1.0, 2.0), ca.vertcat(T**3 - T, ca.exp(T / 2))),
    ((0.1, 3.0), ca.vertcat(ca.log(T), ca.sqrt(T), T ** ca.SX(1.5))),
]
CURVES += [asm.FormulaCurve(x, T, domain) for domain, x in FORMULAS]


def pieces(curve, rng, count, least=1e-8):
    """Random intervals of the domain, down to tiny ones."""
    low, high = curve.domain
    width = (high - low) * np.minimum(10.0 ** rng.uniform(math.log10(least), 0.1, count), 1.0)
    first = low + rng.uniform(0, 1, count) * (high - low - width)
    return first, np.minimum(first + width, high)


@pytest.mark.parametrize("curve", CURVES, ids=repr)
def test_boxes_of_curves(curve, cases):
    t0, t1 = pieces(curve, np.random.default_rng(3), cases(100, 300))
    boxes = curve.bounds(t0, t1)
    slow, fast = curve.speed(t0, t1)
    for k in range(len(t0)):
        values = curve.evaluate(np.clip(np.linspace(t0[k], t1[k], 50), t0[k], t1[k]), 2)
        speed = np.linalg.norm(values[1], axis=1)
        assert slow[k] <= speed.min() * (1 + 1e-15) and speed.max() <= fast[k] * (1 + 1e-15)
        for order, value in enumerate(values):
            assert (value >= boxes[k, order, 0]).all() and (value <= boxes[k, order, 1]).all()


@pytest.mark.parametrize("k", range(len(FORMULAS)))
def test_boxes_of_third_derivatives(k, cases):
    domain, expression = FORMULAS[k]
    curve = asm.FormulaCurve(expression, T, domain)
    third = expression
    for _ in range(3):
        third = ca.jacobian(third, T)
    function = ca.Function("f", [T], [third])
    t0, t1 = pieces(curve, np.random.default_rng(4), cases(70, 200))
    boxes = curve.bounds(t0, t1)[:, 3]
    for i in range(len(t0)):
        values = np.array(function.map(40)(np.clip(np.linspace(t0[i], t1[i], 40), t0[i], t1[i])[None])).T
        assert (values >= boxes[i, 0]).all() and (values <= boxes[i, 1]).all()


def test_boxes_shrink_with_the_square_of_the_interval():
    curve = CURVES[0]
    excess = []
    for width in (1e-2, 1e-3, 1e-4):
        box = curve.bounds(1.0, 1.0 + width)[0]
        values = curve.evaluate(np.linspace(1.0, 1.0 + width, 1001))
        excess.append(((box[1] - box[0]) - np.ptp(values, axis=0)).max())
    assert excess[1] < 0.03 * excess[0] and excess[2] < 0.03 * excess[1]


@pytest.mark.parametrize("curve", CURVES, ids=repr)
def test_arc_length_bounds(curve, cases):
    t0, t1 = pieces(curve, np.random.default_rng(5), cases(100, 300))
    nodes, weights = np.polynomial.legendre.leggauss(24)
    bound = curve.arc_length_bound(t0, t1)
    own = curve.arc_lengths(t0, t1)
    for k in range(len(t0)):
        # By sub-intervals, so that the sum is within a few roundings; a chord is shorter than the arc in any case.
        ends = np.linspace(t0[k], t1[k], 21)
        half = 0.5 * np.diff(ends)[:, None]
        at = np.clip(ends[:-1, None] + half * (1 + nodes), *curve.domain)
        speed = np.linalg.norm(curve.evaluate(at, 1)[1], axis=2)
        length = float((half * speed * weights).sum())
        assert bound[k] >= length * (1 - 1e-12)
        assert own[k] >= length * (1 - 1e-12)
        assert bound[k] <= fast_bound(curve, t0[k], t1[k]) * (1 + 1e-12)


def fast_bound(curve, t0, t1):
    return (t1 - t0) * curve.speed(t0, t1)[1]


def test_short_arcs_are_never_undercut():
    # The printed antiderivative cancels: computed as it stands, it undercuts the chord of short arcs.
    curve = asm.curves.heart()
    t0 = np.random.default_rng(6).uniform(0.1, 6.0, 200)
    t1 = t0 + 1e-6
    own = curve.arc_lengths(t0, t1)
    chord = np.linalg.norm(curve.evaluate(t1) - curve.evaluate(t0), axis=1)
    assert (own >= chord - 1e-14 * curve.size).all()
    assert (own < 1.1 * curve.arc_length_bound(t0, t1) + 1e-6).all()


# As in table I of paper 003, and what else is bounded once over the domain: antiderivatives of |C'|^2.
SQUARES = {
    "ellipse": (lambda s, f: 2.5 * s - 0.75 * f.sin(2 * s), (0.0, 6.0)),
    "cubic": (lambda s, f: s * (2 + s * s * (2 + 1.8 * (s * s))), (-1.0, 2.0)),
    "hyperbola": (lambda s, f: s - 1 / (3 * (s + 1) * (s + 1) * (s + 1)), (0.0, 3.0)),
    "growing": (lambda s, f: f.exp(s) / (1 + 0.1 * f.cos(s) * f.cos(s)) - f.sqrt(s + 2), (0.0, 3.0)),
}


@pytest.mark.parametrize("name", SQUARES)
def test_plain_doubles_never_undercut_a_closed_form(name):
    antiderivative, domain = SQUARES[name]
    curve = asm.FormulaCurve(
        ca.vertcat(T, T),
        T,
        domain,
        lambda t0, t1: ca.sqrt((t1 - t0) * (antiderivative(t1, ca) - antiderivative(t0, ca))),
    )
    assert formula.formula_at(curve.packed()[0], 0).arc_plain
    rng = np.random.default_rng(7)
    t0 = rng.uniform(*domain, 100_000)
    # Short ones too: there the difference of the antiderivatives is nothing but rounding.
    t1 = np.minimum(t0 + (domain[1] - domain[0]) * 10.0 ** rng.uniform(-17.0, 0.0, t0.size), domain[1])
    first, last = t0.astype(np.longdouble), t1.astype(np.longdouble)
    exact = np.sqrt((last - first) * (antiderivative(last, np) - antiderivative(first, np)).clip(0.0))
    found = curve.arc_lengths(t0, t1)
    # Long doubles are themselves off by 2^-64 of the antiderivatives.
    slack = np.sqrt((last - first) * np.abs(antiderivative(last, np)) * np.longdouble(2.0) ** -60)
    assert (found >= exact - slack).all()
    long = last - first > 1e-3
    assert (found[long] <= (1 + 1e-9) * exact[long]).all()


@pytest.mark.parametrize("count", [1, 63, 64, 65, 200])
def test_many_arcs_as_one_by_one(count):
    curve = asm.curves.heart()
    t0, t1 = np.sort(np.random.default_rng(count).uniform(0.0, 6.0, (2, count)), axis=0)
    table, pool = curve.packed()
    workspace = np.zeros(int(table[formula.WORKSPACE]))
    one = [formula.arc_bound(Store(table, pool), *ends, workspace) for ends in zip(t0, t1, strict=True)]
    assert curve.arc_lengths(t0, t1) == pytest.approx(one, rel=1e-10)


def test_what_has_no_bound_of_rounding_is_computed_on_intervals():
    curve = asm.FormulaCurve(ca.vertcat(T, T), T, (0.0, 1.0), lambda t0, t1: 2.0 * ca.tanh(t1 - t0))
    assert not formula.formula_at(curve.packed()[0], 0).arc_plain
    assert 2.0 * np.tanh(0.25) <= curve.arc_lengths(np.array([0.5]), np.array([0.75]))[0] < 2.0 * np.tanh(0.25) + 1e-14


def test_kinks_leave_no_second_derivative():
    curve = asm.FormulaCurve(ca.vertcat(T, ca.fabs(T)), T, (-1.0, 1.0))
    over = curve.bounds(-0.1, 0.1)
    assert np.isinf(over[2]).all() and over[1, :, 1].tolist() == pytest.approx([-1.0, 1.0])
    beside = curve.bounds(0.1, 0.2)
    assert np.abs(beside[2]).max() < 1e-12


PARTIAL = [ca.acos, ca.asin, ca.sqrt, ca.log, ca.acosh, ca.atanh, lambda x: x**1.5, lambda x: 1 / x, ca.floor, ca.ceil]
CHOICES = [ca.fmin, ca.fmax, lambda x, y: ca.if_else(x < y, x, 2 * y), lambda x, y: (x <= y) + y, ca.hypot]
CHOICES += [lambda x, y: ca.logic_and(x, y) - x, lambda x, y: ca.logic_or(x, ca.logic_not(y)), lambda x, y: x * y]


@pytest.mark.parametrize("seed", range(4))
def test_what_is_made_of_no_value_is_enclosed(seed, cases):
    """fmin(x, NaN) is x, and no comparison with NaN holds: bounds know where a part of a formula may be none."""
    rng = np.random.default_rng(seed)
    looked = 0
    for _ in range(cases(50, 150)):
        inner = [PARTIAL[rng.integers(len(PARTIAL))](rng.normal() + rng.normal() * T) for _ in range(2)]
        first = CHOICES[rng.integers(len(CHOICES))](inner[0], rng.normal() + T)
        expression = CHOICES[rng.integers(len(CHOICES))](first, PARTIAL[rng.integers(len(PARTIAL))](inner[1] + T))
        function = compact("f", T, expression)
        found = packed(function)
        for width in 10.0 ** rng.uniform(-6, 1, 4):
            start = 2.0 * rng.normal()
            y, work = np.zeros(2), np.zeros(2 * found.table[tape.WORK])
            bound_outputs(found.table, found.constants, 0, np.array([start, start + width]), work, y)
            values = np.array(function.map(50)(np.linspace(start, start + width, 50)[None])).ravel()
            values = values[~np.isnan(values)]
            looked += values.size
            assert (values >= y[0]).all() and (values <= y[1]).all(), (expression, start, width)
    assert looked > 5_000


def test_steps_of_what_is_unbounded_are_unbounded():
    for name in ("FLOOR", "CEIL"):
        assert elementary(name, (-math.inf, math.inf), (0.0, 0.0))[0].tolist() == [-math.inf, math.inf]
        assert elementary(name, (1e20, 2e20), (0.0, 0.0))[0].tolist() == [1e20, 2e20]


def test_remainders_are_as_wide_as_their_interval_between_jumps():
    t = ca.SX.sym("t")
    curve = asm.FormulaCurve(ca.vertcat(ca.fmod(t, 0.7), ca.fmod(-t, 0.3)), t, (-2.0, 2.5))
    rng = np.random.default_rng(0)
    narrow = 0
    for _ in range(500):
        low = rng.uniform(-2.0, 2.4)
        high = min(2.5, low + 10.0 ** rng.uniform(-9.0, 0.0))
        ends = curve.bounds(np.array([low]), np.array([high]))[0, 0]
        at = np.concatenate([[low, high], rng.uniform(low, high, 20)])
        values = np.stack([np.fmod(at, 0.7), np.fmod(-at, 0.3)], 1)
        assert (ends[0] <= values).all() and (values <= ends[1]).all()
        narrow += bool((np.ptp(ends, axis=0) <= 1.000001 * (high - low)).all())
    # The others have a jump inside.
    assert narrow > 400
