"""Shafts, pins and balls that a hand drags in bores and sockets: judged by circles and lines alone.

A rim of the bore is in the shaft where a point of it is nearer to the shaft's axis than its radius, and a rim of the
shaft in the wall where a point of it is farther from the bore's axis than that. A wall between two rims is no nearer.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import assembly as asm
from assembly.tracking.tick import TrackStatus
from tests.studies.machined import socket

BORE, SHAFT, PLAY, HEIGHT = 10.02, 10.0, 0.02, 20.0
# Of the larger body's size: what is called touching.
TOUCHING = 1e-9
AROUND = np.linspace(0.0, 2.0 * np.pi, 181)


def least(function):
    """The least value of a function of an angle."""
    best = AROUND[int(np.argmin([function(angle) for angle in AROUND]))]
    found = minimize_scalar(function, bounds=(best - 0.04, best + 0.04), method="bounded", options={"xatol": 1e-11})
    return min(float(found.fun), float(function(best)))


def shaft_depth(row, length, bore=BORE, radius=SHAFT, height=HEIGHT):
    """By how much a shaft at a pose row (7,) is in the wall of a bore about the z axis; negative where it is clear."""
    pose = asm.Pose(row[:3], row[3:])
    axis, middle = pose.apply((0, 0, 1)) - pose.position, pose.position
    depths = []
    for z in (-0.5 * height, 0.5 * height):
        if abs((z - middle[2]) / axis[2]) < 0.5 * length:

            def to_axis(angle, z=z):
                return np.linalg.norm(
                    np.cross(np.array([bore * np.cos(angle), bore * np.sin(angle), z]) - middle, axis)
                )

            depths.append(radius - least(to_axis))
    for end in (-0.5 * length, 0.5 * length):
        if abs(pose.apply((0, 0, end))[2]) < 0.5 * height:

            def to_wall(angle, end=end):
                place = pose.apply((radius * np.cos(angle), radius * np.sin(angle), end))
                return bore - np.hypot(place[0], place[1])

            depths.append(-least(to_wall))
    return max(depths, default=-np.inf)


def bearing(length, position=(0.0, 0.0, 0.0)):
    """A plate with a bore, and a shaft with a play in it."""
    bodies = [
        asm.Body("plate", asm.shapes.plate(50, 50, HEIGHT, [(0, 0, BORE)]), fixed=True),
        asm.Body("shaft", asm.shapes.solid_cylinder(SHAFT, length), position=position),
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    return scene, bodies[1]


def dragged(scene, held, path, judge, size):
    """The last step, and how many ended how; every tick is proven, and none is deeper than what is called touching."""
    tracker, statuses = scene.tracker(held), Counter()
    for target in path:
        step = tracker.step(target)
        statuses[step.status] += 1
        assert step.proved
        assert judge(step.q) <= TOUCHING * size
    assert not statuses[TrackStatus.HELD]
    return step, statuses


def test_a_shaft_pressed_on_its_bore_slides_and_turns():
    """It goes along the bore and turns in it with the hand, however the wall is pressed."""
    scene, shaft = bearing(90.0)
    path = [
        asm.Pose((0.03 * np.sin(0.1 * k), 0.0, 0.05 * k), (np.cos(0.01 * k), 0.0, 0.0, np.sin(0.01 * k)))
        for k in range(1, 81)
    ]
    step, statuses = dragged(scene, shaft, path, lambda q: shaft_depth(q[1], 90.0), 90.0)
    assert statuses[TrackStatus.FOLLOWED] >= len(path) - 2
    assert step.q[1, 2] == pytest.approx(4.0, abs=1e-6)
    assert step.q[1, 0] == pytest.approx(PLAY, abs=1e-6)
    assert np.abs(step.q[1, 3:]) == pytest.approx(np.abs((np.cos(0.8), 0.0, 0.0, np.sin(0.8))), abs=1e-6)


def test_a_shaft_leans_in_its_bore():
    """Held above the bore, it touches both rims, on opposed sides: where lines and circles say."""
    scene, shaft = bearing(90.0)
    path = [(0.01 * k, 0.0, 30.0) for k in range(1, 13)] + [(0.12, 0.0, 30.0 + 0.1 * k) for k in range(1, 21)]
    step, _ = dragged(scene, shaft.point(0, 0, 30), path, lambda q: shaft_depth(q[1], 90.0), 90.0)
    axis = asm.Pose(step.q[1, :3], step.q[1, 3:]).apply((0, 0, 1)) - step.q[1, :3]
    # Both sections fill the bore: R = |e| + r / cos, with e opposed at both rims.
    tilt = np.arctan2(np.hypot(*axis[:2]), axis[2])
    assert 0.5 * HEIGHT * np.tan(tilt) + SHAFT / np.cos(tilt) == pytest.approx(BORE, abs=1e-4)


def test_a_ring_leans_on_its_shaft(cases):
    """Held beside its axis and slid along the shaft: its flat faces are rings, of a revolution, and end in its bore."""
    bore, radius, height = 5.05, 5.0, 4.0
    ring = asm.shapes.revolution(asm.curves.polygon([(bore, -2), (9, -2), (9, 2), (bore, 2)]))
    bodies = [
        asm.Body("shaft", asm.shapes.solid_cylinder(radius, 60.0), fixed=True),
        asm.Body("ring", ring, position=(0, 0, 3)),
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())

    def depth(q):
        back = asm.Pose(q[1, :3], q[1, 3:]).inverse()
        return shaft_depth(np.r_[back.position, back.quaternion], 60.0, bore, radius, height)

    ways = 0.03 * np.arange(1, cases(40, 200))
    path = [(1 + 0.5 * np.sin(a), 0.3 * np.sin(2 * a), 5 + 8 * np.sin(0.5 * a)) for a in ways]
    step, statuses = dragged(scene, bodies[1].point(1, 0, 2), path, depth, 60.0)
    assert set(statuses) <= {TrackStatus.FOLLOWED, TrackStatus.APPROACHING}
    assert step.q[1, 2] == pytest.approx(path[-1][2] - 2.0, abs=0.2)


def test_a_pin_is_dropped_into_its_hole():
    """Down past the rim, and in the hole to the wall."""
    scene, pin = bearing(30.0, (0.005, 0.0, 26.0))
    path = [(0.005, 0.0, 26.0 - 0.4 * k) for k in range(1, 66)] + [(0.005 + 0.002 * k, 0.0, 0.0) for k in range(1, 21)]
    step, _ = dragged(scene, pin.point(0, 0, 0), path, lambda q: shaft_depth(q[1], 30.0), 50.0)
    # It leans by what rims let it, now on one of them and now on both, so that ticks are still on their way.
    assert step.q[1, :3] == pytest.approx((PLAY, 0.0, 0.0), abs=1e-4)


def test_a_ball_goes_down_into_its_socket():
    """Down to the bottom, and there along the wall."""
    radius, ball = 10.0, asm.Body("ball", asm.shapes.sphere(10.0 - PLAY), position=(0, 0, 1))
    scene = asm.Assembly([asm.Body("socket", socket(radius, 20.0, 15.0), fixed=True), ball])
    scene.constrain(asm.Clearance())

    def depth(q):
        across, high = np.hypot(q[1, 0], q[1, 1]), q[1, 2]
        off_rim = (radius - PLAY) - np.hypot(radius - across, high)
        return max(np.hypot(across, high) - PLAY, off_rim) if high <= 0.0 else off_rim

    path = [asm.Pose((0, 0, 1 - 0.1 * k)) for k in range(1, 13)]
    path += [asm.Pose((0.002 * k, 0, -0.2), (np.cos(0.01 * k), np.sin(0.01 * k), 0, 0)) for k in range(1, 16)]
    step, _ = dragged(scene, ball, path, depth, 40.0)
    assert np.linalg.norm(step.q[1, :3]) == pytest.approx(PLAY, abs=1e-6)


def test_a_shoulder_comes_to_lie_on_the_bearing(cases):
    """A shaft that leans in its bore, pressed on its mouth, comes upright on its shoulder: wall and face touch at once.

    Its faces are of a revolution, and flat ones have polar parameters. The last digit of where it is dragged to decides
    on which side it comes down, and how far around the bore it goes until it rests: from 0 to 27 ticks.
    """
    profile = asm.curves.polygon([(0, -40), (SHAFT, -40), (SHAFT, 0), (16, 0), (16, 10), (0, 10)])
    count = cases(8, 40)
    for aside in 0.3 + 1e-4 * (np.arange(count) - count // 2):
        bodies = [
            asm.Body("plate", asm.shapes.plate(50, 50, HEIGHT, [(0, 0, BORE)]), fixed=True),
            asm.Body("shaft", asm.shapes.revolution(profile), position=(0, 0, 14)),
        ]
        scene = asm.Assembly(bodies)
        scene.constrain(asm.Clearance())
        tracker, statuses = scene.tracker(bodies[1].point(0, 0, 0)), Counter()
        for z in [*np.linspace(14.0, 7.0, 30), *[7.0] * 40]:
            step = tracker.step((aside, 0.0, z))
            statuses[step.status] += 1
            assert step.proved
        # One may be, where the shoulder meets the bearing.
        assert statuses[TrackStatus.HELD] <= 1 and step.status is TrackStatus.FOLLOWED
        np.testing.assert_allclose(step.q[1, [0, 1, 2, 4, 5]], (PLAY, 0, 10, 0, 0), atol=1e-6)


def test_a_pin_is_let_down_into_its_hole():
    """It passes the mouth where it is led, and no row of the hole's rim turns it aside."""
    scene, pin = bearing(80.0, (0.0, 0.0, 62.0))
    tracker = scene.tracker(pin.point(0, 0, 0))
    for z in np.linspace(62.0, 30.0, 60):
        step = tracker.step((0.0, 0.0, z))
        assert step.status is TrackStatus.FOLLOWED and step.proved
        np.testing.assert_allclose(step.q[1], (0, 0, z, 1, 0, 0, 0), atol=1e-9)


def plug_in_its_seat():
    """Both of a half angle of 30 degrees, the plug lifted by 0.5: scene, bodies, slope."""
    slope = np.tan(np.pi / 6.0)
    plug = asm.shapes.revolution(asm.curves.polygon([(0, 5), (5 * slope, 5), (20 * slope, 20), (0, 20)]))
    seat = asm.shapes.revolution(asm.curves.polygon([(3 * slope, 3), (30, 3), (30, 18), (18 * slope, 18)]))
    bodies = [asm.Body("seat", seat, fixed=True), asm.Body("plug", plug, position=(0, 0, 0.5))]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    return scene, bodies, slope


def seat_depth(pose, slope):
    """By how much circles of the plug are in the seat's cone where they are between its ends, at most."""
    around, depth = np.linspace(0.0, 2.0 * np.pi, 361), -np.inf
    for radius, height in ((slope * z, z) for z in np.linspace(5, 20, 61)):
        ring = pose.apply(np.column_stack([radius * np.cos(around), radius * np.sin(around), 0 * around + height]))
        level = np.hypot(ring[:, 0], ring[:, 1]) - slope * ring[:, 2]
        depth = max(depth, level[(ring[:, 2] > 3.0) & (ring[:, 2] < 18.0)].max(initial=-1.0))
    return depth


def test_a_plug_is_dragged_in_its_conical_seat(cases):
    """Lifted and moved aside: a cone in a cone is clear where the levels of its circles say so, with no cell halved."""
    scene, bodies, _ = plug_in_its_seat()
    tracker, statuses = scene.tracker(bodies[1].point(0, 0, 15)), Counter()
    for k in range(cases(40, 400)):
        step = tracker.step((0.01 * k, 0.0, 15.5 + 0.1 * k))
        statuses[step.status] += 1
        assert step.proved
    assert set(statuses) <= {TrackStatus.FOLLOWED, TrackStatus.APPROACHING}


def test_a_plug_leans_on_the_edge_of_its_seat(cases):
    """Turned by a hand beside its axis while it is lifted a little: what of it is in the seat is a cone in a sleeve."""
    scene, bodies, slope = plug_in_its_seat()
    tracker, statuses, leans = scene.tracker(bodies[1].point(0, 0, 15)), Counter(), 0.0
    for way in 0.05 * np.arange(cases(40, 200)):
        step = tracker.step((2.0 * np.sin(way), np.sin(2.0 * way), 16.0 + 1.5 * np.sin(0.7 * way)))
        statuses[step.status] += 1
        assert step.proved
        pose = asm.Pose(step.q[1, :3], step.q[1, 3:])
        leans = max(leans, np.hypot(*(pose.apply((0, 0, 1)) - pose.position)[:2]))
        assert seat_depth(pose, slope) <= 1e-6
    assert set(statuses) <= {TrackStatus.FOLLOWED, TrackStatus.APPROACHING}
    assert leans > 0.01


def test_a_plug_leans_far_in_its_seat(cases):
    """Turned by a hand while it is lifted, to 25 degrees: no lean is one at which the part in the seat is not known."""
    scene, bodies, slope = plug_in_its_seat()
    count, statuses = cases(50, 400), Counter()
    tracker = scene.tracker(bodies[1])
    for way in np.linspace(0.0, 1.0, count):
        half = np.radians(12.5) * way
        step = tracker.step(asm.Pose((0, 0, 0.5 + 12.5 * way), (np.cos(half), 0, np.sin(half), 0)))
        statuses[step.status] += 1
        assert step.proved
        assert seat_depth(asm.Pose(step.q[1, :3], step.q[1, 3:]), slope) <= 1e-6
    assert set(statuses) <= {TrackStatus.FOLLOWED, TrackStatus.APPROACHING}
    assert step.q[1, 5] == pytest.approx(np.sin(half), abs=1e-6)


def test_a_pin_leans_in_a_thin_plate_until_both_rims_hold_it():
    """Drawn aside at its top: 15.5 degrees, by the closed form of both sections, and no tick is HELD on the way."""
    height, radius, bore = 1.0, 9.5, 10.0
    bodies = [
        asm.Body("plate", asm.shapes.plate(50, 50, height, [(0, 0, bore)]), fixed=True),
        asm.Body("pin", asm.shapes.solid_cylinder(radius, 40.0)),
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    path = [(0.5 * k, 0.0, 20.0) for k in range(1, 60)]
    step, _ = dragged(
        scene, bodies[1].point(0, 0, 20), path, lambda q: shaft_depth(q[1], 40.0, bore, radius, height), 50
    )
    axis = asm.Pose(step.q[1, :3], step.q[1, 3:]).apply((0, 0, 1)) - step.q[1, :3]
    tilt = np.arctan2(np.hypot(*axis[:2]), axis[2])
    assert 0.5 * height * np.tan(tilt) + radius / np.cos(tilt) == pytest.approx(bore, abs=1e-4)
    assert np.degrees(tilt) > 15.0
