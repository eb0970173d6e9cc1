"""Pairs of surfaces and curves from Python: closed forms, both kinds of curve, what is refused."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.kinematics.body import Body
from assembly.proximity import (
    PairStatus,
    curve_contact_jacobian,
    curve_gap_gradient,
    curve_gap_hessian,
    extremal_curve_pair,
)
from tests.laws.scenes import random_quaternion
from tests.laws.witness import rotated

HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
BALL, CYLINDER, PLANE = shapes.sphere(1.0), shapes.cylinder(1.0, 4.0), shapes.plane(8.0, 8.0)
LINE = NurbsCurve([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]], [0, 0, 1, 1], 1)
# Once round the cylinder at half its height, and a straight line in the plane.
RIM = NurbsCurve([[CYLINDER.domain[0][0], 2.0], [CYLINDER.domain[0][1], 2.0]], [0, 0, 1, 1], 1)
FLAT = NurbsCurve([[-1.0, 0.0], [1.0, 0.0]], [0, 0, 1, 1], 1)


def close(found, expected, atol=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=atol)


def at(x, y, z, e=(1.0, 0.0, 0.0, 0.0)):
    return np.array([x, y, z, *e])


@pytest.mark.parametrize("gap", [0.5, 1e-8, 0.0, -1e-8, -0.2])
def test_plane_and_inclined_circle(gap):
    """The rim of a cylinder over a plane: its lowest point is r sin(tilt) below its center."""
    tilt = 0.4
    for spin in (0.0, 1.0, 3.0):
        # Tilted about x, after a spin about the cylinder's own axis: the rim's seam goes anywhere.
        c, s = np.cos(0.5 * tilt), np.sin(0.5 * tilt)
        a, b = np.cos(0.5 * spin), np.sin(0.5 * spin)
        q = at(0.3, -0.2, np.sin(tilt) + gap, (c * a, s * a, -s * b, c * b))
        lowest = rotated(q[None], np.array([[0.0, 0.0, 1.0]]))
        assert abs(lowest[0, 2] - np.cos(tilt)) < 1e-12
        local = np.array([[-np.sin(spin), -np.cos(spin), 0.0]])
        foot = rotated(q[None], local)[0] + q[:3]
        t = np.mod(np.arctan2(local[0, 1], local[0, 0]) / (2.0 * np.pi), 1.0)
        for start in (t, np.mod(t + 0.08, 1.0), np.mod(t - 0.08, 1.0)):
            pair = extremal_curve_pair(PLANE, HOME, RIM, q, (foot[0], foot[1] + 0.1, start), CYLINDER)
            assert pair.status is PairStatus.CONVERGED
            close(pair.gap, gap, 1e-13)
            close(pair.points, [[*foot[:2], 0.0], [*foot[:2], gap]])
            close(pair.normal, [0.0, 0.0, 1.0])
            foot_again = CYLINDER.evaluate(*RIM.evaluate(pair.parameters[2]))
            close(foot_again, local[0])


def test_a_line_in_space_and_in_a_plane_are_the_same():
    rng = np.random.default_rng(3)
    for _ in range(20):
        q_s, q_c = (np.r_[rng.uniform(-1.0, 1.0, 3), random_quaternion(rng)] for _ in range(2))
        # The middle of the line above the ball.
        u, v = rng.uniform(0.5, 5.5), rng.uniform(0.6, 2.4)
        away = rotated(q_s[None], BALL.evaluate(u, v)[None])[0]
        x = rotated(q_c[None], np.array([[1.0, 0.0, 0.0]]))[0]
        away -= (away @ x) * x
        q_c[:3] = q_s[:3] + 1.3 * away / np.linalg.norm(away) - 0.2 * x
        nearest = rotated((q_s * [1, 1, 1, 1, -1, -1, -1])[None], away[None])[0]
        i = np.argmax(GRID_POINTS @ nearest)
        start = (*GRID[i], 0.6)
        space = extremal_curve_pair(BALL, q_s, LINE, q_c, start)
        plane = extremal_curve_pair(BALL, q_s, FLAT, q_c, start, PLANE)
        for pair in (space, plane):
            assert pair.status is PairStatus.CONVERGED
            close(pair.gap, 0.3)
            close(pair.parameters[2], 0.6)
        if BALL.domain[1][0] + 0.1 < space.parameters[1] < BALL.domain[1][1] - 0.1:
            for function in (curve_contact_jacobian, curve_gap_gradient, curve_gap_hessian):
                found = function(BALL, q_s, FLAT, q_c, plane.parameters, PLANE)
                expected = function(BALL, q_s, LINE, q_c, space.parameters)
                # Rates up to 10 near the ball's poles.
                close(found, expected, 1e-11)


GRID = [(u, v) for u in np.linspace(*BALL.domain[0], 33) for v in np.linspace(*BALL.domain[1], 17)]
GRID_POINTS = BALL.evaluate(*np.transpose(GRID))


def test_shapes_of_results():
    arguments = (CYLINDER, HOME, LINE, at(1.5, 0.1, 0.2, (0.9, 0.1, 0.3, 0.9)), (0.1, 2.2, 0.4))
    pair = extremal_curve_pair(*arguments)
    assert pair.status is PairStatus.CONVERGED and isinstance(pair.gap, float)
    assert pair.parameters.shape == (3,) and pair.points.shape == (2, 3) and pair.normal.shape == (3,)
    arguments = (*arguments[:4], pair.parameters)
    assert curve_contact_jacobian(*arguments).shape == (3, 14)
    assert curve_gap_gradient(*arguments).shape == (14,)
    assert curve_gap_hessian(*arguments).shape == (12, 12)


def test_faces_and_faces_of_bodies_count_with_their_side():
    q = at(0.2, 0.1, 0.4, (0.9, 0.1, 0.4, 0.2))
    circle = Face(CYLINDER)
    start = (0.3, -0.8, 0.4)
    pair = extremal_curve_pair(PLANE, HOME, RIM, q, start, CYLINDER)
    turned = extremal_curve_pair(Face(PLANE, reversed=True), HOME, RIM, q, start, circle)
    body = Body("floor", PLANE)
    same = extremal_curve_pair(body.face(), HOME, RIM, q, start, Body("can", CYLINDER).face())
    assert pair.status is turned.status is same.status is PairStatus.CONVERGED
    close(turned.gap, -pair.gap)
    close(turned.normal, -pair.normal)
    close(same.gap, pair.gap)
    gradient = curve_gap_gradient(PLANE, HOME, RIM, q, pair.parameters, CYLINDER)
    close(curve_gap_gradient(Face(PLANE, reversed=True), HOME, RIM, q, pair.parameters, circle), -gradient)


def test_an_end_of_a_curve_is_held():
    pair = extremal_curve_pair(
        PLANE, HOME, LINE, at(0.0, 0.0, 1.0, (np.cos(0.1), 0.0, np.sin(0.1), 0.0)), (0.2, 0.1, 0.4)
    )
    assert pair.status is PairStatus.LEFT_PATCH
    close(pair.parameters, [np.cos(0.2), 0.0, 1.0])
    close(pair.gap, 1.0 - np.sin(0.2))


def test_a_line_along_the_plane_stays_where_it_is():
    pair = extremal_curve_pair(PLANE, HOME, LINE, at(0.0, 0.0, 0.3), (0.1, 0.0, 0.55))
    assert pair.status is PairStatus.SINGULAR
    close(pair.gap, 0.3)
    close(pair.parameters, [0.1, 0.0, 0.55])
    assert np.isfinite(curve_contact_jacobian(PLANE, HOME, LINE, at(0.0, 0.0, 0.3), pair.parameters)).all()
    # The whole line moves along its normal at any of its points: the gap's rate is one.
    gradient = curve_gap_gradient(PLANE, HOME, LINE, at(0.0, 0.0, 0.3), pair.parameters)
    close(gradient[[2, 9]], [-1.0, 1.0])


def test_closed_curves_wrap_and_others_do_not():
    q = at(0.0, 0.0, 0.7, (np.cos(0.2), np.sin(0.2), 0.0, 0.0))
    pair = extremal_curve_pair(PLANE, HOME, RIM, q, (0.0, -0.9, 0.75 + 3.0), CYLINDER)
    assert pair.status is PairStatus.CONVERGED and abs(pair.parameters[2] - 0.75) < 1e-12
    half = NurbsCurve(RIM.control_points * [0.5, 1.0], RIM.knots, 1)
    with pytest.raises(InputError, match=r"start\[2\] is 1.5; expected a parameter in \[0, 1\]"):
        extremal_curve_pair(PLANE, HOME, half, q, (0.0, -0.9, 1.5), CYLINDER)


GOOD = dict(surface=PLANE, q_s=HOME, curve=LINE, q_c=at(0, 0, 1), start=(0.0, 0.0, 0.5))


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"surface": LINE}, TypeError, "surface is .*; expected a NurbsSurface or a Face"),
        ({"curve": PLANE}, TypeError, "curve is .*; expected a NurbsCurve"),
        ({"curve": FLAT}, InputError, "embedded_in is None; expected the surface"),
        ({"embedded_in": PLANE}, InputError, "expected None for a curve in space"),
        ({"curve": FLAT, "embedded_in": 3}, TypeError, "embedded_in is 3; expected a NurbsSurface"),
        ({"q_s": np.zeros(7)}, InputError, r"q_s\[3:\]"),
        ({"q_c": np.full(7, np.nan)}, InputError, r"q_c\[0\] is nan"),
        ({"q_c": np.zeros(6)}, InputError, r"q_c has shape \(6,\); expected \(7,\)"),
        ({"start": (0.0, 0.0)}, InputError, r"start has shape \(2,\); expected \(3,\)"),
        ({"start": (0.0, np.inf, 0.5)}, InputError, r"start\[1\] is inf"),
        ({"start": (9.0, 0.0, 0.5)}, InputError, r"start\[0\] is 9; expected a parameter in \[-4, 4\]"),
        ({"start": (0.0, 0.0, -0.5)}, InputError, r"start\[2\] is -0.5; expected a parameter in \[0, 1\]"),
        (
            {"curve": NurbsCurve([[0.0, 0.0], [9.0, 0.0]], [0, 0, 1, 1], 1), "embedded_in": PLANE},
            InputError,
            "curve leaves the domain of embedded_in: u is",
        ),
    ],
)
def test_bad_input(changes, error, text):
    with pytest.raises(error, match=text):
        extremal_curve_pair(**{**GOOD, **changes})


@pytest.mark.parametrize("function", [curve_contact_jacobian, curve_gap_gradient, curve_gap_hessian])
def test_derivatives_are_refused_off_a_pair(function):
    q = at(0.2, 0.1, 0.4, (0.9, 0.1, 0.4, 0.2))
    pair = extremal_curve_pair(PLANE, HOME, RIM, q, (0.3, -0.8, 0.4), CYLINDER)
    assert np.isfinite(function(PLANE, HOME, RIM, q, pair.parameters, CYLINDER)).all()
    with pytest.raises(InputError, match="off an extremal pair by .*; expected those of extremal_curve_pair"):
        function(PLANE, HOME, RIM, q, pair.parameters + [0.0, 1e-3, 0.0], CYLINDER)
    with pytest.raises(InputError, match="parameters has shape"):
        function(PLANE, HOME, RIM, q, pair.parameters[:2], CYLINDER)


def test_parameters_have_no_rates_at_a_pole():
    top = BALL.domain[1][1]
    pair = extremal_curve_pair(BALL, HOME, LINE, at(0.0, 0.0, 1.5), (0.3, top, 0.4))
    assert pair.status is PairStatus.CONVERGED
    close(pair.gap, 0.5)
    q = at(0.0, 0.0, 1.5)
    with pytest.raises(InputError, match="at a pole, where parameters have no rates"):
        curve_contact_jacobian(BALL, HOME, LINE, q, (0.3, top, 0.5))
    # The gap itself is smooth there.
    assert np.isfinite(curve_gap_hessian(BALL, HOME, LINE, q, (0.3, top, 0.5))).all()


def test_a_cusp_is_refused():
    cusp = NurbsCurve([[-1, 0, 1], [0, 0, 0], [0, 0, 0], [1, 0, 1]], [0, 0, 0, 0, 1, 1, 1, 1], 3)
    still = NurbsCurve([[0, 0, 0], [0, 0, 0], [1, 0, 1]], [0, 0, 0, 1, 1, 1], 2)
    assert extremal_curve_pair(PLANE, HOME, cusp, HOME, (0.0, 0.0, 0.3)).points.shape == (2, 3)
    with pytest.raises(InputError, match="has no tangent; expected a regular point"):
        curve_gap_gradient(PLANE, HOME, still, HOME, (0.0, 0.0, 0.0))
