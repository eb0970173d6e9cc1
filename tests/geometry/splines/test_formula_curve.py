"""Curves given by a formula: values against CasADi and closed forms, curves with a name, and what is refused."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError

T = ca.SX.sym("t")
S = ca.SX.sym("s")
PLANE = ca.vertcat(ca.cos(T), ca.sin(2 * T))
MAKERS = ["heart", "epicycloid", "ranunculoid", "ellipse", "involute", "fish", "lissajous", "helix", "euler_spiral"]


def curve(expression=PLANE, **options):
    return asm.FormulaCurve(expression, T, (0.0, 2.0), **options)


def test_points_and_derivatives():
    made = curve(ca.vertcat(ca.cos(T), ca.exp(T), T**3))
    t = np.linspace(0.0, 2.0, 12).reshape(3, 4)
    points, first, second = made.evaluate(t, 2)
    # One library of elementary functions and a few roundings.
    np.testing.assert_allclose(points, np.stack([np.cos(t), np.exp(t), t**3], -1), rtol=4e-15)
    np.testing.assert_allclose(first, np.stack([-np.sin(t), np.exp(t), 3 * t**2], -1), rtol=4e-15)
    np.testing.assert_allclose(second, np.stack([-np.cos(t), np.exp(t), 6 * t], -1), rtol=4e-15)
    assert points.shape == (3, 4, 3)
    assert made.evaluate(0.5).shape == (3,) and len(made.evaluate(0.5, 1)) == 2
    np.testing.assert_array_equal(made.evaluate(t), points)


def test_attributes():
    made = curve(name="knot")
    assert made.domain == (0.0, 2.0) and made.dimension == 2 and made.name == "knot" and not made.closed
    assert repr(made) == "FormulaCurve('knot', 2-D, domain [0.0, 2.0])"
    low, high = made.bounding_box()
    points = made.evaluate(np.linspace(0.0, 2.0, 1001))
    assert (low <= points.min(axis=0)).all() and (high >= points.max(axis=0)).all()
    assert np.linalg.norm(np.ptp(points, axis=0)) <= made.size <= 1.01 * np.linalg.norm(np.ptp(points, axis=0))
    assert asm.curves.heart().closed and not asm.curves.involute().closed


@pytest.mark.parametrize("name", MAKERS)
def test_derivatives_by_differences(name):
    made = getattr(asm.curves, name)()
    low, high = made.domain
    h = 1e-5 * (high - low)
    t = np.linspace(low + 2 * h, high - 2 * h, 37)
    _, first, second = made.evaluate(t, 2)
    for value, order in ((first, 0), (second, 1)):
        before, after = (made.evaluate(t + step, 1)[order] for step in (-h, h))
        # Truncation h^2 / 6 times the third derivative, which of waves is the frequency cubed.
        np.testing.assert_allclose((after - before) / (2 * h), value, rtol=0, atol=1e-6 * np.abs(second).max())


@pytest.mark.parametrize("name", [name for name in MAKERS if name != "helix"])
def test_named_curves_are_turned_and_moved(name):
    maker = getattr(asm.curves, name)
    plain, moved = maker(), maker(angle=30.0, center=(1.0, -2.0))
    c, s = math.cos(math.pi / 6), math.sin(math.pi / 6)
    t = np.linspace(*plain.domain, 20)
    expected = plain.evaluate(t) @ np.array([[c, s], [-s, c]]) + (1.0, -2.0)
    np.testing.assert_allclose(moved.evaluate(t), expected, rtol=0, atol=1e-13 * plain.size)
    assert moved.name == plain.name


def test_named_curves_against_their_equations():
    t = np.linspace(0.0, 6.0, 50)
    cases = {
        "heart": (16 * np.sin(t) ** 3, 13 * np.cos(t) - 5 * np.cos(2 * t) - 2 * np.cos(3 * t) - np.cos(4 * t)),
        "ranunculoid": (6 * np.cos(t) - np.cos(6 * t), 6 * np.sin(t) - np.sin(6 * t)),
        "involute": (np.cos(t) + t * np.sin(t), np.sin(t) - t * np.cos(t)),
        "fish": (np.cos(t) - np.sin(t) ** 2 / np.sqrt(2), np.cos(t) * np.sin(t)),
        "lissajous": (np.sin(3 * t), np.sin(2 * t)),
        "ellipse": (2 * np.cos(t), np.sin(t)),
        "helix": (np.cos(t), np.sin(t), t / (2 * np.pi)),
    }
    for name, expected in cases.items():
        np.testing.assert_allclose(
            getattr(asm.curves, name)().evaluate(t), np.stack(expected, -1), rtol=0, atol=2e-14, err_msg=name
        )


def longdouble_fresnel(t):
    """Both integrals in extended precision, by 40 Gauss rules of 30 points, their nodes polished."""
    x = np.polynomial.legendre.leggauss(30)[0].astype(np.longdouble)
    for _ in range(3):
        before, here = np.ones_like(x), x.copy()
        for k in range(2, 31):
            before, here = here, ((2 * k - 1) * x * here - (k - 1) * before) / np.longdouble(k)
        slope = 30 * (x * here - before) / (x * x - 1)
        x = x - here / slope
    w = 2 / ((1 - x * x) * slope * slope)
    ends = np.linspace(np.longdouble(0), np.longdouble(t), 41)
    half = 0.5 * (ends[1:] - ends[:-1])[:, None]
    u = ends[:-1, None] + half * (1 + x)
    return np.array([(np.cos(u * u) * w * half).sum(), (np.sin(u * u) * w * half).sum()])


def test_euler_spiral():
    made = asm.curves.euler_spiral()
    for t in np.linspace(-2 * np.pi, 2 * np.pi, 41):
        exact = longdouble_fresnel(t)
        box = made.bounds(t, t)[0]
        assert (box[0] <= exact).all() and (exact <= box[1]).all()
        assert (box[1] - box[0]).max() < 4e-13  # sums of 40 roundings of phases up to 39
        np.testing.assert_allclose(made.evaluate(t), exact.astype(float), rtol=0, atol=3e-14)
    slope = made.evaluate(np.array([1.0, 6.0]), 1)[1]
    np.testing.assert_allclose(slope, np.stack([np.cos([1.0, 36.0]), np.sin([1.0, 36.0])], -1), rtol=1e-14)


def test_a_curve_of_its_own_arc_length():
    made = asm.FormulaCurve(PLANE, T, (0.0, 2.0), arc_length=lambda t0, t1: 3 * (t1 - t0))
    assert made.arc_length_bound(0.0, 1.0) == pytest.approx(made.speed(0.0, 1.0)[1], abs=1.0)
    assert made.arc_lengths(np.array([0.5]), np.array([1.5]))[0] == pytest.approx(3.0, rel=1e-14)
    # The smaller of the two; a callable may be a CasADi function too.
    ends = [ca.SX.sym("a"), ca.SX.sym("b")]
    long = curve(arc_length=ca.Function("f", ends, [100 * (ends[1] - ends[0])]))
    assert long.arc_length_bound(0.0, 1.0) < 3.0


def bad(match, raised=InputError, **arguments):
    defaults = {"expression": PLANE, "parameter": T, "domain": (0.0, 1.0)}
    with pytest.raises(raised, match=match):
        asm.FormulaCurve(**{**defaults, **arguments})


def test_bad_input():
    bad("expression is .*expected a casadi.SX column", TypeError, expression=np.zeros(2))
    bad("expression is .*expected a casadi.SX column", TypeError, expression=ca.MX.sym("x", 2))
    bad(r"expression has shape \(1, 1\); expected a column of 2 or 3 rows", expression=T)
    bad(r"expression has shape \(2, 2\)", expression=ca.horzcat(PLANE, PLANE))
    bad("expression has the symbols \\['s'\\] beside t", expression=ca.vertcat(S, T))
    bad("parameter is .*expected one casadi.SX symbol", TypeError, parameter=2 * T)
    bad("parameter is .*expected one casadi.SX symbol", TypeError, parameter="t")
    bad("domain is 3; expected two numbers", domain=3)
    bad(r"domain is \[1, 1\]", domain=(1.0, 1.0))
    bad(r"domain is \[0, inf\]", domain=(0.0, math.inf))
    bad("expression is .*nan.* at -1; expected finite", expression=ca.vertcat(T, ca.sqrt(T)), domain=(-1.0, 1.0))
    bad("expression is .*inf.* at 0", expression=ca.vertcat(T, 1 / T))
    bad("error is -1", error=-1.0)
    bad("name is 3", TypeError, name=3)
    bad("derivative has shape", derivative=ca.vertcat(T, T, T))
    bad("arc_length is 3; expected a callable", TypeError, arc_length=3)
    bad("arc_length returns no casadi.SX", TypeError, arc_length=lambda t0, t1: "long")
    bad("arc_length has the symbols", arc_length=lambda t0, t1: S)
    bad(r"arc_length returns shape \(2, 1\)", arc_length=lambda t0, t1: ca.vertcat(t0, t1))
    for what in (lambda t0: t0, lambda: 1.0, float, ca.Function("f", [T], [T]), str.upper):
        bad("arc_length is .*, which takes no two casadi.SX symbols", TypeError, arc_length=what)
    bad("arc_length returns no casadi.SX", TypeError, arc_length=lambda t0, t1: object())
    for value in (math.nan, math.inf, -1.0):
        bad("arc_length is .* over the domain", arc_length=lambda t0, t1, value=value: value)
    bad(r"arc_length is -1 over the domain \[0, 1\]; expected a finite length", arc_length=lambda t0, t1: t0 - t1)
    bad("domain is .*expected two numbers", domain=(ca.DM([1, 2]), 3.0))
    bad("error is DM", error=ca.DM([1, 2]))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("end", [1e99, 1e100, 1e300, 1e308])
def test_coordinates_that_squares_cannot_hold(end):
    column = ca.vertcat(T, ca.sin(T))
    if end < 1e100:
        assert asm.FormulaCurve(column, T, (-end, end)).size >= 2 * end
        bad(
            "expression reaches 1e.102 on the domain; expected coordinates", expression=1e3 * column, domain=(-end, end)
        )
    else:
        bad("domain is .*; expected parameters below 1e.100", expression=column, domain=(-end, end))


GAP = ca.fabs(T - 0.3) - 1e-4
BOUNDED = {
    "a root at an end": ca.sqrt(T),
    "a root at both ends": ca.sqrt(T - T * T),
    "an arc sine at both ends": ca.asin(2 * T - 1),
    "a cusp": ca.sqrt(ca.fabs(T - 0.3)),
    "a cube root": ca.sign(T - 0.3) * ca.fabs(T - 0.3) ** (1 / 3.0),
    "a high and narrow peak": 1 / (1e-8 + (T - 0.3) ** 2),
    "a peak that intervals see late": 1 / (T * T - 0.6 * T + 0.09 + 1e-5),
    "a pole beside the domain": 1 / (T + 1e-9),
}
UNBOUNDED = {
    "a pole": 1 / (T - 0.3),
    "an even pole": 1 / (T - 0.3) ** 2,
    "a pole of the tangent": ca.tan(6 * T),
    "a logarithm": ca.log(ca.fabs(T - 0.3)),
    "a gap of a root": ca.sqrt(GAP),
    "a gap of a power": GAP**1.5,
    "a gap of an arc sine": ca.asin(1 - GAP),
    "a removable one": ca.sin(T - 0.3) / (T - 0.3),
    "a pole told apart": ca.if_else(ca.fabs(T - 0.3) > 0, 1 / (T - 0.3), 0),
}


@pytest.mark.parametrize("name", BOUNDED)
def test_formulas_that_are_bounded(name):
    """Verticals and kinks have no derivative somewhere, and are curves all the same: box and distance are right."""
    made = asm.FormulaCurve(ca.vertcat(T, BOUNDED[name]), T, (0.0, 1.0))
    points = made.evaluate(np.linspace(0.0, 1.0, 2001))
    low, high = made.bounding_box()
    # Rounding of the samples.
    off = 1e-13 * np.abs(points).max()
    assert (low <= points.min(axis=0) + off).all() and (points.max(axis=0) <= high + off).all()
    assert (high - low <= 1.5 * np.ptp(points, axis=0) + 1e-9).all()
    answer = asm.proximity.minimum_distance(made, np.array([0.3, points[:, 1].max() + 1.0]))
    known = np.hypot(points[:, 0] - 0.3, points[:, 1] - points[:, 1].max() - 1.0).min()
    assert 0.0 < answer.lower <= known + off and answer.upper >= answer.lower


@pytest.mark.parametrize("name", UNBOUNDED)
def test_formulas_that_are_not_bounded(name):
    bad("expression has no bound between 0[.]", expression=ca.vertcat(T, UNBOUNDED[name]), domain=(0.0, 1.0))


def test_an_unbounded_part_between_all_looks_is_found():
    """A gap a thousandth of a step wide, anywhere."""
    rng = np.random.default_rng(8)
    for at in rng.uniform(0.01, 0.99, 20):
        bad("expression has no bound", expression=ca.vertcat(T, ca.sqrt(ca.fabs(T - float(at)) - 2e-6), T))


def test_bad_input_to_methods():
    made = curve()
    with pytest.raises(InputError, match=r"t is 2.5; expected a parameter in the domain \[0, 2\]"):
        made.evaluate([0.0, 2.5])
    with pytest.raises(InputError, match="t is nan"):
        made.evaluate(math.nan)
    with pytest.raises(InputError, match="order is 3"):
        made.evaluate(0.0, 3)
    with pytest.raises(InputError, match="t0, t1 are"):
        made.bounds(1.0, 0.5)
    steep = asm.FormulaCurve(ca.vertcat(ca.sqrt(T), T), T, (0.0, 1.0))
    assert steep.evaluate(0.0).tolist() == [0.0, 0.0]
    with pytest.raises(InputError, match="t is 0.0; expected one where the expression and its derivatives are finite"):
        steep.evaluate(0.0, 1)


@pytest.mark.parametrize(
    ("name", "arguments", "match"),
    [
        ("heart", {"size": 0.0}, "size is 0; expected a positive number"),
        ("epicycloid", {"cusps": 0}, "cusps is 0"),
        ("ellipse", {"half_axes": (1.0, -1.0)}, r"half_axes\[1\] is -1"),
        ("involute", {"end": -1.0}, "end is -1"),
        ("lissajous", {"frequencies": (1, 0)}, r"frequencies\[1\] is 0"),
        ("lissajous", {"frequencies": 3}, "frequencies are 3"),
        ("helix", {"turns": 0.0}, "turns is 0"),
        ("helix", {"center": (0.0, 0.0)}, "center has shape"),
        ("euler_spiral", {"end": 7.0}, "end is 7; expected at most 2 pi"),
    ],
)
def test_bad_input_to_makers(name, arguments, match):
    with pytest.raises(InputError, match=match):
        getattr(asm.curves, name)(**arguments)
