"""What `proximity/features/quadratic_model.py` says of a box of a face or a part of an edge, against samples of the
true shapes.

Every point is the quadratic's to within e (along the normal: e_n), inside the ball, and below the support in every
direction; no two samples are nearer than the bound of their cells. Rounding: some 1e-15 of the coordinates.
"""

from __future__ import annotations

import numpy as np
import pytest

from assembly._kernel import kernel
from assembly._record import Store, rows_of
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import plane_curves, solids
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.motion import IDENTITY, RelativePose
from assembly.proximity.brep.packing import pack_shell
from assembly.proximity.brep.records import EDGE, EDGE_RECORD, FACE, FACE_RECORD, edge_at, shell_at
from assembly.proximity.brep.topology import topology_of
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.features import quadratic_model as box
from assembly.proximity.features.ball_tree import (
    CELL,
    CELL_NODE,
    INFO,
    BallTree,
    cell_in,
    cell_node_at,
    give_model,
    grow,
    model_in,
    plant,
)
from tests.geometry.splines.test_surface import random_surface
from tests.laws.scenes import random_quaternion
from tests.laws.witness import rotated

SURFACES = {
    "torus": shapes.torus(2.0, 0.7),
    "sphere": shapes.sphere(1.3),
    "plane": shapes.plane(2.0, 1.0),
    "cone": shapes.cone(1.0, 2.0),
    "clip": shapes.paper_clip(),
    "mixed": random_surface(1, (4, 2), ("multiple", "unclamped")),
    "high": random_surface(2, (7, 6)),
    "far": shapes.torus(2e-3, 1e-3).transformed(translation=(10.0, -20.0, 30.0)),
}


@kernel
def edge_points(table, pool, edge, t, out):
    for k in range(t.size):
        p = edge_jet(Store(table, pool), edge, t[k])[0]
        out[k, 0], out[k, 1], out[k, 2] = p


@kernel
def fill(table, pool, turn, shift, nodes, info, used, work, i):
    tree = BallTree(0, RelativePose(turn, shift), nodes, info, used, work)
    give_model(Store(table, pool), tree, i)


def points_of_edge(table, pool, edge, t):
    out = np.empty((t.size, 3))
    edge_points(table, pool, edge, t, out)
    return out


def bent_patch():
    """A rational patch of several spans trimmed by a circle that crosses their borders."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    points = np.stack([x, y, np.zeros_like(x)], axis=-1) + rng.uniform(size=(6, 5, 3))
    knots = np.r_[[0.0] * 4, 0.3, 0.6, [1.0] * 4], np.r_[[0.0] * 3, 0.4, 0.7, [1.0] * 3]
    surface = NurbsSurface(points, knots, (3, 2), rng.uniform(0.5, 2.0, (6, 5)))
    return Face(surface, plane_curves.circle(0.37, (0.5, 0.5)))


SOLIDS = {
    "cylinder": solids.solid_cylinder(0.7, 1.5),
    "plate": solids.plate(2.0, 1.0, 0.3, [(0.4, 0.1, 0.2)]),
    "bent": (bent_patch(),),
}
DIRECTIONS = 12


def pose(rng):
    q = np.concatenate([np.zeros(3), random_quaternion(rng)])
    turn = rotated(np.tile(q, (3, 1)), np.eye(3)).T
    return tuple(turn.ravel()), tuple(rng.normal(size=3))


def random_box(rng, surface):
    """A box inside one span, of any width down to a thousandth of it."""
    result = []
    for breaks in surface.breaks():
        k = rng.integers(breaks.size - 1)
        width = (breaks[k + 1] - breaks[k]) * 10.0 ** rng.uniform(-3.0, 0.0)
        low = rng.uniform(breaks[k], breaks[k + 1] - width)
        result.append((low + 0.5 * width, 0.5 * width))
    return result


class OneCell:
    """A tree of one node, a cell of a feature."""

    def __init__(self, table, pool, kind, record):
        self.store = table, pool
        self.arrays = (
            np.zeros((1, box.NODE)),
            np.zeros((1, INFO), np.int64),
            np.ones(1, np.int64),
            np.empty((4, 16, 16)),
        )
        self.model = box.model_at(self.arrays[0], 0)
        self.cell = cell_node_at(self.arrays[1], 0)
        self.cell.level, self.cell.kind, self.cell.record = CELL, kind, record

    def fill(self, u, v, turn, shift):
        """Give it its model over a box: middle and half width of u, and of v."""
        self.arrays[0][:] = 0.0
        (self.model.u0, self.model.half_u), (self.model.v0, self.model.half_v) = u, v
        self.model.radius = np.inf
        self.cell.has_model = 0
        fill(*self.store, turn, shift, *self.arrays, 0)


def check(rng, node, s, t, points, rounding):
    """A node against points over (s, t) in [-1, 1]^2."""
    o, p, q, l, m, k = node.point, node.linear_u, node.linear_v, node.square_u, node.mixed, node.square_v
    assert np.linalg.norm(points - node.center, axis=1).max() <= node.radius + rounding
    if node.rest == np.inf:
        return
    assert all(np.isfinite(node[name]).all() for name in node.dtype.names)
    s, t = s[:, None], t[:, None]
    model = o + p * s + q * t + l * s**2 + m * s * t + k * t**2
    off = points - model
    assert np.linalg.norm(off, axis=1).max() <= node.rest + rounding
    normal = node.normal
    assert np.abs(off @ normal).max() <= node.rest_n + rounding
    for n in (*rng.normal(size=(DIRECTIONS, 3)), normal, -normal):
        if (length := np.linalg.norm(n)) > 0.0:
            n = n / length
            assert ((points - o) @ n).max() <= box.support(node, n) + rounding


@pytest.mark.parametrize("name", SURFACES)
def test_models_of_faces_hold(name, cases):
    surface = SURFACES[name]
    rng = np.random.default_rng(5)
    table, pool = surface.packed()
    # The record of a face after that of its surface, which is at 0.
    cell = OneCell(np.append(table, np.zeros(FACE_RECORD, np.int64)), pool, FACE, table.size)
    rounding = 4e-15 * (np.abs(surface.control_points).max() + 10.0)
    tight = []
    count = cases(13, 40)
    for _ in range(count):
        turn, shift = pose(rng)
        u, v = random_box(rng, surface)
        cell.fill(u, v, turn, shift)
        s, t = np.concatenate([rng.uniform(-1.0, 1.0, (2, 60)), [[-1, -1, 1, 1], [-1, 1, -1, 1]]], axis=1)
        (a, b), (c, d) = surface.domain
        points = surface.evaluate(np.clip(u[0] + s * u[1], a, b), np.clip(v[0] + t * v[1], c, d))
        points = points @ np.reshape(turn, (3, 3)).T + shift
        check(rng, cell.model, s, t, points, rounding)
        if cell.model.rest < np.inf:
            tight.append(cell.model.rest / cell.model.radius)
    assert len(tight) > count / 2
    # The law would hold for boundless models too: the remainder is of third order in the width.
    assert np.median(tight) < 0.05


@pytest.mark.parametrize("name", SOLIDS)
def test_models_of_edges_hold(name, cases):
    rng = np.random.default_rng(6)
    table, pool, shell = pack_shell(topology_of(SOLIDS[name]), 1.0)
    tight, count = [], cases(4, 10)
    for k in range(shell_at(table, shell).edges):
        edge = shell_at(table, shell).edge_table + EDGE_RECORD * k
        cell = OneCell(table, pool, EDGE, edge)
        curve = edge_at(table, edge).curve
        breaks = pool[table[curve + 2] : table[curve + 2] + table[curve + 1] + 1]
        for _ in range(count):
            piece = rng.integers(breaks.size - 1)
            width = (breaks[piece + 1] - breaks[piece]) * 10.0 ** rng.uniform(-3.0, -0.5)
            low = rng.uniform(breaks[piece], breaks[piece + 1] - width)
            cell.fill((low + 0.5 * width, 0.5 * width), (0.0, 0.0), *IDENTITY)
            s = np.concatenate([rng.uniform(-1.0, 1.0, 40), [-1.0, 1.0]])
            points = points_of_edge(table, pool, edge, low + 0.5 * width * (1.0 + s))
            check(rng, cell.model, s, 0.0 * s, points, 1e-14)
            if cell.model.rest < np.inf:
                tight.append(cell.model.rest / cell.model.radius)
    assert len(tight) >= count and np.median(tight) < 0.05


def tree(faces, pose):
    """All nodes of a solid's tree down to its cells, and what they are of."""
    table, pool, shell = pack_shell(topology_of(faces), 1.0)
    store = Store(table, pool)
    grown = plant(store, shell, pose)
    for i in range(1, grown.used[0]):
        grow(store, grown, i)
    return store, grown


def samples(store, tree, i, rng):
    """Points of a node's feature over its box."""
    cell, model = cell_in(tree, i), model_in(tree, i)
    s, t = rng.uniform(-1.0, 1.0, (2, 25))
    u, v = model.u0 + s * model.half_u, model.v0 + t * model.half_v
    if cell.kind == FACE:
        surface = store.table[cell.record]
        points = [surface_point(*store, surface, a, b)[0] for a, b in zip(u, v, strict=True)]
    elif cell.kind == EDGE:
        points = points_of_edge(*store, cell.record, u)
    else:
        return model.point[None]
    return np.array(points) @ np.reshape(tree.pose.rotation, (3, 3)).T + tree.pose.shift


@pytest.mark.parametrize("names", [("cylinder", "plate"), ("bent", "bent"), ("bent", "cylinder")])
def test_no_samples_are_nearer_than_the_bound(names, cases):
    rng = np.random.default_rng(7)
    trees = tree(SOLIDS[names[0]], IDENTITY), tree(SOLIDS[names[1]], RelativePose(*pose(rng)))
    ends = [np.flatnonzero(rows_of(CELL_NODE, grown.info[: grown.used[0]]).level == CELL) for _store, grown in trees]
    useful, count = 0, cases(50, 150)
    for _ in range(count):
        pair = [rng.choice(some) for some in ends]
        for (store, grown), k in zip(trees, pair, strict=True):
            fill(*store, *grown.pose, grown.nodes, grown.info, grown.used, grown.work, k)
        a, b = (model_in(grown, k) for (_store, grown), k in zip(trees, pair, strict=True))
        bound, _n = box.pair_bound(a, b, tuple(np.eye(3)[0]), np.inf)
        p, q = (samples(*one, k, rng) for one, k in zip(trees, pair, strict=True))
        nearest = np.sqrt(((p[:, None] - q) ** 2).sum(axis=2)).min()
        assert bound <= nearest + 1e-13
        useful += bound > 0.7 * nearest
    # Bounds that are always low would pass.
    assert useful > count / 4
