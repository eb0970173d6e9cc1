"""Starts at which bodies are stuck in each other: parted by the least ways that are found, and no more than these.

Lengths are within 2 in 100 of the shortest, as least translations are.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.studies.parting import parted
from tests.validation import exact_solids as exact
from tests.validation.crossing_judge import Motion, least_signed_distance

BALL, BIG = exact.ball(0.5), exact.box(3.0, 3.0, 3.0)
TOUCHING = 1e-9


def scene_of(*bodies):
    made = [asm.Body(f"b{k}", part.shape, place, fixed=fixed) for k, (part, place, fixed) in enumerate(bodies)]
    scene = asm.Assembly(made)
    scene.constrain(asm.Clearance())
    return scene


def ways_of(scene):
    """How far each body is moved; None where nothing is."""
    q = scene.solve(max_iterations=0).q
    found = parted(scene, q, TOUCHING, CTRL_C)
    return None if found is None else found[:, :3] - q[:, :3]


SHARES = {(True, False): (0.0, 1.0), (False, True): (1.0, 0.0), (False, False): (0.5, 0.5)}


@pytest.mark.parametrize(("fixed", "share"), SHARES.items())
def test_who_is_free_is_moved(fixed, share):
    ways = ways_of(scene_of((BALL, (0.0, 0.0, 0.0), fixed[0]), (BALL, (0.6, 0.0, 0.0), fixed[1])))
    assert np.linalg.norm(ways, axis=1) == pytest.approx(0.4 * np.array(share), rel=0.02)
    assert np.linalg.norm(ways[1] - ways[0]) >= 0.4


def test_out_of_another_body():
    ways = ways_of(scene_of((BIG, (0.0, 0.0, 0.0), True), (BALL, (0.2, 0.3, 0.9), False)))
    assert ways[0].tolist() == [0.0, 0.0, 0.0]
    assert 1.1 <= np.linalg.norm(ways[1]) <= 1.02 * 1.1


def test_what_is_apart_or_touches_stays():
    assert ways_of(scene_of((BALL, (0.0, 0.0, 0.0), True), (BALL, (1.2, 0.0, 0.0), False))) is None
    assert ways_of(scene_of((BALL, (0.0, 0.0, 0.0), True), (BALL, (1.0 - 1e-11, 0.0, 0.0), False))) is None


def test_two_that_are_fixed_have_no_way():
    scene = scene_of((BALL, (0.0, 0.0, 0.0), True), (BALL, (0.6, 0.0, 0.0), True), (BALL, (5, 0, 0), False))
    assert ways_of(scene) is None


def test_where_time_is_over_there_is_none():
    scene = scene_of((BALL, (0.0, 0.0, 0.0), True), (BALL, (0.6, 0.0, 0.0), False))
    q = scene.solve(max_iterations=0).q
    assert parted(scene, q, TOUCHING, Interruption(1e-9)) is None


def test_several_pairs_that_are_stuck():
    """All are apart at the end."""
    places = [(0.0, 0.0, 0.0), (0.7, 0.05, 0.0), (4.0, 0.0, 0.1), (4.2, 0.3, 0.0)]
    scene = scene_of(*((BALL, place, k == 0) for k, place in enumerate(places)))
    found = parted(scene, scene.solve(max_iterations=0).q, TOUCHING, CTRL_C)
    for i in range(4):
        for k in range(i):
            seen = Motion.of(found[i]).seen_from(Motion.of(found[k]))
            assert least_signed_distance(BALL, BALL, seen) > -1e-10


def test_solves_take_the_least_way():
    """Rows alone may lead anywhere from within: what is proven and nearest to the start is the answer."""
    solution = scene_of((BIG, (0.0, 0.0, 0.0), True), (BALL, (0.2, 0.3, 0.9), False)).solve()
    assert solution.success and solution.proved
    assert np.linalg.norm(solution.q[1, :3] - [0.2, 0.3, 0.9]) <= 1.02 * 1.1
