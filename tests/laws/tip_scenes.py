"""Mechanisms with a tip and inputs: open and closed, redundant, with idle motions, with contacts in their loops."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

import assembly as asm
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.joint import Joint
from assembly.kinematics.frame import Frame
from tests.solve.mechanisms import chain, planar_four_bar


@dataclass(frozen=True)
class Mechanism:
    """A scene near a pose where it closes, the frame of its tip, and its inputs.

    Tasks are those whose singular values are apart from each other and from zero: elsewhere measures have kinks.
    """

    scene: asm.Assembly
    tip: Frame
    inputs: list[Joint | Freedom]
    tasks: tuple[str, ...] = ("position", "rotation", "pose")

    def with_term(self, measure, task, direction=None):
        """A scene of the same bodies and constraints whose objective is the term alone."""
        scene = asm.Assembly(self.scene.bodies)
        scene.constrain(*self.scene.constraints)
        scene.maximize(asm.Dexterity(self.tip, self.inputs, measure, task=task, direction=direction))
        return scene


def arm(count, sliding=(), size=1.0, seed=0):
    """A serial arm of revolute joints, and prismatic ones where told, with joint axes everywhere."""
    rng = np.random.default_rng(100 * count + seed)
    bodies, joints = [asm.Body("base", fixed=True)], []
    for k in range(count):
        bodies.append(asm.Body(f"link {k + 1}"))
        kind = asm.Prismatic if k in sliding else asm.Revolute
        before = bodies[-2].frame(size * rng.uniform(-0.5, 0.5, 3), rng.normal(size=3))
        after = bodies[-1].frame(size * rng.uniform(-0.5, 0.5, 3), rng.normal(size=3))
        joints.append(kind(before, after, f"joint {k + 1}"))
    scene = asm.Assembly(bodies)
    scene.constrain(*joints)
    tip = bodies[-1].frame(size * np.array([0.4, 0.3, -0.2]), (1, 2, 3))
    return Mechanism(scene, tip, joints)


def four_bar(size=1.0):
    """A planar four-bar in space, whose crank goes around: of its 20 rows three are redundant."""
    scene = planar_four_bar(size)
    tip = scene.body("link 2").frame(size * np.array([1.2, 2.0, 0.3]))
    return Mechanism(scene, tip, [scene.constraints[0]])


def spatial_four_bar():
    """A universal, a spherical and two revolute joints; one freedom, no row too many."""
    ground = asm.Body("ground", fixed=True)
    crank, coupler, rocker = asm.Body("crank"), asm.Body("coupler"), asm.Body("rocker")
    joints = [
        asm.Revolute(ground, crank, "crank joint"),
        asm.Spherical(crank.frame((1, 0, 0)), coupler, "ball"),
        asm.Universal(coupler.frame((3, 0, 0)), rocker.frame((0, 2, 0), (1, 0, 0)), "cross"),
        asm.Revolute(ground.frame((3, 0, 0.5), (0, 1, 0.2)), rocker, "rocker joint"),
    ]
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(*joints)
    return Mechanism(scene, coupler.frame((1.5, 0.4, 0.2)), [joints[0]])


def five_bar():
    """A planar five-bar in space, drawn by both its cranks."""
    corners = [(0, 0, 0), (-0.4, 1.0, 0), (0.8, 2.1, 0), (1.9, 1.2, 0), (1.5, 0, 0)]
    scene = chain([(0, 0, 1)] * 5, corners)
    tip = scene.body("link 2").frame((0.8, 2.1, 0.0))
    return Mechanism(scene, tip, [scene.constraints[0], scene.constraints[4]], ("position", "pose"))


def spinning_link():
    """A four-bar whose coupler hangs in two balls: it spins, and moves no tip that is on the rocker."""
    ground = asm.Body("ground", fixed=True)
    crank, coupler, rocker = asm.Body("crank"), asm.Body("coupler"), asm.Body("rocker")
    joints = [
        asm.Revolute(ground.frame(z=(0.1, 0.2, 1)), crank, "crank joint"),
        asm.Spherical(crank.frame((1, 0, 0.2)), coupler, "near ball"),
        asm.Spherical(coupler.frame((2.5, 0, 0)), rocker.frame((0, 1.5, 0)), "far ball"),
        asm.Revolute(ground.frame((3, 0, 0.5), (0, 0.6, 1)), rocker, "rocker joint"),
    ]
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(*joints)
    return Mechanism(scene, rocker.frame((0.3, 1.0, 0.4)), [joints[0]])


def cam():
    """A ball on a follower that slides, on a ring that turns about an axis beside its own: contact in the loop."""
    ground = asm.Body("ground", fixed=True)
    ring = asm.Body("ring", asm.shapes.torus(1.0, 0.3))
    ball = asm.Body("ball", asm.shapes.sphere(0.4), (1.1, 0.1, 0.69))
    axis = {"at": (0.2, -0.1, 0), "z": (0.1, 0.05, 1)}
    hinge = asm.Revolute(ground.frame(**axis), ring.frame(**axis), "hinge")
    slide = asm.Prismatic(ground.frame((1.1, 0.1, 0), (0.1, 0, 1)), ball.frame(z=(0.1, 0, 1)), "slide")
    scene = asm.Assembly([ground, ring, ball])
    scene.constrain(hinge, slide, asm.Contact(ring, ball, "touch"))
    return Mechanism(scene, ball.frame((0, 0, 0.4)), [hinge], ("position", "pose"))


def sledge():
    """A block that lies flat on a floor and that a crank shifts: a contact at a fold, and a turn that no input asks."""
    floor = asm.Body("floor", asm.shapes.plane(8.0, 8.0), fixed=True)
    crank = asm.Body("crank", position=(0, 0, 0.5))
    block = asm.Body("block", asm.Face(asm.shapes.plane(1.0, 1.0), reversed=True), (1.0, 0.3, 0.0))
    hinge = asm.Revolute(floor.frame((0, 0, 0.5), (0.1, 0.2, 1)), crank.frame(z=(0.1, 0.2, 1)), "hinge")
    pin = asm.PointOnLine(crank.point(1.0, 0.3, 0.0), block.frame(z=(0, 0, 1)), "pin")
    scene = asm.Assembly([floor, crank, block])
    scene.constrain(hinge, pin, asm.Contact(floor, block, "flat"))
    return Mechanism(scene, block.frame((0, 0, 0)), [hinge], ("position",))


def geared_arm():
    """An arm whose second joint is geared to the first, and whose slide a rack drives."""
    mechanism = arm(3, (2,), seed=4)
    turn, follower, slide = mechanism.inputs
    mechanism.scene.constrain(
        asm.Gear(turn, follower, -1.7, name="gear"), asm.RackPinion(follower, slide, 0.35, name="rack")
    )
    return Mechanism(mechanism.scene, mechanism.tip, [turn])


def hoop():
    """A crank and a rocker at a given distance, which an expression says instead of a coupler."""
    ground = asm.Body("ground", fixed=True)
    crank, rocker = asm.Body("crank"), asm.Body("rocker", position=(3, 0, 0.5))
    hinge = asm.Revolute(ground.frame(z=(0.1, 0.2, 1)), crank.frame(z=(0.1, 0.2, 1)), "hinge")
    foot = asm.Revolute(ground.frame((3, 0, 0.5), (0, 0.6, 1)), rocker.frame(z=(0, 0.6, 1)), "foot")
    f, g = ca.SX.sym("f", 7), ca.SX.sym("g", 7)

    def end(pose, point):
        w, u = pose[3], pose[4:]
        return pose[:3] + point + 2 * ca.cross(u, ca.cross(u, point) + w * point)

    apart = end(f, ca.DM([1.0, 0.0, 0.2])) - end(g, ca.DM([0.0, 1.5, 0.0]))
    rod = asm.Expression(ca.Function("rod", [f, g], [ca.dot(apart, apart) - 2.5**2]), [crank, rocker], "rod", scale=5.0)
    scene = asm.Assembly([ground, crank, rocker])
    scene.constrain(hinge, foot, rod)
    return Mechanism(scene, rocker.frame((0.3, 1.0, 0.4)), [hinge])


MECHANISMS = {
    "arm of two": lambda: arm(2),
    "arm of three": lambda: arm(3),
    "arm of four, one slides": lambda: arm(4, (1,)),
    "arm of six, two slide": lambda: arm(6, (0, 4)),
    "arm of seven": lambda: arm(7),
    "small arm": lambda: arm(4, (2,), 1e-3),
    "large arm": lambda: arm(4, (2,), 1e3),
    "planar four-bar": four_bar,
    "spatial four-bar": spatial_four_bar,
    "five-bar": five_bar,
    "spinning link": spinning_link,
    "cam": cam,
    "sledge": sledge,
    "geared arm": geared_arm,
    "hoop": hoop,
}
