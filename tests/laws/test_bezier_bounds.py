"""Every bound of the certified queries encloses what it says, at samples: models, boxes, pairs, convexity."""

from __future__ import annotations

from fractions import Fraction
from math import comb

import numpy as np
import pytest

import assembly as asm
from assembly.distance.curves import capsules as bc
from assembly.distance.curves import nodes as bn
from assembly.distance.curves.bounds import box_bound, convexity, hull_bound, least_change, model_bound, square_minimum
from assembly.distance.patches import nodes as pn
from assembly.distance.patches import pair as pp
from assembly.distance.patches.newton import patch_derivatives
from assembly.distance.patches.packing import pack_patches
from assembly.distance.piece_search import PieceTree
from assembly.geometry.splines.bezier_pieces import CENTER, ERROR
from tests.laws.curve_queries import CURVES, least_distances, piece_values, random_curve

SLACK = 1e-15


class Tree:
    """A random node of a curve's tree, some halvings down."""

    def __init__(self, curve, rng, depth):
        self.record, self.pool = curve._packed_pieces
        stride = bn.node_stride(self.record)
        nodes = np.full(stride * (2 * depth + 40), np.nan)
        tree = PieceTree(self.record, self.pool, np.zeros(bn.NODE_INTS * (2 * depth + 40), dtype=np.int64), nodes)
        bn.start_nodes(tree)
        k, used = 0, 1
        while depth > 0 or not bn.is_piece(tree, k):
            depth -= bool(bn.is_piece(tree, k))
            bn.split_node(tree, k, used)
            k, used = used + int(rng.integers(2)), used + 2
        self.piece, self.node = bn.piece_of(tree, k), bn.node_of(tree, k)
        self.interval = self.node.begin, self.node.end
        self.net = curve.bezier_pieces()[bn.links_of(tree, k).first]
        # About the center, as the nodes are.
        self.net = self.net.copy()
        d = self.net.shape[1] - 1
        self.net[:, :d] -= self.net[:, d:] * self.pool[CENTER : CENTER + d]

    def values(self, x):
        """Point and derivatives (m, 3) at x in the node's own parameter."""
        low, high = self.interval
        rows = piece_values(np.repeat(self.net[None], len(x), axis=0), low + x * (high - low))
        return [np.pad(row, ((0, 0), (0, 3 - row.shape[1]))) * (high - low) ** k for k, row in enumerate(rows)]


# The oracle's own rounding, a part of the curve's size: the degree times some units of the last place.
ORACLE = 1e-13


@pytest.mark.parametrize("kind", CURVES)
def test_models_of_pieces(kind):
    rng = np.random.default_rng(1)
    x = np.linspace(0.0, 1.0, 33)
    d = (x - 0.5)[:, None]
    for depth in (0, 1, 3, 6, 12):
        tree = Tree(random_curve(rng, kind, 3), rng, depth)
        c, c1, c2 = tree.values(x)
        node = tree.node
        a0, a1, a2 = node.a0, node.a1, node.a2
        away = node.away + ORACLE
        e0, e1, e2, speed = node.e0, node.e1, node.e2, node.speed
        assert np.linalg.norm(c - (a0 + a1 * d + 0.5 * a2 * d * d), axis=1).max() <= e0 + away
        assert np.linalg.norm(c1 - (a1 + a2 * d), axis=1).max() <= e1 + away
        assert np.linalg.norm(c2 - a2, axis=1).max() <= e2 + 100.0 * away
        assert np.linalg.norm(c1, axis=1).max() <= speed + away
        assert (np.abs(c - node.box_center) <= node.box_half + away).all()
        # Remainders are of third order: an eighth at every halving, but for rounding.
        assert e0 <= 5000.0 * 0.2**depth + 1e-13


@pytest.mark.parametrize("kind", CURVES)
def test_packed_curves_are_what_was_given(kind):
    """In exact arithmetic, at the ends and the middle of every span; the error that the record states."""
    curve = random_curve(np.random.default_rng(2), kind, 3)
    record, pool = curve._packed_pieces
    n = curve.degree
    net = pool[record[6] : record[6] + 4 * (n + 1) * record[1]].reshape(record[1], n + 1, 4)
    knots = [Fraction(t) for t in curve.knots.tolist()]
    for span, (low, high) in enumerate(zip(curve.breaks()[:-1], curve.breaks()[1:], strict=True)):
        j = int(np.searchsorted(curve.knots, low, side="right")) - 1
        for x in (Fraction(0), Fraction(1, 2), Fraction(1)):
            t = Fraction(low) + x * (Fraction(high) - Fraction(low))
            exact = [
                [Fraction(float(p)) * Fraction(float(w)) for p in point] + [Fraction(float(w))]
                for point, w in zip(curve.control_points[j - n : j + 1], curve.weights[j - n : j + 1], strict=True)
            ]
            for r in range(1, n + 1):
                for i in range(n, r - 1, -1):
                    left, right = knots[j - n + i], knots[j + 1 + i - r]
                    a = (t - left) / (right - left)
                    exact[i] = [(1 - a) * u + a * v for u, v in zip(exact[i - 1], exact[i], strict=True)]
            point = [float(v / exact[n][3] - Fraction(float(c))) for v, c in zip(exact[n][:3], pool[2:5], strict=True)]
            basis = [comb(n, i) * x**i * (1 - x) ** (n - i) for i in range(n + 1)]
            rows = [sum(b * Fraction(float(v)) for b, v in zip(basis, net[span, :, c], strict=True)) for c in range(4)]
            packed = [float(v / rows[3]) for v in rows[:3]]
            assert np.linalg.norm(np.subtract(point, packed)) <= pool[ERROR]


@pytest.mark.parametrize("depth", [0, 2, 5])
@pytest.mark.parametrize("kinds", [("segment", "polyline"), ("quintic", "degree 10"), ("arc", "rational of degree 6")])
def test_bounds_of_pairs(kinds, depth, cases):
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 1.0, 41)
    tight, proven, count = 0, 0, cases(15, 30)
    for round_ in range(count):
        a, b = (Tree(random_curve(rng, kind, 3), rng, depth) for kind in kinds)
        # Anywhere, or near: there the distance is convex.
        shift = b.pool[CENTER : CENTER + 3] - a.pool[CENTER : CENTER + 3]
        if round_ % 2:
            shift = a.node.a0 - b.node.a0 + 1e-3 * rng.normal(size=3)
        shift = tuple(shift.tolist())
        (u, du, hu), (v, dv, hv) = a.values(x), b.values(x)
        d = u[:, None] - v[None] - np.array(shift)
        least = np.linalg.norm(d, axis=2).min()
        pair = a.node, b.node, shift, SLACK
        box = box_bound(*pair)
        model, s, t = model_bound(*pair)
        hull = hull_bound(a.piece, b.piece, shift, SLACK, s, t)
        assert max(box, model, hull) <= least + ORACLE
        tight += max(model, hull) > 0.8 * least
        lambdas = convexity(a.node, b.node, False, shift)
        if lambdas[0] > 0.0:
            proven += 1
            ss = (du * du).sum(1)[:, None] + (d * hu[:, None]).sum(2)
            tt = (dv * dv).sum(1)[None] - (d * hv[None]).sum(2)
            st = -du @ dv.T
            # H - diag(lambda) is positive semidefinite.
            assert ((ss - lambdas[0]) * (tt - lambdas[1]) - st * st >= -1e-12 * ss * tt).all()
            assert (ss >= lambdas[0]).all() and (tt >= lambdas[1]).all()
    # The law has something to say: bounds that are near, boxes that are convex.
    assert depth < 5 or tight >= count / 2.5
    assert depth < 5 or proven >= count / 3


def test_a_quadratic_on_the_square_and_on_a_line():
    rng = np.random.default_rng(4)
    x = np.linspace(-0.5, 0.5, 41)
    for _ in range(300):
        c, g, h, p, q, r = rng.normal(size=6)
        values = c + 2 * g * x[:, None] + 2 * h * x + p * x[:, None] ** 2 + 2 * q * x[:, None] * x + r * x**2
        least, s, t = square_minimum(c, g, h, p, q, r)
        assert least <= values.min() + 1e-14 and abs(s) <= 0.5 and abs(t) <= 0.5
        assert least == pytest.approx(c + 2 * g * s + 2 * h * t + p * s * s + 2 * q * s * t + r * t * t, abs=1e-13)
        # Forms of rank one but for rounding, as along parallel lines, and nearly so.
        u, v, d = rng.normal(size=(3, 3))
        v = rng.normal() * u + rng.choice([0.0, 1e-9, 1e-6, 1e-3]) * v
        least, s, t = square_minimum(d @ d, d @ u, -d @ v, u @ u, -u @ v, v @ v)
        squares = ((d + x[:, None, None] * u - x[:, None] * v) ** 2).sum(axis=-1)
        at_place = ((d + s * u - t * v) ** 2).sum()
        assert least <= squares.min() + 1e-14 and abs(s) <= 0.5 and abs(t) <= 0.5
        # One step of refinement leaves the rounding of the slope.
        assert at_place - 1e-12 * (d @ d + u @ u + v @ v) <= least <= at_place + 1e-14
        slope, error, curvature, at = rng.normal(), 0.3 * rng.random(), rng.random(), rng.random()
        ahead = rng.uniform(0.0, 1.0 - at)
        d = np.linspace(-at, ahead, 101)
        lowest = min((k * d + 0.5 * curvature * d * d).min() for k in (slope - error, slope, slope + error))
        assert lowest - 1e-3 <= least_change(slope, error, curvature, at, ahead) <= lowest + 1e-15


@pytest.mark.parametrize("kind", CURVES)
def test_capsules(kind, cases):
    rng = np.random.default_rng(6)
    x = np.linspace(0.0, 1.0, 201)
    said = []
    for trial in range(cases(4, 12)):
        dimension = 2 + trial % 2
        curve, other = (random_curve(rng, kind, dimension, 3.0) for _ in range(2))
        tree, far = (bc.capsule_tree(*c._packed_pieces) for c in (curve, other))
        leaves = int(tree[bc.LEAVES])
        rows = tree.reshape(-1, bc.STRIDE)
        places = np.zeros((len(x), 3))
        places[:, :dimension] = curve.evaluate(x)
        places -= tree[bc.ORIGIN : bc.ORIGIN + 3]
        distances = []
        for k in range(1, 2 * leaves):
            if rows[k, bc.RADIUS] >= 0.0:
                m, u, r = rows[k, :3], rows[k, 3:6], rows[k, bc.RADIUS]
                s = np.clip((places - m) @ u / max(u @ u, 1e-300), -0.5, 0.5)
                distances.append(np.linalg.norm(places - m - s[:, None] * u, axis=1) - r)
        # All is in the first one, and every point in one of each level, here of the lowest.
        assert (distances[0] <= ORACLE).all()
        pieces = (rows[leaves:, bc.RADIUS] >= 0.0).sum()
        assert (np.min(distances[-pieces:], axis=0) <= ORACLE).all()
        # Answers on both sides of the distance, near it too.
        point = rng.uniform(0.0, 3.0, dimension)
        y, z = least_distances([(curve, other)], 65)[0], least_distances([(curve, point)], 65)[0]
        place = np.append(point, np.zeros(3 - dimension))
        for part in (0.0, 0.5, 0.9, 0.99, 0.999, 1.001, 1.01, 1.1, 2.0):
            answers = bc.compare_curves(tree, far, part * y), bc.compare_point(tree, *place, part * z)
            assert (bc.NEARER if part < 1.0 else bc.FARTHER) not in answers
            said += answers
    assert {bc.FARTHER, bc.NEARER} <= set(said)


SURFACES = {
    "torus": lambda: asm.shapes.torus(2.0, 0.5),
    "plane": lambda: asm.shapes.plane(2.0, 2.0),
    "bicubic": lambda: asm.NurbsSurface(
        np.random.default_rng(5).random((5, 6, 3)),
        ([0, 0, 0, 0, 0.4, 1, 1, 1, 1], [0, 0, 0, 0, 0.3, 0.6, 1, 1, 1, 1]),
        (3, 3),
    ),
}


def patch_node(shape, rng, depth):
    """A packed shape and a random node of it as a patch."""
    record, pool = pack_patches(shape)
    patches = record[pn.PATCHES_U] * record[pn.PATCHES_V]
    stride = pn.patch_stride(record)
    nodes = np.full(stride * (patches + 2 * depth), np.nan)
    ints = np.zeros(pn.NODE_INTS * (patches + 2 * depth), dtype=np.int64)
    tree = PieceTree(record, pool, ints, nodes)
    for k in range(patches):
        pn.fill_patch(tree, k)
    k, used, m = int(rng.integers(patches)), patches, np.zeros(32)
    pn.describe_patch(record, pool, nodes, stride * k, m)
    for _ in range(depth):
        pn.split_patch(tree, k, used)
        k, used = used + int(rng.integers(2)), used + 2
        pn.describe_patch(record, pool, nodes, stride * k, m)
    return pool, pn.Patch(record, nodes, stride * k, pp.free_count(record))


def grid_values(patch, x):
    """(len(x)^2, 3) points and derivatives u, v, uu, uv, vv."""
    record = patch.record
    w = np.zeros(pp.BASIS + 6 * (max(record[0], record[1]) + 1))
    rows = []
    for s in x:
        for t in x if record[1] > 0 else [0.0]:
            point = patch_derivatives(patch, s, t, w)
            rows.append([*point, *w[pp.PATCH_J : pp.PATCH_J + 15]])
    return np.array(rows).reshape(-1, 6, 3)


@pytest.mark.parametrize("depth", [0, 3, 8])
@pytest.mark.parametrize("name", SURFACES)
def test_models_of_patches(name, depth):
    rng = np.random.default_rng(6)
    x = np.linspace(0.0, 1.0, 9)
    _pool, patch = patch_node(SURFACES[name](), rng, depth)
    values = grid_values(patch, x)
    s, t = (row.ravel()[:, None] - 0.5 for row in np.meshgrid(x, x, indexing="ij"))
    node = pp.node_of(patch)
    a0, (ju, jv), (kuu, kuv, kvv) = node.a0, node.ju.reshape(2, 3), node.kuu.reshape(3, 3)
    e0, e1, e2, speed_u, speed_v = node.e0, node.e1, node.e2, node.speed_u, node.speed_v
    model = a0 + ju * s + jv * t + 0.5 * kuu * s * s + kuv * s * t + 0.5 * kvv * t * t

    def largest(difference):
        return np.linalg.norm(difference, axis=-1).max()

    assert largest(values[:, 0] - model) <= e0 + SLACK
    assert (
        max(largest(values[:, 1] - ju - kuu * s - kuv * t), largest(values[:, 2] - jv - kuv * s - kvv * t))
        <= e1 + SLACK
    )
    assert max(largest(values[:, 3 + i] - k) for i, k in enumerate((kuu, kuv, kvv))) <= e2 + SLACK
    assert largest(values[:, 1]) <= speed_u and largest(values[:, 2]) <= speed_v
    assert (np.abs(values[:, 0] - node.box_center) <= node.box_half).all()


@pytest.mark.parametrize("depth", [0, 4, 14])
@pytest.mark.parametrize("other", ["point", "quintic", "torus"])
def test_bounds_of_pairs_of_patches(other, depth):
    rng = np.random.default_rng(7)
    x = np.linspace(0.0, 1.0, 7)
    proven = 0
    for round_ in range(12):
        shape = {"point": lambda: 3.0 * rng.random(3), "torus": SURFACES["torus"]}.get(
            other, lambda: random_curve(rng, "quintic", 3, 3.0)
        )()
        qa, a = patch_node(SURFACES["bicubic" if round_ % 2 else "torus"](), rng, depth)
        qb, b = patch_node(shape, rng, 0 if other == "point" else depth)
        na, nb = a.free, b.free
        n = na + nb
        shift = qb[CENTER : CENTER + 3] - qa[CENTER : CENTER + 3]
        if round_ > 5:
            shift = pp.node_of(a).a0 - pp.node_of(b).a0 + 1e-3 * rng.normal(size=3)
        shift = tuple(shift.tolist())
        u, v = grid_values(a, x), grid_values(b, x if nb else [0.0])
        d = u[:, None, 0] - v[None, :, 0] - np.array(shift)
        least = np.linalg.norm(d, axis=2).min()
        w = np.zeros(pp.BASIS + 100)
        pp.load_models(a, b, shift, w)
        pp.load_hessian(w, n)
        box = pp.patch_box_bound(a, b, shift, SLACK)
        model = pp.patch_model_bound(a, b, SLACK, w)
        hull = pp.patch_hull_bound(a, b, shift, SLACK, w)
        assert max(box, model, hull) <= least + SLACK
        if not pp.patch_convexity(a, b, w):
            continue
        proven += 1
        floor = pp.MARGIN * np.diag(w[pp.H : pp.H + 16].reshape(4, 4)[:n, :n].diagonal())
        for i in rng.integers(len(u), size=5):
            for j in rng.integers(len(v), size=5):
                jac = np.concatenate([u[i, 1 : 1 + na], -v[j, 1 : 1 + nb]])
                hessian = jac @ jac.T
                bends = u[i, 3:] @ d[i, j], -v[j, 3:] @ d[i, j]
                for k in range(na):
                    hessian[k, :na] += bends[0][k : k + na]
                for k in range(nb):
                    hessian[na + k, na:] += bends[1][k : k + nb]
                assert np.linalg.eigvalsh(hessian - floor).min() >= -1e-14 * np.abs(hessian).max()
    # Where two surfaces all but meet, one of four directions is flat.
    assert depth < 14 or other == "torus" or proven >= 3
