"""Bad input raises at once, and the text names the argument, what came and what was expected."""

from __future__ import annotations

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly.errors import AssemblyError, InputError
from assembly.kinematics import pose as kinematics

NAN, INF = float("nan"), float("inf")
BALL = asm.shapes.sphere(1.0)
PATCH = np.array([[[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]])
KNOTS = ([0, 0, 1, 1], [0, 0, 1, 1])


def pair(**changes):
    """A fixed ball and one beside it."""
    return asm.Body("a", BALL, fixed=True), asm.Body("b", BALL, position=(2.5, 0.0, 0.0), **changes)


def touching():
    """A scene that solves: what is asked of it below is what is wrong."""
    a, b = pair()
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    return scene


def solve(*arguments, **options):
    return touching().solve(*arguments, **options)


def solve_without_moving_bodies():
    return asm.Assembly([asm.Body("a", BALL, fixed=True), asm.Body("b", fixed=True)]).solve()


def solve_with_short_reference():
    scene = touching()
    scene.minimize(asm.Posture(reference=[[0, 0, 0, 1, 0, 0, 0]]))
    return scene.solve()


def solve_from_a_stranger():
    other = touching()
    other.add(asm.Body("c", BALL, (0, 5, 0)))
    return touching().solve(other.solve())


def solve_from_before_a_change():
    scene = touching()
    solution = scene.solve()
    scene.add(asm.Body("c", BALL, (0, 5, 0)))
    return scene.solve(solution)


def set_target(value):
    _, b = pair()
    asm.PointDistance(b.point(0, 0, 0), (0, 0, 0)).target = value


def constrain_strangers():
    a, b = pair()
    asm.Assembly([a]).constrain(asm.Contact(a, b))


def constrain_twice():
    scene = touching()
    scene.constrain(asm.Contact(*scene.bodies))


def constrain_two_fixed():
    a, b = pair(fixed=True)
    asm.Assembly([a, b]).constrain(asm.Contact(a, b))


def add_twice():
    scene = touching()
    scene.add(scene.bodies[0])


def contact(a=0, b=1, **arguments):
    bodies = pair()
    return asm.Contact(bodies[a], bodies[b], **arguments)


def clearance(**arguments):
    return asm.Clearance(pair(), **arguments)


def keep_twice():
    scene = touching()
    scene.constrain(asm.Clearance(scene.bodies), asm.Clearance())
    return scene.solve()


def tracker(**options):
    scene = touching()
    return scene.tracker(scene.bodies[1].point(0, 0, 0), **options)


def track_what_cannot_hold():
    a, b = asm.Body("a", BALL, fixed=True), asm.Body("b", BALL, (5.0, 0.0, 0.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b), asm.Distance(a.point(0, 0, 0), b.point(0, 0, 0), 7.0))
    return scene.tracker(b)


def q_of(row):
    return [[0, 0, 0, 1, 0, 0, 0], row]


CASES = {
    # Shapes; tests/geometry has more.
    "control point nan": (
        lambda: asm.NurbsSurface(PATCH * [1, NAN, 1], KNOTS, (1, 1)),
        r"control_points\[0, 0, 1\] is nan; expected finite",
    ),
    "control points shape": (
        lambda: asm.NurbsSurface(PATCH[0], KNOTS, (1, 1)),
        r"control_points has shape \(2, 3\); expected \(n_u, n_v, 3\)",
    ),
    "decreasing knots": (
        lambda: asm.NurbsSurface(PATCH, ([0, 1, 0.5, 1], KNOTS[1]), (1, 1)),
        r"knots\[0\] decreases from 1 to 0.5 at index 2; expected nondecreasing knots",
    ),
    "zero weight": (
        lambda: asm.NurbsSurface(PATCH, KNOTS, (1, 1), [[1, 1], [0, 1]]),
        r"weights\[1, 0\] is 0; expected positive weights",
    ),
    # Poses.
    "position nan": (lambda: asm.Pose((0, NAN, 0)), r"position\[1\] is nan; expected finite numbers"),
    "position shape": (lambda: asm.Pose((0, 0)), r"position has shape \(2,\); expected \(3,\)"),
    "position text": (lambda: asm.Pose("here"), r"position is 'here'; expected real numbers of shape \(3,\)"),
    "position complex": (lambda: asm.Pose((0, 0, 1j)), r"position is \(0, 0, 1j\); expected real numbers"),
    "quaternion zero": (
        lambda: asm.Pose(quaternion=(0, 0, 0, 0)),
        r"quaternion is \[0.0, 0.0, 0.0, 0.0\] with norm 0; expected a unit quaternion \(w, x, y, z\)",
    ),
    "quaternion far from unit": (lambda: asm.Pose(quaternion=(1, 1, 0, 0)), "with norm 1.41421; expected a unit"),
    "quaternion a percent off": (lambda: asm.Pose(quaternion=(1.011, 0, 0, 0)), "with norm 1.011; expected a unit"),
    "quaternion huge": (lambda: asm.Pose(quaternion=(1e308, 1e308, 0, 0)), "with norm 1.41421e.308; expected a unit"),
    "quaternion inf": (lambda: asm.Pose(quaternion=(1, INF, 0, 0)), r"quaternion\[1\] is inf; expected finite"),
    "quaternion shape": (lambda: asm.Pose(quaternion=(1, 0, 0)), r"quaternion has shape \(3,\); expected \(4,\)"),
    "axis zero": (lambda: asm.Pose.from_axis_angle((0, 0, 0), 1.0), r"axis is \[0.0, 0.0, 0.0\]; expected a direction"),
    "angle": (lambda: asm.Pose.from_axis_angle((0, 0, 1), "half a turn"), "angle is 'half a turn'; expected a finite"),
    "axis position": (lambda: asm.Pose.from_axis_angle((0, 0, 1), 1.0, "x"), "position is 'x'; expected real numbers"),
    "points": (lambda: asm.Pose().apply([1, 2]), r"points has shape \(2,\); expected \(3,\)"),
    "points nan": (lambda: asm.Pose().apply([[1, 2, NAN]]), r"points\[0, 2\] is nan; expected finite numbers"),
    "points ragged": (lambda: asm.Pose().apply([[1, 2, 3], [1]]), r"points is .*; expected real numbers of shape \(3,"),
    "points number": (lambda: asm.Pose().apply(1.0), r"points has shape \(\); expected \(3,\)"),
    "rotation of zero": (lambda: kinematics.rotate((0, 0, 0, 0), (1, 0, 0)), "quaternion is .*; expected a quaternion"),
    "rotation overflow": (lambda: kinematics.rotation_matrix((1e200, 0, 0, 0)), "quaternion is .*of a length other"),
    "map of zero": (lambda: kinematics.angular_velocity_map((0, 0, 0, 0)), "quaternion is .*; expected a quaternion"),
    "retract q": (lambda: kinematics.retract(np.ones(6), np.ones(6)), r"q has shape \(6,\); expected \(7,\)"),
    "retract twist": (
        lambda: kinematics.retract(np.ones((2, 7)), np.ones(6)),
        r"twist has shape \(6,\); expected \(2, 6\)",
    ),
    "retract zero": (lambda: kinematics.retract(np.zeros(7), np.ones(6)), r"q\[..., 3:\] is \[0.0, .*other than zero"),
    "retract nan": (lambda: kinematics.retract(np.ones(7), np.full(6, NAN)), r"twist\[0\] is nan"),
    # Bodies.
    "body name": (lambda: asm.Body(""), "name is ''; expected a nonempty string"),
    "body number": (lambda: asm.Body(7), "name is 7; expected a nonempty string"),
    "body fixed": (lambda: asm.Body("a", fixed="yes"), "fixed is 'yes'; expected True or False"),
    "body position": (lambda: asm.Body("a", position=(0, 0, INF)), r"position\[2\] is inf; expected finite"),
    "body quaternion": (
        lambda: asm.Body("a", quaternion=(0, 0, 0, 0)),
        "quaternion is .* with norm 0; expected a unit",
    ),
    "body empty": (lambda: asm.Body("a", []), "shape of body 'a' is empty; expected a surface"),
    "body twins": (
        lambda: asm.Body("a", [asm.Face(BALL, name="top"), asm.Face(BALL, name="top")]),
        "shape of body 'a' has two faces named 'top'; expected distinct names",
    ),
    "face name": (
        lambda: asm.Body("a", asm.shapes.box(1, 1, 1)).face("tip"),
        "name is 'tip'; expected a face of body 'a': 'left', 'right', 'front', 'back', 'bottom', 'top'",
    ),
    "face of several": (lambda: asm.Body("a", [BALL, BALL]).face(), "name is None; expected .* 'face 1', 'face 2'"),
    "face of none": (lambda: asm.Body("a").face(), "expected a face of body 'a': none, the body has no shape"),
    "point nan": (lambda: asm.Body("a").point(0, NAN, 0), r"point\[1\] is nan; expected finite"),
    "frame at": (lambda: asm.Body("a").frame(at=(0, 0)), r"at has shape \(2,\); expected \(3,\)"),
    "frame z": (lambda: asm.Body("a").frame(z=(0, 0, 0)), r"z is \[0.0, 0.0, 0.0\]; expected a direction other than"),
    "frame x": (lambda: asm.Body("a").frame(x=(0, 0, 0)), r"x is \[0.0, 0.0, 0.0\]; expected a direction other than"),
    "frame parallel": (
        lambda: asm.Body("a").frame(z=(0, 1, 0), x=(0, -2, 0)),
        r"x is \[0.0, -1.0, 0.0\]; expected a direction that is not parallel to z \[0.0, 1.0, 0.0\]",
    ),
    # Contacts.
    "contact with itself": (lambda: contact(0, 0), "sides a and b are both on body 'a'; expected two bodies"),
    "contact shapeless": (
        lambda: asm.Contact(asm.Body("hand"), pair()[0]),
        "a is body 'hand' without a shape; expected a body with a face",
    ),
    "contact name": (lambda: contact(name="  "), "name is '  '; expected a nonempty string"),
    "contact name number": (lambda: contact(name=3), "name is 3; expected a nonempty string"),
    "contact unilateral": (lambda: contact(unilateral="no"), "unilateral is 'no'; expected True or False"),
    # Objectives.
    "target": (
        lambda: asm.PointDistance(pair()[1].point(0, 0, 0), (0, 0)),
        r"target has shape \(2,\); expected \(3,\)",
    ),
    "target set": (lambda: set_target((0, NAN, 0)), r"target\[1\] is nan; expected finite numbers"),
    "weight zero": (
        lambda: asm.PointDistance(pair()[1].point(0, 0, 0), (0, 0, 0), weight=0),
        "weight is 0; expected a positive number",
    ),
    "weight negative": (lambda: asm.Posture(weight=-1.0), "weight is -1; expected a positive number"),
    "weight vector": (lambda: asm.Posture(weight=ca.DM([1, 2])), r"weight is DM\(\[1, 2\]\); expected a finite real"),
    "target masked": (
        lambda: set_target(np.ma.array([1.0, 2.0, 3.0], mask=[False, True, False])),
        "target has masked values; expected real numbers",
    ),
    "weight nan": (lambda: asm.Posture(weight=NAN), "weight is nan; expected a finite real number"),
    "reference shape": (lambda: asm.Posture([1, 0, 0, 0]), r"reference has shape \(4,\); expected \(n, 7\)"),
    "reference": (lambda: asm.Posture(q_of([0] * 7)), r"reference\[1, 3:\] is .* with norm 0; expected a unit"),
    "reference rows": (solve_with_short_reference, "reference has 1 rows; expected one per body, 2"),
    # Assemblies.
    "same name": (
        lambda: asm.Assembly([asm.Body("a"), asm.Body("a")]),
        "body has the name 'a' of another body; expected distinct names",
    ),
    "same body": (add_twice, "body 'a' is in the assembly already; expected each body once"),
    "unknown body": (lambda: touching().body("c"), "name is 'c'; expected one of 'a', 'b'"),
    "body of an empty assembly": (lambda: asm.Assembly().body("c"), "name is 'c'; expected "),
    "foreign contact": (constrain_strangers, "a-b is on body 'b'; expected a body of this assembly: 'a'"),
    "foreign objective": (
        lambda: touching().minimize(asm.PointDistance(asm.Body("c").point(0, 0, 0), (1, 2, 3))),
        "on body 'c'; expected a body of this assembly: 'a', 'b'",
    ),
    "foreign namesake": (
        lambda: touching().maximize(asm.PointDistance(asm.Body("b").point(0, 0, 0), (1, 2, 3))),
        "on body 'b'; expected a body of this assembly",
    ),
    "same constraint": (constrain_twice, "constraint name 'a-b' is taken; expected distinct names"),
    "two fixed": (constrain_two_fixed, "constraint 'a-b' is between two fixed bodies; expected one that moves"),
    "none moving": (solve_without_moving_bodies, r"bodies are \['a', 'b'\], none moving; expected one"),
    "no bodies": (lambda: asm.Assembly().solve(), r"bodies are \[\], none moving; expected one"),
    # Solves.
    "q0 shape": (lambda: solve(np.zeros(7)), r"q0 has shape \(7,\); expected \(2, 7\)"),
    "q0 nan": (lambda: solve(q_of([0, 0, NAN, 1, 0, 0, 0])), r"q0\[1, 2\] is nan; expected finite numbers"),
    "q0 zero": (lambda: solve(q_of([0] * 7)), "q0.* 0.0.*; expected .*unit quaternion"),
    "q0 far from unit": (lambda: solve(q_of([3, 0, 0, 2, 0, 0, 0])), r"q0\[1, 3:\] is \[2.0, .* a unit quaternion"),
    "q0 of another": (solve_from_a_stranger, "q0 is a solution of another assembly, or .*; expected its own"),
    "q0 of before": (solve_from_before_a_change, "q0 is a solution of .* this one before a change; expected its own"),
    "starts unknown": (lambda: solve(starts={"b-a": [0] * 4}), "starts names 'b-a'; expected a contact: 'a-b'"),
    "starts shape": (lambda: solve(starts={"a-b": [0] * 3}), r"starts\['a-b'\] has shape \(3,\); expected \(4,\)"),
    "starts nan": (lambda: solve(starts={"a-b": [0, 0, 0, NAN]}), r"starts\['a-b'\]\[3\] is nan; expected finite"),
    "starts outside": (
        lambda: solve(starts={"a-b": [0, 1e9, 0, 0]}),
        r"starts\['a-b'\]\[1\] is 1e\+09; expected a parameter in",
    ),
    "option": (lambda: solve(tolerence=1e-9), "option 'tolerence' is unknown; expected one of tolerance, stationarity"),
    "option value": (lambda: solve(tolerance=0.0), "tolerance is 0; expected a number above 0"),
    "option nan": (lambda: solve(stationarity=NAN), "stationarity is nan; expected a finite real number"),
    "option integer": (lambda: solve(max_iterations=2.5), "max_iterations is 2.5; expected an integer"),
    "option negative": (lambda: solve(max_iterations=-1), "max_iterations is -1; expected an integer from 0"),
    # Clearances, managers and trackers.
    "clearance of one": (
        lambda: asm.Clearance(pair()[:1]),
        "bodies has 1 of them; expected two or more, or None for all",
    ),
    "clearance of none": (lambda: asm.Clearance([]), "bodies has 0 of them; expected two or more"),
    "clearance without shape": (
        lambda: asm.Clearance([*pair(), asm.Body("c")]),
        r"bodies\[2\] is 'c', a body without a shape; expected one with a face",
    ),
    "clearance of one twice": (
        lambda: asm.Clearance(2 * pair()[:1]),
        "body 'a' is named twice; expected distinct bodies",
    ),
    "minimum": (lambda: clearance(minimum=-1.0), "minimum is -1; expected a length of zero or more"),
    "minimum nan": (lambda: clearance(minimum=NAN), "minimum is nan; expected a finite real number"),
    "minimum text": (lambda: clearance(minimum="1"), "minimum is '1'; expected a finite real number"),
    "neglect": (
        lambda: clearance(merge_radius=0.0),
        "merge_radius is 0; expected a positive part of the scene's size, 1 at most",
    ),
    "neglect large": (
        lambda: clearance(merge_radius=2.0),
        "merge_radius is 2; expected a positive part of the scene's size",
    ),
    "places": (lambda: clearance(slots=0), "slots is 0; expected an integer of 1 or more"),
    "places half": (lambda: clearance(slots=1.5), "slots is 1.5; expected an integer of 1 or more"),
    "exclude": (lambda: clearance(exclude=[pair()[0]]), r"exclude\[0\] is .*; expected a pair of bodies"),
    "exclude strangers": (
        lambda: clearance(exclude=[pair()]),
        r"exclude\[0\] names body 'a'; expected bodies of this clearance",
    ),
    "clearance name": (lambda: clearance(name=""), "name is ''; expected a nonempty string"),
    "clearance of strangers": (
        lambda: touching().constrain(clearance()),
        "clearance a-b is on body 'a'; expected a body of this assembly",
    ),
    "two clearances of a pair": (
        keep_twice,
        "'clearance' is of bodies 'a' and 'b', of which clearance 'clearance a-b' is, too; expected each pair once",
    ),
    "manager of one": (lambda: asm.Manager(pair()[:1]), "bodies has 1 of them; expected two or more"),
    "manager of namesakes": (
        lambda: asm.Manager([pair()[0], pair()[0]]),
        r"bodies\[1\] has the name 'a' of another body; expected distinct names",
    ),
    "reach": (lambda: asm.Manager(pair(), reach=-1.0), "reach is -1; expected a length from 0 to 0.69"),
    "reach far": (lambda: asm.Manager(pair(), reach=3.0), "reach is 3; expected a length from 0 to 0.69"),
    "reach nan": (lambda: asm.Manager(pair(), reach=NAN), "reach is nan; expected a finite real number"),
    "manager neglect": (
        lambda: asm.Manager(pair(), merge_radius=0.0),
        "merge_radius is 0; expected a positive part of the scene's size",
    ),
    "manager places": (lambda: asm.Manager(pair(), slots=-1), "slots is -1; expected an integer of 1 or more"),
    "stiffness": (lambda: tracker(stiffness=0.0), "stiffness is 0; expected a positive number"),
    "budget": (lambda: tracker(budget=-1.0), "budget is -1; expected a positive number"),
    "tracker iterations": (lambda: tracker(iterations=0), "iterations is 0; expected an integer from 1 to 1000"),
    "tracker tolerance": (lambda: tracker(tolerance=1.0), "tolerance is 1; expected a part of the scene's size from"),
    "second order": (lambda: tracker(second_order=1), "second_order is 1; expected True or False"),
    "tracker q0": (lambda: tracker(q0=np.zeros(7)), r"q0 has shape \(7,\); expected \(2, 7\)"),
    "no start": (
        track_what_cannot_hold,
        "q0 leads to no pose at which the constraints hold; expected one that does: .*conflicting",
    ),
    "solution body an array": (
        lambda: solve().pose(np.array([1, 2])),
        r"body is array\(\[1, 2\]\); expected one of 'a', 'b'",
    ),
    "solution body": (lambda: solve().pose("c"), "body is 'c'; expected one of 'a', 'b'"),
}


@pytest.mark.parametrize("case", CASES)
def test_bad_input_is_named_with_what_came_and_what_was_expected(case):
    call, text = CASES[case]
    with pytest.raises(InputError, match=text) as caught:
        call()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, AssemblyError)
    assert "expected" in str(caught.value)


TYPES = {
    "shape": (lambda: asm.Body("a", 3.0), "shape of body 'a' is 3.0; expected NurbsSurface, Face or several"),
    "shapes": (lambda: asm.Body("a", [BALL, "box"]), "shape of body 'a' holds 'box'; expected NurbsSurface or Face"),
    "side": (lambda: asm.Contact(pair()[0], BALL), "b is NurbsSurface.*; expected a Body or one of its faces"),
    "point": (lambda: asm.PointDistance((0, 0, 0), (1, 2, 3)), r"point is \(0, 0, 0\); expected a point of a body"),
    "body": (lambda: asm.Assembly(["a"]), "body is 'a'; expected a Body"),
    "constraint": (lambda: touching().constrain("a-b"), "constraint is 'a-b'; expected a Contact"),
    "objective": (lambda: touching().minimize(3.0), "objective is 3.0; expected an objective such as PointDistance"),
    "clearance body": (lambda: asm.Clearance(["a", "b"]), r"bodies\[0\] is 'a'; expected a Body"),
    "excluded body": (
        lambda: clearance(exclude=[("a", "b")]),
        r"exclude\[0\] is \('a', 'b'\); expected a pair of bodies",
    ),
    "manager bodies": (lambda: asm.Manager(3.0), "bodies is 3.0; expected bodies"),
    "manager body": (lambda: asm.Manager([BALL, BALL]), r"bodies\[0\] is NurbsSurface.*; expected a Body"),
    "follow": (
        lambda: touching().tracker((0, 0, 0)),
        r"follow\[0\] is 0; expected a Point, a Frame, a Body or a joint",
    ),
    "starts an array": (lambda: solve(starts=np.array([1, 2])), r"starts is array\(\[1, 2\]\); expected a mapping"),
    "starts zero": (lambda: solve(starts=0), "starts is 0; expected a mapping of constraint name to parameters"),
    "starts a text": (lambda: solve(starts=""), "starts is ''; expected a mapping"),
    "starts false": (lambda: solve(starts=False), "starts is False; expected a mapping"),
    "starts an empty list": (lambda: solve(starts=[]), r"starts is \[\]; expected a mapping"),
    "pose": (lambda: setattr(pair()[0], "pose", (0, 0, 0)), r"pose is \(0, 0, 0\); expected a Pose"),
}


@pytest.mark.parametrize("case", TYPES)
def test_a_wrong_kind_of_object_is_a_type_error(case):
    call, text = TYPES[case]
    with pytest.raises(TypeError, match=text):
        call()


def test_what_was_refused_leaves_no_trace():
    scene = touching()
    before = scene.solve()
    for call in (
        lambda: scene.add(asm.Body("a")),
        lambda: scene.constrain(asm.Contact(scene.bodies[0], asm.Body("c", BALL))),
        lambda: scene.minimize(asm.PointDistance(asm.Body("c").point(0, 0, 0), (1, 2, 3))),
    ):
        with pytest.raises(InputError):
            call()
    assert (len(scene.bodies), len(scene.constraints), len(scene.objectives)) == (2, 1, 0)
    assert scene.solve(before).success  # the solution is still one of this scene


@pytest.mark.parametrize("name", ["a", "b", "name", "unilateral"])
def test_contacts_cannot_be_changed(name):
    with pytest.raises(AttributeError):
        setattr(contact(), name, True)


@pytest.mark.parametrize("name", ["weight", "reference", "bodies"])
def test_weights_and_references_cannot_be_changed(name):
    # They are packed once, so a change would go unnoticed.
    with pytest.raises(AttributeError):
        setattr(asm.Posture(), name, 2.0)
    with pytest.raises(ValueError, match="read-only"):
        asm.Posture(q_of([0, 0, 0, 1, 0, 0, 0])).reference[0] = 1.0


HALF = "half \ud800 of a pair"


@pytest.mark.parametrize(
    "make",
    [
        lambda: asm.Body(HALF),
        lambda: asm.Face(asm.shapes.plane(1, 1), name=HALF),
        lambda: asm.NurbsSurface(PATCH, KNOTS, (1, 1), name=HALF),
        lambda: asm.NurbsCurve.polyline([(0, 0), (1, 1)], name=HALF),
        lambda: asm.Revolute(asm.Body("a"), asm.Body("b"), HALF),
        lambda: asm.Clearance(name=HALF),
    ],
)
def test_names_that_no_file_can_hold_are_refused(make):
    with pytest.raises(InputError, match=r"name is 'half .ud800 of a pair' with '.ud800' at 5; expected"):
        make()


def test_a_name_of_a_face_that_was_set_anew_is_checked_by_its_body(tmp_path):
    face = asm.Face(asm.shapes.sphere(1.0))
    for name, said in ((HALF, "with"), (5, "expected a nonempty string")):
        face.name = name
        with pytest.raises(InputError, match=rf"shape\[0\].name is .* {said}"):
            asm.Body("a", face)
    scene = asm.Assembly([asm.Body("a", asm.shapes.sphere(1.0))])
    with pytest.raises(InputError, match="title is 'half"):
        asm.view.save_html(tmp_path / "page.html", scene, title=HALF)
    # A name in another encoding than UTF-8, as a system may have it.
    asm.view.save_html(tmp_path / "caf\udce9.html", scene)
