"""Laws of pairs along valleys that are all but level: of tori that lie on each other, whose circles are known.

The gap is least somewhere on the circle, and grows from there by next to nothing: Newton's step along it is the
quotient of two small numbers.
"""

from __future__ import annotations

from copy import deepcopy

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.extrema.pair_matrix import (
    LEVEL,
    PLAIN,
    UNSURE,
    WEAK,
    across_first,
    curvature_bound,
    damped_inverse,
    pair_matrix,
    scale_of,
)

MAJOR, MINOR = 0.7, 0.1
LYING = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)


def circle_distance(turn, shift):
    """The least distance of two circles of radius MAJOR, about the z axis and about that of a pose."""

    def distances(angles):
        points = MAJOR * np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], -1) @ turn.T + shift
        return np.hypot(np.hypot(points[..., 0], points[..., 1]) - MAJOR, points[..., 2])

    angles = np.linspace(0.0, 2.0 * np.pi, 2001)[:-1]
    found = distances(angles)
    lowest = (found <= np.roll(found, 1)) & (found <= np.roll(found, -1))
    best, found, width = angles[lowest], found[lowest], angles[1]
    for _ in range(10):
        # The distance of circles 0.2 apart is bent by less than 8: nothing else comes below what is least so far.
        # Where it is all but level rounding makes minima of half of the places.
        near = found <= found.min() + 4.0 * width**2 + 1e-15
        around = best[near, None] + np.linspace(-width, width, 41)
        values = distances(around)
        rows, columns = np.arange(len(values)), values.argmin(axis=1)
        best, found = around[rows, columns], values[rows, columns]
        width /= 15.0
    return found.min()


def stacked(rng):
    """A pose of a torus on an equal one, tilted and displaced by little; the gap between them."""
    angle, side = rng.uniform(0.0, 2.0 * np.pi, 2)
    tilt, displaced, gap = 10.0 ** rng.uniform([-9.0, -9.0, -9.5], [-5.0, -1.5, -3.0])
    turn = Rotation.from_rotvec(tilt * np.array([np.cos(angle), np.sin(angle), 0.0]))
    turn *= Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)])
    shift = np.array([displaced * np.cos(side), displaced * np.sin(side), 2.0 * MINOR])
    for _ in range(6):
        # The gap grows as the torus is lifted, all but one to one.
        shift[2] += 2.0 * MINOR + gap - circle_distance(turn.as_matrix(), shift)
    return turn, shift, circle_distance(turn.as_matrix(), shift) - 2.0 * MINOR


def test_a_first_look_finds_the_least_gap_of_tori_that_all_but_lie_on_each_other(cases):
    # With Newton's step along the valley from where it is not at its bottom, one in ten of these had none listed at
    # all, or one that was not the least.
    rng = np.random.default_rng(7)
    shape = asm.shapes.torus(MAJOR, MINOR)
    lower, upper = asm.Body("lower", shape), asm.Body("upper", shape, (0.0, 0.0, 2.0 * MINOR))
    fresh = [asm.Manager(bodies, reach=0.02) for bodies in ((lower, upper), (upper, lower))]
    for k in range(cases(30, 80)):
        turn, shift, gap = stacked(rng)
        q = np.array([lower.q, [*shift, *turn.as_quat(scalar_first=True)]])
        # One that has seen nothing; making one takes a second.
        manager = deepcopy(fresh[k % 2])
        manager.update(q if k % 2 == 0 else q[::-1])
        # A pair may rest where normals are parallel to 1e-9 along the circle, which is a length of four.
        assert min(contact.gap for contact in manager.contacts) == pytest.approx(gap, abs=1e-10)


@pytest.mark.parametrize("tilt", [0.0, 1e-13, 2e-12, 1e-11, 1e-10, 5e-10])
@pytest.mark.parametrize("under", ["plane", "cylinder"])
def test_what_touches_along_a_line_is_a_pair_of_a_continuum(tilt, under):
    # No pair of these is extremal, but for rounding all are: the valley leads down to where a face ends.
    shape = asm.shapes.plane(4.0, 4.0) if under == "plane" else asm.shapes.cylinder(0.4, 1.0)
    lower = asm.Body("lower", shape) if under == "plane" else asm.Body("lower", shape, (0.0, 0.0, -0.4), LYING)
    turn = Rotation.from_rotvec([0.0, 0.5 * np.pi - tilt, 0.0]).as_quat(scalar_first=True)
    upper = asm.Body("upper", asm.shapes.cylinder(0.3, 1.0), (0.05, 0.0, 0.31), turn)
    scene = asm.Assembly([lower, upper])
    scene.constrain(asm.Contact(lower, upper))
    assert scene.solve().success
    manager = asm.Manager([lower, upper], reach=0.02)
    manager.update(np.stack([lower.q, upper.q]))
    # Along a length of one the gap varies by the tilt.
    assert min(contact.gap for contact in manager.contacts) == pytest.approx(0.01, abs=tilt + 1e-14)


def test_the_damped_inverse():
    rng = np.random.default_rng(3)
    for _ in range(200):
        left, right = (Rotation.from_rotvec([0.0, 0.0, a]).as_matrix()[:2, :2] for a in rng.uniform(0.0, 6.3, 2))
        values, damping = 10.0 ** rng.uniform(-8.0, 1.0, 2), 10.0 ** rng.uniform(-10.0, 0.0)
        found = np.reshape(damped_inverse(tuple((left * values @ right.T).ravel()), damping), (2, 2))
        expected = right * (values / (values**2 + damping**2)) @ left.T
        # Entries of H are good to 1e-16 of its size, which is up to 10; its least value may be off by as much.
        off = 1e-15 * values.max() / (values.min() + damping) ** 2
        np.testing.assert_allclose(found, expected, rtol=0, atol=off + 1e-14 / (values.min() + damping))


@pytest.mark.parametrize("damping", [1e-10, 1e-3])
def test_the_damped_inverse_of_a_singular_matrix_is_the_least_step(damping):
    # Integers of rank one, whose products are exact: nothing is left that the damping would have to hide.
    h = np.outer([1.0, -2.0], [3.0, 2.0])
    found = np.reshape(damped_inverse(tuple(h.ravel()), damping), (2, 2))
    np.testing.assert_allclose(found, h.T / (65.0 + damping**2), rtol=1e-15)


def valley(rng, least, angle):
    """A plane over a surface bent by one across and by `least` along: a, c, the axes, what `pair_matrix` says."""
    axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    bent = axes * [1.0, least] @ axes.T
    a, c = (0.0, 0.0, 0.0), (-bent[0, 0], -bent[0, 1], -bent[1, 1])
    return a, c, axes, pair_matrix(a, c, 0.5, 1e-12)


def test_steps_are_newtons_near_a_root_and_go_down_a_valley_far_from_it():
    rng = np.random.default_rng(5)
    for k in range(200):
        least = 10.0 ** rng.uniform(-9.0, -4.0) * (1.0 if k % 2 == 0 else -1.0)
        a, c, axes, (k_f, h, inverse, _isolated) = valley(rng, least, rng.uniform(0.0, 6.3))
        for off in (1e-3 * abs(least), 1e-3, 1e-2):
            slopes = off * rng.normal(size=2)
            r = (0.0, 0.0, *(axes @ slopes))
            # -H a = r2, and -H is how the surface is bent.
            step = np.reshape(across_first(a, c, r, k_f, h, inverse, 1e-12)[0], (2, 2)) @ -np.array(r[2:])
            across, along = step @ axes
            damps = 2.0 * max(UNSURE * np.abs(axes @ slopes).sum(), LEVEL) * curvature_bound(c)
            plain = 2.0 * WEAK * curvature_bound(c) * np.abs(h).sum()
            if abs(least) > 1.01 * min(PLAIN * damps, plain):
                # Near a root, also at a maximum along the valley, Newton's step but for a part that vanishes there.
                expected = slopes / [1.0, least]
                assert (across, along) == pytest.approx(tuple(expected), rel=1.01 * damps / abs(least) + 1e-6)
            elif 1.01 * abs(least) < min(PLAIN * damps, plain):
                # The ways along and across are those of H as far as that is singular.
                expected = slopes[1] / (abs(least) + damps)
                assert along == pytest.approx(expected, rel=1e-3, abs=1e-6)
                assert across == pytest.approx(slopes[0], rel=1e-9, abs=2.0 * abs(least) * (off + abs(expected)))


def test_beside_a_ridge_steps_are_the_least():
    # Where surfaces part nowhere there is no way down: -H is that of a maximum across.
    rng = np.random.default_rng(6)
    a, c, axes, (k_f, h, inverse, _isolated) = valley(rng, 1e-8, 0.7)
    c, h = tuple(-x for x in c), tuple(-x for x in h)
    r = (0.0, 0.0, 0.01, 0.02)
    step = np.reshape(across_first(a, c, r, k_f, h, inverse, 1e-12)[0], (2, 2)) @ -np.array(r[2:])
    assert abs(step @ axes[:, 1]) < 1e-5
    assert step @ axes[:, 0] == pytest.approx(-np.array(r[2:]) @ axes[:, 0], rel=1e-3)


def test_no_step_leads_uphill_where_surfaces_part():
    # In a valley a step goes with the slope: the gap falls along it by s.a.
    rng = np.random.default_rng(9)
    raised = 0
    for _ in range(3000):
        least = 10.0 ** rng.uniform(-9.0, 0.0) * rng.choice([-1.0, 1.0])
        a, c, _axes, (k_f, h, inverse, _isolated) = valley(rng, least, rng.uniform(0.0, 6.3))
        slope = 10.0 ** rng.uniform(-6.0, 0.0) * rng.normal(size=2)
        way, level = across_first(a, c, (0.0, 0.0, *slope), k_f, h, inverse, 1e-12)
        step = np.reshape(way, (2, 2)) @ -slope
        assert np.isfinite(step).all()
        damps = 2.0 * UNSURE * np.abs(slope).sum() * curvature_bound(c)
        if level and least > -damps:
            raised += 1
            # -r2 is the right side, and r2 the slope of the gap downward.
            assert step @ slope > -1e-12 * np.linalg.norm(step)
    assert raised > 400


def test_steps_are_bounded_where_h_is_small_but_not_singular():
    # A ball in a socket as round, but for a saddle: the ways of least H are none, and what is raised may be singular.
    small = 1e-6
    a, c = (1.0, 0.0, 1.0), (1.0 - 0.25 * small, -0.75 * small, 1.0 - 0.25 * small)
    k_f, h, inverse, _isolated = pair_matrix(a, c, 0.0, 1e-12)
    for off in np.linspace(0.3, 0.8, 501) * small:
        r = (0.0, 0.0, 0.5 * off, 0.5 * off)
        way, level = across_first(a, c, r, k_f, h, inverse, 1e-12)
        assert level
        # The least singular value of what is inverted is a part of the damping.
        assert np.linalg.norm(way) * UNSURE * off * scale_of(a, c, k_f) < 20.0
