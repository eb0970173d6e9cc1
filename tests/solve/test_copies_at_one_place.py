"""Copies of a body at one place cross, though no walls of theirs do; bodies that fill each other's hollows do not."""

import pytest

import assembly as asm

SHAPES = {
    "box": lambda: asm.shapes.box(1, 1, 1),
    "ball": lambda: asm.shapes.sphere(1.0),
    "plate with a hole": lambda: asm.shapes.plate(4, 4, 1, [(0, 0, 1.0)]),
}


def crossing(*bodies: asm.Body) -> tuple[tuple[str, str], ...]:
    return asm.Assembly(bodies).solve().crossings


@pytest.mark.parametrize("name", SHAPES)
def test_copies_cross(name):
    a, b = asm.Body("a", SHAPES[name](), fixed=True), asm.Body("b", SHAPES[name]())
    assert crossing(a, b) == (("a", "b"),)


def test_a_pin_that_fills_its_hole_does_not():
    plate = asm.Body("plate", SHAPES["plate with a hole"](), fixed=True)
    assert crossing(plate, asm.Body("pin", asm.shapes.solid_cylinder(1.0, 3.0))) == ()
