"""Translations that part bodies: they do, as closed forms tell, and are about as short as the shortest there is.

How near to the shortest: of hulls within 2 in 100, of which 1e-3 is where halving stops and the rest the thickness of
first cells of what is round and trimmed, 8e-3 of the size (`body_cells.TOLERANCE`). Of boxes, balls and cylinders the
hull is exact, and so is the way but for 2e-6 of the bodies' sizes, by which it is made longer to be clear.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hull_depths import HullDepths
from assembly.proximity.clearance.least_translation import least_translation
from tests.proximity.clearance.scenes import at, direction, moved, poses, proof_of, quaternion, start_of
from tests.validation.crossing_judge import Motion, least_signed_distance

NEAR = 1.02
EXACT = 1.0 + 3e-5


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


def cylinders_apart(one, other, place):
    """The least translation of parallel cylinders of (radius, height) that part: across or along their axes."""
    return min(one[0] + other[0] - np.hypot(*place[:2]), 0.5 * (one[1] + other[1]) - abs(place[2]))


def test_parallel_cylinders(cases):
    rng = np.random.default_rng(3)
    for _ in range(cases(6, 100)):
        one, other = rng.uniform(0.4, 1.5, (2, 2))
        place = rng.uniform(-0.4, 0.4, 3) * [one[0] + other[0], one[0] + other[0], one[1] + other[1]]
        least = cylinders_apart(one, other, place)
        told = length(asm.shapes.solid_cylinder(*one), asm.shapes.solid_cylinder(*other), at(*place))
        assert least <= told * (1.0 + 1e-12) and told <= EXACT * least


@pytest.mark.parametrize(
    ("shape", "least"),
    [
        (asm.shapes.box(2.0, 3.0, 4.0), 2.0),
        (asm.shapes.sphere(1.0), 2.0),
        (asm.shapes.solid_cylinder(5.0, 12.0), 10.0),
        # Out along the axis: what is beside holes is flat.
        (asm.shapes.plate(50.0, 20.0, 6.0, [(-15.0, 0.0, 5.05), (15.0, 0.0, 5.05)]), 6.0),
        # Each ring would have to leave the other's tube; along the axis that is its thickness.
        (asm.shapes.torus(3.0, 1.0), 2.0),
    ],
)
def test_two_equal_bodies_in_one_place(shape, least):
    """Their faces lie on each other along many ways, of which no look tells anything: few are made, and short ones."""
    proof, looks = proof_of(shape, shape), []
    proof.look, look = lambda *args, **options: looks.append(options) or look(*args, **options), proof.look
    way = least_translation(proof, 0, poses(at(0.0, 0.0, 0.0)))
    told = float(np.linalg.norm(way))
    assert look(poses(moved(at(0.0, 0.0, 0.0), way)), 0.0)[0].verdict is Verdict.CLEAR
    assert least <= told * (1.0 + 1e-12) and told <= EXACT * least
    assert len(looks) <= 60 and sum(options["budget"] is None for options in looks) == 1


def test_linked_rings_are_parted_across_their_tubes():
    """One is turned by a right angle and moved by 4.1; from 2 to 4 their tubes would be clear of each other."""
    ring = asm.shapes.torus(3.0, 1.0)
    turn = quaternion(np.r_[0, 0, 0, np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
    told = length(ring, ring, at(4.1, 0.0, 0.0, turn))
    # Out of each other it would be 4 or more.
    assert 0.1 <= told * (1.0 + 1e-12) and told <= 1.5 * 0.1


@pytest.mark.parametrize("top", [0.0, 0.3, 1.6])
def test_hulls_of_cones_are_exact(top):
    """Along any direction a cone and a ball are parted as their end circles and its radius tell."""
    rng, profile = np.random.default_rng(5), [(0, 0), (1, 0), (top, 2), (0, 2)]
    cone = asm.shapes.revolution(asm.curves.polygon(profile if top > 0.0 else profile[:2] + profile[3:]))
    cells = proof_of(cone, asm.shapes.sphere(0.5)).cells_of_both(0)
    shift = rng.normal(size=3)
    ways = np.array([direction(rng) for _ in range(50)])
    across = np.hypot(ways[:, 0], ways[:, 1])
    highest = np.maximum(across, top * across + 2.0 * ways[:, 2])
    told = HullDepths(*cells, np.eye(3), shift).depths(ways)
    assert told == pytest.approx(highest + 0.5 - ways @ shift, abs=1e-9)
