"""Cones in their seats are proven to touch as far as asked, and what is deeper is not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.cones import seated_answer
from assembly.proximity.clearance.deforming import smaller_answer
from tests.proximity.clearance.scenes import UPRIGHT, at, direction, poses, proof_of
from tests.proximity.clearance.turned import plug, seat, turned

TOUCHING = 1e-8


def answer_of(a, b, pose, first=UPRIGHT):
    return seated_answer(proof_of(a, b), 0, poses(pose, first), TOUCHING)


@pytest.mark.parametrize("angle", [0.1, 0.5, 1.2])
@pytest.mark.parametrize("ends", [(1.2, 1.8), (0.7, 2.5), (1.0, 2.0), (1.5, 3.0)])
def test_a_plug_in_its_seat(angle, ends):
    """It ends within the seat, at its ends, or beyond; deeper in by so many times what is called touching."""
    slope = np.tan(angle)
    block, cone = seat(slope, 1.0, 2.0, 3.0 * slope), plug(slope, *ends)
    # Along the axis, by what is so much across the wall. It is opened along the axis: of a slender one that is more.
    for off, is_proven in ((0.0, True), (-0.3, angle > 0.4), (0.3, True), (-3.0, False), (-1e4, False)):
        answer = answer_of(block, cone, at(0.0, 0.0, off * TOUCHING / np.sin(angle)))
        assert (answer is not None) == is_proven
        if answer is not None:
            assert answer.verdict is Verdict.TOUCHING and max(-off, 0.0) * TOUCHING <= answer.depth <= TOUCHING
    assert answer_of(block, cone, at(3.0 * TOUCHING / np.cos(angle), 0.0, 0.0)) is None
    assert answer_of(block, cone, at(0.0, 0.0, 0.0, Rotation.from_rotvec([20.0 * TOUCHING, 0.0, 0.0]))) is None


def test_either_body_first_and_anywhere():
    rng = np.random.default_rng(0)
    block, cone = seat(0.5, 1.0, 2.0, 2.0), plug(0.5, 1.2, 2.5)
    for _ in range(5):
        pose = at(*rng.normal(size=3), Rotation.random(rng=rng))
        assert answer_of(block, cone, pose, pose).verdict is Verdict.TOUCHING
        assert answer_of(cone, block, pose, pose).verdict is Verdict.TOUCHING
        away = pose.copy()
        away[:3] += 1e-3 * direction(rng)
        assert answer_of(block, cone, away, pose) is None


def test_a_valve_whose_stem_is_in_the_way():
    """A cone with a stem that goes on through the block: the stem crosses where it is thicker than the hole."""
    block = turned((0.5, 0.0), (2.0, 0.0), (2.0, 2.0), (1.0, 2.0), (0.5, 1.0))
    for stem, is_proven in ((0.4, True), (0.6, False)):
        valve = turned((0.0, -1.0), (stem, -1.0), (stem, 1.2), (0.6, 1.2), (1.2, 2.4), (0.0, 2.4))
        answer = answer_of(block, valve, at(0.0, 0.0, 0.0))
        assert (answer is not None) == is_proven


def test_a_countersunk_head_on_a_flush_plate():
    """A wall and a flat face that touch at once: the head's rim lies on a step of the block."""
    block = turned((0.5, 1.0), (3.0, 1.0), (3.0, 2.5), (2.0, 2.5), (2.0, 2.0), (1.0, 2.0))
    head = turned((0.0, 1.2), (0.6, 1.2), (1.0, 2.0), (1.5, 2.0), (1.5, 2.3), (0.0, 2.3))
    assert answer_of(block, head, at(0.0, 0.0, 0.0)).verdict is Verdict.TOUCHING


def test_what_is_no_cone_in_a_seat_is_left_alone():
    box = asm.shapes.box(1.0, 1.0, 1.0)
    assert answer_of(box, box, at(1.0, 0.0, 0.0)) is None
    block = seat(0.5, 1.0, 2.0, 2.0)
    assert answer_of(block, plug(0.6, 1.2, 2.5), at(0.0, 0.0, 0.0)) is None
    assert seated_answer(proof_of(block, plug(0.5, 1.2, 2.5)), 0, poses(UPRIGHT), 0.0) is None


def test_a_solve_of_a_plug_is_proven():
    base = asm.Body("base", seat(0.5, 1.0, 2.0, 2.0), fixed=True)
    body = asm.Body("plug", plug(0.5, 1.2, 2.5))
    scene = asm.Assembly([base, body])
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.proved and (solution.q[1, :3] == 0.0).all()
    assert not solution.crossings and smaller_answer(
        proof_of(seat(0.5, 1.0, 2.0, 2.0), plug(0.5, 1.2, 2.5)), 0, solution.q, TOUCHING
    )


@pytest.mark.parametrize("down", [False, True])
def test_what_comes_from_behind_a_seat_crosses_its_back(down, cases):
    """The flat faces at both ends of a conical bore are outside of the same cone, though they face opposite ways.

    A ball crosses the block where a ball's radius reaches beyond the corners and sides of its profile.
    """
    rng, radius = np.random.default_rng(1), 0.1
    corners = np.array([(0.5, 1.0), (3.0, 1.0), (3.0, 2.0), (1.0, 2.0)])
    block, ball = turned(*corners), asm.shapes.sphere(radius)
    pose = poses(UPRIGHT, UPRIGHT)[0] if not down else np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
    proof, crossed = proof_of(block, ball), 0
    sides = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.linalg.norm(sides, axis=1)[:, None]
    for _ in range(cases(60, 2000)):
        place = np.array([*rng.uniform(-3.0, 3.0, 2), rng.choice([1.0, 2.0]) + rng.uniform(-0.09, 0.09)])
        flat = np.array([np.hypot(*place[:2]), place[2]])
        inside = float(-((flat - corners) * normals).sum(axis=1).max())
        there = place * (1.0, -1.0, -1.0) if down else place
        proof.begin_anew()
        answer = proof.look(np.array([pose, [*there, 1.0, 0.0, 0.0, 0.0]]), TOUCHING)[0]
        if inside > -0.5 * radius and 0.7 < flat[0] < 2.9:
            crossed += 1
            assert answer.verdict is not Verdict.CLEAR
    assert crossed > 20
