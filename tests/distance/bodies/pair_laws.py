"""Each bound of a pair of nodes by itself against samples, in Python: `python -m tests.distance.bodies.pair_laws 60`.

With NUMBA_DISABLE_JIT=1, for the kernels here are parts of a search and none of them has an entry.
"""

from __future__ import annotations

import math
import sys

import numpy as np

import assembly as asm
from assembly.distance.bodies.descent import BodyQuestion, BodySearch, body_search_at
from assembly.distance.bodies.models import describe_node
from assembly.distance.bodies.nodes import halves_of, links_of, node_of, patch_of
from assembly.distance.bodies.one_minimum import may_have_one_minimum, proven_bound
from assembly.distance.bodies.packing import tree_of
from assembly.distance.bodies.pair import (
    PAIR_DOUBLES,
    BodyPose,
    ball_bound,
    hull_bound,
    load_frame,
    load_models,
    load_tense,
    model_bound,
    pair_work_at,
)
from assembly.distance.bodies.query import SEARCH
from assembly.distance.bodies.records import ALL, GROUP, NONE, BodyTree, body_head_at, patch_span_at
from assembly.distance.bodies.search import errors_of
from assembly.distance.bodies.supports import is_planted, write_supports
from assembly.distance.bodies.trims import falls_to_side, flat_is_elsewhere, is_beside, is_flat_inside
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import bernstein
from tests.distance.bodies.example_shapes import solids, trimmed_faces, wavy

COUNT = 9
TIGHT = 1e-14


def random_node(tree, rng, depth):
    k = 0
    while links_of(tree, k).patch == GROUP:
        k = int(links_of(tree, k).halves + rng.integers(2))
    for _ in range(depth):
        k = int(halves_of(tree, k) + rng.integers(2))
    return k


def grid_of(tree, k):
    """Points of a node."""
    links = links_of(tree, k)
    patch = patch_of(tree, links.patch)
    m, n = int(patch.degree_u) + 1, int(patch.degree_v) + 1
    net = tree.nets[links.net : links.net + 4 * m * n].reshape(m, n, 4)
    x = np.linspace(0.0, 1.0, COUNT)
    s = np.einsum("xi,yj,ijk->xyk", bernstein(m - 1, x), bernstein(n - 1, x), net)
    return s[..., :3] / s[..., 3:]


def sides_hold(p, q, tree_a, i, tree_b, j, of_a):
    """Whether of each sample of one side the nearest of its row or column is where the node has a side of its own."""
    squares = ((p[:, :, None, None] - q[None, None]) ** 2).sum(axis=-1)
    near = squares.min(axis=(2, 3)) if of_a else squares.min(axis=(0, 1))
    node = node_of(tree_a, i) if of_a else node_of(tree_b, j)
    falls = []
    for axis, (low, high) in enumerate(((node.low_u, node.high_u), (node.low_v, node.high_v))):
        steps = np.diff(near, axis=axis)
        falls.append((steps > -1e-15).all() and low > 0.0)
        falls.append((steps < 1e-15).all() and high < 1.0)
    return any(falls)


def roomy(faces):
    """The tree of a body, with room for more halves."""
    kept = tree_of(faces)
    kept.make_room(200)
    return BodyTree(*kept.arrays)


def flat_pairs(rounds):
    """No samples of a node are straight over samples of a flat one that it is said to be beside."""
    rng = np.random.default_rng(1)
    told = 0
    plates = solids()
    shapes = [*plates.values(), (Face(wavy(rng, 1)),), (Face(asm.shapes.torus(1.0, 0.3)),)]
    for _ in range(rounds):
        flat, other = roomy(plates["plate"]), roomy(tuple(shapes[int(rng.integers(len(shapes)))]))
        i, j = (random_node(tree, rng, int(rng.integers(0, 9))) for tree in (flat, other))
        while not is_flat_inside(flat, i):
            i = random_node(flat, rng, int(rng.integers(0, 9)))
        turn = tuple(np.linalg.qr(rng.standard_normal((3, 3)))[0].ravel())
        matrix = np.array(turn).reshape(3, 3)
        gap = rng.standard_normal(3) * 10.0 ** rng.uniform(-3.0, 0.3)
        shift = np.array(node_of(flat, i).middle) - matrix @ np.array(node_of(other, j).middle) + gap
        if not is_beside(flat, i, other, j, (turn, tuple(shift)), 0.0):
            continue
        told += 1
        p, q = grid_of(flat, i), grid_of(other, j) @ matrix.T + shift
        e1, e2 = p[-1, 0] - p[0, 0], p[0, -1] - p[0, 0]
        normal = np.cross(e1, e2) / np.linalg.norm(np.cross(e1, e2))
        apart = p.reshape(-1, 1, 3) - q.reshape(1, -1, 3)
        along = apart - (apart @ normal)[..., None] * normal
        assert np.linalg.norm(along, axis=2).min() > 0.0
        # All on one side of a line, so that none between the samples is over the flat one either.
        middle = along.reshape(-1, 3)[np.linalg.norm(along, axis=2).argmin()]
        assert (along @ (node_difference(flat, i, other, j, matrix, shift, normal)) > 0.0).all(), middle
        pose = BodyPose(turn, tuple(shift), 0.0)
        assert flat_is_elsewhere(flat, i, other, j, pose, 0.0)
        back = BodyPose(tuple(matrix.T.ravel()), tuple(-matrix.T @ shift), 0.0)
        assert flat_is_elsewhere(other, j, flat, i, back, 0.0)
    print("flat", told)
    assert told > 0.2 * rounds


def node_difference(a, i, b, j, matrix, shift, normal):
    """The way between the middles of two nodes, without what is along a normal."""
    d = np.array(node_of(a, i).middle) - matrix @ np.array(node_of(b, j).middle) - shift
    return d - (d @ normal) * normal


def points_of(faces, tree, k):
    """Points of a node, of a trimmed plane those inside its boundary; of a group those of all its patches."""
    links = links_of(tree, k)
    if links.patch == GROUP:
        return np.concatenate([points_of(faces, tree, int(links.halves) + i) for i in range(2)])
    points, patch = grid_of(tree, k).reshape(-1, 3), patch_of(tree, links.patch)
    if patch.border == NONE:
        return points
    span = patch_span_at(tree.pool, patch.span)
    u, v = np.meshgrid(np.linspace(span.low_u, span.high_u, COUNT), np.linspace(span.low_v, span.high_v, COUNT))
    return points.reshape(COUNT, COUNT, 3).swapaxes(0, 1)[faces[patch.face].contains(u, v)]


def supports(rounds):
    """Supports are below n.P of all points of groups and patches; those of round faces reach these."""
    rng = np.random.default_rng(2)
    ring = (Face(asm.shapes.torus(1.0, 0.3)),)
    shapes = [*solids().values(), *((face,) for face in trimmed_faces(rng).values()), ring]
    trees = [BodyTree(*tree_of(tuple(faces)).arrays) for faces in shapes]
    for _ in range(rounds):
        k, side = int(rng.integers(len(trees))), int(rng.integers(2))
        faces, tree = shapes[k], trees[k]
        n = rng.standard_normal(3) * rng.choice([0.0, 1.0], 3, p=[0.2, 0.8])
        n = n / np.linalg.norm(n) if n.any() else np.array([0.0, 0.0, 1.0])
        best = write_supports(tree, side, tuple(n))
        root = node_of(tree, 0).support[side]
        for k in range(2 * int(body_head_at(tree.pool, 0).patches) - 1):
            assert is_planted(tree, k)
            support = node_of(tree, k).support[side]
            assert support <= (points_of(faces, tree, k) @ n).min(initial=math.inf) + TIGHT
            assert root <= support
        assert links_of(tree, best).patch != GROUP and node_of(tree, best).support[side] == root
        # From outside its tube a torus is supported by itself, whatever its control points are.
        tree = trees[-1]
        write_supports(tree, side, tuple(n))
        reach = 0.3 + math.hypot(n[0], n[1])
        assert abs(node_of(tree, 0).support[side] + reach) <= 1e-12


def main(rounds):
    flat_pairs(4 * rounds)
    supports(rounds)
    rng = np.random.default_rng(0)
    told = dict.fromkeys(("ball", "hull", "model", "proof", "fall"), 0)
    for k in range(rounds):
        if k % 50 == 0:
            # Their trees are full some time.
            faces = list(trimmed_faces(rng).values())
        sheets = (Face(wavy(rng, 1, height=rng.choice([0.3, 1.0]))) for _ in range(2))
        kinds = [sheet if rng.random() < 0.6 else faces[int(rng.integers(len(faces)))] for sheet in sheets]
        a, b = (BodyTree(*tree_of((face,)).arrays) for face in kinds)
        depth = int(rng.integers(0, 11))
        i, j = random_node(a, rng, depth), random_node(b, rng, depth)
        room = np.empty(36 + 4 * 40**2)
        for tree, k in ((a, i), (b, j)):
            describe_node(tree, k, ALL, room)
        turn = tuple(np.linalg.qr(rng.standard_normal((3, 3)))[0].ravel())
        matrix = np.array(turn).reshape(3, 3)
        gap = rng.standard_normal(3) * 10.0 ** rng.uniform(-3.0, 0.3)
        shift = np.array(node_of(a, i).middle) - matrix @ np.array(node_of(b, j).middle) + gap
        pose = BodyPose(turn, tuple(shift), 0.0)
        p, q = grid_of(a, i), grid_of(b, j) @ matrix.T + shift
        differences = p.reshape(-1, 1, 3) - q.reshape(1, -1, 3)
        far = np.linalg.norm(differences, axis=2)
        least = float(far.min())
        n = differences.reshape(-1, 3)[far.argmin()]
        n = n + rng.choice([0.0, 0.3]) * least * rng.standard_normal(3)
        n = tuple(n / np.linalg.norm(n))
        question = BodyQuestion(1e-10, -1.0, 0.0)
        errors = errors_of(a, b, pose, question)
        block, state = np.zeros(PAIR_DOUBLES), np.zeros(SEARCH)
        pair = pair_work_at(block, 0)
        upper = least * rng.choice([0.1, 1.0, 2.0, 10.0])
        body_search_at(state, 0).upper = upper
        body_search_at(state, 0).limit = math.inf
        search = BodySearch(a, b, pose, None, state, block, np.zeros(400), room, errors, question)
        load_frame(pair, turn, n)
        load_models(pair, a, i, b, j, pose)
        tension = load_tense(pair, upper).tension
        # A proof may take more tension than a model.
        tensions = {"model": tension, "proof": max(0.0, may_have_one_minimum(pair, a, i, b, j, upper, errors.slope))}
        bounds = {
            "ball": ball_bound(a, i, b, j, pose, errors.slack),
            "hull": hull_bound(pair, a, i, b, j, pose, errors.slack),
            "model": model_bound(pair, a, i, b, j, upper, errors.slack),
            "proof": proven_bound(search, i, j),
        }
        for name, bound in bounds.items():
            assert bound <= least + TIGHT, (name, bound, least, depth)
            told[name] += bound > 0.0
        # The quadratic and the only minimum bound Phi, which is sharper.
        along = differences @ np.array(n)
        for name, tension in tensions.items():
            phi = along + tension * ((differences**2).sum(axis=2) - along**2)
            assert bounds[name] <= float(phi.min()) + TIGHT * (1.0 + tension), (name, bounds[name], phi.min(), depth)
            assert tension == 0.0 or bounds[name] <= 0.5 / tension
        for of_a in (True, False):
            if falls_to_side(pair, a, i, b, j, of_a, errors.slack):
                told["fall"] += 1
                assert sides_hold(p, q, a, i, b, j, of_a)
    print(told)
    assert all(count > 0.05 * rounds for count in told.values()), told


if __name__ == "__main__":
    main(int(sys.argv[1]))
