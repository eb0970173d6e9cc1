"""What may not change, or changes in a known way: other quaternions, other sides, other order, units, places."""

from __future__ import annotations

import numpy as np
import pytest

from assembly.geometry.faces.face import Face
from assembly.proximity import contact_jacobian, extremal_pair, gap_gradient, gap_hessian

DERIVATIVES = (contact_jacobian, gap_gradient, gap_hessian)
QUATERNIONS = np.array([3, 4, 5, 6, 10, 11, 12, 13])
POSITIONS = np.array([0, 1, 2, 7, 8, 9])


@pytest.fixture(scope="session")
def some(group, cases):
    """Nine of the pairs, with ``--long`` twenty; of a third of them the normals are equal, of the others opposed."""
    _, *f, _, g_u, g_v = group.pairs.frames(group.x, group.q)
    normals = [face.sign[:, None] * np.cross(*t) for face, t in ((group.pairs.f, f), (group.pairs.g, (g_u, g_v)))]
    along = (normals[0] * normals[1]).sum(axis=1)
    opposed, equal = np.flatnonzero(along < 0.0)[: cases(6, 14)], np.flatnonzero(along > 0.0)[: cases(3, 6)]
    assert opposed.size == cases(6, 14) and equal.size == cases(3, 6)
    return [*opposed, *equal]


def all_of(f, q_f, g, q_g, x):
    return [function(f, q_f, g, q_g, x) for function in DERIVATIVES]


def scaled(q, factor_f, factor_g):
    q = q.copy()
    q[3:7] *= factor_f
    q[10:] *= factor_g
    return q


@pytest.mark.parametrize("factors", [(-1.0, 1.0), (1.0, -1.0), (2.5, 0.4), (-0.125, -8.0)])
def test_length_and_sign_of_quaternions_mean_nothing(group, some, factors):
    for i in some:
        f, _, g, _ = group.arguments(i)
        q = scaled(group.q[i], *factors)
        start = group.x[i] + 1e-3 / group.speeds()[i]
        a = extremal_pair(*group.arguments(i), start)
        b = extremal_pair(f, q[:7], g, q[7:], start)
        assert a.status == b.status
        # Rounding of another normalization.
        np.testing.assert_allclose(b.parameters, a.parameters, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(b.gap, a.gap, rtol=0.0, atol=1e-14)
        jacobian, gradient, hessian = all_of(*group.arguments(i), group.x[i])
        other = all_of(f, q[:7], g, q[7:], group.x[i])
        # Rates along a quaternion that is c times as long are 1/c times as large.
        back = np.ones(14)
        back[3:7], back[10:] = factors
        for here, there in ((jacobian, other[0] * back), (gradient, other[1] * back), (hessian, other[2])):
            np.testing.assert_allclose(there, here, rtol=0.0, atol=1e-12 * (1.0 + np.abs(here).max()))


def test_nothing_changes_along_a_quaternion(group, some):
    for i in some:
        jacobian, gradient, _ = all_of(*group.arguments(i), group.x[i])
        for k in (3, 10):
            e = group.q[i, k : k + 4]
            size = np.linalg.norm(e)
            # Rates go as 1/|e|, so their product with e does not depend on it: rounding of a sum near the rates.
            assert np.abs(jacobian[:, k : k + 4] @ e).max() <= 1e-13 * (1.0 + np.abs(jacobian).max() * size)
            assert abs(gradient[k : k + 4] @ e) <= 1e-13 * (1.0 + np.abs(gradient).max() * size)


def flipped(face):
    return Face(face.surface, reversed=not face.reversed)


def test_reversing_f_turns_the_normal_and_the_sign_of_the_gap(group, some):
    for i in some:
        f, q_f, g, q_g = group.arguments(i)
        a, b = extremal_pair(f, q_f, g, q_g, group.x[i]), extremal_pair(flipped(f), q_f, g, q_g, group.x[i])
        np.testing.assert_allclose(b.parameters, a.parameters, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(b.normal, -a.normal, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(b.gap, -a.gap, rtol=0.0, atol=1e-14)
        here, there = all_of(f, q_f, g, q_g, group.x[i]), all_of(flipped(f), q_f, g, q_g, group.x[i])
        for one, two, sign in zip(here, there, (1.0, -1.0, -1.0), strict=True):
            np.testing.assert_allclose(two, sign * one, rtol=0.0, atol=1e-12 * (1.0 + np.abs(one).max()))


def test_reversing_g_changes_nothing(group, some):
    for i in some:
        f, q_f, g, q_g = group.arguments(i)
        a, b = extremal_pair(f, q_f, g, q_g, group.x[i]), extremal_pair(f, q_f, flipped(g), q_g, group.x[i])
        assert np.array_equal(a.parameters, b.parameters) and a.gap == b.gap
        for one, two in zip(
            all_of(f, q_f, g, q_g, group.x[i]), all_of(f, q_f, flipped(g), q_g, group.x[i]), strict=True
        ):
            assert np.array_equal(one, two)


def test_swapping_f_and_g(group, some):
    """With opposed normals everything is the same in the other order; with equal ones the gap changes its sign."""
    seen = set()
    for i in some:
        f, q_f, g, q_g = group.arguments(i)
        x = group.x[i]
        turned = x[[2, 3, 0, 1]]
        a, b = extremal_pair(f, q_f, g, q_g, x), extremal_pair(g, q_g, f, q_f, turned)
        sign = -np.sign(a.normal @ b.normal)
        seen.add(sign)
        np.testing.assert_allclose(b.parameters[[2, 3, 0, 1]], a.parameters, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(b.normal, -sign * a.normal, rtol=0.0, atol=1e-12)
        # The points of f and g, each from its own side.
        np.testing.assert_allclose(b.points[::-1], a.points, rtol=0.0, atol=1e-12)
        np.testing.assert_allclose(b.gap, sign * a.gap, rtol=0.0, atol=1e-13)
        jacobian, gradient, hessian = all_of(f, q_f, g, q_g, x)
        other = all_of(g, q_g, f, q_f, turned)
        back = np.r_[7:14, 0:7]
        twist = np.r_[6:12, 0:6]
        expected = (
            (other[0][np.ix_([2, 3, 0, 1], back)], jacobian),
            (sign * other[1][back], gradient),
            (sign * other[2][np.ix_(twist, twist)], hessian),
        )
        for found, here in expected:
            np.testing.assert_allclose(found, here, rtol=0.0, atol=1e-11 * (1.0 + np.abs(here).max()))
    assert seen == {-1.0, 1.0}


@pytest.mark.parametrize("unit", [1e-3, 1e3, 2.0**40])
def test_units(group, some, unit):
    """The same scene in other units: parameters stay (the knots do), lengths and their rates follow."""
    length = np.ones(14)
    length[POSITIONS] = unit
    twist = np.ones(12)
    twist[[0, 1, 2, 6, 7, 8]] = unit
    for i in some:
        f, q_f, g, q_g = group.arguments(i)
        large = [Face(s.surface.transformed(scale=unit), reversed=s.reversed) for s in (f, g)]
        q = group.q[i] * length
        start = group.x[i] + 0.01 / group.speeds()[i]
        a = extremal_pair(f, q_f, g, q_g, start)
        b = extremal_pair(large[0], q[:7], large[1], q[7:], start)
        assert a.status == b.status
        np.testing.assert_allclose(b.parameters, a.parameters, rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(b.gap / unit, a.gap, rtol=0.0, atol=1e-13)
        np.testing.assert_allclose(b.points / unit, a.points, rtol=0.0, atol=1e-11)
        here = all_of(f, q_f, g, q_g, group.x[i])
        there = all_of(large[0], q[:7], large[1], q[7:], group.x[i])
        expected = (there[0] * length, there[1] * length / unit, there[2] * np.outer(twist, twist) / unit)
        for found, one in zip(expected, here, strict=True):
            np.testing.assert_allclose(found, one, rtol=0.0, atol=1e-11 * (1.0 + np.abs(one).max()))


def test_offset(group, some):
    """A scene 131072 lengths away is the same scene to the last bit, where the sums of positions are exact."""
    for i in some:
        f, q_f, g, q_g = group.arguments(i)
        near = group.q[i].copy()
        near[POSITIONS] = np.round(near[POSITIONS] * 2.0**20) / 2.0**20
        far = near.copy()
        far[POSITIONS] += 2.0**17
        a = extremal_pair(f, near[:7], g, near[7:], group.x[i])
        b = extremal_pair(f, far[:7], g, far[7:], group.x[i])
        assert np.array_equal(a.parameters, b.parameters) and a.gap == b.gap and a.status == b.status
        # World points are rounded at the new place.
        np.testing.assert_allclose(b.points - 2.0**17, a.points, rtol=0.0, atol=1e-10)
        for one, two in zip(
            all_of(f, near[:7], g, near[7:], a.parameters), all_of(f, far[:7], g, far[7:], a.parameters), strict=True
        ):
            assert np.array_equal(one, two)
