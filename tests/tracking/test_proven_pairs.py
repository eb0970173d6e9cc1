"""Ticks of mechanisms whose joints keep bodies apart: without contacts, until something is in the way."""

from __future__ import annotations

from collections import Counter
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from assembly.tracking.tick import TrackStatus


def load(name):
    """The module of an example."""
    spec = spec_from_file_location(name, Path(__file__).resolve().parents[2] / "examples" / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


# A tick of 0.6 mm may need a step more.
GOES_ON = (TrackStatus.FOLLOWED, TrackStatus.APPROACHING)
CRANK = load("crank_with_thick_links")


def turning_crank(is_driven):
    """The scene of the example, driven or free, and its joint."""
    scene, drive = CRANK.crank()
    drive.angle = 0.0 if is_driven else None
    return scene, drive


@pytest.mark.parametrize("is_driven", [False, True])
def test_a_crank_of_thick_links_follows(is_driven):
    """By the driven angle, or by a hand at the elbow: no contact is listed, and the rocker is where circles meet."""
    scene, drive = turning_crank(is_driven)
    coupler = scene.body("coupler")
    tracker = scene.tracker(coupler.point(-0.5 * CRANK.LENGTHS["coupler"], 0, 0))
    ground, crank = CRANK.LENGTHS["ground"], CRANK.LENGTHS["crank"]
    for angle in 0.02 * np.arange(1, 31):
        if is_driven:
            drive.angle = angle
        step = tracker.step((crank * np.cos(angle) - 0.5 * ground, crank * np.sin(angle), 12.0))
        assert step.status in GOES_ON and step.proved
        assert not step.solution.contacts
    assert step.status is TrackStatus.FOLLOWED
    assert step.solution.values["swing.angle"] == pytest.approx(CRANK.swing(angle), abs=1e-7)


def arm_and_peg(least=0.0):
    """An arm of 100 by 10 that turns about the origin, and a fixed peg of radius 5 at (80, 40) in its way."""
    base = asm.Body("base", asm.shapes.box(10, 10, 10), position=(0, 0, -15), fixed=True)
    peg = asm.Body("peg", asm.shapes.solid_cylinder(5, 30), position=(80, 40, 0), fixed=True)
    arm = asm.Body("arm", asm.shapes.box(100, 10, 10), position=(45, 0, 0))
    scene = asm.Assembly([base, peg, arm])
    scene.constrain(asm.Revolute(base.frame((0, 0, 15)), arm.frame((-45, 0, 0)), "turn"))
    scene.constrain(asm.Clearance(minimum=least))
    return scene, arm


def highest_angle(least=0.0):
    """Where the arm's side is as far from the peg as it has to be."""
    return np.arctan2(40.0, 80.0) - np.arcsin((10.0 + least) / np.hypot(80.0, 40.0))


@pytest.mark.parametrize("least", [0.0, 1.0])
def test_what_is_in_the_way_is_listed_while_it_pushes(least):
    """An arm that is pressed on a peg rests on it, where a line touches a circle, and leaves it again."""
    scene, arm = arm_and_peg(least)
    tracker = scene.tracker(arm.point(45, 0, 0))
    most = highest_angle(least)
    statuses, listed, highest = Counter(), [], -np.inf
    angles = np.r_[np.arange(0.0, 0.6, 0.02), np.arange(0.6, 0.0, -0.02)]
    for angle in angles:
        step = tracker.step((90.0 * np.cos(angle), 90.0 * np.sin(angle), 0.0))
        statuses[step.status] += 1
        at = 2.0 * np.arctan2(step.q[2, 6], step.q[2, 3])
        highest = max(highest, at)
        listed.append(len(step.solution.contacts))
        assert step.proved and at <= most + 1e-10
        if angle < most - 0.05:
            assert at == pytest.approx(angle, abs=1e-7)
    assert highest == pytest.approx(most, abs=1e-9)
    assert not statuses[TrackStatus.HELD]
    assert listed[0] == 0 and max(listed) > 0 and listed[-1] == 0


def test_a_budget_holds_the_tick_in_which_rows_are_found_wanting():
    """Later ticks have them: the arm comes to rest on the peg however little time a tick has, and goes back."""
    scene, arm = arm_and_peg()
    tracker = scene.tracker(arm.point(45, 0, 0), budget=3e-5)
    # Where the machine is busy there may be no time at all, of which it takes 3,000 ticks either way.
    for angle in [*np.arange(0.0, 0.6, 0.02), *[0.6] * 9000]:
        step = tracker.step((90.0 * np.cos(angle), 90.0 * np.sin(angle), 0.0))
        at = 2.0 * np.arctan2(step.q[2, 6], step.q[2, 3])
        assert step.proved and at <= highest_angle() + 1e-10
        if at >= highest_angle() - 1e-9:
            break
    assert at == pytest.approx(highest_angle(), abs=1e-9)
    for _ in range(9000):
        step = tracker.step((90.0, 0.0, 0.0))
        if step.status is TrackStatus.FOLLOWED:
            break
    assert step.q[2] == pytest.approx((45.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0), abs=1e-7)


def test_two_trackers_of_one_scene_give_the_same():
    scene, arm = arm_and_peg()
    path = [(90.0 * np.cos(angle), 90.0 * np.sin(angle), 0.0) for angle in np.arange(0.0, 0.5, 0.05)]
    one, other = (scene.tracker(arm.point(45, 0, 0)) for _ in range(2))
    for target in path:
        assert (one.step(target).q == other.step(target).q).all()
