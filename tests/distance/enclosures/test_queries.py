"""Certified distances by enclosures: bounds against dense sampling with a polish, statuses, degenerate pairs."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest
from scipy.optimize import minimize, nnls

import assembly as asm
from assembly.distance.enclosures.queries import enclosed_distance
from assembly.distance.separation import SeparationStatus as Status
from assembly.errors import InputError
from assembly.proximity import minimum_distance

T = ca.SX.sym("t")
HEXAGON = np.array([0.9, 0.5]) + 0.25 * np.stack([np.cos(np.arange(6) + 0.2), np.sin(np.arange(6) + 0.2)], 1)
SQUARE = np.array([[1.0, -1.0], [1.0, 1.0], [3.0, 1.0], [3.0, -1.0]])
CIRCLE = asm.curves.ellipse((1.0, 1.0))


def waves(rng):
    a = rng.normal(size=(3, 5))
    terms = ca.vertcat(1, ca.sin(T), ca.cos(2 * T), T / 3, ca.sin(3 * T) / 3)
    return asm.FormulaCurve(ca.mtimes(ca.SX(a), terms), T, (0.0, rng.uniform(0.5, 6.0)))


def spline(rng, d):
    n = int(rng.integers(2, 11))
    weights = rng.uniform(0.3, 3.0, n) if rng.random() < 0.5 else None
    if rng.random() < 0.6:
        return asm.NurbsCurve.bezier(rng.uniform(-1, 1, (n, d)), weights)
    degree = min(3, n - 1)
    inner = np.sort(rng.uniform(0, 1, n - degree - 1))
    knots = [*[0] * (degree + 1), *inner, *[1] * (degree + 1)]
    return asm.NurbsCurve(rng.uniform(-1, 1, (n, d)), knots, degree, weights)


def random_curve(rng, d):
    if rng.random() < 0.35:
        return spline(rng, d)
    size, turn = rng.uniform(0.3, 1.0), {"angle": rng.uniform(0, 360), "center": rng.uniform(-1.5, 1.5, 2)}
    if d == 3:
        if rng.random() < 0.5:
            return waves(rng)
        return asm.curves.helix(size, rng.uniform(0.1, 1), rng.uniform(0.3, 3), center=rng.uniform(-1, 1, 3))
    makers = [
        lambda: asm.curves.heart(size / 16, **turn),
        lambda: asm.curves.epicycloid(size / 7, **turn),
        lambda: asm.curves.ellipse((size, size * rng.uniform(0.2, 1)), **turn),
        lambda: asm.curves.involute(size / 10, **turn),
        lambda: asm.curves.fish(size, **turn),
        lambda: asm.curves.lissajous((size, size), phase=rng.uniform(0, 90), **turn),
    ]
    return makers[rng.integers(len(makers))]()


def random_hull(rng, d):
    k = int(rng.integers(1, 9))
    if k == 1:
        return rng.uniform(-2, 2, d)
    return rng.uniform(-1.5, 1.5, d) + rng.normal(size=(k, d)) * rng.uniform(0.05, 0.5)


def to_hull(x, points):
    """Distance to a hull by weights that are not negative; a stiff row makes them sum to one."""
    points = np.atleast_2d(points)
    stiff = 1e5
    weights, _ = nnls(
        np.vstack([(points - x).T, stiff * np.ones(len(points))]), np.concatenate([np.zeros(len(x)), [stiff]])
    )
    return float(np.linalg.norm(weights / weights.sum() @ points - x))


def reached(a, b):
    """A distance of two points of the shapes, as small as sampling and descent find it."""
    s = np.linspace(*a.domain, 300)
    p = a.evaluate(s)
    if isinstance(b, np.ndarray):
        return float(min(to_hull(x, b) for x in p)) if b.ndim == 2 else float(np.linalg.norm(p - b, axis=1).min())
    t = np.linspace(*b.domain, 300)
    grid = np.linalg.norm(p[:, None] - b.evaluate(t)[None], axis=2)
    least = grid.min()

    def squared(x):
        return ((a.evaluate(np.clip(x[0], *a.domain)) - b.evaluate(np.clip(x[1], *b.domain))) ** 2).sum()

    for k in np.argsort(grid.ravel())[:2]:
        start = np.array([s[k // 300], t[k % 300]])
        found = minimize(squared, start, bounds=[a.domain, b.domain], options={"ftol": 1e-30, "gtol": 1e-14})
        least = min(least, np.sqrt(found.fun))
    return float(least)


def check(a, b, answer, tolerance=1e-10):
    """What is true of every answer. Points are computed by another way here: 1e-12 of a size of one."""
    assert 0.0 <= answer.lower <= answer.upper
    assert np.linalg.norm(answer.points[0] - answer.points[1]) <= answer.upper * (1 + 1e-15)
    assert np.linalg.norm(a.evaluate(answer.parameters[0]) - answer.points[0]) < 1e-12
    if isinstance(b, np.ndarray):
        assert len(answer.parameters) == 1
        assert to_hull(answer.points[1], b) < 1e-9
    else:
        assert np.linalg.norm(b.evaluate(answer.parameters[1]) - answer.points[1]) < 1e-12
    if answer.status is Status.CONVERGED:
        assert answer.upper - answer.lower <= tolerance
    least = reached(a, b)
    assert answer.lower <= least * (1 + 1e-12) + 1e-13
    if answer.status is Status.HIT:
        assert answer.upper < 1e-10
    return least


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("d", [2, 3])
def test_random_pairs(seed, d, cases):
    rng = np.random.default_rng([seed, d])
    seen = set()
    for _ in range(cases(4, 15)):
        a = random_curve(rng, d)
        b = random_curve(rng, d) if rng.random() < 0.5 else random_hull(rng, d)
        answer = enclosed_distance(a, b)
        least = check(a, b, answer)
        seen.add(answer.status)
        # The minimum itself, not a local one: sampling finds nothing nearer, and little farther.
        if isinstance(b, asm.NurbsCurve | asm.FormulaCurve):
            assert answer.lower >= least - 1e-6 or answer.status is Status.HIT
    assert Status.CONVERGED in seen and seen <= {Status.CONVERGED, Status.HIT}


@pytest.mark.parametrize("bound", ["auto", "ellipsoid", "capsule", "taylor"])
@pytest.mark.parametrize("polish", [False, True])
def test_every_bound_has_the_same_answer(bound, polish):
    rng = np.random.default_rng(5)
    pairs = [(asm.curves.heart(0.02), HEXAGON), (asm.curves.helix(), np.array([2.0, 0.3, 0.5]))]
    pairs += [(random_curve(rng, 2), asm.curves.fish(0.5, center=(4.0, 0.0))) for _ in range(2)]
    for a, b in pairs:
        best = enclosed_distance(a, b)
        answer = enclosed_distance(a, b, 1e-7, bound=bound, polish=polish, max_evaluations=20_000)
        assert answer.status is Status.CONVERGED
        assert answer.lower <= best.upper and best.lower <= answer.upper
        check(a, b, answer, 1e-7)


def test_operands_in_either_order():
    heart, spiral = asm.curves.heart(0.02), asm.curves.involute(0.03, center=(1.2, 0.1))
    for b in (HEXAGON, np.array([1.0, 0.2]), spiral):
        one, two = enclosed_distance(heart, b), enclosed_distance(b, heart)
        assert one.lower <= two.upper and two.lower <= one.upper
        np.testing.assert_allclose(one.points, two.points[::-1], rtol=0, atol=1e-7)
    np.testing.assert_allclose(two.parameters, one.parameters[::-1], rtol=0, atol=1e-7)


def test_formula_against_its_own_bezier_curve():
    rng = np.random.default_rng(7)
    points = rng.uniform(-1, 1, (4, 3))
    weights = [(1 - T) ** 3, 3 * T * (1 - T) ** 2, 3 * T**2 * (1 - T), T**3]
    formula = asm.FormulaCurve(sum(w * ca.SX(p) for w, p in zip(weights, points, strict=True)), T, (0.0, 1.0))
    bezier = asm.NurbsCurve.bezier(points)
    for _ in range(10):
        b = rng.uniform(-2, 2, 3)
        one, two = enclosed_distance(formula, b), enclosed_distance(bezier, b)
        assert abs(one.upper - two.upper) < 1e-10


# Hulls.


def test_features_of_hulls():
    # Nearest to the circle: an edge, a vertex; in space a face, an edge and a vertex of a box.
    edge = enclosed_distance(CIRCLE, SQUARE + (1.0, 0.0))
    assert edge.lower <= 1.0 <= edge.upper and edge.upper - edge.lower < 1e-13
    vertex = enclosed_distance(CIRCLE, np.array([[2.0, 2.0], [3.0, 2.0], [2.0, 3.0]]))
    assert vertex.upper == pytest.approx(np.sqrt(8.0) - 1.0, abs=1e-13)
    box = np.array([(x, y, z) for x in (1.5, 2.5) for y in (-3.0, 3.0) for z in (-3.0, 3.0)])
    ring = asm.FormulaCurve(ca.vertcat(ca.cos(T), ca.sin(T), 0.3 * ca.sin(T)), T, (0.0, 6.2))
    assert enclosed_distance(ring, box).upper == pytest.approx(0.5, abs=1e-13)
    for rows in (box + (0.0, 5.0, 0.0), box + (0.0, 5.0, 5.0)):
        answer = enclosed_distance(ring, rows)
        assert answer.status is Status.CONVERGED and answer.evaluations < 60
        check(ring, rows, answer)


@pytest.mark.parametrize("d", [2, 3])
def test_the_nearest_feature_changes_along_the_curve(d, cases):
    # Small and thin hulls: on most pieces the curve passes several features, and the least distance is at any of them.
    rng = np.random.default_rng(d)
    for _ in range(cases(20, 60)):
        curve = random_curve(rng, d)
        hull = rng.uniform(-1, 1, d) + rng.normal(size=(rng.integers(2, 6), d)) * 10.0 ** rng.uniform(-3, -0.5, d)
        answer = enclosed_distance(curve, hull)
        points = curve.evaluate(np.linspace(*curve.domain, 4001))
        near = points[np.linalg.norm(points - hull.mean(axis=0), axis=1).argsort()[:150]]
        dense = min(to_hull(x, hull) for x in near)
        assert answer.lower <= dense + 1e-9 and answer.upper <= dense + 1e-9


def test_inside_a_polygon_is_a_hit():
    for hull in (1.5 * (SQUARE - (2.0, 0.0)), np.array([[-9.0, -9.0], [9.0, -9.0], [0.0, 15.0]])):
        for clearance in (None, 0.0):
            answer = enclosed_distance(CIRCLE, hull, clearance=clearance)
            assert answer.status is Status.HIT and answer.lower == answer.upper == 0.0
            assert to_hull(answer.points[0], hull) < 1e-9
    tetrahedron = np.array([[-2.0, -2, -1], [3, -2, -1], [0, 3, -1], [0, 0, 4]])
    assert enclosed_distance(asm.curves.helix(0.2, 0.1, 1.0), tetrahedron, clearance=0.0).status is Status.HIT
    assert enclosed_distance(asm.curves.helix(0.2, 0.1), tetrahedron + 9, clearance=0.0).status is Status.DISJOINT


def test_hulls_alone():
    assert enclosed_distance(SQUARE, SQUARE + (0.5, 0.3)).status is Status.HIT
    answer = enclosed_distance(SQUARE, np.array([0.0, 0.0]))
    assert answer.lower <= 1.0 <= answer.upper < 1.0 + 1e-13 and answer.status is Status.CONVERGED
    np.testing.assert_allclose(answer.points, [[1.0, 0.0], [0.0, 0.0]], rtol=0, atol=1e-13)
    cube = np.array([(x, y, z) for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    answer = enclosed_distance(cube, cube + (2.0, 2.0, 0.2), clearance=1.0)
    assert answer.status is Status.SEPARATED and answer.lower == pytest.approx(np.sqrt(2.0), abs=1e-13)
    assert len(answer.parameters) == 0


def test_redundant_vertices_change_nothing():
    rng = np.random.default_rng(8)
    inside = rng.dirichlet(np.ones(4), 20) @ SQUARE
    double = np.vstack([SQUARE, SQUARE, inside, 0.5 * (SQUARE[:1] + SQUARE[1:2])])
    curve = asm.curves.fish(0.5, center=(0.0, 0.3))
    one, two = enclosed_distance(curve, SQUARE), enclosed_distance(curve, double)
    assert one.upper == pytest.approx(two.upper, abs=1e-13) and two.status is Status.CONVERGED
    flat = np.array([[2.0, 0.0], [2.0, 1.0], [2.0, 0.5]])
    assert enclosed_distance(CIRCLE, flat).upper == pytest.approx(1.0, abs=1e-13)


# Clearances.


def test_three_answers_to_a_clearance():
    rng = np.random.default_rng(9)
    for _ in range(12):
        a = random_curve(rng, 2)
        b = random_curve(rng, 2) if rng.random() < 0.5 else random_hull(rng, 2)
        d = enclosed_distance(a, b)
        if d.upper < 1e-3:
            continue
        assert enclosed_distance(a, b, clearance=0.5 * d.lower).status is Status.SEPARATED
        near = enclosed_distance(a, b, clearance=1.1 * d.upper)
        assert near.status is Status.NOT_SEPARATED and near.upper <= 1.1 * d.upper
        assert enclosed_distance(a, b, clearance=0.0).status is Status.DISJOINT
        middle = 0.5 * (d.lower + d.upper)
        open_ = enclosed_distance(a, b, 1e-6, clearance=middle)
        assert open_.status in (Status.UNDECIDED, Status.SEPARATED, Status.NOT_SEPARATED)
        assert open_.lower <= d.upper and d.lower <= open_.upper


def test_crossing_plane_curves_are_hits():
    a = asm.curves.lissajous((1.1, 0.7))
    for b in (CIRCLE, asm.curves.fish(0.9), asm.NurbsCurve.polyline([[-2.0, 0.1], [0.0, 0.2], [2.0, -0.3]])):
        for clearance in (None, 0.0):
            answer = enclosed_distance(a, b, clearance=clearance)
            assert answer.status is Status.HIT and answer.lower == 0.0 and answer.upper < 1e-10


def test_touching_is_open():
    other = asm.curves.ellipse((1.0, 1.0), center=(2.0, 0.0))
    answer = enclosed_distance(CIRCLE, other, clearance=0.0)
    assert answer.status is Status.UNDECIDED and answer.upper < 1e-10 and answer.lower == 0.0
    assert enclosed_distance(CIRCLE, other).status is Status.CONVERGED
    edge = enclosed_distance(CIRCLE, SQUARE, clearance=0.0)
    assert edge.status in (Status.UNDECIDED, Status.HIT) and edge.upper < 1e-10


def test_space_curves_that_cross_are_open():
    a = asm.FormulaCurve(ca.vertcat(T, T**2, ca.sin(T)), T, (-1.0, 1.0))
    b = asm.FormulaCurve(ca.vertcat(-T, T, T), T, (-1.0, 1.0))
    answer = enclosed_distance(a, b, clearance=0.0)
    assert answer.status is Status.UNDECIDED and answer.upper <= 1e-10


# Degenerate minima.


def test_center_of_a_circle():
    answer = enclosed_distance(CIRCLE, np.array([0.0, 0.0]))
    assert answer.status is Status.CONVERGED and answer.lower <= 1.0 <= answer.upper


def test_center_of_curvature():
    # Of the ellipse's vertex at (0, 1): the minimum there is of fourth order.
    answer = enclosed_distance(asm.curves.ellipse((2.0, 1.0)), np.array([0.0, -3.0]) + (0.0, 3.0))
    assert answer.upper == pytest.approx(1.0, abs=1e-10)
    end = np.array([1.5, 0.0])  # the center of curvature of (2, 0): b^2 / a from it
    flat = enclosed_distance(asm.curves.ellipse((2.0, 1.0)), end)
    assert flat.status is Status.CONVERGED and flat.lower <= 0.5 <= flat.upper
    plain = enclosed_distance(asm.curves.ellipse((2.0, 1.0)), end, bound="ellipsoid", polish=False)
    assert plain.status is Status.CONVERGED and flat.evaluations < plain.evaluations


def test_ties():
    answer = enclosed_distance(asm.curves.ellipse((2.0, 1.0)), np.array([0.0, 0.0]))
    assert answer.status is Status.CONVERGED and answer.lower <= 1.0 <= answer.upper
    two = enclosed_distance(asm.curves.ellipse((1.0, 0.5)), asm.curves.ellipse((1.0, 0.5), center=(0.0, 3.0)))
    assert two.status is Status.CONVERGED and two.upper == pytest.approx(2.0, abs=1e-10)


def test_minima_at_ends():
    arc = asm.FormulaCurve(ca.vertcat(ca.cos(T), ca.sin(T)), T, (0.0, 1.0))
    answer = enclosed_distance(arc, np.array([1.5, -1.0]))
    assert answer.parameters[0] == 0.0 and answer.upper == pytest.approx(np.hypot(0.5, 1.0), abs=1e-14)
    both = enclosed_distance(arc, asm.FormulaCurve(ca.vertcat(2 + T, -1 - T), T, (0.0, 1.0)))
    assert both.parameters.tolist() == [0.0, 0.0]


def test_kinks_and_steep_ends():
    vee = asm.FormulaCurve(ca.vertcat(T, ca.fabs(T)), T, (-1.0, 2.0))
    answer = enclosed_distance(vee, np.array([0.0, -1.0]), 1e-8)
    assert answer.status is Status.CONVERGED and answer.lower <= 1.0 <= answer.upper
    steep = asm.FormulaCurve(ca.vertcat(ca.sqrt(T), T), T, (0.0, 1.0))
    answer = enclosed_distance(steep, np.array([-1.0, 0.0]), 1e-6)
    assert answer.status is Status.CONVERGED and answer.lower <= 1.0 <= answer.upper


@pytest.mark.parametrize("scale", [1e-9, 1e9])
def test_scales(scale):
    a, b = asm.curves.heart(0.02 * scale), HEXAGON * scale
    one = enclosed_distance(asm.curves.heart(0.02), HEXAGON)
    answer = enclosed_distance(a, b, 1e-10 * scale)
    assert answer.status is Status.CONVERGED
    assert answer.upper == pytest.approx(scale * one.upper, rel=1e-9)


def test_far_from_the_origin():
    far = np.array([1e6, -1e6])
    one = enclosed_distance(asm.curves.heart(0.02), HEXAGON)
    answer = enclosed_distance(asm.curves.heart(0.02, center=far), HEXAGON + far, 1e-8)
    # The shapes themselves are rounded to 1e-10 there.
    assert answer.status is Status.CONVERGED and answer.upper == pytest.approx(one.upper, abs=2e-9)


# Budgets and bad input.


@pytest.mark.parametrize("budget", [1, 2, 3, 5, 10, 30, 100])
def test_budgets_give_true_bounds(budget):
    pairs = [
        (asm.curves.heart(0.02), HEXAGON),
        (asm.curves.fish(0.3), asm.curves.lissajous((0.3, 0.3), (4, 3), center=(0.9, 0.2))),
        (asm.NurbsCurve.polyline(np.random.default_rng(1).normal(size=(9, 2))), np.array([4.0, 4.0])),
    ]
    for a, b in pairs:
        best = enclosed_distance(a, b)
        for polish in (True, False):
            answer = enclosed_distance(a, b, bound="ellipsoid", polish=polish, max_evaluations=budget)
            assert answer.lower <= best.upper and best.lower <= answer.upper
            assert answer.status in (Status.CONVERGED, Status.BUDGET_SPENT)
            # Both halves of a pair are bounded, and the first pairs of smooth parts all.
            assert answer.evaluations <= max(budget + 1, 8)
            assert np.isfinite(answer.upper)


def test_a_search_longer_than_the_room_that_it_begins_with():
    circle = asm.curves.ellipse((1.0, 1.0))
    answer = enclosed_distance(circle, np.zeros(2), bound="ellipsoid", polish=False, max_evaluations=5000)
    assert answer.status is Status.BUDGET_SPENT and 5000 <= answer.evaluations <= 5001
    assert answer.lower <= 1.0 <= answer.upper


def test_a_small_budget_leaves_nothing_for_the_next():
    plain = {"bound": "ellipsoid", "polish": False}
    assert enclosed_distance(CIRCLE, HEXAGON + 1, **plain, max_evaluations=1).status is Status.BUDGET_SPENT
    assert enclosed_distance(CIRCLE, HEXAGON + 1, **plain).status is Status.CONVERGED


def test_answers_are_repeated_to_the_bit():
    for _ in range(3):
        answers = [enclosed_distance(asm.curves.heart(0.02), HEXAGON) for _ in range(2)]
        assert answers[0].lower == answers[1].lower and answers[0].evaluations == answers[1].evaluations


@pytest.mark.parametrize(
    ("arguments", "error", "match"),
    [
        ({"a": "heart"}, TypeError, "a is 'heart'; expected a FormulaCurve"),
        ({"b": asm.shapes.sphere(1.0)}, TypeError, "b is .*expected a FormulaCurve, a NurbsCurve, a point"),
        ({"b": np.zeros(3)}, InputError, "a is 2-D and b 3-D"),
        ({"b": np.zeros(4)}, InputError, "b has shape"),
        ({"b": np.zeros((0, 2))}, InputError, "b has shape"),
        ({"b": [[0.0, np.nan]]}, InputError, r"b\[0, 1\] is nan"),
        ({"tolerance": 0.0}, InputError, "tolerance is 0"),
        ({"clearance": -1.0}, InputError, "clearance is -1; expected zero"),
        ({"bound": "sphere"}, InputError, "bound is 'sphere'; expected one of auto"),
        ({"bound": np.zeros(2)}, InputError, "bound is array.*; expected one of auto"),
        ({"bound": {}}, InputError, "bound is {}; expected one of auto"),
        ({"b": np.ma.array([0.0, 1.0], mask=[True, False])}, InputError, "b has masked values; expected real numbers"),
        ({"polish": 1}, InputError, "polish is 1"),
        ({"max_evaluations": 0}, InputError, "max_evaluations is 0"),
    ],
)
def test_bad_input(arguments, error, match):
    with pytest.raises(error, match=match):
        enclosed_distance(**{"a": CIRCLE, "b": np.array([3.0, 0.0]), **arguments})


def test_where_nothing_is_known_the_points_are_the_shapes_own():
    """In its middle this curve is a quotient by zero to intervals, not to doubles; what came before is gone."""
    knots = np.r_[[0] * 3, np.linspace(0, 1, 11)[1:-1], [1] * 3]
    many = asm.NurbsCurve(np.random.default_rng(0).normal(size=(12, 2)), knots, 2)
    triangle = np.array([[0.0, 3.0], [1.0, 4.0], [2.0, 3.0]])
    enclosed_distance(many, triangle + [1.5, -3.5])
    column = ca.vertcat(T, 1.0 + 1e-20 / ca.sin(np.pi * T))
    level = asm.FormulaCurve(column, T, (0.5, 1.5), derivative=ca.SX([1, 0]), error=1e-3)
    for a, b in ((level, triangle), (triangle, level)):
        answer = enclosed_distance(a, b, max_evaluations=1)
        assert answer.status is Status.BUDGET_SPENT
        assert 0.0 <= answer.lower <= 2.0 <= answer.upper < 2.3
        on_curve = answer.points[0 if a is level else 1]
        assert np.abs(on_curve - level.evaluate(float(answer.parameters[0]))).max() < 1e-9
        assert np.linalg.norm(answer.points[0] - answer.points[1]) <= answer.upper
    # From its middle on nothing more can be known; without it bounds come as near as the curve's own error lets them.
    part = asm.FormulaCurve(column, T, (0.6, 1.5), derivative=ca.SX([1, 0]), error=1e-3)
    answer = enclosed_distance(part, triangle)
    assert answer.status is Status.ROUNDED and answer.evaluations < 100
    assert 1.99 < answer.lower <= 2.0 <= answer.upper < 2.02


def on_a_grid(points):
    """Coordinates of 24 binary digits: added to integers below 2^28 they are exact."""
    return np.round(np.asarray(points) * 2.0**24) * 2.0**-24


@pytest.mark.parametrize("dimension", [2, 3])
def test_offsets_cost_splines_no_digits(dimension):
    """Moved by integers, shapes on a grid keep their distance exactly; so do the bounds, nearly."""
    rng = np.random.default_rng(9)
    knots = [0, 0, 0, 0, 0.25, 1, 1, 1, 1]
    for k in range(12):
        weights = 2.0 ** rng.integers(-2, 3, 5) if k % 3 == 0 else None
        points, hull = on_a_grid(rng.random((5, dimension))), on_a_grid(rng.random((6, dimension)) + 0.7)
        far = rng.choice([-1.0, 1.0], dimension) * 2.0 ** rng.integers(10, 28, dimension)
        near, away = (asm.NurbsCurve(points + move, knots, 3, weights) for move in (0.0, far))
        curves = [asm.NurbsCurve.bezier(hull[:4] + move) for move in (0.0, far)]
        for b, c, options in (
            (hull, hull + far, {}),
            (hull[0], hull[0] + far, {}),
            (*curves, {"bound": "taylor"}),
            (*curves, {"bound": "ellipsoid"}),
        ):
            one, two = enclosed_distance(near, b, **options), enclosed_distance(away, c, **options)
            assert two.status is one.status and two.converged
            assert max(one.lower, two.lower) <= min(one.upper, two.upper)
            assert two.upper - two.lower <= 1e-10
            # The points are rounded to doubles where they are.
            assert np.linalg.norm(two.points[0] - two.points[1]) <= two.upper + 4e-16 * np.abs(far).max()


def test_two_hulls_far_off():
    rng = np.random.default_rng(10)
    for _ in range(20):
        a, b = on_a_grid(rng.random((7, 3))), on_a_grid(rng.random((7, 3)) + rng.uniform(0.2, 1.5, 3))
        far = 2.0 ** rng.integers(10, 28, 3)
        one, two = enclosed_distance(a, b), enclosed_distance(a + far, b + far)
        assert one.status is two.status
        assert max(one.lower, two.lower) <= min(one.upper, two.upper) and two.upper - two.lower <= 1e-13


@pytest.mark.parametrize("offset", [1e6, 1e8])
def test_doubles_end_a_search_with_a_formula_far_off(offset):
    arc = asm.FormulaCurve(ca.vertcat(ca.cos(T) + offset, ca.sin(T) - offset), T, (0.0, 2.0))
    move = np.array([offset, -offset])
    for b in (move, SQUARE + move, asm.NurbsCurve.polyline(SQUARE + move)):
        for clearance in (None, 0.0):
            answer = enclosed_distance(arc, b, clearance=clearance)
            assert answer.evaluations < 20_000
            assert answer.upper - answer.lower <= 4e-15 * offset or answer.status in (Status.DISJOINT, Status.HIT)
            assert clearance is not None or answer.status is Status.ROUNDED


@pytest.mark.parametrize("spread", [1e3, 1e6, 1e9, 1e12])
def test_weights_of_all_sizes(spread):
    """Against a square, by the search for spline curves with its corner, edge by edge, as what is known."""
    rng = np.random.default_rng(11)
    for _ in range(6):
        curve = asm.NurbsCurve.bezier(rng.random((5, 2)), spread ** rng.uniform(-0.5, 0.5, 5))
        square = rng.uniform(1.0, 1.5, 2) + np.array([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
        answer = enclosed_distance(curve, square)
        sides = [minimum_distance(curve, asm.NurbsCurve.polyline(square[[k - 1, k]])) for k in range(4)]
        assert answer.status is Status.CONVERGED
        assert answer.lower <= min(side.upper for side in sides)
        assert answer.upper >= min(side.lower for side in sides)
