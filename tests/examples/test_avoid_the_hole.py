"""The example of the egg and the hole: where it is drawn to, against minima over contacts and turns found by scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from tests.examples.running import run_example

AXES = np.array([9.0, 6.0, 5.0])
LENGTH = 20.0  # by which a turn counts


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("avoid_the_hole", tmp_path_factory.mktemp("avoid_the_hole"))


def off_center(run, solution):
    return solution.contacts["touch"].parameters[:2] - np.array(run.module.CENTER)


def touching(surface, u, v, turn):
    """Where the egg's middle is if it touches the surface at (u, v) from above, turned so."""
    place, along, across = surface.evaluate(u, v, 1)
    normal = np.cross(along, across)
    down = turn.inv().apply(-normal / np.linalg.norm(normal))
    # The point of an ellipsoid with a given outward normal.
    return place - turn.apply(AXES**2 * down / np.linalg.norm(AXES * down))


def wishes(surface, u, v, spin, x):
    turn = Rotation.from_rotvec(spin)
    wish = touching(surface, u, v, turn) - [x, 0.0, 5.0]
    return np.concatenate([wish, 2.0 * LENGTH * turn.as_quat()[:3]])


def least(residuals, start):
    found = least_squares(residuals, start, jac="3-point", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x, 2.0 * found.cost


def test_all_poses_are_found_and_stay_out_of_the_hole(run):
    assert len(run.result) == 77 and all(solution.success for solution in run.result)
    away = np.array([np.hypot(*off_center(run, solution)) for solution in run.result])
    # Constraints hold to 2e-13 of the largest extent, some 130.
    assert away.min() > run.module.RADIUS - 1e-10
    on_rim = away < run.module.RADIUS + 1e-9
    # It reaches the rim once and leaves it once, and goes around a third of it between.
    assert np.flatnonzero(np.diff(on_rim.astype(int))).size == 2 and on_rim.sum() > 20
    angles = [np.arctan2(*off_center(run, solution)[::-1]) for solution in np.array(run.result)[on_rim]]
    turned = np.diff(np.unwrap(angles))
    assert (turned > 0.0).all() and turned.sum() > 2.0 and turned.max() < 0.3


@pytest.mark.parametrize("k", [0, 9, 20, 62, 76])
def test_beside_the_hole_it_is_the_minimum_over_all_contacts(run, k):
    surface, x = run.module.curved_plate().surface, -36.0 + k
    solution = run.result[k]
    assert np.hypot(*off_center(run, solution)) > run.module.RADIUS + 1e-3
    start = np.concatenate([solution.contacts["touch"].parameters[:2] + [0.3, -0.2], np.zeros(3)])
    (u, v, *spin), cost = least(lambda y: wishes(surface, y[0], y[1], y[2:], x), start)
    # Minima by differences of residuals are good to some 1e-8.
    assert solution.contacts["touch"].parameters[:2] == pytest.approx([u, v], abs=1e-6)
    assert solution.pose("egg").position == pytest.approx(touching(surface, u, v, Rotation.from_rotvec(spin)), abs=1e-6)
    assert solution.objective == pytest.approx(cost, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("k", [27, 33, 38, 43, 50])
def test_at_the_hole_it_is_the_minimum_over_the_rim(run, k):
    surface, x = run.module.curved_plate().surface, -36.0 + k
    solution = run.result[k]
    away = off_center(run, solution)
    radius = run.module.RADIUS
    assert np.hypot(*away) == pytest.approx(radius, abs=1e-10)

    def on_circle(r):
        def residuals(y):
            u, v = np.array(run.module.CENTER) + r * np.array([np.cos(y[0]), np.sin(y[0])])
            return wishes(surface, u, v, y[1:], x)

        return least(residuals, [np.arctan2(away[1], away[0]) + 0.02, 0.0, 0.0, 0.0])

    (angle, *_), cost = on_circle(radius)
    assert away == pytest.approx(radius * np.array([np.cos(angle), np.sin(angle)]), abs=1e-6)
    assert solution.objective == pytest.approx(cost, rel=1e-9)
    # Farther out is worse, farther in would be better: it is held by the rim.
    assert on_circle(radius + 0.01)[1] > cost > on_circle(radius - 0.01)[1]


def test_the_egg_touches_the_plate_from_above(run):
    for solution in run.result[::6]:
        pair = solution.contacts["touch"]
        pose = solution.pose("egg")
        u, v = pair.parameters[:2]
        turn = Rotation.from_quat(np.roll(pose.quaternion, -1))
        exact = touching(run.module.curved_plate().surface, u, v, turn)
        # Parameters are found to 1e-12 of the size, and the normal's rate is below one over 5 mm.
        assert pose.position == pytest.approx(exact, abs=1e-9)
        assert abs(pair.gap) < 1e-10


def test_it_prints_where_the_contact_is(run):
    assert len(run.lines) == 21
    for line, solution in zip(run.lines[1:], run.result[::4], strict=True):
        x, u, v, away, gap, status = line.split()
        assert status == "SOLVED" and abs(float(gap)) < 1e-9
        assert [float(u), float(v)] == pytest.approx(solution.contacts["touch"].parameters[:2], abs=5.1e-7)
        assert float(away) == pytest.approx(np.hypot(*off_center(run, solution)), abs=5.1e-10)
    assert "MeshCat.Viewer" in run.page
