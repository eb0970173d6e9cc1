"""Faces that lie on each other, told by what they are: every kind, anywhere, and what only nearly does."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.model.contact import side_faces
from assembly.proximity.clearance.conforming import conforms
from assembly.proximity.clearance.proof import ClearanceProof
from tests.geometry.recognition.constructions import circle_profile, line, revolved
from tests.proximity.manager.test_contact_place import prism

# Points of the bodies below are of some units, and away from the origin by FAR at most. What is off by rounding of
# these is below ROUNDED; what is off by NEAR is not on each other.
FAR, ROUNDED, NEAR = 10.0, 1e-12, 1e-6


def around(profile, is_hollow=False):
    """A face that a profile sweeps all around z, with its outward side toward the axis or away from it."""
    return (asm.Face(revolved(*profile, 2.0 * np.pi, 4), reversed=is_hollow),)


def cylinders(radius):
    """Of the hollow one and of the full one, the radii and what parts of the surface they have differ."""
    return around(line((1.0, -2.0), (1.0, 2.0)), True), around(line((radius, -0.5), (radius, 1.0)))


def cones(shift):
    """r = z + 1 on both; the full one is moved along z."""
    return around(line((0.5, -0.5), (2.0, 1.0)), True), around(line((0.8, -0.2 + shift), (1.5, 0.5 + shift)))


def spheres(radius):
    quarter = circle_profile((0.0, 0.0), 1.0, -0.5 * np.pi, 0.5 * np.pi, 1)
    return around(quarter, True), (asm.shapes.sphere(radius),)


def tori(minor):
    groove = circle_profile((2.0, 0.0), 0.5, -np.pi, np.pi, 2)
    return around(groove, True), (asm.shapes.torus(2.0, minor),)


def ball_in_bore(radius):
    return cylinders(1.0)[0], (asm.shapes.sphere(radius),)


def planes(shift):
    """Plates that are flush at z = 0."""
    boxes = ((3.0, 2.0, 1.0), -0.5), ((1.0, 2.5, 1.2), 0.6 + shift)
    return tuple(
        tuple(
            asm.Face(side.surface.transformed(np.eye(3), (0.0, 0.0, z)), reversed=side.reversed)
            for side in asm.shapes.box(*sides)
        )
        for sides, z in boxes
    )


# Of each kind: the faces of both bodies by a number, what the number is where these lie on each other, and whether a
# turn about x takes the one off the other.
KINDS = {
    "planes": (planes, 0.0, True),
    "cylinders": (cylinders, 1.0, True),
    "cones": (cones, 0.0, True),
    "spheres": (spheres, 1.0, False),
    "tori": (tori, 0.5, True),
    "a ball in a bore": (ball_in_bore, 1.0, False),
}


@cache
def proof_of(kind, number, is_swapped=False):
    """Of bodies of one kind."""
    faces = KINDS[kind][0](number)
    return proof_between(faces[::-1] if is_swapped else faces)


def proof_between(faces):
    bodies = [asm.Body(f"body {k}", shape) for k, shape in enumerate(faces)]
    return ClearanceProof([side_faces(body) for body in bodies], [(0, 1)], [0.0])


def poses(rng, relative=None, shift=(0.0, 0.0, 0.0)):
    """Both bodies somewhere, the second one turned and moved as the first one sees it."""
    turn = Rotation.random(random_state=int(rng.integers(1 << 30)))
    place = FAR * rng.uniform(-1.0, 1.0, 3)
    other = turn if relative is None else turn * relative
    rows = [np.r_[place, turn.as_quat(scalar_first=True)]]
    rows.append(np.r_[place + turn.apply(shift), other.as_quat(scalar_first=True)])
    return np.array(rows)


@pytest.mark.parametrize("kind", KINDS)
def test_faces_that_lie_on_each_other_are_told_anywhere(kind, cases):
    rng = np.random.default_rng(1)
    for is_swapped in (False, True):
        proof = proof_of(kind, KINDS[kind][1], is_swapped)
        for _ in range(cases(5, 100)):
            assert conforms(proof, 0, poses(rng), ROUNDED)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_what_is_off_by_a_millionth_does_not(kind, sign):
    rng = np.random.default_rng(2)
    proof = proof_of(kind, KINDS[kind][1] + sign * NEAR)
    assert not conforms(proof, 0, poses(rng), 0.9 * NEAR)
    # It does where as much is called touching.
    assert conforms(proof, 0, poses(rng), 1.1 * NEAR)


@pytest.mark.parametrize("kind", [kind for kind, (_, _, leans) in KINDS.items() if leans])
def test_what_leans_by_a_millionth_does_not(kind):
    rng = np.random.default_rng(3)
    proof = proof_of(kind, KINDS[kind][1])
    for _ in range(4):
        angle = rng.uniform(0.0, 2.0 * np.pi)
        lean = Rotation.from_rotvec(NEAR * np.array([np.cos(angle), np.sin(angle), 0.0]))
        assert not conforms(proof, 0, poses(rng, lean), 0.1 * NEAR)


@pytest.mark.parametrize("kind", ["spheres", "a ball in a bore"])
def test_balls_may_turn(kind):
    rng = np.random.default_rng(4)
    proof = proof_of(kind, KINDS[kind][1])
    for _ in range(4):
        # Its own center is the origin, which stays.
        turn = Rotation.random(random_state=int(rng.integers(1 << 30)))
        assert conforms(proof, 0, poses(rng, turn), ROUNDED)


@pytest.mark.parametrize(("kind", "way", "stays"), [
    ("planes", (0.3, 0.2, 0.0), True), ("planes", (0.0, 0.0, NEAR), False),
    ("cylinders", (0.0, 0.0, 0.4), True), ("cylinders", (NEAR, 0.0, 0.0), False),
    ("cones", (0.0, NEAR, 0.0), False), ("cones", (0.0, 0.0, NEAR), False),
    ("spheres", (NEAR, 0.0, 0.0), False), ("tori", (0.0, 0.0, NEAR), False), ("tori", (NEAR, 0.0, 0.0), False),
    ("a ball in a bore", (0.0, 0.0, 0.4), True), ("a ball in a bore", (0.0, NEAR, 0.0), False),
])  # fmt: skip
def test_moves_along_a_face_leave_it_and_others_do_not(kind, way, stays):
    rng = np.random.default_rng(5)
    assert (
        conforms(proof_of(kind, KINDS[kind][1]), 0, poses(rng, shift=way), 0.5 * NEAR if not stays else ROUNDED)
        == stays
    )


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "planes"])
def test_surfaces_with_their_outsides_on_one_side_do_not(kind):
    rng = np.random.default_rng(6)
    hollow, full = KINDS[kind][0](KINDS[kind][1])
    for face in hollow:
        outward = (asm.Face(face.surface, reversed=not face.reversed),)
        assert not conforms(proof_between((outward, full)), 0, poses(rng), NEAR)


def test_plates_whose_faces_are_reversed_lie_on_each_other():
    """The bottom of a plate is a plane whose normal points up, the other way round."""
    plate = asm.shapes.plate(3.0, 2.0, 1.0, [(0.5, 0.2, 0.3)])
    assert {face.reversed for face in plate} == {False, True}
    proof = proof_between((plate, plate))
    assert conforms(proof, 0, poses(np.random.default_rng(11), shift=(0.3, 0.1, 1.0)), ROUNDED)
    assert not conforms(proof, 0, poses(np.random.default_rng(11), shift=(0.3, 0.1, 1.0 + 2.0 * NEAR)), NEAR)


def test_planes_that_look_the_same_way_do_not():
    """A plate on a plate of its own height, shifted: tops in one plane, bottoms in one plane."""
    box = asm.shapes.box(1.0, 1.0, 1.0)
    q = poses(np.random.default_rng(7), shift=(1.5, 0.7, 0.0))
    assert not conforms(proof_between((box, box)), 0, q, NEAR)


def test_a_cone_the_other_way_up_does_not():
    """Two nappes of one cone."""
    hollow, _ = cones(0.0)
    other = around(line((0.5, -1.5), (1.5, -2.5)))
    assert not conforms(proof_between((hollow, other)), 0, poses(np.random.default_rng(8)), NEAR)


def test_walls_that_are_none_of_these_conform_to_nothing():
    """An ellipsoid in its own mold would, but no closed form says so: nothing is told of it."""
    blob = (asm.shapes.ellipsoid(1.0, 1.2, 1.4),)
    assert not conforms(proof_between((blob, blob)), 0, poses(np.random.default_rng(9)), NEAR)


def test_the_side_of_a_prism_lies_on_that_of_another_one():
    """Flush flanks of a dovetail, whose faces are no axes' planes."""
    flank = [(0.0, 0.0), (2.0, 0.0), (1.2, 1.1)]
    q = poses(np.random.default_rng(10), Rotation.from_rotvec([0.0, 0.0, np.pi]), (3.2, 1.1, 0.0))
    proof = proof_between((prism(flank, 1.0), prism(flank, 2.0)))
    assert conforms(proof, 0, q, ROUNDED)
    q[1, :3] += 3e-6
    assert not conforms(proof, 0, q, NEAR)
