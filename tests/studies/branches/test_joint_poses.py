"""Poses at values of joints, against closed forms, and against what a solution says of them."""

from __future__ import annotations

from math import acos, atan2, cos, hypot, nan, sin

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError, UnknownNameError
from assembly.solve.measure import measure, standing
from benchmarks.planar_four_bars import FourBar
from tests.studies.branches.test_joint_space import tree_of_all_kinds

# Some ten roundings of a pose.
ROUNDING = 1e-14


def values_at(scene, q):
    """Freedoms of joints at poses, by their definitions, whatever they are driven to."""
    places = {body: k for k, body in enumerate(scene.bodies)}
    found = {}
    for joint in scene.constraints:
        at = tuple(places[body] for body in joint.bodies)
        for name in joint.freedoms:
            coordinate = joint.freedom(name).coordinate
            found[f"{joint.name}.{name}"] = measure(coordinate, standing(coordinate, q, at))
    return found


def arm():
    """Two links of lengths 3 and 2 in the plane."""
    ground, upper, lower = asm.Body("ground", fixed=True), asm.Body("upper"), asm.Body("lower")
    scene = asm.Assembly([ground, upper, lower])
    scene.constrain(
        asm.Revolute(ground, upper, "shoulder", limits=(-2.0, 2.0)),
        asm.Revolute(upper.frame(at=(3, 0, 0)), lower, "elbow", angle=0.5),
    )
    return scene, lower


def test_an_arm_is_where_its_angles_say():
    scene, lower = arm()
    before = scene.q.copy()
    for a, b in ((0.3, 0.9), (-1.7, 3.5), (0.0, -0.2)):
        q = scene.at({"shoulder.angle": a, "elbow.angle": b})
        pose = asm.Pose(q[2, :3], q[2, 3:])
        tip = [3.0 * cos(a) + 2.0 * cos(a + b), 3.0 * sin(a) + 2.0 * sin(a + b), 0.0]
        np.testing.assert_allclose(pose.apply([2.0, 0.0, 0.0]), tip, rtol=0, atol=ROUNDING)
    # A driven angle that is not given has its value, a free one what bodies stand at; nothing was moved or set.
    q = scene.at({"shoulder.angle": 0.3})
    assert values_at(scene, q)["elbow.angle"] == pytest.approx(0.5, abs=ROUNDING)
    lower.pose, scene.bodies[1].pose = asm.Pose((1, 2, 3)), asm.Pose((0, 0, 0), (cos(0.4), 0, 0, sin(0.4)))
    assert values_at(scene, scene.at({}))["shoulder.angle"] == pytest.approx(0.8, abs=ROUNDING)
    assert scene.solve(scene.at({})).iterations == 0 and (before[0] == scene.q[0]).all()
    assert scene.constraints[1].angle == 0.5


def test_all_kinds_of_joints_are_where_a_solution_says():
    scene = tree_of_all_kinds()
    given = {
        "hinge.angle": 0.3,
        "from the child.angle": -1.2,
        "slider.slide": 1.9,
        "sleeve.angle": 2.5,
        "screw.slide": 0.125,
        "plane.x": 3.05,
        "plane.angle": 0.4,
    }
    q = scene.at(given)
    values = values_at(scene, q)
    for name, value in {**given, "sleeve.slide": 0.7}.items():
        assert values[name] == pytest.approx(value, abs=ROUNDING), name
    # Driven to what was given, the scene is solved there. What is free stays as bodies stand.
    scene.constraints[1].angle = -1.2
    scene.constraints[4].slide = 0.125
    solution = scene.solve(q)
    assert solution.iterations == 0 and solution.feasibility < ROUNDING
    for body in scene.bodies[1:]:
        body.pose = solution.pose(body)
    kept = values_at(scene, scene.at({"hinge.angle": 0.8}))
    for name in ("ball.azimuth", "plane.y", "sleeve.angle", "slider.slide"):
        assert kept[name] == pytest.approx(values[name], abs=10 * ROUNDING), name


def test_a_four_bar_closes_from_either_end():
    crank, rod, rocker, base = 1.0, 3.0, 2.5, 3.2
    bar = FourBar(crank, rod, rocker, base)
    bar.crank.angle = 0.7
    solution = bar.scene.solve()
    for body in bar.scene.bodies:
        body.pose = solution.pose(body)
    name = f"{bar.crank.name}.angle"
    for angle in (0.75, 1.1, 0.2):
        q = bar.scene.at({name: angle})
        bar.crank.angle = angle
        found = bar.scene.solve(q)
        assert found.iterations == 0 and found.values[name] == pytest.approx(angle, abs=1e-12)
        # The angle at which the rocker is: of the triangle that it makes with the rod.
        x, y = crank * cos(angle) - base, crank * sin(angle)
        d = hypot(x, y)
        spread = acos((d * d + rocker * rocker - rod * rod) / (2.0 * d * rocker))
        is_at = found.values[f"{bar.rocker.name}.angle"]
        assert min(abs(sin(is_at - atan2(y, x) - s * spread)) for s in (1.0, -1.0)) < 1e-12
    # The other way around: the rocker is given, and the crank is no longer where it is driven to.
    target = found.values[f"{bar.rocker.name}.angle"]
    bar.crank.angle = None
    q = bar.scene.at({f"{bar.rocker.name}.angle": target + 0.01})
    end = bar.scene.solve(q)
    assert end.iterations == 0
    assert end.values[f"{bar.rocker.name}.angle"] == pytest.approx(target + 0.01, abs=1e-12)


def test_what_cannot_close_is_left_open():
    bar = FourBar(1.0, 3.0, 2.5, 3.2)
    bar.rocker.frame_a.place(at=(20, 0, 0))
    q = bar.scene.at({f"{bar.crank.name}.angle": 0.4})
    assert np.isfinite(q).all()
    assert not bar.scene.solve(q).success
    assert values_at(bar.scene, q)[f"{bar.crank.name}.angle"] == pytest.approx(0.4, abs=ROUNDING)


def test_values_that_place_nothing_are_refused():
    scene, _ = arm()
    with pytest.raises(UnknownNameError, match="name is 'shoulder.angel'; expected perhaps 'shoulder.angle'"):
        scene.at({"shoulder.angel": 0.3})
    with pytest.raises(InputError, match=r"values\['shoulder.angle'\] is 2.1; expected a value within the limits"):
        scene.at({"shoulder.angle": 2.1})
    with pytest.raises(InputError, match=r"values\['shoulder.angle'\] is nan"):
        scene.at({"shoulder.angle": nan})
    with pytest.raises(TypeError, match="values is 0.3; expected a mapping"):
        scene.at(0.3)
    every = tree_of_all_kinds()
    with pytest.raises(InputError, match="values has 'ball.azimuth', which places no body; expected names of"):
        every.at({"ball.azimuth": 0.3})
    with pytest.raises(InputError, match="values has the angle and the slide of 'screw'; expected one"):
        every.at({"screw.angle": 0.3, "screw.slide": 0.1})
