"""Faces of two bodies that lie on each other: planes, a shaft in a bore of its radius, a cone in its seat, a ball in a
socket.

No move opens all of what is touching there, so that nothing is proven. It is told by what the faces are exactly
(`geometry/recognition`); which parts of them they have is not asked.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.recognition.forms import Cone, Cylinder, Form, Plane, Sphere, Torus
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.proximity.manifolds.elementary_faces import elementary_faces

__all__ = ["conforms", "lie_on_each_other"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Posed:
    """A face of a body at a pose: x -> turn x + shift.

    Attributes
    ----------
    form : Form
        What its surface is.
    is_outward : bool
        Whether its outward normal points away from its axis or center; of a plane, along `form.normal`.
    size : float
        How far points of the body are from each other at most.
    """

    form: Form
    is_outward: bool
    size: float
    turn: Array
    shift: Array

    def point(self, x: Array) -> Array:
        """A point of the surface's coordinates."""
        return np.asarray(self.turn @ x + self.shift)

    def direction(self, x: Array) -> Array:
        """A direction in them."""
        return np.asarray(self.turn @ x)


def conforms(proof: ClearanceProof, k: int, q: Array, touching: float) -> bool:
    """Whether faces of the bodies of pair k lie on each other at poses q (n, 7), to within a length."""
    turn, shift = proof.relative(k, q)
    size = proof.size(k)
    a, b = (elementary_faces(proof.faces[body]) for body in proof.pairs[k])
    ones = [_Posed(face.form, face.is_outward, size, np.eye(3), np.zeros(3)) for face in a]
    others = [_Posed(face.form, face.is_outward, size, turn, shift) for face in b]
    return any(lie_on_each_other(one, other, touching) for one in ones for other in others)


def lie_on_each_other(one: _Posed, other: _Posed, touching: float) -> bool:
    """Whether the surfaces of two posed faces are one, or touch along a circle, from opposite sides."""
    if isinstance(one.form, Plane) != isinstance(other.form, Plane):
        return False
    if isinstance(one.form, Plane):
        return _fills(one.form, one, other) <= touching
    if one.is_outward == other.is_outward:
        return False
    hollow, full = (other, one) if one.is_outward else (one, other)
    return _fills(hollow.form, hollow, full) <= touching


@singledispatch
def _fills(form: Form, hollow: _Posed, full: _Posed) -> float:
    """How far the surface of the second face is from lying on, or all around in, that of the first one, at most."""
    return np.inf


@_fills.register
def _plane(form: Plane, hollow: _Posed, full: _Posed) -> float:
    if not isinstance(full.form, Plane):
        return np.inf
    sign = 1.0 if hollow.is_outward == full.is_outward else -1.0
    normal = hollow.direction(form.normal)
    off = full.point(full.form.point) - hollow.point(form.point)
    lean = np.linalg.norm(normal + sign * full.direction(full.form.normal))
    return float(abs(off @ normal) + lean * full.size)


@_fills.register
def _cylinder(form: Cylinder, hollow: _Posed, full: _Posed) -> float:
    if isinstance(full.form, Sphere):
        middles = [full.form.center]
    elif isinstance(full.form, Cylinder):
        middles = [full.form.point + height * full.form.axis for height in full.form.heights]
    else:
        return np.inf
    return _off_axis(hollow, form.point, form.axis, full, middles) + abs(form.radius - full.form.radius)


@_fills.register
def _cone(form: Cone, hollow: _Posed, full: _Posed) -> float:
    if not isinstance(full.form, Cone):
        return np.inf
    apex, axis = hollow.point(form.apex), hollow.direction(form.axis)
    if full.direction(full.form.axis) @ axis < 0.0:
        return np.inf
    middles = [full.form.apex + height * full.form.axis for height in full.form.heights]
    radii = np.array(full.form.heights) * np.tan(full.form.half_angle)
    heights = np.array([(full.point(middle) - apex) @ axis for middle in middles])
    off = np.abs(heights * np.tan(form.half_angle) - radii).max()
    return _off_axis(hollow, form.apex, form.axis, full, middles) + float(off)


@_fills.register
def _sphere(form: Sphere, hollow: _Posed, full: _Posed) -> float:
    if not isinstance(full.form, Sphere):
        return np.inf
    off = full.point(full.form.center) - hollow.point(form.center)
    return float(np.linalg.norm(off)) + abs(form.radius - full.form.radius)


@_fills.register
def _torus(form: Torus, hollow: _Posed, full: _Posed) -> float:
    if not isinstance(full.form, Torus):
        return np.inf
    axis, other = hollow.direction(form.axis), full.direction(full.form.axis)
    off = np.linalg.norm(full.point(full.form.center) - hollow.point(form.center))
    lean = np.linalg.norm(np.cross(axis, other)) * (full.form.major + full.form.minor)
    return float(off + lean) + abs(form.major - full.form.major) + abs(form.minor - full.form.minor)


def _off_axis(hollow: _Posed, point: Array, axis: Array, full: _Posed, middles: list[Array]) -> float:
    """How far points on the axis of a face are from the axis of another one, at most."""
    axis = hollow.direction(axis)
    offs = [full.point(middle) - hollow.point(point) for middle in middles]
    return max(float(np.linalg.norm(off - (off @ axis) * axis)) for off in offs)
