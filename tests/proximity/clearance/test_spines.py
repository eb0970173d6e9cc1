"""Distances of two spines are lower bounds of those of samples, and exact where their nearest points are.

Kernels are run as plain Python. Pieces are those of random wires, halved some times, at random poses.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import rows_of
from assembly.geometry.shapes.path import Path
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.clearance.answers import Verdict, is_proven
from assembly.proximity.clearance.front import Parted
from assembly.proximity.clearance.records import BY_SPINES, NODE, NODES, WIRE
from assembly.proximity.clearance.spines import (
    both_radii,
    least_curvature,
    loss_on_way,
    piece_of,
    point_at,
    spine_distance,
    spine_gap,
    squared_at,
)
from assembly.proximity.clearance.way import pose_at, sag_of, way_of
from tests.proximity.clearance.nodes import forest_of, halve_all, leaves, tree_of
from tests.proximity.clearance.scenes import at, direction, faces_of, poses, proof_of
from tests.proximity.clearance.test_separation import packed, random_turn, relative

# Sums of a few products of coordinates of order one.
ROUNDING = 1e-13
WIRES = [
    asm.shapes.pipe(Path().line(1.0), 0.2),
    asm.shapes.pipe(Path().line(1.0).arc(0.5, 3.0, toward=(1, 0, 0)).line(0.4), 0.1),
    asm.shapes.torus(0.8, 0.15),
]


RADIUS, WIDE = 1.0, 0.2
RING = asm.shapes.torus(RADIUS, WIDE)


def wires(rng, halvings):
    """A forest of two random wires, and the pieces that they have after some halvings."""
    forest = forest_of(*(faces_of(WIRES[rng.integers(len(WIRES))]) for _ in range(2)))
    for _ in range(halvings):
        halve_all(forest, rng)
    links, _ = tree_of(forest)
    rows, last = leaves(forest), max(forest.roots)
    first = min(forest.roots)
    # The cells made later are behind those of both bodies; which body's they are is told by their faces.
    of_second = links.face[rows] >= 1
    assert first < last and (links.form[rows] == WIRE).all()
    return packed(forest), rows[~of_second], rows[of_second]


def pairs(cases, seed, halvings=2):
    """Random pairs of pieces, and a pose of the second, near the first."""
    rng = np.random.default_rng(seed)
    for _ in range(cases(12, 600)):
        forest, first, second = wires(rng, rng.integers(halvings + 1))
        for _ in range(12):
            a, b = int(rng.choice(first)), int(rng.choice(second))
            turn = random_turn(rng)
            one, other = piece_of(forest, a, IDENTITY), piece_of(forest, b, IDENTITY)
            way = direction(rng) * rng.choice([0.25, 0.5, 1.0])
            shift = np.array(one.middle) + way - turn.apply(other.middle)
            yield rng, forest, a, b, turn, shift


def points_on(piece, count):
    """Points of a piece at equal distances, ends included."""
    return np.array([point_at(piece, s)[0] for s in np.linspace(-piece.half, piece.half, count)])


def test_pieces_are_arcs_by_their_length():
    """Derivatives by sixth-order differences, the length of tangents, and where a piece ends."""
    rng, step = np.random.default_rng(1), 1e-2
    factors = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0 / step
    places = step * np.array([-3, -2, -1, 1, 2, 3])
    for _ in range(20):
        forest, first, _ = wires(rng, rng.integers(3))
        k = int(rng.choice(first))
        piece = piece_of(forest, k, relative(random_turn(rng), direction(rng)))
        for s in (0.0, 0.4 * piece.half, -piece.half):
            _, tangent, bent = point_at(piece, s)
            # Of arcs of curvature 2 and less the seventh derivative is 64 at most: step^6 64 / 140.
            slope = factors @ [point_at(piece, s + d)[0] for d in places]
            turn = factors @ [point_at(piece, s + d)[1] for d in places]
            assert np.abs(slope - tangent).max() < 1e-11 and np.abs(turn - bent).max() < 2e-11
            assert np.linalg.norm(tangent) == pytest.approx(1.0, abs=1e-14)
        ends = points_on(piece_of(forest, k, IDENTITY), 2)
        assert np.abs(ends - rows_of(NODE, forest.nodes)[k].corner[:2]).max() < ROUNDING


def test_derivatives_of_the_squared_distance(cases):
    """First and second ones by sixth-order differences of those before."""
    step = 1e-2
    factors = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0 / step
    places = step * np.array([-3, -2, -1, 1, 2, 3])
    for rng, forest, a, b, turn, shift in pairs(cases, 2):
        one, other = piece_of(forest, a, IDENTITY), piece_of(forest, b, relative(turn, shift))
        s, t = rng.uniform(-1, 1, 2) * (one.half, other.half)
        f = squared_at(one, other, s, t)
        along_s = factors @ [squared_at(one, other, s + d, t) for d in places]
        along_t = factors @ [squared_at(one, other, s, t + d) for d in places]
        assert along_s[0] == pytest.approx(f.s, abs=1e-10) and along_t[0] == pytest.approx(f.t, abs=1e-10)
        assert along_s[1] == pytest.approx(f.ss, abs=1e-10) and along_t[2] == pytest.approx(f.tt, abs=1e-10)
        assert along_s[2] == pytest.approx(f.st, abs=1e-10) and along_t[1] == pytest.approx(f.st, abs=1e-10)


def test_second_derivatives_are_bounded(cases):
    """The least eigenvalue of the second derivatives at samples of both pieces; some are convex, and some are not.

    Of smaller pieces the bound is nearer to what it bounds.
    """
    convex, concave = 0, 0
    for _, forest, a, b, turn, shift in pairs(cases, 3):
        one, other = piece_of(forest, a, IDENTITY), piece_of(forest, b, relative(turn, shift))
        bound = least_curvature(one, other)
        assert bound <= 0.0
        convex, concave = convex + (bound == 0.0), concave + (-math.inf < bound < 0.0)
        for s in np.linspace(-one.half, one.half, 9):
            for t in np.linspace(-other.half, other.half, 9):
                f = squared_at(one, other, s, t)
                assert np.linalg.eigvalsh([[f.ss, f.st], [f.st, f.tt]])[0] >= bound - ROUNDING
    assert convex > 40 and concave > 10


@pytest.mark.parametrize("gap", [1e-3, 1e-5, 1e-7])
def test_wires_that_bend_alike_are_parted_by_few_pieces(gap):
    """Arcs about one center: half of their squared distance is convex nowhere, and has an eigenvalue of zero.

    What is lost to that is of the third order in the lengths of pieces. Their number goes with the third root of the
    gap: 24 to 28 over it; where pieces had to be parted by planes it was 40 to 190, and more than may be for 1e-7.
    """
    outer, inner = (asm.shapes.pipe(Path().arc(bend, 1.0, toward=(1, 0, 0)), 0.5) for bend in (3.75, 2.75 - gap))
    proof = proof_of(faces_of(outer), faces_of(inner))
    (answer,) = proof.look(poses(at(1.0 + gap, 0.0, 0.0)), 0.0)
    assert answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= gap + ROUNDING
    assert proof.fronts.counts.sought[0] < 35.0 * gap ** (-1.0 / 3.0)


def test_distances_are_lower_bounds_and_exact(cases):
    """Beside samples of both pieces, and of those around the places that are told; chords are off by their sags."""
    known, bounded = 0, 0
    for _, forest, a, b, turn, shift in pairs(cases, 4):
        pose = relative(turn, shift)
        one, other = piece_of(forest, a, IDENTITY), piece_of(forest, b, pose)
        bound, s, t = spine_distance(forest, a, b, pose, 0.0, 0.0)
        if bound == -math.inf:
            continue
        known += 1
        x, y = points_on(one, 60), points_on(other, 60)
        assert bound <= np.linalg.norm(x[:, None] - y, axis=-1).min() + ROUNDING
        assert abs(s) <= one.half and abs(t) <= other.half
        if least_curvature(one, other) < 0.0:
            bounded += 1
            continue
        # From any start the same, and it is the distance of the points that are told.
        again, _, _ = spine_distance(forest, a, b, pose, one.half, -other.half)
        told = math.dist(point_at(one, s)[0], point_at(other, t)[0])
        assert bound == pytest.approx(again, abs=ROUNDING) and bound == pytest.approx(told, abs=ROUNDING)
    assert known - bounded > 40 and bounded > 5


def test_ways_lose_no_more_than_is_told(cases):
    """The least distance of samples of two spines at poses of a way, beside that at both of its ends."""
    known, tight = 0, 0.0
    for rng, forest, a, b, turn, shift in pairs(cases, 5):
        before = relative(turn, shift)
        size = rng.choice([1e-3, 1e-2, 0.1])
        after = relative(
            Rotation.from_rotvec(size * direction(rng)) * turn, shift + size * rng.uniform(0.0, 1.0) * direction(rng)
        )
        # The middle about which the second body turns is anywhere in it.
        way = way_of(before, after, tuple(rng.uniform(-0.5, 0.5, 3).tolist()), 3.0, True)
        nodes = Parted(a, b, BY_SPINES)
        gaps = [spine_gap(forest, nodes, pose, (0.0, 0.0, 0.0))[0] for pose in (before, after)]
        if min(gaps) == -math.inf:
            continue
        loss = loss_on_way(forest, nodes, way, min(gaps), sag_of(way, forest, b))
        if loss == math.inf:
            continue
        known += 1
        x = points_on(piece_of(forest, a, IDENTITY), 40)
        for part in np.linspace(0.0, 1.0, 9):
            y = points_on(piece_of(forest, b, pose_at(way, part)), 40)
            gap = np.linalg.norm(x[:, None] - y, axis=-1).min() - both_radii(forest, a, b)
            assert gap >= min(gaps) - loss - ROUNDING
            tight = max(tight, (min(gaps) - gap) / loss if loss > 0.0 else 0.0)
    assert known > 40
    # It is a bound of what happens, and not of something far larger.
    assert tight > 0.05


def linked(gap):
    """Poses of two rings, their circles in planes across each other, each through the other; their gap."""
    return poses(at(2.0 * RADIUS - 2.0 * WIDE - gap, 0.0, 0.0, Rotation.from_euler("x", 90, degrees=True)))


@pytest.mark.parametrize("gap", [1e-2, 1e-6, 1e-10, 0.0])
def test_rings_that_all_but_touch_take_few_pairs(gap):
    """Two linked rings: few pairs of cells however near they are, and a bound that is one."""
    proof = proof_of(RING, RING)
    proof.make_slimmer(1e-9)
    (answer,) = proof.look(linked(gap), 1e-9)
    assert answer.verdict is (Verdict.CLEAR if gap > 0.0 else Verdict.TOUCHING)
    assert -1.1e-9 <= answer.bound <= gap + 1e-12
    assert int(proof.fronts.counts.count[0]) < 150
    links = rows_of(NODES, proof.fronts.nodes[0][: int(proof.fronts.counts.count[0])])
    assert (links.how == BY_SPINES).any()


def test_rings_in_each_other_are_not_clear():
    """By more than they may be slimmer: told with a depth that is none too large."""
    proof = proof_of(RING, RING)
    proof.make_slimmer(1e-9)
    (answer,) = proof.look(linked(-1e-6), 1e-9)
    assert answer.verdict is Verdict.CROSSING and 0.0 < answer.depth <= 1e-6 + 1e-12


def test_nothing_is_in_another_that_may_not_be_slimmer():
    """A proof of touching ends with the promise that it was made for."""
    proof = proof_of(RING, RING)
    for depth, proven in ((1e-9, True), (0.0, False), (1e-9, True)):
        proof.make_slimmer(depth)
        (answer,) = proof.look(linked(-5e-10), 1e-9, budget=500)
        assert is_proven(answer) is proven
    assert proof.stays_clear(linked(-6e-10), 1e-9, np.zeros((1, 6)))
    assert not proof.stays_clear(linked(-2e-9), 1e-9, np.zeros((1, 6)))


@pytest.mark.parametrize(("radius", "touching"), [(0.1, 1e-9), (1e-4, 1e-3)])
@pytest.mark.parametrize("off", [2.0, 2.5, 4.0])
def test_no_way_leads_through_a_wire(radius, touching, off):
    """From one side of a wire to the other one: midway spines cross, of which both ends tell nothing.

    Nor does it where more than a wire is thick is called touching.
    """
    wire = asm.shapes.pipe(Path((0, 0, -1)).line(2.0), radius)
    proof, turn = proof_of(wire, wire), Rotation.from_rotvec([1.2, 0.0, 0.0])
    proof.make_slimmer(touching)
    begin, end = (poses(at(x * radius, 0.0, 0.0, turn)) for x in (off, -off))
    assert is_proven(proof.look(begin, touching)[0])
    assert not is_proven(proof.look(end, touching, swept=True)[0])
    assert not proof.stays_clear(end, touching, np.zeros((1, 6)), at_once=True)
    # They pass where nobody asks for the way.
    proof.forget_poses()
    assert is_proven(proof.look(end, touching)[0])
