"""The mechanisms that are measured are what they are said to be."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from benchmarks import cadquery_boxes, linkages
from benchmarks.pictures import exponent


@pytest.mark.parametrize("make", [linkages.bennett, linkages.bricard, linkages.planar_four_bar])
@pytest.mark.parametrize("size", [1e-6, 1.0, 1e6])
def test_linkages_stand_closed(make, size):
    scene = make(size)
    # Roundings of a few products, lengths in units of the size and angles.
    assert scene.mobility().feasibility < 1e-14 * max(size, 1.0)


@pytest.mark.parametrize("kind", linkages.CONTRADICTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_contradictions_are_minimal(kind, seed):
    scene, names = linkages.contradiction(kind, seed)
    assert "tail" not in names and len(names) == len(scene.constraints) - 1
    for left_out in names:
        # Without one of them the others can hold; a coupling reads its joints, in the scene or not.
        rest = asm.Assembly(scene.bodies)
        for constraint in scene.constraints:
            if constraint.name != left_out:
                rest.constrain(constraint)
        assert rest.solve().success, left_out
    # The same seed, the same scene.
    np.testing.assert_array_equal(linkages.contradiction(kind, seed)[0].q, scene.q)


@pytest.mark.parametrize("count", [1, 4])
def test_parallelograms_lie_flat(count):
    scene = linkages.parallelograms(count)
    assert len(scene.constraints) == 3 * count + 1 and scene.mobility().feasibility == 0.0


def test_boxes_are_scattered_and_stand_on_each_other_when_solved():
    scene = linkages.boxes(5, seed=1)
    assert scene.mobility().feasibility > 0.1
    solution = scene.solve()
    for below, above in zip(scene.bodies, scene.bodies[1:], strict=False):
        up = solution.pose(below).apply((0, 0, 1)) - solution.pose(below).position
        # Rows hold to 2e-13 of a size of two.
        np.testing.assert_allclose(solution.pose(above).position - solution.pose(below).position, up, atol=1e-12)


def test_exponent():
    counts = (2, 8, 16, 64)
    # Logarithms and a line through them.
    assert exponent(counts, [3e-6 * n**1.5 for n in counts]) == pytest.approx(1.5, abs=1e-13)


def test_a_peer_that_is_not_there_says_so():
    # Without the folders of installed packages there is none.
    done = subprocess.run(
        [sys.executable, "-I", "-S", str(Path(cadquery_boxes.__file__))],
        input="[]",
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) is None
