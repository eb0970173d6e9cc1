"""Directions that separate two nodes at a pose, or at both ends of a way at once.

A plane that separates two nodes at both ends of a way separates them along the chord. So the direction sought is the
one whose smaller gap, of those at both ends, is largest: the direction between a and the hull of b at both poses.
Directions that cost less are tried before it.
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.distance.enclosures.gjk import APART, ConvexSet, gjk
from assembly.geometry.vec import add, dot, matvec, neg, scale, sub
from assembly.kinematics.motion import IDENTITY
from assembly.proximity.clearance.halve import vector
from assembly.proximity.clearance.records import GUIDES, node_at, pair_proof_at
from assembly.proximity.clearance.separation import (
    is_cell,
    is_round,
    is_wire,
    normal_of,
    placed,
    separation,
    write_corners,
)

# The relative accuracy of the distance to which GJK seeks the direction between hulls.
ROUGHLY = 1e-3
# A unit direction, and the gaps of two nodes along it at both ends of a way; `before` is infinite without a sweep.
Direction = namedtuple("Direction", "n before after")


@kernel(inline=True)
def lesser(direction):
    """The lesser of both gaps."""
    return min(direction.before, direction.after)


@kernel(inner=True)
def along(forest, nodes, way, n):
    """The gaps of two nodes along a unit direction."""
    after = separation(forest, nodes.a, nodes.b, way.after, n)
    before = separation(forest, nodes.a, nodes.b, way.before, n) if way.swept else math.inf
    return Direction(n, before, after)


@kernel(inline=True)
def better(forest, nodes, way, m, found):
    """The direction of m, which may have any length, if its lesser gap is larger than that of `found`; else `found`."""
    length = math.sqrt(dot(m, m))
    if not length > 0.0:
        return found
    other = along(forest, nodes, way, scale(1.0 / length, m))
    return other if lesser(other) > lesser(found) else found


@kernel(inner=True)
def of_boxes(forest, nodes, way, middle, found, enough):
    """The best of one found and of the axes of two boxes, toward the middle of b; stops at the first above `enough`."""
    for i in range(6):
        if i < 3:
            m = vector(node_at(forest.nodes, nodes.a).axes[i])
        else:
            m = matvec(way.after.rotation, vector(node_at(forest.nodes, nodes.b).axes[i - 3]))
        found = better(forest, nodes, way, neg(m) if dot(m, middle) < 0.0 else m, found)
        if lesser(found) > enough:
            break
    return found


@kernel(inner=True)
def of_hulls(forest, nodes, way, found, work):
    """The better of `found` and the direction between a and the hull of b at both poses; whether the hulls overlap."""
    count_a = write_corners(forest, nodes.a, IDENTITY, work[0], 0)
    count_b = write_corners(forest, nodes.b, way.after, work[1], 0)
    if way.swept:
        count_b += write_corners(forest, nodes.b, way.before, work[1], count_b)
    hull_a, hull_b = ConvexSet(work[0], 0, count_a, -1.0), ConvexSet(work[1], 0, count_b, -1.0)
    how, v, _count = gjk(4, hull_a, hull_b, neg(found.n), math.inf, ROUGHLY, work[2])
    if how != APART:
        return found, True
    return better(forest, nodes, way, neg(v), found), False


@kernel(inner=True)
def of_normals(forest, front, nodes, way, found):
    """The best of `found`, of the normals of contacts, and of the normals of cells in both senses.

    Where hulls almost touch, their nearest points do not determine a direction well enough.
    """
    guides = pair_proof_at(front.pair, 0).guides
    for i in range(GUIDES):
        found = better(forest, nodes, way, vector(guides[i]), found)
    for i in range(2):
        if is_cell(forest, nodes.a if i == 0 else nodes.b):
            m = normal_of(forest, nodes.a) if i == 0 else matvec(way.after.rotation, normal_of(forest, nodes.b))
            found = better(forest, nodes, way, m, found)
            found = better(forest, nodes, way, neg(m), found)
    return found


@kernel(inner=True)
def best_direction(forest, front, nodes, way, hint, needed):
    """A direction with a large lesser gap, and whether hulls overlap. Stops at the first above `needed` and the sag."""
    enough = needed + way.sag
    found = Direction(hint, -math.inf, -math.inf)
    if dot(hint, hint) > 0.5:
        found = along(forest, nodes, way, hint)
        if lesser(found) > enough:
            return found, False
    one, other = node_at(forest.nodes, nodes.a), node_at(forest.nodes, nodes.b)
    middle = sub(placed(way.after, vector(other.center)), vector(one.center))
    if way.swept:
        middle = scale(0.5, add(middle, sub(placed(way.before, vector(other.center)), vector(one.center))))
    found = better(forest, nodes, way, middle, found)
    if lesser(found) > enough:
        return found, False
    cells = is_cell(forest, nodes.a) and is_cell(forest, nodes.b)
    if not cells and not is_round(forest, nodes.a) and not is_round(forest, nodes.b):
        return of_boxes(forest, nodes, way, middle, found, enough), False
    found, overlap = of_hulls(forest, nodes, way, found, front.work)
    if lesser(found) > enough:
        return found, False
    # The corners of a wire are those of its spine: wires may overlap where these hulls do not.
    overlap = overlap or is_wire(forest, nodes.a) or is_wire(forest, nodes.b)
    return of_normals(forest, front, nodes, way, found), cells and overlap
