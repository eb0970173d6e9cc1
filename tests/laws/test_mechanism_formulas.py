"""The formulas of docs/derivations.md on mechanisms, as written there: dexterity, envelopes, shifts, gathering."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.dexterity import MEASURES
from assembly.kinematics.pose import retract, rotation_matrix
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.dense.rank import Balanced
from assembly.solve.linear_algebra.factorize import factorize, forward, substitute
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.witness import OFFSETS, SLOPE
from tests.solve.mechanisms import bennett, planar_four_bar


def spatial_arm(rng):
    """Three hinges and a slider, any axes; the hinges and the slider are inputs."""
    links = [asm.Body("base", fixed=True), *(asm.Body(f"link {k}") for k in range(4))]
    frames = [[links[j].frame(rng.normal(size=3), rng.normal(size=3)) for j in (k, k + 1)] for k in range(4)]
    joints = [asm.Revolute(*pair, f"hinge {k}", angle=0.3 * k) for k, pair in enumerate(frames[:3])]
    joints.append(asm.Prismatic(*frames[3], "slider", slide=0.7))
    scene = asm.Assembly(links)
    scene.constrain(*joints)
    return scene, links[-1], joints


def closed_loop(make):
    def scene_of(rng):
        scene = make()
        return scene, scene.bodies[2], [scene.constraints[0]]

    return scene_of


MECHANISMS = {"arm": spatial_arm, "four-bar": closed_loop(planar_four_bar), "Bennett": closed_loop(bennett)}


@pytest.mark.parametrize("measure", MEASURES)
@pytest.mark.parametrize(("name", "off"), [("arm", 0.0), ("four-bar", 0.0), ("four-bar", 1e-3), ("Bennett", 1e-3)])
def test_the_gradient_of_dexterity(name, measure, off):
    """On the constraints, and beside them, where redundant rows contradict each other and the terms with A v count."""
    rng = np.random.default_rng(5)
    scene, body, inputs = MECHANISMS[name](rng)
    solution = scene.solve()
    assert solution.success
    direction = (0.3, 1.0, 0.5) if measure == "force_transmission" else None
    scene.minimize(asm.Dexterity(body.point(0.4, -0.3, 0.2), inputs, measure, direction=direction))
    n = LoopPoint(scene, solution.q).n
    q = moved(scene, solution.q, off * rng.normal(size=n))
    value, gradient, _ = LoopPoint(scene, q).goal()
    assert np.isfinite(value)
    way = rng.normal(size=n) / np.sqrt(n)
    step = 2e-3
    values = [LoopPoint(scene, moved(scene, q, step * offset * way)).goal(0)[0] for offset in OFFSETS]
    slope = np.dot(SLOPE, values) / step
    # Sixth order in 2e-3 leaves about 1e-12 of a seventh derivative. Rates are exact to about 1e-12, over the step.
    assert gradient @ way == pytest.approx(slope, rel=1e-8, abs=2e-8)


@pytest.mark.parametrize("name", MECHANISMS)
def test_rates_are_least_squares_under_equations(name):
    scene, body, inputs = MECHANISMS[name](np.random.default_rng(6))
    for joint in inputs:
        freedom = joint.freedom()
        freedom.value = scene.solve().values[f"{joint.name}.{freedom.name}"]
    solution = scene.solve()
    rows = rows_of(scene.packed(), solution._state)
    moving = np.repeat([not each.fixed for each in scene.bodies], 6)
    a, b = rows.jacobian[~rows.drives][:, moving], rows.jacobian[rows.drives][:, moving]
    k = len(inputs)
    # A^T A V + B^T Z = 0, B V = 1, by a dense pseudoinverse.
    matrix = np.block([[a.T @ a, b.T], [b, np.zeros((k, k))]])
    rates = (np.linalg.pinv(matrix, rcond=1e-10) @ np.vstack([np.zeros((a.shape[1], k)), np.eye(k)]))[: a.shape[1]]
    place = 6 * sum(not each.fixed for each in scene.bodies[: scene.bodies.index(body)])
    point = np.array([0.4, -0.3, 0.2])
    arm = rotation_matrix(solution.pose(body).quaternion) @ point
    size = scene.packed().scale
    turns = rates[place + 3 : place + 6]
    # Rows of an angle are radians; those of a slide are lengths over the size, so that its rates are, too.
    units = np.array([1.0 if joint.freedom().coordinate.is_angle else 1.0 / size for joint in inputs])
    expected = (size * rates[place : place + 3] + np.cross(turns.T, arm).T) * units
    # The pseudoinverse of squared rows loses half the digits.
    found = asm.tip_jacobian(scene, body.point(*point), inputs, solution)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9 * max(1.0, np.abs(expected).max()))


def banded(rng, n, width):
    """A positive definite matrix with an uneven envelope, and where its rows end."""
    last = np.minimum(np.arange(n) + rng.integers(0, width, n), n - 1)
    last = np.maximum.accumulate(np.maximum(last, np.arange(n)))
    matrix = np.zeros((n, n))
    for i in range(n):
        matrix[i, i : last[i] + 1] = rng.normal(size=last[i] + 1 - i)
    matrix = np.triu(matrix, 1) + np.triu(matrix, 1).T
    return matrix + np.diag(np.abs(matrix).sum(axis=1) + 1.0), last


@pytest.mark.parametrize("n", [1, 2, 7, 30])
def test_the_factor_stays_in_the_envelope(n):
    rng = np.random.default_rng(n)
    matrix, last = banded(rng, n, 6)
    # What lies outside the envelope is neither read nor written.
    m = np.full((n, n), np.nan)
    for i in range(n):
        m[i, i : last[i] + 1] = matrix[i, i : last[i] + 1]
    x = rng.normal(size=n)
    b = matrix @ x
    assert factorize(m, n, last)
    substitute(m, n, last, b)
    np.testing.assert_allclose(b, x, rtol=0, atol=1e-13)
    m[0, 0] = -1.0
    assert not factorize(m, n, last)


def test_the_shift_that_shortens_a_step():
    """s += (dx.dx / q.q) (excess - 1) is Newton's method on 1 / |dx|, by the slope of |dx|."""
    rng = np.random.default_rng(9)
    n = 12
    matrix, last = banded(rng, n, n)
    descent = rng.normal(size=n)

    def length(s):
        return np.linalg.norm(np.linalg.solve(matrix + s * np.eye(n), descent))

    factor, step = matrix.copy(), descent.copy()
    assert factorize(factor, n, last)
    substitute(factor, n, last, step)
    q = step.copy()
    forward(factor, n, last, q)
    bound = 0.3 * length(0.0)
    # d(1 / |dx|)/ds by sixth order in 1e-2: its seventh derivative is below one.
    slope = np.dot(SLOPE, [1.0 / length(1e-2 * offset) for offset in OFFSETS]) / 1e-2
    newton = (1.0 / bound - 1.0 / length(0.0)) / slope
    assert step @ step / (q @ q) * (length(0.0) / bound - 1.0) == pytest.approx(newton, rel=1e-9)


def test_ranks_of_sets_from_the_combinations_that_vanish():
    rng = np.random.default_rng(10)
    rows = rng.normal(size=(9, 4)) @ rng.normal(size=(4, 12))
    balanced = Balanced.of(rows, 0.0)
    combinations = balanced.dependencies()
    assert combinations.shape == (5, 9)
    for size in range(10):
        chosen = rng.permutation(9)[:size]
        beyond = np.delete(combinations, chosen, axis=1)
        outside = np.linalg.matrix_rank(beyond, tol=1e-8) if beyond.size else 0
        inside = np.linalg.matrix_rank(balanced.rows[chosen], tol=1e-8) if size else 0
        assert size - (5 - outside) == inside


@pytest.mark.parametrize("seed", range(3))
def test_a_tree_of_joints_is_gathered_exactly(seed):
    rng = np.random.default_rng(seed)
    bodies = [asm.Body("base", fixed=True)]
    scene = asm.Assembly(bodies)
    kinds = (asm.Revolute, asm.Spherical, asm.Cylindrical, asm.Universal, asm.Prismatic)
    for k in range(8):
        quaternion = rng.normal(size=4)
        place = {"position": 4.0 * rng.normal(size=3), "quaternion": quaternion / np.linalg.norm(quaternion)}
        body = scene.add(asm.Body(f"body {k}", **place))
        parent = bodies[rng.integers(len(bodies))]
        bodies.append(body)
        sides = [side.frame(rng.normal(size=3), rng.normal(size=3)) for side in (parent, body)]
        scene.constrain(kinds[k % len(kinds)](*sides, f"joint {k}"))
    solution = scene.solve(max_iterations=0)
    # Half a sum of squares of 1e-26 ends the method: rows of 1e-13 of the scene's size.
    assert solution.feasibility < 3e-13 * scene.packed().scale


def test_frame_distance_and_its_derivatives():
    rng = np.random.default_rng(12)
    start = np.array([0.0, 0, 0, 1, 0, 0, 0])
    for _ in range(5):
        target, q = (retract(start, rng.normal(size=6)) for _ in range(2))
        body = asm.Body("body", asm.shapes.plane(np.sqrt(0.5), np.sqrt(0.5)))
        frame = body.frame(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))
        scene = asm.Assembly([body])
        scene.minimize(asm.FrameDistance(frame, asm.Pose(target[:3], target[3:]), length=0.7))
        point = LoopPoint(scene, q[None])
        unit = scene.packed().unit
        value, gradient, hessian = point.goal()
        turn = rotation_matrix(q[3:])
        apart = q[:3] + turn @ frame.origin - target[:3]
        # 4 sin^2(angle / 2) = 3 - trace of the turn between the axes.
        between = rotation_matrix(target[3:]).T @ turn @ frame.axes
        assert unit * value == pytest.approx(apart @ apart + 0.49 * (3.0 - np.trace(between)), rel=1e-13)
        way = rng.normal(size=6)
        near = [LoopPoint(scene, moved(scene, q[None], 1e-2 * offset * way)).goal() for offset in OFFSETS]
        # Sixth order in 1e-2: 1e-12 of a seventh derivative of order one hundred.
        assert gradient @ way == pytest.approx(np.dot(SLOPE, [each[0] for each in near]) / 1e-2, abs=1e-9)
        # Along one twist the gradient's own component has the second derivative.
        assert way @ hessian @ way == pytest.approx(np.dot(SLOPE, [each[1] @ way for each in near]) / 1e-2, abs=1e-9)
