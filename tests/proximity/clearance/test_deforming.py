"""Bodies that hold each other without play are proven to touch as far as asked, and what is thicker is not."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.shapes.plane_curves import polygon
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.body_cells import cells_of_body
from assembly.proximity.clearance.deforming import _farthest, _mapped, deformed_answer
from tests.proximity.clearance.scenes import at, faces_of, poses, proof_of
from tests.proximity.clearance.splines import shapes

SHAPES = shapes()
TOUCHING = 1e-6


def slot(width):
    """A groove of depth 1 along z, with its floor at y = 0."""
    w = 0.5 * width
    corners = [(-2, -1), (2, -1), (2, 1), (w, 1), (w, 0), (-w, 0), (-w, 1), (-2, 1)]
    return asm.shapes.extrusion(polygon(corners), 4.0)


def dovetail(wider, depth=1.0):
    """A groove that is wider at its floor, and what fills it."""
    top, low = 1.0, 1.0 + wider
    groove = [(-3, -2), (3, -2), (3, 0), (top, 0), (low, -depth), (-low, -depth), (-top, 0), (-3, 0)]
    slide = [(-low, -depth), (low, -depth), (top, 0), (top, 0.5), (-top, 0.5), (-top, 0)]
    return asm.shapes.extrusion(polygon(groove), 6.0), asm.shapes.extrusion(polygon(slide), 2.0)


def pocket():
    """A slot that is closed at one end by a wall: two bodies' faces hold a box from five sides."""
    return asm.shapes.extrusion(
        polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)]), 1.0, [polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)])]
    )


def answer_of(a, b, pose, touching=TOUCHING):
    return deformed_answer(proof_of(a, b), 0, poses(pose), touching)


@pytest.mark.parametrize("name", ["pin", "plate", "ball", "torus", "sheet"])
def test_no_point_goes_farther_than_told(name):
    rng = np.random.default_rng(0)
    faces = faces_of(SHAPES[name])
    matrix, offset = 0.01 * rng.normal(size=(3, 3)), 0.01 * rng.normal(size=3)
    far, most = _farthest(cells_of_body(faces), matrix, offset), 0.0
    mapped = _mapped(faces, tuple(matrix.ravel().tolist()), tuple(offset.tolist()))
    for face, other in zip(faces, mapped, strict=True):
        u, v = (rng.uniform(*ends, 500) for ends in face.surface.domain)
        before, after = face.surface.evaluate(u, v), other.surface.evaluate(u, v)
        assert after == pytest.approx(before + before @ matrix.T + offset, abs=1e-13)
        within = face.contains(u, v) if face.boundary else np.ones(500, dtype=bool)
        most = max(most, float(np.linalg.norm(after - before, axis=1)[within].max(initial=0.0)))
    assert 0.5 * far < most <= far


@pytest.mark.parametrize("thicker", [0.0, 0.3, 0.9, 3.0, 100.0, -0.3])
def test_a_key_in_a_slot(thicker):
    """One that is thicker by so many times what is called touching is in both flanks by half of that."""
    key = asm.shapes.box(1.0 + thicker * TOUCHING, 0.6, 2.0)
    answer = answer_of(slot(1.0), key, at(0.0, 0.3, 0.1))
    if thicker < 1.0:
        assert answer is not None and answer.verdict is Verdict.TOUCHING
        assert 0.5 * thicker * TOUCHING <= answer.depth <= TOUCHING
    elif thicker > 2.0:
        assert answer is None


@pytest.mark.parametrize("wider", [0.3, 0.0])
def test_a_dovetail(wider):
    groove, slide = dovetail(wider)
    # With a floor and two flanks that lean in no translation opens all.
    assert answer_of(groove, slide, at(0.0, 0.0, 1.5)).verdict is Verdict.TOUCHING
    assert answer_of(groove, slide, at(0.0, 3.0 * TOUCHING, 1.5)) is None or wider == 0.0
    assert answer_of(groove, slide, at(3.0 * TOUCHING, 0.0, 1.5)) is None
    # The other way around it is the groove that is mapped.
    assert deformed_answer(proof_of(slide, groove), 0, poses(at(0.0, 0.0, -1.5)), TOUCHING).verdict is Verdict.TOUCHING


def test_a_box_that_fills_a_pocket():
    box = asm.shapes.box(2.0, 2.0, 1.0)
    answer = answer_of(pocket(), box, at(0.0, 0.0, 0.2))
    assert answer.verdict is Verdict.TOUCHING
    assert answer_of(pocket(), asm.shapes.box(2.0, 2.001, 1.0), at(0.0, 0.0, 0.2)) is None


def test_what_does_not_lie_on_each_other_is_left_alone():
    box = asm.shapes.box(1.0, 1.0, 1.0)
    assert answer_of(box, box, at(1.0 + 1e-3, 0.0, 0.0)) is None
    assert answer_of(box, box, at(0.2, 0.1, 0.3)) is None
    assert answer_of(slot(1.0), asm.shapes.box(1.0, 0.6, 2.0), at(0.0, 0.3, 0.1), 0.0) is None


def test_a_solve_of_a_key_is_proven():
    base, key = asm.Body("base", slot(1.0), fixed=True), asm.Body("key", asm.shapes.box(1.0, 0.6, 2.0), (0.0, 0.3, 0.1))
    scene = asm.Assembly([base, key])
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.proved and (solution.q[1, :3] == (0.0, 0.3, 0.1)).all()
    assert not solution.crossings


@pytest.mark.parametrize("shape", [asm.shapes.solid_cylinder(0.5, 2.0), asm.shapes.sphere(0.5)])
def test_what_is_round_between_two_flanks(shape):
    """A roller and a ball of a slot's width, on its floor or over it, touch; a little farther in they do not."""
    for height in (0.5, 0.7):
        assert answer_of(slot(1.0), shape, at(0.0, height, 0.1)).verdict is Verdict.TOUCHING
    assert answer_of(slot(1.0), shape, at(0.0, 0.5 - 3.0 * TOUCHING, 0.1)) is None
    assert answer_of(slot(1.0), shape, at(3.0 * TOUCHING, 0.5, 0.1)) is None
    base, body = asm.Body("base", slot(1.0), fixed=True), asm.Body("round", shape, (0.0, 0.5, 0.1))
    scene = asm.Assembly([base, body])
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.proved and (solution.q[1, :3] == (0.0, 0.5, 0.1)).all()
