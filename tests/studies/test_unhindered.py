"""Warm solves that no clearance hinders end where solves with contacts do, and lead through nothing."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.proof import ClearanceProof
from assembly.studies import unhindered as module
from tests.studies.machined import turned_part


def slider():
    """A plate that is slid over another one, flush, and turned on it."""
    lower = asm.Body("lower", asm.shapes.plate(60, 40, 10, [(10, 0, 4.5)]), fixed=True)
    upper = asm.Body("upper", asm.shapes.plate(40, 30, 8, [(-5, 3, 4.0)]), position=(3, 2, 9))
    joint = asm.Planar(lower.frame((0, 0, 5)), upper.frame((0, 0, -4)), "on", x=3.0, y=2.0, angle=0.0)
    scene = asm.Assembly([lower, upper])
    scene.constrain(joint, asm.Clearance())
    return scene, joint


def rings(slide):
    """Two linked rings, one of which is drawn along its own plane."""
    a, b = (asm.Body(name, asm.shapes.torus(1.0, 0.1), fixed=name == "a") for name in "ab")
    b.pose = asm.Pose((slide, 0.0, 0.0), (0.5**0.5, 0.5**0.5, 0.0, 0.0))
    joint = asm.Prismatic(a.frame(z=(1, 0, 0), x=(0, 1, 0)), b.frame(z=(1, 0, 0), x=(0, 0, -1)), "draw", slide=slide)
    return a, b, joint


def without(monkeypatch):
    monkeypatch.setattr(module, "unhindered", lambda *_: None)


def test_a_slid_plate_is_where_contacts_lead_it(monkeypatch):
    ends = []
    for alone in (True, False):
        scene, joint = slider()
        if not alone:
            without(monkeypatch)
        solution = scene.solve()
        for k in range(1, 9):
            joint.x, joint.y, joint.angle = 3.0 - 2.0 * k, 2.0 + k, 0.2 * k
            solution = scene.solve(solution)
            assert solution.success and solution.proved
            # Contacts that nobody asks for are not listed.
            assert (solution._lists is not None) is alone
        ends.append(solution)
    assert ends[0].q == pytest.approx(ends[1].q, abs=1e-10)
    assert ends[0].contacts and ends[0].values == pytest.approx(ends[1].values, abs=1e-12)


def test_contacts_are_there_where_they_are_asked_for():
    scene, joint = slider()
    joint.x = 5.0
    solution = scene.solve(scene.solve())
    assert solution._lists is not None
    assert max(abs(contact.gap) for contact in solution.contacts.values()) < 1e-10
    assert solution.feasibility < 1e-10 and solution.mobility.dof == 0
    joint.x = 6.0
    assert scene.solve(solution).success


def test_what_is_in_the_way_pushes():
    """A block on a rail is driven against another one, which is free to slide."""
    ground = asm.Body("ground", fixed=True)
    first, second = (asm.Body(name, asm.shapes.box(2, 2, 2), position=(x, 0, 0)) for name, x in (("a", 0.0), ("b", 3)))
    drive = asm.Prismatic(ground.frame(z=(1, 0, 0)), first.frame(z=(1, 0, 0)), "drive", slide=0.0)
    scene = asm.Assembly([ground, first, second])
    scene.constrain(drive, asm.Prismatic(ground.frame(z=(1, 0, 0)), second.frame(z=(1, 0, 0)), "rail"), asm.Clearance())
    solution = scene.solve()
    for slide, other in ((0.5, 3.0), (0.9, 3.0), (1.2, 3.2), (1.9, 3.9), (1.0, 3.9)):
        drive.slide = slide
        solution = scene.solve(solution)
        assert solution.success and solution.proved
        assert solution.q[1:, 0] == pytest.approx([slide, other], abs=1e-8)


def test_an_objective_goes_by_rows_alone_until_a_clearance_pushes(monkeypatch):
    """A ball is drawn over a floor, into it, and up again: the same poses as with contacts listed at every solve."""
    ends = []
    for alone in (True, False):
        floor = asm.Body("floor", asm.shapes.box(6.0, 6.0, 1.0), fixed=True)
        ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(0.0, 0.0, 2.0))
        scene, aim = asm.Assembly([floor, ball]), asm.PointDistance(ball.point(0, 0, 0), (0.0, 0.0, 2.0))
        scene.constrain(asm.Clearance())
        scene.minimize(aim)
        if not alone:
            without(monkeypatch)
        solution, found, unlisted = scene.solve(), [], []
        for height in (1.8, 1.5, 0.9, 0.8, 0.9, 1.3, 1.6, 1.8):
            aim.target = (2.0 - height, 0.1, height)
            solution = scene.solve(solution)
            assert solution.success and solution.proved
            assert solution.q[1, 2] == pytest.approx(max(height, 1.0), abs=1e-8)
            found.append(solution.q[1, :3])
            unlisted.append(solution._lists is not None)
        # Where the last solution was pushed contacts are listed, else only where rows alone led into the floor.
        assert unlisted == [alone and free for free in (True, True, False, False, False, False, True, True)]
        ends.append(np.array(found))
    assert ends[0] == pytest.approx(ends[1], abs=1e-9)


@pytest.mark.parametrize("slide", [1.0, 0.95])
def test_no_rows_alone_lead_linked_rings_apart(slide, monkeypatch):
    """Where they end the rings are clear, but on the way there they are not."""
    a, b, joint = rings(slide)
    scene, ends = asm.Assembly([a, b]), []
    scene.constrain(joint, asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.q[1, 0] == pytest.approx(slide)
    alone = module.unhindered
    monkeypatch.setattr(module, "unhindered", lambda *asked: ends.append(alone(*asked)) or ends[-1])
    joint.slide = 3.0
    scene.solve(solution, max_iterations=30)
    joint.slide = slide - 0.02
    assert scene.solve(solution).success
    assert ends[0] is None and ends[1].q[1, 0] == pytest.approx(slide - 0.02)


def test_ways_along_a_plane_are_proven_however_long():
    """An arm that lies on a plate goes around by sixth parts of a turn."""
    plate = asm.Body("plate", asm.shapes.box(50, 50, 4), fixed=True)
    arm = asm.Body("arm", asm.shapes.box(30, 6, 4), position=(10, 0, 4))
    hinge = asm.Revolute(plate.frame((0, 0, 2)), arm.frame((-10, 0, -2)), "hinge", angle=0.0)
    scene = asm.Assembly([plate, arm])
    scene.constrain(hinge, asm.Clearance())
    solution = scene.solve()
    for k in range(1, 7):
        hinge.angle = k * np.pi / 3
        solution = scene.solve(solution)
        assert solution.success and solution.proved and solution._lists is not None
        assert all(pair.answer.swept for pair in solution._clear)


def test_nothing_is_known_of_the_way_from_a_solve_that_failed(monkeypatch):
    """Bodies may be in each other there: a block is driven into one that does not move, and back."""
    wall = asm.Body("wall", asm.shapes.box(2, 2, 2), position=(3, 0, 0), fixed=True)
    block = asm.Body("block", asm.shapes.box(2, 2, 2))
    drive = asm.Prismatic(wall.frame((-3, 0, 0), z=(1, 0, 0)), block.frame(z=(1, 0, 0)), "drive", slide=0.9)
    scene, ends = asm.Assembly([wall, block]), []
    scene.constrain(drive, asm.Clearance())
    solution = scene.solve()
    assert solution.success
    drive.slide = 1.5
    failed = scene.solve(solution)
    assert not failed.success
    alone = module.unhindered
    monkeypatch.setattr(module, "unhindered", lambda *asked: ends.append(alone(*asked)) or ends[-1])
    drive.slide = 0.8
    assert scene.solve(failed).success and ends == [None]
    assert scene.solve(solution).success and ends[1] is not None


def test_what_turns_in_its_seat_is_told_by_hulls_once_no_look_proves_its_way(monkeypatch):
    """Each step looked at the last pose and at the way in vain, before hulls told of its end."""
    root = 3**0.5
    seat = asm.Body("seat", turned_part([(5, -5 * root), (25, -5 * root), (25, 0), (10, 0)]), fixed=True)
    plug = asm.Body("plug", turned_part([(0, -4 * root), (6, -4 * root), (12, 2 * root), (0, 2 * root)]))
    spin, scene, looks = asm.Revolute(seat.frame(), plug.frame(), "spin", angle=0.0), asm.Assembly([seat, plug]), []
    scene.constrain(spin, asm.Clearance())
    solution, look = scene.solve(), ClearanceProof.look
    monkeypatch.setattr(ClearanceProof, "look", lambda *asked, **more: looks.append(1) or look(*asked, **more))
    for k in range(1, 7):
        spin.angle = 0.08 * k
        solution = scene.solve(solution)
        assert solution.success and solution.proved and solution._lists is not None
        if k == 2:
            looks.clear()
    assert not looks


@pytest.mark.parametrize("way", [8.0, 40.0])
def test_no_long_way_is_taken_for_a_short_one(way, monkeypatch):
    """Behind a wall that it was flush with a block is clear again, whatever the last way was."""
    monkeypatch.setattr(ClearanceProof, "has_jumped", property(lambda _: True, lambda *_: None), raising=False)
    wall = asm.Body("wall", asm.shapes.box(2, 40, 40), fixed=True)
    block = asm.Body("block", asm.shapes.box(4, 4, 4), position=(-3, 0, 0))
    drive = asm.Prismatic(wall.frame(z=(1, 0, 0)), block.frame(z=(1, 0, 0)), "drive", slide=-3.0)
    scene = asm.Assembly([wall, block])
    scene.constrain(drive, asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution._lists is not None
    drive.slide = way - 3.0
    assert scene.solve(solution)._lists is None
