"""Certificates of enclosures hold; `python -m tests.laws.enclosure_certificates` makes 100,000 queries of each sort."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.distance.enclosures.queries import enclosed_distance
from tests.laws.enclosure_certificates import (
    SORTS,
    fault,
    faults,
    formula_curve,
    hull_distances,
    known_distance,
    known_surface_distance,
    surface_faults,
)


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("sort", SORTS)
def test_random_queries(sort, dimension, cases):
    count = cases(50, 150)
    found, done, statuses = faults(np.random.default_rng(3), sort, dimension, count)
    assert found == [] and done >= count
    assert {"CONVERGED", "DISJOINT", "UNDECIDED"} <= set(statuses)


def test_random_surfaces(cases):
    count = cases(50, 150)
    found, done, statuses = surface_faults(np.random.default_rng(4), count)
    assert found == [] and done >= count
    assert {"CONVERGED", "DISJOINT", "UNDECIDED", "BUDGET_SPENT"} <= set(statuses)


def test_the_oracle_of_surfaces():
    """A torus about z and a line along it, straight above the ring of its highest points, or across it."""
    torus = asm.shapes.torus(0.5, 0.2)
    t = ca.SX.sym("t")
    for column, known in (((0.5, t, 0.4), 0.2), ((t, 0.0, 0.3), 0.1), ((0.0, 0.0, t), 0.3)):
        line = asm.FormulaCurve(ca.vertcat(*column), t, (-0.6, 0.7))
        found = known_surface_distance(line, torus)
        # Above the ring the distance grows with the fourth power: samples hardly tell where it is least.
        assert known <= found + 1e-15 and found <= known + 1e-8


def test_a_wrong_certificate_is_seen():
    rng = np.random.default_rng(5)
    curve = formula_curve(rng, 2)
    point = np.array([3.0, 2.0])
    known = known_distance(curve, point)
    answer = enclosed_distance(curve, point)
    assert fault(answer, curve, point, known, None) is None
    for change in ({"lower": known + 1e-12, "upper": known + 1e-11}, {"upper": known - 1e-12, "lower": 0.0}):
        wrong = type(answer)(**(vars(answer) | change))
        assert fault(wrong, curve, point, known, None) is not None


def test_the_oracle_of_hulls():
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    x = np.random.default_rng(6).uniform(-1, 2, (500, 3))
    assert hull_distances(x, box) == pytest.approx(np.linalg.norm(x - x.clip(0, 1), axis=1), abs=1e-14)
