"""Pickles: scenes travel as what they are made of, and solve to the same bits; solutions are starts elsewhere."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest

import assembly as asm
from benchmarks.linkages import four_bar
from benchmarks.running import example

# What is found out by a solve and kept beside: places of clearances, whether corners are listed.
LITTLE = 1.03


def linkage():
    return four_bar()[0]


def clips_apart():
    scene = example("paper_clips").paper_clips()
    scene.constrain(asm.Clearance())
    return scene


def crates():
    floor, crate = asm.Body("floor", asm.shapes.box(20, 20, 1), fixed=True), asm.Body("crate", asm.shapes.box(1, 1, 1))
    crate.pose = asm.Pose((0, 0, 2.0))
    scene = asm.Assembly([floor, crate])
    scene.constrain(asm.Contact(floor, crate))
    return scene


def upside_down():
    """Axes are those that are nearest where a solve begins."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", quaternion=(0.1, 0.99, 0.1, 0.0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Revolute(ground, arm, "seat", axes="nearest"))
    return scene


SCENES = [linkage, clips_apart, crates, upside_down]


@pytest.mark.parametrize("make", SCENES)
def test_a_scene_travels_as_what_it_is_made_of(make):
    scene = make()
    before = pickle.dumps(scene)
    solution = scene.solve()
    after = pickle.dumps(scene)
    assert len(after) <= LITTLE * len(before) + 100
    for data in (before, after):
        np.testing.assert_array_equal(pickle.loads(data).solve().q, solution.q)
    np.testing.assert_array_equal(copy.deepcopy(scene).solve().q, scene.solve().q)


def test_three_paper_clips_are_10_kilobytes():
    # The clip travels once; 3.8 MB went with the packed scene.
    scene = clips_apart()
    assert scene.solve().success
    assert len(pickle.dumps(scene)) < 11_000
    assert len(pickle.dumps([scene, scene])) < 11_100


@pytest.mark.parametrize("make", SCENES)
def test_a_solution_is_a_start_of_a_scene_like_its_own(make):
    scene = make()
    solution = scene.solve()
    told = pickle.loads(pickle.dumps(solution))
    assert told.status is solution.status and np.array_equal(told.q, solution.q)
    assert told.violations == solution.violations and told.message == solution.message
    # Clearances are packed and proven anew in every one of them.
    more = [] if make is clips_apart else [make(), copy.deepcopy(scene), copy.copy(scene), scene]
    for other in (pickle.loads(pickle.dumps(scene)), *more):
        again = other.solve(told)
        assert again.success and again.iterations <= 1 and again.axes == solution.axes
        np.testing.assert_allclose(again.q, solution.q, rtol=0, atol=1e-12)
        # What goes on from there is of the other scene.
        assert other.solve(again).success


def test_a_solution_is_a_start_where_sizes_are_others():
    scene, crank = four_bar()
    solution = scene.solve()
    other, driven = four_bar()
    other.constraints[1].frame_a.place(at=(1.02, 0, 0))
    driven.angle = 0.35
    warm, cold = other.solve(solution), other.solve(solution.q)
    assert warm.success and warm.iterations <= cold.iterations
    np.testing.assert_allclose(warm.q, cold.q, rtol=0, atol=1e-10)
    balls = []
    for radius in (1.0, 1.5):
        plate, ball = asm.Body("plate", asm.shapes.plane(9, 9), fixed=True), asm.Body("ball", asm.shapes.sphere(radius))
        ball.pose = asm.Pose((0, 0, 2))
        balls.append(asm.Assembly([plate, ball]))
        balls[-1].constrain(asm.Contact(plate, ball))
    grown = balls[1].solve(balls[0].solve())
    assert grown.success and abs(grown.q[1, 2] - 1.5) < 1e-12


def test_a_number_that_a_function_makes_faces_of_travels_with_its_scene():
    size = asm.Parameter(asm.shapes.sphere, 1.0, name="radius")
    plate, ball = asm.Body("plate", asm.shapes.plane(9, 9), fixed=True), asm.Body("ball", size.shape, (0, 0, 2))
    scene = asm.Assembly([plate, ball])
    scene.constrain(asm.Contact(plate, ball))
    there, radius = pickle.loads(pickle.dumps((scene, size)))
    radius.value = 1.5
    assert size.value == 1.0 and abs(there.solve().q[1, 2] - 1.5) < 1e-12
    found = asm.study(scene, asm.grid({size: [1.0, 1.25]}), of=asm.Measure(ball, "z"))
    assert found.success.all()


def test_a_solution_of_other_bodies_or_constraints_is_none():
    solution = linkage().solve()
    renamed, crank = four_bar()
    renamed.remove("ball")
    renamed.constrain(asm.Spherical(renamed.bodies[1].frame((1, 0, 0)), renamed.bodies[2], "socket"))
    fixed = linkage()
    fixed.bodies[1].fixed = True
    more = linkage()
    more.minimize(asm.Posture())
    free, hinge = four_bar()
    hinge.freedom().limits = (-9.0, 9.0)
    hinge.angle = None
    for other in (renamed, fixed, more, free):
        with pytest.raises(asm.errors.InputError, match="q0 is a solution of another assembly, .* by name"):
            other.solve(solution)


ELSEWHERE = """
import pickle, sys
import numpy as np
scene, solution = pickle.loads(sys.stdin.buffer.read())
cold, warm = scene.solve(), scene.solve(solution)
sys.stdout.buffer.write(pickle.dumps((cold.q, warm.q, warm.success)))
"""


def test_another_process_solves_to_the_same_bits():
    scene = example("paper_clips").paper_clips()
    solution = scene.solve()
    data = pickle.dumps((scene, solution))
    done = subprocess.run([sys.executable, "-c", ELSEWHERE], input=data, capture_output=True, check=True)
    cold, warm, success = pickle.loads(done.stdout)
    np.testing.assert_array_equal(cold, solution.q)
    assert success
    np.testing.assert_array_equal(warm, solution.q)
