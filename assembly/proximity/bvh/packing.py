"""Trees of facets as kernels read them (`proximity/bvh/tree.py`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from assembly._record import rows_of
from assembly.errors import positive
from assembly.proximity.bvh import tree as layout
from assembly.proximity.bvh.facet_tree import FacetTree

__all__ = ["pack_tree"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# Rounding of a center and of half widths.
_BOUNDS_ROUNDING = 4.5e-16


def pack_tree(tree: FacetTree, scale: float, table_at: int = 0, pool_at: int = 0) -> tuple[Table, Array, int]:
    """The records of a tree.

    Parameters
    ----------
    tree : FacetTree
    scale : float
        Lengths are divided by it; parameters are not.
    table_at, pool_at : int
        Where the arrays will stand in a larger table and pool: offsets in the records are absolute.

    Returns
    -------
    table, pool : arrays
        To be appended there.
    offset : int
        Of the tree's header in the table.
    """
    factor = 1.0 / positive("scale", scale)
    nodes = tree.nodes
    count, elements = len(nodes.child), len(tree.feature)
    table = np.zeros(layout.TREE + layout.NODE_INTS * count, dtype=np.int64)
    pool = np.zeros(layout.NODE * count + layout.ELEMENT * elements)
    header = layout.tree_at(table, 0)
    header.nodes, header.elements = count, elements
    header.node_table = table_at + layout.TREE
    header.node_pool, header.element_pool = pool_at, pool_at + layout.NODE * count
    links = rows_of(layout.NODE_LINKS, table[layout.TREE :].reshape(count, layout.NODE_INTS))
    links.child = nodes.child
    leaf = nodes.child < 0
    links.feature = -1
    links.feature[leaf] = tree.feature[-1 - nodes.child[leaf]]
    bounds = rows_of(layout.NODE_BOUNDS, pool[: layout.NODE * count].reshape(count, layout.NODE))
    center = 0.5 * factor * (nodes.low + nodes.high)
    half = 0.5 * factor * (nodes.high - nodes.low)
    half += _BOUNDS_ROUNDING * (np.abs(center) + 2.0 * half)
    bounds.center, bounds.half, bounds.axis = center, half, nodes.axis
    full = nodes.half_angle >= np.pi
    bounds.cosine = np.where(full, -1.0, np.cos(nodes.half_angle))
    bounds.sine = np.where(full, 0.0, np.sin(nodes.half_angle))
    bounds.radius = factor * nodes.radius + 4.0 * _BOUNDS_ROUNDING * np.linalg.norm(np.abs(center) + half, axis=1)
    box = tree.parameters
    rows = rows_of(layout.ELEMENT_DTYPE, pool[layout.NODE * count :].reshape(elements, layout.ELEMENT))
    rows.middle = 0.5 * (box[:, ::2] + box[:, 1::2])
    rows.half = 0.5 * (box[:, 1::2] - box[:, ::2])
    rows.feature = tree.feature
    rows.node[-1 - nodes.child[leaf]] = np.flatnonzero(leaf)
    return table, pool, table_at
