from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assembly.geometry.splines.curve import NurbsCurve
from tests.geometry.reference import KINDS, curve_derivatives, curve_point, fractions, knot_vector

DEGREES = range(1, 8)


def random_curve(seed, degree, kind="clamped", dimension=3, rational=True):
    rng = np.random.default_rng([seed, degree, KINDS.index(kind), dimension])
    count = degree + 1 + int(rng.integers(1, 6))
    points = rng.normal(size=(count, dimension))
    weights = rng.uniform(0.4, 2.0, count) if rational else None
    return NurbsCurve(points, knot_vector(rng, degree, count, kind), degree, weights)


def samples(curve, count=12, seed=0):
    """Random parameters, the ends and all knots of the domain."""
    low, high = curve.domain
    inner = np.random.default_rng(seed).uniform(low, high, count)
    return np.concatenate([inner, curve.breaks()])


def assert_same_geometry(a, b, tolerance=1e-13):
    # Two ways to compute the same point differ by some roundings of the coordinates.
    t = samples(a, 40)
    assert a.domain == b.domain
    np.testing.assert_allclose(a.evaluate(t), b.evaluate(t), rtol=0, atol=tolerance * a.size)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degree", DEGREES)
def test_points_and_derivatives_are_those_of_the_recurrence(degree, kind, dimension, rational):
    curve = random_curve(1, degree, kind, dimension, rational)
    t = samples(curve)
    got = curve.evaluate(t, 2)
    want = [np.array(x) for x in zip(*(curve_derivatives(curve, x) for x in t), strict=True)]
    for k, (g, w) in enumerate(zip(got, want, strict=True)):
        # Each derivative divides rounding by a short span once more.
        assert g.shape == (t.size, dimension)
        np.testing.assert_allclose(g, w, rtol=0, atol=[1e-13, 1e-12, 1e-11][k] * max(1.0, np.abs(w).max()))


@pytest.mark.parametrize("degree", [2, 3, 5])
def test_points_are_exact_to_rounding_against_fractions(degree):
    curve = random_curve(2, degree, "multiple")
    data = [fractions(x.tolist()) for x in (curve.control_points, curve.knots, curve.weights)]
    for t in samples(curve):
        want = [float(x) for x in curve_point(data[0], data[1], degree, data[2], fractions(float(t)))]
        # About ten roundings of numbers near one.
        np.testing.assert_allclose(curve.evaluate(t), want, rtol=0, atol=4e-15 * max(1.0, curve.size))


def test_derivatives_are_central_differences():
    curve = random_curve(3, 4)
    h = 1e-5
    t = np.random.default_rng(0).uniform(*curve.domain, 200)
    # Both neighbors in the span of t, where the curve is smooth.
    t = t[np.abs(t[:, None] - curve.breaks()).min(axis=1) > 2 * h]
    _, ct, ctt = curve.evaluate(t, 2)
    before, after = curve.evaluate(t - h, 1), curve.evaluate(t + h, 1)
    # Truncation h^2 / 6 times the third derivative, below 1e-6 of the largest value.
    np.testing.assert_allclose((after[0] - before[0]) / (2 * h), ct, rtol=0, atol=1e-6 * np.abs(ctt).max())
    np.testing.assert_allclose((after[1] - before[1]) / (2 * h), ctt, rtol=0, atol=1e-5 * np.abs(ctt).max())


def test_orders_agree_and_shapes_broadcast():
    curve = random_curve(4, 3)
    t = np.random.default_rng(1).uniform(*curve.domain, (4, 5))
    full = curve.evaluate(t, 2)
    assert all(x.shape == (4, 5, 3) for x in full)
    assert np.array_equal(curve.evaluate(t), full[0])
    assert all(np.array_equal(a, b) for a, b in zip(curve.evaluate(t, 1), full[:2], strict=True))
    assert np.array_equal(curve.evaluate(float(t[2, 3])), full[0][2, 3])
    assert np.array_equal(curve.evaluate(t[:, ::2]), full[0][:, ::2])
    assert curve.evaluate(np.empty(0), 2)[2].shape == (0, 3)


def test_a_read_only_or_integer_parameter_is_evaluated():
    curve = NurbsCurve([[0, 0], [2, 4]], [0, 0, 2, 2], 1)
    t = np.array([0.5, 1.0])
    t.flags.writeable = False
    assert curve.evaluate(t).tolist() == [[0.5, 1.0], [1.0, 2.0]]
    assert curve.evaluate(1).tolist() == [1.0, 2.0]


def test_a_closed_curve_wraps_and_an_open_one_does_not():
    square = NurbsCurve([[0, 0], [1, 0], [1, 1], [0, 1], [0, 0]], [0, 0, 1, 2, 3, 4, 4], 1)
    assert square.closed
    for t in (-0.25, 3.75, 7.75, -8.25):
        # The remainder of t by the period is exact here.
        assert square.evaluate(t).tolist() == [0.0, 0.25]
    assert square.evaluate(-1e-30).tolist() == [0.0, 0.0]
    line = random_curve(5, 2)
    assert not line.closed
    low, high = line.domain
    for t in (low - 1e-6, high + 1e-6):
        with pytest.raises(ValueError, match=r"t is .*domain"):
            line.evaluate([low, t])
    # Beyond the end by rounding is the end.
    assert np.array_equal(line.evaluate(np.nextafter(high, np.inf)), line.evaluate(high))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_parameter_that_is_not_finite_is_refused(closed, bad):
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0 if closed else 1]]
    curve = NurbsCurve(points, [0, 0, 1, 2, 3, 3], 1)
    assert curve.closed is closed
    with pytest.raises(ValueError, match="t is"):
        curve.evaluate([0.5, bad])


def test_periodic_unclamped_knots_make_a_smooth_closed_curve():
    degree, n = 3, 7
    ring = np.random.default_rng(6).normal(size=(n, 3))
    curve = NurbsCurve(np.concatenate([ring, ring[:degree]]), np.arange(n + 2 * degree + 1.0), degree)
    assert curve.closed
    assert curve.domain == (3.0, 10.0)
    for a, b in zip(curve.evaluate(3.0, 2), curve.evaluate(10.0, 2), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13)


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 1000), st.sampled_from(DEGREES), st.sampled_from(KINDS), st.floats(0.0, 1.0), st.integers(1, 3))
def test_knot_insertion_keeps_the_curve(seed, degree, kind, part, times):
    curve = random_curve(seed, degree, kind)
    low, high = curve.domain
    value = min(max(low + part * (high - low), low), high)
    workspace = degree - int(np.count_nonzero(curve.knots == value))
    near = np.abs(curve.breaks() - value)
    if times > workspace:
        with pytest.raises(ValueError, match="times is"):
            curve.insert_knot(value, times)
        return
    if (near[near > 0.0] < 1e-9).any():
        return  # a sliver of a span is refused or badly conditioned, and another test's business
    finer = curve.insert_knot(value, times)
    assert finer.knots.size == curve.knots.size + times
    assert_same_geometry(curve, finer)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("degree", DEGREES)
def test_elevation_and_bezier_pieces_keep_the_curve(degree, kind):
    curve = random_curve(7, degree, kind)
    for target in (degree, degree + 1, degree + 3):
        raised = curve.elevate(target)
        assert raised.degree == target
        assert_same_geometry(curve, raised)
    pieces, breaks = curve.bezier_pieces(), curve.breaks()
    assert pieces.shape == (breaks.size - 1, degree + 1, 4)
    assert np.array_equal(pieces[1:, 0], pieces[:-1, -1])
    bezier_knots = np.repeat([0.0, 1.0], degree + 1)
    for k, piece in enumerate(pieces):
        x = np.linspace(0.0, 1.0, 5)
        part = NurbsCurve(piece[:, :3] / piece[:, 3:], bezier_knots, degree, piece[:, 3])
        t = np.clip(breaks[k] + x * (breaks[k + 1] - breaks[k]), *curve.domain)
        np.testing.assert_allclose(part.evaluate(x), curve.evaluate(t), rtol=0, atol=1e-13 * curve.size)


@pytest.mark.parametrize("kind", KINDS)
def test_reversal_runs_backwards_over_the_same_domain(kind):
    curve = random_curve(8, 3, kind)
    back = curve.reversed()
    t = samples(curve)
    assert back.domain == curve.domain
    mirrored = np.clip(sum(curve.domain) - t, *curve.domain)
    np.testing.assert_allclose(back.evaluate(mirrored), curve.evaluate(t), rtol=0, atol=1e-13 * curve.size)


def test_transformation_moves_every_point():
    curve = random_curve(9, 3)
    rotation = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    t = samples(curve)
    want = 2.0 * curve.evaluate(t) @ rotation.T + [1.0, 2.0, 3.0]
    got = curve.transformed(rotation, (1.0, 2.0, 3.0), 2.0).evaluate(t)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-13 * curve.size)
    with pytest.raises(ValueError, match="plane"):
        random_curve(9, 3, dimension=2).transformed()


def test_box_and_size_hold_the_curve():
    curve = random_curve(10, 5)
    low, high = curve.bounding_box()
    points = curve.evaluate(np.linspace(*curve.domain, 500))
    rounding = 1e-14 * curve.size  # of the points themselves: the ends are control points
    assert (points >= low - rounding).all() and (points <= high + rounding).all()
    assert curve.size == pytest.approx(np.linalg.norm(high - low), rel=1e-15)


def test_a_single_point_is_not_closed():
    dot = NurbsCurve(np.ones((3, 2)), [0, 0, 0, 1, 1, 1], 2)
    assert dot.size == 0.0 and not dot.closed
    assert np.array_equal(dot.evaluate(0.3, 1)[1], np.zeros(2))


def test_arrays_are_copies_and_read_only():
    points = np.array([[0.0, 0.0], [1.0, 1.0]])
    curve = NurbsCurve(points, [0, 0, 1, 1], 1, name="edge")
    points[:] = 7.0
    assert curve.evaluate(1.0).tolist() == [1.0, 1.0]
    assert curve.name == "edge" and "edge" in repr(curve)
    for array in (curve.control_points, curve.knots, curve.weights):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_a_tiny_and_a_huge_domain_give_the_same_points():
    points = np.random.default_rng(11).normal(size=(6, 3))
    knots = np.array([0, 0, 0, 0, 0.3, 0.6, 1, 1, 1, 1])
    want = NurbsCurve(points, knots, 3).evaluate([0.1, 0.45, 0.9])
    for scale in (1e-12, 1e9):
        got = NurbsCurve(points, scale * knots, 3).evaluate(scale * np.array([0.1, 0.45, 0.9]))
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-13)
    with pytest.raises(ValueError, match="knots span"):
        NurbsCurve(points, 1e-200 * knots, 3).evaluate(0.0)


def test_bezier_and_polyline_are_what_they_say() -> None:
    corners = np.array([[0.0, 0.0, 1.0], [1.0, 2.0, 0.5], [4.0, 1.0, 0.0]])
    parabola = NurbsCurve.bezier(corners)
    assert parabola.degree == 2 and parabola.domain == (0.0, 1.0)
    # By hand, (1 - t)^2 P0 + 2 t (1 - t) P1 + t^2 P2; a few roundings of numbers up to 4.
    assert (
        np.abs(parabola.evaluate(0.25) - (0.5625 * corners[0] + 0.375 * corners[1] + 0.0625 * corners[2])).max() < 2e-15
    )
    path = NurbsCurve.polyline(corners)
    assert path.domain == (0.0, 2.0)
    assert np.abs(path.evaluate([0.0, 1.0, 2.0]) - corners).max() < 2e-15
    assert np.abs(path.evaluate(1.25) - (0.75 * corners[1] + 0.25 * corners[2])).max() < 2e-15
