"""Bodies that lie on each other and are in each other by little more than touching: that they cross is found."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.overlapped import balls_answer, overlap_answer
from tests.proximity.clearance.scenes import at, poses, proof_of

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


def test_far_sides_of_thin_parts_are_no_crossing():
    """A thin plate below another one: the top of the upper and the bottom of the lower face each other from inside."""
    thin = asm.shapes.box(2.0, 2.0, 1e-4)
    for height, answer in ((-2e-4, None), (-5e-5, Verdict.CROSSING)):
        proof = proof_of(thin, thin)
        found = overlap_answer(proof, 0, poses(at(0.1, 0.2, height)), 1e-8)
        assert (found and found.verdict) is answer
        if found:
            # Inside of both, as deep as the planes are in each other.
            assert found.depth == pytest.approx(1e-4 + height, rel=1e-9)
            assert -5e-5 < found.place[2] < 5e-5 + height


@pytest.mark.parametrize(
    ("shape", "least"),
    [
        (asm.shapes.box(2.0, 3.0, 4.0), 2.0),
        (asm.shapes.solid_cylinder(5.0, 12.0), 10.0),
        (asm.shapes.torus(3.0, 1.0), 2.0),
    ],
)
def test_two_equal_bodies_in_one_place_cross_and_are_parted(shape, least):
    """All their faces lie on each other. As deep as balls inside of both overlap, which no way out is shorter than."""
    proof, q = proof_of(shape, shape), poses(at(0.0, 0.0, 0.0))
    told = balls_answer(proof, 0, q, 1e-8)
    assert told is not None and told.verdict is Verdict.CROSSING and 0.4 * least < told.depth <= least
    twins = asm.Assembly([asm.Body("a", shape), asm.Body("b", shape, fixed=True)])
    twins.constrain(asm.Clearance())
    solution = twins.solve()
    assert solution.success and solution.proved
    assert least * (1.0 - 1e-6) <= np.linalg.norm(solution.pose("a").position) <= 1.5 * least


def test_bodies_that_touch_are_not_said_to_cross():
    box = asm.shapes.box(2.0, 3.0, 4.0)
    assert balls_answer(proof_of(box, box), 0, poses(at(2.0, 0.3, 0.2)), 1e-8) is None
