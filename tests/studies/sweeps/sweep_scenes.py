"""Scenes and measures of the tests of studies."""

from __future__ import annotations

import assembly as asm

GROUND, ROCKER, ROD, CRANK = 4.0, 3.0, 4.0, 1.5


def four_bar():
    """A four-bar and its parameters: the crank's angle, its length, the rod's length."""
    ground, crank = asm.Body("ground", fixed=True), asm.Body("crank")
    rod, rocker = asm.Body("rod", position=(1, 0.5, 0)), asm.Body("rocker", position=(GROUND, 0, 0))
    drive = asm.Revolute(ground, crank, "drive", angle=0.7)
    pin = asm.Revolute(crank.frame(at=(CRANK, 0, 0)), rod, "pin")
    joint = asm.Revolute(rod.frame(at=(ROD, 0, 0)), rocker.frame(at=(ROCKER, 0, 0)), "joint")
    out = asm.Revolute(ground.frame(at=(GROUND, 0, 0)), rocker, "out")
    scene = asm.Assembly([ground, crank, rod, rocker])
    scene.constrain(drive, pin, joint, out)
    parameters = (
        asm.Parameter(drive, "angle", name="angle"),
        asm.Parameter(pin.frame_a, "origin", "x", name="crank"),
        asm.Parameter(joint.frame_a, "origin", "x", name="rod"),
    )
    return scene, parameters, asm.Measure(out, name="out")


def elbow_x(solution):
    """Where the rod meets the rocker."""
    return float(solution.pose("rocker").apply([ROCKER, 0.0, 0.0])[0])


def elbow_y(solution):
    return float(solution.pose("rocker").apply([ROCKER, 0.0, 0.0])[1])


def wide(count=160):
    """A study over designs of which some cannot be assembled: scene, plan, measures."""
    scene, (angle, crank, rod), out = four_bar()
    return scene, asm.sobol({angle: (0.0, 6.2), crank: (0.5, 3.5), rod: (2.5, 4.5)}, count), [out, elbow_x, elbow_y]


def narrow(count=300):
    """The same of designs that all can be assembled, nearer to each other."""
    scene, (angle, crank, rod), out = four_bar()
    return scene, asm.sobol({angle: (0.7, 1.7), crank: (1.4, 1.6), rod: (3.9, 4.1)}, count), [out, elbow_x]


def ball_on_floor():
    """A ball whose radius is a number, on a floor, drawn to a place: faces are made anew for each row."""
    floor = asm.Body("floor", asm.shapes.plate(20, 20, 1), fixed=True)
    ball = asm.Body("ball", asm.Parametric(asm.shapes.sphere, radius=2.0), position=(0, 0, 5))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball, "touch", unilateral=True))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), target=(1.0, 2.0, -3.0)))
    return scene, asm.Parameter(ball, "radius"), asm.Measure(ball, "z", name="height")


def columns(found):
    """What two studies must have the same bits of."""
    names = [*found.plan.names, *found.measures, "iterations"]
    return (
        [found.table[name].tobytes() for name in names],
        found.table["status"].tolist(),
        found.table["message"].tolist(),
    )
