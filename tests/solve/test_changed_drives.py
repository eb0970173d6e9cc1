"""Solves that go on from a solution of before coordinates of joints became driven, free or limited."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assembly as asm
from benchmarks import linkages


def test_a_linkage_that_is_driven_freed_and_limited_goes_on_from_each_solution():
    scene, _ = linkages.four_bar()
    joints = [item for item in scene.constraints if isinstance(item, asm.Revolute)]
    last, rng, steps = scene.solve(), np.random.default_rng(1), np.zeros(2, dtype=int)
    for _ in range(60):
        for joint in joints:
            joint.angle = joint.limits = None
        joint = joints[rng.integers(len(joints))]
        angle = last.values[f"{joint.name}.angle"]
        joint.angle, joint.limits = [
            (angle + rng.uniform(-0.2, 0.2), None),
            (angle, None),
            (None, (angle - 0.5, angle + 0.1)),
            (None, (angle + 0.05, angle + 0.5)),
            (None, None),
        ][rng.integers(5)]
        here, from_poses = scene.solve(last), scene.solve(last.q)
        assert here.status is from_poses.status
        assert np.abs(here.q - from_poses.q).max() < 1e-5 or joint.angle is None
        steps += here.iterations, from_poses.iterations
        last = here if here.success else last
    assert steps[0] <= steps[1]


def wheel():
    ground, wheel = asm.Body("ground", fixed=True), asm.Body("wheel")
    hub = asm.Revolute(ground.frame(), wheel.frame(), "hub")
    scene = asm.Assembly([ground, wheel])
    scene.constrain(hub)
    return scene, hub


def test_angles_keep_their_turns():
    scene, hub = wheel()
    hub.angle = 7.0
    driven = scene.solve()
    hub.angle, hub.limits = None, (-9.0, 9.0)
    limited = scene.solve(driven)
    # From its poses the turn would be the one next to zero.
    assert limited.values["hub.angle"] == pytest.approx(7.0) and np.array_equal(limited.q, driven.q)
    assert scene.solve(driven.q).values["hub.angle"] == pytest.approx(7.0 - 2.0 * math.pi)


def test_an_angle_that_was_not_looked_for_is_on_the_turn_that_its_limits_ask_for():
    scene, hub = wheel()
    free = scene.solve()
    hub.limits = (6.0, 8.0)
    limited = scene.solve(free)
    assert limited.success and limited.values["hub.angle"] == pytest.approx(2.0 * math.pi)


def test_what_pushes_pushes_on():
    """Two drawn arms: the angle of one is limited meanwhile, and the multiplier of the other one's limit is kept."""
    ground = asm.Body("ground", fixed=True)
    arms = [asm.Body(name) for name in ("one", "other")]
    joints = [asm.Revolute(ground.frame((3.0 * k, 0, 0)), arm.frame(), arm.name) for k, arm in enumerate(arms)]
    scene = asm.Assembly([ground, *arms])
    scene.constrain(*joints)
    for k, arm in enumerate(arms):
        scene.minimize(asm.PointDistance(arm.point(1.0, 0, 0), (3.0 * k + 0.5, 1.0, 0.0)))
    joints[0].limits = (-0.5, 0.5)
    drawn = scene.solve()
    pushing = drawn._state[drawn._packed.multipliers_at : drawn._packed.residuals_at]
    joints[1].limits = (-4.0, 4.0)
    packed = scene.packed()
    begun, is_complete = scene._begun_by(packed, drawn)
    handed = begun[packed.multipliers_at : packed.residuals_at]
    assert not is_complete and np.abs(pushing).max() > 0.1
    # Two rows more, on which nothing pushes.
    np.testing.assert_allclose(sorted(handed), sorted([*pushing, 0.0, 0.0]), rtol=1e-12, atol=1e-15)
    again = scene.solve(drawn)
    assert again.success and again.iterations <= 1
    np.testing.assert_allclose(again.q, drawn.q, rtol=0, atol=1e-9)


def test_what_pushes_is_scaled_to_another_size():
    """A slide is drawn against its limit; the other one is driven far out, by which the scene gets larger."""
    ground = asm.Body("ground", fixed=True)
    slides = [asm.Body(name) for name in ("one", "other")]
    joints = [asm.Prismatic(ground.frame((3.0 * k, 0, 0)), body.frame(), body.name) for k, body in enumerate(slides)]
    scene = asm.Assembly([ground, *slides])
    scene.constrain(*joints)
    scene.minimize(asm.PointDistance(slides[0].point(0, 0, 0), target=(0.0, 0.0, 1.0)))
    joints[0].limits = (-0.5, 0.5)
    drawn = scene.solve()
    joints[1].slide = 50.0
    packed = scene.packed()
    assert packed.scale > 5.0 * drawn._packed.scale
    handed = scene._begun_by(packed, drawn)[0][packed.multipliers_at : packed.residuals_at]
    again = scene.solve(drawn)
    ended = again._state[again._packed.multipliers_at : again._packed.residuals_at]
    assert again.success and np.abs(ended).max() > 1e-3
    np.testing.assert_allclose(handed, ended, rtol=1e-9, atol=1e-9)


def test_contacts_keep_their_pairs():
    ground, ball = asm.Body("ground", asm.shapes.torus(2.0, 0.6), fixed=True), asm.Body("ball", asm.shapes.sphere(0.3))
    ball.pose = asm.Pose((2.0, 0.2, -1.0))
    slide = asm.Cylindrical(ground.frame((2.0, 0.2, 0.0)), ball.frame(), "slide")
    scene = asm.Assembly([ground, ball])
    scene.constrain(slide, asm.Contact(ground, ball, "touch", edges=False))
    below = scene.solve()
    slide.angle = 0.4
    turned = scene.solve(below)
    assert turned.success and turned.q[1, 2] < -0.5
    np.testing.assert_allclose(turned.q[:, :3], below.q[:, :3], rtol=0, atol=1e-9)


def test_bodies_that_are_kept_apart_go_on_and_are_proved():
    table = asm.Body("table", asm.shapes.box(4, 4, 1), fixed=True)
    shaft = asm.Body("shaft", asm.shapes.solid_cylinder(1.0, 6.0), (0.0, 0.0, 3.5))
    spin = asm.Cylindrical(table.frame((0, 0, 0.5)), shaft.frame((0, 0, -3.0)), "spin", slide=0.0)
    scene = asm.Assembly([table, shaft])
    scene.constrain(spin, asm.Clearance())
    here = scene.solve()
    assert here.success and here.proved
    for spin.angle in (0.2, 3.0, None, 0.1):
        here = scene.solve(here)
        assert here.success and here.proved
    spin.slide = None
    here = scene.solve(here)
    assert here.success and here.proved


def test_a_solution_of_other_bodies_is_none():
    (one, hub), (other, _) = wheel(), wheel()
    hub.angle = 0.3
    with pytest.raises(asm.errors.InputError, match="q0 is a solution of another assembly"):
        other.solve(one.solve())
