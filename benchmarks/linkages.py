"""Mechanisms to measure: known linkages, boxes on one another, arms, and scenes that contradict themselves."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

import assembly as asm
from assembly.constraints.model.constraint import Constraint
from assembly.kinematics.frame import Point

__all__ = [
    "CONTRADICTIONS",
    "arm",
    "bennett",
    "boxes",
    "bricard",
    "contradiction",
    "four_bar",
    "parallelograms",
    "planar_four_bar",
    "turntable",
]

Array = NDArray[np.float64]
Inputs = list[asm.Revolute]


def four_bar(base: asm.Body | None = None) -> tuple[asm.Assembly, asm.Revolute]:
    """The spatial four-bar: hinge, ball, universal joint, hinge; and the crank's hinge, which is driven."""
    ground = asm.Body("ground", fixed=True) if base is None else base
    crank, coupler, rocker = (asm.Body(name) for name in ("crank", "coupler", "rocker"))
    hinge = asm.Revolute(ground, crank, "crank hinge", angle=0.3)
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(
        hinge,
        asm.Spherical(crank.frame((1, 0, 0)), coupler, "ball"),
        asm.Universal(coupler.frame((3, 0, 0)), rocker.frame((0, 2, 0), (1, 0, 0)), "cross"),
        asm.Revolute(ground.frame((3, 0, 0.5), (0, 1, 0.2)), rocker, "rocker hinge"),
    )
    return scene, hinge


def turntable() -> tuple[asm.Assembly, Point, Inputs]:
    """The spatial four-bar on a turntable, a point of its coupler, and both inputs, driven."""
    table, ground = asm.Body("table"), asm.Body("ground", fixed=True)
    scene, hinge = four_bar(table)
    scene.add(ground)
    turn = asm.Revolute(ground.frame((0.5, 1, 0), (1, 2, 3)), table.frame((0.5, 1, 0), (1, 2, 3)), "turn", angle=0.1)
    scene.constrain(turn)
    return scene, scene.body("coupler").point(1.5, 0.4, 0.2), [turn, hinge]


def arm(count: int, seed: int = 0) -> tuple[asm.Assembly, Point, Inputs]:
    """Links in a row with hinges any way, driven; a point of the last link."""
    rng = np.random.default_rng(seed)
    bodies = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}") for k in range(count))]
    hinges = [
        asm.Revolute(a.frame((1.0, 0.2 * k, 0.1), _way(rng)), b.frame(z=_way(rng)), f"hinge {k}", angle=0.3 + 0.2 * k)
        for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False))
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(*hinges)
    return scene, bodies[-1].point(1.0, 0.3, 0.1), hinges


def boxes(count: int, seed: int) -> asm.Assembly:
    """Unit cubes from scattered poses, each to stand on the one before: face on face, free to turn."""
    rng = np.random.default_rng(seed)
    bodies = [asm.Body("box 0", asm.shapes.box(1, 1, 1), fixed=True)]
    for k in range(1, count):
        bodies.append(asm.Body(f"box {k}", asm.shapes.box(1, 1, 1), 2.0 * rng.normal(size=3), _turn(rng)))
    scene = asm.Assembly(bodies)
    for k in range(1, count):
        top, bottom = bodies[k - 1].frame((0, 0, 0.5)), bodies[k].frame((0, 0, -0.5), (0, 0, -1))
        scene.constrain(asm.Revolute(top, bottom, f"mate {k}", axes="opposed"))
    return scene


def _loop(axes: Sequence[ArrayLike], points: Sequence[ArrayLike], size: float) -> asm.Assembly:
    """Links that stand at the world's origin, ground first; joint k, on axis k through point k, ties k to k + 1."""
    links = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}") for k in range(1, len(axes)))]
    scene = asm.Assembly(links)
    for k, (axis, point) in enumerate(zip(axes, points, strict=True)):
        a, b = (links[j % len(links)].frame(size * np.asarray(point, dtype=float), axis) for j in (k, k + 1))
        scene.constrain(asm.Revolute(a, b, f"joint {k + 1}"))
    return scene


def planar_four_bar(size: float) -> asm.Assembly:
    """Four parallel hinges; the crank goes around, 0.5 + 3 < 2.46 + 1.58."""
    return _loop([(0, 0, 1)] * 4, [(0, 0, 0), (0.3, 0.4, 0), (2.5, 1.5, 0), (3, 0, 0)], size)


def bennett(size: float) -> asm.Assembly:
    """Opposite bars alike, sin(alpha) / a = sin(beta) / b, no axes parallel or meeting.

    Closed by (Bennett 1903) tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2).
    """
    alpha, beta, a, first = 0.6, 1.1, 1.0, 0.7
    b = a * np.sin(beta) / np.sin(alpha)
    second = 2.0 * np.arctan(np.sin(0.5 * (beta + alpha)) / np.sin(0.5 * (beta - alpha)) / np.tan(0.5 * first))
    pose, axes, points = asm.Pose(), [], []
    for angle, length, twist in ((first, a, alpha), (second, b, beta), (-first, a, alpha), (-second, b, beta)):
        axes.append(pose.matrix[:3, 2])
        points.append(pose.position)
        link = asm.Pose.from_axis_angle((1, 0, 0), twist, (length, 0, 0))
        pose = pose @ asm.Pose.from_axis_angle((0, 0, 1), angle) @ link
    return _loop(axes, points, size)


def bricard(size: float) -> asm.Assembly:
    """Six bars along edges of a cube, each across the hinges at its ends: Bricard's trihedral linkage."""
    corners = [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1), (0, 0, 0)]
    return _loop([(0, 0, 1), (1, 0, 0), (0, 1, 0)] * 2, corners, size)


def parallelograms(count: int) -> asm.Assembly:
    """Squares in a row with common sides, folded flat: every bar lies along x."""
    ground = asm.Body("ground", fixed=True)
    rods = [asm.Body(f"rod {k}") for k in range(count + 1)]
    couplers = [asm.Body(f"coupler {k}") for k in range(count)]
    ties = [(ground, rod, k, f"foot {k}") for k, rod in enumerate(rods)]
    for k, coupler in enumerate(couplers):
        ties += [(rods[k], coupler, k + 1, f"left {k}"), (coupler, rods[k + 1], k + 2, f"right {k}")]
    scene = asm.Assembly([ground, *rods, *couplers])
    scene.constrain(*(asm.Revolute(a.frame((x, 0, 0)), b.frame((x, 0, 0)), name) for a, b, x, name in ties))
    return scene


def _way(rng: np.random.Generator) -> Array:
    return np.asarray(rng.normal(size=3))


def _turn(rng: np.random.Generator) -> Array:
    e = rng.normal(size=4)
    return np.asarray(e / np.linalg.norm(e))


def _bodies(rng: np.random.Generator, count: int) -> list[asm.Body]:
    """The first one fixed, all scattered."""
    return [asm.Body(f"body {k}", position=_way(rng), quaternion=_turn(rng), fixed=k == 0) for k in range(count)]


def _polygon(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """Distances around a polygon of points of which one is longer than the others together."""
    count = int(rng.integers(3, 6))
    bodies = _bodies(rng, count)
    points = [body.point(*_way(rng)) for body in bodies]
    lengths = rng.uniform(0.5, 1.5, count)
    lengths[-1] = lengths[:-1].sum() * rng.uniform(1.05, 2.0)
    rods: list[Constraint] = [
        asm.Distance(points[k], points[(k + 1) % count], length, f"rod {k}") for k, length in enumerate(lengths)
    ]
    return bodies, rods


def _driven(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """A hinge driven to an angle at which a rod to the arm does not fit."""
    ground, door = bodies = _bodies(rng, 2)
    angle = rng.uniform(-3.0, 3.0)
    length = 2.0 * abs(np.sin(0.5 * angle)) + rng.choice([-1, 1]) * rng.uniform(0.05, 0.3)
    ends = ground.point(1, 0, 0), door.point(1, 0, 0)
    # Shorter than nothing is not to be had.
    rod = asm.Distance(*ends, length if length > 0.05 else 2.0 + rng.uniform(0.1, 1.0), "rod")
    return bodies, [asm.Revolute(ground, door, "hinge", angle=angle), rod]


def _stopped(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """A slide whose stop is before the plane that the slider is to reach."""
    ground, slider = bodies = _bodies(rng, 2)
    stop = rng.uniform(0.2, 2.0)
    return bodies, [
        asm.Prismatic(ground, slider, "slide", limits=(0.0, stop)),
        asm.PointOnPlane(slider, ground, "plane", offset=stop + rng.uniform(0.05, 1.0)),
    ]


def _geared(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """Two wheels in mesh, each driven to an angle of its own."""
    ground, first, second = bodies = _bodies(rng, 3)
    ratio, angle = -rng.uniform(0.3, 3.0), rng.uniform(-1.0, 1.0)
    other = ratio * angle + rng.choice([-1, 1]) * rng.uniform(0.1, 1.0)
    a = asm.Revolute(ground.frame(_way(rng)), first, "first", angle=angle)
    b = asm.Revolute(ground.frame(_way(rng)), second, "second", angle=other)
    return bodies, [a, b, asm.Gear(a, b, ratio, "mesh")]


def _reaching(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """An arm of balls and links whose tip is to be where it does not reach."""
    count = int(rng.integers(2, 5))
    bodies = _bodies(rng, count + 1)
    lengths = rng.uniform(0.5, 1.5, count)
    ties: list[Constraint] = [asm.Spherical(bodies[0], bodies[1], "ball 0")]
    for k in range(1, count):
        ties.append(asm.Spherical(bodies[k].point(lengths[k - 1], 0, 0), bodies[k + 1], f"ball {k}"))
    far = _way(rng)
    far *= lengths.sum() * rng.uniform(1.05, 2.0) / np.linalg.norm(far)
    ties.append(asm.Spherical(bodies[0].point(*far), bodies[-1].point(lengths[-1], 0, 0), "goal"))
    return bodies, ties


def _ring(rng: np.random.Generator) -> tuple[list[asm.Body], list[Constraint]]:
    """Three hinges any way in a ring: 15 rows for 12 unknowns, and any two of them an open chain."""
    bodies = _bodies(rng, 3)
    hinges: list[Constraint] = []
    for k in range(3):
        a, b = bodies[k], bodies[(k + 1) % 3]
        hinges.append(asm.Revolute(a.frame(_way(rng), _way(rng)), b.frame(_way(rng), _way(rng)), f"hinge {k}"))
    return bodies, hinges


CONTRADICTIONS: dict[str, Callable[[np.random.Generator], tuple[list[asm.Body], list[Constraint]]]] = {
    "polygon": _polygon,
    "driven": _driven,
    "stopped": _stopped,
    "geared": _geared,
    "reaching": _reaching,
    "ring": _ring,
}


def contradiction(kind: str, seed: int) -> tuple[asm.Assembly, tuple[str, ...]]:
    """A scene whose constraints cannot all hold, and the least set of them that cannot, which is the only one.

    A body hangs on every scene that has nothing to do with it.
    """
    rng = np.random.default_rng([seed, *map(ord, kind)])
    bodies, ties = CONTRADICTIONS[kind](rng)
    tail = asm.Body("tail", position=_way(rng), quaternion=_turn(rng))
    scene = asm.Assembly([*bodies, tail])
    scene.constrain(*ties, asm.Spherical(bodies[-1].point(*_way(rng)), tail, "tail"))
    return scene, tuple(sorted(tie.name for tie in ties))
