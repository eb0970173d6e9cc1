"""Mates: what they are made of, what they say of themselves, and what they refuse."""

from __future__ import annotations

import copy
import pickle
from math import nan

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError


def parts():
    plate = asm.Body("plate", asm.shapes.plate(10, 8, 2, [(1, 1, 1.5), (-3, 0, 0.5)]), fixed=True)
    bolt = asm.curves.polygon([(0, -3), (1, -3), (1, 1), (2, 1), (2, 2), (0, 2)])
    return plate, asm.Body("bolt", asm.shapes.revolution(bolt), (1, 1, 6))


PLATE, BOLT = parts()
BALL = asm.Body("ball", asm.shapes.sphere(1))
CONE = asm.Body("cone", asm.shapes.cone(3, 4))
HOLE, SHANK = PLATE.face("hole 1"), BOLT.faces.cylinders(radius=1).one()
MATES = {
    3: [
        asm.Flush(PLATE.faces(">Z"), BOLT.faces("<Z")),
        asm.Concentric(BALL.face(), asm.Body("cup", asm.Face(asm.shapes.sphere(1), reversed=True)).face()),
        asm.Width(PLATE.faces("|X"), BOLT.faces("|Z")[:2]),
        asm.Symmetric(BALL.face(), BOLT.point(0, 0, 0), PLATE.face("top")),
    ],
    4: [asm.Coaxial(HOLE, SHANK)],
    5: [asm.Insert(HOLE, SHANK)],
    1: [asm.Tangent(PLATE.face("top"), BALL.face())],
    6: [asm.Group([PLATE, BOLT])],
}
ALL = [(count, mate) for count, mates in MATES.items() for mate in mates]


@pytest.mark.parametrize(("count", "mate"), ALL, ids=lambda value: type(value).__name__)
def test_each_names_what_it_takes_away(count, mate):
    kind = asm.Tangent if isinstance(mate, asm.Tangent) else type(mate)
    assert mate.removes == count and f"takes away {count} " in repr(mate)
    assert f"takes away {count} degree" in kind.__doc__ or kind is asm.Group
    word = kind.__name__.lower()
    assert mate.name.startswith(word) and kind(*_given(mate), name="mine").name == "mine"


def _given(mate):
    if isinstance(mate, asm.Group):
        return [mate.bodies]
    return mate.faces if isinstance(mate, asm.Tangent) else mate.features


@pytest.mark.parametrize("mate", [mate for count, mate in ALL if count != 1], ids=lambda value: type(value).__name__)
def test_copies_are_their_own(mate):
    other = copy.copy(mate)
    assert repr(other) == repr(mate) and other.bodies == mate.bodies and other.removes == mate.removes
    again = pickle.loads(pickle.dumps(mate))
    assert repr(again) == repr(mate) and again.bodies[0] is not mate.bodies[0]


def test_what_a_mate_says():
    said = repr(asm.Flush(PLATE.faces(">Z"), BOLT.faces("<Z"), "on top", offset=2.0, angle=0.5))
    assert said == (
        "Flush(plate.face('top'), bolt.face('wall 1'), name='on top', axes='opposed', offset=2.0, angle=0.5; "
        "takes away 3 of 6 degrees of freedom)"
    )


def test_mates_are_joints_of_frames_as_well():
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    for mate in (asm.Flush(ground.frame(), arm.frame()), asm.Coaxial(ground.frame(), arm.frame(), axes="aligned")):
        scene = asm.Assembly([ground, arm])
        scene.constrain(mate)
        assert scene.solve().success


def test_seats_of_a_bolt():
    mate = asm.Insert(HOLE, SHANK)
    assert {face.name for face in mate.seats.hole.faces} == {"hole 1", "top"} and mate.axes == "opposed"
    assert {round(face.center[2], 9) for face in mate.seats.shank.faces if face.kind == "plane"} == {1.0}
    below = parts()[1]
    below.pose = asm.Pose((1, 1, -6), (0, 1, 0, 0))
    mate = asm.Insert(HOLE, below.faces.cylinders(radius=1))
    assert "bottom" in mate.seats.hole.name
    said = asm.Insert(HOLE, SHANK, seats=(PLATE.edges.circles(1.5)[:1], mate_end(BOLT)), axes="aligned")
    assert said.seats.hole.index == PLATE.edges.circles(1.5)[0].index and said.seats.shank.index == mate_end(BOLT).index


def mate_end(bolt):
    return bolt.edges.circles(1)("<Z").one()


TWO = asm.Body("two", asm.shapes.solid_cylinder(2, 3))
REFUSED = {
    "not flat": (
        lambda: asm.Flush(HOLE, BOLT.faces("<Z")),
        "face_a is plate.face('hole 1'), a cylinder; expected a flat",
    ),
    "empty": (lambda: asm.Flush(PLATE.faces("%CONE"), BOLT.faces("<Z")), "is empty; expected one of the faces"),
    "several": (lambda: asm.Flush(PLATE.faces("|Z"), BOLT.faces("<Z")), "is 2 faces: 'bottom'"),
    "one body": (
        lambda: asm.Flush(PLATE.face("top"), PLATE.face("left")),
        "face_a and face_b are both on body 'plate'",
    ),
    "offset": (lambda: asm.Flush(PLATE.face("top"), BOLT.faces("<Z"), offset=nan), "offset is nan; expected a finite"),
    "axes": (lambda: asm.Coaxial(HOLE, SHANK, axes="any"), "axes is 'any'; expected 'aligned', 'opposed' or 'nearest'"),
    "no axis": (
        lambda: asm.Coaxial(HOLE, BALL.face()),
        "b is ball.face('surface'), a sphere; expected a cylinder, cone",
    ),
    "wrong order": (
        lambda: asm.Insert(SHANK, HOLE),
        "a full cylinder; expected a hollow one: Insert takes the hole first",
    ),
    "too thick": (lambda: asm.Insert(HOLE, TWO.faces.cylinders()), "expected a shank that fits"),
    "no cylinder": (
        lambda: asm.Insert(PLATE.face("top"), SHANK),
        "hole is plate.face('top'), a plane; expected a cylinder",
    ),
    "seats": (lambda: asm.Insert(HOLE, SHANK, seats=3), "seats is 3; expected two circles"),
    "seat of another hole": (
        lambda: asm.Insert(HOLE, SHANK, seats=(PLATE.edges.circles(0.5)[:1], mate_end(BOLT))),
        "about another axis than plate.face('hole 1')",
    ),
    "seat": (
        lambda: asm.Insert(HOLE, SHANK, seats=(PLATE.edges.lines()[:1], SHANK)),
        "seats[0] is plate.edges[0], a line",
    ),
    "seat body": (
        lambda: asm.Insert(HOLE, SHANK, seats=[mate_end(BOLT)] * 2),
        "seats[0] is on body 'bolt'; expected one",
    ),
    "both full": (lambda: asm.Concentric(BALL.face(), CONE.face()), "both full; expected one hollow, one full"),
    "no ball": (
        lambda: asm.Concentric(BALL.face(), PLATE.face("top")),
        "b is plate.face('top'), a plane; expected a sphere",
    ),
    "one side": (lambda: asm.Width(PLATE.faces(">X"), BOLT.faces("|Z")[:2]), "slot is 1 faces: 'right'"),
    "not parallel": (
        lambda: asm.Width((PLATE.face("top"), PLATE.face("left")), BOLT.faces("|Z")[:2]),
        "are not parallel",
    ),
    "two bodies": (lambda: asm.Width((PLATE.face("top"), BOLT.faces("<Z")), BOLT.faces("|Z")[:2]), "faces of one body"),
    "side": (lambda: asm.Tangent(HOLE, SHANK, side="left"), "side is 'left'; expected 'outside' or 'inside'"),
    "a side for a name": (lambda: asm.Tangent(HOLE, SHANK, "inside"), "expected side='inside', or another name"),
    "axes for a name": (lambda: asm.Coaxial(HOLE, SHANK, "opposed"), "expected axes='opposed', or another name"),
    "one face twice": (lambda: asm.Width([PLATE.face("top")] * 2, BOLT.faces("|Z")[:2]), "plate.face('top') twice"),
    "mirror": (lambda: asm.Symmetric(BALL.face(), BOLT.point(0, 0, 0), BOLT.faces("<Z")), "on body 'bolt' of a or b"),
    "group of one": (lambda: asm.Group([PLATE]), "bodies is ['plate']; expected two or more"),
    "group twice": (lambda: asm.Group([PLATE, PLATE]), "body 'plate' is named twice"),
    "poses": (lambda: asm.Group([PLATE, BOLT], poses=[asm.Pose()]), "poses is 1 poses; expected 2, one for each body"),
}
WRONG_KIND = {
    "a point for a plane": (
        lambda: asm.Flush(PLATE.face("top"), BOLT.point(0, 0, 0)),
        "face_b is bolt.point(0, 0, 0); expected",
    ),
    "a body for a plane": (lambda: asm.Flush(PLATE, BOLT.faces("<Z")), "face_a is Body('plate'"),
    "a frame for a point": (
        lambda: asm.Symmetric(BALL.frame(), BOLT.point(0, 0, 0), PLATE.face("top")),
        "a is ball.frame(",
    ),
    "an edge for a plane": (
        lambda: asm.Flush(PLATE.edges.circles()[:1], BOLT.faces("<Z")),
        "plate.edges[12], a circle",
    ),
    "a name": (lambda: asm.Coaxial("hole 1", SHANK), "a is 'hole 1'; expected a cylinder"),
    "a frame in a cone": (lambda: asm.Concentric(BALL.frame(), CONE.face()), "a is ball.frame("),
    "a face for two": (
        lambda: asm.Width(PLATE.face("top"), BOLT.faces("|Z")[:2]),
        "slot is plate.face('top'); expected two",
    ),
    "an edge for a face": (lambda: asm.Tangent(PLATE.edges[0], SHANK), "a is plate.edges[0]; expected a face"),
    "no body": (lambda: asm.Group([PLATE, SHANK]), "bodies[1] is bolt.face('wall 2'); expected a Body"),
    "an unknown setting": (lambda: asm.Flush(PLATE.face("top"), BOLT.faces("<Z"), slide=1.0), "unexpected keyword"),
    "frame first": (
        lambda: asm.PointOnPlane(PLATE.frame(), BOLT.point(0, 0, 0)),
        "frame is bolt.point(0, 0, 0); expected a frame",
    ),
    "line first": (
        lambda: asm.PointOnLine(PLATE.frame(), BOLT.point(0, 0, 0)),
        "frame is bolt.point(0, 0, 0); expected a frame",
    ),
}


@pytest.mark.parametrize("case", [*REFUSED, *WRONG_KIND])
def test_bad_input_is_named_with_what_came_and_what_was_expected(case):
    call, text = {**REFUSED, **WRONG_KIND}[case]
    errors = InputError if case in REFUSED or case == "an edge for a plane" else TypeError
    with pytest.raises(errors) as caught:
        call()
    assert text in str(caught.value)


def test_joints_of_points_take_what_has_a_center():
    corner, rim = PLATE.vertices(">X and >Y and >Z"), BOLT.edges.of(SHANK).circles()[:1]
    made = asm.Distance(corner, rim, 3.0)
    assert np.array_equal(made.frame_a.origin, corner.one().center)
    assert np.array_equal(made.frame_b.origin, rim.one().center)
    assert np.array_equal(asm.Spherical(BALL.face(), corner).frame_a.origin, BALL.face().center)
    beside = asm.PointOnLine(BALL.face(), HOLE, distance=2.0)
    assert beside.frame_a.body is PLATE and np.array_equal(beside.frame_a.axes[:, 2], HOLE.axis)
    above = asm.PointOnPlane(rim, PLATE.faces(">Z"), offset=2.0)
    assert np.array_equal(above.frame_a.axes[:, 2], PLATE.face("top").normal)


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda: asm.Distance(PLATE.face("top"), BALL.face(), 2.0), InputError, "a plane; expected a point of a body"),
        (
            lambda: asm.PointOnLine(BALL.face(), PLATE.face("top")),
            InputError,
            "frame is plate.*a plane; expected a c",
        ),
        (lambda: asm.PointOnPlane(BALL.face(), HOLE), InputError, "frame is plate.*a cylinder; expected a flat face"),
        (lambda: asm.PointOnPlane(PLATE.face("top"), BALL.frame()), InputError, "point is plate.*a plane; expected a"),
        (lambda: asm.Revolute(HOLE, SHANK), TypeError, r"expected a frame, body.frame\(...\) or face.frame\(\), or a"),
        (lambda: asm.Distance(PLATE.vertices, BALL.face(), 2.0), InputError, "plate.vertices is .* vertices"),
    ],
)
def test_features_that_are_no_points(call, error, text):
    with pytest.raises(error, match=text):
        call()
