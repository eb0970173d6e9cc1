"""A solve gives back what it took."""

from __future__ import annotations

import gc
import sys

import assembly as asm


def test_no_reference_to_a_state_is_left_behind():
    scene = asm.Assembly(
        [asm.Body("a", asm.shapes.sphere(1.0), fixed=True), asm.Body("b", asm.shapes.sphere(1.0), (3.0, 0.0, 0.0))]
    )
    scene.minimize(asm.PointDistance(scene.bodies[1].point(0.0, 0.0, 0.0), (2.5, 0.0, 0.0)))
    state = scene.solve()._state
    gc.collect()
    # This name and the argument of the call that counts.
    assert sys.getrefcount(state) == 2
