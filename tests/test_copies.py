"""Copies: what changes in one of two objects does not change in the other, and what is not copied says so."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.dexterity import Dexterity

STILL = (1.0, 0.0, 0.0, 0.0)


def balls():
    a, b = asm.Body("a", asm.shapes.sphere(1.0), fixed=True), asm.Body("b", asm.shapes.sphere(1.0), (2, 0, 0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (0, 3, 0)))
    return scene, a, b


@pytest.mark.parametrize("solved", [False, True])
def test_what_is_added_to_a_copied_scene_is_in_the_copy_alone(solved):
    scene, a, b = balls()
    if solved:
        assert scene.solve().success
    other = copy.copy(scene)
    other.constrain(asm.Distance(a, b, 2.0, "far"))
    other.minimize(asm.Posture())
    other.add(asm.Body("c"))
    assert [body.name for body in scene.bodies] == ["a", "b"]
    assert [one.name for one in scene.constraints] == ["a-b"] and len(scene.objectives) == 1
    assert set(scene.solve().violations) == {"a-b"} and set(other.solve().violations) == {"a-b", "far"}
    # Its names are free in the original, and the bodies are the same.
    scene.constrain(asm.Distance(a, b, 2.0, "far"))
    scene.add(asm.Body("c"))
    assert other.bodies[:2] == (a, b) and other.body("a") is a


def test_a_copied_scene_is_solved_for_itself():
    scene, _, b = balls()
    first = scene.solve()
    other = copy.copy(scene)
    # What the one was solved with is a start of the other, too.
    np.testing.assert_array_equal(other.solve(first).q, first.q)
    np.testing.assert_array_equal(other.solve().q, first.q)
    scene.objectives[0][1].target = (0, -3, 0)
    # The term is the same object in both.
    np.testing.assert_array_equal(other.solve().pose(b).position, scene.solve().pose(b).position)


def test_a_copied_joint_is_driven_for_itself():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    hinge = asm.Revolute(ground, arm, "hinge", angle=0.5)
    other = copy.copy(hinge)
    other.angle = 1.0
    assert hinge.angle == 0.5 and hinge.freedom().joint is hinge and other.freedom().joint is other
    assert other.bodies == (ground, arm) and other.frame_a is hinge.frame_a and other.freedom() is not hinge.freedom()
    for joint, angle in ((hinge, 0.5), (other, 1.0)):
        scene = asm.Assembly([ground, arm])
        scene.constrain(joint)
        assert abs(scene.solve().values["hinge.angle"] - angle) < 1e-12
    # Two inputs of two joints are none that is given twice.
    assert Dexterity(arm.point(1, 0, 0), [hinge, other])


def test_a_copied_coupling_couples_the_same_joints():
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b")
    one, two = asm.Revolute(ground, a), asm.Revolute(ground, b)
    gear = asm.Gear(one, two, 2.0)
    other = copy.copy(gear)
    other.offset = 0.5
    assert gear.offset == 0.0 and other.leader is one.freedom()


def test_a_copied_body_has_faces_and_a_pose_of_its_own():
    body = asm.Body("crate", asm.shapes.box(1, 2, 3), color=(1, 0, 0))
    other = copy.copy(body)
    other.pose, other.color = asm.Pose((1, 2, 3)), None
    assert body.pose.position.tolist() == [0, 0, 0] and body.color == (1, 0, 0)
    assert all(side.body is other for side in other.faces) and all(side.body is body for side in body.faces)
    assert [side.face for side in other.faces] == [side.face for side in body.faces]


def test_a_copied_objective_has_a_target_of_its_own():
    goal = asm.PointDistance(asm.Body("a").point(0, 0, 0), (1, 2, 3))
    other = copy.copy(goal)
    other.target = (4, 5, 6)
    assert goal.target.tolist() == [1, 2, 3]


def test_a_copied_manager_watches_for_itself():
    manager = asm.Manager([asm.Body("a", asm.shapes.sphere(1.0)), asm.Body("b", asm.shapes.sphere(1.0))], reach=0.3)
    manager.update([(0, 0, 0, *STILL), (2.1, 0, 0, *STILL)])
    other = copy.copy(manager)
    other.update([(0, 0, 0, *STILL), (2.2, 0, 0, *STILL)])
    assert [round(one.contacts[0].gap, 9) for one in (manager, other)] == [0.1, 0.2]
    assert all(one is two for one, two in zip(manager.bodies, other.bodies, strict=True))


def test_a_copied_feature_tracker_goes_on_for_itself():
    tracker = asm.proximity.FeatureTracker(asm.shapes.box(1, 1, 1), asm.shapes.sphere(1.0))
    before = tracker.step(None, (0, 0, 3, *STILL)).gap
    other = copy.copy(tracker)
    other.step(None, (3, 0, 0, *STILL))
    assert tracker.step(None, (0, 0, 3, *STILL)).gap == before and tracker.searches == 1


def tracker_with_contacts():
    floor, ball = asm.Body("floor", asm.shapes.plane(20, 20), fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    ball.pose = asm.Pose((0, 0, 1.5))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Clearance())
    return scene.tracker(ball)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, pickle.dumps])
def test_a_tracker_says_what_to_keep_instead(how):
    tracker = tracker_with_contacts()
    with pytest.raises(TypeError, match=r"Tracker .* cannot be copied or pickled; keep `tracker.scene`"):
        how(tracker)
    again = tracker.scene.tracker(tracker.scene.body("ball"), q0=tracker.q)
    np.testing.assert_allclose(again.q, tracker.q, rtol=0, atol=1e-12)
    with pytest.raises(TypeError, match=r"Recorder .* cannot be copied or pickled; keep its `log\(\)`"):
        how(asm.TrackLog.recorder([0.0, 1.0], 2, asm.TrackStatus))


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, lambda step: pickle.loads(pickle.dumps(step))])
def test_a_step_is_kept_with_all_it_says(how):
    tracker = tracker_with_contacts()
    for height in (1.3, 1.1, 0.9, 0.7):
        step = tracker.step((0.1, 0.2, height, *STILL))
    kept = how(step)
    told = ("status", "feasibility", "stationarity", "objective", "iterations", "is_minimum", "seconds")
    assert all(getattr(kept, name) == getattr(step, name) for name in told)
    for name in ("q", "wrench", "force"):
        np.testing.assert_array_equal(getattr(kept, name), getattr(step, name))
    assert [str(event) for event in kept.events] == [str(event) for event in step.events]
    assert kept.solution.violations == step.solution.violations and abs(step.wrench[2]) > 0.0
    # What the tracker does next does not change it.
    before = step.q
    tracker.step((3.0, 0.2, 2.0, *STILL))
    np.testing.assert_array_equal(how(step).q, before)
