"""Dexterities that leave rows out, count chosen axes, and are held by one-sided rows; and by the reference solver."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.solve.oracle import reference
from tests.laws.tip_scenes import MECHANISMS


def planar_arm(count=2):
    """Links 2, 1.5, 1 of hinges about z, and its tip."""
    lengths = (2.0, 1.5, 1.0)[:count]
    bodies, joints = [asm.Body("ground", fixed=True)], []
    for k in range(count):
        bodies.append(asm.Body(f"link {k}", position=(sum(lengths[:k]), 0.1 * k, 0)))
        before = bodies[-2].frame((lengths[k - 1] if k else 0.0, 0, 0))
        joints.append(asm.Revolute(before, bodies[-1], f"hinge {k}"))
    scene = asm.Assembly(bodies)
    scene.constrain(*joints)
    return scene, bodies[-1].point(lengths[-1], 0, 0), joints


def angles_of(solution, joints):
    return np.array([solution.values[f"{joint.name}.angle"] for joint in joints])


def test_rows_that_express_the_task_are_left_out():
    """An arm of three links whose tip is held: of all such poses the one of largest dexterity, by brute force."""
    scene, tip, joints = planar_arm(3)
    ground = scene.bodies[0]
    held = asm.PointOnLine(tip, ground.frame((2.2, 1.4, 0)), "held")
    scene.constrain(held)
    term = asm.Dexterity(tip, joints, axes="xy", ignoring=[held])
    scene.maximize(term)
    for joint, angle in zip(joints, (0.2, 0.5, 0.4), strict=True):
        joint.angle = angle
    scene.remove(held)
    start = scene.solve()
    for joint in joints:
        joint.angle = None
    scene.constrain(held)
    best = scene.solve(start.q)
    assert best.status is asm.Status.SOLVED
    # By hand: the tip is held, the last link's direction is free.
    direction = np.linspace(-np.pi, np.pi, 20001)
    tip_at = np.array([2.2, 1.4])
    wrist = tip_at - np.stack([np.cos(direction), np.sin(direction)], axis=1)
    cosine = ((wrist * wrist).sum(axis=1) - 2.0**2 - 1.5**2) / 6.0
    within = np.abs(cosine) < 1.0
    wrist, bend = np.repeat(wrist[within], 2, axis=0), np.outer(np.arccos(cosine[within]), (1.0, -1.0)).ravel()
    first = np.arctan2(wrist[:, 1], wrist[:, 0]) - np.arctan2(1.5 * np.sin(bend), 2.0 + 1.5 * np.cos(bend))
    elbow = 2.0 * np.stack([np.cos(first), np.sin(first)], axis=1)
    arms = np.stack([np.broadcast_to(tip_at, elbow.shape), tip_at - elbow, tip_at - wrist], axis=2)
    jacobians = np.stack([-arms[:, 1], arms[:, 0]], axis=1)
    largest = np.sqrt(np.linalg.det(jacobians @ jacobians.transpose(0, 2, 1)).max())
    # The grid's step squared times the curvature; of several minima the solve finds one.
    value = asm.dexterity_value(scene, term, best)
    assert np.isclose(value, largest, rtol=0, atol=1e-6)
    with pytest.raises(InputError, match="expected inputs"):
        asm.dexterity_value(scene, asm.Dexterity(tip, joints, axes="xy"), best)


def test_axes_are_rows_of_the_whole_jacobian():
    mechanism = MECHANISMS["arm of seven"]()
    scene, tip, inputs = mechanism.scene, mechanism.tip, mechanism.inputs
    q = scene.solve().q
    whole = asm.tip_jacobian(scene, tip, inputs, q)
    for axes, rows in ((("xy", "z"), [0, 1, 5]), (("", "xz"), [3, 5]), (("xyz", "xyz"), range(6))):
        np.testing.assert_allclose(
            asm.tip_jacobian(scene, tip, inputs, q, axes=axes), whole[list(rows)], rtol=0, atol=1e-14
        )
    only = asm.tip_jacobian(scene, tip, inputs, q, task="rotation", axes="y")
    np.testing.assert_allclose(only, whole[[4]], rtol=0, atol=1e-14)


def test_a_planar_arm_has_a_measure_along_its_axes_alone():
    scene, tip, joints = planar_arm(3)
    q = scene.solve().q
    flat = asm.Dexterity(tip, joints, "inverse_condition", axes="xy")
    jacobian = asm.tip_jacobian(scene, tip, joints, q)
    sizes = np.linalg.svd(jacobian[:2], compute_uv=False)
    assert np.isclose(asm.dexterity_value(scene, flat, q), sizes[1] / sizes[0], rtol=1e-10)
    # In space it goes nowhere along z.
    assert asm.dexterity_value(scene, asm.Dexterity(tip, joints, "inverse_condition"), q) < 1e-8


def test_one_sided_rows_hold_where_they_are_asked_to():
    """A slider on a slanted floor: with its contact, or its limit, an input of two is one too many."""
    ground, cart, arm = asm.Body("ground", fixed=True), asm.Body("cart"), asm.Body("arm", position=(0.2, 1, 0))
    slide = asm.Prismatic(ground.frame(z=(1, 0, 0)), cart.frame(z=(1, 0, 0)), "slide")
    hinge = asm.Revolute(cart, arm, "hinge")
    rest = asm.Distance(arm.point(2, 0, 0), ground.point(3, -1, 0), name="rest", limits=(1.0, None))
    scene = asm.Assembly([ground, cart, arm])
    scene.constrain(slide, hinge, rest)
    tip = arm.point(2, 0, 0)
    scene.minimize(asm.PointDistance(tip, (3.0, -1.0, 0.0)))
    leaning = scene.solve()
    assert leaning.status is asm.Status.SOLVED
    free = asm.tip_jacobian(scene, tip, [slide, hinge], leaning)
    assert free.shape == (3, 2)
    for options in ({"holding": [rest]}, {"active": True}):
        held = asm.tip_jacobian(scene, tip, [hinge], leaning, **options)
        # The tip goes along its circle around the far end.
        away = leaning.pose(arm).apply([2.0, 0.0, 0.0]) - [3.0, -1.0, 0.0]
        assert abs(away @ held[:, 0]) < 1e-7 and np.linalg.norm(held) > 0.1
        with pytest.raises(InputError, match="constraints tie"):
            asm.tip_jacobian(scene, tip, [slide, hinge], leaning, **options)
    # Not touching, it is held all the same where it is said, and not where it only might.
    apart = [body.q for body in scene.bodies]
    assert np.isfinite(asm.tip_jacobian(scene, tip, [hinge], apart, holding=[rest])).all()
    assert asm.tip_jacobian(scene, tip, [slide, hinge], apart, active=True).shape == (3, 2)


def test_a_held_dexterity_is_maximized_along_its_stop():
    """The gradient through a one-sided row that holds, against differences along the stop."""
    scene, tip, joints = planar_arm(3)
    joints[1].limits = (None, 0.7)
    joints[0].angle = 0.3
    term = asm.Dexterity(tip, [joints[0], joints[2]], "manipulability", axes="xy", holding=[joints[1]])
    scene.maximize(term)
    joints[1].angle = None
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    values = angles_of(solution, joints)
    best = asm.dexterity_value(scene, term, solution)
    for change in (-0.02, 0.02):
        joints[2].angle = values[2] + change
        assert asm.dexterity_value(scene, term, scene.solve(solution.q)) <= best + 1e-12
        joints[2].angle = None


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"axes": "yx"}, "axes is 'yx' of task 'position'; expected letters of 'xyz' in this order"),
        ({"axes": ""}, "axes is ''; expected one axis at least"),
        ({"axes": ("xy", "z")}, r"axes is \('xy', 'z'\) of task 'position'"),
        ({"axes": "xy", "task": "pose"}, "axes is 'xy' of task 'pose'; expected two words, linear and angular axes"),
        ({"ignoring": "hinge 0"}, "ignoring is 'hinge 0'; expected constraints, a list of them"),
        ({"ignoring": [3]}, "ignoring has 3; expected a constraint"),
        ({"axes": "xy", "measure": "force_transmission", "direction": (1, 0, 0)}, "direction"),
    ],
)
def test_options_that_make_no_sense_are_refused(change, expected):
    _, tip, joints = planar_arm()
    with pytest.raises((InputError, TypeError), match=expected):
        asm.Dexterity(tip, joints, **change)


def test_constraints_that_are_named_are_those_of_the_scene():
    scene, tip, joints = planar_arm()
    other = planar_arm()[2][0]
    for name in ("ignoring", "holding"):
        with pytest.raises(InputError, match=f"{name} of objective .* names 'hinge 0', which is not in the assembly"):
            scene.maximize(asm.Dexterity(tip, joints, **{name: [other]}))
        with pytest.raises(InputError, match=f"{name} names 'hinge 0'; expected constraints of this assembly"):
            asm.tip_jacobian(scene, tip, joints, **{name: [other]})
    with pytest.raises(InputError, match="holding has 'hinge 0', and so has ignoring"):
        asm.Dexterity(tip, joints, ignoring=[joints[0]], holding=[joints[0]])


@pytest.mark.parametrize(
    ("name", "measure"),
    [
        ("arm of three", "manipulability"),
        ("geared arm", "force_transmission"),
        ("arm of four, one slides", "isotropy"),
        ("hoop", "manipulability"),
    ],
)
def test_the_reference_finds_the_same_dexterity(name, measure):
    mechanism = MECHANISMS[name]()
    scene = mechanism.with_term(measure, "position", (1, 2, 0.5) if measure == "force_transmission" else None)
    solution = scene.solve()
    other = reference.solve(scene, solution.q)
    assert solution.status is other.status is asm.Status.SOLVED
    # Both stop where slopes are 1e-9 or so: the difference is the square of that, and rounding.
    np.testing.assert_allclose(other.objective, solution.objective, rtol=1e-10)


@pytest.mark.parametrize("measure", ["inverse_condition", "smallest_singular_value"])
def test_the_reference_has_single_singular_values(measure):
    scene, tip, joints = planar_arm(3)
    ground = scene.bodies[0]
    held = asm.PointOnLine(tip, ground.frame((2.2, 1.4, 0)), "held")
    scene.constrain(held)
    scene.maximize(asm.Dexterity(tip, joints, measure, axes="xy", ignoring=[held]))
    solution = scene.solve()
    other = reference.solve(scene, solution.q)
    assert solution.status is other.status is asm.Status.SOLVED
    np.testing.assert_allclose(other.objective, solution.objective, rtol=1e-10)


def test_an_arm_pulled_straight_is_judged_without_its_inputs_in_rows():
    """The force that it holds has no bound: once judging that asked for angles that no row has."""
    mechanism = MECHANISMS["arm of three"]()
    scene = mechanism.with_term("force_transmission", "position", (1, 2, 0.5))
    assert not scene.solve().success
