"""Which shapes the public verbs take, in both orders: formula curves and convex hulls beside splines and points."""

from __future__ import annotations

import math
import pickle

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import AssemblyError, InputError
from assembly.proximity import SeparationStatus as Status
from assembly.proximity import closest_points, collides, is_separated, minimum_distance

t = ca.SX.sym("t")
# Half a circle of radius two above the x axis, and a turn of a helix about z.
HALF = asm.FormulaCurve(ca.vertcat(2.0 * ca.cos(t), 2.0 * ca.sin(t)), t, (0.0, math.pi))
HELIX = asm.FormulaCurve(ca.vertcat(ca.cos(t), ca.sin(t), t / 4.0), t, (0.0, 2.0 * math.pi))
SQUARE = np.array([(-0.5, 3.0), (0.5, 3.0), (0.5, 4.0), (-0.5, 4.0)])
CUBE = np.array([(x, y, z) for x in (2.0, 3.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

# a, b, their distance, and how many parameters each has.
KNOWN = {
    "formula and point": (HALF, np.array([0.0, 5.0]), 3.0, (1, 0)),
    "formula and a list": (HALF, [0.0, 5.0], 3.0, (1, 0)),
    "formula and hull": (HALF, SQUARE, 1.0, (1, 0)),
    "formula and polyline": (HALF, asm.NurbsCurve.polyline([(-3, 2.5), (3, 2.5)]), 0.5, (1, 1)),
    "formula and formula": (
        HALF,
        asm.FormulaCurve(ca.vertcat(3.0 * ca.cos(t), 4.0 * ca.sin(t)), t, (1.0, 2.0)),
        None,
        (1, 1),
    ),
    "formula and hull in space": (HELIX, CUBE, 1.0, (1, 0)),
    "formula and curve in space": (HELIX, asm.NurbsCurve.bezier([(4, 0, 0), (4, 1, 0), (4, 0, 1)]), None, (1, 1)),
    # Three above the top of the torus beside its axis, at the nearest; a root's vertical; a kink above a plane.
    "formula and torus": (
        asm.FormulaCurve(ca.vertcat(1.0, t, 3.5 + t * t), t, (-1.0, 1.0)),
        asm.shapes.torus(1.0, 0.5),
        3.0,
        (1, 2),
    ),
    "formula with a vertical and plane": (
        asm.FormulaCurve(ca.vertcat(t, 0.1, 0.5 + ca.sqrt(t)), t, (0.0, 1.0)),
        asm.shapes.plane(4.0, 4.0),
        0.5,
        (1, 2),
    ),
    "formula with a kink and plane": (
        asm.FormulaCurve(ca.vertcat(t, t / 3.0, 0.25 + ca.fabs(t - 0.1)), t, (-1.0, 1.0)),
        asm.shapes.plane(4.0, 4.0),
        0.25,
        (1, 2),
    ),
    "Bezier curve and hull": (asm.NurbsCurve.bezier([(-1, 0), (0, 4), (1, 0)]), SQUARE, 1.0, (1, 0)),
    "point and hull": (np.array([0.0, 1.0]), SQUARE, 2.0, (0, 0)),
    "two hulls": (SQUARE, SQUARE - [0.0, 3.0], 2.0, (0, 0)),
}  # fmt: skip


def place(shape, parameters, point):
    """Where a curve or a surface is at its parameters; a point of a hull or a point is what it is."""
    return shape.evaluate(*map(float, parameters)) if len(parameters) else point


@pytest.mark.parametrize("name", KNOWN)
def test_distances_in_both_orders(name):
    a, b, distance, counts = KNOWN[name]
    answer, other = minimum_distance(a, b), minimum_distance(b, a)
    for result, shapes, own in ((answer, (a, b), counts), (other, (b, a), counts[::-1])):
        assert result.status is Status.CONVERGED
        assert result.upper - result.lower <= 1e-10
        if distance is not None:
            assert result.lower <= distance * (1.0 + 4e-16) and result.upper >= distance * (1.0 - 4e-16)
        assert result.parameters.shape == (sum(own),)
        parts = result.parameters[: own[0]], result.parameters[own[0] :]
        for shape, part, point in zip(shapes, parts, result.points, strict=True):
            # Some units of the coordinates and the parameter's own rounding.
            np.testing.assert_allclose(place(shape, part, point), point, rtol=0.0, atol=1e-13)
        # Upper bounds are widened by parts of the size, some hundred units of the last place.
        assert abs(math.dist(*result.points) - result.upper) <= 1e-12
    # Two searches that end within the tolerance, and minima that are quadratic.
    assert abs(answer.upper - other.upper) <= 2e-10
    np.testing.assert_allclose(other.points[::-1], answer.points, rtol=0.0, atol=1e-4)


@pytest.mark.parametrize("name", KNOWN)
def test_questions_in_both_orders(name):
    a, b, distance, _counts = KNOWN[name]
    distance = distance or minimum_distance(a, b).lower
    for first, second in ((a, b), (b, a)):
        assert is_separated(first, second, 0.99 * distance)
        assert not is_separated(first, second, 1.01 * distance)
        assert not collides(first, second)
        assert minimum_distance(first, second, clearance=0.5 * distance).status is Status.SEPARATED
        assert minimum_distance(first, second, clearance=1.5 * distance).status is Status.NOT_SEPARATED
        assert minimum_distance(first, second, clearance=0.0).status is Status.DISJOINT
        points = closest_points(first, second)
        assert points.shape == minimum_distance(first, second).points.shape
        assert abs(math.dist(*points) - distance) <= 1e-9


def test_shapes_that_meet():
    line = asm.NurbsCurve.polyline([(0.0, 0.0), (0.3, 3.1)])
    inside = np.array([(-0.5, 1.5), (0.5, 1.5), (0.0, 2.5)])
    for a, b in ((HALF, line), (HALF, inside), (line, inside), (inside, inside + 0.1), (inside, np.array([0.0, 2.0]))):
        for first, second in ((a, b), (b, a)):
            assert collides(first, second)
            assert not is_separated(first, second, 0.0)
            assert minimum_distance(first, second, clearance=0.0).status is Status.HIT
    # A line that touches: no computation in doubles tells, and no answer is a proof.
    tangent = asm.NurbsCurve.polyline([(-1.0, 2.0), (1.0, 2.0)])
    assert collides(HALF, tangent)
    assert minimum_distance(tangent, HALF, clearance=0.0).status is Status.UNDECIDED


def test_budgets_and_what_does_not_converge():
    point = np.array([0.1, 0.2, 0.7])
    answer, full = minimum_distance(HELIX, point, max_evaluations=3), minimum_distance(HELIX, point)
    assert answer.status is Status.BUDGET_SPENT and not answer.converged
    assert answer.lower <= full.upper and full.lower <= answer.upper
    # All points of the half circle are as near to its center: doubles end this search, or the budget does.
    ties = minimum_distance(np.zeros(2), HALF, 1e-15)
    assert not ties.converged and ties.lower <= 2.0 <= ties.upper * (1.0 + 4e-16)
    with pytest.raises(AssemblyError, match="the distance is between .* not known to the tolerance 1e-15"):
        closest_points(HALF, np.zeros(2), 1e-15)


def test_bounds_by_name():
    plain = minimum_distance(SQUARE, HALF, 1e-6, bound="ellipsoid", polish=False)
    assert plain.converged and plain.lower <= 1.0 <= plain.upper + 1e-15
    for bound in ("ellipsoid", "capsule", "taylor"):
        assert abs(minimum_distance(HALF, SQUARE, 1e-6, bound=bound).upper - 1.0) <= 1e-6
    for a, b in ((HALF, SQUARE), (SQUARE, HALF), (HALF, HALF), (SQUARE, asm.NurbsCurve.polyline(SQUARE))):
        with pytest.raises(InputError, match="bound is 'hull'; expected curves and surfaces of control points"):
            minimum_distance(a, b, bound="hull")


def test_surfaces_do_not_meet_hulls():
    sphere = asm.shapes.sphere(1.0)
    for a, b in ((sphere, CUBE), (CUBE, sphere)):
        for verb in (minimum_distance, closest_points, collides, lambda a, b: is_separated(a, b, 1.0)):
            with pytest.raises((InputError, TypeError), match="is NurbsSurface.*; expected"):
                verb(a, b)


def test_formulas_and_surfaces_have_one_bound():
    sphere = asm.shapes.sphere(1.0)
    for a, b in ((sphere, HELIX), (HELIX, sphere)):
        with pytest.raises(InputError, match="bound is 'hull'; expected curves and surfaces of control points"):
            minimum_distance(a, b, bound="hull")
        with pytest.raises(InputError, match="bound is 'taylor'; expected 'auto' with a surface and a formula"):
            minimum_distance(a, b, bound="taylor")


def test_a_formula_crosses_a_surface():
    """A helix through a torus, and one that lies on a sphere: both may meet it, which no doubles prove."""
    torus = asm.shapes.torus(1.0, 0.3)
    answer = minimum_distance(HELIX, torus, clearance=0.0)
    assert answer.status is Status.UNDECIDED and answer.upper <= 1e-10 and collides(torus, HELIX)
    assert minimum_distance(HELIX, torus).status is Status.CONVERGED
    ring = asm.FormulaCurve(ca.vertcat(ca.cos(t), 0.6 * ca.sin(t), 0.8 * ca.sin(t)), t, (0.0, 2.0))
    on = minimum_distance(ring, asm.shapes.sphere(1.0), 1e-6)
    assert on.lower == 0.0 and on.upper <= 1e-6
    # Without Newton's method bounds alone come to the same.
    plain = minimum_distance(ring, asm.shapes.sphere(2.0), 1e-2, polish=False)
    assert plain.converged and plain.lower <= 1.0 <= plain.upper


def test_a_formula_against_a_surface_agrees_with_its_own_bezier_curve():
    rng = np.random.default_rng(7)
    for k in range(12):
        p = rng.random((4, 3)) + rng.uniform(-1.0, 1.0, 3)
        weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
        formula = asm.FormulaCurve(sum(w * ca.SX(row) for w, row in zip(weights, p, strict=True)), t, (0.0, 1.0))
        surface = asm.shapes.torus(0.7, 0.2) if k % 2 else asm.shapes.sphere(0.5)
        one, two = minimum_distance(formula, surface), minimum_distance(asm.NurbsCurve.bezier(p), surface)
        assert one.converged and two.converged
        # Both within their bounds, which are 1e-10 apart at most.
        assert max(one.lower, two.lower) <= min(one.upper, two.upper) + 1e-15
        spent = minimum_distance(surface, formula, max_evaluations=5)
        assert spent.lower <= one.upper and one.lower <= spent.upper


@pytest.mark.parametrize("offset", [1e3, 1e6, 1e8])
def test_a_formula_and_a_surface_far_off(offset):
    """Doubles end the search where the formula's own sums do, at some units of the coordinates."""
    move = offset * np.array([0.5, -1.0, 1.0])
    wave = asm.FormulaCurve(ca.vertcat(t + move[0], ca.cos(t) + move[1], 2.0 + 0.1 * t + move[2]), t, (-1.0, 2.0))
    ball = asm.shapes.sphere(1.0)
    ball = asm.NurbsSurface(ball.control_points + move, ball.knots, ball.degree, ball.weights)
    near = minimum_distance(
        asm.FormulaCurve(ca.vertcat(t, ca.cos(t), 2.0 + 0.1 * t), t, (-1.0, 2.0)), asm.shapes.sphere(1.0)
    )
    answer = minimum_distance(wave, ball)
    assert answer.status is (Status.CONVERGED if offset < 1e5 else Status.ROUNDED)
    assert answer.upper - answer.lower <= max(1e-10, 1e-14 * offset)
    # Both shapes are moved to the grid of doubles there.
    off = 2e-16 * offset * 4.0
    assert answer.lower <= near.upper + off and near.lower - off <= answer.upper


def test_dimensions_do_not_mix():
    for a, b in (
        (HALF, HELIX),
        (HALF, CUBE),
        (HELIX, SQUARE),
        (SQUARE, CUBE),
        (HELIX, np.zeros(2)),
        (HALF, asm.shapes.sphere(1.0)),
    ):
        for first, second in ((a, b), (b, a)):
            with pytest.raises(InputError, match="expected one space"):
                minimum_distance(first, second)


def test_answers_are_copied_as_they_are():
    for a, b in ((HALF, SQUARE), (np.zeros(3), asm.NurbsCurve.bezier(CUBE[:4]))):
        answer = minimum_distance(a, b)
        copy = pickle.loads(pickle.dumps(answer))
        assert (copy.lower, copy.upper, copy.status) == (answer.lower, answer.upper, answer.status)
        np.testing.assert_array_equal(copy.points, answer.points)


def test_options_are_looked_at_before_anything_is_searched():
    a, b = asm.NurbsCurve.bezier([[0.0, 0.0], [1.0, 1.0]]), asm.NurbsCurve.bezier([[2.0, 0.0], [2.0, 1.0]])
    with pytest.raises(InputError, match="clearance is None"):
        is_separated(a, b, None)
    with pytest.raises(InputError, match="polish is 'no'; expected True or False"):
        minimum_distance(a, b, polish="no")
    # A whole number is a clearance like any other.
    assert is_separated(a, b, 0) and not is_separated(a, b, 1)


@pytest.mark.parametrize(
    ("root", "domain"),
    [
        (lambda t: ca.sqrt(1.0 - t), (0.0, 1.0)),
        (lambda t: ca.sqrt(1.0 - t * t), (-1.0, 1.0)),
        (lambda t: ca.sqrt(t + 0.1), (-0.1, 1.0)),
    ],
)
def test_vertical_ends_whose_argument_is_rounded(root, domain):
    """Such an end piece never becomes short: what is left of it stands for itself, and patches are halved beside it."""
    t = ca.SX.sym("t")
    curve = asm.FormulaCurve(ca.vertcat(t, root(t), -0.1 * t * t), t, domain)
    points = np.zeros((3, 3, 3))
    points[..., 0], points[..., 1] = np.meshgrid([-4.0, 0.0, 4.0], [-4.0, 0.0, 4.0], indexing="ij")
    points[..., 2] = -2.0
    points[1, 1, 2] = -1.0
    knots = [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]
    bump = asm.NurbsSurface(points, (knots, knots), (2, 2))
    # Many patches are equally near to a point of a vertical end: 1e-4 is what some thousand pairs reach.
    answer = minimum_distance(bump, curve, 1e-4)
    assert answer.status is Status.CONVERGED and 1.6 < answer.lower
    assert is_separated(bump, curve, 0.99 * answer.lower) and not is_separated(bump, curve, 1.01 * answer.upper)
    assert not collides(bump, curve)


def test_a_joint_in_the_middle_of_a_formula_does_not_end_a_search():
    """Its point there is wide, and no other."""
    t = ca.SX.sym("t")
    curve = asm.FormulaCurve(ca.vertcat(t, 0.3 * t, ca.fabs(ca.fmod(t + 0.5, 1.0) - 0.5)), t, (0.0, 1.0))
    at = np.array([3.0, 0.3, 0.2])
    known = np.linalg.norm(curve.evaluate(np.linspace(0.0, 1.0, 2001)) - at, axis=1).min()
    answer = minimum_distance(curve, at, 1e-8)
    assert answer.status is Status.CONVERGED and answer.lower <= known <= answer.upper + 1e-6
    sheet = asm.shapes.plane(20.0, 20.0).transformed(np.eye(3), np.array([0.0, 0.0, -1.0]))
    answer = minimum_distance(sheet, curve, 1e-8)
    assert answer.status is Status.CONVERGED and answer.lower == pytest.approx(1.0, abs=1e-8)
