"""A face's extent in (u, v) and its outermost wire are those that OCCT finds."""

from __future__ import annotations

import pytest

from assembly.step.wires import bounds, outermost, wires_of
from tests.step.models import MODELS, O, box, cylinder, drill, faces, without


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
