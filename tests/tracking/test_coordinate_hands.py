"""Hands on coordinates of joints: derivatives, balance of forces, the shorter way round, refusals."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.coordinate_distance import CoordinateDistance
from assembly.kinematics.pose import retract, rotation_matrix
from assembly.tracking.tick import TrackStatus
from tests.constraints.model.test_expression import derivatives
from tests.laws.test_solve_formulas import slope_of

BAR = asm.shapes.box(4.0, 0.4, 0.4)


def arm_with_slide(axes="aligned"):
    """A bar that turns about a fixed pivot at its end, and a block that slides along it."""
    base = asm.Body("base", asm.shapes.box(1.0, 1.0, 1.0), fixed=True)
    bar, block = (
        asm.Body("bar", BAR, (2.0, 0.0, 0.0)),
        asm.Body("block", asm.shapes.box(0.5, 0.5, 0.5), (2.0, 0.0, 0.0)),
    )
    scene = asm.Assembly([base, bar, block])
    z = (0.0, 0.0, 1.0 if axes == "aligned" else -1.0)
    hinge = asm.Revolute(base.frame(), bar.frame((-2.0, 0.0, 0.0), z=z, x=(1.0, 0.0, 0.0)), "hinge", axes=axes)
    way = asm.Prismatic(bar.frame(z=(1.0, 0.0, 0.0)), block.frame(z=(1.0, 0.0, 0.0)), "way")
    scene.constrain(hinge, way)
    return scene, hinge, way


def settled(tracker, targets, ticks=60):
    for _ in range(ticks):
        step = tracker.step(targets)
    assert step.status is TrackStatus.FOLLOWED and step.feasibility < 1e-11
    return step


def expected_value(term, q):
    """The term of weight one, from what the coordinate is: axes and places of both frames in the world."""
    pair = term.freedom.coordinate.frames
    turns = [rotation_matrix(row[3:]) for row in q]
    a, b = (turn @ frame.axes for turn, frame in zip(turns, (pair.frame_a, pair.frame_b), strict=True))
    p, r = (x[:3] + t @ f.origin for x, t, f in zip(q, turns, (pair.frame_a, pair.frame_b), strict=True))
    if not term.is_angle:
        return (a[:, 2] @ (r - p) - term.target) ** 2
    c, s = np.cos(term.target), np.sin(term.target)
    wanted = c * a[:, 0] + s * a[:, 1], c * a[:, 1] - s * a[:, 0]
    return 0.5 * term.length**2 * sum(float((x - y) @ (x - y)) for x, y in zip(b.T, wanted, strict=False))


@pytest.mark.parametrize(("kind", "axes"), [("way", "aligned"), ("hinge", "aligned"), ("hinge", "opposed")])
def test_derivatives_are_those_of_the_definition(kind, axes):
    scene, hinge, way = arm_with_slide(axes)
    term = CoordinateDistance((hinge if kind == "hinge" else way).coordinate(), 0.7)
    rng = np.random.default_rng(46)
    for _ in range(4):
        # Anywhere, not only where the joint holds.
        q = np.array([[*rng.normal(size=3), *e / np.linalg.norm(e)] for e in rng.normal(size=(2, 4))])
        value, jacobian, hessian = derivatives(term, q, np.ones(1))
        assert value[0] == pytest.approx(expected_value(term, q), rel=1e-13, abs=1e-13)
        direction = rng.normal(size=12) / 4.0

        def along(t, q=q, direction=direction):
            return retract(q, (t * direction).reshape(2, 6))

        # Sixth order: 1e-3^6 times a seventh derivative, and rounding over the step.
        slope = slope_of(lambda t, along=along: expected_value(term, along(t)), 1e-3)
        assert jacobian[0] @ direction == pytest.approx(slope, rel=1e-9, abs=1e-9)
        curvature = slope_of(
            lambda t, along=along, d=direction: derivatives(term, along(t), np.ones(1))[1][0] @ d, 1e-3
        )
        assert direction @ hessian @ direction == pytest.approx(curvature, rel=1e-9, abs=1e-9)
    # Where the axes are one, an angle's term is length^2 4 sin^2 of half of what it lacks.
    if kind == "hinge":
        q = scene.solve(scene.at({"hinge.angle": -1.1})).q[:2]
        assert expected_value(term, q) == pytest.approx(4.0 * (term.length * np.sin(0.9)) ** 2, rel=1e-9)


def test_two_fingers_a_held_part_and_a_slider():
    """One tracker with two points, a frame and a coordinate; all forces balance."""
    scene, hinge, way = arm_with_slide()
    bar, block = scene["bar"], scene["block"]
    other = asm.Body("other", BAR, (2.0, 3.0, 0.0))
    scene = asm.Assembly([*scene.bodies, other])
    scene.constrain(hinge, way)
    hands = [bar.point(1.0, 0.0, 0.0), block.point(0.0, 0.2, 0.0), other.frame(), hinge.coordinate("angle")]
    tracker = scene.tracker(hands, stiffness=[2.0, 3.0, 1.0, 0.5])
    turned = asm.Pose.from_axis_angle((0, 0, 1), 0.4, (2.0, 3.5, 0.1))
    targets = [(2.5, 1.0, 0.0), (1.0, 2.2, 0.0), turned, 1.5]
    step = settled(tracker, targets)
    # What nobody hinders is where it is drawn.
    assert np.abs(step.wrenches[2]).max() < 1e-9
    # Torques about the pivot: of both fingers, and of the spring on the angle.
    q = step.q
    points = [
        asm.Pose(q[k, :3], q[k, 3:]).apply(at) for k, at in ((1, np.array([1.0, 0, 0])), (2, np.array([0.0, 0.2, 0])))
    ]
    torque = sum(np.cross(p, force)[2] for p, force in zip(points, step.forces, strict=False)) + step.wrenches[3, 5]
    assert abs(torque) < 1e-8 and abs(step.wrenches[3, 5]) > 0.05
    angle = step.solution.values["hinge.angle"]
    length = 0.5 * bar.size
    assert step.wrenches[3, 5] == pytest.approx(0.5 * length**2 * np.sin(angle - 1.5), rel=1e-12)
    # The block slides without anybody's help: its finger has no force along the bar.
    along = np.array([np.cos(angle), np.sin(angle), 0.0])
    assert abs(step.forces[1] @ along) < 1e-8


def test_ways_and_angles_are_followed_at_once():
    scene, hinge, way = arm_with_slide()
    tracker = scene.tracker([way.coordinate("slide"), hinge.coordinate("angle")])
    for s, angle in zip(np.linspace(0.0, 1.5, 40), np.linspace(0.0, 8.0, 40), strict=True):
        tracker.step([s, angle])
    step = settled(tracker, [1.5, 8.0])
    values = step.solution.values
    assert values["way.slide"] == pytest.approx(1.5, abs=1e-9)
    assert np.cos(values["hinge.angle"] - 8.0) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(step.wrenches).max() < 1e-7
    # The objective is the energy of both springs.
    step = tracker.step([2.5, 8.0])
    lack = step.solution.values["way.slide"] - 2.5
    turned = step.solution.values["hinge.angle"] - 8.0
    energy = 0.5 * lack**2 + 2.0 * (0.5 * scene["bar"].size * np.sin(0.5 * turned)) ** 2
    assert step.objective == pytest.approx(energy, rel=1e-9, abs=1e-12)


def test_an_angle_goes_the_shorter_way_round():
    scene, hinge, _ = arm_with_slide()
    tracker = scene.tracker(hinge.coordinate("angle"), q0=scene.at({"hinge.angle": 2.9}))
    passed = []
    for _ in range(40):
        step = tracker.step(-2.9)
        way = asm.Pose(step.q[1, :3], step.q[1, 3:]).apply((1.0, 0.0, 0.0))
        passed.append(np.arctan2(way[1], way[0]) % (2.0 * np.pi))
    assert step.status is TrackStatus.FOLLOWED
    assert min(passed) > 2.89 and passed[-1] == pytest.approx(2.0 * np.pi - 2.9, abs=1e-9)
    assert step.force.shape == (3,) and step.wrench == pytest.approx(np.zeros(6), abs=1e-8)


def test_hands_on_coordinates_let_go_and_take_hold_again():
    scene, hinge, _ = arm_with_slide()
    angle = hinge.coordinate()
    tracker = scene.tracker([angle, scene["block"].frame()])
    tracker.hold(1, None)
    settled(tracker, [0.6, None])
    tracker.hold(0, None)
    before = tracker.q
    step = tracker.step([3.0, None])
    assert np.abs(step.q - before).max() < 1e-9 and not step.wrenches.any() and tracker.follow == (None, None)
    tracker.hold(0, angle, stiffness=4.0)
    step = settled(tracker, [0.2, None])
    assert step.solution.values["hinge.angle"] == pytest.approx(0.2, abs=1e-9)
    tracker.restart(scene.at({"hinge.angle": 1.0}))
    # At rest there: what was asked for before draws no more.
    assert tracker._hands.where()[0][0] == pytest.approx(1.0, abs=1e-9)
    assert settled(tracker, [1.2, None]).solution.values["hinge.angle"] == pytest.approx(1.2, abs=1e-9)
    for wrong in (scene["bar"], scene["bar"].point(0, 0, 0)):
        with pytest.raises(asm.errors.InputError, match="which is what hand 0 was made with"):
            tracker.hold(0, wrong)
    with pytest.raises(asm.errors.InputError, match="expected something of body 'block'"):
        tracker.hold(1, angle)


def test_recorded_coordinates_are_followed(tmp_path):
    scene, hinge, way = arm_with_slide()
    # More than a turn, which the numbers say.
    angles = asm.Trace.through([0.0, 2.0, 7.0], [0.0, 0.1, 0.3], rate=200.0)
    ways = asm.Trace.through([0.0, 1.2], [0.0, 0.3], rate=200.0)
    for name, trace in (("angles.csv", angles), ("ways.npz", ways)):
        trace.save(tmp_path / name)
    recorded = [asm.Trace.load(tmp_path / name) for name in ("angles.csv", "ways.npz")]
    tracker = scene.tracker([hinge.coordinate(), way.coordinate()])
    log = tracker.run(recorded)
    stepped = scene.tracker([hinge.coordinate(), way.coordinate()])
    for pair in zip(angles.targets, ways.targets, strict=True):
        step = stepped.step(pair)
    assert np.array_equal(log.q[-1], step.q) and log.worst_violation < 1e-11
    values = settled(tracker, [7.0, 1.2]).solution.values
    assert np.cos(values["hinge.angle"] - 7.0) == pytest.approx(1.0, abs=1e-12)
    assert values["way.slide"] == pytest.approx(1.2, abs=1e-9)
    # A tracker of one coordinate takes one trace, as one of a point does.
    alone = scene.tracker(hinge.coordinate())
    alone.run(angles)
    assert np.cos(alone.step(7.0).solution.values["hinge.angle"] - 7.0) == pytest.approx(1.0, abs=1e-6)
    with pytest.raises(asm.errors.InputError, match="trace has points; expected numbers"):
        alone.run(asm.Trace([0.0, 1.0], np.zeros((2, 3))))
    with pytest.raises(asm.errors.InputError, match="trace has numbers; expected points for"):
        scene.tracker(scene["block"].point(0, 0, 0)).run(ways)
    with pytest.raises(asm.errors.InputError, match=r"trace\[1\] has points; expected poses for"):
        scene.tracker([hinge.coordinate(), scene["block"]]).run([angles, asm.Trace(angles.times, np.zeros((61, 3)))])


@pytest.mark.parametrize("target", [None, "here", np.nan, np.inf, True, 1e200, [0.1, 0.2], 1j])
def test_what_is_no_number_moves_nothing(target):
    scene, hinge, way = arm_with_slide()
    tracker = scene.tracker([hinge.coordinate(), way.coordinate()])
    before = tracker.q
    assert tracker.step([0.5, target]).status is TrackStatus.BAD_TARGET
    assert np.array_equal(tracker.q, before) and tracker._hands.where()[0][0] == 0.0


def test_what_no_hand_can_draw_is_refused():
    scene, hinge, way = arm_with_slide()
    with pytest.raises(asm.errors.InputError, match="not in the scene"):
        scene.tracker(arm_with_slide()[1].coordinate())
    way.slide = 0.0
    with pytest.raises(asm.errors.InputError, match=r"follow\[1\] is .*driven"):
        scene.tracker([hinge.coordinate(), way.coordinate()])
    with pytest.raises(asm.errors.InputError, match="expected a coordinate"):
        hinge.coordinate("slide")
    tracker = scene.tracker([hinge.coordinate()])
    with pytest.raises(asm.errors.InputError, match=r"trace\[0\] has points; expected numbers for .*hinge"):
        tracker.run([asm.Trace([0.0, 1.0], np.zeros((2, 3)))])
    hinge.angle = 0.3
    assert tracker.step([0.3]).status is TrackStatus.CHANGED


def test_frames_that_are_placed_anew_are_drawn_at_their_new_place():
    scene, hinge, _ = arm_with_slide()
    tracker = scene.tracker([hinge.coordinate()])
    settled(tracker, [0.4])
    hinge.frame_b.place(at=(-1.5, 0.0, 0.0), z=(0.0, 0.6, 0.8), x=(1.0, 0.0, 0.0))
    assert tracker.step([0.4]).status is TrackStatus.CHANGED
    tracker.restart(scene.solve())
    step = settled(tracker, [1.1])
    assert step.solution.values["hinge.angle"] == pytest.approx(1.1, abs=1e-9)
