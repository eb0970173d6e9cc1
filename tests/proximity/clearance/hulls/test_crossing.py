"""Hulls tell that bodies cross where they do, by judges of closed form, and of most that do."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance import proof
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hulls import crossing
from assembly.proximity.clearance.hulls.crossing import crossing_by_hulls, marked
from assembly.proximity.clearance.hulls.scene import HullAnswers
from tests.proximity.clearance.hulls.test_pair import FITS, NEAR, PARTS
from tests.proximity.clearance.scenes import at, faces_of, start_of
from tests.validation import exact_solids as exact
from tests.validation.crossing_judge import Motion

ROUNDING = 1e-12


def told(a, b, pose, touching):
    return crossing_by_hulls((faces_of(a), faces_of(b)), rotation_matrix(pose[3:]), pose[:3], touching)


def is_right(a, b, pose, answer):
    """Whether a ball of the depth about the place is inside one part, and the place on the other."""
    both = float(a.distance(answer.place[None])[0]), float(b.distance(Motion.of(pose).back(answer.place[None]))[0])
    return min(both) <= -answer.depth + ROUNDING and max(both) <= ROUNDING


@pytest.mark.parametrize("part", [*PARTS.values(), exact.torus(0.5, 0.15)], ids=lambda part: part.name)
def test_inner_points_are_inside(part):
    found = marked(faces_of(part.shape))
    assert (part.distance(found.inner) < 0.0).all()
    assert np.abs(part.distance(found.boundary)).max() < ROUNDING
    # Of a ring none is found: its faces are on no side of a point below them.
    assert len(found.inner) > 4 or part.name == "torus"


@pytest.mark.parametrize("names", NEAR)
def test_pairs_that_all_but_fit_are_judged(names, cases):
    rng = np.random.default_rng(8)
    a, b = (PARTS[name] for name in names)
    cross = found = 0
    for _ in range(cases(6, 400)):
        t = 10.0 ** rng.uniform(-4, -0.5)
        turn = Rotation.from_rotvec(0.5 * t * rng.normal(size=3)).as_quat(scalar_first=True)
        pose = np.r_[np.array(NEAR[names]) + t * rng.normal(size=3), turn]
        answer = told(a.shape, b.shape, pose, 1e-7)
        motion = Motion.of(pose)
        cross += min(a.distance(motion.apply(b.samples)).min(), b.distance(motion.back(a.samples)).min()) < -1e-6
        found += answer is not None
        assert answer is None or is_right(a, b, pose, answer), (pose, answer)
    # Of crossings that samples tell of, which are not all.
    assert found > 0.5 * cross


def test_random_pairs_are_judged(cases):
    seen = {True: 0, False: 0}
    for number in range(60, 60 + cases(12, 600)):
        begin = start_of(number)
        answer = told(begin.a.shape, begin.b.shape, begin.pose, 1e-7)
        seen[answer is not None] += 1
        assert answer is None or is_right(begin.a, begin.b, begin.pose, answer), (begin, answer)
    assert all(seen.values()), seen


@pytest.mark.parametrize("name", FITS)
def test_bodies_that_fit_do_not_cross(name):
    for off in (-0.05, 0.0):
        a, b, pose = FITS[name](off)
        assert told(a, b, pose, 1e-7) is None


def test_no_more_than_touching_is_told():
    box = asm.shapes.box(2, 2, 2)
    for pose in (at(0.3, 0.2, 1.9), at(0.3, 0.2, -1.9)):
        answer = told(box, box, pose, 0.09)
        assert answer is not None and 0.09 < answer.depth <= 0.1
        assert told(box, box, pose, 0.1) is None


def test_what_is_wholly_within_another_one_is_left_to_cells():
    assert told(asm.shapes.box(10, 10, 10), asm.shapes.box(1, 1, 1), at(0.3, 0.2, 0.1), 1e-7) is None


def test_what_takes_longer_than_cells_is_left_to_them(monkeypatch):
    box, pose = asm.shapes.box(2, 2, 2), at(0.3, 0.2, 1.5)
    assert told(box, box, pose, 1e-7) is not None
    monkeypatch.setattr(crossing, "MOST", 100)
    assert told(box, box, pose, 1e-7) is None


def test_places_are_in_the_world():
    box = faces_of(asm.shapes.box(2, 2, 2))
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9])
    q = np.array([np.r_[5.0, 6, 7, turn.as_quat(scalar_first=True)], np.r_[5.5, 6.5, 8.5, 1, 0, 0, 0], at(90, 0, 0)])
    answers = HullAnswers([box] * 3, [(0, 1), (1, 2)], [0.0, 0.0], q, 1e-7)
    first, second = answers.crossing(0), answers.crossing(1)
    assert first is not None and first.verdict is Verdict.CROSSING and second is None
    cube = exact.box(2, 2, 2)
    ones = [float(cube.distance(Motion.of(row).back(first.place[None]))[0]) for row in q[:2]]
    assert min(ones) <= -first.depth + ROUNDING and max(ones) <= ROUNDING


def test_a_disturbed_bolt_is_seated_without_cells(monkeypatch):
    """Neither where it starts, crossing its plate, nor where it fits are cells made."""
    plate = asm.Body("plate", asm.shapes.plate(60, 40, 10, [(0, 0, 4.05)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(4.0, 40), (0.3, 0.2, 3.0), (0.999, 0.03, 0.02, 0.0))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Clearance())

    def none_made(*_):
        raise AssertionError("cells are made")

    monkeypatch.setattr(proof.KeptLooks, "__init__", none_made)
    solution = scene.solve()
    assert solution.success and solution.proved
