"""`Solution.crossings`: all pairs of bodies, whatever constrains them, but those that may overlap."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.solve import crossings, samples
from assembly.solve.interruption import CTRL_C, Interruption


def block(name, x, size=1.0, **others):
    return asm.Body(name, asm.shapes.box(size, size, size), (x, 0, 0), **others)


def scene_of(bodies, *constraints):
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    return scene


def test_joints_alone_have_crossings():
    # A crank of three links in a row: neighbors overlap at their pins, and the outer ones do not.
    ground, a, b, c = block("ground", 0, fixed=True), block("a", 0.9), block("b", 1.8), block("c", 0.5, 0.2)
    joints = [asm.Revolute(ground.frame((0.45, 0, 0)), a.frame((-0.45, 0, 0))), asm.Fixed(a.frame((0.9, 0, 0)), b)]
    solution = scene_of([ground, a, b, c], *joints).solve()
    assert solution.success
    # c stands where ground and a overlap, and nothing ties it.
    assert solution.crossings == (("ground", "c"), ("a", "c"))
    assert solution.crossings_of_joined == (("ground", "a"), ("a", "b"))
    lines = str(solution).splitlines()
    assert "  ground and c cross; asm.Clearance() keeps them apart" in lines
    assert "  a and b cross, which are connected by a joint or a coupling" in lines


def test_a_scene_without_constraints_has_crossings_and_apart_there_are_none():
    a, b = block("a", 0, fixed=True), block("b", 0.5)
    scene = asm.Assembly([a, b])
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (0.5, 0, 0)))
    assert scene.solve().crossings == (("a", "b"),)
    scene.objectives[0][1].target = (1.5, 0, 0)
    solution = scene.solve()
    assert solution.crossings == () and solution.crossings_of_joined == () and " cross" not in str(solution)
    # Faces that lie on each other do not cross.
    scene.objectives[0][1].target = (1.0, 0, 0)
    assert scene.solve().crossings == ()


@pytest.mark.parametrize("fixed", [False, True])
def test_a_body_in_the_material_of_another_one(fixed):
    large, small = block("large", 0, 4.0, fixed=True), block("small", 0.3, fixed=fixed)
    free = block("free", 9.0)
    for bodies in ([large, small, free], [small, large, free]):
        assert asm.Assembly(bodies).solve().crossings == ((bodies[0].name, bodies[1].name),)


def test_a_body_in_the_hollow_of_another_one_is_outside():
    ring, ball = asm.Body("ring", asm.shapes.torus(2.0, 0.5), fixed=True), asm.Body("ball", asm.shapes.sphere(0.5))
    assert asm.Assembly([ring, ball]).solve().crossings == ()


def test_pairs_that_a_clearance_excludes_and_those_it_does_not_know():
    a, b, c = block("a", 0, fixed=True), block("b", 0.5), block("c", 5.0)
    solution = scene_of([a, b, c], asm.Clearance(exclude=[(b, a)])).solve()
    assert solution.success and solution.crossings == solution.crossings_of_joined == ()
    # A clearance of others says nothing of these.
    b.pose = asm.Pose((0.5, 0, 0))
    solution = scene_of([a, b, c], asm.Clearance([a, c])).solve()
    assert solution.success and solution.crossings == (("a", "b"),)


def test_a_name_that_is_taken_hides_nothing():
    a, b, c = block("a", 0, fixed=True), asm.Body("b", asm.shapes.sphere(1.0), (0, 0, 1.6)), block("c", 0.5)
    solution = scene_of([a, b, c], asm.Contact(a, b, "crossings")).solve()
    assert solution.success and ("a", "c") in solution.crossings


def test_what_cannot_be_searched_says_so():
    a, b = (asm.Body(name, asm.shapes.sphere(1e80)) for name in "ab")
    solution = asm.Assembly([a, b]).solve()
    with pytest.raises(InputError, match=r"bodies\[0\], 'a', has a face whose u"):
        _ = solution.crossings
    assert "crossings are not known: bodies[0], 'a'," in str(solution)


def test_many_bodies_are_searched_when_it_is_read():
    bodies = [asm.Body(f"{k}", asm.shapes.sphere(0.6), (float(k), 0, 0)) for k in range(42)]
    solution = asm.Assembly(bodies).solve()
    assert "42 bodies were not searched" in str(solution)
    assert len(solution.crossings) == 41 and solution.crossings_of_joined == ()
    assert str(solution).count(" cross;") == 41


def wheel(name, x, **others):
    return asm.Body(name, asm.shapes.solid_cylinder(1.0, 0.5), (x, 0.0, 0.0), **others)


def test_wheels_that_mesh_are_tied():
    # Pitch circles overlap by the height of the teeth.
    frame, a, b, c = asm.Body("frame", fixed=True), wheel("a", 0.0), wheel("b", 1.9), wheel("c", 3.8)
    hinges = [asm.Revolute(frame.frame((x, 0, 0)), body) for x, body in ((0.0, a), (1.9, b), (3.8, c))]
    gear = asm.Gear(hinges[0], hinges[1], -1.0)
    assert gear.meshing == ((a, b),)
    solution = scene_of([frame, a, b, c], *hinges, gear).solve()
    assert solution.success
    assert solution.crossings_of_joined == (("a", "b"),)
    # Nothing says that b and c mesh.
    assert solution.crossings == (("b", "c"),)


def test_a_sun_that_is_fixed_meshes_with_its_planet():
    sun, arm, planet = wheel("sun", 0.0, fixed=True), asm.Body("arm"), wheel("planet", 1.9)
    hinges = [asm.Revolute(sun, arm), asm.Revolute(arm.frame((1.9, 0, 0)), planet)]
    assert asm.Gear(*hinges, -1.0).meshing == ((sun, planet),)


def test_wheels_on_frames_of_their_own_and_racks_mesh():
    frames = [asm.Body(f"frame {k}", fixed=True) for k in range(2)]
    a, b, rack = wheel("a", 0.0), wheel("b", 1.9), block("rack", 0.0)
    hinges = [asm.Revolute(frames[0], a), asm.Revolute(frames[1].frame((1.9, 0, 0)), b)]
    assert asm.Gear(*hinges, -1.0).meshing == ((a, b),)
    slide = asm.Prismatic(frames[0].frame((0, -1.4, 0), z=(1, 0, 0)), rack)
    assert asm.RackPinion(hinges[0], slide, 1.0).meshing == ((a, rack),)
    # A screw of one joint ties no other bodies than the joint.
    both = asm.Cylindrical(frames[0], a)
    assert asm.RackPinion(both.freedom("angle"), both.freedom("slide"), 1.0).meshing == ()


def row_of_blocks(count):
    """Blocks of which each crosses the next, and no other one."""
    solution = asm.Assembly([block(f"{k}", 0.7 * k) for k in range(count)]).solve()
    return solution, tuple((f"{k}", f"{k + 1}") for k in range(count - 1))


def test_what_a_time_limit_leaves_out_is_not_clear():
    solution, expected = row_of_blocks(6)
    nothing = solution.find_crossings(time_limit=1e-9)
    # Boxes of the others do not meet: that is known at once.
    assert nothing.pairs == () and nothing.unseen == expected
    assert not nothing.is_complete and not nothing.is_clear
    for found in (solution.find_crossings(), solution.find_crossings(time_limit=1e6)):
        assert found.pairs == expected and found.unseen == ()
        assert found.is_complete and not found.is_clear
    apart = asm.Assembly([block("a", 0.0), block("b", 9.0)]).solve()
    assert apart.find_crossings(time_limit=1e-9).is_clear and apart.find_crossings(joined=True).is_clear


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joined": "both"}, "joined is 'both'; expected True or False"),
        ({"time_limit": -1.0}, "time_limit is -1; expected a number of seconds above 0"),
    ],
)
def test_bad_input(options, message):
    with pytest.raises(InputError, match=message):
        row_of_blocks(2)[0].find_crossings(**options)


def slotted(width):
    """A channel along z, open above, of a width."""
    corners = [(-2, -1), (2, -1), (2, 1), (width / 2, 1), (width / 2, 0), (-width / 2, 0), (-width / 2, 1), (-2, 1)]
    points = np.array(corners, float)
    sides = [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(points, np.roll(points, -1, 0), strict=True)]
    return asm.shapes.extrusion(sides, 4.0)


def scene_of_fits():
    """Shafts in bores of their radius: one, one beside the axis of its bore, two that are one body; blocks in slots."""
    plate, shaft = asm.shapes.plate(3.0, 2.0, 0.5, [(0.0, 0.0, 0.3)]), asm.shapes.solid_cylinder(0.3, 0.5)
    bodies = [asm.Body("plate a", plate), asm.Body("shaft a", shaft)]
    bodies += [asm.Body("plate b", plate, (9, 0, 0)), asm.Body("shaft b", shaft, (9.1, 0, 0))]
    for name, x, high in (("a", 20, 0.7), ("b", 30, 0.4)):
        bodies.append(asm.Body(f"slot {name}", slotted(1.0), (x, 0, 0)))
        bodies.append(asm.Body(f"block {name}", asm.shapes.box(1.0, 1.0, 1.0), (x, high, 1.5)))
    bodies.append(asm.Body("plate c", asm.shapes.plate(3.0, 2.0, 0.5, [(-0.9, 0.0, 0.3), (0.9, 0.0, 0.3)]), (40, 0, 0)))
    pins = [f.transformed(translation=(x, 0.0, 0.0), name=f"{f.name} {x}") for x in (-0.9, 0.9) for f in shaft]
    bodies.append(asm.Body("pins", pins, (40, 0, 0)))
    return asm.Assembly(bodies)


def test_a_look_tells_how_deep_and_where():
    places = [np.array([0.7, 0.2, 0.1]) * k for k in range(3)]
    bodies = [asm.Body(f"{k}", asm.shapes.box(1.0, 1.0, 1.0), place) for k, place in enumerate(places)]
    found = asm.Assembly(bodies).solve().find_crossings().found
    assert [crossing.bodies for crossing in found] == [("0", "1"), ("1", "2")]
    for k, crossing in enumerate(found):
        # In each other by 0.3: what is proven is no more.
        assert crossing.proved and 0.0 < crossing.depth <= 0.3
        # On both, to rounding: cells of boxes are exact.
        for middle in places[k : k + 2]:
            assert np.abs(crossing.place - middle).max() == pytest.approx(0.5, abs=1e-14)


def test_samples_stand_in_where_bodies_conform_alone(monkeypatch):
    asked = []
    search = crossings.sampled
    monkeypatch.setattr(crossings, "sampled", lambda at, pairs, limit: asked.append(pairs) or search(at, pairs, limit))
    solution = scene_of_fits().solve()
    found = solution.find_crossings().found
    assert [crossing.bodies for crossing in found] == [("plate b", "shaft b"), ("slot b", "block b")]
    # What fills a bore or a slot is made slimmer; about two axes at once nothing is.
    assert [[a.name for a, _ in pairs] for pairs in asked] == [["plate c"]]
    # Boxes that lie on each other are proven to touch.
    assert asm.Assembly([block("a", 0.0, fixed=True), block("b", 1.0)]).solve().crossings == () and asked[1] == []


def test_bodies_of_which_nothing_can_be_proven_are_sampled(monkeypatch):
    """As those of files with faces whose boundaries have gaps."""
    monkeypatch.setattr(crossings, "has_cells", lambda faces: False)
    solution, expected = row_of_blocks(3)
    found = solution.find_crossings().found
    assert tuple(crossing.bodies for crossing in found) == expected
    assert not any(crossing.proved or crossing.depth > 0.0 for crossing in found)


def test_updates_in_slices_find_the_same(monkeypatch):
    bodies = [block(f"{k}", 0.7 * k) for k in range(6)]
    posed = samples.PosedBodies(bodies, np.array([body.q for body in bodies]), 1e-9)
    pairs = list(pairwise(bodies))
    updates = []
    update = samples.manager.update
    # A slice that is over when it begins: every update is of one pair.
    monkeypatch.setattr(samples, "SLICE", -1)
    monkeypatch.setattr(samples.manager, "update", lambda *arguments: updates.append(arguments) or update(*arguments))
    assert samples.sampled(posed, pairs, CTRL_C) == samples.Sampled(set(range(5)), True)
    assert len(updates) == len(pairs)

    def later(*arguments):
        updates.append(arguments)
        if len(updates) == 4:
            monkeypatch.setattr(limit, "_deadline", 0.0)
        return update(*arguments)

    limit = Interruption(time_limit=1e6)
    updates.clear()
    monkeypatch.setattr(samples.manager, "update", later)
    # What was found by then crosses for certain, and the rest is not known.
    assert samples.sampled(posed, pairs, limit) == samples.Sampled({0, 1, 2, 3}, False)


def test_contacts_of_one_pair_hide_no_other_pair(monkeypatch):
    """Where its extrema take all slots that there are, as those of faces that lie on each other, the others' are seen.

    Balls that are in each other by less than their facets are off have an extremum that tells of it, and nothing else.
    """
    monkeypatch.setattr(samples, "PLACES", 1)
    shapes = asm.shapes.box(2.0, 2.0, 2.0), asm.shapes.sphere(1.0)
    at = ((0.0, 0.0, 0.0), (0.0, 0.0, 2.0)), ((9.0, 0.0, 0.0), (9.0, 0.0, 1.9999))
    bodies = [asm.Body(f"{k}", shapes[k // 2], at[k // 2][k % 2]) for k in range(4)]
    posed = samples.PosedBodies(bodies, np.array([body.q for body in bodies]), 1e-9)
    pairs = [(bodies[0], bodies[1]), (bodies[2], bodies[3])]
    for order in ((0, 1), (1, 0)):
        found = samples.sampled(posed, [pairs[k] for k in order], CTRL_C)
        assert found == samples.Sampled({order.index(1)}, True)


def test_bodies_are_where_their_boxes_are(cases):
    # Turned and far from the origin: searched only where hulls meet, and where bodies meet hulls do.
    rng = np.random.default_rng(3)
    for _ in range(cases(20, 400)):
        turns = rng.normal(size=(2, 4))
        turns /= np.linalg.norm(turns, axis=1)[:, None]
        bodies = [
            asm.Body(name, asm.shapes.sphere(1.0), quaternion=turn) for name, turn in zip("ab", turns, strict=True)
        ]
        way = rng.normal(size=3)
        distance = rng.choice([1.999, 2.001])
        bodies[0].pose = asm.Pose(100.0 * rng.normal(size=3), turns[0])
        bodies[1].pose = asm.Pose(bodies[0].pose.position + distance * way / np.linalg.norm(way), turns[1])
        assert bool(asm.Assembly(bodies).solve().crossings) == (distance < 2.0)
