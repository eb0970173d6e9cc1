"""The judge of crossings itself: its solids are the library's, its distances those of closed forms.

Distances are found by steps that end at 1e-11 of a part's size. Where the lowest point is on a smooth piece or at an
edge, what is told is off by no more than that; hence `CLOSE`, in the units of parts that are up to 6 in size.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

import assembly as asm
from tests.validation import crossing_judge, exact_solids
from tests.validation.clearance_scenes import Start, Way, clear_start, parts, start, way
from tests.validation.crossing_judge import COVER, Motion, crossing_depth, least_signed_distance, sampled_distance

CLOSE = 1e-10
NAMES = list(parts())
CLOSED = [name for name, part in parts().items() if part.is_closed]
VOLUMES = {
    "box": 0.35,
    "plate": 1.8 - 0.3 * np.pi * (0.25 + 0.16),
    "pin": np.pi * 0.09 * 1.2,
    "torus": 2.0 * np.pi**2 * 0.6 * 0.15**2,
    "ball": 4.0 / 3.0 * np.pi * 0.064,
    "L": 0.5 * (1.2 * 0.4 + 0.4 * 0.8),
    "star": 0.4 * 5 * 0.35 * 0.8 * np.sin(np.pi / 5),
    "thin 1e-2": 1.92e-2,
    "thin 1e-4": 1.92e-4,
    "big box": 42.0,
    "ellipsoid": 4.0 / 3.0 * np.pi * 0.105,
    "big ellipsoid": 4.0 / 3.0 * np.pi * 10.56,
    "capsule": np.pi * 0.04 * 0.8 + 4.0 / 3.0 * np.pi * 0.008,
    "tube": np.pi * (0.25 - 0.16),
}
UPRIGHT = np.eye(3)


def surface_of(shape, count, rng):
    """Random points of the surface that the library has."""
    found = []
    for side in asm.Body("body", shape).faces:
        face, (u, v) = side.face, (rng.uniform(*ends, count) for ends in side.face.surface.domain)
        if face.outer is not None or face.holes:
            within = face.locate(u, v) >= 0
            u, v = u[within], v[within]
        found.append(face.surface.evaluate(u, v))
    return np.concatenate(found)


@pytest.mark.parametrize("name", NAMES)
def test_parts_are_what_the_library_has(name):
    part = parts()[name]
    points = surface_of(part.shape, 4000, np.random.default_rng(0))
    assert np.abs(part.distance(points)).max() < 1e-15 * part.size
    assert np.abs(part.distance(part.samples)).max() < 1e-15 * part.size
    # And there is no more of either surface: random points are farther apart than those of a grid.
    assert cKDTree(points).query(part.samples)[0].max() < 6.0 * part.spacing
    assert cKDTree(part.samples).query(points)[0].max() <= COVER * part.spacing


@pytest.mark.parametrize("name", CLOSED)
def test_signed_distances(name):
    part, rng = parts()[name], np.random.default_rng(1)
    points = rng.uniform(-1.0, 1.0, (40_000, 3)) * part.half_extents
    told = part.distance(points)
    nearest = cKDTree(part.samples).query(points)[0]
    # No sample is nearer than the surface, and one is nearly as near.
    assert (nearest - np.abs(told)).min() > -1e-13
    assert (nearest - np.abs(told)).max() <= COVER * part.spacing
    share = VOLUMES[name] / np.prod(2.0 * part.half_extents)
    # Five standard deviations.
    assert np.mean(told < 0.0) == pytest.approx(share, abs=5.0 * np.sqrt(share * (1.0 - share) / len(points)) + 1e-15)


@pytest.mark.parametrize("name", NAMES)
def test_a_ball_is_as_far_as_its_center_less_its_radius(name, cases):
    """Whether they cross or not: what of the part is nearest to a center outside of it is the deepest in the ball."""
    part, rng = parts()[name], np.random.default_rng(2)
    for number in range(cases(12, 300)):
        while True:
            center = rng.uniform(-1.3, 1.3, 3) * (part.half_extents + 0.1)
            off = float(part.distance(center[None])[0])
            if off > 0.11:
                break
        # Touching by nearly nothing, or by as much as the radius is.
        gap = (10.0 ** rng.uniform(-9, -1) * rng.choice([-1, 1])) if number % 3 else rng.uniform(-0.5, 0.5) * off
        ball = exact_solids.ball(off - gap)
        told = least_signed_distance(part, ball, Motion(Rotation.random(random_state=number).as_matrix(), center))
        assert told == pytest.approx(gap, abs=CLOSE)


@pytest.mark.parametrize("gap", [1e-3, 1e-8, -1e-8, -1e-3])
def test_a_corner_over_a_face(gap):
    plate, box = parts()["plate"], parts()["box"]
    turn = Rotation.from_euler("xyz", [0.5, 0.6, 0.2]).as_matrix()
    corners = np.array(np.meshgrid(*[(-1, 1)] * 3)).reshape(3, -1).T * box.half_extents
    lowest = (corners @ turn.T)[:, 2].min()
    pose = Motion(turn, np.array([0.07, -0.6, 0.15 - lowest + gap]))
    assert least_signed_distance(plate, box, pose) == pytest.approx(gap, abs=CLOSE)


@pytest.mark.parametrize("gap", [1e-3, 1e-8, -1e-8, -1e-3])
def test_an_edge_across_an_edge(gap):
    """Two right-angled ridges; a point so far under a ridge is over sqrt(2) from its faces."""
    box = exact_solids.box(1.0, 1.0, 1.0)
    below, above = (Rotation.from_euler(axis, 45, degrees=True).as_matrix() for axis in "xy")
    pose = Motion(above, np.array([0.013, 0.027, np.sqrt(2.0) + gap])).seen_from(Motion(below, np.zeros(3)))
    told = gap if gap > 0.0 else gap / np.sqrt(2.0)
    assert least_signed_distance(box, box, pose) == pytest.approx(told, abs=CLOSE)


@pytest.mark.parametrize("thickness", [1e-2, 1e-4])
def test_a_pin_through_a_thin_plate(thickness):
    """No sample of its wall is in the plate, whose middle is half the thickness deep."""
    plate, pin = exact_solids.box(1.6, 1.2, thickness), exact_solids.pin(0.2, 1.2)
    pose = Motion(Rotation.from_euler("x", 0.2).as_matrix(), np.array([0.1, 0.05, 0.013]))
    assert least_signed_distance(plate, pin, pose) < -0.9 * 0.5 * thickness
    assert crossing_depth(pin, plate, Motion(UPRIGHT, np.zeros(3)).seen_from(pose)) > 0.9 * 0.5 * thickness


def test_samples_alone_do_not_tell_what_crosses_by_little(cases):
    """Of pairs that cross by 1e-6 to 1e-4: most have no sample in each other, which is what descents are for."""
    count, unseen, rng = cases(8, 200), 0, np.random.default_rng(3)
    for _ in range(count):
        while True:
            begin = start(rng, aims=(-6.0, -4.0), sides=(-1,))
            if begin.kind == "near":
                break
        assert begin.distance < -0.9e-6
        unseen += sampled_distance(begin.a, begin.b, Motion.of(begin.pose)) > 0.0
    assert unseen > count // 4


@pytest.mark.parametrize("name", CLOSED)
def test_equal_parts_at_one_place_cross(name):
    part = parts()[name]
    deepest = -part.distance(part.inner).min()
    assert crossing_depth(part, part, Motion(UPRIGHT, np.zeros(3))) == pytest.approx(deepest, abs=CLOSE)


def test_nested_and_linked():
    ring, ball, tube, big = (parts()[name] for name in ("torus", "ball", "tube", "big box"))
    linked = Motion(Rotation.from_euler("x", 90, degrees=True).as_matrix(), np.array([0.6, 0.0, 0.0]))
    assert least_signed_distance(ring, ring, linked) == pytest.approx(0.3, abs=CLOSE)
    # Its center is 0.9 from the nearest wall, its farthest point 1.3.
    assert least_signed_distance(big, ball, Motion(UPRIGHT, np.array([0.1, 0.2, 0.6]))) == pytest.approx(-1.3, abs=1e-3)
    inside = exact_solids.ball(0.3)
    assert least_signed_distance(tube, inside, Motion(UPRIGHT, np.array([0.04, 0.0, 0.1]))) == pytest.approx(0.06)
    assert crossing_depth(tube, inside, Motion(UPRIGHT, np.zeros(3))) == 0.0


def test_sheets():
    sheet, ball = parts()["sheet"], parts()["ball"]
    through = Motion(UPRIGHT, np.array([0.1, 0.2, 0.4 - 1e-7]))
    assert least_signed_distance(sheet, ball, through) == pytest.approx(-1e-7, abs=CLOSE)
    with pytest.raises(ValueError, match="sheet and sheet are sheets; expected one of them to have an inside"):
        least_signed_distance(sheet, sheet, through)


def test_more_samples_and_more_starts_tell_the_same(cases, monkeypatch):
    """Of random pairs near touching, from either side; depths may be off along kinks, but not whether they cross."""
    starts = [start(np.random.default_rng([4, number])) for number in range(cases(6, 300))]
    known = parts()
    monkeypatch.setattr(exact_solids, "SAMPLES", 8 * exact_solids.SAMPLES)
    monkeypatch.setattr(crossing_judge, "STARTS", 4 * crossing_judge.STARTS)
    fine = parts.__wrapped__()
    for begin in starts:
        pose = Motion.of(begin.pose)
        back = Motion(UPRIGHT, np.zeros(3)).seen_from(pose)
        near = pytest.approx(begin.distance, abs=max(CLOSE, -0.1 * begin.distance))
        assert least_signed_distance(fine[begin.first], fine[begin.second], pose) == near, begin
        assert least_signed_distance(known[begin.second], known[begin.first], back) == near, begin


def test_starts_are_the_same_again_and_where_they_were_meant_to_be():
    starts = [start(np.random.default_rng([5, number])) for number in range(8)]
    again = [start(np.random.default_rng([5, number])) for number in range(8)]
    assert [s.pose.tobytes() for s in starts] == [s.pose.tobytes() for s in again]
    near = [abs(s.distance) for s in starts if s.kind == "near"]
    assert len(near) >= 4 and all(0.9e-6 < distance < 0.11 for distance in near)
    assert clear_start(np.random.default_rng(6)).distance > 0.9e-4


def test_ways_tell_what_is_crossed_between_clear_poses():
    above, below = np.r_[0.1, 0.1, 0.5, 1, 0, 0, 0], np.r_[0.1, 0.1, -0.6, np.sqrt(0.5), 0, np.sqrt(0.5), 0]
    through = Way(Start("thin 1e-4", "ball", above, "near", np.eye(3)[2], 0.1), below)
    assert through.least(looks=2) == pytest.approx(0.1 - 5e-5, abs=CLOSE)
    assert through.least() < -4.9e-5
    for number in range(4):
        rng = np.random.default_rng([7, number])
        begin = clear_start(rng)
        step = way(rng, begin)
        ends = step.at(0.0), step.at(1.0)
        for motion, pose in zip(ends, (begin.pose, step.end), strict=True):
            assert np.abs(motion.turn - Motion.of(pose).turn).max() < 1e-14
            assert np.abs(motion.place - Motion.of(pose).place).max() < 1e-15
