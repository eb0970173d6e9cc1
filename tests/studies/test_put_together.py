"""First solves under clearances from where joints do not hold: put together first or last, or never."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.studies.first_solve import _FirstSolve
from assembly.studies.put_together import put_together
from assembly.studies.unhindered import rows_from_start
from tests.studies.machined import bolt, disturbed, turned_part

# [length] What holds to 1e-12 of some hundred.
HOLDS = 1e-9
ACROSS = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def bolted(rng=None):
    """Two plates and a bolt, exploded, with joints; which body is where is known."""
    plate = asm.shapes.plate(60, 40, 10, [(0, 0, 4.5)])
    homes = {"lower": (0, 0, 0), "upper": (0, 0, 10), "bolt": (0, 0, 15)}
    away = {"lower": (0, 0, 0), "upper": (20, 5, 60), "bolt": (-10, 0, -90)}
    shapes = {"lower": plate, "upper": plate, "bolt": bolt(4, 30, 6.5, 8)}
    bodies = {}
    for name, home in homes.items():
        pose = np.r_[np.add(home, away[name]), 1.0, 0.0, 0.0, 0.0]
        if rng is not None and name != "lower":
            pose = disturbed(rng, pose, 3.0, 0.15)
        bodies[name] = asm.Body(name, shapes[name], pose[:3], pose[3:], fixed=name == "lower")
    lower, upper, screw = bodies.values()
    scene = asm.Assembly(list(bodies.values()))
    scene.constrain(
        asm.Planar(lower.frame((0, 0, 5)), upper.frame((0, 0, -5)), "flush"),
        asm.Cylindrical(lower.frame(), screw.frame(), "axis"),
        asm.Cylindrical(upper.frame(), screw.frame(), "upper axis"),
        asm.Planar(upper.frame((0, 0, 5)), screw.frame(), "seat"),
        asm.Clearance(),
    )
    return scene


def linked(off, apart=False):
    """Two rings of radius 1 and thickness 0.1, through each other; a joint leads one of them away."""
    a = asm.Body("a", asm.shapes.torus(1.0, 0.1), fixed=True)
    b = asm.Body("b", asm.shapes.torus(1.0, 0.1), (1.0, 0.0, 0.0), ACROSS)
    scene = asm.Assembly([a, b])
    to = (1.0 + off, 0.0, 0.0) if apart else (1.0, 0.0, off)
    scene.constrain(asm.Spherical(a.point(*to), b.point(0, 0, 0), "lead"), asm.Clearance())
    return scene


def asked(scene, q=None, interruption=CTRL_C, **options):
    """What a first solve would put together, from the bodies' own poses or others."""
    q = np.array(scene.q) if q is None else q
    alone = rows_from_start(scene, q, scene._settings(options, CTRL_C, warm=False), None, CTRL_C)
    return put_together(scene, q, alone, None, options, interruption)


def passes_through(solution):
    """Whether the second ring's center line goes through the disc of the first one: linked, by crossings of a plane."""
    turn, place = Rotation.from_quat(solution.q[1, 3:], scalar_first=True), solution.q[1, :3]
    angle = np.linspace(0.0, 2.0 * np.pi, 4001)
    line = turn.apply(np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])) + place
    cuts = np.flatnonzero(np.sign(line[1:, 2]) != np.sign(line[:-1, 2]))
    return sum(np.hypot(*line[k, :2]) < 1.0 for k in cuts) % 2 == 1


def test_exploded_parts_with_joints_are_put_together(cases):
    rng = np.random.default_rng(1)
    for _ in range(cases(1, 20)):
        scene = bolted(rng)
        solution = scene.solve()
        assert solution.success and solution.put_together, solution.message
        for name, height in (("upper", 10.0), ("bolt", 15.0)):
            pose = solution.pose(name)
            up = Rotation.from_quat(pose.quaternion, scalar_first=True).apply([0.0, 0.0, 1.0])
            assert pose.position == pytest.approx([0.0, 0.0, height], abs=HOLDS)
            assert up == pytest.approx([0.0, 0.0, 1.0], abs=HOLDS)
    assert np.array_equal(scene.solve().q, solution.q)


def test_where_parts_touch_in_the_end_no_way_there_is_sought():
    """A way ends where all are clear: cells were made to look for it, and for planes between the parts."""
    scene = bolted()
    solution = scene.solve()
    assert solution.success and solution.put_together and solution.proved
    assert not scene.packed().proofs


def test_what_holds_is_returned_as_it_is():
    scene = bolted()
    home = scene.solve()
    again = scene.solve(home.q)
    assert again.success and not again.put_together
    assert np.array_equal(again.q, home.q)


def test_with_keep_topology_a_bolt_stays_on_its_side():
    """Its joints are on the other side of both plates, whose holes its head does not fit: nothing leads there."""
    solution = bolted().solve(keep_topology=True)
    assert not solution.put_together and not solution.success


@pytest.mark.parametrize("off", [0.05, 0.2])
@pytest.mark.parametrize("keep_topology", [False, True])
def test_rings_that_are_linked_stay_linked(off, keep_topology):
    scene = linked(off)
    solution = scene.solve(keep_topology=keep_topology)
    assert solution.success and not solution.put_together
    assert passes_through(solution)
    assert solution.q[1, :3] == pytest.approx([1.0, 0.0, off], abs=HOLDS)


@pytest.mark.parametrize("off", [1.6, 2.5])
def test_rings_come_apart_where_they_may_alone(off):
    """Linked, the other ring's center is within 1.8 of this one's; 1.6 farther is where bodies count as scattered."""
    free, kept = linked(off, True).solve(), linked(off, True).solve(keep_topology=True)
    assert free.success and free.put_together and not passes_through(free)
    assert not kept.success and not kept.put_together and passes_through(kept)


def test_it_is_tried_last_where_bodies_are_clear_and_not_all_parted_by_planes():
    near, far = linked(0.05), bolted()
    for scene, keeps in ((near, True), (linked(2.0, True), True), (far, False)):
        together = asked(scene)
        assert together.keeps_topology == keeps
    assert asked(near, keep_topology=True) is None


def test_it_is_tried_first_from_a_start_that_crosses():
    """Near, but in each other: there is no topology to keep."""
    scene = linked(0.05)
    q = np.array(scene.q)
    for x, keeps in ((0.9, True), (1.85, False)):
        q[1, 0] = x
        a, b = scene.bodies
        near = asm.Assembly([a, b])
        near.constrain(asm.Spherical(a.point(x + 0.01, 0.0, 0.0), b.point(0, 0, 0), "lead"), asm.Clearance())
        assert asked(near, q).keeps_topology == keeps


def test_there_is_none_where_joints_hold_or_cannot():
    scene = linked(0.0)
    assert asked(scene) is None
    scene.constrain(asm.Distance(scene.bodies[0].point(0, 0, 0), scene.bodies[1].point(0, 0, 0), 3.0, "contradiction"))
    assert asked(scene).there is None
    ball = asm.Body("ball", asm.shapes.sphere(0.1), (0.0, 0.0, 3.0))
    alone = asm.Assembly([scene.bodies[0], ball])
    alone.constrain(asm.Clearance())
    assert asked(alone) is None


def test_where_time_is_over_there_is_none():
    scene = bolted()
    assert asked(scene, interruption=Interruption(1e-9)) is None


@pytest.mark.parametrize("angle", [0.4, 7.0, -9.0])
def test_turns_are_those_that_were_asked_for(angle):
    """A rotor that is put into its bearing is at the angle itself, not at a copy of it."""
    base = asm.Body("base", asm.shapes.plate(40, 40, 4, [(0, 0, 3.0)]), fixed=True)
    turn = Rotation.from_rotvec([0.3, 0.1, 1.0]).as_quat(scalar_first=True)
    rotor = asm.Body("rotor", asm.shapes.solid_cylinder(2.5, 20), (60.0, 20.0, 60.0), turn)
    scene = asm.Assembly([base, rotor])
    scene.constrain(asm.Revolute(base.frame(), rotor.frame(), "spin", angle=angle), asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.put_together
    assert solution.values["spin.angle"] == pytest.approx(angle, abs=1e-9)


@pytest.mark.parametrize("value", [1, 0.0, "yes", None])
def test_keep_topology_is_true_or_false(value):
    with pytest.raises(TypeError, match="keep_topology is .*; expected True or False"):
        linked(0.05).solve(keep_topology=value)


def drawn(rng, radius, amount, away=(5.0, -3.0, 60.0)):
    """A pin of radius 4 over a plate with a hole, drawn to where it is home in the hole and by an amount beyond."""
    plate = asm.Body("plate", asm.shapes.plate(60, 40, 12, [(8, 0, radius)]), fixed=True)
    home = np.array([8.0, 0.0, 4.0])
    pose = disturbed(rng, np.r_[home + away, 1.0, 0.0, 0.0, 0.0], 1.5, 0.15)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(4, 40), pose[:3], pose[3:])
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Clearance())
    for along in (-12.0, 12.0):
        scene.minimize(asm.PointDistance(pin.point(0, 0, along), home + (0, 0, along) + np.array(amount)))
    return scene


@pytest.mark.parametrize("away", [(5.0, -3.0, 60.0), (0.0, 2.0, -70.0)], ids=["over", "under"])
@pytest.mark.parametrize("radius", [4.0, 4.5])
def test_what_an_objective_alone_draws_into_its_hole_is_put_there(radius, away, cases):
    """Without, pins came to rest on the plate: another minimum."""
    rng = np.random.default_rng(2)
    for _ in range(cases(1, 10)):
        for amount in ((0.0, 0.0, 0.0), (3.0, 1.0, 0.0)) if radius > 4.0 else ((0.0, 0.0, 0.0),):
            scene = drawn(rng, radius, amount, away)
            solution = scene.solve()
            assert solution.success and solution.put_together and solution.proved
            # The pin leans on the wall along a line, for the way is across the axis.
            pull = np.linalg.norm(amount)
            play = min(pull, radius - 4.0)
            assert solution.objective == pytest.approx(2.0 * (pull - play) ** 2, rel=1e-9, abs=1e-15)
            kept = scene.solve(keep_topology=True)
            assert not kept.put_together and not (kept.success and kept.objective < solution.objective - 1e-9)


@pytest.mark.parametrize("depth", [1.0, 0.4])
def test_what_an_objective_draws_through_a_plate_comes_to_rest_on_it(depth):
    """A box over a plate, drawn to where it is below it, or in it: bodies beside each other stay on their sides."""
    plate = asm.Body("plate", asm.shapes.box(4, 4, 0.5), fixed=True)
    box = asm.Body("box", asm.shapes.box(0.6, 0.6, 0.6), (0.1, 0.2, 3.0), (0.99, 0.1, 0.05, 0.0))
    scene = asm.Assembly([plate, box])
    scene.constrain(asm.Clearance())
    for x, y in ((0.3, 0.3), (-0.3, 0.3), (0.3, -0.3)):
        scene.minimize(asm.PointDistance(box.point(x, y, -0.3), (x, y, -0.3 - depth)))
    solution = scene.solve()
    assert solution.success and solution.q[1, 2] == pytest.approx(0.25 + 0.3, abs=1e-9)


def test_what_is_drawn_into_a_plate_from_below_stays_below():
    plate = asm.Body("plate", asm.shapes.box(4, 4, 0.5), fixed=True)
    box = asm.Body("box", asm.shapes.box(0.6, 0.6, 0.6), (0.1, 0.2, -2.0))
    scene = asm.Assembly([plate, box])
    scene.constrain(asm.Clearance())
    for x, y in ((0.3, 0.3), (-0.3, 0.3), (0.3, -0.3)):
        scene.minimize(asm.PointDistance(box.point(x, y, -0.3), (x, y, 0.24)))
    solution = scene.solve()
    assert not solution.put_together and solution.q[1, 2] < -0.55 + 1e-9


def test_what_an_objective_draws_into_each_other_without_fitting_stays_on_its_side():
    """Two balls, one drawn into the other one: nothing is put together there, and the nearest place is the answer."""
    one = asm.Body("one", asm.shapes.sphere(1.0), fixed=True)
    two = asm.Body("two", asm.shapes.sphere(0.5), (0.3, 0.2, 3.0))
    scene = asm.Assembly([one, two])
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(two.point(0, 0, 0), (0.0, 0.0, 0.2)))
    together = asked(scene)
    assert not together.keeps_topology and not together.is_asked and together.there is not None
    solution = scene.solve()
    assert solution.success and not solution.put_together
    assert np.linalg.norm(solution.q[1, :3]) == pytest.approx(1.5, abs=1e-9)


def test_rings_that_an_objective_draws_apart_stay_linked():
    scene = linked(0.0)
    free = asm.Assembly(scene.bodies)
    free.constrain(asm.Clearance())
    free.minimize(asm.PointDistance(scene.bodies[1].point(0, 0, 0), (3.5, 0.0, 0.0)))
    solution = free.solve()
    assert solution.success and not solution.put_together and passes_through(solution)


def test_what_nearly_fits_where_contacts_hold_is_seated_there(cases):
    """A stepped shaft in bores of two walls, its shoulder to be flush: rows took 65 steps for such a one."""
    walls = [
        asm.Body("thin", asm.shapes.plate(60, 60, 16, [(0, 0, 8.02)]), (0, 0, -8), fixed=True),
        asm.Body("thick", asm.shapes.plate(60, 60, 16, [(0, 0, 12.02)]), (0, 0, 40), fixed=True),
    ]
    corners = [(0, -30), (8, -30), (8, 0), (12, 0), (12, 70), (0, 70)]
    rng = np.random.default_rng(5)
    for _ in range(cases(2, 20)):
        pose = disturbed(rng, np.r_[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], 1.0, 0.035)
        shaft = asm.Body("shaft", turned_part(corners), pose[:3], pose[3:])
        scene = asm.Assembly([*walls, shaft])
        seat = next(face.name for face in turned_part(corners) if face.name == "face 2")
        scene.constrain(asm.Contact(walls[0].face("top"), shaft.face(seat), "seat", edges=False), asm.Clearance())
        solution = scene.solve()
        assert solution.success and solution.proved
        up = Rotation.from_quat(solution.q[2, 3:], scalar_first=True).apply([0.0, 0.0, 1.0])
        assert up == pytest.approx([0.0, 0.0, 1.0], abs=HOLDS)
        assert solution.q[2, 2] == pytest.approx(0.0, abs=HOLDS) and np.hypot(*solution.q[2, :2]) <= 0.02 + HOLDS
        # Before any row of a clearance is asked for, where contacts alone put the shaft into a wall.
        assert solution.iterations == 0 or not solution.put_together


def test_the_three_lugs_of_a_hinge_are_joined_by_a_pin_that_is_drawn_in():
    """A leaf between two lugs, and a pin through all three with a play of 0.05, drawn home from apart."""
    lug = asm.shapes.plate(30, 40, 10, [(0, 8, 5.05)])
    lugs = [asm.Body(name, lug, (0, -8, z), fixed=True) for name, z in (("below", 0.0), ("above", 22.0))]
    leaf = asm.Body("leaf", asm.shapes.plate(30, 60, 12, [(0, 18, 5.05)]), (1, -85, 12), (0.999, 0.02, 0.03, 0.0))
    pin = asm.Body("pin", bolt(5, 40, 8, 4), (2, 1, 90), (0.999, -0.03, 0.02, 0.0))
    scene = asm.Assembly([*lugs, leaf, pin])
    scene.constrain(asm.Clearance())
    for x, y, z in ((10, 0, 0), (0, 10, 0), (0, 0, 10)):
        scene.minimize(asm.PointDistance(leaf.point(x, y, z), (x, y - 18, z + 11)))
    for x, y in ((6, 0), (-6, 0), (0, 6), (0, -6)):
        scene.minimize(asm.PointDistance(pin.point(x, y, 0), (x, y, 25.0)))
    solution = scene.solve()
    assert solution.success and solution.put_together
    # The head comes down onto the lug by 2 too few: four points, 2 each.
    assert solution.objective == pytest.approx(4 * 2.0**2, rel=1e-9)
    assert solution.pose("leaf").position == pytest.approx([0.0, -18.0, 11.0], abs=1e-6)
    assert solution.pose("pin").position[2] == pytest.approx(27.0, abs=1e-6)


def test_slots_added_before_parts_are_put_together_do_no_harm():
    """Parts are put together last where topology is kept; attempts before may have packed the scene with more slots."""
    scene = linked(0.5)
    settings, q = scene._settings({}, CTRL_C, warm=False), np.array(scene.q)
    way = _FirstSolve(scene, q, settings, None, {}, CTRL_C)
    together = asked(scene)
    assert together.keeps_topology and together.is_asked
    before = scene.packed()
    assert scene._pack_with_more_places().results_at > before.results_at
    (solution,) = way._put_together(together)
    assert solution.success and solution.put_together and solution.proved
    assert solution.pose("b").position == pytest.approx([1.0, 0.0, 0.5], abs=HOLDS)
    assert solution.feasibility < HOLDS
    assert solution.objective == pytest.approx(0.25, abs=HOLDS)  # the square of the way


def test_equal_bodies_in_one_place_are_in_each_other_and_put_together_first():
    """Their surfaces are the same, and do not cross."""
    plate = asm.Body("plate", asm.shapes.plate(20, 20, 4, [(0, 0, 3)]), fixed=True)
    pegs = [asm.Body(f"peg {k}", asm.shapes.solid_cylinder(2, 6)) for k in range(2)]
    scene = asm.Assembly([plate, *pegs])
    scene.constrain(asm.Fixed(plate, pegs[0]), asm.Fixed(plate.frame((14, 0, 0)), pegs[1], "beside"), asm.Clearance())
    assert not asked(scene).keeps_topology
    solution = scene.solve()
    assert solution.success and solution.put_together and solution.proved
    assert solution.pose(pegs[1]).position == pytest.approx([14.0, 0.0, 0.0], abs=HOLDS)


@pytest.mark.parametrize(
    ("at", "target", "end"),
    [((2, 0, 0), (-3, 0.5, 0.2), (2, 0.5, 0.2)), ((0, 0, 2), (0, 0, 5), (0, 0, 5)), ((2, 2, 2), (3, 1, 4), (3, 1, 4))],
)
def test_equal_boxes_that_begin_flush(at, target, end):
    """Corners of both coincide at the start, to the bit: no plane is between them, and an objective draws one away."""
    shape = asm.shapes.box(2, 2, 2)
    still, drawn = asm.Body("still", shape, fixed=True), asm.Body("drawn", shape, at)
    scene = asm.Assembly([still, drawn])
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(drawn.point(0, 0, 0), target))
    solution = scene.solve()
    assert solution.success and solution.proved
    assert solution.q[1, :3] == pytest.approx(end, abs=1e-8)
