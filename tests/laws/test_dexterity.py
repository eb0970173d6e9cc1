"""An end effector's Jacobian and measures of it: against differences, columns by hand, poses solved again, a sweep."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

import assembly as asm
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.dexterity import MEASURES
from assembly.constraints.program import records as layout
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.dense.row_table import gradient_at
from assembly.solve.loop.dexterity import dexterity
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.test_solve_formulas import slope_of
from tests.laws.tip_scenes import MECHANISMS, arm, four_bar
from tests.solve.mechanisms import chain

# Of one singular value these are constant.
CONSTANT = ("inverse_condition", "isotropy")
# Arms of which others tell as much, in less time.
LONG = ("arm of two", "arm of six, two slide", "arm of seven", "small arm", "large arm")
# How far bodies are from poses where the rows hold, in sizes of the scene and radians.
OFF = (0.0, 1e-3, 0.05)


@cache
def solved(name):
    """A mechanism and a pose where it closes."""
    mechanism = MECHANISMS[name]()
    solution = mechanism.scene.solve()
    assert solution.success
    return mechanism, solution


def term_at(scene, q, tracked, order=1):
    """Value and gradient of a scene's one term; the code runs as plain Python."""
    # Once more from the pair that is found: after a last small step its curvatures are those before the step.
    point = LoopPoint(scene, q, LoopPoint(scene, q, tracked).tracked)
    gradient = np.zeros(point.n)
    term = point.table[layout.TERM_TABLE]
    return dexterity(point.program, term, point.rows, point.point, order, gradient), gradient


def unknowns(scene):
    return 6 * sum(not body.fixed for body in scene.bodies)


def terms_of(name, parts):
    """Terms of every measure and task, each at one of the distances from the poses where the rows hold.

    Of every so many tasks a measure has one, another one of the next mechanism.
    """
    mechanism, solution = solved(name)
    rng = np.random.default_rng(len(name))
    for i, task in enumerate(mechanism.tasks):
        for j, measure in enumerate(MEASURES):
            if (measure in CONSTANT and len(mechanism.inputs) == 1) or (i - j - len(name)) % parts:
                continue
            direction = rng.normal(size=6 if task == "pose" else 3) if measure == "force_transmission" else None
            scene = mechanism.with_term(measure, task, direction)
            n = unknowns(scene)
            off = OFF[(i + j) % 3]
            yield scene, moved(scene, solution.q, off * rng.normal(size=n) / np.sqrt(n)), rng.normal(size=n)


@pytest.mark.parametrize("name", [name for name in MECHANISMS if name != "sledge"])
def test_gradients(name, cases):
    parts = cases(len(solved(name)[0].tasks), 1)
    for scene, q, direction in terms_of(name, parts):
        # A pair of a contact is carried from the same start at every step.
        tracked = LoopPoint(scene, q).tracked
        direction /= np.linalg.norm(direction)
        value, gradient = term_at(scene, q, tracked)
        assert np.isfinite(value) and np.abs(gradient).max() > 0.0

        def along(t, scene=scene, q=q, tracked=tracked, direction=direction):
            return term_at(scene, moved(scene, q, t * direction), tracked, order=0)[0]

        # Sixth order: the step to the sixth times a seventh derivative, and rounding of some 1e-15 of the value over
        # the step. Where the value is steep, which it is near a pole of a force, the step is short.
        expected = slope_of(along, 1e-3 * min(1.0, 3.0 * abs(value) / np.linalg.norm(gradient)))
        size = max(abs(expected), 0.1 * np.linalg.norm(gradient), 1e-3 * abs(value))
        assert abs(gradient @ direction - expected) < 1e-9 * size


def test_gradients_through_a_contact_at_a_fold():
    """A face that lies flat on another one: its pair's coordinates are unknowns with rows of their own."""
    mechanism, solution = solved("sledge")
    rng = np.random.default_rng(51)
    evaluate = getattr(gradient_at, "py_func", gradient_at)
    for measure, direction in (("manipulability", None), ("force_transmission", (1.0, 2.0, 0.5))):
        scene = mechanism.with_term(measure, "position", direction)
        packed = scene.packed()
        state = scene._start(packed, solution.q, None)
        state[packed.contacts_at : packed.angles_at] = solution._state[packed.contacts_at : packed.angles_at]
        # The block stays level: tilted planes have no pair.
        along = rng.normal(size=(3, 6)) * [[0, 0, 0, 0, 0, 0], [1, 1, 1, 1, 1, 1], [1, 1, 1, 0, 0, 1]] / np.sqrt(10)

        def at(t, scene=scene, packed=packed, state=state, along=along):
            """Value and gradient by plain Python."""
            gradient, free = np.empty(18), np.empty(1, dtype=np.int64)
            there = state.copy()
            q = there[: packed.contacts_at].reshape(-1, 7)
            q[:] = moved(scene, q, t * along[1:].ravel())
            value = evaluate(packed.table, packed.pool, there, free, gradient, packed.end_effectors)
            assert free[0] == 0
            return value, gradient

        expected = slope_of(lambda t, at=at: at(t)[0], 1e-3)
        gradient = at(0.0)[1]
        # The block's idle turn rests up to the root of rounding, and off the pin it moves the tip.
        assert abs(gradient @ along.ravel() - expected) < 1e-6 * np.linalg.norm(gradient)
        assert abs(expected) > 1e-2 * np.linalg.norm(gradient)


@pytest.mark.parametrize("name", ["arm of two", "planar four-bar", "spatial four-bar", "spinning link", "cam"])
def test_derivatives_of_gradients(name, cases):
    """They are symmetric but for turns, which do not commute, and their symmetric part is the loop's Hessian."""
    mechanism, solution = solved(name)
    scene = mechanism.with_term("manipulability", "pose")
    n = unknowns(scene)
    q = moved(scene, solution.q, 0.01 * np.random.default_rng(52).normal(size=n))
    tracked = LoopPoint(scene, q).tracked
    gradient = term_at(scene, q, tracked)[1]
    # Row b has the derivatives of the gradient along unknown b; of the unknowns some are taken, unless the run is long.
    some = np.random.default_rng(53).permutation(n)[: cases(7, n)]
    second = np.array(
        [slope_of(lambda t, b=b: term_at(scene, moved(scene, q, t * b), tracked)[1], 3e-3) for b in np.eye(n)[some]]
    )[:, some]
    # X_b X_a f - X_a X_b f = (gradient of turns) . (a x b): entry (b, a) less entry (a, b).
    twisted = np.zeros((n, n))
    for s in range(3, n, 6):
        x, y, z = gradient[s : s + 3]
        twisted[s : s + 3, s : s + 3] = [[0, -z, y], [z, 0, -x], [-y, x, 0]]
    twisted = twisted[np.ix_(some, some)]
    size = np.abs(second).max()
    # Steps of 3e-3 to the sixth, 1e-15, times high derivatives; rounding over the step.
    np.testing.assert_allclose(second - second.T, twisted, rtol=0, atol=1e-8 * size)
    # Which the loop takes by forward differences with steps of 1e-6.
    hessian = LoopPoint(scene, q, tracked).goal()[2][np.ix_(some, some)]
    np.testing.assert_allclose(hessian, 0.5 * (second + second.T), rtol=0, atol=1e-4 * size)
    assert np.abs(hessian).max() > 0.1 * size


def by_definition(j, measure, direction):
    """The measures of a Jacobian by numpy."""
    s = np.linalg.svd(j, compute_uv=False)
    gram = j @ j.T if j.shape[0] <= j.shape[1] else j.T @ j
    if measure == "manipulability":
        return np.sqrt(np.linalg.det(gram))
    if measure == "inverse_condition":
        return s[-1] / s[0]
    if measure == "isotropy":
        return np.linalg.det(gram) ** (1.0 / len(gram)) / (np.trace(gram) / len(gram))
    if measure == "smallest_singular_value":
        return s[-1]
    # The largest force along the direction that torques of norm one hold: tau = J^T f.
    return 1.0 / np.linalg.norm(j.T @ direction)


@pytest.mark.parametrize("name", MECHANISMS)
def test_measures_are_what_they_are_called(name):
    mechanism, solution = solved(name)
    rng = np.random.default_rng(53)
    for task in mechanism.tasks:
        # What `Dexterity` weighs turns with in a pose task.
        length = asm.Dexterity(mechanism.tip, mechanism.inputs).tip_task.length
        jacobian = asm.tip_jacobian(
            mechanism.scene, mechanism.tip, mechanism.inputs, solution, task=task, length=length
        )
        for measure in MEASURES:
            u = rng.normal(size=len(jacobian))
            direction = u if measure == "force_transmission" else None
            term = asm.Dexterity(mechanism.tip, mechanism.inputs, measure, task=task, direction=direction, weight=3.0)
            expected = by_definition(jacobian, measure, u / np.linalg.norm(u))
            # Determinants of J J^T lose the square of its condition, up to 700,000 of the large arm's pose.
            found = asm.dexterity_value(mechanism.scene, term, solution)
            assert found == pytest.approx(expected, rel=1e-11 if "large" not in name else 1e-4)
            if "large" in name and measure in ("smallest_singular_value", "inverse_condition", "force_transmission"):
                assert found == pytest.approx(expected, rel=1e-9)
            # The loop's own objective, of a solve that takes no step: less the value, for it is maximized.
            if task == mechanism.tasks[0]:
                scene = mechanism.with_term(measure, task, direction)
                start = scene.solve(solution.q, max_iterations=0)
                assert start.objective == pytest.approx(-found, rel=1e-9)


def columns(joints, solution, bodies, point):
    """Of an open chain, by hand: z x (p - o) and z of a hinge, z of a slide (paper 001, section 3.1)."""
    out = []
    for joint in joints:
        row = solution.q[bodies.index(joint.frame_a.body)]
        turn = rotation_matrix(row[3:])
        z, o = turn @ joint.frame_a.axes[:, 2], row[:3] + turn @ joint.frame_a.origin
        out.append(np.concatenate([np.cross(z, point - o), z] if isinstance(joint, asm.Revolute) else [z, np.zeros(3)]))
    return np.array(out).T


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize(("count", "sliding"), [(2, ()), (3, (1,)), (4, ()), (5, (0, 3)), (6, ()), (7, (6,))])
def test_columns_of_open_chains(count, sliding, size):
    mechanism = arm(count, sliding, size)
    solution = mechanism.scene.solve(tolerance=1e-14)
    bodies = mechanism.scene.bodies
    point = solution.pose(bodies[-1]).apply(mechanism.tip.origin)
    expected = columns(mechanism.inputs, solution, bodies, point)
    found = asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs, solution)
    # Linear rows of hinges have the size of the arm; the rest is of order one.
    slides = np.isin(np.arange(count), sliding)
    units = np.where(np.arange(6)[:, None] < 3, np.where(slides, 1.0, size), 1.0)
    np.testing.assert_allclose(found / units, expected / units, rtol=0, atol=1e-13 * count)


def poses_around(mechanism, solution, k):
    """Tips (position, rotation) where input k is t from its value at the solution and the others stay, by solves."""
    values = [solution.values[f"{freedom.joint.name}.{freedom.name}"] for freedom in mechanism.inputs]
    body = mechanism.tip.body

    def at(t):
        for i, (freedom, value) in enumerate(zip(mechanism.inputs, values, strict=True)):
            freedom.value = value + (t if i == k else 0.0)
        try:
            there = mechanism.scene.solve(solution.q, tolerance=1e-14)
        finally:
            for freedom in mechanism.inputs:
                freedom.value = None
        assert there.success
        pose = there.pose(body)
        return pose.apply(mechanism.tip.origin), rotation_matrix(pose.q[3:])

    return at


@pytest.mark.parametrize("name", [name for name in MECHANISMS if name not in LONG])
def test_jacobians_are_how_solved_poses_change(name):
    mechanism, solution = solved(name)
    inputs = [item if isinstance(item, Freedom) else item.freedom() for item in mechanism.inputs]
    mechanism = replace(mechanism, inputs=inputs)
    task = mechanism.tasks[-1]
    jacobian = asm.tip_jacobian(mechanism.scene, mechanism.tip, inputs, solution, task=task)
    # A drive adds a row, and the scene is packed anew: what is compared is of poses.
    for k in range(len(inputs)):
        at = poses_around(mechanism, solution, k)
        first = at(0.0)[1]

        def both(t, at=at, first=first):
            place, turn = at(t)
            # The part of a turn that is odd in it has its vector to third order, and differences see the rest as such.
            relative = turn @ first.T
            sine = 0.5 * np.array(
                [relative[2, 1] - relative[1, 2], relative[0, 2] - relative[2, 0], relative[1, 0] - relative[0, 1]]
            )
            return np.concatenate([place, sine])[: len(jacobian)]

        # Sixth order: 0.02^6 = 6e-11 times derivatives; poses are solved to some 1e-14, over the step.
        expected = slope_of(both, 0.02)
        np.testing.assert_allclose(jacobian[:, k], expected, rtol=0, atol=1e-8)
        assert np.abs(expected).max() > 1e-3


def test_redundant_rows_that_do_not_hold_lock_nothing():
    """Of a planar four-bar in space three rows are too many; off its poses they contradict each other."""
    mechanism, solution = solved("planar four-bar")
    scene = mechanism.with_term("manipulability", "position")
    direction = np.random.default_rng(54).normal(size=18) / np.sqrt(18)
    exact = asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs, solution.q, task="pose")
    for off in (1e-9, 1e-6, 1e-3, 0.05):
        q = moved(scene, solution.q, off * direction)
        found = asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs, q, task="pose")
        # As smooth as the mechanism.
        np.testing.assert_allclose(found, exact, rtol=0, atol=20.0 * off)
        assert scene.solve(q).success


class Bars:
    """The planar four-bar by trigonometry: crank from the origin, coupler, rocker to the ground's other end."""

    def __init__(self, corners):
        a, b, d = (np.array(corner[:2], dtype=float) for corner in corners)
        self.ground, self.a, self.b = d, a, b
        self.coupler, self.rocker = np.linalg.norm(b - a), np.linalg.norm(b - d)
        self.side = np.sign((b - a)[0] * (d - a)[1] - (b - a)[1] * (d - a)[0])

    def corners(self, angle):
        c, s = np.cos(angle), np.sin(angle)
        a = np.array([c * self.a[0] - s * self.a[1], s * self.a[0] + c * self.a[1]])
        # Where the circles of coupler and rocker meet, on the side they met first.
        span = self.ground - a
        length = np.linalg.norm(span)
        along = (self.coupler**2 - self.rocker**2 + length**2) / (2.0 * length)
        height = np.sqrt(self.coupler**2 - along**2)
        u = span / length
        return a, a + along * u - self.side * height * np.array([-u[1], u[0]])

    def speed(self, angle, point):
        """|dp / d angle| of a point of the coupler, given where it is at the angle zero."""
        a, b = self.corners(angle)
        before, now = self.b - self.a, b - a
        turn = np.arctan2(now[1], now[0]) - np.arctan2(before[1], before[0])
        c, s = np.cos(turn), np.sin(turn)
        arm = np.array([[c, -s], [s, c]]) @ (np.asarray(point[:2]) - self.a)

        def quarter(v):
            return np.array([-v[1], v[0]])

        # v_a + w2 x (b - a) = w3 x (b - d)
        rates = np.linalg.solve(np.column_stack([quarter(now), -quarter(b - self.ground)]), -quarter(a))
        return np.linalg.norm(quarter(a) + rates[0] * quarter(arm))


def test_bars_close():
    bars = Bars([(0.3, 0.4, 0), (2.5, 1.5, 0), (3, 0, 0)])
    for angle in np.linspace(-3.0, 3.0, 13):
        a, b = bars.corners(angle)
        lengths = [np.linalg.norm(v) for v in (a, b - a, b - bars.ground)]
        np.testing.assert_allclose(lengths, [0.5, np.hypot(2.2, 1.1), np.hypot(0.5, 1.5)], rtol=1e-14)
    np.testing.assert_allclose(bars.corners(0.0), [bars.a, bars.b], rtol=0, atol=1e-15)


def test_the_best_pose_of_a_four_bar_is_the_maximum_of_a_sweep():
    mechanism = four_bar()
    bars = Bars([(0.3, 0.4, 0), (2.5, 1.5, 0), (3, 0, 0)])
    point = mechanism.tip.origin

    def slope(angle):
        return slope_of(lambda t: bars.speed(angle + t, point), 1e-2)

    angles = np.linspace(-np.pi, np.pi, 721)
    slopes = np.array([slope(angle) for angle in angles])
    peaks = [
        brentq(slope, low, high, xtol=1e-12)
        for low, high, before, after in zip(angles[:-1], angles[1:], slopes[:-1], slopes[1:], strict=True)
        if before > 0.0 >= after
    ]
    assert len(peaks) >= 2
    scene = mechanism.with_term("manipulability", "position")
    crank = scene.constraints[0]
    found = set()
    for start in np.linspace(-2.8, 2.8, 8):
        crank.angle = start
        closed = mechanism.scene.solve()
        crank.angle = None
        assert closed.success
        best = scene.solve(closed.q)
        assert best.success
        angle = best.values["joint 1.angle"]
        nearest = min(peaks, key=lambda peak: abs(np.angle(np.exp(1j * (peak - angle)))))
        # A flat maximum: an angle off by 1e-6 costs 1e-12 of the value.
        assert abs(np.angle(np.exp(1j * (nearest - angle)))) < 1e-6
        assert -best.objective == pytest.approx(bars.speed(nearest, point), rel=1e-11)
        found.add(peaks.index(nearest))
    assert len(found) >= 2


def test_inputs_that_determine_nothing_stall_and_leave_no_infinities_behind():
    closed, open_ = four_bar(), arm(3)
    inputs = [(closed, [closed.scene.constraints[0], closed.scene.constraints[3]]), (open_, open_.inputs[:2])]
    for mechanism, given in inputs:
        start = mechanism.scene.solve()
        scene = asm.Assembly(mechanism.scene.bodies)
        scene.constrain(*mechanism.scene.constraints)
        scene.maximize(asm.Dexterity(mechanism.tip, given))
        solution = scene.solve(start.q)
        assert solution.status is asm.Status.STALLED and not solution.success
        assert solution.objective == np.inf
        np.testing.assert_allclose(solution.q, start.q, rtol=0, atol=1e-15)
        figures = [solution.feasibility, solution.stationarity, *solution.violations.values()]
        assert np.isfinite(np.concatenate([figures, *solution.multipliers.values()])).all()
        assert solution.feasibility < 1e-11
        with pytest.raises(asm.errors.InputError, match="inputs is"):
            asm.tip_jacobian(mechanism.scene, mechanism.tip, given, start)


def test_a_dead_point_has_no_jacobian():
    """Crank and coupler in line, the rocker as input: it cannot move the crank there, and near it rates grow."""
    corners = [(0, 0, 0), (1, 0, 0), (3, 0, 0), (3, -2, 0)]
    scene = chain([(0, 0, 1)] * 4, corners)
    crank, rocker = scene.constraints[0], scene.constraints[3]
    tip = scene.body("link 1").point(1, 0, 0)
    with pytest.raises(asm.errors.InputError, match="'joint 4'.angle"):
        asm.tip_jacobian(scene, tip, [rocker])
    np.testing.assert_allclose(asm.tip_jacobian(scene, tip, [crank]).ravel(), [0, 1, 0], rtol=0, atol=1e-13)
    rates = []
    for angle in (1e-2, 1e-3):
        crank.angle = angle
        near = scene.solve(tolerance=1e-14)
        crank.angle = None
        rates.append(np.linalg.norm(asm.tip_jacobian(scene, tip, [rocker], near.q)))
    # Crank turns per rocker turn, as the inverse of the angle.
    assert rates[1] / rates[0] == pytest.approx(10.0, rel=0.05)


def test_sledge_turns_freely():
    """The block's turn is no input, and moves no tip at the pin; a tip beside the pin is not determined."""
    mechanism, solution = solved("sledge")
    assert mechanism.scene.mobility(solution.q).dof == 2
    tip = mechanism.tip.body.point(0.2, 0, 0)
    with pytest.raises(asm.errors.InputError, match="expected inputs that determine"):
        asm.tip_jacobian(mechanism.scene, tip, mechanism.inputs, solution)
