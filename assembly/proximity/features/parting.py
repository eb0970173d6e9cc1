"""The least translation found that parts two bodies, one of which is inside the other one.

Along a unit vector n a translation parts them as soon as it is as long as

    w(n) = max n.x over a - min n.x over b,

and of convex bodies the least w is the least translation. Bernstein coefficients bound both terms from above, and so do
the elementary surfaces on which patches lie; patches on which the lesser bound is higher than a point known are halved
until it is not.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from assembly._record import rows_of
from assembly.distance.bodies.packing import KeptTree
from assembly.distance.bodies.records import (
    NONE,
    PATCH,
    PATCH_SIZE,
    USED,
    body_head_at,
    node_links_at,
    spine_at,
)
from assembly.distance.bodies.spines import CYLINDER, PLANE, SPHERE, TORUS
from assembly.geometry.faces.face import Face
from assembly.geometry.splines import bezier
from assembly.kinematics.pose import rotation_matrix
from assembly.proximity.features.places import body_tree, is_closed

__all__ = ["are_balls", "parting_translation"]

Array = NDArray[np.float64]
Faces = tuple[Face, ...]
# Heights of points closer than this part of the size are one; halvings of all that is left.
_SAME, _HALVINGS = 1e-14, 120
# Patches that are halved at once, at most: where more of a body is as high, its bound is that of its control points.
_MOST = 1000
# Directions from which the least one is searched, and how exactly that and its length are found.
_STARTS, _WAY, _LENGTH = 2, 1e-9, 1e-12
_AROUND = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
_AROUND /= np.linalg.norm(_AROUND, axis=1, keepdims=True)


def are_balls(faces: tuple[Faces, Faces]) -> bool:
    """Whether both bodies are whole balls, of which the least translation is known."""
    return all(is_closed(each) and _spine_kind(body_tree(each), 0) == SPHERE for each in faces)


def _spine_kind(tree: KeptTree, node: int) -> float:
    """The kind of elementary surface that a node is all on; 0 if none."""
    at = int(node_links_at(tree.arrays[2], USED + node).spine)
    return 0.0 if at == NONE else float(spine_at(tree.arrays[1], at).kind)


class _Group(NamedTuple):
    """Patches of the same degrees, and what they lie on.

    nets: (n, p + 1, q + 1, 4); spines: (n, 9) center, axis, and the height of the surface along a unit vector as
    multiples of its cosine and its sine to the axis and a part that is always there, infinite where there is none.
    """

    nets: Array
    spines: Array

    def heights(self, way: Array) -> Array:
        """Heights of the control points along a direction (n, p + 1, q + 1)."""
        return np.asarray(self.nets[..., :3] @ way / self.nets[..., 3])

    def bounds(self, way: Array, heights: Array) -> Array:
        """How high the patches are at most (n,)."""
        cosine = np.abs(self.spines[:, 3:6] @ way)
        sine = np.linalg.norm(np.cross(self.spines[:, 3:6], way), axis=1)
        of_spine = self.spines[:, :3] @ way + self.spines[:, 6] * cosine + self.spines[:, 7] * sine + self.spines[:, 8]
        return np.asarray(np.minimum(heights.max(axis=(1, 2)), of_spine))


def _spine_row(pool: Array, at: int) -> list[float]:
    """A row of `_Group.spines`."""
    if at == NONE:
        return [0.0] * 8 + [np.inf]
    spine = spine_at(pool, at)
    parts = {
        SPHERE: (0.0, 0.0, spine.radius),
        CYLINDER: (spine.half, spine.radius, 0.0),
        TORUS: (0.0, spine.major, spine.radius),
        PLANE: (0.0, spine.half, 0.0),
    }[float(spine.kind)]
    return [*spine.center, *spine.axis, *parts[:2], parts[2] + spine.off]


@lru_cache(maxsize=64)
def _hull_of(faces: Faces) -> tuple[tuple[_Group, ...], Array]:
    """Patches in whose hull a body is, about its center, and normals of its planes.

    Trimmed planes are in the hull of their boundary.
    """
    table, pool, _links, _nodes, nets = body_tree(faces).arrays
    count = int(body_head_at(pool, 0).patches)
    rows = rows_of(PATCH, table[: PATCH_SIZE * count].reshape(-1, PATCH_SIZE))
    found: dict[tuple[int, int], tuple[list[Array], list[list[float]]]] = {}
    normals = []
    for row in rows:
        at = int(row.spine)
        plane = at != NONE and float(spine_at(pool, at).kind) == PLANE
        if plane:
            normals.append(np.array(spine_at(pool, at).axis))
        if not plane or row.trim == NONE:
            shape = int(row.degree_u) + 1, int(row.degree_v) + 1
            size = 4 * shape[0] * shape[1]
            group = found.setdefault(shape, ([], []))
            group[0].append(nets[int(row.net) : int(row.net) + size].reshape(*shape, 4))
            group[1].append(_spine_row(pool, at))
    groups = tuple(_Group(np.array(each), np.array(spines)) for each, spines in found.values())
    return groups, np.array(normals).reshape(-1, 3)


def _farthest(groups: tuple[_Group, ...], way: Array) -> float:
    """An upper bound of the height of a body along a direction, which a point of it comes up to but for rounding."""
    known = most = -np.inf
    for half in range(_HALVINGS):
        heights = [group.heights(way) for group in groups]
        bounds = [group.bounds(way, h) for group, h in zip(groups, heights, strict=True)]
        known = max(known, max(float(h[:, i, j].max()) for h in heights for i in (0, -1) for j in (0, -1)))
        enough = known + _SAME * (1.0 + abs(known))
        keep = [bound > enough for bound in bounds]
        last = half == _HALVINGS - 1 or sum(int(each.sum()) for each in keep) > _MOST
        most = max(most, *(float(b[last | ~k].max(initial=-np.inf)) for k, b in zip(keep, bounds, strict=True)))
        groups = tuple(_halved(group, k, half % 2) for group, k in zip(groups, keep, strict=True) if k.any())
        if last or not groups:
            break
    return max(known, most)


def _halved(group: _Group, keep: NDArray[np.bool_], axis: int) -> _Group:
    """Halves of some of the patches across one direction."""
    halves = bezier.divided(np.moveaxis(group.nets[keep], 1 + axis, 0), 0.5)
    nets = np.concatenate([np.moveaxis(half, 0, 1 + axis) for half in halves])
    return _Group(nets, np.concatenate([group.spines[keep]] * 2))


class _Parting:
    """w(n) of two bodies at poses."""

    def __init__(self, faces: tuple[Faces, Faces], q: Array) -> None:
        self.hulls = [_hull_of(each) for each in faces]
        self.turns = [rotation_matrix(row[3:]) for row in q]
        centers = [np.array(body_head_at(body_tree(each).arrays[1], 0).center) for each in faces]
        a, b = (turn @ center + row[:3] for turn, center, row in zip(self.turns, centers, q, strict=True))
        self.between: Array = a - b

    def length(self, way: Array) -> float:
        """w along a unit vector."""
        a, b = (
            _farthest(hull[0], sign * turn.T @ way)
            for hull, turn, sign in zip(self.hulls, self.turns, (1.0, -1.0), strict=True)
        )
        return a + b + float(way @ self.between)

    def roughly(self, ways: Array) -> Array:
        """What control points say of w along unit vectors (n, 3)."""
        total = ways @ self.between
        for (groups, _), turn, sign in zip(self.hulls, self.turns, (1.0, -1.0), strict=True):
            points = np.concatenate([(nets[..., :3] / nets[..., 3:]).reshape(-1, 3) for nets, _ in groups])
            total = total + (points @ (sign * turn.T @ ways.T)).max(axis=0)
        return np.asarray(total)

    def starts(self) -> Array:
        """Directions to begin with: those around in the axes of both, the normals of planes, from center to center."""
        ways = [_AROUND]
        for (_, normals), turn in zip(self.hulls, self.turns, strict=True):
            ways += [_AROUND @ turn.T, normals @ turn.T, -normals @ turn.T]
        size = float(np.linalg.norm(self.between))
        if size > 0.0:
            ways.append(np.array([self.between, -self.between]) / size)
        each = np.concatenate(ways)
        return np.asarray(each[np.argsort(self.roughly(each), kind="stable")[:_STARTS]])


def _from(start: Array, x: Array) -> Array:
    """The unit vector that a place in the plane across another one stands for."""
    axis = np.eye(3)[int(np.abs(start).argmin())]
    u = np.cross(start, axis)
    u /= np.linalg.norm(u)
    way = start + x[0] * u + x[1] * np.cross(start, u)
    return np.asarray(way / np.linalg.norm(way))


def parting_translation(faces: tuple[Faces, Faces], q: Array) -> Array:
    """The shortest translation found (3,) of the second body after which the two are apart, or touch."""
    bodies = _Parting(faces, q)
    best, least = np.zeros(3), np.inf
    for start in bodies.starts():
        length = bodies.length(start)
        if length < least:
            best, least = start, length
        found = minimize(
            lambda x, start=start: bodies.length(_from(start, x)),
            np.zeros(2),
            method="Nelder-Mead",
            options={"xatol": _WAY, "fatol": _LENGTH * length, "maxiter": 120},
        )
        if float(found.fun) < least:
            best, least = _from(start, found.x), float(found.fun)
    return best * least
