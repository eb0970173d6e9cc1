"""Solves that go on from a solution by the loop alone: they return what the way with all that may follow does."""

from __future__ import annotations

import math
import threading

import numpy as np
import pytest

import assembly as asm
from assembly.solve.interruption import CTRL_C
from assembly.solve.straight import straight_from
from benchmarks import linkages
from benchmarks.running import example


def four_bar():
    scene, crank = linkages.four_bar()

    def change(k):
        crank.angle = 0.3 + math.radians(k)

    return scene, change


def gears():
    train, crank, _ = example("gear_train").gear_train()

    def change(k):
        crank.angle = 0.3 * k

    return train, change


def arm():
    scene, tip, hinges = linkages.arm(4, seed=3)
    for hinge in hinges:
        hinge.angle = None
    hand = asm.PointDistance(tip, (3.0, 0.3, 0.4))
    scene.minimize(hand)

    def change(k):
        hand.target = (3.0 - 0.01 * k, 0.3, 0.4)

    return scene, change


def clips():
    scene = example("paper_clips").paper_clips()
    ((_, grip),) = scene.objectives
    begin = np.array(grip.target)

    def change(k):
        grip.target = begin + np.array([0.06, -0.04, 0.05]) * k

    return scene, change


def straight_of(scene, begun):
    return straight_from(begun, scene._scene, scene._packed)


@pytest.mark.parametrize("make", [four_bar, gears, arm, clips])
def test_it_is_to_the_bit_the_solve_with_all_that_may_follow(make):
    scene, change = make()
    begun = scene.solve()
    assert begun.success
    went = 0
    for k in (1, 2, 3, 9):
        change(k)
        straight = straight_of(scene, begun)
        whole = scene._from_start(begun, None, {}, CTRL_C)
        assert whole.success
        if straight is not None:
            went += 1
            assert straight.status is whole.status and straight._order is whole._order and straight._fit is whole._fit
            assert straight._touching == whole._touching
            np.testing.assert_array_equal(straight._state, whole._state)
            np.testing.assert_array_equal(straight.history, whole.history)
            assert all(map(np.array_equal, straight._asked, whole._asked))
        begun = scene.solve(begun)
        np.testing.assert_array_equal(begun.q, whole.q)
    assert went == 4


def test_what_does_not_arrive_is_tried_with_all_there_is():
    ground, link = asm.Body("ground", fixed=True), asm.Body("link")
    hinge = asm.Revolute(ground, link, "hinge")
    far = asm.Distance(ground.point(0, 0, 0), link.point(1, 0, 0), 1.0, "far")
    scene = asm.Assembly([ground, link])
    scene.constrain(hinge, far)
    begun = scene.solve()
    assert begun.success and straight_of(scene, begun) is not None
    far.value = 1.5
    assert straight_of(scene, begun) is None
    failed = scene.solve(begun)
    assert failed.status is asm.Status.INFEASIBLE and failed.conflicting == ["far", "hinge"]


def test_what_has_changed_or_needs_more_goes_the_whole_way():
    scene, change = four_bar()
    begun = scene.solve()
    change(1)
    assert straight_of(scene, begun) is not None
    # A row more, of a joint of this scene: it is packed anew, and the solution is of before.
    scene.constraints[0].freedom().limits = (-9.0, 9.0)
    scene.constraints[0].angle = None
    assert straight_of(scene, begun) is None
    assert scene.solve(begun).success

    balls = [asm.Body(name, asm.shapes.sphere(1.0), (4.0 * k, 0, 0), fixed=k == 0) for k, name in enumerate("ab")]
    apart = asm.Assembly(balls)
    apart.constrain(asm.Clearance())
    apart.minimize(asm.PointDistance(balls[1].point(0, 0, 0), (3.0, 0.0, 0.0)))
    begun = apart.solve()
    assert begun.success and straight_of(apart, begun) is None and apart.solve(begun).proved


def test_numbers_set_since_are_those_of_the_next_solve():
    ground, link = asm.Body("ground", fixed=True), asm.Body("link")
    hinge = asm.Revolute(ground.frame(), link, "hinge", angle=0.3)
    scene = asm.Assembly([ground, link])
    scene.constrain(hinge)
    begun = scene.solve()
    hinge.frame_a.place(at=(1.0, 2.0, 0.0))
    moved = scene.solve(begun)
    np.testing.assert_allclose(moved.pose(link).position, (1.0, 2.0, 0.0), rtol=0, atol=1e-12)
    # And those set in another scene change nothing here.
    asm.Revolute(ground, link, "other").frame_a.place(at=(5.0, 0.0, 0.0))
    np.testing.assert_array_equal(scene.solve(moved).q, moved.q)
    link.fixed = True
    with pytest.raises(asm.errors.InputError):
        scene.solve(moved)


def test_another_thread_goes_straight_as_well():
    scene, change = four_bar()
    begun = scene.solve()
    change(1)
    here, there = scene.solve(begun), []
    thread = threading.Thread(target=lambda: there.append(scene.solve(begun)))
    thread.start()
    thread.join()
    np.testing.assert_array_equal(there[0].q, here.q)


def set_place(scene):
    scene.constraints[1].frame_a.place(at=(1.1, 0.0, 0.0))


def disable(scene):
    scene.constraints[3].enabled = False


def fix(scene):
    scene.bodies[1].fixed = True


@pytest.mark.parametrize(("edit", "rows"), [(set_place, "the same"), (disable, "fewer"), (fix, "fewer")])
def test_what_was_edited_is_noticed_before_it_goes_straight(edit, rows):
    scene, change = four_bar()
    # The second solve goes straight, and so would the third.
    begun = scene.solve(scene.solve())
    fresh, _ = four_bar()
    for each in (scene, fresh):
        edit(each)
    if rows == "the same":
        here = scene.solve(begun)
        # The multipliers of a warm start are other ones: the same place to rounding, not to the bit.
        assert here.success and np.allclose(here.q, fresh.solve(begun.q).q, rtol=0, atol=1e-12)
        assert not np.array_equal(here.q, begun.q)
    else:
        with pytest.raises(asm.errors.InputError, match="q0 is a solution of another assembly"):
            scene.solve(begun)


class Interrupted(Exception):
    pass


@pytest.mark.parametrize("at", ["reshape", "addressof", "get_ident"])
def test_what_interrupts_the_lending_of_other_arrays_leaves_none_of_them_lent(monkeypatch, at):
    scene, change = four_bar()
    begun = scene.solve()
    change(1)
    before = scene.solve(begun)
    packed = scene._packed
    (workspace,) = packed.workspaces
    other = packed.twin()
    other.rows_pool[[place for _, place in other.driven_angles]] += 0.4

    def interrupt(*_):
        raise Interrupted

    class Arrays(tuple):
        def __getitem__(self, k):
            interrupt()

    lent = workspace.arrays
    with monkeypatch.context() as patch:
        if at == "reshape":
            # As on another thread, where all arrays are lent anew.
            workspace.arrays, workspace._thread = Arrays(lent), 0
        else:
            patch.setattr(f"assembly.solve.workspace.{at}", interrupt)
        with pytest.raises(Interrupted):
            workspace.go_on(other, begun._state.copy())
    workspace.arrays = lent
    # The first scene has the workspace as well: it solves its own numbers, not the other's.
    np.testing.assert_array_equal(scene.solve(begun).q, before.q)
