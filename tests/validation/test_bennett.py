"""Bennett's linkage: four hinges in space that move, where Gruebler counts -2 freedoms.

Opposite links are alike, with lengths a, b and twists alpha, beta: a / sin(alpha) = b / sin(beta). Opposite hinges
turn by opposite angles, and neighbors t, p so that (Bennett 1903)

    tan(t / 2) tan(p / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
"""

from __future__ import annotations

from math import pi, radians, sin

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import (
    CLOSE,
    Counter,
    angles,
    degrees,
    drive,
    loop_of_revolutes,
    shake,
)

START = 0.3


def output(t, alpha, beta):
    """The neighbor's angle where the driven one is t; it turns backward, once a turn."""
    rise = sin((beta + alpha) / 2) / sin((beta - alpha) / 2)
    return np.unwrap(2 * np.arctan2(rise * np.cos(t / 2), np.sin(t / 2)))


class Bennett:
    def __init__(self, alpha, beta, size=1.0):
        b = size * sin(beta) / sin(alpha)
        p = float(output(np.array([START]), alpha, beta)[0])
        links, self.hinges = loop_of_revolutes((size, b) * 2, (alpha, beta) * 2, (p, -START, -p))
        self.size = max(size, b)
        shake(links, 0.01 * size)
        # Counters of the hinges that are not driven.
        self.counters = [
            Counter(links[0], hinge, self.size, start)
            for hinge, start in zip(self.hinges[1:], (p, -START, -p), strict=True)
        ]
        self.scene = asm.Assembly([*links, *(counter.rack for counter in self.counters)])
        self.scene.constrain(*self.hinges, *(row for counter in self.counters for row in counter.constraints))


@pytest.mark.parametrize(
    ("alpha", "beta", "size"),
    # The last two: an output that hardly moves and then rushes, and twists beyond a right angle.
    [(40, 75, 1.0), (40, 75, 1e4), (30, 65, 1.0), (100, 150, 1.0)],
)
def test_hinges_over_two_turns(alpha, beta, size):
    alpha, beta = radians(alpha), radians(beta)
    made = Bennett(alpha, beta, size)
    t = degrees(turns=2, start=START)
    solutions = drive(made.scene, made.hinges[0].freedom(), t)
    p = output(t, alpha, beta)
    assert abs(p[-1] - p[0] + 4 * pi) < 1e-9
    for hinge, counter, expected in zip(made.hinges[1:], made.counters, (p, -t, -p), strict=True):
        # By the poses up to a whole turn, and by the angle the solver goes by, which counts the turns.
        off = angles(solutions, hinge) - expected
        assert np.abs(off - 2 * pi * np.round(off / (2 * pi))).max() < 3 * CLOSE
        assert np.abs(counter.read(solutions) - expected).max() < 3 * CLOSE
    # The links, not the counters, are back.
    first, last = (solution.q[:4] for solution in (solutions[0], solutions[-1]))
    assert np.abs(first[:, :3] - last[:, :3]).max() < 3 * CLOSE * size
    assert np.abs(first[:, 3:] - last[:, 3:]).max() < 3 * CLOSE


def test_any_hinge_drives():
    alpha, beta = radians(40), radians(75)
    made = Bennett(alpha, beta)
    # From the output back to the input: the relation is its own inverse, with t and p exchanged.
    p = degrees(turns=-1, step=-5, start=float(output(np.array([START]), alpha, beta)[0]))
    solutions = drive(made.scene, made.hinges[1].freedom(), p)
    found = angles(solutions, made.hinges[0])
    rise = sin((beta + alpha) / 2) / sin((beta - alpha) / 2)
    assert np.abs(np.sin(found / 2) * np.sin(p / 2) - rise * np.cos(found / 2) * np.cos(p / 2)).max() < 3 * CLOSE
    assert abs(found[-1] - found[0] - 2 * pi) < 3 * CLOSE


def test_without_bennetts_condition_nothing_moves():
    """The same chain with opposite links a percent longer closes in no such pose, and the solve says so."""
    alpha, beta = radians(40), radians(75)
    made = Bennett(alpha, beta)
    (solution,) = drive(made.scene, made.hinges[0].freedom(), [1.0])
    links, hinges = loop_of_revolutes((1.01, sin(beta) / sin(alpha)) * 2, (alpha, beta) * 2, (0.0, 0.0, 0.0))
    scene = asm.Assembly(links)
    scene.constrain(*hinges)
    hinges[0].angle = 1.0
    off = scene.solve(solution.q[:4])
    assert off.status is asm.Status.INFEASIBLE and off.feasibility > 1e-4
