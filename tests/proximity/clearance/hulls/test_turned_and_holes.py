"""What goes around an axis, holes of sides and arcs, and flat faces for balls: laws by samples, and bodies that fit."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.hollows import Hollow, Ring
from assembly.proximity.clearance.hulls.prism import Arcs, Prism
from assembly.proximity.clearance.hulls.sheet import Sheet
from tests.geometry.recognition.constructions import circle_profile, revolved
from tests.proximity.clearance.hulls.test_face_hulls import OFF, polygon, samples, samples_of_loops, slotted
from tests.proximity.clearance.hulls.test_pair import TOUCHING, told
from tests.proximity.clearance.scenes import at, direction, faces_of
from tests.studies.machined import turned_part


def arc(center, radius, begin, end):
    """An arc of less than a half turn, from one angle to another, either way around."""
    weight, middle = np.cos(0.5 * (end - begin)), 0.5 * (begin + end)
    ways = [np.array([np.cos(t), np.sin(t)]) for t in (begin, middle, end)]
    points = [center + radius * ways[0], center + radius / weight * ways[1], center + radius * ways[2]]
    return asm.NurbsCurve(points, [0, 0, 0, 1, 1, 1], 2, [1, weight, 1])


def flattened(radius, flat, clockwise=False):
    """A circle without what is above a height, of three arcs."""
    angle = np.arcsin(flat / radius)
    ends = np.linspace(np.pi - angle, 2.0 * np.pi + angle, 4)
    arcs = [arc(np.zeros(2), radius, *pair) for pair in zip(ends[:-1], ends[1:], strict=True)]
    wide = radius * np.cos(angle)
    loop = [*arcs, *polygon([(wide, flat), (-wide, flat)])[:1]]
    return [curve.reversed() for curve in loop[::-1]] if clockwise else loop


def star(valley, tip, half, count=6):
    """The corners of a splined shaft, counterclockwise."""
    corners = []
    for k in range(count):
        c, s = np.cos(2.0 * np.pi * k / count), np.sin(2.0 * np.pi * k / count)
        inner, outer = (np.sqrt(r * r - half * half) for r in (valley, tip))
        for x, y in ((inner, -half), (outer, -half), (outer, half), (inner, half)):
            corners.append((c * x - s * y, s * x + c * y))
    return corners


def race(outer):
    """A ring with a groove for balls of radius 4 around a circle of radius 20."""
    center = 19.8 if outer else 20.2
    edge, land = (22.5, 30.0) if outer else (17.5, 10.0)
    angle = np.arccos(abs(edge - center) / 4.2)
    high = 4.2 * np.sin(angle)
    profile = circle_profile((center, 0.0), 4.2, -angle if outer else np.pi - angle, 2.0 * angle, 1)
    corners = [(edge, 7.0), (edge, high), (edge, -high), (edge, -7.0), (land, -7.0), (land, 7.0)]
    if not outer:
        corners = [(radius, -height) for radius, height in corners]
    faces = turned_part(corners)
    return [*faces[:1], *faces[2:], asm.Face(revolved(*profile, 2.0 * np.pi, 4), name="race", reversed=True)]


def hub(inner, outer):
    return asm.shapes.extrusion([circle(25.0)], 30.0, [polygon(star(inner, outer, 2.5)[::-1])])


HOLES = {
    "flattened": asm.shapes.extrusion([circle(12.0)], 15.0, [flattened(5.0, 3.0, clockwise=True)]),
    "slot": slotted(),
    "splined": hub(10.0, 13.0),
    "L": asm.shapes.extrusion(
        [circle(12.0)], 4.0, [polygon([(-5, -5), (5, -5), (5, 0), (1, 0), (1, 6), (-5, 6)][::-1])]
    ),
}
PIECES = {**HOLES, "inner race": race(False), "outer race": race(True)}
FITS = {
    "a knob on a flattened shaft": lambda off: (
        HOLES["flattened"],
        asm.shapes.extrusion([*flattened(5.0 + off, 3.0 + off)], 40.0),
        at(0, 0, 3),
    ),
    "a pin in a slot": lambda off: (slotted(), asm.shapes.solid_cylinder(2.0 + off, 20), at(1.2, 0, 0)),
    "a hub on a splined shaft": lambda off: (
        HOLES["splined"],
        asm.shapes.extrusion(polygon(star(10.0 + off, 13.0 + off, 2.5 + off)), 80.0),
        at(0, 0, 3),
    ),
    "a rod through a cone": lambda off: (
        turned_part([(4, -6), (15, -6), (9, 20), (4, 20)]),
        asm.shapes.solid_cylinder(4.0 + off, 90),
        at(0, 0, 10),
    ),
    "a ball in a race": lambda off: (race(True), asm.shapes.sphere(4.0 + off), at(20.0, 0, 0)),
    "a ball on a race": lambda off: (race(False), asm.shapes.sphere(4.0 + off), at(20.0, 0, 0)),
}


@pytest.mark.parametrize("name", PIECES)
def test_faces_are_within_their_hulls_and_beside_their_hollows(name):
    rng = np.random.default_rng(1)
    normals = np.array([*np.eye(3), *-np.eye(3), *(direction(rng) for _ in range(60))])
    for face in faces_of(PIECES[name]):
        points, hulls = samples(face), hulls_of_body((face,))
        within = (points @ normals.T <= hulls.reach(normals)[:, None] + OFF).all(axis=2)
        assert within.any(axis=0).all(), face
        for _, hollow in hulls.hollows:
            assert hollow.depth_of(points).max() <= OFF, face


def test_races_are_as_wide_as_they_are():
    """All of the tube counted: of a ring that touches nothing the other one seemed to be in it."""
    for outer, least, most in ((False, 16.0, 17.5), (True, 22.5, 24.0)):
        (face,) = (face for face in race(outer) if face.name == "race")
        hulls = hulls_of_body((face,))
        assert hulls.reach(np.eye(3)[:1]).max() <= most + 0.6
        through = [hollow for _, hollow in hulls.hollows if isinstance(hollow, Hollow)]
        assert [hollow.radius for hollow in through] == pytest.approx([least] * len(through), abs=1e-8)
        # Within the one is the body, within the other none.
        assert through and all(hollow.is_wall == outer for hollow in through)


def test_a_ball_without_its_poles_is_beside_what_goes_through():
    ball = asm.shapes.sphere(15.0)
    low, high = ball.domain[1]
    rings = [polygon([(side, v) for side in ball.domain[0]])[:1] for v in (low + 8.0, high - 8.0)]
    zone = asm.Face(ball, rings[0], [[rings[1][0].reversed()]], name="zone")
    least = np.hypot(*samples_of_loops(zone)[:, :2].T).min()
    through = [hollow for _, hollow in hulls_of_body((zone,)).hollows if isinstance(hollow, Hollow)]
    assert max(hollow.radius for hollow in through if hollow.axis.any()) == pytest.approx(least, abs=1e-8)
    # With a pole nothing goes through.
    for loop in (rings[0], [rings[1][0].reversed()]):
        cap = asm.Face(ball, loop, name="cap")
        assert not any(hollow.axis.any() for _, hollow in hulls_of_body((cap,)).hollows)


@pytest.mark.parametrize("name", HOLES)
def test_a_hole_is_covered_by_its_prisms(name):
    """Every point of a hole that all of its boundary is seen from is in one; of a polygon all that sides lead along."""
    (face, *_) = (face for face in faces_of(HOLES[name]) if face.holes)
    prisms = [hollow for _, hollow in hulls_of_body((face,)).hollows if isinstance(hollow, Prism)]
    assert prisms
    ends = [face.boundary[k].evaluate(np.linspace(*face.boundary[k].domain, 9)) for k in face.chains[1]]
    on_loop = face.surface.evaluate(*np.concatenate(ends).T)
    depths = np.array([prism.depth_of(on_loop) for prism in prisms])
    # Every point of the loop is on the border of a prism, and in none.
    assert np.abs(depths.max(axis=0)).max() < 1e-9


def test_depths_in_arcs_are_bounds():
    """Of discs that lean, no more than of samples of their rims; half spaces say no less."""
    rng = np.random.default_rng(2)
    half = np.array([0.6, 1.4])
    arcs = Arcs(np.zeros((2, 3)), np.array([[1.0, 0, 0], [-1.0, 0, 0]]), np.array([2.0, 2.2]), half)
    prism = Prism(np.array([0.0, 0, 1]), np.array([[0.0, 1, 0], [0.0, -1, 0]]), np.array([-1.5, -1.7]), arcs)
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    inside = 0
    for _ in range(200):
        center, axis, radius = rng.normal(size=3), direction(rng), rng.uniform(0.1, 0.8)
        across = np.linalg.svd(axis[None])[2][1:]
        rim = center + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])
        depth = prism.depth(Discs(center[None], axis[None], np.array([radius])))[0]
        assert depth <= prism.depth_of(rim).min() + 1e-14
        # A point is within by the least of all half spaces along the arcs.
        normals = [np.array([np.cos(t), np.sin(t), 0.0]) for t in np.linspace(-0.6, 0.6, 4001)]
        normals += [-np.array([np.cos(t), np.sin(t), 0.0]) for t in np.linspace(-1.4, 1.4, 4001)]
        radii = np.repeat([2.0, 2.2], 4001)
        sampled = min((radii - np.array(normals) @ center).min(), 1.5 + center[1], 1.7 - center[1])
        assert prism.depth_of(center[None])[0] == pytest.approx(sampled, abs=1e-6)
        inward, borders = prism.planes(center)
        assert (inward @ center - borders).min() == pytest.approx(prism.depth_of(center[None])[0], abs=1e-12)
        if depth > 0.0:
            inside += 1
            assert (rim @ inward.T >= borders - 1e-12).all()
    assert inside > 5


@pytest.mark.parametrize("name", HOLES)
def test_a_flat_face_and_a_ball_are_apart_by_what_samples_say(name):
    rng = np.random.default_rng(4)
    (face, *_) = (face for face in faces_of(HOLES[name]) if face.holes)
    (sheet,) = (hollow for _, hollow in hulls_of_body((face,)).hollows if isinstance(hollow, Sheet))
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(u0, u1, 300), np.linspace(v0, v1, 300)))
    mine = face.contains(u, v)
    grid = face.surface.evaluate(u[mine], v[mine])
    fine = max(u1 - u0, v1 - v0) / 299
    for _ in range(40):
        center = grid[rng.integers(len(grid))] + rng.normal(size=3) * (3.0, 3.0, 1.0)
        depth, sampled = sheet.depth_of(center[None])[0], np.linalg.norm(grid - center, axis=1).min()
        assert depth <= sampled + 1e-12 and sampled <= depth + 2.0 * fine
        inward, borders = sheet.planes(center)
        assert (inward @ center - borders).min() == pytest.approx(depth, abs=1e-12)
    assert not len(sheet.planes(grid[0])[0]) or abs(sheet.depth_of(grid[:1])[0]) < 1e-12


def test_a_flat_face_without_an_outer_boundary_is_not_for_balls():
    """Its holes alone would be its boundary, and a ball beside it far from that."""
    top = asm.shapes.plate(60, 40, 10)[0]
    assert top.outer is None or top.holes == ()
    face = asm.Face(top.surface, holes=[polygon([(1, 1), (1, 2), (2, 2), (2, 1)])])
    assert face.outer is None
    assert not any(isinstance(hollow, Sheet) for _, hollow in hulls_of_body((face,)).hollows)
    # Nor does one tell anything whose boundary has other curves.
    curve = asm.NurbsCurve([(9, 0), (7, 7), (0, 9), (-7, 7), (-9, 0)], [0, 0, 0, 0, 1, 2, 2, 2, 2], 3)
    (face,) = faces_of(asm.shapes.trimmed_plane([curve, *polygon([(-9, 0), (9, 0)])[:1]]))
    (sheet,) = (hollow for _, hollow in hulls_of_body((face,)).hollows if isinstance(hollow, Sheet))
    assert sheet.depth_of(np.array([[0.0, 0.0, 50.0]])) == [-np.inf] and not len(sheet.planes(np.zeros(3))[0])


@pytest.mark.parametrize("name", FITS)
def test_bodies_that_fit_are_told_to(name):
    answer = told(*FITS[name](0.0))
    if name in ("a ball in a race", "a ball on a race"):
        # A groove of a larger radius touches the ball where that is farthest out.
        assert answer is not None and answer.bound <= 1e-9
    else:
        assert answer is not None and answer.verdict is Verdict.TOUCHING and answer.depth <= TOUCHING
    assert told(*FITS[name](8.0 * TOUCHING)) is None
    answer = told(*FITS[name](-0.02))
    assert answer is not None and answer.verdict is Verdict.CLEAR and 0.0 < answer.bound <= 0.021


def test_a_ball_in_the_wall_of_a_shaft_is_not_told_to_be_clear():
    """From within, a ball touches a shaft's wall, and the narrow end of a cone: it is in the body."""
    shaft, cone = asm.shapes.solid_cylinder(10.0, 40), turned_part([(0, -6), (15, -6), (9, 20), (0, 20)])
    for body, radius, place in ((shaft, 3.0, (7.0, 0, 0)), (cone, 9.0, (0, 0, 5.0)), (race(False), 2.0, (15.5, 0, 0))):
        assert told(body, asm.shapes.sphere(radius), at(*place)) is None
        assert told(asm.shapes.sphere(radius), body, at(*(-np.array(place)))) is None


def test_balls_beside_a_shaft_are_judged():
    """Beside its wall, over its end and about its rim: what is told is the distance, wherever they are apart."""
    rng, shaft, told_of = np.random.default_rng(8), asm.shapes.solid_cylinder(4.0, 10), 0
    assert any(isinstance(hollow, Ring) and not hollow.is_wall for _, hollow in hulls_of_body(faces_of(shaft)).hollows)
    for _ in range(100):
        radius, place = rng.uniform(0.5, 3.0), rng.uniform((-8, -8, -9), (8, 8, 9))
        beside, height = np.hypot(*place[:2]) - 4.0, abs(place[2]) - 5.0
        distance = np.hypot(max(beside, 0.0), max(height, 0.0)) - radius
        if max(beside, height) < 0.0:
            distance = max(beside, height) - radius
        answer = told(shaft, asm.shapes.sphere(radius), np.r_[place, 1.0, 0.0, 0.0, 0.0])
        assert answer is None or distance > -TOUCHING
        told_of += answer is not None
        assert answer is None or answer.bound <= distance + 1e-12
    assert told_of > 50
