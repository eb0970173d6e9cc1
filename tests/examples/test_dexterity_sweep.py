"""The example of the dexterity sweep: measures, ellipsoids and the best pose against the linkage's closed form."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import assembly as asm
from tests.examples.running import run_example

RIGHT = 1.2


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("dexterity_sweep", tmp_path_factory.mktemp("dexterity_sweep"))


def tip_and_jacobian(angle):
    """Tip (x, z) in the plane of the linkage, and what unit rates of turntable, left and right crank do to it (3, 3).

    The rods keep their lengths: u.p' = u.a' and v.p' = v.b', with the elbows a, b, the tip p, u = p - a, v = p - b.
    Columns are in the table's axes x, y, z; the turntable moves the tip across the plane.
    """
    a = [60.0, 40.0] + 30.0 * np.array([np.cos(angle), np.sin(angle)])
    a1 = 30.0 * np.array([-np.sin(angle), np.cos(angle)])
    b = [100.0, 40.0] + 50.0 * np.array([np.cos(RIGHT), np.sin(RIGHT)])
    b1 = 50.0 * np.array([-np.sin(RIGHT), np.cos(RIGHT)])
    # Where the circles of 90 around a and of 70 around b meet, above the line from a to b.
    base = np.linalg.norm(b - a)
    along = (base**2 + 90.0**2 - 70.0**2) / (2.0 * base)
    toward = (b - a) / base
    p = a + along * toward + np.sqrt(90.0**2 - along**2) * np.array([-toward[1], toward[0]])
    u, v = p - a, p - b
    planar = np.linalg.solve([u, v], np.diag([u @ a1, v @ b1]))
    jacobian = np.zeros((3, 3))
    jacobian[1, 0] = p[0]
    jacobian[np.ix_([0, 2], [1, 2])] = planar
    return p, jacobian


def manipulability(angle):
    return abs(np.linalg.det(tip_and_jacobian(angle)[1]))


def test_the_sweep_is_solved_all_around(run):
    sweep, _ = run.result
    assert len(sweep) == 121 and all(solution.success for solution in sweep)
    for k, solution in enumerate(sweep):
        angle = np.radians(3.0 * k)
        x, z = tip_and_jacobian(angle)[0]
        tip = solution.pose("left rod").apply([90.0, 0.0, 0.0])
        # A body without shape counts as the extent of its frames; solves hold to 2e-13 of the largest, 108.
        assert tip == pytest.approx([x * np.cos(angle), x * np.sin(angle), z], abs=1e-9)
        assert solution.values["crank.angle"] == pytest.approx(angle, abs=1e-11)


def test_measures_and_ellipsoids_are_those_of_the_closed_form(run):
    sweep, _ = run.result
    linkage, inputs, dexterity = run.module.five_bar()
    for k in range(0, 121, 7):
        angle = np.radians(3.0 * k)
        _, local = tip_and_jacobian(angle)
        turn = asm.Pose.from_axis_angle((0, 0, 1), angle).matrix[:3, :3]
        wanted = turn @ local
        q = sweep[k].q
        tip = dexterity.tip_task.tip
        # Rounding of numbers near 100, and positions that are off by 1e-11 next to a wrist that is well bent.
        assert asm.tip_jacobian(linkage, tip, inputs, q) == pytest.approx(wanted, abs=1e-9)
        value = asm.dexterity_value(linkage, dexterity, q)
        assert value == pytest.approx(manipulability(angle), rel=1e-10)
        ellipsoid = asm.dexterity_ellipsoid(linkage, tip, inputs, q, scale=0.3)
        assert np.prod(ellipsoid.lengths / 0.3) == pytest.approx(value, rel=1e-12)
        squares = ellipsoid.axes @ np.diag((ellipsoid.lengths / 0.3) ** 2) @ ellipsoid.axes.T
        assert squares == pytest.approx(wanted @ wanted.T, abs=1e-6)
        assert ellipsoid.center == pytest.approx(sweep[k].pose("left rod").apply([90.0, 0.0, 0.0]), abs=1e-11)


def slope(angle):
    h = 1e-3
    f = [manipulability(angle + k * h) for k in (-2, -1, 1, 2)]
    return (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h)


def test_the_best_pose_is_the_maximum_of_the_closed_form(run):
    sweep, best = run.result
    assert best.success and best.stationarity < 1e-10
    exact = brentq(slope, np.radians(20.0), np.radians(28.0), xtol=1e-14)
    # Differences of the fourth order are off by 1e-9 of the curvature at most.
    assert best.values["crank.angle"] == pytest.approx(exact, abs=1e-8)
    assert -best.objective == pytest.approx(manipulability(exact), rel=1e-12)
    # The limits do not hold it, and nowhere on the turn is it better.
    assert np.radians(21.1) < best.values["crank.angle"] < np.radians(26.9)
    assert -best.objective >= max(manipulability(t) for t in np.radians(np.arange(0.0, 360.0, 0.1)))


@pytest.mark.parametrize("k", [0, 33, 90])
def test_the_reference_agrees(run, k):
    linkage, inputs, _ = run.module.five_bar()
    inputs[0].angle = inputs[1].angle = np.radians(3.0 * k)
    other = asm.reference.solve(linkage, run.result[0][k].q)
    assert other.success and other.q == pytest.approx(run.result[0][k].q, abs=1e-8)


def test_no_row_says_what_another_says(run):
    linkage, inputs, _ = run.module.five_bar()
    mobility = linkage.mobility(run.result[0][20].q, drives=False)
    assert (mobility.dof, mobility.grubler, mobility.redundant) == (3, 3, [])


def test_it_prints_the_sweep_and_the_best(run):
    assert len(run.lines) == 14
    for k, line in enumerate(run.lines[:-1]):
        crank, angle, degrees, word, value, unit = line.split()
        assert (crank, degrees, word, unit) == ("crank", "deg", "manipulability", "mm^3")
        assert float(angle) == 30.0 * k
        assert float(value) == pytest.approx(manipulability(np.radians(30.0 * k)), abs=1e-4)
    best, angle, _, _, value, _ = run.lines[-1].split()
    assert (best, float(angle), float(value)) == ("best", 23.66789, 183977.9889)
    assert "MeshCat.Viewer" in run.page
