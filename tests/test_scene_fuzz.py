"""Whatever happens to a valid scene file, it loads or says what is wrong."""

from __future__ import annotations

import copy
import json
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import casadi as ca
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import assembly as asm
from assembly.errors import InputError
from assembly.scene_file.kinds import CONSTRAINTS, OBJECTIVES

# Of examples: 50, or 150 with --long.
COUNT = settings.default.max_examples


@cache
def small_document():
    """Every kind of thing, and as little of it as there can be, so that changes hit every kind of field."""
    patch = asm.NurbsSurface([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], [[0, 0, 1, 1]] * 2, (1, 1))
    corners = np.array([[0, 0], [1, 0], [0, 1], [0, 0]])
    outer, inner = (
        asm.NurbsCurve(size * corners + at, [0, 0, 1, 2, 3, 3], 1) for size, at in ((0.75, 0.125), (0.25, 0.25))
    )
    trimmed = asm.Face(patch, outer, [inner], name="top", color=(0.5, 0, 1))
    shapes = {"a": trimmed, "b": asm.Face(patch, name="top"), "c": [trimmed]}
    a, b, c = (asm.Body(name, shape, fixed=name == "a", color=(1, 0, 0.5)) for name, shape in shapes.items())
    pose = ca.SX.sym("pose", 7)
    f = ca.Function("f", [pose], [ca.fmax(pose[0] * pose[1], 2.5) + ca.sin(pose[2])])
    hinge, slider = asm.Revolute(a, b, "h", angle=0.5, limits=(0, 1)), asm.Prismatic(a, c, "s", limits=(None, 1))
    screw = asm.Screw(a, c, 2.0, angle_limits=(None, 1))
    plate = asm.Body("d", asm.shapes.plate(4, 4, 1, [(0, 0, 1)]))
    pin, sphere = asm.Body("e", asm.shapes.solid_cylinder(1, 2)), asm.shapes.sphere(1)
    ball, twin = asm.Body("f", sphere), asm.Body("g", sphere)
    scene = asm.Assembly([a, b, c, plate, pin, ball, twin])
    touch = asm.Contact(a, b.face("top"))
    scene.constrain(
        asm.Gear(hinge, screw.freedom("angle"), 2.0),
        asm.RackPinion(hinge, slider, 2.0),
        hinge,
        slider,
        screw,
        touch,
        asm.Fixed(a, b, axes="opposed"),
        asm.Cylindrical(a, b, slide=0.5),
        asm.Planar(a, b, offset=1.0),
        asm.Spherical(a, b, swing_limits=(None, 1)),
        asm.Universal(a, b),
        asm.Parallel(a, b),
        asm.Perpendicular(a, b),
        asm.PointOnLine(a, b),
        asm.PointOnPlane(a, b),
        asm.Distance(a, b, 1.0),
        asm.Angle(a, b, limits=(0.5, None)),
        asm.TrimContact(touch, a.face().face.outer, "outside", name="t"),
        asm.TrimContact(touch, a.face().face.holes[0], name="n"),
        asm.TrimContact(touch, inner, form="cartesian", side="b"),
        asm.Clearance([a, b], 0.1, exclude=[(a, b)]),
        asm.Flush(a.face(), plate.faces(">Z")),
        asm.Coaxial(a.frame(), plate.faces.cylinders(), axes="nearest"),
        asm.Insert(plate.faces.cylinders(), pin.faces.cylinders()),
        asm.Concentric(ball.face(), twin.face()),
        asm.Width(plate.faces("|X"), pin.faces("|Z")),
        asm.Symmetric(a.point(1, 0, 0), plate.vertices(">X and >Y and >Z"), c.frame()),
        asm.Tangent(a.face(), ball.face(), side="outside"),
        asm.Group([plate, pin]),
        kept := asm.ContactPlace(touch, "a", (None, 0.5)),
        asm.Linear(slider, screw.freedom("slide"), 2.0),
        asm.ConstantVelocity(a, b),
        asm.Expression(f, [b]),
    )
    scene.minimize(
        asm.PointDistance(b.point(0, 0, 0), (1, 2, 3)), asm.FrameDistance(b, asm.Pose()), asm.Expression(f, [c])
    )
    scene.maximize(asm.Weight([pin, ball]), asm.Posture([[0, 0, 0, 1, 0, 0, 0]] * 7), asm.Dexterity(c, [hinge, slider]))
    scene.minimize(kept)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "scene.json"
        scene.save(path)
        document = json.loads(path.read_text())
    assert {item["type"] for item in document["constraints"]} == set(CONSTRAINTS.kinds)
    assert {item["type"] for item in document["objective"]} == set(OBJECTIVES.kinds)
    return document


def places(value, path=()):
    """Paths of all values in a document."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


WORDS = ["a", "b", "top", "h", "s", "a-b", "outer", "inside", "signed", "angle", "slide", "aligned", "opposed"]
WORDS += [*CONSTRAINTS.kinds, *OBJECTIVES.kinds]
SCALARS = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(),
    st.floats(),
    st.sampled_from([1e-320, 1e154, 1e308, -1e308, 10**400, 10**4000, 0, 1, -1, 2, 0.5]),
    st.text(max_size=3),
    st.sampled_from(WORDS),
)
VALUES = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=2), inner, max_size=2)
)
# Of the instructions of an expression.
TOKENS = st.sampled_from(["0", "1", "2", "-1", "7", "nan", "inf", "1e400", "", "f", "input", "output", "const"]) | (
    st.sampled_from(["add", "mul", "pow", "constpow", "sq", "if_else_zero", "not", "erfinv", "lift", "assign", "fmod"])
)


def changed_text(draw, text):
    """A text with one of its words changed."""
    words = text.split(" ")
    words[draw(st.integers(0, len(words) - 1))] = draw(TOKENS)
    return " ".join(words)


@st.composite
def changed_documents(draw, within=()):
    """The document changed in a few places, of those below a path."""
    whole = small_document()
    document = copy.deepcopy(whole)
    for _ in range(draw(st.integers(1, 3))):
        *way, last = draw(
            st.sampled_from([path for path in places(document) if path[: len(within)] == within and path != within])
        )
        place = document
        for key in way:
            place = place[key]
        match draw(st.sampled_from(["change", "change", "elsewhere", "delete", "repeat", "kind", "kind", "kind"])):
            case "kind" if isinstance(place[last], float):
                place[last] = draw(st.sampled_from([0.5, 0.125, -0.0, 2.0]) | st.floats(-1.0, 1.0))
            case "kind" if isinstance(place[last], str):
                place[last] = changed_text(draw, place[last])
            case "change" | "kind":
                place[last] = draw(VALUES)
            case "elsewhere":
                found = whole
                for key in draw(st.sampled_from(list(places(whole)))):
                    found = found[key]
                place[last] = copy.deepcopy(found)
            case "delete":
                del place[last]
            case "repeat":
                twin = copy.deepcopy(place[last])
                if isinstance(place, list):
                    place.insert(last, twin)
                else:
                    place[draw(st.text(max_size=2))] = twin
    return document


def check(path, document):
    """Load a document, or be told what is wrong; a scene that loads is saved and loaded without a change."""
    path.write_text(json.dumps(document))
    try:
        scene = asm.load(path)
    except InputError as error:
        assert str(error).startswith(f"{path}: ")
        return
    scene.save(path)
    first = path.read_bytes()
    asm.load(path).save(path)
    assert path.read_bytes() == first


@settings(max_examples=4 * COUNT // 3)
@given(changed_documents())
def test_a_changed_document_loads_or_raises_input_error(tmp_path_factory, document):
    check(tmp_path_factory.getbasetemp() / "fuzz.json", document)


@settings(max_examples=COUNT)
@given(changed_documents(within=("constraints", len(CONSTRAINTS.kinds) + 1, "function")))
def test_a_changed_function_loads_or_raises_input_error(tmp_path_factory, document):
    check(tmp_path_factory.getbasetemp() / "function.json", document)


@settings(max_examples=COUNT)
@given(st.data())
def test_damaged_bytes_load_or_raise_input_error(tmp_path_factory, data):
    path = tmp_path_factory.getbasetemp() / "damaged.json"
    text = bytearray(json.dumps(small_document()).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text) - 1))
        match data.draw(st.sampled_from(["byte", "cut", "drop", "digit"])):
            case "byte":
                text[at] = data.draw(st.integers(0, 255))
            case "cut":
                del text[max(at, 1) :]
            case "drop":
                del text[at : at + data.draw(st.integers(1, 20))]
                text = text or bytearray(b" ")
            case "digit":
                text[at:at] = data.draw(st.sampled_from([b"9", b"e9", b"-", b".", b"NaN", b"null", b'"', b"[", b"}"]))
    path.write_bytes(bytes(text))
    try:
        asm.load(path)
    except InputError as error:
        assert str(path) in str(error)
