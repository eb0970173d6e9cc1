"""What a proof says of random pairs of bodies is what closed forms say, and it says something nearly always.

Distances of the judge are found to 1e-11 of a part's size, and from above (`crossing_judge`): hence `CLOSE`, in the
unit of parts that are up to 6 in size. Where it says crossing, the judge's signed distance is below zero but for
rounding.
"""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict, is_proven
from assembly.proximity.clearance.proof import ClearanceProof
from tests.proximity.clearance.scenes import (
    UPRIGHT,
    at,
    direction,
    faces_of,
    moved,
    poses,
    proof_of,
    quaternion,
    start_of,
    way_of,
)
from tests.validation.clearance_scenes import TOUCHING, parts
from tests.validation.crossing_judge import Motion, least_signed_distance

CLOSE, ROUNDING = 1e-10, 1e-14
# Pairs of cells that may be looked at for nine tenths of a distance: an ellipsoid at 2.5e-4 of a plate, pair 135, takes
# 25,000 to 30,000, for seven tenths fewer than 20,000.
BUDGET = 40_000


def seen(pose):
    """A pose of the second body as the judge reads it; the first one stands at the origin."""
    return Motion.of(pose)


def check_answer(answer, begin):
    """That what is said of a start is so."""
    if answer.verdict is Verdict.CLEAR:
        assert 0.0 < answer.bound <= begin.distance + CLOSE, begin
    if answer.verdict is Verdict.CROSSING:
        assert answer.depth > 0.0 and begin.distance < ROUNDING * begin.size, begin
        assert np.linalg.norm(answer.place) < 1.1 * begin.size, begin
    if answer.verdict is Verdict.ENCLOSED:
        assert is_enclosed(begin), begin
        assert answer.bound > 0.0


def is_enclosed(begin):
    """Whether all samples of one part are within the other one."""
    pose = seen(begin.pose)
    return any(
        part.is_closed and float(part.distance(points).max()) < 0.0
        for part, points in ((begin.a, pose.apply(begin.b.samples)), (begin.b, pose.back(begin.a.samples)))
    )


def test_random_pairs(cases):
    count, found = cases(18, 20_000), Counter()
    for number in range(count):
        begin = start_of(number)
        (answer,) = proof_of(begin.a.shape, begin.b.shape).look(poses(begin.pose), 0.0)
        check_answer(answer, begin)
        # Of two copies at one place nothing can be proven.
        found[answer.verdict] += not (begin.first == begin.second and np.linalg.norm(begin.pose[:3]) < 1e-9)
    assert found[Verdict.TOUCHING] == 0
    assert found[Verdict.UNDECIDED] <= 0.005 * count
    assert min(found[v] for v in (Verdict.CLEAR, Verdict.CROSSING, Verdict.ENCLOSED)) > 0.03 * count


def test_bounds_are_near_where_bodies_are(cases):
    """Asked for one gap after another, a proof comes to nine tenths of the distance."""
    for number in range(cases(4, 600)):
        begin, _ = way_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        assert proof.is_apart(0, poses(begin.pose), 0.9 * begin.distance, BUDGET), begin
        assert not proof.is_apart(0, poses(begin.pose), begin.distance + CLOSE, 1000), begin
        # And the proof itself is as it was.
        check_answer(proof.look(poses(begin.pose), 0.0)[0], begin)


@pytest.mark.parametrize("number", [401, 797])
def test_bounds_of_what_is_in_bores_of_second_bodies(number):
    """At 2e-5 and 4e-6 of each other, where the walls of bores are the nearest."""
    begin = start_of(number)
    first, second, pose = begin.a.shape, begin.b.shape, poses(begin.pose)
    for proof, at_pose in ((proof_of(first, second), pose), (proof_of(second, first), pose[::-1])):
        (answer,) = proof.look(at_pose, 0.0)
        assert answer.verdict is Verdict.CLEAR
        assert 0.9 * begin.distance < answer.bound <= begin.distance + CLOSE


@pytest.mark.parametrize("least", [0.0, 3e-5])
@pytest.mark.parametrize("pin", ["bare", "with a collar"])
def test_bounds_of_pins_in_bores_of_second_bodies(pin, least):
    """Off the middle by e they are 1e-4 - e apart, where they are looked at and where ways are proven to lead."""
    shape = [*asm.shapes.solid_cylinder(0.4 - 1e-4, 2.0)]
    if pin == "with a collar":
        shape += [
            asm.Face(f.surface.transformed(np.eye(3), (0, 0, 1.5)), name=f"collar {k}", reversed=f.reversed)
            for k, f in enumerate(faces_of(asm.shapes.box(1.2, 1.2, 0.4)))
        ]
    proof = proof_of(shape, parts()["plate"].shape, least)
    for way, off in enumerate((0.0, 3e-5, 6e-5, 1e-5)):
        at_pose, still = poses(UPRIGHT, at(0.7 + off, 0.1, 0.3)), np.zeros((1, 6))
        if way < 2:
            (answer,) = proof.look(at_pose, 0.0)
        else:
            assert proof.stays_clear(at_pose, 0.0, still)
            (answer,) = proof.clear_answers(at_pose, still)
        assert answer.verdict is Verdict.CLEAR
        assert max(0.99 * (1e-4 - off), least) < answer.bound <= 1e-4 - off + 1e-14


def test_the_least_gap_is_kept(cases):
    for number in range(cases(4, 400)):
        begin, _ = way_of(number)
        for factor, holds in ((0.9, True), (1.0 + 1e-9, False)):
            least = factor * begin.distance + (0.0 if holds else CLOSE)
            proof = proof_of(begin.a.shape, begin.b.shape, least)
            proof.fronts.counts.budget = BUDGET if holds else 1000
            (answer,) = proof.look(poses(begin.pose), 0.0)
            assert is_proven(answer) == holds, begin
            if holds:
                assert least < answer.bound <= begin.distance + CLOSE


def test_both_bodies_may_be_anywhere(cases):
    """The pair turned and moved as one: the same verdict, with coordinates of 1e3."""
    for number in range(cases(6, 500)):
        rng, begin = np.random.default_rng([24, number]), start_of(number)
        turn = quaternion(at(0, 0, 0) if number == 0 else np.r_[0, 0, 0, rng.normal(size=4)])
        shift = 1e3 * direction(rng)
        first = np.r_[shift, turn.as_quat(scalar_first=True)]
        second = np.r_[turn.apply(begin.pose[:3]) + shift, (turn * quaternion(begin.pose)).as_quat(scalar_first=True)]
        near = proof_of(begin.a.shape, begin.b.shape).look(poses(begin.pose), 0.0)[0]
        far = proof_of(begin.a.shape, begin.b.shape).look(poses(second, first), 0.0)[0]
        assert far.verdict is near.verdict, begin
        if far.verdict is Verdict.CROSSING:
            assert np.linalg.norm(far.place - shift) < 1.1 * begin.size


def test_ways(cases):
    """Of a way that is proven no pose crosses; of many it is proven."""
    count, looks, found = cases(8, 5000), cases(3, 25), Counter()
    for number in range(count):
        begin, step = way_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        assert proof.look(poses(begin.pose), 0.0)[0].verdict is Verdict.CLEAR
        (answer,) = proof.look(poses(step.end), 0.0, swept=True)
        found[answer.verdict] += 1
        if answer.verdict is Verdict.CLEAR:
            assert answer.swept and answer.part == 1.0
            assert step.least(looks) > -TOUCHING, begin
        elif answer.part > 0.0:
            assert min(
                least_signed_distance(begin.a, begin.b, step.at(s)) for s in (0.5 * answer.part, answer.part)
            ) > (-TOUCHING)
    assert found[Verdict.CLEAR] > 0.4 * count
    assert found[Verdict.UNDECIDED] <= 0.05 * count


def state_of(proof):
    """What a look may not change that fails: fronts and last poses, but lengths that may only grow."""
    fronts, count = proof.fronts, int(proof.fronts.counts.count[0])
    pair = fronts.pair
    parted, nodes = fronts.parted[0, :count].copy(), fronts.nodes[0, :count].copy()
    # Fields that tell how the last look ended.
    return parted, nodes, pair.turn.copy(), pair.shift.copy(), pair.soonest.copy(), pair.known.copy()


def same(one, other):
    return all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_look_that_fails_changes_nothing(cases):
    """The same look again says the same; and earlier poses are looked at as before."""
    failed = 0
    for number in range(cases(10, 2000)):
        begin, step = way_of(number)
        proof = proof_of(begin.a.shape, begin.b.shape)
        proof.look(poses(begin.pose), 0.0)
        before = state_of(proof)
        (answer,) = proof.look(poses(step.end), 0.0, swept=True)
        if is_proven(answer):
            continue
        failed += 1
        assert np.array_equal(proof.fronts.pair.turn, before[2]) and np.array_equal(proof.fronts.pair.shift, before[3])
        if answer.part == 0.0:
            assert same(state_of(proof), before)
        (again,) = proof.look(poses(step.end), 0.0, swept=True)
        assert again.verdict is answer.verdict
        assert proof.look(poses(begin.pose), 0.0, swept=True)[0].verdict is Verdict.CLEAR
    assert failed > 1


def test_a_proof_that_is_kept_says_what_a_fresh_one_says(cases):
    """Along random walks of poses: clear and crossing alike; bounds are those of bodies."""
    said = Counter()
    for number in range(cases(3, 300)):
        rng, (begin, _) = np.random.default_rng([27, number]), way_of(number)
        kept, pose = proof_of(begin.a.shape, begin.b.shape), begin.pose
        kept.look(poses(pose), 0.0)
        for _ in range(8):
            step = 10.0 ** rng.uniform(-3.0, -0.5)
            turn = quaternion(np.r_[0, 0, 0, 1.0, 0.3 * step * rng.normal(size=3)])
            tried = moved(pose, step * direction(rng) - 0.3 * step * begin.way, turn)
            (fresh,), (old,) = (
                proof_of(begin.a.shape, begin.b.shape).look(poses(tried), 0.0),
                kept.look(poses(tried), 0.0),
            )
            assert old.verdict is fresh.verdict, (number, begin)
            said[old.verdict] += 1
            if old.verdict is Verdict.CLEAR:
                distance = least_signed_distance(begin.a, begin.b, seen(tried))
                assert 0.0 < old.bound <= distance + CLOSE
                pose = tried
    assert min(said[v] for v in (Verdict.CLEAR, Verdict.CROSSING)) > 3


def test_going_back():
    """To an earlier pose, without a look: what follows is proven from there."""
    proof = proof_of(parts()["box"].shape, parts()["ball"].shape)
    first, second, third = (poses(at(x, 0.0, 0.0)) for x in (1.5, 1.2, 1.6))
    proof.look(first, 0.0)
    earlier = proof.last_poses()
    assert proof.look(second, 0.0, swept=True)[0].verdict is Verdict.CLEAR
    proof.go_back(earlier)
    assert [np.array_equal(a, b) for a, b in zip(proof.last_poses(), earlier, strict=True)] == [True, True]
    (answer,) = proof.look(third, 0.0, swept=True)
    assert answer.verdict is Verdict.CLEAR and answer.bound <= 0.7 + CLOSE
    proof.go_back(earlier)
    assert proof.look(poses(at(0.8, 0.0, 0.0)), 0.0, swept=True)[0].verdict is Verdict.CROSSING


def test_going_back_far_does_not_keep_gaps():
    """What was gone back counts as gone: gaps of a front are those of where it was made."""
    proof = proof_of(parts()["box"].shape, parts()["ball"].shape)
    near, far = poses(at(1.0, 0.0, 0.0)), poses(at(5.0, 0.0, 0.0))
    proof.look(near, 0.0)
    earlier = proof.last_poses()
    proof.look(far, 0.0, swept=True)
    proof.go_back(earlier)
    (answer,) = proof.look(poses(at(0.95, 0.0, 0.0)), 0.0, swept=True)
    assert answer.verdict is Verdict.CLEAR and answer.bound <= 0.05 + CLOSE
    proof.go_back(earlier)
    assert proof.look(poses(at(0.89, 0.0, 0.0)), 0.0, swept=True)[0].verdict is Verdict.CROSSING


def test_through_a_thin_plate():
    """Clear at both ends of the way alone."""
    proof = proof_of(parts()["thin 1e-4"].shape, parts()["ball"].shape)
    above, below = poses(at(0.1, 0.1, 0.5)), poses(at(0.1, 0.1, -0.6))
    assert proof.look(above, 0.0)[0].verdict is Verdict.CLEAR
    (answer,) = proof.look(below, 0.0, swept=True)
    assert answer.verdict is Verdict.CROSSING and answer.part < 0.1 / 1.1
    assert proof.look(below, 0.0)[0].verdict is Verdict.CLEAR


def test_no_way_leads_from_poses_that_are_forgotten():
    proof = proof_of(parts()["thin 1e-4"].shape, parts()["ball"].shape)
    above, below = poses(at(0.1, 0.1, 0.5)), poses(at(0.1, 0.1, -0.6))
    assert proof.look(above, 0.0)[0].verdict is Verdict.CLEAR
    proof.forget_poses()
    (answer,) = proof.look(below, 0.0, swept=True)
    assert answer.verdict is Verdict.CLEAR and not answer.swept


def test_within_another_and_out_of_it():
    """Also of a proof that found them clear before: no way is proven from within."""
    big, ball = parts()["big box"], parts()["ball"]
    proof = proof_of(big.shape, ball.shape)
    outside, inside = poses(at(3.0, 0.0, 0.0)), poses(at(0.1, 0.0, 0.0))
    assert proof.look(outside, 0.0)[0].verdict is Verdict.CLEAR
    (answer,) = proof.look(inside, 0.0)
    assert answer.verdict is Verdict.ENCLOSED and answer.bound <= 1.1 + CLOSE
    for swept in (True, False):
        assert proof.look(poses(at(0.2, 0.0, 0.0)), 0.0, swept=swept)[0].verdict is Verdict.ENCLOSED
    assert proof.look(outside, 0.0)[0].verdict is Verdict.CLEAR
    # The other way around, and of a sheet, which has no inside.
    assert proof_of(ball.shape, big.shape).look(inside, 0.0)[0].verdict is Verdict.ENCLOSED
    assert proof_of(big.shape, parts()["sheet"].shape).look(inside, 0.0)[0].verdict is Verdict.ENCLOSED
    assert proof_of(asm.shapes.cylinder(1.0, 2.0), ball.shape).look(inside, 0.0)[0].verdict is Verdict.CLEAR


def test_linked_rings_and_pins_in_bores_are_clear():
    ring = parts()["torus"].shape
    turn = quaternion(np.r_[0, 0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0])
    (answer,) = proof_of(ring, ring).look(poses(at(0.6, 0.0, 0.0, turn)), 0.0)
    assert answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 0.3 + CLOSE
    plate, pin = parts()["plate"].shape, asm.shapes.solid_cylinder(0.4 - 1e-4, 2.0)
    (answer,) = proof_of(plate, pin).look(poses(at(0.7, 0.1, 0.3)), 0.0)
    assert answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 1e-4 + CLOSE


def test_a_shaft_that_turns_on_the_wall_of_its_bore():
    """About its own axis, and along it: its way is straight, and no cell is asked, however little room is left."""
    proof = proof_of(
        asm.shapes.plate(50.0, 50.0, 20.0, holes=[(0.0, 0.0, 10.02)]), asm.shapes.solid_cylinder(10.0, 90.0)
    )
    off = 0.02 - 3e-8
    for k, angle in enumerate(np.linspace(0.0, 0.2, 21)):
        turned = (off, 0.0, 0.05 * k, np.cos(angle), 0.0, 0.0, np.sin(angle))
        (answer,) = proof.look(poses(turned), 1e-7, swept=k > 0)
        assert answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 3e-8
        assert k == 0 or proof.fronts.counts.sought[0] == 0


def test_what_is_not_looked_at_does_not_stay_clear():
    """Where no way is known from the last pose, none is from it to this one."""
    proof = proof_of(asm.shapes.box(1.0, 1.0, 1.0), asm.shapes.box(1.0, 1.0, 1.0))
    beside, across = poses((2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)), poses((0.2, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0))
    assert proof.look(beside, 0.0)[0].verdict is Verdict.CLEAR
    proof.forget_poses()
    assert not proof.stays_clear(across, 0.0, np.zeros((1, 6))) and proof.not_clear() == [0]


def test_equal_bodies_at_one_place():
    """No proof can tell: at every place boundaries touch. It says so."""
    shape = parts()["ball"].shape
    proof = proof_of(shape, shape)
    proof.fronts.counts.budget = 500
    assert proof.look(poses(UPRIGHT), 0.0)[0].verdict is Verdict.UNDECIDED


def test_several_pairs_at_once():
    """Each is looked at as if it were alone, and those that are not asked for stay as they are."""
    box, ball = faces_of(parts()["box"].shape), faces_of(parts()["ball"].shape)
    proof = ClearanceProof([box, (), ball, ball], [(0, 2), (2, 3), (3, 0)], [0.0, 0.1, 0.0])
    q = np.array([UPRIGHT, UPRIGHT, at(1.0, 0, 0), at(2.0, 0, 0)])
    answers = proof.look(q, 0.0)
    assert [a.verdict for a in answers] == [Verdict.CLEAR] * 3
    assert [a.bound <= d + CLOSE for a, d in zip(answers, (0.1, 0.2, 1.1), strict=True)] == [True] * 3
    assert answers[1].bound > 0.1
    q[3] = at(1.85, 0, 0)
    assert [a.verdict for a in proof.look(q, 0.0, which=[2, 0])] == [Verdict.CLEAR] * 2
    assert not is_proven(proof.look(q, 0.0, which=[1])[0])


@pytest.mark.parametrize("swept", [False, True])
def test_what_is_said_is_the_same_again(swept):
    for number in range(3):
        begin, step = way_of(number)
        told = []
        for _ in range(2):
            proof = proof_of(begin.a.shape, begin.b.shape)
            proof.look(poses(begin.pose), 0.0)
            answer = proof.look(poses(step.end), 0.0, swept=swept)[0]
            told.append((answer.verdict, answer.bound, answer.depth, answer.place.tobytes(), answer.part))
        assert told[0] == told[1]
