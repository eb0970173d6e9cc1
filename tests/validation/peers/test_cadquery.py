"""CadQuery, `tests/test_assembly.py`: constraints of assemblies, with the locations that its tests ask for.

The kinds of its constraints, in the words of this library (faces by their centers and outward normals):

| CadQuery | here |
|---|---|
| Point | `Spherical`, or `Distance` with a parameter |
| Axis, an angle between outward normals, 180 degrees by default | `Parallel`, aligned or opposed, or `Angle` |
| Plane, both of these | `Revolute`, opposed |
| PointInPlane | `PointOnPlane` |
| PointOnLine | `PointOnLine` |
| Fixed, FixedPoint, FixedAxis, FixedRotation | a fixed body, and joints to it |

Its tests compare to 1e-6, the rounding of a minimizer; here rows hold to 2e-13 of the size.
"""

from __future__ import annotations

from math import cos, pi, radians, sin, sqrt

import numpy as np
import pytest

import assembly as asm

CLOSE = 1e-11
NORMALS = {
    ">X": (1, 0, 0),
    "<X": (-1, 0, 0),
    ">Y": (0, 1, 0),
    "<Y": (0, -1, 0),
    ">Z": (0, 0, 1),
    "<Z": (0, 0, -1),
}


def box(name, size, at=(0.0, 0.0, 0.0), fixed=False):
    return asm.Body(name, asm.shapes.box(*size), position=at, fixed=fixed)


def face(body, size, side, center=(0.0, 0.0, 0.0)):
    """The frame of a face of a box about a center: its middle, z outward."""
    normal = np.array(NORMALS[side], dtype=float)
    return body.frame(at=np.asarray(center) + 0.5 * normal * size, z=normal)


def solved(bodies, *constraints):
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED, solution.message
    return solution


def assert_at(solution, body, position):
    assert np.abs(solution.pose(body).position - position).max() < CLOSE


CUBE, TALL, LONG = (1, 1, 1), (1, 1, 2), (1, 1, 3)


@pytest.fixture(scope="module")
def three_boxes():
    """`test_constrain`, `simple_assy`: a cube whose corner is at its origin, two boxes on its left face."""
    base = box("base", CUBE, (2.5, -4.5, 0.5), fixed=True)
    second, third = box("second", TALL, (3, -4, 0)), box("third", LONG, (4, -2, 0))
    left = face(base, CUBE, "<X")
    return solved(
        [base, second, third],
        asm.Revolute(left, face(second, TALL, "<Z"), "Plane", axes="opposed"),
        asm.Parallel(left, face(third, LONG, "<Z"), "Axis", axes="opposed"),
        asm.Spherical(face(second, TALL, ">Z"), face(third, LONG, "<Z"), "Point"),
    )


@pytest.mark.parametrize(
    ("body", "position"),
    [
        ("base", (2.5, -4.5, 0.5)),  # its corner stays at (2, -5, 0)
        ("second", (2 - 1, -5 + 0.5, 0.5)),  # (-1, 0.5, 0.5) from that corner
        ("third", (2 - 3.5, -5 + 0.5, 0.5)),  # on the second's end
    ],
)
def test_constrain(three_boxes, body, position):
    assert_at(three_boxes, body, position)


def test_constrain_nested():
    # `nested_assy`: a sub-assembly whose part hangs at (0, 4, 0), the first of two boxes at (-2, 0, 0) from there.
    top, second = box("top", CUBE, fixed=True), box("second", CUBE, (0, 4, 0))
    slab, center = (1, 1, 0.5), (-2, 4, 0)
    solution = solved(
        [top, second],
        asm.Revolute(face(top, CUBE, ">Z"), face(second, slab, "<Z", center), "Plane", axes="opposed"),
        asm.Parallel(face(top, CUBE, ">X"), face(second, slab, "<X", center), "Axis", axes="opposed"),
    )
    assert_at(solution, second, (2, -4, 0.75))


BOX = (1, 2, 3)


@pytest.mark.parametrize(
    ("sides", "position"),
    [
        ((">X",), (0.5, 0, 0)),
        ((">X", ">Y"), (0.5, 1, 0)),
        ((">X", ">Y", ">Z"), (0.5, 1, 1.5)),
    ],
)
def test_point_in_planes(sides, position):
    # `test_PointInPlane_constraint`: one, two and three faces of a box; what is free stays where it was.
    block, vertex = box("box", BOX, fixed=True), asm.Body("vertex")
    planes = [asm.PointOnPlane(vertex, face(block, BOX, side), side) for side in sides]
    assert_at(solved([block, vertex], *planes), vertex, position)


@pytest.mark.parametrize("right", [-1, 0, 2])
@pytest.mark.parametrize("top", [-2, 0, 0.01])
def test_point_at_heights_over_planes(top, right):
    # `test_PointInPlane_param`
    block, vertex = box("box", BOX, fixed=True), asm.Body("vertex")
    solution = solved(
        [block, vertex],
        asm.PointOnPlane(vertex, face(block, BOX, ">Z"), "top", offset=top),
        asm.PointOnPlane(vertex, face(block, BOX, ">X"), "right", offset=right),
    )
    assert_at(solution, vertex, (0.5 + right, 0, 1.5 + top))


def test_point_in_planes_of_two_parts():
    # `test_PointInPlane_3_parts`: on the far end of a cylinder that stands on the box, and in the box's right face.
    block, vertex = box("box", BOX, fixed=True), asm.Body("vertex")
    cylinder = asm.Body("cylinder", asm.shapes.solid_cylinder(0.1, 2.0))
    solution = solved(
        [block, vertex, cylinder],
        asm.Revolute(face(block, BOX, ">Z"), cylinder.frame(at=(0, 0, -1), z=(0, 0, -1)), axes="opposed"),
        asm.PointOnPlane(vertex, cylinder.frame(at=(0, 0, 1))),
        asm.PointOnPlane(vertex, face(block, BOX, ">X")),
    )
    x, _, z = solution.pose(vertex).position
    assert abs(z - (1.5 + 2)) < CLOSE and abs(x - 0.5) < CLOSE


@pytest.mark.parametrize("body, middle", [("box1", 5.0), ("box2", 9.5), ("box3", 15.0)])
def test_stack(body, middle):
    # `test_toCompound`: boxes of heights 3, 4, 5 and 6 on top of each other are 18 high.
    heights = (3, 4, 5, 6)
    bodies = [box(f"box{k}", (1, 1, h), (0, 0, 0.5 * h * (k == 0)), fixed=k == 0) for k, h in enumerate(heights)]
    joints = [
        asm.Revolute(face(a, (1, 1, h), ">Z"), face(b, (1, 1, g), "<Z"), f"on {a.name}", axes="opposed")
        for a, b, h, g in zip(bodies, bodies[1:], heights, heights[1:], strict=False)
    ]
    solution = solved(bodies, *joints)
    assert_at(solution, body, (0, 0, middle))
    assert np.abs(solution.pose("box3").apply((0, 0, 3)) - (0, 0, 18)).max() < CLOSE


@pytest.mark.parametrize("kind", ["Plane", "PointInPlane", "Point"])
def test_infinite_faces(kind):
    # `test_infinite_face_constraint_Plane`: planes through the centers of two spheres at one place.
    parts = [asm.Body(f"part{k}", asm.shapes.sphere(1.0), fixed=k == 0) for k in range(2)]
    first, second = (part.frame() for part in parts)
    constraint = {
        "Plane": asm.Revolute(first, second, axes="opposed"),
        "PointInPlane": asm.PointOnPlane(first, second),
        "Point": asm.Spherical(first, second),
    }[kind]
    assert_at(solved(parts, constraint), "part1", (0, 0, 0))


SLAB = (2, 1, 1)


def ground_and_slab():
    """`simple_assy2`: a cube, and a box above it."""
    return box("b1", CUBE, fixed=True), box("b2", SLAB, (0, 0, 4))


@pytest.mark.parametrize("axis", [(0, 1, 1), (0, 2, 1), (1, 0, 0)])
def test_fixed_point_and_axis(axis):
    # `test_unary_constraints`, and its axis with those of `test_point_on_line`.
    ground, slab = ground_and_slab()
    solution = solved(
        [ground, slab],
        asm.Spherical(ground.point(0, 0, -3), slab, "FixedPoint"),
        asm.Parallel(ground.frame(z=axis), face(slab, SLAB, ">Z"), "FixedAxis"),
    )
    assert_at(solution, slab, (0, 0, -3))
    outward = solution.pose(slab).matrix[:3, 2]
    assert np.abs(outward - np.array(axis) / np.linalg.norm(axis)).max() < CLOSE


def test_fixed_rotation():
    # `test_fixed_rotation`: 45 degrees about x.
    ground, slab = ground_and_slab()
    turn = asm.Pose.from_axis_angle((1, 0, 0), radians(45))
    z, x = turn.apply((0, 0, 1)), turn.apply((1, 0, 0))
    solution = solved([ground, slab], asm.Fixed(ground.frame(at=(0, 0, -3), z=z, x=x), slab.frame()))
    assert_at(solution, slab, (0, 0, -3))
    corner = solution.pose(slab).apply((0, 0.5, 0.5))
    assert np.abs(corner - (0, 0, -3 + sqrt(0.5))).max() < CLOSE  # one edge is on top


def test_point_on_line():
    # `test_point_on_line`: the middle of the right face is on an edge of the cube, after two axes are fixed.
    ground, slab = ground_and_slab()
    solution = solved(
        [ground, slab],
        asm.Parallel(ground.frame(z=(0, 2, 1)), face(slab, SLAB, ">Z"), "up"),
        asm.Parallel(ground.frame(z=(1, 0, 0)), face(slab, SLAB, ">X"), "right"),
        asm.PointOnLine(face(slab, SLAB, ">X"), ground.frame(at=(0, 0.5, 0.5), z=(1, 0, 0))),
    )
    assert_at(solution, slab, (0, 0.5, 0.5))


@pytest.mark.parametrize("degrees", [45, 30, 90, 135])
def test_axis_at_an_angle(degrees):
    # `test_axis_constraint`, with 45 degrees; the other angles are ours.
    ground, slab = ground_and_slab()
    solution = solved(
        [ground, slab],
        asm.Parallel(face(ground, CUBE, ">Z"), face(slab, SLAB, ">Z"), "Axis"),
        asm.Angle(face(ground, CUBE, ">X"), face(slab, SLAB, ">X"), radians(degrees)),
    )
    turn = 2 * np.arccos(abs(solution.pose(slab).quaternion[0]))
    assert abs(turn - radians(degrees)) < CLOSE


@pytest.mark.parametrize("distance", [1.0, 0.25, 7.5])
def test_point_at_a_distance(distance):
    # `test_point_constraint`, with 1; the others are ours.
    ground, slab = ground_and_slab()
    solution = solved([ground, slab], asm.Distance(ground, slab, distance))
    assert abs(np.linalg.norm(solution.pose(slab).position) - distance) < CLOSE


def test_order_of_transforms():
    # `test_order_of_transform`: a marker on a corner of a part turned by 45 degrees, in an assembly that is moved.
    turned = asm.Pose.from_axis_angle((0, 0, 1), radians(45), (2, 0, 1.5))
    part = asm.Body("part", asm.shapes.box(1, 1, 1), turned.position, turned.quaternion, fixed=True)
    markers = [asm.Body(f"marker{k}", asm.shapes.sphere(0.2)) for k in (1, 2)]
    corner = part.point(-0.5, -0.5, 0.5)
    solution = solved([part, *markers], *(asm.Spherical(corner, marker) for marker in markers))
    for marker in markers:
        assert_at(solution, marker, (2 - cos(pi / 4) * 0.5 + sin(pi / 4) * 0.5, -sqrt(0.5), 2))


@pytest.mark.parametrize("distance", [5.0, 0.5, 1.5])
def test_what_contradicts_itself(distance):
    # A Plane puts the centers one apart, a Point asks for another distance. CadQuery minimizes the sum of squares of
    # both and ends between them; here the status says that they cannot both hold.
    base = box("base", (4, 3, 1), fixed=True)
    top = box("top", (1, 2, 1), (0, 0, 3))
    scene = asm.Assembly([base, top])
    scene.constrain(
        asm.Revolute(face(base, (4, 3, 1), ">Z"), face(top, (1, 2, 1), "<Z"), "Plane", axes="opposed"),
        asm.Distance(base, top, distance, "Point"),
    )
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE
    assert sorted(solution.conflicting) == ["Plane", "Point"]
