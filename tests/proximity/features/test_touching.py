"""Bodies that touch along flat faces do not cross, whatever a search finds that they have in common."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.proximity import FeatureStatus, closest_features

CROSS = (FeatureStatus.PENETRATING, FeatureStatus.CROSSING)


def bolt_and_plate(height):
    """A bolt whose head is over a plate, its shank in a wider hole."""
    plate = asm.Body("plate", asm.shapes.plate(80, 40, 10, holes=[(0, 0, 4.5)]), fixed=True)
    shank = asm.shapes.solid_cylinder(4, 60)
    for face in shank:
        face.name = "shank " + face.name
    head = asm.shapes.plate(13, 13, 8, holes=[(0, 0, 4)])
    return plate, asm.Body("bolt", [*head, *shank], position=(0, 0, height))


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("depth", "touching"), [(0.0, 1e-9), (1e-9, 1e-9), (1e-6, 1e-7)])
def test_a_head_that_lies_on_a_plate_touches_it(swapped, depth, touching):
    bodies = bolt_and_plate(9.0 - depth)[:: -1 if swapped else 1]
    pair = closest_features(*bodies, touching=touching)
    assert pair.status not in CROSS
    # The depth, and rounding of coordinates of some tens.
    assert pair.gap == pytest.approx(-depth, abs=1e-13) and abs(pair.normal[2]) == pytest.approx(1.0, abs=1e-12)
    assert pair.points[:, 2] == pytest.approx(5.0, abs=1.1 * depth + 1e-13)


@pytest.mark.parametrize("swapped", [False, True])
def test_a_head_in_a_plate_crosses_it(swapped):
    bodies = bolt_and_plate(9.0 - 1e-3)[:: -1 if swapped else 1]
    assert closest_features(*bodies).status in CROSS
    assert closest_features(*bolt_and_plate(9.0 - 1e-6), touching=1e-9).status in CROSS


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e6])
def test_an_overlap_is_touching_up_to_a_part_of_the_size(unit):
    size = 10.0 * unit
    a, b = (asm.Body(name, asm.shapes.box(size, size, size)) for name in "ab")
    for part, touches in ((0.0, True), (0.5, True), (2.0, False)):
        # Its diagonal is a box's size.
        over = part * 1e-7 * np.sqrt(3.0) * size
        b.pose = asm.Pose((0.3 * size, 0.1 * size, size - over))
        pair = closest_features(a, b, touching=1e-7)
        assert (pair.status is FeatureStatus.APART) == touches
        assert pair.gap == pytest.approx(-over, abs=1e-14 * size)


def test_touching_is_a_number_of_the_size():
    a, b = bolt_and_plate(20.0)
    for touching in (-1e-9, 0.1, np.nan):
        with pytest.raises(InputError, match="touching is"):
            closest_features(a, b, touching=touching)
