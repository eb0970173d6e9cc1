"""Solids over flat faces: the lowest place is listed, though nothing is looked for inside faces or at slanted edges."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def disc(radius, height):
    """A cylinder and its lowest height over the plane z = 0 at a pose."""

    def lowest(turn, place):
        axis = turn[:, 2]
        return place[2] - 0.5 * height * abs(axis[2]) - radius * np.hypot(axis[0], axis[1])

    return asm.shapes.solid_cylinder(radius, height), lowest


def block(*sides):
    """A box and its lowest height."""
    return asm.shapes.box(*sides), lambda turn, place: place[2] + (0.5 * CORNERS * sides @ turn.T)[:, 2].min()


@pytest.mark.parametrize("swap", [False, True], ids=["over", "under"])
@pytest.mark.parametrize("made", [lambda: disc(1.5, 0.8), lambda: disc(0.4, 2.0), lambda: block(2.0, 1.2, 0.8)])
def test_the_lowest_place_over_a_plate_is_listed(made, swap, cases):
    shape, lowest = made()
    top = asm.Body("top", asm.shapes.box(8.0, 8.0, 1.0), (0.0, 0.0, -0.5), fixed=True)
    body = asm.Body("body", shape)
    scene = asm.Assembly([body, top] if swap else [top, body])
    scene.constrain(asm.Clearance())
    rng = np.random.default_rng(8)
    for _ in range(cases(12, 200)):
        tilt = 10.0 ** rng.uniform(-9.0, -0.5)
        lean = Rotation.from_rotvec(tilt * np.array([*rng.normal(size=2), 0.0]))
        turn = lean * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
        gap = 10.0 ** rng.uniform(-9.0, -2.0)
        place = np.array([*rng.uniform(-1.0, 1.0, 2), 0.0])
        place[2] = gap - lowest(turn.as_matrix(), place)
        q = np.array([scene.bodies[k].pose.position.tolist() + [1.0, 0.0, 0.0, 0.0] for k in range(2)])
        q[0 if swap else 1] = [*place, *turn.as_quat(scalar_first=True)]
        found = scene.solve(q, max_iterations=0).contacts
        # A lower one would be in the other body; the closed form is exact but for rounding of poses of some units.
        assert min(contact.gap for contact in found.values()) == pytest.approx(gap, abs=1e-12 + 1e-9 * gap)
