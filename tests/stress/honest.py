"""What must hold of every answer, whatever was asked: finite poses, a status that is true, and a measured violation."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm

# What a solve promises by default, over the scene's size, with what evaluating a row again may add.
HELD = 1e-12


def world(q, frame):
    """Origin and axes (columns) of a frame of a body at a row of q; None for a point's axes."""
    turn = Rotation.from_quat(q[3:], scalar_first=True).as_matrix()
    axes = getattr(frame, "axes", None)
    return q[:3] + turn @ np.asarray(frame.position), None if axes is None else turn @ np.asarray(axes)


def check(scene, solution, held=HELD):
    """Assert what every solution owes; its status is returned."""
    q = solution.q
    size = scene.packed().scale
    assert np.isfinite(q).all()
    assert np.abs(np.linalg.norm(q[:, 3:], axis=1) - 1.0).max() <= 4e-16 * 4
    assert solution.message and isinstance(solution.message, str)
    assert solution.success == (solution.status in (asm.Status.SOLVED, asm.Status.FITTED))
    assert not np.isnan(solution.feasibility) and not np.isnan(solution.stationarity)
    assert not any(np.isnan(value) for value in solution.violations.values())
    for body, row in zip(scene.bodies, q, strict=True):
        if body.fixed:
            np.testing.assert_array_equal(row, body.q)
    if solution.success:
        reach = np.abs(q[:, :3]).max(initial=size)
        # Rounding of coordinates far from the origin is all that may be added.
        bound = held * size + 8e-16 * reach
        assert solution.feasibility <= bound
        for constraint in scene.constraints:
            if isinstance(constraint, asm.Contact):
                gap = touch(scene, q, constraint, solution.contacts[constraint.name].parameters)
                assert (gap >= -bound) if constraint.unilateral else (abs(gap) <= bound), constraint.name
    return solution.status


def touch(scene, q, contact, start):
    """Gap of a contact between bodies of one face, found again from where it was."""
    rows = [q[scene.bodies.index(body)] for body in contact.bodies]
    faces = [body.face() for body in contact.bodies]
    pair = asm.proximity.extremal_pair(faces[0], rows[0], faces[1], rows[1], start)
    assert pair.status in (asm.proximity.PairStatus.CONVERGED, asm.proximity.PairStatus.SINGULAR)
    return pair.gap
