"""Corners of loops that touch, and how many pairs of their curves are compared."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.faces import touches
from assembly.geometry.faces.relinked import _Corners


@pytest.mark.parametrize("periods", [(0.0, 0.0), (2.0, 0.0), (0.7, 3.0)])
def test_a_corner_is_the_first_within_reach(periods):
    random, reach = np.random.default_rng(3), 0.05
    corners, places = _Corners(np.array(periods), reach), []
    for point in random.uniform(-3.0, 3.0, (1500, 2)):
        off = point - np.array(places).reshape(-1, 2)
        for axis, period in enumerate(periods):
            if period > 0.0:
                off[:, axis] -= np.round(off[:, axis] / period) * period
        near = np.flatnonzero((np.abs(off) <= reach).all(axis=1))
        expected = int(near[0]) if near.size else len(places)
        if not near.size:
            places.append(point)
        assert corners.number(point) == expected
    assert len(corners.points) == len(places) < 1500


def row_of_holes(count):
    """A plate with round holes that are tangent to their neighbors."""
    size = 2.0 * count + 4.0
    ground = asm.NurbsSurface(
        [[[0.0, 0.0, 0.0], [0.0, 4.0, 0.0]], [[size, 0.0, 0.0], [size, 4.0, 0.0]]],
        [[0.0, 0.0, size, size], [0.0, 0.0, 4.0, 4.0]],
        (1, 1),
    )
    ring = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    knots, weights = np.repeat([0.0, 1.0], 3), [1.0, np.sqrt(0.5), 1.0]
    outer = asm.NurbsCurve.polyline([[1, 0.5], [size - 1, 0.5], [size - 1, 3.5], [1, 3.5], [1, 0.5]])
    holes = [
        [asm.NurbsCurve(ring[k : k + 3] + [2.0 * n + 3.0, 2.0], knots, 2, weights) for k in (0, 2, 4, 6)]
        for n in range(count)
    ]
    return asm.Face(ground, outer, holes)


def test_curves_that_are_apart_are_not_compared(monkeypatch):
    compared, asked = [], touches._meetings
    monkeypatch.setattr(touches, "_meetings", lambda *given: compared.append(1) or asked(*given))
    counts = []
    for count in (10, 20, 40):
        compared.clear()
        face = row_of_holes(count)
        assert face.area() == pytest.approx(3.0 * (2.0 * count + 2.0) - np.pi * count, abs=1e-10)
        counts.append(len(compared))
    assert counts[2] - counts[1] == 2 * (counts[1] - counts[0])
