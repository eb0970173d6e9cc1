"""Pieces of formula curves as a search over patches sees them: models, boxes, rows and points hold what they say."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.distance.patches import formula_nodes as fn
from assembly.distance.patches import nodes as pn
from assembly.distance.patches import pair as pp
from assembly.distance.patches.formula_packing import pack_formula
from assembly.distance.piece_search import PieceTree
from assembly.geometry.expression import formula
from assembly.geometry.splines.bezier_pieces import CENTER, ERROR, REACH

T = ca.SX.sym("t")
CURVES = [
    asm.curves.heart(0.1, angle=20.0, center=(1.0, -2.0)),
    asm.curves.euler_spiral(0.7, angle=100.0),
    asm.curves.helix(0.5, 0.3, 2.0),
    asm.FormulaCurve(ca.vertcat(ca.cos(T) + 1e3, ca.sin(2 * T), ca.exp(0.3 * T)), T, (0.0, 4.0), name="far off"),
    asm.FormulaCurve(ca.vertcat(T, ca.fabs(T), ca.sin(3 * T)), T, (-1.0, 2.0), name="kink"),
    asm.FormulaCurve(ca.vertcat(ca.sqrt(T), T, T * T), T, (0.0, 1.0), name="steep"),
    asm.FormulaCurve(ca.vertcat(ca.sqrt(ca.fabs(T)), T, T), T, (-1.0, 2.0), name="cusp"),
]
# Doubles of the oracle, parts of the coordinates.
ORACLE = 4e-16


def packed(curve):
    record, pool, (table, tape) = pack_formula(curve)
    return record, pool, (table, tape, np.empty(int(table[formula.WORKSPACE])))


def described(curve, rng, depth):
    """Nodes after random halvings, where the last of them is, and how the curve is packed."""
    record, pool, full = packed(curve)
    nodes = np.full(pn.patch_stride(record) * (2 * depth + 1), np.nan)
    ints = np.zeros(pn.NODE_INTS * (2 * depth + 1), dtype=np.int64)
    tree = PieceTree(record, pool, ints, nodes)
    fn.start_formula(full, tree)
    k, used, side = 0, 1, int(rng.integers(3))
    for _ in range(depth):
        fn.split_formula(tree, k, used)
        # To either end, or anywhere.
        k, used = used + (side if side < 2 else int(rng.integers(2))), used + 2
    o = pn.patch_stride(record) * k
    # Kernels inside of kernels are plain Python here, where infinities that meet warn.
    with np.errstate(all="ignore"):
        fn.describe_formula(full, 0.0, nodes, o, np.zeros(42))
    assert not np.isnan(nodes[o : o + pn.patch_stride(record)]).any()
    return full, pool, nodes, o


def in_space(rows):
    return np.pad(rows, ((0, 0), (0, 3 - rows.shape[1])))


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_models_of_pieces(curve):
    rng = np.random.default_rng(1)
    known = np.zeros(3, dtype=int)
    for depth in (0, 1, 2, 3, 5, 8, 13, 20, 30, 45) * 3:
        _full, pool, nodes, o = described(curve, rng, depth)
        t0, t1 = nodes[o + pn.LOW_U], nodes[o + pn.HIGH_U]
        h = 2.0 * fn.half_width(t0, t1)
        inner = np.clip(np.linspace(t0, t1, 41), t0, t1)[1:-1]
        c, c1, c2 = (in_space(row) for row in curve.evaluate(inner, 2))
        c = c - pool[CENTER : CENTER + 3]
        z = ((inner - 0.5 * (t0 + t1)) / h)[:, None]
        a0, j, k = (
            nodes[o + pn.A0 : o + pn.A0 + 3],
            nodes[o + pn.JU : o + pn.JU + 3],
            nodes[o + pn.KUU : o + pn.KUU + 3],
        )
        size = ORACLE * (np.abs(c).max() + np.abs(pool[CENTER : CENTER + 3]).max())
        # What of z is lost moves a place along the curve.
        turned = size + 1e-15 * (abs(t0) + abs(t1)) / h * np.abs(h * c1).max()

        def largest(rows):
            return np.linalg.norm(rows, axis=1).max()

        e0, e1, e2 = nodes[o + pn.E0 : o + pn.E0 + 3]
        assert largest(c - a0 - j * z - 0.5 * k * z * z) <= e0 + turned
        assert largest(h * c1 - j - k * z) <= e1 + ORACLE * np.abs(h * c1).max()
        if e2 < fn.NONE:
            assert largest(h * h * c2 - k) <= e2 + 4e-15 * np.abs(h * h * c2).max()
        known += np.array([e0, e1, e2]) < fn.NONE
        assert (np.abs(c - nodes[o : o + 3]) <= nodes[o + 3 : o + 6] + size).all()
        assert np.linalg.norm(c, axis=1).max() <= pool[REACH] + size
        rows = nodes[o + pn.ROWS : o + pn.ROWS + 12].reshape(3, 4)[:, :3]
        n = rng.normal(size=(20, 3))
        n /= np.linalg.norm(n, axis=1)[:, None]
        assert ((n @ c.T).max(axis=1) <= (n @ rows.T).max(axis=1) + e0 + turned).all()
        # Halved before any patch where no second derivative is known.
        assert nodes[o + pn.SPEED_U] >= largest(h * c1) * (1.0 - 1e-12) and not fn.is_dot(nodes, o)
        assert e2 < fn.NONE or nodes[o + pn.SPEED_U] == fn.NONE
    # A smooth curve is known to the third order everywhere, a kink's neighborhood to the first.
    assert known[0] == 30
    assert known[2] == 30 if curve.name not in ("kink", "steep", "cusp") else 5 < known[2] < 30


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_models_narrow_with_the_cube_of_a_piece(curve):
    rng = np.random.default_rng(2)
    remainders = []
    for depth in (4, 8):
        rows = [described(curve, rng, depth) for _ in range(20)]
        remainders.append(np.median([nodes[o + pn.E0] for _f, _p, nodes, o in rows]))
    # Sixteen times shorter: 4,096 times less, where nothing else is in the way.
    assert remainders[1] <= remainders[0] / (1000.0 if curve.name not in ("kink", "steep", "cusp") else 2.0)


@pytest.mark.parametrize("curve", CURVES[4:], ids=lambda c: c.name)
def test_pieces_that_count_as_points(curve):
    """About the kink, the cusp or the vertical at zero."""
    rng = np.random.default_rng(4)
    record, pool, full = packed(curve)
    nodes, ints = np.zeros(pn.patch_stride(record)), np.zeros(pn.NODE_INTS, dtype=np.int64)
    dots = 0
    for exponent in rng.uniform(-14.0, -2.0, 60):
        t0, t1 = np.clip(10.0**exponent * np.array([-rng.random(), rng.random()]), *curve.domain)
        fn.set_interval(PieceTree(record, pool, ints, nodes), 0, t0, t1)
        with np.errstate(all="ignore"):
            fn.describe_formula(full, 1e-5, nodes, 0, np.zeros(42))
        e0 = nodes[pn.E0]
        c = in_space(curve.evaluate(np.clip(np.linspace(t0, t1, 41), t0, t1))) - pool[CENTER : CENTER + 3]
        assert fn.is_dot(nodes, 0) or e0 > 1e-6
        if fn.is_dot(nodes, 0):
            dots += 1
            assert e0 <= 1.0001e-5 and nodes[pn.SPEED_U] == 0.0 and not nodes[pn.JU : pn.E0].any()
            assert np.linalg.norm(c - nodes[pn.A0 : pn.A0 + 3], axis=1).max() <= e0 + 4e-16
    assert 10 <= dots < 60


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_points_are_off_by_what_they_say(curve):
    rng = np.random.default_rng(3)
    w = np.zeros(pp.BASIS + 8)
    for depth in (0, 2, 6, 12, 25):
        full, pool, nodes, o = described(curve, rng, depth)
        t0, t1 = nodes[o + pn.LOW_U], nodes[o + pn.HIGH_U]
        for x in (0.0, 1.0, *rng.random(8)):
            with np.errstate(all="ignore"):
                point = np.array(fn.formula_derivatives(full, nodes, o, x, w))
            off, _off_slope, back, ahead = w[pp.OFF : pp.OFF + 4]
            t = fn.formula_parameter(nodes, o, x)
            c = in_space(curve.evaluate([t]))[0] - pool[CENTER : CENTER + 3]
            assert np.linalg.norm(point - c) <= off + ORACLE * (1.0 + np.abs(pool[CENTER : CENTER + 3]).max())
            assert off <= max(50.0 * pool[ERROR], 4e-15)
            h = 2.0 * fn.half_width(t0, t1)
            assert t0 <= t <= t1 and back * h >= t - t0 and ahead * h >= t1 - t
            assert back + ahead <= 1.0 + 1e-12
