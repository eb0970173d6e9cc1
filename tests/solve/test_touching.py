"""Touching is not crossing: what holds as it stands, flush or hardly in each other, is left where it is."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.proximity import FeatureStatus, closest_features
from tests.proximity.features.test_touching import bolt_and_plate
from tests.proximity.manager.test_contact_place import CORNER, prism

HOLES = [(0.0, 0.0, 4.5), (20.0, 0.0, 3.0)]


def stacked(*bodies):
    """A box or another body, fixed, and what stands on it: (shape, position) each."""
    return [asm.Body(f"body {k}", shape, position=at, fixed=k == 0) for k, (shape, at) in enumerate(bodies)]


def flush(unit, over, origin):
    """Scenes of bodies that touch, or are in each other by `over` times ten units, and one step of theirs."""
    o, d = np.asarray(origin, dtype=float), 10.0 * unit * over

    def box(*sides):
        return asm.shapes.box(*(unit * side for side in sides))

    def at(x, y, z, off=(0.0, 0.0, 1.0)):
        return o + unit * np.array([x, y, z]) - d * np.asarray(off)

    def plate():
        return asm.shapes.plate(80 * unit, 40 * unit, 10 * unit, holes=[[unit * c for c in hole] for hole in HOLES])

    base = (box(10, 10, 10), o)
    rod = asm.shapes.solid_cylinder(5 * unit, 20 * unit)
    walls = prism([(unit * x, unit * y) for x, y in CORNER], 40.0 * unit)
    return {
        "whole faces": stacked(base, (box(10, 10, 10), at(0, 0, 10))),
        "a face in a face": stacked(base, (box(4, 4, 4), at(1, 0.5, 7))),
        "parts of faces": stacked(base, (box(10, 10, 10), at(4, 3, 10))),
        "three high": stacked(base, (box(8, 8, 10), at(0, 0, 10)), (box(10, 10, 10), at(0, 0, 20, (0, 0, 2)))),
        "two walls": stacked((walls, o), (box(4, 4, 4), at(2, 2, 10, (1, 1, 0)))),
        "plates with holes": stacked((plate(), o), (plate(), at(0, 0, 10))),
        "a cylinder on a plate": stacked((plate(), o), (rod, at(-20, 0, 15))),
        "a cylinder over a hole": stacked((plate(), o), (rod, at(0, 0, 15))),
        "edges": stacked(base, (box(10, 10, 10), at(10, 0, 10, (1, 0, 1)))),
        "vertices": stacked(base, (box(10, 10, 10), at(10, 10, 10, (1, 1, 1)))),
        "a ball": stacked(base, (asm.shapes.sphere(2 * unit), at(0, 0, 7))),
    }


KINDS = list(flush(1.0, 0.0, (0, 0, 0)))


def stays(bodies, **options):
    """Solve a scene of a clearance alone; nothing moves by a bit."""
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    before = np.array(scene.q)
    solution = scene.solve(**options)
    assert solution.success, solution.message
    assert np.array_equal(solution.q, before)
    return solution


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("kind", KINDS)
def test_what_is_flush_is_not_moved(kind, order):
    stays(flush(1.0, 0.0, (0, 0, 0))[kind][::order])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("unit", "origin"), [(1e-3, (0, 0, 0)), (1e6, (0, 0, 0)), (1.0, (1e3, 333.3, -777.7))])
def test_what_is_flush_is_not_moved_in_other_units_and_far_out(kind, unit, origin):
    stays(flush(unit, 0.0, origin)[kind])


@pytest.mark.parametrize("order", [1, -1])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("over", "touching"), [(1e-10, 1e-9), (1e-7, 1e-6)])
def test_what_is_hardly_in_each_other_is_not_moved(kind, over, touching, order):
    stays(flush(1.0, over, (0, 0, 0))[kind][::order], touching=touching)


@pytest.mark.parametrize("order", [1, -1])
def test_a_head_that_lies_on_a_plate_is_not_moved(order):
    stays(bolt_and_plate(9.0)[::order])


CONTACTS = ["whole faces", "a face in a face", "parts of faces", "a cylinder on a plate", "edges", "a ball"]


@pytest.mark.parametrize("unilateral", [False, True])
@pytest.mark.parametrize("kind", CONTACTS)
@pytest.mark.parametrize(("over", "touching"), [(0.0, 1e-9), (1e-10, 1e-9), (1e-7, 1e-6)])
def test_a_contact_that_touches_is_not_moved(kind, over, touching, unilateral):
    """Flush, or hardly in each other: alone, on a guide, and where a weld leaves no way apart."""
    for tie in (None, asm.Prismatic, asm.Fixed):
        a, b = flush(1.0, over, (0, 0, 0))[kind][:2]
        scene = asm.Assembly([a, b])
        scene.constrain(asm.Contact(a, b, "touch", unilateral=unilateral))
        if tie is not None:
            scene.constrain(tie(a.frame(at=b.pose.position), b.frame(), "tie"))
        before = np.array(scene.q)
        solution = scene.solve(touching=touching)
        assert solution.status is asm.Status.SOLVED, (tie, solution.message)
        assert np.array_equal(solution.q, before)
        again = scene.solve(solution, touching=touching)
        assert again.status is asm.Status.SOLVED and np.array_equal(again.q, before)


def test_a_contact_that_is_deeper_is_parted():
    a, b = flush(1.0, 1e-7, (0, 0, 0))["a ball"]
    for unilateral in (False, True):
        scene = asm.Assembly([a, b])
        scene.constrain(asm.Contact(a, b, unilateral=unilateral))
        solution = scene.solve(touching=1e-9)
        assert solution.success and solution.pose(b).position[2] == pytest.approx(7.0, abs=1e-11)


def test_a_contact_goes_no_deeper_than_it_was():
    """Drawn down, a ball that was in the box by less than touching stays as deep; a warm solve allows no more."""
    a, b = flush(1.0, 1e-9, (0, 0, 0))["a ball"]
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, unilateral=True))
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), target=(0.5, 0, 3)))
    solution = scene.solve()
    for _ in range(3):
        assert solution.success and solution.pose(b).position == pytest.approx([0.5, 0, 7 - 1e-8], abs=1e-11)
        solution = scene.solve(solution)


@pytest.mark.parametrize("unilateral", [False, True])
@pytest.mark.parametrize("over", [0.0, 1e-7])
@pytest.mark.parametrize("kind", ["a peg in a bore", "a ball in a bore"])
def test_a_contact_of_conforming_walls_does_not_lead_out_of_the_bore(kind, over, unilateral):
    plate = asm.Body("plate", asm.shapes.plate(80, 40, 10, holes=[(0, 0, 4.5)]), fixed=True)
    inner = asm.shapes.solid_cylinder(4.5 + over, 30) if "peg" in kind else asm.shapes.sphere(4.5 + over)
    scene = asm.Assembly([plate, asm.Body("inner", inner)])
    scene.constrain(asm.Contact(*scene.bodies, "touch", unilateral=unilateral))
    before = np.array(scene.q)
    solution = scene.solve(touching=1e-6)
    assert solution.success and np.array_equal(solution.q, before)


def test_what_is_deeper_is_parted():
    """And not a hair's breadth is left: touching is for what a solve begins with."""
    bodies = flush(1.0, 1e-5, (0, 0, 0))["parts of faces"]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    solution = scene.solve()
    assert solution.success and solution.pose(bodies[1]).position[2] == pytest.approx(10.0, abs=1e-11)


def test_no_step_goes_deeper_than_what_touched_at_the_start():
    bodies = flush(1.0, 1e-10, (0, 0, 0))["parts of faces"]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    drawn = asm.PointDistance(bodies[1].point(0, 0, 0), target=(4, 3, 8))
    scene.minimize(drawn)
    solution = scene.solve()
    assert solution.success and solution.pose(bodies[1]).position == pytest.approx([4, 3, 10 - 1e-9], abs=1e-11)
    # From above it is the least gap itself that ends the way.
    bodies[1].pose = asm.Pose((4, 3, 10.5))
    assert scene.solve().pose(bodies[1]).position[2] == pytest.approx(10.0, abs=1e-11)


def test_touching_is_a_number_of_the_size():
    scene = asm.Assembly(flush(1.0, 0.0, (0, 0, 0))["edges"])
    scene.constrain(asm.Clearance())
    for touching in (-1e-9, 0.1, np.nan):
        with pytest.raises(InputError, match="touching is"):
            scene.solve(touching=touching)


def test_a_tracked_body_at_its_target_is_drawn_by_nothing_where_bodies_touch():
    bodies = flush(1.0, 1e-7, (0, 0, 0))["parts of faces"]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    before = np.array(scene.q)
    tracker = scene.tracker(follow=bodies[1], touching=1e-6)
    step = tracker.step(before[1])
    assert step.iterations == 0 and np.array_equal(step.q, before)


@pytest.mark.parametrize(("over", "touching", "crosses"), [(0.0, 1e-9, False), (1e-7, 1e-6, False), (1e-7, 1e-9, True)])
def test_crossings_are_more_than_touching(over, touching, crosses):
    """Of a scene without a clearance: bodies that a contact holds, and one that is flush with another one."""
    bodies = flush(1.0, over, (0, 0, 0))["parts of faces"]
    ball = asm.Body("ball", asm.shapes.sphere(2.0), position=(-3, -3, 7))
    scene = asm.Assembly([*bodies, ball])
    scene.constrain(asm.Contact(bodies[0], ball))
    solution = scene.solve(touching=touching)
    assert solution.success and solution.crossings == ((("body 0", "body 1"),) if crosses else ())


@pytest.mark.parametrize("order", [1, -1])
def test_a_head_that_lies_on_a_plate_is_no_crossing(order):
    plate, bolt = bolt_and_plate(9.0)
    ball = asm.Body("ball", asm.shapes.sphere(2.0), position=(30, 0, 7))
    scene = asm.Assembly([plate, bolt, ball][::order])
    scene.constrain(asm.Contact(plate, ball))
    solution = scene.solve()
    assert solution.success and solution.crossings == ()


def test_a_tracker_begins_where_bodies_touch():
    bodies = flush(1.0, 1e-7, (0, 0, 0))["parts of faces"]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    before = np.array(scene.q)
    tracker = scene.tracker(follow=bodies[1].point(0, 0, 0), touching=1e-6)
    step = tracker.step(before[1, :3])
    assert step.status is asm.TrackStatus.FOLLOWED and np.allclose(step.q, before, rtol=0.0, atol=1e-12)
    # It is at its target: nothing draws it. The scene was packed anew for its contacts, after the target was set.
    assert step.iterations == 0
    # Drawn down it goes no deeper.
    for _ in range(20):
        step = tracker.step(before[1, :3] - np.array([0.0, 0.0, 0.5]))
    assert step.q[1, 2] > before[1, 2] - 1e-10


@pytest.mark.parametrize(("over", "touching", "crosses"), [(0.0, 1e-9, False), (1e-7, 1e-6, False), (1e-7, 1e-9, True)])
def test_a_managers_crossings_are_more_than_touching(over, touching, crosses):
    bodies = flush(1.0, over, (0, 0, 0))["parts of faces"]
    manager = asm.Manager(bodies, touching=touching)
    assert manager.touching == touching and manager.crossings == ()
    q = np.array([body.pose.q for body in bodies])
    manager.update(q)
    assert manager.crossings == ((("body 0", "body 1"),) if crosses else ())
    # And of where the bodies are now.
    manager.update(q + np.array([[0.0] * 7, [0, 0, 1.0, 0, 0, 0, 0]]))
    assert manager.crossings == ()
    manager.update(q - np.array([[0.0] * 7, [0, 0, 9.0, 0, 0, 0, 0]]))
    assert manager.crossings == (("body 0", "body 1"),)


def test_touching_of_a_manager_is_a_number_of_the_size():
    for touching in (-1e-9, 0.1, np.nan):
        with pytest.raises(InputError, match="touching is"):
            asm.Manager(flush(1.0, 0.0, (0, 0, 0))["edges"], touching=touching)


@pytest.mark.parametrize("at", [(0, 0, 6), (1.5, -2, 9), (0, 0, 2.0)])
def test_boxes_come_to_touch_along_parallel_faces(at):
    """Of all pairs of points of two parallel faces any will do, and no other pose is asked for."""
    a = asm.Body("a", asm.shapes.box(10, 10, 2), fixed=True)
    b = asm.Body("b", asm.shapes.box(4, 4, 2), position=at)
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    solution = scene.solve()
    assert solution.success
    pair = closest_features(a, b, solution.q[0], solution.q[1])
    # Faces that lean by less than 1e-9 have any of their points for the nearest one.
    assert pair.status is FeatureStatus.APART and abs(pair.gap) < 1e-8
    assert scene.solve(solution).success


@pytest.mark.parametrize("solid", [False, True])
@pytest.mark.parametrize("heights", [(2.0, 1.0), (1.0, 2.0), (2.0, 2.5)])
def test_a_warm_solve_keeps_the_contact_of_parallel_cylinders(heights, solid):
    """An eccentric cam and its follower, of which one is shorter: the pair stays inside both."""
    make = asm.shapes.solid_cylinder if solid else asm.shapes.cylinder
    ground = asm.Body("ground", fixed=True)
    cam, follower = asm.Body("cam", make(3.0, heights[0])), asm.Body("follower", make(0.5, heights[1]), (0, 4.5, 0))
    drive = asm.Revolute(ground.frame(x=(0, 1, 0)), cam.frame(at=(0, -1, 0), x=(0, 1, 0)), "drive", angle=0.0)
    guide = asm.Prismatic(ground.frame(z=(0, 1, 0)), follower.frame(z=(0, 1, 0)), "guide")
    scene = asm.Assembly([ground, cam, follower])
    walls = (cam.face("wall"), follower.face("wall")) if solid else (cam, follower)
    scene.constrain(drive, guide, asm.Contact(*walls, "touch"))
    solution = scene.solve()
    for degrees in range(0, 100, 7):
        drive.angle = np.radians(degrees)
        solution = scene.solve(solution)
        assert solution.success and solution.contacts["touch"].status.name in ("CONVERGED", "SINGULAR")
        # The height of a circle of radius 3.5 about the cam's middle, over the guide.
        off = np.sin(drive.angle)
        assert solution.pose(follower).position[1] == pytest.approx(
            np.cos(drive.angle) + np.sqrt(3.5**2 - off**2), abs=1e-10
        )
