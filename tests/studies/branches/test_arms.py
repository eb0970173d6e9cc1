"""All branches of an arm's inverse kinematics, judged by the closed form; their configurations; executors."""

from __future__ import annotations

import pickle
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from math import pi
from multiprocessing import get_context

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from benchmarks.planar_four_bars import FourBar
from benchmarks.six_axis_arm import Arm, angles_of, hand_of, is_found


def test_the_closed_form_reaches_the_hand():
    rng = np.random.default_rng(0)
    for _ in range(20):
        hand = hand_of(rng.uniform(-pi, pi, 6))
        for angles in angles_of(hand):
            np.testing.assert_allclose(hand_of(angles), hand, rtol=0, atol=1e-12)


def test_all_branches_of_an_arm_are_found(cases):
    arm, rng = Arm(), np.random.default_rng(2)
    complete, generic = 0, 0
    count = cases(25, 200)
    for _ in range(count):
        hand = hand_of(rng.uniform(-pi, pi, 6))
        arm.reach(hand)
        expected, found = angles_of(hand), arm.scene.solve_all(starts="all")
        assert len(found) == len(expected)
        complete += all(is_found(angles, found) for angles in expected)
        if len(expected) == 8:
            generic += 1
            # Three signs, all eight ways.
            assert len({tuple(asm.configuration(solution).values()) for solution in found}) == 8
    assert complete == count and generic > count // 2


def test_signs_are_those_of_the_closed_form():
    arm, rng = Arm(), np.random.default_rng(3)
    seen = []
    for _ in range(6):
        hand = hand_of(rng.uniform(-pi, pi, 6))
        arm.reach(hand)
        for solution in arm.scene.solve_all(starts="all"):
            signs = asm.configuration(solution)
            assert list(signs) == ["axis 2-axis 3-axis 4", "axis 4-axis 5-axis 6", "loop of hold"]
            elbow, wrist = (np.sin(solution.values[f"axis {k}.angle"]) for k in (3, 5))
            seen.append(
                [signs["axis 2-axis 3-axis 4"] * np.sign(elbow), signs["axis 4-axis 5-axis 6"] * np.sign(wrist)]
            )
    # One convention throughout.
    assert (np.array(seen) == seen[0]).all()


def test_limits_leave_the_branches_within():
    arm = Arm()
    hand = hand_of([0.3, -1.2, 1.4, -0.5, 0.8, 0.2])
    arm.reach(hand)
    arm.joints[2].limits, arm.joints[4].limits = (0.1, 3.0), (0.1, 3.0)
    found = arm.scene.solve_all(starts="all")
    within = [a for a in angles_of(hand) if 0.1 < a[2] < 3.0 and 0.1 < a[4] < 3.0]
    assert len(within) == 2 and all(is_found(angles, found) for angles in within)
    for solution in found:
        assert 0.1 - 1e-9 <= solution.values["axis 3.angle"] <= 3.0 + 1e-9


def test_an_arm_that_cannot_reach_has_no_branch():
    arm = Arm()
    hand = hand_of(np.zeros(6))
    hand[:3, 3] *= 3.0
    arm.reach(hand)
    assert arm.scene.solve_all(starts=20) == []


def test_branches_that_are_near_each_other_are_two():
    bar = FourBar(1.0, 3.0, 2.5, 3.2)
    # The rocker beside its end: the two ways to close differ by the root of what it is off by.
    bar.rocker.angle = bar.dead_centers()[0] + 1e-6
    found = bar.scene.solve_all(starts="all")
    assert len(found) == 2
    signs = [asm.configuration(solution)["crank-pin-wrist"] for solution in found]
    assert sorted(signs) == [-1, 1]
    assert np.abs(found[0].q[:, :3] - found[1].q[:, :3]).max() < 2e-2
    bar.rocker.angle = bar.dead_centers()[0]
    assert len(bar.scene.solve_all(starts=8)) == 1


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_an_executor_finds_the_same(kind):
    arm = Arm()
    arm.reach(hand_of([0.3, -1.2, 1.4, -0.5, 0.8, 0.2]))
    alone = arm.scene.solve_all(starts=40)
    context = get_context("spawn")
    pool = ThreadPoolExecutor(2) if kind == "threads" else ProcessPoolExecutor(1, mp_context=context)
    with pool:
        found = arm.scene.solve_all(starts=40, executor=pool)
    assert len(found) == len(alone) == 8
    for one, other in zip(found, alone, strict=True):
        np.testing.assert_array_equal(one.q, other.q)
        assert one.objective == other.objective and one.values == other.values
    # They are solutions of the scene, from which it goes on.
    assert arm.scene.solve(found[3]).iterations <= 1


def test_starts_may_be_poses_and_unpickled_solutions():
    arm = Arm()
    hand = hand_of([0.3, -1.2, 1.4, -0.5, 0.8, 0.2])
    arm.reach(hand)
    first = arm.scene.solve_all(starts="all")
    apart = pickle.loads(pickle.dumps(first))
    again = arm.scene.solve_all(starts=[apart[0], *[solution.q for solution in apart[1:]], apart[2]])
    assert len(again) == 8
    for one, other in zip(first, again, strict=True):
        np.testing.assert_allclose(one.q, other.q, rtol=0, atol=1e-12)


def test_bad_arguments_raise():
    scene = FourBar(1.0, 3.0, 2.5, 3.2).scene
    for starts, words in (("every", "'all'"), (0, "starts is 0"), ([np.zeros(3)], r"starts\[0\]")):
        with pytest.raises(InputError, match=words):
            scene.solve_all(starts=starts)
    with pytest.raises(TypeError, match="executor"):
        scene.solve_all(executor=4)
    with pytest.raises(TypeError, match="expected a Solution"):
        asm.configuration(scene)
    failed = scene.solve(max_iterations=0)
    assert not failed.success
    with pytest.raises(InputError, match="that succeeded"):
        asm.configuration(failed)
