"""Random closed linkages that can be put together by construction, started elsewhere."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import assembly as asm
from assembly.kinematics.pose import rotate

Array = NDArray[np.float64]
Joint = asm.Revolute | asm.Prismatic | asm.Cylindrical | asm.Spherical | asm.Universal
# Kinds of joints of linkages in a plane and in space, and their angle or slide that may be driven or limited.
PLANAR = (asm.Revolute, asm.Revolute, asm.Revolute, asm.Prismatic)
SPATIAL = (asm.Revolute, asm.Revolute, asm.Cylindrical, asm.Spherical, asm.Universal)


@dataclass(frozen=True)
class Linkage:
    """A scene whose bodies stand scattered, and poses (n, 7) at which all of it holds."""

    scene: asm.Assembly
    held: Array


def random_turn(rng: np.random.Generator) -> Array:
    """A unit quaternion, any as likely as any other."""
    quaternion = rng.normal(size=4)
    return quaternion / np.linalg.norm(quaternion)


def linkage(seed: int) -> Linkage:
    """A closed linkage of two to six bodies and one or two loops, in a plane or in space.

    All joints hold at poses that are drawn first; some are driven to what they are there, or limited about it.
    """
    rng = np.random.default_rng(seed)
    planar = bool(rng.random() < 0.6)
    count = int(rng.integers(3, 7))
    held = np.array([_pose(rng, planar) for _ in range(count)])
    bodies = [asm.Body(f"body {k}", position=row[:3], quaternion=row[3:], fixed=k == 0) for k, row in enumerate(held)]
    links = [(k, (k + 1) % count) for k in range(count)]
    if count > 4 and rng.random() < 0.3:
        links.append((0, int(rng.integers(2, count - 1))))
    joints = [_joint(rng, planar, bodies, held, pair, f"joint {k}") for k, pair in enumerate(links)]
    scene = asm.Assembly(bodies)
    scene.constrain(*joints)
    _ask(rng, joints, held, scene)
    for body in bodies[1:]:
        body.pose = asm.Pose(3.0 * rng.uniform(-1.0, 1.0, 3), random_turn(rng))
    return Linkage(scene, held)


def _pose(rng: np.random.Generator, planar: bool) -> Array:
    if planar:
        half = rng.uniform(-np.pi, np.pi) / 2.0
        return np.array([*rng.uniform(-2.0, 2.0, 2), 0.0, np.cos(half), 0.0, 0.0, np.sin(half)])
    return np.array([*rng.uniform(-2.0, 2.0, 3), *random_turn(rng)])


def _joint(
    rng: np.random.Generator, planar: bool, bodies: list[asm.Body], held: Array, pair: tuple[int, int], name: str
) -> Joint:
    """A joint whose frames lie on each other at the poses that hold, but for what it leaves free."""
    kinds = PLANAR if planar else SPATIAL
    kind = kinds[rng.integers(len(kinds))]
    at = np.array([*rng.uniform(-2.0, 2.0, 2), 0.0 if planar else rng.uniform(-2.0, 2.0)])
    slides = kind in (asm.Prismatic, asm.Cylindrical)
    if planar:
        way = rng.uniform(-np.pi, np.pi)
        z = np.array([np.cos(way), np.sin(way), 0.0]) if kind is asm.Prismatic else np.array([0.0, 0.0, 1.0])
    else:
        z = rotate(random_turn(rng), np.array([0.0, 0.0, 1.0]))
    x = np.cross(z, [0.3, 0.5, 0.8])
    other_at = at + (rng.uniform(-1.0, 1.0) * z if slides else 0.0)
    other_z = z
    other_x = x
    if kind in (asm.Revolute, asm.Cylindrical, asm.Spherical):
        half = rng.uniform(-np.pi, np.pi) / 2.0
        other_x = rotate(np.array([np.cos(half), *(np.sin(half) * z)]), x)
    if kind is asm.Universal:
        other_z, other_x = x, z
    a, b = pair
    frame_a = _frame(bodies[a], held[a], at, z, x)
    frame_b = _frame(bodies[b], held[b], other_at, other_z, other_x)
    joint: Joint = kind(frame_a, frame_b, name)
    return joint


def _frame(body: asm.Body, row: Array, at: Array, z: Array, x: Array) -> Any:
    """A frame of the world as one of a body at a pose."""
    back = row[3:] * [1.0, -1.0, -1.0, -1.0]
    return body.frame(at=rotate(back, at - row[:3]), z=rotate(back, z), x=rotate(back, x))


def _ask(rng: np.random.Generator, joints: list[Joint], held: Array, scene: asm.Assembly) -> None:
    """Drive one freedom or two to what they are, and limit others about it."""
    values = scene.solve(held, max_iterations=0).values
    for joint in rng.permutation(np.array(joints, dtype=object))[: int(rng.integers(1, 4))]:
        name = str(rng.choice(list(joint.freedoms)))
        value = float(values[f"{joint.name}.{name}"])
        freedom = joint.freedom(name)
        if name == "swing":
            continue
        if rng.random() < 0.4:
            freedom.value = value
        else:
            low, high = value - rng.uniform(0.05, 1.0), value + rng.uniform(0.05, 1.0)
            freedom.limits = [(low, high), (low, None), (None, high)][rng.integers(3)]
