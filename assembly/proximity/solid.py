"""The solid that some faces make: its edges and vertices, found once, and what its features are called."""

from __future__ import annotations

from functools import lru_cache

from assembly.geometry.face import Face
from assembly.proximity.topology import Topology, topology_of

__all__ = ["feature_name", "solid_of"]


@lru_cache(maxsize=256)
def solid_of(faces: tuple[Face, ...]) -> Topology:
    """Edges and vertices of the solid with these faces."""
    return topology_of(faces)


def feature_name(solid: Topology, number: int) -> str:
    """What a feature of a solid is called: faces come first, then edges, then vertices."""
    faces, edges = len(solid.faces), len(solid.edges)
    if number < faces:
        return f"face {solid.faces[number].name or number + 1!r}"
    if number < faces + edges:
        edge = solid.edges[number - faces]
        beside = [edge.face_a] if edge.face_b is None else [edge.face_a, edge.face_b]
        return f"edge {number - faces + 1} of {' and '.join(str(solid.faces[k].name or k + 1) for k in beside)}"
    return f"vertex {number - faces - edges + 1}"
