"""Shapes that are equal: what is made once for faces serves all that have the same numbers, of other bodies and scenes.

Whoever builds a scene again, or gives two bodies faces that were made by the same calls, has other objects of the same
content. What is found of faces and kept, trees of cells or of facets, is found of the first of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

from assembly.geometry.faces.face import Face

__all__ = ["first_equal"]

# Shapes that are known at a time.
KNOWN = 512


class _Content:
    """Faces that are equal where their numbers and names are."""

    def __init__(self, faces: tuple[Face, ...]) -> None:
        self.faces = faces
        digest = blake2b(digest_size=32)
        for face in faces:
            for part in _parts(face):
                digest.update(part)
        self._digest = digest.digest()

    def __hash__(self) -> int:
        return hash(self._digest)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Content) and self._digest == other._digest


def _parts(face: Face) -> Iterator[bytes]:
    """All that a face is made of, numbers and names, each behind its size."""
    surface, has_loops = face.surface, (face.outer is not None, len(face.holes))
    # Without loops the boundary is the edge of the surface, which nobody may have asked for yet.
    curves = face.boundary if any(has_loops) else ()
    chains = [(chain.start, chain.stop) for chain in face.chains] if any(has_loops) else []
    yield repr((face.name, face.reversed, surface.degree, has_loops, chains, [c.degree for c in curves])).encode()
    arrays: list[NDArray[np.float64]] = [surface.control_points, surface.weights, *surface.knots]
    for curve in curves:
        arrays += [curve.control_points, curve.weights, curve.knots]
    for array in arrays:
        yield repr(array.shape).encode()
        yield np.ascontiguousarray(array).tobytes()


@lru_cache(maxsize=KNOWN)
def _first(content: _Content) -> tuple[Face, ...]:
    return content.faces


@lru_cache(maxsize=KNOWN)
def first_equal(faces: tuple[Face, ...]) -> tuple[Face, ...]:
    """The faces of the first shape that was asked for with the same content."""
    return _first(_Content(faces))
