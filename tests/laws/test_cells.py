"""What `proximity/features/quadratic_model.py` says of a box of a face or a part of an edge, against samples of the
true shapes.

Every point is the quadratic's to within e (along the normal: e_n), inside the ball, and below the support in every
direction; no two samples are nearer than the bound of their cells. Rounding: some 1e-15 of the coordinates.
"""

from __future__ import annotations

import numpy as np
import pytest

from assembly._kernel import kernel
from assembly._record import Store
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.evaluate import surface_point
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.motion import RelativePose
from assembly.proximity.brep.packing import pack_shell
from assembly.proximity.brep.records import EDGE, EDGE_CURVE, EDGE_RECORD, EDGE_TABLE, EDGES, FACE, FACE_RECORD
from assembly.proximity.brep.topology import topology_of
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.features import quadratic_model as box
from assembly.proximity.features.ball_tree import (
    CELL,
    HAS_MODEL,
    INFO,
    KIND,
    LEVEL,
    RECORD,
    give_model,
    grow,
    plant,
    room,
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
def fill(table, pool, turn, shift, nodes, info, i, work):
    give_model(Store(table, pool), RelativePose(turn, shift), nodes, info, i, work)


def open_all(table, pool, shell, turn, shift, nodes, info, work):
    used = plant(Store(table, pool), shell, RelativePose(turn, shift), nodes, info)
    for i in range(1, used):
        used = grow(Store(table, pool), shell, RelativePose(turn, shift), nodes, info, i, used)
    return used


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
    return Face(surface, solids._circle((0.5, 0.5), 0.37))


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


def new_node(nodes, i, u, v):
    nodes[i] = 0.0
    nodes[i, box.U0], nodes[i, box.HALF_U] = u
    nodes[i, box.V0], nodes[i, box.HALF_V] = v
    nodes[i, box.RADIUS] = np.inf


def cell_of(kind, record):
    """What a node is: a cell of a feature, without its model."""
    info = np.zeros((1, INFO), np.int64)
    info[0, [LEVEL, KIND, RECORD]] = CELL, kind, record
    return info


def check(rng, node, s, t, points, rounding):
    """A node against points over (s, t) in [-1, 1]^2."""
    o, p, q, l, m, k = (
        node[at : at + 3] for at in (box.POINT, box.LINEAR_U, box.LINEAR_V, box.SQUARE_U, box.MIXED, box.SQUARE_V)
    )
    center = node[box.CENTER : box.CENTER + 3]
    assert np.linalg.norm(points - center, axis=1).max() <= node[box.RADIUS] + rounding
    if node[box.REST] == np.inf:
        return
    assert np.isfinite(node).all()
    s, t = s[:, None], t[:, None]
    model = o + p * s + q * t + l * s**2 + m * s * t + k * t**2
    off = points - model
    assert np.linalg.norm(off, axis=1).max() <= node[box.REST] + rounding
    normal = node[box.NORMAL : box.NORMAL + 3]
    assert np.abs(off @ normal).max() <= node[box.REST_N] + rounding
    row = node[None]
    for n in (*rng.normal(size=(DIRECTIONS, 3)), normal, -normal):
        if (length := np.linalg.norm(n)) > 0.0:
            n = n / length
            assert ((points - o) @ n).max() <= box.support(row, 0, *n) + rounding


@pytest.mark.parametrize("name", SURFACES)
def test_models_of_faces_hold(name, cases):
    surface = SURFACES[name]
    rng = np.random.default_rng(5)
    table, pool = surface.packed()
    # The record of a face after that of its surface, which is at 0.
    info = cell_of(FACE, table.size)
    table = np.append(table, np.zeros(FACE_RECORD, np.int64))
    work = np.empty((4, 16, 16))
    nodes = np.empty((1, box.NODE))
    rounding = 4e-15 * (np.abs(surface.control_points).max() + 10.0)
    tight = []
    count = cases(13, 40)
    for _ in range(count):
        turn, shift = pose(rng)
        u, v = random_box(rng, surface)
        new_node(nodes, 0, u, v)
        info[0, HAS_MODEL] = 0
        fill(table, pool, turn, shift, nodes, info, 0, work)
        s, t = np.concatenate([rng.uniform(-1.0, 1.0, (2, 60)), [[-1, -1, 1, 1], [-1, 1, -1, 1]]], axis=1)
        (a, b), (c, d) = surface.domain
        points = surface.evaluate(np.clip(u[0] + s * u[1], a, b), np.clip(v[0] + t * v[1], c, d))
        points = points @ np.reshape(turn, (3, 3)).T + shift
        check(rng, nodes[0], s, t, points, rounding)
        if nodes[0, box.REST] < np.inf:
            tight.append(nodes[0, box.REST] / nodes[0, box.RADIUS])
    assert len(tight) > count / 2
    # The law would hold for boundless models too: the remainder is of third order in the width.
    assert np.median(tight) < 0.05


@pytest.mark.parametrize("name", SOLIDS)
def test_models_of_edges_hold(name, cases):
    rng = np.random.default_rng(6)
    table, pool, shell = pack_shell(topology_of(SOLIDS[name]), 1.0)
    work = np.empty((4, 16, 16))
    nodes = np.empty((1, box.NODE))
    same, origin = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    tight, count = [], cases(4, 10)
    for k in range(table[shell + EDGES]):
        edge = table[shell + EDGE_TABLE] + EDGE_RECORD * k
        curve = table[edge + EDGE_CURVE]
        breaks = pool[table[curve + 2] : table[curve + 2] + table[curve + 1] + 1]
        for _ in range(count):
            piece = rng.integers(breaks.size - 1)
            width = (breaks[piece + 1] - breaks[piece]) * 10.0 ** rng.uniform(-3.0, -0.5)
            low = rng.uniform(breaks[piece], breaks[piece + 1] - width)
            new_node(nodes, 0, (low + 0.5 * width, 0.5 * width), (0.0, 0.0))
            fill(table, pool, same, origin, nodes, cell_of(EDGE, edge), 0, work)
            s = np.concatenate([rng.uniform(-1.0, 1.0, 40), [-1.0, 1.0]])
            points = points_of_edge(table, pool, edge, low + 0.5 * width * (1.0 + s))
            check(rng, nodes[0], s, 0.0 * s, points, 1e-14)
            if nodes[0, box.REST] < np.inf:
                tight.append(nodes[0, box.REST] / nodes[0, box.RADIUS])
    assert len(tight) >= count and np.median(tight) < 0.05


def tree(faces, turn, shift):
    """All nodes of a solid's tree down to its cells, with the arrays that made them."""
    table, pool, shell = pack_shell(topology_of(faces), 1.0)
    count = room(Store(table, pool), shell)
    nodes, info, work = np.zeros((count, box.NODE)), np.zeros((count, INFO), np.int64), np.empty((4, 16, 16))
    used = open_all(table, pool, shell, turn, shift, nodes, info, work)
    return nodes[:used], info[:used], (table, pool, turn, shift, work)


def samples(arrays, nodes, info, i, rng):
    """Points of a node's feature over its box."""
    table, pool, turn, shift, _ = arrays
    s, t = rng.uniform(-1.0, 1.0, (2, 25))
    u, v = nodes[i, 0] + s * nodes[i, 2], nodes[i, 1] + t * nodes[i, 3]
    kind, record = info[i, 1], info[i, 3]
    if kind == FACE:
        points = [surface_point(table, pool, table[record], a, b)[0] for a, b in zip(u, v, strict=True)]
    elif kind == EDGE:
        points = points_of_edge(table, pool, record, u)
    else:
        return nodes[i : i + 1, box.POINT : box.POINT + 3]
    return np.array(points) @ np.reshape(turn, (3, 3)).T + shift


@pytest.mark.parametrize("names", [("cylinder", "plate"), ("bent", "bent"), ("bent", "cylinder")])
def test_no_samples_are_nearer_than_the_bound(names, cases):
    rng = np.random.default_rng(7)
    same, origin = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0)
    a, ai, one = tree(SOLIDS[names[0]], same, origin)
    turn, shift = pose(rng)
    b, bi, other = tree(SOLIDS[names[1]], turn, shift)
    cells_a, cells_b = np.flatnonzero(ai[:, 0] == 3), np.flatnonzero(bi[:, 0] == 3)
    useful, count = 0, cases(50, 150)
    for _ in range(count):
        i, j = rng.choice(cells_a), rng.choice(cells_b)
        for arrays, nodes, info, k in ((one, a, ai, i), (other, b, bi, j)):
            fill(*arrays[:4], nodes, info, k, arrays[4])
        bound, _n = box.pair_bound(a, i, b, j, tuple(np.eye(3)[0]), np.inf)
        p, q = samples(one, a, ai, i, rng), samples(other, b, bi, j, rng)
        nearest = np.sqrt(((p[:, None] - q) ** 2).sum(axis=2)).min()
        assert bound <= nearest + 1e-13
        useful += bound > 0.7 * nearest
    # Bounds that are always low would pass.
    assert useful > count / 4
