"""TrimContact: what it takes, what it refuses, and on which face its loop is."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.trim_contact import FORMS
from assembly.constraints.program import records as layout
from assembly.errors import InputError
from assembly.geometry.faces.loop import Loop
from tests.laws.trim_scenes import circle, polygon

SQUARE = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)]


def ball_on(shape, name="ball"):
    ground = asm.Body("ground", shape, fixed=True)
    ball = asm.Body(name, asm.shapes.sphere(1.0), position=(0.5, 0.3, 1.2))
    return ground, ball, asm.Contact(ground, ball)


def test_what_it_says():
    ground, ball, contact = ball_on(asm.shapes.plane(10.0, 10.0))
    trim = asm.TrimContact(contact, circle((0.0, 0.0), 2.0))
    assert (trim.contact, trim.keep, trim.form, trim.side) == (contact, "on", "signed", 0)
    assert trim.name == "trim ground-ball" and not trim.unilateral
    assert trim.bodies == (ground, ball)
    assert isinstance(trim.loop, Loop) and len(trim.loop.curves) == 1
    assert repr(trim) == "TrimContact('ground-ball', keep='on', form='signed', name='trim ground-ball')"
    for keep in ("inside", "outside"):
        assert asm.TrimContact(contact, circle((0.0, 0.0), 2.0), keep, name="edge").unilateral
    assert asm.TrimContact(contact, polygon(SQUARE), name="edge").name == "edge"


def test_the_side_that_has_the_loop():
    plate = asm.Face(asm.shapes.plane(10.0, 10.0), polygon(SQUARE), [circle((0.0, 0.0), 1.0)])
    ground, ball = asm.Body("ground", plate, fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    face = ground.faces[0].face
    for loop in (face.outer, face.holes[0]):
        assert asm.TrimContact(asm.Contact(ground, ball), loop).side == 0
        assert asm.TrimContact(asm.Contact(ball, ground), loop).side == 1
        assert asm.TrimContact(asm.Contact(ball, ground.faces[0]), loop).side == 1
        assert asm.TrimContact(asm.Contact(ground, ball), loop).loop is loop
    # Any other loop is on side a, unless said otherwise.
    other = circle((0.5, 0.5), 0.3)
    assert asm.TrimContact(asm.Contact(ball, ground), other).side == 0
    assert asm.TrimContact(asm.Contact(ball, ground), other, side="b").side == 1
    # Said otherwise, that holds for loops of the faces, too.
    two = asm.Contact(ground, asm.Body("table", plate))
    assert asm.TrimContact(two, face.outer).side == 0
    assert asm.TrimContact(two, face.outer, side="b").side == 1


def test_a_hole_is_a_loop_that_encloses():
    """Holes are run clockwise on their faces; inside one is inside, whichever way it is run."""
    plate = asm.Face(asm.shapes.plane(10.0, 10.0), polygon(SQUARE), [circle((0.0, 0.0), 1.0)])
    ground, ball = asm.Body("ground", plate, fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    trim = asm.TrimContact(asm.Contact(ground, ball), ground.faces[0].face.holes[0], "outside")
    assert ground.faces[0].face.holes[0].area < 0.0
    assert trim.region.trim_distance(0.0, 0.0) == pytest.approx(1.0, abs=1e-12)
    assert trim.region.trim_distance(1.5, 0.0) == pytest.approx(-0.5, abs=1e-12)


def test_the_stretch_is_a_mean_over_the_loop():
    # v of this cylinder is a length, and u one at its radius.
    cylinder = asm.shapes.cylinder(2.0, 6.0)
    ground, ball = asm.Body("ground", cylinder, fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    middle = np.mean(cylinder.domain, axis=1)
    trim = asm.TrimContact(asm.Contact(ground, ball), circle(middle, 0.5))
    # |Su| is not quite constant on a rational circle.
    assert trim.stretch == pytest.approx(1.0, rel=0.1)
    plane = asm.shapes.plane(10.0, 10.0).transformed(scale=3.0)
    trim = asm.TrimContact(asm.Contact(asm.Body("table", plane), ball), circle((0.0, 0.0), 2.0))
    assert trim.stretch == pytest.approx(3.0, rel=1e-12)


@pytest.mark.parametrize(
    ("change", "error", "text"),
    [
        ({"contact": None}, TypeError, "contact is None; expected a Contact"),
        ({"contact": "rests"}, TypeError, "contact is 'rests'"),
        ({"keep": "off"}, ValueError, "keep is 'off'; expected one of 'on', 'inside', 'outside'"),
        ({"keep": None}, ValueError, "keep is None"),
        ({"keep": ["on"]}, ValueError, r"keep is \['on'\]"),
        (
            {"form": "exact"},
            ValueError,
            "form is 'exact'; expected one of 'signed', 'parametric', 'cartesian', 'between'",
        ),
        ({"form": 0}, ValueError, "form is 0"),
        ({"side": "c"}, ValueError, "side is 'c'; expected 'a', 'b' or None"),
        ({"side": 0}, ValueError, "side is 0"),
        ({"name": ""}, ValueError, "name is ''"),
        ({"name": 3}, (TypeError, ValueError), "name is 3"),
        ({"loop": None}, TypeError, "loop is None; expected a Loop, a closed NurbsCurve, or several"),
        ({"loop": []}, ValueError, "loop is empty"),
        ({"loop": [1.0]}, TypeError, r"loop\[0\] is 1.0; expected a NurbsCurve"),
        ({"loop": polygon(SQUARE)[:3]}, ValueError, "loop is open: a gap of 4"),
        ({"loop": polygon([(-2, -2), (2, 2), (2, -2), (-2, 2)])}, ValueError, "crosses or touches itself"),
        ({"loop": circle((0.0, 4.5), 2.0)}, ValueError, "^loop .*domain"),
        ({"loop": asm.NurbsCurve([[0, 0, 0], [1, 0, 0], [0, 0, 0]], [0, 0, 1, 2, 2], 1)}, ValueError, "curve in space"),
    ],
    ids=lambda value: str(value)[:24] if isinstance(value, dict) else "",
)
def test_what_it_refuses(change, error, text):
    contact = ball_on(asm.shapes.plane(10.0, 10.0))[2]
    arguments = {"contact": contact, "loop": circle((0.0, 0.0), 2.0), **change}
    with pytest.raises(error, match=text):
        asm.TrimContact(**arguments)


def test_a_side_with_several_faces():
    box = asm.Body("box", asm.shapes.plate(1.0, 1.0, 1.0), position=(0.0, 0.0, 2.0))
    ground = asm.Body("ground", asm.shapes.plane(10.0, 10.0), fixed=True)
    loop = circle((0.0, 0.0), 2.0)
    with pytest.raises(InputError, match="body 'box' with 6 faces as side b; expected one of its faces"):
        asm.TrimContact(asm.Contact(ground, box), loop)
    with pytest.raises(InputError, match="body 'box' with 6 faces as side a"):
        asm.TrimContact(asm.Contact(box, ground), loop, side="b")
    trim = asm.TrimContact(asm.Contact(ground, box.face("bottom")), loop)
    assert trim.side == 0


def test_it_needs_its_contact_in_the_assembly():
    ground, ball, contact = ball_on(asm.shapes.plane(10.0, 10.0))
    trim = asm.TrimContact(contact, circle((0.0, 0.0), 2.0))
    scene = asm.Assembly([ground, ball])
    with pytest.raises(InputError, match="keeps contact 'ground-ball', which is not in the assembly"):
        scene.constrain(trim)
    with pytest.raises(InputError, match="keeps contact"):
        # Another one of the same name is not it.
        scene.constrain(asm.Contact(ground, ball), trim)
    scene = asm.Assembly([ground, ball])
    scene.constrain(contact, trim)
    with pytest.raises(InputError, match="name 'trim ground-ball' is taken"):
        scene.constrain(asm.TrimContact(contact, circle((0.0, 0.0), 1.0)))
    assert scene.constraints == (contact, trim)


@pytest.mark.parametrize("form", FORMS)
def test_rows_and_their_sides(form):
    ground, ball, contact = ball_on(asm.shapes.plane(10.0, 10.0))
    scene = asm.Assembly([ground, ball])
    scene.constrain(contact)
    sides = ("on", "on" if form == "between" else "outside")
    trims = [asm.TrimContact(contact, circle((0.0, 0.0), 2.0), k, form, name=f"{n} {k}") for n, k in enumerate(sides)]
    scene.constrain(*trims)
    packed = scene.packed()
    each = {"signed": 1, "parametric": 2, "cartesian": 3, "between": 3}[form]
    assert packed.rows == 1 + 2 * each and packed.table[layout.TRIMS] == 2 * each
    assert [len(rows) for rows in packed.spans] == [1, each, each]
    assert packed.lengths.all()
    # Of a vector that is one-sided the first row counts, the others are zero.
    assert packed.one_sided.tolist() == [False] * (1 + each) + [form != "between"] * each
    assert packed.pairs.tolist() == [0] * packed.rows
    assert packed.table[layout.VECTOR_TRIMS] == int(form != "signed")
    # The contact is of the surfaces, without the boundary of the plane.
    row = packed.table[layout.ROW_TABLE]
    assert packed.table[row + layout.SHELL_F] == -1
