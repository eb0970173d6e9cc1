"""Contacts that come to places: solved, by brute force, by numbers set anew, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import retract


def eggs():
    """An egg on an egg, both smooth, and their contact."""
    base = asm.Body("base", asm.shapes.ellipsoid(3, 2, 1.5), fixed=True)
    egg = asm.Body("egg", asm.shapes.ellipsoid(1, 0.8, 0.6), (0.3, 2.6, 0.4))
    contact = asm.Contact(base, egg, "touch")
    scene = asm.Assembly([base, egg])
    scene.constrain(contact)
    return scene, contact


@pytest.mark.parametrize("as_constraint", [True, False])
@pytest.mark.parametrize("target", [(4.0, 2.5), (15.9, None), (None, 1.2), (-0.3, 3.0)])
def test_a_contact_comes_to_its_place(target, as_constraint):
    scene, contact = eggs()
    places = [asm.ContactPlace(contact, "a", target), asm.ContactPlace(contact, "b", (2.0, 1.1), name="on the egg")]
    (scene.constrain if as_constraint else scene.minimize)(*places)
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    x = solution.contacts["touch"].parameters
    # A row is a length over the size, 6; an objective is left where its root is the root of rounding.
    least = 1e-9 if as_constraint else 1e-6
    assert places[0].distance(*x[:2]) < least and places[1].distance(*x[2:]) < least
    if as_constraint:
        assert solution.mobility.dof == (1 if None not in target else 2)


def test_the_nearest_contact_that_a_hinge_allows():
    """An egg that only turns about an axis, against the minimum over its angle by brute force."""
    scene, contact = eggs()
    base, egg = scene.bodies
    scene.constrain(asm.Planar(base.frame((0, 2.0, 0)), egg, "lies"))
    place = asm.ContactPlace(contact, "b", (2.0, 1.6), 0.3)
    scene.minimize(place)
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED and solution.objective > 1e-4
    np.testing.assert_allclose(
        solution.objective, 0.3 * place.distance(*solution.contacts["touch"].parameters[2:]) ** 2, rtol=1e-10
    )
    # In every pose beside it that holds the contact is farther away.
    rng, held = np.random.default_rng(0), asm.Assembly(scene.bodies)
    held.constrain(*scene.constraints)
    place_there = asm.ContactPlace(contact, "b", (2.0, 1.6), 0.3, name="again")
    for _ in range(20):
        q = solution.q.copy()
        q[1] = retract(q[1], 0.03 * rng.normal(size=6))
        beside = held.solve(q)
        assert beside.success
        assert 0.3 * place_there.distance(*beside.contacts["touch"].parameters[2:]) ** 2 >= solution.objective - 1e-12


def test_numbers_set_anew_are_those_of_a_scene_built_with_them():
    scene, contact = eggs()
    place = asm.ContactPlace(contact, "a", (4.0, 2.5))
    scene.constrain(place)
    first = scene.solve()
    place.target = (5.0, 2.0)
    moved = scene.solve(first)
    x = moved.contacts["touch"].parameters
    assert moved.success and place.distance(*x[:2]) < 1e-9
    np.testing.assert_allclose(x[:2], (5.0, 2.0), rtol=0, atol=1e-8)
    with pytest.raises(InputError, match=r"expected the same coordinates to be None"):
        place.target = (5.0, None)


@pytest.mark.parametrize("as_constraint", [True, False])
@pytest.mark.parametrize("often", [1, 600])
def test_a_gap_and_a_place_set_together_are_those_of_a_scene_built_with_them(as_constraint, often):
    """Also where more was set meanwhile than is remembered by name."""
    found = []
    for is_built in (False, True):
        scene, contact = eggs()
        start, place = scene.q, asm.ContactPlace(contact, "a", (4.0, 2.5))
        (scene.constrain if as_constraint else scene.minimize)(place)
        if not is_built:
            assert scene.solve().success
        for _ in range(1 if is_built else often):
            contact.minimum, place.target = 0.05, (5.0, 2.0)
        found.append(scene.solve(start))
    assert found[0].success and found[0].contacts["touch"].gap == pytest.approx(0.05, rel=0, abs=1e-12)
    np.testing.assert_array_equal(found[0].q, found[1].q)


@pytest.mark.parametrize("as_constraint", [True, False])
def test_solutions_are_derived_by_targets(as_constraint):
    """Against differences of scenes solved again."""
    scene, contact = eggs()
    egg = scene.bodies[1]
    # Away from a quarter, 4.0, where the third derivatives of the egg jump.
    place = asm.ContactPlace(contact, "a", (5.0, 2.5))
    (scene.constrain if as_constraint else scene.minimize)(place)
    scene.minimize(asm.PointDistance(egg.point(0, 0, 0.6), (1.0, 3.0, 2.0)))
    wrt = [asm.Parameter(place, "target", "u"), asm.Parameter(place, "target", "v")]
    wrt += [] if as_constraint else [asm.Parameter(place, "weight")]
    of = [asm.Measure(egg, axis) for axis in "xyz"]
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    found = asm.sensitivity(scene, solution, of=of, wrt=wrt).matrix
    for r, parameter in enumerate(wrt):
        middle, rows = parameter.value, []
        for k in (-2, -1, 1, 2):
            parameter.value = middle + 1e-3 * k
            there = scene.solve(solution)
            assert there.success
            rows.append([measure.value(there) for measure in of])
        parameter.value = middle
        expected = (np.array([1, -8, 8, -1]) @ rows) / 12e-3
        # Order four in steps of 1e-3, and what solves leave, 1e-12, over the step.
        np.testing.assert_allclose(found[:, r], expected, rtol=0, atol=1e-8)
        assert np.abs(expected).max() > 1e-3


def test_a_tracker_tells_that_a_place_is_another_one():
    scene, contact = eggs()
    place = asm.ContactPlace(contact, "a", (5.0, 2.5))
    scene.minimize(place)
    egg = scene.bodies[1]
    for number in (asm.Parameter(place, "weight"), asm.Parameter(place, "target", "u")):
        scene.solve()
        tracker = asm.Tracker(scene, egg.point(0, 0, 0))
        there = tracker.q[1, :3]
        assert tracker.step(there).status is not asm.TrackStatus.CHANGED
        number.value = 1.1 * number.value
        assert tracker.step(there).status is asm.TrackStatus.CHANGED


def test_a_branch_is_followed_along_a_target():
    """Newton's last steps are of pairs that move by less than is evaluated again, and slopes are made of these."""
    scene, contact = eggs()
    egg = scene.bodies[1]
    place = asm.ContactPlace(contact, "a", (5.0, 2.5))
    scene.minimize(place, asm.PointDistance(egg.point(0, 0, 0.6), (1.0, 3.0, 2.0)))
    branch = asm.follow(scene, asm.Parameter(place, "target", "u"), 4.999, 5.001, of=asm.Measure(egg, "x"))
    assert {event.kind for event in branch.events} == {"end of range"} and np.ptp(branch.values) == pytest.approx(0.002)
    for value, q in zip(branch.values, branch.poses, strict=True):
        place.target = (value, 2.5)
        # Solves leave some 1e-9 along the flattest way of the objective.
        np.testing.assert_allclose(scene.solve(q).q, q, rtol=0, atol=2e-8)


def test_scenes_know_the_contacts_of_their_places():
    scene, contact = eggs()
    alone = asm.Assembly(scene.bodies)
    place = asm.ContactPlace(contact, "a", (4.0, 2.5))
    with pytest.raises(InputError, match="keeps contact 'touch', which is not in the assembly"):
        alone.constrain(place)
    with pytest.raises(InputError, match="names 'touch', which is not in the assembly"):
        alone.minimize(place)
    scene.minimize(place)
    with pytest.raises(InputError, match="whose contact 'place touch' constrains to a place"):
        scene.remove(contact)
    contact.enabled = False
    assert scene.solve().objective == 0.0  # nothing is drawn without its contact


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({"contact": "touch"}, "contact is 'touch'; expected a Contact"),
        ({"side": "c"}, "side is 'c'; expected 'a' or 'b'"),
        ({"target": 1.0}, "target is 1.0; expected"),
        ({"target": (None, None)}, "expected a coordinate at least"),
        ({"target": (1.0, float("nan"))}, r"target\[1\] is nan; expected a finite real number"),
        ({"target": (1.0, 9.0)}, r"target\[1\] is 9; expected from 0 to 6\.57111, the face's domain"),
        ({"target": (1.0, 0.0)}, "a pole of the face; expected a place"),
        ({"target": (None, 0.0)}, "a pole of the face; expected a line"),
        ({"weight": -1.0}, "weight is -1; expected a positive number"),
    ],
)
def test_what_is_no_place_is_refused(change, expected):
    _, contact = eggs()
    arguments = {"contact": contact, "side": "a", "target": (1.0, 2.0)} | change
    with pytest.raises((InputError, TypeError), match=expected):
        asm.ContactPlace(**arguments)


def test_solids_have_places_on_single_faces():
    box, egg = asm.Body("box", asm.shapes.box(1, 1, 1), fixed=True), asm.Body("egg", asm.shapes.sphere(0.5))
    with pytest.raises(InputError, match="has body 'box' with 6 faces as side a; expected one of its faces"):
        asm.ContactPlace(asm.Contact(box, egg), "b", (1.0, 1.0))
