"""Bodies that lie on each other and are in each other by little more than touching: that they cross is found."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm

SIZE = 2.0


def cavity():
    """A block of 4 with a closed cavity of 2."""
    outer = [side.face for side in asm.Body("outer", asm.shapes.box(4, 4, 4)).faces]
    inner = []
    for side in asm.Body("inner", asm.shapes.box(SIZE, SIZE, SIZE)).faces:
        inner.append(asm.Face(side.face.surface, reversed=True, name=f"cavity {side.name}"))
    return asm.Body("block", [*outer, *inner], fixed=True)


def scene(extra, shift, turn=(1.0, 0.0, 0.0, 0.0)):
    box = asm.Body("box", asm.shapes.box(*(SIZE + np.asarray(extra))), shift, turn)
    found = asm.Assembly([cavity(), box])
    found.constrain(asm.Clearance())
    return found


@pytest.mark.parametrize("e", [1e-7, 1e-6, 3e-6])
@pytest.mark.parametrize("axis", [0, 2])
def test_a_box_that_is_larger_than_its_cavity_crosses(e, axis):
    """By 2 e at one side, flush at the other: deeper than touching, some 1e-8. It fits nowhere but out of the block."""
    unit = np.eye(3)[axis]
    crossing = scene(2.0 * e * unit, e * unit)
    solution = crossing.solve()
    assert solution.success and solution.proved
    assert np.abs(solution.pose("box").position).max() >= 2.0 + 0.5 * SIZE - 1e-8


def test_one_that_fits_is_not_said_to_cross():
    for extra, shift in (((0, 0, 0), (0, 0, 0)), ((-1e-6,) * 3, (5e-7,) * 3), ((1e-9, 0, 0), (0, 0, 0))):
        fits = scene(extra, shift)
        solution = fits.solve()
        assert solution.success and (solution.q == fits.q).all() and not solution.crossings


def test_planes_that_overlap_beside_bodies_are_no_crossing():
    """Two thin plates side by side: their far sides face each other from inside, but nothing is in both."""
    a = asm.Body("a", asm.shapes.box(2, 2, 1e-4), fixed=True)
    b = asm.Body("b", asm.shapes.box(2, 2, 1e-4), (2.0 + 1e-6, 0, 5e-5))
    side = asm.Assembly([a, b])
    side.constrain(asm.Clearance())
    solution = side.solve()
    assert solution.success and solution.proved and (solution.q == side.q).all()
