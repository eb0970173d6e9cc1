from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.constraint import Constraint, structure_changes
from assembly.constraints.model.joint import Driven, Joint
from assembly.constraints.model.mate_features import Mate
from assembly.constraints.program.primitives import ANGLE, AZIMUTH, COINCIDENT, DISTANCE, DOT, SLIDE, SWING, TURN
from assembly.errors import InputError

NAN, INF, PI = math.nan, math.inf, math.pi
POINT = [(COINCIDENT, 0), (COINCIDENT, 1), (COINCIDENT, 2)]
AXIS = [(SWING, 0), (SWING, 1)]
LINE = [(SLIDE, 0), (SLIDE, 1)]
ALONG, TWIST, ZZ, AROUND = (SLIDE, 2), (TURN, 0), (DOT, 8), (AZIMUTH, 2)
# What each joint asks, and what it leaves free.
JOINTS = {
    asm.Fixed: ([*POINT, *AXIS, TWIST], {}),
    asm.Revolute: ([*POINT, *AXIS], {"angle": TWIST}),
    asm.Prismatic: ([*LINE, *AXIS, TWIST], {"slide": ALONG}),
    asm.Cylindrical: ([*LINE, *AXIS], {"angle": TWIST, "slide": ALONG}),
    asm.Screw: ([*LINE, *AXIS, ALONG], {"angle": TWIST, "slide": ALONG}),
    asm.Planar: ([*AXIS, ALONG], {"x": (SLIDE, 0), "y": (SLIDE, 1), "angle": TWIST}),
    asm.Spherical: (POINT, {"swing": (ANGLE, 0), "azimuth": AROUND, "twist": TWIST}),
    asm.Universal: ([*POINT, ZZ], {"angle_a": AROUND, "angle_b": AROUND}),
    asm.ConstantVelocity: ([*POINT, TWIST], {"swing": (ANGLE, 0), "azimuth": AROUND}),
    asm.Parallel: (AXIS, {"angle": TWIST}),
    asm.Perpendicular: ([ZZ], {}),
    asm.PointOnLine: (LINE, {"slide": ALONG}),
    asm.PointOnPlane: ([ALONG], {"x": (SLIDE, 0), "y": (SLIDE, 1)}),
    asm.Distance: ([], {"distance": (DISTANCE, 0)}),
    asm.Angle: ([], {"angle": (ANGLE, 0)}),
}
# What a joint needs besides its two sides.
NEEDED = {asm.Screw: {"pitch": 3.0}, asm.Distance: {"value": 2.0}, asm.Angle: {"value": 1.0}}
DRIVES = [(joint, name) for joint, (_, free) in JOINTS.items() if joint not in NEEDED for name in free]
OPPOSABLE = [asm.Fixed, asm.Revolute, asm.Prismatic, asm.Cylindrical, asm.Screw, asm.Planar, asm.Parallel]
OPPOSABLE.append(asm.ConstantVelocity)
POINTED = [asm.PointOnLine, asm.PointOnPlane]


def bodies(*names):
    return [asm.Body(name) for name in names or ("ground", "crank")]


def make(joint, **arguments):
    return joint(*bodies(), **{**NEEDED.get(joint, {}), **arguments})


def limits_of(joint, name):
    return "limits" if len(JOINTS[joint][1]) == 1 else f"{name}_limits"


def rows(joint):
    return [(row.terms[0][1].kind, row.terms[0][1].component) for row in joint.equations]


@pytest.mark.parametrize("joint", JOINTS)
def test_what_a_joint_asks_and_leaves_free(joint):
    asked, free = JOINTS[joint]
    made = make(joint)
    own = [row for row in made.equations if not row.is_drive]
    assert [(r.terms[0][1].kind, r.terms[0][1].component) for r in own] == (asked or list(free.values()))
    assert len(own) == len(made.equations) and not any(row.one_sided for row in own)
    assert {name: (f.coordinate.kind, f.coordinate.component) for name, f in made.freedoms.items()} == free
    assert all(f.joint is made and f.name == name for name, f in made.freedoms.items())
    assert all(row.terms[0][0] == 1.0 for row in own)
    assert [row.value for row in own] == [row.current() for row in own]


def test_every_joint_is_public():
    public = {kind for name in asm.__all__ if isinstance(kind := getattr(asm, name), type)}
    assert {kind for kind in public if issubclass(kind, Joint) and not issubclass(kind, Mate)} == set(JOINTS)
    assert issubclass(asm.Contact, Constraint) and issubclass(asm.Gear, Constraint)


@pytest.mark.parametrize("joint", JOINTS)
def test_names(joint):
    words = {"PointOnLine": "point-on-line", "PointOnPlane": "point-on-plane", "ConstantVelocity": "constant-velocity"}
    kind = words.get(joint.__name__, joint.__name__.lower())
    a, b = ("crank", "ground") if joint in POINTED else ("ground", "crank")
    made = make(joint)
    assert made.name == f"{kind} {a}-{b}"
    assert repr(made).startswith(f"{joint.__name__}({a!r}, {b!r}, name={made.name!r}")
    assert [body.name for body in made.bodies] == [a, b]
    assert make(joint, name="pin").name == "pin"


@pytest.mark.parametrize(("joint", "name"), DRIVES, ids=lambda v: getattr(v, "__name__", v))
class TestFreedoms:
    def test_driving_adds_a_row_that_follows_the_value(self, joint, name):
        made = make(joint, **{name: 0.25})
        free = make(joint)
        assert len(made.equations) == len(free.equations) + 1
        row = made.equations[-1]
        (coefficient, coordinate), freedom = row.terms[0], made.freedom(name)
        assert (coefficient, coordinate, row.is_drive, row.one_sided) == (1.0, freedom.coordinate, True, False)
        assert row.source == (freedom, "value")
        setattr(made, name, 0.5)
        assert row.current() == row.value == getattr(made, name) == freedom.value == 0.5
        freedom.value = None
        assert getattr(made, name) is None and rows(made) == rows(free)

    def test_limits_add_one_sided_rows(self, joint, name):
        limits = limits_of(joint, name)
        made = make(joint, **{limits: (0.25, 0.75)})
        below, above = made.equations[-2:]
        assert [(row.one_sided, row.is_drive) for row in (below, above)] == [(True, True)] * 2
        # A coordinate c within (0.25, 0.75): c >= 0.25, and -c >= -0.75.
        assert (below.terms[0][0], below.current(), above.terms[0][0], above.current()) == (1.0, 0.25, -1.0, -0.75)
        setattr(made, limits, (0.5, None))
        assert below.current() == 0.5
        assert getattr(made, limits) == made.freedom(name).limits == (0.5, None)
        assert len(made.equations) == len(make(joint).equations) + 1
        setattr(made, limits, [-INF, 0.5])
        assert made.equations[-1].current() == -0.5 and getattr(made, limits) == (None, 0.5)
        setattr(made, limits, None)
        assert getattr(made, limits) is None and len(made.equations) == len(make(joint).equations)

    def test_a_driven_freedom_needs_no_rows_for_its_limits(self, joint, name):
        made = make(joint, **{name: 0.5, limits_of(joint, name): (0.25, 0.75)})
        assert [row.source[1] for row in made.equations if row.is_drive] == ["value"]
        setattr(made, name, None)
        assert [row.source[1] for row in made.equations if row.is_drive] == ["lower", "upper"]

    def test_only_a_change_of_rows_counts(self, joint, name):
        made, limits = make(joint), limits_of(joint, name)
        changes = [
            (name, 0.5, 1),
            (name, 0.6, 0),
            (limits, (0.1, 1.0), 0),  # driven: there are no rows for limits
            (name, None, 1),
            (limits, (0.2, 0.9), 0),
            (limits, (None, 0.9), 1),
            (limits, (None, None), 1),
            (limits, None, 0),
            (name, None, 0),
        ]
        for attribute, value, expected in changes:
            before = structure_changes()
            setattr(made, attribute, value)
            assert structure_changes() - before == expected, (attribute, value)

    def test_a_value_outside_the_limits_raises_and_changes_nothing(self, joint, name):
        limits = limits_of(joint, name)
        with pytest.raises(InputError, match=rf"^{name} is 0.9 with {limits} \(0.25, 0.75\); expected a value within"):
            make(joint, **{name: 0.9, limits: (0.25, 0.75)})
        made = make(joint, **{name: 0.5, limits: (0.25, 0.75)})
        before = structure_changes()
        for attribute, value in ((name, 0.9), (limits, (0.6, 0.75)), (limits, (0.6, 0.1)), (name, NAN)):
            with pytest.raises(InputError):
                setattr(made, attribute, value)
        assert (getattr(made, name), getattr(made, limits), structure_changes()) == (0.5, (0.25, 0.75), before)
        setattr(made, name, 0.75)  # on the limit is within

    @pytest.mark.parametrize("value", [NAN, INF, "1", True, [1.0]])
    def test_a_value_that_is_no_number(self, joint, name, value):
        with pytest.raises(InputError, match=rf"^{name} is .*; expected a finite real number"):
            make(joint, **{name: value})
        with pytest.raises(InputError, match=rf"^{name} is .*; expected a finite real number"):
            setattr(make(joint), name, value)

    @pytest.mark.parametrize(
        ("value", "text"),
        [
            ((1.0, 0.5), r" is \(1, 0.5\); expected lower <= upper"),
            ((NAN, 1.0), r"\[0\] is nan; expected a finite real number"),
            ((0.0, NAN), r"\[1\] is nan; expected a finite real number"),
            ((INF, None), r"\[0\] is inf; expected a finite real number"),
            ((None, -INF), r"\[1\] is -inf; expected a finite real number"),
            (("0", 1.0), r"\[0\] is '0'; expected a finite real number"),
            (1.0, r" is 1.0; expected \(lower, upper\), None for a side without limit"),
            ("ab", r" is 'ab'; expected \(lower, upper\)"),
            ((1.0, 2.0, 3.0), r" is \(1.0, 2.0, 3.0\); expected \(lower, upper\)"),
        ],
    )
    def test_bad_limits(self, joint, name, value, text):
        limits = limits_of(joint, name)
        with pytest.raises(InputError, match=f"^{limits}{text}"):
            make(joint, **{limits: value})
        with pytest.raises(InputError, match=f"^{limits}{text}"):
            setattr(make(joint), limits, value)


def test_order_of_rows():
    made = make(asm.Planar, y=0.5, angle_limits=(0, 1), x_limits=(None, 2), angle=None)
    tail = [(row.source[0].name, row.source[1]) for row in made.equations[3:]]
    assert tail == [("y", "value"), ("x", "upper"), ("angle", "lower"), ("angle", "upper")]


def test_units():
    assert [f.coordinate.is_angle for f in make(asm.Planar).freedoms.values()] == [False, False, True]
    assert all(f.coordinate.is_angle for f in make(asm.Spherical).freedoms.values())
    assert not make(asm.Distance).freedom().coordinate.is_angle
    assert [row.terms[0][1].is_angle for row in make(asm.Universal).equations] == [False] * 3 + [True]
    assert [row.terms[0][1].is_angle for row in make(asm.Fixed).equations] == [False] * 3 + [True] * 3


def test_freedom_by_name():
    hinge, shaft = make(asm.Revolute), make(asm.Cylindrical)
    assert hinge.freedom() is hinge.freedom("angle") is hinge.freedoms["angle"]
    with pytest.raises(
        InputError, match="name is None; expected a coordinate of 'cylindrical ground-crank': 'angle', 'sl"
    ):
        shaft.freedom()
    with pytest.raises(InputError, match="name is 'slide'; expected a coordinate of 'revolute ground-crank': 'angle'$"):
        hinge.freedom("slide")
    with pytest.raises(InputError, match=r"name is \[\]; expected a coordinate"):
        hinge.freedom([])
    with pytest.raises(InputError, match="none, the joint leaves no coordinate free"):
        make(asm.Fixed).freedom()
    with pytest.raises(TypeError):
        hinge.freedoms["slide"] = hinge.freedom()


def test_coordinates_of_a_joint_share_its_frames():
    for joint in JOINTS:
        made = make(joint)
        pairs = {id(c.frames) for row in made.equations for _, c in row.terms}
        pairs |= {id(f.coordinate.frames) for f in made.freedoms.values()}
        assert len(pairs) == (2 if joint is asm.Universal else 1)
        assert made.equations[0].terms[0][1] is made.equations[0].terms[0][1]  # made once


def test_universal_measures_its_second_angle_from_the_other_side():
    made = make(asm.Universal)
    a, b = (made.freedom(name).coordinate.frames for name in ("angle_a", "angle_b"))
    assert (b.frame_a, b.frame_b) == (a.frame_b, a.frame_a)
    assert a.frame_a is made.frame_a and a.frame_b is made.frame_b


@pytest.mark.parametrize("joint", OPPOSABLE)
def test_opposed_turns_frame_b_about_its_x_axis(joint):
    a, b = bodies()
    frame = b.frame(at=(1, 2, 3), z=(1, 2, 2), x=(0, 1, 0))
    aligned, opposed = (joint(a, frame, **NEEDED.get(joint, {}), axes=axes) for axes in ("aligned", "opposed"))
    assert (aligned.axes, opposed.axes) == ("aligned", "opposed")
    assert opposed.frame_b is aligned.frame_b is aligned.equations[0].terms[0][1].frames.frame_b is frame
    flipped = opposed.equations[0].terms[0][1].frames.frame_b
    assert np.array_equal(flipped.axes, frame.axes * [1, -1, -1]) and np.linalg.det(flipped.axes) > 0
    assert flipped.origin is frame.origin and flipped.body is b
    assert "axes='opposed'" in repr(opposed) and "axes" not in repr(aligned)


@pytest.mark.parametrize("axes", ["Aligned", "", None, 1, ["aligned"]])
@pytest.mark.parametrize("joint", OPPOSABLE)
def test_axes_are_one_of_two_words(joint, axes):
    with pytest.raises(InputError, match="axes is .*; expected 'aligned', 'opposed' or 'nearest'"):
        make(joint, axes=axes)


@pytest.mark.parametrize("joint", sorted(set(JOINTS) - set(OPPOSABLE), key=str))
def test_joints_whose_axes_may_point_anywhere_take_no_axes(joint):
    with pytest.raises(TypeError, match="axes"):
        make(joint, axes="aligned")


@pytest.mark.parametrize("joint", JOINTS)
def test_two_sides_on_one_body(joint):
    body = asm.Body("crank")
    a, b = {asm.Distance: ("point_a", "point_b")}.get(joint, ("frame_a", "frame_b"))
    if joint in POINTED:
        a, b = "frame", "point"
    with pytest.raises(InputError, match=f"{a} and {b} are both on body 'crank'; expected two bodies"):
        joint(body, body.frame(at=(1, 0, 0)), **NEEDED.get(joint, {}))


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("side", [0, 1])
def test_sides_of_a_wrong_kind(joint, side):
    names = {
        asm.Distance: ("point_a", "point_b"),
        asm.PointOnLine: ("point", "frame"),
        asm.PointOnPlane: ("point", "frame"),
    }
    name = names.get(joint, ("frame_a", "frame_b"))[side]
    sides = bodies()
    sides[side] = "crank"
    with pytest.raises(TypeError, match=f"^{name} is 'crank'; expected a"):
        joint(*sides, **NEEDED.get(joint, {}))
    sides[side] = asm.Body("crank").point(1, 2, 3)
    takes_point = joint in (asm.Distance, asm.Spherical) or (joint in POINTED and side == 0)
    if takes_point:
        made = joint(*sides, **NEEDED.get(joint, {}))
        frame = made.frame_a if made.frame_a.body is sides[side].body else made.frame_b
        assert np.array_equal(frame.origin, [1, 2, 3]) and np.array_equal(frame.axes, np.eye(3))
    else:
        with pytest.raises(TypeError, match=rf"^{name} is crank.point\(1, 2, 3\); expected a frame, body.frame"):
            joint(*sides, **NEEDED.get(joint, {}))


@pytest.mark.parametrize("joint", JOINTS)
@pytest.mark.parametrize("name", ["", "  ", 3])
def test_bad_names(joint, name):
    with pytest.raises(InputError, match=f"name is {name!r}; expected a nonempty string"):
        make(joint, name=name)


# Rows that hold a number.


def test_screw():
    made = make(asm.Screw, pitch=-3.0, angle=1.0)
    (one, slide), (factor, turn) = made.equations[4].terms
    assert (slide, turn) == (made.freedom("slide").coordinate, made.freedom("angle").coordinate)
    assert (one, factor, made.pitch, made.equations[4].source) == (1.0, 3.0 / (2.0 * PI), -3.0, None)
    assert made.angle == 1.0 and made.slide is None


@pytest.mark.parametrize(
    ("pitch", "text"), [(0, "0; expected the travel"), (NAN, "nan; exp"), ("3", "'3'; expected a")]
)
def test_bad_pitch(pitch, text):
    with pytest.raises(InputError, match=f"^pitch is {text}"):
        make(asm.Screw, pitch=pitch)


@pytest.mark.parametrize("joint", [asm.Planar, asm.PointOnPlane])
def test_offset(joint):
    assert make(joint).offset == 0.0
    made = make(joint, offset=2.0)
    row = made.equations[JOINTS[joint][0].index(ALONG)]
    before = structure_changes()
    made.offset = -1.5
    assert row.current() == made.offset == -1.5 and row.source == (made, "offset")
    assert structure_changes() == before
    for value in (NAN, None, "2"):
        with pytest.raises(InputError, match="^offset is .*; expected a finite real number"):
            made.offset = value
        with pytest.raises(InputError, match="^offset is .*; expected a finite real number"):
            make(joint, offset=value)
    assert made.offset == -1.5


@pytest.mark.parametrize(("joint", "name"), [(asm.Distance, "distance"), (asm.Angle, "angle")])
def test_distance_and_angle_hold_a_value_or_limits(joint, name):
    a, b = bodies()
    made = joint(a, b, 2.0, "rod")
    assert made.name == "rod" and made.value == made.freedom(name).value == 2.0 and repr(made).endswith("value=2.0)")
    (row,) = made.equations
    assert not row.is_drive and not row.one_sided and row.current() == 2.0
    made.value = 1.5
    assert row.current() == 1.5
    with pytest.raises(InputError, match="value is None without limits; expected a number or limits that bind"):
        made.value = None
    made.limits = (1.0, 3.0)
    made.value = None
    assert [(r.current(), r.one_sided, r.is_drive) for r in made.equations] == [(1.0, True, True), (-3.0, True, True)]
    with pytest.raises(InputError, match="value is None without limits"):
        made.limits = None
    for limits in (None, (None, None), (0.0, None), (0.0, INF)):  # a distance and an angle are never below zero
        with pytest.raises(InputError, match="value is None without limits"):
            joint(a, b, limits=limits)
    assert len(joint(a, b, limits=(0.0, 1.0)).equations) == 1
    with pytest.raises(InputError, match=r"value is 3.0 with limits \(1, 2\)"):
        joint(a, b, 3.0, limits=(1.0, 2.0))


@pytest.mark.parametrize("value", [0.0, -1.0])
def test_no_distance(value):
    with pytest.raises(InputError, match=f"value is {value}; expected a distance above zero; .* Spherical"):
        make(asm.Distance, value=value)
    with pytest.raises(InputError, match=r"limits is \(-2, 0\); expected limits .* between 0 and 1e\+150"):
        make(asm.Distance, value=None, limits=(-2, 0))


@pytest.mark.parametrize("value", [0.0, PI, -0.5, 4.0])
def test_no_angle_between_axes(value):
    with pytest.raises(InputError, match=f"value is {value}; expected an angle between 0 and pi.*Parallel.*opposed"):
        make(asm.Angle, value=value)
    with pytest.raises(InputError, match=f"swing is {value}; expected an angle between 0 and pi"):
        make(asm.Spherical, swing=value)
    with pytest.raises(InputError, match="limits is .*; expected limits that leave values between 0 and 3.14"):
        make(asm.Angle, value=None, limits=(PI, 4.0))


def test_a_cone_has_one_row():
    assert len(make(asm.Spherical, swing_limits=(0.0, 0.5)).equations) == 4
    made = make(asm.Spherical, swing_limits=(0.1, PI))
    assert [row.source[1] for row in made.equations[3:]] == ["lower"]
    before = structure_changes()
    made.swing_limits = (0.0, 0.5)  # one row as before, but the other one
    assert structure_changes() == before + 1


@pytest.mark.parametrize("value", [NAN, INF, "2"])
@pytest.mark.parametrize("joint", [asm.Distance, asm.Angle])
def test_distance_and_angle_of_no_number(joint, value):
    with pytest.raises(InputError, match="^value is .*; expected a finite real number"):
        make(joint, value=value)


def test_a_constraint_names_a_body_once():
    a, b = bodies()
    with pytest.raises(InputError, match="body 'ground' is named twice; expected distinct bodies"):
        Constraint((a, b, a), None)
    assert Constraint((a, b), None).name == "ground-crank"


def test_what_can_be_seen():
    made = make(asm.Cylindrical, angle=0.5, slide_limits=(None, 2))
    assert repr(made) == (
        "Cylindrical('ground', 'crank', name='cylindrical ground-crank', angle=0.5, slide_limits=(None, 2.0))"
    )
    assert repr(made.freedom("slide")) == "Freedom('cylindrical ground-crank', 'slide', slide_limits=(None, 2.0))"
    assert "FramePair('ground', 'crank')" in repr(made.equations[0])
    assert isinstance(asm.Cylindrical.angle, Driven) and "[rad]" in asm.Cylindrical.angle.__doc__
    assert "slide" in asm.Cylindrical.slide_limits.__doc__ and "Height" in asm.Planar.offset.__doc__


def test_joints_go_to_other_processes():
    made = pickle.loads(pickle.dumps(make(asm.Revolute, angle=0.5)))
    assert made.freedom().joint is made and made.equations[-1].current() == 0.5
