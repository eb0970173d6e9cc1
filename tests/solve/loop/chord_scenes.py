"""Scenes of which one value changes, and what tells how a solve went on from the last one."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from typing import NamedTuple

import casadi
import numpy as np

import assembly as asm
from assembly.constraints.program.kept import kept_header_at
from assembly.solve.loop.parameters import CHORD_SHIFT
from assembly.solve.result import Ended
from benchmarks import linkages
from benchmarks.running import example


class Case(NamedTuple):
    """A scene, and what changes one of its values or targets; how far a change by one goes."""

    scene: asm.Assembly
    change: Callable[[float], None]
    small: float


def drive(joint, start, value):
    joint.angle = start + value


def draw(grip, start, way, value):
    grip.target = np.asarray(start) + value * np.asarray(way)


def four_bar():
    scene, hinge = linkages.four_bar()
    return Case(scene, partial(drive, hinge, 0.0), 0.01)


def wires():
    scene = example("paper_clips").paper_clips()
    ((_, grip),) = scene.objectives
    return Case(scene, partial(draw, grip, grip.target, (1.0, -0.7, 0.4)), 0.05)


def gears():
    scene, crank, _ = example("gear_train").gear_train()
    return Case(scene, partial(drive, crank, 0.0), 0.01)


def limited_arm():
    scene, tip, hinges = linkages.arm(4, seed=3)
    for hinge in hinges:
        hinge.angle = None
    # The first one ends at its limit, and stays there.
    hinges[0].limits = (-0.1, 0.1)
    grip = asm.PointDistance(tip, (1.0, 9.0, 0.4))
    scene.minimize(grip)
    return Case(scene, partial(draw, grip, grip.target, (0.3, 0.1, -0.2)), 0.05)


def expression():
    x = casadi.SX.sym("q", 7)
    ball = asm.Body("ball", position=(0.3, 0.2, 2.0))
    round_ = casadi.Function("round", [x], [casadi.sumsqr(x[:3]) - 4.0 + 0.3 * casadi.sin(x[0])])
    scene = asm.Assembly([ball])
    scene.constrain(asm.Expression(round_, [ball], name="egg"))
    grip = asm.PointDistance(ball.point(0.0, 0.0, 0.0), (0.5, 0.4, 3.0))
    scene.minimize(grip, asm.Posture(weight=0.1))
    return Case(scene, partial(draw, grip, grip.target, (0.3, 0.1, 0.2)), 0.02)


CASES = [four_bar, wires, gears, limited_arm, expression]


def without_kept(solution):
    """The same solution without what is kept with it."""
    other = deepcopy(solution)
    # The copy has a packed scene of its own: it is put beside the one of the scene again.
    other._ended, other._scene = Ended(solution._packed, solution._state.copy()), solution._scene
    other._state[solution._packed.kept_at :] = 0.0
    return other


def by_chords(solution):
    """Whether the steps of a solution were by a factor that was kept."""
    return solution.iterations > 0 and solution.history[0, 4] == CHORD_SHIFT


def factor_of(solution):
    """Which factor is kept with a solution."""
    return kept_header_at(solution._state, solution._packed.kept_at).factor
