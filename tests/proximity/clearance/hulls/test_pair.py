"""What hulls tell of two bodies is so, by judges of closed form; of bodies that fit each other they tell it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls import outside, pair
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body
from assembly.proximity.clearance.hulls.pair import answer_by_hulls
from assembly.proximity.clearance.hulls.scene import HullAnswers, _after_a_move
from tests.proximity.clearance.hulls.test_face_hulls import GROOVE, polygon, square_hole
from tests.proximity.clearance.scenes import at, faces_of, poses, proof_of, start_of
from tests.studies.machined import bolt, retaining_ring, socket, turned_part
from tests.validation import exact_solids as exact
from tests.validation.crossing_judge import Motion, crossing_depth

TOUCHING = 1e-7
PLATE = asm.shapes.plate(60, 40, 10, [(0, 0, 4.0)])
# How far from a ring of 5 by 1.5 a ball of 5 is that lies on it, along the axis.
ON_RING = (6.5**2 - 5.0**2) ** 0.5


def dovetail(wider=0.0):
    t = 8.0 / np.tan(np.radians(60.0))
    groove = [(-30, -20), (30, -20), (30, 0), (10, 0), (10 + t, -8), (-10 - t, -8), (-10, 0), (-30, 0)]
    tail = [(-10 - t - wider, -8), (10 + t + wider, -8), (10 + wider, 0), (10, 6), (-10, 6), (-10 - wider, 0)]
    return asm.shapes.extrusion(polygon(groove), 120.0), asm.shapes.extrusion(polygon(tail), 40.0)


def plug(thicker=0.0):
    seat = turned_part([(5, -5 * 3**0.5), (25, -5 * 3**0.5), (25, 0), (10, 0)])
    s = 3**0.5
    return seat, turned_part([(0, -4 * s), (6 + thicker, -4 * s), (12 + thicker, 2 * s), (0, 2 * s)])


def slotted_bore(radius, half, top):
    """The loop of a bore with a slot for a key, clockwise: arcs of less than a third of a turn, and three sides."""
    begin = np.arcsin(half / radius)
    angles = np.pi / 2 - begin - np.linspace(0.0, 2.0 * np.pi - 2.0 * begin, 5)
    arcs = []
    for a, b in zip(angles[:-1], angles[1:], strict=True):
        weight = np.cos((a - b) / 2)
        middle = radius / weight * np.array([np.cos((a + b) / 2), np.sin((a + b) / 2)])
        ends = [radius * np.array([np.cos(t), np.sin(t)]) for t in (a, b)]
        arcs.append(asm.NurbsCurve([ends[0], middle, ends[1]], [0, 0, 0, 1, 1, 1], 2, [1, weight, 1]))
    low = radius * np.cos(begin)
    corners = [(-half, low), (-half, top), (half, top), (half, low)]
    sides = [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(corners[:-1], corners[1:], strict=True)]
    return [*arcs, *sides]


FITS = {
    "plates": lambda off: (PLATE, PLATE, at(5, 3, 10 - off)),
    "a pin in its bore": lambda off: (PLATE, asm.shapes.solid_cylinder(4 + off, 40), at(0, 0, 4)),
    "a pin no longer than its bore": lambda off: (PLATE, asm.shapes.solid_cylinder(4 + off, 10), at(0, 0, 0)),
    "a bore over its pin": lambda off: (asm.shapes.solid_cylinder(4 + off, 40), PLATE, at(0, 0, 4)),
    "a bolt on its plate": lambda off: (PLATE, bolt(4 + off, 30, 6.5, 8), at(0, 0, 5)),
    "a ball in its socket": lambda off: (socket(10, 18, 16), asm.shapes.sphere(10 + off), at(0, 0, 0)),
    "a ball through its ring": lambda off: (
        retaining_ring(12.0, 22.0, 0.6),
        asm.shapes.sphere(12 + off),
        at(0, 0, 0),
    ),
    "a ball on a ring": lambda off: (asm.shapes.torus(5, 1.5), asm.shapes.sphere(5 + off), at(0, 0, ON_RING)),
    "a ring around a ball": lambda off: (asm.shapes.sphere(5 + off), asm.shapes.torus(5, 1.5), at(0, 0, ON_RING)),
    "a ball on a hole": lambda off: (PLATE, asm.shapes.sphere(5 + off), at(0, 0, 8)),
    "a ball under a hole": lambda off: (asm.shapes.sphere(5 + off), PLATE, at(0, 0, 8)),
    "a ball on a turned hole": lambda off: (
        turned_part([(4, -5), (30, -5), (30, 5), (8, 5), (4, 1)]),
        asm.shapes.sphere(12 + off),
        at(0, 0, 5 + 80**0.5),
    ),
    "a ball in its seat": lambda off: (plug()[0], asm.shapes.sphere(10 + off), at(0, 0, 20 - 10 * 3**0.5)),
    "a hub with a slot on its shaft": lambda off: (
        asm.shapes.extrusion([circle(25.0)], 30.0, [slotted_bore(12.0, 3.0, 15.0)]),
        asm.shapes.solid_cylinder(12 + off, 60),
        at(0, 0, 3),
    ),
    "a plug in its seat": lambda off: (*plug(2.0 * off), at(0, 0, 0)),
    "a dovetail": lambda off: (*dovetail(2.0 * off), at(0, 0, 3)),
    "a block in a square hole": lambda off: (
        asm.shapes.extrusion(polygon([(-20, -20), (20, -20), (20, 20), (-20, 20)]), 9.0, [square_hole(-2.5)]),
        asm.shapes.box(5 + 2 * off, 4 + 2 * off, 30),
        at(0, 0, 2),
    ),
    "a cylinder on two flanks": lambda off: (
        asm.shapes.extrusion(polygon([(-25, -20), (25, -20), (25, 12), (16, 12), (0, -4), (-16, 12), (-25, 12)]), 60.0),
        asm.shapes.solid_cylinder(10 + off, 80),
        at(0, -4 + 10 * 2**0.5, 0),
    ),
}


def told(first, second, pose, touching=TOUCHING, least=0.0):
    hulls = hulls_of_body(faces_of(second)).posed(rotation_matrix(pose[3:]), pose[:3])
    return answer_by_hulls(hulls_of_body(faces_of(first)), hulls, least, touching)


@pytest.mark.parametrize("name", FITS)
def test_bodies_that_fit_touch(name):
    answer = told(*FITS[name](0.0))
    assert answer is not None and answer.verdict is Verdict.TOUCHING
    assert 0.0 < answer.depth <= TOUCHING
    # Their boundaries are no nearer than the opened ones, less what was moved.
    assert answer.bound <= 1e-12


@pytest.mark.parametrize("name", FITS)
def test_bodies_that_are_too_large_are_not_told_to_touch(name):
    assert told(*FITS[name](8.0 * TOUCHING)) is None


@pytest.mark.parametrize("name", FITS)
def test_bodies_with_play_are_clear_and_proven_so(name):
    play = 0.05
    first, second, pose = FITS[name](-play)
    if name == "a cylinder on two flanks":
        # A smaller one stays on one of them.
        pose = pose + [0.0, play, 0.0, 0.0, 0.0, 0.0, 0.0]
    if name in ("a bolt on its plate", "a dovetail"):
        # The head and the floor still touch.
        pose = pose + ([0, 0, play, 0, 0, 0, 0] if "bolt" in name else [0, 0.25 * play, 0, 0, 0, 0, 0])
    answer = told(first, second, pose)
    assert answer is not None and answer.verdict is Verdict.CLEAR and answer.bound > 0.0
    (proven,) = proof_of(first, second).look(poses(pose), TOUCHING)
    assert proven.verdict is Verdict.CLEAR


def test_without_touching_nothing_touches():
    assert all(told(*FITS[name](0.0), touching=0.0) is None for name in FITS)


def test_a_least_gap_is_kept():
    answer = told(PLATE, PLATE, at(5, 3, 10.5), least=0.5)
    assert answer is not None and answer.verdict is Verdict.TOUCHING and answer.bound == pytest.approx(0.5, abs=1e-12)
    answer = told(PLATE, PLATE, at(5, 3, 10.5), least=0.4)
    assert answer is not None and answer.verdict is Verdict.CLEAR and 0.4 < answer.bound <= 0.5
    assert told(PLATE, PLATE, at(5, 3, 10.5), least=0.6) is None


def test_bodies_within_others_are_not_told_to_be_clear():
    big, ball = asm.shapes.box(10, 10, 10), asm.shapes.sphere(1)
    for both in ((big, ball), (ball, big)):
        assert told(*both, at(0.3, 0.2, 0.1)) is None
    assert told(asm.shapes.sphere(3), ball, at(0, 0, 0)) is None
    hollow = turned_part([(0, -9), (9, -9), (9, 9), (0, 9)])
    assert told(hollow, ball, at(0.3, 0.2, 0.1)) is None
    # In the bore of a tube it is outside.
    tube = turned_part([(4, -9), (9, -9), (9, 9), (4, 9)])
    answer = told(tube, ball, at(0.3, 0.2, 0.1))
    assert answer is not None and answer.verdict is Verdict.CLEAR and answer.bound <= 4 - 1 - np.hypot(0.3, 0.2)


def test_random_pairs_are_judged(cases):
    """Whatever may be moved so that hulls tell something: what bodies have in common is no deeper than that."""
    seen = {None: 0, Verdict.CLEAR: 0, Verdict.TOUCHING: 0}
    for number in range(20, 20 + cases(20, 400)):
        begin = start_of(number)
        motion = Motion.of(begin.pose)
        depth = crossing_depth(begin.a, begin.b, motion)
        for touching in (1e-9, 1e-2):
            answer = told(begin.a.shape, begin.b.shape, begin.pose, touching * begin.size)
            seen[None if answer is None else answer.verdict] += 1
            assert answer is None or depth <= answer.depth + 1e-13, begin
    assert all(seen.values()), seen


PARTS = {
    "plate": exact.plate(3.0, 2.0, 0.3, [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)]),
    "pin": exact.pin(0.4, 1.2),
    "short pin": exact.pin(0.4, 0.2),
    "L": exact.polygonal([(-0.6, -0.6), (0.6, -0.6), (0.6, -0.2), (-0.2, -0.2), (-0.2, 0.6), (-0.6, 0.6)], 0.5, "L"),
    "box": exact.box(0.4, 0.8, 0.5),
    "tube": exact.tube(0.5, 0.4, 1.0),
    "ball": exact.ball(0.4),
}
NEAR = {
    ("plate", "pin"): (0.7, 0.1, 0.1),
    ("plate", "short pin"): (0.7, 0.1, 0.0),
    ("plate", "tube"): (-0.7, 0.0, 0.2),
    ("L", "box"): (0.0, 0.2, 0.1),
    ("tube", "pin"): (0.0, 0.0, 0.2),
    ("tube", "ball"): (0.0, 0.0, 0.1),
    ("plate", "box"): (0.1, 0.3, 0.4),
}


@pytest.mark.parametrize("names", NEAR)
def test_pairs_that_all_but_fit_are_judged(names, cases):
    """Moved and turned by about as much as may be opened."""
    rng = np.random.default_rng(6)
    one, other = (PARTS[name] for name in names)
    found = 0
    for _ in range(cases(6, 200)):
        t = 10.0 ** rng.uniform(-4, -1.5)
        turn = Rotation.from_rotvec(0.3 * t * rng.normal(size=3) * rng.integers(2))
        pose = np.r_[np.array(NEAR[names]) + 0.5 * t * rng.normal(size=3), turn.as_quat(scalar_first=True)]
        depth = crossing_depth(one, other, Motion.of(pose))
        answer = told(one.shape, other.shape, pose, t)
        found += answer is not None
        assert answer is None or depth <= answer.depth + 1e-13, (names, pose, t)
    assert found


def test_balls_beside_rings_are_judged():
    """Anywhere about a ring, also in its hole: what is told is the distance, and it is told wherever they are apart."""
    rng, ring, told_of = np.random.default_rng(7), asm.shapes.torus(0.5, 0.15), 0
    for _ in range(60):
        radius, place = rng.uniform(0.1, 0.5), 0.5 * rng.normal(size=3)
        distance = np.hypot(np.hypot(*place[:2]) - 0.5, place[2]) - 0.15 - radius
        turned = np.r_[place, Rotation.random(rng=rng).as_quat(scalar_first=True)]
        answer = told(ring, asm.shapes.sphere(radius), turned)
        assert (answer is not None) == (distance > -TOUCHING)
        if answer is not None:
            assert answer.bound <= distance + 1e-14
            told_of += 1
    assert told_of > 20


def test_balls_on_holes_are_judged():
    """Anywhere about a plate's hole, and in it: what is told is the distance, wherever the ball is not in the plate."""
    rng, plate, told_of = np.random.default_rng(8), asm.shapes.plate(60, 40, 10, [(0, 0, 4.0)]), 0
    for _ in range(200):
        radius, place = rng.uniform(1.0, 6.0), rng.uniform((-4, -4, -12), (4, 4, 12))
        beside, height = np.hypot(*place[:2]), abs(place[2])
        distance = np.hypot(max(4.0 - beside, 0.0), max(height - 5.0, 0.0)) - radius
        if beside > 4.0:
            distance = height - 5.0 - radius
        answer = told(plate, asm.shapes.sphere(radius), np.r_[place, 1.0, 0.0, 0.0, 0.0])
        assert (answer is not None) == (distance > -TOUCHING), (radius, place)
        if answer is not None:
            # What is told of bodies that are far apart is a bound.
            assert answer.bound <= distance + 1e-12
            told_of += 1
    assert told_of > 50


def test_of_a_scene_all_pairs_or_none():
    q = np.array([at(0, 0, 0), at(5, 3, 10), at(0, 0, 90)])
    shapes, pairs = [faces_of(PLATE)] * 3, [(0, 1), (0, 2), (1, 2)]
    found = HullAnswers(shapes, pairs, [0.0, 0.0, 0.0], q, TOUCHING).all_held()
    assert found is not None
    assert [answer.verdict for answer in found] == [Verdict.TOUCHING, Verdict.CLEAR, Verdict.CLEAR]
    assert found[1].bound <= 80 and found[2].bound <= 70
    assert HullAnswers(shapes, pairs, [0.0, 0.0, 75.0], q, TOUCHING).all_held() is None
    assert HullAnswers(shapes, [], [], q, TOUCHING).all_held() == []


@pytest.mark.parametrize("room", [outside, pair])
def test_what_takes_longer_than_cells_is_left_to_them(room, monkeypatch):
    first, second, pose = FITS["a pin in its bore"](-0.1)
    assert told(first, second, pose) is not None
    monkeypatch.setattr(room, "MOST", 100)
    assert told(first, second, pose) is None


def test_grooves_are_not_convex():
    """In a groove, beside the walls that its ends' hulls would cover."""
    block = asm.shapes.extrusion(polygon(GROOVE), 30.0)
    answer = told(block, asm.shapes.box(6, 4, 50), at(0, -3, 0))
    assert answer is not None and answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 3.0


@pytest.mark.parametrize("angle", [0.0, 0.11, 0.37, 1.0, 4.4])
def test_a_pin_that_lies_along_the_wall_of_a_wider_bore_touches_it(angle):
    """Wherever around the bore: half spaces at fixed angles moved it beside the contact, and told nothing."""
    plate = hulls_of_body(faces_of(asm.shapes.plate(60, 40, 12, [(8, 0, 4.5)])))
    pin = hulls_of_body(faces_of(asm.shapes.solid_cylinder(4.0, 40)))
    place = np.array([8.0 + 0.5 * np.cos(angle), 0.5 * np.sin(angle), 4.0])
    answer = answer_by_hulls(plate, pin.posed(np.eye(3), place), 0.0, TOUCHING)
    assert answer is not None and answer.verdict is Verdict.TOUCHING and answer.depth <= TOUCHING
    deeper = place + 1e-5 * np.array([np.cos(angle), np.sin(angle), 0.0])
    assert answer_by_hulls(plate, pin.posed(np.eye(3), deeper), 0.0, TOUCHING) is None


def test_what_is_known_of_bodies_that_stay_is_what_is_told_of_them_anew():
    """Answers are the same to the bit, and none is asked for again."""
    plate, pin = faces_of(PLATE), faces_of(asm.shapes.solid_cylinder(4.0, 40))
    shapes, pairs = [plate, pin, pin, plate], [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)]
    q = np.array([at(0, 0, 0), at(0, 0, 4), at(0, 0, 60), at(5, 3, 10)])
    first = HullAnswers(shapes, pairs, [0.0] * 5, q, TOUCHING)
    for k in range(5):
        first.held(k), first.crossing(k)
    moved = q.copy()
    moved[2, :3] = 30.0, 0.0, 1000.0
    later, anew = (HullAnswers(shapes, pairs, [0.0] * 5, moved, TOUCHING, last=last) for last in (first, None))
    assert [later.held(k) is first.held(k) for k in (0, 2)] == [True, True]
    for k in range(5):
        assert repr(later.held(k)) == repr(anew.held(k)) and repr(later.crossing(k)) == repr(anew.crossing(k))
    assert later.held(1).bound > first.held(1).bound


@pytest.mark.parametrize(
    ("at", "touches", "parted"),
    [((40, 0, 0), False, True), ((20, 0, 0), True, False), ((15, 0, 0), True, False), ((0, 0, 22), False, False)],
    ids=["beside", "flush", "crossing", "in its hole"],
)
def test_what_touches_or_is_parted_by_a_plane(at, touches, parted):
    plate = faces_of(asm.shapes.plate(30, 30, 10, [(0, 0, 4.5)]))
    pin = faces_of(asm.shapes.box(10, 10, 10) if at[0] else asm.shapes.solid_cylinder(4.0, 60))
    q = np.tile([0.0, 0, 0, 1, 0, 0, 0], (2, 1))
    q[1, :3] = at
    answers = HullAnswers([plate, pin], [(0, 1)], [0.0], q, TOUCHING)
    assert answers.any_touches() == touches
    assert answers.parted(0) == parted
    # Of wires nothing is told.
    assert not HullAnswers([plate, pin], [(0, 1)], [0.0], q, TOUCHING, True).parted(0)


@pytest.mark.parametrize("beside", [(5.0, 3.0, 10.0), (5.0, 3.0, 12.0)], ids=["touching", "clear"])
def test_what_moves_by_rounding_is_not_asked_again(beside, monkeypatch):
    """Its answer is worth less by at least how far its points have gone; what moves farther is asked."""
    rng, shapes, asked = np.random.default_rng(5), [faces_of(PLATE)] * 3, []
    q = np.array([at(10, 20, 30), at(*np.add((10, 20, 30), beside)), at(10, 20, 90)])
    pairs = [(0, 1), (0, 2), (1, 2)]
    first = HullAnswers(shapes, pairs, [0.0] * 3, q, TOUCHING)
    before = first.all_held()

    def seen(*given):
        asked.append(given)
        return answer_by_hulls(*given)

    monkeypatch.setattr("assembly.proximity.clearance.hulls.scene.answer_by_hulls", seen)
    for _ in range(20):
        moved = q.copy()
        moved[1] += rng.uniform(-1.0, 1.0, 7) * np.r_[np.full(3, 8e-15), np.full(4, 1e-16)]
        after = HullAnswers(shapes, pairs, [0.0] * 3, moved, TOUCHING, last=first).all_held()
        assert not asked
        went = float(np.linalg.norm(moved[1, :3] - q[1, :3]))
        for k in (0, 2):
            assert after[k].verdict is before[k].verdict
            assert before[k].bound - after[k].bound >= went - 1e-15
            assert after[k].depth >= before[k].depth
        assert after[1] is before[1]
    moved[1, 2] += 1e-10
    HullAnswers(shapes, pairs, [0.0] * 3, moved, TOUCHING, last=first).all_held()
    assert asked


def test_what_is_touching_by_all_that_counts_is_asked_again():
    """A move by rounding takes what touches no farther than what counts as touching, nor below a least gap."""
    touches, clear = Answer(Verdict.TOUCHING, 0.0, TOUCHING), Answer(Verdict.CLEAR, 0.5)
    assert _after_a_move(touches, 1e-15, 0.0, TOUCHING) is None
    assert _after_a_move(touches, 1e-15, 0.0, 2.0 * TOUCHING).depth == TOUCHING + 1e-15
    assert _after_a_move(clear, 1e-15, 0.5, TOUCHING) is None
    assert _after_a_move(clear, 1e-15, 0.4, TOUCHING).bound == 0.5 - 1e-15
    assert _after_a_move(None, 1e-15, 0.0, TOUCHING) is None
