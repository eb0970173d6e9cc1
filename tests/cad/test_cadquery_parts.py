"""CadQuery's workplanes and assemblies as bodies: names, colors, places, tags; and placed back."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assembly as asm

cq = pytest.importorskip("cadquery", reason="needs CadQuery, in an environment of its own: packaging/check_cad.py")


def plate():
    """Tags of a face that is cut afterwards, and of one that stays."""
    drawn = cq.Workplane().box(40, 30, 5).faces(">Z").tag("top").workplane().hole(6)
    return drawn.faces("%CYLINDER").tag("bore").end()


def names(thing):
    (body,) = asm.cad.from_cadquery(thing)
    return [face.name for face in body.faces]


NAMES = ["face 1", "face 2", "top", "face 4", "face 5", "face 6", "bore"]


def assembly_of_ten():
    part = plate()
    group = cq.Assembly(None, name="group", loc=cq.Location(cq.Vector(0, 0, 20)), color=cq.Color(0, 0.5, 1))
    for k in range(10):
        place = cq.Location(cq.Vector(k, 0, 8 * k), cq.Vector(0, 0, 1), 10 * k)
        group.add(part, name=f"p{k}", loc=place, color=cq.Color("red") if k == 3 else None)
    return cq.Assembly(part, name="base", loc=cq.Location(cq.Vector(1, 2, 3))).add(group, name="group")


def test_a_workplane_is_one_body_with_its_own_volume():
    (body,) = asm.cad.from_cadquery(plate(), "plate", fixed=["plate"])
    assert (body.name, body.fixed, [face.name for face in body.faces]) == ("plate", True, NAMES)
    volume = sum(face.face.volume_integral() for face in body.faces)
    assert volume == pytest.approx(40 * 30 * 5 - 9 * math.pi * 5, rel=1e-10)
    assert body.face("top").face.surface.evaluate(1.0, 1.0)[2] == pytest.approx(2.5, abs=1e-12)


def test_tags_go_with_copies_and_what_is_moved_or_cut_again():
    part = plate()
    assert names(part.newObject([part.val().copy()])) == NAMES
    assert names(part.translate((5, 6, 7))) == NAMES
    assert names(part.rotate((0, 0, 0), (1, 1, 0), 35)) == NAMES
    assert {"top", "bore"} < set(names(part.edges("|Z").fillet(2)))
    slit = part.faces(">Z").workplane().rect(100, 2).cutThruAll()
    assert {"top", "top 2"} < set(names(slit))


def test_a_face_of_another_part_has_no_part_in_it():
    part, other = plate(), cq.Workplane().box(1, 2, 3)
    other.ctx.tags["top"] = part.faces(">Z")
    assert "top" not in names(other)


def test_an_assembly_keeps_names_places_and_colors_and_shares_faces():
    bodies = asm.cad.from_cadquery(assembly_of_ten(), fixed=["base"])
    assert [body.name for body in bodies] == ["base", *(f"group/p{k}" for k in range(10))]
    assert len({id(face.face) for body in bodies for face in body.faces}) == 7
    assert bodies[0].color is None and bodies[1].color == (0.0, 0.5, 1.0) and bodies[4].color == (1.0, 0.0, 0.0)
    assert [body.fixed for body in bodies] == [True] + 10 * [False]
    for k, body in enumerate(bodies[1:]):
        # In the root's location.
        assert body.pose.position == pytest.approx([1 + k, 2, 23 + 8 * k], abs=1e-12)
        half = math.radians(5 * k)
        assert body.pose.quaternion == pytest.approx([math.cos(half), 0, 0, math.sin(half)], abs=1e-14)


def test_names_and_colors_of_faces_that_an_assembly_gives():
    part = plate()
    named = cq.Assembly(part, name="w").addSubshape(part.faces("<Z").val(), name="bottom", color=cq.Color("green"))
    for assembly in (named, cq.Assembly(name="around").add(named, name="w")):
        (body,) = asm.cad.from_cadquery(assembly)
        assert body.face("bottom").face.color == (0.0, 1.0, 0.0) and body.face("top").face.color is None


def test_what_is_solved_is_placed_back():
    assembly = assembly_of_ten()
    bodies = asm.cad.from_cadquery(assembly, fixed=["base"])
    scene = asm.Assembly(bodies)
    below = bodies[0]
    for body in bodies[1:-1]:
        scene.constrain(asm.Fixed(below.frame((0, 0, 2.5)), body.frame((0, 0, -2.5))))
        below = body
    solution = scene.solve()
    assert solution.success and asm.cad.place(assembly, solution) is assembly
    again = asm.cad.from_cadquery(assembly)
    assert np.abs(np.array([body.q for body in again]) - solution.q).max() < 1e-13
    # Nothing asked for the last one.
    assert again[-1].pose.position == pytest.approx(bodies[-1].pose.position, abs=1e-12)
    assert assembly.toCompound().BoundingBox().zmax == pytest.approx(23 + 72 + 2.5, abs=1e-6)


def test_what_cannot_be_read_raises():
    for call, error, text in (
        (lambda: asm.cad.from_cadquery("plate"), TypeError, "thing is 'plate'"),
        (lambda: asm.cad.from_cadquery(cq.Workplane()), asm.errors.InputError, "no faces"),
        (lambda: asm.cad.from_cadquery(cq.Assembly(name="a")), asm.errors.InputError, "no faces"),
        (lambda: asm.cad.from_cadquery(plate(), fixed=["plat"]), asm.errors.InputError, "expected one of 'part'"),
        (lambda: asm.cad.from_cadquery(plate(), fixed="part"), asm.errors.InputError, "expected several names"),
        (lambda: asm.cad.from_cadquery(plate(), strict=1), asm.errors.InputError, "True or False"),
        (lambda: asm.cad.from_cadquery(plate(), ""), asm.errors.InputError, "nonempty string"),
    ):
        with pytest.raises(error, match=text):
            call()


def test_only_a_solution_that_succeeded_is_placed():
    assembly = assembly_of_ten()
    other = asm.Assembly([asm.Body("a", fixed=True), asm.Body("b")])
    other.constrain(asm.Fixed(*other.bodies))
    solution = other.solve()
    with pytest.raises(asm.errors.InputError, match="expected one of 'a', 'b'"):
        asm.cad.place(assembly, solution)
    with pytest.raises(TypeError, match="expected a Solution"):
        asm.cad.place(assembly, None)
    other.constrain(asm.Distance(*other.bodies, 1.0))
    with pytest.raises(asm.errors.InputError, match="is INFEASIBLE"):
        asm.cad.place(assembly, other.solve())
