"""What scripts see of an end effector: shapes and units, how a pose is given, agreement with statics, errors."""

from __future__ import annotations

import json

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import retract, rotation_matrix
from assembly.solve.dense.jacobian import moving_columns, rows_of
from assembly.solve.diagnosis.undetermined import _end_effector_rows, _gradient, _scaled
from tests.laws.tip_scenes import MECHANISMS, arm, cam, five_bar, four_bar, spatial_four_bar

statics = asm.statics


@pytest.fixture(scope="module")
def robot():
    mechanism = arm(4, (1,))
    return mechanism, mechanism.scene.solve()


def test_rows_and_columns(robot):
    mechanism, solution = robot
    scene, tip, inputs = mechanism.scene, mechanism.tip, mechanism.inputs
    body = tip.body
    point = body.point(*tip.origin)
    full = asm.tip_jacobian(scene, tip, inputs, solution)
    assert full.shape == (6, 4)
    position = asm.tip_jacobian(scene, tip, inputs, solution, task="position")
    rotation = asm.tip_jacobian(scene, tip, inputs, solution, task="rotation")
    np.testing.assert_array_equal(np.vstack([position, rotation]), full)
    # A point has no axes, a body has those of its frame at the origin.
    np.testing.assert_array_equal(asm.tip_jacobian(scene, point, inputs, solution), position)
    np.testing.assert_array_equal(
        asm.tip_jacobian(scene, body, inputs, solution), asm.tip_jacobian(scene, body.frame(), inputs, solution)
    )
    assert asm.tip_jacobian(scene, point, inputs, solution, task="pose").shape == (6, 4)
    # Freedoms are joints' by name; columns are in their order.
    freedoms = [joint.freedom() for joint in inputs]
    turned = asm.tip_jacobian(scene, tip, freedoms[::-1], solution)
    np.testing.assert_allclose(turned, full[:, ::-1], rtol=0, atol=1e-14)


def test_length_weighs_turns(robot):
    mechanism, solution = robot
    scene, tip, inputs = mechanism.scene, mechanism.tip, mechanism.inputs
    full = asm.tip_jacobian(scene, tip, inputs, solution)
    scaled = asm.tip_jacobian(scene, tip, inputs, solution, length=2.5)
    np.testing.assert_allclose(scaled, full * np.repeat([1.0, 2.5], 3)[:, None], rtol=1e-14, atol=1e-15)
    turns = asm.tip_jacobian(scene, tip, inputs, solution, task="rotation", length=2.5)
    np.testing.assert_array_equal(turns, full[3:])


def test_the_pose_may_be_said_in_three_ways():
    mechanism = cam()
    solution = mechanism.scene.solve()
    places = (mechanism.scene, mechanism.tip, mechanism.inputs)
    here = asm.tip_jacobian(*places, solution)
    # The pair is found again, to 1e-12.
    np.testing.assert_allclose(asm.tip_jacobian(*places, solution.q), here, rtol=0, atol=1e-11)
    for body, row in zip(mechanism.scene.bodies, solution.q, strict=True):
        body.pose = asm.Pose(row[:3], row[3:])
    np.testing.assert_allclose(asm.tip_jacobian(*places), here, rtol=0, atol=1e-11)


def test_solutions_of_the_same_bodies_are_taken_after_a_change_of_drives():
    """A value that becomes driven makes another program of the scene; poses and pairs are the same."""
    ring = asm.Body("ring", asm.shapes.torus(1.0, 0.3))
    ground, ball = asm.Body("ground", fixed=True), asm.Body("ball", asm.shapes.sphere(0.4), (1.1, 0.1, -0.69))
    hinge = asm.Revolute(ground.frame((0.2, 0, 0), (0.1, 0, 1)), ring.frame((0.2, 0, 0), (0.1, 0, 1)), "hinge")
    slide = asm.Prismatic(ground.frame((1.1, 0.1, 0)), ball.frame(), "slide")
    scene = asm.Assembly([ground, ring, ball])
    scene.constrain(hinge, slide, asm.Contact(ring, ball, "touch"))
    below = scene.solve()
    assert below.success and below.pose(ball).position[2] < -0.5
    expected = asm.tip_jacobian(scene, ball, [hinge], below)
    hinge.angle = below.values["hinge.angle"]
    np.testing.assert_allclose(asm.tip_jacobian(scene, ball, [hinge], below), expected, rtol=0, atol=1e-14)
    driven = scene.solve(below.q)
    hinge.angle = None
    np.testing.assert_allclose(asm.tip_jacobian(scene, ball, [hinge], driven), expected, rtol=0, atol=1e-11)
    other = asm.Assembly([ground, ring])
    with pytest.raises(InputError, match="q is a solution of another assembly"):
        asm.tip_jacobian(other, ring, [hinge], below)


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_same_by_dense_linear_algebra(name):
    """The least solution of [A; B] v = [0; e], by numpy, from the rows that diagnosis looks at."""
    mechanism = MECHANISMS[name]()
    scene, solution = mechanism.scene, mechanism.scene.solve()
    task = asm.Dexterity(mechanism.tip, mechanism.inputs, task=mechanism.tasks[-1], length=1.0).tip_task
    packed = scene.packed()
    rows = rows_of(packed, solution._state)
    moving = moving_columns([k for k, body in enumerate(scene.bodies) if not body.fixed])
    poses = _scaled(packed, solution._state)
    inputs = np.array([_gradient(packed, freedom.coordinate, poses) for freedom in task.inputs])
    system = np.vstack([rows.jacobian, inputs])[:, moving]
    right = np.vstack([np.zeros((len(rows.jacobian), len(inputs))), np.eye(len(inputs))])
    rates = np.linalg.lstsq(system, right, rcond=1e-9)[0]
    velocities = _end_effector_rows(packed, task, poses)[:, moving] @ rates
    found = asm.tip_jacobian(scene, mechanism.tip, mechanism.inputs, solution, task=mechanism.tasks[-1])
    # Compared in the scene's lengths, as rows are. A small arm is a thousandth of the user's: what rounding makes of
    # how its slide turns the tip, 1e-15 instead of 0, would be 1e-12.
    found *= [1.0 if freedom.coordinate.is_angle else packed.scale for freedom in task.inputs]
    found[:3] /= packed.scale
    size = np.abs(velocities).max(axis=0)
    # Rounding times the square of the worst condition, 37 of the geared arm: the normal matrix may be what is solved.
    np.testing.assert_allclose(found / size, velocities / size, rtol=0, atol=3e-13)


def test_a_joint_given_from_its_other_side_turns_backwards():
    ground, link = asm.Body("ground", fixed=True), asm.Body("link")
    sides = [ground.frame((1, 2, 0), (1, 0, 2)), link.frame((0.5, 0, 0), (0, 1, 1))]
    found = []
    for frames in (sides, sides[::-1]):
        hinge = asm.Revolute(*frames, "hinge")
        scene = asm.Assembly([ground, link])
        scene.constrain(hinge)
        if not found:
            q = scene.solve().q
        found.append(asm.tip_jacobian(scene, link.point(1, 1, 1), [hinge], q))
    # The angle is that of the second frame to the first.
    assert np.abs(found[0]).max() > 0.1
    np.testing.assert_allclose(found[0], -found[1], rtol=0, atol=1e-13)


def test_fixed_tips_do_not_move():
    mechanism = four_bar()
    ground = mechanism.scene.bodies[0]
    np.testing.assert_array_equal(
        asm.tip_jacobian(mechanism.scene, ground.point(1, 1, 1), mechanism.inputs), np.zeros((3, 1))
    )


@pytest.mark.parametrize("size", [1e-6, 1e-3, 1e3, 1e6])
def test_units_change_nothing(size):
    first, other = four_bar(), four_bar(size)
    expected = asm.tip_jacobian(first.scene, first.tip, first.inputs)
    found = asm.tip_jacobian(other.scene, other.tip, other.inputs)
    np.testing.assert_allclose(found, expected * np.repeat([size, 1.0], 3)[:, None], rtol=1e-12, atol=1e-15 * size)


@pytest.mark.parametrize("count", [2, 4, 6])
def test_statics_of_arms_agree(count):
    """J^T W by the joints' axes and by the rows (paper 001, equations 6 to 8)."""
    mechanism = arm(count, (1,), seed=7)
    solution = mechanism.scene.solve()
    jacobian = asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs, solution)
    np.testing.assert_allclose(
        jacobian, statics.geometric_jacobian(solution, mechanism.inputs, mechanism.tip), rtol=0, atol=1e-12
    )
    wrench = np.random.default_rng(60).normal(size=6)
    torques = statics.joint_torques(solution, mechanism.inputs, mechanism.tip, wrench)
    np.testing.assert_allclose(jacobian.T @ wrench, torques, rtol=0, atol=1e-12)


def test_a_closed_linkage_holds_a_load_by_the_transposed_jacobian():
    """A spring draws the tip, the driven crank holds it: the drive's multiplier is the torque that J^T gives."""
    mechanism = spatial_four_bar()
    crank = mechanism.inputs[0]
    crank.angle = 0.7
    scene = asm.Assembly(mechanism.scene.bodies)
    scene.constrain(*mechanism.scene.constraints)
    tip = mechanism.tip.body.point(*mechanism.tip.origin)
    spring = asm.PointDistance(tip, (1.0, -0.5, 2.0), weight=0.5)
    scene.minimize(spring)
    solution = scene.solve()
    assert solution.success
    force = spring.target - solution.pose(tip.body).apply(tip.coordinates)
    torque = asm.tip_jacobian(scene, tip, [crank], solution).T @ force
    # The last of the joint's rows is its drive: L = objective + y (angle - value) is stationary along the motion.
    assert solution.multipliers[crank.name][-1] == pytest.approx(torque[0], rel=1e-9)
    assert abs(torque[0]) > 0.01


def test_ellipsoids(robot):
    mechanism, solution = robot
    place = solution.pose(mechanism.tip.body).apply(mechanism.tip.origin)
    for inputs in (mechanism.inputs, mechanism.inputs[1:], mechanism.inputs[2:]):
        # The rest of the joints is held by drives: these do not count, so they become fixed ones.
        held = [joint for joint in mechanism.inputs if joint not in inputs]
        scene = asm.Assembly(mechanism.scene.bodies)
        scene.constrain(*mechanism.scene.constraints)
        for joint in held:
            bodies = [scene.bodies.index(frame.body) for frame in (joint.frame_a, joint.frame_b)]
            turns = [rotation_matrix(solution.q[k, 3:]) for k in bodies]
            # Frames that coincide at the pose.
            world = (0.3, 0.2, 0.1)
            sides = [
                body.frame(turn.T @ (np.array(world) - solution.q[k, :3]), turn.T @ [0, 0, 1], turn.T @ [1, 0, 0])
                for body, turn, k in zip((joint.frame_a.body, joint.frame_b.body), turns, bodies, strict=True)
            ]
            scene.constrain(asm.Fixed(*sides))
        jacobian = asm.tip_jacobian(scene, mechanism.tip, inputs, solution.q, task="position")
        ellipsoid = asm.dexterity_ellipsoid(scene, mechanism.tip, inputs, solution.q)
        np.testing.assert_allclose(ellipsoid.center, place, rtol=0, atol=1e-14)
        assert list(ellipsoid.lengths) == sorted(ellipsoid.lengths, reverse=True)
        assert (ellipsoid.lengths[len(inputs) :] == 0.0).all()
        # J J^T = axes lengths^2 axes^T: the eigenvectors of paper 001, and what unit rates reach.
        shape = ellipsoid.axes @ np.diag(ellipsoid.lengths**2) @ ellipsoid.axes.T
        np.testing.assert_allclose(shape, jacobian @ jacobian.T, rtol=0, atol=1e-13)
        rates = np.random.default_rng(61).normal(size=(len(inputs), 50))
        reached = jacobian @ (rates / np.linalg.norm(rates, axis=0))
        thick = ellipsoid.lengths > 0.0
        inside = (ellipsoid.axes[:, thick].T @ reached) / ellipsoid.lengths[thick, None]
        assert (np.linalg.norm(inside, axis=0) <= 1.0 + 1e-12).all()
        half = asm.dexterity_ellipsoid(scene, mechanism.tip, inputs, solution.q, scale=0.5)
        np.testing.assert_array_equal(half.lengths, 0.5 * ellipsoid.lengths)


def test_values_leave_out_the_weight(robot):
    mechanism, solution = robot
    terms = [asm.Dexterity(mechanism.tip, mechanism.inputs, "isotropy", weight=weight) for weight in (1.0, 7.0)]
    one, other = (asm.dexterity_value(mechanism.scene, term, solution) for term in terms)
    assert one == other
    assert 0.0 < one < 1.0


def test_a_force_that_no_torque_feels_has_no_measure():
    ground, link = asm.Body("ground", fixed=True), asm.Body("link")
    hinge = asm.Revolute(ground, link, "hinge")
    scene = asm.Assembly([ground, link])
    scene.constrain(hinge)
    along = asm.Dexterity(link.point(1, 0, 0), [hinge], "force_transmission", direction=(1, 0, 0))
    across = asm.Dexterity(link.point(2, 0, 0), [hinge], "force_transmission", direction=(0, 3, 0))
    with pytest.raises(InputError, match="expected a finite measure"):
        asm.dexterity_value(scene, along)
    # A torque of one pushes with a half, two units from the axis.
    assert asm.dexterity_value(scene, across) == pytest.approx(0.5, rel=1e-14)


def test_inputs_that_leave_the_tip_free_are_told_what_is_missing(robot):
    mechanism, solution = robot
    scene, tip = mechanism.scene, mechanism.tip
    with pytest.raises(InputError) as caught:
        asm.tip_jacobian(scene, tip, [mechanism.inputs[0], mechanism.inputs[2]], solution)
    assert str(caught.value) == (
        "inputs is ['joint 1'.angle, 'joint 3'.angle]; expected inputs that determine how the tip on 'link 4' moves; "
        "'joint 2'.slide, 'joint 4'.angle may still change"
    )
    # What hangs behind the tip need not be determined.
    elbow = mechanism.scene.body("link 2")
    assert asm.tip_jacobian(scene, elbow, mechanism.inputs[:2], solution).shape == (6, 2)


def test_inputs_that_depend_on_each_other_are_named():
    mechanism = five_bar()
    joints = mechanism.scene.constraints
    with pytest.raises(InputError) as caught:
        asm.tip_jacobian(mechanism.scene, mechanism.tip, [joints[0], joints[1], joints[4]])
    assert str(caught.value) == (
        "inputs is ['joint 1'.angle, 'joint 2'.angle, 'joint 5'.angle]; expected inputs with rates of their own, but "
        "here constraints tie 'joint 1'.angle, 'joint 2'.angle, 'joint 5'.angle together"
    )
    # Of a chain beside a loop, only those in the loop are tied.
    free = asm.Body("free")
    extra = asm.Revolute(mechanism.scene.bodies[0], free, "extra")
    mechanism.scene.add(free)
    mechanism.scene.constrain(extra)
    with pytest.raises(InputError, match="tie 'joint 1'.angle, 'joint 2'.angle, 'joint 5'.angle together"):
        asm.tip_jacobian(mechanism.scene, mechanism.tip, [joints[0], extra, joints[1], joints[4]])


def test_an_input_that_is_held_is_named():
    ground, link = asm.Body("ground", fixed=True), asm.Body("link")
    scene = asm.Assembly([ground, link])
    hinge, weld = asm.Revolute(ground, link, "hinge"), asm.Fixed(ground, link, "weld")
    scene.constrain(hinge, weld)
    with pytest.raises(InputError, match=r"expected inputs that can move, but here constraints hold 'hinge'.angle"):
        asm.tip_jacobian(scene, link, [hinge])


def test_an_input_between_fixed_bodies_is_named():
    ground, wall, link = asm.Body("ground", fixed=True), asm.Body("wall", fixed=True), asm.Body("link")
    scene = asm.Assembly([ground, wall, link])
    scene.constrain(asm.Revolute(ground, link, "hinge"))
    with pytest.raises(InputError, match=r"constraints hold 'apart'.angle"):
        asm.tip_jacobian(scene, link, [asm.Revolute(ground, wall, "apart")])


def test_contacts_without_a_pair_are_named():
    # The pair is said to be at the cone's apex, where a surface has no tangent plane.
    cone = asm.shapes.cone(1, 2)
    floor, top = asm.Body("floor", asm.shapes.plane(4, 4), fixed=True), asm.Body("top", cone, (0.3, 0.2, 1.5))
    scene = asm.Assembly([floor, top])
    scene.constrain(asm.Contact(floor, top, "touch"))
    lost = scene.solve(starts={"touch": [0.3, 0.2, 1.0, cone.domain[1][1]]})
    assert lost.status is asm.Status.CONTACT_LOST
    with pytest.raises(InputError, match="q leaves contact 'touch' without an extremal pair"):
        asm.tip_jacobian(scene, top, [asm.Revolute(floor, top)], lost)


BAD = [
    ({"scene": "arm"}, TypeError, "scene is 'arm'; expected an Assembly"),
    ({"tip": "hand"}, TypeError, "tip is 'hand'; expected a point, a frame or a body"),
    ({"tip": asm.Body("stranger").point(0, 0, 0)}, InputError, "tip is on body 'stranger'; expected bodies of this"),
    ({"inputs": []}, InputError, r"inputs is \[\]; expected joints or their coordinates"),
    ({"inputs": "joint 1"}, TypeError, r"inputs\[0\] is 'j'; expected a joint"),
    (
        {"inputs": [asm.Revolute(asm.Body("a"), asm.Body("b"), "far")]},
        InputError,
        "inputs is on body 'a'; expected bodies of this assembly",
    ),
    ({"task": "speed"}, InputError, "task is 'speed'; expected one of 'position', 'rotation', 'pose'"),
    ({"length": 0.0}, InputError, "length is 0; expected a positive number"),
    ({"q": np.zeros((2, 7))}, InputError, r"q has shape \(2, 7\)"),
    ({"q": np.full((5, 7), np.nan)}, InputError, "q"),
]


@pytest.mark.parametrize(("wrong", "error", "text"), BAD)
def test_bad_input(robot, wrong, error, text):
    mechanism, _ = robot
    given = {"scene": mechanism.scene, "tip": mechanism.tip, "inputs": mechanism.inputs, "q": None} | wrong
    with pytest.raises(error, match=text):
        asm.tip_jacobian(**given)


def test_bad_input_of_values_and_ellipsoids(robot):
    mechanism, solution = robot
    with pytest.raises(TypeError, match="objective is 3; expected a Dexterity"):
        asm.dexterity_value(mechanism.scene, 3, solution)
    with pytest.raises(InputError, match="scale is -1; expected a positive number"):
        asm.dexterity_ellipsoid(mechanism.scene, mechanism.tip, mechanism.inputs, solution, scale=-1.0)


def test_scenes_are_left_as_they_are(robot):
    mechanism, solution = robot
    packed = mechanism.scene.packed()
    before = packed.table.copy(), packed.pool.copy(), solution._state.copy()
    asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs, solution)
    asm.dexterity_value(
        mechanism.scene, asm.Dexterity(mechanism.tip, mechanism.inputs), retract(solution.q, np.full((5, 6), 0.1))
    )
    assert mechanism.scene.packed() is packed
    for one, other in zip(before, (packed.table, packed.pool, solution._state), strict=True):
        np.testing.assert_array_equal(one, other)


def numbers():
    out = []
    for name in ("arm of three", "planar four-bar", "spinning link", "cam", "geared arm"):
        mechanism = MECHANISMS[name]()
        out += asm.tip_jacobian(mechanism.scene, mechanism.tip, mechanism.inputs).ravel().tolist()
        term = asm.Dexterity(mechanism.tip, mechanism.inputs, "manipulability", task="position")
        out.append(asm.dexterity_value(mechanism.scene, term))
    return out


def test_the_same_with_and_without_compilation(run_python):
    code = "import json; from tests.solve.forces.test_end_effector import *; print(json.dumps(numbers()))"
    plain = json.loads(run_python(code, NUMBA_DISABLE_JIT="1"))
    # Compiled code fuses multiplications and additions; Newton's method stops within 1e-12 of a pair.
    np.testing.assert_allclose(plain, numbers(), rtol=0, atol=1e-11)
