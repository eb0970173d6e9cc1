"""Which configuration a mechanism is in: signs that change at dead centers and singular poses, and nowhere else.

Three hinges that follow each other from body to body are at a dead center where their axes are dependent: parallel ones
where they lie in a plane, others where their directions do. On either side the middle one is bent the one way or the
other: elbow up or down, a wrist flipped or not. The sign is that of

    ((p_2 - p_1) x (p_3 - p_2)) . z      parallel axes z through p_i,
    z_1 . (z_2 x z_3)                    others,

over the lengths. A loop that six coordinates close is singular where their screws are dependent: the sign of the
determinant of these. Two solutions of a scene with another sign are two branches, however near they are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from assembly.constraints.model.constraint import Constraint
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.joints import Cylindrical, Fixed, Prismatic, Revolute
from assembly.errors import InputError
from assembly.kinematics.body import Body
from assembly.kinematics.pose import rotation_matrix
from assembly.solve.solution import Solution

__all__ = ["configuration", "differ"]

Array = NDArray[np.float64]
# Axes whose cosine is within this of one are parallel. Numbers of order one that are below ZERO have no sign: beside a
# dead center a pose is as exact as the root of twice what rows may be off by, 2e-13.
PARALLEL, ZERO = 1e-9, 1e-6
# Singular values of screws that are always dependent.
DEPENDENT = 1e-8
# Coordinates of joints that are one screw each: about the axis, along it.
SCREWS = {Revolute: ("angle",), Prismatic: ("slide",), Cylindrical: ("angle", "slide"), Fixed: ()}


@dataclass(frozen=True, eq=False)
class _Axis:
    """A joint of a solution: bodies by number, a place on its axis and the axis' direction in the world."""

    joint: Joint
    bodies: tuple[int, int]
    place: Array
    direction: Array


def configuration(solution: Solution) -> Mapping[str, int]:
    """Signs of a solution's mechanism: 1 or -1, and 0 at a dead center or a singular pose.

    Parameters
    ----------
    solution : Solution

    Returns
    -------
    dict of str to int
        "a-b-c" for consecutive hinges, in the order of the scene's constraints, with the bend at b; "loop of c" for a
        loop that six coordinates close, c the last of its joints. Of joints that are always dependent there is none.
    """
    if not isinstance(solution, Solution):
        raise TypeError(f"solution is {solution!r}; expected a Solution")
    if not solution.success:
        raise InputError(f"solution is {solution.status.name}; expected one that succeeded")
    scene = solution._scene
    axes = _axes(scene.bodies, scene.constraints, solution.q)
    told = {**_bends(axes), **_loops(scene.bodies, axes)}
    return {name: 0 if abs(value) <= ZERO else (1 if value > 0.0 else -1) for name, value in told.items()}


def differ(solution: Solution, other: Solution) -> bool:
    """Whether two solutions of a scene have a sign that is another one, and zero in neither."""
    signs, others = configuration(solution), configuration(other)
    return any(sign * others.get(name, 0) < 0 for name, sign in signs.items())


def _axes(bodies: Sequence[Body], constraints: Sequence[Constraint], q: Array) -> list[_Axis]:
    """Joints with an axis."""
    places = {id(body): k for k, body in enumerate(bodies)}
    axes = []
    for joint in constraints:
        if isinstance(joint, Joint) and type(joint) in SCREWS:
            frame = joint._frames.frame_a
            row = q[places[id(frame.body)]]
            turn = rotation_matrix(row[3:])
            a, b = (places[id(body)] for body in joint.bodies)
            axes.append(_Axis(joint, (a, b), row[:3] + turn @ frame.origin, turn @ frame.axes[:, 2]))
    return axes


def _bends(axes: Sequence[_Axis]) -> dict[str, float]:
    """How hinges that follow each other are bent, by their names."""
    hinges = [axis for axis in axes if isinstance(axis.joint, Revolute)]
    told: dict[str, float] = {}
    for k, middle in enumerate(hinges):
        p, r = middle.bodies
        for i, j in permutations(range(len(hinges)), 2):
            if k in (i, j) or p not in hinges[i].bodies or r not in hinges[j].bodies:
                continue
            first, last = (hinges[i], hinges[j]) if i < j else (hinges[j], hinges[i])
            bend = _bend(first, middle, last)
            if bend is not None:
                told[f"{first.joint.name}-{middle.joint.name}-{last.joint.name}"] = bend
    return told


def _bend(first: _Axis, middle: _Axis, last: _Axis) -> float | None:
    """The bend of three hinges; None where two of the axes alone are parallel, or two of three are one."""
    z = middle.direction
    cosines = [abs(float(z @ first.direction)), abs(float(z @ last.direction))]
    is_parallel = [cosine > 1.0 - PARALLEL for cosine in cosines]
    if all(is_parallel):
        before, after = middle.place - first.place, last.place - middle.place
        before, after = before - (before @ z) * z, after - (after @ z) * z
        lengths = float(np.linalg.norm(before) * np.linalg.norm(after))
        return float(np.cross(before, after) @ z) / lengths if lengths > 0.0 else None
    if any(is_parallel):
        return None
    return float(first.direction @ np.cross(z, last.direction))


def _loops(bodies: Sequence[Body], axes: Sequence[_Axis]) -> dict[str, float]:
    """The determinants of loops that six coordinates close."""
    above: dict[int, tuple[int, _Axis] | None] = {k: None for k, body in enumerate(bodies) if body.fixed}
    rest, told = list(axes), {}
    while True:
        # Of several the first in the scene's order, which is the same at all solutions.
        found = next((axis for axis in rest if (axis.bodies[0] in above) != (axis.bodies[1] in above)), None)
        if found is None:
            break
        a, b = found.bodies if found.bodies[0] in above else found.bodies[::-1]
        above[b] = (a, found)
        rest.remove(found)
    for last in rest:
        if all(body in above for body in last.bodies):
            ways = [_way(body, above) for body in last.bodies]
            loop = [axis for way in ways for axis in way if not all(axis in other for other in ways)]
            determinant = _determinant([*loop, last])
            if determinant is not None:
                told[f"loop of {last.joint.name}"] = determinant
    return told


def _way(body: int, above: Mapping[int, tuple[int, _Axis] | None]) -> list[_Axis]:
    """Joints from a body to a fixed one."""
    way, step = [], above[body]
    while step is not None:
        way.append(step[1])
        step = above[step[0]]
    return way


def _determinant(loop: Sequence[_Axis]) -> float | None:
    """Of the screws of six coordinates, lengths over the loop's. None for more or fewer, or where it is always zero."""
    middle = np.mean([axis.place for axis in loop], axis=0)
    size = max(float(np.linalg.norm(axis.place - middle)) for axis in loop)
    if size == 0.0:
        return None
    screws = []
    for axis in loop:
        for name in SCREWS[type(axis.joint)]:
            if axis.joint.freedom(name).value is None:
                z = axis.direction
                about = np.concatenate([z, np.cross((axis.place - middle) / size, z)])
                screws.append(about if name == "angle" else np.concatenate([np.zeros(3), z]))
    if len(screws) != 6:
        return None
    values = np.linalg.svd(np.array(screws), compute_uv=False)
    # Of a planar loop with six coordinates several are zero.
    return float(np.linalg.det(np.array(screws))) if values[-2] > DEPENDENT else None
