"""A start that holds is returned as it is, to the bit, with no manager packed, and so no update; others are solved.

What such a solution says is what the loop says of it, which is asked for the same scene past the check.
"""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle
from assembly.proximity.clearance.forest import PackedForest
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import answers_at, owned_pairs
from assembly.solve.interruption import CTRL_C
from assembly.studies.first_solve import first_solve
from tests.studies.machined import bolt, socket

TOUCHING = 1e-9
PLATE = asm.shapes.plate(60, 40, 10, [(0, 0, 4.5)])
TIGHT = asm.shapes.plate(60, 40, 12, [(8, 0, 4.0)])
BLOCK = asm.shapes.box(60, 40, 10)


def made(shapes, places, constraints):
    """A scene of shapes by name, the first of which is fixed; places are positions and perhaps quaternions."""
    bodies = {
        name: asm.Body(name, shape, *place, fixed=k == 0)
        for k, ((name, shape), place) in enumerate(zip(shapes.items(), places, strict=True))
    }
    scene = asm.Assembly(list(bodies.values()))
    scene.constrain(*constraints(bodies))
    return scene


def flush_plates(off=0.0, **clearance):
    return made(
        {"lower": PLATE, "upper": asm.shapes.plate(60, 40, 10, [(0, 0, 4.5)])},
        [((0, 0, 0),), ((5, 3, 10 + off),)],
        lambda b: [
            asm.Planar(b["lower"].frame((0, 0, 5)), b["upper"].frame((0, 0, -5)), "flush", offset=off),
            asm.Clearance(name="gap", **clearance),
        ],
    )


def bolted():
    return made(
        {"lower": PLATE, "upper": PLATE, "bolt": bolt(4, 30, 6.5, 8)},
        [((0, 0, 0),), ((0, 0, 10),), ((0, 0, 15),)],
        lambda b: [
            asm.Planar(b["lower"].frame((0, 0, 5)), b["upper"].frame((0, 0, -5)), "flush"),
            asm.Cylindrical(b["lower"].frame(), b["bolt"].frame(), "axis", slide=15.0),
            asm.Planar(b["upper"].frame((0, 0, 5)), b["bolt"].frame(), "seat"),
            asm.Clearance(name="gap"),
        ],
    )


def alone(first, second, *place):
    return made({"first": first, "second": second}, [((0, 0, 0),), place], lambda _: [asm.Clearance(name="gap")])


LYING = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)
SCENES = {
    "plates": flush_plates,
    "bolted": bolted,
    "a least gap": lambda: flush_plates(0.5, minimum=0.5),
    "a pin that fills its bore": lambda: alone(TIGHT, asm.shapes.solid_cylinder(4, 40), (8, 0, 4)),
    "a ball in its socket": lambda: alone(socket(10, 18, 16), asm.shapes.sphere(10), (0, 0, 0)),
    "a cylinder on a block": lambda: alone(BLOCK, asm.shapes.solid_cylinder(4, 30), (3, 2, 9), LYING),
    "a ball on a block": lambda: alone(BLOCK, asm.shapes.sphere(4), (3, 2, 9)),
    "far apart": lambda: alone(BLOCK, asm.shapes.sphere(4), (3, 2, 90)),
    "a contact": lambda: made(
        {"block": BLOCK, "ball": asm.shapes.sphere(4)},
        [((0, 0, 0),), ((3, 2, 9),)],
        lambda b: [asm.Contact(b["block"].face("top"), b["ball"].faces[0], "touch"), asm.Clearance(name="gap")],
    ),
}


def is_unlisted(scene, solution):
    """Whether nobody packed a contact manager, without which there are no updates."""
    return solution._lists is not None and scene.packed()._unwritten is not None


def by_the_loop(scene):
    """The solution that a first solve finds without the check."""
    settings = scene._settings({}, CTRL_C, warm=False)
    return first_solve(scene, scene.q, settings, None, {}, CTRL_C)


def told(solution):
    """What a solution says, arrays as lists."""
    return {
        "status": solution.status,
        "proved": solution.proved,
        "q": solution.q.tolist(),
        "iterations": solution.iterations,
        "history": solution.history.tolist(),
        "objective": solution.objective,
        "stationarity": solution.stationarity,
        "violations": solution.violations,
        "multipliers": {name: values.tolist() for name, values in solution.multipliers.items()},
        "values": solution.values,
        "message": solution.message,
        "second_order": solution.second_order,
        "put_together": solution.put_together,
        "freedoms": solution.mobility.dof,
        "contacts": {
            name: (contact.gap, contact.points.tolist(), contact.normal.tolist(), contact.features)
            for name, contact in solution.contacts.items()
        },
    }


@pytest.mark.parametrize("name", SCENES)
def test_a_start_that_fits_comes_back_to_the_bit_without_an_update(name):
    scene = SCENES[name]()
    for _ in range(2):
        solution = scene.solve()
        assert solution.status is asm.Status.SOLVED and solution.proved
        assert (solution.q == scene.q).all()
        assert solution.iterations == 0 and len(solution.history) == 1
        assert is_unlisted(scene, solution)


@pytest.mark.parametrize("name", SCENES)
def test_it_says_what_the_loop_says(name):
    assert told(SCENES[name]().solve()) == told(by_the_loop(SCENES[name]()))


def test_contacts_are_listed_when_they_are_asked_for():
    scene = flush_plates()
    solution = scene.solve()
    assert is_unlisted(scene, solution)
    gaps = [contact.gap for contact in solution.contacts.values()]
    assert solution._lists is None
    # Three hold a plane; nothing is in anything else.
    assert sum(abs(gap) < 1e-12 * 60 for gap in gaps) >= 3 and min(gaps) > -1e-12 * 60


def test_what_goes_on_from_it_goes_on_from_its_contacts():
    ends = []
    for solve in (asm.Assembly.solve, by_the_loop):
        scene = flush_plates()
        first = solve(scene)
        scene.constraints[0].offset = 0.5
        ends.append(scene.solve(first))
    # The one by rows alone, the other with contacts: rows hold to 2e-13 of the size, some hundred.
    assert ends[0].q == pytest.approx(ends[1].q, abs=1e-10)
    assert ends[0].status is ends[1].status and len(ends[0].contacts) == len(ends[1].contacts)


def test_a_solve_from_it_moves_where_values_are_others():
    scene = flush_plates()
    first = scene.solve()
    again = scene.solve(first)
    assert (again.q == first.q).all() and is_unlisted(scene, again)
    scene.constraints[0].offset = 2.0
    moved = scene.solve(first)
    assert moved.success and moved.proved and abs(moved.q[1, 2] - 12.0) < 1e-9
    # What it was solved with stays what it was.
    assert first.violations["flush"] < 1e-12 * 60


def test_it_can_be_read_after_its_scene_has_changed():
    """Another constraint of the scene is none of the solution's; of rows that went there are none to be listed with."""
    scene, told_before = flush_plates(), told(flush_plates().solve())
    solution = scene.solve()
    scene.constrain(asm.PointOnPlane(scene.bodies[1].point(0, 0, 0), scene.bodies[0].frame((0, 0, 10)), name="more"))
    assert told(solution) == told_before
    scene, other = bolted(), bolted().solve()
    solution = scene.solve()
    scene.constraints[1].slide = None
    assert solution.contacts and solution.contacts.keys() <= other.contacts.keys()


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda solution: pickle.loads(pickle.dumps(solution))])
def test_copies_list_the_same_contacts(copied):
    solution = flush_plates().solve()
    other = copied(solution)
    assert other._lists is not None
    assert told(other) == told(solution)


@pytest.mark.parametrize("off", [1e-3, -1e-3])
def test_a_start_at_which_a_joint_is_off_is_solved(off):
    scene = flush_plates()
    scene.bodies[1].pose = asm.Pose((5.0, 3.0, 10.0 + off))
    solution = scene.solve()
    assert solution.success and solution.proved
    assert abs(solution.q[1, 2] - 10.0) < 1e-9


@pytest.mark.parametrize("deep", [3.0 * TOUCHING * 60, 1e-6, 0.05])
def test_a_start_that_crosses_is_parted(deep):
    scene = alone(BLOCK, asm.shapes.box(30, 20, 10), (3, 2, 10 - deep))
    solution = scene.solve()
    assert solution.success and solution.proved and not (solution.q == scene.q).all()
    assert solution.q[1, 2] > 10.0 - TOUCHING * scene.packed().scale


def test_a_start_that_is_in_by_what_touching_is_stays():
    scene = alone(BLOCK, asm.shapes.box(30, 20, 10), (3, 2, 10 - 0.2 * TOUCHING * 60))
    solution = scene.solve()
    assert solution.success and solution.proved and (solution.q == scene.q).all()


def test_a_start_within_a_least_gap_is_moved():
    scene = made(
        {"block": BLOCK, "ball": asm.shapes.sphere(4)},
        [((0, 0, 0),), ((3, 2, 9.1),)],
        lambda _: [asm.Clearance(name="gap", minimum=0.3)],
    )
    solution = scene.solve()
    assert solution.success and solution.q[1, 2] >= 9.3 - 1e-7


def test_beside_a_contact_rows_keep_a_least_gap():
    scene = made(
        {"block": BLOCK, "ball": asm.shapes.sphere(4)},
        [((0, 0, 0),), ((3, 2, 9),)],
        lambda b: [asm.Contact(b["block"].face("top"), b["ball"].faces[0]), asm.Clearance(name="gap", minimum=0.3)],
    )
    solution = scene.solve()
    assert solution.success and not solution.proved and solution._lists is None


def test_an_objective_asks_to_move():
    scene = flush_plates()
    body = scene.bodies[1]
    scene.minimize(asm.PointDistance(body.point(0, 0, 0), (0.0, 0.0, 10.0)))
    solution = scene.solve()
    assert solution.success and np.abs(solution.q[1, :3] - [0.0, 0.0, 10.0]).max() < 1e-6


def test_of_several_starts_each_is_measured_from_the_bodies():
    scene = alone(BLOCK, asm.shapes.sphere(4), (3, 2, 90))
    found = scene.solve_all(starts=4)
    assert len(found) == 1 and (found[0].q == scene.q).all()


def test_callbacks_and_limits_end_nothing_that_holds():
    solution = flush_plates().solve(time_limit=60.0, callback=lambda *_: None)
    assert solution.success and solution.proved


def test_only_pairs_of_which_hulls_do_not_tell_are_looked_at(monkeypatch):
    """One pair that they leave open had all others looked at, and of some it was not proven what hulls told."""
    arch = asm.shapes.revolution(circle(2.0, (10.0, 0.0)), 0.9 * np.pi)
    bodies = [
        asm.Body("floor", asm.shapes.plate(60, 60, 10, [(0, 0, 4.0)]), fixed=True),
        asm.Body("pin", asm.shapes.solid_cylinder(4.0, 30), position=(0, 0, 8)),
        asm.Body("arch", arch, position=(0, 0, 12)),
        asm.Body("block", asm.shapes.box(10, 10, 10), position=(20, 20, 10)),
    ]
    scene, looked, look, celled, forest = asm.Assembly(bodies), set(), ClearanceProof.look, [], PackedForest.__init__

    def made(trees, shapes):
        celled.append(len(shapes))
        forest(trees, shapes)

    scene.constrain(asm.Clearance())

    def seen(proof, q, touching, moves=None, which=None, *args, **more):
        looked.update(proof.pairs[k] for k in (range(len(proof.pairs)) if which is None else which))
        return look(proof, q, touching, moves, which, *args, **more)

    # Planes along the pin through corners of the arch's hulls would tell of these two as well.
    monkeypatch.setattr("assembly.proximity.clearance.hulls.pair.BESIDE", 0)
    monkeypatch.setattr(ClearanceProof, "look", seen)
    monkeypatch.setattr(PackedForest, "__init__", made)
    solution = scene.solve()
    assert solution.iterations == 0 and solution.proved
    assert looked == {(1, 2)} or looked == {(2, 1)}
    # Cells were made of all bodies.
    assert celled == [2]
    assert [pair.bodies for pair in solution._clear] == [
        (a.name, b.name) for _, (a, b), _ in owned_pairs(scene.packed())
    ]
    # Whoever asks again at the same poses finds what was looked at.
    touching = 1e-6
    first = answers_at(scene.packed(), scene.bodies, solution.q, touching)
    looked.clear()
    assert answers_at(scene.packed(), scene.bodies, solution.q, touching) == first
    assert not looked and celled == [2, 2]
