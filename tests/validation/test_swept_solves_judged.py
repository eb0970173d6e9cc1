"""Swept solves of random bodies that a screw drives past each other, judged by closed forms.

The motion is known, and so is the pose at every part of it. On the way that is said to be clear no pose is deeper than
`way.depth`; where a way is blocked the bodies are nearly in touch, and cross a little beyond.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from tests.validation.clearance_scenes import TOUCHING, parts
from tests.validation.crossing_judge import Motion, crossing_depth, least_signed_distance, sampled_distance

# A part of the way that is not known, times what bodies go along the longest one, in sizes: 10 in lengths and turns.
RESOLUTION = 10.0 * 2.0**-20
BEYOND = (1e-5, 1e-4, 1e-3, 1e-2)


def unit(rng):
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


class Drawn(NamedTuple):
    """Two parts, how the second one begins, and the screw: a point of its axis, the axis, and how far it goes."""

    first: str
    second: str
    begin: Motion
    point: np.ndarray
    axis: np.ndarray
    angle: float
    slide: float

    @property
    def both(self):
        return parts()[self.first], parts()[self.second]

    @property
    def size(self):
        return max(part.size for part in self.both)

    def at(self, part):
        """Where the second part is at a part of its way."""
        turn = Rotation.from_rotvec(part * self.angle * self.axis).as_matrix()
        place = self.point + turn @ (self.begin.place - self.point) + part * self.slide * self.axis
        return Motion(turn @ self.begin.turn, place)

    def scene(self):
        """The scene, and the joint that drives it."""
        (a, b), base = self.both, asm.Body("base", fixed=True)
        quaternion = Rotation.from_matrix(self.begin.turn).as_quat(scalar_first=True)
        first, second = asm.Body("a", a.shape, fixed=True), asm.Body("b", b.shape, self.begin.place, quaternion)
        x = np.linalg.svd(self.axis[None])[2][1]
        back = self.begin.turn.T
        there = second.frame(at=back @ (self.point - self.begin.place), z=back @ self.axis, x=back @ x)
        joint = asm.Cylindrical(base.frame(at=self.point, z=self.axis, x=x), there, "screw", angle=0.0, slide=0.0)
        scene = asm.Assembly([base, first, second])
        scene.constrain(joint, asm.Clearance())
        return scene, joint


def drawn(number):
    """Of a number the same parts, apart from each other, and the same screw."""
    rng = np.random.default_rng(number)
    # An open sheet ends solves STALLED before it is reached.
    known = [name for name, part in parts().items() if part.is_closed]
    while True:
        first, second = (known[k] for k in rng.integers(len(known), size=2))
        a, b = parts()[first], parts()[second]
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
        begin = Motion(turn, unit(rng) * rng.uniform(0.2, 0.5) * (a.size + b.size))
        if sampled_distance(a, b, begin) > 0.05:
            break
    angle, slide = rng.uniform(-2.0 * np.pi, 2.0 * np.pi), rng.uniform(-2.0, 2.0)
    return Drawn(first, second, begin, 0.5 * rng.normal(size=3), unit(rng), angle, slide)


def test_random_screws(cases):
    count, samples = cases(4, 400), cases(8, 30)
    blocked = 0
    for number in range(count):
        way = drawn(number)
        scene, joint = way.scene()
        start = scene.solve()
        assert start.success, way
        joint.angle, joint.slide = way.angle, way.slide
        found = scene.solve(start, swept=True)
        assert found.q[2, :3] == pytest.approx(way.at(found.way.part).place, abs=1e-11 * way.size), way
        allowed = found.way.depth + TOUCHING * way.size
        for part in np.linspace(0.0, found.way.part, samples):
            assert crossing_depth(*way.both, way.at(part)) <= allowed, way
        if found.success:
            assert found.way.part == 1.0 and found.q.tobytes() == scene.solve(start).q.tobytes(), way
        else:
            blocked += 1
            assert found.status is asm.Status.BLOCKED and found.way.obstacles == (("a", "b"),), way
            assert least_signed_distance(*way.both, way.at(found.way.part)) <= RESOLUTION * way.size, way
            beyond = [way.at(found.way.part + more) for more in BEYOND]
            assert max(crossing_depth(*way.both, pose) for pose in beyond) > 0.0, way
    assert blocked > 0.1 * count
