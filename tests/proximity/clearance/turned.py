"""Solids that are turned about the z axis: a plug with a conical wall, and a block with its seat."""

from __future__ import annotations

import numpy as np

import assembly as asm
from tests.geometry.recognition.constructions import line, revolved


def turned(*corners):
    """The faces of a polygon (r, z) turned about z, counterclockwise, whose side on the axis sweeps nothing."""
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    profiles = [line(p, q) for p, q in sides if p[0] > 0.0 or q[0] > 0.0]
    return tuple(asm.Face(revolved(*profile, 2.0 * np.pi, 4)) for profile in profiles)


def plug(slope, low, high):
    """A full cone with its apex at the origin, between two heights; its wall is face 1."""
    return turned((0.0, low), (slope * low, low), (slope * high, high), (0.0, high))


def seat(slope, low, high, around):
    """A round block with a conical hole through it, whose apex is the origin; its wall is face 3."""
    return turned((slope * low, low), (around, low), (around, high), (slope * high, high))
