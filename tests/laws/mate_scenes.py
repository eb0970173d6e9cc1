"""A scene with each mate, as users write them; a body of it is for a hand to hold."""

from __future__ import annotations

import numpy as np

import assembly as asm

SHAPES = asm.shapes


def unit(*row):
    return np.array(row, dtype=float) / np.linalg.norm(row)


def hollow(surface):
    return asm.Face(surface, reversed=True)


def plate():
    return asm.Body("plate", SHAPES.plate(10, 8, 2, [(1, -2, 1.5)]), fixed=True)


def bolt():
    """A shank of radius 1.4 from z = -3 to 1, and a head above it."""
    profile = asm.curves.polygon([(0, -3), (1.4, -3), (1.4, 1), (2, 1), (2, 2), (0, 2)])
    return asm.Body("bolt", SHAPES.revolution(profile), (4, 3, 6), unit(1, 0.1, 0.2, 0.05))


def box(name="box", position=(0, 0, 5), quaternion=(1, 0.2, 0.1, 0)):
    return asm.Body(name, SHAPES.box(3, 4, 5), position, unit(*quaternion))


def flush(axes="opposed"):
    a, b = plate(), box(quaternion=(0.1, 1, 0.1, 0) if axes == "nearest" else (1, 0.2, 0.1, 0))
    return [a, b], [asm.Flush(a.face("top"), b.face("bottom"), axes=axes)], b


def coaxial(**freedoms):
    a, b = plate(), bolt()
    return [a, b], [asm.Coaxial(a.faces.cylinders(), b.faces.cylinders(1.4), **freedoms)], b


def insert():
    a, b = plate(), bolt()
    return [a, b], [asm.Insert(a.faces.cylinders(), b.faces.cylinders(1.4))], b


def concentric(socket, radius):
    a, b = asm.Body("socket", hollow(socket), fixed=True), asm.Body("ball", SHAPES.sphere(radius), (1, 1, 3))
    return [a, b], [asm.Concentric(a.face(), b.face())], b


def tangent(one, other, **said):
    a, b = asm.Body("one", one, fixed=True), asm.Body("other", other, (1, 2, 7), unit(1, 0.2, 0.3, 0.1))
    return [a, b], [asm.Tangent(a.face(), b.face(), **said)], b


def width():
    slot, tab = asm.Body("slot", SHAPES.box(3, 4, 5), fixed=True), box("tab", (1, 2, 7))
    sides = (slot.face("left"), slot.face("right")), (tab.face("top"), tab.face("bottom"))
    return [slot, tab], [asm.Width(*sides)], tab


def symmetric():
    a, b, mirror = asm.Body("a", SHAPES.sphere(1), (2, 1, 4)), asm.Body("b", SHAPES.sphere(1), (1, 2, -5)), plate()
    return [a, b, mirror], [asm.Symmetric(a.face(), b.face(), mirror.face("top"))], a


def group():
    base, a, b = plate(), box("a"), box("b", (4, 0, 5))
    return [base, a, b], [asm.Group([a, b]), asm.Flush(base.face("top"), a.face("bottom"))], b


def linear():
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b")
    ways = [asm.Prismatic(ground.frame(z=z), body, body.name) for z, body in (((1, 0, 0), a), ((0, 1, 0), b))]
    return [ground, a, b], [*ways, asm.Linear(*ways, -0.5)], b


def constant_velocity():
    ground, a, b = asm.Body("ground", fixed=True), asm.Body("a"), asm.Body("b", position=(0.1, 0, 4))
    return [ground, a, b], [asm.Revolute(ground, a), asm.ConstantVelocity(a.frame((0, 0, 2)), b.frame((0, 0, -2)))], b


def revolute_of_nearest_axes():
    ground, a = asm.Body("ground", fixed=True), asm.Body("a", quaternion=unit(0.1, 1, 0, 0))
    return [ground, a], [asm.Revolute(ground, a, axes="nearest", limits=(-1, 1))], a


def beside_a_line(**distance):
    ground, a = asm.Body("ground", fixed=True), asm.Body("a", position=(1, 2, 3))
    return [ground, a], [asm.PointOnLine(a, ground, **distance)], a


def above_a_plane():
    ground, a = asm.Body("ground", fixed=True), asm.Body("a", position=(1, 2, 3))
    return [ground, a], [asm.PointOnPlane(a, ground, offset=-1.5)], a


PLANE, BALL, PIN, CONE = SHAPES.plane(20, 20), SHAPES.sphere(1), SHAPES.cylinder(1, 14), SHAPES.cone(3, 4)
DRUM = SHAPES.cylinder(3, 20)
# Bodies, constraints, and what is held; and how many degrees of freedom are left.
MATES = {
    "flush": (flush, 3),
    "flush, nearest": (lambda: flush("nearest"), 3),
    "coaxial": (coaxial, 2),
    "coaxial, limited": (lambda: coaxial(slide_limits=(-1, 2), angle=0.3), 1),
    "insert": (insert, 1),
    "concentric balls": (lambda: concentric(SHAPES.sphere(2), 2), 3),
    "a ball in a cone": (lambda: concentric(CONE, 0.8), 3),
    "width": (width, 3),
    "symmetric": (symmetric, 9),
    "group": (group, 3),
    "linear": (linear, 1),
    "constant velocity": (constant_velocity, 3),
    "nearest axes": (revolute_of_nearest_axes, 1),
    "point at a distance": (lambda: beside_a_line(distance=2.0), 5),
    "point within a distance": (lambda: beside_a_line(distance=None, distance_limits=(1, 2)), 6),
    "point below a plane": (above_a_plane, 5),
    "tangent, plane and ball": (lambda: tangent(PLANE, BALL), 5),
    "tangent, plane and cylinder": (lambda: tangent(PLANE, PIN), 4),
    "tangent, plane and cone": (lambda: tangent(PLANE, CONE), 4),
    "tangent, balls": (lambda: tangent(SHAPES.sphere(3), BALL), 5),
    "tangent, a ball within": (lambda: tangent(SHAPES.sphere(3), BALL, side="inside"), 5),
    "tangent, cylinder and ball": (lambda: tangent(DRUM, BALL), 5),
    "tangent, bore and ball": (lambda: tangent(hollow(DRUM), BALL), 5),
    "tangent, tube and ball": (lambda: tangent(hollow(PIN), BALL), 4),
    "tangent, cone and ball": (lambda: tangent(CONE, BALL), 5),
    "tangent, cylinders": (lambda: tangent(DRUM, PIN), 3),
    # Long enough: a contact in a point is on the surfaces as far as these go.
    "tangent, crossed cylinders": (
        lambda: tangent(SHAPES.cylinder(3, 99), SHAPES.cylinder(1, 99), touch="point"),
        5,
    ),
    "tangent, plane and torus": (lambda: tangent(PLANE, SHAPES.torus(3, 1)), 5),
    "tangent, plane and egg": (lambda: tangent(PLANE, SHAPES.ellipsoid(1, 2, 3)), 5),
    "tangent, one-sided": (lambda: tangent(PLANE, BALL, unilateral=True), 6),
}


def scene_of(name):
    """The scene of a mate, its bodies where the mate holds, and the body that is held."""
    bodies, constraints, held = MATES[name][0]()
    scene = asm.Assembly(bodies)
    scene.constrain(*constraints)
    solution = scene.solve()
    assert solution.success, solution.message
    for body in bodies:
        body.pose = solution.pose(body)
    return scene, held
