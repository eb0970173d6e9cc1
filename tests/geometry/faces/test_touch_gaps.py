"""Gaps between plane curves against dense samples, their signs, and where curves meet."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._kernel import kernel
from assembly.geometry.faces.loop import Loop
from assembly.geometry.faces.touch_gaps import MOST, Couple, Traced, find_meetings, gap_between, nearest_place
from assembly.geometry.splines.curve import NurbsCurve


@kernel
def nearest(curve, x, y, interval):
    return nearest_place(Traced(curve[0], curve[1], curve[2], curve[3], curve[4], curve[5]), x, y, interval)


@kernel
def gap(one, other, s, move, interval):
    first = Traced(one[0], one[1], one[2], one[3], one[4], one[5])
    second = Traced(other[0], other[1], other[2], other[3], other[4], other[5])
    found = gap_between(Couple(first, second, move, 0.0, False), s, interval)
    return found.distance, found.t, found.inside, found.turn


def traced(curve):
    t = np.linspace(*curve.domain, 65)
    points = np.ascontiguousarray(curve.evaluate(t))
    low, high = np.minimum(points[:-1], points[1:]) - 0.01, np.maximum(points[:-1], points[1:]) + 0.01
    return (*curve.packed(), t, points, low, high)


def meetings(one, other, move=(0.0, 0.0), nearest=1e-9, own=False):
    a, b = traced(one), traced(other)
    out = np.empty((MOST + 17 * b[2].size, 2))
    return out[: find_meetings(a, b, move, nearest, own, out)]


def some_curve(seed):
    random = np.random.default_rng(seed)
    points = np.column_stack([np.arange(7.0), random.normal(size=7)])
    knots = np.concatenate([[0.0] * 4, [1.0, 2.0, 3.0], [4.0] * 4])
    return asm.NurbsCurve(points, knots, 3, random.uniform(0.5, 2.0, 7))


@pytest.mark.parametrize("seed", range(6))
def test_nearest_places_are_nearest(seed):
    curve, random = some_curve(seed), np.random.default_rng(seed)
    for _ in range(20):
        point = random.uniform((-1.0, -2.0), (7.0, 2.0))
        low, high = np.sort(random.uniform(0.0, 4.0, 2))
        t, distance = nearest(traced(curve), *point, (low, high))
        far = np.linalg.norm(curve.evaluate(np.linspace(low, high, 4001)) - point, axis=1)
        assert low <= t <= high
        assert distance == pytest.approx(np.linalg.norm(curve.evaluate(t) - point), abs=1e-15)
        # A polygon of sixty-four chords tells the right one of several minima but where they are nearly the same.
        assert distance <= far.min() + 1e-3


@pytest.mark.parametrize("seed", range(6))
def test_gaps_have_the_side_and_the_turn(seed):
    one, other = some_curve(seed), some_curve(seed + 10)
    move = (0.25, -0.5)
    for s in np.linspace(0.1, 3.9, 25):
        size, t, inside, turn = gap(traced(one), traced(other), s, move, (0.0, 4.0))
        (point, along), (place, way) = one.evaluate(s, 1), other.evaluate(t, 1)
        off = point - move - place
        assert abs(size) == pytest.approx(np.linalg.norm(off), abs=1e-14)
        assert size * (way[0] * off[1] - way[1] * off[0]) >= 0.0
        assert inside == (4e-12 < t < 4.0 - 4e-12)
        sine = (along[0] * way[1] - along[1] * way[0]) / np.linalg.norm(along) / np.linalg.norm(way)
        assert turn == pytest.approx(sine, abs=1e-13)


@pytest.mark.parametrize("seed", range(6))
def test_curves_meet_where_their_samples_cross(seed):
    one, other, move = some_curve(seed), some_curve(seed + 20), (0.0, 0.1 * seed)
    found = meetings(one, other, move)
    there = other.evaluate(found[:, 1]) + np.array(move)
    np.testing.assert_allclose(one.evaluate(found[:, 0]), there, atol=1e-9)
    t = np.linspace(0.0, 4.0, 2001)
    p, q = one.evaluate(t), other.evaluate(t) + np.array(move)
    # Both run along x, so that heights over the same x tell.
    above = p[:, 1] - np.interp(p[:, 0], q[:, 0], q[:, 1])
    inside = (p[:, 0] > 0.0) & (p[:, 0] < 6.0)
    crossed = t[:-1][(above[:-1] * above[1:] < 0.0) & inside[:-1] & inside[1:]]
    assert crossed.size and found.size
    for s in crossed:
        assert np.abs(found[:, 0] - s).min() < 0.01


def test_tangent_curves_and_ends_and_a_curve_with_itself_meet():
    bowl = asm.NurbsCurve([[-1.0, 1.0], [0.0, -1.0], [1.0, 1.0]], [0.0, 0.0, 0.0, 1.0, 1.0, 1.0], 2)
    ground = asm.NurbsCurve.polyline([[-2.0, 0.0], [3.0, 0.0]])
    s, t = meetings(bowl, ground)[-1]
    assert s == pytest.approx(0.5, abs=1e-12) and ground.evaluate(t) == pytest.approx([0.0, 0.0], abs=1e-12)
    post = asm.NurbsCurve.polyline([[0.25, 0.0625], [0.25, -1.0]])
    assert [0.0, 0.625] in meetings(post, bowl).tolist()
    assert not meetings(bowl, ground, (0.0, -1e-6)).size
    loop = asm.NurbsCurve([[0.0, 0.0], [3.0, 2.0], [-2.0, 2.0], [1.0, 0.0]], np.repeat([0.0, 1.0], 4), 3)
    found = meetings(loop, loop, own=True)
    assert found.size and np.abs(found[:, 0] - found[:, 1]).min() > 0.1
    np.testing.assert_allclose(loop.evaluate(found[:, 0]), loop.evaluate(found[:, 1]), atol=1e-9)


def test_lines_made_together_are_lines():
    ends = np.array([[[0.0, 1.0], [2.0, 3.0]], [[2.0, 3.0], [-0.0, 5.0]]])
    made = NurbsCurve._lines(ends, [(0.0, 1.0), (2.0, 5.0)], ["a", "b"])
    for line, row, domain, name in zip(made, ends, [(0.0, 1.0), (2.0, 5.0)], "ab", strict=True):
        same = asm.NurbsCurve(row, np.repeat(domain, 2), 1, name=name)
        assert (line.name, line.domain, line.degree, line._is_clamped) == (name, domain, 1, same._is_clamped)
        for field in ("control_points", "knots", "weights"):
            assert getattr(line, field).tobytes() == getattr(same, field).tobytes()
            assert not getattr(line, field).flags.writeable
    ends[0, 0, 0] = 7.0
    assert made[0].control_points[0, 0] == 0.0
    with pytest.raises(asm.errors.InputError, match="finite"):
        NurbsCurve._lines(np.array([[[np.nan, 0.0], [1.0, 1.0]]]), [(0.0, 1.0)], ["a"])
    with pytest.raises(asm.errors.InputError, match="empty domain"):
        NurbsCurve._lines(ends, [(0.0, 1.0), (1.0, 1.0)], ["a", "b"])


@pytest.mark.parametrize("count", [3, 4, 30])
def test_a_loop_of_lines_knows_its_sense(count):
    random = np.random.default_rng(count)
    for sense in (1.0, -1.0):
        angle = sense * np.sort(random.uniform(0.0, 2.0 * np.pi, count))
        corners = (random.uniform(0.5, 2.0, (count, 1)) * np.column_stack([np.cos(angle), np.sin(angle)])) + 1e3
        pairs = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
        loop = Loop(NurbsCurve._lines(pairs, [(0.0, 1.0)] * count, [""] * count))
        assert loop.is_clockwise == (loop.area < 0.0)
    # Next to nothing in it: the whole area decides, as for curves.
    thin = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, -1e-7], [0.0, -1e-7]])
    loop = Loop.unchecked([asm.NurbsCurve.polyline(thin[[k, (k + 1) % 4]]) for k in range(4)], 1e-9, None, "loop")
    assert loop.is_clockwise and loop.area < 0.0
