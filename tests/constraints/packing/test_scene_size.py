"""The length by which a scene is scaled: the same scene in another unit, turned or in another order solves the same."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.packing.earlier import taken_over
from assembly.constraints.packing.scene_size import scene_size
from assembly.errors import InputError
from assembly.kinematics.pose import length, multiply, rotation_matrix

UNITS = [1e-145, 1e-100, 1e-13, 1e-9, 1e-6, 1e-3, 25.4, 1e3, 1e6, 1e9, 1e12, 1e100, 1e145]
ORIGIN = np.zeros(3)
ROOT = np.sqrt(0.5)


def size_of(scene):
    return scene_size(scene.bodies, scene.constraints, scene.objectives)


def bodies_at_one_place():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    return ground, arm, asm.Assembly([ground, arm])


def driven_slide(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(ground, arm, "joint", slide=2.0 * unit))
    return scene


def distance(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground, arm, 2.0 * unit, "joint"))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (3.0 * unit, unit, 0.0)))
    return scene


def offset(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Planar(ground, arm, "joint", offset=-unit))
    return scene


def height(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.PointOnPlane(arm, ground, "joint", offset=unit))
    return scene


def nut(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Screw(ground, arm, 2.0 * np.pi * unit, "joint", angle=1.0))
    return scene


def rack(unit, radius=-1.0, offset=0.0):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    slider = asm.Body("slider")
    scene = asm.Assembly([ground, arm, slider])
    hinge, rail = asm.Revolute(ground, arm, angle=0.7), asm.Prismatic(ground, slider)
    scene.constrain(hinge, rail, asm.RackPinion(hinge, rail, radius * unit, "joint", offset=offset * unit))
    return scene


def rack_with_offset(unit):
    return rack(unit, radius=0.1, offset=3.0)


def limits(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(ground, arm, "joint", limits=(-unit, unit)))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, unit, 3.0 * unit)))
    return scene


def least_distance(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground, arm, None, "joint", limits=(unit, None)))
    return scene


def target(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(ground, arm, "joint"))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, unit, 3.0 * unit)))
    return scene


def target_frame(unit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(ground, arm, "joint"))
    scene.minimize(asm.FrameDistance(arm, asm.Pose((0.0, unit, 3.0 * unit)), length=unit))
    return scene


def reference(unit):
    _, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(scene.bodies[0], arm, "joint"))
    scene.minimize(asm.Posture([[0, 0, 0, 1, 0, 0, 0], [0, 0, 2.0 * unit, 1, 0, 0, 0]]))
    return scene


def two_marks(unit):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(unit, 0.2 * unit, 0.0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Distance(ground.point(1e-8 * unit, 0, 0), arm.point(0, 1e-8 * unit, 0), 2.0 * unit, "joint"))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (3.0 * unit, unit, 0.0)))
    return scene


def apart(unit):
    """One mark a body: what they have of a length is in the world."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(2.0 * unit, 0.3 * unit, 0.0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Distance(ground.point(unit, 0, 0), arm.point(0, unit, 0), 0.5 * unit, "joint"))
    return scene


SCENES = [
    driven_slide,
    distance,
    offset,
    height,
    nut,
    rack,
    rack_with_offset,
    limits,
    least_distance,
    target,
    target_frame,
    reference,
    two_marks,
    apart,
]


# The length of a FrameDistance is one from 1e-100 to 1e100.
@pytest.mark.parametrize(
    ("made", "unit"),
    [(made, unit) for made in SCENES for unit in UNITS if made is not target_frame or 1e-100 <= unit <= 1e100],
)
def test_a_scene_in_another_unit_solves_the_same(made, unit):
    plain, scene = made(1.0).solve(), made(unit)
    solution = scene.solve()
    assert size_of(scene) == pytest.approx(unit * size_of(made(1.0)), rel=1e-14, abs=0)
    assert solution.status is plain.status is asm.Status.SOLVED
    assert solution.iterations == plain.iterations
    # Scaled numbers differ by the rounding of divisions alone, which some ten steps may magnify.
    np.testing.assert_allclose(solution.q[:, :3] / unit, plain.q[:, :3], rtol=0, atol=1e-12)
    np.testing.assert_allclose(solution.q[:, 3:], plain.q[:, 3:], rtol=0, atol=1e-12)
    # The largest violation, of lengths or of angles.
    assert solution.feasibility < 1e-11 * max(unit, 1.0)
    for name, forces in solution.multipliers.items():
        assert np.isfinite(forces).all(), name


@pytest.mark.parametrize(
    ("made", "size"),
    [
        (driven_slide, 2.0),
        (distance, 2.0),
        (offset, 1.0),
        (height, 1.0),
        (nut, 1.0),
        (rack, 1.0),
        (rack_with_offset, 3.0),
        (limits, 1.0),
        (least_distance, 1.0),
        (target, np.sqrt(10.0)),
        (target_frame, np.sqrt(10.0)),
        (reference, 2.0),
        (two_marks, 2.0),
    ],
)
def test_what_is_a_length(made, size):
    assert size_of(made(1.0)) == pytest.approx(size, rel=1e-15)


def test_what_says_nothing_of_lengths():
    ground, arm, scene = bodies_at_one_place()
    hinge = asm.Revolute(ground, arm, angle=0.4, limits=(-3.0, 3.0))
    scene.constrain(hinge)
    assert size_of(scene) == 0.0 and scene.packed().scale == 1.0
    assert scene.solve().success


def test_angles_are_no_lengths():
    ground, one, two = asm.Body("ground", fixed=True), asm.Body("one"), asm.Body("two")
    scene = asm.Assembly([ground, one, two])
    first, second = asm.Revolute(ground, one, angle=5.0), asm.Revolute(ground, two)
    scene.constrain(first, second, asm.Gear(first, second, -30.0, offset=7.0), asm.Angle(one, two, limits=(0.0, 3.0)))
    assert size_of(scene) == 0.0


@pytest.mark.parametrize("far", [1e9, 1e100, 1e149])
def test_no_limit_and_a_target_far_away_do_not_loosen_tolerances(far):
    ground, arm, scene = bodies_at_one_place()
    joint = asm.Prismatic(ground, arm, "joint", limits=(-far, far))
    scene.constrain(joint)
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, 3.0)))
    assert size_of(scene) == 3.0
    assert scene.solve().values["joint.slide"] == pytest.approx(3.0, abs=1e-9)
    joint.limits = (-2.0, None)
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, far)))
    assert size_of(scene) == 2.0
    scene.constrain(asm.Distance(ground, arm, 0.5))
    assert size_of(scene) == 0.5


@pytest.mark.parametrize("limit", [1e150, 1e300, np.inf])
def test_a_limit_beyond_every_coordinate_is_none(limit):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Prismatic(ground, arm, "joint", limits=(-limit, limit)))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, 3.0)))
    assert size_of(scene) == 3.0 and scene.packed().rows == 5
    assert scene.solve().success


def test_shapes_alone_say_how_large_a_scene_with_shapes_is():
    ground, ball = asm.Body("ground", fixed=True), asm.Body("ball", asm.shapes.sphere(1.0), position=(30.0, 0.0, 0.0))
    scene = asm.Assembly([ground, ball])
    scene.constrain(asm.Prismatic(ground, ball, slide=50.0, limits=(-100.0, 100.0)))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.0, 0.0, 1e6)))
    assert size_of(scene) == ball.size
    # Two frames on a body may be farther apart than its shape is large.
    scene.constrain(asm.Distance(ground.point(0, 0, 0), ball.point(1, 0, 0), 3.0, "one"))
    scene.constrain(asm.Distance(ground.point(5, 7, 9), ball.point(1, 1, 0), 3.0, "two"))
    assert size_of(scene) == np.linalg.norm([5.0, 7.0, 9.0])


def turned(scene_rows, quaternion, shift, order):
    """Three bodies with a mark each, at poses turned and shifted together, in an order."""
    rotation = rotation_matrix(quaternion)
    named = []
    for k, row in enumerate(scene_rows):
        position = rotation @ row[:3] + shift
        named.append(asm.Body(f"{k}", position=position, quaternion=multiply(quaternion, row[3:]), fixed=k == 0))
    scene = asm.Assembly([named[k] for k in order])
    a, b, c = named
    scene.constrain(asm.Distance(a.point(0.5, 1, 0), b.point(0, 0.2, 1), 1.0), asm.Distance(b.point(0, 0.2, 1), c, 1.5))
    return scene, named


@pytest.mark.parametrize("seed", range(12))
def test_a_scene_turned_shifted_and_in_another_order_has_the_same_size_and_least_move(seed):
    rng = np.random.default_rng(seed)
    rows = np.hstack([rng.normal(size=(3, 3)), rng.normal(size=(3, 4))])
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1, keepdims=True)
    quaternion = rng.normal(size=4)
    quaternion /= np.linalg.norm(quaternion)
    shift = rng.normal(size=3)
    plain, before = turned(rows, np.array([1.0, 0, 0, 0]), np.zeros(3), range(3))
    other, after = turned(rows, quaternion, shift, rng.permutation(3))
    assert size_of(other) == pytest.approx(size_of(plain), rel=1e-14)
    first, second = plain.solve(), other.solve()
    assert first.status is second.status is asm.Status.SOLVED
    assert second.objective == pytest.approx(first.objective, rel=1e-9)
    for body, again in zip(before, after, strict=True):
        place = rotation_matrix(quaternion) @ first.pose(body).position + shift
        # A least move is found to the square root of the tolerance of its objective at worst.
        np.testing.assert_allclose(second.pose(again).position, place, rtol=0, atol=1e-9)


def test_the_order_of_bodies_changes_no_bit_of_the_size():
    rng = np.random.default_rng(5)
    for _ in range(50):
        rows = np.hstack([rng.normal(size=(3, 3)), np.tile([1.0, 0, 0, 0], (3, 1))])
        sizes = {size_of(turned(rows, np.array([1.0, 0, 0, 0]), np.zeros(3), rng.permutation(3))[0]) for _ in range(4)}
        assert len(sizes) == 1


def test_bodies_at_one_place_up_to_rounding_are_at_one_place():
    ground, arm = asm.Body("ground", fixed=True, position=(1.0, 0, 0)), asm.Body("arm", position=(1.0 + 4e-16, 0, 0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Spherical(ground, arm))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (1.0, 4.0, 0.0)))
    assert size_of(scene) == pytest.approx(4.0)


@pytest.mark.parametrize("marks", [(0.0, 3e-16), (0.3, 0.1 + 0.2), (7.0, 7.0 + 1e-14)])
def test_marks_that_rounding_alone_holds_apart_are_no_length(marks):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(9.0, 9.0, 9.0))
    scene = asm.Assembly([ground, arm])
    low, high = marks
    axes = asm.Parallel(ground.frame(z=(1, 0, 0)), arm.frame((low, 0, 0), z=(1, 0, 0)), axes="opposed")
    scene.constrain(axes, asm.Spherical(ground.point(0, 0, 0), arm.point(high, 0, 0)))
    assert size_of(scene) > 1.0 and scene.solve().success


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_a_scene_gets_its_size_when_something_is_a_length(unit):
    ground, arm, scene = bodies_at_one_place()
    joint = asm.Prismatic(ground, arm, "joint", slide=0.0)
    scene.constrain(joint)
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, 0.0)))
    solution = first = scene.solve()
    assert scene.packed().scale == 1.0
    for k in range(1, 4):
        joint.slide = k * unit
        solution = scene.solve(solution)
        assert solution.success and scene.packed().scale == unit
        assert solution.values["joint.slide"] / unit == pytest.approx(k, abs=1e-12)
        # The force of the spring that the objective is.
        assert solution.multipliers["joint"][-1] / unit == pytest.approx(-2.0 * k, rel=1e-9)
    # The solution of before is still of this scene.
    assert scene.solve(first).success and scene.mobility(first).dof == 0
    assert first.values["joint.slide"] == 0.0


def test_forces_of_a_scene_that_got_its_size_go_on_from_where_they_were():
    ground, arm, scene = bodies_at_one_place()
    joint = asm.Prismatic(ground, arm, "joint", slide=0.0)
    goal = asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, 0.0))
    scene.constrain(joint)
    scene.minimize(goal)
    packed = scene.packed()
    state = np.zeros(packed.memory_at)
    state[packed.multipliers_at : packed.residuals_at] = np.arange(1.0, 7.0)
    forces = np.arange(1.0, 7.0) * packed.unit / np.where(packed.lengths, packed.scale, 1.0)
    joint.slide = 1e-3
    sized = scene.packed()
    assert sized.before is packed and sized.scale == 1e-3
    taken = taken_over(packed, sized, state)[sized.multipliers_at : sized.residuals_at]
    np.testing.assert_allclose(taken * sized.unit / np.where(sized.lengths, sized.scale, 1.0), forces, rtol=1e-15)


@pytest.mark.parametrize("unit", [1e-151, 1e-163, 1e-200, 1e-300, 1e-320])
@pytest.mark.parametrize("made", SCENES)
def test_too_small_a_scene_is_refused(made, unit):
    with pytest.raises(InputError, match=r"the scene's size is .*; expected one from 1e-150 to|length is "):
        made(0.1 * unit).solve()


def test_noise_is_no_length_where_there_is_another():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm", position=(1.0, 0.0, 0.0))
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Spherical(ground, arm, "one"), asm.Distance(ground.point(1e-170, 0, 0), arm, limits=(0, 9)))
    assert size_of(scene) == 1.0 and scene.solve().success


HUGE = 1.1e150


@pytest.mark.parametrize(
    ("made", "text"),
    [
        (lambda a, b, h: asm.Body("c", position=(0, h, 0)), r"position\[1\] is 1.1e\+150; expected coordinates from"),
        (lambda a, b, h: setattr(a, "pose", asm.Pose((-h, 0, 0))), r"pose.position\[0\] is -1.1e\+150; expected coord"),
        (lambda a, b, h: a.point(0, 0, h), r"point\[2\] is 1.1e\+150; expected coordinates from -1e\+150 to 1e\+150"),
        (lambda a, b, h: a.frame((0, 0, h)), r"at\[2\] is 1.1e\+150; expected coordinates"),
        (lambda a, b, h: asm.PointDistance(b.point(0, 0, 0), (h, 0, 0)), r"target\[0\] is 1.1e\+150; expected coord"),
        (lambda a, b, h: asm.FrameDistance(b, asm.Pose((h, 0, 0))), r"target.position\[0\] is 1.1e\+150; expected"),
        (lambda a, b, h: asm.Posture([[0, h, 0, 1, 0, 0, 0]]), r"reference\[0, 1\] is 1.1e\+150; expected coord"),
        (lambda a, b, h: asm.Prismatic(a, b, slide=h), r"slide is 1.1e\+150; expected a length between -1e\+150 and"),
        (lambda a, b, h: asm.Prismatic(a, b, limits=(h, None)), r"limits is \(1.1e\+150, inf\); expected limits that"),
        (lambda a, b, h: setattr(asm.Prismatic(a, b, slide=1.0), "slide", h), r"slide is 1.1e\+150; expected a length"),
        (lambda a, b, h: asm.Distance(a, b, h), r"value is 1.1e\+150; expected a distance .*above 1e\+150"),
        (lambda a, b, h: asm.Planar(a, b, offset=-h), r"offset is -1.1e\+150; expected a number from -1e\+150 to"),
        (lambda a, b, h: asm.Screw(a, b, h), r"pitch is 1.1e\+150; expected a number from -1e\+150 to 1e\+150"),
        (
            lambda a, b, h: asm.Assembly([a, b]).solve([[0, 0, 0, 1, 0, 0, 0], [h, 0, 0, 1, 0, 0, 0]]),
            r"q0\[1, 0\] is",
        ),
    ],
)
def test_lengths_whose_squares_overflow_are_refused_where_they_come_in(made, text):
    ground, arm, _ = bodies_at_one_place()
    with pytest.raises(InputError, match=text):
        made(ground, arm, HUGE)


def far_target(near, far):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Spherical(ground.point(0, 0, 0), arm.point(near, 0, 0)))
    goal = asm.PointDistance(arm.point(0, near, 0), (0.0, 0.0, 0.0))
    scene.minimize(goal)
    scene.packed()
    goal.target = (far, 0.0, 0.0)
    return scene.solve()


def far_slide(near, far):
    ground, arm, scene = bodies_at_one_place()
    joint = asm.Prismatic(ground.frame((near, 0, 0)), arm.frame((0, near, 0)), slide=near)
    scene.constrain(joint)
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0.0, 0.0, 0.0)))
    scene.packed()
    joint.slide = far
    return scene.solve()


def far_start(near, far):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground.point(near, 0, 0), arm.point(0, near, 0), near))
    return scene.solve([[0, 0, 0, 1, 0, 0, 0], [far, far, 0, 1, 0, 0, 0]])


def far_reference(near, far):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground.point(near, 0, 0), arm.point(0, near, 0), near))
    scene.minimize(asm.Posture([[0, 0, 0, 1, 0, 0, 0], [far, far, 0, 1, 0, 0, 0]]))
    return scene.solve()


def long_lever(near, far):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground.point(near, 0, 0), arm.point(0, near, 0), near))
    scene.minimize(asm.FrameDistance(arm, asm.Pose(), length=min(far, 1e99)))
    return scene.solve()


@pytest.mark.parametrize("made", [far_target, far_slide, far_start, far_reference, long_lever])
@pytest.mark.parametrize("near", [1.0, 1e-10, 1e-50, 1e-100])
@pytest.mark.parametrize("far", [1e20, 1e100, 1e149])
def test_what_is_very_far_for_the_size_is_refused_or_leaves_no_nan(made, near, far):
    try:
        solution = made(near, far)
    except InputError as error:
        assert "scene's size of" in str(error) and "times it" in str(error)
        return
    numbers = [solution.q.ravel(), [solution.objective, solution.feasibility], solution.history[:, :3].ravel()]
    assert np.isfinite(np.concatenate([*numbers, *solution.multipliers.values()])).all()


@pytest.mark.parametrize("weight", [1e-300, 1e300])
def test_weights_that_overflow_with_the_size_are_refused(weight):
    ground, arm, scene = bodies_at_one_place()
    scene.constrain(asm.Distance(ground, arm, 1e-60 if weight < 1.0 else 1e60))
    scene.minimize(asm.PointDistance(arm.point(0, 0, 0), (0, 0, 0), weight))
    with pytest.raises(InputError, match="the objective counts in units of .*, by its weights and the scene's size"):
        scene.solve()


def test_a_norm_is_that_of_numpy_bit_for_bit_and_goes_on_where_squares_have_no_doubles():
    rng = np.random.default_rng(3)
    for v in rng.normal(size=(500, 3)) * 10.0 ** rng.uniform(-100, 100, (500, 1)):
        assert length(v) == np.linalg.norm(v)
    assert length(ORIGIN) == 0.0
    for factor in (1e-323, 1e-308, 1e-200, 1e-163, 1e154, 1e200, 3e307):
        assert length(factor * np.array([3.0, 0.0, 4.0])) == pytest.approx(5.0 * factor, rel=1e-15, abs=5e-324)
    assert length(np.array([1.7e308, 0.0, 0.0])) == 1.7e308
    assert length(np.array([ROOT, ROOT, 0.0])) == pytest.approx(1.0, rel=1e-15)


@pytest.mark.parametrize("first", [6e-17, 1e-9, 1e9])
def test_a_first_value_is_not_the_size_for_good(first):
    # The sine of a half turn, the begin of a homotopy, a value that was meant as "far".
    ground, arm, scene = bodies_at_one_place()
    joint = asm.Prismatic(ground, arm, "joint", slide=first)
    scene.constrain(joint)
    solution = scene.solve()
    assert solution.success and solution.values["joint.slide"] == pytest.approx(first, rel=1e-12)
    for slide in (0.5, 0.7, 0.3):
        joint.slide = slide
        solution = scene.solve(solution)
        assert solution.success and scene.packed().scale == 0.5
        assert solution.values["joint.slide"] == pytest.approx(slide, abs=1e-12)
