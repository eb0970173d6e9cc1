"""Places of parameters in the pool: what is written there is what a scene with these numbers is packed with."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.program.records import VERSION
from assembly.derivatives.pool_writes import pool_writes
from benchmarks.linkages import four_bar


def scene_of_all_kinds():
    """A four-bar with an offset, limits, targets of a point and of a frame, and a frame that two joints have."""
    scene, hinge = four_bar()
    _, crank, coupler, rocker = scene.bodies
    shared = coupler.frame((3.1, 0.2, 0.1))
    scene.constrain(asm.Angle(coupler, rocker, limits=(0.1, 3.0), name="fan"))
    scene.constrain(asm.Distance(crank, rocker, limits=(0.1, 9.0), name="leash"))
    gear = asm.Gear(hinge, scene.constraints[3], 0.5, offset=0.1, name="gear")
    scene.constrain(gear)
    goal, place = asm.PointDistance(coupler.point(1, 0, 0), (1, 2, 3)), asm.FrameDistance(shared, asm.Pose((3, 0, 1)))
    scene.minimize(goal, place)
    return scene, {
        "drive": (hinge, "angle"),
        "lower": (scene.constraints[4].freedom(), "lower"),
        "upper": (scene.constraints[5].freedom(), "upper"),
        "offset": (gear, "offset"),
        "target": (goal, "target", "y"),
        "target of a frame": (place, "target", "z"),
        "frame": (scene.constraints[2].frame_b, "origin", "y"),
        "frame of a target": (shared, "origin", "x"),
    }


@pytest.mark.parametrize("name", sorted(scene_of_all_kinds()[1]))
def test_the_pool_is_that_of_the_scene_with_the_number(name):
    scene, kinds = scene_of_all_kinds()
    # The longest body, by whose size lengths are divided, stays.
    scene.add(asm.Body("frame", asm.shapes.box(30, 30, 30), fixed=True))
    parameter = asm.Parameter(*kinds[name])
    packed = scene.packed()
    packed.refresh()
    before = packed.rows_pool.copy()
    writes = pool_writes(packed, parameter)
    assert writes
    value = parameter.value + 0.05
    expected = before.copy()
    for write in writes:
        assert write.numbers(np.array([parameter.value]))[0] == before[write.place]
        expected[write.place] = write.numbers(np.array([value]))[0]
    parameter.value = value
    now = scene.packed()
    now.refresh()
    assert now.scale == packed.scale
    expected[VERSION] = now.rows_pool[VERSION]
    np.testing.assert_array_equal(now.rows_pool, expected)
    assert not np.array_equal(before, expected)


def test_what_takes_more_than_numbers_has_no_places():
    scene, hinge = four_bar()
    ball = asm.Body("ball", asm.Parametric(asm.shapes.sphere, radius=1.0))
    scene.add(ball)
    packed = scene.packed()
    for parameter in (asm.Parameter(ball, "radius"), asm.Parameter(hinge.frame_a, "turn", "x")):
        assert pool_writes(packed, parameter) is None


def test_targets_are_written_from_where_the_first_body_stands():
    ground, ball = (
        asm.Body("ground", position=(10.0, -7.0, 3.0), fixed=True),
        asm.Body("ball", position=(11.0, -7.0, 3.0)),
    )
    scene = asm.Assembly([ground, ball])
    goal = asm.PointDistance(ball.point(0, 0, 0), target=(11.0, -7.0, 3.0))
    scene.minimize(goal)
    along = asm.Parameter(goal, "target", "x")
    (write,) = pool_writes(scene.packed(), along)
    along.value = 12.5
    packed = scene.packed()
    packed.refresh()
    assert packed.rows_pool[write.place] == write.numbers(np.array([12.5]))[0] == 2.5 / packed.scale
