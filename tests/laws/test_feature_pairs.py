"""Laws of pairs of any two features, and of surfaces and curves against a witness and the paper's own matrix.

Errors are relative to the largest entry (plus one), lengths and radii being near one. `x` is where the pair was placed.
Differences are of sixth order; their steps are shorter where contact points run fast (`test_contact_velocity.py`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from assembly.geometry.faces.face import Face
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity import (
    PairStatus,
    curve_contact_jacobian,
    curve_gap_gradient,
    curve_gap_hessian,
    extremal_curve_pair,
)
from assembly.proximity.brep.records import EDGE, EDGE_POINT, FACE, FACE_POINT, VERTEX
from tests.laws.curve_witness import CurveStack, SurfaceCurve, errata_jacobian
from tests.laws.feature_scenes import (
    GAP,
    NORMAL,
    POINT_F,
    POINT_G,
    PROPER,
    Feature,
    Packed,
    place,
    plane_curve,
    random_feature,
    space_curve,
)
from tests.laws.scenes import dome, inside, quadratic, random_gap
from tests.laws.witness import OFFSETS, SLOPE, Stack, moved, product, rotated

STEP = 2e-4
# Around a point, all ways.
RING = np.stack([np.cos(np.arange(16) * np.pi / 8.0), np.sin(np.arange(16) * np.pi / 8.0)], axis=1)
# The points of a pair in what `find_features` writes.
POINT = (slice(POINT_F, POINT_F + 3), slice(POINT_G, POINT_G + 3))
# Surface, and what the curve lies on.
CURVES = (
    ("dome", None),
    ("dome", "dome"),
    ("dome", "quadratic"),
    ("quadratic", None),
    ("quadratic", "dome"),
    ("quadratic", "quadratic"),
)
MAKERS = {"dome": dome, "quadratic": quadratic}


@dataclass(frozen=True)
class Group:
    faces: list[Face]
    curves: list
    carriers: list[NurbsSurface | None]
    q: np.ndarray
    x: np.ndarray
    gap: np.ndarray
    witness: SurfaceCurve

    def arguments(self, i):
        return self.faces[i], self.q[i, :7], self.curves[i], self.q[i, 7:]

    def take(self, rows):
        lists = [[items[i] for i in rows] for items in (self.faces, self.curves, self.carriers)]
        return Group(*lists, self.q[rows], self.x[rows], self.gap[rows], self.witness.take(rows))


def random_curves(seed, kind, on, count):
    """Surfaces (with sides) and curves, placed; well away from singular pairs, near which differences say nothing."""
    rng = np.random.default_rng(seed)
    surfaces = [MAKERS[kind](rng) for _ in range(12)]
    carriers = [None] * 12 if on is None else [MAKERS[on](rng) for _ in range(12)]
    rows = []
    for _ in range(2 * count):
        face = Face(surfaces[rng.integers(12)], reversed=bool(rng.integers(2)))
        carrier = carriers[rng.integers(12)]
        curve, t = space_curve(rng) if carrier is None else plane_curve(rng, carrier, inside(rng, carrier))
        f = Feature(FACE, face=face)
        g = Feature(EDGE, face=None if carrier is None else Face(carrier), curve=curve)
        uv, gap = inside(rng, face.surface), random_gap(rng, 0.3)
        q, _n = place(rng, f, uv, g, (t, 0.0), gap)
        rows.append((face, curve, carrier, q, (*uv, t), gap))
    faces, curves, carriers, q, x, gap = (list(column) for column in zip(*rows, strict=True))
    witness = SurfaceCurve(
        Stack([f.surface for f in faces], [f.sign for f in faces]),
        CurveStack(curves),
        None if on is None else Stack(carriers),
    )
    # Placed to rounding, which a curve of a twentieth of the surface's size feels: two steps of the witness's Newton.
    x = witness.solve(np.array(x), np.array(q), 2)
    group = Group(faces, curves, carriers, np.array(q), x, np.array(gap), witness)
    rates = witness.jacobian(group.x, group.q) * witness.speeds(group.x, group.q)[:, :, None]
    tame = np.flatnonzero(np.abs(rates).max(axis=(1, 2)) < 15.0)
    assert tame.size >= count, f"{tame.size} of {2 * count} random pairs are away from singular ones"
    return group.take(tame[:count])


@pytest.fixture(scope="module", params=range(len(CURVES)), ids=[f"{a}-{b or 'space'}" for a, b in CURVES])
def group(request, cases):
    """Random pairs; with ``--long`` 170, 1,020 over all parameters."""
    return random_curves(50 + request.param, *CURVES[request.param], cases(68, 170))


def worst(found, expected):
    """Largest error of every row, relative to the row's largest entry plus one."""
    axes = tuple(range(1, expected.ndim))
    return (np.abs(found - expected).max(axis=axes) / (1.0 + np.abs(expected).max(axis=axes))).max()


def each(function, group):
    return np.stack([function(*group.arguments(i), group.x[i], group.carriers[i]) for i in range(len(group.faces))])


def steps(group, step):
    """Shorter where points run fast, in lengths or in parts of a curve (some are short, and bend along that)."""
    rates = np.abs(group.witness.jacobian(group.x, group.q))
    scale = group.witness.speeds(group.x, group.q)
    scale[:, 2] = np.maximum(scale[:, 2], [3.0 / (c.domain[1] - c.domain[0]) for c in group.curves])
    return (step / (1.0 + (rates * scale[:, :, None]).max(axis=(1, 2))))[:, None]


# ---- a surface and a curve: public functions ----------------------------------------------------------------------


def test_the_random_pairs_are_extremal(group):
    # Placed by numpy: a few roundings of lengths near ten.
    assert np.abs(group.witness.residual(group.x, group.q)).max() < 1e-12
    assert np.abs(group.witness.gap(group.x, group.q) - group.gap).max() < 1e-13
    assert group.gap.min() < -0.01 and group.gap.max() > 0.1 and (group.gap == 0.0).sum() > len(group.faces) / 17


def test_curve_jacobian_is_the_implicit_derivative(group):
    # Rates of parameters up to some hundreds: the rounding of points near ten moves x by that much more, and at an x
    # that is off by 1e-12 the two forms, which are the same at a pair, differ by some 1e-11.
    assert worst(each(curve_contact_jacobian, group), group.witness.jacobian(group.x, group.q)) < 1e-10


def test_curve_jacobian_is_the_corrected_matrix_of_the_paper(group):
    found = each(curve_contact_jacobian, group)
    for i in range(len(group.faces)):
        t, carrier = group.x[i, 2], group.carriers[i]
        c, d, h = jet = group.curves[i].evaluate(t, 2)
        if carrier is not None:
            s, su, sv, suu, suv, svv = carrier.evaluate(c[0], c[1], 2)
            bent = suu * d[0] ** 2 + 2.0 * suv * d[0] * d[1] + svv * d[1] ** 2
            jet = (s, su * d[0] + sv * d[1], bent + su * h[0] + sv * h[1])
        expected = errata_jacobian(group.faces[i].surface, group.q[i, :7], jet, group.q[i, 7:], group.x[i])
        assert worst(found[i : i + 1], expected[None]) < 1e-11


def test_curve_jacobian_is_the_difference_of_pairs_solved_again(group):
    step = steps(group, 0.7 * STEP)[:, 0]
    found = each(curve_contact_jacobian, group)
    gradient = each(curve_gap_gradient, group)
    for i in range(0, len(group.faces), 3):
        face, _, curve, _ = group.arguments(i)
        rates, slopes = np.empty((3, 14)), np.empty(14)
        for k in range(14):
            solved = []
            for offset in OFFSETS:
                q = group.q[i].copy()
                q[k] += offset * step[i]
                pair = extremal_curve_pair(face, q[:7], curve, q[7:], group.x[i], group.carriers[i])
                assert pair.status is PairStatus.CONVERGED
                solved.append([*(pair.parameters - group.x[i]), pair.gap - group.gap[i]])
            *rates[:, k], slopes[k] = SLOPE @ np.array(solved) / step[i]
        # Differences of curves whose curvature changes within a tenth of their length: their sixth order is not small.
        assert worst(found[i : i + 1], rates[None]) < 1e-8
        assert worst(gradient[i : i + 1], slopes[None]) < 1e-9


def test_curve_gradient_is_the_derivative_of_the_gap(group):
    columns = [group.witness.gap_rate(group.x, group.q, np.tile(e, (len(group.faces), 1))) for e in np.eye(14)]
    assert worst(each(curve_gap_gradient, group), np.stack(columns, 1)) < 1e-12


def curvature(group, twist, step):
    """d^2 gap / dt^2 along exp(t twist): differences of the witness's exact rate, its pair solved again each time."""
    total = 0.0
    for offset, weight in zip(OFFSETS, SLOPE, strict=True):
        there, rate = moved(group.q, twist, offset * step)
        x = group.witness.solve(group.x, there, 4)
        total = total + weight * group.witness.gap_rate(x, there, rate)
    return total / step[:, 0]


def test_curve_hessian_is_the_second_derivative_along_any_twist(group):
    twist = np.random.default_rng(5).normal(size=(len(group.faces), 12)) / 3.0
    found = np.einsum("ni,nij,nj->n", twist, each(curve_gap_hessian, group), twist)
    expected = curvature(group, twist, steps(group, STEP))
    assert worst(found[:, None], expected[:, None]) < 1e-8


def test_curve_hessian_entry_by_entry(group):
    # By polarization: e_i H e_j = (Q(e_i + e_j) - Q(e_i) - Q(e_j)) / 2.
    rows = np.arange(0, len(group.faces), 17 if len(group.faces) < 100 else 34)
    i, j = np.tril_indices(12)
    twist = np.eye(12)[i] + (i != j)[:, None] * np.eye(12)[j]
    many = np.repeat(rows, i.size)
    part = group.take(many)
    squares = curvature(part, np.tile(twist, (rows.size, 1)), steps(part, STEP)).reshape(rows.size, i.size)
    alone = squares[:, i == j]
    entries = np.where(i == j, squares, 0.5 * (squares - alone[:, i] - alone[:, j]))
    found = each(curve_gap_hessian, group.take(rows))
    assert worst(found[:, i, j], entries) < 1e-8
    assert worst(found[:, j, i], entries) < 1e-8


# ---- every pair of kinds: the kernels --------------------------------------------------------------------------------

NAMES = {FACE: "face", EDGE: "edge", VERTEX: "vertex", EDGE_POINT: "point of an edge", FACE_POINT: "point of a face"}
# Points that stay where they are on an edge or a face are looked at over faces alone.
POINTS = {EDGE_POINT, FACE_POINT}
KINDS = [(f, g) for f in NAMES for g in NAMES if not POINTS & {f, g} or FACE in (f, g)]


@dataclass(frozen=True)
class Case:
    f: Feature
    g: Feature
    packed: Packed
    q: np.ndarray
    x: np.ndarray
    n: np.ndarray
    gap: float

    @property
    def speed(self):
        """Lengths a unit of each parameter, for rates of points."""
        out = np.ones(4)
        for side, (feature, x) in enumerate(((self.f, self.x[:2]), (self.g, self.x[2:]))):
            for k, tangent in enumerate(feature.jet(x)[1:]):
                out[2 * side + k] = np.linalg.norm(tangent)
        return out

    @property
    def moves(self):
        """Whether each parameter is solved for: a vertex has none, a point that stays keeps its own."""
        return np.repeat([self.f.kind not in POINTS, self.g.kind not in POINTS], 2) & (self.x != 0.0)


def random_cases(kind_f, kind_g, count):
    """Pairs of two kinds at all gaps they can have, away from singular ones."""
    rng = np.random.default_rng(100 + 3 * kind_f + kind_g)
    signed = FACE in (kind_f, kind_g) or (kind_f, kind_g) == (EDGE, EDGE)
    cases = []
    while len(cases) < count:
        f, x_f = random_feature(rng, kind_f)
        g, x_g = random_feature(rng, kind_g)
        # A distance has no derivative at zero, and no sign.
        gap = random_gap(rng, 0.3) if signed else rng.uniform(0.2, 1.5)
        q, n = place(rng, f, x_f, g, x_g, gap)
        case = Case(f, g, Packed(f, g), q, np.array(x_f + x_g), n, gap)
        rates, _gradient, hessian, error = case.packed.derivatives(q, case.x, n)
        assert error < 1e-13
        if np.abs(rates * case.speed[:, None]).max() < 10.0 and np.abs(hessian).max() < 30.0:
            cases.append(case)
    return cases


@pytest.fixture(scope="module", params=KINDS, ids=[f"{NAMES[f]}-{NAMES[g]}" for f, g in KINDS])
def pairs(request, cases):
    return random_cases(*request.param, cases(9, 40))


def test_pairs_are_found_from_nearby(pairs):
    rng = np.random.default_rng(8)
    for case in pairs:
        start = case.x + 1e-3 / case.speed * rng.uniform(-1.0, 1.0, 4) * case.moves
        status, out = case.packed.solve(case.q, start, case.n)
        assert status == "CONVERGED"
        # Rounding of lengths near ten, times rates below ten.
        assert np.abs((out[:4] - case.x) * case.speed).max() < 1e-12
        assert abs(out[GAP] - case.gap) < 1e-13
        assert np.abs(out[NORMAL : NORMAL + 3] - case.n).max() < 1e-12


def test_rates_gradient_and_hessian_are_differences_of_pairs_solved_again(pairs):
    rng = np.random.default_rng(9)
    for case in pairs:
        rates, gradient, hessian, _error = case.packed.derivatives(case.q, case.x, case.n)
        twist = rng.normal(size=(1, 12)) / 3.0
        step = STEP / (1.0 + np.abs(rates * case.speed[:, None]).max())
        along = moved(case.q[None], twist, 0.0)[1][0]
        total = np.zeros(6)
        for offset, weight in zip(OFFSETS, SLOPE, strict=True):
            q, rate = (a[0] for a in moved(case.q[None], twist, offset * step))
            status, out = case.packed.solve(q, case.x, case.n)
            assert status == "CONVERGED"
            slope = case.packed.derivatives(q, out[:4], case.n)[1] @ rate
            total += weight / step * np.array([*(out[:4] - case.x) * case.speed, out[GAP] - case.gap, slope])
        expected = [*(rates @ along) * case.speed, gradient @ along, twist[0] @ hessian @ twist[0]]
        np.testing.assert_allclose(total[4], expected[4], rtol=0.0, atol=1e-9)
        scale = 1.0 + np.abs(rates * case.speed[:, None]).max() + np.abs(hessian).max()
        # Curves bend within tenths of their length: the sixth order is felt where points run fast.
        np.testing.assert_allclose(total, expected, rtol=0.0, atol=1e-8 * scale)


def test_hessian_of_every_kind_entry_by_entry(pairs):
    i, j = np.tril_indices(12)
    twists = np.eye(12)[i] + (i != j)[:, None] * np.eye(12)[j]
    for case in pairs[:3]:
        rates, _gradient, hessian, _error = case.packed.derivatives(case.q, case.x, case.n)
        step = STEP / (1.0 + np.abs(rates * case.speed[:, None]).max())
        squares = np.zeros(i.size)
        for offset, weight in zip(OFFSETS, SLOPE, strict=True):
            poses, along = moved(np.tile(case.q, (i.size, 1)), twists, offset * step)
            for k in range(i.size):
                _status, out = case.packed.solve(poses[k], case.x, case.n)
                squares[k] += weight / step * (case.packed.derivatives(poses[k], out[:4], case.n)[1] @ along[k])
        alone = squares[i == j]
        entries = np.where(i == j, squares, 0.5 * (squares - alone[i] - alone[j]))
        np.testing.assert_allclose(hessian[i, j], entries, rtol=0.0, atol=1e-8 * (1.0 + np.abs(hessian).max()))
        np.testing.assert_array_equal(hessian, hessian.T)


def test_swapping_the_bodies_swaps_everything(pairs):
    parameters, poses = np.r_[2:4, 0:2], np.r_[7:14, 0:7]
    twists = np.r_[6:12, 0:6]
    for case in pairs:
        other = Packed(case.g, case.f)
        q, x = case.q[poses], case.x[parameters]
        status, out = other.solve(q, x, -case.n)
        assert status == "CONVERGED"
        # Another order of the same sums; of the curvatures, rounding times rates.
        assert abs(out[GAP] - case.gap) < 1e-13
        assert np.abs(out[NORMAL : NORMAL + 3] + case.n).max() < 1e-12
        rates, gradient, hessian, _error = case.packed.derivatives(case.q, case.x, case.n)
        rates_2, gradient_2, hessian_2, _error = other.derivatives(q, x, -case.n)
        assert worst(gradient_2[None, poses], gradient[None]) < 1e-13
        assert worst(hessian_2[np.ix_(twists, twists)][None], hessian[None]) < 1e-12
        scale = case.speed[:, None]
        assert worst((rates_2[parameters][:, poses] * scale)[None], (rates * scale)[None]) < 1e-12


def test_an_edge_is_proper_where_the_gap_grows_along_it(cases):
    # The gap of points of the edge beside the pair, each found again, against what the pair says of itself.
    step, told, count = 1e-4, [], cases(27, 80)
    for kinds in ((FACE, EDGE), (EDGE, FACE)):
        for case in random_cases(*kinds, count):
            f, g = (Feature(EDGE_POINT, s.face, s.curve) if s.kind == EDGE else s for s in (case.f, case.g))
            column = 2 * kinds.index(EDGE)
            gaps = []
            for side in (-1.0, 1.0):
                x = case.x.copy()
                x[column] += side * step / case.speed[column]
                status, out = Packed(f, g).solve(case.q, x, case.n)
                gaps.append(out[GAP] if status == "CONVERGED" else np.nan)
            bend = (gaps[0] - 2.0 * case.gap + gaps[1]) / step**2
            status, out = case.packed.solve(case.q, case.x, case.n)
            # Points of the face around the foot, seen from the edge's point.
            k = kinds.index(FACE)
            at = case.x[2 * k : 2 * k + 2] + step / case.speed[2 * k : 2 * k + 2] * RING
            pose = case.q[7 * k : 7 * k + 7]
            feet = rotated(np.tile(pose, (len(at), 1)), (f, g)[k].face.surface.evaluate(*at.T)) + pose[:3]
            farther = np.linalg.norm(feet - out[POINT[1 - k]], axis=1) - abs(case.gap)
            # Differences of second order say nothing of what is flat: they are off by some 1e-4.
            if abs(bend) > 1e-2 and np.abs(farther).min() > 1e-2 * step**2:
                proper = bend > 0.0 and (farther > 0.0).all()
                assert (out[PROPER] == 1.0) == proper
                told.append(proper)
    # Of twice the count: what is left out is flat, next to a center of curvature, or has no foot beside it.
    assert len(told) > 1.75 * count and sum(told) > count / 2 and len(told) - sum(told) > count / 2


def test_rigid_motion_of_both_bodies_changes_nothing(pairs):
    rng = np.random.default_rng(7)
    for case in pairs:
        rates, gradient, _hessian, _error = case.packed.derivatives(case.q, case.x, case.n)
        v, w = rng.normal(size=(2, 3))
        direction = np.zeros(14)
        for k in (0, 7):
            direction[k : k + 3] = v + np.cross(w, case.q[k : k + 3])
            direction[k + 3 : k + 7] = 0.5 * product(np.array([[0.0, *w]]), case.q[None, k + 3 : k + 7])[0]
        # Rounding of sums of terms up to a hundred.
        assert np.abs((rates @ direction) * case.speed).max() < 1e-11
        assert abs(gradient @ direction) < 1e-12
