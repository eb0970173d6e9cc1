"""Bodies that nearly fit where a solve begins: they end near, where they fit, and clear by closed forms."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity.clearance.answers import Verdict
from assembly.solve.clearance_proof import lent_proof
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.studies.seated import seated
from tests.proximity.manager.test_contact_place import prism
from tests.studies.machined import bolt, disturbed, moved, socket, turned_part
from tests.validation import exact_solids as exact
from tests.validation.crossing_judge import Motion, least_signed_distance

WAY, ANGLE, TOUCHING = 2.0, np.radians(2.0), 1e-9
HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])


class Fit(NamedTuple):
    """Two bodies that fit: their shapes, where the second one is then, its extents, and how deep it is in the first."""

    shapes: tuple
    home: np.ndarray
    extents: tuple
    depth: object


def rows(pose):
    """The rotation and the place of a pose."""
    return Rotation.from_quat(pose[3:], scalar_first=True), pose[:3]


def depth_in_bore(radius, bore, half):
    """Of a long pin in a hole of a plate: its section with either side of the plate is an ellipse."""

    def depth(pose):
        turn, place = rows(pose)
        angle = np.linspace(0.0, 2.0 * np.pi, 20000)
        points = turn.apply(np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 0.0 * angle])) + place
        along = turn.apply([0.0, 0.0, 1.0])
        ends = [points + ((z - points[:, 2]) / along[2])[:, None] * along for z in (-half, half)]
        return max(np.hypot(end[:, 0], end[:, 1]).max() for end in ends) - bore

    return depth


def depth_of_bolt(radius, bore, half, head):
    """The same, and of the rim of its head in the plate's top."""
    in_bore = depth_in_bore(radius, bore, half)

    def depth(pose):
        turn, place = rows(pose)
        up = turn.apply([0.0, 0.0, 1.0])
        lowest = place[2] - head * np.hypot(up[0], up[1])
        return max(in_bore(pose), half - lowest)

    return depth


def depth_in_socket(radius, cavity):
    """Of a ball: its center is nearer than the radius to half a sphere, or to its rim."""

    def depth(pose):
        x, y, z = pose[:3]
        rho = np.hypot(x, y)
        return radius - (cavity - np.hypot(rho, z) if z <= 0.0 else np.hypot(cavity - rho, z))

    return depth


def depth_in_seat(slope, levels):
    """Of a cone within another one, r = slope z + r0, between two levels of the seat: along lines it is convex."""

    def depth(pose):
        turn, place = rows(pose)
        angle = np.linspace(0.0, 2.0 * np.pi, 20000)
        around = np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
        up, r0 = np.array([0.0, 0.0, 1.0]), 10.0
        base, along = turn.apply(r0 * around) + place, turn.apply(slope * around + up)
        low, high = (np.clip((z - base[:, 2]) / along[:, 2], -7.0, 4.0)[:, None] for z in levels)
        ends = [base + low * along, base + high * along]
        return max((np.hypot(p[:, 0], p[:, 1]) - slope * p[:, 2] - r0).max() for p in ends) / np.hypot(1.0, slope)

    return depth


def depth_of_prism(points, hollow, height):
    """Of corners of a prism that is longer than what it is in: where its edges pass the ends of that."""
    outside = exact.polygon_distance(hollow)

    def depth(pose):
        turn, place = rows(pose)
        base = turn.apply(np.column_stack([points, np.zeros(len(points))])) + place
        along = turn.apply([0.0, 0.0, 1.0])
        ends = [base + ((z - base[:, 2]) / along[2])[:, None] * along for z in (-0.5 * height, 0.5 * height)]
        return float(outside(np.concatenate(ends)[:, :2]).max())

    return depth


@cache
def fits():
    slope = np.tan(np.radians(30.0))
    plate = asm.shapes.plate(80, 40, 10, [(0, 0, 4.5)])
    tight = asm.shapes.plate(80, 40, 10, [(0, 0, 4.02)])
    seat = turned_part([(10 - 8 * slope, -8), (25, -8), (25, 0), (10, 0)])
    plug = turned_part([(0, -7), (10 - 7 * slope, -7), (10 + 4 * slope, 4), (0, 4)])
    # A shaft with a key, in one piece, in a bore with a slot.
    keyed = [(-8.0, -8.0), (8.0, -8.0), (8.0, 8.0), (3.0, 8.0), (3.0, 14.0), (-3.0, 14.0), (-3.0, 8.0), (-8.0, 8.0)]
    wider = [(x + 0.05 * np.sign(x), y + 0.05 * np.sign(y)) for x, y in keyed]
    square = [(-20.0, -20.0), (20.0, -20.0), (20.0, 20.0), (-20.0, 20.0)]

    def curves(points):
        return [asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(points, points[1:] + points[:1], strict=True)]

    hub = asm.shapes.extrusion(curves(square), 12.0, [curves(wider)])
    on_top = np.r_[0.0, 0.0, 5.0, HOME[3:]]
    return {
        "a pin in its hole": Fit(
            (plate, asm.shapes.solid_cylinder(4, 60)), HOME, (8, 8, 60), depth_in_bore(4, 4.5, 5)
        ),
        "a pin with little play": Fit(
            (tight, asm.shapes.solid_cylinder(4, 60)), HOME, (8, 8, 60), depth_in_bore(4, 4.02, 5)
        ),
        "a bolt on its plate": Fit((plate, bolt(4, 30, 6.5, 8)), on_top, (13, 13, 60), depth_of_bolt(4, 4.5, 5, 6.5)),
        "a ball in its socket": Fit(
            (socket(10, 18, 16), asm.shapes.sphere(10)), HOME, (20, 20, 20), depth_in_socket(10, 10)
        ),
        "a cone in its seat": Fit((seat, plug), HOME, (25, 25, 14), depth_in_seat(slope, (-8.0, 0.0))),
        "a key in its slot": Fit((hub, prism(keyed, 60.0)), HOME, (16, 28, 60), depth_of_prism(keyed, wider, 12.0)),
    }  # fmt: skip


def scene_of(fit, pose):
    a = asm.Body("a", fit.shapes[0], fixed=True)
    b = asm.Body("b", fit.shapes[1], position=pose[:3], quaternion=pose[3:])
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance())
    return scene


@pytest.mark.parametrize("kind", ["a pin in its hole", "a pin with little play", "a bolt on its plate",
                                  "a ball in its socket", "a cone in its seat", "a key in its slot"])  # fmt: skip
def test_what_was_disturbed_ends_near_and_clear(kind, cases):
    fit, rng = fits()[kind], np.random.default_rng(3)
    size = float(np.linalg.norm([np.linalg.norm(fit.extents), 90.0]))
    for _ in range(cases(1, 30)):
        start = disturbed(rng, fit.home, WAY, ANGLE)
        scene = scene_of(fit, start)
        q = np.array(scene.q)
        solution = scene.solve()
        assert solution.success, solution.message
        # Samples of the closed forms are off by less.
        assert fit.depth(solution.q[1]) <= TOUCHING * size
        # Where it was before is one place to go to; the least way need not be found, but none that is much longer.
        assert moved(q[1], solution.q[1], fit.extents) <= 1.5 * moved(q[1], fit.home, fit.extents)


@pytest.mark.parametrize("kind", ["a pin in its hole", "a bolt on its plate", "a ball in its socket",
                                  "a cone in its seat"])  # fmt: skip
def test_the_closed_forms_tell_what_crosses(kind):
    fit, rng = fits()[kind], np.random.default_rng(4)
    assert fit.depth(fit.home) <= 1e-12
    assert max(fit.depth(disturbed(rng, fit.home, WAY, ANGLE)) for _ in range(5)) > 0.5


@pytest.mark.parametrize("sunk", [0.6, -0.6])
def test_axes_coincide_and_planes_where_one_is_below(sunk):
    """A bolt that leans in its hole, its head in the plate or over it: it comes out of the plate, and not onto it."""
    fit = fits()["a bolt on its plate"]
    start = disturbed(np.random.default_rng(5), fit.home, 0.0, ANGLE) + np.r_[1.2, 0.9, -sunk, np.zeros(4)]
    scene = scene_of(fit, start)
    q = np.array(scene.q)
    found = seated(scene, q, TOUCHING, CTRL_C).poses
    turn, place = rows(found[1])
    # Joints hold to 1e-12 of some hundred lengths.
    assert turn.apply([0.0, 0.0, 1.0]) == pytest.approx([0.0, 0.0, 1.0], abs=1e-11)
    assert place[:2] == pytest.approx([0.0, 0.0], abs=1e-9)
    assert place[2] == pytest.approx(5.0, abs=1e-9) if sunk > 0.0 else place[2] > 5.1
    assert np.array_equal(found[0], q[0])


def test_it_is_the_same_each_time():
    fit = fits()["a pin with little play"]
    start = disturbed(np.random.default_rng(8), fit.home, WAY, ANGLE)
    assert np.array_equal(scene_of(fit, start).solve().q, scene_of(fit, start).solve().q)


def test_a_flank_goes_with_the_nearest_one():
    """A key is near the wall beyond its slot as well, and has play: it is flush with the flanks that are nearer."""
    fit = fits()["a key in its slot"]
    scene = scene_of(fit, np.r_[0.4, -0.3, 0.2, HOME[3:]])
    assert abs(fit.depth(seated(scene, np.array(scene.q), TOUCHING, CTRL_C).poses[1])) < 1e-12


def test_of_faces_that_differ_by_their_play_axes_coincide():
    fit = fits()["a pin with little play"]
    scene = scene_of(fit, disturbed(np.random.default_rng(6), fit.home, WAY, ANGLE))
    turn, place = rows(seated(scene, np.array(scene.q), TOUCHING, CTRL_C).poses[1])
    assert np.abs(turn.apply([0.0, 0.0, 1.0])[:2]).max() < 1e-11 and np.abs(place[:2]).max() < 1e-9
    # A pin may be anywhere along its hole: it stays.
    assert place[2] == pytest.approx(scene.q[1, 2], abs=1e-2)


def pin_at(radius, bore, lean, off):
    plate = asm.shapes.plate(80, 40, 10, [(0, 0, bore)])
    turn = Rotation.from_rotvec([lean, 0.0, 0.0]).as_quat(scalar_first=True)
    fit = Fit((plate, asm.shapes.solid_cylinder(radius, 60)), HOME, (8, 8, 60), None)
    return scene_of(fit, np.r_[off, 0.0, 20.3, turn])


@pytest.mark.parametrize(
    ("radius", "bore", "lean", "off", "fits_there"),
    [
        (4.0, 4.5, 0.12, 1.0, True),
        (4.0, 4.5, 0.18, 1.0, False),  # it leans by more than such parts are left to
        (4.0, 4.5, 0.05, 4.6, False),  # the axes are farther apart than the bore is wide
        (3.5, 4.5, 0.12, 2.0, False),  # so loose that it is in no place
        (4.6, 4.5, 0.05, 0.0, False),  # it is too thick
    ],
)
def test_what_does_not_nearly_fit_is_not_seated(radius, bore, lean, off, fits_there):
    scene = pin_at(radius, bore, lean, off)
    assert (seated(scene, np.array(scene.q), TOUCHING, CTRL_C) is not None) == fits_there


def test_cones_of_other_angles_do_not_fit():
    slope = np.tan(np.radians(31.0))
    seat = fits()["a cone in its seat"].shapes[0]
    plug = turned_part([(0, -7), (10 - 7 * slope, -7), (10 + 4 * slope, 4), (0, 4)])
    scene = scene_of(Fit((seat, plug), HOME, (25, 25, 14), None), np.r_[0.6, 0.0, -0.5, HOME[3:]])
    assert seated(scene, np.array(scene.q), TOUCHING, CTRL_C) is None


def test_what_is_clear_is_not_seated():
    fit = fits()["a pin in its hole"]
    scene = scene_of(fit, np.r_[0.3, 0.1, 20.0, HOME[3:]])
    assert seated(scene, np.array(scene.q), TOUCHING, CTRL_C) is None
    solution = scene.solve()
    assert solution.success and np.array_equal(solution.q, scene.q)


def test_a_ball_in_its_socket_is_seated_where_no_look_tells_that_it_crosses():
    pair = (
        asm.Body("socket", socket(10, 18, 16), fixed=True),
        asm.Body("ball", asm.shapes.sphere(10), (0.37, 0.27, -0.2)),
    )
    scene = asm.Assembly(pair)
    scene.constrain(asm.Clearance())
    q = np.array([HOME, [0.37, 0.27, -0.2, *HOME[3:]]])
    with lent_proof(scene.packed(), scene.bodies) as proof:
        assert proof.as_they_stand(q, TOUCHING)[0].verdict is Verdict.UNDECIDED
    seat = seated(scene, q, TOUCHING, CTRL_C)
    assert seat.has_bores and seat.poses[1, :3] == pytest.approx(0.0, abs=1e-9)
    solution = scene.solve()
    assert solution.success and solution.proved and solution.iterations == 0


def test_where_time_is_over_nothing_is():
    fit = fits()["a pin in its hole"]
    scene = scene_of(fit, disturbed(np.random.default_rng(7), fit.home, WAY, ANGLE))
    assert seated(scene, np.array(scene.q), TOUCHING, Interruption(1e-9)) is None


def test_a_ball_through_a_wall_is_no_ball_in_a_socket():
    """Without a face that fits bodies are parted, as the closed form of a judge tells."""
    ball, block = exact.ball(0.5), exact.box(3.0, 3.0, 3.0)
    a = asm.Body("a", block.shape, fixed=True)
    b = asm.Body("b", ball.shape, (0.1, 0.2, 1.4))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance())
    assert seated(scene, np.array(scene.q), TOUCHING, CTRL_C) is None
    solution = scene.solve()
    assert solution.success
    assert least_signed_distance(block, ball, Motion.of(solution.q[1])) > -TOUCHING * 6.0
