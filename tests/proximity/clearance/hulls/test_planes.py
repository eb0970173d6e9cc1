"""Planes between bodies: each leaves both on its sides, by closed forms, and is found where there is room."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.constraints.model.contact import side_faces
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body
from assembly.proximity.clearance.hulls.planes import normal_between

HALF = np.array([1.0, 1.5, 2.0])


def reach_of_a_box(turn, normal):
    return np.abs(normal @ turn) @ HALF


def reach_of_a_cylinder(turn, normal):
    """Of radius 2, 5 long, about its middle."""
    along = abs(float(normal @ turn[:, 2]))
    return 2.5 * along + 2.0 * np.sqrt(max(0.0, 1.0 - along**2))


def reach_of_a_ball(turn, normal):
    return 1.5


KINDS = [
    (asm.shapes.box(*(2.0 * HALF)), reach_of_a_box),
    (asm.shapes.solid_cylinder(2.0, 5.0), reach_of_a_cylinder),
    (asm.shapes.sphere(1.5), reach_of_a_ball),
]


def gap_along(pair, turns, off, normal):
    return float(normal @ off) - sum(reach(turn, normal) for (_, reach), turn in zip(pair, turns, strict=True))


def test_each_plane_is_between_both_bodies(count=80):
    rng, found = np.random.default_rng(4), 0
    hulls = [hulls_of_body(side_faces(asm.Body("b", shape))) for shape, _ in KINDS]
    directions = rng.normal(size=(400, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for _ in range(count):
        which = rng.integers(0, len(KINDS), 2)
        turns = Rotation.random(2, random_state=int(rng.integers(1 << 30))).as_matrix()
        off = 3.0 * rng.normal(size=3)
        shifts = (np.zeros(3), off)
        posed = [hulls[k].posed(turn, shift) for k, turn, shift in zip(which, turns, shifts, strict=True)]
        normal = normal_between(*posed)
        pair = [KINDS[k] for k in which]
        if normal is not None:
            found += 1
            assert gap_along(pair, turns, off, normal) > 0.0
        else:
            # No direction of many leaves a gap of more than a tenth.
            assert max(gap_along(pair, turns, off, n) for n in directions) < 0.1
    assert 0.4 * count < found < 0.95 * count


@pytest.mark.parametrize("tilt", [0.0, 0.07])
def test_cylinders_side_by_side_whose_boxes_meet(tilt):
    """As rotors of an exploded view: boxes that are turned about the cylinders' axes meet, the cylinders do not."""
    hulls = hulls_of_body(side_faces(asm.Body("b", asm.shapes.solid_cylinder(2.0, 5.0))))
    turn = Rotation.from_euler("zy", [np.pi / 4, tilt]).as_matrix()
    apart = 4.05 + 5.0 * np.sin(tilt)
    found = normal_between(hulls.posed(turn, np.zeros(3)), hulls.posed(turn.T, np.array([apart, 0.0, 0.0])))
    assert found is not None and found[0] > 0.9
    assert normal_between(hulls, hulls.posed(turn, np.array([3.9, 0.0, 0.0]))) is None


@pytest.mark.parametrize("off", [(2.0, 0, 0), (0, -3.0, 0), (2.0, 0, 4.0), (2.0, 3.0, 4.0), (-2.0, 3.0, -4.0)])
def test_bodies_whose_first_points_are_the_same_are_parted_by_no_plane(off):
    """Equal boxes flush, edge to edge and corner to corner: the farthest corners of both coincide, to the bit."""
    hulls = hulls_of_body(side_faces(asm.Body("b", KINDS[0][0])))
    posed = hulls.posed(np.eye(3), np.array(off, dtype=float))
    assert normal_between(hulls, posed) is None and normal_between(posed, hulls) is None
