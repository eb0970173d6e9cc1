"""Hock and Schittkowski, Test Examples for Nonlinear Programming Codes (1981): problems 36 to 44 and 60 to 76.

Three and four variables. Solutions are compared to the digits that the book prints, mostly ten, and to closed forms
where it has them. Variables along which the objective is flat are printed with fewer right digits than figures: IPOPT
with a tolerance of 1e-13 agrees with the solutions here to all of them where `close_x` is above 1e-7.
"""

from __future__ import annotations

from math import sqrt

import casadi as ca
import pytest

from tests.validation.peers.programs import Program, check

R2 = sqrt(2)


def _wood(x):
    """Colville's fourth function."""
    return (
        100 * (x[1] - x[0] ** 2) ** 2
        + (1 - x[0]) ** 2
        + 90 * (x[3] - x[2] ** 2) ** 2
        + (1 - x[2]) ** 2
        + 10.1 * ((x[1] - 1) ** 2 + (x[3] - 1) ** 2)
        + 19.8 * (x[1] - 1) * (x[3] - 1)
    )


def _squares(x, *weights):
    return sum(w * x[k] ** 2 for k, w in enumerate(weights))


def _inner(x, *weights):
    return sum(w * x[k] for k, w in enumerate(weights))


def _separation(x):
    """Problem 62."""
    a, b, c = x[0] + x[1] + x[2] + 0.03, x[1] + x[2] + 0.03, x[2] + 0.03
    logs = (
        255 * ca.log(a / (0.09 * x[0] + b))
        + 280 * ca.log(b / (0.07 * x[1] + c))
        + 290 * ca.log(c / (0.13 * x[2] + 0.03))
    )
    return -32.174 * logs


def _power_flow(name, angle, optimum, x):
    """Problems 74 and 75: two generators, and angles of the net."""

    def zero(x):
        c, d = x[2], x[3]
        return [
            1000 * (ca.sin(-c - 0.25) + ca.sin(-d - 0.25)) + 894.8 - x[0],
            1000 * (ca.sin(c - 0.25) + ca.sin(c - d - 0.25)) + 894.8 - x[1],
            1000 * (ca.sin(d - 0.25) + ca.sin(d - c - 0.25)) + 1294.8,
        ]

    return Program(
        name,
        (0, 0, 0, 0),
        lambda x: 3 * x[0] + 1e-6 * x[0] ** 3 + 2 * x[1] + 2e-6 / 3 * x[1] ** 3,
        optimum,
        x,
        zero=zero,
        positive=lambda x: [x[3] - x[2] + angle, x[2] - x[3] + angle],
        low=(0, 0, -angle, -angle),
        high=(1200, 1200, angle, angle),
        close=5e-8,
        close_x=5e-7,
        scale=1000.0,
    )


THREE = (
    Program(
        "36, 250",
        (10, 10, 10),
        lambda x: -x[0] * x[1] * x[2],
        -3300.0,
        (20, 11, 15),
        positive=lambda x: [72 - x[0] - 2 * x[1] - 2 * x[2]],
        low=(0, 0, 0),
        high=(20, 11, 42),
    ),
    Program(
        "37, 251",
        (10, 10, 10),
        lambda x: -x[0] * x[1] * x[2],
        -3456.0,
        (24, 12, 12),
        positive=lambda x: [72 - x[0] - 2 * x[1] - 2 * x[2], x[0] + 2 * x[1] + 2 * x[2]],
        low=(0, 0, 0),
        high=(42, 42, 42),
    ),
    Program(
        "60",
        (2, 2, 2),
        lambda x: (x[0] - 1) ** 2 + (x[0] - x[1]) ** 2 + (x[1] - x[2]) ** 4,
        0.03256820025,
        (1.104859024, 1.196674194, 1.535262257),
        zero=lambda x: [x[0] * (1 + x[1] ** 2) + x[2] ** 4 - 4 - 3 * R2],
        low=(-10, -10, -10),
        high=(10, 10, 10),
    ),
    Program(
        "61",
        (0, 0, 0),
        lambda x: _squares(x, 4, 2, 2) + _inner(x, -33, 16, -24),
        -143.6461422,
        (5.326770157, -2.118998639, 3.210464239),
        zero=lambda x: [3 * x[0] - 2 * x[1] ** 2 - 7, 4 * x[0] - x[2] ** 2 - 11],
    ),
    Program(
        "62",
        (0.7, 0.2, 0.1),
        _separation,
        -26272.51448,
        (0.6178126908, 0.328202223, 0.05398508606),
        zero=lambda x: [x[0] + x[1] + x[2] - 1],
        low=(0, 0, 0),
        high=(1, 1, 1),
    ),
    Program(
        "63",
        (2, 2, 2),
        lambda x: 1000 - _squares(x, 1, 2, 1) - x[0] * x[1] - x[0] * x[2],
        961.7151721,
        (3.512118414, 0.2169881741, 3.552174034),
        zero=lambda x: [_inner(x, 8, 14, 7) - 56, _squares(x, 1, 1, 1) - 25],
        low=(0, 0, 0),
        close_x=1e-6,
    ),
    Program(
        "64",
        (1, 1, 1),
        lambda x: _inner(x, 5, 20, 10) + 50000 / x[0] + 72000 / x[1] + 144000 / x[2],
        6299.842428,
        (108.7347175, 85.12613942, 204.3247078),
        positive=lambda x: [1 - 4 / x[0] - 32 / x[1] - 120 / x[2]],
        low=(1e-5, 1e-5, 1e-5),
        close_x=1e-6,
    ),
    Program(
        "65",
        (-5, 5, 0),
        lambda x: (x[0] - x[1]) ** 2 + (x[0] + x[1] - 10) ** 2 / 9 + (x[2] - 5) ** 2,
        0.9535288567,
        (3.650461821, 3.650461821, 4.6204170507),
        positive=lambda x: [48 - _squares(x, 1, 1, 1)],
        low=(-4.5, -4.5, -5),
        high=(4.5, 4.5, 5),
        close_x=3e-7,
    ),
    Program(
        "66",
        (0, 1.05, 2.9),
        lambda x: 0.2 * x[2] - 0.8 * x[0],
        0.5181632741,
        (0.1841264879, 1.202167873, 3.327322322),
        positive=lambda x: [x[1] - ca.exp(x[0]), x[2] - ca.exp(x[1])],
        low=(0, 0, 0),
        high=(100, 100, 10),
    ),
)

FOUR = (
    Program("38, 258", (-3, -1, -3, -1), _wood, 0.0, (1, 1, 1, 1), low=(-10,) * 4, high=(10,) * 4),
    Program(
        "39, 219",
        (2, 2, 2, 2),
        lambda x: -x[0],
        -1.0,
        (1, 1, 0, 0),
        zero=lambda x: [x[1] - x[0] ** 3 - x[2] ** 2, x[0] ** 2 - x[1] - x[3] ** 2],
        others=[(10, 10, 10, 10)],
    ),
    Program(
        "40",
        (0.8, 0.8, 0.8, 0.8),
        lambda x: -x[0] * x[1] * x[2] * x[3],
        -0.25,
        (2 ** (-1 / 3), 2 ** (-1 / 2), 2 ** (-11 / 12), 2 ** (-1 / 4)),
        zero=lambda x: [x[0] ** 3 + x[1] ** 2 - 1, x[0] ** 2 * x[3] - x[2], x[3] ** 2 - x[1]],
    ),
    Program(
        "41",
        (2, 2, 2, 2),
        lambda x: 2 - x[0] * x[1] * x[2],
        52 / 27,
        (2 / 3, 1 / 3, 1 / 3, 2),
        zero=lambda x: [_inner(x, 1, 2, 2, -1)],
        low=(0, 0, 0, 0),
        high=(1, 1, 1, 2),
    ),
    Program(
        "42",
        (1, 1, 1, 1),
        lambda x: sum((x[k] - k - 1) ** 2 for k in range(4)),
        28 - 10 * R2,
        (2, 2, 0.6 * R2, 0.8 * R2),
        zero=lambda x: [x[0] - 2, x[2] ** 2 + x[3] ** 2 - 2],
    ),
    Program(
        "43",
        (0, 0, 0, 0),
        lambda x: _squares(x, 1, 1, 2, 1) + _inner(x, -5, -5, -21, 7),
        -44.0,
        (0, 1, 2, -1),
        positive=lambda x: [
            8 - _squares(x, 1, 1, 1, 1) - _inner(x, 1, -1, 1, -1),
            10 - _squares(x, 1, 2, 1, 2) + x[0] + x[3],
            5 - _squares(x, 2, 1, 1) - _inner(x, 2, -1, 0, -1),
        ],
    ),
    Program(
        "44",
        (0, 0, 0, 0),
        lambda x: x[0] - x[1] - x[2] - x[0] * x[2] + x[0] * x[3] + x[1] * x[2] - x[1] * x[3],
        -15.0,
        (0, 3, 0, 4),
        positive=lambda x: [
            8 - x[0] - 2 * x[1],
            12 - 4 * x[0] - x[1],
            12 - 3 * x[0] - 4 * x[1],
            8 - 2 * x[2] - x[3],
            8 - x[2] - 2 * x[3],
            5 - x[2] - x[3],
        ],
        low=(0, 0, 0, 0),
    ),
    Program(
        "71",
        (1, 5, 5, 1),
        lambda x: x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2],
        17.0140173,
        (1, 4.7429994, 3.8211503, 1.3794082),
        zero=lambda x: [_squares(x, 1, 1, 1, 1) - 40],
        positive=lambda x: [x[0] * x[1] * x[2] * x[3] - 25],
        low=(1, 1, 1, 1),
        high=(5, 5, 5, 5),
    ),
    Program(
        "72",
        (1, 1, 1, 1),
        lambda x: 1 + _inner(x, 1, 1, 1, 1),
        727.67937,
        (193.4071, 179.5475, 185.0186, 168.7062),
        positive=lambda x: [
            0.0401 - 4 / x[0] - 2.25 / x[1] - 1 / x[2] - 0.25 / x[3],
            0.010085 - 0.16 / x[0] - 0.36 / x[1] - 0.64 / x[2] - 0.64 / x[3],
        ],
        low=(0.001,) * 4,
        high=(4e5, 3e5, 2e5, 1e5),
        close=1e-7,
        close_x=5e-6,
    ),
    Program(
        "73",
        (1, 1, 1, 1),
        lambda x: _inner(x, 24.55, 26.75, 39, 40.5),
        29.894378,
        (0.6355216, 0, 0.3127019, 0.05177655),
        zero=lambda x: [_inner(x, 1, 1, 1, 1) - 1],
        positive=lambda x: [
            _inner(x, 2.3, 5.6, 11.1, 1.3) - 5,
            _inner(x, 12, 11.9, 41.8, 52.1) - 21 - 1.645 * ca.sqrt(_squares(x, 0.28, 0.19, 20.5, 0.62)),
        ],
        low=(0, 0, 0, 0),
        close=2e-8,
    ),
    _power_flow("74", 0.55, 5126.4981, (679.9453, 1026.067, 0.1188764, -0.3962336)),
    _power_flow("75", 0.48, 5174.4129, (776.1592, 925.1949, 0.05110879, -0.4288911)),
    Program(
        "76",
        (0.5, 0.5, 0.5, 0.5),
        lambda x: _squares(x, 1, 0.5, 1, 0.5) - x[0] * x[2] + x[2] * x[3] + _inner(x, -1, -3, 1, -1),
        -103 / 22,
        (3 / 11, 23 / 11, 0, 6 / 11),
        positive=lambda x: [
            5 - _inner(x, 1, 2, 1, 1),
            4 - _inner(x, 3, 1, 2, -1),
            x[1] + 4 * x[2] - 1.5,
        ],
        low=(0, 0, 0, 0),
    ),
)


@pytest.mark.parametrize("program", THREE, ids=str)
def test_three_variables(program):
    check(program)


@pytest.mark.parametrize("program", FOUR, ids=str)
def test_four_variables(program):
    check(program)
