"""Small assemblies as users write them, from random starts: what they come to is known in closed form.

Parts are placed at random in their bodies (`Part`), so that nothing is along an axis by chance.
"""

from __future__ import annotations

from math import pi, sqrt

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import rotation_matrix
from tests.laws.test_mates import Part

SHAPES = asm.shapes
SEEDS = range(5)
# Solves hold to 2e-13 of sizes of some 40; where rows are many, what they leave adds up.
HELD = 1e-9


def turned(axis, angle):
    return rotation_matrix(np.append(np.cos(angle / 2), np.sin(angle / 2) * np.eye(3)[axis]))


def solved(parts, dof, *constraints):
    scene = asm.Assembly([part.body for part in parts])
    scene.constrain(*constraints)
    solution = scene.solve()
    assert solution.success, solution.message
    assert scene.mobility(solution).dof == dof
    return solution


def box_in_a_corner(rng):
    """Three faces on three faces."""
    a, b = Part(rng, "a", SHAPES.box(6, 5, 4), fixed=True), Part(rng, "b", SHAPES.box(2, 3, 1))
    up = asm.Flush(a.body.face("top"), b.body.face("bottom"), "up")
    level = [asm.Flush(a.body.face(n), b.body.face(n), n, axes="aligned") for n in ("left", "front")]
    solution = solved([a, b], 0, up, *level)
    yield b.point(solution, -1, -1.5, -0.5) - a.point(solution, -3, -2.5, 2)


def box_centered_by_widths(rng):
    a, b = Part(rng, "a", SHAPES.box(6, 5, 4), fixed=True), Part(rng, "b", SHAPES.box(2, 3, 1))
    pairs = (("left", "right"), ("front", "back"))
    widths = [asm.Width(*([p.body.face(n) for n in names] for p in (a, b)), names[0]) for names in pairs]
    solution = solved([a, b], 0, *widths, asm.Flush(a.body.face("top"), b.body.face("bottom")))
    yield b.point(solution, 0, 0, -0.5) - a.point(solution, 0, 0, 2)


def bolted_cover(rng):
    holes, profile = [(2, 1, 1), (-3, 0, 1)], [(0, -6), (0.9, -6), (0.9, 0), (2, 0), (2, 1), (0, 1)]
    base, cover = (Part(rng, n, SHAPES.plate(10, 8, h, holes), n == "base") for n, h in (("base", 2), ("cover", 1)))
    bolts = [Part(rng, f"bolt {k}", SHAPES.revolution(asm.curves.polygon(profile))) for k in range(2)]
    names = ("hole 1", "hole 2")
    mates = [asm.Flush(base.body.face("top"), cover.body.face("bottom"))]
    mates += [asm.Coaxial(base.body.face(n), cover.body.face(n), n) for n in names]
    mates += [
        asm.Insert(cover.body.face(n), bolt.body.faces.cylinders(0.9)) for n, bolt in zip(names, bolts, strict=True)
    ]
    solution = solved([base, cover, *bolts], 2, *mates)
    yield cover.point(solution, 2, 1, 0) - base.point(solution, 2, 1, 1.5)
    for (x, y, _), bolt in zip(holes, bolts, strict=True):
        # The head is on one of the cover's two faces.
        off = bolt.point(solution, 0, 0, 0) - cover.point(solution, x, y, 0)
        yield abs(off @ cover.direction(solution, 0, 0, 1)) - 0.5
        yield np.linalg.norm(off) - 0.5


def roller_in_a_v_block(rng):
    sides = [
        asm.Face(SHAPES.plane(20, 20), name=n).transformed(turned(0, s * pi / 4)) for n, s in (("l", 1), ("r", -1))
    ]
    block, roller = Part(rng, "block", sides, fixed=True), Part(rng, "roller", SHAPES.solid_cylinder(2, 10))
    wall = roller.body.face("wall")
    solution = solved([block, roller], 2, *(asm.Tangent(block.body.face(n), wall, n) for n in ("l", "r")))
    for z in (-5, 5):
        off = roller.point(solution, 0, 0, z) - block.point(solution, 0, 0, 0)
        yield off @ block.direction(solution, 0, 0, 1) - 2 * sqrt(2)
        yield off @ block.direction(solution, 0, 1, 0)


def ball_in_the_corner_of_a_room(rng):
    box = SHAPES.box(20, 20, 20)
    walls = [asm.Face(side.surface, reversed=not side.reversed, name=side.name) for side in box]
    room, ball = Part(rng, "room", walls, fixed=True), Part(rng, "ball", SHAPES.sphere(2))
    names = ("left", "front", "bottom")
    solution = solved([room, ball], 3, *(asm.Tangent(room.body.face(n), ball.body.face(), n) for n in names))
    yield ball.point(solution, 0, 0, 0) - room.point(solution, -8, -8, -8)


def heap_of_balls(rng):
    balls = [Part(rng, f"ball {k}", SHAPES.sphere(1 + 0.3 * k), k == 0) for k in range(4)]
    pairs = [(i, j) for i in range(4) for j in range(i)]
    mates = [asm.Tangent(balls[i].body.face(), balls[j].body.face()) for i, j in pairs]
    solution = solved(balls, 12, *mates)
    for i, j in pairs:
        apart = balls[i].point(solution, 0, 0, 0) - balls[j].point(solution, 0, 0, 0)
        yield np.linalg.norm(apart) - 2 - 0.3 * (i + j)


def ball_bearing(rng):
    inner, ball = Part(rng, "inner", SHAPES.cylinder(5, 4), fixed=True), Part(rng, "ball", SHAPES.sphere(1.5))
    outer = Part(rng, "outer", asm.Face(SHAPES.cylinder(8, 4), reversed=True))
    rings = [asm.Tangent(ring.body.face(), ball.body.face()) for ring in (inner, outer)]
    # One distance from an axis is asked for twice.
    solution = solved([inner, outer, ball], 7, asm.Coaxial(inner.body.face(), outer.body.face()), *rings)
    off = ball.point(solution, 0, 0, 0) - inner.point(solution, 0, 0, 0)
    yield np.linalg.norm(np.cross(inner.direction(solution, 0, 0, 1), off)) - 6.5


def rollers_on_a_floor(rng):
    floor = Part(rng, "floor", SHAPES.plane(30, 30), fixed=True)
    a, b = Part(rng, "a", SHAPES.cylinder(3, 8)), Part(rng, "b", SHAPES.cylinder(2, 8))
    touching = ((floor, a), (floor, b), (a, b))
    solution = solved([floor, a, b], 6, *(asm.Tangent(p.body.face(), q.body.face()) for p, q in touching))
    n, z = floor.direction(solution, 0, 0, 1), a.direction(solution, 0, 0, 1)
    origin = floor.point(solution, 0, 0, 0)
    yield [n @ (p.point(solution, 0, 0, 0) - origin) - r for p, r in ((a, 3), (b, 2))]
    yield np.linalg.norm(np.cross(z, b.point(solution, 0, 0, 0) - a.point(solution, 0, 0, 0))) - 5


def jaws(rng):
    base, a, b = (
        Part(rng, "base", SHAPES.box(40, 10, 2), fixed=True),
        *(Part(rng, n, SHAPES.box(2, 2, 6)) for n in "ab"),
    )
    mates = [
        asm.Symmetric(*(p.body.point(*p.offset) for p in (a, b)), base.body.frame(base.offset, base.rotation[:, 0]))
    ]
    for jaw in (a, b):
        mates += [
            asm.Flush(base.body.face("top"), jaw.body.face("bottom")),
            asm.Flush(base.body.face("front"), jaw.body.face("front"), f"front {jaw.body.name}", axes="aligned"),
        ]
    solution = solved([base, a, b], 1, *mates)
    x, origin = base.direction(solution, 1, 0, 0), base.point(solution, 0, 0, 0)
    yield sum(x @ (p.point(solution, 0, 0, 0) - origin) for p in (a, b))


def corner_beside_a_hole(rng):
    """A vertex at a distance from the axis of a hole, and above a face."""
    a, b = Part(rng, "a", SHAPES.plate(10, 8, 2, [(1, 1, 1)]), fixed=True), Part(rng, "b", SHAPES.box(1, 1, 1))
    corner = b.body.vertices[0]
    line = asm.PointOnLine(corner, a.body.face("hole 1"), distance=3.0)
    solution = solved([a, b], 4, line, asm.PointOnPlane(corner, a.body.faces.named("top"), offset=-2))
    off = solution.pose(b.body).apply(corner.center) - a.point(solution, 1, 1, 1)
    z = a.direction(solution, 0, 0, 1)
    yield z @ off + 2
    yield np.linalg.norm(np.cross(z, off)) - 3


def groups_in_a_chain(rng):
    parts = [Part(rng, f"part {k}", SHAPES.box(1, 2, 3), k == 0) for k in range(4)]
    base, *others = (part.body for part in parts)
    before = others[0].pose.inverse() @ others[2].pose
    groups = asm.Group(others[:2], "first"), asm.Group(others[1:], "second")
    solution = solved(parts, 3, *groups, asm.Flush(base.face("top"), others[2].face("top")))
    yield (solution.pose(others[0]).inverse() @ solution.pose(others[2])).position - before.position


CASES = [
    box_in_a_corner,
    box_centered_by_widths,
    bolted_cover,
    roller_in_a_v_block,
    ball_in_the_corner_of_a_room,
    heap_of_balls,
    ball_bearing,
    rollers_on_a_floor,
    jaws,
    corner_beside_a_hole,
    groups_in_a_chain,
]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_small_assemblies(case, seed):
    for off in case(np.random.default_rng(seed)):
        assert np.abs(off).max() < HELD


def quarter_turns():
    """The 24 ways in which a cube stands on its faces."""
    found = []
    for x in range(4):
        for y in range(4):
            for z in range(4):
                turn = np.rint(turned(0, x * pi / 2) @ turned(1, y * pi / 2) @ turned(2, z * pi / 2))
                if not any((turn == other).all() for other, _ in found):
                    pose = asm.Pose()
                    for axis, k in ((0, x), (1, y), (2, z)):
                        pose = pose @ asm.Pose.from_axis_angle(np.eye(3)[axis], k * pi / 2)
                    found.append((turn, pose.quaternion))
    assert len(found) == 24
    return [quaternion for _, quaternion in found]


@pytest.mark.parametrize("quaternion", quarter_turns(), ids=str)
def test_a_bolt_goes_into_its_plate_however_it_lies(quaternion):
    plate = asm.Body("plate", SHAPES.plate(60, 40, 8, [(-20, 0, 3), (20, 0, 3)]), fixed=True)
    profile = asm.curves.polygon([(0, -12), (2.9, -12), (2.9, 0), (5, 0), (5, 4), (0, 4)])
    bolt = asm.Body("bolt", SHAPES.revolution(profile), (40, 10, 30), quaternion)
    scene = asm.Assembly([plate, bolt])
    scene.constrain(asm.Insert(plate.faces.cylinders(3)(">X"), bolt.faces.cylinders(2.9)))
    solution = scene.solve()
    pose, up = solution.pose(bolt), rotation_matrix(solution.pose(bolt).quaternion)[:, 2]
    # Under its head it is on the top, or on the bottom with its head below.
    side = np.sign(pose.position[2])
    assert solution.success and np.abs(pose.position - [20, 0, 4 * side]).max() < 1e-10
    assert np.abs(up - [0, 0, side]).max() < 1e-12 and scene.mobility(solution).dof == 1


DEGENERATE = {
    "a plane across a cylinder": (SHAPES.plane(20, 20), SHAPES.cylinder(1, 5)),
    "a plane across a cone": (SHAPES.plane(20, 20), SHAPES.cone(3, 4)),
    "balls about one center": (SHAPES.sphere(3), SHAPES.sphere(1)),
    "a ball on an axis": (SHAPES.cylinder(3, 8), SHAPES.sphere(1)),
    "cylinders about one axis": (SHAPES.cylinder(3, 8), SHAPES.cylinder(1, 8)),
    "a ball in a cone": (SHAPES.cone(3, 4), SHAPES.sphere(1)),
    "a ball in a plane": (SHAPES.plane(20, 20), SHAPES.sphere(1)),
}


@pytest.mark.parametrize("across", [False, True])
@pytest.mark.parametrize("kinds", DEGENERATE)
def test_tangents_from_where_directions_are_undefined(kinds, across):
    one, other = DEGENERATE[kinds]
    a, b = asm.Body("a", one, fixed=True), asm.Body("b", other)
    if across:
        b.pose = asm.Pose((0, 0, 0), (0.5**0.5, 0.5**0.5, 0, 0))
    scene = asm.Assembly([a, b])
    mate = asm.Tangent(a.face(), b.face())
    scene.constrain(mate)
    solution = scene.solve()
    assert solution.success and scene.mobility(solution).dof == 6 - mate.removes
