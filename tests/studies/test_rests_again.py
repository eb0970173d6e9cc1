"""Solves that go on from bodies at rest, rest beside what is in the way, and what is put straight in its bore."""

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.solve.clearance_proof import new_proof
from assembly.solve.interruption import CTRL_C
from assembly.solve.start_proof import prove_start
from assembly.studies.resting import Rest, beside_others, resting
from tests.studies.machined import bolt

CORNERS = ((9.0, 9.0), (-9.0, 9.0), (9.0, -9.0), (-9.0, -9.0))


def slab_on_a_table(*others, at=(0.3, -0.2, 6.9)):
    """A slab that four points draw 3 into a table, a little crooked at the start; and those points."""
    table = asm.Body("table", asm.shapes.box(80, 60, 10), fixed=True)
    slab = asm.Body("slab", asm.shapes.box(20, 20, 4), at, (0.9998, 0.01, -0.012, 0.0))
    scene = asm.Assembly([table, slab, *others])
    scene.constrain(asm.Clearance())
    drawn = [asm.PointDistance(slab.point(x, y, -2.0), (x, y, 2.0)) for x, y in CORNERS]
    scene.minimize(*drawn)
    return scene, drawn


def draw_to(drawn, x, y, z):
    for point, (u, v) in zip(drawn, CORNERS, strict=True):
        point.target = (u + x, v + y, z)


def test_what_rests_stays_to_the_bit_and_lists_no_contact():
    scene, _ = slab_on_a_table()
    first = scene.solve()
    again = scene.solve(first)
    assert first.success and again.success and again.proved and again.iterations == 0
    assert first._lists is not None and again._lists is not None
    assert np.array_equal(again.q, first.q)
    assert again.objective == pytest.approx(4 * 9.0, rel=1e-12)
    # They are listed when they are asked for.
    assert len(again.contacts) >= 3


def test_what_rests_follows_its_points():
    """Random places on the table: the slab is where they are, 3 above them, and contacts need not be listed."""
    rng, (scene, drawn) = np.random.default_rng(2), slab_on_a_table()
    solution = scene.solve()
    for _ in range(6):
        x, y = rng.uniform(-10, 10, 2)
        draw_to(drawn, x, y, 2.0)
        solution = scene.solve(solution)
        assert solution.success and solution.proved and solution._lists is not None
        # Solves are stationary to 1e-10 of slopes, over lengths of 100.
        assert solution.q[1] == pytest.approx([x, y, 7.0, 1, 0, 0, 0], abs=1e-8)


def test_what_is_drawn_off_is_let_go():
    scene, drawn = slab_on_a_table()
    solution = scene.solve()
    draw_to(drawn, 1.0, 0.0, 9.0)
    solution = scene.solve(solution)
    assert solution.success and solution.objective < 1e-16
    assert solution.q[1, :3] == pytest.approx([1.0, 0.0, 11.0], abs=1e-8)
    draw_to(drawn, 1.0, 0.0, 2.0)
    solution = scene.solve(solution)
    assert solution.success and solution.q[1] == pytest.approx([1.0, 0, 7.0, 1, 0, 0, 0], abs=1e-8)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_others_in_the_way_are_leaned_on(side):
    """A ball of radius 5 lies on the table: the slab, drawn along the table through it, comes to touch it."""
    ball = asm.Body("ball", asm.shapes.sphere(5.0), (20.0 * side, 0.0, 10.0), fixed=True)
    scene, drawn = slab_on_a_table(ball)
    draw_to(drawn, 12.0 * side, 0.0, 2.0)
    # The ball's middle is 1 over the slab's top edge, which is at 9.
    x = 20.0 * side - side * (10.0 + np.sqrt(25.0 - 1.0))
    rest = resting_of(scene)
    assert isinstance(rest, Rest)
    q = np.array(scene.q)
    found = beside_others(scene, rest, q, q, scene._settings({}, CTRL_C, warm=False), None, CTRL_C)
    for solution in (found, scene.solve()):
        assert solution.success and solution.proved
        assert solution.q[1] == pytest.approx([x, 0.0, 7.0, 1, 0, 0, 0], abs=1e-7)


@pytest.mark.parametrize(
    ("shape", "at", "far", "end"),
    [
        (asm.shapes.sphere(5.0), (20.0, 0.0, 10.0), 6.0, 10.0 - np.sqrt(24.0)),
        (asm.shapes.sphere(5.0), (20.0, 0.0, 10.0), 12.0, 10.0 - np.sqrt(24.0)),
        (asm.shapes.box(1, 60, 30), (15.0, 0.0, 20.0), 6.0, 4.5),
        (asm.shapes.box(1, 60, 30), (15.0, 0.0, 20.0), 28.0, 4.5),
    ],
)
def test_what_rests_is_drawn_against_others(shape, at, far, end):
    """A solve goes on from rest to where a ball or a wall is in the way, however hard it is drawn against that.

    Drawn far, the loop alone stays at one multiplier for all of its steps.
    """
    scene, drawn = slab_on_a_table(asm.Body("other", shape, at, fixed=True))
    solution = scene.solve()
    draw_to(drawn, far, 0.0, 2.0)
    solution = scene.solve(solution)
    assert solution.success and solution.proved
    assert solution.q[1] == pytest.approx([end, 0.0, 7.0, 1, 0, 0, 0], abs=1e-7)


def resting_of(scene):
    """How bodies of a scene rest, whatever is in their way."""
    packed, q = scene.packed(), np.array(scene.q)
    settings = scene._settings({}, CTRL_C, warm=False)

    def prove(state, touching):
        return prove_start(packed, scene.bodies, state, touching)

    return resting(scene, q, q, prove, settings, None, CTRL_C)


def test_a_bolt_that_leans_more_than_its_play_is_put_straight():
    """Its axis is that of the hole after no iteration of a loop with clearances; the least move along it is kept."""
    plate = asm.Body("plate", asm.shapes.plate(40, 40, 10, [(0, 0, 4.1)]), fixed=True)
    screw = asm.Body("screw", bolt(4, 30, 6.5, 8), (0.2, -0.3, 12.0), (0.998, 0.04, -0.03, 0.02))
    scene = asm.Assembly([plate, screw])
    scene.constrain(asm.Clearance())
    joints = asm.Assembly([plate, screw])
    joints.constrain(asm.Cylindrical(plate.frame(), screw.frame()))
    solution, there = scene.solve(), joints.solve()
    assert solution.success and solution.proved and solution.iterations == 0
    assert solution.q == pytest.approx(there.q, abs=1e-10)
    # The move is that from where the user had put it.
    assert solution.objective == pytest.approx(there.objective, rel=1e-9)
    assert solution.objective > 0.1


def test_what_touches_as_it_stands_is_told_without_a_move():
    """By hulls: a look alone leaves flush faces open."""
    scene, _ = slab_on_a_table(at=(0.0, 0.0, 7.0))
    q = np.array(scene.q)
    q[1, 3:] = [1.0, 0.0, 0.0, 0.0]
    proof = new_proof(scene.packed(), scene.bodies)
    assert [answer.verdict for answer in proof.look(q, 1e-7)] == [Verdict.UNDECIDED]
    (answer,) = proof.as_they_stand(q, 1e-7)
    assert answer.verdict is Verdict.TOUCHING and answer.depth <= 1e-7
    q[1, 2] -= 1e-3
    assert proof.as_they_stand(q, 1e-7)[0].verdict is Verdict.CROSSING
