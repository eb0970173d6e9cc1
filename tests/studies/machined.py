"""Machined parts that tests put together: solids of revolution, and how far bodies moved."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle
from tests.geometry.recognition.constructions import circle_profile, line, revolved


def _wall(profile, name):
    """What a part of a profile sweeps; the profile has the material on its left."""
    return asm.Face(revolved(*profile, 2.0 * np.pi, 4), name=name)


def _ring(z, radii, is_up, name):
    """A flat face between two radii, or a disc."""
    inner, outer = min(radii), max(radii)
    holes = [circle(inner)] if inner > 0.0 else []
    flat = asm.shapes.trimmed_plane([circle(outer)], [[hole] for hole in holes])
    surface = flat.surface.transformed(np.eye(3), (0.0, 0.0, z))
    return asm.Face(surface, flat.outer, flat.holes, name=name, reversed=not is_up)


def turned_part(corners):
    """The solid that a closed polygon of points (rho, z), counterclockwise, sweeps around z."""
    faces = []
    for k, ((r, z), (s, y)) in enumerate(pairwise([*corners, corners[0]])):
        if r == s == 0.0:
            continue
        if z == y:
            faces.append(_ring(z, (r, s), s < r, f"face {k}"))
        else:
            faces.append(_wall(line((r, z), (s, y)), f"face {k}"))
    return faces


def bolt(radius, length, head, high):
    """A shank from z = -length to 0, and a head over it."""
    return turned_part([(0, -length), (radius, -length), (radius, 0), (head, 0), (head, high), (0, high)])


def socket(radius, outer, depth):
    """A block with half a sphere in its top, z = 0."""
    faces = turned_part([(0, -depth), (outer, -depth), (outer, 0), (radius, 0)])[:3]
    profile = circle_profile((0.0, 0.0), radius, -0.5 * np.pi, 0.5 * np.pi, 1)
    return [*faces, asm.Face(revolved(*profile, 2.0 * np.pi, 4), name="cavity", reversed=True)]


def retaining_ring(radius, outer, angle):
    """A ring that holds a ball in its socket, from the ball's equator up to an angle of latitude."""
    high, hole = radius * np.sin(angle), radius * np.cos(angle)
    faces = turned_part([(radius, 0), (outer, 0), (outer, high), (hole, high)])[:3]
    profile = circle_profile((0.0, 0.0), radius, 0.0, angle, 1)
    return [*faces, asm.Face(revolved(*profile, 2.0 * np.pi, 4), name="seat", reversed=True)]


def disturbed(rng, pose, way, angle):
    """A pose (7,) moved by a way in any direction and turned about any axis."""
    axis, along = rng.normal(size=(2, 3))
    turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)) * Rotation.from_quat(pose[3:], scalar_first=True)
    return np.r_[pose[:3] + way * along / np.linalg.norm(along), turn.as_quat(scalar_first=True)]


def moved(before, after, extents):
    """How far a corner of a box (3,) about the origin goes from one pose to another, at most."""
    corners = 0.5 * np.array(list(product((-1.0, 1.0), repeat=3))) * np.asarray(extents)
    at = [Rotation.from_quat(q[3:], scalar_first=True).apply(corners) + q[:3] for q in (before, after)]
    return float(np.linalg.norm(at[1] - at[0], axis=1).max())
