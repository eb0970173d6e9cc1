"""Solves that go on from a solution and ask for their way end where bodies are in the way.

Judged by closed forms. The way is known to 2^-20 of it, and what stands at its end is open by less than it goes in so
much; points of bodies are off the straight way of a step by 1e-4 of the size at most, but at the ends of steps, where
the pose is one that the joints allow, by nothing.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.studies import swept_solve

RESOLUTION = 2.0**-20
ALONG_X = {"z": (1.0, 0.0, 0.0)}
TIPPED = (np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0)


def through_a_plate():
    """A pin of half length 0.25 that is driven along z, a plate with its face at 5e-4 in its way."""
    rail = asm.Body("rail", fixed=True)
    plate = asm.Body("plate", asm.shapes.box(2.0, 2.0, 1e-3), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(0.1, 0.5), position=(0.1, 0.2, 1.0))
    drive = asm.Prismatic(rail.frame(at=(0.1, 0.2, 0.0)), pin.frame(), "drive", slide=1.0)
    scene = asm.Assembly([rail, plate, pin])
    scene.constrain(drive, asm.Clearance())
    return scene, drive


def turning(obstacle, arm, at=(0.0, 0.0, 0.0)):
    """A body that is driven about the z axis, which goes through `at` on it, and an obstacle that stands."""
    base = asm.Body("base", fixed=True)
    drive = asm.Revolute(base.frame(), arm.frame(at=at), "drive", angle=0.0)
    scene = asm.Assembly([base, obstacle, arm])
    scene.constrain(drive, asm.Clearance())
    return scene, drive


def past_a_post():
    """An arm of half width 0.05 and a post of radius 0.1, which it meets at a right angle less asin(0.15)."""
    post = asm.Body("post", asm.shapes.solid_cylinder(0.1, 1.0), position=(0.0, 1.0, 0.0), fixed=True)
    arm = asm.Body("arm", asm.shapes.box(1.4, 0.1, 0.2), position=(0.6, 0.0, 0.0))
    return turning(post, arm, (-0.6, 0.0, 0.0))


MEETS_POST = 0.5 * np.pi - np.arcsin(0.15)


def test_a_pin_does_not_jump_over_a_thin_plate():
    scene, drive = through_a_plate()
    start = scene.solve()
    drive.slide = -1.0
    jumped = scene.solve(start)
    assert jumped.success and jumped.way is None and jumped.q[2, 2] == pytest.approx(-1.0, abs=1e-12)
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and not blocked.success and not blocked.proved
    assert 0.0 <= blocked.q[2, 2] - (0.25 + 5e-4) <= 2.0 * RESOLUTION
    # It is a pose of the mechanism, with the drive at a part of its way.
    assert blocked.feasibility < 1e-11 and blocked.pose_error < 1e-11
    assert blocked.way.part == pytest.approx((1.0 - blocked.q[2, 2]) / 2.0, abs=1e-12)
    assert blocked.way.obstacles == (("plate", "pin"),)
    assert np.hypot(*(blocked.way.place[:2] - (0.1, 0.2))) <= 0.1 + 1e-9
    assert blocked.way.place[2] == pytest.approx(5e-4, abs=5e-6)
    assert "plate and pin in each other's way near" in blocked.message
    # What the user asked for is asked for still.
    assert drive.slide == -1.0 and scene.solve(start).q.tobytes() == jumped.q.tobytes()


@pytest.mark.parametrize("part", [asm.shapes.sphere(0.3), asm.shapes.solid_cylinder(0.349, 0.6)])
def test_contacts_that_need_more_places_on_the_way_hinder_nothing(part):
    """On the axis of a hole all of its rim is as near: solves there are packed anew, with other places in states."""
    rail = asm.Body("rail", fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(2.0, 2.0, 0.2, [(0.0, 0.0, 0.35)]), fixed=True)
    body = asm.Body("part", part, position=(0.0, 0.0, 1.0))
    drive = asm.Prismatic(rail.frame(), body.frame(), "drive", slide=1.0)
    scene = asm.Assembly([rail, plate, body])
    scene.constrain(drive, asm.Clearance())
    start = scene.solve()
    drive.slide = -1.0
    through = scene.solve(start, swept=True)
    assert through.success and through.proved and through.way.part == 1.0
    assert through.q[2, 2] == pytest.approx(-1.0, abs=1e-12)
    assert scene.packed().clearance_rows > start._packed.clearance_rows


def test_a_ball_stops_on_the_rim_of_a_hole():
    """All around: its middle is then sqrt(0.5^2 - 0.3^2) above the rim."""
    rail = asm.Body("rail", fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(2.0, 2.0, 0.2, [(0.0, 0.0, 0.3)]), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(0.0, 0.0, 1.0))
    drive = asm.Prismatic(rail.frame(), ball.frame(), "drive", slide=1.0)
    scene = asm.Assembly([rail, plate, ball])
    scene.constrain(drive, asm.Clearance())
    start = scene.solve()
    drive.slide = -1.0
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("plate", "ball"),)
    assert 0.0 <= blocked.q[2, 2] - (0.1 + 0.4) <= 4.0 * RESOLUTION
    assert np.hypot(*blocked.way.place[:2]) == pytest.approx(0.3, abs=1e-4)


def test_what_cannot_be_reached_either_is_blocked_before():
    scene, drive = through_a_plate()
    start = scene.solve()
    drive.slide = 0.0
    assert not scene.solve(start).success
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("plate", "pin"),)
    assert 0.0 <= blocked.q[2, 2] - (0.25 + 5e-4) <= RESOLUTION


def test_an_arm_past_a_post():
    scene, drive = past_a_post()
    start = scene.solve()
    drive.angle = 2.8
    assert scene.solve(start).success
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("post", "arm"),)
    assert -2.8 * 2.0 * RESOLUTION <= blocked.values["drive.angle"] - MEETS_POST <= 1e-9
    # The way the other side is free, and so is the one back.
    drive.angle = MEETS_POST - 2.0 * np.pi + 0.3
    assert scene.solve(start, swept=True).status is asm.Status.BLOCKED
    drive.angle = 1.4
    assert scene.solve(blocked, swept=True).success
    # A way that goes on from a blocked one ends there as well.
    drive.angle = 2.8
    again = scene.solve(blocked, swept=True)
    assert again.status is asm.Status.BLOCKED and again.way.part <= 2.0 * RESOLUTION
    assert again is not blocked and blocked.way.part > 0.5


@pytest.mark.parametrize("angle", [1.2, -2.8])
def test_a_clear_way_ends_with_the_same_bits(angle):
    scene, drive = past_a_post()
    start = scene.solve()
    drive.angle = angle
    direct, swept = scene.solve(start), scene.solve(start, swept=True)
    assert swept.status is asm.Status.SOLVED and swept.proved and swept.q.tobytes() == direct.q.tobytes()
    assert swept.way.part == 1.0 and swept.way.obstacles == () and swept.way.reason == ""
    assert 0.0 < swept.way.depth <= 1e-4 * 1.42  # the arm's diagonal


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.0])
def test_an_obstacle_between_poses_that_are_alike(turns):
    """After half a turn the bar is the same set of points as before; after two turns it is so in the middle, too."""
    peg = asm.Body("peg", asm.shapes.solid_cylinder(0.02, 1.0), position=(0.0, 0.5, 0.0), fixed=True)
    scene, drive = turning(peg, asm.Body("bar", asm.shapes.box(2.0, 0.05, 0.05)))
    start = scene.solve()
    drive.angle = 2.0 * np.pi * turns
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED
    off = blocked.values["drive.angle"] - (0.5 * np.pi - np.arcsin(0.045 / 0.5))
    assert -2.0 * drive.angle * RESOLUTION <= off <= 1e-9


def test_an_obstacle_between_the_arc_and_its_chord():
    """A ball on a circle of radius 1 meets one on it; the chord of the arc is 0.0064 off there, three radii."""
    peg = asm.Body("peg", asm.shapes.sphere(0.002), position=(np.cos(0.08), np.sin(0.08), 0.0), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.002), position=(1.0, 0.0, 0.0))
    scene, drive = turning(peg, ball, (-1.0, 0.0, 0.0))
    start = scene.solve()
    drive.angle = 0.24
    assert scene.solve(start).success
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED
    off = blocked.values["drive.angle"] - (0.08 - 2.0 * np.arcsin(0.002))
    assert -0.5 * RESOLUTION <= off <= 1e-9


def four_bar(post):
    """Crank 1, coupler 3, rocker 2.5 on a ground of 3, of thin bars one above the other; a post in the coupler's plane.

    Also returns the joint of the crank and the distance of the post's axis from the coupler's middle line, by the
    angle of the crank.
    """

    def joints(angle):
        a = np.array([np.cos(angle), np.sin(angle)])
        way = np.array([3.0, 0.0]) - a
        length = np.linalg.norm(way)
        along = (9.0 - 6.25 + length * length) / (2.0 * length)
        return a, a + (along * way + np.sqrt(9.0 - along * along) * np.array([-way[1], way[0]])) / length

    def bar(name, a, b, z):
        (x, y), angle = 0.5 * (a + b), np.arctan2(*(b - a)[::-1])
        shape = asm.shapes.box(float(np.linalg.norm(b - a)), 0.02, 0.02)
        return asm.Body(name, shape, (x, y, z), (np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)))

    a, b = joints(0.3)
    base, end = asm.Body("base", fixed=True), np.array([3.0, 0.0])
    crank, coupler = bar("crank", np.zeros(2), a, 0.0), bar("coupler", a, b, 0.1)
    rocker = bar("rocker", end, b, 0.2)
    peg = asm.Body("peg", asm.shapes.solid_cylinder(0.01, 0.06), position=(*post, 0.1), fixed=True)
    drive = asm.Revolute(base.frame(), crank.frame(at=(-0.5, 0.0, 0.0)), "drive", angle=0.3)
    scene = asm.Assembly([base, crank, coupler, rocker, peg])
    scene.constrain(
        drive,
        asm.Revolute(crank.frame(at=(0.5, 0.0, 0.1)), coupler.frame(at=(-1.5, 0.0, 0.0))),
        asm.Revolute(coupler.frame(at=(1.5, 0.0, 0.1)), rocker.frame(at=(1.25, 0.0, 0.0))),
        asm.Revolute(base.frame(at=(3.0, 0.0, 0.2)), rocker.frame(at=(-1.25, 0.0, 0.0))),
        asm.Clearance(),
    )

    def distance(angle):
        a, b = joints(angle)
        x, y = (b - a) / 3.0
        return abs(x * (post[1] - a[1]) - y * (post[0] - a[0]))

    return scene, drive, distance


def test_a_linkage_of_thin_bars():
    scene, drive, distance = four_bar((0.9, 1.4))
    start = scene.solve()
    drive.angle = 0.3 + 2.0 * np.pi
    assert scene.solve(start).success
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("coupler", "peg"),)
    # The distance falls to both radii, and not before.
    there = blocked.values["drive.angle"]
    assert 0.02 - 1e-9 <= distance(there) <= 0.02 + 4.0 * drive.angle * RESOLUTION
    assert all(distance(angle) > 0.02 for angle in np.linspace(0.3, there, 2000))


def test_a_linkage_that_is_free(cases):
    scene, drive, _ = four_bar((1.5, 6.0))
    start = scene.solve()
    drive.angle = 0.3 + cases(1.0, 2.0) * np.pi
    direct, swept = scene.solve(start), scene.solve(start, swept=True)
    assert swept.success and swept.proved and swept.q.tobytes() == direct.q.tobytes()


def test_joints_may_be_in_the_way():
    """A crank of 2 whose rod of 1 ends on a line through its pivot turns by asin(1 / 2); no body is in its way."""
    base = asm.Body("base", fixed=True)
    far = asm.Body("far", asm.shapes.box(1.0, 1.0, 1.0), position=(0.0, 9.0, 0.0), fixed=True)
    crank, rod = asm.Body("crank", asm.shapes.box(2.0, 0.1, 0.1), position=(1.0, 0.0, 0.0)), asm.Body("rod")
    drive = asm.Revolute(base.frame(), crank.frame(at=(-1.0, 0.0, 0.0)), "drive", angle=0.0)
    rod.pose = asm.Pose((2.0, 0.0, 0.0))
    scene = asm.Assembly([base, far, crank, rod])
    scene.constrain(
        drive,
        asm.Revolute(crank.frame(at=(1.0, 0.0, 0.0)), rod.frame()),
        asm.PointOnPlane(rod.point(1.0, 0.0, 0.0), base.frame(z=(0.0, 1.0, 0.0))),
        asm.Clearance(),
    )
    start = scene.solve()
    drive.angle = 1.0
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == ()
    assert blocked.way.reason.startswith("a solve beyond is") and np.isnan(blocked.way.place).all()
    # At the dead center a residual of 2e-13 is an angle of its root.
    assert blocked.values["drive.angle"] == pytest.approx(np.pi / 6.0, abs=2e-6)


def on_a_plate(body, height):
    """A body that lies on a plate and is driven along x."""
    base = asm.Body("base", fixed=True)
    plate = asm.Body("plate", asm.shapes.box(4.0, 2.0, 0.2), fixed=True)
    joint = asm.Prismatic(base.frame(at=(0.0, 0.0, height), **ALONG_X), body.frame(**ALONG_X), "drive", slide=-1.0)
    scene = asm.Assembly([base, plate, body])
    scene.constrain(joint, asm.Clearance())
    return scene, joint


@pytest.mark.parametrize("shape", [asm.shapes.box(0.5, 0.4, 0.3), asm.shapes.sphere(0.15)], ids=["box", "ball"])
def test_what_only_touches_is_not_in_the_way(shape):
    scene, drive = on_a_plate(asm.Body("slider", shape, position=(-1.0, 0.0, 0.25)), 0.25)
    start = scene.solve()
    drive.slide = 1.0
    direct, swept = scene.solve(start), scene.solve(start, swept=True)
    assert swept.success and swept.proved and swept.q.tobytes() == direct.q.tobytes()


def test_what_is_only_touched_is_not_told_of():
    """A box that slides on a plate comes to a step on it: the plate is not in its way."""
    base = asm.Body("base", fixed=True)
    plate = asm.Body("plate", asm.shapes.box(4.0, 2.0, 0.2), fixed=True)
    step = asm.Body("step", asm.shapes.box(0.2, 2.0, 0.1), position=(1.1, 0.0, 0.15), fixed=True)
    box = asm.Body("box", asm.shapes.box(0.5, 0.4, 0.3), position=(0.0, 0.0, 0.25))
    drive = asm.Prismatic(base.frame(at=(0.0, 0.0, 0.25), **ALONG_X), box.frame(**ALONG_X), "drive", slide=0.0)
    scene = asm.Assembly([base, plate, step, box])
    scene.constrain(drive, asm.Clearance())
    start = scene.solve()
    drive.slide = 1.8
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("step", "box"),)
    assert -1.8 * 2.0 * RESOLUTION <= blocked.values["drive.slide"] - 0.75 <= 1e-8


def test_two_that_are_in_the_way_at_once():
    """Without the one it is the other one that stops the bar: both are told of."""
    base = asm.Body("base", fixed=True)
    left, right = (
        asm.Body(name, asm.shapes.solid_cylinder(0.1, 1.0), position=(x, 1.0, 0.0), fixed=True)
        for name, x in (("left", -0.6), ("right", 0.6))
    )
    bar = asm.Body("bar", asm.shapes.box(2.0, 0.2, 0.2))
    y = (0.0, 1.0, 0.0)
    drive = asm.Prismatic(base.frame(z=y), bar.frame(z=y), "drive", slide=0.0)
    scene = asm.Assembly([base, left, right, bar])
    scene.constrain(drive, asm.Clearance())
    start = scene.solve()
    drive.slide = 2.0
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("left", "bar"), ("right", "bar"))
    assert -2.0 * 2.0 * RESOLUTION <= blocked.values["drive.slide"] - 0.8 <= 1e-8


def test_a_wheel_that_rolls():
    """Poses between two steps go in by the square of the step, which is no more than is allowed of all ways."""
    wheel = asm.Body("wheel", asm.shapes.solid_cylinder(0.15, 0.1), position=(-1.0, 0.0, 0.25), quaternion=TIPPED)
    base = asm.Body("base", fixed=True)
    plate = asm.Body("plate", asm.shapes.box(4.0, 2.0, 0.2), fixed=True)
    carrier = asm.Body("carrier", position=(-1.0, 0.0, 0.25))
    slide = asm.Prismatic(base.frame(at=(0.0, 0.0, 0.25), **ALONG_X), carrier.frame(**ALONG_X), "slide", slide=-1.0)
    turn = asm.Revolute(carrier.frame(z=(0.0, -1.0, 0.0)), wheel.frame(), "turn")
    rack = asm.RackPinion(turn.freedom("angle"), slide.freedom("slide"), radius=0.15, offset=-1.0)
    scene = asm.Assembly([base, plate, carrier, wheel])
    scene.constrain(slide, turn, rack, asm.Clearance())
    start = scene.solve()
    assert start.success
    slide.slide = 0.0
    swept = scene.solve(start, swept=True)
    assert swept.success and abs(swept.values["turn.angle"] - start.values["turn.angle"]) == pytest.approx(1.0 / 0.15)
    assert swept.way.depth <= 1e-4 * scene.packed().scale


def test_what_is_pushed_gives_way_until_it_cannot():
    """A ball of radius 0.1 pushes a block of 0.5, on a rail, against a wall at 2.95."""
    base = asm.Body("base", fixed=True)
    wall = asm.Body("wall", asm.shapes.box(0.1, 2.0, 2.0), position=(3.0, 0.0, 0.0), fixed=True)
    block = asm.Body("block", asm.shapes.box(0.5, 0.5, 0.5))
    ball = asm.Body("ball", asm.shapes.sphere(0.1), position=(-2.0, 0.0, 0.0))
    drive = asm.Prismatic(base.frame(**ALONG_X), ball.frame(**ALONG_X), "drive", slide=-2.0)
    scene = asm.Assembly([base, wall, block, ball])
    scene.constrain(drive, asm.Prismatic(base.frame(**ALONG_X), block.frame(**ALONG_X), "rail"), asm.Clearance())
    start = scene.solve()
    drive.slide = 1.0
    pushed = scene.solve(start, swept=True)
    assert pushed.success and pushed.q[2, 0] == pytest.approx(1.35, abs=1e-8)
    drive.slide = 3.5
    blocked = scene.solve(pushed, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("wall", "block"), ("block", "ball"))
    assert -2.5 * 2.0 * RESOLUTION <= blocked.values["drive.slide"] - (2.95 - 0.5 - 0.1) <= 1e-8


def geared(ratio=7.0):
    """A bar that a gear turns seven times as fast, or more, and a peg at a right angle less asin(0.045 / 0.4)."""
    base = asm.Body("base", fixed=True)
    wheel = asm.Body("wheel")
    bar = asm.Body("bar", asm.shapes.box(1.0, 0.05, 0.05), position=(3.0, 0.0, 0.0))
    peg = asm.Body("peg", asm.shapes.solid_cylinder(0.02, 1.0), position=(3.0, 0.4, 0.0), fixed=True)
    drive = asm.Revolute(base.frame(), wheel.frame(), "drive", angle=0.0)
    driven = asm.Revolute(base.frame(at=(3.0, 0.0, 0.0)), bar.frame(), "driven")
    gear = asm.Gear(drive.freedom("angle"), driven.freedom("angle"), ratio=ratio)
    scene = asm.Assembly([base, wheel, bar, peg])
    scene.constrain(drive, driven, gear, asm.Clearance())
    return scene, drive, gear


@pytest.mark.parametrize("moved", ["angle", "offset", "limits"])
def test_all_that_may_change_between_solves_goes_along(moved):
    """The bar has turned three times where it is asked to go, and is stopped in the first quarter."""
    scene, drive, gear = geared()
    if moved == "limits":
        drive.angle, drive.freedom("angle").limits = None, (-0.1, 5.0)
    start = scene.solve()
    if moved == "angle":
        drive.angle = 6.0 * np.pi / 7.0
    elif moved == "offset":
        gear.offset = 6.0 * np.pi
    else:
        drive.freedom("angle").limits = (1.0, 6.0)
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == (("bar", "peg"),)
    off = blocked.values["driven.angle"] - (0.5 * np.pi - np.arcsin(0.045 / 0.4))
    assert -40.0 * RESOLUTION <= off <= 1e-8
    if moved == "limits":
        assert drive.freedom("angle").limits == (1.0, 6.0)


def test_poses_that_are_alike_at_every_step():
    """A bar that turns 64 times as fast, and twice around in the longest step of what drives it."""
    scene, drive, _ = geared(64.0)
    start = scene.solve()
    drive.angle = np.pi / 16.0
    blocked = scene.solve(start, swept=True)
    assert blocked.status is asm.Status.BLOCKED
    off = blocked.values["driven.angle"] - (0.5 * np.pi - np.arcsin(0.045 / 0.4))
    assert -8.0 * np.pi * RESOLUTION <= off <= 1e-8


def aimed(shape, target):
    """A body whose frame is drawn to a pose, under a peg."""
    peg = asm.Body("peg", asm.shapes.solid_cylinder(0.02, 1.0), position=(0.0, 0.4, 0.0), fixed=True)
    body = asm.Body("body", shape)
    goal = asm.FrameDistance(body.frame(), target)
    scene = asm.Assembly([peg, body])
    scene.constrain(asm.Clearance())
    scene.minimize(goal)
    return scene, goal


def test_targets_go_along_the_shorter_turn():
    """The frame's target turns by 200 degrees: by 160 the other side around, where nothing is in the way."""
    scene, goal = aimed(asm.shapes.box(0.3, 0.05, 0.05), asm.Pose((0.0, 0.0, 0.0)))
    start = scene.solve()
    half = np.radians(100.0)
    goal.target = asm.Pose((0.2, -0.1, 0.0), (np.cos(half), 0.0, 0.0, np.sin(half)))
    direct, swept = scene.solve(start), scene.solve(start, swept=True)
    assert swept.success and swept.way.part == 1.0
    assert swept.q == pytest.approx(direct.q, abs=1e-9)
    assert goal.target.q.tolist() == [0.2, -0.1, 0.0, *goal.target.quaternion]


def test_a_pose_that_jumps_has_no_way():
    """A ball that a target under a sheet draws along its upper side falls from its edge."""
    sheet = asm.Body("sheet", asm.shapes.box(2.0, 2.0, 1e-3), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.1), position=(0.5, 0.0, 0.2))
    goal = asm.PointDistance(ball.point(0, 0, 0), target=(0.5, 0.0, -0.5))
    scene = asm.Assembly([sheet, ball])
    scene.constrain(asm.Clearance())
    scene.minimize(goal)
    start = scene.solve()
    assert start.q[1, 2] == pytest.approx(0.1005, abs=1e-8)
    goal.target = (2.0, 0.0, -0.5)
    fallen, blocked = scene.solve(start), scene.solve(start, swept=True)
    assert fallen.success and fallen.q[1, :3] == pytest.approx((2.0, 0.0, -0.5), abs=1e-8)
    assert blocked.status is asm.Status.BLOCKED and blocked.way.obstacles == ()
    assert blocked.way.reason == "the pose jumps" and blocked.q[1, 0] == pytest.approx(1.0, abs=1e-5)
    assert goal.target.tolist() == [2.0, 0.0, -0.5]


def test_nothing_to_do():
    scene, _ = past_a_post()
    start = scene.solve()
    swept = scene.solve(start, swept=True)
    assert swept.success and swept.proved and swept.q.tobytes() == start.q.tobytes() and start.way is None


def test_the_same_scene_has_the_same_way():
    found = []
    for _ in range(2):
        scene, drive = past_a_post()
        start = scene.solve()
        drive.angle = 2.8
        found.append(scene.solve(start, swept=True))
    assert found[0].q.tobytes() == found[1].q.tobytes()
    assert found[0].way.part == found[1].way.part and found[0].way.depth == found[1].way.depth


class Interrupted(Exception):
    pass


def test_interruptions_leave_the_scene_as_it_was_asked_for(monkeypatch):
    scene, drive = past_a_post()
    start = scene.solve()
    drive.angle = 2.8
    over = scene.solve(start, swept=True, time_limit=1e-6)
    assert over.status is asm.Status.TIME_LIMIT and over.way.part < 1.0 and over.q.tobytes() == start.q.tobytes()

    def interrupt(*_):
        raise Interrupted

    monkeypatch.setattr(swept_solve.SeenPoses, "bend", interrupt)
    with pytest.raises(Interrupted):
        scene.solve(start, swept=True)
    assert drive.angle == 2.8 and start.success and start.way is None
    monkeypatch.undo()
    assert scene.solve(start, swept=True).status is asm.Status.BLOCKED


def test_sweeps_mark_where_they_are_blocked():
    """A loop of solves, each from the last, as sweeps are written: it stays where it is blocked until it turns back."""
    scene, drive = past_a_post()
    poses = [scene.solve()]
    for angle in (0.7, 1.3, 1.9, 2.5, 1.3):
        drive.angle = angle
        poses.append(scene.solve(poses[-1], swept=True))
    assert [pose.status.name for pose in poses[1:]] == ["SOLVED", "SOLVED", "BLOCKED", "BLOCKED", "SOLVED"]
    assert poses[4].q == pytest.approx(poses[3].q, abs=4.0 * RESOLUTION)


def test_bad_input():
    scene, drive = past_a_post()
    start = scene.solve()
    for q0 in (None, start.q):
        with pytest.raises(asm.errors.InputError, match="q0 is .* with swept=True; expected a Solution"):
            scene.solve(q0, swept=True)
    with pytest.raises(asm.errors.InputError, match="swept is 1; expected True or False"):
        scene.solve(start, swept=1)
    with pytest.raises(asm.errors.InputError, match="starts is .* with swept=True; expected None"):
        scene.solve(start, swept=True, starts={})
    with pytest.raises(asm.errors.InputError, match="another assembly"):
        past_a_post()[0].solve(start, swept=True)
    drive.angle = 1.5
    crossing = scene.solve(start)
    with pytest.raises(asm.errors.InputError, match=f"q0 is {crossing.status.name} with swept=True"):
        scene.solve(crossing, swept=True)
    bare = asm.Assembly([asm.Body("base", fixed=True), asm.Body("arm", asm.shapes.box(1.0, 1.0, 1.0))])
    with pytest.raises(asm.errors.InputError, match=r"swept is True where no clearance .*; expected one"):
        bare.solve(bare.solve(), swept=True)


def test_a_start_that_touched_by_more_than_is_called_touching():
    """What is in another body by 1e-6 touches in a solve that is told so, and crosses in one that is not."""
    height = 0.25 - 1e-6
    slider = asm.Body("slider", asm.shapes.box(0.5, 0.4, 0.3), position=(-1.0, 0.0, height))
    scene, _ = on_a_plate(slider, height)
    start = scene.solve(touching=1e-5)
    assert start.success
    with pytest.raises(asm.errors.InputError, match="at which plate and slider are not clear"):
        scene.solve(start, swept=True)
