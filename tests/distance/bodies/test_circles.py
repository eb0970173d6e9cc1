"""The bound of two circles is below their distance, and as near to it as promised, at isolated nearest points or not.

Judged by a fine sampling of one of them, each low place of it made exact by a bounded search; the distance of a point
from a circle has a closed form.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.distance.bodies.circles import circles_apart
from assembly.distance.bodies.spines import TORUS, Spine
from assembly.proximity.features.body_distance import DistanceStatus

UPRIGHT = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
SPACING = 2e-3 * np.pi


def circle(center, axis, radius):
    return np.concatenate([center, np.asarray(axis) / np.linalg.norm(axis), [radius]])


def told_apart(one, other):
    """The bound."""
    spines = (Spine(TORUS, tuple(row[:3]), tuple(row[3:6]), 0.0, row[6], 0.0) for row in (one, other))
    return circles_apart(*spines)[0]


def distance_judged(one, other):
    """The distance of two circles."""
    (c, m, r), (o, n, s) = ((row[:3], row[3:6], row[6]) for row in (one, other))
    e = np.cross(m, np.eye(3)[np.abs(m).argmin()])
    e /= np.linalg.norm(e)
    g = np.cross(m, e)

    def apart(t):
        d = c - o + r * (np.multiply.outer(np.cos(t), e) + np.multiply.outer(np.sin(t), g))
        along = d @ n
        return np.hypot(along, np.linalg.norm(d - np.multiply.outer(along, n), axis=-1) - s)

    t = np.arange(0.0, 2.0 * np.pi, SPACING)
    found = apart(t)
    low = t[(found <= np.roll(found, 1)) & (found <= np.roll(found, -1))]
    options = {"xatol": 1e-12}
    exact = [
        minimize_scalar(apart, bounds=(x - SPACING, x + SPACING), method="bounded", options=options).fun
        for x in low[np.argsort(apart(low))][:6]
    ]
    return min(found.min(), *exact)


def check(one, other, near=2e-11):
    """A lower bound, and one that is within 2e-11 of the sum of radii and centers' distance, where they do not meet."""
    size = np.linalg.norm(one[:3] - other[:3]) + one[6] + other[6]
    told, true = told_apart(one, other), distance_judged(one, other)
    assert told <= true + 1e-14 * size
    # Half of what f is known to divided by the distance.
    if true > 0.02 * size:
        assert true - told <= near * size
    return told, true


def test_random_circles(cases):
    rng = np.random.default_rng(0)
    for k in range(cases(60, 20_000)):
        turn = rng.normal(size=3)
        one = circle(rng.normal(size=3) * rng.choice([0.01, 1.0, 3.0]), turn, rng.uniform(0.1, 3.0))
        other = circle(np.zeros(3), turn if k % 5 == 0 else rng.normal(size=3), rng.uniform(0.1, 3.0))
        if k % 7 == 0:
            # Concentric.
            one[:3] = 0.0
        check(one, other)


@pytest.mark.parametrize("off", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
def test_equal_circles_linked_through_each_others_centers(off, cases):
    """Each point of either is at one distance from the other: a continuum that is neither coaxial nor parallel."""
    rng = np.random.default_rng(1)
    for _ in range(cases(2, 100)):
        move, turn = off * rng.normal(size=(2, 3))
        axis = Rotation.from_rotvec(turn).apply([0.0, 1.0, 0.0])
        told, true = check(np.append(UPRIGHT, 3.0), circle([3.0, 0.0, 0.0] + move, axis, 3.0))
        assert abs(told - 3.0) <= 4.0 * off + 1e-11 and abs(true - 3.0) <= 4.0 * off + 1e-14


def test_where_one_circle_meets_the_axis_of_the_other():
    """The bound by harmonics tells nothing there: in the plane of both axes, on the axis itself, and beside it."""
    for height, beside, radius, other in ((0.0, 1.0, 1.0, 1.5), (0.4, 1.0, 1.0, 0.3), (0.4, 1.0, 1.0 + 1e-9, 2.0)):
        for axis in ([0.0, 1.0, 0.0], [0.3, 1.0, 0.2], [0.0, 0.0, 1.0]):
            check(circle([beside, 0.0, height], axis, radius), np.append(UPRIGHT, other))


@pytest.mark.parametrize("lean", [1e-8, 1e-6, 1e-4])
def test_two_valleys_nearer_to_each_other_than_first_places(lean):
    """Equal circles, one above the other and beside it: they lean, so that one of two near places is the nearest."""
    for turn in np.linspace(0.0, 6.28, 8):
        axis = [lean * np.cos(turn), lean * np.sin(turn), 1.0]
        beside = 2.0 * np.cos(0.1) * np.array([np.cos(1.7 * turn), np.sin(1.7 * turn)])
        told, true = check(circle([*beside, 1.7], axis, 1.0), np.append(UPRIGHT, 1.0))
        assert true - told <= 1e-10


def test_circles_that_cross_are_not_apart():
    told, true = check(circle([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], 0.5), np.append(UPRIGHT, 0.5))
    assert true < 1e-9 and told < 1e-6
    assert told_apart(circle([0, 0, 0], [0, 0, 1], 0.0), np.append(UPRIGHT, 1.0)) == 0.0


@pytest.mark.parametrize("off", [0.0, 1e-11, 1e-7, 1e-2])
def test_linked_tori_have_a_certified_distance(off):
    """Near the pose at which their nearest points are a continuum; moved apart along the line of both centers."""
    ring, half = asm.shapes.torus(3.0, 0.5), np.sqrt(0.5)
    pose = np.array([3.0 + off, 0.0, 0.0, half, half, 0.0, 0.0])
    found = asm.proximity.distance(ring, ring, poses=(None, pose))
    assert found.status is DistanceStatus.CONVERGED and found.upper - found.lower <= 1e-10
    # The far point of the first and the near one of the second are as far apart as that moves them.
    true = distance_judged(np.append(UPRIGHT, 3.0), circle(pose[:3], [0.0, 1.0, 0.0], 3.0)) - 1.0
    assert found.lower <= true + 1e-12 and found.upper >= true - 1e-12
    assert found.evaluations <= 1000
