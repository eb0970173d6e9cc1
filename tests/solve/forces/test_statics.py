"""Forces: they balance, they are where they act, and joints of an arm hold what is at its tip."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import angular_velocity_map, retract
from tests.solve.mechanisms import bennett, bricard, planar_four_bar

statics = asm.statics
SIZES = [1e-3, 1.0, 1e3]


def pulls(scene, solution):
    """What the objective, a sum of point distances, exerts on every body: force and torque about its origin."""
    found = {body.name: np.zeros(6) for body in scene.bodies}
    for _, term in scene.objectives:
        pose = solution.pose(term.point.body)
        p = pose.apply(term.point.coordinates)
        force = 2.0 * term.weight * (term.target - p)
        found[term.point.body.name] += np.concatenate([force, np.cross(p - pose.position, force)])
    return found


def check_balance(scene, solution, atol):
    """All there is on a moving body vanishes; what each constraint exerts, it exerts on nothing else."""
    total = pulls(scene, solution)
    for name, own in solution.wrenches.items():
        constraint = next(c for c in scene.constraints if c.name == name)
        assert list(own) == [body.name for body in constraint.bodies]
        # Of two bodies what one feels, the other feels against it.
        about = np.sum([wrench.at((0, 0, 0)) for wrench in own.values()], axis=0)
        np.testing.assert_allclose(about, 0.0, rtol=0, atol=atol)
        for body, wrench in own.items():
            total[body] += wrench.vector
    for body in scene.bodies:
        if not body.fixed:
            np.testing.assert_allclose(total[body.name], 0.0, rtol=0, atol=atol)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("make", [planar_four_bar, bennett, bricard])
def test_forces_balance_in_redundant_linkages(make, size):
    scene = make(size)
    rng = np.random.default_rng(1)
    for body in scene.bodies[1:]:
        scene.minimize(asm.PointDistance(body.point(*rng.normal(size=3) * size), rng.normal(size=3) * size, weight=0.5))
    scene.constraints[0].angle = scene.solve().values["joint 1.angle"] + 0.2
    solution = scene.solve()
    assert solution.success
    # Stationary to 1e-10 of the objective's unit.
    check_balance(scene, solution, 1e-8 * size**2 * max(1.0, 1.0 / size))


def test_forces_balance_in_contacts():
    wire = asm.shapes.torus(1.0, 0.12)
    left, right = asm.Body("left", wire, fixed=True), asm.Body("right", wire, (0.9, 0.1, 0.1), (0.7071, 0.7071, 0, 0))
    scene = asm.Assembly([left, right])
    scene.constrain(asm.Contact(left, right, "link"))
    scene.minimize(asm.PointDistance(right.point(1, 0, 0), (4.0, 2.0, 1.0)))
    # Pulled taut, so the pair is at a fold.
    solution = scene.solve()
    assert solution.success and solution.objective > 1.0
    check_balance(scene, solution, 1e-8)
    # It pushes along the normal, where the surfaces touch.
    pair = solution.contacts["link"]
    wrench = solution.wrenches["link"]["right"]
    np.testing.assert_allclose(np.cross(wrench.force, pair.normal), 0.0, rtol=0, atol=1e-8)
    np.testing.assert_allclose(wrench.at(pair.points[1])[3:], 0.0, rtol=0, atol=1e-7)


def test_a_ball_is_pushed_off_the_floor():
    floor = asm.Body("floor", asm.shapes.plane(8, 8), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.2, 0.1, 3.0))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball, "rest", unilateral=True))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.2, 0.1, -2.0), weight=3.0))
    solution = scene.solve()
    assert solution.success
    # 2 weight (1 - -2) upward, nothing about the center; the floor takes it.
    push = solution.wrenches["rest"]
    np.testing.assert_allclose(push["ball"].vector, [0, 0, 18, 0, 0, 0], rtol=0, atol=1e-8)
    np.testing.assert_allclose(push["floor"].vector, [0, 0, -18, -1.8, 3.6, 0], rtol=0, atol=1e-8)


def test_pressure_on_a_flat_face_is_where_the_load_is():
    floor = asm.Body("floor", asm.shapes.plane(8, 8), fixed=True)
    tile = asm.Body("tile", asm.shapes.plane(4, 4), (0.3, 0.2, 0.0), (0.0, 1.0, 0.0, 0.0))
    scene = asm.Assembly([floor, tile])
    scene.constrain(asm.Contact(floor, tile, "rest"))
    load = asm.PointDistance(tile.point(0.8, -0.5, 0), (0.0, 0.0, -1.0))
    scene.minimize(load)
    solution = scene.solve()
    assert solution.success
    check_balance(scene, solution, 1e-8)
    force = solution.wrenches["rest"]["tile"]
    assert force.force[2] == pytest.approx(2.0, abs=1e-8)
    np.testing.assert_allclose(force.at(solution.pose("tile").apply((0.8, -0.5, 0)))[3:], 0.0, rtol=0, atol=1e-8)
    # The solution keeps its load, whatever the scene is asked for meanwhile.
    again = scene.solve()
    load.target = (1.0, 1.0, -5.0)
    assert scene.solve().success
    np.testing.assert_allclose(again.wrenches["rest"]["tile"].vector, force.vector, rtol=0, atol=1e-7)


def test_an_expression_acts_on_the_bodies_it_names():
    ca = pytest.importorskip("casadi")
    ground, body = asm.Body("ground", fixed=True), asm.Body("body", position=(1, 2, 0.5))
    scene = asm.Assembly([ground, body])
    q = ca.SX.sym("q", 7)
    scene.constrain(asm.Expression(ca.Function("height", [q], [5.0 * (q[2] - 1.0)]), [body], scale=7.0))
    scene.minimize(asm.PointDistance(body.point(0, 0, 0), (0, 0, 4.0)))
    solution = scene.solve()
    assert solution.success
    wrench = solution.wrenches["height body"]["body"]
    np.testing.assert_allclose(wrench.vector, [0, 0, -6, 0, 0, 0], rtol=0, atol=1e-8)


def random_wrench(rng):
    return asm.Wrench(rng.normal(size=3), rng.normal(size=3), random_pose(rng).q)


def random_pose(rng):
    return asm.Pose.from_axis_angle(rng.normal(size=3), rng.uniform(-3, 3), rng.normal(size=3))


@pytest.mark.parametrize("seed", range(5))
def test_work_is_the_same_in_all_coordinates(seed):
    rng = np.random.default_rng(seed)
    wrench, twist = random_wrench(rng), rng.normal(size=6)
    work = wrench.vector @ twist
    # Along the pose's coordinates: a central difference of a smooth path, exact to 1e-10.
    rate = (retract(wrench.q, 1e-5 * twist) - retract(wrench.q, -1e-5 * twist)) / 2e-5
    assert wrench.configuration() @ rate == pytest.approx(work, abs=1e-9)
    # At another point of the body, which moves otherwise.
    point = rng.normal(size=3)
    speed = twist[:3] + np.cross(twist[3:], point - wrench.q[:3])
    assert wrench.at(point) @ np.concatenate([speed, twist[3:]]) == pytest.approx(work, abs=1e-13)
    # In the body's axes.
    turn = asm.Pose((0, 0, 0), wrench.q[3:]).inverse()
    in_body = np.concatenate([turn.apply(twist[:3]), turn.apply(twist[3:])])
    assert wrench.in_body_axes() @ in_body == pytest.approx(work, abs=1e-13)


@pytest.mark.parametrize("seed", range(5))
def test_equation_5(seed):
    rng = np.random.default_rng(seed)
    wrench = random_wrench(rng)
    back = asm.Wrench.from_configuration(wrench.configuration(), wrench.q)
    np.testing.assert_allclose(back.vector, wrench.vector, rtol=0, atol=1e-14)
    # As printed, in body axes: W = G W_c / 4 for the torque. Along the quaternion there is nothing.
    body_map = angular_velocity_map(wrench.q[3:], body_axes=True)
    given = wrench.configuration()[3:] + 0.7 * wrench.q[3:]
    np.testing.assert_allclose(body_map @ given / 4.0, wrench.in_body_axes()[3:], rtol=0, atol=1e-14)
    assert wrench.configuration()[3:] @ wrench.q[3:] == pytest.approx(0.0, abs=1e-14)


def arm(rng, count=7, reverse=()):
    """An arm of turning joints, one of them sliding; joints in `reverse` name the hand's side first."""
    links = [asm.Body("base", fixed=True), *(asm.Body(f"link {k}") for k in range(1, count + 1))]
    scene = asm.Assembly(links)
    for k in range(count):
        frames = [links[j].frame(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)) for j in (k, k + 1)]
        if k in reverse:
            frames.reverse()
        name = f"joint {k + 1}"
        if k == 2:
            scene.constrain(asm.Prismatic(*frames, name, slide=rng.normal()))
        else:
            axes = "opposed" if k == 4 else "aligned"
            scene.constrain(asm.Revolute(*frames, name, axes=axes, angle=rng.uniform(-1, 1)))
    return scene


@pytest.mark.parametrize("reverse", [(), (1, 2, 4)])
@pytest.mark.parametrize("seed", range(2))
def test_the_jacobian_of_an_arm_is_how_its_tip_moves(seed, reverse):
    rng = np.random.default_rng(seed)
    scene = arm(rng, reverse=reverse)
    joints = scene.constraints
    hand = scene.bodies[-1]
    tip = hand.point(0.3, -0.2, 0.5)
    solution = scene.solve()
    assert solution.success
    jacobian = statics.geometric_jacobian(solution, joints, tip)
    assert jacobian.shape == (6, 7)
    # The Jacobian that rows give, which knows closed loops too, is the same.
    general = asm.tip_jacobian(scene, tip, joints, solution, task="pose")
    np.testing.assert_allclose(jacobian, general, rtol=0, atol=1e-10)
    step = 1e-5
    for k, joint in enumerate(joints):
        freedom = joint.freedom()
        value = freedom.value
        poses = []
        for sign in (1.0, -1.0):
            freedom.value = value + sign * step
            poses.append(scene.solve(solution).pose(hand))
        freedom.value = value
        linear = (poses[0].apply(tip.coordinates) - poses[1].apply(tip.coordinates)) / (2 * step)
        # Twice the vector part of the turn from one to the other.
        turn = 2.0 * (poses[0] @ poses[1].inverse()).quaternion
        angular = np.sign(turn[0]) * turn[1:] / (2 * step)
        # 1e-13 of the poses over the step, and the square of the step.
        np.testing.assert_allclose(jacobian[:, k], [*linear, *angular], rtol=0, atol=1e-7)


def test_drives_hold_what_the_jacobian_says():
    # An independent way: multipliers of driven joints against a pull at the tip.
    rng = np.random.default_rng(4)
    scene = arm(rng)
    tip = scene.bodies[-1].point(0.3, -0.2, 0.5)
    scene.minimize(asm.PointDistance(tip, (1.0, 2.0, 3.0)))
    solution = scene.solve()
    assert solution.success
    pull = pulls(scene, solution)["link 7"]
    held = np.array([solution.multipliers[joint.name][5] for joint in scene.constraints])
    force = np.concatenate([pull[:3], np.zeros(3)])
    torques = statics.joint_torques(solution, scene.constraints, tip, force)
    np.testing.assert_allclose(held, torques, rtol=0, atol=1e-8)
    # The same of a wrench that says where it acts itself; and about the hand's origin.
    given = asm.Wrench(pull[:3], pull[3:], solution.q[-1])
    np.testing.assert_allclose(statics.joint_torques(solution, scene.constraints, tip, given), torques, atol=1e-8)
    at_origin = statics.joint_torques(solution, scene.constraints, scene.bodies[-1], pull)
    np.testing.assert_allclose(at_origin, torques, rtol=0, atol=1e-8)


def test_a_finger_beyond_the_wrist():
    # Two links of length 1 along x, turning about z; the finger is 0.5 beyond the wrist.
    base, upper, fore = asm.Body("base", fixed=True), asm.Body("upper"), asm.Body("fore", position=(1, 0, 0))
    scene = asm.Assembly([base, upper, fore])
    shoulder, elbow = asm.Revolute(base, upper, "shoulder"), asm.Revolute(upper.frame((1, 0, 0)), fore, "elbow")
    scene.constrain(shoulder, elbow)
    wrench = statics.tool_wrench((0, 4, 0), (0.5, 0, 0))
    np.testing.assert_array_equal(wrench, [0, 4, 0, 0, 0, 2])
    torques = statics.joint_torques(scene, [shoulder, elbow], fore.point(1, 0, 0), wrench)
    np.testing.assert_allclose(torques, [4 * 2.5, 4 * 1.5], rtol=0, atol=1e-14)


def test_joints_that_do_not_carry_the_tip_hold_nothing():
    rng = np.random.default_rng(0)
    scene = arm(rng, 4)
    other = asm.Body("other")
    scene.add(other)
    door = asm.Revolute(scene.bodies[0], other, "door")
    finger = asm.Revolute(scene.bodies[4], asm.Body("finger"), "finger")
    scene.add(finger.bodies[1])
    scene.constrain(door, finger)
    jacobian = statics.geometric_jacobian(scene, [door, finger, *scene.constraints[:2]], scene.bodies[2])
    assert not jacobian[:, :2].any() and np.abs(jacobian[:, 2:]).max(axis=0).min() > 0.1
    assert not statics.geometric_jacobian(scene, scene.constraints, scene.bodies[0].point(1, 2, 3)).any()


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda s, j: statics.geometric_jacobian(s, j[0], s.bodies[1]), TypeError, "inputs is Revolute"),
        (
            lambda s, j: statics.geometric_jacobian(s, [3], s.bodies[1]),
            TypeError,
            r"inputs\[0\] is 3; expected a joint",
        ),
        (lambda s, j: statics.geometric_jacobian(s, j[:1], (0, 0, 0)), TypeError, "tip is"),
        (lambda s, j: statics.geometric_jacobian(s, j[:1], asm.Body("x")), InputError, "tip is on body 'x'"),
        (lambda s, j: statics.geometric_jacobian(s, j[:1], s.bodies[1]), InputError, "'joint 1' in a closed loop"),
        (lambda s, j: statics.geometric_jacobian(s, j[1:2], s.bodies[1]), InputError, "'joint 2' in a closed loop"),
        (
            lambda s, j: statics.geometric_jacobian(s, [asm.Revolute(*s.bodies[:2], "new")], s.bodies[1]),
            InputError,
            r"inputs\[0\] is of joint 'new'; expected one of this assembly",
        ),
        (
            lambda s, j: statics.geometric_jacobian(s, [asm.Universal(*s.bodies[:2])], s.bodies[1]),
            InputError,
            "expected a joint with one coordinate; it has 'angle_a', 'angle_b'",
        ),
        (
            lambda s, j: statics.geometric_jacobian(s, [asm.Parallel(*s.bodies[:2])], s.bodies[1]),
            InputError,
            "expected a coordinate of a Revolute, Prismatic or Cylindrical joint",
        ),
        (lambda s, j: statics.joint_torques(s, [], s.bodies[1], (1, 2)), InputError, "wrench"),
        (lambda s, j: statics.tool_wrench((1, 2), (0, 0, 0)), InputError, "force"),
        (lambda s, j: asm.Wrench((0, 0, np.nan), (0, 0, 0), s.q[0]), InputError, "force"),
        (lambda s, j: asm.Wrench((0, 0, 1), (0, 0, 0), (0, 0, 0, 2, 0, 0, 0)), InputError, "q"),
    ],
)
def test_bad_input(call, error, text):
    scene = planar_four_bar()
    with pytest.raises(error, match=text):
        call(scene, scene.constraints)
