"""The definitions that poses are judged by, against the coordinates of the loop: two ways of writing the same."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.constraint import Coordinate, FramePair
from assembly.constraints.program import primitives as P
from assembly.solve.measure import JointRow, measure, standing

COORDINATES = [
    *((P.COINCIDENT, k) for k in range(3)),
    *((P.SLIDE, k) for k in range(3)),
    (P.DISTANCE, 0),
    *((P.DOT, k) for k in range(9)),
    *((P.SWING, k) for k in range(2)),
    (P.TURN, 0),
    *((P.AZIMUTH, k) for k in range(3)),
    (P.ANGLE, 0),
    (P.RADIUS, 0),
]


def unit(*e):
    return np.array(e, dtype=float) / np.linalg.norm(e)


def pair(z_b=None, seed=0):
    """Two frames on two bodies, and poses of these; with z_b, in the axes of frame a, frames on bodies that stand."""
    rng = np.random.default_rng(seed)
    a, b = asm.Body("a"), asm.Body("b")
    q = rng.normal(size=(2, 7))
    q[:, 3:] /= np.linalg.norm(q[:, 3:], axis=1)[:, None]
    if z_b is None:
        frames = [body.frame(rng.normal(size=3), rng.normal(size=3), rng.normal(size=3)) for body in (a, b)]
    else:
        q[:, 3:] = [1.0, 0.0, 0.0, 0.0]
        frames = [a.frame((0, 0, 0), (0, 0, 1), (1, 0, 0)), b.frame((0, 0, 0), z_b, (0.3, 1.0, 0.2))]
    return FramePair(*frames), q


def ours(kind, component, frames, q, near):
    pool = np.concatenate([part for f in (frames.frame_a, frames.frame_b) for part in (f.origin, f.axes.T.ravel())])
    records = np.empty((1, P.RECORD))
    P.place_frames(pool, 0, q, 0, 1, records, 0)
    return P.coordinate(kind, component, records, 0, near)[0]


@pytest.mark.parametrize(("kind", "component"), COORDINATES)
def test_definitions_are_those_of_the_loop(kind, component):
    for seed in range(20):
        frames, q = pair(seed=seed)
        coordinate = Coordinate(kind, component, frames)
        for near in (0.0, 40.0, -7.0):
            got = measure(coordinate, standing(coordinate, q, (0, 1)), near)
            # Some twenty roundings of numbers up to 10, and of angles up to 40.
            assert got == pytest.approx(ours(kind, component, frames, q, near), abs=3e-14)


@pytest.mark.parametrize("kind", [P.SWING, P.TURN, P.AZIMUTH, P.ANGLE])
@pytest.mark.parametrize(
    "z_b", [(0, 0, 1), (0, 0, -1), (1e-9, 2e-9, 1), (1e-9, -2e-9, -1), (1, 0, 0), (0.0, -1e-3, -1), (1e-5, 0.0, 1)]
)
def test_definitions_are_those_of_the_loop_where_directions_end(kind, z_b):
    frames, q = pair(z_b)
    for component in range(3 if kind == P.AZIMUTH else 2 if kind == P.SWING else 1):
        coordinate = Coordinate(kind, component, frames)
        got = measure(coordinate, standing(coordinate, q, (0, 1)), 0.3)
        want = ours(kind, component, frames, q, 0.3)
        sine = math.hypot(z_b[0], z_b[1])
        if kind == P.AZIMUTH and component == 2 and 0.0 < sine < 1e-6:
            # Next to its pole, too, an azimuth is what it is; the direction is rounded by 1e-16 over the sine.
            assert want == pytest.approx(got, abs=1e-6)
            assert got == pytest.approx(math.atan2(z_b[1], z_b[0]), abs=1e-6)
        elif kind == P.TURN and z_b[2] < 0 and sine > 0.0:
            # Of (1 + z_a.z_b), here 1e-18 or 5e-7, some digits are left, or none.
            assert sine < 1e-6 or got == pytest.approx(want, abs=1e-8)
        else:
            # The direction of an axis is rounded, which counts over the sine where there is one.
            assert got == pytest.approx(want, abs=1e-14 + 1e-15 / max(sine, 1e-2))


def test_opposed_axes_are_far_from_aligned():
    frames, q = pair((0, 0, -1))
    values = [
        measure(Coordinate(P.SWING, k, frames), standing(Coordinate(P.SWING, k, frames), q, (0, 1))) for k in (0, 1)
    ]
    assert values == [math.pi, 0.0]


def test_a_row_is_its_sum_less_its_value_over_its_unit():
    a, b = asm.Body("a"), asm.Body("b", position=(0.0, 0.0, 3.0), quaternion=unit(1.0, 0.0, 0.0, 1.0))
    screw = asm.Screw(a, b, pitch=2.0, slide=1.0)
    q = np.array([a.q, b.q])
    own, drive = screw.equations[4:]
    angle = screw.freedom("angle").coordinate
    # A quarter of a turn and four more: 3 - 2 (4 + 1/4), in units of 10.
    near = {angle: 8.0 * math.pi + 1.0}
    assert JointRow(own, ((0, 1), (0, 1)), 10.0).residual(q, near) == pytest.approx(-0.55, abs=1e-15)
    row = JointRow(drive, ((0, 1),), 10.0)
    assert row.residual(q, {}) == pytest.approx(0.2, abs=1e-15) and row.value() == pytest.approx(0.1, abs=1e-17)
    screw.slide = 2.0
    assert row.residual(q, {}) == pytest.approx(0.1, abs=1e-15) and row.value() == pytest.approx(0.2, abs=1e-17)
