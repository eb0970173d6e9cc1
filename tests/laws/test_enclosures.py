"""Enclosures hold the pieces they are of, in every direction, down to pieces of 1e-8 of the domain."""

from __future__ import annotations

from fractions import Fraction
from itertools import pairwise
from math import comb

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly._kernel import kernel
from assembly.distance.enclosures.enclosure import (
    AUTO,
    BOX,
    FIRST_END,
    LAST_END,
    MID,
    PIECE,
    SPEED,
    enclose,
    enclosed_piece_at,
    separation_along,
)
from assembly.distance.enclosures.gjk import APART, INSIDE, ROOM, ConvexSet, gjk, witnesses
from assembly.distance.enclosures.queries import BOUNDS, packed_operand
from assembly.distance.enclosures.taylor import ValuesAt, box_hessian, crossing_proven, taylor_bound

RNG = np.random.default_rng(1)
KNOTS = [0, 0, 0, 0, 0.3, 0.5, 1, 1, 1, 1]
T = ca.SX.sym("t")
CURVES = [
    asm.curves.heart(0.1, angle=20.0, center=(1.0, -2.0)),
    asm.curves.ranunculoid(0.2),
    asm.curves.involute(0.4),
    asm.curves.euler_spiral(0.7, angle=100.0),
    asm.curves.helix(0.5, 0.3, 2.0),
    asm.FormulaCurve(ca.vertcat(T, ca.fabs(T), ca.sin(3 * T)), T, (-1.0, 2.0), name="kink"),
    asm.FormulaCurve(ca.vertcat(ca.sqrt(T), T), T, (0.0, 1.0), name="steep"),
    asm.NurbsCurve.bezier(RNG.uniform(-1, 1, (6, 2)), name="bezier 5"),
    asm.NurbsCurve.bezier(RNG.uniform(-1, 1, (14, 3)) + 1e3, name="bezier 13, far off"),
    asm.NurbsCurve.bezier(RNG.uniform(-1, 1, (5, 3)), RNG.uniform(0.2, 3.0, 5), name="rational bezier"),
    asm.NurbsCurve(RNG.uniform(-1, 1, (6, 2)), KNOTS, 3, RNG.uniform(0.5, 2.0, 6), name="nurbs"),
    asm.NurbsCurve.polyline(RNG.uniform(-1, 1, (4, 2)), name="polyline"),
]


def spans(curve):
    return curve.breaks() if isinstance(curve, asm.NurbsCurve) else np.array(curve.domain)


def pieces(curve, rng, count):
    """Intervals within the smooth parts, of all lengths."""
    breaks = spans(curve)
    for _ in range(count):
        k = rng.integers(len(breaks) - 1)
        low, high = breaks[k : k + 2]
        width = (high - low) * min(10.0 ** rng.uniform(-8, 0.3), 1.0)
        first = low + rng.uniform() * (high - low - width)
        yield float(first), float(min(first + width, high))


def directions(d, rng, count):
    n = rng.normal(size=(count, d))
    return n / np.linalg.norm(n, axis=1)[:, None]


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_supports(curve, cases):
    rng = np.random.default_rng(2)
    for t0, t1 in pieces(curve, rng, cases(25, 60)):
        piece = asm.proximity.enclosure(curve, t0, t1)
        points = curve.evaluate(np.clip(np.linspace(t0, t1, 60), t0, t1))
        n = directions(points.shape[1], rng, 20)
        # Along and across the chord, where the enclosures are tight.
        chord = points[-1] - points[0]
        if np.linalg.norm(chord) > 0.0:
            n[0] = chord / np.linalg.norm(chord)
            n[1] -= n[0] * (n[0] @ n[1])
        n[2 : 2 + len(n[0])] = np.eye(len(n[0]))
        # Points are computed; what they are off is not the enclosure's business, though it is small beside it.
        off = 4e-15 * np.abs(points).max()
        farthest = (points @ (n / np.linalg.norm(n, axis=1)[:, None]).T).max(axis=0)
        best = piece.support(n)
        for bound in BOUNDS:
            support = piece.support(n, bound)
            assert (support >= farthest - off).all(), (bound, t0, t1)
            if bound != "capsule":  # which is not among those that "auto" takes the least of
                assert (support >= best - off).all()


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: c.name)
def test_widths_and_lengths(curve, cases):
    rng = np.random.default_rng(3)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for t0, t1 in pieces(curve, rng, cases(25, 60)):
        piece = asm.proximity.enclosure(curve, t0, t1)
        if curve.name in ("kink", "steep") and t0 <= 1e-3:
            continue  # not for Gauss's sum
        half = 0.5 * (t1 - t0)
        ends = np.linspace(t0, t1, 9)
        at = np.clip(ends[:-1, None] + 0.125 * half * (1 + nodes), t0, t1)
        slope = curve.evaluate(at, 1)[1].reshape(-1, curve.evaluate(t0).size)
        w = np.tile(weights, 8) * 0.125 * half
        length = float(w @ np.linalg.norm(slope, axis=1))
        mean = w @ slope / (t1 - t0)
        width = (t1 - t0) * float(w @ ((slope - mean) ** 2).sum(axis=1))
        rounding = 1e-13 * np.abs(slope).max() * (t1 - t0)
        assert piece.length >= length - rounding
        if piece.radius < np.inf:
            # The width of lemma 1; formulas of ranges above it are bounds of it, or of the length of arc.
            least = min(width, length**2 - np.linalg.norm(piece.ends[1] - piece.ends[0]) ** 2)
            assert np.sqrt(piece.width) >= np.sqrt(max(least, 0.0)) - rounding - 3e-7 * length * (least != width)


def exact_values(points, weights, s):
    """C and C' of a rational Bezier curve at a fraction, as fractions."""
    n = len(points) - 1
    rows = [[Fraction(w) * Fraction(x) for x in p] + [Fraction(w)] for p, w in zip(points, weights, strict=True)]

    def total(degree, rows):
        basis = [comb(degree, i) * s**i * (1 - s) ** (degree - i) for i in range(degree + 1)]
        return [sum(b * row[k] for b, row in zip(basis, rows, strict=True)) for k in range(len(rows[0]))]

    x = total(n, rows)
    d = total(n - 1, [[n * (q - p) for p, q in zip(*pair, strict=True)] for pair in pairwise(rows)])
    place = [v / x[-1] for v in x[:-1]]
    return place, [(v - p * d[-1]) / x[-1] for v, p in zip(d[:-1], place, strict=True)]


@pytest.mark.parametrize("spread", [1.0, 1e6, 1e12])
def test_ranges_of_pieces_with_weights_of_all_sizes(spread):
    """Against fractions, at the ends of the curve as well, where it may move far between two doubles."""
    rng = np.random.default_rng(12)
    for _ in range(6):
        points, weights = rng.uniform(-1, 1, (5, 2)), rng.uniform(0.5, 1, 5) * spread ** rng.uniform(-0.5, 0.5, 5)
        operand = packed_operand("curve", asm.NurbsCurve.bezier(points, weights))
        for _ in range(12):
            width = 10.0 ** rng.uniform(-14, 0)
            t0 = (0.0, 1.0 - width, rng.uniform(0, 1 - width))[rng.integers(3)]
            t1 = min(t0 + width, 1.0)
            x = np.zeros(PIECE)
            enclose(operand.kind, operand.table, operand.pool, np.empty(operand.workspace), 0, t0, t1, x)
            for s in (Fraction(t0), Fraction(t1), *(Fraction(float(v)) for v in np.linspace(t0, t1, 7)[1:-1])):
                for value, at in zip(exact_values(points, weights, s), (BOX, SPEED), strict=True):
                    for k, v in enumerate(value):
                        low, high = x[at + 2 * k : at + 2 * k + 2]
                        assert low <= v <= high
            # Boxes stay as small as the curve, whatever the weights.
            assert np.ptp(x[BOX : BOX + 4].reshape(2, 2), axis=1).max() <= 2.1


def test_the_width_of_a_polynomial_is_exact():
    curve = CURVES[7]
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for t0, t1 in ((0.0, 1.0), (0.2, 0.3), (0.7, 0.7 + 1e-6)):
        slope = curve.evaluate(0.5 * (t0 + t1) + 0.5 * (t1 - t0) * nodes, 1)[1]
        w = 0.5 * weights
        width = (t1 - t0) ** 2 * float(w @ ((slope - w @ slope) ** 2).sum(axis=1))
        # In the short one derivatives are known to 1e-16 and differ by 1e-6.
        assert asm.proximity.enclosure(curve, t0, t1).width == pytest.approx(width, rel=1e-6)


def test_enclosures_narrow_with_the_square_of_a_piece():
    for curve in (CURVES[0], CURVES[4], CURVES[9]):
        low, high = curve.domain
        widths = [
            np.sqrt(asm.proximity.enclosure(curve, 0.4 * high, 0.4 * high + h * (high - low)).width)
            for h in (1e-2, 1e-3, 1e-4, 1e-5)
        ]
        assert all(0.005 < b / a < 0.02 for a, b in zip(widths[:-1], widths[1:], strict=True))


def test_bad_input():
    curve = CURVES[0]
    with pytest.raises(TypeError, match="curve is 3"):
        asm.proximity.enclosure(3, 0.0, 1.0)
    for t0, t1 in ((1.0, 1.0), (-1.0, 1.0), (0.0, 7.0)):
        with pytest.raises(asm.errors.InputError, match="t0, t1 are .*expected t0 < t1 in the domain"):
            asm.proximity.enclosure(curve, t0, t1)
    with pytest.raises(asm.errors.InputError, match="across the knot 0.3"):
        asm.proximity.enclosure(CURVES[10], 0.2, 0.4)
    piece = asm.proximity.enclosure(curve, 0.0, 1.0)
    with pytest.raises(asm.errors.InputError, match="directions has a zero row"):
        piece.support([[0.0, 0.0]])
    for bound in ([], {}, np.zeros(2)):
        with pytest.raises(asm.errors.InputError, match="bound is .*; expected one of auto"):
            piece.support([[1.0, 0.0]], bound)
    with pytest.raises(asm.errors.InputError, match="bound is 'sphere'"):
        piece.support([[0.0, 1.0]], "sphere")


@kernel
def pair_bounds(ka, ta, pa, ra, ia, kb, tb, pb, rb, ib, xa, xb, out):
    """Taylor bound of boxes about their middles, and what is told; rows of intervals in ia and ib."""
    for i in range(ia.shape[0]):
        enclose(ka, ta, pa, ra, int(ia[i, 2]), ia[i, 0], ia[i, 1], xa)
        enclose(kb, tb, pb, rb, int(ib[i, 2]), ib[i, 0], ib[i, 1], xb)
        xa[FIRST_END], xa[LAST_END], xb[FIRST_END], xb[LAST_END] = 0.0, 0.0, 0.0, 0.0
        hessian = box_hessian(xa, 0, xb, 0)
        s, t = 0.5 * (ia[i, 0] + ia[i, 1]), 0.5 * (ib[i, 0] + ib[i, 1])
        a, b = enclosed_piece_at(xa, 0), enclosed_piece_at(xb, 0)
        lower, convex = taylor_bound(a, b, hessian, ValuesAt(xa, MID, s), ValuesAt(xb, MID, t))
        out[i, 0], out[i, 1], out[i, 2] = lower, convex, hessian.empty
        out[i, 3] = crossing_proven(xa, 0, xb, 0)
        n = (1.0, 0.0, 0.0)
        out[i, 4] = separation_along(xa, 0, xb, 0, 0, n, AUTO)


def local_intervals(curve, rng, count):
    rows = np.empty((count, 5))
    for i, (t0, t1) in enumerate(pieces(curve, rng, count)):
        breaks = spans(curve)
        k = int(np.clip(np.searchsorted(breaks, t0, side="right") - 1, 0, len(breaks) - 2))
        low, high = breaks[k : k + 2]
        local = isinstance(curve, asm.NurbsCurve)
        rows[i] = *(((t - low) / (high - low) if local else t) for t in (t0, t1)), k if local else 0, t0, t1
    return rows


PAIRS = [(0, 1), (0, 7), (4, 8), (4, 9), (7, 10), (8, 9), (3, 2), (11, 0)]


@pytest.mark.parametrize(("i", "j"), PAIRS)
def test_bounds_by_second_derivatives(i, j, cases):
    rng = np.random.default_rng(10 * i + j)
    a, b = CURVES[i], CURVES[j]
    one, two = packed_operand("a", a), packed_operand("b", b)
    count = cases(50, 150)
    rows_a, rows_b = local_intervals(a, rng, count), local_intervals(b, rng, count)
    out = np.empty((count, 5))
    pair_bounds(
        *(one.kind, one.table, one.pool, np.empty(one.workspace), rows_a),
        *(two.kind, two.table, two.pool, np.empty(two.workspace), rows_b),
        *(np.empty(PIECE), np.empty(PIECE), out),
    )
    sharp = 0
    for k in range(count):
        s = np.clip(np.linspace(*rows_a[k, 3:], 40), *rows_a[k, 3:])
        t = np.clip(np.linspace(*rows_b[k, 3:], 40), *rows_b[k, 3:])
        p, q = a.evaluate(s), b.evaluate(t)
        distance = np.linalg.norm(p[:, None] - q[None], axis=2)
        lower, convex, empty, crossing, along = out[k]
        least = distance.min()
        assert lower <= least * (1 + 1e-15) + 1e-12 * np.abs(p).max() * 1e-2
        assert along <= least * (1 + 1e-15) + 1e-14 * np.abs(p).max()
        sharp += lower > 0.99 * least
        half = 0.5 * distance**2
        if convex:
            # Along lines of the grid second differences of a convex function are not negative.
            rounding = 1e-14 * (half.max() + np.abs(p).max() * distance.max())
            assert np.diff(half, 2, axis=0).min() >= -rounding and np.diff(half, 2, axis=1).min() >= -rounding
        if empty:
            # No minimum strictly inside: the least of the grid is on its border.
            m, n = np.unravel_index(distance.argmin(), distance.shape)
            assert m in (0, 39) or n in (0, 39) or np.ptp(distance) < 1e-13 * np.abs(p).max()
        if crossing:
            assert least <= np.linalg.norm(np.ptp(p, axis=0)) + np.linalg.norm(np.ptp(q, axis=0))
    assert sharp > count // 5


def test_a_crossing_is_proven_where_there_is_one():
    line = asm.FormulaCurve(ca.vertcat(T, T), T, (-1.0, 1.0))
    out = np.empty((3, 5))
    rows = np.array([[-0.1, 0.1, 0, 0, 0], [-0.1, 0.1, 0, 0, 0], [-0.1, 0.1, 0, 0, 0]])
    one = packed_operand("a", line)
    other = asm.FormulaCurve(ca.vertcat(T, 0.05 * ca.cos(T) - T), T, (-1.0, 1.0))
    two = packed_operand("b", other)
    # They meet at t = 0.0249...: inside the first interval, outside the others.
    rows_b = np.array([[-0.1, 0.1, 0, 0, 0], [0.05, 0.25, 0, 0, 0], [-0.5, -0.3, 0, 0, 0]])
    pair_bounds(
        *(one.kind, one.table, one.pool, np.empty(one.workspace), rows),
        *(two.kind, two.table, two.pool, np.empty(two.workspace), rows_b),
        *(np.empty(PIECE), np.empty(PIECE), out),
    )
    assert out[:, 3].tolist() == [1.0, 0.0, 0.0]


@kernel(allocates=True)
def nearest(full, xa, ca_, wa, xb, cb, wb, first, out):
    g = np.zeros(ROOM)
    a, b = ConvexSet(xa, 0, ca_, wa), ConvexSet(xb, 0, cb, wb)
    how, v, kept = gjk(full, a, b, (first[0], first[1], first[2]), np.inf, 1e-14, g)
    out[0], out[1], out[2] = v
    on_a, on_b = witnesses(g, kept)
    out[3], out[4], out[5] = on_a
    out[6], out[7], out[8] = on_b
    return how


@pytest.mark.parametrize("d", [2, 3])
def test_gjk_of_hulls(d, cases):
    rng = np.random.default_rng(d)
    out = np.empty(9)
    seen = set()
    for _ in range(cases(60, 300)):
        m, n = rng.integers(1, 12, 2)
        a, b = np.zeros((m, 3)), np.zeros((n, 3))
        a[:, :d], b[:, :d] = rng.normal(size=(m, d)), rng.normal(size=(n, d)) + rng.choice([0.0, 2.0, 4.0])
        how = nearest(d + 1, a.ravel(), m, -1.0, b.ravel(), n, -1.0, a[0] - b[0], out)
        seen.add(how)
        v = out[:3]
        differences = (a[:, None] - b[None]).reshape(-1, 3)
        if how == APART:
            # The least vector of a convex set: no vertex is farther down along it.
            assert (differences @ v).min() >= v @ v - 1e-12
            np.testing.assert_allclose(out[3:6] - out[6:9], v, rtol=0, atol=1e-13)
        else:
            # No direction parts them.
            for n_ in directions(d, rng, 200):
                assert (differences[:, :d] @ n_).min() <= 1e-12
    assert {APART, INSIDE} <= seen


@pytest.mark.parametrize("d", [2, 3])
def test_gjk_of_ellipsoids(d):
    rng = np.random.default_rng(d)
    out = np.empty(9)
    for k in range(100):
        foci = np.zeros((2, 2, 3))
        foci[..., :d] = rng.normal(size=(2, 2, d))
        foci[1, :, 0] += 6.0
        width = rng.uniform(0, 2, 2) * (k % 5 > 0)
        how = nearest(d + 1, foci[0].ravel(), 2, width[0], foci[1].ravel(), 2, width[1], foci[0, 0] - foci[1, 0], out)
        assert how == APART
        for focus, w, p in zip(foci, width, (out[3:6], out[6:9]), strict=True):
            length = np.sqrt(w + ((focus[1] - focus[0]) ** 2).sum())
            assert np.linalg.norm(p - focus, axis=1).sum() <= length * (1 + 1e-9)
        # A direction proves what the points show.
        n = out[:3] / np.linalg.norm(out[:3])
        lower = 0.0
        for sign, focus, w in zip((1.0, -1.0), foci, width, strict=True):
            chi = focus[1] - focus[0]
            lower += sign * n @ focus.mean(axis=0) - 0.5 * np.sqrt(w + (n @ chi) ** 2)
        assert -1e-14 <= np.linalg.norm(out[:3]) - lower < 1e-6
