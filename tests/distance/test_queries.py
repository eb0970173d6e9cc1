"""Certified queries on splines: what the verbs answer, statuses, degenerate cases, bad input."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import AssemblyError, InputError
from assembly.proximity import (
    SeparationStatus as Status,
)
from assembly.proximity import (
    closest_points,
    collides,
    is_separated,
    minimum_distance,
    minimum_distances,
)

# What is left of sixteen digits after some ten halvings: the kernels subtract a few dozen units of the last place.
TIGHT = 1e-13


def bezier(seed, degree=5, dimension=3, size=1.0, offset=0.0):
    points = np.random.default_rng(seed).random((degree + 1, dimension))
    return asm.NurbsCurve.bezier(offset + size * points)


def segment(a, b):
    return asm.NurbsCurve.polyline([a, b])


def arc(radius, angle=math.pi / 2, start=0.0, dimension=2):
    """An arc about the origin."""
    h = 0.5 * angle
    at = np.array([start, start + h, start + angle])
    radii = radius / np.array([1.0, math.cos(h), 1.0])
    points = np.zeros((3, dimension))
    points[:, 0], points[:, 1] = radii * np.cos(at), radii * np.sin(at)
    return asm.NurbsCurve.bezier(points, [1.0, math.cos(h), 1.0])


def circle(radius, x=0.0):
    corners = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    knots = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]
    weights = [1.0, math.sqrt(0.5)] * 4 + [1.0]
    return asm.NurbsCurve(radius * np.array(corners, dtype=float) + [x, 0.0], knots, 2, weights)


def check(answer, distance, tolerance=1e-10):
    """The bounds enclose a distance that is known to four units of its last place."""
    slack = 4e-16 * distance
    assert answer.lower <= distance + slack
    assert answer.upper >= distance - slack
    assert answer.upper - answer.lower <= tolerance
    assert answer.status is Status.CONVERGED and answer.converged


KNOWN = {
    "two points": (np.array([0.0, 0, 0]), np.array([1.0, 2, 2]), 3.0),
    "point over a segment": (segment((0, 0), (4, 0)), np.array([1.0, 2.0]), 2.0),
    "point beyond a segment": (segment((0, 0), (4, 0)), np.array([7.0, 4.0]), 5.0),
    "hull of one vertex": (segment((0, 0), (4, 0)), np.array([[7.0, 4.0]]), 5.0),
    "skew segments": (segment((-1, 0, 0), (1, 0, 0)), segment((0, -1, 2), (0, 1, 2)), 2.0),
    "parallel segments": (segment((0, 0), (1, 0)), segment((0, 0.5), (1, 0.5)), 0.5),
    "segments on a line, apart": (segment((0, 0), (1, 0)), segment((3, 0), (4, 0)), 2.0),
    "segments that overlap": (segment((0, 0), (1, 0)), segment((0.25, 0), (4, 0)), 0.0),
    "crossing": (segment((0, 0), (1, 1)), segment((0, 1), (1, 0)), 0.0),
    "center of an arc": (arc(2.0), np.zeros(2), 2.0),
    "center of a circle": (circle(2.0), np.zeros(2), 2.0),
    "point in a circle": (circle(2.0), np.array([0.6, 0.8]), 1.0),
    "concentric arcs": (arc(1.0), arc(1.25), 0.25),
    "concentric arcs in space": (arc(1.0, dimension=3), arc(1.25, dimension=3), 0.25),
    "concentric arcs of other ends": (arc(1.0), arc(1.25, 1.2, 0.1), 0.25),
    "circles side by side": (circle(1.0), circle(1.0, 3.0), 1.0),
    # y = x^2 has the curvature 2 at its vertex: four times the root of the distance is flat to third order.
    "center of curvature": (asm.NurbsCurve.bezier([(-1, 1), (0, -1), (1, 1)]), np.array([0.0, 0.5]), 0.5),
    "segment that ends there": (asm.NurbsCurve.bezier([(-1, 1), (0, -1), (1, 1)]), segment((0, 0.5), (0, 3)), 0.5),
    "tangent line": (arc(1.0, start=-0.5), segment((1, -1), (1, 1)), 0.0),
    "a curve of one point": (asm.NurbsCurve.bezier(np.ones((4, 3))), np.array([1.0, 1, 3]), 2.0),
    "two curves of one point": (asm.NurbsCurve.bezier(np.ones((4, 2))), segment((0, 0), (0, 0)), math.sqrt(2)),
    "a cusp": (asm.NurbsCurve.bezier([(0, 0), (1, 1), (0, 1), (1, 0)]), np.array([0.5, 2.0]), 1.25),
    "plane and point": (asm.shapes.plane(4.0, 4.0), np.array([0.5, 0.5, 2.0]), 2.0),
    "point and torus": (np.array([5.0, 0.0, 0.0]), asm.shapes.torus(2.0, 0.5), 2.5),
    "plane and a parallel segment": (asm.shapes.plane(4.0, 4.0), segment((0, 0, 1), (1, 0, 1)), 1.0),
    "two spheres": (asm.shapes.sphere(1.0), asm.shapes.sphere(1.0).transformed(None, (3, 1, 0)), math.sqrt(10.0) - 2.0),
}  # fmt: skip


@pytest.mark.parametrize("name", KNOWN)
def test_known_distances(name):
    a, b, distance = KNOWN[name]
    check(minimum_distance(a, b), distance)
    check(minimum_distance(b, a), distance)


@pytest.mark.parametrize("name", KNOWN)
def test_statuses_on_both_sides_of_the_distance(name):
    a, b, distance = KNOWN[name]
    if distance > 0.0:
        near = minimum_distance(a, b, clearance=0.99 * distance)
        assert near.status is Status.SEPARATED and near.lower > 0.99 * distance
        assert is_separated(a, b, 0.99 * distance) and is_separated(b, a, 0.99 * distance)
        apart = minimum_distance(a, b, clearance=0.0)
        assert apart.status is Status.DISJOINT and apart.lower > 0.0
    assert collides(a, b) == (distance == 0.0)
    far = minimum_distance(a, b, clearance=1.01 * distance + 1e-6)
    assert far.status is Status.NOT_SEPARATED and far.upper <= 1.01 * distance + 1e-6
    assert not is_separated(a, b, 1.01 * distance + 1e-6)
    # Within the tolerance of the distance nothing is decided, or a bound happens to decide it.
    at = minimum_distance(a, b, clearance=distance)
    assert at.upper - at.lower <= 1e-10 or at.status in (Status.SEPARATED, Status.NOT_SEPARATED)


@pytest.mark.parametrize("seed", range(5))
def test_points_and_parameters_belong_together(seed):
    a, b = bezier(seed), bezier(seed + 100, 8)
    answer = minimum_distance(a, b)
    assert answer.parameters.shape == (2,) and answer.points.shape == (2, 3)
    np.testing.assert_allclose(a.evaluate(answer.parameters[0]), answer.points[0], rtol=0, atol=TIGHT)
    np.testing.assert_allclose(b.evaluate(answer.parameters[1]), answer.points[1], rtol=0, atol=TIGHT)
    assert np.linalg.norm(answer.points[0] - answer.points[1]) <= answer.upper
    other = minimum_distance(b, a)
    np.testing.assert_allclose(other.points[::-1], answer.points, rtol=0, atol=1e-7)
    np.testing.assert_allclose(closest_points(a, b), answer.points)
    surface = asm.shapes.torus(2.0, 0.5)
    answer = minimum_distance(a, surface)
    assert answer.parameters.shape == (3,)
    np.testing.assert_allclose(a.evaluate(answer.parameters[0]), answer.points[0], rtol=0, atol=TIGHT)
    np.testing.assert_allclose(surface.evaluate(*answer.parameters[1:]), answer.points[1], rtol=0, atol=TIGHT)


@pytest.mark.parametrize("point", [np.array([0.3, 0.4, 0.5]), (0.3, 0.4, 0.5), [[0.3, 0.4, 0.5]]])
def test_points_of_any_form(point):
    answer = minimum_distance(bezier(1), point)
    assert answer.parameters.shape == (1,) and answer.points.shape == (2, 3)
    assert answer.upper == minimum_distance(point, bezier(1)).upper


def test_a_point_on_a_curve():
    rng = np.random.default_rng(3)
    for degree in (1, 2, 3, 5, 10, 30):
        curve = bezier(degree, degree)
        for t in rng.random(20):
            answer = minimum_distance(curve, curve.evaluate(t))
            assert answer.lower == 0.0 and answer.upper <= TIGHT * degree
    # Both ends are given points: a hit, exactly.
    assert minimum_distance(curve, curve.control_points[0].copy(), clearance=0.0).status is Status.HIT
    assert minimum_distance(curve, curve.evaluate(0.3), clearance=0.0).status is Status.UNDECIDED


def test_points_at_every_distance_have_all_their_digits():
    curve = bezier(4)
    for t in (0.2, 0.55, 0.9):
        point, along = curve.evaluate(t, 1)
        across = np.cross(along, [0.3, 0.2, 0.9])
        across /= np.linalg.norm(across)
        for away in 10.0 ** np.arange(-14.0, -2.0):
            answer = minimum_distance(curve, point + away * across, 1e-12)
            assert answer.converged and answer.upper - answer.lower <= 1e-12
            # The point is off by the rounding of its coordinates.
            assert abs(answer.upper - away) <= TIGHT


def test_hits():
    a = bezier(1, 5, 2)
    # A line through a point of the curve, across it.
    point, along = a.evaluate(0.37, 1)
    across = np.array([-along[1], along[0]])
    hit = minimum_distance(a, segment(point - across, point + 1.3 * across), clearance=0.0)
    assert hit.status is Status.HIT and hit.lower == 0.0
    assert minimum_distance(a, a, clearance=0.0).status is Status.HIT
    same = asm.NurbsCurve(a.control_points, a.knots, a.degree)
    assert minimum_distance(a, same, clearance=0.0).status is Status.HIT
    # A corner in common, in space.
    first = asm.NurbsCurve.polyline(np.random.default_rng(1).random((5, 3)))
    second = asm.NurbsCurve.polyline([(0, 0, 3), first.control_points[2], (0, 3, 0)])
    assert minimum_distance(first, second, clearance=0.0).status is Status.HIT
    # Touching without crossing cannot be proven in doubles.
    touch = minimum_distance(arc(1.0, start=-0.5), segment((1, -1), (1, 1)), clearance=0.0)
    assert touch.status is Status.UNDECIDED and not touch.converged
    assert collides(arc(1.0, start=-0.5), segment((1, -1), (1, 1)))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9, 1e53])
def test_a_crossing_is_within_every_clearance(scale):
    """Also where doubles cannot say how near two points of the crossing are to each other."""
    rng = np.random.default_rng(6)
    tried = 0
    for polish in (True, False):
        for _ in range(20):
            a, b = (asm.NurbsCurve.bezier(scale * rng.normal(size=(4, 2))) for _ in range(2))
            if minimum_distance(a, b, 1e-12 * scale, clearance=0.0).status is not Status.HIT:
                continue
            tried += 1
            for part in (1e-40, 1e-20, 1e-16, 1e-14, 1e-6, 1e-2):
                answer = minimum_distance(a, b, 1e-12 * scale, clearance=part * scale, polish=polish)
                if answer.status is Status.NOT_SEPARATED:
                    assert answer.lower == 0.0 and answer.upper <= part * scale
                    # Points are within the clearance, or some roundings apart.
                    apart = np.linalg.norm(answer.points[0] - answer.points[1])
                    assert apart <= max(part, 2e-12) * scale
                else:
                    assert answer.status is Status.UNDECIDED and not polish
    assert tried > 10


def test_near_misses_are_no_hits():
    rng = np.random.default_rng(2)
    for _ in range(100):
        # Ends just before the line they point at.
        end = rng.random(2)
        gap = 10.0 ** rng.uniform(-12, -3)
        a = segment(end + [0.0, gap], end + [rng.normal(), 1.0])
        b = segment(end - [1.0, 0.0], end + [1.0, 0.0])
        answer = minimum_distance(a, b, 1e-13, clearance=0.0)
        assert answer.status is Status.DISJOINT
        assert 0.0 < answer.lower <= gap * (1.0 + 1e-3)


@pytest.mark.parametrize("scale", [1e-60, 1e-9, 1e9, 1e60])
def test_scales(scale):
    reference = minimum_distance(bezier(1), bezier(2))
    answer = minimum_distance(bezier(1, size=scale), bezier(2, size=scale), 1e-10 * scale)
    # Bounds are widened by parts of the size alone.
    np.testing.assert_allclose(
        [answer.lower, answer.upper], scale * np.array([reference.lower, reference.upper]), rtol=1e-9
    )
    assert answer.converged
    point = scale * np.array([0.3, 0.2, 0.9])
    assert minimum_distance(bezier(1, size=scale), point, 1e-10 * scale).converged


@pytest.mark.parametrize("scale", [1e-120, 1e-80, 1e80, 1e98])
def test_scales_whose_fourth_powers_are_no_doubles(scale):
    rng = np.random.default_rng(3)
    for degree in (1, 1, 1, 1, 2, 3, 5, 8):
        first, second = rng.random((2, degree + 1, 3))
        known = minimum_distance(asm.NurbsCurve.bezier(first), asm.NurbsCurve.bezier(second))
        a, b = asm.NurbsCurve.bezier(scale * first), asm.NurbsCurve.bezier(scale * second)
        answer = minimum_distance(a, b, 1e-10 * scale)
        assert answer.converged
        # Two answers within the tolerance of one distance.
        assert abs(answer.lower - scale * known.lower) <= 2e-10 * scale
        assert abs(answer.upper - scale * known.upper) <= 2e-10 * scale
        assert is_separated(a, b, 0.9 * scale * known.lower) and not is_separated(a, b, 1.1 * scale * known.upper)


def test_what_doubles_cannot_tell_is_said():
    a, b = bezier(1, size=1e9), bezier(2, size=1e9)
    for answer in (minimum_distance(a, b), minimum_distance(a, np.array([3e8, 2e8, 9e8]))):
        assert answer.status is Status.ROUNDED and not answer.converged
        assert 0.0 < answer.upper - answer.lower < 1e-3
    with pytest.raises(AssemblyError, match="the distance is between .* as close as doubles let them be"):
        closest_points(a, b)


def test_an_offset_costs_no_digits():
    # Coordinates are rounded to 1e-10 there, so the shape is compared with itself moved back.
    far = bezier(1, offset=1e6), bezier(2, offset=1e6)
    near = [asm.NurbsCurve.bezier(curve.control_points - 1e6) for curve in far]
    answer, reference = minimum_distance(*far), minimum_distance(*near)
    assert answer.converged and abs(answer.upper - reference.upper) < TIGHT
    answer = minimum_distance(far[0], np.full(3, 1e6))
    assert answer.converged and abs(answer.upper - minimum_distance(near[0], np.zeros(3)).upper) < TIGHT


def test_tied_minima():
    wave = asm.NurbsCurve.bezier([(-2, 1), (-1, -1), (0, 2), (1, -1), (2, 1)])
    line = segment((-3, -1), (3, -1))
    answer = minimum_distance(wave, line)
    x = np.linspace(0.0, 1.0, 100_001)
    least = wave.evaluate(x)[:, 1].min() + 1.0
    assert answer.converged and answer.lower <= least <= answer.upper + 1e-9


@pytest.mark.parametrize("pair", ["curves", "point", "arcs", "surface"])
def test_budgets_of_every_size_give_true_bounds(pair):
    a, b = {
        "curves": (bezier(3, 8), bezier(4, 8)),
        "point": (bezier(3, 15), np.array([0.4, 0.5, 0.5])),
        "arcs": (arc(1.0), arc(1.25)),
        "surface": (asm.shapes.torus(2.0, 0.5), bezier(5)),
    }[pair]
    distance = 0.25 if pair == "arcs" else minimum_distance(a, b).upper
    width = []
    for budget in (1, 2, 3, 5, 8, 13, 21, 50, 100, 1000):
        answer = minimum_distance(a, b, max_evaluations=budget)
        assert answer.lower <= distance + 1e-15 and distance <= answer.upper + 1e-10
        assert (answer.upper - answer.lower <= 1e-10) == (answer.status is Status.CONVERGED)
        assert answer.converged or answer.status is Status.BUDGET_SPENT
        # Halving makes two pairs at once, and surfaces begin with a pair for each patch.
        assert answer.evaluations <= budget + (50 if pair == "surface" else 2)
        width.append(answer.upper - answer.lower)
        decided = minimum_distance(a, b, clearance=0.5 * distance, max_evaluations=budget)
        assert decided.status in (Status.SEPARATED, Status.BUDGET_SPENT)
    assert width[-1] < width[0]


def test_parallel_segments():
    rng = np.random.default_rng(5)

    def from_segment(p, ends):
        along = ends[1] - ends[0]
        return np.linalg.norm(p - ends[0] - np.clip((p - ends[0]) @ along / (along @ along), 0.0, 1.0) * along)

    for _ in range(1000):
        # The determinant of their directions is rounding, of either sign.
        along = rng.normal(size=3)
        across = np.cross(along, rng.normal(size=3)) * 10.0 ** rng.uniform(-3.0, 0.0)
        p = rng.normal(size=3)
        q = p + across + rng.uniform(-1.0, 1.0) * along
        first = np.array([p, p + rng.uniform(0.5, 2.0) * along])
        second = np.array([q, q + rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 2.0) * along])
        known = min(*(from_segment(x, second) for x in first), *(from_segment(x, first) for x in second))
        a, b = segment(*first), segment(*second)
        answer = minimum_distance(a, b)
        assert answer.converged and answer.lower <= known + TIGHT and abs(answer.upper - known) <= 2e-10
        assert is_separated(a, b, 0.9 * known) and not is_separated(a, b, 1.1 * known)
        assert minimum_distance(a, b, 1e-8, polish=False).lower <= known + TIGHT


def test_without_newton_bounds_alone_converge():
    a, b = bezier(3), bezier(4)
    plain = minimum_distance(a, b, 1e-8, bound="hull", polish=False)
    polished = minimum_distance(a, b)
    check(plain, polished.upper, 1e-8)
    assert plain.evaluations > polished.evaluations
    check(minimum_distance(a, np.zeros(3), 1e-8, polish=False), minimum_distance(a, np.zeros(3)).upper, 1e-8)


@pytest.mark.parametrize("degree", [16, 30, 45, 50])
def test_high_degrees(degree):
    curve = bezier(degree, degree)
    x = np.linspace(0.0, 1.0, 20_001)
    points = curve.evaluate(x)
    for point in np.random.default_rng(1).random((10, 3)):
        answer = minimum_distance(curve, point)
        least = np.linalg.norm(points - point, axis=1).min()
        assert answer.converged and answer.lower <= least
        # Between two samples it is nearer by their distance's square at most.
        assert answer.upper >= least - 1e-5
    other = minimum_distance(curve, bezier(1))
    assert other.converged


def test_many_points():
    rng = np.random.default_rng(1)
    for curve in (bezier(1), circle(2.0), bezier(2, 8, 2)):
        d = curve.control_points.shape[1]
        points = 2.0 * rng.random((50, d)) - 0.5
        lower, upper, parameters = minimum_distances(points, curve)
        for i, point in enumerate(points):
            answer = minimum_distance(curve, point)
            assert (lower[i], upper[i], parameters[i]) == (answer.lower, answer.upper, answer.parameters[0])


MASKED = np.ma.array([0.0, 1.0, 2.0], mask=[False, True, False])
BAD = {
    "text": (("curve", bezier(1)), {}, TypeError, "a is 'curve'; expected a NurbsCurve"),
    "none": ((bezier(1), None), {}, TypeError, "b is None; expected"),
    "nan": ((bezier(1), np.array([0.0, math.nan, 0.0])), {}, InputError, r"b\[1\] is nan; expected finite numbers"),
    "shape": ((bezier(1), np.zeros(4)), {}, InputError, r"b has shape \(4,\); expected \(d,\) or \(k, d\)"),
    "ragged": ((bezier(1), [[0.0, 1.0, 2.0], [0.0]]), {}, InputError, r"b is .*; expected a point"),
    "huge": ((bezier(1), np.full(3, 1e200)), {}, InputError, "b has the coordinate 1e.200"),
    "dimensions": ((bezier(1), np.zeros(2)), {}, InputError, "a is in 3-D and b in 2-D"),
    "dimensions of curves": ((bezier(1), bezier(1, 5, 2)), {}, InputError, "a is in 3-D and b in 2-D"),
    "tolerance": ((bezier(1), bezier(2), 0.0), {}, InputError, "tolerance is 0; expected a positive number"),
    "tolerance nan": ((bezier(1), bezier(2), math.nan), {}, InputError, "tolerance is nan"),
    "clearance": ((bezier(1), bezier(2)), {"clearance": -1.0}, InputError, "clearance is -1; expected a distance"),
    "bound": ((bezier(1), bezier(2)), {"bound": "ball"}, InputError, "bound is 'ball'; expected one of auto, hull"),
    "bound array": (
        (bezier(1), bezier(2)),
        {"bound": np.ones(3)},
        InputError,
        r"bound is array.*; expected one of auto",
    ),
    "bound list": ((bezier(1), np.zeros((4, 3))), {"bound": []}, InputError, r"bound is \[\]; expected one of auto"),
    "masked": ((bezier(1), MASKED), {}, InputError, "b has masked values; expected real numbers"),
    "masked hull": ((bezier(1), np.ma.stack([MASKED, MASKED])), {}, InputError, "b has masked values"),
    "vector": ((bezier(1), bezier(2), ca.DM([1, 2])), {}, InputError, r"tolerance is DM.*; expected a finite real"),
    "budget": ((bezier(1), bezier(2)), {"max_evaluations": 0}, InputError, "max_evaluations is 0; expected an integer"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_input(name):
    arguments, keywords, error, text = BAD[name]
    with pytest.raises(error, match=text):
        minimum_distance(*arguments, **keywords)


def test_bad_input_of_the_other_verbs():
    with pytest.raises(InputError, match="clearance is -1"):
        is_separated(bezier(1), bezier(2), -1.0)
    with pytest.raises(InputError, match="tolerance is -1"):
        collides(bezier(1), bezier(2), -1.0)
    with pytest.raises(TypeError, match="curve is 3; expected a NurbsCurve"):
        minimum_distances([[0.0, 0.0, 0.0]], 3)
    with pytest.raises(InputError, match=r"points has shape \(3,\); expected \(n, 3\)"):
        minimum_distances([0.0, 0.0, 0.0], bezier(1))
    with pytest.raises(InputError, match=r"points has shape \(0, 2\); expected \(n, 3\)"):
        minimum_distances(np.zeros((0, 2)), bezier(1))


def test_no_points_have_no_distances():
    assert [part.shape for part in minimum_distances(np.zeros((0, 3)), bezier(1))] == [(0,)] * 3


def test_parameters_of_nearest_points_are_in_the_domain():
    # Near an end of a curve their sum was rounded to beyond it, for one of these points; evaluation raised there.
    rng = np.random.default_rng(3)
    for _ in range(2000):
        low = rng.uniform(-3.0, 3.0)
        degree = int(rng.integers(1, 6))
        points = rng.normal(size=(degree + 1, 3))
        knots = np.repeat([low, low + rng.uniform(0.1, 3.0)], degree + 1)
        curve = asm.NurbsCurve(points, knots, degree)
        near = minimum_distance(curve, points[-1] + 10.0 ** rng.uniform(-16.0, -6.0) * rng.normal(size=3))
        assert knots[0] <= near.parameters[0] <= knots[-1]
        assert np.abs(curve.evaluate(near.parameters[0]) - near.points[0]).max() < 1e-12
