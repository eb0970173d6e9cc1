from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.objectives import Objective
from assembly.errors import InputError
from assembly.geometry.expression import tape
from assembly.kinematics.body import Body
from assembly.kinematics.pose import quaternion_rate_map, retract

RNG = np.random.default_rng(11)
CASADI = {name: getattr(ca, name) for name in dir(ca) if name.startswith("OP_")}
MOVES = ("INPUT", "OUTPUT", "CONST", "ASSIGN", "LIFT")
ELEMENTARY = [name for name in tape.OPERATIONS if name not in MOVES]
# One rounding, or none at all: the same in every library of elementary functions.
EXACT = set(
    "MUL ADD SUB NEG SQ TWICE DIV SQRT INV FABS SIGN COPYSIGN FMIN FMAX LT LE EQ NE NOT AND OR IF_ELSE_ZERO FLOOR CEIL "
    "FMOD REMAINDER".split()
)
BODIES = (Body("red"), Body("green"), Body("blue"))
RED, GREEN, _ = BODIES

inf, nan = math.inf, math.nan
SPECIAL = [0.0, 1.0, 0.5, 0.7, 0.69, 0.71, 1.5, 2.0, 2.5, 3.0, 1e-9, 0.1, math.pi, 40.0, 800.0, 1e22, 1e300, 1e-300]
SPECIAL += [5e-324, math.nextafter(1.0, 0.0), math.nextafter(1.0, 2.0), inf]
ARGUMENTS = np.concatenate(
    [
        SPECIAL,
        np.negative(SPECIAL),
        [nan],
        RNG.normal(size=30),
        RNG.uniform(-1.0, 1.0, 30),
        10.0 ** RNG.uniform(-20.0, 20.0, 15) * RNG.choice([-1.0, 1.0], 15),
    ]
)
PAIRS = np.array(np.meshgrid(ARGUMENTS, ARGUMENTS)).reshape(2, -1).T.copy()


@kernel
def run_compiled(table, pool, o, xs, work, ys):
    for k in range(xs.shape[0]):
        tape.run_tape(Store(table, pool), o, xs[k], work, ys[k])


def run_plain(table, pool, o, xs, work, ys):
    # What numpy warns of is what these arguments are for.
    with np.errstate(all="ignore"):
        for x, y in zip(xs, ys, strict=True):
            tape.run_tape(Store(table, pool), o, x, work, y)


def run(packed, x, size, compiled=True):
    """Outputs of a tape that lies amid other data; all of work and of the outputs is NaN before."""
    table = np.concatenate([[-1, -1, -1], packed.table, [-1]])
    table[3 + tape.CONSTANTS] += 2
    pool = np.concatenate([[nan, nan], packed.constants, [nan]])
    y = np.full((1, size), nan)
    work = np.full(packed.table[tape.WORK], nan)
    (run_compiled if compiled else run_plain)(table, pool, 3, np.atleast_2d(x), work, y)
    return y[0]


def ulps(a, b):
    """Doubles from a to b; none between two NaN, and one between the two zeros."""
    places = [x.view(np.int64).astype(object) for x in (a, b)]
    ordered = [np.where(p < 0, -(2**63) - p - 1, p) for p in places]
    return np.where(np.isnan(a) & np.isnan(b), 0, np.abs(ordered[0] - ordered[1]))


def elementary(name, runner, pairs):
    code = tape.OPERATIONS.index(name)
    instructions = [[tape.INPUT, 0, 0, 0], [tape.INPUT, 1, 1, 0], [code, 2, 0, 1], [tape.OUTPUT, 0, 2, 0]]
    y = np.full((len(pairs), 1), 0.123)
    runner(np.ravel([4, 0, 3, *np.ravel(instructions)]), np.zeros(0), 0, pairs, np.zeros(3), y)
    return y[:, 0]


def by_casadi(name, pairs):
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    function = ca.Function("f", [u, v], [ca.SX.binary(CASADI[f"OP_{name}"], u, v)])
    return np.array(function.map(len(pairs))(pairs[:, 0][None], pairs[:, 1][None])).ravel()


# The machine.


def test_codes_are_the_places_of_their_names():
    assert [getattr(tape, name) for name in tape.OPERATIONS] == list(range(len(tape.OPERATIONS)))
    assert {f"OP_{name}" for name in tape.OPERATIONS} <= CASADI.keys()


def test_every_elementary_function_of_casadi_is_there():
    u, v = ca.SX.sym("u"), ca.SX.sym("v")
    names = {code: name for name, code in CASADI.items()}
    found = set()
    for code in CASADI.values():
        # What is no elementary function becomes a constant here.
        function = ca.Function("f", [u, v], [ca.SX.binary(code, u, v)])
        found |= {names[function.instruction_id(k)] for k in range(function.n_instructions())}
    assert len(found) > 45
    assert found - {f"OP_{name}" for name in tape.OPERATIONS} == {"OP_PRINTME"}


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_function_equals_casadi(name):
    came, expected = elementary(name, run_compiled, PAIRS), by_casadi(name, PAIRS)
    # Both call the same library where it is the system's, which gives the same bits; another one may round the last
    # bit of sin and its like otherwise.
    assert ulps(came, expected).max() <= (0 if name in EXACT else 1)


@pytest.mark.parametrize("name", ELEMENTARY)
def test_elementary_function_without_compilation(name):
    pairs = PAIRS[np.random.default_rng(3).choice(len(PAIRS), 400, replace=False)]
    came, expected = elementary(name, run_plain, pairs), elementary(name, run_compiled, pairs)
    # numpy's own loops are right to 4 ulp; three of its functions make up erfinv.
    assert ulps(came, expected).max() <= (0 if name in EXACT else 8 if name == "ERFINV" else 4)


@pytest.mark.parametrize("name", ["ASSIGN", "LIFT"])
@pytest.mark.parametrize("runner", [run_compiled, run_plain])
def test_copies_copy(name, runner):
    assert ulps(elementary(name, runner, PAIRS[:500]), PAIRS[:500, 0].copy()).max() == 0


# Expressions.


def rotated(pose, point):
    w, u = pose[3], pose[4:]
    return pose[:3] + point + 2 * ca.cross(u, ca.cross(u, point) + w * point)


def poses(count, rng=None):
    q = (rng or np.random.default_rng(5)).normal(size=(count, 7))
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1)[:, None]
    return q


def mixed():
    """Three bodies, four values: lengths, angles, powers, switches; and one value that body blue has no part in."""
    red, green, blue = (ca.SX.sym(name, 7) for name in "abc")
    p = rotated(red, ca.DM([0.3, -1.2, 0.5]))
    d = rotated(green, ca.DM([1.0, 0.2, -0.4])) - p
    e = rotated(blue, ca.DM([0.0, 0.7, 0.1])) - p
    values = ca.vertcat(
        ca.norm_2(d) - ca.hypot(e[0], e[1]) + 0.2 * ca.atan2(d[2], d[0]),
        ca.exp(-0.2 * ca.sumsqr(e)) * ca.sin(d[1]) + ca.fmin(ca.dot(d, e), 0.4 * ca.sumsqr(d) + 3.0) / 10.0,
        ca.if_else(d[2] > e[2], ca.tanh(d[2]) ** 3, ca.log1p(ca.sumsqr(d)) ** 1.7) + ca.erf(e[2]) * red[3] ** 2,
        ca.sqrt(1.0 + ca.sumsqr(d)) * red[4] * green[6],
    )
    return ca.Function("mixed", [red, green, blue], [values])


EXPRESSION = Expression(mixed(), BODIES)


def derivatives(expression, q, multipliers, compiled=True):
    """Values, Jacobian and Hessian by the tapes."""
    b, m = len(expression.bodies), expression.count
    rows = run(expression.tapes.rows, q.ravel(), m + 6 * b * m, compiled)
    hessian = run(expression.tapes.hessian, np.concatenate([q.ravel(), multipliers]), 36 * b * b, compiled)
    return rows[:m], rows[m:].reshape(m, 6 * b), hessian.reshape(6 * b, 6 * b)


def moved(q, twist):
    return retract(q, twist.reshape(-1, 6))


@pytest.mark.parametrize("compiled", [True, False])
def test_tapes_equal_casadi(compiled):
    function = EXPRESSION.function
    symbols = ca.SX.sym("x", 21)
    multipliers = ca.SX.sym("y", 4)
    values = function(*ca.vertsplit(symbols, 7))
    hessian, gradient = ca.hessian(ca.dot(multipliers, values), symbols)
    raw = ca.Function("raw", [symbols, multipliers], [values, ca.jacobian(values, symbols), gradient, hessian])
    rng = np.random.default_rng(21)
    for q in (poses(3, rng) for _ in range(5)):
        y = rng.normal(size=4)
        v, j, g, h = (np.array(ca.densify(x)) for x in raw(q.ravel(), y))
        # d pose / d twist at rest; its second derivative is -e / 4 for a turn twice about one axis, else zero.
        rates = np.zeros((21, 18))
        curvature = np.zeros((18, 18))
        for k, e in enumerate(q[:, 3:]):
            rates[7 * k : 7 * k + 3, 6 * k : 6 * k + 3] = np.eye(3)
            rates[7 * k + 3 : 7 * k + 7, 6 * k + 3 : 6 * k + 6] = quaternion_rate_map(e)
            turns = slice(6 * k + 3, 6 * k + 6)
            curvature[turns, turns] = -0.25 * (g[7 * k + 3 : 7 * k + 7, 0] @ e) * np.eye(3)
        came = derivatives(EXPRESSION, q, y, compiled)
        # Sums of some twenty products in another order.
        for a, b in zip(came, (v[:, 0], j @ rates, rates.T @ h @ rates + curvature), strict=True):
            np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-14 * (1.0 + np.abs(b).max()))
        np.testing.assert_array_equal(came[2], came[2].T)


def test_values_are_those_of_the_function():
    rng = np.random.default_rng(22)
    for q in (poses(3, rng) for _ in range(5)):
        came = derivatives(EXPRESSION, q, np.ones(4))[0]
        expected = np.array(EXPRESSION.function(*q)).ravel()
        # The rows' list may add up in another order.
        np.testing.assert_allclose(came, expected, rtol=0.0, atol=2e-15)
        np.testing.assert_allclose(EXPRESSION.values(q), expected, rtol=0.0, atol=2e-15)


def test_derivatives_equal_differences_along_retract():
    rng = np.random.default_rng(23)
    for q in (poses(3, rng) for _ in range(3)):
        y = rng.normal(size=4)
        _, jacobian, hessian = derivatives(EXPRESSION, q, y)
        for _ in range(20):
            t = rng.normal(size=18) / math.sqrt(18.0)
            steps = {k: EXPRESSION.values(moved(q, 4e-3 * k * t)) for k in (-3, -2, -1, 0, 1, 2, 3)}
            # Of sixth order: what they drop is below 1e-10 here; values rounded to 1e-15 leave 1e-10 in the second.
            first = sum(c * (steps[k] - steps[-k]) for k, c in ((1, 45.0), (2, -9.0), (3, 1.0))) / (60.0 * 4e-3)
            second = sum(c * (steps[k] + steps[-k]) for k, c in ((1, 270.0), (2, -27.0), (3, 2.0)))
            second = (second - 490.0 * steps[0]) / (180.0 * 4e-3**2)
            np.testing.assert_allclose(jacobian @ t, first, rtol=0.0, atol=1e-8)
            assert t @ hessian @ t == pytest.approx(y @ second, rel=0.0, abs=1e-7)


def test_a_body_without_part_in_a_value_has_zeros():
    _, jacobian, _ = derivatives(EXPRESSION, poses(3), np.ones(4))
    assert (np.abs(jacobian[:3, 12:]).max(axis=1) > 0.0).all()
    np.testing.assert_array_equal(jacobian[3, 12:], 0.0)
    _, _, hessian = derivatives(EXPRESSION, poses(3), np.array([0.0, 0.0, 0.0, 1.0]))
    np.testing.assert_array_equal(hessian[12:], 0.0)


def test_the_other_quaternion_of_a_pose_changes_nothing():
    red, green = ca.SX.sym("a", 7), ca.SX.sym("b", 7)
    d = rotated(red, ca.DM([0.3, -1.2, 0.5])) - rotated(green, ca.DM([1.0, 0.2, -0.4]))
    distance = Expression(ca.Function("distance", [red, green], [ca.norm_2(d)]), BODIES[:2])
    q = poses(2)
    other = q * np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0])
    for a, b in zip(derivatives(distance, q, np.ones(1)), derivatives(distance, other, np.ones(1)), strict=True):
        np.testing.assert_array_equal(a, b)  # signs change no rounding


def test_closed_form_of_a_point_far_from_its_body():
    pose = ca.SX.sym("q", 7)
    height = Expression(ca.Function("height", [pose], [rotated(pose, ca.DM([3.0, 0.0, 4.0]))[2]]), [RED])
    q = poses(1)
    w, x, y, z = q[0, 3:]
    arm = np.array([3.0, 0.0, 4.0]) + 2 * np.cross(
        [x, y, z], np.cross([x, y, z], [3.0, 0.0, 4.0]) + w * np.array([3, 0, 4])
    )
    value, jacobian, hessian = derivatives(height, q, np.array([2.0]))
    assert value[0] == pytest.approx(q[0, 2] + arm[2], abs=2e-15)
    # d(w x p) z = (p x z) . w ..., and its second derivative (w (w.p) - p |w|^2) z.
    np.testing.assert_allclose(jacobian[0], [0, 0, 1, arm[1], -arm[0], 0], rtol=0.0, atol=4e-15)
    up = np.array([0.0, 0.0, 1.0])
    expected = np.outer(arm, up) + np.outer(up, arm) - 2.0 * arm[2] * np.eye(3)
    np.testing.assert_allclose(hessian[3:, 3:], expected, rtol=0.0, atol=2e-14)
    np.testing.assert_array_equal(hessian[:3], 0.0)


def test_all_elementary_functions_in_one_expression():
    pose = ca.SX.sym("q", 7)
    u, v = pose[0], pose[1]
    values = [ca.SX.binary(CASADI[f"OP_{name}"], u, v) for name in ELEMENTARY if name != "CONSTPOW"]
    values += [u**3.7, u**-2.5, ca.if_else(u > v, u, v), ca.fabs(u) ** 0.5]
    everything = Expression(ca.Function("everything", [pose], [ca.vertcat(*values)]), [RED])
    used = set(everything.tapes.rows.table[tape.HEAD :: tape.INSTRUCTION])
    assert {tape.OPERATIONS.index(name) for name in ELEMENTARY} <= used
    for u, v in ((0.3, 0.6), (-0.9, 0.4), (0.8, -2.0), (2.5, 1.25), (0.0, -1.0), (1.0, inf), (nan, 2.0)):
        q = np.array([u, v, 0.0, 1.0, 0.0, 0.0, 0.0])
        m = everything.count
        rows = run(everything.tapes.rows, q, 7 * m)
        assert ulps(rows[:m], np.array(everything.function(q)).ravel()).max() <= 1  # as function by function
    q = np.array([0.37, 0.6, 0.0, 1.0, 0.0, 0.0, 0.0])
    rows = run(everything.tapes.rows, q, 7 * m)
    jacobian = np.array(ca.Function("j", [pose], [ca.jacobian(ca.vertcat(*values), pose)])(q))
    came = rows[m:].reshape(m, 6)
    np.testing.assert_array_equal(np.isfinite(came[:, :2]), np.isfinite(jacobian[:, :2]))
    finite = np.isfinite(jacobian[:, :2])
    # CasADi's derivatives simplified otherwise.
    np.testing.assert_allclose(came[:, :2][finite], jacobian[:, :2][finite], rtol=4e-15, atol=1e-15)


def test_one_function_of_mx():
    a, b = ca.MX.sym("a", 7), ca.MX.sym("b", 7)
    difference = ca.Function("difference", [a, b], [ca.mtimes(ca.DM(np.arange(9.0).reshape(3, 3)), a[:3] - b[:3])])
    expression = Expression(difference, [RED, GREEN])
    q = poses(2)
    value, jacobian, hessian = derivatives(expression, q, np.ones(3))
    matrix = np.arange(9.0).reshape(3, 3)
    np.testing.assert_allclose(value, matrix @ (q[0, :3] - q[1, :3]), rtol=0.0, atol=1e-14)
    np.testing.assert_array_equal(jacobian[:, [0, 1, 2, 6, 7, 8]], np.hstack([matrix, -matrix]))
    assert not hessian.any()


def test_sparse_values_are_zeros():
    pose = ca.SX.sym("q", 7)
    sparse = ca.SX(3, 1)
    sparse[1] = pose[0]
    expression = Expression(ca.Function("f", [pose], [sparse]), [RED])
    value, jacobian, _ = derivatives(expression, poses(1) + np.eye(7)[0], np.ones(3))
    assert value[0] == value[2] == 0.0 != value[1]
    np.testing.assert_array_equal(jacobian, np.outer([0, 1, 0], [1, 0, 0, 0, 0, 0]))


def test_tapes_are_made_once():
    assert EXPRESSION.tapes is EXPRESSION.tapes


def scalar(value=None):
    pose = ca.SX.sym("q", 7)
    return ca.Function("height", [pose], [pose[2] if value is None else value(pose)])


def test_is_a_constraint_and_an_objective():
    plain = Expression(scalar(), [RED])
    assert isinstance(plain, Constraint) and isinstance(plain, Objective)
    assert (plain.name, plain.bodies, plain.count) == ("height red", (RED,), 1)
    assert (plain.unilateral, plain.scale, plain.weight) == (False, 1.0, 1.0)
    assert repr(plain) == "Expression(height, [red], name='height red')"
    other = Expression(scalar(), [GREEN], "lift", unilateral=True, scale=0.5, weight=3)
    assert (other.name, other.unilateral, other.scale, other.weight) == ("lift", True, 0.5, 3.0)
    assert repr(other) == "Expression(height, [green], name='lift', unilateral=True, scale=0.5, weight=3.0)"


# Bad input.


class _Opaque(ca.Callback):
    def __init__(self):
        ca.Callback.__init__(self)
        self.construct("opaque", {})

    def eval(self, arguments):
        return arguments


OPAQUE = _Opaque()


def function_of_mx(value):
    pose = ca.MX.sym("q", 7)
    return ca.Function("height", [pose], [value(pose)])


def shaped(inputs, outputs):
    symbols = [ca.SX.sym(f"q{k}", *shape) for k, shape in enumerate(inputs)]
    return ca.Function("f", symbols, [ca.SX(*shape) for shape in outputs])


def with_free_variables():
    return ca.Function("f", [ca.SX.sym("q", 7)], [ca.SX.sym("height")], {"allow_free": True})


def calling():
    inner = ca.Function("inner", [x := ca.SX.sym("x")], [ca.sin(x)], {"never_inline": True})
    return scalar(lambda q: inner(q[0]))


@pytest.mark.parametrize(
    ("function", "text"),
    [
        (lambda: scalar(lambda q: q[0].printme(q[1])), "function 'height' has the instruction OP_PRINTME; expected"),
        (calling, "function 'height' has the instruction OP_CALL; expected elementary functions"),
        (lambda: function_of_mx(lambda q: OPAQUE(q[0])), "function 'height' has the instruction OP_CALL; expected"),
        (
            lambda: function_of_mx(ca.find),
            r"function height:.* does not expand to SX \(.*FindE\); expected one that does",
        ),
        (ca.Function, r"function is casadi.Function\(\) without content; expected"),
        (lambda: shaped([], [(1, 1)]), "function is f:.* without inputs; expected one for each body"),
        (lambda: shaped([(7, 1), (6, 1)], [(1, 1)]), "function has input 'i1' of shape 6x1.*; expected a pose"),
        (lambda: shaped([(1, 7)], [(1, 1)]), "function has input 'i0' of shape 1x7.*; expected a pose"),
        (lambda: shaped([(7, 1)], []), "function has 0 outputs; expected one"),
        (lambda: shaped([(7, 1)], [(1, 1), (1, 1)]), "function has 2 outputs; expected one"),
        (lambda: shaped([(7, 1)], [(1, 2)]), r"function has an output of shape \(1, 2\); expected a column"),
        (lambda: shaped([(7, 1)], [(0, 1)]), r"function has an output of shape \(0, 1\); expected a column"),
        (with_free_variables, r"function has the free variables \['height'\]; expected"),
    ],
)
def test_bad_functions_are_refused(function, text):
    made = function()
    with pytest.raises(InputError, match=text):
        Expression(made, BODIES[: max(made.n_in(), 1) if not made.is_null() else 1])


@pytest.mark.parametrize("value", [3, None, "f", lambda q: q, ca.SX.sym("q", 7)])
def test_what_is_no_function_is_refused(value):
    with pytest.raises(TypeError, match="function is .*; expected a casadi.Function"):
        Expression(value, [RED])


@pytest.mark.parametrize(
    ("bodies", "error", "text"),
    [
        ([], InputError, r"bodies are \[\]; expected 2, one for each input"),
        ([RED], InputError, r"bodies are \['red'\]; expected 2"),
        (BODIES, InputError, "bodies are .*'blue'.*; expected 2"),
        ([RED, RED], InputError, "body 'red' is named twice; expected distinct"),
        ([RED, "green"], TypeError, r"bodies\[1\] is 'green'; expected a Body"),
        ("ab", TypeError, "bodies is 'ab'; expected a sequence of bodies"),
        (RED, TypeError, "bodies is .*red.*; expected a sequence of bodies"),
    ],
)
def test_bad_bodies_are_refused(bodies, error, text):
    with pytest.raises(error, match=text):
        Expression(shaped([(7, 1), (7, 1)], [(1, 1)]), bodies)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"name": " "}, "name is ' '; expected a nonempty string"),
        ({"unilateral": 1}, "unilateral is 1; expected True or False"),
        ({"scale": 0.0}, "scale is 0; expected a positive number"),
        ({"scale": nan}, "scale is nan; expected"),
        ({"weight": -2.0}, "weight is -2; expected a positive number"),
        ({"weight": "1"}, "weight is '1'; expected"),
    ],
)
def test_bad_settings_are_refused(arguments, text):
    with pytest.raises(InputError, match=text):
        Expression(scalar(), [RED], **arguments)


def test_bad_poses_are_refused():
    with pytest.raises(InputError, match=r"q has shape \(2, 7\); expected \(1, 7\)"):
        Expression(scalar(), [RED]).values(poses(2))


# Documents.


def test_document_gives_the_same_instructions():
    again = Expression.from_document(EXPRESSION.document(), BODIES, "again", unilateral=True, scale=2.0, weight=4.0)
    assert (again.name, again.unilateral, again.scale, again.weight) == ("again", True, 2.0, 4.0)
    assert again.function.name() == "mixed" and again.document() == EXPRESSION.document()
    for old, new in zip(EXPRESSION.tapes, again.tapes, strict=True):
        np.testing.assert_array_equal(old.table, new.table)
        np.testing.assert_array_equal(old.constants, new.constants)


def test_document_holds_every_function_and_every_constant():
    pose = ca.SX.sym("q", 7)
    values = [ca.SX.binary(CASADI[f"OP_{name}"], pose[0], pose[1]) for name in ELEMENTARY]
    values += [pose[2] * constant for constant in (0.1, 1e-320, -1e300, inf, nan, 3.0)] + [pose[0] ** 3.7]
    expression = Expression(ca.Function("f", [pose], [ca.vertcat(*values)]), [RED])
    again = Expression.from_document(expression.document(), [RED])
    assert again.document() == expression.document()
    for x, y in ((0.3, -0.6), (-2.0, 5.5), (nan, inf)):
        q = np.array([x, y, 0.25, 1.0, 0.0, 0.0, 0.0])
        came, expected = (np.array(e.function(q)).ravel() for e in (again, expression))
        assert ulps(came, expected).max() == 0


DOCUMENT = "2 1 f\ninput 0 0\ninput 1 7\nmul 0 0 1\nconst 1 2.0\nadd 0 0 1\noutput 0 0"


def test_document_is_read_as_it_says():
    expression = Expression.from_document(DOCUMENT, [RED, GREEN])
    q = poses(2)
    assert expression.values(q)[0] == q[0, 0] * q[1, 0] + 2.0
    assert expression.document() == DOCUMENT


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (DOCUMENT, "", "document line 1 is ''; expected the numbers of bodies and of values, and the function's name"),
        ("2 1 f", "2 1", "document line 1 is '2 1'; expected"),
        ("2 1 f", "2 x f", "document line 1 is '2 x f'; expected"),
        ("2 1 f", "2 1 3f", "document line 1 is '2 1 3f'; expected"),
        ("2 1 f", "2 0 f", "document line 1 is '2 0 f'; expected"),
        ("2 1 f", "3 1 f", r"bodies are \['red', 'green'\]; expected 3"),
        ("2 1 f", "2 2 f", "document has 1 values; expected 2"),
        ("mul", "foo", "document line 4 is 'foo 0 0 1'; expected an instruction, one of mul, add"),
        ("mul 0 0 1", "", "document line 4 is ''; expected an instruction"),
        ("mul 0 0 1", "mul 0 0", "document line 4 is 'mul 0 0'; expected mul, a place, then 2 of places"),
        ("mul 0 0 1", "mul 0 0 9", "document line 4 is 'mul 0 0 9'; expected mul"),
        ("mul 0 0 1", "neg 0 0 1", "document line 4 is 'neg 0 0 1'; expected neg, a place, then 1 of places"),
        ("input 1 7", "input 1 14", "document line 3 is 'input 1 14'; expected input, a place, then an input below 14"),
        ("input 1 7", "input 1 -1", "document line 3 is 'input 1 -1'; expected input"),
        ("const 1 2.0", "const 1 two", "document line 5 is 'const 1 two'; expected const, a place, then a number"),
        ("output 0 0", "output 1 0", "document line 7 is 'output 1 0'; expected output"),
        ("output 0 0", "output 0 5", "document line 7 is 'output 0 5'; expected output"),
    ],
)
def test_bad_documents_are_refused(old, new, text):
    with pytest.raises(InputError, match=text):
        Expression.from_document(DOCUMENT.replace(old, new), [RED, GREEN])


def test_a_document_that_is_no_text_is_refused():
    with pytest.raises(TypeError, match="document is 3; expected the text"):
        Expression.from_document(3, [RED])


@given(st.integers(0, len(DOCUMENT)), st.integers(0, 4), st.text(max_size=4))
def test_a_damaged_document_is_read_or_refused(at, removed, added):
    try:
        Expression.from_document(DOCUMENT[:at] + added + DOCUMENT[at + removed :], [RED, GREEN])
    except InputError:
        pass


def test_casadi_is_loaded_by_the_first_expression_alone(run_python):
    code = "import sys, assembly.constraints.model.expression; print('casadi' in sys.modules)"
    assert run_python(code).strip().splitlines()[-1] == "False"
