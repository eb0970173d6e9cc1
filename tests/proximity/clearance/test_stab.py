"""Crossings that are proven are there, and no translation by less than their depth undoes them.

Kernels are run as plain Python; whole bodies are asked by a proof, and judged by closed forms.
"""

from __future__ import annotations

import numpy as np
import pytest

from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.stab import segments_apart, stabbed, triangle_distance
from tests.proximity.clearance.nodes import nearest_on_triangles
from tests.proximity.clearance.scenes import direction, moved, poses, proof_of, start_of
from tests.validation.clearance_scenes import start
from tests.validation.crossing_judge import Motion, least_signed_distance

TRIANGLE = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def rows(x):
    return tuple(map(tuple, np.asarray(x, dtype=float).tolist()))


def test_distances_of_segments(cases):
    """Of samples of both none is nearer, and one is nearly as near; also of segments that are points or parallel."""
    rng = np.random.default_rng(0)
    part = np.linspace(0.0, 1.0, 201)[:, None]
    for number in range(cases(100, 5000)):
        p, q, a, b = rng.normal(size=(4, 3))
        if number % 5 == 1:
            q = p
        if number % 5 == 2:
            b = a
        if number % 5 == 3:
            b = a + (q - p)
        told = segments_apart(*rows([p, q, a, b]))
        one, other = p + part * (q - p), a + part * (b - a)
        least = np.linalg.norm(one[:, None] - other, axis=-1).min()
        assert told <= least + 1e-14
        assert least - told < 0.005 * (np.linalg.norm(q - p) + np.linalg.norm(b - a)) + 1e-14
        assert segments_apart(*rows([a, b, p, q])) == pytest.approx(told, abs=1e-13)


def test_distances_of_triangles(cases):
    rng = np.random.default_rng(1)
    for number in range(cases(200, 5000)):
        p, a, b, c = rng.normal(size=(4, 3))
        if number % 4 == 1:
            c = b
        if number % 4 == 2:
            p = 0.2 * a + 0.5 * b + 0.3 * c
        told = triangle_distance(*rows([p, a, b, c]))
        assert told == pytest.approx(float(np.linalg.norm(nearest_on_triangles(p, a, b, c) - p)), abs=1e-14)


@pytest.mark.parametrize(
    ("segment", "thick", "rho", "depth"),
    [
        (((0.25, 0.25, 1.0), (0.25, 0.25, -1.0)), 0.0, 0.0, 0.25),
        (((0.25, 0.25, 0.1), (0.25, 0.25, -1.0)), 0.0, 0.0, 0.1),
        (((0.25, 0.25, 0.1), (0.25, 0.25, -1.0)), 0.0, 0.04, 0.06),
        (((0.25, 0.25, 1.0), (0.25, 0.25, -1.0)), 0.1, 0.05, 0.1),
        (((0.25, 0.25, 0.1), (0.25, 0.25, -1.0)), 0.0, 0.1, 0.0),
        (((0.25, 0.25, 1.0), (0.25, 0.25, 0.1)), 0.0, 0.0, 0.0),
        (((0.8, 0.8, 1.0), (0.8, 0.8, -1.0)), 0.0, 0.0, 0.0),
        (((0.25, 0.25, 0.0), (0.25, 0.25, -1.0)), 0.0, 0.0, 0.0),
    ],
)
def test_stabs(segment, thick, rho, depth):
    """By heights of the ends and distances from sides; what both stand for is taken off."""
    told, part = stabbed(segment, thick, TRIANGLE, rho)
    assert max(told, 0.0) == pytest.approx(depth, abs=1e-15)
    if depth > 0.0:
        (_, _, high), (_, _, low) = segment
        assert part == pytest.approx(high / (high - low), abs=1e-15)


def test_stabs_stay_whatever_both_stand_for(cases):
    """Ends that are moved by less, and corners: the segment still goes through."""
    rng, stabs = np.random.default_rng(2), 0
    for _ in range(cases(600, 20_000)):
        segment, triangle = rng.normal(size=(2, 3)), rng.normal(size=(3, 3))
        rho = 10.0 ** rng.uniform(-3.0, -1.0)
        depth, _ = stabbed(rows(segment), 0.0, rows(triangle), rho)
        if not depth > 0.0:
            continue
        stabs += 1
        # Corners anywhere within rho, and a translation.
        for _ in range(4):
            other = triangle + rho * np.array([direction(rng) for _ in range(3)])
            shifted = segment + 0.999 * depth * direction(rng)
            assert stabbed(rows(shifted), 0.0, rows(other), 0.0)[0] > 0.0
    assert stabs > 20


def test_no_translation_by_less_than_the_depth_parts(cases):
    rng, found = np.random.default_rng(3), 0
    for number in range(cases(24, 2000)):
        begin = start_of(number)
        (answer,) = proof_of(begin.a.shape, begin.b.shape).look(poses(begin.pose), 0.0)
        if answer.verdict is not Verdict.CROSSING:
            continue
        found += 1
        ways = [direction(rng) for _ in range(2)] + [begin.way]
        for n in ways:
            pose = moved(begin.pose, 0.999 * answer.depth * n)
            assert least_signed_distance(begin.a, begin.b, Motion.of(pose)) < 1e-13, begin
    assert found > 5


def test_crossings_by_less_than_is_touching_are_not_told():
    begin = start(np.random.default_rng(32), aims=(-6.0, -6.0), sides=(-1,))
    for number in range(40):
        begin = start(np.random.default_rng([32, number]), aims=(-6.0, -6.0), sides=(-1,))
        if begin.kind == "near":
            break
    shapes = begin.a.shape, begin.b.shape
    assert proof_of(*shapes).look(poses(begin.pose), 0.0)[0].verdict is Verdict.CROSSING
    proof = proof_of(*shapes)
    proof.fronts.counts.budget = 2000
    assert proof.look(poses(begin.pose), 2e-6)[0].verdict is Verdict.UNDECIDED
