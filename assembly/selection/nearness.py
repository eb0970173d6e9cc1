"""How far points are from trimmed faces and from edges, with a proof: by the search for the distance of two bodies.

A point is a body of one sheet of no size.
"""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly._turn import in_child
from assembly.distance.bodies.packing import KeptTree, tree_of, tree_of_boundary
from assembly.distance.bodies.query import bodies_apart
from assembly.geometry.faces.face import Face, whole_face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.selection.selection import checked_place

__all__ = ["distance_to_boundary", "distance_to_face", "finer"]

Array = NDArray[np.float64]
# Parts of the size of what is looked at that the two bounds of a distance are to be apart at most.
_EXACT = 1e-12
# Parts of a face that are looked at for that; a face of two hundred spans takes some hundreds, in a tenth of a
# millisecond. All of them, in 50 ms, are spent where nearest points are a circle of a cone or of a turned curve.
_BUDGET = 20_000


@cache
def _point_tree() -> KeptTree:
    """The origin."""
    ends = [0.0, 0.0, 1.0, 1.0]
    return tree_of((whole_face(NurbsSurface(np.zeros((2, 2, 3)), (ends, ends), (1, 1))),))


in_child(_point_tree.cache_clear)


def finer(breaks: Array, surface: NurbsSurface) -> Array:
    """Breaks of a curve in (u, v), and as many more between them as the surface has spans: it may pass all of these."""
    spans = max(4, sum(len(at) - 1 for at in surface.breaks()))
    parts = [np.linspace(a, b, spans + 1) for a, b in pairwise(breaks)]
    return np.unique(np.concatenate(parts))


def distance_to_face(face: Face, point: ArrayLike) -> float:
    """How far a point (3,) is from a face, within its boundary: that of the nearest point of it that is known.

    It is proven that no point is nearer by more than 1e-12 of the size; by more than some 1e-6 of it where nearest
    points are not single ones, and the face is neither a plane nor a cylinder, sphere or torus.
    """
    return _nearest(tree_of((face,)), face, point)


def distance_to_boundary(face: Face, curve: int, point: ArrayLike) -> float:
    """The same of a boundary curve of a face, by its number."""
    return _nearest(tree_of_boundary(face, curve), face, point)


def _nearest(tree: KeptTree, face: Face, point: ArrayLike) -> float:
    place = checked_place("point", point)
    q = np.zeros((2, 7))
    q[:, 3], q[1, :3] = 1.0, place
    low, high = face.surface.bounding_box()
    # Coordinates, too: their rounding is what doubles let be known.
    size = max(float(np.abs(each).max()) for each in (low, high, place)) + 1e-150
    return bodies_apart(tree, _point_tree(), q, _EXACT * size, _BUDGET).upper
