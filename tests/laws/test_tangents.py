"""Tangents of elementary faces from random starts: closed forms of the returned poses, ranks, and another solver.

What touches is judged by the numbers that parts were made with: heights of axes and centers, and generators of cones.
"""

from __future__ import annotations

import copy
import pickle
from math import atan, cos, pi, sin

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.contact import Contact
from assembly.kinematics.pose import rotation_matrix
from tests.laws.test_mates import HELD, Part, solved, unit

SEEDS = range(6)
ANGLE = atan(3 / 4)  # of a cone of radius 3 and height 4, whose apex is at z = 2


def hollow(surface):
    return asm.Face(surface, reversed=True)


def height(plane, solution, point):
    return float(plane.direction(solution, 0, 0, 1) @ (point - plane.point(solution, 0, 0, 0)))


def away(part, solution, point):
    """How far a point is from the z axis of a part, and how far along it."""
    off, z = point - part.point(solution, 0, 0, 0), part.direction(solution, 0, 0, 1)
    return float(np.linalg.norm(np.cross(z, off))), float(z @ off)


def center(part, solution):
    return part.point(solution, 0, 0, 0)


def gap_of_plane_and_ball(a, b, solution, side):
    return [height(a, solution, center(b, solution)) - side * 0.7]


def gap_of_plane_and_cylinder(a, b, solution, side):
    return [height(a, solution, b.point(solution, 0, 0, z)) - side * 0.7 for z in (-3, 3)]


def gap_of_plane_and_cone(a, b, solution, side):
    """The lowest of its lines is in the plane, the others above it, or below."""
    around = np.linspace(0, 2 * pi, 721)
    ends = [height(a, solution, b.point(solution, 3 * cos(t), 3 * sin(t), -2)) for t in around]
    apex = height(a, solution, b.point(solution, 0, 0, 2))
    # Of 720 lines the nearest is off by half a step: the height of its end by 3 cos(angle) of the square of that.
    return [apex, max(min(side * end for end in ends) - 3 * (pi / 720) ** 2, 0.0), min(min(side * e for e in ends), 0)]


def gap_of_balls(a, b, solution, side):
    apart = np.linalg.norm(center(a, solution) - center(b, solution))
    return [apart - (2.7 if side > 0 else 1.3)]


def gap_of_cylinder_and_ball(a, b, solution, side):
    return [away(a, solution, center(b, solution))[0] - (2.7 if side > 0 else 1.3)]


def gap_of_cone_and_ball(a, b, solution, side):
    # Along the outward normal of the line through (3, -2) and (0, 2).
    return _cone_gaps(a, solution, center(b, solution), side)


def gap_of_cylinders(a, b, solution, side):
    return [away(a, solution, b.point(solution, 0, 0, z))[0] - (2.7 if side > 0 else 1.3) for z in (-3, 3)]


def gap_of_cone_and_cylinder(a, b, solution, side):
    """Points of the axis, from far beside the apex on, are all at the radius from the lines of the cone."""
    along = b.direction(solution, 0, 0, 1)
    # The cone opens against its z.
    along = -along if along @ a.direction(solution, 0, 0, 1) > 0.0 else along
    foot = center(b, solution) + along * (along @ (a.point(solution, 0, 0, 2) - center(b, solution)))
    return [gap for t in (2, 5, 9) for gap in _cone_gaps(a, solution, foot + t * along, side)]


def _cone_gaps(a, solution, point, side):
    out, up = away(a, solution, point)
    return [cos(ANGLE) * out + sin(ANGLE) * (up - 2) - side * 0.7]


SHAPES = asm.shapes
PAIRS = {
    "plane, ball": (SHAPES.plane(10, 10), SHAPES.sphere(0.7), 1, gap_of_plane_and_ball),
    "plane, cylinder": (SHAPES.plane(10, 10), SHAPES.cylinder(0.7, 6), 2, gap_of_plane_and_cylinder),
    "plane, cone": (SHAPES.plane(10, 10), SHAPES.cone(3, 4), 2, gap_of_plane_and_cone),
    "ball, ball": (SHAPES.sphere(2), SHAPES.sphere(0.7), 1, gap_of_balls),
    "cylinder, ball": (SHAPES.cylinder(2, 6), SHAPES.sphere(0.7), 1, gap_of_cylinder_and_ball),
    "cone, ball": (SHAPES.cone(3, 4), SHAPES.sphere(0.7), 1, gap_of_cone_and_ball),
    "cylinder, cylinder": (SHAPES.cylinder(2, 6), SHAPES.cylinder(0.7, 6), 3, gap_of_cylinders),
    "cone, cylinder": (SHAPES.cone(3, 4), SHAPES.cylinder(0.7, 6), 3, gap_of_cone_and_cylinder),
}


@pytest.mark.parametrize("turned", [(), (0,), (1,), (0, 1)], ids=str)
@pytest.mark.parametrize("side", ["outside", "inside"])
@pytest.mark.parametrize("kinds", PAIRS)
def test_elementary_faces_touch_as_their_numbers_say(kinds, side, turned):
    """Each face may be hollow: then its outward normals are turned, and so is the side on which it is touched."""
    one, other, count, gaps = PAIRS[kinds]
    sign = (1.0 if side == "outside" else -1.0) * (-1.0) ** len(turned)
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        parts = [Part(rng, name, hollow(shape) if k in turned else shape) for k, (name, shape) in enumerate(
            (("one", one), ("other", other)))]  # fmt: skip
        faces = [part.body.face() for part in parts]
        if turned == (1,) and side == "outside" and "plane" not in kinds and "cone" not in kinds:
            # What is wider than a bore is not in it.
            with pytest.raises(asm.errors.InputError, match="expected one that fits"):
                asm.Tangent(*faces)
            continue
        mate = asm.Tangent(*(faces if seed % 2 else faces[::-1]), side=side)
        # It has the rank that it says, which `solved` holds against the rank of the rows.
        solution = solved(parts, mate)
        assert mate.removes == count and f"takes away {count} of 6" in repr(mate)
        assert np.abs(gaps(*parts, solution, sign)).max() < HELD


@pytest.mark.parametrize("kind", ["sphere", "cylinder"])
def test_a_ball_and_a_pin_in_a_bore_of_their_radius_are_on_its_axis(kind):
    rng = np.random.default_rng(3)
    bore, ball = Part(rng, "bore", hollow(SHAPES.cylinder(0.7, 6))), Part(rng, "ball", getattr(SHAPES, kind)(
        *([0.7] if kind == "sphere" else [0.7, 4])))  # fmt: skip
    mate = asm.Tangent(bore.body.face(), ball.body.face())
    solution = solved([bore, ball], mate)
    ends = (0,) if kind == "sphere" else (-2, 2)
    assert all(away(bore, solution, ball.point(solution, 0, 0, z))[0] < HELD for z in ends)
    assert mate.removes == (2 if kind == "sphere" else 4)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kinds", PAIRS)
def test_another_solver_agrees(kinds, seed):
    """In CasADi and IPOPT, from the same start: contacts that it lost before are rows of its own there."""
    rng = np.random.default_rng(seed)
    one, other, count, _ = PAIRS[kinds]
    parts = [Part(rng, "one", one, fixed=True), Part(rng, "other", other)]
    scene = asm.Assembly([part.body for part in parts])
    scene.constrain(asm.Tangent(parts[0].body.face(), parts[1].body.face()))
    put = scene.solve()
    target = parts[1].body.pose.position + rng.normal(size=3)
    scene.minimize(asm.FrameDistance(parts[1].body.frame(), asm.Pose(target, unit(rng.normal(size=4)))))
    first = scene.solve(put.q)
    second = asm.reference.solve(scene, first.q)
    assert first.success and second.success and abs(first.q - second.q).max() < 1e-6
    assert first.mobility.dof == 6 - count


@pytest.mark.parametrize("touch", ["line", "point"])
def test_two_cylinders_touch_along_a_line_or_crosswise(touch):
    pins = [asm.Body(f"pin {k}", SHAPES.cylinder(k + 1.0, 20), (0, 3.2 * k, 0), fixed=not k) for k in range(2)]
    pins[1].pose = asm.Pose((0.3, 3.2, 0.1), unit(np.array([1.0, 0.05, 0.3, 0.1])))
    scene = asm.Assembly(pins)
    mate = asm.Tangent(pins[0].face(), pins[1].face(), touch=touch)
    scene.constrain(mate)
    solution = scene.solve()
    assert solution.success and mate.touch == touch and mate.removes == (3 if touch == "line" else 1)
    assert scene.mobility(solution).dof == 6 - mate.removes
    z = rotation_matrix(solution.pose(pins[1]).q[3:])[:, 2]
    across = np.array([0, 0, 1.0]) if touch == "line" else unit(np.cross([0, 0, 1.0], z))
    x = solution.pose(pins[1]).position
    apart = np.linalg.norm(x - x[2] * across) if touch == "line" else abs(across @ x)
    assert apart == pytest.approx(3, abs=1e-11) and (abs(z[2]) == pytest.approx(1, abs=1e-12)) == (touch == "line")
    assert isinstance(mate, Contact) == (touch == "point") and isinstance(mate, asm.Tangent)


def test_which_tangents_are_contacts():
    box, ring = asm.Body("box", SHAPES.box(3, 4, 5)), asm.Body("ring", SHAPES.torus(4, 1))
    ball, egg = asm.Body("ball", SHAPES.sphere(1)), asm.Body("egg", SHAPES.ellipsoid(1, 2, 3))
    top = box.face("top")
    pairs = ((top, ring.face(), True), (top, egg.face(), True), (ball.face(), ring.face(), True))
    for a, b, tracked in (*pairs, (top, ball.face(), False)):
        mate = asm.Tangent(a, b)
        assert isinstance(mate, Contact) == tracked and mate.faces == (a, b)
    pin, tip = asm.Body("pin", SHAPES.cylinder(1, 6)), asm.Body("tip", SHAPES.cone(3, 4))
    for touch, count in (("line", 3), ("point", 1), (None, 3)):
        mate = asm.Tangent(tip.face(), pin.face(), touch=touch)
        assert isinstance(mate, Contact) == (touch == "point") and mate.removes == count
        assert mate.touch == (touch or "line") and f"touch={mate.touch!r}" in repr(mate)
    one_sided = asm.Tangent(top, ball.face(), unilateral=True)
    assert isinstance(one_sided, Contact) and one_sided.unilateral and "unilateral=True" in repr(one_sided)


def test_what_is_no_tangent_is_told():
    box, pin = asm.Body("box", SHAPES.box(3, 4, 5)), asm.Body("pin", SHAPES.solid_cylinder(1, 5))
    other = asm.Body("other", SHAPES.solid_cylinder(1, 5))
    top, wall = box.face("top"), pin.face("wall")
    with pytest.raises(asm.errors.InputError, match="two planes; expected Flush for them"):
        asm.Tangent(top, pin.face("top"))
    with pytest.raises(
        asm.errors.InputError, match="touch is 'point' of a plane and a cylinder; expected it of two cyl"
    ):
        asm.Tangent(top, wall, touch="point")
    with pytest.raises(asm.errors.InputError, match="touch is 'line' of a one-sided tangent; expected it of two cylin"):
        asm.Tangent(wall, other.face("wall"), touch="line", unilateral=True)
    with pytest.raises(asm.errors.InputError, match="touch is 'face'; expected 'line' or 'point'"):
        asm.Tangent(wall, other.face("wall"), touch="face")
    bore = asm.Body("bore", hollow(SHAPES.cylinder(0.9, 5)))
    with pytest.raises(asm.errors.InputError, match="has the radius 1, and bore.face.*, which is hollow, 0.9; exp"):
        asm.Tangent(wall, bore.face())
    assert asm.Tangent(wall, bore.face(), side="inside").removes == 3
    with pytest.raises(asm.errors.InputError, match="a and b are both on body 'pin'; expected two bodies"):
        asm.Tangent(wall, pin.face("top"))


@pytest.mark.parametrize("touch", ["line", "point"])
def test_copies_are_their_own(touch):
    one, other = (asm.Body(name, SHAPES.cylinder(2, 6)) for name in ("one", "other"))
    mate = asm.Tangent(one.face(), other.face(), touch=touch)
    for again in (copy.copy(mate), pickle.loads(pickle.dumps(mate))):
        assert repr(again) == repr(mate) and type(again) is type(mate) and again.removes == mate.removes
