"""The formulas of docs/derivations.md as they are written there: free pairs, objectives and the step of the loop."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.constraints.program.objective_terms import objective
from assembly.constraints.program.records import Sparsity
from assembly.geometry.splines.evaluate import SURFACE_RECORD
from assembly.kinematics.pose import multiply, retract, rotation_matrix, skew
from assembly.proximity import gap_hessian
from assembly.proximity.extrema.lifted_pair import (
    VARIABLES,
    VECTORS,
    LiftedPair,
    coordinate_lengths,
    free_hessian,
    free_rows,
)
from assembly.proximity.extrema.pairs import _packed
from assembly.solve.loop.residuals import merit
from assembly.solve.loop.workspace import new_rows
from tests.laws.test_formulas import Local
from tests.laws.witness import OFFSETS, SLOPE


def slope_of(function, step):
    """The derivative of function(t) at zero, by central differences of sixth order."""
    return sum(weight * function(offset * step) for offset, weight in zip(OFFSETS, SLOPE, strict=True)) / step


class FreePair:
    """The five rows of a pair with coordinates of its own, by the kernels, and their derivatives."""

    def __init__(self, group, i):
        f, g = group.f[i], group.g[i]
        self.table, self.pool, _ = _packed((f.surface, f.reversed), (g.surface, g.reversed))
        self.q = group.q[i].reshape(2, 7).copy()
        self.q[:, 3:] /= np.linalg.norm(self.q[:, 3:], axis=1, keepdims=True)
        self.x = group.x[i]
        lengths = np.empty((1, 4))
        coordinate_lengths(self.table, self.pool, 0, SURFACE_RECORD, tuple(self.x), lengths, 0)
        self.lengths = lengths[0]
        self.work = np.empty((VECTORS, 3, VARIABLES))

    def at(self, step):
        """Poses and coordinates after a step (16,)."""
        return retract(self.q, step[:12].reshape(2, 6)), self.x + step[12:] / self.lengths

    def rows(self, step):
        """Rows (5,) and their gradients (5, 16)."""
        q, x = self.at(step)
        residual, jacobian = np.empty(5), np.empty((5, VARIABLES))
        pair = LiftedPair((0, SURFACE_RECORD), (0, 1), tuple(x), tuple(self.lengths))
        free_rows(Store(self.table, self.pool), pair, q, self.work, residual, jacobian, 0, 1)
        return residual, jacobian

    def hessian(self, y):
        out = np.empty((VARIABLES, VARIABLES))
        pair = LiftedPair((0, SURFACE_RECORD), (0, 1), tuple(self.x), tuple(self.lengths))
        free_hessian(Store(self.table, self.pool), pair, self.q, tuple(y), self.work, out)
        return out


@pytest.fixture(scope="module")
def free_pairs(group):
    return [(i, FreePair(group, i)) for i in range(0, len(group.f), 25)]


def test_rows_of_a_free_pair(group, free_pairs):
    for i, pair in free_pairs:
        tangents = [t[0] for t in Local(group.pairs.take([i]), pair.x[None], group.q[i : i + 1]).tangents]
        np.testing.assert_allclose(pair.lengths, np.linalg.norm(tangents, axis=1), rtol=1e-13)
        # Away from the pair, where all five say something. The lengths stay.
        step = np.zeros(16)
        step[12:] = 0.02 * np.random.default_rng(i).normal(size=4)
        there = Local(group.pairs.take([i]), (pair.x + step[12:] / pair.lengths)[None], group.q[i : i + 1])
        fu, fv, gu, gv = (t[0] for t in there.tangents)
        d, n = there.d[0], there.n[0]
        expected = np.array([n @ d, d @ fu, d @ fv, n @ gu, n @ gv]) / [1.0, *pair.lengths]
        np.testing.assert_allclose(pair.rows(step)[0], expected, rtol=0, atol=1e-13 * (1.0 + np.abs(expected).max()))


def test_gradients_of_a_free_pair(free_pairs):
    rng = np.random.default_rng(45)
    for _, pair in free_pairs:
        direction = rng.normal(size=16) / 4.0
        # Sixth order: 1e-3^6 times a seventh derivative, and rounding over the step.
        expected = slope_of(lambda t, pair=pair, direction=direction: pair.rows(t * direction)[0], 1e-3)
        found = pair.rows(np.zeros(16))[1] @ direction
        assert np.abs(found - expected).max() < 1e-9 * (1.0 + np.abs(expected).max())


def test_hessians_of_a_free_pair(free_pairs):
    rng = np.random.default_rng(46)
    for _, pair in free_pairs:
        direction, y = rng.normal(size=16) / 4.0, rng.normal(size=5)

        def slope(t, pair=pair, direction=direction, y=y):
            # Along constant twists the velocity is the direction all the way.
            return y @ pair.rows(t * direction)[1] @ direction

        expected = slope_of(slope, 1e-3)
        hessian = pair.hessian(y)
        size = 1.0 + np.abs(hessian).max()
        assert abs(direction @ hessian @ direction - expected) < 1e-9 * size
        assert np.abs(hessian - hessian.T).max() < 1e-13 * size


def test_eliminating_the_coordinates_gives_the_hessian_of_the_gap(group, free_pairs):
    for i, pair in free_pairs:
        jacobian = pair.rows(np.zeros(16))[1]
        # No slope of the gap in the coordinates, so no multipliers of the rows of tangency.
        assert np.abs(jacobian[0, 12:]).max() < 1e-12
        rates = -np.linalg.solve(jacobian[1:, 12:], jacobian[1:, :12])
        both = np.concatenate([np.eye(12), rates])
        found = both.T @ pair.hessian([1.0, 0.0, 0.0, 0.0, 0.0]) @ both
        expected = gap_hessian(*group.arguments(i), group.x[i])
        # Rates up to 30, squared.
        assert np.abs(found - expected).max() < 1e-11 * (1.0 + np.abs(rates).max() ** 2)


def objective_at(scene, q):
    """Value, gradient and Hessian by the kernel, for a scene of one moving body of size one at a reference of zero."""
    packed = scene.packed()
    assert packed.scale == 1.0 and not packed.reference.any()
    gradient, hessian = np.empty(6), np.empty((6, 6))
    room = (np.empty(0), np.empty(0), np.empty(0))
    places = np.stack([np.full(6, 5), np.arange(6), np.full(6, 5)])
    whole = Sparsity(places, np.zeros((1, 2), np.int64), np.empty((1, 6)), np.zeros(0, np.int64))
    value = objective(Store(packed.table, packed.pool), q, 1, room, whole, gradient, hessian)
    # The kernel writes the upper triangle.
    return value, gradient, np.triu(hessian) + np.triu(hessian, 1).T


def one_body(term):
    """A body whose box has a diagonal of one, at the origin."""
    edge = np.sqrt(0.5)
    body = asm.Body("body", asm.shapes.plane(edge, edge))
    scene = asm.Assembly([body])
    scene.minimize(term(body))
    return scene


def test_objectives_and_their_derivatives():
    rng = np.random.default_rng(47)
    for _ in range(10):
        target, point = rng.normal(size=(2, 3))
        reference, start = retract(np.array([0.0, 0, 0, 1, 0, 0, 0]), rng.normal(size=6)), rng.normal(size=6)
        q = retract(reference, start)[None]
        scenes = [
            one_body(lambda body, point=point, target=target: asm.PointDistance(body.point(*point), target)),
            one_body(lambda body, reference=reference: asm.Posture(reference[None])),
        ]
        for scene in scenes:
            scene.packed().refresh()
        p = rotation_matrix(q[0, 3:]) @ point
        r = q[0, :3] + p - target
        d = q[0, :3] - reference[:3]
        c, *u = multiply(reference[3:], q[0, 3:] * [1.0, -1.0, -1.0, -1.0])
        u, s, zero = np.array(u), 0.5, np.zeros((3, 3))
        turn = (p @ p - p @ r) * np.eye(3) - np.outer(p, p) + 0.5 * (np.outer(p, r) + np.outer(r, p))
        turn_back = 2.0 * s * s * (c * c * np.eye(3) - np.outer(u, u))
        # Half of a relative angle is what the vector part shows.
        assert np.linalg.norm(u) == pytest.approx(abs(np.sin(0.5 * np.linalg.norm(start[3:]))), abs=1e-14)
        blocks = [[np.eye(3), -skew(p)], [skew(p), turn]]
        formulas = [
            (r @ r, 2.0 * np.concatenate([r, np.cross(p, r)]), 2.0 * np.block(blocks)),
            (
                d @ d + 4.0 * s * s * u @ u,
                np.concatenate([2.0 * d, -4.0 * s * s * c * u]),
                np.block([[2.0 * np.eye(3), zero], [zero, turn_back]]),
            ),
        ]
        direction = rng.normal(size=6) / 2.0
        for scene, expected in zip(scenes, formulas, strict=True):
            value, gradient, hessian = found = objective_at(scene, q)
            for have, want in zip(found, expected, strict=True):
                np.testing.assert_allclose(have, want, rtol=0, atol=1e-13)

            def along(t, scene=scene, q=q, direction=direction):
                return objective_at(scene, retract(q, t * direction[None]))

            # Sixth order: 1e-2^6 times a seventh derivative, at most some hundred, over 140.
            slope = slope_of(lambda t, along=along: along(t)[0], 1e-2)
            bend = slope_of(lambda t, along=along, direction=direction: along(t)[1] @ direction, 1e-2)
            assert gradient @ direction == pytest.approx(slope, abs=1e-9)
            assert direction @ hessian @ direction == pytest.approx(bend, abs=1e-9)


def test_a_weight_and_its_derivatives():
    """-mass direction . center, in a scene whose reference is not the origin, of two bodies."""
    rng = np.random.default_rng(51)
    for _ in range(5):
        direction, place = rng.normal(size=3), 0.1 * rng.normal(size=3)
        shape = [asm.Face(face.surface.transformed(translation=place)) for face in asm.shapes.box(0.4, 0.5, 0.6)]
        ground = asm.Body("ground", shape, position=rng.normal(size=3), fixed=True, density=3.0)
        body = asm.Body("body", shape, density=2.0)
        scene = asm.Assembly([ground, body])
        term = asm.Weight([ground, body], direction, 9.81)
        scene.minimize(term)
        packed = scene.packed()
        q = retract(np.array([[0.0, 0, 0, 1, 0, 0, 0]]), rng.normal(size=(1, 6)))
        down = direction / np.linalg.norm(direction)

        def energy(row, body=body, ground=ground, down=down, place=place):
            lifted = rotation_matrix(row[3:]) @ place + row[:3]
            return -9.81 * (body.mass * down @ lifted + ground.mass * down @ ground.pose.apply(place))

        def at(row, packed=packed, ground=ground):
            gradient, hessian = np.empty(6), np.empty((6, 6))
            room = (np.empty(0), np.empty(0), np.empty(0))
            places = np.stack([np.full(6, 5), np.arange(6), np.full(6, 5)])
            whole = Sparsity(places, np.zeros((1, 2), np.int64), np.empty((1, 6)), np.zeros(0, np.int64))
            poses = np.stack([ground.q, row])
            poses[:, :3] = (poses[:, :3] - packed.reference) / packed.scale
            value = objective(Store(packed.table, packed.pool), poses, 1, room, whole, gradient, hessian)
            return value * packed.unit, gradient * packed.unit, np.triu(hessian) + np.triu(hessian, 1).T

        value, gradient, hessian = at(q[0])
        # Of the order of 10; the gradient counts scaled lengths.
        assert value == pytest.approx(energy(q[0]), rel=1e-13, abs=1e-12)
        units = np.repeat([packed.scale, 1.0], 3)
        direction = rng.normal(size=6) / 2.0
        slope = slope_of(lambda t, q=q, d=direction: energy(retract(q[0], t * d)), 1e-2)
        assert gradient @ (direction / units) == pytest.approx(slope, abs=1e-9)
        bend = slope_of(lambda t, q=q, d=direction, u=units: at(retract(q[0], t * d))[1] @ (d / u), 1e-2)
        scaled = direction / units
        assert scaled @ hessian @ scaled * packed.unit == pytest.approx(bend, abs=1e-9)


def step_problem(rng, n=8, m=4):
    """H, J, gradient, residual, y, mu of one step; two rows of J are the same."""
    h = rng.normal(size=(n, n))
    j = rng.normal(size=(m, n))
    j[-1] = j[0]
    return h + h.T, j, rng.normal(size=n), rng.normal(size=m), rng.normal(size=m), 10.0 ** rng.uniform(-4, -1)


def test_eliminating_the_multipliers_leaves_the_same_step():
    rng = np.random.default_rng(48)
    for _ in range(20):
        h, j, gradient, c, y, mu = step_problem(rng)
        n, m = j.shape[1], j.shape[0]
        eliminated = h + j.T @ j / mu
        shift = max(0.0, 1.0 - np.linalg.eigvalsh(eliminated)[0])
        full_matrix = np.block([[h + shift * np.eye(n), j.T], [j, -mu * np.eye(m)]])
        both = -np.linalg.solve(full_matrix, np.concatenate([gradient + j.T @ y, c]))
        step = -np.linalg.solve(eliminated + shift * np.eye(n), gradient + j.T @ (y + c / mu))
        # Condition numbers up to 1e6.
        np.testing.assert_allclose(both[:n], step, rtol=0, atol=1e-9 * np.abs(both).max())
        np.testing.assert_allclose(both[n:], (j @ step + c) / mu, rtol=0, atol=1e-9 * np.abs(both).max() / mu)
        # Descent, and n positive and m negative eigenvalues, though rows are redundant.
        assert step @ (gradient + j.T @ (y + c / mu)) < 0.0
        assert (np.linalg.eigvalsh(full_matrix) > 0.0).sum() == n
        assert (np.linalg.eigvalsh(full_matrix) < 0.0).sum() == m


def test_the_inertia_is_wrong_where_the_eliminated_matrix_is_not_positive():
    rng = np.random.default_rng(49)
    seen = 0
    for _ in range(20):
        h, j, _, _, _, mu = step_problem(rng)
        negative = (np.linalg.eigvalsh(h + j.T @ j / mu) < 0.0).sum()
        seen += negative > 0
        full_matrix = np.block([[h, j.T], [j, -mu * np.eye(len(j))]])
        assert (np.linalg.eigvalsh(full_matrix) < 0.0).sum() == len(j) + negative
    assert seen > 5


@pytest.mark.parametrize("one_sided", [0, 1])
def test_the_slope_of_the_augmented_lagrangian_is_the_first_order_multiplier(one_sided):
    rng = np.random.default_rng(50)
    for _ in range(50):
        c, y, mu = rng.normal(size=1), -np.abs(rng.normal(size=1)), 10.0 ** rng.uniform(-2, 0)
        side = np.array([one_sided])
        force = y[0] + c[0] / mu
        idle = one_sided == 1 and force >= 0.0
        expected = -0.5 * mu * y[0] ** 2 if idle else y[0] * c[0] + 0.5 * c[0] ** 2 / mu
        rows = new_rows(1, mu)
        rows.y[:] = y
        assert merit(c, side, rows) == pytest.approx(expected, rel=1e-14, abs=1e-14)
        # Quadratic on either side of its switch, so central differences are exact there but for rounding.
        h = 1e-4
        if abs(force) > 2.0 * h / mu:
            slope = (merit(c + h, side, rows) - merit(c - h, side, rows)) / (2.0 * h)
            assert slope == pytest.approx(0.0 if idle else force, abs=1e-8 / mu)


def test_one_step_of_the_loop():
    """From a solution whose target has moved, in a scene of size one: the pose after one step, by the formulas."""
    ring = asm.shapes.torus(1.0, 0.3)
    ring = ring.transformed(scale=1.0 / ring.size)
    first = asm.Body("first", ring, fixed=True)
    second = asm.Body("second", ring, (0.37, 0.05, 0.02), (0.7, 0.7, 0.1, 0.1))
    scene = asm.Assembly([first, second])
    contact = asm.Contact(first, second)
    scene.constrain(contact)
    grasp = second.point(0.3, 0.1, 0.0)
    goal = asm.PointDistance(grasp, (0.9, 0.3, 0.1))
    scene.minimize(goal, asm.Posture())
    before = scene.solve()
    goal.target = goal.target + [2e-3, -1e-3, 1e-3]
    mu = 1e-3
    after = scene.solve(before, max_iterations=1, penalty_floor=mu)
    _, _, _, _, shift, alpha, _ = after.history[1]
    assert before.success and after.iterations == 1 and alpha == 1.0 and after.history[0, 3] == mu

    q, y = before.q[1], before.multipliers[contact.name][0]
    pair = before.contacts[contact.name]
    force = np.concatenate([pair.normal, np.cross(pair.points[1] - q[:3], pair.normal)])
    # The contact carries a load, so that the curvature of its gap counts.
    assert abs(y) > 0.1
    hessian = y * gap_hessian(ring, before.q[0], ring, q, pair.parameters)[6:, 6:]
    p = rotation_matrix(q[3:]) @ grasp.coordinates
    r = q[:3] + p - goal.target
    turn = (p @ p - p @ r) * np.eye(3) - np.outer(p, p) + 0.5 * (np.outer(p, r) + np.outer(r, p))
    hessian += 2.0 * np.block([[np.eye(3), -skew(p)], [skew(p), turn]])
    # A posture at its reference has no slope, and half the size is its lever.
    hessian += np.diag([2.0, 2.0, 2.0, 0.5, 0.5, 0.5])
    slope = 2.0 * np.concatenate([r, np.cross(p, r)]) + force * (y + pair.gap / mu)
    step = -np.linalg.solve(hessian + np.outer(force, force) / mu + shift * np.eye(6), slope)
    assert 1e-4 < np.abs(step).max() < 0.1
    # Gaps near 1e-14 over mu, and rounding over the smallest curvature, some tenths.
    np.testing.assert_allclose(after.q[1], retract(q, step), rtol=0, atol=1e-11)
