"""Pairs of bodies at poses, and what a proof makes of them."""

from __future__ import annotations

from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.clearance.proof import ClearanceProof
from tests.validation.clearance_scenes import clear_start, start, way

UPRIGHT = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


def faces_of(shape):
    """The faces that the library has of a shape."""
    return tuple(side.face for side in asm.Body("body", shape).faces)


def proof_of(a, b, minimum=0.0):
    """The proof of a pair of shapes."""
    return ClearanceProof([faces_of(a), faces_of(b)], [(0, 1)], [minimum])


def poses(b, a=UPRIGHT):
    """Poses of both bodies, rows."""
    return np.array([a, b], dtype=float)


def at(x, y, z, turn=None):
    """A pose at a place, turned or upright."""
    return np.r_[x, y, z, [1.0, 0.0, 0.0, 0.0] if turn is None else turn.as_quat(scalar_first=True)]


def moved(pose, shift=(0.0, 0.0, 0.0), turn=None):
    """A pose after a turn about its origin and a translation."""
    turned = pose[3:] if turn is None else (turn * quaternion(pose)).as_quat(scalar_first=True)
    return np.r_[pose[:3] + shift, turned]


def quaternion(pose):
    return Rotation.from_quat(pose[3:], scalar_first=True)


def direction(rng):
    """A random unit vector."""
    way = rng.normal(size=3)
    return way / np.linalg.norm(way)


@cache
def start_of(number):
    """A random pair of parts, judged: many tests ask for the same."""
    return start(np.random.default_rng([21, number]))


@cache
def way_of(number):
    """A start whose parts are apart, and a way from it."""
    rng = np.random.default_rng([20, number])
    begin = clear_start(rng)
    return begin, way(rng, begin)
