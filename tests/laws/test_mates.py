"""Mates from random starts: what they ask holds by closed form of the returned poses, and they take away what they say.

The parts are placed at random in their bodies, so that no axis is one of a body's. Residuals are found from the numbers
that the parts were made with, not from faces.
"""

from __future__ import annotations

from math import atan, hypot, pi, sin

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import rotation_matrix

SEEDS = range(8)
# Residuals of parts of some 10: solves hold to 2e-13 of the scene's size, and frames of faces add their rounding.
HELD = 1e-11


class Part:
    """A body whose shape is moved by a known rotation and translation in it."""

    def __init__(self, rng, name, faces, fixed=False):
        self.rotation = rotation_matrix(unit(rng.normal(size=4)))
        self.offset = rng.uniform(-3, 3, 3)
        faces = [faces] if isinstance(faces, (asm.NurbsSurface, asm.Face)) else faces
        faces = [face if isinstance(face, asm.Face) else asm.Face(face) for face in faces]
        shape = [face.transformed(self.rotation, self.offset) for face in faces]
        self.body = asm.Body(name, shape, rng.uniform(-6, 6, 3), unit(rng.normal(size=4)), fixed=fixed)

    def point(self, solution, x, y, z):
        """Where a point of the shape as it was made is in the world."""
        return solution.pose(self.body).apply(self.rotation @ np.array([x, y, z], dtype=float) + self.offset)

    def direction(self, solution, x, y, z):
        turn = rotation_matrix(solution.pose(self.body).q[3:])
        return turn @ self.rotation @ np.array([x, y, z], dtype=float)


def unit(vector):
    return vector / np.linalg.norm(vector)


def solved(parts, *constraints):
    """The solution, after a look at what is left free."""
    scene = asm.Assembly([part.body for part in parts])
    scene.constrain(*constraints)
    solution = scene.solve()
    assert solution.success, solution.message
    free = 6 * sum(not part.body.fixed for part in parts)
    assert scene.mobility(solution).dof == free - sum(mate.removes for mate in constraints)
    return solution


def plate(rng, fixed=True):
    return Part(rng, "plate", asm.shapes.plate(10, 8, 2, [(1, -2, 1.5)]), fixed)


def bolt(rng):
    """A shank of radius 1 from z = -3 to 1, and a head of radius 2 above it."""
    profile = asm.curves.polygon([(0, -3), (1, -3), (1, 1), (2, 1), (2, 2), (0, 2)])
    return Part(rng, "bolt", asm.shapes.revolution(profile))


def box(rng, name="box"):
    return Part(rng, name, asm.shapes.box(3, 4, 5))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("axes", ["opposed", "aligned", "nearest"])
def test_flush(seed, axes):
    rng = np.random.default_rng(seed)
    a, b = plate(rng, seed % 2 == 0), box(rng)
    offset = rng.uniform(-2, 2)
    mate = asm.Flush(a.body.faces(selector(a, (0, 0, 1))), b.body.face("right"), offset=offset, axes=axes)
    solution = solved([a, b], mate)
    n, m = a.direction(solution, 0, 0, 1), b.direction(solution, 1, 0, 0)
    sense = 1.0 if mate.axes == "aligned" else -1.0
    assert np.linalg.norm(m - sense * n) < HELD
    assert abs(n @ (b.point(solution, 1.5, 1, 1) - a.point(solution, 3, 3, 1)) - offset) < HELD
    assert mate.removes == 3 and solution.axes == ({mate.name: mate.axes} if axes == "nearest" else {})


def selector(part, direction):
    """The selector string of the face farthest along a direction of the shape as it was made."""
    x, y, z = part.rotation @ np.array(direction, dtype=float)
    return f"+({x:.12f}, {y:.12f}, {z:.12f})"


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("axes", ["opposed", "aligned", "nearest"])
def test_coaxial(seed, axes):
    rng = np.random.default_rng(seed)
    a, b = plate(rng), bolt(rng)
    start = [part.direction(asm.Assembly([a.body, b.body]).solve(), 0, 0, 1) for part in (a, b)]
    shank = b.body.faces.cylinders(radius=1)
    mate = asm.Coaxial(a.body.faces.cylinders(), shank if seed % 2 else b.body.edges.of(shank.one())[1:2], axes=axes)
    solution = solved([a, b], mate)
    n, m = a.direction(solution, 0, 0, 1), b.direction(solution, 0, 0, 1)
    if axes == "nearest":
        assert (n @ m > 0) == (start[0] @ start[1] > 0)
    assert np.linalg.norm(np.cross(n, m)) < HELD and mate.removes == 4
    for z in (-3, 1):
        off = b.point(solution, 0, 0, z) - a.point(solution, 1, -2, 0)
        assert np.linalg.norm(np.cross(n, off)) < HELD


@pytest.mark.parametrize("seed", SEEDS)
def test_insert_puts_a_head_on_a_mouth(seed):
    rng = np.random.default_rng(seed)
    a, b = plate(rng), bolt(rng)
    mate = asm.Insert(a.body.faces.cylinders(hole=True), b.body.faces.cylinders(radius=1))
    solution = solved([a, b], mate)
    n, m = a.direction(solution, 0, 0, 1), b.direction(solution, 0, 0, 1)
    side = 1.0 if mate.seats.hole.frame().axes[:, 2] @ (a.rotation @ [0, 0, 1]) > 0 else -1.0
    assert np.linalg.norm(m - side * n) < HELD
    assert np.linalg.norm(b.point(solution, 0, 0, 1) - a.point(solution, 1, -2, side)) < HELD
    assert mate.removes == 5 and mate.axes == "opposed"


@pytest.mark.parametrize("seed", SEEDS)
def test_insert_puts_a_pin_on_the_bottom_of_a_blind_hole(seed):
    rng = np.random.default_rng(seed)
    cup = asm.curves.polygon([(0, 0), (2, 0), (2, 3), (1, 3), (1, 1), (0, 1)])
    a, b = Part(rng, "cup", asm.shapes.revolution(cup)), Part(rng, "pin", asm.shapes.solid_cylinder(0.9, 4))
    mate = asm.Insert(a.body.faces.cylinders(hole=True), b.body.faces.cylinders(), offset=0.25)
    solution = solved([a, b], mate)
    n = a.direction(solution, 0, 0, 1)
    ends = [b.point(solution, 0, 0, z) for z in (-2, 2)]
    floor = a.point(solution, 0, 0, 1.25)
    assert min(np.linalg.norm(end - floor) for end in ends) < HELD
    assert max(n @ (end - floor) for end in ends) == pytest.approx(4)


def test_the_offset_of_an_insert_is_set_between_solves():
    rng = np.random.default_rng(5)
    a, b = plate(rng), Part(rng, "pin", asm.shapes.solid_cylinder(0.9, 4))
    mouth = a.body.edges.circles().near(a.rotation @ [1, -2, 1] + a.offset)
    end = b.body.edges.circles().near(b.rotation @ [0, 0, 2] + b.offset)
    mate = asm.Insert(mouth, end, offset=0.5)
    scene = asm.Assembly([a.body, b.body])
    scene.constrain(mate)
    for height in (0.5, -0.75, 0.0):
        mate.offset = height
        solution = scene.solve()
        assert solution.success and mate.removes == 5
        assert np.linalg.norm(b.point(solution, 0, 0, 2) - a.point(solution, 1, -2, 1.0 + height)) < HELD
    with pytest.raises(asm.errors.InputError, match="offset is nan"):
        mate.offset = float("nan")


def test_mates_of_one_kind_between_two_bodies_have_names_of_their_own():
    a, b = (asm.Body(name, asm.shapes.box(1, 1, 1)) for name in "ab")
    mates = [asm.Flush(a.faces(way), b.faces(way), axes="aligned") for way in (">X", ">Y", ">Z")]
    mates.append(asm.Flush(a.faces("<X"), b.faces("<X"), "flush a-b 2", axes="aligned"))
    scene = asm.Assembly([a, b])
    scene.constrain(mates[0], mates[3], mates[1], mates[2])
    assert [mate.name for mate in mates] == ["flush a-b", "flush a-b 3", "flush a-b 4", "flush a-b 2"]
    # A name that an assembly has taken stays: it is what files and results know the mate by.
    other = asm.Assembly([a, b])
    other.constrain(mates[2])
    assert mates[2].name == "flush a-b 4"
    with pytest.raises(asm.errors.InputError, match="'flush a-b 4' is taken"):
        other.constrain(mates[2])
    round_faces = [asm.Body(name, asm.shapes.solid_cylinder(1.0, 2.0)).faces.cylinders() for name in "cd"]
    tangents = [asm.Tangent(*round_faces, touch=touch) for touch in ("line", "point")]
    third = asm.Assembly([tangents[0].bodies[0], tangents[0].bodies[1]])
    third.constrain(*tangents)
    assert [mate.name for mate in tangents] == ["tangent c-d", "tangent c-d 2"]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("axes", ["opposed", "aligned"])
def test_insert_of_edges(seed, axes):
    rng = np.random.default_rng(seed)
    a, b = plate(rng), Part(rng, "pin", asm.shapes.solid_cylinder(0.9, 4))
    mouth = a.body.edges.circles().near(a.rotation @ [1, -2, 1] + a.offset)
    end = b.body.edges.circles().near(b.rotation @ [0, 0, 2] + b.offset)
    solution = solved([a, b], asm.Insert(mouth, end, axes=axes))
    n, m = a.direction(solution, 0, 0, 1), b.direction(solution, 0, 0, 1)
    assert np.linalg.norm(m - (n if axes == "aligned" else -n)) < HELD
    assert np.linalg.norm(b.point(solution, 0, 0, 2) - a.point(solution, 1, -2, 1)) < HELD


@pytest.mark.parametrize("seed", SEEDS)
def test_concentric(seed):
    rng = np.random.default_rng(seed)
    ball = Part(rng, "ball", asm.shapes.sphere(0.8))
    socket = Part(rng, "socket", asm.Face(asm.shapes.sphere(0.8), reversed=True))
    mate = asm.Concentric(ball.body.face(), socket.body.faces.spheres(hole=True))
    solution = solved([ball, socket], mate)
    assert np.linalg.norm(ball.point(solution, 0, 0, 0) - socket.point(solution, 0, 0, 0)) < HELD and mate.removes == 3


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sphere_in_a_cone_touches_all_around(seed):
    rng = np.random.default_rng(seed)
    ball = Part(rng, "ball", asm.shapes.sphere(0.8))
    cone = Part(rng, "cone", asm.Face(asm.shapes.cone(3, 4), reversed=True))
    sides = [ball.body.faces, cone.body.faces]
    solution = solved([ball, cone], asm.Concentric(*sides[:: 1 if seed % 2 else -1]))
    # The cone's apex is at z = 2, its lines lean by atan(3 / 4).
    center, apex, down = (
        ball.point(solution, 0, 0, 0),
        cone.point(solution, 0, 0, 2),
        cone.direction(solution, 0, 0, -1),
    )
    height = down @ (center - apex)
    assert np.linalg.norm(center - apex - height * down) < HELD
    assert abs(height * sin(atan(3 / 4)) - 0.8) < HELD  # the distance from a point of the axis to the lines


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("side", ["outside", "inside"])
def test_tangent_spheres_and_a_plane(seed, side):
    rng = np.random.default_rng(seed)
    a, b = Part(rng, "a", asm.shapes.sphere(2)), Part(rng, "b", asm.shapes.sphere(0.7))
    mate = asm.Tangent(a.body.faces, b.body.faces, side=side)
    solution = solved([a, b], mate)
    apart = np.linalg.norm(a.point(solution, 0, 0, 0) - b.point(solution, 0, 0, 0))
    assert abs(apart - (2.7 if side == "outside" else 1.3)) < 1e-10 and mate.removes == 1
    floor = Part(rng, "floor", asm.shapes.plane(60, 60))
    solution = solved([floor, b], asm.Tangent(floor.body.faces, b.body.faces, side=side))
    n = floor.direction(solution, 0, 0, 1)
    height = n @ (b.point(solution, 0, 0, 0) - floor.point(solution, 0, 0, 0))
    assert abs(height - (0.7 if side == "outside" else -0.7)) < 1e-10


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("axes", ["opposed", "aligned", "nearest"])
def test_width(seed, axes):
    rng = np.random.default_rng(seed)
    slot, tab = box(rng, "slot"), box(rng, "tab")
    mate = asm.Width(
        (slot.body.face("left"), slot.body.face("right")), (tab.body.face("top"), tab.body.face("bottom")), axes=axes
    )
    solution = solved([slot, tab], mate)
    n, m = slot.direction(solution, 1, 0, 0), tab.direction(solution, 0, 0, 1)
    assert np.linalg.norm(np.cross(n, m)) < HELD and mate.removes == 3
    if axes != "nearest":
        assert (n @ m < 0) == (axes == "aligned")  # of the first faces: left against top
    assert abs(n @ (tab.point(solution, 0, 0, 0) - slot.point(solution, 0, 0, 0))) < HELD


@pytest.mark.parametrize("seed", SEEDS)
def test_symmetric(seed):
    rng = np.random.default_rng(seed)
    a, b = Part(rng, "a", asm.shapes.sphere(2)), Part(rng, "b", asm.shapes.box(1, 1, 1))
    mirror = plate(rng, seed % 2 == 0)
    corner = b.body.vertices.near(b.rotation @ [0.5, 0.5, 0.5] + b.offset)
    mate = asm.Symmetric(a.body.faces, corner, mirror.body.faces.near(mirror.rotation @ [4, 3, 1] + mirror.offset))
    solution = solved([a, b, mirror], mate)
    n, o = mirror.direction(solution, 0, 0, 1), mirror.point(solution, 0, 0, 1)
    p, q = a.point(solution, 0, 0, 0), b.point(solution, 0.5, 0.5, 0.5)
    assert np.linalg.norm(q - (p - 2 * (n @ (p - o)) * n)) < HELD and mate.removes == 3


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("fixed", [(), (1,), (0, 2)])
def test_group(seed, fixed):
    rng = np.random.default_rng(seed)
    parts = [Part(rng, f"part {k}", asm.shapes.box(1, 2, 3), k in fixed) for k in range(4)]
    before = [part.body.pose for part in parts[:3]]
    group = asm.Group([part.body for part in parts[:3]])
    scene = asm.Assembly([part.body for part in parts])
    scene.constrain(group)
    scene.minimize(asm.PointDistance(parts[1].body.point(0, 0, 0), (1, 2, 3)))
    solution = scene.solve()
    assert solution.success and group.removes == (12 if len(fixed) < 2 else 6)
    assert scene.mobility(solution).dof == 6 * (4 - len(fixed)) - group.removes
    after = [solution.pose(part.body) for part in parts[:3]]
    for k in (1, 2):
        turns = [rotation_matrix(pose[0].q[3:]).T @ rotation_matrix(pose[k].q[3:]) for pose in (before, after)]
        ways = [rotation_matrix(p[0].q[3:]).T @ (p[k].position - p[0].position) for p in (before, after)]
        assert abs(turns[0] - turns[1]).max() < HELD and abs(ways[0] - ways[1]).max() < HELD
    if not fixed:
        assert np.linalg.norm(after[1].position - [1, 2, 3]) < 1e-6


@pytest.mark.parametrize("seed", SEEDS)
def test_linear(seed):
    rng = np.random.default_rng(seed)
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a", position=rng.normal(size=3)), asm.Body("b")
    ways = [asm.Prismatic(ground.frame(z=rng.normal(size=3)), body, body.name) for body in (a, b)]
    ratio, offset = rng.uniform(-2, 2), rng.uniform(-1, 1)
    scene = asm.Assembly([ground, a, b])
    scene.constrain(*ways, asm.Linear(*ways, ratio, offset=offset))
    ways[0].slide = 1.5
    solution = scene.solve()
    z = ways[1].frame_a.axes[:, 2]
    assert solution.success and scene.mobility(solution, drives=False).dof == 1
    assert abs(solution.pose(b).position - (1.5 * ratio + offset) * z).max() < 1e-12


@pytest.mark.parametrize("swing", [0.0, 0.3, 1.2])
def test_constant_velocity_hands_on_turns_as_they_are(swing):
    """Two hinges at an angle, with shafts of the joint: where a Cardan joint surges, this one does not."""
    ground, one, other = asm.Body("ground", fixed=True), asm.Body("one"), asm.Body("other")
    bent = (np.sin(swing), 0.0, np.cos(swing))
    first = asm.Revolute(ground.frame(), one.frame(), "first", angle=0.0)
    second = asm.Revolute(ground.frame(z=bent, x=(np.cos(swing), 0.0, -np.sin(swing))), other.frame(), "second")
    scene = asm.Assembly([ground, one, other])
    scene.constrain(first, second, asm.ConstantVelocity(one, other, "joint"))
    solution = scene.solve()
    for angle in np.linspace(0, 2 * pi, 33)[1:]:
        first.angle = angle
        solution = scene.solve(solution)
        assert solution.success
        off = np.exp(1j * (solution.values["second.angle"] - angle)) - 1.0
        assert abs(off) < 1e-11
    assert scene.mobility(solution, drives=False).dof == 1


def test_axes_are_those_of_the_start_and_solutions_keep_theirs():
    plate = asm.Body("plate", asm.shapes.plate(10, 8, 2, [(1, 1, 1.5)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(1.4, 5), (1, 1, 2))
    mate = asm.Coaxial(plate.faces.cylinders(), pin.faces.cylinders(), "mate", slide=2.0)
    scene = asm.Assembly([plate, pin])
    scene.constrain(mate)
    upright = scene.solve()
    q = scene.q.copy()
    q[1, 3:] = 0, 1, 0, 0
    turned = scene.solve(q)
    assert (upright.axes, turned.axes) == ({"mate": "aligned"}, {"mate": "opposed"})
    assert mate.axes == "opposed" and "axes opposed, which was nearest" in str(turned)
    assert upright.values["mate.slide"] == pytest.approx(2) and turned.values["mate.slide"] == pytest.approx(2)
    again = scene.solve(upright)
    assert again.axes == {"mate": "aligned"} and again.iterations == 0 and abs(again.q - upright.q).max() < 1e-15
    assert turned.axes == {"mate": "opposed"} and scene.mobility(turned).dof == upright.mobility.dof == 1


def test_a_driven_freedom_follows_axes_that_turn():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    hinge = asm.Revolute(ground, arm, "hinge", axes="nearest", angle=0.4)
    wheel = asm.Body("wheel")
    other = asm.Revolute(ground, wheel, "other")
    scene = asm.Assembly([ground, arm, wheel])
    scene.constrain(hinge, other, asm.Gear(hinge, other, -2.0))
    q = scene.q.copy()
    for row, sense in (((1, 0, 0, 0), "aligned"), ((0, 1, 0, 0), "opposed"), ((1, 0, 0, 0), "aligned")):
        q[1, 3:] = row
        solution = scene.solve(q)
        assert solution.success and solution.axes == {"hinge": sense}
        assert solution.values["hinge.angle"] == pytest.approx(0.4, abs=1e-12)
        assert solution.values["other.angle"] == pytest.approx(-0.8, abs=1e-12)
        z = rotation_matrix(solution.pose(arm).q[3:])[:, 2]
        assert z[2] == pytest.approx(1.0 if sense == "aligned" else -1.0)
        assert hypot(z[0], z[1]) < 1e-12


@pytest.mark.parametrize("seed", range(12))
def test_axes_that_the_start_gets_wrong_are_those_where_the_rest_holds(seed):
    """Parts that lie about: what axes are nearest to there may contradict what is flush."""
    rng = np.random.default_rng(seed)
    a, b = plate(rng), Part(rng, "upper", asm.shapes.plate(10, 8, 2, [(1, -2, 1.5)]))
    flush = asm.Flush(a.body.face("top"), b.body.face("bottom"))
    # The axis of an edge is outward of its face, so that "aligned" is what the flush faces ask for.
    rim = b.body.edges.of(b.body.face("top")).circles()
    mouth = a.body.edges.of(a.body.face("top")).circles()
    mate = asm.Coaxial(mouth, rim, "mate")
    scene = asm.Assembly([a.body, b.body])
    scene.constrain(flush, mate)
    solution = scene.solve()
    assert solution.success and solution.axes == {"mate": "aligned"}
    assert np.linalg.norm(b.point(solution, 1, -2, -1) - a.point(solution, 1, -2, 1)) < HELD


def every_kind(rng):
    """Parts of a machine with a mate of every kind, that hold together."""
    a, b = plate(rng), bolt(rng)
    lever, ball = box(rng, "lever"), Part(rng, "ball", asm.shapes.sphere(0.8))
    cone = Part(rng, "cone", asm.Face(asm.shapes.cone(3, 4), reversed=True))
    seat = asm.Insert(a.body.faces.cylinders(hole=True), b.body.faces.cylinders(radius=1))
    mates = [
        seat,
        asm.Flush(a.body.face("front"), lever.body.face("left"), offset=1.0),
        asm.Concentric(cone.body.face(), ball.body.face()),
        asm.Symmetric(ball.body.face(), lever.body.point(0, 0, 0), a.body.face("right")),
        asm.Tangent(ball.body.face(), Part(rng, "other", asm.shapes.sphere(1)).body.face()),
        asm.Group([cone.body, Part(rng, "cap", asm.shapes.box(1, 1, 1)).body]),
    ]
    bodies = dict.fromkeys(body for mate in mates for body in mate.bodies)
    scene = asm.Assembly(bodies)
    scene.constrain(*mates)
    return scene


@pytest.mark.parametrize("seed", range(4))
def test_another_solver_agrees(seed):
    """The same scene in CasADi and IPOPT, from the same start: it has rows of its own."""
    scene = every_kind(np.random.default_rng(seed))
    scene.minimize(asm.Posture())
    first = scene.solve()
    second = asm.reference.solve(scene, first.q)
    assert first.success and second.success and abs(first.q - second.q).max() < 1e-6


def test_groups_and_symmetries_are_named_where_they_contradict():
    a, b, c = (asm.Body(name, fixed=name == "a") for name in "abc")
    scene = asm.Assembly([a, b, c])
    scene.constrain(asm.Group([a, b, c], "group"), asm.Distance(b.point(0, 0, 0), c.point(0, 0, 0), 2.0, "apart"))
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE and solution.conflicting == ["apart", "group"]
    held = asm.Assembly([a, b, c])
    held.constrain(asm.Group([a, b, c], "group"), asm.Parallel(b, c, "parallel"))
    assert held.mobility().redundant_sets == [("group", "parallel")] and held.solve().success


def test_what_a_group_holds_together_counts_as_joined():
    box, other = (asm.Body(name, asm.shapes.box(1, 1, 1), (x, 0, 0)) for name, x in (("one", 0.0), ("other", 0.5)))
    scene = asm.Assembly([box, other])
    scene.constrain(asm.Group([box, other]))
    solution = scene.solve()
    assert solution.crossings == () and solution.crossings_of_joined == (("one", "other"),)


def test_under_a_clearance_axes_are_nearest_as_well():
    plate = asm.Body("plate", asm.shapes.plate(10, 8, 2, [(1, 1, 1.5)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(1.4, 5), (1.2, 1.1, 0.3), (0, 1, 0, 0))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Coaxial(plate.faces.cylinders(), pin.faces.cylinders(), "mate"), asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.proved and solution.axes == {"mate": "opposed"}
    assert abs(solution.pose(pin).position[:2] - 1.0).max() < 1e-12
    tracker = scene.tracker(pin.point(0, 0, 0))
    step = tracker.step((1.0, 1.0, 0.8))
    assert step.feasibility < 1e-12 and step.solution.axes == {"mate": "opposed"}
