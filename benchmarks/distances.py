"""Certified distances of surfaces and of solids to 1e-10: at one pose again, at a new pose, and for the first time."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity import BodyDistance, distance
from benchmarks.figures import figure

ABOUT = """\
Calls of `asm.proximity.distance` from Python. "Again" is the least of ten calls at one pose, "a new pose" the median of
twelve poses of the same shapes, "first" a call with shapes that were never asked before; each is the median over the
pairs. Patches: wavy bicubic ones of one span, half of them rational, side by side at random orientations. Convex sides:
two ellipsoids at a known gap. Rounded boxes: 6 planes, 12 quarters of cylinders and 8 eighths of balls each. Domes in
bowls: paraboloids as bicubic sheets, the dome's two curvatures 1.02 to 2.5 times the larger one of the bowl's, over its
lowest point and turned about the axis; of a dome 1.02 to 1.1 times as curved the surfaces nearly conform. A count is of
answers whose bounds are 1e-10 apart or less, and have the distance between them where it is known."""

Array = NDArray[np.float64]
Shape = Any
Pose = tuple[float, ...]
# A quarter of a circle: three control points with these weights.
ARC = np.array([1.0, np.sqrt(0.5), 1.0])
AGAIN, NEW = 10, 12


def _patch(rng: np.random.Generator) -> asm.NurbsSurface:
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, 4)], indexing="ij")
    net = np.stack([x, y, 0.3 * rng.standard_normal((4, 4))], axis=2)
    knots = np.repeat([0.0, 1.0], 4)
    weights = rng.uniform(0.5, 2.0, (4, 4)) if rng.random() < 0.5 else None
    return asm.NurbsSurface(net, (knots, knots), (3, 3), weights)


def rounded_box(half: tuple[float, float, float], radius: float) -> list[asm.NurbsSurface]:
    """A box with these half sides whose edges and corners are round: 26 faces."""
    axes, inner = np.eye(3), np.array(half) - radius
    line, arc = np.repeat([0.0, 1.0], 2), np.repeat([0.0, 1.0], 3)
    faces = []
    for k, sign in product(range(3), (-1.0, 1.0)):
        u, v = inner[(k + 1) % 3] * axes[(k + 1) % 3], inner[(k + 2) % 3] * axes[(k + 2) % 3]
        net = np.array([[s * u + t * v + sign * half[k] * axes[k] for t in (-sign, sign)] for s in (-1.0, 1.0)])
        faces.append(asm.NurbsSurface(net, (line, line), (1, 1)))
    for k, p, q in product(range(3), (-1.0, 1.0), (-1.0, 1.0)):
        a, b = p * axes[(k + 1) % 3], q * axes[(k + 2) % 3]
        middle = inner[(k + 1) % 3] * a + inner[(k + 2) % 3] * b
        ends = [s * inner[k] * axes[k] for s in (-p * q, p * q)]
        net = np.array([[middle + radius * out + end for end in ends] for out in (a, a + b, b)])
        faces.append(asm.NurbsSurface(net, (arc, line), (2, 1), np.stack([ARC, ARC], axis=1)))
    for signs in product((-1.0, 1.0), repeat=3):
        a, b, c = np.diag(signs) if np.prod(signs) > 0.0 else np.diag(signs)[[1, 0, 2]]
        out = np.array([[a, a + c, c], [a + b, a + b + c, c], [b, b + c, c]])
        net = np.array(signs) * inner + radius * out
        faces.append(asm.NurbsSurface(net, (arc, arc), (2, 2), np.outer(ARC, ARC)))
    return faces


def _turned(rng: np.random.Generator, place: Array) -> Pose:
    return (*place, *Rotation.random(random_state=rng).as_quat(scalar_first=True))


class _Case:
    """Pairs of shapes, where the second one stands, and how far they are apart, if that is known."""

    def __init__(
        self, make: Callable[[], tuple[Shape, Shape]], pose: Callable[[], Pose], gap: float | None = None
    ) -> None:
        self.make, self.pose, self.gap = make, pose, gap
        self.again: list[float] = []
        self.new: list[float] = []
        self.first: list[float] = []
        self.right = self.asked = 0

    def ask(self, a: Shape, b: Shape, pose: Pose) -> float:
        """Seconds of a call; whether its answer is right is counted."""
        begin = time.perf_counter()
        found = distance(a, b, poses=(None, pose))
        took = time.perf_counter() - begin
        self.asked += 1
        self.right += self._is_right(found)
        return took

    def _is_right(self, found: BodyDistance) -> bool:
        known = self.gap is None or found.lower - 1e-14 <= self.gap <= found.upper + 1e-14
        return found.converged and found.upper - found.lower <= 1e-10 and known

    def run(self, pairs: int) -> None:
        for _ in range(pairs):
            (a, b), pose = self.make(), self.pose()
            self.first.append(self.ask(a, b, pose))
            self.again.append(min(self.ask(a, b, pose) for _ in range(AGAIN)))
            self.new.append(statistics.median(self.ask(a, b, self.pose()) for _ in range(NEW)))


def _ellipsoids(about_z: Callable[[tuple[float, float, float]], Pose], gap: float) -> _Case:
    """Two of them, one above the other."""
    ellipsoid = asm.shapes.ellipsoid
    return _Case(
        lambda: (ellipsoid(1.0, 0.8, 0.6), ellipsoid(1.0, 0.8, 0.6)), lambda: about_z((0.0, 0.0, 1.2 + gap)), gap
    )


def _paraboloid(curvatures: Array, side: float) -> asm.NurbsSurface:
    """z = (k x^2 + l y^2) / 2 over a square about the origin, of degree (3, 3)."""
    x, y = np.meshgrid(*2 * [np.linspace(-side, side, 3)], indexing="ij")
    # Bezier points of x^2.
    square = side**2 * np.array([1.0, -1.0, 1.0])
    z = 0.5 * (curvatures[0] * square[:, None] + curvatures[1] * square)
    knots = np.repeat([0.0, 1.0], 3)
    return asm.NurbsSurface(np.stack([x, y, z], axis=2), (knots, knots), (2, 2)).elevate((3, 3))


def _dome_in_bowl(
    rng: np.random.Generator, about_z: Callable[[tuple[float, float, float]], Pose], gap: float, most: float
) -> _Case:
    """No horizontal section of the dome, whose curvatures are larger, is nearer to the bowl than its lowest point."""

    def make() -> tuple[Shape, Shape]:
        bowl = rng.uniform(0.3, 1.0, 2)
        return _paraboloid(bowl, 1.0), _paraboloid(bowl.max() * rng.uniform(1.02, most, 2), 0.5)

    return _Case(make, lambda: about_z((0.0, 0.0, gap)), gap)


def _cases(rng: np.random.Generator) -> dict[str, _Case]:
    def far(length: float) -> Array:
        way = rng.normal(size=3)
        return np.asarray(length * way / np.linalg.norm(way))

    def about_z(place: tuple[float, float, float]) -> Pose:
        turn = rng.uniform(0.0, 2.0 * np.pi)
        return (*place, np.cos(0.5 * turn), 0.0, 0.0, np.sin(0.5 * turn))

    shapes = asm.shapes
    boxes = (rounded_box((1.0, 0.7, 0.5), 0.15), rounded_box((0.8, 0.8, 0.4), 0.1))
    cases = {
        "bicubic patches": _Case(
            lambda: (_patch(rng), _patch(rng)), lambda: _turned(rng, np.array([0.0, 0.0, 2.0]) + far(0.5))
        ),
        "rounded boxes": _Case(
            lambda: (asm.Body("a", boxes[0]), asm.Body("b", boxes[1])), lambda: _turned(rng, far(2.6))
        ),
        "concentric balls": _Case(
            lambda: (shapes.sphere(2.0), shapes.sphere(1.0)), lambda: _turned(rng, np.zeros(3)), 1.0
        ),
        "coaxial cylinders": _Case(
            lambda: (shapes.cylinder(2.0, 3.0), shapes.cylinder(1.0, 2.0)), lambda: about_z((0.0, 0.0, 0.3)), 1.0
        ),
        "parallel cylinders": _Case(
            lambda: (shapes.cylinder(1.0, 3.0), shapes.cylinder(1.0, 2.0)), lambda: about_z((2.5, 0.0, 0.3)), 0.5
        ),
    }
    for gap in (1e-2, 1e-4, 1e-6):
        cases[f"convex sides at a gap of {gap:g}"] = _ellipsoids(about_z, gap)
    for gap in (1e-2, 1e-4, 1e-6):
        cases[f"dome in a bowl at a gap of {gap:g}"] = _dome_in_bowl(rng, about_z, gap, 2.5)
    return cases | {"dome in a bowl of nearly its curvatures": _dome_in_bowl(rng, about_z, 1e-4, 1.1)}


# Of each case: a call again, at a new pose, and the first one [s]; None where no figure is asked for.
REACH = {
    "bicubic patches": (0.06e-3, 0.15e-3, 0.3e-3),
    "rounded boxes": (0.5e-3, 1.5e-3, None),
    "concentric balls": (20e-6, None, None),
    "coaxial cylinders": (20e-6, None, None),
    "parallel cylinders": (20e-6, None, None),
}
CONVEX = (0.3e-3, None, None)
BOWL = (3e-3, None, None)


def run(quick: bool) -> dict[str, Any]:
    """Times a call, and how many answers are right."""
    figures = []
    right = asked = 0
    for name, case in _cases(np.random.default_rng(0)).items():
        case.run(2 if quick else 12)
        times = (case.again, case.new, case.first)
        for kind, seconds, reach in zip(
            ("again", "a new pose", "first"), times, REACH.get(name, BOWL if "bowl" in name else CONVEX), strict=True
        ):
            # The first call with the first pair loads kernels.
            measured = statistics.median(seconds[1:] if kind == "first" else seconds)
            figures.append(figure(f"{name}, {kind}", "seconds", measured, reach=reach))
        right, asked = right + case.right, asked + case.asked
    figures.append(figure("answers that are right", "count", right, of=asked, reach=asked))
    return {"about": ABOUT, "figures": figures}
