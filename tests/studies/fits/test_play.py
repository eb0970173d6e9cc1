"""The range of measures within fits, against closed forms."""

from __future__ import annotations

from math import acos, asin, atan2, hypot, inf, sqrt, tan

import pytest

import assembly as asm
from assembly.errors import InputError
from tests.studies.machined import socket


def tilt(hole, pin, thickness):
    """Of a pin in a hole of a plate, by radii: 2 hole cos a = 2 pin + thickness sin a.

    The pin's wall, two lines in the plane in which it tilts, goes through the two edges of the hole that are across.
    """
    return acos(2.0 * pin / hypot(2.0 * hole, thickness)) - atan2(thickness, 2.0 * hole)


def loose_pin():
    """A pin of diameter 8 in a hole of 8.4 of a plate 12 thick; its end is kept in the plane 20 above the plate."""
    plate = asm.Body("plate", asm.shapes.plate(40, 40, 12, holes=[(0, 0, 4.2)]), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(4, 60), position=(0, 0, -4))
    tip = pin.point(0, 0, 30)
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Clearance(), asm.PointOnPlane(tip, plate.frame((0, 0, 26))))
    return scene, tip


def test_a_pin_tilts_in_its_hole():
    scene, tip = loose_pin()
    found = asm.play(scene, scene.solve(), asm.Measure(tip, "x"))
    # The axis goes through the middle of the hole, which is a center of symmetry, 26 below the plane of the tip.
    most = 26.0 * tan(tilt(4.2, 4.0, 12.0))
    assert found.success
    assert most == pytest.approx(0.8572477676298279, abs=1e-14)
    assert [found.least.value, found.most.value] == pytest.approx([-most, most], abs=1e-11)
    assert found.width == pytest.approx(2.0 * most, abs=1e-11)
    for end, value in ((found.least, -most), (found.most, most)):
        assert end.status is asm.Status.SOLVED
        assert asm.Measure(tip, "x").value(end.solution) == pytest.approx(value, abs=1e-11)
        assert max(end.solution.violations.values()) < 1e-10


def test_the_same_farthest_from_the_axis():
    scene, tip = loose_pin()
    found = asm.play(scene, scene.solve(), asm.Measure((tip, scene.bodies[0].point(0, 0, 26))))
    assert [found.least.value, found.most.value] == pytest.approx([0.0, 26.0 * tan(tilt(4.2, 4.0, 12.0))], abs=1e-9)


def test_a_slider_between_limits():
    ground, slider = asm.Body("ground", fixed=True), asm.Body("slider", position=(0.3, 0, 0))
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), slider.frame(z=(1, 0, 0)), "guide", limits=(-0.25, 1.5))
    scene = asm.Assembly([ground, slider])
    scene.constrain(guide)
    for measure in (asm.Measure(guide), asm.Measure(slider, "x")):
        found = asm.play(scene, scene.solve(), measure)
        assert [found.least.value, found.most.value] == pytest.approx([-0.25, 1.5], abs=1e-12)
    guide.limits = (-0.25, None)
    found = asm.play(scene, scene.solve(), asm.Measure(guide))
    assert found.least.value == pytest.approx(-0.25, abs=1e-12)
    assert found.most.value == inf and found.most.status is asm.Status.UNBOUNDED and not found.success
    assert "most: unbounded" in str(found)
    guide.slide = 0.5
    held = asm.play(scene, scene.solve(), asm.Measure(guide))
    assert [held.least.value, held.most.value] == pytest.approx([0.5, 0.5], abs=1e-12)


@pytest.mark.parametrize("limits", [(-0.4, 0.9), (0.2, 5.5), (6.5, 9.0)])
def test_a_hinge_between_limits(limits):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    hinge = asm.Revolute(ground, arm, "hinge", limits=limits)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge)
    found = asm.play(scene, scene.solve(), asm.Measure(hinge))
    assert [found.least.value, found.most.value] == pytest.approx(limits, abs=1e-11)
    hinge.limits = None
    free = asm.play(scene, scene.solve(), asm.Measure(hinge))
    assert [free.least.value, free.most.value] == [-inf, inf]


def test_a_block_in_a_pocket():
    # A block of 10 x 6 in a pocket of 11 x 6.5 that it cannot leave, kept from turning, and then free to turn.
    walls = [(12, 20, 8, 11.5, 0), (12, 20, 8, -11.5, 0), (40, 12, 8, 0, 9.25), (40, 12, 8, 0, -9.25)]
    frame = [
        asm.Body(f"wall {k}", asm.shapes.box(x, y, z), position=(at, to, 0), fixed=True)
        for k, (x, y, z, at, to) in enumerate(walls)
    ]
    block = asm.Body("block", asm.shapes.box(10, 6, 4))
    floor = asm.Planar(frame[0].frame((-11.5, 0, 0)), block.frame(), "floor", angle=0.0)
    scene = asm.Assembly([*frame, block])
    scene.constrain(floor, asm.Clearance(exclude=[(a, b) for a in frame for b in frame if a.name < b.name]))
    for component, half in (("x", 0.5), ("y", 0.25)):
        found = asm.play(scene, scene.solve(), asm.Measure(floor, component))
        assert [found.least.value, found.most.value] == pytest.approx([-half, half], abs=1e-11)
    corner = asm.play(scene, scene.solve(), asm.Measure((block.point(5, 3, 0), frame[0].point(-11.5, 0, 0))))
    assert corner.most.value == pytest.approx(hypot(5.5, 3.25), abs=1e-11)
    assert corner.least.value == pytest.approx(hypot(4.5, 2.75), abs=1e-11)
    floor.angle = None
    turned = asm.play(scene, scene.solve(), asm.Measure(floor, "angle"))
    # It turns until its diagonal is as wide as the pocket: 10 sin a + 6 cos a = 6.5.
    most = asin(6.5 / hypot(10.0, 6.0)) - atan2(6.0, 10.0)
    assert [turned.least.value, turned.most.value] == pytest.approx([-most, most], abs=1e-10)


def test_a_plate_on_two_pins():
    # Pins of radius 3 in holes of 3.1, 40 apart: the plate turns, and shifts by 0.1.
    base = asm.Body("base", fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(60, 30, 5, holes=[(-20, 0, 3.1), (20, 0, 3.1)]))
    pins = [
        asm.Body(f"pin {x}", asm.shapes.solid_cylinder(3, 15), position=(x, 0, 0), fixed=True) for x in (-20.0, 20.0)
    ]
    floor = asm.Planar(base, plate, "floor")
    scene = asm.Assembly([base, plate, *pins])
    scene.constrain(floor, asm.Clearance([plate, *pins], exclude=[(pins[0], pins[1])]))
    solution = scene.solve()
    turned = asm.play(scene, solution, asm.Measure(floor, "angle"))
    # The centers of the holes go on a circle of radius 20, by chords of 0.1 at most.
    most = 2.0 * asin(0.05 / 20.0)
    assert turned.most.value == pytest.approx(most, abs=1e-11)
    assert turned.least.value == pytest.approx(-most, abs=1e-11)
    for component in ("x", "y"):
        shift = asm.play(scene, solution, asm.Measure(floor, component))
        assert [shift.least.value, shift.most.value] == pytest.approx([-0.1, 0.1], abs=1e-11)


def test_a_ball_in_a_socket_with_play():
    # A ball of radius 2.9 in half a sphere of radius 3: its center is within 0.1 of that of the socket, and is kept
    # 0.05 below it.
    cup = asm.Body("cup", socket(3.0, 6.0, 6.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(2.9), position=(0.02, 0.01, -0.05))
    scene = asm.Assembly([cup, ball])
    scene.constrain(asm.Clearance(), asm.PointOnPlane(ball.point(0, 0, 0), cup.frame((0, 0, -0.05))))
    found = asm.play(scene, scene.solve(), asm.Measure(ball, "x"))
    most = sqrt(0.1**2 - 0.05**2)
    assert [found.least.value, found.most.value] == pytest.approx([-most, most], abs=1e-10)


def test_what_is_refused():
    scene, tip = loose_pin()
    solution, x = scene.solve(), asm.Measure(tip, "x")
    with pytest.raises(TypeError, match="expected a Measure"):
        asm.play(scene, solution, tip)
    with pytest.raises(TypeError, match="expected a Solution"):
        asm.play(scene, solution.q, x)
    with pytest.raises(InputError, match="of another scene"):
        asm.play(asm.Assembly([asm.Body("a"), asm.Body("b")]), solution, x)
    with pytest.raises(InputError, match="expected a place, a distance or a coordinate"):
        asm.play(scene, solution, asm.Measure("objective"))
    with pytest.raises(InputError, match="fixed bodies alone"):
        asm.play(scene, solution, asm.Measure(scene.bodies[0], "x"))


@pytest.mark.parametrize("limits", [(-3.0, 3.5), (-4.0, 4.0), (0.0, 7.0), (-10.0, 9.0)])
def test_a_hinge_turns_from_stop_to_stop(limits):
    """Poses do not tell how often it turned: every solve on the way starts near the angle of the one before."""
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    scene = asm.Assembly([ground, arm])
    hinge = asm.Revolute(ground, arm, "hinge", limits=limits)
    scene.constrain(hinge)
    found = asm.play(scene, scene.solve(), asm.Measure(hinge))
    assert found.success, found
    assert (found.least.value, found.most.value) == pytest.approx(limits, abs=1e-9)
