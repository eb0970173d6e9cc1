"""build123d's parts as bodies, placed back, and its joints: where `connect_to` puts them, and in closed loops."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

import assembly as asm

bd = pytest.importorskip("build123d", reason="needs build123d, in an environment of its own: packaging/check_cad.py")

AXIS, REFERENCE = ((1, 2, 3), (1, 1, 2)), (1, -1, 0)


def location(random):
    return bd.Location(tuple(random.uniform(-3, 3, 3)), tuple(random.uniform(-170, 170, 3)))


def two_boxes():
    random = np.random.default_rng(0)
    boxes = [bd.Box(1, 2, 3), bd.Box(1, 2, 3)]
    for box, label in zip(boxes, "ab", strict=True):
        box.label, box.location = label, location(random)
    return *boxes, random


def rigid(part, random):
    return bd.RigidJoint("l", part, part.location * location(random))


def rows(part):
    move = part.location.wrapped.Transformation()
    return np.array([[move.Value(i, j) for j in (1, 2, 3, 4)] for i in (1, 2, 3)])


TIES = {
    "rigid": (lambda a, b, r: bd.RigidJoint("r", a, a.location * location(r)).connect_to(rigid(b, r)), {}),
    "revolute": (
        lambda a, b, r: bd.RevoluteJoint("r", a, bd.Axis(*AXIS), None, (0, 270)).connect_to(rigid(b, r), angle=200),
        {"a.r-b.l.angle": math.radians(200)},
    ),
    "revolute with a reference": (
        lambda a, b, r: bd.RevoluteJoint("r", a, bd.Axis(*AXIS), REFERENCE, (0, 270)).connect_to(
            rigid(b, r), angle=200
        ),
        {"a.r-b.l.angle": math.radians(200)},
    ),
    "from the rigid joint": (
        lambda a, b, r: rigid(a, r).connect_to(bd.RevoluteJoint("r", b, bd.Axis(*AXIS), None, (0, 270)), angle=100),
        {"a.l-b.r.angle": math.radians(100)},
    ),
    "linear": (
        lambda a, b, r: bd.LinearJoint("r", a, bd.Axis(*AXIS), (-3, 10)).connect_to(rigid(b, r), position=4),
        {"a.r-b.l.slide": 4.0},
    ),
    "cylindrical": (
        lambda a, b, r: bd.CylindricalJoint("r", a, bd.Axis(*AXIS), REFERENCE, (-3, 10), (0, 200)).connect_to(
            rigid(b, r), position=4, angle=50
        ),
        {"a.r-b.l.angle": math.radians(50), "a.r-b.l.slide": 4.0},
    ),
    "linear to revolute": (
        lambda a, b, r: bd.LinearJoint("r", a, bd.Axis(*AXIS), (-3, 10)).connect_to(
            bd.RevoluteJoint("l", b, bd.Axis((0, 1, 0), (1, 0, 3)), None, (0, 180)), position=4, angle=35
        ),
        {"a.r-b.l, position.slide": 4.0, "a.r-b.l, angle.angle": math.radians(35)},
    ),
    "ball": (
        lambda a, b, r: bd.BallJoint("r", a, a.location * location(r), ((-90, 90), (-80, 80), (-90, 90))).connect_to(
            rigid(b, r), angles=(30, 40, -50)
        ),
        {f"a.r-b.l, {axis}.angle": math.radians(turn) for axis, turn in zip("xyz", (30, 40, -50), strict=True)},
    ),
    "ball without ranges": (
        lambda a, b, r: bd.BallJoint("r", a, a.location * location(r)).connect_to(rigid(b, r), angles=(30, 40, 50)),
        None,
    ),
}


@pytest.mark.parametrize("name", TIES)
def test_where_connect_to_puts_parts_the_joint_holds_with_its_value(name):
    tie, values = TIES[name]
    a, b, random = two_boxes()
    tie(a, b, random)
    before = rows(b)
    solution = asm.cad.solve([a, b])
    assert solution.success and solution.iterations == 0
    assert (rows(b) == before).all()
    assert values is None or solution.values == pytest.approx(values, abs=1e-12)


@pytest.mark.parametrize("name", TIES)
def test_a_part_that_was_moved_away_comes_back_to_the_joint(name):
    tie, _ = TIES[name]
    a, b, random = two_boxes()
    tie(a, b, random)
    stays = rows(a)
    b.location = b.location * location(random)
    solution = asm.cad.solve([a, b])
    assert solution.success and (rows(a) == stays).all()
    assert asm.cad.solve([a, b]).iterations == 0


@pytest.mark.parametrize(("joint", "value"), [("revolute", 37.0), ("linear", 7.5)])
def test_driven_values_are_those_that_connect_to_would_have(joint, value):
    a, b, random = two_boxes()
    TIES[joint][0](a, b, random)
    hinge = a.joints["r"]
    assert asm.cad.solve([a, b], driven={hinge: value}).success
    ours = rows(b)
    hinge.connect_to(b.joints["l"], **{"angle" if joint == "revolute" else "position": value})
    assert ours == pytest.approx(rows(b), abs=1e-12)


@pytest.mark.parametrize("name", ["ball", "ball without ranges"])
def test_a_ball_is_driven_at_three_angles(name):
    a, b, random = two_boxes()
    TIES[name][0](a, b, random)
    ball = a.joints["r"]
    assert asm.cad.solve([a, b], driven={ball: (20, 70, 10)}).success
    ours = rows(b)
    ball.connect_to(b.joints["l"], angles=(20, 70, 10))
    assert ours == pytest.approx(rows(b), abs=1e-12)
    if name == "ball":
        with pytest.raises(asm.errors.InputError, match="driven has the y 81 for .* its range, -80 to 80"):
            asm.cad.solve([a, b], driven={ball: (0, 81, 0)})


def bar(label, length):
    part = bd.Box(length, 1, 1)
    part.label = label
    bd.RigidJoint("start", part, bd.Location((-length / 2, 0, 0)))
    bd.RevoluteJoint("end", part, bd.Axis((length / 2, 0, 0), (0, 0, 1)), angular_range=(-180, 180))
    return part


def four_bar():
    bars = [bar("ground", 10), bar("crank", 4), bar("coupler", 8), bar("rocker", 7)]
    for (a, b), angle in zip(zip(bars, [*bars[1:], bars[0]], strict=True), (100, 100, 60, 90), strict=True):
        a.joints["end"].connect_to(b.joints["start"], angle=angle)
    return bars


def test_a_loop_closes_which_build123d_leaves_open():
    bars = four_bar()
    lengths = [10, 4, 8, 7]
    solution = asm.cad.solve(bars)
    assert solution.success and solution.mobility.dof == 1
    for k in range(4):
        one, other = rows(bars[k]), rows(bars[(k + 1) % 4])
        tip, start = one @ [lengths[k] / 2, 0, 0, 1], other @ [-lengths[(k + 1) % 4] / 2, 0, 0, 1]
        assert tip == pytest.approx(start, abs=1e-11)


def test_a_loop_is_driven_all_around():
    bars = four_bar()
    hinge, stays = bars[0].joints["end"], rows(bars[0])
    turns = []
    for angle in range(60, 121, 10):
        assert asm.cad.solve(bars, driven={hinge: angle}).success
        crank = stays[:, :3].T @ rows(bars[1])[:, :3]
        turns.append(math.degrees(math.atan2(crank[1, 0], crank[0, 0])))
    assert (rows(bars[0]) == stays).all()
    assert turns == pytest.approx(list(range(60, 121, 10)), abs=1e-9)


def test_ranges_are_limits():
    a, b, _ = two_boxes()
    a.location = b.location = bd.Location()
    bd.LinearJoint("r", a, bd.Axis.X, (0, 3)).connect_to(bd.RigidJoint("l", b), position=1)
    b.location = bd.Location((9, 1, 1))
    solution = asm.cad.solve([a, b])
    assert solution.success and rows(b)[:, 3] == pytest.approx([3, 0, 0], abs=1e-12)
    with pytest.raises(asm.errors.InputError, match="driven has the position 4 for 'a.r-b.l'.* its range, 0 to 3"):
        asm.cad.solve([a, b], driven={a.joints["r"]: 4})


def test_what_is_fixed_and_what_is_not_tied():
    a, b, random = two_boxes()
    with pytest.raises(asm.errors.InputError, match="no joints of the parts are tied"):
        asm.cad.solve([a, b])
    TIES["revolute"][0](a, b, random)
    b.location = bd.Location()
    stays = rows(b)
    assert asm.cad.solve([a, b], fixed="b").success and (rows(b) == stays).all()
    assert asm.cad.solve(bd.Compound(label="all", children=[a, b]), fixed=[b]).success
    for arguments, error, text in (
        ({"fixed": "c"}, asm.errors.InputError, "expected parts of the assembly: 'a', 'b'"),
        ({"driven": {a: 1}}, TypeError, "expected joints of build123d"),
        ({"driven": {a.joints["r"]: {"position": 1}}}, asm.errors.InputError, "which the joint does not leave free"),
        ({"driven": {a.joints["r"]: {"turn": 1}}}, asm.errors.InputError, "expected 'angle', 'angles' or 'position'"),
        ({"driven": 3}, TypeError, "expected a mapping"),
    ):
        with pytest.raises(error, match=text):
            asm.cad.solve([a, b], **arguments)
    with pytest.raises(asm.errors.InputError, match="a part that is not given"):
        asm.cad.solve([a])


def plates():
    box = bd.Box(4, 3, 1)
    top = box.faces().sort_by(bd.Axis.Z)[-1]
    top.label, top.color = "top", bd.Color("blue")
    plate = box - bd.Cylinder(0.5, 5)
    plate.label, plate.color = "plate", bd.Color("red")
    shared, deep = copy.copy(plate), copy.deepcopy(plate)
    shared.label, shared.location = "shared", bd.Location((1, 2, 3), (10, 20, 30))
    deep.label, deep.location = "deep", bd.Location((0, 0, 9))
    return top, plate, shared, deep


def test_parts_keep_labels_colors_and_places_and_share_faces():
    top, *parts = plates()
    bodies = asm.cad.from_build123d(parts, faces=[top], fixed=["plate"])
    assert [(body.name, body.color, body.fixed) for body in bodies] == [
        ("plate", (1.0, 0.0, 0.0), True),
        ("shared", (1.0, 0.0, 0.0), False),
        ("deep", (1.0, 0.0, 0.0), False),
    ]
    for body in bodies:
        # A face keeps its label when the part is cut, and in copies.
        assert body.face("top").face.color == (0.0, 0.0, 1.0) and len(body.faces) == 7
    assert bodies[0].faces[0].face is bodies[1].faces[0].face
    assert bodies[1].pose.position == pytest.approx([1, 2, 3], abs=1e-14)


def test_a_tree_is_placed_back_with_its_compounds():
    top, plate, shared, deep = plates()
    group = bd.Compound(label="group", children=[shared, deep])
    group.location = bd.Location((0, 0, 5))
    root = bd.Compound(label="root", children=[plate, group])
    root.location = bd.Location((7, 0, 0))
    bodies = asm.cad.from_build123d(root, faces={"upper": top}, fixed=["plate"])
    assert [body.name for body in bodies] == ["plate", "group/shared", "group/deep"]
    assert bodies[2].pose.position == pytest.approx([7, 0, 14], abs=1e-14)
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Fixed(bodies[0].frame((0, 0, 0.5)), bodies[1].frame((0, 0, -0.5))))
    solution = scene.solve()
    assert asm.cad.place(root, solution) is root
    again = asm.cad.from_build123d(root)
    assert np.abs(np.array([body.q for body in again]) - solution.q).max() < 1e-14
    assert root.location.position.X == 7 and group.location.position.Z == 5
    # The compound's own shape has moved, too.
    box = root.bounding_box()
    assert (box.min.Z, box.max.Z) == pytest.approx((-0.5, 14.5), abs=1e-6)


def test_a_builder_and_a_single_part():
    with bd.BuildPart() as builder:
        bd.Box(1, 2, 3)
    assert [(body.name, len(body.faces)) for body in asm.cad.from_build123d(builder, "cube")] == [("cube", 6)]
    with pytest.raises(TypeError, match="expected a build123d part"):
        asm.cad.from_build123d(3)
    with pytest.raises(asm.errors.InputError, match="the label of a face"):
        asm.cad.from_build123d(builder, faces=[builder.part.faces()[0]])
    with pytest.raises(asm.errors.InputError, match="thing is an empty Compound"):
        asm.cad.from_build123d(bd.Compound(children=[]))
    for thing in (3, builder.part.faces()[0]):
        with pytest.raises(TypeError, match="expected a cadquery.Assembly, or build123d parts"):
            asm.cad.solve(thing)
