"""How many pairs of nodes the proofs of single ticks look at: counts, so that a slow tick is found without a clock."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.kept_looks import KeptLooks
from assembly.tracking.proven_pose import BUDGET
from assembly.tracking.tick import TrackStatus
from tests.tracking.test_bores import plug_in_its_seat


@pytest.fixture
def sought(monkeypatch):
    """The pairs of nodes that each look went into."""
    found, looked = [], KeptLooks._looked

    def counted(self, *asked):
        tasks = yield from looked(self, *asked)
        found.append(int(self.fronts.counts.sought.sum()))
        return tasks

    monkeypatch.setattr(KeptLooks, "_looked", counted)
    return found


def most_of_a_tick(tracker, path, sought):
    """How many pairs the proof of one tick looked at, at most, and how often ticks were HELD."""
    most, held = 0, 0
    for target in path:
        sought.clear()
        step = tracker.step(target)
        assert step.proved
        most, held = max(most, sum(sought)), held + (step.status is TrackStatus.HELD)
    return most, held


def test_no_way_is_sought_to_a_pose_that_is_not_clear(sought):
    """A pin that tips over in a steep seat: ticks that go too far are HELD by a few looks at their pose."""
    seat = asm.shapes.revolution(asm.curves.polygon([(10.05, -5), (30, -5), (30, 5), (17, 5)]))
    bodies = [asm.Body("seat", seat, fixed=True), asm.Body("pin", asm.shapes.solid_cylinder(10.0, 40.0))]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    path = [(0.5 * k, 0.0, 20.0) for k in range(1, 12)]
    most, held = most_of_a_tick(scene.tracker(bodies[1].point(0, 0, 20)), path, sought)
    # Looks at all parts of the ways took 300,000.
    assert 0 < held <= 2 and BUDGET <= most <= 3 * BUDGET


def test_a_way_along_a_bore_makes_no_cells(sought):
    """A plug that is lifted and drawn aside touches its seat: where the way is too long a shorter one is taken."""
    scene, bodies, _ = plug_in_its_seat()
    path = [(0.4 * k, 0.0, 20.5 - 0.002 * k * k) for k in np.arange(1, 31)]
    most, held = most_of_a_tick(scene.tracker(bodies[1].point(0, 0, 20)), path, sought)
    # Cells as fine as the gap took 19,000.
    assert held == 0 and most <= 0.5 * BUDGET


def test_cells_beside_a_rim_become_shorter_where_a_way_turns(sought):
    """A box tips over a hole's rim: its face parts from flat cells beside the rim at the end, and not at the begin.

    By chord error, which is next to nothing there, they were halved along the rim again and again.
    """
    plate = asm.Body("plate", asm.shapes.plate(3, 2, 0.3, [(-0.7, 0, 0.5), (0.7, 0.1, 0.4)]), fixed=True)
    box = asm.Body("box", asm.shapes.box(0.4, 0.3, 0.2), (-0.2, 0.0, 0.3))
    scene = asm.Assembly([plate, box])
    scene.constrain(asm.Clearance())
    angle = 0.02 * np.arange(192)
    path = np.column_stack([0.1 * np.sin(angle) - 0.2, 0.1 * np.cos(angle), np.full(192, 0.2)])
    most, held = most_of_a_tick(scene.tracker(box.point(0, 0, 0)), path, sought)
    # Halved by chord error they took 62,000, and by planes that stay, while the box's face turns, 6,000.
    assert held <= 1 and most <= 0.5 * BUDGET
