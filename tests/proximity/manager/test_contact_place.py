"""The place of a contact: what a least gap of the same two bodies leaves to it, and what not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm

# Rows hold to 1e-12 of the scene's size, which is some tens of lengths here.
HOLDS = 1e-10
CORNER = [(-10, -10), (30, -10), (30, 0), (0, 0), (0, 30), (-10, 30)]
BRIDGE = [(-6, -5), (-4, -5), (-4, 0), (4, 0), (4, -5), (6, -5), (6, 2), (-6, 2)]


def prism(points, height):
    """An extruded polygon."""
    ends = zip(points, points[1:] + points[:1], strict=True)
    return asm.shapes.extrusion([asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in ends], height)


def turned(body, position, angle, axis):
    """Stand a body somewhere, turned about an axis."""
    x, y, z, w = Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis)).as_quat()
    body.pose = asm.Pose(position, (w, x, y, z))
    return body


def scene_of(bodies, swapped, minimum, **contact):
    """A contact of two bodies, in either order, and a least gap."""
    ordered = bodies[::-1] if swapped else bodies
    scene = asm.Assembly(ordered)
    scene.constrain(asm.Contact(*ordered, "touch", **contact), asm.Clearance(minimum=minimum))
    return scene


def gaps(solution):
    """The gaps that the clearance has listed."""
    return [pair.gap for name, pair in solution.contacts.items() if name.startswith("clearance")]


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("unilateral", [False, True])
@pytest.mark.parametrize("minimum", [0.0, 0.5, 3.0])
def test_a_ball_touches_one_wall_and_keeps_off_the_other(swapped, unilateral, minimum):
    corner = asm.Body("corner", prism(CORNER, 40.0), fixed=True, position=(0, 0, -20))
    ball = asm.Body("ball", asm.shapes.sphere(3.0), position=(3.2, 5, 0))
    scene = scene_of([corner, ball], swapped, minimum, unilateral=unilateral)
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), target=(3, 0, 0)))
    solution = scene.solve()
    assert solution.success
    assert solution.pose(ball).position == pytest.approx([3.0, 3.0 + minimum, 0.0], abs=1e-9)
    # The contact's own pair is listed by the contact alone.
    if minimum > 0.0:
        assert gaps(solution) and min(gaps(solution)) == pytest.approx(minimum, abs=HOLDS)


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("lean", [-0.02, 0.02])
def test_a_bridge_stands_on_one_foot(swapped, lean):
    floor = asm.Body("floor", asm.shapes.box(60, 4, 60), fixed=True, position=(0, -2, 0))
    bridge = turned(asm.Body("bridge", prism(BRIDGE, 8.0)), (0, 6, -4), lean, (0, 0, 1))
    solution = scene_of([floor, bridge], swapped, 6.0).solve()
    assert solution.success
    # Feet are 10 wide apart at their inner edges: the other one is up by 6 at its nearer one where the sine is 0.6.
    turn = Rotation.from_quat(solution.pose(bridge).quaternion[[1, 2, 3, 0]]).as_rotvec()
    assert turn == pytest.approx([0.0, 0.0, np.copysign(np.arcsin(0.6), lean)], abs=1e-9)
    found = np.sort(gaps(solution))
    assert (found > -HOLDS).all() and ((np.abs(found) < HOLDS) | (found > 6.0 - HOLDS)).all()


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("unilateral", [False, True])
def test_a_box_lies_on_a_whole_face(swapped, unilateral):
    floor = asm.Body("floor", asm.shapes.box(40, 40, 4), fixed=True, position=(0, 0, -2))
    box = turned(asm.Body("box", asm.shapes.box(6, 5, 4)), (0, 0, 6), 0.1, (0.8, 0.6, 0))
    scene = scene_of([floor, box], swapped, 1.0, unilateral=unilateral)
    scene.minimize(asm.PointDistance(box.point(0, 0, 0), target=(0, 0, 1)))
    solution = scene.solve()
    assert solution.success
    assert solution.pose(box).position == pytest.approx([0.0, 0.0, 2.0], abs=1e-9)
    assert min(gaps(solution)) > -HOLDS


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("minimum", [0.1, 0.5, 1.0])
def test_a_ring_touches_a_pin_at_one_place(swapped, minimum):
    pin = asm.Body("pin", asm.shapes.ellipsoid(1.5, 2.5, 6.0), fixed=True)
    ring = asm.Body("ring", asm.shapes.torus(3.3, 0.5), position=(0, 0.1, 0))
    scene = scene_of([pin, ring], swapped, minimum)
    scene.minimize(asm.Posture(weight=1.0))
    solution = scene.solve()
    assert solution.success
    # Of all extrema, also those that are too far to be listed, the contact's alone is nearer.
    manager = asm.Manager([pin, ring], reach=2.0)
    manager.update(solution.q if not swapped else solution.q[::-1])
    touching, *others = sorted(contact.gap for contact in manager.contacts)
    assert abs(touching) < HOLDS and others and min(others) > minimum - HOLDS
    # At the middle of the pin there is room for 0.6 in all.
    assert (abs(solution.pose(ring).position[2]) > 0.1) == (minimum > 0.6)


@pytest.mark.parametrize("swapped", [False, True])
def test_an_open_contact_excuses_nothing_elsewhere(swapped):
    """A one-sided contact that is open by more than the least gap: what is elsewhere and nearer than it keeps that."""
    corner = asm.Body("corner", prism(CORNER, 40.0), fixed=True, position=(0, 0, -20))
    ball = asm.Body("ball", asm.shapes.sphere(3.0), position=(5, 5.5, 0))
    scene = scene_of([corner, ball], swapped, 0.5, unilateral=True)
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), target=(5, 0, 0)))
    solution = scene.solve()
    assert solution.success and solution.contacts["touch"].gap == pytest.approx(2.0, abs=1e-9)
    assert solution.pose(ball).position == pytest.approx([5.0, 3.5, 0.0], abs=1e-9)
    assert min(gaps(solution)) == pytest.approx(0.5, abs=HOLDS)


@pytest.mark.parametrize("edges", [False, True])
def test_contacts_of_single_faces_have_a_place(edges):
    floor = asm.Body("floor", asm.shapes.box(40, 40, 4), fixed=True, position=(0, 0, -2))
    ball = asm.Body("ball", asm.shapes.sphere(3.0), position=(0, 0, 6))
    top = next(face for face in floor.faces if face.name == "top")
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(ball.faces[0], top, edges=edges), asm.Clearance(minimum=0.5))
    solution = scene.solve()
    assert solution.success and solution.pose(ball).position == pytest.approx([0, 0, 3], abs=1e-9)


@pytest.mark.parametrize("minimum", [0.0, 1.0])
def test_a_ball_that_rolls_far_is_followed(minimum, cases):
    floor = asm.Body("floor", asm.shapes.plane(40, 40), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(3.0), position=(0, 0, 6))
    scene = scene_of([floor, ball], False, minimum)
    drawn = asm.PointDistance(ball.point(0, 0, 0), target=(0, 0, 3))
    scene.minimize(drawn)
    solution = scene.solve()
    for k in range(cases(30, 300)):
        drawn.target = (10 * np.sin(k / 4), 10 * np.cos(k / 4) - 10, 3 + np.sin(k))
        solution = scene.solve(solution)
        assert solution.success and solution.pose(ball).position[2] == pytest.approx(3.0, abs=1e-9)
    tracker = scene.tracker(follow=ball.point(0, 0, 0))
    for k in range(cases(30, 300)):
        step = tracker.step((10 * np.sin(k / 40), 10 * np.cos(k / 40) - 10, 3.5))
        assert step.status is asm.TrackStatus.FOLLOWED


@pytest.mark.parametrize("minimum", [0.0, 0.5])
def test_a_box_that_a_hand_turns_over_keeps_touching(minimum, cases):
    """Its contact goes from vertex to vertex: none of them is asked for a gap, as all are in the contact's place."""
    floor = asm.Body("floor", asm.shapes.box(60, 60, 4), fixed=True, position=(0, 0, -2))
    box = turned(asm.Body("box", asm.shapes.box(4, 5, 6)), (0, 0, 6), 0.8, (3, 2, 1))
    scene = scene_of([floor, box], False, minimum)
    held = asm.FrameDistance(box, asm.Pose((0, 0, 4)))
    scene.minimize(held)

    def hand(turn):
        half = 0.5 * turn
        return asm.Pose((5 * np.sin(turn), 0, 4), (np.cos(half), 0.6 * np.sin(half), 0.8 * np.sin(half), 0))

    solution = scene.solve()
    for k in range(cases(20, 60)):
        held.target = hand(0.1 * k)
        solution = scene.solve(solution)
        assert solution.success, k
    tracker = scene.tracker(follow=box.frame())
    for k in range(cases(60, 200)):
        step = tracker.step(hand(0.02 * k))
        assert step.status in (asm.TrackStatus.FOLLOWED, asm.TrackStatus.APPROACHING), k
