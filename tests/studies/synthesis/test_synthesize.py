"""Dimensions found by optimizers, against closed forms of a slider-crank and of arms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import BSpline
from scipy.optimize import minimize_scalar

import assembly as asm
from assembly.errors import InputError
from tests.studies.reachable.test_workspace_gradient import spatial_arm

RADIUS, LENGTH = 2.0, 5.0


def slider_crank():
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    hinge = asm.Revolute(ground, crank, "hinge", angle=0.7)
    pin = asm.Revolute(crank.frame(at=(RADIUS, 0, 0)), rod, "pin")
    wrist = asm.Revolute(rod.frame(at=(LENGTH, 0, 0)), piston, "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene = asm.Assembly([ground, crank, rod, piston])
    scene.constrain(hinge, pin, wrist, guide)
    angle = asm.Parameter(hinge, "angle")
    radius = asm.Parameter(pin.frame_a, "origin", "x", name="radius")
    length = asm.Parameter(wrist.frame_a, "origin", "x", name="length")
    return scene, asm.Measure(guide), angle, radius, length


def stroke(radius, length, angle):
    return radius * np.cos(angle) + np.sqrt(length**2 - (radius * np.sin(angle)) ** 2)


def test_two_strokes_give_two_lengths_back():
    scene, slide, angle, radius, length = slider_crank()
    stations = [asm.Station({angle: a}, {slide: stroke(1.7, 5.6, a)}) for a in (0.2, 1.2, 2.2)]
    found = asm.synthesize(scene, stations, {radius: (1.0, 3.0), length: (4.0, 8.0)})
    assert found.success, found
    np.testing.assert_allclose(found.values, [1.7, 5.6], rtol=0, atol=1e-10)
    assert found.evaluations <= 10
    assert (radius.value, length.value, angle.value) == (RADIUS, LENGTH, 0.7)
    found.apply()
    assert radius.value == found.values[0] and found.found[length] == length.value
    assert "radius" in str(found) and "evaluations" in str(found)


def test_the_greatest_of_a_measure_is_made_least_within_bounds():
    """A slider that stays near at two angles, with a rod no shorter than 2.2 cranks."""
    scene, slide, angle, radius, length = slider_crank()
    stations = [asm.Station({angle: a}) for a in (0.5, 1.0)]

    def ratio(values):
        return values[1] - 2.2 * values[0], (-2.2, 1.0)

    sides = {radius: (1.5, 3.0), length: (3.0, 8.0)}
    found = asm.synthesize(scene, slide, sides, stations=stations, subject_to=[(ratio, 0.0, None)])
    # The shortest crank, and the shortest rod that it may have.
    assert found.success, found
    np.testing.assert_allclose(found.values, [1.5, 3.3], rtol=0, atol=1e-9)
    assert found.cost == pytest.approx(stroke(1.5, 3.3, 0.5), abs=1e-9)
    assert found.violation < 1e-9


def test_two_stations_share_the_greatest_measure():
    """How far the piston is from a place between two strokes: the best rod puts both as far from it."""
    scene, _, angle, _, length = slider_crank()
    far = asm.Measure((scene.bodies[3], scene.bodies[0].point(5.0, 0.0, 0.0)))
    stations = [asm.Station({angle: a}) for a in (0.3, 2.6)]
    found = asm.synthesize(scene, far, {length: (4.0, 7.0)}, stations=stations)
    first, second = found.measures
    assert found.success and first == pytest.approx(second, abs=1e-8)
    assert found.cost == pytest.approx(first, abs=1e-8)


def test_squares_with_a_bound_on_a_measure():
    """Two strokes wanted, and the one at the second station not over 4.5: the bound holds, and its residual is left."""
    scene, slide, angle, radius, length = slider_crank()
    stations = [asm.Station({angle: 0.4}, {slide: 7.0}, weight=2.0), asm.Station({angle: 1.6}, {slide: 5.0})]
    free = asm.synthesize(scene, stations, {radius: (1.0, 3.0), length: (4.0, 8.0)})
    assert free.success and np.abs(free.residuals).max() < 1e-10
    held = asm.synthesize(scene, stations, {radius: (1.0, 3.0), length: (4.0, 8.0)}, subject_to=[(slide, None, 6.9)])
    assert held.success, held
    # The second can still be met; the first is 0.1 short, by its weight 0.2.
    np.testing.assert_allclose(held.residuals, [-0.2, 0.0], rtol=0, atol=1e-6)
    assert held.measures[[0, 2]] == pytest.approx([6.9, 5.0], abs=1e-6)


def test_steps_to_where_there_is_no_solution_are_shortened_and_told():
    """A stroke of 2 with the crank upright wants a rod so short that Newton's first step makes it shorter than it."""
    scene, slide, angle, radius, length = slider_crank()
    wanted = stroke(RADIUS, 2.05, 1.5)
    found = asm.synthesize(scene, [asm.Station({angle: 1.5}, {slide: wanted})], {length: (0.5, 8.0)})
    assert found.success, found
    assert found.values[0] == pytest.approx(2.05, abs=1e-9)
    assert found.failures and "no solution" in found.failures[0]
    bounded = asm.synthesize(
        scene, [asm.Station({angle: 1.5}, {slide: wanted})], {length: (0.5, 8.0)}, subject_to=[(slide, -10.0, None)]
    )
    assert bounded.success, bounded
    assert bounded.values[0] == pytest.approx(2.05, abs=1e-6)


def arm(long, short):
    """Two links and a tip that is a body; its lengths as parameters."""
    ground, upper, fore, tip = asm.Body("ground", fixed=True), *(asm.Body(name) for name in ("upper", "fore", "tip"))
    turn = (np.cos(0.4), 0, 0, np.sin(0.4))
    fore.pose = asm.Pose((long, 0, 0), turn)
    tip.pose = asm.Pose((long + short * np.cos(0.8), short * np.sin(0.8), 0), turn)
    scene = asm.Assembly([ground, upper, fore, tip])
    shoulder = asm.Revolute(ground, upper, "shoulder")
    elbow = asm.Revolute(upper.frame(at=(long, 0, 0)), fore, "elbow")
    wrist = asm.Fixed(fore.frame(at=(short, 0, 0)), tip, "wrist")
    scene.constrain(shoulder, elbow, wrist)
    lengths = [asm.Parameter(joint.frame_a, "origin", "x", name=joint.name) for joint in (elbow, wrist)]
    return scene, (shoulder, elbow), lengths


def total(values):
    return values.sum(), (1.0, 1.0)


def test_the_worst_dexterity_over_targets_is_largest_for_links_of_one_length():
    """The manipulability l1 l2 |sin bend| at a target is twice the area of the triangle of both links and it: of all
    with one sum of links the isosceles one has the largest, r (l^2 - r^2 / 4)^(1/2).
    """
    scene, joints, lengths = arm(1.1, 0.7)
    ground, tip = scene.bodies[0], scene.bodies[3]
    held = asm.Planar(ground, tip, "target", x=1.2, y=0.4)
    scene.constrain(held)
    scene.maximize(asm.Dexterity(tip.point(0, 0, 0), joints, "manipulability"))
    x, y = (asm.Parameter(held, name) for name in "xy")
    targets = [(1.2, 0.4), (0.9, 0.9), (0.3, 1.5), (0.4, 0.7)]
    found = asm.synthesize(
        scene,
        asm.Measure("objective"),
        {lengths[0]: (0.6, 1.4), lengths[1]: (0.5, 1.3)},
        stations=[asm.Station({x: a, y: b}) for a, b in targets],
        subject_to=[(total, 1.8, 1.8)],
    )
    assert found.success, found
    np.testing.assert_allclose(found.values, 0.9, rtol=0, atol=1e-6)
    radii = np.hypot(*np.transpose(targets))
    worst = (radii * np.sqrt(0.81 - radii**2 / 4.0)).min()
    assert found.cost == pytest.approx(-worst, abs=1e-7)


def test_the_area_that_an_arm_reaches_is_largest_for_links_of_one_length():
    """4 pi l1 l2 for one sum of both lengths. The area's derivatives are good to 3e-3 at this cell."""
    scene, _, lengths = arm(1.0, 0.7)

    def area(values):
        reach = asm.workspace(scene, scene.bodies[3], cell=0.1, plane="xy")
        return -reach.estimate, -reach.gradient(lengths)

    found = asm.synthesize(
        scene, area, {lengths[0]: (0.5, 1.2), lengths[1]: (0.5, 1.2)}, subject_to=[(total, None, 1.7)], level=0.01
    )
    assert found.success, found
    np.testing.assert_allclose(found.values, 0.85, rtol=0, atol=5e-3)
    assert found.cost == pytest.approx(-4.0 * np.pi * 0.85**2, rel=3e-3)
    assert lengths[0].value == 1.0


def test_the_volume_that_a_spatial_arm_reaches_is_largest_for_links_of_one_length():
    """4 pi / 3 ((l1 + l2)^3 - |l1 - l2|^3) for one sum of both lengths, which leaves no hole in the middle.

    The arm turns about z, and at the poles on that axis its first hinge moves the tip no more: cells there are reached,
    too. Where the hole is smaller than a cell nothing of it is seen; the volume is good to 1.6 percent at this cell.
    """
    scene, tip, lengths = spatial_arm(1.1, 0.6)
    cell, seen = 0.4, []

    def volume(values):
        reach = asm.workspace(scene, tip, cell=cell)
        seen.append(reach)
        return -reach.estimate, -reach.gradient(lengths)

    found = asm.synthesize(
        scene, volume, {lengths[0]: (0.6, 1.3), lengths[1]: (0.4, 1.1)}, subject_to=[(total, None, 1.7)], level=0.05
    )
    assert found.success, found
    assert found.values.sum() == pytest.approx(1.7, abs=1e-9) and abs(np.subtract(*found.values)) < 0.1
    assert -found.cost == pytest.approx(4.0 / 3.0 * np.pi * 1.7**3, rel=0.02)
    assert seen[0].estimate == pytest.approx(4.0 / 3.0 * np.pi * (1.7**3 - 0.5**3), rel=0.01)
    # Cells around the axis, up to the outer sphere and down to the hole.
    heights = seen[0].centers[np.hypot(*seen[0].centers[:, :2].T) < cell][:, 2]
    assert heights.max() > 1.3 and heights.min() < -1.3 and np.abs(heights).min() < 0.5 + cell


def test_functions_of_the_dimensions_that_fail_shorten_steps():
    """The least of (r - 1.4)^2 + (l - 5)^4 / 8, of which there is none where r is less than 1.3."""
    scene, slide, _, radius, length = slider_crank()

    def function(values):
        assert (radius.value, length.value) == tuple(values)  # the scene has them
        if values[0] < 1.3:
            raise asm.ResponseError("radius is too small")
        off = values - [1.4, 5.0]
        return off[0] ** 2 + off[1] ** 4 / 8.0, (2.0 * off[0], off[1] ** 3 / 2.0)

    length.value = 6.0
    found = asm.synthesize(scene, function, {radius: (0.5, 3.0), length: (4.0, 8.0)}, level=1e-4)
    assert found.success, found
    assert found.values[0] == pytest.approx(1.4, abs=1e-3) and found.cost < 1e-4
    assert found.failures and found.failures[0] == "radius is too small"
    assert radius.value == RADIUS
    with pytest.raises(InputError, match="minimize is a function; expected one of the two"):
        asm.synthesize(scene, function, {radius: (0.5, 3.0)}, stations=[asm.Station({}, {slide: 1.0})])
    with pytest.raises(InputError, match="level is 0; expected a positive number"):
        asm.synthesize(scene, function, {radius: (0.5, 3.0)}, level=0.0)


def test_a_cam_has_the_profile_that_a_lift_is_wanted_of():
    """A cubic profile y(x) that slides under a roller of radius r: at x the roller's axis is at the largest of
    y(t) + (r^2 - (t - x)^2)^(1/2). The control points that made the lifts come back.
    """
    count, long, radius = 9, 8.0, 0.5
    knots = np.concatenate([[0.0] * 3, np.linspace(0.0, long, count - 2), [long] * 3])
    along = np.array([knots[k + 1 : k + 4].mean() for k in range(count)])
    heights = np.array([0.0, 0.0, 0.05, 0.3, 0.5, 0.35, 0.1, 0.0, 0.0])
    profile = BSpline(knots, heights, 3)

    def lift(x):
        def below(t):
            return -profile(t) - np.sqrt(radius**2 - (t - x) ** 2)

        return -minimize_scalar(below, (x - 0.1, x + 0.1), options={"xtol": 1e-12}).fun

    net = np.array([[[x, 0.0, z] for z in (1.0, -1.0)] for x in along])
    surface = asm.NurbsSurface(net, (knots, [0.0, 0.0, 1.0, 1.0]), (3, 1))
    ground, cam = asm.Body("ground", fixed=True), asm.Body("cam", surface)
    roller = asm.Body("roller", asm.shapes.sphere(radius), position=(4.0, 0.6, 0.0))
    slide = asm.Prismatic(ground.frame(z=(1, 0, 0)), cam.frame(z=(1, 0, 0)), "slide", slide=0.0)
    guide = asm.Prismatic(ground.frame(at=(4, 0, 0), z=(0, 1, 0)), roller.frame(z=(0, 1, 0)), "guide")
    scene = asm.Assembly([ground, cam, roller])
    scene.constrain(slide, guide, asm.Contact(cam, roller, "touch"))
    driven, height = asm.Parameter(slide, "slide"), asm.Measure(guide)
    places = np.linspace(-2.8, 2.8, 12)
    stations = [asm.Station({driven: -x}, {height: lift(4.0 + x)}) for x in places]
    points = [
        asm.Parameter(cam.face(), "control_points", (i, j, "y")) for i in range(1, count - 1) for j in (0, 1)
    ]  # fmt: skip
    found = asm.synthesize(scene, stations, {point: (-1.0, 1.0) for point in points}, apply=True)
    assert found.success, found
    # A minimum is known to the root of rounding, which leaves 1e-15 of its value.
    np.testing.assert_allclose(found.residuals, 0.0, rtol=0, atol=1e-10)
    np.testing.assert_allclose(found.values.reshape(-1, 2), heights[1:-1, None] * [1.0, 1.0], rtol=0, atol=1e-8)
    assert found.evaluations <= 15


def test_same_input_same_output():
    results = []
    for _ in range(2):
        scene, slide, angle, radius, length = slider_crank()
        stations = [asm.Station({angle: a}, {slide: stroke(1.7, 5.6, a)}) for a in (0.2, 1.2)]
        results.append(asm.synthesize(scene, stations, {radius: (1.0, 3.0), length: (4.0, 8.0)}))
    assert results[0].values.tobytes() == results[1].values.tobytes()


def test_what_cannot_be_used_is_told():
    scene, slide, angle, radius, length = slider_crank()
    station = asm.Station({angle: 0.7}, {slide: 6.0})
    with pytest.raises(InputError, match="either side"):
        asm.synthesize(scene, [station], {radius: (2.5, 3.0)})
    with pytest.raises(InputError, match="without wanted values"):
        asm.synthesize(scene, [asm.Station({angle: 0.7})], {radius: (1.5, 3.0)})
    with pytest.raises(InputError, match="one of the two"):
        asm.synthesize(scene, slide, {radius: (1.5, 3.0)}, stations=[station])
    with pytest.raises(InputError, match="or either"):
        asm.synthesize(scene, [station], {radius: (1.5, 3.0)}, subject_to=[(slide, None, None)])
    with pytest.raises(TypeError, match="expected a Parameter"):
        asm.Station({slide: 0.7}, {slide: 6.0})
    with pytest.raises(asm.ResponseError, match="station 1"):
        radius.value, length.value = 2.0, 1.9
        asm.synthesize(
            scene,
            [asm.Station({angle: 0.1}, {slide: 4.0}), asm.Station({angle: 1.5}, {slide: 1.0})],
            {radius: (1.5, 3.0)},
        )
