"""A face's extent in (u, v) and its outermost wire are those that OCCT finds."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.step.wires import bounds, outermost, wires_of
from tests.step.models import MODELS, O, box, cylinder, drill, edges, faces, filleted, joined, volumes, without
from tests.step.test_poles import written


@pytest.mark.parametrize("name", MODELS)
def test_extents_are_occt_s_to_the_bit(name):
    for face in faces(MODELS[name]()):
        forward = O.as_face(face.Oriented(O.TopAbs_FORWARD))
        wires, surface = wires_of(forward), O.BRep_Tool.Surface_s(forward)
        assert bounds(wires, surface, forward) == O.BRepTools.UVBounds_s(forward)
        if wires:
            around = wires[outermost(wires, surface, forward)].wire
            assert around.IsSame(O.BRepTools.OuterWire_s(forward))


def test_the_wire_around_others_is_found_among_them():
    plate = box(10.0, 10.0, 1.0)
    for x, y in ((2, 2), (5, 5), (8, 3)):
        plate = without(plate, drill(0.5, (x, y, -1), (0, 0, 1), 3.0))
    plate = without(plate, box(1.0, 1.0, 3.0, (7, 7, -1)))
    several = 0
    for face in faces(without(cylinder(), drill())) + faces(plate):
        forward = O.as_face(face.Oriented(O.TopAbs_FORWARD))
        wires, surface = wires_of(forward), O.BRep_Tool.Surface_s(forward)
        several += len(wires) > 1
        assert bounds(wires, surface, forward) == O.BRepTools.UVBounds_s(forward)
        assert wires[outermost(wires, surface, forward)].wire.IsSame(O.BRepTools.OuterWire_s(forward))
        for k in range(len(wires)):
            turned = wires[k:] + wires[:k]
            found = turned[outermost(turned, surface, forward)].wire
            assert found.IsSame(O.BRepTools.OuterWire_s(forward))
    assert several >= 2


def test_faces_that_occt_turns_with_their_wires_are_read_right_side_out(tmp_path):
    """Of tori about axes that point down OCCT makes wires that run the wrong way, and turns the faces for it."""
    spool = joined(box(10.0, 10.0, 4.0, (-5, -5, -2)), cylinder(2.0, 12.0, ((0, 0, -6), (0, 0, 1))))
    circles = {
        tuple(np.round([center.X(), center.Y(), center.Z(), curve.Radius()], 9)): one
        for one in edges(spool)
        if isinstance(curve := O.BRep_Tool.Curve_s(one, 0.0, 0.0), O.Geom_Circle)
        for center in [curve.Location()]
    }
    assert len(circles) == 4
    rounded = filleted(spool, 0.5, circles.values())
    (body,) = asm.read_step(written(rounded, tmp_path / "spool.step"))
    assert body.volume == pytest.approx(volumes(rounded)[1], rel=1e-9)
    assert [face.kind for face in body.faces].count("torus") == 4
