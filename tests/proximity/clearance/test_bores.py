"""Bores: what is said to be outside of one is, at samples of faces; pins in holes are judged by closed forms.

A pin of radius r, upright and off the axis of its hole by e, is clear of it where e + r is less than the radius of the
hole; a tilted one cuts the planes of the plate's faces in ellipses with the half axes r and r / cos(tilt), and is clear
where both are within the circle of the hole.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.body_cells import cells_of_body
from assembly.proximity.clearance.bores import distances_of_parts
from assembly.proximity.clearance.records import FLAT, LINKS, NODE, NONE
from assembly.proximity.clearance.round_faces import Round, round_holes
from tests.proximity.clearance.nodes import forest_of, halve_all, tree_of
from tests.proximity.clearance.scenes import UPRIGHT, at, direction, faces_of, poses, proof_of
from tests.proximity.clearance.splines import shapes, surface_points

# Of points and axes, in parts of the largest coordinate.
OFF = 4e-15
RADIUS, THICK = 0.5, 0.3
PLATES = {
    "one hole": asm.shapes.plate(3.0, 2.0, THICK, [(0.0, 0.0, RADIUS)]),
    "two holes": asm.shapes.plate(3.0, 2.0, THICK, [(-0.7, 0.0, RADIUS), (0.7, 0.1, 0.4)]),
    "off the middle": asm.shapes.plate(3.0, 2.0, THICK, [(-0.8, 0.45, RADIUS), (0.3, -0.3, 0.2), (1.1, 0.5, 0.3)]),
}
RINGS = {
    "washer": asm.shapes.revolution(asm.curves.polygon([(RADIUS, 0.0), (1.0, 0.0), (1.0, THICK), (RADIUS, THICK)])),
    "two rings": asm.shapes.revolution(
        asm.curves.polygon([(RADIUS, 0.0), (1.0, 0.0), (1.0, 1.0), (0.7, 1.0), (0.7, 0.5), (RADIUS, 0.5)])
    ),
}
PLACES = {"one hole": (0.0, 0.0), "two holes": (-0.7, 0.0), "off the middle": (-0.8, 0.45)}


def faces_below(links, k):
    """Numbers of the faces of which a node has cells."""
    waiting, found = [k], set()
    while waiting:
        k = waiting.pop()
        if links.face[k] != NONE:
            found.add(int(links.face[k]))
        else:
            waiting += [int(links.child[k]), int(links.child[k]) + 1]
    return found


def moved(faces, rotation, translation):
    """The same faces elsewhere: loops are in (u, v), and stay."""
    out = []
    for face in faces:
        surface = face.surface.transformed(rotation, translation)
        outer = None if face.outer is None else face.outer.curves
        out.append(Face(surface, outer, [hole.curves for hole in face.holes], reversed=face.reversed))
    return tuple(out)


@pytest.mark.parametrize("name", [*PLATES, *RINGS, "plate", "slot", "cam", "bumpy hole", "trimmed ball", "pin", "box"])
def test_nodes_are_outside_of_their_bores(name):
    rng = np.random.default_rng(0)
    faces = faces_of({**shapes(), **PLATES, **RINGS}[name])
    if name in PLATES or name in RINGS:
        faces = moved(faces, Rotation.random(random_state=3).as_matrix(), [1.0, -2.0, 0.5])
    forest = forest_of(faces)
    halve_all(forest, rng)
    links, nodes = tree_of(forest)
    points = [surface_points(face, 1500, rng) for face in solid_of(faces).faces]
    far = max(np.abs(p).max() for p in points)
    bored = np.flatnonzero(nodes.bore > 0.0)
    assert (len(bored) > 10) == (name in PLATES or name in RINGS or name in ("plate", "slot", "cam"))
    # A disc that is the hull of a whole flat face is outside of that face's hole.
    discs = (nodes.disc[bored] > 0.0) & (links.face[bored] == NONE)
    assert discs.any() == (name in RINGS)
    nearest = {}
    for k in bored:
        line = (*nodes.spine[k], *nodes.ruling[k])
        for number in faces_below(links, k):
            if (line, number) not in nearest:
                off = points[number] - nodes.spine[k]
                off -= (off @ nodes.ruling[k])[:, None] * nodes.ruling[k]
                nearest[line, number] = np.linalg.norm(off, axis=1).min()
            assert nearest[line, number] >= nodes.bore[k] - OFF * far


@pytest.mark.parametrize("name", ["ellipsoid", "torus", "sheet", "trimmed ball", "cam", "cone"])
def test_distances_from_axes(name, cases):
    """A line past a body is no nearer to its faces than their cells tell."""
    rng, told = np.random.default_rng(0), 0
    faces = faces_of(shapes()[name])
    cells = cells_of_body(faces)
    rows = cells.first
    parts = rows_of(LINKS, cells.links).face[rows]
    records = rows_of(NODE, cells.nodes)[rows]
    points = [surface_points(face, 4000, rng) for face in solid_of(faces).faces]
    for _ in range(cases(20, 500)):
        axis, center = direction(rng), cells.size * rng.uniform(-0.6, 0.6, 3)
        found = distances_of_parts(Round(center, axis, 0.0, 0.0, 0.0, False), parts, records, len(points))
        for least, samples in zip(found, points, strict=True):
            off = samples - center
            assert least <= np.linalg.norm(off - (off @ axis)[:, None] * axis, axis=1).min() + OFF
            told += least > 0.0
    assert told > 5


@pytest.mark.parametrize("name", PLATES)
def test_every_node_at_a_hole_has_its_bore(name):
    """Cells with a chord of a hole's circle, and walls, have the bore of that hole, whole as it is."""
    cells = cells_of_body(faces_of(PLATES[name]))
    links, nodes = rows_of(LINKS, cells.links), rows_of(NODE, cells.nodes)
    walls = cells.walls
    for k in np.flatnonzero(links.face != NONE):
        corners = nodes.corner[k, :3]
        for wall in walls:
            off = corners - wall.center
            off -= (off @ wall.axis)[:, None] * wall.axis
            if (np.linalg.norm(off, axis=1) < wall.radius + 1e-9).sum() > 1:
                assert nodes.bore[k] == pytest.approx(wall.radius, abs=1e-13)
                at_axis = nodes.spine[k] - wall.center
                assert np.linalg.norm(np.cross(at_axis, wall.axis)) < 1e-13


CONICAL = {
    "wider upwards": [(0.5, 0), (2, 0), (2, 1), (1, 1)],
    "wider downwards": [(1, 0), (2, 0), (2, 1), (0.5, 1)],
    "widest in the middle": [(0.5, 0), (2, 0), (2, 2), (0.5, 2), (1, 1)],
    "narrowest in the middle": [(1, 0), (2, 0), (2, 2), (1, 2), (0.5, 1)],
}


@pytest.mark.parametrize("name", CONICAL)
def test_nodes_are_outside_of_their_cones(name):
    """Of a cone, which gets wider along its axis only, each node has the axis that its level is meant along."""
    body = asm.shapes.revolution(asm.curves.polygon(CONICAL[name]))
    faces = moved(faces_of(body), Rotation.random(random_state=3).as_matrix(), [1.0, -2.0, 0.5])
    forest = forest_of(faces)
    halve_all(forest, np.random.default_rng(0))
    links, nodes = tree_of(forest)
    conical = np.flatnonzero((nodes.bore > 0.0) & (nodes.slant > 0.0) & (links.face != NONE))
    assert (links.form[conical] == FLAT).sum() > 10
    for node in nodes[conical]:
        off = node.corner - node.spine
        along = off @ node.ruling
        beside = np.linalg.norm(off - along[:, None] * node.ruling, axis=1)
        level = np.sqrt(1.0 - node.slant**2) * beside - node.slant * along
        assert level.min() >= node.bore - OFF * 5.0


@pytest.mark.parametrize("half_angle", [0.03, 0.5, 1.2])
def test_bounds_of_plugs_whichever_body_is_first(half_angle):
    """Lifted off its seat, a plug is as far from it as it is lifted times the sine of the half angle."""
    slope = np.tan(half_angle)
    heights = np.array([1.0, 2.0]) / slope
    seat = asm.shapes.revolution(
        asm.curves.polygon([(1, heights[0]), (4, heights[0]), (4, heights[1]), (2, heights[1])])
    )
    low, high = heights[0] + 0.2 / slope, heights[1] - 0.3 / slope
    plug = asm.shapes.revolution(asm.curves.polygon([(0, low), (1.2, low), (1.7, high), (0, high)]))
    for play in (1e-2, 1e-5):
        pose = at(0.0, 0.0, play / np.sin(half_angle), Rotation.from_rotvec([0.0, 0.0, 0.7]))
        (first,) = proof_of(seat, plug).look(poses(pose), 0.0)
        (second,) = proof_of(plug, seat).look(poses(UPRIGHT, pose), 0.0)
        for answer in (first, second):
            assert answer.verdict is Verdict.CLEAR
            assert 0.99 * play <= answer.bound <= play + 1e-13


@pytest.mark.parametrize("name", PLATES)
@pytest.mark.parametrize("play", [1e-3, 1e-5, 1e-7])
def test_pins_in_holes(name, play, cases):
    rng = np.random.default_rng(1)
    proof = proof_of(PLATES[name], asm.shapes.solid_cylinder(RADIUS - play, 1.2))
    for _ in range(cases(12, 400)):
        e, angle = play * rng.uniform(0.0, 2.0), rng.uniform(0.0, 2.0 * np.pi)
        place = np.array(PLACES[name]) + e * np.array([np.cos(angle), np.sin(angle)])
        turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(-3.0, 3.0)])
        verdict = proof.look(poses(at(*place, rng.uniform(-0.6, 0.6), turn)), 0.0)[0].verdict
        if e < play * (1.0 - 1e-3) - 1e-13:
            assert verdict is Verdict.CLEAR
        elif e > play + 1e-13:
            assert verdict is not Verdict.CLEAR


def farthest(center, radius, tilt, z):
    """How far the cut of a tilted cylinder with a plane z goes from the z axis."""
    axis = tilt.apply([0.0, 0.0, 1.0])
    middle = center + (z - center[2]) / axis[2] * axis
    x = np.array([axis[0], axis[1], 0.0])
    x = x / np.linalg.norm(x)
    t = np.linspace(0.0, 2.0 * np.pi, 2001)[:, None]
    ring = middle + radius * (np.cos(t) / axis[2] * x + np.sin(t) * np.cross([0.0, 0.0, 1.0], x))
    return float(np.linalg.norm(ring[:, :2], axis=1).max())


@pytest.mark.parametrize("play", [1e-3, 1e-5, 1e-7])
def test_tilted_pins(play, cases):
    rng, clear = np.random.default_rng(2), 0
    pin, long = RADIUS - play, 1.2
    proof = proof_of(PLATES["one hole"], asm.shapes.solid_cylinder(pin, long))
    for _ in range(cases(12, 400)):
        center = np.r_[play * rng.uniform(-0.7, 0.7, 2), rng.uniform(-0.2, 0.2)]
        tilt = Rotation.from_rotvec(np.r_[play * rng.uniform(-2.0, 2.0, 2), 0.0])
        verdict = proof.look(poses(at(*center, tilt)), 0.0)[0].verdict
        if max(farthest(center, pin, tilt, z) for z in (-0.5 * THICK, 0.5 * THICK)) > RADIUS + 1e-13:
            assert verdict is not Verdict.CLEAR
        # All of the pin within the bore, as long as that went on.
        ends = [center + s * 0.5 * long * tilt.apply([0.0, 0.0, 1.0]) for s in (-1.0, 1.0)]
        if max(np.linalg.norm(end[:2]) for end in ends) < 0.99 * play - 1e-13:
            clear += 1
            assert verdict is Verdict.CLEAR
    assert clear > 0


@pytest.mark.parametrize("play", [1e-3, 1e-5, 1e-7])
def test_a_pin_goes_along_its_bore(play):
    """Every step of the way is proven, and asks for few pairs of nodes: some cells are of two bores, and know one."""
    proof = proof_of(PLATES["two holes"], asm.shapes.solid_cylinder(RADIUS - play, 1.2))
    x, y = PLACES["two holes"]
    assert proof.look(poses(at(x, y, 0.5)), 0.0)[0].verdict is Verdict.CLEAR
    assert proof.fronts.counts.count[0] < 1500
    for k in range(1, 31):
        q = poses(at(x + 0.5 * play * np.sin(k), y + 0.5 * play * np.cos(2.0 * k), 0.5 - 0.04 * k))
        assert proof.look(q, 0.0, swept=True)[0].verdict is Verdict.CLEAR
    # Through the wall, it crosses on the way.
    assert proof.look(poses(at(x + 0.3, y, -0.7)), 0.0, swept=True)[0].verdict is not Verdict.CLEAR


def test_round_holes_of_flat_faces():
    plate = faces_of(PLATES["off the middle"])
    flat = [round_holes(face) for face in plate]
    assert sorted(len(holes) for holes in flat) == [0, 0, 0, 0, 0, 0, 0, 3, 3]
    for holes in flat:
        assert sorted(hole.radius for hole in holes) in ([], pytest.approx([0.2, 0.3, RADIUS], abs=1e-13))
    # The circle around a disc is no hole, and neither is an ellipse.
    pin = faces_of(asm.shapes.solid_cylinder(0.3, 1.0))
    assert [round_holes(face) for face in pin] == [[]] * 3
    circle = asm.NurbsCurve(
        0.4 * np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]),
        [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, 0.5**0.5, 1, 0.5**0.5, 1, 0.5**0.5, 1, 0.5**0.5, 1],
    )  # fmt: skip
    plane = asm.shapes.plane(2.0, 2.0)
    (hole,) = round_holes(Face(plane, holes=[[circle]]))
    assert hole.radius == pytest.approx(0.4, abs=1e-14) and not hole.outward
    assert len(round_holes(Face(plane, holes=[[circle.reversed()]], reversed=True))) == 1
    assert round_holes(Face(plane, outer=[circle])) == []
    off = asm.NurbsCurve(circle.control_points * [1.2, 1.0], circle.knots, 2, circle.weights)
    assert round_holes(Face(plane, holes=[[off]])) == []
    # Of what is nearly a circle, as in files, a circle within it is the hole.
    off = asm.NurbsCurve(circle.control_points * [1.0 + 1e-6, 1.0], circle.knots, 2, circle.weights)
    (near,) = round_holes(Face(plane, holes=[[off]]))
    assert 0.4 - 1e-6 < near.radius <= 0.4
    # The map from (u, v) to space need not keep angles: an ellipse there may be a circle here.
    skewed = asm.NurbsSurface(plane.control_points * [1.2, 1.0, 1.0], plane.knots, (1, 1))
    assert round_holes(Face(skewed, holes=[[circle]])) == []
    narrow = asm.NurbsCurve(circle.control_points / [1.2, 1.0], circle.knots, 2, circle.weights)
    assert len(round_holes(Face(skewed, holes=[[narrow]]))) == 1
