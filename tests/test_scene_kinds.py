"""Joints, couplings, expressions and drawn frames in scene files: every kind comes back to the bit."""

from __future__ import annotations

import copy
import json
import re
from math import inf, pi

import casadi as ca
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import assembly as asm
from assembly import scene_file
from assembly.constraints.model.joint import Joint
from assembly.errors import InputError
from assembly.kinematics.frame import Frame
from assembly.scene_file.kinds import CONSTRAINTS, OBJECTIVES

THIRD = 1.0 / 3.0


def mixed(bodies, values=1):
    """A function of poses with constants that have no short decimals."""
    poses = [ca.SX.sym(f"p{k}", 7) for k in range(bodies)]
    parts = [
        ca.sin(THIRD * poses[0][k]) + 0.1 * poses[-1][0] * poses[-1][k] - ca.exp(poses[0][3]) / 7 for k in range(values)
    ]
    return ca.Function("mixed", poses, [ca.vertcat(*parts)])


def bodies_in_space():
    """A fixed body and two that move."""
    ball = asm.shapes.sphere(THIRD)
    return (
        asm.Body("ground", ball, fixed=True),
        asm.Body('crank "1"\n', ball, (0.3, -0.0, 1e-3), (0.99, 0.1, 0.05, 0.02), density=0.1),
        asm.Body("wheel \N{SNOWMAN}", None, (1.0, 2.0, THIRD), (0.5, -0.5, 0.5, 0.5)),
    )


def every_mate(ground, crank, wheel, plate, pin):
    hole, shank = plate.faces.cylinders(hole=True), pin.faces.cylinders()
    return (
        asm.Flush(plate.faces(">Z"), pin.faces("<Z"), offset=THIRD, axes="nearest", x=0.1, angle_limits=(None, 0.2)),
        asm.Coaxial(hole, shank, axes="opposed", slide_limits=(-THIRD, None)),
        asm.Coaxial(plate.edges("|Z and >X and >Y"), wheel.frame((0.1, THIRD, 0)), angle=0.1),
        asm.Insert(hole, shank, offset=THIRD, limits=(0.0, THIRD)),
        asm.Insert(plate.edges.circles()[1:], pin.edges.circles()[:1], "edges", axes="nearest", angle=0.1),
        asm.Concentric(ground.faces, crank.face(), "balls", twist=0.1),
        asm.Width(plate.faces("|X"), pin.faces("|Z"), y_limits=(None, 1.0)),
        asm.Tangent(ground.face(), shank, side="inside", unilateral=True),
        asm.Tangent(plate.faces(">Z"), shank, "lies"),
        asm.Tangent(hole, shank, side="inside", touch="point"),
        asm.Symmetric(crank.face(), wheel.point(THIRD, 0, 0), plate.faces("<Y")),
        asm.Symmetric(pin.edges.circles()[:1], plate.vertices(">X and >Y and >Z"), ground.frame(), "corners"),
        asm.Group([wheel, plate, pin]),
    )


def every_constraint():
    """A scene with every kind of constraint, couplings before their joints, and numbers that have no short decimals."""
    ground, crank, wheel = bodies_in_space()
    here = ground.frame((THIRD, -0.0, 1e-300), (0.1, 0.2, 0.3), (1.0, -1.0, 0.7))
    there = crank.frame((0.1, 0.2, 0.3), (-1.0, 0.3, 0.1))
    point = wheel.point(THIRD, 1e22, -7.1)
    hinge = asm.Revolute(here, there, axes="opposed", angle=-0.0, limits=(-7.0, None))
    slider = asm.Prismatic(crank, wheel.frame((0.1, 0.0, 0.0)), "slider", slide=0.1, limits=(0.1, 1e22))
    shaft = asm.Cylindrical(here, wheel, angle_limits=(None, 4.0 * pi), slide=THIRD, axes="opposed")
    couplings = [
        asm.Gear(hinge, shaft.freedom("angle"), -13.0 / 7.0, offset=0.1),
        asm.RackPinion(hinge.freedom("angle"), slider, -THIRD, "rack", offset=-0.2),
    ]
    joints = [
        hinge,
        slider,
        shaft,
        asm.Fixed(there, wheel, axes="opposed"),
        asm.Screw(here, there, -0.1, slide_limits=(-0.1, 0.3), angle=2e-17),
        asm.Planar(here, there, axes="opposed", offset=THIRD, x=0.1, y_limits=(0.0, None), angle_limits=(-1, 1)),
        asm.Spherical(there, point, swing_limits=(None, THIRD), azimuth=1e3, twist_limits=(-0.1, 0.7)),
        asm.Universal(here, there, angle_a=0.7, angle_b_limits=(-inf, 0.9)),
        asm.Parallel(here, wheel, axes="opposed", limits=(-0.1, 0.1)),
        asm.Perpendicular(here, wheel),
        asm.PointOnLine(point, here, slide=-0.3, limits=(-THIRD, None)),
        asm.PointOnPlane(point, there, offset=-1e-9, x_limits=(None, 1.1), y=0.1),
        asm.Distance(point, ground.point(0.1, 0.2, 0.3), THIRD, limits=(0.1, 0.7)),
        asm.Distance(crank, wheel, limits=(THIRD, None), name="at least"),
        asm.Angle(here, wheel, 0.1),
        asm.Angle(there, wheel, name="between", limits=(0.2, 0.3)),
    ]
    beside = [
        asm.PointOnLine(point, there, distance=THIRD, slide=0.1),
        asm.PointOnLine(point, ground, "beside", distance=None, distance_limits=(0.1, None)),
    ]
    touch = asm.Contact(ground, crank, "touch", edges=True)
    corners = np.array([[0.1, 0.2], [THIRD, 0.2], [0.3, 0.7], [0.1, 0.2]])
    loop = asm.NurbsCurve(corners, [0, 0, 1, 2, 3, 3], 1)
    plate = asm.Body("plate", asm.shapes.plate(3, 2, 1, [(THIRD, 0.1, 0.2)]), (4.0, THIRD, 0.0))
    pin = asm.Body("pin", asm.shapes.solid_cylinder(0.2, 3.0), (5.0, 1.0, THIRD), (0.6, 0.0, 0.8, 0.0))
    scene = asm.Assembly([ground, crank, wheel, plate, pin])
    scene.constrain(
        *couplings,
        touch,
        *joints,
        asm.TrimContact(touch, loop, "inside", "cartesian", side="b", name="kept"),
        asm.ContactPlace(touch, "a", (THIRD, None), 0.1),
        asm.Clearance([ground, crank], THIRD, merge_radius=0.1, slots=3, exclude=[(crank, ground)]),
        *every_mate(ground, crank, wheel, plate, pin),
        asm.Linear(slider, shaft, -THIRD, "slides", offset=0.1),
        asm.ConstantVelocity(here, there, axes="nearest", swing=0.3, azimuth_limits=(None, 0.1)),
        *beside,
        asm.Expression(mixed(3, 2), [wheel, ground, crank], unilateral=True, scale=0.1, weight=THIRD),
    )
    scene.minimize(
        asm.FrameDistance(there, asm.Pose((0.1, 0.2, THIRD), (0.3, 0.5, -0.7, 0.41)), weight=0.1),
        asm.FrameDistance(wheel, asm.Pose(), length=THIRD),
        asm.PointDistance(point, (0.1, 0.2, 0.3)),
        asm.Expression(mixed(2), [crank, wheel], "bent", weight=0.1),
    )
    scene.maximize(
        asm.Posture(weight=1e-3),
        asm.Expression(mixed(1), [wheel], scale=2.0),
        asm.Dexterity(point, [hinge, shaft.freedom("slide")], "isotropy"),
        asm.Dexterity(there, [hinge], "force_transmission", direction=(0, 0, 1, THIRD, 0, 0), length=0.3, weight=0.1),
        asm.Dexterity(there, [hinge], task="pose", axes=("xy", "z"), ignoring=joints[:2], holding=joints[2:4]),
        asm.Weight([crank, ground], (0.1, -0.2, THIRD), 9.81),
        asm.ContactPlace(touch, "b", (-0.1, THIRD), THIRD, name="drawn"),
    )
    return scene


def reread(scene, path):
    scene.save(path)
    return asm.load(path)


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.json"
    every_constraint().save(path)
    return json.loads(path.read_text())


@pytest.fixture
def load_document(tmp_path):
    def load(document):
        path = tmp_path / "changed.json"
        path.write_text(json.dumps(document))
        return asm.load(path)

    return load


def assert_same_frame(came, expected):
    assert came.body.name == expected.body.name
    assert came.origin.tobytes() == expected.origin.tobytes()
    assert came.axes.tobytes() == expected.axes.tobytes()
    assert came.axes.flags.c_contiguous == expected.axes.flags.c_contiguous  # products depend on it
    assert not (came.origin.flags.writeable or came.axes.flags.writeable)


def assert_same_constraint(came, expected):
    assert type(came) is type(expected) and came.name == expected.name and repr(came) == repr(expected)
    assert [body.name for body in came.bodies] == [body.name for body in expected.bodies]
    for name in ("offset", "pitch", "axes", "ratio", "radius", "unilateral", "edges", "scale", "weight"):
        assert getattr(came, name, None) == getattr(expected, name, None)
    if isinstance(expected, Joint):
        assert_same_frame(came.frame_a, expected.frame_a)
        assert_same_frame(came.frame_b, expected.frame_b)
        for name, freedom in expected.freedoms.items():
            value, limits = came.freedom(name).value, came.freedom(name).limits
            assert (repr(value), limits) == (repr(freedom.value), freedom.limits)  # -0.0 is not 0.0
    if isinstance(expected, asm.Expression):
        assert came.document() == expected.document()
    for row, other in zip(getattr(came, "equations", ()), getattr(expected, "equations", ()), strict=True):
        assert row.current() == other.current() and row.one_sided == other.one_sided


def test_every_kind_is_tried():
    scene = every_constraint()
    kinds = {kind for record in CONSTRAINTS.kinds.values() for kind in record.kinds}
    # A tangent is one of two others, as its faces are.
    assert kinds - {asm.Tangent} == {type(item) for item in scene.constraints}
    assert {record.kind for record in OBJECTIVES.kinds.values()} == {type(term) for _, term in scene.objectives}


def test_every_joint_that_is_public_has_a_kind():
    public = {getattr(asm, name) for name in asm.__all__ if isinstance(getattr(asm, name), type)}
    joints = {cls for cls in public if issubclass(cls, Joint)}
    assert len(joints) == 20 and joints <= {record.kind for record in CONSTRAINTS.kinds.values()}


@pytest.mark.parametrize(("kinds", "heading"), [(CONSTRAINTS, "constraint"), (OBJECTIVES, "term")])
def test_the_heading_names_every_field(kinds, heading):
    told = {}
    for line in scene_file.__doc__.partition(f"Fields of a {heading}")[2].split("\n\n")[1].splitlines():
        word, _, names = re.sub(r"\{.*?\}", "", re.sub(r"\[.*?\]", "", line)).strip().partition(" ")
        told[word] = [name.split()[0] for name in names.split(",")]
    common = {"name"} if kinds is CONSTRAINTS else set()
    assert {word: set(names) | common for word, names in told.items()} == {
        word: {item.name for item in record.fields} for word, record in kinds.kinds.items()
    }


def test_every_kind_comes_back_to_the_bit(tmp_path):
    scene = every_constraint()
    again = reread(scene, tmp_path / "scene.json")
    for came, expected in zip(again.constraints, scene.constraints, strict=True):
        assert_same_constraint(came, expected)
    for (sign, came), (other_sign, expected) in zip(again.objectives, scene.objectives, strict=True):
        assert sign == other_sign and type(came) is type(expected) and came.weight == expected.weight
        if isinstance(expected, asm.FrameDistance):
            assert_same_frame(came.frame, expected.frame)
            assert came.length == expected.length
            assert came.target.q.tobytes() == expected.target.q.tobytes()
            assert came.body_quaternion.tobytes() == expected.body_quaternion.tobytes()
        if isinstance(expected, asm.Expression):
            assert_same_constraint(came, expected)


def test_couplings_are_of_the_joints_of_their_scene(tmp_path):
    again = reread(every_constraint(), tmp_path / "scene.json")
    joints = {item.name: item for item in again.constraints}
    gear, rack = again.constraints[:2]
    assert gear.leader is joints['revolute ground-crank "1"\n'].freedom("angle") is rack.leader
    assert gear.follower is joints["cylindrical ground-wheel \N{SNOWMAN}"].freedom("angle")
    assert rack.follower is joints["slider"].freedom("slide")


def test_the_text_is_the_same_every_time(tmp_path):
    one, two, three = (tmp_path / name for name in ("one", "two", "three"))
    every_constraint().save(one)
    every_constraint().save(two)
    reread(every_constraint(), three).save(three)
    assert one.read_bytes() == two.read_bytes() == three.read_bytes()
    assert one.read_bytes().isascii()


def test_the_loop_is_given_the_same_numbers(tmp_path):
    scene = every_constraint()
    again = reread(scene, tmp_path / "scene.json")
    for one in (scene, again):
        one.solve(max_iterations=0)  # writes values and targets
    assert again.packed().table.tobytes() == scene.packed().table.tobytes()
    assert again.packed().pool.tobytes() == scene.packed().pool.tobytes()


def four_bar():
    """Universal, spherical and two revolute joints in space; the crank driven, the rocker drawn to a pose."""
    ground, crank, coupler, rocker = (asm.Body(name, fixed=name == "ground") for name in ("ground", "c", "d", "r"))
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(
        asm.Revolute(ground, crank, "crank", angle=0.3),
        asm.Spherical(crank.frame((1, 0, 0)), coupler, "ball"),
        asm.Universal(coupler.frame((3, 0, 0)), rocker.frame((0, 2, 0), (1, 0, 0)), "cross"),
        asm.Revolute(ground.frame((3, 0, 0.5), (0, 1, 0.2)), rocker, "rocker", limits=(-2.0, 2.0)),
    )
    scene.minimize(asm.Posture(weight=1e-3), asm.FrameDistance(coupler, asm.Pose((1.0, THIRD, 0.1)), weight=0.1))
    return scene


def gear_train():
    """A wheel, a pinion that it drives, and the pinion's rack; couplings come before their joints."""
    ground, wheel, pinion, rack = (asm.Body(name, fixed=name == "ground") for name in ("ground", "w", "p", "r"))
    hinge = asm.Revolute(ground, wheel, angle=THIRD)
    axle = asm.Revolute(ground.frame((3, 0, 0)), pinion, axes="opposed")
    slide = asm.Prismatic(ground.frame((3, 1, 0), (1, 0, 0)), rack, limits=(-4.0, 0.1))
    scene = asm.Assembly([ground, wheel, pinion, rack])
    scene.constrain(
        asm.Gear(hinge, axle, -13.0 / 7.0, offset=0.1), asm.RackPinion(axle, slide, 0.7), hinge, axle, slide
    )
    return scene


def bent():
    """Values of a function held and made small, and a limit that is reached."""
    ground, block = asm.Body("ground", fixed=True), asm.Body("block", position=(0.3, 0.2, 0.1))
    pose = ca.SX.sym("pose", 7)
    x, y, z = pose[0], pose[1], pose[2]
    scene = asm.Assembly([ground, block])
    scene.constrain(
        asm.Planar(ground, block, x_limits=(THIRD, None)),
        asm.Expression(ca.Function("curve", [pose], [y - ca.sin(x) / 3 + ca.exp(z) - 1]), [block], scale=0.1),
    )
    scene.minimize(asm.Expression(ca.Function("far", [pose], [(x + 0.1) ** 2 + y**2]), [block]), asm.Posture())
    return scene


@pytest.mark.parametrize("make", [four_bar, gear_train, bent])
def test_the_scene_that_comes_back_solves_to_the_same_bits(make, tmp_path):
    scene = make()
    again = reread(scene, tmp_path / "scene.json")
    solution, other = scene.solve(), again.solve()
    assert solution.success
    assert other.q.tobytes() == solution.q.tobytes()
    assert (other.objective, other.iterations) == (solution.objective, solution.iterations)
    for name, multipliers in solution.multipliers.items():
        assert other.multipliers[name].tobytes() == multipliers.tobytes()


unit = st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: np.linalg.norm(v) > 1e-3)
place = st.tuples(*[st.floats(-1e150, 1e150)] * 3)


@given(place, unit, unit, st.floats(allow_nan=False, allow_infinity=False), st.floats(0.0, exclude_min=True))
def test_numbers_come_back_to_the_bit(tmp_path_factory, origin, z, x, value, reach):
    path = tmp_path_factory.getbasetemp() / "numbers.json"
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    if np.linalg.norm(np.cross(z, x)) < 1e-6:
        x = None
    hinge = asm.Revolute(ground.frame(origin, z, x), arm, angle=value, limits=(value, None))
    upper = min(reach, 1e149)
    scene = asm.Assembly([ground, arm])
    scene.constrain(hinge, asm.Distance(hinge.frame_a, arm, limits=(None, upper)))
    again = reread(scene, path)
    for came, expected in zip(again.constraints, scene.constraints, strict=True):
        assert_same_constraint(came, expected)


def test_values_that_were_set_are_saved(tmp_path):
    scene = four_bar()
    crank, rocker = scene.constraints[0], scene.constraints[3]
    crank.angle, rocker.limits = None, (THIRD, None)
    scene.objectives[1][1].target = asm.Pose((0.0, 0.1, 0.2))
    again = reread(scene, tmp_path / "scene.json")
    assert again.constraints[0].angle is None and again.constraints[3].limits == (THIRD, None)
    assert again.objectives[1][1].target.position.tolist() == [0.0, 0.1, 0.2]


def test_couplings_of_joints_elsewhere_are_refused_before_a_file_is_touched(tmp_path):
    scene = gear_train()
    gear, _, hinge, axle, slide = scene.constraints
    path = tmp_path / "scene.json"
    partial = asm.Assembly(scene.bodies)
    partial.constrain(axle, slide, gear)
    partial.solve()  # the scene itself is a good one
    text = r"constraints\[2\].a is freedom 'angle' of joint 'revolute ground-w', which is not in the assembly; expected"
    with pytest.raises(InputError, match=text):
        partial.save(path)
    # A joint that happens to have the name is another joint.
    partial.constrain(asm.Revolute(hinge.frame_a, hinge.frame_b))
    with pytest.raises(InputError, match=text):
        partial.save(path)
    assert not path.exists()


def test_integers_and_limits_without_ends_are_read(document, load_document):
    document = copy.deepcopy(document)
    joint = document["constraints"][3]
    joint.update(
        angle=1, limits=[None, None], frame_a={"body": "ground", "origin": [1, 0, 0], "axes": np.eye(3).tolist()}
    )
    hinge = load_document(document).constraints[3]
    assert (repr(hinge.angle), hinge.limits, hinge.frame_a.origin.tolist()) == ("1.0", None, [1.0, 0.0, 0.0])


MISSING = object()
HINGE, SLIDER, SHAFT, SCREW, PLANE, LINE, HELD, LEAST, CURVE = 3, 4, 5, 7, 8, 13, 15, 16, -1
HALF = [[1.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 0.0, 1.0]]
LEFT = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]
CASES = {
    "type": (
        [HINGE, "type"],
        "hinge",
        r'.type is "hinge"; expected one of contact, fixed, .*, rack_pinion, trim_contact, .*, clearance, expression$',
    ),
    "type of a term": ([HINGE, "type"], "posture", r'.type is "posture"; expected one of contact'),
    "missing": ([HINGE, "limits"], MISSING, " has no field 'limits'; expected the fields type, name, frame_a, frame_b"),
    "unknown": ([HINGE, "slide"], None, " has the unknown field 'slide'; expected only type, name, frame_a"),
    "of another joint": ([HINGE, "type"], "prismatic", " has no field 'slide'; expected the fields type, name"),
    "frame": ([HINGE, "frame_a"], "ground", '.frame_a is "ground"; expected an object with the fields body, origin'),
    "frame body": ([HINGE, "frame_a", "body"], "?", r".frame_a.body: name is '\?'; expected one of 'ground'"),
    "same body": ([HINGE, "frame_b", "body"], "ground", ".frame_a and frame_b are both on body 'ground'; expected two"),
    "same body, line": ([LINE, "frame", "body"], "wheel \N{SNOWMAN}", ".frame and point are both on body"),
    "origin": ([HINGE, "frame_a", "origin"], [0, 0], ".frame_a.origin is a list of 2; expected a list of 3"),
    "origin nan": ([HINGE, "frame_a", "origin", 2], inf, r".frame_a.origin\[2\] is Infinity; expected a finite number"),
    "axes table": ([HINGE, "frame_b", "axes", 1], [1, 0], r".frame_b.axes\[1\] is a list of 2; expected a list of 3"),
    "axes length": ([HINGE, "frame_b", "axes"], HALF, r".frame_b.axes is \[\[1.0, .*; expected unit vectors x, y, z"),
    "axes huge": ([HINGE, "frame_b", "axes", 0, 0], 1e308, r".frame_b.axes is \[\[1e\+308.*; expected unit vectors"),
    "axes almost": ([HINGE, "frame_b", "axes", 0, 0], 1 + 1e-6, r".frame_b.axes is .*; expected unit vectors x, y, z"),
    "axes left": ([HINGE, "frame_b", "axes"], LEFT, ".frame_b.axes is .*, left-handed; expected z = x cross y"),
    "axes word": ([HINGE, "axes"], "along", ".axes is 'along'; expected 'aligned', 'opposed' or 'nearest'"),
    "axes null": ([HINGE, "axes"], None, ".axes is null; expected a string"),
    "driven": ([HINGE, "angle"], "1", '.angle is "1"; expected a finite number'),
    "driven true": ([HINGE, "angle"], True, ".angle is true; expected a finite number"),
    "driven beyond": ([HINGE, "angle"], -8, r".angle is -8.0 with limits \(-7, inf\); expected a value within"),
    "limits": ([HINGE, "limits"], 3, ".limits is 3; expected a list of 2"),
    "limits short": ([HINGE, "limits"], [1], ".limits is a list of 1; expected a list of 2"),
    "limit": ([HINGE, "limits", 1], inf, r".limits\[1\] is Infinity; expected a finite number"),
    "limits crossed": ([SLIDER, "limits"], [1, 0], r".limits is \(1, 0\); expected lower <= upper"),
    "limits by name": ([SHAFT, "slide_limits"], [1, 0], r".slide_limits is \(1, 0\); expected lower <= upper"),
    "pitch": ([SCREW, "pitch"], 0, ".pitch is 0; expected the travel per turn"),
    "pitch null": ([SCREW, "pitch"], None, ".pitch is null; expected a finite number"),
    "offset": ([PLANE, "offset"], None, ".offset is null; expected a finite number"),
    "distance": ([HELD, "value"], 0, ".value is 0.0; expected a distance above zero"),
    "not held": ([LEAST, "limits"], None, ".value is None without limits; expected a number or limits that bind"),
    "side": ([0, "a"], "hinge", '.a is "hinge"; expected an object with the fields joint, freedom'),
    "joint": ([0, "a", "joint"], "gear", r".a.joint is \"gear\"; expected a joint of the file: 'revolute ground"),
    "joint number": ([0, "a", "joint"], 3, ".a.joint is 3; expected a string"),
    "freedom": ([0, "a", "freedom"], "slide", ".a.freedom: name is 'slide'; expected a coordinate of .*: 'angle'"),
    "freedom null": ([0, "a", "freedom"], None, ".a.freedom is null; expected a string"),
    "no angle": ([0, "b", "freedom"], "slide", r".b is Freedom\(.*; expected a joint coordinate that is an angle"),
    "ratio": ([0, "ratio"], 0, ".ratio is 0; expected the turns of b"),
    "radius": ([1, "radius"], 0, ".radius is 0; expected the travel of the rack"),
    "taken": ([6, "name"], "touch", ": constraint name 'touch' is taken; expected distinct names"),
    "function": ([CURVE, "function"], "1 1 f", '.function is "1 1 f"; expected a list'),
    "function line": ([CURVE, "function", 2], 3, r".function\[2\] is 3; expected a string"),
    "instruction": ([CURVE, "function", 2], "mil 1 1 1", ".function line 3 is 'mil 1 1 1'; expected an instruction"),
    "no function": ([CURVE, "function"], [], ".function line 1 is ''; expected the numbers of bodies"),
    "fewer values": ([CURVE, "function", 0], "3 3 mixed", ".function has 2 values; expected 3"),
    "fewer bodies": ([CURVE, "bodies"], ["ground"], r".bodies are \['ground'\]; expected 3, one for each input"),
    "expression body": ([CURVE, "bodies", 0], "?", r".bodies\[0\]: name is '\?'; expected one of"),
    "body twice": ([CURVE, "bodies", 0], "ground", ": body 'ground' is named twice"),
    "scale": ([CURVE, "scale"], 0, ".scale is 0; expected a positive number"),
    "expression weight": ([CURVE, "weight"], -1, ".weight is -1; expected a positive number"),
}
TERMS = {
    "frame": ([0, "frame", "body"], "?", r".frame.body: name is '\?'; expected one of 'ground'"),
    "target": ([0, "target"], [0, 0, 0], ".target is a list of 3; expected an object with the fields position, quat"),
    "target position": ([0, "target", "position"], [0], r".target.position has shape \(1,\); expected \(3,\)"),
    "target turn": ([0, "target", "quaternion", 0], 2, r".target.quaternion is .* with norm 2.*; expected a unit"),
    "length": ([0, "length"], 0.0, ".length is 0; expected a positive number"),
    "length null": ([0, "length"], None, ".length is null; expected a finite number"),
    "values": ([3, "function", 0], "2 2 mixed", ".function has 1 values; expected 2"),
    "sign": ([3, "sign"], 2, r".sign is 2; expected 1 \(minimized\) or -1 \(maximized\)"),
    "no sign": ([3, "sign"], MISSING, " has no field 'sign'; expected the fields type, sign, name, bodies, function"),
}


@pytest.mark.parametrize(
    ("key", "case"),
    [("constraints", case) for case in CASES] + [("objective", case) for case in TERMS],
)
def test_what_is_wrong_is_named_by_its_path(key, case, document, load_document, tmp_path):
    (number, *way), value, text = (CASES if key == "constraints" else TERMS)[case]
    changed = copy.deepcopy(document)
    place = changed[key][number]
    for step in way[:-1]:
        place = place[step]
    if value is MISSING:
        del place[way[-1]]
    else:
        place[way[-1]] = value
    number %= len(changed[key])
    with pytest.raises(InputError, match=f"^{re.escape(str(tmp_path))}/changed.json: {key}\\[{number}\\]{text}"):
        load_document(changed)


def test_expressions_of_several_values_are_no_terms(document, load_document):
    changed = copy.deepcopy(document)
    changed["objective"].append({"sign": 1, **changed["constraints"][CURVE]})
    with pytest.raises(InputError, match=r"objective\[11\]: objective '.*' has 2 values; expected one"):
        load_document(changed)


def test_a_frame_of_any_layout_is_saved(tmp_path):
    ground, arm = asm.Body("ground", fixed=True), asm.Body("arm")
    axes = np.asfortranarray(arm.frame((0, 0, 0), (1, 2, 3)).axes)
    scene = asm.Assembly([ground, arm])
    scene.constrain(asm.Fixed(ground, Frame(arm, np.zeros(3), axes)))
    again = reread(scene, tmp_path / "scene.json")
    np.testing.assert_array_equal(again.constraints[0].frame_b.axes, axes)


def test_dexterities_and_places_come_back_as_they_were(tmp_path):
    scene = every_constraint()
    back = reread(scene, tmp_path / "scene.json")
    (drawn,) = (term for _, term in back.objectives if isinstance(term, asm.ContactPlace))
    kept = back.constraints[[item.name for item in scene.constraints].index("place touch")]
    assert (drawn.side, drawn.target, drawn.weight, drawn.name) == (1, (-0.1, THIRD), THIRD, "drawn")
    assert (kept.side, kept.target, kept.weight) == (0, (THIRD, None), 0.1)
    assert drawn.contact is kept.contact is back.constraints[2]
    tasks = [term.tip_task for _, term in back.objectives if isinstance(term, asm.Dexterity)]
    assert [task.axes for task in tasks] == ["xyz", ("xyz", "xyz"), ("xy", "z")]
    given = [term.tip_task for _, term in scene.objectives if isinstance(term, asm.Dexterity)][-1]
    for name in ("ignoring", "holding"):
        names = [item.name for item in getattr(tasks[-1], name)]
        assert names == [item.name for item in getattr(given, name)] and len(names) == 2


def test_a_dexterity_of_version_4_counts_all_axes(document, load_document):
    old = copy.deepcopy(document)
    old["version"] = 4
    old["constraints"] = [item for item in old["constraints"] if item["type"] != "contact_place"]
    old["objective"] = [item for item in old["objective"] if item["type"] != "contact_place"]
    for item in old["objective"]:
        for name in ("axes", "ignoring", "holding"):
            item.pop(name, None)
    for item in old["constraints"]:
        if item["type"] == "contact":
            item.pop("minimum")
    tasks = [term.tip_task for _, term in load_document(old).objectives if isinstance(term, asm.Dexterity)]
    assert [(task.rows, task.ignoring, task.holding) for task in tasks] == [(3, (), ()), (6, (), ()), (6, (), ())]
