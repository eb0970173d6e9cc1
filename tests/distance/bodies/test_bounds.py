"""Bounds of pairs of parts of bodies against samples of these parts, and what a tree says of its nodes."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._heap import PAIR, waiting_pair_at
from assembly.distance.bodies import query
from assembly.distance.bodies.descent import body_search_at
from assembly.distance.bodies.nodes import links_of, node_of, patch_of
from assembly.distance.bodies.packing import tree_of
from assembly.distance.bodies.records import ALL, GROUP, MODEL, NONE, BodyTree, body_head_at, patch_span_at, spine_at
from assembly.distance.bodies.search import search_bodies
from assembly.distance.bodies.spines import PLANE
from assembly.distance.piece_search import CROWDED
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import bernstein
from assembly.kinematics.pose import rotation_matrix
from tests.distance.bodies.example_shapes import random_pose, solids, trimmed_faces, wavy

# What is left of sixteen digits of evaluated points, at sizes of some units.
TIGHT = 1e-14


def searched(a, b, q, budget):
    """The search after a budget: what it keeps, and the pairs that wait."""
    state, heap = np.empty(query.SEARCH), np.empty(PAIR * 100_000)
    work = (state, np.empty(query.PAIR_DOUBLES), np.zeros(500), np.empty(5000))
    while True:
        status, left = search_bodies(a.arrays, b.arrays, q, (1e-10, -1.0, float(budget)), heap, work, -1)
        if status != CROWDED:
            break
        a.make_room(1)
        b.make_room(1)
    return body_search_at(state, 0), [waiting_pair_at(heap, PAIR * k) for k in range(left)]


def net_of(tree, k):
    patch = patch_of(tree, links_of(tree, k).patch)
    m, n = int(patch.degree_u) + 1, int(patch.degree_v) + 1
    at = int(links_of(tree, k).net)
    return tree.nets[at : at + 4 * m * n].reshape(m, n, 4)


def samples(tree, k, count, faces=()):
    """Points of a node about the center of its body, of trimmed planes those of faces; of a group those of its patches.

    A trimmed plane has no more points than its boundary spans.
    """
    links = links_of(tree, k)
    if links.patch == GROUP:
        return np.concatenate([samples(tree, int(links.halves) + i, count, faces) for i in range(2)])
    net, patch = net_of(tree, k), patch_of(tree, links.patch)
    x = np.linspace(0.0, 1.0, count)
    b, c = bernstein(net.shape[0] - 1, x), bernstein(net.shape[1] - 1, x)
    s = np.einsum("xi,yj,ijk->xyk", b, c, net).reshape(-1, 4)
    points = s[:, :3] / s[:, 3:]
    if patch.border == NONE or patch.spine == NONE or spine_at(tree.pool, patch.spine).kind != PLANE:
        return points
    node, span = node_of(tree, k), patch_span_at(tree.pool, patch.span)
    u, v = (part.ravel() for part in np.meshgrid(x, x, indexing="ij"))
    u, v = node.low_u + u * (node.high_u - node.low_u), node.low_v + v * (node.high_v - node.low_v)
    u, v = span.low_u + u * (span.high_u - span.low_u), span.low_v + v * (span.high_v - span.low_v)
    return points[faces[int(patch.face)].contains(u, v)]


def world(tree, points, q):
    return (points + body_head_at(tree.pool, 0).center) @ rotation_matrix(q[3:]).T + q[:3]


def check_waiting(a, b, q, budget, faces=((), ()), most=40):
    """All pairs that wait have bounds below the distance of their samples; how many were positive."""
    state, pairs = searched(a, b, q, budget)
    tree_a, tree_b = BodyTree(*a.arrays), BodyTree(*b.arrays)
    positive = 0
    for pair in pairs[:: max(1, len(pairs) // most)]:
        p = world(tree_a, samples(tree_a, int(pair.a), 7, faces[0]), q[0])
        r = world(tree_b, samples(tree_b, int(pair.b), 7, faces[1]), q[1])
        least = np.sqrt(((p[:, None] - r[None]) ** 2).sum(axis=2).min(initial=np.inf))
        assert pair.bound <= least + TIGHT, (budget, pair.bound, least)
        positive += pair.bound > 0.0
    assert state.lower <= state.upper
    return positive


@pytest.mark.parametrize("budget", [20, 60, 150])
def test_bounds_of_sheets_hold_against_samples(cases, budget):
    rng = np.random.default_rng(budget)
    positive = 0
    for _ in range(cases(6, 200)):
        a, b = (tree_of((Face(wavy(rng, int(rng.integers(1, 4)), rng.random() < 0.5)),)) for _ in range(2))
        q = np.stack([random_pose(rng, 0.2), random_pose(rng, 0.2) + [0, 0, rng.uniform(0.8, 2.0), 0, 0, 0, 0]])
        positive += check_waiting(a, b, q, budget)
    assert positive > 5


@pytest.mark.parametrize("budget", [20, 200])
def test_bounds_of_solids_hold_against_samples(cases, budget):
    rng = np.random.default_rng(budget)
    shapes = [*solids().values(), *((face,) for face in trimmed_faces(rng).values()), (Face(asm.shapes.torus(1, 0.3)),)]
    positive = 0
    for _ in range(cases(6, 200)):
        faces = [tuple(shapes[int(k)]) for k in rng.integers(len(shapes), size=2)]
        a, b = (tree_of(one) for one in faces)
        q = np.stack([random_pose(rng, 0.5), random_pose(rng, 1.5)])
        positive += check_waiting(a, b, q, budget, faces)
    assert positive > 5


def model_of(node, x, y):
    """Point and derivatives of a model at x, y in [-1/2, 1/2]."""
    su, sv = np.array(node.slopes).reshape(2, 3)
    uu, uv, vv = np.array(node.bends).reshape(3, 3)
    x, y = x[:, None], y[:, None]
    point = np.array(node.middle) + x * su + y * sv + 0.5 * x * x * uu + x * y * uv + 0.5 * y * y * vv
    return point, su + x * uu + y * uv, sv + x * uv + y * vv, uu, uv, vv


def true_derivatives(net, x, y):
    """Point and derivatives of a patch at x, y in [0, 1]: quotients of polynomials by exact differences."""

    def basis(n, t, order):
        rows = bernstein(n - order, t) if n >= order else np.zeros((t.size, 0))
        for k in range(order):
            rows = (n - order + k + 1) * (np.pad(rows, ((0, 0), (1, 0))) - np.pad(rows, ((0, 0), (0, 1))))
        return rows

    p, q = net.shape[0] - 1, net.shape[1] - 1
    h = {
        (i, j): np.einsum("ta,tb,abk->tk", basis(p, x, i), basis(q, y, j), net) for i in range(3) for j in range(3 - i)
    }
    w = h[0, 0][:, 3:]
    s = h[0, 0][:, :3] / w
    wu, wv = h[1, 0][:, 3:], h[0, 1][:, 3:]
    su, sv = (h[1, 0][:, :3] - wu * s) / w, (h[0, 1][:, :3] - wv * s) / w
    uu = (h[2, 0][:, :3] - 2 * wu * su - h[2, 0][:, 3:] * s) / w
    uv = (h[1, 1][:, :3] - wu * sv - wv * su - h[1, 1][:, 3:] * s) / w
    vv = (h[0, 2][:, :3] - 2 * wv * sv - h[0, 2][:, 3:] * s) / w
    return s, su, sv, uu, uv, vv


def test_models_are_within_their_doubts(cases):
    rng = np.random.default_rng(5)
    counts = np.zeros(2, dtype=int)
    for _ in range(cases(4, 60)):
        faces = list(trimmed_faces(rng).values())
        a, b = tree_of((faces[int(rng.integers(4))],)), tree_of((Face(wavy(rng, 2)),))
        searched(a, b, np.stack([random_pose(rng, 0.3), random_pose(rng, 1.0)]), 400)
        for kept in (a, b):
            tree = BodyTree(*kept.arrays)
            for k in rng.integers(int(kept.arrays[2][0]), size=60).tolist():
                links, node = links_of(tree, k), node_of(tree, k)
                if links.patch == GROUP:
                    continue
                x, y = rng.random((2, 50))
                net = net_of(tree, k)
                truth = true_derivatives(net, x, y)
                away = np.linalg.norm(truth[0] - np.array(node.middle), axis=1)
                assert away.max() <= node.radius
                if links.known < MODEL:
                    continue
                counts[0] += 1
                model = model_of(node, x - 0.5, y - 0.5)
                off = [np.linalg.norm(t - m, axis=1).max() for t, m in zip(truth, model, strict=True)]
                assert off[0] <= node.point_doubt
                if links.known == ALL:
                    counts[1] += 1
                    curved = net.shape[1] > 1
                    assert max(off[1], off[2] if curved else 0.0) <= node.slope_doubt
                    assert max(off[3], *(off[4:] if curved else [0.0])) <= node.bend_doubt
    assert (counts > 10).all(), counts


def test_each_bound_by_itself_holds_against_samples(run_python, cases):
    code = f"from tests.distance.bodies.pair_laws import main; main({cases(80, 3000)})"
    assert "proof" in run_python(code, NUMBA_DISABLE_JIT="1")


def test_a_pair_of_doubles_has_room_for_a_direction():
    from assembly.distance.bodies.directions import packed_way, unpacked_way

    rng = np.random.default_rng(2)
    ways = np.concatenate([np.eye(3), -np.eye(3), rng.standard_normal((200, 3))])
    for way in ways / np.linalg.norm(ways, axis=1, keepdims=True):
        back = np.array(unpacked_way(packed_way(tuple(way))))
        assert abs(np.linalg.norm(back) - 1.0) < 1e-15
        # Two numbers of 25 bits over the octahedron, whose faces are up to 1.8 times as far as the sphere.
        assert np.abs(back - way).max() < 2e-7
