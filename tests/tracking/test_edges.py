"""Solids with edges that a hand draws into each other: no tick goes through, however far the hand goes at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.tracking.tick import TrackStatus
from tests.solve.test_flat_contacts import apart

PLATE = (3.0, 3.0, 0.1)


def drawn(rng, ticks, order):
    """Two plates that are apart, and a hand that draws a point of one to a place behind the other one's middle."""
    while True:
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_quat(scalar_first=True)
        pose = np.r_[rng.uniform(-1.6, 1.6, 3), turn]
        if apart(np.array([[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], pose]), (PLATE, PLATE)) > 0.02:
            break
    a = asm.Body("a", asm.shapes.box(*PLATE), fixed=True)
    b = asm.Body("b", asm.shapes.box(*PLATE), pose[:3], pose[3:])
    scene = asm.Assembly([a, b][::order])
    scene.constrain(asm.Clearance())
    hold = b.point(*(0.5 * rng.uniform(-1.0, 1.0, 3) * PLATE))
    begin = b.pose.apply(hold.coordinates)
    target = np.array([*rng.uniform(-1.0, 1.0, 2), -np.sign(begin[2]) * rng.uniform(0.2, 1.0)])
    return scene.tracker(hold), [begin + (target - begin) * (k + 1) / ticks for k in range(ticks)]


# Of these hands 13 to 27 of 40 drew one plate through the other, told FOLLOWED.
@pytest.mark.parametrize("ticks", [15, 100])
@pytest.mark.parametrize("order", [1, -1])
def test_plates_do_not_go_through_each_other(ticks, order, cases):
    rng = np.random.default_rng(8)
    held, count = 0, cases(3, 40)
    for _ in range(count):
        tracker, hand = drawn(rng, ticks, order)
        deepest = 0.0
        for target in hand:
            step = tracker.step(target)
            held += step.status is not TrackStatus.VIOLATED
            if step.status is not TrackStatus.VIOLATED:
                deepest = min(deepest, apart(step.q[::order], (PLATE, PLATE)))
        # The bound of a tick, 1e-9 of the scene's size.
        assert deepest > -1e-8
    assert held > 0.99 * count * ticks
