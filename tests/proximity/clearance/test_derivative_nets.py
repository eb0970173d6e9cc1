"""Bounds of derivatives over boxes of parameters are above the derivatives of samples, and not far above them.

What counts is the bound times the square of the box's width, which cells use; rounding of coordinates is added to that
(`cells.ROUNDING`), so it is here as well.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.cells import ROUNDING
from assembly.proximity.clearance.derivative_nets import chord_bounds, surface_bounds
from tests.proximity.clearance.splines import random_curve, random_surface

# What samples of derivatives may be off by rounding, in parts of themselves.
CLOSE = 1e-10


def intervals(rng, low, high, count):
    """Random ones, the whole one, and one that is all but empty."""
    ends = np.sort(rng.uniform(low, high, (count, 2)), axis=1)
    ends[0] = low, high
    ends[1, 1] = min(ends[1, 0] + 1e-9 * (high - low), high)
    return ends


def sampled(surface, low, high, rng):
    """The largest lengths of S_u, S_v and of S_uu, S_uv, S_vv at random points of a box, some on its border."""
    part = np.vstack([rng.random((40, 2)), [[0, 0], [0, 1], [1, 0], [1, 1]]])
    u, v = (low + part * (high - low)).T
    lengths = [np.linalg.norm(x, axis=-1).max() for x in surface.evaluate(u, v, order=2)[1:]]
    return np.array(lengths[:2]), np.array(lengths[2:])


def check_surface(surface, low, high, rng):
    far = np.abs(surface.control_points).max()
    first, second = surface_bounds(surface, low, high)
    for k in range(len(low)):
        rates, bends = sampled(surface, low[k], high[k], rng)
        width = np.minimum(high[k] - low[k], 1.0)
        by = np.array([width[0] ** 2, width[0] * width[1], width[1] ** 2])
        assert (rates * width <= first[k] * width * (1.0 + CLOSE) + ROUNDING * far).all()
        assert (bends * by <= second[k] * by * (1.0 + CLOSE) + ROUNDING * far).all()


@pytest.mark.parametrize("offset", [0.0, 1e3])
def test_surfaces(cases, offset):
    rng = np.random.default_rng(0)
    for _ in range(cases(15, 500)):
        surface = random_surface(rng, offset)
        boxes = [intervals(rng, *ends, 5) for ends in surface.domain]
        low, high = (np.column_stack([box[:, k] for box in boxes]) for k in range(2))
        check_surface(surface, low, high, rng)


@pytest.mark.parametrize("shape", [asm.shapes.torus(0.6, 0.2), asm.shapes.cylinder(0.5, 1.0), asm.shapes.sphere(0.7)])
def test_boxes_over_a_seam(shape):
    rng, (u0, u1), (v0, v1) = np.random.default_rng(1), *shape.domain
    for begin, end in ((u1 - 0.2, u1 + 0.3), (u0 - 0.4, u0 + 0.1), (u0 - 0.2, u1 + 0.2)):
        first, second = surface_bounds(shape, np.array([[begin, v0]]), np.array([[end, v1]]))
        u = rng.uniform(begin, end, 300)
        lengths = [np.linalg.norm(x, axis=-1).max() for x in shape.evaluate(u, rng.uniform(v0, v1, 300), order=2)[1:]]
        assert (np.array(lengths) <= np.r_[first[0], second[0]] * (1.0 + CLOSE)).all()


def test_bounds_of_small_boxes_are_near():
    """Nets of products of cells of width h are within O(h) of what they bound."""
    shape, rng = asm.shapes.torus(0.6, 0.2), np.random.default_rng(2)
    low = np.column_stack([rng.uniform(0.0, 3.0, 30), rng.uniform(0.0, 1.2, 30)])
    first, second = surface_bounds(shape, low, low + 0.02)
    for k in range(30):
        rates, bends = sampled(shape, low[k], low[k] + 0.02, rng)
        assert first[k] == pytest.approx(rates, rel=0.1)
        assert (second[k] <= 1.3 * bends + 0.05).all()


def test_a_cylinder_has_no_twist():
    """The terms of S_uv cancel, in nets as well."""
    shape = asm.shapes.cylinder(0.5, 1.0)
    low, high = (np.array([[x, y]]) for (x, y) in zip(*shape.domain, strict=True))
    second = surface_bounds(shape, low, high)[1][0]
    assert second[0] < 3.0 / 0.5 and second[1] < 1e-13 and second[2] == 0.0


def test_curves(cases):
    rng = np.random.default_rng(3)
    for _ in range(cases(40, 2000)):
        curve = random_curve(rng)
        t = intervals(rng, *curve.domain, 6)
        bound = chord_bounds(curve, t)[0]
        for k, (a, b) in enumerate(t):
            bend = np.abs(curve.evaluate(np.r_[a, rng.uniform(a, b, 40), b], order=2)[2]).max(axis=0)
            wide = min(b - a, 1.0) ** 2
            assert (bend * wide <= bound[k] * wide * (1.0 + CLOSE) + ROUNDING * 10.0).all()


def heights_over_chord(curve, a, b):
    """How far samples are to the left of the chord, in parts of its length."""
    start, *points, end = curve.evaluate(np.linspace(a, b, 33))
    chord, off = end - start, np.array(points) - start
    return (chord[0] * off[:, 1] - chord[1] * off[:, 0]) / (chord @ chord)


def test_what_bends_to_one_side_is_there_of_all_chords(cases):
    rng, found = np.random.default_rng(4), {side: 0 for side in (-1, 0, 1)}
    for _ in range(cases(200, 5000)):
        curve = random_curve(rng)
        begin, end = curve.domain
        t = np.sort(rng.uniform(begin, end, (8, 2)), axis=1)
        t[4:, 1] = np.minimum(t[4:, 0] + 0.1, end)
        told = chord_bounds(curve, t)[1]
        for (a, b), side in zip(t, told.tolist(), strict=True):
            found[side] += 1
            if side != 0:
                parts = np.sort(rng.uniform(a, b, (3, 2)), axis=1)
                # Of a chord as short as 1e-6 rounding of points tells no side better than 1e-9.
                heights = [side * heights_over_chord(curve, *ends) for ends in ((a, b), *parts) if np.ptp(ends) > 1e-6]
                assert np.min(heights) > -1e-9
    # Of short intervals of curves that bend the right way most are told.
    assert min(found.values()) > 100


def test_arcs_bend_away_from_the_inside_of_holes_alone():
    """Material is left of a boundary: of a circle that is run through clockwise it is outside of it."""
    arc = asm.NurbsCurve([[1, 0], [1, 1], [0, 1]], [0, 0, 0, 1, 1, 1], 2, [1, np.sqrt(0.5), 1])
    t = np.array([[0.05, 0.95], [0.2, 0.4]])
    assert (chord_bounds(arc.reversed(), t)[1] == 1).all()
    assert (chord_bounds(arc, t)[1] == -1).all()


@pytest.mark.parametrize("side", [1, -1])
def test_of_a_circle_the_side_of_all_short_chords_is_known(side):
    """Also of those over knots, where quarters meet. Seen from a hole it is 1: counterclockwise it turns left."""
    circle = asm.shapes.solid_cylinder(2.0, 1.0)[-1].boundary[0]
    if side == 1:
        circle = asm.shapes.plate(10.0, 10.0, 1.0, [(1.0, 2.0, 2.0)])[-1].boundary[-1]
    begin, end = circle.domain
    middles = np.linspace(begin + 1.6, end - 1.6, 400)
    # A turn of less than a right angle, 1.5 of a radius of 2.
    assert (chord_bounds(circle, middles[:, None] + [-1.5, 1.5])[1] == side).all()
    assert (chord_bounds(circle, middles[:, None] + [-1e-6, 1e-6])[1] == side).all()
