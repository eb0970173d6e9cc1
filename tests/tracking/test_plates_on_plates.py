"""Plates and boxes that a hand drags over plates, presses on them, and against walls: judged by their half sizes alone.

Two boxes are in each other by the least of what they overlap by along their faces' normals and along the products of
their edges (Gottschalk, Lin and Manocha, "OBBTree", 1996), which shares nothing with the library.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.tracking import standing
from assembly.tracking.tick import TrackStatus
from tests.validation.clearance_scenes import PROMISE_NOTHING

# Of the larger body's size: what is called touching.
TOUCHING = 1e-9
# Edges whose product is shorter are parallel: that of the faces tells.
PARALLEL = 1e-7


def turn_of(row):
    return Rotation.from_quat(row[3:], scalar_first=True).as_matrix()


def box_depth(half_a, a, half_b, b):
    """By how much two boxes are in each other, by half sizes (3,) and pose rows (7,); negative where they are apart."""
    one, other = turn_of(a), turn_of(b)
    across = np.cross(one.T[:, None], other.T[None]).reshape(-1, 3)
    lengths = np.linalg.norm(across, axis=1)
    across = across[lengths > PARALLEL] / lengths[lengths > PARALLEL, None]
    axes = np.concatenate([one.T, other.T, across])
    spans = np.abs(axes @ one) @ half_a + np.abs(axes @ other) @ half_b
    return float((spans - np.abs(axes @ (b[:3] - a[:3]))).min())


def plates():
    """Two plates of 60 by 40 by 10, one flush on the other, which is fixed."""
    bodies = [
        asm.Body("lower", asm.shapes.plate(60, 40, 10), fixed=True),
        asm.Body("upper", asm.shapes.plate(60, 40, 10), position=(0, 0, 10)),
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    return scene, bodies[1], np.array([30.0, 20.0, 5.0])


@pytest.mark.parametrize(("low", "most"), [(10.0, 1), (9.5, 5)])
def test_a_plate_goes_with_the_hand(low, most):
    """Along the other one, or pressed on it: at the hand, flush, and proven at every tick."""
    scene, upper, half = plates()
    tracker = scene.tracker(upper.point(0, 0, 0))
    statuses = []
    for k in range(1, 61):
        step = tracker.step((0.05 * k, 0.01 * k, low))
        assert step.proved and box_depth(half, step.q[0], half, step.q[1]) <= 1e-10
        statuses.append(step.status)
    assert step.q[1, :3] == pytest.approx((3.0, 0.6, 10.0), abs=1e-8)
    # The first ticks list what touches; where the hand presses, some more need a step more.
    assert set(statuses) <= {TrackStatus.FOLLOWED, TrackStatus.APPROACHING}
    assert statuses.count(TrackStatus.APPROACHING) <= most
    assert step.force == pytest.approx((0.0, 0.0, 10.0 - low), abs=1e-6)


def test_flush_faces_are_not_opened_at_every_tick(monkeypatch):
    """Contacts whose normals stay go in on no way: bodies are proven as they are opened at the first tick."""
    asked = []
    usual = standing.opening_move
    monkeypatch.setattr(standing, "opening_move", lambda *args: asked.append(1) or usual(*args))
    scene, upper, _ = plates()
    tracker = scene.tracker(upper)
    for k in range(1, 41):
        turned = asm.Pose.from_axis_angle((0, 0, 1), 0.002 * k, (0.02 * k, 0.01 * k, 10.0))
        assert tracker.step(turned).proved
    assert len(asked) <= 6


def test_a_box_in_a_corner_goes_along_the_wall():
    """Pressed on a table and a wall, which need more places for contacts than there were; then along the wall."""
    table = asm.Body("table", asm.shapes.box(200, 200, 10), fixed=True)
    wall = asm.Body("wall", asm.shapes.box(10, 200, 40), position=(60, 0, 25), fixed=True)
    box = asm.Body("box", asm.shapes.box(30, 20, 20), position=(35, 0, 15))
    scene = asm.Assembly([table, wall, box])
    scene.constrain(asm.Clearance())
    tracker = scene.tracker(box.point(0, 0, 0))
    halves = np.array([[100, 100, 5], [5, 100, 20], [15, 10, 10]], dtype=float)
    path = [(35.0 + 0.5 * k, 0.0, 14.5) for k in range(1, 31)] + [(50.0, 0.5 * k, 14.5) for k in range(1, 21)]
    statuses = Counter()
    for target in path:
        step = tracker.step(target)
        statuses[step.status] += 1
        for k in (0, 1):
            assert box_depth(halves[k], step.q[k], halves[2], step.q[2]) <= TOUCHING * 283.0
    assert step.q[2, :3] == pytest.approx((40.0, 10.0, 15.0), abs=1e-6)
    assert statuses[TrackStatus.HELD] == 0 and statuses[TrackStatus.FOLLOWED] >= len(path) - 4


def random_drag(number):
    """Boxes of random sizes, flush or turned, one held at a point or as a frame, perhaps beside a wall; and a path."""
    rng = np.random.default_rng(number)
    size, other = rng.uniform([0.5, 0.4, 0.05], [1.5, 1.2, 0.3]), rng.uniform([0.2, 0.2, 0.05], [1.0, 0.8, 0.4])
    angle = float(rng.choice([0.0, 0.5 * np.pi, rng.uniform(0.0, 6.28)]))
    place = np.array([*rng.uniform(-0.3, 0.3, 2) * size[:2], 0.5 * (size[2] + other[2])])
    bodies = [asm.Body("lower", asm.shapes.box(*size), fixed=True), asm.Body("upper", asm.shapes.box(*other))]
    halves = [0.5 * size, 0.5 * other]
    if rng.random() < 0.5:
        wide = rng.uniform([0.1, 0.5, 0.2], [0.2, 1.0, 0.8])
        at = 0.5 * np.array([size[0] - wide[0], 0.0, size[2] + wide[2]])
        bodies.append(asm.Body("wall", asm.shapes.box(*wide), position=at, fixed=True))
        halves.append(0.5 * wide)
        place[0] = min(place[0], at[0] - 0.5 * wide[0] - 0.5 * np.hypot(*other[:2]) - 0.01)
    bodies[1].pose = asm.Pose.from_axis_angle((0, 0, 1), angle, place)
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    corners = rng.uniform([-0.6, -0.6, -0.15], [0.6, 0.6, 0.1], (4, 3))
    corners[:, 2] *= rng.choice([0.0, 1.0], 4)
    knots = np.vstack([np.zeros(3), corners])
    path = np.concatenate([np.linspace(a, b, 15, endpoint=False) for a, b in zip(knots[:-1], knots[1:], strict=True)])
    held = bodies[1].point(*(rng.uniform(-0.5, 0.5, 3) * other)) if rng.random() < 0.6 else bodies[1]
    return scene, held, halves, path, angle


def test_random_drags(cases):
    """Whatever the hand asks for: no tick that promises anything ends in another body, and few of them are held."""
    statuses = Counter()
    for number in range(cases(3, 300)):
        scene, held, halves, path, angle = random_drag(number)
        tracker = scene.tracker(held)
        begin = asm.Pose(tracker.q[1, :3], tracker.q[1, 3:])
        size = 2.0 * max(map(np.linalg.norm, halves))
        for k, move in enumerate(path):
            if held is scene.bodies[1]:
                target = asm.Pose.from_axis_angle((0, 0, 1), angle + 0.005 * k, begin.position + move)
            else:
                target = begin.apply(held.coordinates) + move
            step = tracker.step(target)
            statuses[step.status] += 1
            assert step.status.name not in PROMISE_NOTHING, number
            depths = [box_depth(halves[j], step.q[j], halves[1], step.q[1]) for j in range(len(halves)) if j != 1]
            assert max(depths) <= TOUCHING * size, number
    assert statuses[TrackStatus.HELD] <= 0.02 * sum(statuses.values())
