"""The oracle for wires against closed forms, dense samples, the library's own pairs and counting laws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.path import Path
from benchmarks.center_lines import Wire, ball_wire, linking_number, paper_clip_wire, path_wire, torus_wire
from benchmarks.dense_distance import circle_distance
from benchmarks.scenes import linked
from benchmarks.wire_oracle import WireOracle

HERE = [0.0, 0, 0, 1, 0, 0, 0]
HOOK = Path((0, 0, 0), (0, 0, 1)).line(2.0).arc(0.7, 2.0, (1, 0, 0)).arc(0.5, 1.3, (0, 1, 0.3)).line(1.0)
RING = Path((1.0, 0, 0), (0, 1, 0)).line(1).arc(0.5, np.pi, (-1, 0, 0)).line(2).arc(0.5, np.pi, (1, 0, 0)).line(1)
# Name: (wire, surface, half extent of random places).
SHAPES = {
    "clip": (paper_clip_wire(), asm.shapes.paper_clip(), 12.0),
    "small clip": (paper_clip_wire(10.0, 5.0, 0.25), asm.shapes.paper_clip(10.0, 5.0, 0.25), 4.0),
    "torus": (torus_wire(1.0, 0.12), asm.shapes.torus(1.0, 0.12), 1.5),
    "wide torus": (torus_wire(1.4, 0.5), asm.shapes.torus(1.4, 0.5), 1.5),
    "hook": (path_wire(HOOK, 0.2), asm.shapes.pipe(HOOK, 0.2), 2.0),
    "ring": (path_wire(RING, 0.2), asm.shapes.pipe(RING, 0.2), 1.5),
    "ball": (ball_wire(0.6), asm.shapes.sphere(0.6), 1.5),
}
PAIRS = (("torus", "wide torus"), ("clip", "clip"), ("hook", "ring"), ("small clip", "ball"), ("hook", "torus"))


def poses(rng, count, extent):
    e = rng.normal(size=(count, 4))
    return np.hstack([rng.uniform(-extent, extent, (count, 3)), e / np.linalg.norm(e, axis=1, keepdims=True)])


def sampled(wire: Wire, pose, spacing):
    """Points on a center line, at most `spacing` apart, by the body's own axes."""
    rows = [wire.ends[0]]
    for start, (e, f, _), bend, length in zip(wire.start, wire.axes, wire.bend, wire.length, strict=True):
        s = np.linspace(0.0, length, int(np.ceil(length / spacing)) + 1)[:, None]
        rows.append(start + (s * e if bend == 0.0 else bend * (np.cos(s / bend) * e + np.sin(s / bend) * f)))
    return Rotation.from_quat(pose[3:], scalar_first=True).apply(np.concatenate(rows)) + pose[:3]


@pytest.mark.parametrize("name", SHAPES)
def test_surfaces_are_around_the_center_lines(name):
    wire, surface, _ = SHAPES[name]
    rng = np.random.default_rng(1)
    oracle = WireOracle([wire, ball_wire(1e-3)])
    points = surface.evaluate(*(rng.uniform(*ends, 60) for ends in surface.domain))
    found = [oracle.deepest([HERE, [*point, 1, 0, 0, 0]]) for point in points]
    assert np.abs(np.add(found, 1e-3)).max() < 1e-13  # roundings of lengths of up to 33


def test_linked_circles():
    oracle = WireOracle([torus_wire(1.0, 0.1), torus_wire(1.0, 0.1)])
    upright = Rotation.from_euler("x", 90.0, degrees=True).as_quat(scalar_first=True)
    found = oracle.extrema([HERE, [0.8, 0, 0, *upright]])
    # They meet the common axis at -1 and 1, and at -0.2 and 1.8: two minima and two maxima. The four saddles are where
    # the upright circle passes the axis of the other one, all of which is as far from there.
    minima = found.take(found.index == 0)
    np.testing.assert_allclose(np.sort(minima.gap), [0.6, 0.6], atol=1e-14)
    np.testing.assert_allclose(np.sort(minima.centers[:, :, 0], axis=0), [[-1.0, -0.2], [1.0, 1.8]], atol=1e-14)
    assert sorted(found.index) == [0, 0, 1, 1, 1, 1, 2, 2]
    np.testing.assert_allclose(found.centers[found.index == 1][:, 1, 0], 0.0, rtol=0, atol=1e-14)


def test_lines_and_ends():
    rod = path_wire(Path((-1, 0, 0), (1, 0, 0)).line(2.0), 0.25)
    oracle = WireOracle([rod, rod])
    quarter = Rotation.from_euler("z", 90.0, degrees=True).as_quat(scalar_first=True)
    crossed = oracle.minima([HERE, [0.5, 0.25, 1.0, *quarter]])
    np.testing.assert_allclose(crossed.gap, [0.5], rtol=0, atol=1e-15)
    np.testing.assert_allclose(crossed.points[0], [[0.5, 0, 0.25], [0.5, 0, 0.75]], rtol=0, atol=1e-15)
    # An end over the middle, and end to end.
    for place, expected in (((0.5, 2.0, 1.0), np.sqrt(2.0)), ((2.0, 2.0, 1.0), np.sqrt(3.0))):
        found = oracle.minima([HERE, [*place, *quarter]])
        np.testing.assert_allclose(found.gap, [expected - 0.5], rtol=0, atol=1e-15)
    # Parallel, over half of their lengths: a continuum has no isolated minimum, but a least gap.
    assert abs(oracle.deepest([HERE, [1.0, 0.4, 0.3, 1, 0, 0, 0]])) < 1e-15
    assert not oracle.minima([HERE, [7.0, 0, 0, 1, 0, 0, 0]], reach=4.0).gap.size
    assert oracle.minima([HERE, [7.0, 0, 0, 1, 0, 0, 0]], reach=4.6).gap.size == 1


@pytest.mark.parametrize(("f", "g"), PAIRS)
def test_the_least_gap_is_within_bounds_from_samples(f, g):
    (a, _, extent), (b, _, _) = SHAPES[f], SHAPES[g]
    rng = np.random.default_rng(2)
    oracle, spacing = WireOracle([a, b]), 0.02 * extent
    turned = Rotation.from_euler("x", 90.0, degrees=True).as_quat(scalar_first=True)
    special = [np.array([HERE, [*place, *turn]]) for place in np.eye(3) for turn in ([1, 0, 0, 0], turned)]
    cases = [poses(rng, 2, extent) for _ in range(25)] + special
    # From aligned and coaxial to nearly so.
    cases += [q + 10.0**-k * rng.uniform(-1, 1, (2, 7)) for q in special for k in (3, 7, 11)]
    for q in cases:
        p, r = sampled(a, q[0], spacing), sampled(b, q[1], spacing)
        nearest = np.linalg.norm(p[:, None] - r[None], axis=2).min() - a.radius - b.radius
        # Half a spacing each from some sample, and distances change by no more than points move.
        assert nearest - spacing <= oracle.deepest(q) <= nearest + 1e-12


def test_circles_have_the_distance_of_another_search():
    rng = np.random.default_rng(3)
    oracle = WireOracle([torus_wire(1.0, 0.1), torus_wire(0.7, 0.2)])
    aligned = np.array([HERE, HERE])
    cases = [poses(rng, 2, 1.5) for _ in range(60)]
    cases += [aligned + 10.0**-k * rng.uniform(-1, 1, (2, 7)) for k in range(1, 13) for _ in range(3)]
    for q in cases:
        turn = Rotation.from_quat(q[:, 3:], scalar_first=True)
        relative, shift = (turn[0].inv() * turn[1]).as_matrix(), turn[0].inv().apply(q[1, :3] - q[0, :3])
        # Golden sections of a distance find it to rounding, its place only to the root of that.
        assert abs(oracle.deepest(q) + 0.3 - circle_distance(1.0, 0.7, relative, shift)) < 1e-13


@pytest.mark.parametrize(("f", "g"), PAIRS)
def test_nothing_is_missed_or_doubled(f, g, cases):
    (a, _, extent), (b, _, _) = SHAPES[f], SHAPES[g]
    rng = np.random.default_rng(4)
    oracle = WireOracle([a, b])
    kinds = set()
    for _ in range(cases(40, 200)):
        # Raises where the sum over minima, saddles and maxima is wrong.
        kinds.update(oracle.extrema(poses(rng, 2, extent)).index)
    assert kinds == ({0, 1} if "ball" in (f, g) else {0, 1, 2})


def test_a_lost_and_a_doubled_extremum_are_noticed(monkeypatch):
    oracle = WireOracle([SHAPES["torus"][0], SHAPES["wide torus"][0]])
    q = poses(np.random.default_rng(5), 2, 1.5)
    whole = oracle.extrema(q)
    for rows in (np.arange(1, whole.gap.size), np.append(0, np.arange(whole.gap.size))):
        monkeypatch.setattr(oracle, "_extrema", lambda posed, rows=rows: whole.take(rows))
        with pytest.raises(ArithmeticError, match="wires 0 and 1 have the sum -?1; expected 0"):
            oracle.extrema(q)


@pytest.mark.parametrize(("f", "g"), [("torus", "wide torus"), ("clip", "clip"), ("hook", "ring")])
def test_minima_are_those_that_descents_reach(f, g, cases):
    (a, _, extent), (b, _, _) = SHAPES[f], SHAPES[g]
    rng = np.random.default_rng(6)
    oracle = WireOracle([a, b])
    for _ in range(cases(1, 3)):
        q = poses(rng, 2, 0.7 * extent)
        found = oracle.minima(q)
        curves = [_curve(wire, pose) for wire, pose in zip((a, b), q, strict=True)]
        lengths = [wire.length.sum() for wire in (a, b)]
        reached = []
        for start in rng.uniform(0.0, 1.0, (25, 2)) * lengths:
            end = _descended(curves, [wire.ends[0].size > 0 for wire in (a, b)], lengths, start)
            away = np.linalg.norm(found.centers - end, axis=2).max(axis=1)
            # A descent ends where the distance does not change to rounding: the root of that times the size.
            assert away.min() < 1e-5 * extent
            reached.append(int(away.argmin()))
        # A basin of a part in a thousand may be passed over by 25 starts.
        assert len(set(reached)) >= min(2, found.gap.size)


def _curve(wire, pose):
    knots = np.concatenate([[0.0], np.cumsum(wire.length)])
    turn = Rotation.from_quat(pose[3:], scalar_first=True).as_matrix()

    def at(s):
        k = int(np.clip(np.searchsorted(knots, s, "right") - 1, 0, wire.bend.size - 1))
        (e, f, _), bend, x = wire.axes[k], wire.bend[k], s - knots[k]
        if bend == 0.0:
            return turn @ (wire.start[k] + x * e) + pose[:3], turn @ e
        c, i = np.cos(x / bend), np.sin(x / bend)
        return turn @ (wire.start[k] + bend * (c * e + i * f)) + pose[:3], turn @ (c * f - i * e)

    return at


def _descended(curves, opens, lengths, x):
    def square(x):
        (p, dp), (r, dr) = (
            curve(s if is_open else s % length)
            for curve, s, is_open, length in zip(curves, x, opens, lengths, strict=True)
        )
        return 0.5 * (p - r) @ (p - r), np.array([(p - r) @ dp, (r - p) @ dr])

    limits = [(0.0, length) if is_open else (None, None) for is_open, length in zip(opens, lengths, strict=True)]
    for _ in range(3):
        x = minimize(square, x, jac=True, method="L-BFGS-B", bounds=limits, options={"ftol": 0.0, "gtol": 1e-14}).x
    return np.stack([c(s if o else s % n)[0] for c, s, o, n in zip(curves, x, opens, lengths, strict=True)])


@pytest.mark.parametrize(("f", "g"), PAIRS)
def test_the_library_finds_one_of_the_minima(f, g):
    (a, surface_f, extent), (b, surface_g, _) = SHAPES[f], SHAPES[g]
    rng = np.random.default_rng(7)
    oracle = WireOracle([a, b])
    for _ in range(25):
        q = poses(rng, 2, extent)
        found = oracle.extrema(q)
        if found.gap.min() < -0.5 * min(a.radius, b.radius):
            # Near crossing center lines the far sides are about as deep, and face each other as well.
            continue
        pair = asm.proximity.extremal_pair(surface_f, q[0], surface_g, q[1])
        away = np.linalg.norm(found.points - pair.points, axis=2).max(axis=1)
        k = int(away.argmin())
        assert away[k] < 1e-9 * extent and abs(found.gap[k] - pair.gap) < 1e-13 * extent
        if found.gap.min() > 0.0:
            # Apart, it is the nearest pair.
            assert abs(pair.gap - oracle.deepest(q)) < 1e-13 * extent


def test_gaps_are_those_of_each_pair():
    rng = np.random.default_rng(8)
    wires = [SHAPES[name][0] for name in ("torus", "wide torus", "hook", "ball")]
    q = poses(rng, 4, 1.5)
    oracle = WireOracle(wires)
    alone = [WireOracle([wires[i], wires[j]]).deepest(q[[i, j]]) for i, j in oracle.pairs]
    np.testing.assert_allclose(oracle.gaps(q), alone, rtol=0, atol=1e-14)
    assert oracle.deepest(q) == min(oracle.gaps(q))
    with pytest.raises(ValueError, match="shape"):
        oracle.gaps(q[:3])


def test_linking_numbers(cases):
    rng = np.random.default_rng(9)
    oracle = WireOracle([torus_wire(1.0, 0.1)] * 2)
    numbers = []
    for _ in range(cases(40, 200)):
        q = poses(rng, 2, 1.2)
        if oracle.deepest(q) < -0.19:
            continue
        numbers.append(oracle.links(q)[0])
        assert abs(numbers[-1]) == linked(*q)
    assert set(numbers) == {-1, 0, 1}
    # One curve twice around the other, with either sense; open wires are not linked.
    t = np.linspace(0.0, 2.0 * np.pi, 200, endpoint=False)
    radius = 1.0 + 0.3 * np.cos(2.0 * t)
    around = np.column_stack([radius * np.cos(t), radius * np.sin(t), 0.3 * np.sin(2.0 * t)])
    circle = np.column_stack([np.cos(t), np.sin(t), 0.0 * t])
    assert abs(linking_number(around, circle)) == 2
    assert linking_number(around, circle) == linking_number(circle, around) == -linking_number(around[::-1], circle)
    with pytest.raises(ArithmeticError, match="meet"):
        linking_number(circle, circle[:, [0, 2, 1]])
    clips = WireOracle([paper_clip_wire(), paper_clip_wire()])
    assert clips.links(poses(rng, 2, 3.0)).tolist() == [0]
