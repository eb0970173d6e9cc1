from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from assembly.geometry import shapes
from assembly.geometry.splines import evaluate as spline
from assembly.geometry.splines.curve import COINCIDENT, NurbsCurve
from assembly.geometry.splines.known_surface import known_surface
from assembly.geometry.splines.surface import NurbsSurface
from assembly.geometry.splines.surface_ends import is_one_curve
from tests.geometry.reference import KINDS, fractions, knot_vector, surface_derivatives, surface_point

DEGREES = [(1, 1), (2, 2), (3, 3), (1, 3), (3, 2), (4, 4), (2, 5), (6, 1), (7, 7)]


def random_surface(seed, degree, kinds=("clamped", "clamped"), rational=True):
    rng = np.random.default_rng([seed, *degree])
    counts = [p + 1 + int(rng.integers(1, 4)) for p in degree]
    points = rng.normal(size=(*counts, 3))
    weights = rng.uniform(0.4, 2.0, counts) if rational else None
    knots = [knot_vector(rng, p, n, kind) for p, n, kind in zip(degree, counts, kinds, strict=True)]
    return NurbsSurface(points, knots, degree, weights)


def samples(surface, count=8, seed=0):
    """Random parameters, and all pairs of knots."""
    rng = np.random.default_rng(seed)
    (a, b), (c, d) = surface.domain
    grid = np.meshgrid(*surface.breaks())
    u = np.concatenate([rng.uniform(a, b, count), grid[0].ravel()])
    return u, np.concatenate([rng.uniform(c, d, count), grid[1].ravel()])


def assert_same_geometry(a, b, tolerance=1e-13):
    # Two ways to compute the same point differ by some roundings of the coordinates.
    u, v = samples(a, 60)
    assert a.domain == b.domain
    np.testing.assert_allclose(a.evaluate(u, v), b.evaluate(u, v), rtol=0, atol=tolerance * a.size)


@pytest.mark.parametrize("rational", [False, True])
@pytest.mark.parametrize("kinds", [("clamped", "multiple"), ("multiple", "unclamped"), ("unclamped", "clamped")])
@pytest.mark.parametrize("degree", DEGREES)
def test_points_and_derivatives_are_those_of_the_recurrence(degree, kinds, rational, cases):
    surface = random_surface(1, degree, kinds, rational)
    u, v = samples(surface, cases(1, 6))
    got = surface.evaluate(u, v, 2)
    want = [
        np.array(x) for x in zip(*(surface_derivatives(surface, x, y) for x, y in zip(u, v, strict=True)), strict=True)
    ]
    for g, w, tolerance in zip(got, want, [1e-13, 1e-12, 1e-12, 1e-11, 1e-11, 1e-11], strict=True):
        # Each derivative divides rounding by a short span once more.
        np.testing.assert_allclose(g, w, rtol=0, atol=tolerance * max(1.0, np.abs(w).max()))


@pytest.mark.parametrize("degree", [(2, 2), (3, 3), (5, 2)])
def test_points_are_exact_to_rounding_against_fractions(degree):
    surface = random_surface(2, degree, ("multiple", "clamped"))
    points, weights = (fractions(x.tolist()) for x in (surface.control_points, surface.weights))
    knots = [fractions(x.tolist()) for x in surface.knots]
    u, v = samples(surface, 4)
    for x, y in zip(u, v, strict=True):
        exact = surface_point(points, knots, degree, weights, fractions(float(x)), fractions(float(y)))
        # Some ten roundings of numbers near one.
        np.testing.assert_allclose(surface.evaluate(x, y), [float(c) for c in exact], rtol=0, atol=4e-15 * surface.size)


def test_derivatives_are_central_differences():
    surface = random_surface(3, (3, 4))
    h = 1e-5
    rng = np.random.default_rng(0)
    u, v = (rng.uniform(*domain, 300) for domain in surface.domain)
    # All neighbors in the span of the point, where the surface is smooth.
    near = [np.abs(x[:, None] - at).min(axis=1) > 2 * h for x, at in zip((u, v), surface.breaks(), strict=True)]
    u, v = u[near[0] & near[1]], v[near[0] & near[1]]
    _, *first, suu, suv, svv = surface.evaluate(u, v, 2)
    in_u = [
        (b - a) / (2 * h) for a, b in zip(surface.evaluate(u - h, v, 1), surface.evaluate(u + h, v, 1), strict=True)
    ]
    in_v = [
        (b - a) / (2 * h) for a, b in zip(surface.evaluate(u, v - h, 1), surface.evaluate(u, v + h, 1), strict=True)
    ]
    scale = np.abs([suu, suv, svv]).max()
    # Truncation h^2 / 6 times a third derivative.
    for got, want in zip(
        [in_u[0], in_v[0], in_u[1], in_u[2], in_v[1], in_v[2]], [*first, suu, suv, suv, svv], strict=True
    ):
        np.testing.assert_allclose(got, want, rtol=0, atol=1e-5 * scale)


def test_orders_agree_and_parameters_broadcast():
    surface = random_surface(4, (3, 2))
    u = np.linspace(*surface.domain[0], 5)[:, None]
    v = np.linspace(*surface.domain[1], 7)
    full = surface.evaluate(u, v, 2)
    assert all(x.shape == (5, 7, 3) for x in full)
    assert np.array_equal(surface.evaluate(u, v), full[0])
    assert all(np.array_equal(a, b) for a, b in zip(surface.evaluate(u, v, 1), full[:3], strict=True))
    assert all(np.array_equal(a, b[2, 3]) for a, b in zip(surface.evaluate(u[2, 0], v[3], 2), full, strict=True))
    assert np.array_equal(surface.evaluate(u.T, v[:1]), surface.evaluate(u[:, 0], v[0])[None])
    assert surface.evaluate(np.empty((0, 2)), 0.0).shape == (0, 2, 3)
    with pytest.raises(ValueError, match="broadcast"):
        surface.evaluate(np.zeros(2), np.zeros(3))


def test_closed_directions_wrap_and_open_ones_do_not():
    ring = shapes.cylinder(1.0, 2.0)
    assert ring.closed == (True, False)
    period = ring.domain[0][1]
    for turns in (-2, -1, 1, 5):
        for a, b in zip(ring.evaluate(0.7 + turns * period, 0.3, 2), ring.evaluate(0.7, 0.3, 2), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-14 * 10)  # the remainder rounds at a few periods
    for u, v, name in (
        (0.0, -1e-9, "v"),
        (100.0, 2.1, "v"),
        (np.nan, 1.0, "u"),
        (np.inf, 1.0, "u"),
        (1.0, np.nan, "v"),
    ):
        with pytest.raises(ValueError, match=rf"^{name} is"):
            ring.evaluate([0.0, u], [0.0, v])
    with pytest.raises(ValueError, match="^u is 4"):
        shapes.plane(2.0, 2.0).evaluate(4.0, 0.0)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 500), st.sampled_from(DEGREES), st.sampled_from(KINDS), st.integers(0, 1), st.floats(0.02, 0.98))
def test_knot_insertion_keeps_the_surface(seed, degree, kind, direction, part):
    surface = random_surface(seed, degree, (kind, kind))
    low, high = surface.domain[direction]
    value = low + part * (high - low)
    if np.abs(surface.breaks()[direction] - value).min() < 1e-9:
        return  # a sliver of a span is refused or badly conditioned, and another test's business
    finer = surface.insert_knot(direction, value, degree[direction])
    assert finer.knots[direction].size == surface.knots[direction].size + degree[direction]
    assert np.array_equal(finer.knots[1 - direction], surface.knots[1 - direction])
    assert_same_geometry(surface, finer)
    with pytest.raises(ValueError, match="times is 1"):
        finer.insert_knot(direction, value)


@pytest.mark.parametrize("kinds", [("clamped", "multiple"), ("unclamped", "unclamped")])
@pytest.mark.parametrize("degree", DEGREES)
def test_elevation_and_bezier_pieces_keep_the_surface(degree, kinds):
    surface = random_surface(5, degree, kinds)
    p, q = degree
    for target in ((p, q), (p + 1, q), (p, q + 2), (p + 2, q + 1)):
        raised = surface.elevate(target)
        assert raised.degree == target
        assert_same_geometry(surface, raised)
    pieces, (at_u, at_v) = surface.bezier_pieces(), surface.breaks()
    assert pieces.shape == (at_u.size - 1, at_v.size - 1, p + 1, q + 1, 4)
    assert np.array_equal(pieces[1:, :, 0], pieces[:-1, :, -1])
    assert np.array_equal(pieces[:, 1:, :, 0], pieces[:, :-1, :, -1])
    x = np.linspace(0.0, 1.0, 4)
    knots = [np.repeat([0.0, 1.0], d + 1) for d in degree]
    for i, j in np.ndindex(pieces.shape[:2]):
        piece = pieces[i, j]
        part = NurbsSurface(piece[..., :3] / piece[..., 3:], knots, degree, piece[..., 3])
        u = np.clip(at_u[i] + x * (at_u[i + 1] - at_u[i]), *surface.domain[0])
        v = np.clip(at_v[j] + x * (at_v[j + 1] - at_v[j]), *surface.domain[1])
        np.testing.assert_allclose(
            part.evaluate(x[:, None], x), surface.evaluate(u[:, None], v), rtol=0, atol=1e-13 * surface.size
        )


@pytest.mark.parametrize("degree", DEGREES)
def test_reversal_and_transposition_keep_the_points_and_turn_the_normal(degree):
    surface = random_surface(6, degree, ("clamped", "unclamped"))
    u, v = samples(surface)
    (a, b), (c, d) = surface.domain
    back_u, back_v = np.clip(a + b - u, a, b), np.clip(c + d - v, c, d)
    tolerance = {"rtol": 0, "atol": 1e-13 * surface.size}
    want = surface.evaluate(u, v)
    np.testing.assert_allclose(surface.reversed(0).evaluate(back_u, v), want, **tolerance)
    np.testing.assert_allclose(surface.reversed(1).evaluate(u, back_v), want, **tolerance)
    np.testing.assert_allclose(surface.transposed().evaluate(v, u), want, **tolerance)
    inner_u, inner_v = u[:8], v[:8]
    normal = surface.normal(inner_u, inner_v)
    # The quotient by |Su x Sv| enlarges rounding where the net is folded.
    np.testing.assert_allclose(surface.transposed().normal(inner_v, inner_u), -normal, rtol=0, atol=1e-11)
    np.testing.assert_allclose(surface.reversed(0).normal(back_u[:8], inner_v), -normal, rtol=0, atol=1e-11)


def test_transformation_moves_every_point():
    surface = random_surface(7, (3, 2))
    rotation = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    u, v = samples(surface)
    want = 0.5 * surface.evaluate(u, v) @ rotation.T + [1.0, 2.0, 3.0]
    got = surface.transformed(rotation, (1.0, 2.0, 3.0), 0.5).evaluate(u, v)
    np.testing.assert_allclose(got, want, rtol=0, atol=1e-13 * surface.size)


def test_closed_looks_at_the_whole_edge():
    torus = shapes.torus(3.0, 1.0)
    assert torus.closed == (True, True)
    points = np.array(torus.control_points)
    points[-1, 3] += 1e-9
    assert NurbsSurface(points, torus.knots, torus.degree, torus.weights).closed == (False, True)
    weights = np.array(torus.weights)
    weights[-1, 3] *= 1.0 + 1e-9
    assert NurbsSurface(torus.control_points, torus.knots, torus.degree, weights).closed == (False, True)
    # One factor on a whole edge changes no point of the edge.
    weights = np.array(torus.weights)
    weights[-1] *= 1.5
    assert NurbsSurface(torus.control_points, torus.knots, torus.degree, weights).closed == (True, True)
    # Both ends of v are the same point, which is not an edge to cross.
    petal = NurbsSurface(
        [[[0, 0, 0], [1, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 0]]], ([0, 0, 1, 1], [0, 0, 1, 2, 2]), (1, 1)
    )
    assert petal.closed == (False, False)


def test_periodic_unclamped_knots_close_both_directions():
    rng = np.random.default_rng(8)
    n, m, p, q = 6, 5, 3, 2
    ring = rng.normal(size=(n, m, 3))
    ring = np.concatenate([ring, ring[:p]])
    ring = np.concatenate([ring, ring[:, :q]], axis=1)
    surface = NurbsSurface(ring, (np.arange(n + 2 * p + 1.0), np.arange(m + 2 * q + 1.0)), (p, q))
    assert surface.closed == (True, True)
    (a, b), (c, d) = surface.domain
    for x, y in zip(surface.evaluate(a, c, 2)[:5], surface.evaluate(b, d, 2)[:5], strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-13)
    np.testing.assert_allclose(
        surface.evaluate(a - 0.3, d + 0.7), surface.evaluate(b - 0.3, c + 0.7), rtol=0, atol=1e-13
    )


def test_bounding_sphere_and_box_hold_the_surface():
    for degree in DEGREES:
        surface = random_surface(9, degree)
        (a, b), (c, d) = surface.domain
        points = surface.evaluate(np.linspace(a, b, 60)[:, None], np.linspace(c, d, 60))
        low, high = surface.bounding_box()
        rounding = 1e-14 * surface.size  # of the points themselves: corners are control points
        assert (points >= low - rounding).all() and (points <= high + rounding).all()
        center, radius = surface.bounding_sphere()
        assert np.linalg.norm(points - center, axis=-1).max() <= radius + rounding
        assert radius <= 0.5 * surface.size * (1.0 + 1e-12)


@pytest.mark.parametrize("distance", [0.0, 1e-12, 3e-9, 0.9e-8, 1.2e-8, 1e-6, 1e-3])
def test_the_normal_is_unit_and_outward_up_to_the_poles(distance):
    ball = shapes.sphere(1.0)
    u = np.linspace(0.0, 6.0, 13)
    south, north = distance, ball.domain[1][1] - distance
    for v, side in ((south, -1.0), (north, 1.0)):
        got = ball.normal(u, v)
        np.testing.assert_allclose(np.linalg.norm(got, axis=1), 1.0, rtol=0, atol=1e-15)
        # On both sides of the switch to the limit the error is about the switch's distance, 1e-8 of pi; far from
        # it the rounding of the points, 1e-16, over the distance to the pole.
        tolerance = 1e-7 if distance < 1e-7 else 1e-14 / distance
        np.testing.assert_allclose(got, ball.evaluate(u, v), rtol=0, atol=tolerance)
        if distance == 0.0:
            np.testing.assert_allclose(got, np.tile([0.0, 0.0, side], (13, 1)), rtol=0, atol=1e-15)


def test_the_normal_at_an_apex_is_that_of_its_ruling():
    tip = shapes.cone(3.0, 4.0)
    u = np.linspace(*tip.domain[0], 9)
    np.testing.assert_allclose(
        tip.normal(u, tip.domain[1][1]), tip.normal(u, 0.5 * tip.domain[1][1]), rtol=0, atol=1e-14
    )


def test_a_surface_without_normal_says_so():
    line = NurbsSurface(np.arange(4.0).reshape(2, 2, 1) * [[[1.0, 2.0, 3.0]]], ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1))
    with pytest.raises(ValueError, match="without a normal"):
        line.normal(0.3, 0.4)
    dot = NurbsSurface(np.ones((2, 2, 3)), ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1))
    with pytest.raises(ValueError, match="without a normal"):
        dot.normal(0.3, 0.4)


def test_packed_is_cached_and_padded_to_bicubic_up_to_degree_three():
    for degree in DEGREES:
        surface = random_surface(10, degree, ("multiple", "clamped"))
        record, pool = surface.packed()
        assert surface.packed()[1] is pool
        assert record.dtype == np.int64 and record.size == spline.SURFACE_RECORD and pool.dtype == np.float64
        p, q = (3, 3) if max(degree) <= 3 else degree
        assert (spline.surface_at(record, 0).degree_u, spline.surface_at(record, 0).degree_v) == (p, q)
        at_u, at_v = surface.breaks()
        assert (record[spline.SPANS_U], record[spline.SPANS_V]) == (at_u.size - 1, at_v.size - 1)
        assert np.array_equal(pool[record[spline.BREAKS_U] :][: at_u.size], at_u)
        assert np.array_equal(pool[record[spline.BREAKS_V] :][: at_v.size], at_v)
        tables = 4 * (p + 1) * (q + 1) * (at_u.size - 1) * (at_v.size - 1)
        assert record[spline.CELLS] == record[spline.COEFFICIENTS] + tables
        assert pool.size == record[spline.CELLS] + 11 * record[spline.CELL_COUNT]
        # At the middle of a span the power table is its first coefficient.
        first = pool[record[spline.COEFFICIENTS] :][:4]
        middle = surface.evaluate(0.5 * (at_u[0] + at_u[1]), 0.5 * (at_v[0] + at_v[1]))
        np.testing.assert_allclose(first[:3] / first[3], middle, rtol=0, atol=1e-14 * surface.size)


def test_packed_records_can_be_joined_in_one_table():
    one, two = random_surface(11, (3, 3)), shapes.torus(3.0, 1.0)
    records, pools, offset = [], [], 0
    for surface in (one, two):
        record, pool = surface.packed()
        record = record.copy()
        record[[spline.BREAKS_U, spline.BREAKS_V, spline.COEFFICIENTS, spline.CELLS]] += offset
        offset += pool.size
        records.append(record)
        pools.append(pool)
    table, pool = np.concatenate(records), np.concatenate(pools)
    for k, surface in enumerate((one, two)):
        u, v = (0.3 * a + 0.7 * b for a, b in surface.domain)
        got = spline.surface_point(table, pool, k * spline.SURFACE_RECORD, u, v)
        np.testing.assert_array_equal(got, surface.evaluate(u, v, 2))


def test_a_packed_curve_can_be_read_by_kernels():
    curve = NurbsCurve([[0, 0], [1, 2], [3, 1], [4, 4]], [0, 0, 0, 1, 2, 2, 2], 2, [1, 2, 1, 1])
    record, pool = curve.packed()
    assert record.tolist() == [2, 2, 0, 3, 0] and pool.size == 3 + 2 * 3 * 4
    got = np.array(spline.curve_point(record, pool, 0, 1.3))
    assert np.array_equal(got[:, :2], curve.evaluate(1.3, 2)) and not got[:, 2].any()


def test_arrays_are_copies_and_read_only():
    surface = shapes.plane(1.0, 2.0, name="table")
    assert surface.name == "table" and "table" in repr(surface)
    for array in (surface.control_points, surface.knots[0], surface.knots[1], surface.weights, surface.bezier_pieces()):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    "surface",
    [
        shapes.plane(2.0, 3.0),
        shapes.cylinder(1.0, 2.0),
        shapes.cone(1.0, 2.0),
        shapes.sphere(2.0),
        shapes.torus(3.0, 1.0),
    ],
    ids=["plane", "cylinder", "cone", "sphere", "torus"],
)
def test_what_control_points_say_of_the_ends_is_what_pieces_say(surface):
    pieces, least = surface._pieces, COINCIDENT * surface.size
    edges = (pieces[0, :, 0], pieces[-1, :, -1], pieces[:, 0, :, 0], pieces[:, -1, :, -1])
    known = known_surface(*(np.array(surface.control_points), tuple(map(np.array, surface.knots))), surface.degree)
    points = [(edge[..., :3] / edge[..., 3:]).reshape(-1, 3) for edge in edges]
    poles = sum(bit for bit, rows in zip((1, 2, 4, 8), points, strict=True) if np.ptp(rows, axis=0).max() <= least)
    assert surface._pole_bits == poles
    tolerance = COINCIDENT * surface.size
    assert surface.closed == (is_one_curve(*edges[:2], tolerance), is_one_curve(*edges[2:], tolerance))
    if surface.degree == (1, 1):
        assert known.size == pytest.approx(surface.size, rel=1e-15) and known._apart == surface._apart
