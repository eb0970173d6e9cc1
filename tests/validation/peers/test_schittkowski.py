"""Schittkowski, More Test Examples for Nonlinear Programming Codes (1987): problems 201 to 260, two to four variables.

Objectives, constraints, bounds, standard starts and solutions are those of the book. A problem that stands in it twice,
but for its start or for bounds and rows that bind nowhere, is one row; those of the first collection once more (219,
225, 232, 235, 249, 250, 251, 258) are rows there. Not here: problems 213 and 214, powers that are flat or have no slope
at the optimum; 216, whose optimum is printed as 1 at (2, 4), where the constraint has no slope in x[0] and the
objective falls on to 0.999375; 221, an optimum without multipliers.
"""

from __future__ import annotations

from math import exp, log, sqrt

import casadi as ca
import pytest

from tests.validation.peers.programs import Program, check

R3 = sqrt(3)


def _banana(weight):
    return lambda x: weight * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2


def _beale(x):
    return sum((c - x[0] * (1 - x[1] ** (k + 1))) ** 2 for k, c in enumerate((1.5, 2.25, 2.625)))


def _wood(x):
    return (
        100 * (x[1] - x[0] ** 2) ** 2
        + (1 - x[0]) ** 2
        + 90 * (x[3] - x[2] ** 2) ** 2
        + (1 - x[2]) ** 2
        + 10.1 * ((x[1] - 1) ** 2 + (x[3] - 1) ** 2)
        + 19.8 * (x[1] - 1) * (x[3] - 1)
    )


def _crossed_wood(x):
    """Problem 257: Wood's function with another product."""
    return _wood(x) + 19.8 * (x[3] - 1) * (x[0] - x[1])


def _exponentials(x):
    """Problems 242 and 245 (Box): ten residuals."""
    rows = (ca.exp(-x[0] * t) - ca.exp(-x[1] * t) - x[2] * (exp(-t) - exp(-10 * t)) for t in _tenths())
    return sum(row**2 for row in rows)


def _biggs(x):
    """Problem 244 (Biggs): ten residuals."""
    rows = (ca.exp(-x[0] * t) - x[2] * ca.exp(-x[1] * t) - exp(-t) + 5 * exp(-10 * t) for t in _tenths())
    return sum(row**2 for row in rows)


def _tenths():
    return [0.1 * k for k in range(1, 11)]


def _five_squares(x):
    return (
        (x[0] ** 2 + x[1] ** 2 + x[2] ** 2 - 1) ** 2
        + (x[0] ** 2 + x[1] ** 2 + (x[2] - 2) ** 2 - 1) ** 2
        + (x[0] + x[1] + x[2] - 1) ** 2
        + (x[0] + x[1] - x[2] + 1) ** 2
        + (x[0] ** 3 + 3 * x[1] ** 2 + (5 * x[2] - x[0] + 1) ** 2 - 36) ** 2
    )


def _corners(x):
    """Problem 253: the sum of the distances to the corners of a cube."""
    corners = [(i, j, k) for i in (0, 10) for j in (0, 10) for k in (0, 10)]
    return sum(ca.sqrt(sum((x[n] - at[n]) ** 2 for n in range(3))) for at in corners)


TWO = (
    Program("201", (8, 9), lambda x: 4 * (x[0] - 5) ** 2 + (x[1] - 6) ** 2, 0.0, (5, 6)),
    Program("203, 205", (2, 0.2), _beale, 0.0, (3, 0.5), others=[(0, 0)]),
    Program("206", (-1.2, 1), lambda x: (x[1] - x[0] ** 2) ** 2 + 100 * (1 - x[0]) ** 2, 0.0, (1, 1)),
    Program("207", (-1.2, 1), _banana(1), 0.0, (1, 1)),
    Program("208, 229", (-1.2, 1), _banana(100), 0.0, (1, 1)),
    Program("209", (-1.2, 1), _banana(1e4), 0.0, (1, 1), close_x=1e-6),
    Program("211", (-1.2, 1), lambda x: 100 * (x[1] - x[0] ** 3) ** 2 + (1 - x[0]) ** 2, 0.0, (1, 1)),
    Program(
        "212",
        (2, 0),
        lambda x: (
            (4 * (x[0] + x[1])) ** 2 + (4 * (x[0] + x[1]) + (x[0] - x[1]) * ((x[0] - 2) ** 2 + x[1] ** 2 - 1)) ** 2
        ),
        0.0,
        (0, 0),
    ),
    Program("215", (1, 1), lambda x: x[1], 0.0, (0, 0), positive=lambda x: [x[1] - x[0] ** 2], low=(0,), close_x=2e-5),
    Program(
        "217",
        (10, 10),
        lambda x: -x[1],
        -0.8,
        (0.6, 0.8),
        zero=lambda x: [x[0] ** 2 + x[1] ** 2 - 1],
        positive=lambda x: [1 + x[0] - 2 * x[1]],
        low=(0,),
    ),
    Program(
        "218", (9, 100), lambda x: x[1], 0.0, (0, 0), positive=lambda x: [x[1] - x[0] ** 2], low=(None, 0), close_x=2e-5
    ),
    Program(
        "220",
        (25000, 25000),
        lambda x: x[0],
        1.0,
        (1, 0),
        zero=lambda x: [(x[0] - 1) ** 3 - x[1]],
        low=(1, 0),
        close_x=1e-4,
    ),
    Program(
        "222",
        (1.3, 0.2),
        lambda x: -x[0],
        -1.5,
        (1.5, 0),
        positive=lambda x: [0.125 - x[1] - (x[0] - 1) ** 3],
        low=(0, 0),
    ),
    Program(
        "223",
        (0.1, 3.3),
        lambda x: -x[0],
        -log(log(10)),
        (log(log(10)), 10),
        positive=lambda x: [ca.exp(ca.exp(x[0])), x[1] - ca.exp(ca.exp(x[0]))],
        low=(0, 0),
        high=(10, 10),
    ),
    Program(
        "224",
        (0.1, 0.1),
        lambda x: 2 * x[0] ** 2 + x[1] ** 2 - 48 * x[0] - 40 * x[1],
        -304.0,
        (4, 4),
        positive=lambda x: [x[0] + 3 * x[1], 18 - x[0] - 3 * x[1], x[0] + x[1], 8 - x[0] - x[1]],
        low=(0, 0),
        high=(6, 6),
    ),
    Program(
        "226",
        (0.8, 0.05),
        lambda x: -x[0] * x[1],
        -0.5,
        (sqrt(0.5), sqrt(0.5)),
        positive=lambda x: [x[0] ** 2 + x[1] ** 2, 1 - x[0] ** 2 - x[1] ** 2],
        low=(0, 0),
    ),
    Program(
        "227",
        (0.5, 0.5),
        lambda x: (x[0] - 2) ** 2 + (x[1] - 1) ** 2,
        1.0,
        (1, 1),
        positive=lambda x: [x[1] - x[0] ** 2, x[0] - x[1] ** 2],
    ),
    Program(
        "228",
        (0, 0),
        lambda x: x[0] ** 2 + x[1],
        -3.0,
        (0, -3),
        positive=lambda x: [1 - x[0] - x[1], 9 - x[0] ** 2 - x[1] ** 2],
    ),
    Program(
        "230",
        (0, 0),
        lambda x: x[1],
        0.375,
        (0.5, 0.375),
        positive=lambda x: [
            -2 * x[0] ** 2 + x[0] ** 3 + x[1],
            -2 * (1 - x[0]) ** 2 + (1 - x[0]) ** 3 + x[1],
        ],
    ),
    Program(
        "231",
        (-1.2, 1),
        _banana(100),
        0.0,
        (1, 1),
        positive=lambda x: [x[0] / 3 + x[1] + 0.1, -x[0] / 3 + x[1] + 0.1],
    ),
    Program("233", (1.2, 1), _banana(100), 0.0, (1, 1), positive=lambda x: [x[0] ** 2 + x[1] ** 2 - 0.25]),
    Program(
        "234",
        (0, 0),
        lambda x: (x[1] - x[0]) ** 4 - (1 - x[0]),
        -0.8,
        (0.2, 0.2),
        positive=lambda x: [1 - x[0] ** 2 - x[1] ** 2],
        low=(0.2, 0.2),
        high=(2, 2),
        close_x=2e-3,  # the fourth power is flat
    ),
)

MORE = (
    Program(
        "240",
        (100, -1, 2.5),
        lambda x: (x[0] - x[1] + x[2]) ** 2 + (-x[0] + x[1] + x[2]) ** 2 + (x[0] + x[1] - x[2]) ** 2,
        0.0,
        (0, 0, 0),
    ),
    Program("241", (1, 2, 0), _five_squares, 0.0, (0, 0, 1)),
    Program("242", (2.5, 10, 10), _exponentials, 0.0, None, low=(0, 0, 0), high=(10, 10, 10)),
    Program("244", (1, 2, 1), _biggs, 0.0, None),
    Program("245", (0, 10, 20), _exponentials, 0.0, (1, 10, 1), low=(0, 0, 0), high=(12, 12, 20)),
    Program(
        "246",
        (-1.2, 2, 0),
        lambda x: 100 * (x[2] - ((x[0] + x[1]) / 2) ** 2) ** 2 + (1 - x[0]) ** 2 + (1 - x[1]) ** 2,
        0.0,
        (1, 1, 1),
    ),
    Program(
        "248",
        (-0.1, -1, 0.1),
        lambda x: -x[1],
        -0.8,
        (0.6, 0.8, 0),
        zero=lambda x: [x[0] ** 2 + x[1] ** 2 + x[2] ** 2 - 1],
        positive=lambda x: [1 - 2 * x[1] + x[0]],
    ),
    Program(
        "252",
        (-1, 2, 2),
        lambda x: 0.01 * (x[0] - 1) ** 2 + (x[1] - x[0] ** 2) ** 2,
        0.04,
        (-1, 1, 0),
        zero=lambda x: [x[0] + x[2] ** 2 + 1],
        high=(-1,),
    ),
    Program(
        "253", (0, 2, 0), _corners, 40 * R3, (5, 5, 5), positive=lambda x: [30 - 3 * x[0] - 3 * x[2]], low=(0, 0, 0)
    ),
    Program(
        "254",
        (1, 1, 1),
        lambda x: ca.log(x[2]) - x[1],
        -R3,
        (0, R3, 1),
        zero=lambda x: [x[1] ** 2 + x[2] ** 2 - 4, x[2] - 1 - x[0] ** 2],
        low=(None, None, 1),
    ),
    Program(
        "256",
        (3, -1, 0, 1),
        lambda x: (x[0] + 10 * x[1]) ** 2 + 5 * (x[2] - x[3]) ** 2 + (x[1] - 2 * x[2]) ** 4 + 10 * (x[0] - x[3]) ** 4,
        0.0,
        (0, 0, 0, 0),
        close_x=5e-3,  # the fourth powers are flat
    ),
    Program("257", (-3, -1, -3, -1), _crossed_wood, 0.0, (1, 1, 1, 1), low=(0, None, 0, None)),
    Program("259", (0, 0, 0, 0), _wood, 0.0, (1, 1, 1, 1), high=(None, None, None, 1)),
)


@pytest.mark.parametrize("program", TWO, ids=str)
def test_two_variables(program):
    check(program)


@pytest.mark.parametrize("program", MORE, ids=str)
def test_three_and_four_variables(program):
    check(program)
