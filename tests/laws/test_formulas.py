"""The formulas of docs/derivations.md as they are written there, in plain numpy, where no other test holds them.

Those of the pair and its rates, and what the paper prints; `test_solve_formulas.py` has the others. Pairs are those of
the laws: bicubic, rational, skewed, both orientations, gaps from interpenetrating to apart. Rates grow up to 30
(see `scenes.random_group`), so 1e-11 is some hundred roundings.
"""

from __future__ import annotations

import numpy as np
import pytest

from assembly._record import Store
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.evaluate import surface_at
from assembly.geometry.splines.pole import pole_frame
from assembly.kinematics.pose import angular_velocity_map, multiply, rotation_matrix, skew
from assembly.proximity import gap_hessian
from assembly.proximity.extrema.pair_matrix import RANK, pair_matrix
from tests.laws.witness import STEP, moved

EYE = np.eye(2)


def dots(a, b):
    return np.einsum("ni,ni->n", a, b)


def mats(*factors):
    """Products of stacks of matrices, the last one perhaps of vectors (rows, k)."""
    *first, last = factors
    vectors = last.ndim == 2
    out = last[..., None] if vectors else last
    for factor in reversed(first):
        out = factor @ out
    return out[..., 0] if vectors else out


def turned(a):
    """The transposed matrices."""
    return a.transpose(0, 2, 1)


def second_derivatives(pairs, x, q):
    """f_uu, f_uv, f_vv, g_uu, g_uv, g_vv in world axes, (rows, 3) each, by complex steps."""
    out = []
    for k in range(2):
        along = [pairs.frames(x + 1j * STEP * np.eye(4)[2 * k + i], q.astype(complex)) for i in range(2)]
        su, sv = 3 * k + 1, 3 * k + 2
        out += [along[0][su].imag / STEP, along[0][sv].imag / STEP, along[1][sv].imag / STEP]
    return out


def shape_operator(n, inverse, uu, uv, vv):
    """-J^T [S_ij.n] J for J the inverse of tangent coordinates."""
    form = np.stack([dots(uu, n), dots(uv, n), dots(uv, n), dots(vv, n)], 1).reshape(-1, 2, 2)
    return -mats(turned(inverse), form, inverse)


class Local:
    """What the first section names: n, P, d, beta, E, T, A, C, H, at parameters that need not be extremal."""

    def __init__(self, pairs, x, q):
        self.f, fu, fv, self.g, gu, gv = pairs.frames(x, q)
        fuu, fuv, fvv, guu, guv, gvv = second_derivatives(pairs, x, q)
        self.d = self.g - self.f
        n = pairs.f.sign[:, None] * np.cross(fu, fv)
        self.n = n / np.linalg.norm(n, axis=1, keepdims=True)
        along = fu / np.linalg.norm(fu, axis=1, keepdims=True)
        self.p = np.stack([along, np.cross(self.n, along)], 2)
        self.beta = dots(self.n, self.d)
        self.e = mats(turned(self.p), np.stack([fu, fv], 2))
        self.t = mats(turned(self.p), np.stack([gu, gv], 2))
        self.a = shape_operator(self.n, np.linalg.inv(self.e), fuu, fuv, fvv)
        self.c = shape_operator(self.n, np.linalg.inv(self.t), guu, guv, gvv)
        self.k = EYE + self.beta[:, None, None] * self.a
        self.h = self.c @ self.k - self.a
        self.r1 = mats(turned(self.p), self.d)
        self.r2 = -mats(np.linalg.inv(turned(self.t)), np.stack([dots(self.n, gu), dots(self.n, gv)], 1))
        self.tangents = fu, fv, gu, gv
        self.second = fuu, fuv, fvv, guu, guv, gvv


def velocities(local, q, twist):
    """v, omega, z12, z34 of twists (rows, 12)."""
    v_f, w_f, v_g, w_g = np.split(twist, 4, axis=1)
    v = v_g + np.cross(w_g, local.g - q[:, 7:10]) - v_f - np.cross(w_f, local.g - q[:, :3])
    omega = w_g - w_f
    p = turned(local.p)
    return v, omega, mats(p, v), mats(p, np.cross(omega, local.n))


@pytest.fixture(scope="module")
def local(group):
    return Local(group.pairs, group.x, group.q)


@pytest.fixture(scope="module")
def twist(group):
    return np.random.default_rng(41).normal(size=(len(group.f), 12)) / 3.0


def close(found, expected, tolerance):
    """Largest error of every row, relative to the row's largest entry plus one."""
    error = np.abs(found - expected).reshape(len(found), -1).max(axis=1)
    assert (error / (1.0 + np.abs(expected).reshape(len(found), -1).max(axis=1))).max() < tolerance


def test_rates_by_two_solves_in_one_frame(group, local, twist):
    _, _, z12, z34 = velocities(local, group.q, twist)
    a = mats(np.linalg.inv(local.h), mats(local.c, z12) - z34)
    b = mats(local.k, a) - z12
    found = np.concatenate([mats(np.linalg.inv(local.e), a), mats(np.linalg.inv(local.t), b)], 1)
    close(found, group.pairs.rates(group.x, group.q, moved(group.q, twist, 0.0)[1]), 1e-11)
    close(mats(local.c, b) - mats(local.a, a), -z34, 1e-11)


def test_in_the_frame_of_f_z34_is_omega_y_and_minus_omega_x(local, group, twist):
    _, omega, _, z34 = velocities(local, group.q, twist)
    x, y = local.p[:, :, 0], local.p[:, :, 1]
    # The second tangent is n x x: the frame is right-handed.
    close(z34, np.stack([dots(omega, y), -dots(omega, x)], 1), 1e-13)


def test_newton_s_step_leads_back_to_the_pair(group):
    rng = np.random.default_rng(42)
    offset = 1e-6 * rng.normal(size=group.x.shape) / group.speeds()
    there = Local(group.pairs, group.x + offset, group.q)
    a = mats(np.linalg.inv(there.h), mats(there.c, there.r1) - there.r2)
    b = mats(there.k, a) - there.r1
    step = np.concatenate([mats(np.linalg.inv(there.e), a), mats(np.linalg.inv(there.t), b)], 1)
    # What is left is of second order: 1e-12 times curvatures and rates.
    assert np.abs((offset + step) * group.speeds()).max() < 1e-9


def test_second_derivative_of_the_gap(group, local, twist):
    v, _, z12, z34 = velocities(local, group.q, twist)
    _, w_f, _, w_g = np.split(twist, 4, axis=1)
    a = mats(np.linalg.inv(local.h), mats(local.c, z12) - z34)
    found = dots(a, mats(local.a, z12) - mats(local.k, z34)) + dots(z12, z34)
    found += 2.0 * dots(w_f, np.cross(local.n, v))
    for sign, w, origin in ((1.0, w_g, group.q[:, 7:10]), (-1.0, w_f, group.q[:, :3])):
        found += sign * dots(local.n, np.cross(w, np.cross(w, local.g - origin)))
    hessians = np.stack([gap_hessian(*group.arguments(i), group.x[i]) for i in range(len(group.f))])
    close(found[:, None], np.einsum("ni,nij,nj->n", twist, hessians, twist)[:, None], 1e-11)


def test_determinants_of_both_systems(group, local):
    det_e, det_t, det_h = (np.linalg.det(m) for m in (local.e, local.t, local.h))
    matrix = group.pairs.residual_in_x(group.x, group.q)
    # Relative to Hadamard's bound, which is what rounding scales with.
    bound = np.prod(np.linalg.norm(matrix, axis=2), axis=1)
    assert (np.abs(np.linalg.det(matrix) - det_e**4 * det_t**2 * det_h) / bound).max() < 1e-13

    def slopes(x, q):
        f, fu, fv, g, gu, gv = group.pairs.frames(x, q)
        return np.stack([-dots(g - f, fu), -dots(g - f, fv), dots(g - f, gu), dots(g - f, gv)], 1)

    steps = 1j * STEP * np.eye(4)
    textbook = np.stack([slopes(group.x + s, group.q.astype(complex)).imag / STEP for s in steps], 2)
    bound = np.prod(np.linalg.norm(textbook, axis=2), axis=1)
    expected = group.gap**2 * det_e**2 * det_t**2 * det_h
    assert (np.abs(np.linalg.det(textbook) - expected) / bound).max() < 1e-13
    touching = group.gap == 0.0
    values = np.linalg.svd(textbook[touching], compute_uv=False)
    assert touching.sum() > len(group.f) / 20 and (values[:, 2] / values[:, 0]).max() < 1e-12
    # With each shape operator with respect to the surface's own outward normal, the two opposed.
    k_f, k_g = local.a, -local.c
    close(det_h, np.linalg.det(k_g + k_f + group.gap[:, None, None] * k_f @ k_g), 1e-11)


class Paper:
    """Appendix A of paper 001 in the two surfaces' own frames: R, sigma, E, F, v and omega in the axes of g."""

    def __init__(self, local, q, twist):
        fu, fv, gu, gv = local.tangents
        second = local.second
        frames, self.e, self.f = [], [], []
        for (su, sv), (suu, suv, svv) in (((fu, fv), second[:3]), ((gu, gv), second[3:])):
            normal = np.cross(su, sv)
            length = np.linalg.norm(normal, axis=1, keepdims=True)
            z = normal / length
            x = su / np.linalg.norm(su, axis=1, keepdims=True)
            frames.append(np.stack([x, np.cross(z, x), z], 2))
            slopes = []
            for a, b in ((suu, suv), (suv, svv)):
                change = np.cross(a, sv) + np.cross(su, b)
                slopes.append((change - dots(z, change)[:, None] * z) / length)
            tangents = turned(frames[-1][:, :, :2])
            self.e.append(mats(tangents, np.stack([su, sv], 2)))
            self.f.append(mats(tangents, np.stack(slopes, 2)))
        p_f, p_g = (frame[:, :, :2] for frame in frames)
        self.r = mats(turned(p_g), p_f)
        self.sigma = np.sign(dots(frames[0][:, :, 2], frames[1][:, :, 2]))[:, None, None]
        self.beta = dots(frames[0][:, :, 2], local.d)[:, None, None]
        self.axes = turned(frames[1])
        v, omega, _, _ = velocities(local, q, twist)
        self.v, self.omega = mats(self.axes, v), mats(self.axes, omega)
        self.right = np.concatenate([self.v[:, :2], self.omega[:, 1:2], -self.omega[:, :1]], 1)

    def rates(self, beta):
        """From the block system, with a beta that may be wrong."""
        blocks = [
            [self.r @ (self.e[0] + beta * self.f[0]), -self.e[1]],
            [self.sigma * self.r @ self.f[0], -self.f[1]],
        ]
        return np.linalg.solve(np.block(blocks), self.right[..., None])[..., 0]


@pytest.fixture(scope="module")
def paper(group, local, twist):
    return Paper(local, group.q, twist)


def test_the_corrected_system_and_its_inverse_by_blocks(group, paper, twist):
    assert {-1.0, 1.0} == set(paper.sigma.ravel())
    expected = group.pairs.rates(group.x, group.q, moved(group.q, twist, 0.0)[1])
    close(paper.rates(paper.beta), expected, 1e-11)
    a1, b1 = paper.r @ (paper.e[0] + paper.beta * paper.f[0]), paper.sigma * paper.r @ paper.f[0]
    inverse = np.linalg.inv(paper.e[1])
    k = paper.f[1] @ inverse
    unit = np.broadcast_to(EYE, k.shape)
    j = np.linalg.solve(k @ a1 - b1, np.concatenate([k, -unit], 2))
    second = inverse @ (a1 @ j - np.concatenate([unit, 0.0 * unit], 2))
    close(mats(np.concatenate([j, second], 1), paper.right), expected, 1e-11)


def test_the_printed_sign_of_beta_holds_at_contact_only(group, paper, twist):
    expected = group.pairs.rates(group.x, group.q, moved(group.q, twist, 0.0)[1])
    printed = paper.rates(-paper.beta)
    error = (np.abs(printed - expected) / (1.0 + np.abs(expected))).max(axis=1)
    touching = group.gap == 0.0
    assert error[touching].max() < 1e-11
    # Some of the surfaces are nearly flat, and there the term with beta hardly counts.
    assert np.median(error[np.abs(group.gap) > 0.1]) > 1e-3


def test_the_product_of_equation_20(group, local, paper, twist):
    """With x_g - x_f as the lever of the middle block, factors 1/4 and a positive last block; unit quaternions."""
    for i in range(0, len(group.f), 20):
        rate = moved(group.q[i : i + 1], twist[i : i + 1], 0.0)[1][0]
        q, rate = group.q[i].copy(), rate.copy()
        for k in (3, 10):
            length = np.linalg.norm(q[k : k + 4])
            q[k : k + 4] /= length
            rate[k : k + 4] /= length
        r_f, r_g = rotation_matrix(q[3:7]), rotation_matrix(q[10:])
        g_f, g_g = angular_velocity_map(q[3:7], True), angular_velocity_map(q[10:], True)
        axes, zero = paper.axes[i], np.zeros
        left = np.block(
            [
                [-axes, zero((3, 4)), axes, -axes @ skew(local.g[i] - q[7:10]) @ r_g @ g_g],
                [zero((3, 10)), axes @ r_g @ g_g],
            ]
        )
        right = np.block(
            [
                [np.eye(3), zero((3, 11))],
                [zero((4, 14))],
                [zero((3, 3)), skew(q[7:10] - q[:3]) @ r_f @ g_f, np.eye(3), zero((3, 4))],
                [zero((4, 3)), -0.25 * g_g.T @ r_g.T @ r_f @ g_f, zero((4, 3)), 0.25 * g_g.T @ g_g],
            ]
        )
        expected = np.concatenate([paper.v[i], paper.omega[i]])
        # Levers near ten.
        np.testing.assert_allclose(left @ right @ rate, expected, rtol=0, atol=1e-12)


def test_equation_25_is_the_derivative_without_normalization():
    rng = np.random.default_rng(43)
    for _ in range(20):
        e, p = rng.normal(size=4), rng.normal(size=3)
        w, u = e[0], e[1:]
        expected = np.empty((3, 4))
        for k in range(4):
            s = e + 1j * STEP * np.eye(4)[k]
            s_w, s_u = s[0], s[1:]
            rotated = (s_w * s_w - s_u @ s_u) * p + 2.0 * s_w * np.cross(s_u, p) + 2.0 * s_u * (s_u @ p)
            expected[:, k] = rotated.imag / STEP
        turn = -np.outer(p, u) - w * skew(p) + (u @ p) * np.eye(3) + np.outer(u, p)
        found = 2.0 * np.column_stack([w * p + np.cross(u, p), turn])
        # Sums of a few products of numbers near one.
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14)
        product = multiply(multiply(e, [0.0, *p]), e * [1.0, -1.0, -1.0, -1.0])[1:]
        np.testing.assert_allclose((w * w - u @ u) * p + 2 * w * np.cross(u, p) + 2 * u * (u @ p), product, atol=1e-14)


def symmetric(rng, *values):
    """(11, 12, 22) of a symmetric matrix with these eigenvalues."""
    c, s = np.cos(angle := rng.uniform(0.0, 6.3)), np.sin(angle)
    m = np.array([[c, -s], [s, c]]) @ np.diag(values) @ np.array([[c, s], [-s, c]])
    return m[0, 0], m[0, 1], m[1, 1]


def full(a):
    return np.array([[a[0], a[1]], [a[1], a[2]]])


def test_the_inverse_of_h_is_damped_where_h_is_singular():
    rng = np.random.default_rng(44)
    for _ in range(50):
        beta, flat = rng.uniform(-0.3, 2.0), 1e-9
        a = symmetric(rng, *rng.uniform(0.2, 2.0, 2))
        k_f = np.eye(2) + beta * full(a)
        offset = full(a) @ np.linalg.inv(k_f)  # curvature of the surface at distance beta
        axis = rng.normal(size=2)
        for miss, regular in ((0.3, True), (1e-12, False), (0.0, False)):
            c = offset - miss * np.eye(2) - rng.uniform(0.1, 0.5) * np.outer(axis, axis)
            k, h, inverse, isolated = pair_matrix(a, (c[0, 0], c[0, 1], c[1, 1]), beta, flat)
            h, inverse = np.reshape(h, (2, 2)), np.reshape(inverse, (2, 2))
            # An order or two of magnitude is lost to the products of curvatures.
            np.testing.assert_allclose(full(k), k_f, rtol=0, atol=1e-14)
            np.testing.assert_allclose(h, c @ k_f - full(a), rtol=0, atol=1e-13)
            assert bool(isolated) is regular
            if regular:
                np.testing.assert_allclose(inverse @ h, np.eye(2), rtol=0, atol=1e-11)
                continue
            # Damped: the regular direction is inverted, nothing moves along the other. The products under the
            # inverse have lost all but some three digits.
            left, values, right = np.linalg.svd(h)
            turned_inverse = right @ inverse @ left
            assert abs(turned_inverse[0, 0] * values[0] - 1.0) < 1e-2
            assert np.abs(turned_inverse[[0, 1], [1, 0]]).max() < 1e-2
            assert abs(turned_inverse[1, 1]) < 1e-3 / RANK


def test_nothing_is_inverted_where_both_surfaces_are_flat():
    _, _, inverse, isolated = pair_matrix((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.5, 1e-9)
    assert inverse == (0.0, 0.0, 0.0, 0.0) and not isolated


@pytest.mark.parametrize("reverse", [False, True])
@pytest.mark.parametrize(
    ("surface", "curvatures"),
    [
        (shapes.sphere(1.0), (1.0, 1.0)),
        (shapes.ellipsoid(1.0, 0.7, 0.5), (0.5 / 1.0**2, 0.5 / 0.7**2)),
        (shapes.paper_clip(13.0, 8.0, 0.5), (2.0, 2.0)),
    ],
    ids=["sphere", "ellipsoid", "paper clip"],
)
def test_the_frame_at_a_pole(surface, curvatures, reverse):
    """To third order on the surface, and to second along it, where S_vv has a part along S_v."""
    face = Face(surface, reversed=reverse)
    record, pool = face.packed()
    edges = [edge for edge in (1, 2, 4, 8) if surface_at(record, 0).poles & edge]
    assert len(edges) == 2
    for edge in edges:
        across = 0 if edge <= 2 else 1
        low, high = surface.domain[across]
        start, end = surface.domain[1 - across]
        errors = []
        for delta in (2e-2, 1e-2):
            place = np.empty(2)
            place[across] = low + delta if edge in (1, 4) else high - delta
            place[1 - across] = start + 0.3 * (end - start)
            frame = pole_frame(Store(record, pool), 0, edge, *place)
            tangents = np.array([frame.tangent_x, frame.tangent_y])
            # The frame turns with the normal, up to second order.
            assert frame.regular and np.abs(tangents @ frame.normal).max() < 50.0 * delta**2
            off = np.array(frame.point) - surface.evaluate(*place)
            out = face.normal(*place)
            errors.append([abs(off @ out), np.linalg.norm(off), np.linalg.norm(frame.normal - out)])
            # Positive where the outward normal is n.
            np.testing.assert_allclose(
                np.sort(face.sign * np.linalg.eigvalsh(full(frame.shape))), curvatures, rtol=0, atol=1e-12
            )
        ratio = np.array(errors[0]) / errors[1]
        # Halving the distance divides them by 8 and by 4, or more.
        assert ratio[0] > 7.8 and ratio[1:].min() > 3.8
