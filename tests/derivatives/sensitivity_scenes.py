"""Scenes whose solutions are derived, with the parameters and measures of each; and differences of re-solved scenes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import assembly as asm

WEIGHTS = ((1, 0.75), (2, -0.15), (3, 1.0 / 60.0))


@dataclass
class Case:
    scene: asm.Assembly
    of: list[asm.Measure]
    wrt: list[asm.Parameter]
    q0: np.ndarray | None = None

    def solved(self, start=None):
        solution = self.scene.solve(self.q0 if start is None else start, stationarity=1e-13)
        assert solution.success, solution
        return solution


def differences(case, solution, parameter, step):
    """Sixth-order differences of the measures of re-solved scenes."""
    middle = parameter.value
    slopes = np.zeros(len(case.of))
    for k, weight in WEIGHTS:
        for sign in (1.0, -1.0):
            parameter.value = middle + sign * k * step
            there = case.solved(solution)
            slopes += sign * weight / step * np.array([measure.value(there) for measure in case.of])
    parameter.value = middle
    return slopes


def slider_crank(radius=2.0, length=5.0, angle=0.7):
    """A crank that is driven, a rod, a piston; hinges are of frames on the bodies."""
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    scene = asm.Assembly([ground, crank, rod, piston])
    hinge = asm.Revolute(ground.frame(), crank.frame(), "hinge", angle=angle)
    pin = asm.Revolute(crank.frame(at=(radius, 0, 0)), rod.frame(), "pin")
    wrist = asm.Revolute(rod.frame(at=(length, 0, 0)), piston.frame(), "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene.constrain(hinge, pin, wrist, guide)
    of = [asm.Measure(piston, "x"), asm.Measure(guide), asm.Measure(pin)]
    wrt = [
        asm.Parameter(hinge, "angle", name="angle"),
        asm.Parameter(pin.frame_a, "origin", "x", name="r"),
        asm.Parameter(wrist.frame_a, "origin", "x", name="l"),
        asm.Parameter(guide.frame_a, "origin", "y", name="height"),
        asm.Parameter(guide.frame_a, "turn", "z", name="tilt"),
    ]
    return Case(scene, of, wrt)


def ball_in_v(radius=1.0, half_angle=0.6):
    """A ball in a V, held above its middle."""

    def sides(angle):
        c, s = np.cos(angle), np.sin(angle)
        faces = []
        for k, sign in enumerate((1.0, -1.0)):
            out, up = np.array([sign * s, 0.0, c]), np.array([0.0, 1.0, 0.0])
            corners = [[6 * u * out + v * up for v in (-3.0, 3.0)] for u in ((0.0, 1.0) if sign > 0 else (1.0, 0.0))]
            knots = [0.0, 0.0, 6.0, 6.0]
            faces.append(asm.NurbsSurface(corners, (knots, knots), (1, 1), name=f"side {k}"))
        return faces

    angle = asm.Parameter(sides, half_angle, name="a")
    size = asm.Parameter(asm.shapes.sphere, radius, name="R")
    notch, ball = asm.Body("notch", angle.shape, fixed=True), asm.Body("ball", size.shape, (0.1, 0, 2.0))
    scene = asm.Assembly([notch, ball])
    scene.constrain(
        asm.Contact(ball, notch.face("side 0"), "left", edges=False),
        asm.Contact(ball, notch.face("side 1"), "right", edges=False),
        asm.PointOnPlane(ball, notch.frame(z=(0, 1, 0)), "middle"),
        asm.Parallel(ball, notch, "upright", angle=0.0),
    )
    return Case(scene, [asm.Measure(ball, "z"), asm.Measure(ball, "x")], [size, angle])


def rocker(weight=0.3):
    """A spatial four-bar, redundant rows of which two hinges have, that is drawn to a place and pulled by a weight."""
    ground, crank, link = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("link", position=(0, 0, 6))
    arm = asm.Body("arm", position=(14, 0, 0))
    scene = asm.Assembly([ground, crank, link, arm])
    hinge = asm.Revolute(ground.frame(z=(0, 1, 0)), crank.frame(z=(0, 1, 0)), "hinge")
    cross = asm.Universal(crank.frame(at=(0, 0, 6), z=(0, 1, 0)), link.frame(z=(0, 0, 1)), "cross")
    ball = asm.Spherical(link.point(15, 0, 0), arm.point(0, 0, 9), "ball")
    last = asm.Revolute(ground.frame(at=(14, 0, 0), z=(1, 1, 0)), arm.frame(z=(1, 1, 0)), "last", axes="opposed")
    scene.constrain(hinge, cross, ball, last)
    goal = asm.PointDistance(link.point(7, 1, 0), (6.0, -2.0, 9.0))
    grasp = asm.FrameDistance(arm.frame(at=(1, 0, 3), z=(1, 0, 1)), asm.Pose((15, 1, 4)), length=3.0, weight=weight)
    scene.minimize(goal, grasp)
    of = [
        asm.Measure(link.point(7, 1, 0), "y"),
        asm.Measure(cross, "angle_b"),
        asm.Measure(ball, "swing"),
        asm.Measure((link.point(7, 1, 0), arm)),
        asm.Measure(hinge, "fx", on=crank),
        asm.Measure(ball, "fz", on=arm),
        asm.Measure(last, "ty", on=arm),
        asm.Measure("objective"),
        asm.Measure(ball.frame_b, "z"),
    ]
    wrt = [
        asm.Parameter(goal, "target", "x"),
        asm.Parameter(grasp, "target", 2),
        asm.Parameter(cross.frame_a, "origin", "z"),
        asm.Parameter(ball.frame_b, "origin", "z", name="arm length"),
        asm.Parameter(last.frame_a, "origin", "y"),
        asm.Parameter(last.frame_a, "turn", "z"),
        asm.Parameter(last.frame_b, "turn", "x"),
        asm.Parameter(cross.frame_a, "turn", "z"),
        asm.Parameter(grasp.frame, "origin", "x", name="grasp"),
        asm.Parameter(grasp.frame, "turn", "y", name="grasp turn"),
    ]
    return Case(scene, of, wrt)


def cam():
    """A freeform hump that slides under a roller, which is pulled down."""
    rng = np.random.default_rng(3)
    grid = np.stack(np.meshgrid(np.linspace(-4, 4, 6), np.linspace(-2, 2, 5), indexing="ij"), axis=-1)
    height = 1.5 * np.exp(-0.2 * grid[..., 0] ** 2) + 0.05 * rng.normal(size=(6, 5))
    knots = [np.array([-4.0] * 4 + [-1.5, 1.5] + [4.0] * 4), np.array([-2.0] * 4 + [0.0] + [2.0] * 4)]
    hump = asm.NurbsSurface(np.concatenate([grid, height[..., None]], axis=-1), knots, (3, 3))
    size = asm.Parameter(asm.shapes.sphere, 0.7, name="roller")
    ground = asm.Body("ground", fixed=True)
    sled, ball = asm.Body("sled", hump), asm.Body("ball", size.shape, (0, 0, 2.4))
    scene = asm.Assembly([ground, sled, ball])
    slide = asm.Prismatic(ground.frame(z=(1, 0, 0)), sled.frame(z=(1, 0, 0)), "slide", slide=0.8)
    stem = asm.Prismatic(ground, ball, "stem")
    scene.constrain(slide, stem, asm.Contact(sled, ball, "touch"))
    net = sled.face()
    of = [asm.Measure(stem), asm.Measure(ball, "z")]
    wrt = [
        asm.Parameter(slide, "slide"),
        asm.Parameter(net, "control_points", (2, 2, "z")),
        asm.Parameter(net, "control_points", (3, 2, 0)),
        asm.Parameter(net, "weights", (2, 2)),
        size,
        asm.Parameter(stem.frame_a, "origin", "y"),
    ]
    return Case(scene, of, wrt)


def clips():
    """Three paper clips, each through both others, of one shape; drawn to a place, and kept from turning at will."""
    shape = asm.Parametric(lambda length, wire: asm.shapes.paper_clip(length, 8.0, wire), length=33.0, wire=0.5)
    red = asm.Body("red", shape, fixed=True)
    green = asm.Body("green", shape, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    blue = asm.Body("blue", shape, position=(4.0, 3.0, -28.0), quaternion=(0.649, -0.063, -0.147, 0.744))
    scene = asm.Assembly([red, green, blue])
    touch = asm.Contact(red, green)
    scene.constrain(touch, asm.Contact(green, blue), asm.Contact(red, blue))
    goal = asm.PointDistance(blue.point(0, 0, -15), (12.0, 4.0, -40.0))
    scene.minimize(goal, asm.Posture(scene.q, weight=0.2))
    of = [
        asm.Measure(blue, "x"),
        asm.Measure(green, "z"),
        asm.Measure("objective"),
        asm.Measure(touch, "fx", on=green),
        asm.Measure(touch, "ty", on=green),
    ]
    wrt = [asm.Parameter(goal, "target", "x"), asm.Parameter(shape, "wire"), asm.Parameter(shape, "length")]
    return Case(scene, of, wrt)


def pushed(limit=0.5, target=2.0):
    """A slide that is drawn against its limit."""
    ground, block = asm.Body("ground", fixed=True), asm.Body("block")
    scene = asm.Assembly([ground, block])
    slide = asm.Prismatic(ground, block, "slide", limits=(-1.0, limit))
    scene.constrain(slide)
    goal = asm.PointDistance(block.point(0, 0, 0), (0.0, 0.0, target))
    scene.minimize(goal)
    of = [asm.Measure(slide), asm.Measure("objective"), asm.Measure(slide, "fz", on=block)]
    return Case(scene, of, [asm.Parameter(slide, "limits", 1), asm.Parameter(goal, "target", "z")])


def kept_apart(minimum=0.3):
    """A ball pulled to a plate, from which a clearance keeps it."""
    size = asm.Parameter(asm.shapes.sphere, 1.0, name="radius")
    plate = asm.Body("plate", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", size.shape, (0.3, 0.2, 3.0))
    scene = asm.Assembly([plate, ball])
    least = asm.Clearance([plate, ball], minimum=minimum)
    goal = asm.PointDistance(ball.point(0, 0, 0), (0.0, 0.0, -1.0))
    scene.constrain(least)
    scene.minimize(goal, asm.Posture(scene.q, weight=0.1))
    of = [asm.Measure(ball, "z"), asm.Measure(ball, "x"), asm.Measure("objective")]
    return Case(scene, of, [asm.Parameter(least, "minimum"), asm.Parameter(goal, "target", "x"), size])


def filmed():
    """A ball over a plate by a film, in a V of two more films that keep it at their least gaps or farther."""
    hump = asm.shapes.sphere(8.0)
    ground = asm.Body("ground", hump, fixed=True)
    left, right = (
        asm.Body("left", asm.shapes.sphere(1.0), (-0.4, 0.3, 9.2)),
        asm.Body("right", asm.shapes.sphere(1.5), (2, 0, 10)),
    )
    scene = asm.Assembly([ground, left, right])
    films = [
        asm.Contact(ground, left, "one", minimum=0.2),
        asm.Contact(ground, right, "two", minimum=0.1),
        asm.Contact(left, right, "between", unilateral=True, minimum=0.3),
    ]
    scene.constrain(*films)
    goals = [asm.PointDistance(body.point(0, 0, 0), (0.5, 0.2, 8.0)) for body in (left, right)]
    scene.minimize(*goals, asm.Posture(scene.q, weight=0.1))
    of = [
        asm.Measure(left, "x"),
        asm.Measure(right, "z"),
        asm.Measure(films[1]),
        asm.Measure(films[2]),
        asm.Measure("objective"),
    ]
    return Case(scene, of, [asm.Parameter(item, "minimum") for item in films])


def trimmed():
    """A ball on a plate whose contact is kept in a circle, drawn out of it."""
    size = asm.Parameter(asm.shapes.sphere, 1.0, name="radius")
    turns = np.arange(9) * 0.25 * np.pi
    weights = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
    points = 2.0 * np.stack([np.cos(turns), np.sin(turns)], 1) / weights[:, None]
    points[-1] = points[0]
    ring = asm.NurbsCurve(points, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, weights)
    knots = [-5.0, -5.0, 5.0, 5.0]
    corners = [[[x, y, 0.05 * x] for y in (-5.0, 5.0)] for x in (-5.0, 5.0)]
    plate = asm.Body("plate", asm.NurbsSurface(corners, (knots, knots), (1, 1)), fixed=True)
    ball = asm.Body("ball", size.shape, (1.5, 0.5, 1.2))
    scene = asm.Assembly([plate, ball])
    touch = asm.Contact(plate, ball, "touch", edges=False)
    keep = asm.TrimContact(touch, ring, keep="inside", side="a")
    goal = asm.PointDistance(ball.point(0, 0, 0), (4.0, 1.0, 1.0))
    scene.constrain(touch, keep)
    scene.minimize(goal, asm.Posture(scene.q, weight=0.1))
    of = [asm.Measure(ball, "x"), asm.Measure(ball, "y"), asm.Measure("objective")]
    return Case(scene, of, [size, asm.Parameter(goal, "target", "y")])


def geared():
    """Two wheels and a rack that follow each other, a rod of a length from the rack to a carriage, drawn to a place."""
    ground, small, large = asm.Body("ground", fixed=True), asm.Body("small"), asm.Body("large", position=(3, 0, 0))
    rack, carriage = asm.Body("rack", position=(3, 2, 0)), asm.Body("carriage", position=(6, 3, 0.5))
    scene = asm.Assembly([ground, small, large, rack, carriage])
    one = asm.Revolute(ground, small, "one")
    two = asm.Revolute(ground.frame(at=(3, 0, 0)), large, "two")
    slide = asm.Prismatic(ground.frame(at=(3, 2, 0), z=(1, 0, 0)), rack.frame(z=(1, 0, 0)), "slide")
    gear = asm.Gear(one, two, -0.5, "gear", offset=0.1)
    pinion = asm.RackPinion(two, slide, -2.0, "pinion", offset=0.2)
    deck = asm.Planar(ground, carriage, "deck", offset=0.5)
    rod = asm.Distance(rack.point(0.5, 0, 0), carriage.point(0, 0.2, 0), 3.0, "rod")
    goal = asm.PointDistance(carriage.point(1, 0, 0), (8.0, 2.0, 1.0))
    scene.constrain(one, two, slide, gear, pinion, deck, rod)
    scene.minimize(goal, asm.Posture(scene.q, weight=0.3))
    of = [
        asm.Measure(one),
        asm.Measure(deck, "angle"),
        asm.Measure(carriage, "y"),
        asm.Measure(gear, "tz", on=small),
        asm.Measure(rod, "fx", on=rack),
        asm.Measure("objective"),
    ]
    wrt = [
        asm.Parameter(gear, "offset"),
        asm.Parameter(pinion, "offset"),
        asm.Parameter(deck, "offset"),
        asm.Parameter(rod, "value"),
        asm.Parameter(two.frame_b, "turn", "z"),
        asm.Parameter(slide.frame_a, "origin", "y"),
        asm.Parameter(slide.frame_a, "turn", "z", name="rack turned"),
        asm.Parameter(rod.frame_b, "origin", "y", name="rod's end"),
    ]
    return Case(scene, of, wrt)


def leaning():
    """A box on an edge of a step, whose size a function has, pulled by its weight and held by a guide."""
    size = asm.Parameter(lambda a: asm.shapes.box(a, 2.0, 1.0), 3.0, name="length")
    step = asm.Body("step", asm.shapes.box(4.0, 4.0, 2.0), fixed=True)
    crate = asm.Body("crate", size.shape, (2.8, 0.0, 2.3), (0.97, 0.0, 0.243, 0.0))
    scene = asm.Assembly([step, crate])
    deck = asm.Planar(step.frame(z=(0, 1, 0)), crate.frame(z=(0, 1, 0)), "deck")
    touch = asm.Contact(step, crate, "touch")
    goal = asm.PointDistance(crate.point(0.5, 0, -0.5), (2.5, 0.0, 1.0))
    scene.constrain(deck, touch)
    scene.minimize(goal, asm.Posture(scene.q, weight=0.4))
    of = [asm.Measure(crate, "x"), asm.Measure(deck, "angle"), asm.Measure(touch, "fz", on=crate)]
    return Case(scene, of, [size, asm.Parameter(goal, "target", "z"), asm.Parameter(deck.frame_b, "origin", "x")])


def tethered():
    """Bodies smaller than the tether between them, whose length is the size by which a posture counts turns."""
    ground, hub, kite = asm.Body("ground", fixed=True), asm.Body("hub", position=(1, 0, 0)), asm.Body("kite")
    scene = asm.Assembly([ground, hub, kite])
    pole = asm.PointOnLine(hub.point(0.5, 0, 0), ground.frame(z=(0, 0.3, 1)), "pole", distance=1.4)
    tether = asm.Distance(hub.point(0, 1, 0), kite.point(0.2, 0, 0), 2.6, "tether")
    goal = asm.PointDistance(kite.point(0, 1, 0), (4.0, 4.0, 3.0))
    scene.constrain(pole, tether)
    scene.minimize(goal, asm.Posture(scene.q, weight=0.2))
    of = [asm.Measure(hub, "x"), asm.Measure(kite, "y"), asm.Measure(tether, "fx", on=kite), asm.Measure("objective")]
    wrt = [asm.Parameter(pole, "distance"), asm.Parameter(tether, "value"), asm.Parameter(pole.frame_a, "origin", "x")]
    return Case(scene, of, wrt)


CASES = {
    case.__name__: case
    for case in (
        slider_crank,
        ball_in_v,
        rocker,
        cam,
        clips,
        pushed,
        kept_apart,
        filmed,
        trimmed,
        geared,
        leaning,
        tethered,
    )
}
