"""Contacts that joints let close, told by screws; a nut that the collars of its screw take along."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import assembly as asm
from assembly.kinematics.pose import retract, rotation_matrix
from assembly.solve.contact_pairs import ContactRows
from assembly.tracking.closing import closing_rates, screw_between
from assembly.tracking.tick import TrackStatus

PITCH, PLAY, RADIUS, THICK = 4.0, 0.05, 10.0, 10.0


def random_pose(rng, angle):
    """A pose (7,) that is turned by an angle."""
    axis = rng.normal(size=3)
    quaternion = np.r_[np.cos(0.5 * angle), np.sin(0.5 * angle) * axis / np.linalg.norm(axis)]
    return np.r_[rng.normal(size=3), quaternion]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-5, 0.9e-4, 1.1e-4, 0.01, 1.0, 3.0])
def test_a_screw_makes_its_motion(angle):
    """Its twist, kept up in 2^20 equal parts of a unit of time, leads to the same rotation and shift."""
    pose = random_pose(np.random.default_rng(int(1e6 * angle)), angle)
    rotation, shift = rotation_matrix(pose[3:]), pose[:3]
    v, w = screw_between(rotation, shift)
    small = np.eye(4)
    turned = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]]) / 2.0**20
    small[:3, :3] += turned + 0.5 * turned @ turned
    small[:3, 3] = (np.eye(3) + 0.5 * turned) @ v / 2.0**20
    # A part is off by its cube, and a product by its rounding.
    motion = np.linalg.matrix_power(small, 2**20)
    assert motion[:3, :3] == pytest.approx(rotation, abs=2e-9)
    assert motion[:3, 3] == pytest.approx(shift, abs=4e-9)


def contact(normal, point):
    """One contact of bodies 0 and 1, with a gap of zero."""
    rows = np.array([normal], dtype=float), np.array([[point, point]], dtype=float)
    return ContactRows(np.zeros(1, np.int64), np.array([[0, 1]]), *rows, np.zeros(1))


def test_rates_are_derivatives_of_gaps():
    """By where a short way of both bodies takes the point of the second one, seen from the first."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        here = np.array([random_pose(rng, 0.7), random_pose(rng, 1.1)])
        point, normal = rng.normal(size=3), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        there = retract(here, 1e-6 * rng.normal(size=(2, 6)))
        first, second = (rotation_matrix(q[3:]) for q in here)
        first_after, second_after = (rotation_matrix(q[3:]) for q in there)
        taken = second_after @ second.T @ (point - here[1, :3]) + there[1, :3]
        seen = first_after.T @ (taken - there[0, :3]) - first.T @ (point - here[0, :3])
        # What is left out is of second order.
        rate = closing_rates(contact(normal, point), here, there)[0]
        assert rate == pytest.approx((first @ seen) @ normal, abs=1e-10)


@pytest.mark.parametrize("angle", [1e-6, 0.05, 1.0, 2.5])
def test_what_slides_has_no_rate(angle):
    """However far a plate turns on a table about any point, or a ring in its bore: no gap closes."""
    here = np.array([[0.3, 0.1, 0.0, 1.0, 0.0, 0.0, 0.0], [5.0, 2.0, 1.0, 1.0, 0.0, 0.0, 0.0]])
    there = here.copy()
    there[1] = 4.0, -3.0, 1.0, np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)
    assert abs(closing_rates(contact((0, 0, 1), (7.0, 3.0, 0.5)), here, there)[0]) < 1e-14
    there[1, :3] = 5.0, 2.0, 4.0
    assert abs(closing_rates(contact((0.6, 0.8, 0), (5.0 + 1.2, 2.0 + 1.6, 0.5)), here, there)[0]) < 1e-14


def nut_and_screw():
    """A nut on a guide, on a screw that turns in a base and has a collar on either side of it."""
    low, high, out, end = 0.5 * THICK + PLAY, 0.5 * THICK + PLAY + 6.0, RADIUS + 6.0, 60.0
    profile = [(0, -end), (RADIUS, -end), (RADIUS, -high), (out, -high), (out, -low), (RADIUS, -low), (RADIUS, low)]
    profile += [(out, low), (out, high), (RADIUS, high), (RADIUS, end), (0, end)]
    base = asm.Body("base", asm.shapes.box(60, 10, 120), position=(0, -35, 0), fixed=True)
    nut = asm.Body("nut", asm.shapes.plate(50, 60, THICK, [(0, 0, RADIUS + PLAY)]))
    screw = asm.Body("screw", asm.shapes.revolution(asm.curves.polygon(profile)))
    place = base.frame((0, 35, 0))
    guide = asm.Prismatic(place, nut.frame(), "guide")
    turn = asm.Screw(place, screw.frame(), PITCH, "turn")
    scene = asm.Assembly([base, nut, screw])
    scene.constrain(guide, turn, asm.Clearance())
    return scene, guide, turn


@pytest.mark.parametrize("by_nut", [False, True])
def test_collars_take_a_nut_along(by_nut):
    """It goes with a collar once the play is used up, to either side, and contacts are found at few ticks only.

    No force holds the nut, so that none of the contacts that take it along pushes.
    """
    scene, guide, turn = nut_and_screw()
    tracker = scene.tracker(guide.coordinate("slide") if by_nut else turn.coordinate("angle"))
    statuses, updates = Counter(), 0
    ways = np.r_[np.arange(1, 16), np.arange(14, 0, -1)] * 0.02
    for way in ways:
        before = len(tracker._rows._closing)
        step = tracker.step(way if by_nut else 2.0 * np.pi * way / PITCH)
        statuses[step.status] += 1
        updates += len(tracker._rows._closing) > before
        nut, screw = step.q[1:, 2]
        # A tick ends where the spring's pull along the thread is a part of 1e-9 of the size.
        assert step.proved and (nut if by_nut else screw) == pytest.approx(way, abs=5e-6)
        assert abs(nut - screw) <= PLAY + 1e-9
    assert statuses == {TrackStatus.FOLLOWED: len(ways)}
    # At either collar once, where it comes to lie on the nut, and in the few ticks in which it comes near.
    assert 1 <= updates <= 4


def test_a_budget_holds_few_ticks_of_a_nut():
    """The tick at which a collar meets the nut is HELD or LATE, and those after it have its rows."""
    scene, _, turn = nut_and_screw()
    tracker = scene.tracker(turn.coordinate("angle"), budget=1.0)
    statuses = [tracker.step(0.03 * k).status for k in range(1, 16)]
    assert statuses.count(TrackStatus.HELD) == 1 and statuses[-1] is TrackStatus.FOLLOWED
