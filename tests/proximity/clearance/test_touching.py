"""Bodies that touch: proven to do no more by a move that opens their contacts, and crossing where they are in by more.

Places are exact in closed form, so that gaps are zero but for rounding, which is 1e-16 of coordinates of about 1; a
thousandth of what is called touching, 1e-9.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.clearance.answers import Contacts, Verdict, is_proven
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.clearance.touching import left_open, move_apart, off_contacts
from tests.proximity.clearance.scenes import at, direction, faces_of, poses, proof_of

TOUCHING = 1e-9
UP = [0.0, 0.0, 1.0]
PLATE = asm.shapes.plate(3.0, 2.0, 0.3, [(-0.7, 0.0, 0.5), (0.7, 0.1, 0.4)])
CORNERS = 0.5 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])


def at_corners(x, y, z):
    return np.column_stack([CORNERS * [1.0, 0.8] + [x, y], np.full(4, z)])


# First and second shape, where the second is, normals from the first to it, and places.
SCENES = {
    "box on plate": (PLATE, asm.shapes.box(1.0, 0.8, 0.5), (0.0, 0.3, 0.4), UP, at_corners(0.0, 0.3, 0.15)),
    "ball on plane": (PLATE, asm.shapes.sphere(0.4), (0.0, 0.8, 0.55), UP, [[0.0, 0.8, 0.15]]),
    "torus on plane": (
        asm.shapes.box(3.0, 3.0, 0.5),
        asm.shapes.torus(0.6, 0.15),
        (0.1, 0.2, 0.4),
        UP,
        [[0.1 + 0.6 * np.cos(a), 0.2 + 0.6 * np.sin(a), 0.25] for a in np.arange(0.0, 6.0, 0.7)],
    ),
    "pin in a bore": (
        PLATE,
        asm.shapes.solid_cylinder(0.25, 1.0),
        (0.7 + 0.15, 0.1, 0.1),
        [-1.0, 0.0, 0.0],
        [[1.1, 0.1, -0.15], [1.1, 0.1, 0.15]],
    ),
    "boxes side by side": (
        asm.shapes.box(1.0, 0.8, 0.5),
        asm.shapes.box(1.0, 0.8, 0.5),
        (1.0, 0.0, 0.0),
        [1.0, 0.0, 0.0],
        [[0.5, y, z] for y in (-0.4, 0.4) for z in (-0.25, 0.25)],
    ),
    "rod on rod": (
        asm.shapes.solid_cylinder(0.3, 2.0),
        asm.shapes.solid_cylinder(0.2, 2.0),
        (0.5, 0.0, 0.1),
        [1.0, 0.0, 0.0],
        [[0.3, 0.0, -0.9], [0.3, 0.0, 1.0]],
    ),
}


def scene(name, off=0.0, turned=None):
    """The proof of a scene whose second body is moved off along the normal, poses, and contacts.

    Both bodies, and with them contacts, may be turned about the origin.
    """
    first, second, place, normal, places = SCENES[name]
    n = np.array(normal)
    turn = Rotation.identity() if turned is None else turned
    q = poses(at(*turn.apply(np.array(place) + off * n), turn), at(0.0, 0.0, 0.0, turn))
    points = np.array(places) + off * n
    contacts = Contacts(turn.apply(np.tile(n, (len(points), 1))), turn.apply(points), np.full(len(points), off))
    return proof_of(first, second), q, contacts


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("turned", [False, True])
def test_bodies_that_touch(name, turned):
    turn = Rotation.from_rotvec([0.4, -0.7, 1.1]) if turned else None
    proof, q, contacts = scene(name, turned=turn)
    move = move_apart(proof, 0, q, contacts, TOUCHING)
    (answer,) = proof.look(q, TOUCHING, move[None])
    assert answer.verdict is Verdict.TOUCHING and is_proven(answer)
    assert 0.0 < answer.depth <= TOUCHING
    # They are moved by what they are said to be, at most, and opened.
    assert answer.depth == proof.move_length(0, q, move)
    assert answer.bound < 0.0 + TOUCHING
    # As they are no gap is proven; that they cross is not either.
    assert proof_of(*SCENES[name][:2]).look(q, TOUCHING)[0].verdict in (Verdict.UNDECIDED, Verdict.CLEAR)


@pytest.mark.parametrize("name", SCENES)
def test_bodies_that_are_in_each_other(name):
    """By 1e-6: no move by what is called touching opens them, and they are found to cross."""
    proof, q, contacts = scene(name, off=-1e-6)
    assert move_apart(proof, 0, q, contacts, TOUCHING) is None
    (answer,) = proof.look(q, TOUCHING)
    if name in ("boxes side by side", "box on plate"):
        # Flush faces have edges within the others' planes: nothing pierces until they are turned.
        assert not is_proven(answer)
        turn = Rotation.from_rotvec([2e-7, 3e-7, 1e-7])
        q[1] = at(*q[1, :3], turn)
        (answer,) = proof.look(q, TOUCHING)
    assert answer.verdict is Verdict.CROSSING
    # No deeper than the move out.
    assert TOUCHING < answer.depth < 2e-6


@pytest.mark.parametrize("name", SCENES)
def test_bodies_that_are_near(name):
    proof, q, _ = scene(name, off=1e-6)
    (answer,) = proof.look(q, TOUCHING)
    if name == "torus on plane":
        # All around it is as near.
        assert answer.verdict in (Verdict.CLEAR, Verdict.UNDECIDED)
        return
    assert answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 1e-6 * (1.0 + 1e-9)


def test_wedged():
    """Between opposed contacts no move opens; one that is open by as much as it is moved does not matter."""
    proof, q, contacts = scene("ball on plane")
    both = Contacts(
        np.vstack([contacts.normals, -contacts.normals]),
        np.vstack([contacts.places, contacts.places + [0.0, 0.0, 0.8]]),
        np.zeros(2),
    )
    assert move_apart(proof, 0, q, both, TOUCHING) is None
    assert move_apart(proof, 0, q, both._replace(gaps=np.array([0.0, 1e-8])), TOUCHING) is not None
    assert move_apart(proof, 0, q, contacts, 0.0) is None


def test_moves_open_by_no_more_than_is_touching(cases):
    """Of a body that is far from its own origin: moves are about that, lengths are those of points of the body."""
    rng, tried = np.random.default_rng(0), 0
    part = asm.shapes.ellipsoid(0.3, 0.5, 0.7).transformed(translation=[4.0, 1.0, 0.5])
    turn = Rotation.from_rotvec([0.3, 0.2, 0.1])
    proof, q = proof_of(PLATE, part), poses(at(1.0, 2.0, 3.0, turn))
    middle = turn.apply([4.0, 1.0, 0.5])
    for _ in range(cases(40, 1000)):
        many = int(rng.integers(1, 5))
        normals = np.array([direction(rng) for _ in range(many)])
        arms = middle + rng.uniform(-0.5, 0.5, (many, 3))
        gaps = rng.uniform(-0.4, 1.5, many) * TOUCHING
        move = move_apart(proof, 0, q, Contacts(normals, q[1, :3] + arms, gaps), TOUCHING)
        if move is None or not move.any():
            continue
        tried += 1
        length = proof.move_length(0, q, move)
        assert length <= TOUCHING * (1.0 + 1e-6)
        points = turn.apply(part.evaluate(*(rng.uniform(*ends, 50) for ends in part.domain)))
        # To first order: a turn by 1e-9 leaves 1e-18.
        assert np.linalg.norm(move[:3] + np.cross(move[3:], points), axis=1).max() <= length * (1.0 + 1e-6)
        after = gaps + (normals * (move[:3] + np.cross(move[3:], arms))).sum(axis=1)
        assert after.min() > 0.0
    assert tried > 10


def test_a_pin_that_fills_its_bore_is_not_decided():
    """All around nothing parts it, and nothing crosses."""
    proof, q = proof_of(PLATE, asm.shapes.solid_cylinder(0.4, 1.0)), poses(at(0.7, 0.1, 0.1))
    proof.fronts.counts.budget = 3000
    assert proof.look(q, TOUCHING)[0].verdict is Verdict.UNDECIDED


def test_what_crosses_or_is_clear_does_not_conform():
    proof = proof_of(asm.shapes.box(1.0, 1.0, 1.0), asm.shapes.sphere(0.4))
    assert not conforms(proof, 0, poses(at(0.8, 0.0, 0.0)), TOUCHING)
    assert not conforms(proof, 0, poses(at(2.0, 0.0, 0.0)), TOUCHING)


def test_what_is_left_open_tells_how_to_open_it():
    """A corner of a box on a plane, of which no contact is told."""
    turn = Rotation.from_euler("xyz", [0.5, 0.6, 0.2])
    corners = turn.apply(0.5 * np.array([[x, y, z] for x in (-1, 1) for y in (-0.8, 0.8) for z in (-0.5, 0.5)]))
    proof = proof_of(PLATE, asm.shapes.box(1.0, 0.8, 0.5))
    q = poses(at(0.0, 0.6, 0.15 - corners[:, 2].min(), turn))
    assert proof.look(q, TOUCHING)[0].verdict is Verdict.UNDECIDED
    move = left_open(proof, 0, q, TOUCHING)
    assert move is not None and move[2] > 0.0
    assert proof.look(q, TOUCHING, move[None])[0].verdict is Verdict.TOUCHING


def test_cells_that_no_front_has_are_forgotten():
    """Answers, and what is proven of ways, stay; the room does not grow."""
    box, ball = faces_of(asm.shapes.box(1.0, 0.7, 0.5)), faces_of(asm.shapes.ellipsoid(0.3, 0.5, 0.7))
    proof = ClearanceProof([box, ball, ball], [(0, 1), (1, 2), (2, 0)], [0.0] * 3)
    rng = np.random.default_rng(3)
    q = np.array([at(0, 0, 0), at(0.8005, 0.0, 0.0), at(0.0, 1.2, 0.0)])
    before = ClearanceProof([box, ball, ball], [(0, 1), (1, 2), (2, 0)], [0.0] * 3).look(q, 0.0)
    for _ in range(20):
        other = q.copy()
        other[1, 0] = 0.801
        other[:, 3:] += 0.3 * rng.normal(size=(3, 4))
        other[:, 3:] /= np.linalg.norm(other[:, 3:], axis=1)[:, None]
        proof.look(other, 0.0)
    told, used = proof.look(q, 0.0), int(proof.forest.arrays[5][0])
    of_fronts = proof.forest.arrays[4][proof.fronts.cells()].copy()
    proof.forest.forget(proof.fronts)
    assert int(proof.forest.arrays[5][0]) < used
    # Fronts have the same nodes, at other rows.
    assert np.array_equal(proof.forest.arrays[4][proof.fronts.cells()], of_fronts)
    assert proof.fronts.cells().max() < int(proof.forest.arrays[5][0])
    again = proof.look(q, 0.0, swept=True)
    assert [a.verdict for a in again] == [a.verdict for a in told] == [a.verdict for a in before]
    assert [a.bound for a in again] == [a.bound for a in told]
    crossing = q.copy()
    crossing[1, 0] = 0.7
    fresh = ClearanceProof([box, ball, ball], [(0, 1), (1, 2), (2, 0)], [0.0] * 3).look(crossing, 0.0)
    assert [a.verdict for a in proof.look(crossing, 0.0)] == [a.verdict for a in fresh]


def nothing_known():
    return None


# Shapes with flat faces on which what is round lies: the second shape, and where it is over the top, z = 0.25.
ON_TOP = {
    "a ball": (asm.shapes.sphere(0.4), lambda x, y, gap: at(x, y, 0.65 + gap)),
    "a cylinder": (
        asm.shapes.solid_cylinder(0.2, 1.4),
        lambda x, y, gap: at(x, y, 0.45 + gap, Rotation.from_rotvec([0.0, 0.5 * np.pi, 0.0])),
    ),
    "a box": (asm.shapes.box(0.5, 0.4, 0.6), lambda x, y, gap: at(x, y, 0.55 + gap)),
}


@pytest.mark.parametrize("name", ON_TOP)
@pytest.mark.parametrize("gap", [0.0, 0.2])
@pytest.mark.parametrize("swapped", [False, True])
def test_what_is_recognized_to_lie_on_a_flat_face_is_opened(name, gap, swapped):
    """Anywhere on the top of a block, both turned any way: by less than what touching is, over a least gap."""
    rng = np.random.default_rng(3)
    part, place = ON_TOP[name]
    for _ in range(4):
        turn = Rotation.from_rotvec(rng.normal(size=3))
        row = place(*rng.uniform(-0.8, 0.8, 2), gap)
        there = np.r_[
            turn.apply(row[:3]), (turn * Rotation.from_quat(row[3:], scalar_first=True)).as_quat(scalar_first=True)
        ]
        block = at(0.0, 0.0, 0.0, turn)
        shapes = (asm.shapes.box(3.0, 3.0, 0.5), part)
        proof = proof_of(*(shapes[::-1] if swapped else shapes), minimum=gap)
        q = poses(block, there) if swapped else poses(there, block)
        move = off_contacts(proof, 0, q, TOUCHING, nothing_known)
        assert 0.0 < proof.move_length(0, q, move) <= TOUCHING
        (answer,) = proof.look(q, TOUCHING, move[None])
        assert answer.verdict is Verdict.TOUCHING


@pytest.mark.parametrize("name", ON_TOP)
@pytest.mark.parametrize("place", [(6.0, 0.0, 0.0), (0.0, 0.3, 1e-6), (0.0, 0.3, -1e-6)])
def test_what_is_beside_a_face_or_off_its_plane_does_not_lie_on_it(name, place):
    part, over = ON_TOP[name]
    proof = proof_of(asm.shapes.box(3.0, 3.0, 0.5), part)
    assert not off_contacts(proof, 0, poses(over(*place)), TOUCHING, nothing_known).any()
