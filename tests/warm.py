"""Compiles the kernels that most tests ask for, so that test processes find them: ``python -m tests.warm PART``."""

from __future__ import annotations

import sys

import numpy as np

import assembly as asm
from benchmarks.linkages import arm


def scenes() -> None:
    """Solve a scene of solids, one of a contact with a trim, and one with a clearance."""
    floor = asm.Body("floor", asm.shapes.plate(4.0, 4.0, 1.0, holes=[(0.0, 0.0, 0.5)]), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(1.2, 0.2, 2.0))
    solids = asm.Assembly([floor, ball])
    solids.constrain(asm.Contact(floor, ball))
    assert solids.solve().success
    top = floor.face("top")
    trimmed = asm.Assembly([floor, ball])
    touch = asm.Contact(top, ball)
    trimmed.constrain(touch, asm.TrimContact(touch, top.face.holes[0], keep="outside"))
    assert trimmed.solve().success
    apart = asm.Assembly([floor, ball])
    apart.constrain(asm.Clearance())
    assert apart.solve().success
    # What tests in fresh interpreters ask for: there the first compile says so, among what they print.
    pair = asm.proximity.extremal_pair(ball.face(), ball.q, ball.face(), floor.q)
    asm.proximity.gap_hessian(ball.face(), ball.q, ball.face(), floor.q, pair.parameters)


def queries() -> None:
    """Distances of curves, points and surfaces, a descent; a solve with a dexterity, whose kernel is one of its own."""
    rng = np.random.default_rng(0)
    curve, other = (asm.NurbsCurve.bezier(rng.normal(size=(6, 3))) for _ in range(2))
    ball = asm.shapes.sphere(0.5)
    drawn = asm.curves.helix(1.0, 0.3, 1.0)
    pairs = ((curve, other), (curve, np.zeros(3)), (curve, ball), (ball, np.zeros(3)), (drawn, other), (drawn, ball))
    for a, b in pairs:
        asm.proximity.minimum_distance(a, b)
    still, apart = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 3.0, 1.0, 0.0, 0.0, 0.0)
    asm.proximity.descend(ball, still, ball, apart, (0.1, 0.2, 0.3, 0.4))
    scene, tip, inputs = arm(3)
    for hinge in inputs:
        hinge.angle = None
    scene.maximize(asm.Dexterity(tip, inputs, "manipulability"))
    scene.solve(max_iterations=3)


PARTS = {"scenes": scenes, "queries": queries}

if __name__ == "__main__":
    PARTS[sys.argv[1]]()
