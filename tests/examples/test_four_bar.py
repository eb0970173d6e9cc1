"""The example of the spatial four-bar: three grasps, each against the mechanism's closed form or another solver."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import brentq

import assembly as asm
from tests.examples.running import run_example

KINDS = ("point", "rigid", "surface")
HAND = np.array([40.0, -40.0, 80.0])
CRANK_HINGE, ROCKER_HINGE = np.array([-70.0, 0.0, 15.0]), np.array([70.0, 0.0, 15.0])


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("four_bar", tmp_path_factory.mktemp("four_bar"))


def link_pose(angle):
    """Where the link is for an angle of the crank: its first end, its axis, and the second arm of its cross.

    The rocker's angle solves c1 cos f + c2 sin f = k, which says that the link is 150 long; of the two solutions the
    one with the rocker more upright.
    """
    first = CRANK_HINGE + 60.0 * np.array([np.sin(angle), 0.0, np.cos(angle)])
    hinge, up = np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0), np.array([0.0, 0.0, 1.0])
    away, across = first - ROCKER_HINGE, np.cross(hinge, up)
    k = (away @ away + 90.0**2 - 150.0**2) / (2.0 * 90.0)
    turn, width = np.arctan2(away @ across, away @ up), np.arccos(k / np.hypot(away @ up, away @ across))
    f = min((turn - width, turn + width), key=abs)
    second = ROCKER_HINGE + 90.0 * (np.cos(f) * up + np.sin(f) * across)
    along = (second - first) / 150.0
    # The cross: one arm is the crank's y axis, the other the link's z axis.
    arm = np.cross(along, [0.0, 1.0, 0.0])
    return first, along, arm / np.linalg.norm(arm)


def wish(kind, angle):
    first, along, arm = link_pose(angle)
    value = np.sum((first + 75.0 * along - HAND) ** 2)
    if kind == "rigid":
        # Of a turn by t the trace is 1 + 2 cos t, and 4 sin^2(t / 2) = 2 - 2 cos t = 3 - trace.
        value += 75.0**2 * (3.0 - (along[0] + np.cross(arm, along)[1] + arm[2]))
    return value


def slope(kind, angle):
    """d wish / d angle by differences of the fourth order: truncation and rounding are below 1e-9 of the wish."""
    h = 2e-3
    f = [wish(kind, angle + k * h) for k in (-2, -1, 1, 2)]
    return (f[0] - 8.0 * f[1] + 8.0 * f[2] - f[3]) / (12.0 * h)


@pytest.mark.parametrize("kind", ["point", "rigid"])
def test_the_crank_is_where_the_closed_form_has_its_least_wish(run, kind):
    solution = run.result[kind]
    angle = brentq(lambda t: slope(kind, t), 0.4, 0.9, xtol=1e-14)
    # The error of the slope over the curvature, which is some 1e4.
    assert solution.values["crank hinge.angle"] == pytest.approx(angle, abs=1e-9)
    first, along, arm = link_pose(solution.values["crank hinge.angle"])
    pose = solution.pose("link")
    # The tolerance of the solve is 2e-13 of the largest body, which is 216 long.
    assert pose.position == pytest.approx(first, abs=1e-9)
    assert pose.matrix[:3, 0] == pytest.approx(along, abs=1e-11)
    assert pose.matrix[:3, 2] == pytest.approx(arm, abs=1e-11)
    # What a violation of 2e-11 changes: as much times the force, which is some 50.
    assert solution.objective == pytest.approx(wish(kind, angle), abs=1e-8)
    # It is the least of all, not only nearby.
    reachable = [wish(kind, t) for t in np.radians(np.arange(-20.0, 181.0))]
    assert solution.objective <= min(reachable) + 1e-8


@pytest.mark.parametrize("kind", KINDS)
def test_the_reference_agrees(run, kind):
    scene, _, _ = run.module.grasped(kind)
    other = asm.reference.solve(scene)
    assert other.success
    assert run.result[kind].q == pytest.approx(other.q, abs=1e-8)
    assert run.result[kind].success and max(run.result[kind].violations.values()) < 1e-10


@pytest.mark.parametrize("kind", KINDS)
def test_it_has_one_freedom_and_the_ring_five_more(run, kind):
    scene, _, _ = run.module.grasped(kind)
    mobility = scene.mobility(run.result[kind].q)
    assert mobility.dof == mobility.grubler == (6 if kind == "surface" else 1)
    assert not mobility.redundant


def test_the_ring_is_around_the_link_and_touches_it_once(run):
    solution = run.result["surface"]
    link, hand = solution.pose("link"), solution.pose("hand")
    turn = np.linspace(0.0, 2.0 * np.pi, 20_001)
    circle = 14.0 * np.column_stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)])
    tube = link.inverse().apply(hand.apply(circle))
    from_axis = np.hypot(tube[:, 1], tube[:, 2])
    # The tube's and the rod's radius are 4; samples are 0.004 apart, so that the least is found to 1e-6.
    assert from_axis.min() == pytest.approx(8.0, abs=1e-6)
    # Around: the axis of the link meets the ring's plane within the circle.
    start, end = hand.inverse().apply(link.apply([[0.0, 0.0, 0.0], [150.0, 0.0, 0.0]]))
    crossing = start + (end - start) * start[2] / (start[2] - end[2])
    assert start[2] * end[2] < 0.0 and np.hypot(*crossing[:2]) < 14.0
    assert 0.0 < tube[:, 0].min() and tube[:, 0].max() < 150.0
    pair = solution.contacts["grip"]
    assert abs(pair.gap) < 1e-10
    # The rod pulls back: on the ring acts no force but the hand's and the contact's, along the normal.
    pull = 2.0 * (hand.position - HAND)
    assert np.cross(pull, pair.normal) == pytest.approx(np.zeros(3), abs=1e-8)
    assert pull @ pair.normal > 0.0


def test_it_prints_a_line_a_grasp(run):
    heading, *lines = run.lines
    assert heading.split() == ["grasp", "crank", "[deg]", "apart", "[mm]", "iterations"]
    numbers = {}
    for line in lines:
        kind, angle, apart, iterations, status = line.split()
        solution = run.result[kind]
        assert (int(iterations), status) == (solution.iterations, "SOLVED")
        assert float(angle) == pytest.approx(np.degrees(solution.values["crank hinge.angle"]), abs=6e-7)
        numbers[kind] = float(angle), float(apart)
    # Six digits, as they were found by the closed form and by the reference.
    assert numbers == {
        "point": (40.661863, 20.909590),
        "rigid": (36.043528, 21.579236),
        "surface": (36.135351, 13.839531),
    }
    assert "MeshCat.Viewer" in run.page
