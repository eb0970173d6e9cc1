"""Scenes that are edited: constraints removed and disabled, bodies fixed, frames placed anew; bad numbers refused."""

from __future__ import annotations

import copy

import numpy as np
import pytest

import assembly as asm
from tests.derivatives.sensitivity_scenes import ball_in_v, clips, kept_apart, pushed, rocker, slider_crank


def test_a_disabled_constraint_asks_for_nothing_and_one_enabled_again_as_before():
    case = slider_crank()
    scene, wrist = case.scene, case.scene.constraints[2]
    before = scene.solve()
    wrist.enabled = False
    without = scene.solve(before.q)
    assert without.mobility.dof == 2 and "wrist" not in without.violations
    assert wrist in scene.constraints
    with pytest.raises(asm.errors.InputError, match="solution of another assembly, or of this one before a change"):
        scene.solve(before)
    wrist.enabled = True
    assert np.array_equal(scene.solve().q, before.q)
    with pytest.raises(asm.errors.InputError, match="enabled is 1; expected True or False"):
        wrist.enabled = 1


def test_a_trim_of_a_disabled_contact_is_not_asked_for():
    plate, ball = asm.Body("plate", asm.shapes.plane(8, 8), fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))
    ball.pose = asm.Pose((0, 0, 1.5))
    touch = asm.Contact(plate, ball, "touch", edges=False)
    square = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]
    loop = [asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(square[:-1], square[1:], strict=True)]
    trim = asm.TrimContact(touch, loop, keep="inside", side="a")
    scene = asm.Assembly([plate, ball])
    scene.constrain(touch, trim)
    with pytest.raises(asm.errors.InputError, match="to be removed first"):
        scene.remove(touch)
    touch.enabled = False
    solution = scene.solve()
    assert solution.success and solution.violations == {} and np.array_equal(solution.q, scene.q)
    assert scene.remove(trim.name) is trim and scene.remove(touch) is touch and scene.constraints == ()


def test_removed_is_as_never_there():
    case, other = slider_crank(), slider_crank()
    guide = case.scene.constraints[3]
    case.scene.solve()
    assert case.scene.remove("guide") is guide
    other.scene.constraints[3].enabled = False
    assert np.array_equal(case.scene.solve().q, other.scene.solve().q)
    case.scene.constrain(guide)
    assert np.array_equal(case.scene.solve().q, slider_crank().scene.solve().q)
    with pytest.raises(asm.errors.InputError, match="constraint is 'none'; expected one of the assembly: 'hinge'"):
        case.scene.remove("none")


def test_a_term_of_the_objective_that_is_removed_draws_no_more():
    ball = asm.Body("ball")
    scene = asm.Assembly([ball])
    goal, other = (asm.PointDistance(ball.point(0, 0, 0), to) for to in ((1.0, 0.0, 0.0), (0.0, 2.0, 0.0)))
    scene.minimize(goal, other)
    assert np.allclose(scene.solve().pose(ball).position, (0.5, 1.0, 0.0), rtol=0, atol=1e-12)
    assert scene.remove(goal) is goal and scene.objectives == ((1.0, other),)
    assert np.allclose(scene.solve().pose(ball).position, (0.0, 2.0, 0.0), rtol=0, atol=1e-12)
    with pytest.raises(asm.errors.InputError, match="constraint is PointDistance.*expected one of the assembly: none"):
        scene.remove(goal)


def test_a_body_that_becomes_fixed_stays_and_its_joints_to_ground_ask_for_nothing():
    case = slider_crank()
    scene, crank = case.scene, case.scene.bodies[1]
    solution = scene.solve()
    crank.pose = solution.pose(crank)
    crank.fixed = True
    held = scene.solve(solution.q)
    assert held.success and "hinge" not in held.violations
    assert np.abs(held.q - solution.q).max() < 1e-12
    crank.fixed = False
    assert np.array_equal(scene.solve().q, scene.solve().q) and "hinge" in scene.solve().violations


def test_a_frame_placed_anew_is_as_if_it_had_been_there():
    case, other = slider_crank(), slider_crank(length=5.5)
    wrist = case.scene.constraints[2]
    case.scene.solve()
    wrist.frame_a.place(at=(5.5, 0, 0))
    assert np.array_equal(case.scene.solve().q, other.scene.solve().q)
    pin = case.scene.constraints[1]
    pin.frame_a.place(at=(2, 0, 0), z=(0, 0, 1), x=(0, 1, 0))
    # The axis is the same: only where angles are counted from.
    solution = case.scene.solve()
    assert np.abs(solution.q - other.scene.solve().q).max() < 1e-11
    with pytest.raises(asm.errors.InputError, match="x is given without z"):
        pin.frame_a.place(x=(1, 0, 0))


def test_an_opposed_frame_follows_the_frame_it_is_turned_from():
    case = rocker()
    last = case.scene.constraints[3]
    opposed = last._frames.frame_b
    last.frame_b.place(at=(0.1, 0.2, 0.3), z=(0, 1, 0))
    assert np.array_equal(opposed.origin, (0.1, 0.2, 0.3))
    assert np.allclose(opposed.axes[:, 2], (0, -1, 0), rtol=0, atol=1e-15)
    # A copy of the joint has the frame of the original.
    assert copy.copy(last)._frames.frame_b.base is last.frame_b


def test_a_solution_keeps_its_numbers_when_others_are_set():
    case = slider_crank()
    first = case.scene.solve()
    expected = first.violations, first.multipliers["pin"].copy(), first.values
    case.wrt[2].value = 7.0
    second = case.scene.solve(first)
    assert second.success and second._packed.scale != first._packed.scale
    assert first.violations == expected[0] and np.array_equal(first.multipliers["pin"], expected[1])
    case.wrt[2].value = 5.0
    # The same numbers again: the first solution is one of the scene as it is.
    assert asm.sensitivity(case.scene, first, case.of, case.wrt).rank == 18


@pytest.mark.parametrize(
    ("case", "k", "value", "message"),
    [
        (slider_crank, 1, float("inf"), "r is inf; expected a finite real number"),
        (slider_crank, 1, "2", "r is '2'; expected a finite real number"),
        (pushed, 0, -2.0, r"limits is \(-1, -2\); expected lower <= upper"),
        (kept_apart, 0, -0.1, "minimum is -0.1; expected a length of zero or more"),
        (ball_in_v, 0, -1.0, "radius is -1; expected a"),
        (clips, 1, 9.0, "expected"),
    ],
)
def test_a_number_that_the_scene_cannot_have_raises_and_changes_nothing(case, k, value, message):
    case = case()
    before, parameter = case.scene.solve(), case.wrt[k]
    kept = parameter.value
    with pytest.raises(asm.errors.InputError, match=message):
        parameter.value = value
    assert parameter.value == kept
    assert np.array_equal(case.scene.solve().q, before.q)


def test_what_is_no_number_of_a_thing_raises():
    case = slider_crank()
    hinge, pin, _, guide = case.scene.constraints
    for arguments, message in (
        ((pin, "angle"), r"pin.angle is None; expected a driven value"),
        ((guide, "limits", 0), r"guide.slide lower limit|lower.*expected a limit on this side"),
        ((hinge, "pitch"), "field is 'pitch'; expected one of 'hinge': 'angle'"),
        ((pin.frame_a, "origin", "w"), "index is 'w'; expected 'x', 'y' or 'z'"),
        ((pin.frame_a, "axes", 0), "field is 'axes'; expected 'origin' or 'turn'"),
        ((case.scene.bodies[1], "radius"), "body 'crank' has faces that are no function of numbers"),
    ):
        with pytest.raises(asm.errors.InputError, match=message):
            asm.Parameter(*arguments)
    with pytest.raises(TypeError, match="thing is 3; expected a joint"):
        asm.Parameter(3, "x")


def test_what_cannot_be_derived_raises():
    case = slider_crank()
    scene, hinge = case.scene, case.scene.constraints[0]
    solution = scene.solve()
    with pytest.raises(asm.errors.InputError, match="of is empty"):
        asm.sensitivity(scene, solution, [], case.wrt)
    stray = asm.Parameter(scene.bodies[1].frame(at=(1, 0, 0)), "origin", "x", name="stray")
    with pytest.raises(asm.errors.InputError, match="parameter 'stray' enters no row and no term"):
        asm.sensitivity(scene, solution, case.of, stray)
    with pytest.raises(asm.errors.InputError, match="is a force, in a scene without an objective"):
        asm.sensitivity(scene, solution, asm.Measure(hinge, "fx", on=scene.bodies[1]), case.wrt)
    case.wrt[1].value = 2.2
    with pytest.raises(asm.errors.InputError, match="with other numbers; expected one solved with the present numbers"):
        asm.sensitivity(scene, solution, case.of, case.wrt)
    failed = scene.solve(max_iterations=0)
    assert not failed.success
    with pytest.raises(asm.errors.InputError, match="solution is ITERATION_LIMIT; expected one that succeeded"):
        asm.sensitivity(scene, failed, case.of, case.wrt)


def test_files_refuse_what_is_disabled(tmp_path):
    scene = slider_crank().scene
    scene.constraints[2].enabled = False
    with pytest.raises(asm.errors.InputError, match="constraint 'wrist' is disabled, which files do not hold"):
        scene.save(tmp_path / "scene.json")


def test_a_freedom_let_go_and_a_frame_placed_at_once():
    case, other = slider_crank(), slider_crank(radius=2.2)
    for scene in (case.scene, other.scene):
        scene.solve()
        scene.constraints[0].angle = None
    case.wrt[1].value = 2.2
    assert np.array_equal(case.scene.solve().q, other.scene.solve().q)


def test_what_is_set_in_another_scene_changes_nothing_of_this_one():
    case, other = slider_crank(), slider_crank()
    scene, wrist = case.scene, case.scene.constraints[2]
    scene.solve()
    scene.remove(wrist)
    scene.solve()
    scene.constrain(wrist)
    solution = scene.solve()
    other.wrt[1].value = 2.5
    other.scene.constraints[2].enabled = False
    # Packed as it was: the solution is one of the scene as it is.
    assert scene.solve(solution).iterations == 0 and scene.packed() is solution._packed


def _chain():
    """A ground and three bars with hinges between them, the last one's end drawn to a place."""
    bodies = [asm.Body("ground", fixed=True), *(asm.Body(f"bar {k}", position=(k, 0.2, 0)) for k in range(3))]
    scene = asm.Assembly(bodies)
    pairs = zip(bodies, bodies[1:], strict=False)
    joints = [asm.Revolute(a.frame(at=(1, 0, 0)), b, f"joint {k}") for k, (a, b) in enumerate(pairs)]
    scene.constrain(*joints)
    return scene, bodies, joints


def test_what_is_between_fixed_bodies_is_no_obstacle_to_trackers_ranges_and_starts():
    scene, bodies, joints = _chain()
    joints[2].freedom("angle").limits = (-0.5, 0.4)
    assert scene.solve().success
    bodies[1].fixed = True
    tracker = scene.tracker(bodies[3].point(1, 0, 0))
    assert tracker.step(tracker.q[3, :3]).status is not asm.TrackStatus.CHANGED
    solution = scene.solve()
    found = asm.play(scene, solution, asm.Measure(joints[2]))
    assert (found.least.value, found.most.value) == pytest.approx((-0.5, 0.4), abs=1e-9)
    bodies[1].fixed = False
    assert tracker.step(tracker.q[3, :3]).status is asm.TrackStatus.CHANGED
    # A clearance has bodies put together first, in a scene of their own.
    one, two = asm.Body("one", asm.shapes.box(1, 1, 1)), asm.Body("two", asm.shapes.box(1, 1, 1), (0.2, 3, 0))
    base = asm.Body("base", fixed=True)
    apart = asm.Assembly([base, one, two])
    apart.constrain(asm.Fixed(base, one, "held"), asm.Clearance([one, two]))
    apart.constrain(asm.Prismatic(base.frame(at=(0, 1.5, 0)), two, "guide", slide=0.0))
    one.fixed = True
    assert apart.solve().success


def test_a_goal_without_bounds_beside_what_is_disabled():
    """What an objective may fall along without end is looked for with what is asked alone."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    block = asm.Body("block", asm.shapes.box(1, 1, 1))
    scene = asm.Assembly([ground, arm, block])
    hinge = asm.Revolute(ground, arm, "hinge", angle=0.3)
    scene.constrain(hinge, asm.Prismatic(ground, block, "rail"))
    scene.minimize(asm.Weight([block]))
    hinge.enabled = False
    assert scene.solve().status is asm.Status.UNBOUNDED


def test_a_least_gap_of_a_contact_is_held_saved_and_no_clearance_beside_it(tmp_path):
    plate = asm.Body("plate", asm.shapes.plane(20.0, 20.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), (0.3, 0.2, 3.0))
    scene = asm.Assembly([plate, ball])
    film = asm.Contact(plate, ball, "film", minimum=0.25)
    scene.constrain(film)
    assert scene.solve().pose(ball).position[2] == pytest.approx(1.25, abs=1e-11)
    scene.save(tmp_path / "film.json")
    again = asm.load(tmp_path / "film.json")
    assert again.constraints[0].minimum == 0.25
    for value in (-0.1, float("nan")):
        with pytest.raises(asm.errors.InputError, match="minimum is"):
            film.minimum = value
    assert film.minimum == 0.25
    scene.constrain(asm.Clearance([plate, ball], minimum=0.1, name="apart"))
    with pytest.raises(
        asm.errors.InputError, match="contact 'film' has the minimum 0.25 and clearance 'apart' is of its bodies"
    ):
        scene.solve()
    film.minimum = 0.0
    assert scene.solve().success


def test_measures_of_what_is_not_there_raise():
    case = slider_crank()
    scene = case.scene
    ground, _, rod, piston = scene.bodies
    hinge = scene.constraints[0]
    with pytest.raises(TypeError, match="on is 'crank'; expected a Body"):
        asm.Measure(hinge, "fx", on="crank")
    with pytest.raises(asm.errors.InputError, match=r"on is Body\('rod', 0 faces\); expected one of Body\('ground'"):
        asm.Measure(hinge, "fx", on=rod)
    with pytest.raises(asm.errors.InputError, match="component is 'x' of .*; expected none"):
        asm.Measure((rod, piston), "x")
    with pytest.raises(asm.errors.InputError, match="component is 'x' of 'objective'; expected none"):
        asm.Measure("objective", "x")
    touch = asm.Contact(asm.Body("a", asm.shapes.sphere(1.0)), asm.Body("b", asm.shapes.sphere(1.0)))
    with pytest.raises(asm.errors.InputError, match="component is 'u' of .*; expected none"):
        asm.Measure(touch, "u")
    with pytest.raises(TypeError, match="solution is 3; expected a Solution"):
        asm.Measure(rod, "x").value(3)
    balls = [asm.Body(f"ball {k}", asm.shapes.sphere(1.0), position=(3.0 * k, 0, 0)) for k in range(2)]
    clear, apart = asm.Assembly(balls), asm.Clearance()
    clear.constrain(apart)
    with pytest.raises(asm.errors.InputError, match="what is exerted on Body.*; expected one of 'ball 0', 'ball 1'"):
        asm.Measure(apart, "fx", on=rod).value(clear.solve())


def test_frames_are_said_in_one_line():
    frame = asm.Body("arm").frame((1, 0, 2.5), z=(0, 0, -1), x=(0, 1, 0))
    assert repr(frame) == "arm.frame((1, 0, 2.5), z=(0, 0, -1), x=(0, 1, 0))"
