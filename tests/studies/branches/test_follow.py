"""Branches: turning points of closed form, loops that close, crossings, limits, contacts, objectives."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from assembly.studies.branches.result import KINDS
from benchmarks.planar_four_bars import FourBar

CRANK_ROCKER, DOUBLE_ROCKER, DRAG_LINK = (1.0, 3.0, 2.5, 3.2), (2.0, 2.2, 2.1, 4.5), (3.0, 1.2, 3.1, 1.0)


def followed(bar, joint, low, high, **options):
    """The branch along a joint's angle, from where the four-bar stands."""
    joint.angle = bar.swing if joint is bar.rocker else 0.7
    of = options.pop("of", [asm.Measure(bar.crank), asm.Measure(bar.rocker)])
    start = bar.scene.solve(bar.q)
    return asm.follow(bar.scene, asm.Parameter(joint, "angle"), low, high, of=of, start=start, **options)


def gaps(bar, branch):
    """How far hinges come apart at the points of a branch, at most."""
    worst = 0.0
    for q in branch.poses:
        for joint in (bar.crank, bar.pin, bar.wrist, bar.rocker):
            places = []
            for frame in (joint.frame_a, joint.frame_b):
                row = q[bar.scene.bodies.index(frame.body)]
                places.append(row[:3] + rotation_matrix(row[3:]) @ frame.origin)
            worst = max(worst, float(np.abs(places[0] - places[1]).max()))
    return worst


def test_a_crank_rocker_is_followed_around_its_loop():
    bar = FourBar(*CRANK_ROCKER)
    branch = followed(bar, bar.rocker, 0.0, pi)
    # Found to rounding: the parameter is level there.
    turns = sorted(event.value for event in branch.events_of("turning point"))
    np.testing.assert_allclose(turns, bar.dead_centers(), rtol=0, atol=1e-13)
    # The pose is found to the root of nothing: the tangent is exact.
    for event in branch.events_of("turning point"):
        pin = bar.scene.bodies.index(bar.pin.frame_b.body)
        bent = np.array(rotation_matrix(event.q[pin, 3:]) @ [1, 0, 0])
        crank = rotation_matrix(event.q[pin - 1, 3:]) @ [1, 0, 0]
        assert abs(np.cross(crank, bent)[2]) < 1e-12
    assert branch.closed and branch.closure < 1e-12
    assert [event.kind for event in branch.events] == ["turning point", "turning point", "closed loop"]
    assert gaps(bar, branch) < 1e-13
    assert bar.rocker.angle == bar.swing


def test_both_rockers_of_a_chain_that_no_link_turns_in_turn_back():
    bar = FourBar(*DOUBLE_ROCKER)
    branch = followed(bar, bar.rocker, 0.0, 2.0 * pi)
    (least,) = bar.dead_centers()
    turns = sorted(event.value for event in branch.events_of("turning point"))
    np.testing.assert_allclose(turns, [least, 2.0 * pi - least], rtol=0, atol=1e-13)
    assert branch.closed and branch.closure < 1e-12
    # It is the whole loop: the crank has been at both of its own ends.
    crank, coupler, rocker, ground = bar.lengths
    end = np.arccos((crank**2 + ground**2 - (coupler + rocker) ** 2) / (2.0 * crank * ground))
    assert branch.measures[:, 0].max() == pytest.approx(end, abs=2e-2)


def test_a_drag_link_closes_after_a_whole_turn():
    bar = FourBar(*DRAG_LINK)
    branch = followed(bar, bar.rocker, -10.0, 10.0)
    assert [event.kind for event in branch.events] == ["closed loop"]
    assert branch.closed and branch.closure < 1e-12
    assert branch.values[-1] - branch.values[0] == pytest.approx(2.0 * pi, abs=1e-12)


def test_poses_between_are_those_of_solves():
    bar = FourBar(*CRANK_ROCKER)
    branch = followed(bar, bar.rocker, 0.0, pi)
    for k in range(3, len(branch.values), 9):
        bar.rocker.angle = branch.values[k]
        solution = bar.scene.solve(branch.poses[k])
        # Beside a dead center a pose is as exact as the root of what rows are off by.
        np.testing.assert_allclose(solution.q, branch.poses[k], rtol=0, atol=1e-7)
        assert solution.success


def test_a_finer_step_finds_the_same():
    bar = FourBar(*CRANK_ROCKER)
    coarse = followed(bar, bar.rocker, 0.0, pi, turn=0.3)
    fine = followed(bar, bar.rocker, 0.0, pi, turn=0.05)
    assert len(fine.values) > 1.5 * len(coarse.values)
    for one, other in zip(coarse.events, fine.events, strict=True):
        assert one.kind == other.kind and one.value == pytest.approx(other.value, abs=1e-13)


def test_a_parallelogram_crosses_its_other_branch_where_it_is_flat():
    bar = FourBar(1.0, 3.0, 1.0, 3.0)
    branch = followed(bar, bar.crank, 0.5, 2.5 * pi)
    crossings = branch.events_of("crossing")
    # At the crossing rows have no one direction; it is interpolated between points about it.
    np.testing.assert_allclose([event.value for event in crossings], [pi, 2.0 * pi], rtol=0, atol=1e-11)
    for event in crossings:
        np.testing.assert_allclose(event.q[:, 1], 0.0, rtol=0, atol=1e-11)
    # It stays a parallelogram, and does not go over to the other branch.
    np.testing.assert_allclose(np.sin(branch.measures[:, 0] - branch.measures[:, 1]), 0.0, rtol=0, atol=1e-11)


def test_no_crossing_is_told_of_branches_that_only_come_near():
    bar = FourBar(1.0, 3.0, 1.0, 3.001)
    branch = followed(bar, bar.crank, 0.5, 2.5 * pi)
    assert not branch.events_of("crossing")


def test_a_branch_ends_at_a_limit():
    bar = FourBar(*CRANK_ROCKER)
    bar.rocker.limits = (1.5, 2.3)
    branch = followed(bar, bar.crank, -3.0, 7.0)
    assert [(event.kind, event.name) for event in branch.events] == [("limit reached", "rocker")] * 2
    assert [event.row for event in branch.events] == [0, len(branch.values) - 1]
    for event in branch.events:
        assert branch.measures[event.row, 1] == pytest.approx(2.3, abs=1e-12)
    crank, coupler, rocker, ground = bar.lengths
    tip = np.array([ground + rocker * cos(2.3), rocker * sin(2.3)])
    for angle in branch.values[[0, -1]]:
        assert np.linalg.norm(tip - crank * np.array([cos(angle), sin(angle)])) == pytest.approx(coupler, abs=1e-12)


def arm():
    """Two links drawn to a target, the second one within limits."""
    ground, upper, lower = asm.Body("ground", fixed=True), asm.Body("upper"), asm.Body("lower", position=(1, 0, 0))
    shoulder = asm.Revolute(ground, upper, "shoulder")
    elbow = asm.Revolute(upper.frame(at=(1, 0, 0)), lower, "elbow", limits=(0.3, 2.0))
    goal = asm.PointDistance(lower.point(0.8, 0, 0), (1.0, 1.0, 0.0))
    scene = asm.Assembly([ground, upper, lower])
    scene.constrain(shoulder, elbow)
    scene.minimize(goal)
    q = np.array([[0, 0, 0, 1, 0, 0, 0], [0, 0, 0, 1, 0, 0, 0], [1, 0, 0, cos(0.5), 0, 0, sin(0.5)]])
    return scene, shoulder, elbow, goal, scene.solve(q)


def test_an_objective_is_followed_through_a_limit():
    scene, shoulder, elbow, goal, solution = arm()
    measures = [asm.Measure(shoulder), asm.Measure(elbow), asm.Measure("objective")]
    branch = asm.follow(scene, asm.Parameter(goal, "target", "x"), 0.1, 3.0, of=measures, start=solution)
    assert [event.kind for event in branch.events] == ["end of range", "limit reached", "end of range"]
    # Stretched to the limit: |tip|^2 = 1 + 0.64 + 1.6 cos 0.3 = x^2 + 1.
    assert branch.events[1].value == pytest.approx(np.sqrt(0.64 + 1.6 * cos(0.3)), abs=1e-12)
    reach = np.sqrt(1.64 + 1.6 * cos(0.3))
    for x, (_, bend, value) in zip(branch.values, branch.measures, strict=True):
        expected = max(0.0, np.hypot(x, 1.0) - reach) ** 2
        assert value == pytest.approx(expected, abs=1e-12) and bend > 0.3 - 1e-12
    assert goal.target[0] == 1.0
    # And back, from beyond: the limit is left where it was reached.
    goal.target = (2.5, 1.0, 0.0)
    back = asm.follow(scene, asm.Parameter(goal, "target", "x"), 0.5, 3.0, start=scene.solve(solution))
    (left,) = back.events_of("limit left")
    assert left.name == "elbow" and left.value == pytest.approx(branch.events[1].value, abs=1e-11)


def table_and_ball():
    """A ball on a table, guided upward, drawn to a height."""
    table = asm.Body("table", asm.shapes.plane(10, 10), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), position=(0, 0, 1))
    goal = asm.PointDistance(ball.point(0, 0, 0), (0, 0, 0.2))
    scene = asm.Assembly([table, ball])
    scene.constrain(asm.Prismatic(table, ball, "guide"), asm.Contact(table, ball, "rest", unilateral=True))
    scene.minimize(goal)
    return scene, ball, goal


def test_contacts_open_and_close():
    scene, ball, goal = table_and_ball()
    height = asm.Parameter(goal, "target", "z")
    branch = asm.follow(scene, height, -1.0, 3.0, of=asm.Measure(ball, "z"))
    assert [(event.kind, event.name) for event in branch.events][1] == ("contact opened", "rest")
    assert branch.events[1].value == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(branch.measures[:, 0], np.maximum(branch.values, 1.0), rtol=0, atol=1e-12)
    goal.target = (0, 0, 2.0)
    back = asm.follow(scene, height, -1.0, 3.0, of=asm.Measure(ball, "z"))
    assert back.events[1].kind == "contact closed" and back.events[1].value == pytest.approx(1.0, abs=1e-12)
    np.testing.assert_allclose(back.measures[:, 0], np.maximum(back.values, 1.0), rtol=0, atol=1e-12)


def test_a_cam_is_followed_through_its_contact():
    ground, cam = asm.Body("ground", fixed=True), asm.Body("cam", asm.shapes.sphere(1.0))
    turned = (np.sqrt(0.5), np.sqrt(0.5), 0, 0)
    flat = asm.Body("flat", asm.shapes.plane(8, 8), position=(0, 1.5, 0), quaternion=turned)
    shaft = asm.Revolute(ground.frame(at=(0.4, 0, 0)), cam.frame(at=(0.4, 0, 0)), "shaft", angle=0.3)
    lift = asm.Prismatic(ground.frame(z=(0, 1, 0), x=(1, 0, 0)), flat.frame(z=(0, 0, -1), x=(1, 0, 0)), "lift")
    scene = asm.Assembly([ground, cam, flat])
    scene.constrain(shaft, lift, asm.Contact(cam, flat, "touch"))
    branch = asm.follow(scene, asm.Parameter(shaft, "angle"), -10.0, 10.0, of=asm.Measure(lift))
    assert branch.closed and branch.closure < 1e-12
    np.testing.assert_allclose(branch.measures[:, 0], 1.0 - 0.4 * np.sin(branch.values), rtol=0, atol=1e-12)


def test_a_length_is_followed_to_where_the_chain_is_pulled_taut():
    bar = FourBar(*CRANK_ROCKER)
    bar.crank.angle = 0.7
    length = asm.Parameter(bar.wrist.frame_a, "origin", "x", name="coupler")
    branch = asm.follow(
        bar.scene, length, 0.001, 6.0, of=asm.Measure(bar.rocker), start=bar.scene.solve(bar.q), largest_step=0.3
    )
    crank, _, rocker, ground = bar.lengths
    reach = np.hypot(ground - crank * cos(0.7), crank * sin(0.7))
    turns = [event.value for event in branch.events_of("turning point")]
    # The scene's size changes with the length, and so do units: the events do not.
    np.testing.assert_allclose(sorted(turns)[-1], reach + rocker, rtol=0, atol=1e-12)
    np.testing.assert_allclose(sorted(turns)[0], abs(reach - rocker), rtol=0, atol=1e-12)
    assert branch.closed


def test_the_same_again_and_at_another_size():
    first, again = (followed(bar, bar.rocker, 0.0, pi) for bar in (FourBar(*CRANK_ROCKER), FourBar(*CRANK_ROCKER)))
    np.testing.assert_array_equal(first.poses, again.poses)
    large = FourBar(*(1e3 * length for length in CRANK_ROCKER))
    other = followed(large, large.rocker, 0.0, pi)
    assert len(other.values) == len(first.values)
    np.testing.assert_allclose(other.values, first.values, rtol=0, atol=1e-11)


def test_what_is_told():
    bar = FourBar(*CRANK_ROCKER)
    branch = followed(bar, bar.rocker, 0.0, pi, of=asm.Measure(bar.crank))
    table = branch.table
    assert table.dtype.names == ("rocker.angle", "length", "crank.angle")
    np.testing.assert_array_equal(table["rocker.angle"], branch.values)
    text = str(branch)
    assert "turning point at 1.60142611597" in text and "closed to" in text and len(text.splitlines()) == 4
    assert not branch.poses.flags.writeable and (np.diff(branch.lengths) > 0.0).all()
    # A crank goes all around, and does not jump back at half a turn.
    assert abs(table["crank.angle"][-1] - table["crank.angle"][0]) == pytest.approx(2.0 * pi, abs=1e-12)
    twice = followed(bar, bar.rocker, 0.0, pi)
    with pytest.raises(InputError, match="expected names that differ"):
        _ = twice.table


def test_a_branch_is_drawn():
    pytest.importorskip("matplotlib", reason="plots need matplotlib")
    bar = FourBar(*CRANK_ROCKER)
    figure = followed(bar, bar.rocker, 0.0, pi).plot()
    assert len(figure.axes) == 2
    labels = {text.get_text() for text in figure.axes[0].get_legend().get_texts()}
    assert labels == {"turning point", "closed loop"}


def test_what_cannot_be_followed_raises():
    bar = FourBar(*CRANK_ROCKER)
    bar.rocker.angle = bar.swing
    solution, angle = bar.scene.solve(bar.q), asm.Parameter(bar.rocker, "angle")
    cases = [
        ((angle, 3.0, 4.0), {}, "expected low below high"),
        ((angle, 0.0, 4.0), {"turns": 1.0}, "option 'turns' is unknown"),
        ((angle, 0.0, 4.0), {"turn": 0.0}, "turn is 0"),
        ((angle, 0.0, float("nan")), {}, "high is nan"),
    ]
    for arguments, options, words in cases:
        with pytest.raises(InputError, match=words):
            asm.follow(bar.scene, *arguments, start=solution, **options)
    with pytest.raises(TypeError, match="expected a Parameter"):
        asm.follow(bar.scene, "angle", 0.0, 4.0)
    length = asm.Parameter(bar.wrist.frame_a, "origin", "x")
    bar.rocker.angle = None
    with pytest.raises(InputError, match="leaves 1 motions free"):
        asm.follow(bar.scene, length, 0.1, 4.0, start=bar.scene.solve(bar.q))
    scene, ball, goal = table_and_ball()
    scene.remove("guide")
    with pytest.raises(InputError, match="does not determine 3 of the motions"):
        asm.follow(scene, asm.Parameter(goal, "target", "z"), -1.0, 3.0)
    height = asm.Parameter(goal, "target", "z")
    with pytest.raises(InputError, match="swept is True where no clearance keeps bodies apart"):
        asm.follow(scene, height, -1.0, 3.0, swept=True)
    with pytest.raises(TypeError, match="swept is 1; expected True or False"):
        asm.follow(scene, height, -1.0, 3.0, swept=1)


def test_what_cannot_be_followed_is_told():
    bar = FourBar(*CRANK_ROCKER)
    bar.crank.angle = 0.7
    angle = asm.Parameter(bar.crank, "angle")
    with pytest.raises(InputError, match=r"are 3 and 0; expected low below high, and crank\.angle = 0\.7"):
        asm.follow(bar.scene, angle, 3.0, 0.0)
    with pytest.raises(TypeError, match=r"of is 'crank\.angle'; expected a Measure"):
        asm.follow(bar.scene, angle, 0.0, 3.0, of="crank.angle")
    with pytest.raises(InputError, match=r"parameter has 'crank\.angle', which is of another scene"):
        asm.follow(FourBar(*CRANK_ROCKER).scene, angle, 0.0, 3.0)
    bar.crank.angle = None
    assert repr(angle) == "Parameter('crank.angle', value=None)"
    with pytest.raises(InputError, match=r"crank\.angle is None; expected a driven value"):
        asm.follow(bar.scene, angle, 0.0, 3.0)


def test_a_branch_is_shown_by_notebooks_and_has_known_kinds_of_events():
    bar = FourBar(*CRANK_ROCKER)
    branch = followed(bar, bar.rocker, 0.0, pi)
    assert "turning point at" in branch._repr_html_()
    assert len(branch.events_of("turning point")) == 2 and branch.events_of("crossing") == ()
    assert {event.kind for event in branch.events} <= {*KINDS}
    with pytest.raises(InputError, match="kind is 'turning'; expected one of 'turning point', 'crossing'"):
        branch.events_of("turning")
