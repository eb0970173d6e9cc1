"""Rows that are restored alone: a saddle of the violations is left, and is no contradiction."""

from __future__ import annotations

import assembly as asm


def test_parallel_axes_that_are_to_stand_at_right_angles_are_no_contradiction():
    # Their cosine has no slope there. With a contact no other start is tried, so the loop has to leave it by itself.
    floor = asm.Body("floor", asm.shapes.plane(10.0, 10.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), (0.3, 0.1, 0.5))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Perpendicular(floor.frame(), ball.frame()), asm.Contact(floor, ball))
    solution = scene.solve()
    assert solution.success
    assert abs(solution.pose(ball).matrix[2, 2]) < 1e-11
    assert abs(solution.pose(ball).position[2] - 0.5) < 1e-11
