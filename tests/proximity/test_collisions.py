"""Many curves against many obstacles: the same answers as one by one, none missed."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.distance.enclosures.queries import enclosed_distance
from assembly.errors import InputError
from assembly.proximity import collisions


def paths(rng, count, d=2):
    points = np.zeros((count, 6, d))
    points[:, :, 0] = [-0.2, 0.0, 0.0, 0.0, 1.0, 1.2]
    points[:, :, 1] = 0.5
    points[:, 2:4] = rng.uniform(0, 1, (count, 2, d))
    return points


def polygon(rng, center, d=2):
    turn = rng.normal(size=(20, d))
    return np.array(center) + 0.1 * turn / np.linalg.norm(turn, axis=1)[:, None]


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("clearance", [0.0, 0.03])
def test_as_one_by_one(d, clearance):
    rng = np.random.default_rng(d)
    curves = paths(rng, 60, d)
    obstacles = [polygon(rng, [0.35, 0.6, 0.1][:d], d), polygon(rng, [0.65, 0.4, -0.1][:d], d), np.full((1, d), 0.5)]
    near = collisions(curves, obstacles, clearance)
    assert near.shape == (60, 3) and near.dtype == bool
    assert 0 < near.sum() < near.size
    for i in range(60):
        for j, obstacle in enumerate(obstacles):
            answer = enclosed_distance(asm.NurbsCurve.bezier(curves[i]), obstacle)
            if abs(answer.lower - clearance) > 1e-9:
                assert near[i, j] == (answer.upper <= clearance)


def test_splines():
    rng = np.random.default_rng(4)
    curves = [asm.NurbsCurve.bezier(p, rng.uniform(0.3, 3.0, 6)) for p in paths(rng, 20)]
    curves += [asm.NurbsCurve(p, [0, 0, 0, 0, 0.3, 0.6, 1, 1, 1, 1], 3) for p in paths(rng, 20)]
    obstacles = [polygon(rng, (0.35, 0.6)), polygon(rng, (0.65, 0.4))]
    near = collisions(curves, obstacles, 0.02)
    for i, curve in enumerate(curves):
        for j, obstacle in enumerate(obstacles):
            assert near[i, j] == (enclosed_distance(curve, obstacle).upper <= 0.02)


def test_degrees_mixed():
    rng = np.random.default_rng(8)
    curves = [asm.NurbsCurve.bezier(rng.uniform(-0.2, 1.2, (n + 1, 2))) for n in (7, 1, 12, 3, 1, 7, 2, 45) * 6]
    # Vertices in no order, some twice; a segment and a point have no inside.
    some = polygon(rng, (0.5, 0.5))
    obstacles = [np.concatenate([some, some[:3]]), some[:2] + 0.2, some[:1]]
    near = collisions(curves, obstacles, 0.02)
    assert 0 < near.sum() < near.size
    for i, curve in enumerate(curves):
        for j, obstacle in enumerate(obstacles):
            assert near[i, j] == (enclosed_distance(curve, obstacle).upper <= 0.02)


def test_touching_and_inside():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    inside = [[0.4, 0.4], [0.6, 0.6]]
    along = [[-1.0, 1.0], [2.0, 1.0]]
    above = [[-1.0, 1.0 + 1e-9], [2.0, 1.0 + 1e-9]]
    through = [[-1.0, 0.5], [2.0, 0.5]]
    corner = [[-0.5, 0.5 - 1e-9], [0.5, -0.5 - 1e-9]]
    near = collisions(np.array([inside, along, above, through, corner]), [square])
    assert near[:, 0].tolist() == [True, True, False, True, False]
    assert collisions(np.array([above]), [square], 2e-9).all()
    assert collisions(np.array([inside]), []).shape == (1, 0)


@pytest.mark.parametrize(("offset", "size", "tolerance"), [(1e8, 1.0, 1e-10), (0.0, 1e9, 1e-10), (1e5, 1e2, 1e-12)])
@pytest.mark.parametrize("seed", range(3))
def test_tolerances_below_the_rounding_of_coordinates(offset, size, tolerance, seed):
    # Pieces as short as their rounding have halves that are no shorter.
    rng = np.random.default_rng(seed)
    curve = size * rng.normal(size=(5, 2)) + offset
    on = asm.NurbsCurve.bezier(curve).evaluate(0.37)
    touching = [on[None], np.array([on, on + size * rng.normal(size=2)])]
    away = curve.max(axis=0) + 1e-3 * size
    near = collisions(curve[None], [*touching, away[None]], 0.0, tolerance)
    assert near.tolist() == [[True, True, False]]


def test_bad_input():
    curves = np.zeros((3, 4, 2)) + np.arange(4)[:, None]
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    with pytest.raises(InputError, match=r"curves has shape \(3, 4\)"):
        collisions(curves[..., 0], [square])
    with pytest.raises(InputError, match="expected .n, k, 2. or"):
        collisions(np.zeros((3, 4, 5)), [square])
    with pytest.raises(InputError, match="obstacles is no sequence"):
        collisions(curves, square)
    with pytest.raises(InputError, match=r"obstacles\[0\] has shape \(3, 3\)"):
        collisions(curves, [np.zeros((3, 3))])
    with pytest.raises(InputError, match="clearance is -1"):
        collisions(curves, [square], -1.0)
    with pytest.raises(InputError, match="tolerance is 0"):
        collisions(curves, [square], 0.0, 0.0)
    ragged = [[0.0, 0.0, 0.0], [1.0, 1.0]]
    with pytest.raises(InputError, match="curves is .*; expected real numbers of shape"):
        collisions(ragged, [square])
    for obstacles, k in (([ragged], 0), ([square, ragged], 1)):
        with pytest.raises(InputError, match=rf"obstacles\[{k}\] is .*; expected real numbers of shape"):
            collisions(curves, obstacles)
    for obstacles in (np.array(1.0), 1.0, "square", None):
        with pytest.raises(InputError, match="obstacles is no sequence"):
            collisions(curves, obstacles)
    masked = np.ma.array(curves, mask=curves > 2.0)
    with pytest.raises(InputError, match="curves has masked values"):
        collisions(masked, [square])
    with pytest.raises(InputError, match=r"obstacles\[0\] has masked values"):
        collisions(curves, [masked[0]])
    assert collisions(np.ma.array(curves), [square]).shape == (3, 1)  # nothing is masked
    line = asm.NurbsCurve.polyline([[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(TypeError, match=r"curves\[1\] is 3"):
        collisions([line, 3], [square])
    with pytest.raises(InputError, match=r"curves\[1\] is 3-D"):
        collisions([line, asm.NurbsCurve.polyline([[0.0, 0, 0], [1.0, 1, 1]])], [square])
