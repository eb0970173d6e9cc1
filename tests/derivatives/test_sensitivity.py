"""Derivatives of solutions against closed forms, differences of re-solved scenes, CasADi, and the envelope theorem."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import assembly as asm
from assembly.derivatives.columns import columns_of
from assembly.derivatives.implicit import _problem
from assembly.derivatives.kkt import System, _tried, one_sided_moves, solve_system
from tests.derivatives.sensitivity_scenes import (
    CASES,
    Case,
    ball_in_v,
    clips,
    differences,
    pushed,
    rocker,
    slider_crank,
)

EACH = [(name, k) for name, case in CASES.items() for k in range(len(case().wrt))]
# Of dx/dangle, dx/dr, dx/dl of the slider-crank with r 2, l 5, angle 0.7.
SLIDER_CRANK = (-1.696392624895384, 0.593033361407271, 1.034951956465550)


def derived(case, **options):
    solution = case.solved()
    return solution, asm.sensitivity(case.scene, solution, case.of, case.wrt)


def test_slider_crank_is_its_closed_form():
    _, d = derived(slider_crank())
    # The crank's angle is 0.7 to rounding, and so are the derivatives.
    assert np.abs(d.matrix[0, :3] - SLIDER_CRANK).max() < 1e-13
    assert np.array_equal(d.matrix[0], d.matrix[1]) or np.abs(d.matrix[0] - d.matrix[1]).max() < 1e-13
    assert d.rank == 18 and not d.undetermined.any() and not d.reasons


def test_a_ball_in_a_v_is_its_closed_form():
    angle = 0.6
    _, d = derived(ball_in_v(half_angle=angle))
    # Nets are differenced with a step of 3e-3: rounding of figures of order ten over it.
    assert np.abs(d.matrix[0] - [1 / np.sin(angle), -np.cos(angle) / np.sin(angle) ** 2]).max() < 1e-12
    assert np.abs(d.matrix[1]).max() < 1e-12


@pytest.mark.parametrize(("name", "k"), EACH)
def test_derivatives_are_differences_of_solved_scenes(name, k):
    case = CASES[name]()
    solution, d = derived(case)
    # Of sixth order: their error is what solves leave, 2e-13, over the step.
    found = differences(case, solution, case.wrt[k], 1e-3 * max(1.0, abs(case.wrt[k].value)))
    assert np.abs(found - d.matrix[:, k]).max() < 1e-8 * max(1.0, np.abs(found).max())


def test_the_objective_falls_by_the_envelope_theorem_as_along_the_motion():
    case = rocker()
    solution, d = derived(case)
    problem, _, _ = _problem(case.scene, solution, case.of, case.wrt)
    columns = columns_of(problem, case.wrt)
    scales = np.repeat([problem.packed.scale, 1.0], 3)
    steps = np.concatenate([d.twists[body.name] / scales for body in case.scene.bodies], axis=1).T
    direct = (problem.here.gradient @ steps + columns.values) * problem.packed.unit
    at = [measure.kind for measure in case.of].index("objective")
    assert np.abs(direct - d.matrix[at]).max() < 1e-11 * np.abs(d.matrix[at]).max()


@pytest.mark.parametrize("case", [rocker, clips])
def test_multipliers_are_derived(case):
    case = case()
    solution, d = derived(case)
    parameter, step = case.wrt[0], 1e-3
    found = {name: np.zeros(len(y)) for name, y in solution.multipliers.items()}
    middle = parameter.value
    for k, weight in ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0)):
        for sign in (1.0, -1.0):
            parameter.value = middle + sign * k * step
            for name, y in case.solved(solution).multipliers.items():
                found[name] += sign * weight / step * y
    for name, y in found.items():
        assert np.abs(y - d.multipliers[name][:, 0]).max() < 1e-7 * max(1.0, np.abs(y).max())


@pytest.mark.parametrize(("limit", "target", "expected"), [(0.5, 2.0, (1.0, 0.0)), (0.5, 0.2, (0.0, 1.0))])
def test_both_sides_of_a_change_of_the_active_set(limit, target, expected):
    _, d = derived(pushed(limit, target))
    assert d.matrix[0] == pytest.approx(expected, abs=1e-14)


def test_at_a_change_of_the_active_set_there_are_two_derivatives():
    case = pushed(0.5, 0.5)
    _, d = derived(case)
    limit, target = case.wrt
    slide, objective, force = case.of
    assert np.isnan(d[slide, limit]) and np.isnan(d[slide, target])
    assert d.one_sided(slide, limit) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert d.one_sided(slide, target) == pytest.approx((1.0, 0.0), abs=1e-12)
    assert d.one_sided(force, target) == pytest.approx((0.0, -2.0), abs=1e-12)
    assert d[objective, limit] == 0.0
    assert "1 | 0" in str(d) and "one-sided" in d.reasons[limit.name]


def test_what_a_free_motion_changes_is_undetermined_and_moves_least():
    case = slider_crank()
    hinge = case.scene.constraints[0]
    hinge.angle = None
    solution = case.solved()
    d = asm.sensitivity(case.scene, solution, case.of, case.wrt[1:])
    assert d.undetermined.all() and d.rank == 17 and np.isfinite(d.matrix).all()
    # A re-solve that starts at the solution moves as little as rows ask for.
    radius, step = case.wrt[1], 1e-4
    ends = []
    for sign in (1.0, -1.0):
        radius.value = 2.0 + sign * step
        ends.append(case.scene.solve(solution.q).q)
    found = (ends[0] - ends[1])[:, :3] / (2.0 * step)
    for body, row in zip(case.scene.bodies, found, strict=True):
        assert np.abs(d.poses[body.name][radius][:3] - row).max() < 1e-7


def test_rows_that_repeat_each_other_and_cannot_follow_have_no_derivative():
    door, frame = asm.Body("door"), asm.Body("frame", fixed=True)
    scene = asm.Assembly([frame, door])
    high = asm.Revolute(frame.frame(at=(0, 0, 2)), door.frame(at=(0, 0, 2)), "high")
    scene.constrain(asm.Revolute(frame, door, "low", angle=0.3), high)
    solution = scene.solve()
    tip = asm.Measure(door.point(1, 0, 0), "x")
    apart = asm.Parameter(high.frame_a, "origin", "x")
    turned = asm.Parameter(high.frame_a, "turn", "z")
    d = asm.sensitivity(scene, solution, tip, [apart, turned])
    assert np.isnan(d[tip, apart]) and "cannot all follow" in d.reasons[apart.name]
    assert d[tip, turned] == pytest.approx(0.0, abs=1e-12)
    assert d.rank == 6


def test_casadi_derives_the_same():
    """The slider-crank's closing equations and a pull on its piston, as a program that CasADi derives."""
    casadi = pytest.importorskip("casadi")
    x, p = casadi.SX.sym("x", 3), casadi.SX.sym("p", 3)
    crank, rod, piston = x[0], x[1], x[2]
    radius, length, target = p[0], p[1], p[2]
    rows = casadi.vertcat(
        radius * casadi.cos(crank) + length * casadi.cos(rod) - piston,
        radius * casadi.sin(crank) + length * casadi.sin(rod),
    )
    options = {"ipopt.print_level": 0, "print_time": 0, "ipopt.tol": 1e-14, "ipopt.acceptable_tol": 1e-14}
    solve = casadi.nlpsol("s", "ipopt", {"x": x, "p": p, "f": (piston - target) ** 2 + crank**2, "g": rows}, options)
    solution_of = solve.factory("d", ["x0", "p", "lbx", "ubx", "lbg", "ubg", "lam_x0", "lam_g0"], ["jac:x:p"])
    values = np.array([2.0, 5.0, 4.5])
    first = solve(x0=[0.7, -0.2, 6.0], p=values, lbg=0.0, ubg=0.0)
    given = {"x0": first["x"], "lam_x0": first["lam_x"], "lam_g0": first["lam_g"]}
    bounds = {"lbx": -np.inf, "ubx": np.inf, "lbg": 0.0, "ubg": 0.0}
    jacobian = np.array(solution_of(**given, **bounds, p=values)["jac_x_p"])
    case = slider_crank()
    hinge = case.scene.constraints[0]
    hinge.angle = None
    _, crank_body, _, piston_body = case.scene.bodies
    goal = asm.PointDistance(piston_body.point(0, 0, 0), (4.5, 0, 0))
    q = casadi.SX.sym("q", 7)
    turn = casadi.Function("turn", [q], [(2.0 * casadi.atan2(q[6], q[3])) ** 2])
    case.scene.minimize(goal, asm.Expression(turn, [crank_body]))
    solution = case.scene.solve(stationarity=1e-13)
    assert solution.success
    of = [asm.Measure(hinge), asm.Measure(piston_body, "x")]
    wrt = [case.wrt[1], case.wrt[2], asm.Parameter(goal, "target", "x")]
    d = asm.sensitivity(case.scene, solution, of, wrt)
    assert np.abs(d.matrix - jacobian[[0, 2]]).max() < 1e-8


def test_a_dexterity_is_differenced_by_frames():
    """A planar arm that is to be dexterous and near a place: its second link is made longer."""
    ground, upper, lower = asm.Body("ground", fixed=True), asm.Body("upper"), asm.Body("lower", position=(1, 0, 0))
    scene = asm.Assembly([ground, upper, lower])
    one, two = asm.Revolute(ground, upper, "one"), asm.Revolute(upper.frame(at=(1, 0, 0)), lower, "two")
    tip = lower.point(0.8, 0, 0)
    goal = asm.PointDistance(tip, (0.6, 0.9, 0.0))
    scene.constrain(one, two)
    scene.minimize(goal)
    scene.maximize(asm.Dexterity(tip, [one, two], task="position", weight=0.05))
    # What is measured has the frames as well: a turn of the elbow's turns its angle, and no body.
    of = [asm.Measure(one), asm.Measure(two), asm.Measure(tip, "x"), asm.Measure(two.frame_a, "x")]
    case = Case(scene, of, [asm.Parameter(two.frame_a, "origin", "x"), asm.Parameter(two.frame_a, "turn", "z")])
    solution, d = derived(case)
    for r, parameter in enumerate(case.wrt):
        found = differences(case, solution, parameter, 1e-2)
        # Hessians of dexterities are differences themselves, to 1e-6 or so.
        assert np.abs(found - d.matrix[:, r]).max() < 1e-5
    assert abs(d.matrix[1, 1] + 1.0) < 1e-9 and abs(d.matrix[3, 0]) > 0.1


def test_forces_that_rows_share_are_undetermined():
    """A plane four-bar has three rows too many: what its hinges hold across the plane is no function of the pose."""
    ground, crank, rod, rocker = (
        asm.Body(name, fixed=name == "ground") for name in ("ground", "crank", "rod", "rocker")
    )
    rod.pose, rocker.pose = asm.Pose((0.8, 1.8, 0)), asm.Pose((4, 0, 0))
    scene = asm.Assembly([ground, crank, rod, rocker])
    hinge = asm.Revolute(ground, crank, "hinge", limits=(0.0, 1.1))
    pin = asm.Revolute(crank.frame(at=(2, 0, 0)), rod, "pin")
    last = asm.Revolute(rod.frame(at=(4, 0, 0)), rocker.frame(at=(3, 0, 0)), "last")
    scene.constrain(hinge, pin, last, asm.Revolute(ground.frame(at=(4, 0, 0)), rocker, "foot"))
    scene.minimize(asm.PointDistance(rod.point(2, 1, 0), (-5.0, 4.0, 0.0)))
    bound = asm.Parameter(hinge, "limits", 1)
    of = [asm.Measure(pin, name, on=rod) for name in ("fx", "fy", "fz", "tx", "ty", "tz")]
    case = Case(scene, [*of, asm.Measure(rod, "x")], [bound])
    solution, d = derived(case)
    assert abs(solution.values["hinge.angle"] - 1.1) < 1e-9
    assert d.undetermined.tolist() == [False, False, True, True, True, False, False]
    assert "undetermined: rows that repeat each other share it" in str(d)
    found = differences(case, solution, bound, 1e-3)
    assert np.abs(found - d.matrix[:, 0])[~d.undetermined].max() < 1e-8 * max(1.0, np.abs(found).max())


def test_any_number_of_rows_at_their_bounds_has_one_sided_derivatives():
    """Blocks on rails, each at its stop and drawn to where it is: a stop that comes pushes, one that goes does not."""
    ground, count = asm.Body("ground", fixed=True), 14
    blocks = [asm.Body(f"block {k}") for k in range(count)]
    scene = asm.Assembly([ground, *blocks])
    rails = [
        asm.Prismatic(ground.frame(at=(3 * k, 0, 0)), block, f"rail {k}", limits=(0.5, 4.0))
        for k, block in enumerate(blocks)
    ]
    goals = [asm.PointDistance(block.point(0, 0, 0), (3 * k, 0, 0.5)) for k, block in enumerate(blocks)]
    scene.constrain(*rails)
    scene.minimize(*goals)
    solution = scene.solve(stationarity=1e-13)
    of = [asm.Measure(rails[3]), asm.Measure(rails[9])]
    stop, goal = asm.Parameter(rails[3], "limits", 0), asm.Parameter(goals[9], "target", "z")
    d = asm.sensitivity(scene, solution, of, [stop, goal])
    # Objectives are squares: where the stop stands the block goes with it, or stays at its goal.
    assert d.one_sided(of[0], stop) == pytest.approx((0.0, 1.0), abs=1e-12)
    assert d.one_sided(of[1], goal) == pytest.approx((0.0, 1.0), abs=1e-12)
    assert d[of[1], stop] == d[of[0], goal] == 0.0


def test_least_distances_choose_the_rows_that_trying_all_would():
    rng = np.random.default_rng(1)
    for _ in range(25):
        n, held_rows, open_rows = 6, int(rng.integers(0, 4)), int(rng.integers(1, 8))
        m = held_rows + open_rows
        jacobian = rng.normal(size=(m, n))
        if open_rows > 2:
            jacobian[-1] = jacobian[-2] + jacobian[-3]
        root = rng.normal(size=(n, n))
        hessian = root @ root.T + 0.1 * np.eye(n)
        system = System(jacobian, hessian, rng.normal(size=(m, 3)), rng.normal(size=(n, 3)))
        held = np.arange(m) < held_rows
        for sign in (1.0, -1.0):
            found = one_sided_moves(system, held, ~held, sign)
            tried = _tried(system, held, np.flatnonzero(~held), sign)
            for k, choice in enumerate(tried):
                assert found.contradicts[k] == (choice is None)
                if choice is not None:
                    steps = solve_system(system, choice).steps[:, k]
                    assert np.abs(found.steps[:, k] - steps).max() < 1e-9 * max(1.0, np.abs(steps).max())


def test_a_posture_without_a_reference_is_derived_from_where_the_solve_began():
    """The weight of turns is that of the body's size, so that a radius changes what they are measured by."""
    floor = asm.Body("floor", asm.shapes.plane(20.0, 20.0), fixed=True)
    shape = asm.Parametric(asm.shapes.ellipsoid, a=0.5, b=0.7, c=0.9)
    egg = asm.Body("egg", shape, position=(0.0, 0.0, 2.0))
    scene = asm.Assembly([floor, egg])
    scene.constrain(asm.Contact(floor, egg))
    scene.minimize(asm.Posture(), asm.PointDistance(egg.point(0.4, 0.2, 0.1), (0.5, 1.0, 0.3)))
    begun = np.array(
        [floor.q, [0.3, -0.2, 1.4, *np.array([0.9, 0.3, -0.2, 0.1]) / np.linalg.norm([0.9, 0.3, -0.2, 0.1])]]
    )
    of, radius = [asm.Measure(egg.point(0.1, 0.2, 0.0), axis) for axis in "xyz"], asm.Parameter(shape, "c")
    case = SimpleNamespace(of=of, solved=lambda _: scene.solve(begun))
    solution = scene.solve(begun)
    found = differences(case, solution, radius, 1e-3)
    solution = scene.solve(begun)
    scene.solve(scene.q)
    told = asm.sensitivity(scene, solution, of, [radius]).matrix[:, 0]
    # As of the other scenes: what solves leave over the step.
    assert np.abs(told).max() > 0.1 and np.abs(found - told).max() < 1e-8
