"""Rows of a scene at a pose: their Jacobian against differences along retracted poses, whatever kind they are."""

from __future__ import annotations

import json

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import retract
from assembly.solve.dense.jacobian import rows_of
from assembly.solve.dense.row_table import gradient_at

STEP = 1e-5


def pose(rng):
    return asm.Pose.from_axis_angle(rng.normal(size=3), rng.uniform(-1, 1), rng.uniform(-2, 2, 3))


def everything(rng):
    """Joints of every kind, couplings, an expression of three bodies and contacts, between seven bodies; two fixed."""
    wire, ball = asm.shapes.torus(1.0, 0.2), asm.shapes.ellipsoid(0.7, 0.5, 0.4)
    bodies = [asm.Body(f"body {k}", wire if k == 2 else ball if k == 5 else None, fixed=k in (0, 4)) for k in range(7)]
    for body in bodies:
        body.pose = pose(rng)
    scene = asm.Assembly(bodies)

    def frame(k):
        return bodies[k].frame(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3))

    def between(a, b):
        return frame(a), frame(b)

    slider = asm.Prismatic(*between(0, 3), slide=0.2)
    hinge = asm.Revolute(*between(3, 6), angle=7.0)
    x, y, z = (ca.SX.sym(name, 7) for name in "xyz")
    function = ca.Function("f", [x, y, z], [ca.vertcat(ca.sin(x[0] * y[4]) + z[2] * y[1], x[3] * z[5])])
    scene.constrain(
        asm.Contact(bodies[2], bodies[5]),
        asm.Contact(bodies[5], bodies[2], "one-sided", unilateral=True),
        slider,
        hinge,
        asm.Cylindrical(*between(6, 1), angle_limits=(-1, 1)),
        asm.Screw(*between(1, 4), pitch=0.7),
        asm.Planar(*between(2, 3), x=0.1),
        asm.Spherical(*between(5, 6), azimuth=0.3, swing_limits=(None, 1.0)),
        asm.Universal(*between(4, 5), angle_b=1.0),
        asm.Fixed(*between(1, 6)),
        asm.Distance(bodies[3], bodies[5].point(0.1, 0.2, 0.3), 1.0),
        asm.Angle(*between(1, 5), 1.0),
        asm.PointOnLine(*between(2, 0)),
        asm.PointOnLine(*between(3, 4), distance=0.3),
        asm.PointOnPlane(*between(6, 3), offset=0.1),
        asm.Gear(hinge, asm.Revolute(*between(2, 1)), -2.5),
        asm.RackPinion(hinge, slider, 0.3),
        asm.Expression(function, [bodies[6], bodies[4], bodies[2]], scale=2.0),
    )
    return scene


def at(scene, q):
    packed = scene.packed()
    return packed, scene._start(packed, q, None)


@pytest.mark.parametrize("seed", range(3))
def test_jacobian_is_the_derivative_of_the_residual(seed):
    rng = np.random.default_rng(seed)
    scene = everything(rng)
    packed, state = at(scene, scene.q)
    rows = rows_of(packed, state)
    m, n = len(rows.residual), len(scene.bodies)
    assert m == packed.rows and rows.program_rows.tolist() == list(range(m)) and (rows.shares == 1.0).all()
    differences = np.zeros_like(rows.jacobian)
    for column in range(6 * n):
        ends = []
        for sign in (1.0, -1.0):
            step = np.zeros((n, 6))
            step.ravel()[column] = sign * STEP
            step[:, :3] *= packed.scale
            other = rows.state.copy()
            other[: packed.contacts_at] = retract(scene.q, step).ravel()
            ends.append(rows_of(packed, other).residual)
        differences[:, column] = (ends[0] - ends[1]) / (2.0 * STEP)
    # Central differences: STEP^2 times third derivatives, which grow with numbers up to 5 in the frames.
    np.testing.assert_allclose(rows.jacobian, differences, rtol=0, atol=2e-8)
    # Every constraint moves with its own bodies and no others; with all of them, fixed ones too.
    for k, constraint in enumerate(scene.constraints):
        own = rows.jacobian[rows.owners == k].reshape(-1, n, 6)
        assert [scene.bodies[b] in constraint.bodies for b in range(n)] == list(np.abs(own).max(axis=(0, 2)) > 0.0)


def test_rows_are_those_of_the_solve():
    scene = everything(np.random.default_rng(6))
    solution = scene.solve(max_iterations=3)
    packed, state = solution._packed, solution._state
    rows = rows_of(packed, state)
    users = np.where(packed.lengths, packed.scale, 1.0)[rows.program_rows] * rows.residual
    np.testing.assert_allclose(users, solution._residuals, rtol=0, atol=1e-11)
    np.testing.assert_allclose(rows.state, state, rtol=0, atol=1e-11)


@pytest.mark.parametrize("seed", range(2))
def test_gradient_is_the_derivative_of_the_objective(seed):
    rng = np.random.default_rng(seed)
    scene = everything(rng)
    scene.minimize(asm.Posture(weight=0.3), asm.PointDistance(scene.bodies[6].point(1, 2, 3), (1, -1, 0.5)))
    scene.maximize(asm.FrameDistance(scene.bodies[1].frame((1, 0, 0)), asm.Pose((1, 2, 3)), length=2.0, weight=0.1))
    packed, state = at(scene, scene.q)
    q = retract(scene.q, rng.normal(size=(7, 6)))
    state[: packed.contacts_at] = q.ravel()
    gradient, scratch, free = np.empty(42), np.empty(42), np.empty(2, dtype=np.int64)
    gradient_at(packed.table, packed.pool, state, free, gradient, packed.end_effectors)
    differences = np.zeros(42)
    for column in range(42):
        for sign in (1.0, -1.0):
            step = np.zeros((7, 6))
            step.ravel()[column] = sign * STEP
            step[:, :3] *= packed.scale
            state[: packed.contacts_at] = retract(q, step).ravel()
            value = gradient_at(packed.table, packed.pool, state, free, scratch, packed.end_effectors)
            differences[column] += sign * value / (2.0 * STEP)
    fixed = np.repeat([body.fixed for body in scene.bodies], 6)
    np.testing.assert_allclose(gradient, np.where(fixed, 0.0, differences), rtol=0, atol=1e-8)


def test_a_contact_without_parameters_finds_its_pair():
    a = asm.Body("a", asm.shapes.sphere(1.0), fixed=True)
    b = asm.Body("b", asm.shapes.sphere(0.5), (2.0, 0.0, 0.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    packed, state = at(scene, scene.q)
    rows = rows_of(packed, state)
    assert rows.residual * packed.scale == pytest.approx([0.5], abs=1e-15)
    # The points are found to Newton's tolerance.
    assert rows.jacobian[0] == pytest.approx([-1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0], abs=1e-12)
    assert np.isfinite(rows.state[packed.contacts_at : packed.angles_at]).all()
    assert np.isnan(state[packed.contacts_at]), "the state that came is left as it was"


def floor_and_tile():
    floor = asm.Body("floor", asm.shapes.plane(4, 4), fixed=True)
    tile = asm.Body("tile", asm.shapes.plane(2, 2), (0.3, 0.2, 0.0), (0.0, 1.0, 0.0, 0.0))
    scene = asm.Assembly([floor, tile])
    scene.constrain(asm.Contact(floor, tile))
    return scene


def test_flat_faces_that_lie_on_each_other_are_three_rows():
    scene = floor_and_tile()
    packed, state = at(scene, scene.q)
    rows = rows_of(packed, state)
    assert rows.program_rows.tolist() == [0, 0, 0] and np.abs(rows.residual).max() < 1e-15
    # What they forbid: lifting, and tilting either way.
    tile_rows = rows.jacobian[:, 6:]
    assert np.linalg.matrix_rank(tile_rows[:, 2:5], tol=1e-9) == 3
    assert np.abs(tile_rows[:, [0, 1, 5]]).max() < 1e-14


def test_a_pose_without_a_pair_is_named(monkeypatch):
    scene = everything(np.random.default_rng(0))
    packed, state = at(scene, scene.q)
    monkeypatch.setattr("assembly.solve.dense.jacobian.rows_at", lambda *_: 1)
    with pytest.raises(asm.errors.InputError, match="q leaves contact 'one-sided' without an extremal pair"):
        rows_of(packed, state)


def numbers():
    scenes = everything(np.random.default_rng(1)), floor_and_tile()
    rows = [rows_of(*at(scene, scene.q)) for scene in scenes]
    return [[*each.residual.tolist(), *each.jacobian.ravel().tolist()] for each in rows]


def test_the_same_with_and_without_compilation(run_python):
    code = "import json; from tests.solve.dense.test_jacobian import *; print(json.dumps(numbers()))"
    for one, other in zip(json.loads(run_python(code, NUMBA_DISABLE_JIT="1")), numbers(), strict=True):
        # Compiled code fuses multiplications and additions; Newton's method stops within 1e-12 of a pair.
        np.testing.assert_allclose(one, other, rtol=0, atol=1e-11)
