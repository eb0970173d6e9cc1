"""Joints, couplings, expressions and objectives: two solvers that share no formula come to the same pose and forces."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.objectives import Objective
from assembly.kinematics.pose import retract
from assembly.proximity.features.solid_contact import TRACK
from assembly.solve.oracle import reference
from assembly.solve.oracle.dexterity import Mechanism
from assembly.solve.oracle.reference import ReferenceSolver
from assembly.solve.oracle.rows import Poses, Rows
from assembly.solve.oracle.terms import Terms
from assembly.solve.scene import Status


def unit(*e):
    return np.array(e, dtype=float) / np.linalg.norm(e)


def moved(scene, size, seed=0):
    """The scene with its bodies moved a little, and told to stay near there where nothing else is wished for."""
    rng = np.random.default_rng(seed)
    for body in scene.bodies:
        if not body.fixed:
            row = retract(body.q, size * rng.normal(size=6))
            body.pose = asm.Pose(row[:3], row[3:])
    if not scene.objectives:
        # Said, because without an objective the loop measures from where it has gathered scattered bodies.
        scene.minimize(asm.Posture())
    return scene


def four_bar(angle=0.3):
    """A spatial four-bar: revolute, spherical, universal, revolute."""
    ground = asm.Body("ground", fixed=True)
    crank, coupler, rocker = (asm.Body(name) for name in ("crank", "coupler", "rocker"))
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(
        asm.Revolute(ground, crank, "drive", angle=angle),
        asm.Spherical(crank.frame((1, 0, 0)), coupler, "ball"),
        asm.Universal(coupler.frame((3, 0, 0)), rocker.frame((0, 2, 0), (1, 0, 0)), "cross"),
        asm.Revolute(ground.frame((3, 0, 0.5), (0, 1, 0.2)), rocker, "pivot"),
    )
    scene.minimize(asm.Posture())
    return scene


def planar_four_bar(angle=0.4, noise=0.05):
    """Four parallel hinges: three of the rows follow from the others."""
    ground = asm.Body("ground", fixed=True)
    places = {"crank": (0, 0, 0), "coupler": (0, 1, 0), "rocker": (3, 0, 0)}
    crank, coupler, rocker = bodies = [asm.Body(name, position=place) for name, place in places.items()]
    scene = asm.Assembly([ground, *bodies])
    scene.constrain(
        asm.Revolute(ground, crank, "a", angle=angle),
        asm.Revolute(crank.frame((0, 1, 0)), coupler, "b"),
        asm.Revolute(coupler.frame((3, 0, 0)), rocker.frame((0, 2, 0)), "c"),
        asm.Revolute(ground.frame((3, 0, 0)), rocker, "d"),
    )
    return moved(scene, noise)


def gear_train(angle=2.0, **options):
    ground = asm.Body("ground", fixed=True)
    wheels = [asm.Body(f"wheel {k}", position=(2 * k, 0, 0)) for k in range(3)]
    scene = asm.Assembly([ground, *wheels])
    hinges = [asm.Revolute(ground.frame((2 * k, 0, 0)), wheel, f"hinge {k}") for k, wheel in enumerate(wheels)]
    hinges[0].angle = angle
    if angle is None:
        hinges[0].limits = options.get("limits")
        tip = wheels[1].frame((1, 0, 0))
        scene.minimize(asm.FrameDistance(tip, asm.Pose.from_axis_angle((0, 0, 1), 1.2, (2.5, 0.5, 0))))
    scene.constrain(*hinges)
    for k, (a, b) in enumerate(zip(hinges, hinges[1:], strict=False)):
        scene.constrain(asm.Gear(a, b, -2.5, f"mesh {k}", offset=0.1))
    return moved(scene, 0.01)


def rack(angle=1.0):
    ground, wheel, bar = asm.Body("ground", fixed=True), asm.Body("wheel"), asm.Body("bar", position=(0, -1, 0))
    scene = asm.Assembly([ground, wheel, bar])
    hinge = asm.Revolute(ground, wheel, "hinge", angle=angle)
    rail = asm.Prismatic(ground.frame((0, -1, 0), (1, 0, 0)), bar.frame(z=(1, 0, 0)), "rail")
    scene.constrain(hinge, rail, asm.RackPinion(hinge, rail, 1.5, "teeth", offset=0.2))
    if angle is None:
        scene.minimize(asm.PointDistance(bar.point(0, 0, 0), (2, 0, 0)), asm.Posture(weight=0.1))
    return moved(scene, 0.05)


def two(make, size=0.2, quaternion=(1, 0, 0, 0), **options):
    """A joint between a fixed body and one that moves."""
    a, b = asm.Body("a", fixed=True), asm.Body("b", quaternion=unit(*quaternion))
    scene = asm.Assembly([a, b])
    frames = a.frame((0.1, 0.2, 0.3), (1, 2, 3), (1, 0, 0)), b.frame((0.3, -0.1, 0.2), (1.2, 2, 2.7), (1, 0.1, 0))
    scene.constrain(make(*frames, name="joint", **options))
    return moved(scene, size)


def pulled(make, target, **options):
    """The same, with a point of the body that moves drawn to a target."""
    scene = two(make, **options)
    b = scene.body("b")
    scene.minimize(asm.PointDistance(b.point(1.0, 0.0, 0.5), target, weight=2.0))
    return scene


def coupled_swings():
    """A swing, an angle between axes that is nobody's driven value, follows the turn of another joint."""
    ground, arm, ball = asm.Body("ground", fixed=True), asm.Body("arm"), asm.Body("ball", quaternion=unit(1, 0.3, 0, 0))
    hinge = asm.Revolute(ground, arm, "hinge", angle=0.5)
    socket = asm.Spherical(ground.frame((1, 0, 0)), ball, "socket")
    scene = asm.Assembly([ground, arm, ball])
    scene.constrain(hinge, socket, asm.Gear(hinge, socket.freedom("swing"), 1.5, "cam"))
    return moved(scene, 0.02)


def expressions(sign=1.0, **options):
    x, y = ca.SX.sym("x", 7), ca.SX.sym("y", 7)
    values = sign * ca.vertcat(ca.dot(x[:3], y[:3]) - 1.0, ca.sin(y[3]) * y[5] - 0.2)
    c = asm.Body("c", position=(1, 2, 3), quaternion=unit(1, 0.2, 0.3, 0.1))
    d = asm.Body("d", position=(0.2, 0.1, 0.5), quaternion=unit(1, -0.2, 0.4, 0.1))
    scene = asm.Assembly([c, d])
    scene.constrain(asm.Expression(ca.Function("f", [x, y], [values]), [c, d], "law", scale=2.0, **options))
    return scene


def wished_expression():
    scene = expressions()
    c, d = scene.bodies
    # MX, and one that cares for the length of the quaternion where the pose has none.
    x, y = ca.MX.sym("x", 7), ca.MX.sym("y", 7)
    value = ca.sumsqr(x[:3] - 2 * y[:3]) + ca.sumsqr(x[3:] - y[3:]) + 0.3 * ca.sumsqr(x[3:])
    scene.minimize(asm.Expression(ca.Function("wish", [x, y], [value]), [c, d], weight=3.0), asm.Posture(weight=0.5))
    return scene


def far_expression():
    """In millimeters a kilometer away, with bodies that have a size and a third one that stands."""
    far = np.array([1e6, -2e6, 5e5])
    bodies = [asm.Body(f"b{k}", asm.shapes.sphere(40.0), far + 100.0 * k, fixed=k == 0) for k in range(3)]
    poses = [ca.SX.sym(f"q{k}", 7) for k in range(3)]
    height = ca.norm_2(poses[2][:3] - poses[1][:3]) - ca.norm_2(poses[1][:3] - poses[0][:3]) - 25.0
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Expression(ca.Function("farther", poses, [height]), bodies, scale=80.0, name="farther"))
    return moved(scene, 0.0)


def cam():
    """A contact among joints: a ball on a rod that turns, driven, lifts a table that slides."""
    ground = asm.Body("ground", fixed=True)
    arm = asm.Body("arm", asm.shapes.sphere(0.3), quaternion=unit(1, 1, 0.2, 0), position=(1, 0, 0))
    table = asm.Body("table", asm.shapes.plane(6, 6), position=(0, 0, -0.5))
    scene = asm.Assembly([ground, arm, table])
    to_axis = arm.pose.inverse()
    hub = arm.frame(to_axis.apply((0, 0, 0)), to_axis.matrix[:3, :3] @ (0, 1, 0), to_axis.matrix[:3, :3] @ (1, 0, 0))
    hinge = asm.Revolute(ground.frame((0, 0, 0), (0, 1, 0), (1, 0, 0)), hub, "hinge", angle=0.4)
    scene.constrain(hinge, asm.Prismatic(ground, table, "guide"), asm.Contact(table, arm, name="touch"))
    return scene


SCENES = {
    "four-bar": four_bar,
    "four-bar, free": lambda: four_bar(None),
    "gears": gear_train,
    "gears, turns on": lambda: gear_train(20.0),
    "gears, drawn": lambda: gear_train(None),
    "gears, limit active": lambda: gear_train(None, limits=(-0.1, 0.1)),
    "gears, limit inactive": lambda: gear_train(None, limits=(-3.0, None)),
    "rack": rack,
    "rack, drawn": lambda: rack(None),
    "fixed": lambda: two(asm.Fixed),
    "fixed, opposed": lambda: two(asm.Fixed, axes="opposed"),
    "revolute": lambda: two(asm.Revolute),
    "revolute, driven": lambda: two(asm.Revolute, angle=2.5),
    "prismatic": lambda: two(asm.Prismatic),
    "cylindrical": lambda: two(asm.Cylindrical, slide=0.7, angle_limits=(0.5, 1.0)),
    "screw": lambda: two(asm.Screw, pitch=2.0),
    "screw, turns": lambda: two(asm.Screw, pitch=2.0, slide=3.3),
    "screw, drawn": lambda: pulled(asm.Screw, (0.5, 0.5, 0.7), pitch=-1.5),
    "screw, limit active": lambda: pulled(asm.Screw, (0.5, 0.5, 4.0), pitch=-1.5, slide_limits=(None, 0.1)),
    "planar": lambda: two(asm.Planar, offset=0.4, x=0.2, y_limits=(0.5, None)),
    "spherical": lambda: two(asm.Spherical),
    "spherical, driven": lambda: two(asm.Spherical, swing=0.7, azimuth=0.4, twist=-0.3),
    "cone, active": lambda: pulled(asm.Spherical, (1.0, -2.0, 0.2), swing_limits=(None, 0.4)),
    "cone, inactive": lambda: pulled(asm.Spherical, (1.0, -2.0, 0.2), swing_limits=(None, 3.0)),
    "outside a cone": lambda: pulled(asm.Spherical, (0.4, 0.8, 1.0), swing_limits=(1.2, None)),
    "universal": lambda: two(asm.Universal, quaternion=(1, 1, 0, 0), angle_b_limits=(None, -1.0)),
    "parallel": lambda: two(asm.Parallel, axes="opposed", angle=1.0),
    "perpendicular": lambda: two(asm.Perpendicular),
    "point on line": lambda: two(lambda a, b, name: asm.PointOnLine(b, a, name, slide=0.3)),
    "point by line": lambda: two(lambda a, b, name: asm.PointOnLine(b, a, name, distance=0.7, slide=0.3)),
    "point near line": lambda: pulled(
        lambda a, b, name: asm.PointOnLine(b, a, name, distance=None, distance_limits=(0.2, 0.6)), (2.0, -2.0, 0.2)
    ),
    "point far from line": lambda: pulled(
        lambda a, b, name: asm.PointOnLine(b, a, name, distance=None, distance_limits=(0.6, None)), (0.1, 0.2, 0.3)
    ),
    "point on plane": lambda: two(lambda a, b, name: asm.PointOnPlane(b, a, name, offset=-0.3, y=1.0)),
    "distance": lambda: two(asm.Distance, value=2.0),
    "distance, at most": lambda: pulled(asm.Distance, (5.0, 3.0, 1.0), limits=(1.0, 2.0)),
    "distance, at least": lambda: pulled(asm.Distance, (1.3, 0.2, 0.5), limits=(1.0, 2.0)),
    "angle": lambda: two(asm.Angle, value=1.0),
    "angle, at most": lambda: two(asm.Angle, limits=(None, 0.05)),
    "angle, at least": lambda: two(asm.Angle, limits=(0.7, None)),
    "coupled swing": coupled_swings,
    "expression": lambda: moved(expressions(), 0.0),
    "expression, one-sided": lambda: moved(expressions(unilateral=True), 0.0),
    "expression, one-sided, active": lambda: moved(expressions(-1.0, unilateral=True), 0.0),
    "expression, wished for": wished_expression,
    "expression, far away": far_expression,
    "contact among joints": cam,
}


def difference(q, other):
    """The largest difference of two configurations, e and -e being the same."""
    signs = np.where((q[:, 3:] * other[:, 3:]).sum(axis=1, keepdims=True) < 0.0, -1.0, 1.0)
    return np.abs(np.hstack([q[:, :3] - other[:, :3], q[:, 3:] - signs * other[:, 3:]])).max(axis=0)


def check_poses(ours, theirs, scale):
    assert ours.success and theirs.success, (ours.message, theirs.message)
    # Both stop at residuals below 1e-10; positions far away are rounded to 1e-16 of their own size.
    apart = difference(ours.q, theirs.q)
    assert apart[:3].max() <= 1e-8 * scale + 1e-15 * np.abs(ours.q[:, :3]).max() and apart[3:].max() <= 1e-8
    assert theirs.objective == pytest.approx(ours.objective, rel=1e-7, abs=1e-12 * scale**2)
    assert max(theirs.violations.values()) <= 1e-9 * max(scale, 1.0)


@pytest.mark.parametrize("name", SCENES)
def test_two_independent_solvers_agree(name):
    scene = SCENES[name]()
    ours, theirs = scene.solve(), asm.reference.solve(scene)
    check_poses(ours, theirs, scene.packed().scale)
    strongest = max(np.abs(force).max() for force in ours.multipliers.values())
    for constraint, force in ours.multipliers.items():
        # The loop's stationarity is 1e-10, that of IPOPT 1e-11; its barrier leaves 1e-11 on idle rows.
        np.testing.assert_allclose(theirs.multipliers[constraint], force, rtol=1e-6, atol=1e-7 * (1.0 + strongest))


@pytest.mark.parametrize(
    ("name", "active"),
    [
        ("gears, limit active", True),
        ("gears, limit inactive", False),
        ("cone, active", True),
        ("cone, inactive", False),
    ],
)
def test_limits_push_where_they_are_reached(name, active):
    scene = SCENES[name]()
    solution = asm.reference.solve(scene)
    rows = scene.packed().one_sided
    forces = np.concatenate(list(solution.multipliers.values()))[np.argsort(np.concatenate(scene.packed().spans))][rows]
    assert solution.success and (forces.min() < -1e-2) == active
    # Not positive for rows >= 0, but for what the barrier leaves.
    assert forces.max() <= 1e-9


@pytest.mark.parametrize("angle", [0.4, None])
@pytest.mark.parametrize("noise", [0.0, 0.05, 0.2])
def test_rows_that_follow_from_others_do_no_harm(angle, noise):
    scene = planar_four_bar(angle, noise)
    ours, theirs = scene.solve(), asm.reference.solve(scene)
    check_poses(ours, theirs, 1.0)
    # Forces are not unique, but of the drive's size: IPOPT alone ends at 1e9 and more.
    assert all(np.abs(force).max() < 1e3 for force in theirs.multipliers.values())
    if angle is not None:
        # The torque of the drive is the slope of the least objective, and is unique.
        assert theirs.multipliers["a"][5] == pytest.approx(ours.multipliers["a"][5], rel=1e-6, abs=1e-9)


def test_rows_that_follow_from_others_may_be_found_at_the_end(monkeypatch):
    monkeypatch.setattr(reference, "_PROJECTIONS", 0)
    solution = ReferenceSolver(planar_four_bar()).solve()
    assert solution.success and all(np.abs(force).max() < 1e3 for force in solution.multipliers.values())


def test_rows_that_follow_from_others_far_from_the_start():
    # A hinge said twice, from a start a turn of two radians away.
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", quaternion=unit(1, 1, 0.5, 0), position=(3, 2, 1))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground, arm, "once", angle=1.0), asm.Revolute(ground, arm, "twice"))
    scene.minimize(asm.Posture())
    check_poses(scene.solve(), asm.reference.solve(scene), 1.0)


def test_driven_values_limits_and_targets_change_without_building_again():
    scene = four_bar()
    drive, pivot = scene.constraints[0], scene.constraints[3]
    pivot.limits = (-10.0, 10.0)
    tip = scene.body("coupler").frame((1, 0, 0))
    goal = asm.FrameDistance(tip, asm.Pose((1, 1, 1)), length=0.7)
    scene.minimize(goal)
    before = asm.reference.solve(scene)
    built = reference._built.cache_info().misses
    solver = ReferenceSolver(scene)
    last = solver.solve()
    assert difference(before.q, last.q).max() == 0.0
    for angle in np.linspace(0.5, 7.0, 14):
        drive.angle = angle
        goal.target = asm.Pose.from_axis_angle((1, 2, 0.5), 0.3 * angle, (1.0, 1.0, 0.1 * angle))
        ours, theirs = scene.solve(last), solver.solve(last)
        check_poses(ours, theirs, 3.0)
        assert difference(asm.reference.solve(scene, last).q, theirs.q).max() <= 1e-8
        last = theirs
    value = last._state[scene.packed().angles_at : scene.packed().multipliers_at : TRACK]
    assert 7.0 == pytest.approx(value[0], abs=1e-9)
    assert reference._built.cache_info().misses == built
    drive.angle = None
    with pytest.raises(ValueError, match="scene was changed"):
        solver.solve()
    free = asm.reference.solve(scene)
    assert reference._built.cache_info().misses == built + 1
    check_poses(scene.solve(), free, 3.0)
    number = scene.packed()._angles.index(pivot.freedom().coordinate)
    where = free._state[scene.packed().angles_at + TRACK * number]
    pivot.limits = (where + 0.1, where + 1.0)
    ours, theirs = scene.solve(free), asm.reference.solve(scene, free)
    assert reference._built.cache_info().misses == built + 1
    check_poses(ours, theirs, 3.0)
    assert theirs.multipliers["pivot"][5] == pytest.approx(ours.multipliers["pivot"][5], rel=1e-6)
    assert theirs.multipliers["pivot"][5] < -1e-3


def test_offsets_change_without_building_again():
    scene = gear_train()
    mesh = scene.constraints[-1]
    solver = ReferenceSolver(scene)
    solver.solve()
    mesh.offset = 0.3
    last = solver.solve()
    check_poses(scene.solve(), last, 2.0)
    angles = last._state[scene.packed().angles_at : scene.packed().multipliers_at : TRACK]
    # 2, then -2.5 * 2 + 0.1, then -2.5 * -4.9 + 0.3: angles go on past whole turns.
    np.testing.assert_allclose(angles, [2.0, -4.9, 12.55], rtol=0, atol=1e-9)


SADDLES = {
    "perpendicular from parallel": (asm.Perpendicular, {}),
    "universal from parallel": (asm.Universal, {}),
    "aligned from opposed": (asm.Parallel, {"axes": "opposed"}),
    "angle from none": (asm.Angle, {"value": 1.0}),
    "swing from none": (asm.Spherical, {"swing": 1.0}),
    "distance from none": (asm.Distance, {"value": 2.0}),
    "at least some distance": (asm.Distance, {"limits": (2.0, None)}),
}


@pytest.mark.parametrize("moving", [0, 1])
@pytest.mark.parametrize("name", SADDLES)
def test_a_start_without_a_slope_is_left(name, moving):
    make, options = SADDLES[name]
    bodies = [asm.Body("a", fixed=moving == 1), asm.Body("b", fixed=moving == 0)]
    scene = asm.Assembly(bodies)
    scene.constrain(make(*bodies, **options))
    solution = asm.reference.solve(scene)
    assert solution.success, solution.message


def test_what_cannot_hold_is_infeasible_and_named():
    a, b, c = asm.Body("a", fixed=True), asm.Body("b", position=(1, 0.1, 0)), asm.Body("c", position=(0.3, 1, 0.2))
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Distance(a, b, 1.0, "ab"), asm.Distance(b, c, 1.0, "bc"), asm.Distance(a, c, 3.0, "ac"))
    solution = asm.reference.solve(scene)
    assert solution.status is Status.INFEASIBLE and "'ac'" in solution.message
    # The distances lack 1 in all, however they share it.
    assert sum(solution.violations.values()) >= 1.0 - 1e-9
    hinges = asm.Assembly([a, b])
    hinges.constrain(asm.Revolute(a, b, "one", angle=1.0), asm.Revolute(a, b, "other", angle=2.0))
    solution = asm.reference.solve(hinges)
    assert solution.status is Status.INFEASIBLE
    assert solution.violations["one"] + solution.violations["other"] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("as_constraint", [True, False])
def test_an_expression_without_a_value_is_no_success(as_constraint):
    x, body = ca.SX.sym("x", 7), asm.Body("body", position=(-1.0, 0.0, 0.0))
    for value in (ca.log(x[0]), 1.0 / x[1], ca.floor(ca.sqrt(x[0]))):
        scene = asm.Assembly([body])
        item = asm.Expression(ca.Function("f", [x], [value]), [body])
        (scene.constrain if as_constraint else scene.minimize)(item)
        solution = asm.reference.solve(scene)
        assert not solution.success
        figures = [solution.objective, solution.feasibility, solution.stationarity, *solution.violations.values()]
        assert not np.isnan([*solution.q.ravel(), *figures]).any()


def test_what_the_reference_solver_does_not_take_is_named():
    class Wish(Objective):
        def __repr__(self):
            return "Wish()"

    scene = two(asm.Fixed)
    packed, symbols = scene.packed(), [ca.MX.sym("pose", 7) for _ in scene.bodies]
    poses = Poses(symbols, packed)
    with pytest.raises(ValueError, match=r"objective is Wish\(\); expected .* FrameDistance"):
        Terms(
            packed,
            scene.bodies,
            [(1.0, Wish((), 1.0))],
            poses,
            Mechanism(packed, scene.bodies, scene.constraints, poses),
        )
    with pytest.raises(ValueError, match="constraint 'rule' is .*; expected .* an Expression"):
        Rows(packed, scene.bodies, [Constraint(scene.bodies, "rule")], poses)
