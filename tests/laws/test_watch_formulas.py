"""What `docs/derivations.md` says of how far bodies move."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from assembly.proximity.manager.motion_bounds import turned_by
from assembly.proximity.manager.records import (
    PAIR_MEMORY,
    pair_state_at,
)


def quaternions(rng, count, angle):
    """Pairs of unit quaternions, one of a random sign, that are turned by up to an angle against each other."""
    first = Rotation.random(count, rng=rng)
    axes = rng.normal(size=(count, 3))
    turns = axes * (rng.uniform(0.0, angle, count) / np.linalg.norm(axes, axis=1))[:, None]
    second = Rotation.from_rotvec(turns) * first
    signs = rng.choice([-1.0, 1.0], (count, 1))
    return first.as_quat(scalar_first=True), signs * second.as_quat(scalar_first=True), np.linalg.norm(turns, axis=1)


def test_no_point_moves_farther_than_the_bound():
    rng = np.random.default_rng(4)
    for angle in (1e-6, 0.1, 1.0, np.pi):
        first, second, turned = quaternions(rng, 500, angle)
        for e, f, a in zip(first, second, turned, strict=True):
            x, y = rng.normal(size=(2, 3)) * rng.choice([0.0, 1e-3, 1.0])
            radius = rng.uniform(0.1, 2.0)
            memory = np.zeros(PAIR_MEMORY)
            known = pair_state_at(memory, 0)
            known.turn, known.place = e, x
            bound = np.linalg.norm(y - x) + 2.0 * radius * turned_by(known, tuple(f))
            points = rng.normal(size=(50, 3))
            points *= radius / np.linalg.norm(points, axis=1)[:, None]
            here = Rotation.from_quat(e, scalar_first=True).apply(points) + x
            there = Rotation.from_quat(f, scalar_first=True).apply(points) + y
            moved = np.linalg.norm(there - here, axis=1)
            # Rounding of coordinates of order one.
            assert moved.max() <= bound + 1e-15 * 8.0
            least = min(np.linalg.norm(e - f), np.linalg.norm(e + f))
            assert abs(least - 2.0 * np.sin(a / 4.0)) < 1e-15 * 8.0
            # A point at right angles to the axis comes as far as cos(a / 4) of it by the turn alone.
            turn = Rotation.from_quat(f, scalar_first=True) * Rotation.from_quat(e, scalar_first=True).inv()
            across = np.cross(turn.as_rotvec(), rng.normal(size=3))
            across *= radius / np.linalg.norm(across)
            farthest = np.linalg.norm(turn.apply(across) - across)
            assert abs(farthest - 2.0 * radius * least * np.cos(a / 4.0)) < 1e-14
