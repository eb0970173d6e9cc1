"""A list of facing patches that allows for motions has what a descent finds after any of them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly._record import Store
from assembly.geometry.vec import quaternion_matrix
from assembly.kinematics.motion import RelativePose
from assembly.proximity.bvh.neighbor_list import LIST_INTS, ListKey, listed_pairs, neighbor_list_at
from assembly.proximity.bvh.tree import pairs_within, tree_node
from assembly.proximity.manager.motion_bounds import Mover
from tests.laws.test_facet_enclosure import BODIES, Descent, placed, sample

REACH, RING = 0.1, 0.15


def inverse(turn, shift):
    """The pose of f seen from g, of that of g seen from f; and the other way round."""
    return turn.T, -turn.T @ shift


def around(rng, descent, tree, turn, shift):
    """A pose at which no point of a body's ball is farther than RING from where it is at this one."""
    root = tree_node(Store(descent.table, descent.pool), tree, 0)
    middle = root.center
    share = rng.uniform(0.0, 1.0)
    # A turn by an angle a moves what is at a distance r by a r at most.
    angle = share * RING / root.radius
    axis, way = (v / np.linalg.norm(v) for v in rng.normal(size=(2, 3)))
    turned = Rotation.from_rotvec(angle * axis).as_matrix() @ turn
    return turned, turn @ middle + shift - turned @ middle + (1.0 - share) * RING * way


@pytest.mark.parametrize("side", [0, 1])
@pytest.mark.parametrize("names", [("torus", "torus"), ("torus", "ellipsoid, inside out"), ("box", "cylinder")])
def test_a_list_has_what_is_in_reach_at_poses_near_its_own(names, side):
    rng = np.random.default_rng(4)
    descent = Descent(*(BODIES[name] for name in names))
    table = np.append(descent.table, np.full(LIST_INTS, -1))
    pool, at = descent.pool, descent.table.size
    workspace = np.empty((4_000, 2), dtype=np.int64)
    kept = sifted = 0
    for _ in range(2):
        (_, _, f, n), (_, _, g, m) = (sample(tree, rng) for tree in descent.trees)
        pose = placed(rng, f, n, g, m, rng.uniform(0.0, 0.5 * REACH))
        neighbor_list_at(table, at).owner = -1
        for k in range(4):
            trees = descent.f, descent.g
            # The motion of f is measured seen from g, that of g seen from f.
            seen = pose if side == 1 else inverse(*pose)
            seen = seen if k == 0 else around(rng, descent, trees[side], *seen)
            e = tuple(Rotation.from_matrix(seen[0]).as_quat(scalar_first=True).tolist())
            moving = Mover(side, trees[side], e, quaternion_matrix(*e), tuple(seen[1].tolist()))
            turn, shift = seen if side == 1 else inverse(*seen)
            there = RelativePose(tuple(turn.ravel().tolist()), tuple(shift.tolist()))
            before = table[at:].copy()
            key = ListKey(at, 0, moving)
            count = listed_pairs(Store(table, pool), key, trees, there, REACH, 1.01 * RING, descent.stack, workspace)
            if count < 0:
                assert neighbor_list_at(table, at).count == -1
                break
            listed = {tuple(row) for row in workspace[:count].tolist()}
            count = pairs_within(Store(table, pool), trees, there, REACH, descent.stack, workspace)
            assert {tuple(row) for row in workspace[:count].tolist()} <= listed
            sifted += len(listed)
            kept += int(k > 0 and (before == table[at:]).all())
    assert kept > 1 and sifted > 0
