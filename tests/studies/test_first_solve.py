"""First solves under clearances: rows alone where nothing hinders, scenes that are packed once, ends told by hulls."""

from __future__ import annotations

from copy import copy

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hulls import scene as hull_scene
from assembly.proximity.clearance.hulls.scene import HullAnswers
from assembly.proximity.clearance.proof import SHORT
from assembly.solve.clearance_proof import hull_answers, lent_proof
from assembly.solve.start_proof import prove_way
from benchmarks.center_lines import torus_wire
from benchmarks.hands import TAUT, linked_rings
from benchmarks.wire_oracle import WireOracle

ACROSS = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def rings(target, touching=True):
    """Two rings of radius 1 and thickness 0.1 through each other that are to touch or not, one drawn to a target."""
    a = asm.Body("a", asm.shapes.torus(1.0, 0.1), fixed=True)
    b = asm.Body("b", asm.shapes.torus(1.0, 0.1), (1.0, 0.1, 0.05), ACROSS)
    scene = asm.Assembly([a, b])
    scene.constrain(*[asm.Contact(a, b)] * touching, asm.Clearance())
    scene.minimize(asm.PointDistance(b.point(1.0, 0.0, 0.0), target))
    return scene


def test_where_nothing_hinders_rows_alone_are_proven_with_their_way():
    scene = rings((2.1, 0.2, 0.1))
    solution = scene.solve()
    # No contact of the clearance was searched for it, and no other scene was packed.
    assert solution.success and solution.proved and solution._lists is not None and not scene._parts
    assert all(pair.answer.swept for pair in solution._clear)
    assert not solution.put_together
    oracle = WireOracle([torus_wire(1.0, 0.1)] * 2)
    assert oracle.links(solution.q)[0] == oracle.links(np.array(scene.q))[0] != 0
    assert oracle.deepest(solution.q) > -1e-9


def test_from_what_touches_no_way_is_sought():
    lower = asm.Body("lower", asm.shapes.plate(80, 50, 10, [(-25, 0, 4.5), (25, 0, 4.5)]), fixed=True)
    upper = asm.Body("upper", asm.shapes.plate(60, 40, 10, [(-20, 0, 4.5)]), (5, 3, 10))
    scene = asm.Assembly([lower, upper])
    scene.constrain(asm.Clearance())
    q = np.array([[0, 0, 0, 1, 0, 0, 0], [5, 3, 10, 1, 0, 0, 0]], dtype=float)
    ahead = q + [[0.0] * 7, [0, 0, 0.5, 0, 0, 0, 0]]
    assert prove_way(scene.packed(), scene.bodies, q, ahead.ravel(), 1e-9, may_jump=False) is None
    # Hulls tell that the bodies touch, so that no cells were made.
    assert not scene.packed().proofs
    with lent_proof(scene.packed(), scene.bodies) as proof:
        # A look at what touches spent its whole budget.
        proof.as_they_stand(q, 1e-9)
        assert 0 < proof.fronts.counts.sought.max() <= 2 * SHORT
    # From what is clear it is proven.
    q[1, 2] += 0.01
    assert prove_way(scene.packed(), scene.bodies, q, ahead.ravel(), 1e-9, may_jump=False) is not None


def test_rows_that_lead_through_the_other_ring_are_not_taken():
    """Drawn away the rings come apart without the clearance, at a lower objective, and nothing crosses there."""
    scene = rings((7.0, 0.2, 0.1), touching=False)
    oracle = WireOracle([torus_wire(1.0, 0.1)] * 2)
    solution = scene.solve(keep_topology=True)
    assert oracle.links(solution.q)[0] == oracle.links(np.array(scene.q))[0] != 0
    apart = scene._part(False, True).solve()
    assert apart.success and oracle.links(apart.q)[0] == 0 and oracle.deepest(apart.q) > 0.1
    assert apart.objective < 1e-9 < solution.objective


def test_scenes_that_solves_begin_with_are_packed_once_and_forgotten_with_the_scene():
    """Three rings drawn out of reach: constraints are solved first, without the objective."""
    taut = linked_rings(6, TAUT)
    scene, q = taut.drag.scene, taut.q[5]
    taut.drag.grip.target = taut.targets[5]
    scene.constrain(asm.Clearance())
    first = scene.solve(q)
    parts = dict(scene._parts)
    packed = {key: part.packed() for key, part in parts.items()}
    # What was solved before does not matter.
    scene.solve(first)
    second = scene.solve(q)
    assert parts and scene._parts == parts and all(parts[key].packed() is packed[key] for key in parts)
    assert np.array_equal(first.q, second.q) and first.status is second.status
    assert not copy(scene)._parts
    scene.constrain(asm.Clearance(name="another"))
    assert not scene._parts


def test_a_scene_without_clearances_has_values_of_now():
    """Rows of the kept scenes are those of the same constraints, whose values may be set anew."""
    scene = rings((2.1, 0.2, 0.1))
    part = scene._part(False, True)
    assert scene._part(False, True) is part
    ((_, grip),) = scene.objectives
    for target in ((2.1, 0.2, 0.1), (2.0, 0.4, 0.2)):
        grip.target = np.array(target)
        assert part.solve().objective == pytest.approx(scene.solve().objective, abs=1e-12)


def test_hulls_tell_of_some_pairs():
    """A block on a plate, and one in it: of the latter hulls tell nothing."""
    plate, block = (asm.shapes.box(4, 4, 1), asm.shapes.box(1, 1, 1))
    shapes = [tuple(asm.Body("shape", shape).faces) for shape in (plate, block, block)]
    shapes = [tuple(face.face for face in faces) for faces in shapes]
    q = np.array([[0.0, 0, 0, 1, 0, 0, 0], [-1.0, 0, 1.0, 1, 0, 0, 0], [1.0, 0, 0.8, 1, 0, 0, 0]])
    answers = HullAnswers(shapes, [(0, 1), (0, 2), (1, 2)], [0.0, 0.0, 0.0], q, 1e-8)
    touches, crosses, apart = map(answers.held, range(3))
    assert touches.verdict in (Verdict.TOUCHING, Verdict.CLEAR) and crosses is None
    assert apart.verdict is Verdict.CLEAR and 0.0 < apart.bound <= 1.0


def overlapping_boxes(*constraints):
    """A box that has sunk into another one by a part of its height, and is tilted."""
    lower = asm.Body("lower", asm.shapes.box(20, 20, 4), fixed=True)
    upper = asm.Body("upper", asm.shapes.box(8, 6, 4), (1.0, 0.5, 3.6), (0.9999, 0.01, 0.005, 0.0))
    scene = asm.Assembly([lower, upper])
    scene.constrain(asm.Clearance(), *(constraint(lower, upper) for constraint in constraints))
    return scene


@pytest.mark.parametrize(
    "constraints",
    [(), (lambda a, b: asm.Planar(a.frame((0, 0, 2)), b.frame((0, 0, -2))),)],
    ids=["alone", "with joint"],
)
def test_where_hulls_tell_of_the_start_and_of_the_end_no_cells_are_made(constraints):
    scene = overlapping_boxes(*constraints)
    solution = scene.solve()
    assert solution.success and solution.proved
    assert not scene.packed().proofs


def test_of_equal_poses_hulls_are_asked_once(monkeypatch):
    asked = []

    def counted(one, other, least, touching, told=hull_scene.answer_by_hulls):
        asked.append(other.points.tobytes())
        return told(one, other, least, touching)

    monkeypatch.setattr(hull_scene, "answer_by_hulls", counted)
    scene = overlapping_boxes()
    assert scene.solve().success
    assert len(asked) == len(set(asked)) > 1
    # Another tolerance, or least gap, is another question.
    q, touching = np.array(scene.q), 1e-9
    first = hull_answers(scene.packed(), scene.bodies, q, touching)
    assert hull_answers(scene.packed(), scene.bodies, q.copy(), touching) is first
    assert hull_answers(scene.packed(), scene.bodies, q, 2.0 * touching) is not first
    scene.constraints[0].minimum = 0.1
    assert hull_answers(scene.packed(), scene.bodies, q, touching) is not first
