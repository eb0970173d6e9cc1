"""Branches under clearances: contacts that come and go, or block the branch, where closed forms say so."""

from __future__ import annotations

from importlib.util import find_spec
from math import asin, cos, hypot, pi, sin, sqrt

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from benchmarks.planar_four_bars import FourBar
from tests.studies.scenes import lifted_block, swinging_arm

CRANK_ROCKER = (1.0, 3.0, 2.5, 3.2)
HALF_WIDTH, RADIUS = 0.1, 0.15


MEETS_POST = 0.5 * pi - asin(0.15)


@pytest.mark.parametrize("swept", [False, True])
def test_an_arm_is_blocked_by_a_post(swept):
    scene, drive = swinging_arm()
    branch = asm.follow(scene, asm.Parameter(drive, "angle"), -0.3, 3.0, swept=swept)
    assert branch.ends == ("end of range", "blocked")
    blocked = branch.events[-1]
    assert (blocked.kind, blocked.name, blocked.bodies) == ("contact closed", "clearance", ("arm", "post"))
    assert blocked.value == pytest.approx(MEETS_POST, abs=1e-12) and blocked.row == len(branch.values) - 1
    # On the post, at a right angle to the arm.
    place = [0.1 * sin(MEETS_POST), 1.0 - 0.1 * cos(MEETS_POST)]
    np.testing.assert_allclose(blocked.place[:2], place, rtol=0, atol=1e-12)
    assert branch.proved.all() and branch.table.dtype.names == ("drive.angle", "length", "proved")
    assert branch.table["proved"].all()
    # What is swept is off the straight ways that are proven by 1e-4 of the size at most.
    assert 0.0 <= branch.depth <= 3e-4 if swept else np.isnan(branch.depth)
    assert drive.angle == 0.0


@pytest.mark.parametrize("before", [0.0, 1e-10])
def test_a_branch_that_begins_where_it_is_blocked_goes_the_other_way(before):
    scene, drive = swinging_arm()
    drive.angle = MEETS_POST - before
    branch = asm.follow(scene, asm.Parameter(drive, "angle"), -0.3, 3.0)
    assert branch.ends == ("end of range", "blocked") and len(branch.values) > 5
    assert branch.values[-1] == pytest.approx(MEETS_POST, abs=1e-14) and branch.values[0] == -0.3
    assert branch.proved.all()


class BlockedFourBar:
    """A crank-rocker with a thick coupler, and a post that it meets at a crank's angle, or is so far beyond that."""

    def __init__(self, meets, beyond=0.0):
        at = FourBar(*CRANK_ROCKER, angle=meets).q[2]
        self.post = at[:3] + rotation_matrix(at[3:]) @ [1.4, HALF_WIDTH + RADIUS + beyond, 0.0]
        crank, coupler, rocker, ground = CRANK_ROCKER
        base, first, third = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rocker")
        second = asm.Body("coupler", asm.shapes.box(coupler, 2.0 * HALF_WIDTH, 0.2))
        post = asm.Body("post", asm.shapes.solid_cylinder(RADIUS, 1.0), position=tuple(self.post), fixed=True)
        half = 0.5 * coupler
        self.drive = asm.Revolute(base, first, "crank", angle=0.7)
        self.hinges = [
            self.drive,
            asm.Revolute(first.frame(at=(crank, 0, 0)), second.frame(at=(-half, 0, 0)), "pin"),
            asm.Revolute(second.frame(at=(half, 0, 0)), third.frame(at=(rocker, 0, 0)), "wrist"),
            asm.Revolute(base.frame(at=(ground, 0, 0)), third, "rocker"),
        ]
        self.scene = asm.Assembly([base, first, second, third, post])
        self.scene.constrain(*self.hinges, asm.Clearance())
        bar = FourBar(*CRANK_ROCKER)
        self.q = np.vstack([bar.q, [*self.post, 1, 0, 0, 0]])
        self.q[2, :3] += rotation_matrix(self.q[2, 3:]) @ [half, 0, 0]

    def gap(self, angle):
        """How far coupler and post are apart, as long as the post is beside the coupler."""
        at = FourBar(*CRANK_ROCKER, angle=angle).q[2]
        along, across, _ = rotation_matrix(at[3:]).T @ (self.post - at[:3])
        assert 0.0 < along < CRANK_ROCKER[1]
        return abs(across) - HALF_WIDTH - RADIUS

    def apart(self, branch):
        """How far hinges come apart at the points of a branch, at most."""
        worst = 0.0
        for q in branch.poses:
            for joint in self.hinges:
                places = []
                for frame in (joint.frame_a, joint.frame_b):
                    row = q[self.scene.bodies.index(frame.body)]
                    places.append(row[:3] + rotation_matrix(row[3:]) @ frame.origin)
                worst = max(worst, float(np.abs(places[0] - places[1]).max()))
        return worst


def test_a_coupler_meets_a_post_at_a_known_angle():
    bar = BlockedFourBar(meets=1.3)
    start = bar.scene.solve(bar.q)
    rocker = asm.Measure(bar.hinges[-1])
    branch = asm.follow(bar.scene, asm.Parameter(bar.drive, "angle"), -7.0, 7.0, of=rocker, start=start)
    assert branch.ends == ("blocked", "blocked") and not branch.closed
    assert [event.kind for event in branch.events] == ["contact closed", "contact closed"]
    back, ahead = branch.events
    assert ahead.value == pytest.approx(1.3, abs=1e-12)
    assert back.value < 0.7 and abs(bar.gap(back.value)) < 1e-12
    assert all(event.bodies == ("coupler", "post") for event in branch.events)
    assert bar.apart(branch) < 1e-13 and branch.proved.all()
    # Points of the table are proven as solves of them are.
    for k in range(0, len(branch.values), 9):
        bar.drive.angle = branch.values[k]
        solution = bar.scene.solve(branch.poses[k])
        assert solution.proved and np.abs(solution.q - branch.poses[k]).max() < 1e-10


def test_a_four_bar_whose_post_is_out_of_reach_closes_its_loop():
    bar = BlockedFourBar(meets=1.3, beyond=1.0)
    angle = asm.Parameter(bar.drive, "angle")
    branch = asm.follow(bar.scene, angle, -7.0, 7.0, start=bar.scene.solve(bar.q))
    assert branch.closed and branch.closure < 1e-12 and branch.ends == ("closed loop", "closed loop")
    assert branch.proved.all() and bar.apart(branch) < 1e-13
    # Where nothing touches the branch has the bits that it has without the clearance.
    bar.scene.remove("clearance")
    alone = asm.follow(bar.scene, angle, -7.0, 7.0, start=bar.scene.solve(bar.q))
    assert alone.poses.tobytes() == branch.poses.tobytes() and alone.values.tobytes() == branch.values.tobytes()
    assert "proved" not in alone.table.dtype.names and alone.proved.all()


def block_on_plate(height):
    """A block that is guided upward over a plate, and drawn to a height."""
    plate = asm.Body("plate", asm.shapes.box(4, 4, 1), position=(0, 0, -0.5), fixed=True)
    block = asm.Body("block", asm.shapes.box(1, 1, 1), position=(0, 0, 2.0))
    goal = asm.PointDistance(block.point(0, 0, 0), (0, 0, height))
    scene = asm.Assembly([plate, block])
    scene.constrain(asm.Prismatic(plate.frame(), block.frame(), "guide"), asm.Clearance())
    scene.minimize(goal)
    return scene, block, asm.Parameter(goal, "target", "z")


@pytest.mark.parametrize(("height", "kind"), [(2.0, "contact closed"), (-0.5, "contact opened")])
def test_a_slider_comes_to_rest_on_a_plate_and_leaves_it(height, kind):
    """On all four of its corners at once."""
    scene, block, parameter = block_on_plate(height)
    branch = asm.follow(scene, parameter, -1.0, 3.0, of=asm.Measure(block, "z"), swept=True)
    assert [event.kind for event in branch.events] == ["end of range", kind, "end of range"]
    assert branch.events[1].value == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(branch.measures[:, 0], np.maximum(branch.values, 0.5), rtol=0, atol=1e-14)
    assert branch.proved.all() and branch.depth < 1e-12
    assert branch.ends == ("end of range", "end of range")


def test_a_cam_and_its_follower_part_and_meet():
    """The eccentric lifts the block where 1 - 0.4 sin(angle) is above 1.1."""
    scene, shaft, lift = lifted_block(1.1)
    branch = asm.follow(scene, asm.Parameter(shaft, "angle"), -4.0, 4.0, of=asm.Measure(lift))
    meets = asin(-0.25)
    # Kinds are as seen from the start, at 0.3.
    kinds = ["contact opened", "contact closed", "contact closed"]
    assert [event.kind for event in branch.events[1:-1]] == kinds
    angles = [event.value for event in branch.events[1:-1]]
    np.testing.assert_allclose(angles, [-pi - meets, meets, pi - meets], rtol=0, atol=1e-12)
    lifted = np.maximum(1.0 - 0.4 * np.sin(branch.values), 1.1)
    np.testing.assert_allclose(branch.measures[:, 0], lifted, rtol=0, atol=1e-13)
    assert branch.proved.all()


def ball_over_a_box(contact):
    """A ball of radius 0.5 that is drawn down onto a box, and driven along x over its edge at x = 0."""
    box = asm.Body("box", asm.shapes.box(2, 4, 1), position=(-1, 0, -0.5), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(-0.5, 0, 0.5))
    rail, carriage = asm.Body("rail", fixed=True), asm.Body("carriage", position=(-0.5, 0, 0))
    along = {"z": (1, 0, 0), "x": (0, 1, 0)}
    drive = asm.Prismatic(rail.frame(**along), carriage.frame(**along), "drive", slide=-0.5)
    scene = asm.Assembly([rail, box, carriage, ball])
    scene.constrain(drive, asm.Prismatic(carriage.frame(), ball.frame(), "guide"))
    scene.constrain(asm.Contact(box, ball, "touch") if contact else asm.Clearance([box, ball]))
    if not contact:
        scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0, 0, -1.0)))
    return scene, drive, ball


@pytest.mark.parametrize("contact", [True, False])
def test_a_ball_rolls_over_the_edge_of_a_box(contact):
    scene, drive, ball = ball_over_a_box(contact)
    branch = asm.follow(scene, asm.Parameter(drive, "slide"), -1.0, 0.45, of=asm.Measure(ball, "z"))
    assert [event.kind for event in branch.events] == ["end of range", "contact over an edge", "end of range"]
    edge = branch.events[1]
    # A contact leaves an edge by an angle of 1e-9.
    assert edge.value == pytest.approx(0.0, abs=1e-9) and edge.bodies == ("ball", "box")
    np.testing.assert_allclose(edge.place, 0.0, rtol=0, atol=1e-9)
    x = branch.values
    height = np.where(x < 0.0, 0.5, np.sqrt(0.25 - np.maximum(x, 0.0) ** 2))
    np.testing.assert_allclose(branch.measures[:, 0], height, rtol=0, atol=1e-12)
    assert branch.proved.all()


def test_a_block_is_pushed_over_the_edge_of_a_table():
    """Its corners leave the table at -0.5, where edges that cross carry it; from 0 on it tips."""
    table = asm.Body("table", asm.shapes.box(2, 4, 1), position=(-1, 0, -0.5), fixed=True)
    block = asm.Body("block", asm.shapes.box(1, 1, 1), position=(-1, 0, 0.5))
    goal = asm.FrameDistance(block.frame(), asm.Pose((-1, 0, 0.2)))
    scene = asm.Assembly([table, block])
    scene.constrain(asm.Clearance())
    scene.minimize(goal)
    measures = [asm.Measure(block, "x"), asm.Measure(block, "z")]
    branch = asm.follow(scene, asm.Parameter(goal, "target", "x"), -1.2, 0.1, of=measures)
    kinds = [event.kind for event in branch.events]
    assert kinds == ["end of range", "contact over an edge", "contact opened", "end of range"]
    assert branch.events[1].value == pytest.approx(-0.5, abs=1e-9)
    assert branch.events[2].value == pytest.approx(0.0, abs=1e-12)
    flat = branch.values < 1e-12
    np.testing.assert_allclose(branch.measures[flat], np.array([[x, 0.5] for x in branch.values[flat]]), atol=1e-11)
    assert (branch.measures[~flat, 1] < 0.5).all() and branch.proved.all()


def test_a_ball_is_drawn_into_a_corner():
    floor = asm.Body("floor", asm.shapes.box(6, 4, 1), position=(0, 0, -0.5), fixed=True)
    wall = asm.Body("wall", asm.shapes.box(1, 4, 4), position=(1.5, 0, 2), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(-1, 0, 1.5))
    goal = asm.FrameDistance(ball.frame(), asm.Pose((-1, 0, 0.2)))
    scene = asm.Assembly([floor, wall, ball])
    scene.constrain(asm.Clearance(exclude=[(floor, wall)]))
    scene.minimize(goal)
    branch = asm.follow(scene, asm.Parameter(goal, "target", "x"), -2.0, 2.0, of=asm.Measure(ball, "x"))
    (closed,) = branch.events_of("contact closed")
    assert closed.bodies == ("ball", "wall") and closed.value == pytest.approx(0.5, abs=1e-12)
    np.testing.assert_allclose(branch.measures[:, 0], np.minimum(branch.values, 0.5), rtol=0, atol=1e-13)
    np.testing.assert_allclose(closed.place, [1.0, 0.0, 0.5], rtol=0, atol=1e-12)


def test_a_ball_pushes_another_one_to_a_wall():
    """Weights 1 and 1/2 share the way that is left once they touch; at the wall both stand."""
    wall = asm.Body("wall", asm.shapes.box(1, 4, 4), position=(2, 0, 0), fixed=True)
    drawn = asm.Body("drawn", asm.shapes.sphere(0.5), position=(-3, 0, 0))
    pushed = asm.Body("pushed", asm.shapes.sphere(0.5))
    goal = asm.FrameDistance(drawn.frame(), asm.Pose((-3, 0, 0)))
    scene = asm.Assembly([wall, drawn, pushed])
    scene.constrain(asm.Clearance())
    scene.minimize(goal)
    scene.minimize(asm.FrameDistance(pushed.frame(), asm.Pose((0, 0, 0)), weight=0.5))
    measures = [asm.Measure(drawn, "x"), asm.Measure(pushed, "x")]
    branch = asm.follow(scene, asm.Parameter(goal, "target", "x"), -4.0, 3.0, of=measures, swept=True)
    closed = branch.events_of("contact closed")
    assert [event.bodies for event in closed] == [("drawn", "pushed"), ("pushed", "wall")]
    np.testing.assert_allclose([event.value for event in closed], [-1.0, 0.5], rtol=0, atol=1e-12)
    x = branch.values
    first = np.minimum(np.where(x < -1.0, x, (x - 0.5) / 1.5), 0.0)
    second = np.where(x < -1.0, 0.0, first + 1.0)
    np.testing.assert_allclose(branch.measures, np.column_stack([first, second]), rtol=0, atol=1e-12)
    assert branch.proved.all() and branch.depth < 1e-12


def ball_before_a_wall(shape, clearance=None):
    """A ball at 1, driven about 0, and a wall at 2.5."""
    base = asm.Body("base", fixed=True)
    wall = asm.Body("wall", asm.shapes.box(1, 2, 2), position=(3.0, 0, 0), fixed=True)
    ball, arm = asm.Body("ball", shape, position=(1, 0, 0)), asm.Body("arm")
    drive = asm.Revolute(base, arm, "drive", angle=0.3)
    weld = asm.Fixed(arm.frame(at=(1, 0, 0)), ball.frame(), "weld")
    scene = asm.Assembly([base, wall, arm, ball])
    scene.constrain(drive, weld, clearance or asm.Clearance())
    return scene, weld, ball


def test_lengths_radii_and_gaps_end_where_bodies_meet():
    scene, weld, _ = ball_before_a_wall(asm.shapes.sphere(0.2))
    longer = asm.follow(scene, asm.Parameter(weld.frame_a, "origin", "x"), 0.5, 4.0, swept=True)
    assert longer.ends[1] == "blocked" and longer.values[-1] == pytest.approx(2.3 / cos(0.3), abs=1e-12)
    clearance = asm.Clearance(minimum=0.1)
    scene, _, _ = ball_before_a_wall(asm.shapes.sphere(0.2), clearance)
    wider = asm.follow(scene, asm.Parameter(clearance, "minimum"), 0.05, 4.0)
    assert wider.ends[1] == "blocked" and wider.values[-1] == pytest.approx(2.3 - cos(0.3), abs=1e-12)
    with pytest.raises(InputError, match=r"swept is True for clearance.minimum, with which faces or least gaps change"):
        asm.follow(scene, asm.Parameter(clearance, "minimum"), 0.05, 4.0, swept=True)


def test_a_plate_thinner_than_a_step_is_not_jumped_over():
    rail = asm.Body("rail", fixed=True)
    plate = asm.Body("plate", asm.shapes.box(2, 2, 1e-3), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.01), position=(0.1, 0.2, 1.0))
    drive = asm.Prismatic(rail.frame(at=(0.1, 0.2, 0)), ball.frame(), "drive", slide=1.0)
    scene = asm.Assembly([rail, plate, ball])
    scene.constrain(drive, asm.Clearance())
    angle = asm.Parameter(drive, "slide")
    branch = asm.follow(scene, angle, -1.0, 2.0, largest_step=1.0, first_step=0.5)
    assert branch.ends == ("blocked", "end of range")
    assert branch.values[0] == pytest.approx(0.0105, abs=1e-14)


@pytest.mark.parametrize(
    ("round_body", "height", "is_proved"),
    [
        (asm.shapes.sphere(0.5), 0.5, True),
        # What the loop holds is told, and not proven of what is no elementary surface.
        (asm.shapes.ellipsoid(0.5, 0.5, 0.6), 0.6, False),
    ],
    ids=["ball", "ellipsoid"],
)
def test_what_touches_all_around_is_told_by_rows(round_body, height, is_proved):
    """A ball on the rim of a hole: its middle is sqrt(0.5^2 - 0.35^2) above the rim then."""
    rail = asm.Body("rail", fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(2, 2, 0.2, [(0, 0, 0.35)]), fixed=True)
    ball = asm.Body("ball", round_body, position=(0, 0, 1.0))
    drive = asm.Prismatic(rail.frame(), ball.frame(), "drive", slide=1.0)
    scene = asm.Assembly([rail, plate, ball])
    scene.constrain(drive, asm.Clearance())
    branch = asm.follow(scene, asm.Parameter(drive, "slide"), 0.0, 1.1)
    assert branch.ends == ("blocked", "end of range")
    assert branch.values[0] == pytest.approx(0.1 + height * sqrt(1.0 - 0.7**2), abs=1e-12)
    assert hypot(*branch.events[0].place[:2]) == pytest.approx(0.35, abs=1e-12)
    assert branch.proved[0] == is_proved and branch.proved[1:].all()
    if find_spec("matplotlib"):
        labels = {text.get_text() for text in branch.plot().axes[0].get_legend().get_texts()}
        assert labels == {"contact closed", "end of range"} | (set() if is_proved else {"not proved"})


def test_a_ring_let_down_on_a_ball_meets_it_exactly_and_that_is_proven():
    """Its circle is sqrt(0.6^2 - 0.4^2) above the ball's center then; contacts keep their points along a step."""
    rail, ball = asm.Body("rail", fixed=True), asm.Body("ball", asm.shapes.sphere(0.5), fixed=True)
    ring = asm.Body("ring", asm.shapes.torus(0.4, 0.1), position=(0, 0, 0.6))
    drive = asm.Prismatic(rail.frame(), ring.frame(), "drive", slide=0.6)
    scene = asm.Assembly([rail, ball, ring])
    scene.constrain(drive, asm.Clearance())
    branch = asm.follow(scene, asm.Parameter(drive, "slide"), 0.0, 0.7)
    assert branch.ends == ("blocked", "end of range") and branch.proved.all()
    assert branch.values[0] == pytest.approx(sqrt(0.6**2 - 0.4**2), rel=0, abs=1e-12)


def test_the_same_again_whatever_was_solved_before():
    scene, drive = swinging_arm()
    angle = asm.Parameter(drive, "angle")
    first = asm.follow(scene, angle, -0.3, 3.0)
    drive.angle = 1.0
    scene.solve()
    drive.angle = 0.0
    again = asm.follow(scene, angle, -0.3, 3.0)
    assert first.poses.tobytes() == again.poses.tobytes() and first.lengths.tobytes() == again.lengths.tobytes()


def test_what_is_told_and_refused():
    scene, drive = swinging_arm()
    angle = asm.Parameter(drive, "angle")
    branch = asm.follow(scene, angle, -0.3, 3.0, of=asm.Measure(drive))
    assert "contact closed of clearance, arm and post near (0.09887, 0.985" in str(branch)
    assert str(branch).splitlines()[-1].startswith("  contact closed") and branch.events[0].bodies == ()
    with pytest.raises(TypeError, match="swept is 'yes'; expected True or False"):
        asm.follow(scene, angle, -0.3, 3.0, swept="yes")
    drive.angle = MEETS_POST + 0.05
    with pytest.raises(InputError, match="start is STALLED at drive.angle = .* not clear: post and arm"):
        asm.follow(scene, angle, -0.3, 3.0, start=scene.solve())
    drive.angle = 0.0
    other, _ = swinging_arm()
    with pytest.raises(InputError, match="is of another scene"):
        asm.follow(other, angle, -0.3, 3.0)
