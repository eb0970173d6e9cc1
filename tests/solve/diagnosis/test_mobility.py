"""Degrees of freedom, redundant and conflicting sets, and free motions, of mechanisms where they are known."""

from __future__ import annotations

import os
import signal
import threading

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.solve.dense import rank
from assembly.solve.diagnosis.mobility import Mobility
from tests.solve.mechanisms import bennett, bricard, chain, parallelograms, planar_four_bar

JOINTS = [f"joint {k}" for k in range(1, 7)]
SIZES = [1e-6, 1.0, 1e6]


def free_bodies(count, **kwargs):
    return [asm.Body(f"body {k}", **kwargs) for k in range(count)]


def moving_rows(mobility, scene):
    return [k for k, body in enumerate(scene.bodies) if not body.fixed]


def check(scene, mobility):
    """What holds of any mobility: free motions are orthonormal, forbidden by no row, none of a fixed body."""
    scaled = mobility.free_motions / np.repeat([mobility.size, 1.0], 3)
    flat = scaled.reshape(mobility.dof, 6 * len(scene.bodies))
    np.testing.assert_allclose(flat @ flat.T, np.eye(mobility.dof), rtol=0, atol=1e-13)
    assert not scaled[:, [body.fixed for body in scene.bodies]].any()
    assert 6 * len(moving_rows(mobility, scene)) == mobility.dof + mobility.rank == mobility.grubler + mobility.rows
    counted = ~mobility._rows.one_sided & (mobility._drives | ~mobility._rows.drives)
    rates = mobility._rows.jacobian[counted] @ flat.T
    assert np.abs(rates).max(initial=0.0) < 100.0 * mobility.tolerance


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize(
    ("make", "dof", "grubler", "sets"),
    [
        (planar_four_bar, 1, -2, [tuple(JOINTS[:4])]),
        (bennett, 1, -2, [tuple(JOINTS[:4])]),
        (bricard, 1, 0, [tuple(JOINTS)]),
    ],
)
def test_linkages_that_move_although_grubler_says_no(make, dof, grubler, sets, size):
    scene = make(size)
    mobility = scene.mobility()
    check(scene, mobility)
    assert (mobility.dof, mobility.grubler) == (dof, grubler)
    assert mobility.redundant_sets == sets and mobility.redundant == sorted(sets[0])
    assert mobility.conflicting == [] and not mobility.singular and mobility.finite_dof == dof
    # They are not near to a decision: what counts is of order one, what does not is rounding.
    values = mobility.singular_values
    assert values[mobility.rank - 1] > 0.05 and values[mobility.rank] < 1e-14
    # They solve, too, from anywhere near.
    solution = scene.solve(scene.q)
    assert solution.success


@pytest.mark.parametrize("offset", [(0, 0, 0), (1e3, -2e3, 5e2)])
def test_where_bodies_have_their_origins_does_not_matter(offset):
    # Twists at origins far from the joints: rows would be long arms and little else.
    expected = bricard().mobility()
    scene = bricard()
    frames = []
    for joint in scene.constraints:
        frames.append(
            [f.body.frame(f.origin - offset, f.axes[:, 2], f.axes[:, 0]) for f in (joint.frame_a, joint.frame_b)]
        )
    for body in scene.bodies:
        body.pose = asm.Pose(offset)
    moved = asm.Assembly(scene.bodies)
    moved.constrain(*(asm.Revolute(*pair, f"joint {k + 1}") for k, pair in enumerate(frames)))
    mobility = moved.mobility()
    check(moved, mobility)
    assert (mobility.dof, mobility.redundant_sets) == (1, expected.redundant_sets)
    # 1e-16 of the offset.
    np.testing.assert_allclose(mobility.singular_values, expected.singular_values, rtol=0, atol=1e-11)


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("size", SIZES)
def test_parallelograms_folded_flat_are_singular(count, size):
    scene = parallelograms(count, size)
    mobility = scene.mobility()
    check(scene, mobility)
    assert (mobility.dof, mobility.finite_dof, mobility.singular) == (count + 1, 1, True)
    assert "singular: 1 at poses nearby" in str(mobility)
    # A little way off they are not.
    rod = next(joint for joint in scene.constraints if joint.name == "foot 0")
    rod.angle = 0.3
    solution = scene.solve()
    assert solution.success
    opened = scene.mobility(solution, drives=False)
    assert (opened.dof, opened.singular) == (1, False)
    assert scene.mobility(solution).dof == 0


def test_a_point_between_two_stays_is_shaky():
    # Both distances are stretched to the full: the point moves sideways to first order, and nowhere.
    ground, bead = asm.Body("ground", fixed=True), asm.Body("bead", position=(1, 0, 0))
    scene = asm.Assembly([ground, bead])
    scene.constrain(
        asm.Distance(ground.point(0, 0, 0), bead, 1.0, "left"),
        asm.Distance(ground.point(3, 0, 0), bead, 2.0, "right"),
        asm.Parallel(ground, bead, angle=0.0),
    )
    mobility = scene.mobility()
    check(scene, mobility)
    assert (mobility.dof, mobility.finite_dof, mobility.singular) == (2, 0, True)
    assert mobility.redundant_sets == [("left", "right")]


def test_a_solved_singular_pose_is_seen():
    # The solve leaves 1e-13, so the pose is off by its square root; the tolerance knows.
    scene = parallelograms(2)
    rng = np.random.default_rng(0)
    for body in scene.bodies[1:]:
        body.pose = asm.Pose(1e-9 * rng.normal(size=3), np.array([1, 0, 0, 0]) + 1e-9 * rng.normal(size=4))
    solution = scene.solve()
    assert solution.success and solution.feasibility < 1e-12
    assert scene.mobility(solution).dof == 3


def test_said_twice():
    ground, wheel = asm.Body("ground", fixed=True), asm.Body("wheel")
    scene = asm.Assembly([ground, wheel])
    scene.constrain(*(asm.Revolute(ground, wheel, name) for name in ("first", "again", "and again")))
    mobility = scene.mobility()
    check(scene, mobility)
    assert (mobility.dof, mobility.grubler) == (1, -9)
    assert mobility.redundant_sets == [("first", "again"), ("first", "and again")]
    assert mobility.redundant == ["again", "and again", "first"]


def test_only_what_is_needed_explains_a_redundant_one():
    # The last distance follows from a rod of the triangle and the hinge; the tail has no part in it.
    ground, crank, tail = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("tail")
    scene = asm.Assembly([ground, crank, tail])
    scene.constrain(
        asm.Spherical(crank.point(2, 0, 0), tail.point(2, 0, 0), "tail"),
        asm.Revolute(ground, crank, "hinge", angle=0.0),
        asm.Distance(ground.point(0, 3, 0), crank.point(1, 0, 0), np.sqrt(10.0), "rod"),
    )
    mobility = scene.mobility()
    assert mobility.redundant_sets == [("hinge", "rod")]
    # Without the drive nothing is said twice.
    free = scene.mobility(drives=False)
    check(scene, free)
    assert (free.dof, free.redundant) == (3, []) and mobility.dof == 3


def test_one_that_repeats_itself():
    ground, nut = asm.Body("ground", fixed=True), asm.Body("nut")
    scene = asm.Assembly([ground, nut])
    scene.constrain(asm.Screw(ground, nut, 0.5, "screw", angle=0.0, slide=0.0))
    assert scene.mobility().redundant_sets == [("screw",)]
    assert scene.mobility(drives=False).redundant_sets == []
    assert scene.mobility(drives=False).dof == 1


@pytest.mark.parametrize(
    ("joint", "dof"),
    [
        (asm.Fixed, 0),
        (asm.Revolute, 1),
        (asm.Prismatic, 1),
        (asm.Cylindrical, 2),
        (asm.Planar, 3),
        (asm.Spherical, 3),
        (asm.Parallel, 4),
        (asm.PointOnLine, 4),
        (asm.PointOnPlane, 5),
    ],
)
def test_what_a_joint_leaves_free(joint, dof):
    ground, body = asm.Body("ground", fixed=True), asm.Body("body", position=(1, 2, 3))
    scene = asm.Assembly([ground, body])
    sides = ground.frame((1, 2, 3), (1, 1, 0)), body.frame((0, 0, 0), (1, 1, 0))
    scene.constrain(joint(*(sides[::-1] if joint in (asm.PointOnLine, asm.PointOnPlane) else sides), "it"))
    mobility = scene.mobility()
    check(scene, mobility)
    assert mobility.dof == mobility.grubler == dof and mobility.redundant == []


def test_a_point_at_a_distance_from_a_line_takes_one():
    ground, body = asm.Body("ground", fixed=True), asm.Body("body", position=(1, 2, 3))
    scene = asm.Assembly([ground, body])
    scene.constrain(asm.PointOnLine(body, ground.frame((1, 0, 0)), "it", distance=2.0))
    mobility = scene.mobility()
    check(scene, mobility)
    assert mobility.dof == mobility.grubler == 5 and mobility.redundant == []


def test_free_motions_are_readable():
    ground, shaft = asm.Body("ground", fixed=True), asm.Body("shaft", position=(1, 2, 3))
    scene = asm.Assembly([ground, shaft])
    scene.constrain(asm.Cylindrical(ground.frame((4, 2, 0)), shaft.frame((3, 0, 0)), "bore"))
    mobility = scene.mobility()
    text = str(mobility)
    assert text.startswith("2 degrees of freedom; Grubler's count is 2: 4 rows of rank 4\n")
    assert "shaft                slides along (0, 0, 1)" in text
    turn = mobility.free_motions[np.argmax(np.abs(mobility.free_motions[:, 1, 5]))][1]
    # About the bore: the origin, 3 beside it, moves across.
    assert turn[1] == pytest.approx(-3.0 * turn[5], abs=1e-12) and abs(turn[0]) < 1e-12


def test_bodies_that_nothing_ties_together_share_no_motion():
    bodies = free_bodies(3)
    ground = asm.Body("ground", fixed=True)
    scene = asm.Assembly([ground, *bodies])
    scene.constrain(asm.Spherical(bodies[0], bodies[2], "ball"), asm.Revolute(ground, bodies[1], "hinge"))
    mobility = scene.mobility()
    check(scene, mobility)
    assert mobility.dof == 10
    moving = np.abs(mobility.free_motions).max(axis=2) > 1e-12
    assert moving[:, 2].sum() == 1 and not (moving[:, 2] & (moving[:, 1] | moving[:, 3])).any()


def test_bodies_without_constraints_move_every_way():
    ground, door, loose = asm.Body("ground", fixed=True), asm.Body("door"), asm.Body("loose", position=(1, 2, 3))
    scene = asm.Assembly([ground, loose, door])
    assert scene.mobility().dof == 12 and scene.mobility().redundant == []
    scene.constrain(asm.Revolute(ground, door, "hinge"))
    mobility = scene.mobility()
    check(scene, mobility)
    assert mobility.dof == mobility.finite_dof == 7
    # Its own six coordinates, one by one.
    own = mobility.free_motions[:6, 1] / np.repeat([mobility.size, 1.0], 3)
    np.testing.assert_allclose(np.abs(own).sum(axis=0), np.ones(6), rtol=0, atol=1e-13)
    assert "slides along (1, 0, 0)" in str(mobility)


def test_one_sided_rows_do_not_count():
    ground, door = asm.Body("ground", fixed=True), asm.Body("door", asm.shapes.sphere(0.5))
    wall = asm.Body("wall", asm.shapes.plane(4, 4), (0, 0, -0.5), fixed=True)
    scene = asm.Assembly([ground, door, wall])
    scene.constrain(
        asm.Revolute(ground, door, "hinge", limits=(0.0, 1.0)), asm.Contact(wall, door, "stop", unilateral=True)
    )
    mobility = scene.mobility()
    assert (mobility.dof, mobility.rows, mobility.singular) == (1, 5, False)


@pytest.mark.parametrize(("shape", "dof", "rows"), [("sphere", 5, 1), ("box", 3, 3)])
def test_contacts(shape, dof, rows):
    floor = asm.Body("floor", asm.shapes.plane(8, 8), fixed=True)
    solid = asm.shapes.sphere(1.0) if shape == "sphere" else asm.shapes.box(2, 2, 2)
    body = asm.Body("body", solid, (0.2, 0.1, 1.0))
    scene = asm.Assembly([floor, body])
    # Two single faces come to lie flush; a whole box would stand on one of its features.
    side = body.face() if shape == "sphere" else body.face("bottom")
    scene.constrain(asm.Contact(floor, side))
    mobility = scene.mobility(scene.solve())
    check(scene, mobility)
    assert (mobility.dof, mobility.rows, mobility.feasibility < 1e-12) == (dof, rows, True)


def triangle():
    """Three bodies whose distances cannot be: 1 + 1 < 3; a fourth that has nothing to do with it."""
    a, b, c, d = asm.Body("a", fixed=True), *(asm.Body(name) for name in "bcd")
    for body, position in zip((b, c, d), [(1, 0.1, 0), (0.5, 1, 0.2), (0, 0, 2)], strict=True):
        body.pose = asm.Pose(position)
    scene = asm.Assembly([a, b, c, d])
    scene.constrain(
        asm.Distance(a, d, 2.5, "ad"),
        asm.Distance(a, b, 1.0, "ab"),
        asm.Distance(d, b, 2.0, "db"),
        asm.Distance(b, c, 1.0, "bc"),
        asm.Distance(c, a, 3.0, "ca"),
    )
    return scene


def test_conflicting_distances_are_named():
    scene = triangle()
    solution = scene.solve()
    assert solution.status is asm.Status.INFEASIBLE
    mobility = scene.mobility(solution)
    assert mobility.conflicting_sets == [("ab", "bc", "ca")] and mobility.conflicting == ["ab", "bc", "ca"]
    assert "conflicting: 'ab', 'bc', 'ca'" in str(mobility) and "redundant" not in str(mobility)
    # From the bodies' poses as well, which hold nothing yet; and of a scene that can hold, nothing.
    assert scene.mobility().conflicting_sets == [("ab", "bc", "ca")]
    scene.constraints[-1].value = 1.5
    assert scene.mobility().conflicting == [] and scene.mobility().feasibility > 0.1


def test_conflicts_are_those_of_the_solve_whatever_was_driven_since():
    scene = triangle()
    solution = scene.solve()
    scene.constraints[-1].value = 1.5
    assert scene.solve().success
    assert scene.mobility(solution).conflicting_sets == [("ab", "bc", "ca")]


def test_two_contradictions_are_two_sets():
    ground, *bodies = asm.Body("ground", fixed=True), *free_bodies(2)
    scene = asm.Assembly([ground, *bodies])
    scene.constrain(
        asm.Revolute(ground, bodies[0], "hinge", angle=0.5),
        asm.Distance(ground.point(1, 0, 0), bodies[0].point(1, 0, 0), 1.7, "rod"),
        asm.Prismatic(ground, bodies[1], "slide", limits=(0.0, 1.0)),
        asm.PointOnPlane(bodies[1], ground, "height", offset=2.0),
    )
    mobility = scene.mobility(scene.solve())
    assert mobility.conflicting_sets == [("hinge", "rod"), ("slide", "height")]


def test_a_saddle_is_no_contradiction():
    # All bars in one line: the violation is stationary by symmetry, but the bars close as soon as they leave it.
    scene = chain([(0, 0, 1)] * 4, [(0, 0, 0), (1, 0, 0), (4, 0, 0), (3.2, 0, 0)])
    long = asm.Assembly(scene.bodies)
    ground, crank, coupler, rocker = scene.bodies
    long.constrain(
        asm.Revolute(ground.frame(), crank.frame(), "a"),
        asm.Revolute(crank.frame((1, 0, 0)), coupler.frame(), "b"),
        asm.Revolute(coupler.frame((3, 0, 0)), rocker.frame(), "c"),
        asm.Revolute(rocker.frame((2.5, 0, 0)), ground.frame((3.2, 0, 0)), "d"),
    )
    solution = long.solve()
    assert solution.success
    assert long.mobility(solution).conflicting == []


@pytest.mark.parametrize("make", [planar_four_bar, bennett, bricard])
def test_trajectories_stay_on_the_constraints(make):
    scene = make()
    mobility = scene.mobility()
    poses = mobility.trajectory(0, amplitude=0.8, frames=21)
    assert poses.shape == (21, len(scene.bodies), 7)
    np.testing.assert_array_equal(poses[[0, -1]], scene.q[None].repeat(2, axis=0))
    np.testing.assert_allclose(poses[10], scene.q, rtol=0, atol=0.3)
    for q in poses:
        assert scene.mobility(q).feasibility < 1e-11 * mobility.size
    # There and to the other side, and neither is where it began.
    steps = np.linalg.norm((poses[[5, 15]] - scene.q)[:, 1:, 3:], axis=(1, 2))
    assert steps.min() > 0.2 and np.linalg.norm(poses[5] - poses[15]) > 1.5 * steps.min()
    # It moves in every frame, and nowhere far.
    moves = np.abs(np.diff(poses, axis=0)).max(axis=(1, 2))
    assert moves.max() < 0.5


def test_a_trajectory_waits_where_it_cannot_go_on():
    # The point is drawn along the x axis until the rod is taut.
    ground, bead = asm.Body("ground", fixed=True), asm.Body("bead", position=(1.5, 0, 0))
    scene = asm.Assembly([ground, bead])
    scene.constrain(
        asm.Prismatic(ground.frame(z=(1, 0, 0)), bead.frame(z=(1, 0, 0)), "rail"),
    )
    rod = asm.Body("rod")
    scene.add(rod)
    scene.constrain(
        asm.Spherical(ground.point(0, 1, 0), rod.point(0, 0, 0), "foot"),
        asm.Distance(rod.point(2, 0, 0), bead, 0.5, "rope"),
    )
    solution = scene.solve()
    mobility = scene.mobility(solution)
    along = int(np.argmax(np.abs(mobility.free_motions[:, 1, 0])))
    poses = mobility.trajectory(along, amplitude=3.0, frames=41)
    reach = np.abs(poses[:, 1, 0]).max()
    # Taut: 2 + 0.5 from (0, 1, 0).
    assert reach <= np.sqrt(2.5**2 - 1.0) + 1e-9
    assert scene.mobility(poses[10]).feasibility < 1e-11


def test_scale_of_words_and_numbers():
    small, large = (planar_four_bar(size).mobility() for size in (1e-6, 1e6))
    np.testing.assert_allclose(small.singular_values, large.singular_values, rtol=0, atol=1e-12)
    ratio = large.free_motions[:, :, :3] / 1e12
    np.testing.assert_allclose(small.free_motions[:, :, :3], ratio, rtol=0, atol=1e-18)
    np.testing.assert_allclose(small.free_motions[:, :, 3:], large.free_motions[:, :, 3:], rtol=0, atol=1e-12)


def test_tolerance_can_be_given():
    scene = planar_four_bar()
    values = scene.mobility().singular_values
    coarse = scene.mobility(tolerance=0.5 * (values[14] + values[15]))
    assert coarse.tolerance > values[15] and coarse.dof > 1


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda s: s.mobility(drives=1), "drives is 1; expected True or False"),
        (lambda s: s.mobility(tolerance=0.0), "tolerance is 0; expected a positive number"),
        (lambda s: s.mobility(np.zeros((2, 7))), "q has shape"),
        (lambda s: s.mobility(bricard().solve()), "q is a solution of another assembly"),
        (lambda s: s.mobility().trajectory(1), "k is 1; expected an integer from 0 to 0"),
        (lambda s: s.mobility().trajectory(0, amplitude=0.0), "amplitude is 0; expected a positive number"),
        (lambda s: s.mobility().trajectory(0, frames=2), "frames is 2; expected an integer from 5"),
    ],
)
def test_bad_input(call, text):
    with pytest.raises(InputError, match=text):
        call(planar_four_bar())


def test_nothing_moves_where_nothing_is_free():
    scene = planar_four_bar()
    scene.constraints[0].angle = 0.0
    mobility = scene.mobility()
    assert mobility.dof == 0 and mobility.free_motions.shape == (0, 4, 6) and not mobility.singular
    with pytest.raises(InputError, match="k is 0; expected"):
        mobility.trajectory()


def test_public_name():
    assert asm.Mobility is Mobility


def lazy(mobility):
    """What is found when it is read."""
    return {
        "finite_dof": lambda: mobility.finite_dof,
        "redundant_sets": lambda: mobility.redundant_sets,
        "conflicting_sets": lambda: mobility.conflicting_sets,
        "trajectory": lambda: mobility.trajectory(frames=5),
    }


def test_a_time_limit_gives_no_halves():
    scene = planar_four_bar()
    with pytest.raises(TimeoutError, match="rank is not known yet when time_limit is over"):
        scene.mobility(time_limit=1e-9)
    with pytest.raises(InputError, match="time_limit is 0; expected a number of seconds above 0"):
        scene.mobility(time_limit=0.0)
    plain, limited = scene.mobility(), scene.mobility(time_limit=1e6)
    object.__setattr__(limited, "_time_limit", 1e-9)
    for read in lazy(limited).values():
        with pytest.raises(TimeoutError):
            read()
    lines = str(limited).splitlines()
    assert "  freedoms of poses nearby are not known: time_limit was over" in lines
    assert "  redundant constraints are not known: time_limit was over" in lines
    # Each has a time of its own, and what was not known may be asked for again.
    object.__setattr__(limited, "_time_limit", 1e6)
    assert str(limited) == str(plain)
    for read, expected in zip(lazy(limited).values(), lazy(plain).values(), strict=True):
        np.testing.assert_array_equal(read(), expected())


def test_ranks_of_large_matrices_are_those_of_small_ones(monkeypatch):
    scene = planar_four_bar()
    plain = scene.mobility()
    monkeypatch.setattr(rank, "LARGE", 1)
    other = scene.mobility()
    np.testing.assert_array_equal(other.singular_values, plain.singular_values)
    np.testing.assert_array_equal(other.free_motions, plain.free_motions)
    assert other.redundant_sets == plain.redundant_sets


def test_ctrl_c_ends_a_rank(monkeypatch):
    # As if a decomposition took for ever: the thread that it runs in does not keep anybody.
    done = threading.Event()
    monkeypatch.setattr(rank, "LARGE", 1)

    def endless(*_, **__):
        os.kill(os.getpid(), signal.SIGINT)
        done.wait(60.0)

    monkeypatch.setattr(rank.np.linalg, "svd", endless)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            planar_four_bar().mobility()
    finally:
        signal.signal(signal.SIGINT, before)
        done.set()
    monkeypatch.undo()
    assert planar_four_bar().mobility().dof == 1
