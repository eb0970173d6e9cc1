"""`Solution.crossings`: all pairs of bodies, whatever constrains them, but those that may overlap."""

from __future__ import annotations

import pytest

import assembly as asm
from assembly.errors import InputError


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
    assert "  a and b cross, which a joint or a coupling ties" in lines


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


def test_what_cannot_be_looked_at_says_so():
    a, b = (asm.Body(name, asm.shapes.sphere(1e80)) for name in "ab")
    solution = asm.Assembly([a, b]).solve()
    with pytest.raises(InputError, match=r"bodies\[0\], 'a', has a face whose u"):
        _ = solution.crossings
    assert "crossings are not known: bodies[0], 'a'," in str(solution)


def test_many_bodies_are_looked_at_when_it_is_read():
    bodies = [asm.Body(f"{k}", asm.shapes.sphere(0.6), (float(k), 0, 0)) for k in range(42)]
    solution = asm.Assembly(bodies).solve()
    assert "42 bodies were not looked at" in str(solution)
    assert len(solution.crossings) == 41 and solution.crossings_of_joined == ()
    assert str(solution).count(" cross;") == 41
