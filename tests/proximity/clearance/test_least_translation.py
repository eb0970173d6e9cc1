"""Translations that part bodies: they do, as closed forms tell, and are about as short as the shortest there is.

How near to the shortest: of hulls within 2 in 100, of which 1e-3 is where halving stops and the rest the thickness of
first cells of what is round, 8e-3 of the size (`body_cells.TOLERANCE`).
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.least_translation import least_translation
from tests.proximity.clearance.scenes import at, direction, moved, poses, proof_of, quaternion, start_of
from tests.validation.crossing_judge import Motion, least_signed_distance

NEAR = 1.02


def length(a, b, pose):
    """That of the way out, which is proven to part."""
    proof = proof_of(a, b)
    way = least_translation(proof, 0, poses(pose))
    assert proof.look(poses(moved(pose, way)), 0.0)[0].verdict is Verdict.CLEAR
    return float(np.linalg.norm(way))


def test_boxes_side_by_side(cases):
    """Parallel: the least overlap along an axis."""
    rng = np.random.default_rng(0)
    for _ in range(cases(4, 200)):
        one, other = rng.uniform(0.4, 1.5, (2, 3))
        place = rng.uniform(-0.9, 0.9, 3) * 0.5 * (one + other)
        least = (0.5 * (one + other) - np.abs(place)).min()
        told = length(asm.shapes.box(*one), asm.shapes.box(*other), at(*place))
        assert least <= told * (1.0 + 1e-12) and told <= NEAR * least


def overlaps(one, other, turn, place):
    """Depths of two boxes along the normals of their faces and across pairs of edges: the least is that of the way."""
    ways = [*np.eye(3), *turn.T, *(np.cross(a, b) for a in np.eye(3) for b in turn.T)]
    found = []
    for n in ways:
        size = np.linalg.norm(n)
        if size < 1e-9:
            continue
        u = n / size
        found.append(0.5 * (np.abs(u) @ one + np.abs(u @ turn) @ other) - abs(u @ place))
    return min(found)


def test_boxes_any_way(cases):
    rng, tried = np.random.default_rng(1), 0
    for _ in range(cases(6, 200)):
        one, other = rng.uniform(0.4, 1.5, (2, 3))
        place, turn = rng.uniform(-0.5, 0.5, 3) * (one + other) * 0.5, quaternion(np.r_[0, 0, 0, rng.normal(size=4)])
        least = overlaps(one, other, turn.as_matrix(), place)
        if least < 0.02:
            continue
        tried += 1
        told = length(asm.shapes.box(*one), asm.shapes.box(*other), at(*place, turn))
        assert least <= told * (1.0 + 1e-12) and told <= NEAR * least
    assert tried > 3


def test_boxes_that_are_parted_across_edges():
    """The least of many local ones: between edges of both. Lower parts of hulls lead to one that is 4 in 100 longer."""
    # Found among random ones.
    rng = np.random.default_rng(1)
    for _ in range(147):
        one, other = rng.uniform(0.4, 1.5, (2, 3))
        place, turn = rng.uniform(-0.5, 0.5, 3) * (one + other) * 0.5, quaternion(np.r_[0, 0, 0, rng.normal(size=4)])
    least = overlaps(one, other, turn.as_matrix(), place)
    told = length(asm.shapes.box(*one), asm.shapes.box(*other), at(*place, turn))
    assert least <= told * (1.0 + 1e-12) and told <= (1.0 + 1e-5) * least


def test_balls(cases):
    rng = np.random.default_rng(2)
    for _ in range(cases(2, 100)):
        a, b = rng.uniform(0.3, 1.0, 2)
        place = rng.uniform(0.1, 0.8) * (a + b) * direction(rng)
        least = a + b - float(np.linalg.norm(place))
        told = length(asm.shapes.sphere(a), asm.shapes.sphere(b), at(*place))
        assert least <= told * (1.0 + 1e-12) and told <= NEAR * least


@pytest.mark.parametrize("place", [(0.1, 0.2, 0.3), (0.0, 0.0, 0.0)])
def test_a_ball_within_a_box(place):
    half, radius = np.array([2.0, 1.75, 1.5]), 0.4
    least = (half - np.abs(place)).min() + radius
    told = length(asm.shapes.box(*(2.0 * half)), asm.shapes.sphere(radius), at(*place))
    assert least <= told * (1.0 + 1e-12) and told <= NEAR * least
    # And the box from around the ball.
    told = length(asm.shapes.sphere(radius), asm.shapes.box(*(2.0 * half)), at(*(-np.array(place))))
    assert least <= told * (1.0 + 1e-12) and told <= NEAR * least


def test_a_peg_that_grazes_its_hole():
    """It is out of the wall of the hole by 0.05; out of the plate it would be 0.65 or more."""
    plate = asm.shapes.plate(3.0, 2.0, 0.3, [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)])
    peg = asm.shapes.solid_cylinder(0.3, 1.0)
    told = length(plate, peg, at(-0.7 + 0.25, 0.0, 0.0))
    assert 0.05 <= told * (1.0 + 1e-12) and told <= NEAR * 0.05


def test_a_peg_through_a_plate():
    """Not in a hole: along its axis."""
    plate, peg = asm.shapes.box(3.0, 3.0, 0.3), asm.shapes.solid_cylinder(0.3, 1.0)
    told = length(plate, peg, at(0.0, 0.0, 0.1))
    assert 0.55 <= told * (1.0 + 1e-12) and told <= NEAR * 0.55


def test_random_pairs_are_parted(cases):
    """The judge finds them apart; a way is found nearly always, no longer than that of a ball around both."""
    tried = found = 0
    for number in range(cases(12, 1000)):
        begin = start_of(number)
        if begin.distance > -1e-6:
            continue
        tried += 1
        way = least_translation(proof_of(begin.a.shape, begin.b.shape), 0, poses(begin.pose))
        if way is None:
            continue
        found += 1
        pose = moved(begin.pose, way)
        assert least_signed_distance(begin.a, begin.b, Motion.of(pose)) > -1e-10, begin
        assert np.linalg.norm(way) < begin.a.size + begin.b.size
    assert tried >= 4 and found >= 0.95 * tried
