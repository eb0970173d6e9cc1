"""The contact Jacobian, the gap's gradient and its Hessian against pairs that are solved again.

The errors are relative to the largest entry (plus one), lengths and radii being near one. `x` is where the pair was
placed, never what the library found. Differences have two errors: rounding over the step, and the formula's, of sixth
order in the step; with the steps below both are near 1e-10 (halving them divided the second by 64).
"""

from __future__ import annotations

import numpy as np

from assembly.proximity import contact_jacobian, extremal_pair, gap_gradient, gap_hessian
from tests.laws.witness import OFFSETS, SLOPE, moved, product

# For unit rates and lengths.
STEP = 2.5e-4


def worst(found, expected):
    """Largest error of every row, relative to the row's largest entry plus one."""
    axes = tuple(range(1, expected.ndim))
    return (np.abs(found - expected).max(axis=axes) / (1.0 + np.abs(expected).max(axis=axes))).max()


def each(function, group):
    return np.stack([function(*group.arguments(i), group.x[i]) for i in range(len(group.f))])


def steps(group, step):
    """A step a pair, shorter where its contact points run fast or a quaternion is short: (rows, 1)."""
    rates = np.abs(group.pairs.jacobian(group.x, group.q) * group.speeds()[:, :, None]).max(axis=(1, 2))
    return (step / (1.0 + rates))[:, None]


def test_the_random_pairs_are_extremal(group):
    # Placed by numpy: a few roundings of lengths near ten.
    assert np.abs(group.pairs.residual(group.x, group.q)).max() < 1e-13
    assert np.abs(group.pairs.gap(group.x, group.q) - group.gap).max() < 1e-13
    assert group.gap.min() < -0.1 and group.gap.max() > 1.0 and (group.gap == 0.0).sum() > len(group.f) / 20


def test_jacobian_is_the_implicit_derivative(group):
    # Both are exact but for rounding; rates up to 30 amplify it.
    assert worst(each(contact_jacobian, group), group.pairs.jacobian(group.x, group.q)) < 1e-12


def test_jacobian_is_the_difference_of_pairs_solved_again(group):
    # The pairs are right to some 1e-14 of their size where they are solved to the last bit.
    step = steps(group, STEP)[:, 0]
    found = each(contact_jacobian, group)
    expected = np.empty_like(found)
    for i in range(len(group.f)):
        f, _, g, _ = group.arguments(i)
        for k in range(14):
            solved = []
            for offset in OFFSETS:
                q = group.q[i].copy()
                q[k] += offset * step[i]
                pair = extremal_pair(f, q[:7], g, q[7:], group.x[i])
                solved.append(pair.parameters - group.x[i])
            expected[i, :, k] = SLOPE @ np.array(solved) / step[i]
    assert worst(found, expected) < 1e-9


def test_gradient_is_the_derivative_of_the_gap_with_the_pair_following(group):
    expected = np.stack([group.pairs.gap_rate(group.x, group.q, np.tile(e, (len(group.f), 1))) for e in np.eye(14)], 1)
    assert worst(each(gap_gradient, group), expected) < 1e-12


def test_gradient_is_the_difference_of_gaps_solved_again(group):
    found = each(gap_gradient, group)
    step = steps(group, STEP)[:, 0]
    expected = np.empty_like(found)
    for i in range(0, len(group.f), 4):
        f, _, g, _ = group.arguments(i)
        for k in range(14):
            gaps = []
            for offset in OFFSETS:
                q = group.q[i].copy()
                q[k] += offset * step[i]
                gaps.append(extremal_pair(f, q[:7], g, q[7:], group.x[i]).gap - group.gap[i])
            expected[i, k] = SLOPE @ np.array(gaps) / step[i]
    assert worst(found[::4], expected[::4]) < 1e-9


def curvature(pairs, x, q, twist, step):
    """d^2 gap / dt^2 along exp(t twist): differences of the gap's exact rate, the pair solved again each time."""
    total = 0.0
    for offset, weight in zip(OFFSETS, SLOPE, strict=True):
        there, rate = moved(q, twist, offset * step)
        total = total + weight * pairs.gap_rate(pairs.solve(x, there, 4), there, rate)
    return total / step[:, 0]


def test_hessian_is_the_second_derivative_along_any_twist(group):
    twist = np.random.default_rng(5).normal(size=(len(group.f), 12)) / 3.0
    found = np.einsum("ni,nij,nj->n", twist, each(gap_hessian, group), twist)
    expected = curvature(group.pairs, group.x, group.q, twist, steps(group, STEP))
    assert worst(found[:, None], expected[:, None]) < 1e-9


def test_hessian_entry_by_entry(group):
    # By polarization: e_i H e_j = (Q(e_i + e_j) - Q(e_i) - Q(e_j)) / 2.
    rows = np.arange(0, len(group.f), 20)
    i, j = np.tril_indices(12)
    twist = np.eye(12)[i] + (i != j)[:, None] * np.eye(12)[j]
    many = np.repeat(rows, i.size)
    squares = curvature(
        group.pairs.take(many), group.x[many], group.q[many], np.tile(twist, (rows.size, 1)), steps(group, STEP)[many]
    ).reshape(rows.size, i.size)
    alone = squares[:, i == j]
    entries = np.where(i == j, squares, 0.5 * (squares - alone[:, i] - alone[:, j]))
    found = each(gap_hessian, group.take(rows))
    assert worst(found[:, i, j], entries) < 1e-9
    assert worst(found[:, j, i], entries) < 1e-9


def test_hessian_is_the_difference_of_the_gradient_with_the_pair_solved_again(group):
    # Unlike the test above, all by the library: its gradient along its own pairs.
    rng = np.random.default_rng(6)
    twist = rng.normal(size=(len(group.f), 12)) / 3.0
    found = np.einsum("ni,nij,nj->n", twist, each(gap_hessian, group), twist)
    step = steps(group, STEP)
    expected = np.zeros(len(group.f))
    for offset, weight in zip(OFFSETS, SLOPE, strict=True):
        q, rate = moved(group.q, twist, offset * step)
        for i in range(len(group.f)):
            f, _, g, _ = group.arguments(i)
            pair = extremal_pair(f, q[i, :7], g, q[i, 7:], group.x[i])
            slope = gap_gradient(f, q[i, :7], g, q[i, 7:], pair.parameters) @ rate[i]
            expected[i] += weight * slope / step[i, 0]
    assert worst(found[:, None], expected[:, None]) < 1e-9


def test_hessian_is_symmetric(group):
    hessian = each(gap_hessian, group)
    # The same sums in another order.
    assert worst(hessian, hessian.transpose(0, 2, 1)) < 1e-14


def test_rigid_motion_of_both_bodies_changes_nothing(group):
    """Moving f and g alike leaves parameters and gap: velocities of a common rigid motion are in every null space."""
    rng = np.random.default_rng(7)
    jacobian, gradient = each(contact_jacobian, group), each(gap_gradient, group)
    rate = np.zeros((len(group.f), 14))
    v, w = rng.normal(size=(2, len(group.f), 3))
    for k in (0, 7):
        rate[:, k : k + 3] = v + np.cross(w, group.q[:, k : k + 3])
        rate[:, k + 3 : k + 7] = 0.5 * product(np.pad(w, ((0, 0), (1, 0))), group.q[:, k + 3 : k + 7])
    # Rounding of sums of terms up to a few hundred.
    assert np.abs(np.einsum("nij,nj->ni", jacobian, rate)).max() < 1e-11
    assert np.abs(np.einsum("nj,nj->n", gradient, rate)).max() < 1e-12
