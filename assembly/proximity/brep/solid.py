"""The solid that some faces make: its edges and vertices, found once for all scenes and queries."""

from __future__ import annotations

from functools import lru_cache

from assembly.geometry.faces.face import Face
from assembly.proximity.brep.topology import Topology, topology_of

__all__ = ["is_one_smooth", "solid_of"]


@lru_cache(maxsize=256)
def solid_of(faces: tuple[Face, ...]) -> Topology:
    """Edges and vertices of the solid with these faces."""
    return topology_of(faces)


def is_one_smooth(faces: tuple[Face, ...]) -> bool:
    """Whether the solid is one face that has neither edges nor vertices: a sphere, a torus, a capped wire."""
    if len(faces) > 1:
        return False
    topology = solid_of(faces)
    return not topology.edges and not topology.vertices
