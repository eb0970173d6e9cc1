"""Solves, ticks and queries whose work is counted.

A family of cases is a function of who counts, which is given each case by name and returns what it returned: what one
case found is where the next one starts. They are small, for they are counted in plain Python.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import casadi
import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity import (
    FeatureTracker,
    closest_features,
    collisions,
    extremal_pair,
    minimum_distance,
    minimum_distances,
)
from benchmarks import hands, linkages, scenes
from benchmarks.curves import random_bezier, random_cubic
from benchmarks.running import example

__all__ = ["BY_INSTRUCTION", "FAMILIES", "Count"]

Count = Callable[[str, Callable[[], Any]], Any]


def mechanisms(count: Count) -> None:
    """Joints alone."""
    scene, crank = linkages.four_bar()
    first = count("four-bar, cold", scene.solve)
    assert crank.angle is not None
    crank.angle += math.radians(1.0)
    second = count("four-bar, a warm step of 1 degree", partial(scene.solve, first))
    for _ in range(8):
        crank.angle += math.radians(1.0)
        second = scene.solve(second)
    crank.angle += math.radians(1.0)
    count("four-bar, a step of 1 degree on its way", partial(scene.solve, second))
    count("Bricard's ring", linkages.bricard(1.0).solve)
    count("Bennett's linkage, mobility", linkages.bennett(1.0).mobility)
    count("eight boxes, scattered", linkages.boxes(8, 0).solve)
    train, crank, _ = example("gear_train").gear_train()
    first = count("gear train, cold", train.solve)
    crank.angle = 0.3
    count("gear train, a warm step", partial(train.solve, first))
    arm, tip, hinges = linkages.arm(4, seed=3)
    for hinge in hinges:
        hinge.angle = None
    arm.minimize(asm.PointDistance(tip, (9.0, 0.3, 0.4)))
    count("arm, target out of reach", arm.solve)


def clips(count: Count) -> None:
    """Three paper clips that touch, and follow a hand."""
    scene: asm.Assembly = example("paper_clips").paper_clips()
    ((_, grip),) = scene.objectives
    assert isinstance(grip, asm.PointDistance)
    first = count("paper clips, global start", scene.solve)
    starts = {name: pair.parameters for name, pair in first.contacts.items()}
    count("paper clips, contacts given", partial(scene.solve, starts=starts))
    begin = np.asarray(grip.target)
    grip.target = begin + (0.06, -0.04, 0.05)
    second = count("paper clips, a warm step", partial(scene.solve, first))
    for k in range(7):
        grip.target = begin + np.array((0.06, -0.04, 0.05)) * (k % 2)
        second = scene.solve(second)
    grip.target = begin + (0.06, -0.04, 0.05)
    count("paper clips, a step back on its way", partial(scene.solve, second))
    tracker = asm.Tracker(scene, grip.point, q0=first)

    def ticks() -> list[Any]:
        return [tracker.step(begin + np.array([0.06, -0.04, 0.05]) * (k + 1.0)) for k in range(10)]

    count("paper clips, 10 ticks", ticks)


def rings(count: Count) -> None:
    """Rings that are linked and touch, and rings that are kept apart."""
    drag = hands.ring_chain(3)
    scene, (a, b, c) = drag.scene, drag.scene.bodies
    scene.constrain(asm.Contact(a, b, name="a-b"), asm.Contact(b, c, name="b-c"))
    drag.grip.target = drag.hold + (0.3, 0.2, 0.1)
    first = count("three rings, global start", scene.solve)
    starts = {name: pair.parameters for name, pair in first.contacts.items()}
    count("three rings, contacts given", partial(scene.solve, starts=starts))
    drag.grip.target = drag.hold + (0.3, 0.203, 0.1)
    count("three rings, a warm step", partial(scene.solve, first))
    apart = hands.ring_chain(2)
    apart.scene.constrain(asm.Clearance())
    apart.grip.target = apart.hold + (1.0, 0.2, 0.1)
    first = count("two rings kept apart, drawn taut", apart.scene.solve)
    tracker = asm.Tracker(apart.scene, apart.grip.point, q0=first)

    def ticks() -> list[Any]:
        return [tracker.step(apart.hold + (1.0, 0.2 + 0.02 * k, 0.1)) for k in range(5)]

    count("two rings kept apart, 5 ticks", ticks)


def solids(count: Count) -> None:
    """Trimmed faces and solids."""
    egg, _ = example("avoid_the_hole").egg_on_plate()
    count("egg beside a hole", egg.solve)
    cam, drive = example("cam_follower").cam_and_roller()
    first = count("cam and roller, global start", cam.solve)
    drive.angle = math.radians(5.0)
    count("cam and roller, a warm step of 5 degrees", partial(cam.solve, first))
    still = asm.Body("still", asm.shapes.sphere(0.5), fixed=True)
    drawn = asm.Body("drawn", asm.shapes.sphere(0.4), (1.5, 0.4, -0.7))
    scene = asm.Assembly([still, drawn])
    scene.constrain(asm.Clearance())
    scene.minimize(asm.PointDistance(drawn.point(0.05, 0.02, 0.1), (0.1, 0.05, 0.0)))
    count("two balls kept apart", scene.solve)
    box, cylinder = asm.shapes.box(1.0, 0.8, 0.6), asm.shapes.solid_cylinder(0.3, 0.9)
    turn = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_quat(scalar_first=True)
    count("box and box, nearest features", partial(closest_features, box, box, q_b=[1.1, 0.9, 1.3, *turn]))
    tracker = FeatureTracker(box, cylinder)
    rows = np.zeros((20, 7))
    rows[:, 0] = np.linspace(-1.0, 1.0, len(rows))
    rows[:, 1:] = [0.1, 1.3, 0.9, 0.3, 0.1, 0.2]
    count("box and cylinder, 20 tracked steps", lambda: [tracker.step(None, row) for row in rows])
    torus = scenes.torus_pairs(1, 0.1)
    (f, g), (q_f, q_g) = torus.surfaces[0], torus.q[0]
    count("pair of tori, global start", partial(extremal_pair, f, q_f, g, q_g))


def distances(count: Count) -> None:
    """Distances with a certificate."""
    rng = np.random.default_rng(3)
    for name, make in (("Bezier curves of degree 5", partial(random_bezier, degree=5)), ("cubics", random_cubic)):
        a, b = make(rng), make(rng)
        b = asm.NurbsCurve(b.control_points + 0.5, b.knots, b.degree, b.weights)
        count(f"two {name}", partial(minimum_distance, a, b))
    cubic = random_cubic(rng)
    count("20 points and a cubic", partial(minimum_distances, 2.0 * rng.random((20, 3)), cubic))
    count("hull and a cubic", partial(minimum_distance, rng.random((6, 3)) + 1.2, cubic))
    t = casadi.SX.sym("t")
    wave = asm.FormulaCurve(casadi.vertcat(t, casadi.sin(3 * t), t**2), t, (0.0, 2.0))
    count("formula and a cubic", partial(minimum_distance, wave, cubic, 1e-8))
    f, g = scenes.bicubic(1, net=4), scenes.bicubic(2, net=4)
    g = asm.NurbsSurface(g.control_points + (0.3, 0.2, 3.0), g.knots, g.degree)
    count("two bicubic patches", partial(minimum_distance, f, g, 1e-3))
    hulls = [rng.random((5, 3)) + 0.7 * rng.normal(size=3) for _ in range(15)]
    count("20 curves and 15 hulls", partial(collisions, rng.random((20, 4, 3)), hulls, 0.1))


FAMILIES = (mechanisms, clips, rings, solids, distances)
# Cases whose instructions are counted: what a program does over and over again. Callgrind takes long to begin with one.
BY_INSTRUCTION = (
    "four-bar, a warm step of 1 degree",
    "four-bar, a step of 1 degree on its way",
    "eight boxes, scattered",
    "gear train, a warm step",
    "arm, target out of reach",
    "paper clips, contacts given",
    "paper clips, a warm step",
    "paper clips, a step back on its way",
    "paper clips, 10 ticks",
    "three rings, a warm step",
    "two rings kept apart, 5 ticks",
    "cam and roller, a warm step of 5 degrees",
    "box and box, nearest features",
    "box and cylinder, 20 tracked steps",
    "two Bezier curves of degree 5",
    "two cubics",
    "hull and a cubic",
    "two bicubic patches",
)
