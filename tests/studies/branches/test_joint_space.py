"""Starts from the joint space: what the tree holds, slopes of the rows that close loops, and where starts lead."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import assembly as asm
from assembly.solve.dense.jacobian import rows_of
from assembly.studies.branches.joint_newton import close_rows, move_joint, place_bodies, tree_frames_at, tree_joint_at
from assembly.studies.branches.joint_tree import JointTree
from benchmarks.planar_four_bars import FourBar
from benchmarks.six_axis_arm import Arm, hand_of

TILTED = (0.9, 0.1, -0.3, 0.2)


def tree_of_all_kinds():
    """A body on each kind of joint that carries one, also by its second frame, and what is driven or within limits."""
    ground = asm.Body("ground", position=(1, 2, 3), quaternion=np.array(TILTED) / np.linalg.norm(TILTED), fixed=True)
    bodies = [asm.Body(f"body {k}", position=(k, 0, 0)) for k in range(8)]
    at = {"at": (0.3, 0.1, 0.2), "z": (1, 2, 3)}
    frames = [body.frame(at=(0.1 * k, 0.2, -0.1), z=(1, k, 0.5)) for k, body in enumerate(bodies)]
    joints = [
        asm.Revolute(ground.frame(**at), frames[0], "hinge", limits=(0.2, 0.9)),
        asm.Revolute(frames[1], bodies[0].frame(**at), "from the child", axes="opposed", angle=0.4),
        asm.Prismatic(bodies[1].frame(**at), frames[2], "slider", limits=(1.0, 2.0)),
        asm.Cylindrical(frames[3], bodies[2].frame(**at), "sleeve", slide=0.7),
        asm.Screw(bodies[3].frame(**at), frames[4], 0.3, "screw", slide=0.25),
        asm.Planar(frames[5], bodies[4].frame(**at), "plane", offset=0.6, x_limits=(3.0, 3.1)),
        asm.Spherical(bodies[5].frame(**at), frames[6], "ball"),
        asm.Fixed(frames[7], bodies[6].frame(**at), "weld"),
    ]
    scene = asm.Assembly([ground, *bodies])
    scene.constrain(*joints)
    return scene


def test_drawn_bodies_hold_all_joints_of_the_tree():
    scene = tree_of_all_kinds()
    tree, packed = JointTree(scene), scene.packed()
    assert sorted(tree.carried) == list(range(1, 9)) and tree.loops_close
    poses, off = tree.closed(tree.drawn(np.random.default_rng(0), 20), scene.q)
    assert (off == 0.0).all()
    values = {}
    for q in poses:
        state = scene._start(packed, q, None)
        rows = rows_of(packed, state)
        broken = np.where(rows.one_sided, np.minimum(rows.residual, 0.0), rows.residual)
        # Rounding of eight poses, one after the other.
        assert np.abs(broken).max() < 1e-14
        for name, value in scene.solve(q, max_iterations=0).values.items():
            values.setdefault(name, []).append(value)
    assert np.ptp(values["hinge.angle"]) > 0.4 and np.ptp(values["ball.azimuth"]) > 4.0
    assert np.ptp(values["sleeve.angle"]) > 4.0


def slopes_by_differences(tree, motions, poses):
    """Slopes of the rows by the kernels, and their central differences along the joints' own motions."""
    k, m = tree.coordinates, len(tree._rows)
    columns, scratch = np.empty((k, 9)), np.empty((3, 12))
    moves = np.zeros((poses.shape[0], k), np.int64)
    for e in range(len(tree._joints)):
        joint = tree_joint_at(tree._joints, e)
        moves[joint.child] = moves[joint.parent]
        moves[joint.child, joint.first : joint.first + joint.count] = 1

    def rows_at(motions):
        residual, jacobian = np.empty(m), np.empty((m, k))
        place_bodies(tree._joints, tree._frames, motions, poses, columns, scratch)
        close_rows(tree._rows, tree._row_frames, poses, columns, moves, residual, jacobian, scratch)
        return residual, jacobian

    def moved(step):
        there = motions.copy()
        for e in range(len(tree._joints)):
            joint, frames = tree_joint_at(tree._joints, e), tree_frames_at(tree._frames, e)
            move_joint(joint, frames, step, 1.0, there[e], scratch)
        return rows_at(there)[0]

    _, jacobian = rows_at(motions)
    size = 1e-3
    differences = np.empty_like(jacobian)
    for c, unit in enumerate(np.eye(k)):
        near, far = (moved(n * size * unit) - moved(-n * size * unit) for n in (1.0, 2.0))
        differences[:, c] = (8.0 * near - far) / (12.0 * size)
    return jacobian, differences


def test_rows_that_close_loops_have_their_slopes():
    arm = Arm()
    arm.reach(hand_of(np.random.default_rng(1).uniform(-pi, pi, 6)))
    slide = asm.Assembly(arm.scene.bodies)
    slide.constrain(*arm.joints[:5], asm.Prismatic(arm.joints[5].frame_a, arm.joints[5].frame_b, "slide"))
    slide.constrain(asm.Cylindrical(arm.hand, arm.joints[5].frame_b.body, "sleeve"))
    for scene in (arm.scene, slide):
        tree = JointTree(scene)
        assert tree.loops_close and len(tree._rows) > 0
        starts = tree.drawn(np.random.default_rng(2), 8)
        poses = np.zeros((len(scene.bodies), 12))
        poses[:, [0, 4, 8]] = 1.0
        for motions in starts:
            jacobian, differences = slopes_by_differences(tree, motions, poses)
            # TURN has the slope of axes that lie along each other; all others are exact wherever they are.
            exact = tree._rows[:, 0] != 5
            np.testing.assert_allclose(jacobian[exact], differences[exact], rtol=0, atol=1e-9)


def test_loops_that_close_are_closed_to_rounding():
    bar = FourBar(1.0, 3.0, 2.5, 3.2)
    bar.crank.angle = 0.7
    tree = JointTree(bar.scene)
    poses, off = tree.closed(tree.drawn(np.random.default_rng(0), 64), bar.scene.q)
    closed = off < 1e-12
    assert closed.mean() > 0.9
    for q in poses[closed]:
        assert bar.scene.solve(q, max_iterations=0).feasibility < 1e-11
    assert bar.scene.solve_all(starts=4)[0].success


@pytest.mark.parametrize("reach", [10.0, 1e-3])
def test_a_loop_that_cannot_close_is_told_so(reach):
    bar = FourBar(1.0, 3.0, 2.5, 3.2)
    bar.rocker.frame_a.place(at=(reach if reach > 1.0 else 20.0, 0, 0))
    assert bar.scene.solve_all(starts=6) == []


def test_bodies_that_no_joint_carries_are_drawn_from_a_box():
    bar = FourBar(1.0, 3.0, 2.5, 3.2)
    stray = asm.Body("stray")
    bar.scene.add(stray)
    bar.scene.constrain(asm.Distance(stray.point(0, 0, 0), bar.scene.bodies[0].point(0, 0, 0), 2.0, "leash"))
    bar.crank.angle = 0.7
    found = bar.scene.solve_all(starts=8)
    assert found and all(solution.success for solution in found)
