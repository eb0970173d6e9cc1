"""Thin parts on each other, parts within thin walls, and bodies whose unknowns are not in the order of the scene."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.holder_first import holds_first
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.solve.clearance_proof import proven_pairs
from assembly.solve.interruption import CTRL_C
from assembly.studies.seated import seated
from tests.studies.machined import disturbed, turned_part

THICK = (1.6, 2.0, 1.2)
POINTS = ((6.0, 0.0, 0.0), (-6.0, 0.0, 0.0), (0.0, 6.0, 0.0), (0.0, -6.0, 0.0))


def tube(inner, outer, height):
    """A tube about z, its middle at the origin."""
    half = 0.5 * height
    return turned_part([(inner, -half), (outer, -half), (outer, half), (inner, half)])


def stack():
    """A plate whose top is z = 5, three washers on it, the thickest first, and a ring beneath; and their homes."""
    plate = asm.Body("plate", asm.shapes.plate(60, 40, 10, [(0, 0, 4.5)]), fixed=True)
    heights = {"a": (7.8, 9.0), "b": (6.0, 12.0), "c": (9.2, 8.0)}
    thick = dict(zip("abc", THICK, strict=True))
    bodies = [asm.Body(name, tube(4.3, outer, thick[name])) for name, (_, outer) in heights.items()]
    bodies.append(asm.Body("below", tube(4.0, 7.0, 6.5)))
    home = np.zeros((5, 7))
    home[:, 3] = 1.0
    home[1:, 2] = [*(z for z, _ in heights.values()), -8.25]
    return [plate, *bodies], home


def near_home(home, seed):
    """Poses as far from their homes as a washer is thick."""
    rng = np.random.default_rng(seed)
    return np.array([home[0], *(disturbed(rng, row, 0.7, np.radians(2.0)) for row in home[1:])])


def posed(bodies, q, *constraints):
    """An assembly of bodies at poses."""
    for body, row in zip(bodies, q, strict=True):
        body.pose = asm.Pose(row[:3], row[3:])
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    return scene


@pytest.mark.parametrize("seed", range(2))
def test_washers_of_a_stack_are_not_seated_through_each_other(seed):
    bodies, home = stack()
    q = near_home(home, seed)
    scene = posed(bodies, q, asm.Clearance())
    seat = seated(scene, q, 1e-8, CTRL_C)
    # Each is above the one beneath by both halves, but for what those that stay tilted are lower.
    order = [("b", "plate"), ("a", "b"), ("c", "a"), ("plate", "below")]
    half = dict(zip(["plate", "a", "b", "c", "below"], 0.5 * np.array([10.0, *THICK, 6.5]), strict=True))
    place = {body.name: row[2] for body, row in zip(bodies, seat.poses, strict=True)}
    for upper, lower in order:
        assert place[upper] - place[lower] > half[upper] + half[lower] - 0.05, (upper, lower)
    solution = scene.solve()
    assert solution.success
    assert np.linalg.norm(solution.q[:, :3] - home[:, :3], axis=1).max() < 1.5


def test_a_stack_that_is_drawn_together_rests_whatever_number_its_unknowns_have():
    bodies, home = stack()
    scene = posed(bodies, near_home(home, 0), asm.Clearance())
    for k, way in ((1, -2.0), (2, -2.0), (3, -2.0), (4, 2.0)):
        scene.minimize(
            *(asm.PointDistance(bodies[k].point(*p), home[k, :3] + p + np.array([0.0, 0.0, way])) for p in POINTS)
        )
    solution = scene.solve()
    assert solution.success
    assert solution.q[:, 2] == pytest.approx(home[:, 2], abs=1e-7)
    # Joints alone have led there, in no step of the loop with contacts.
    assert solution.iterations == 0
    # Each of four points of four bodies stays 2 from where it is drawn.
    assert solution.objective == pytest.approx(16 * 2.0**2, rel=1e-9)


def test_a_drawer_is_not_seated_on_the_far_side_of_its_walls():
    """Its bottom is 2 in the floor of its frame: walls 4 and 5 thick are no farther through each other."""
    frame = asm.Body("frame", asm.shapes.extrusion(_rectangle(110, 46), 80, [_rectangle(100, 36)]), fixed=True)
    drawer = asm.Body("drawer", asm.shapes.extrusion(_rectangle(99, 34), 78, [_rectangle(90, 26)]))
    q = np.array([[0.0, 0, 0, 1, 0, 0, 0], [0.0, -3.0, 0, 1, 0, 0, 0]])
    scene = posed([frame, drawer], q, asm.Clearance())
    assert seated(scene, q, 1e-8, CTRL_C).poses[1] == pytest.approx([0, -1, 0, 1, 0, 0, 0], abs=1e-9)


def _rectangle(x, y):
    corners = 0.5 * np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    return [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(corners, np.roll(corners, -1, axis=0), strict=True)]


@pytest.mark.parametrize("swapped", [False, True])
def test_a_shaft_turns_in_its_bearing_whatever_body_is_first(swapped):
    """The bearing's hole is far from its middle: seen from the shaft it goes around, which no way is proven of."""
    shaft = asm.Body("shaft", turned_part([(0, -45), (10, -45), (10, 50), (0, 50)]), position=(30, 0, 0))
    ring = asm.Body("ring", asm.shapes.plate(100, 50, 12, [(30, 0, 10.01)]), fixed=True)
    bodies = [shaft, ring] if swapped else [ring, shaft]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    shapes, pairs, minimum = proven_pairs(scene.packed(), scene.bodies)
    assert pairs == [(1, 0) if swapped else (0, 1)]
    q = np.array(scene.q)
    turned = q.copy()
    turned[bodies.index(shaft), 3:] = [np.cos(0.25), 0.0, 0.0, np.sin(0.25)]
    for order, stays in ((pairs, True), ([pairs[0][::-1]], False)):
        proof = ClearanceProof(shapes, order, minimum)
        proof.look(q, 1e-7)
        assert proof.stays_clear(turned, 1e-7, np.zeros((1, 6))) is stays


def test_which_of_two_tubes_holds_the_other():
    inner, outer = (tuple(asm.Body("b", tube(*size, 5.0)).faces) for size in ((3.0, 5.0), (5.0, 9.0)))
    inner, outer = (tuple(face.face for face in faces) for faces in (inner, outer))
    assert holds_first(inner, outer) and not holds_first(outer, inner)
    assert not holds_first(inner, inner)
