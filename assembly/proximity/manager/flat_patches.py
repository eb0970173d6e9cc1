"""Where flat faces can have extrema, known before Newton's method looks for them.

The least distance of two flat faces is also that of an edge of one of them, and found from there. The distance of an
edge from a flat face is stationary where the edge is level: where its tangent is perpendicular to the normal.
"""

from __future__ import annotations

from assembly._kernel import kernel
from assembly.geometry.vec import dot, matvec, matvec_t
from assembly.proximity.brep.borders import feature_at
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.tree import node_of, three_of
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.manager.continua import kinds_of
from assembly.proximity.manager.overlap import patch_at

__all__ = ["are_flat", "may_be_level"]

# Normals of a flat face differ by rounding alone, by less than this [rad]; cones around them are a few 1e-14 wide.
FLAT = 1e-12
# An edge is taken for level near an element if, by its tangent and curvature there, it is within so many half widths;
# elements turn by 0.2 rad.
BEYOND = 2.0


@kernel(inline=True)
def is_flat(posed, side, e):
    """Whether element e of one body, of a face, is flat."""
    node = node_of(posed.store, posed.trees[side], e)
    return node.cosine > 0.0 and node.sine < FLAT


@kernel(inner=True)
def are_flat(posed, codes, e, d):
    """Whether elements e and d are of two flat faces."""
    kinds = kinds_of(posed, codes)
    return kinds[0] == FACE and kinds[1] == FACE and is_flat(posed, 0, e) and is_flat(posed, 1, d)


@kernel(inner=True)
def may_be_level(posed, codes, e, d):
    """Whether an edge may be level over a flat face near its element, or all along it; True for all other features.

    Elements e and d belong to the features `codes`.
    """
    kinds = kinds_of(posed, codes)
    side = 0 if kinds[0] == EDGE else 1
    element, other = (e, d) if side == 0 else (d, e)
    if kinds[side] != EDGE or kinds[1 - side] != FACE or not is_flat(posed, 1 - side, other):
        return True
    part = patch_at(posed, side, element)
    edge = feature_at(posed.store.table, posed.shells[side], codes[side])
    _p, along, bent = edge_jet(posed.store, edge, part.middle[0])
    n = three_of(node_of(posed.store, posed.trees[1 - side], other).axis)
    turn = posed.pose.rotation
    n = matvec(turn, n) if side == 0 else matvec_t(turn, n)
    lean = abs(dot(along, n))
    return lean <= BEYOND * part.half[0] * abs(dot(bent, n)) or lean * lean <= FLAT * FLAT * dot(along, along)
