"""Shapes that are equal share what is made of them; what differs in one number or name does not."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.faces.equal_shapes import first_equal
from assembly.proximity.clearance.body_cells import cells_of_body

HOLES = [(0.5, 0.2, 0.3), (-0.6, 0.0, 0.4)]


def plate(**changes):
    """A plate with two holes, of which the top may be made anew with other arguments, as the first face."""
    faces = sorted(asm.shapes.plate(3.0, 2.0, 0.5, HOLES), key=lambda face: face.name != "top")
    if changes:
        face = faces[0]
        surface, arguments = changes.pop("surface", face.surface), {"name": face.name, "reversed": face.reversed}
        outer, holes = changes.pop("outer", face.outer), changes.pop("holes", face.holes)
        faces[0] = asm.Face(surface, outer, holes, **(arguments | changes))
    return tuple(faces)


def nudged(surface):
    """A surface with one control point moved by the least there is."""
    points = surface.control_points.copy()
    points[0, 0, 2] = np.nextafter(points[0, 0, 2], np.inf)
    return asm.NurbsSurface(points, surface.knots, surface.degree, surface.weights, name=surface.name)


def test_shapes_made_by_the_same_calls_are_one():
    one, other = plate(), plate()
    assert one[0] is not other[0]
    assert first_equal(one) is first_equal(other) is first_equal(first_equal(other))
    assert cells_of_body(one) is cells_of_body(other)


@pytest.mark.parametrize("what", ["surface", "name", "reversed", "holes", "order"])
def test_shapes_that_differ_are_two(what):
    one = plate()
    face = one[0]
    changes = {
        "surface": {"surface": nudged(face.surface)},
        "name": {"name": f"{face.name}'"},
        "reversed": {"reversed": not face.reversed},
        "holes": {"holes": face.holes[:1]},
    }
    other = one[::-1] if what == "order" else plate(**changes[what])
    first_equal(one)
    assert first_equal(other) is other


def test_asking_makes_no_boundary():
    """Of faces without loops the boundary is that of the surface: to make it takes longer than to tell them apart."""
    faces = tuple(asm.Face(face.surface, name=face.name, reversed=face.reversed) for face in asm.shapes.box(1, 2, 3))
    first_equal(faces)
    assert not any("_boundary" in face.__dict__ for face in faces)
