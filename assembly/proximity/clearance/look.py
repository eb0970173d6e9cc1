"""A look at a pair of bodies: a proof that they are clear at a pose and on the way to it, or that they cross."""

from __future__ import annotations

import math

from assembly._kernel import kernel
from assembly.geometry.vec import matvec_t, neg, sub
from assembly.kinematics.motion import inverse_pose
from assembly.proximity.clearance.directions import best_direction
from assembly.proximity.clearance.front import (
    Limits,
    Parted,
    aim_of,
    ask_again,
    expiry_of,
    goes_on,
    is_over,
    keep,
    last_pose,
    leave_off,
    origin_of,
    put_off,
    put_waiting,
    remember,
    replace_front,
    spines_stay_apart,
)
from assembly.proximity.clearance.halve import halve, put, vector
from assembly.proximity.clearance.records import (
    BY_BORE_B,
    BY_PLANE,
    BY_PLANE_OF_B,
    BY_SPINES,
    CLEAR,
    CROSSING,
    LEFT_OPEN,
    NO_ROOM,
    NONE,
    ON_ITS_WAY,
    OPEN,
    SPENT,
    UNSWEPT,
    counts_at,
    links_at,
    node_at,
    nodes_at,
    pair_proof_at,
    parted_at,
)
from assembly.proximity.clearance.separation import is_cell, is_round, is_wire, most_in_bore, normal_of, placed
from assembly.proximity.clearance.sleeves import best_bore, gap_of
from assembly.proximity.clearance.spines import spine_gap
from assembly.proximity.clearance.stab import crossing_of
from assembly.proximity.clearance.way import pose_at, sag_of, stays_apart, way_of

# The most pairs for which directions are sought over a whole way: beyond that, halving it is cheaper. The shortest part
# of a way.
SWEPT_BUDGET, SHORTEST = 1000, 1.0 / 256.0
# What was found of two nodes: no proof, proven apart, or apart at both ends of a way too long to prove it in between.
NOT_PARTED, ARE_PARTED, NEED_SHORTER = 0, 1, 2
# The clock is read once for so many pairs for which directions are sought.
SOUGHT_AT_ONCE = 8


@kernel(inner=True)
def part_wires(forest, front, way, nodes, needed):
    """Whether the distance of their spines parts two pieces of wires."""
    pair, spines = pair_proof_at(front.pair, 0), Parted(nodes.a, nodes.b, BY_SPINES)
    gap, at = spine_gap(forest, spines, way.after, (0.0, 0.0, 0.0))
    before = math.inf
    if way.swept and gap - needed > -pair.slimmer:
        before = spine_gap(forest, spines, way.before, at)[0] - needed
    if not spines_stay_apart(forest, front, spines, way, needed, (before, gap - needed)):
        return False
    keep(front, spines, at, pair.travelled + way.moved + gap - needed + pair.slimmer)
    return True


@kernel(inner=True)
def part_by_carried(forest, front, way, nodes, n, needed):
    """Whether a plane that moves along with b parts two nodes all the way: along n at the end, or a normal of b.

    Where b turns, a plane that stays between the two is as wide as b's face, which turns, lets it be; and the face is
    halved until its parts are so narrow. One that turns with the face has room for all of it.
    """
    by_plane, normals = Parted(nodes.a, nodes.b, BY_PLANE_OF_B), is_cell(forest, nodes.b)
    for i in range(3 if normals else 1):
        m = matvec_t(way.after.rotation, n) if i == 0 else normal_of(forest, nodes.b)
        m = neg(m) if i == 2 else m
        after = gap_of(forest, by_plane, way.after, m) - needed
        if not after > 0.0:
            continue
        before = gap_of(forest, by_plane, way.before, m) - needed
        if stays_apart(forest, by_plane, way, m, (before, after)):
            keep(front, by_plane, m, pair_proof_at(front.pair, 0).travelled + way.moved + after)
            return True
    return False


@kernel(inner=True)
def part_nodes(forest, front, way, nodes, hint, needed):
    """Seek a proof that two nodes are apart: what was found, the direction, both gaps, and whether hulls overlap."""
    found, overlap = best_direction(forest, front, nodes, way, hint, needed)
    n, gaps = found.n, (found.before - needed, found.after - needed)
    travelled = pair_proof_at(front.pair, 0).travelled + way.moved
    if stays_apart(forest, nodes, way, n, gaps):
        keep(front, nodes, n, travelled + gaps[1])
        return ARE_PARTED, n, gaps, overlap
    if is_wire(forest, nodes.a) and is_wire(forest, nodes.b):
        if part_wires(forest, front, way, nodes, needed):
            return ARE_PARTED, n, gaps, overlap
    elif way.swept and way.factor > 0.0 and part_by_carried(forest, front, way, nodes, n, needed):
        return ARE_PARTED, n, gaps, overlap
    how, room = best_bore(forest, nodes.a, nodes.b, way.after)
    if how != BY_PLANE and room > needed:
        inside = Parted(nodes.a, nodes.b, how)
        at_start = gap_of(forest, inside, way.before, n) - needed if way.swept else math.inf
        if stays_apart(forest, inside, way, n, (at_start, room - needed)):
            keep(front, inside, n, expiry_of(inside, travelled, room - needed))
            return ARE_PARTED, n, gaps, overlap
        if at_start > 0.0 and is_round(forest, nodes.a if how == BY_BORE_B else nodes.b):
            # Round nodes are exact: smaller nodes prove no more.
            return NEED_SHORTER, n, gaps, overlap
    return NOT_PARTED, n, gaps, overlap


@kernel(inline=True)
def extent(forest, k):
    """The radius of a ball around a node; of a cell without its thickness, as halving makes no wire thinner."""
    node = node_at(forest.nodes, k)
    return node.radius - node.rho if is_cell(forest, k) else node.radius


@kernel(inner=True)
def is_halved_first(forest, a, b, short):
    """Whether a is halved, not b, if their gap is too small by `short`; and whether by length or by chord error.

    The larger node is halved. Of two cells that only their radii keep from being separated, it is the one with the
    larger `reach`. A round node, which is exact, is not halved as long as the other one could be finer. Of two wires it
    is the longer piece: once both are short, the distance of their spines separates them.
    """
    if is_wire(forest, a) and is_wire(forest, b):
        return extent(forest, a) > extent(forest, b), True
    round_a, round_b = is_round(forest, a), is_round(forest, b)
    cell_a, cell_b = is_cell(forest, a), is_cell(forest, b)
    one, other = node_at(forest.nodes, a), node_at(forest.nodes, b)
    if cell_a and cell_b:
        if one.reach + other.reach >= 0.5 * short:
            return one.reach > other.reach, False
        return extent(forest, a) > extent(forest, b), True
    if round_b and not round_a and (not cell_a or one.reach >= 0.25 * short + 2.0 * one.pad):
        return True, False
    if round_a and not round_b and (not cell_b or other.reach >= 0.25 * short + 2.0 * other.pad):
        return False, False
    # A box is replaced by its children before a cell is halved.
    if cell_a or cell_b:
        return cell_b, True
    return one.radius > other.radius, True


@kernel(inline=True)
def fineness(forest, k):
    """How much tighter the nodes below node k could still be."""
    node = node_at(forest.nodes, k)
    return node.reach if is_cell(forest, k) else node.radius


@kernel(inner=True)
def is_too_long(forest, way, nodes, gaps):
    """Whether nodes that are clear at the end of a way need a shorter way, rather than smaller nodes."""
    before, after = gaps
    if not way.swept or not after > 0.0:
        return False
    small = extent(forest, nodes.a) + extent(forest, nodes.b) < way.moved
    finer = fineness(forest, nodes.a) + (0.0 if is_round(forest, nodes.b) else fineness(forest, nodes.b))
    return small or (before > 0.0 and finer < sag_of(way, forest, nodes.b) - min(after, before))


@kernel(inner=True)
def is_held(forest, wall, k, pose):
    """Whether a box is in the bore of a wall with its middle: its parts may be, all of them, and exactly."""
    bore = node_at(forest.nodes, wall)
    if not bore.bore > 0.0 or is_cell(forest, k) or is_round(forest, k):
        return False
    d = sub(placed(pose, vector(node_at(forest.nodes, k).center)), vector(bore.spine))
    return most_in_bore(bore, d, vector(bore.ruling), 0.0) < bore.bore


@kernel(inner=True)
def divide(forest, front, nodes, pose, n, tail, short):
    """Put the children of one of two nodes into the queue, beside the other one; False where there is no room."""
    a, b = nodes.a, nodes.b
    first, by_length = is_halved_first(forest, a, b, short)
    # What is in a bore is divided before what has the bore.
    if is_held(forest, a, b, pose):
        first = False
    elif is_held(forest, b, a, inverse_pose(pose)):
        first = True
    k = a if first else b
    if links_at(forest.links, k).child == NONE:
        counts_at(front.counts, 0).halved += 1
        if not halve(forest, k, by_length):
            return False
    child = links_at(forest.links, k).child
    for i in range(2):
        pair = Parted(child + i, b, BY_PLANE) if first else Parted(a, child + i, BY_PLANE)
        put_waiting(front, tail + i, pair, n)
    return True


@kernel(inner=True)
def crosses(forest, front, nodes, pose, touch):
    """Whether two cells are proven to cross by more than `touch`; depth and place are written to the pair."""
    pair = pair_proof_at(front.pair, 0)
    counts_at(front.counts, 0).stabbed += 1
    depth, place = crossing_of(forest, nodes.a, nodes.b, pose, front.work)
    if depth <= touch:
        return False
    pair.depth = depth
    put(pair.place, place)
    return True


@kernel(inner=True)
def seek(forest, front, way, limits, tail):
    """Seek what parts the pairs of the queue, of which there are `tail`."""
    counts = counts_at(front.counts, 0)
    room = min(len(front.waiting), len(front.nodes))
    head, earlier = 0, counts.earlier
    while head < tail:
        if counts.next_count + tail - head + 2 >= room:
            put_off(front, way.after, way.swept, head, tail)
            return NO_ROOM
        if head % SOUGHT_AT_ONCE == SOUGHT_AT_ONCE - 1 and is_over(limits):
            put_off(front, way.after, way.swept, head, tail)
            return SPENT
        row = nodes_at(front.waiting_nodes, head % len(front.waiting))
        nodes = Parted(row.a, row.b, BY_PLANE)
        hint = vector(parted_at(front.waiting, head % len(front.waiting)).normal)
        head += 1
        if way.swept and head + earlier > limits.swept_budget:
            return UNSWEPT
        if head + earlier > limits.budget:
            counts.opened += 1
            keep(front, Parted(nodes.a, nodes.b, LEFT_OPEN), hint, -math.inf)
            continue
        counts.sought += 1
        parted, n, gaps, overlap = part_nodes(forest, front, way, nodes, hint, limits.needed)
        if parted == ARE_PARTED:
            continue
        if parted == NEED_SHORTER:
            return UNSWEPT
        cells = is_cell(forest, nodes.a) and is_cell(forest, nodes.b)
        if cells and overlap and crosses(forest, front, nodes, way.after, limits.touch):
            return CROSSING
        if is_too_long(forest, way, nodes, gaps):
            return UNSWEPT
        small = extent(forest, nodes.a) + extent(forest, nodes.b) < limits.resolution
        if cells and small:
            counts.opened += 1
            keep(front, Parted(nodes.a, nodes.b, LEFT_OPEN), n, -math.inf)
            continue
        # They are as far from being parted all the way as at the end where they are farther from it.
        short = max(way.sag - min(gaps[0], gaps[1]), 0.0)
        if not divide(forest, front, nodes, way.after, n, tail, short):
            put_off(front, way.after, way.swept, head - 1, tail)
            return NO_ROOM
        tail += 2
    return OPEN if counts.opened > 0 else CLEAR


@kernel(inner=True)
def look_only(forest, front, way, limits):
    """Prove that all pairs of the front are clear by more than `needed` at the end of a way and, swept, all along it.

    Unless its time is over, the present front and the last pose stay as they are; the next front is that of the end.
    """
    counts_at(front.counts, 0).opened = 0
    tail, over = ask_again(forest, front, way, limits)
    if over:
        put_off(front, way.after, way.swept, 0, tail)
        return SPENT
    return seek(forest, front, way, limits, tail)


@kernel(inner=True)
def look(forest, front, pose, limits, swept):
    """Look at a pose and, swept, at the way from the last one. Where both are clear, the pose becomes the last one."""
    counts, pair = counts_at(front.counts, 0), pair_proof_at(front.pair, 0)
    if not goes_on(front, pose, swept):
        leave_off(front)
    root = node_at(forest.nodes, counts.root_b)
    way = way_of(last_pose(front), pose, vector(root.center), root.radius, swept)
    travelled = pair.travelled + way.moved
    if travelled < pair.soonest:
        pair.travelled = travelled
        remember(front, pose)
        return CLEAR
    code = look_only(forest, front, way, limits)
    if code == CLEAR:
        replace_front(front, pose, travelled)
        pair.underway = 0.0
    elif code != SPENT and code != NO_ROOM:
        leave_off(front)
    return code


@kernel(inner=True)
def go_to(forest, front, pose, limits):
    """A look at a pose and at the way to it, which is taken in parts where it is too long for one look.

    `part` of the pair's record is the part of the way that is proven clear. If it is not the whole way, the last pose
    stays as it was; but if the time is over, or memory full, it becomes the pose up to which the way is clear, and the
    next call goes on from there. SHORTEST is a part of the whole way, not of what is left: that always has a half.
    """
    pair = pair_proof_at(front.pair, 0)
    root = node_at(forest.nodes, counts_at(front.counts, 0).root_b)
    center = vector(root.center)
    begin = last_pose(front)
    whole = way_of(begin, pose, center, root.radius, True)
    # `to` and `done` are parts of the way that is left; `behind` is the part of the whole way proven by earlier calls.
    to, aim, origin, behind = 1.0, pose, begin, 0.0
    if pair.underway == ON_ITS_WAY:
        to, aim, origin, behind = pair.aim_part, aim_of(pair), origin_of(pair), pair.behind
    swept_budget = SWEPT_BUDGET if to == 1.0 and behind == 0.0 else limits.swept_budget
    first = Limits(
        limits.needed, limits.touch, limits.resolution, limits.budget, swept_budget, limits.clock, limits.until
    )
    code = look(forest, front, aim, first, True)
    done, step = 0.0, 0.5 * to
    if code == CLEAR:
        done, step = to, 2.0 * to
    while done < 1.0 and (code == CLEAR or (code == UNSWEPT and step * (1.0 - behind) >= SHORTEST)):
        to = min(done + step, 1.0)
        code = look(forest, front, pose if to == 1.0 else pose_at(whole, to), limits, True)
        if code == CLEAR:
            done = to
            step *= 2.0
        else:
            step *= 0.5
            while done + step >= to:
                # As far as what has just failed.
                step *= 0.5
    pair.part = 1.0 if done == 1.0 else behind + (1.0 - behind) * done
    if code == SPENT or code == NO_ROOM:
        pair.aim_part = 1.0 if to == 1.0 else (to - done) / (1.0 - done)
        pair.behind = pair.part
        for k in range(9):
            pair.origin_turn[k] = origin.rotation[k]
        put(pair.origin_shift, origin.shift)
        return code
    if code != CLEAR and pair.part > 0.0:
        pair.travelled += way_of(last_pose(front), origin, center, root.radius, False).moved
        remember(front, origin)
    return code
