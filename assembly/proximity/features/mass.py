"""What a body weighs: volume, area, center of mass and inertia of what its faces enclose.

With p the place from a center and n the outward normal, Gauss' theorem makes of integrals over the body such over its
faces: of 1 (the volume) of p_x n_x, of p the integral of p (p . n) / 4, and of p p^T that of p p^T (p . n) / 5.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly._read_only import ReadOnlyArrays
from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.proximity.brep.solid import solid_of
from assembly.proximity.brep.topology import Edge, Topology, topology_of
from assembly.proximity.features.body_distance import DistanceStatus, distance
from assembly.proximity.features.places import pieces_of

__all__ = ["MassProperties", "mass_properties"]

Array = NDArray[np.float64]
# How near the distance of two pieces has to be known, in parts of the body's size: whether it is zero, and pieces that
# are apart by much, as most are, tell so at once.
_APART = (1e-2, 1e-5, 1e-9)
# Gaps of files, in parts of the body's size: what is open is looked at with these one after the other, up to what the
# writer of STEP files sews. How much the volume may be wrong by gaps is told.
_GAPS = (1e-5, 1e-4)
# Places of an edge at which the curves of its two faces are compared.
_PLACES = 17
# Steps of Gauss and Newton to the nearest point of a curve.
_STEPS = 5
# Where xx, yy, zz, xy, xz, yz stand in a symmetric matrix.
_SECOND = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])


@dataclass(frozen=True, eq=False)
class MassProperties(ReadOnlyArrays):
    """What a body weighs, in its coordinates.

    Attributes
    ----------
    density : float
        Mass a volume.
    volume, area : float
        Of what the faces enclose, and of the faces.
    center_of_mass : (3,)
    inertia : (3, 3)
        About the center of mass, along the axes of the body: density times the integral of |p|^2 I - p p^T.
    volume_error : float
        By how much the volume may be wrong: what is left of quadrature, and gaps between the faces, measured at 17
        places of every edge. Rounding of sums is not in it.
    """

    density: float
    volume: float
    area: float
    center_of_mass: Array
    inertia: Array
    volume_error: float

    @property
    def mass(self) -> float:
        """Density times volume."""
        return self.density * self.volume


def mass_properties(name: str, faces: tuple[Face, ...], density: float) -> MassProperties:
    """What the body of this name, with these faces, weighs.

    Raises
    ------
    InputError
        Faces that enclose nothing: none, an edge that one face has for itself, normals that look inward; or pieces
        that meet, or lie in each other other than as voids.
    """
    if not faces:
        raise InputError(f"body {name!r} has no shape; expected faces that enclose a volume")
    solid = _closed(faces)
    if not solid.is_closed:
        open_edge = next(edge for edge in solid.edges if edge.face_b is None)
        face = solid.faces[open_edge.face_a].name or f"face {open_edge.face_a + 1}"
        raise InputError(f"body {name!r} is open: an edge of {face!r} has no other face; expected a closed body")
    fault = _fault(faces)
    if fault:
        raise InputError(f"body {name!r} {fault}")
    unit = _of_density_one(faces)
    return MassProperties(
        density, unit.volume, unit.area, unit.center_of_mass, density * unit.inertia, unit.volume_error
    )


@lru_cache(maxsize=256)
def _fault(faces: tuple[Face, ...]) -> str:
    """Why the volumes of a body's pieces do not add up to that of the body, and what is expected; nothing if they do.

    A piece that lies in an even number of others is material, with normals that look outward; one in an odd number is
    a void, whose normals look into it.
    """
    shells = pieces_of(_closed(faces))
    volumes = [_of_density_one(shell).volume for shell in shells]
    inside = [0] * len(shells)
    for i, k in combinations(range(len(shells)), 2):
        first, second = _outward(shells[i], volumes[i]), _outward(shells[k], volumes[k])
        for apart in _APART:
            found = distance(first, second, tolerance=apart * _size(faces))
            if found.lower > 0.0 and found.converged:
                break
        if not found.lower > 0.0:
            return (
                f"has pieces that meet, with {_name(shells[i])} and {_name(shells[k])}; expected pieces that are apart"
            )
        if found.status is DistanceStatus.ENCLOSED:
            inside[i if abs(volumes[i]) < abs(volumes[k]) else k] += 1
    for shell, volume, around in zip(shells, volumes, inside, strict=True):
        least = _of_density_one(shell).volume_error
        if around % 2 and not volume < -least:
            return f"has a piece within another one, with {_name(shell)}; expected a void there, by normals into it"
        if around % 2 == 0 and not volume > least:
            text = f"has a piece with a volume of {volume:g}, with {_name(shell)}"
            return f"{text}; expected a positive one, by normals that look outward"
    return ""


@lru_cache(maxsize=256)
def _closed(faces: tuple[Face, ...]) -> Topology:
    """The topology of a body, with the least of gaps between edges that are one with which it is closed, if it is."""
    solid = solid_of(faces)
    if solid.is_closed:
        return solid
    size = _size(faces)
    wider = (topology_of(faces, gap * size) for gap in _GAPS)
    return next((found for found in wider if found.is_closed), solid)


def _outward(shell: tuple[Face, ...], volume: float) -> list[Face]:
    """The faces of a piece as those of a body that it would be by itself."""
    if volume > 0.0:
        return list(shell)
    turned = [copy(face) for face in shell]
    for face in turned:
        face.reversed = not face.reversed
    return turned


def _name(shell: tuple[Face, ...]) -> str:
    return repr(shell[0].name or "a face without a name")


def _size(faces: tuple[Face, ...]) -> float:
    boxes = [face.surface.bounding_box() for face in faces]
    return float(np.linalg.norm(np.max([box[1] for box in boxes], axis=0) - np.min([box[0] for box in boxes], axis=0)))


@lru_cache(maxsize=256)
def _of_density_one(faces: tuple[Face, ...]) -> MassProperties:
    boxes = [face.surface.bounding_box() for face in faces]
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    center = 0.5 * (low + high)
    found = [(face.sign, *face.integrals(center)) for face in faces]
    volume = sum(sign * float(total.flux.sum()) for sign, total, _ in found) / 3.0
    first = sum((sign * total.first for sign, total, _ in found), np.zeros(3)) / 4.0
    second = sum((sign * total.second for sign, total, _ in found), np.zeros(6))[_SECOND] / 5.0
    area = sum(float(total.area) for _, total, _ in found)
    offset = first / volume if volume else np.zeros(3)
    about = second - volume * np.outer(offset, offset)
    doubt = sum(float(doubt.flux.sum()) for _, _, doubt in found) / 3.0
    doubt += _gaps(_closed(faces)) * float(np.linalg.norm(high - center)) / 3.0
    return MassProperties(1.0, volume, area, center + offset, np.trace(about) * np.eye(3) - about, doubt)


def _gaps(solid: Topology) -> float:
    """Area of the gaps between faces, at most: lengths of edges times how far their curves are apart."""
    return sum(edge.length * _gap(solid, edge) for edge in solid.edges if edge.face_b is not None)


def _gap(solid: Topology, edge: Edge) -> float:
    """How far the curves of an edge's two faces are apart, at places of the first one."""
    assert edge.face_b is not None and edge.curve_b is not None
    face, other = solid.faces[edge.face_a], solid.faces[edge.face_b]
    curve, others = face.boundary[edge.curve_a], other.boundary[edge.curve_b]
    t = np.linspace(*curve.domain, _PLACES)
    at, _ = _in_space(face, curve, t)
    # Parameters of the other curve are known to first order; its nearest points are found from there.
    guess = edge.map_b[0] + edge.map_b[1] * t
    is_ring = edge.start == edge.end
    nearest = np.full(len(at), np.inf)
    for _ in range(_STEPS):
        guess = _within(others, guess, is_ring)
        place, slope = _in_space(other, others, guess)
        nearest = np.minimum(nearest, np.linalg.norm(at - place, axis=1))
        speed = np.maximum(np.einsum("ij,ij->i", slope, slope), 1e-300)
        guess = guess + np.einsum("ij,ij->i", at - place, slope) / speed
    return float(nearest.max())


def _within(curve: NurbsCurve, t: Array, is_ring: bool) -> Array:
    """Parameters in the domain of a curve; of a ring they go on at its other end beyond rounding."""
    low, high = curve.domain
    slack = 1e-6 * (high - low)
    inside = np.clip(t, low, high)
    return np.where(np.abs(t - inside) > slack, low + np.mod(t - low, high - low), inside) if is_ring else inside


def _in_space(face: Face, curve: NurbsCurve, t: Array) -> tuple[Array, Array]:
    """Points of a boundary curve in space, and their derivatives."""
    place, slope = curve.evaluate(t, 1)
    (u0, u1), (v0, v1) = face.surface.domain
    u = place[:, 0] if face.surface.closed[0] else np.clip(place[:, 0], u0, u1)
    v = place[:, 1] if face.surface.closed[1] else np.clip(place[:, 1], v0, v1)
    point, along_u, along_v = face.surface.evaluate(u, v, 1)
    return point, slope[:, :1] * along_u + slope[:, 1:] * along_v
