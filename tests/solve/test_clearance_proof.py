"""What clearances promise at the end of a solve is proven; where it is not, no solve says that it is solved."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import rotation_of
from assembly.proximity.clearance.answers import Verdict
from assembly.solve import near_contacts as contacts_nearby
from assembly.solve.clearance_proof import judge_end, lent_proof, new_proof, prove_end
from assembly.solve.interruption import Interruption
from assembly.solve.near_contacts import near_contacts, opening_move
from tests.proximity.clearance.scenes import start_of
from tests.validation.clearance_scenes import scene_of
from tests.validation.crossing_judge import Motion, crossing_depth

BALL, BOX = asm.shapes.sphere(0.5), asm.shapes.box(1.0, 1.0, 1.0)


def scene(second, place, first=BOX, **others):
    bodies = [asm.Body("plate", first, fixed=True), asm.Body("part", second, place)]
    found = asm.Assembly(bodies)
    found.constrain(asm.Clearance(name="gap", **others))
    return found


def test_a_start_that_crosses_is_stalled_where_nothing_may_move():
    solution = scene(BALL, (0.8, 0.1, 0.2)).solve(max_iterations=0)
    assert solution.status is asm.Status.STALLED and not solution.success and not solution.proved
    # A ball by 0.2 in a face: what is proven of that depth is no more.
    assert 1e-3 < solution.violations["gap"] <= 0.2
    assert solution.feasibility == solution.violations["gap"]
    assert "plate and part (CROSSING)" in solution.message
    assert "'gap'" in solution.message


def test_a_start_within_another_body_is_stalled_where_nothing_may_move():
    solution = scene(asm.shapes.sphere(0.3), (0.1, 0.1, 0.1), asm.shapes.box(3.0, 3.0, 3.0)).solve(max_iterations=0)
    assert solution.status is asm.Status.STALLED and not solution.proved
    assert "plate and part (ENCLOSED)" in solution.message
    # It is no nearer to the walls than that.
    assert 0.5 < solution.violations["gap"] <= 1.1 + 1e-12


@pytest.mark.parametrize("place, status", [((2.0, 0.0, 0.0), "STALLED"), ((0.8, 0.1, 0.2), "INFEASIBLE")])
def test_only_of_a_pose_that_violates_something_is_said_that_it_violates_it_least(place, status):
    """The loop's verdict may be of another pose than the one that it returns."""
    found = scene(BALL, place)
    found.minimize(asm.PointDistance(found["part"].point(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)))
    solution = found.solve(max_iterations=0)
    solution.status = asm.Status.INFEASIBLE
    interruption = Interruption(None, None)
    judge_end(solution, found._settings({}, interruption, warm=False), interruption)
    assert solution.status.name == status


def test_a_tight_pin_that_is_drawn_out_of_its_bore_is_not_called_infeasible_where_it_stands():
    """It was, at its start, which holds: the loop had gone to where the pin wedges, and came back."""
    plate = asm.Body("plate", asm.shapes.plate(3.0, 3.0, 4.0, [(0.0, 0.0, 0.5)]), fixed=True)
    lean = np.array([0.9999999639132022, 0.0001054936435254, -0.00024707222701596, 0.0])
    start = (0.0, 0.0, -0.8161681157298062)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(0.4999, 0.2), start, lean / np.linalg.norm(lean))
    found = asm.Assembly([plate, pin])
    found.constrain(asm.Clearance())
    found.minimize(asm.PointDistance(pin.point(0.0, 0.0, 1.1), (0.572, -0.163, -0.429)))
    solution = found.solve()
    # No contradiction is claimed where nothing is violated; that it is SOLVED is not required of this start.
    assert solution.feasibility < 1e-9 and solution.status is not asm.Status.INFEASIBLE


@pytest.mark.parametrize("place", [(2.0, 0.0, 0.0), (0.8, 0.1, 0.2), (1.0, 0.0, 0.0), (0.1, 0.1, 0.1)])
def test_solved_is_proven(place):
    solution = scene(BALL, place).solve()
    assert solution.success and solution.proved
    assert solution.violations["gap"] < 1e-9
    assert "not clear" not in solution.message


@pytest.mark.parametrize("given", [False, True])
def test_contacts_are_the_same_as_rows_and_one_by_one(given, monkeypatch):
    """What opens them rests on rows that one kernel makes; `contact_pairs` finds each of them again."""
    base = asm.Body("base", asm.shapes.box(3.0, 3.0, 1.0), fixed=True)
    ball = asm.Body("ball", BALL, position=(0.1, 0.2, 1.0 + 2e-3))
    ring = asm.Body("ring", asm.shapes.torus(0.8, 0.2), (-0.3, 0.1, 0.9), (0.9, 0.3, 0.2, 0.2449))
    found = asm.Assembly([base, ball, ring])
    found.constrain(asm.Clearance())
    if given:
        # The ball is the second body of its pair, and the first side here.
        found.constrain(asm.Contact(ball, base))
    for body, goal in ((ball, (0.1, 0.2, 0.9)), (ring, (-0.3, 0.1, 0.4))):
        found.minimize(asm.PointDistance(body.point(0, 0, 0), goal))
    solution = found.solve(max_iterations=60)
    with lent_proof(found.packed(), found.bodies) as proof:
        rows = near_contacts(solution, proof, 10.0)
        monkeypatch.setattr(contacts_nearby, "rows_of_contacts", lambda _: None)
        alone = near_contacts(solution, proof, 10.0)
    assert set(rows) == set(alone) and len(rows) >= 2
    for number, contacts in alone.items():
        for told, expected in zip(rows[number], contacts, strict=True):
            assert told == pytest.approx(expected, abs=1e-10)


def test_contacts_of_a_pair_that_a_proof_has_the_other_way_round():
    """Of a pin and a plate a proof has the plate first, in whose bore the pin fits: normals point from there."""
    pin = asm.Body("pin", asm.shapes.solid_cylinder(0.3, 1.2), (0.1, 0.02, 0.1), (0.99, 0.05, 0.08, 0.0))
    plate = asm.Body("plate", asm.shapes.plate(3.0, 2.0, 0.5, [(0.0, 0.0, 0.5)]), fixed=True)
    found = asm.Assembly([pin, plate])
    found.constrain(asm.Clearance())
    found.minimize(asm.PointDistance(pin.point(0, 0, 0.4), (2.0, 0.3, 0.4)))
    solution = found.solve()
    proof = new_proof(found.packed(), found.bodies)
    assert solution.success and proof.pairs == [(1, 0)]
    (near,) = near_contacts(solution, proof, 1e-3).values()
    # It has come out of the bore, and leans on an edge of the plate from beyond.
    assert len(near.normals) and (near.normals[:, 0] > 0.1).all()
    # Points are those of the second body, the pin.
    offs = (near.places - solution.q[0, :3]) @ rotation_of(solution.q[0, 3:])
    assert np.hypot(offs[:, 0], offs[:, 1]).max() <= 0.3 + 1e-9 and np.abs(offs[:, 2]).max() <= 0.6 + 1e-9


def test_a_least_gap_is_proven():
    solution = scene(BALL, (0.8, 0.1, 0.2), minimum=0.1).solve()
    assert solution.success and solution.proved
    (answer,) = prove_end(solution)
    assert answer.clearance == "gap" and answer.bodies == ("plate", "part") and answer.holds
    assert answer.answer.bound <= 0.1 + 1e-9


def test_touching_at_the_end_is_proven_by_a_move():
    """Drawn against the box: there is a contact, and its gap is opened."""
    found = scene(BALL, (1.2, 0.1, 0.2))
    found.minimize(asm.PointDistance(found.bodies[1].point(0, 0, 0), (0.9, 0.1, 0.2)))
    solution = found.solve()
    assert solution.success and solution.proved
    assert solution.q[1, 0] == pytest.approx(1.0, abs=1e-9)
    (pair,) = prove_end(solution)
    assert pair.answer.verdict in (Verdict.TOUCHING, Verdict.CLEAR) and pair.proved
    packed = found.packed()
    with lent_proof(packed, found.bodies) as proof:
        near = near_contacts(solution, proof, 1e-3)
        assert list(near) == [0]
        assert near[0].normals[0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
        move = opening_move(proof, 0, solution.q, near[0], 1e-6)
        assert move[0] > 0.0 and np.linalg.norm(move) < 1e-6
        assert not opening_move(proof, 0, solution.q, near[0], 0.0).any()
        assert not opening_move(proof, 0, solution.q, None, 1e-6).any()
    # It is given back.
    assert len(packed.proofs) >= 1


def test_a_pair_is_looked_at_as_the_clearance_asks():
    found = scene(BALL, (2.0, 0.0, 0.0), minimum=0.25)
    made = new_proof(found.packed(), found.bodies)
    assert made.pairs in ([(0, 1)], [(1, 0)]) and made.minimum.tolist() == [0.25]


def test_random_solves_say_what_is_so(cases):
    """Where it is proven the judge finds none in the other; where not, it is not SOLVED, or samples stand for it."""
    for number in range(cases(6, 500)):
        begin = start_of(number)
        solution = scene_of(begin).solve(max_iterations=0 if number % 2 else 200)
        seen = Motion.of(solution.q[1]).seen_from(Motion.of(solution.q[0]))
        depth = crossing_depth(begin.a, begin.b, seen) / begin.size
        if solution.proved:
            assert solution.success and depth <= 1e-9, begin
        if depth > 1e-9:
            assert not solution.success and not solution.proved, begin
            assert solution.feasibility > 0.0 and "a and b" in solution.message


def test_what_opened_contacts_elsewhere_is_no_proof_of_more_than_touching():
    """A proof is kept from solve to solve, with its moves: one that was allowed more is not to be taken."""
    floor = asm.Body("floor", asm.shapes.box(4.0, 4.0, 1.0), fixed=True)
    block = asm.Body("block", asm.shapes.box(1.0, 1.0, 1.0), position=(0.0, 0.0, 1.0))
    scene = asm.Assembly([floor, block])
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    touching = solution._touching * solution._packed.scale
    with lent_proof(solution._packed, scene.bodies) as proof:
        proof.look(solution.q, touching, np.array([[0.0, 0.0, 0.5 * touching, 0.0, 0.0, 0.0]]))
    proof.moves[:] = [0.0, 0.0, 1e-3, 0.0, 0.0, 0.0]
    (pair,) = prove_end(solution)
    assert pair.proved and pair.answer.depth <= touching


def test_what_leans_as_far_as_its_bore_lets_it_is_proven_to_touch():
    """It touches opposite sides at its ends; as ellipses both ends have room beside that, which balls have not."""
    plate = asm.Body("plate", asm.shapes.plate(60, 60, 40, [(0, 0, 18.0)]), fixed=True)
    disc = asm.Body("disc", asm.shapes.solid_cylinder(17.998, 20.0), (0.001, 0.0, 0.3))
    scene = asm.Assembly([plate, disc])
    scene.constrain(asm.Clearance())
    scene.minimize(
        asm.PointDistance(disc.point(0, 0, 10), (3, 0, 10)), asm.PointDistance(disc.point(0, 0, -10), (-3, 0.5, -10))
    )
    solution = scene.solve()
    assert solution.success and solution.proved
    # Its play of 0.004 over its height: so far it leans.
    assert 2.0 * np.hypot(*solution.q[1, 4:6]) == pytest.approx(0.004 / 20.0, rel=0.01)


@pytest.mark.parametrize("thicker", [0.0, 1e-6])
def test_a_shaft_that_fills_its_bore_is_proven_to_touch(thicker):
    """No move opens the bore; made slimmer by what is called touching the shaft is clear. A thicker one is not."""
    plate = asm.Body("plate", asm.shapes.plate(4.0, 3.0, 1.0, [(0.3, 0.1, 0.5)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(0.5 + thicker, 2.0), (0.3, 0.1, 0.2))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Clearance())
    solution = scene.solve(max_iterations=0) if thicker else scene.solve()
    assert solution.proved == (thicker == 0.0)
    if not thicker:
        assert solution.success and np.array_equal(solution.q, scene.q)
        assert [pair.answer.verdict for pair in solution._clear] == [Verdict.TOUCHING]
