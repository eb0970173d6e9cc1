"""Bodies made slimmer: no point goes farther than asked, and a pin in its bore touches to what is called so."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.body_cells import cells_of_body
from assembly.proximity.clearance.slimming import _across, _radius, _slimmer, slim_answer
from tests.proximity.clearance.scenes import UPRIGHT, at, faces_of, poses, proof_of
from tests.proximity.clearance.splines import shapes

SHAPES = shapes()


@pytest.mark.parametrize("name", ["pin", "plate", "ball", "torus", "sheet"])
def test_no_point_goes_farther_than_asked(name):
    rng = np.random.default_rng(0)
    faces = faces_of(SHAPES[name])
    for ends in (rng.normal(size=(2, 3)), np.tile(rng.normal(size=3), (2, 1))):
        center, across = ends.mean(axis=0), _across(ends)
        radius = _radius(cells_of_body(faces), center, across)
        slim = _slimmer(faces, tuple(center), tuple(across.ravel()), 0.01)
        most = 0.0
        for face, other in zip(faces, slim, strict=True):
            u, v = (rng.uniform(*ends, 500) for ends in face.surface.domain)
            before, after = face.surface.evaluate(u, v), other.surface.evaluate(u, v)
            assert after == pytest.approx(before - 0.01 * (before - center) @ across, abs=1e-13)
            within = face.contains(u, v) if face.boundary else np.ones(500, dtype=bool)
            most = max(most, float(np.linalg.norm(after - before, axis=1)[within].max(initial=0.0)))
        # A bound, and no more than cells are off.
        assert 0.4 * 0.01 * radius < most <= 0.01 * radius * (1.0 + 1e-12)


def answer_of(plate, pin, pose, touching):
    return slim_answer(proof_of(plate, pin), 0, poses(pose), touching, (faces_of(plate), faces_of(pin)))


@pytest.mark.parametrize("off", [0.0, 0.4, 1.2, 5.0])
def test_a_pin_in_a_bore_of_its_radius_touches_as_far_as_asked(off):
    """Beside the axis by so many times what is called touching it is in the wall by as much."""
    touching = 1e-4
    plate, pin = asm.shapes.plate(3.0, 2.0, 0.3, [(0.2, 0.1, 0.5)]), asm.shapes.solid_cylinder(0.5, 1.0)
    pose = at(0.2 + off * touching, 0.1, 0.05)
    answer = answer_of(plate, pin, pose, touching)
    if off < 0.9:
        assert answer is not None and answer.verdict is Verdict.TOUCHING
        assert off * touching <= answer.depth <= touching
    else:
        assert answer is None
    # The same with the bodies exchanged.
    answer = slim_answer(proof_of(pin, plate), 0, poses(UPRIGHT, pose), touching, (faces_of(pin), faces_of(plate)))
    assert (answer is not None) == (off < 0.9)


def test_what_fills_no_bore_is_left_alone():
    a, b = asm.shapes.box(1.0, 1.0, 1.0), asm.shapes.box(1.0, 1.0, 1.0)
    assert answer_of(a, b, at(1.0, 0.0, 0.0), 1e-4) is None
