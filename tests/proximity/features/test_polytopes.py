"""Convex bodies of flat faces: what parts two of them, by support functions along very many directions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.features.polytopes import partings, polytope_of

SHAPES = asm.shapes


def prism(corners, height):
    points = np.array(corners, float)
    sides = [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(points, np.roll(points, -1, 0), strict=True)]
    return SHAPES.extrusion(sides, height)


SOLIDS = {
    "box": SHAPES.box(1.0, 0.8, 0.6),
    "seed": SHAPES.box(0.05, 0.04, 0.06),
    "plate": SHAPES.box(2.0, 1.5, 0.1),
    "wedge": prism([(0.0, 0.0), (1.2, 0.0), (0.1, 0.7)], 0.9),
    "prism": prism([(np.cos(t), np.sin(t)) for t in 2.0 * np.pi * np.arange(7) / 7.0], 0.5),
}


def polytope(name):
    body = asm.Body(name, SOLIDS[name])
    return polytope_of(tuple(side.face for side in body.faces))


def depths(a, b, turn, shift, ways):
    corners = b.corners @ turn.T + shift
    return (a.corners @ ways.T).max(axis=0) - (corners @ ways.T).min(axis=0)


def test_the_depth_is_the_least_of_all_directions(cases):
    rng = np.random.default_rng(5)
    kinds = set()
    for _ in range(cases(40, 2000)):
        a, b = (polytope(str(name)) for name in rng.choice(list(SOLIDS), 2))
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
        shift = rng.normal(size=3) * rng.choice([0.2, 0.8])
        (found,) = partings(a, b, turn[None], shift[None], [0.0])
        n = found.normal
        # The normal is one along which they are so deep.
        assert np.linalg.norm(n) == pytest.approx(1.0, abs=1e-14)
        assert depths(a, b, turn, shift, n[None])[0] == pytest.approx(found.depth, abs=1e-13)
        if found.depth < 0.0:
            kinds.add("apart")
            continue
        kinds.add("nested" if found.is_nested else "crossing")
        ways = rng.normal(size=(2000, 3))
        ways /= np.linalg.norm(ways, axis=1)[:, None]
        sampled = depths(a, b, turn, shift, ways)
        assert sampled.min() >= found.depth - 1e-13
        # Around the best of them, too.
        beside = n + 10.0 ** rng.uniform(-9.0, -1.0, (500, 1)) * rng.normal(size=(500, 3))
        beside /= np.linalg.norm(beside, axis=1)[:, None]
        assert depths(a, b, turn, shift, beside).min() >= found.depth - 1e-13
        corners = b.corners @ turn.T + shift
        inside = (corners @ a.normals.T - a.heights).max() <= 0.0
        around = ((a.corners - shift) @ turn @ b.normals.T - b.heights).max() <= 0.0
        assert found.is_nested == (inside or around)
    assert kinds == {"apart", "crossing", "nested"}


def test_many_places_at_once_are_each_of_them():
    rng = np.random.default_rng(6)
    a, b = polytope("wedge"), polytope("prism")
    turns = Rotation.random(300, random_state=1).as_matrix()
    shifts = rng.normal(size=(300, 3))
    together = partings(a, b, turns, shifts, [0.0] * 300)
    for turn, shift, one in zip(turns, shifts, together, strict=True):
        (alone,) = partings(a, b, turn[None], shift[None], [0.0])
        assert alone.depth == pytest.approx(one.depth, abs=1e-14)


def test_what_is_no_polytope():
    corner = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
    for shape in (SHAPES.sphere(1.0), SHAPES.solid_cylinder(1.0, 2.0), SHAPES.plane(1.0, 1.0), prism(corner, 1.0)):
        body = asm.Body("body", shape)
        assert polytope_of(tuple(side.face for side in body.faces)) is None
