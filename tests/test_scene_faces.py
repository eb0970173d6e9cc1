"""Faces with loops, colors and trims in scene files; files of version 1."""

from __future__ import annotations

import copy
import json
import re

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.geometry.faces.loop import Loop
from assembly.geometry.splines.curve import NurbsCurve
from tests.geometry.loops import blob, circle, polygon, segment

THIRD = 1.0 / 3.0


def domain_rectangle(surface):
    """All edges of a domain, seams and pole edges too, from a corner that is not the first."""
    (a, b), (c, d) = surface.domain
    return polygon((b, c), (b, d), (a, d), (a, c))


def faced_scene():
    """Faces of every kind of boundary, shared ones among them, and trims on loops of faces and on others."""
    rng = np.random.default_rng(5)
    plane, tube, ball = asm.shapes.plane(8.0, 6.0), asm.shapes.cylinder(1.1, 2.0), asm.shapes.sphere(0.7)
    # Clockwise, with gaps that are closed, and off the edge of the domain by rounding.
    (a, b), (c, d) = plane.domain
    rough = [(a - 1e-12, c + 0.3), (a, d - 0.1), (b + 1e-11, d - 0.1), (b, c + 0.3)]
    sides = [segment(p, np.add(q, (0.0, 1e-6))) for p, q in zip(rough, (*rough[1:], rough[0]), strict=True)]
    holes = [circle((1.3, 0.1), THIRD).reversed(), [*polygon((-2, -1), (-1, -1), (-1, THIRD))], blob(rng, (0, 2), 0.4)]
    top = asm.Face(plane, Loop(sides, tolerance=1e-5), holes, color=(THIRD, 0.0, 1.0))
    (a, b), (c, d) = tube.domain
    # One time around, from a seam that is none of the surface's.
    low, high = (c + part * (d - c) for part in (0.1, 0.7))
    ring = [segment((a + 0.3, low), (a + 1.7, low)), segment((a + 1.7, low), (b + 0.3, low))]
    back = segment((b, high), (a, high))
    shapes = {
        "base": [top, asm.Face(plane, blob(rng, (0.1, 0.2), 1.7), name="under", reversed=True)],
        "twin": [top],
        "tube": [asm.Face(tube, domain_rectangle(tube), name="seams"), asm.Face(tube, ring, [back], name="rings")],
        "ball": [asm.Face(ball, domain_rectangle(ball))],
        "egg": [asm.shapes.ellipsoid(0.5, 0.4, THIRD)],
    }
    bodies = {name: asm.Body(name, shape, fixed=name == "base") for name, shape in shapes.items()}
    bodies["twin"].color = (0.1, 1, 0)
    scene = asm.Assembly(bodies.values())
    side = bodies["base"].faces[0]
    touch, rest = asm.Contact(side, bodies["egg"]), asm.Contact(bodies["egg"], bodies["tube"].face("rings"), "rest")
    seams = bodies["tube"].face("seams").face.outer
    scene.constrain(
        touch,
        rest,
        asm.TrimContact(touch, side.face.outer, "inside", name="edge"),
        asm.TrimContact(touch, side.face.holes[2], "outside", "parametric"),
        asm.TrimContact(touch, circle((0.1, 0.2), THIRD).reversed(), form="between", name="own"),
        asm.TrimContact(rest, seams, "inside", "cartesian", side="b", name="of another face, with seams"),
        asm.TrimContact(rest, Loop(circle((0.1, 0.5), THIRD)), side="a", name="on an egg"),
    )
    return scene


def reread(scene, path):
    scene.save(path)
    return asm.load(path)


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.json"
    faced_scene().save(path)
    return json.loads(path.read_text())


def load_document(document, path):
    path.write_text(json.dumps(document))
    return asm.load(path)


def assert_same_curves(came, expected):
    for curve, other in zip(came, expected, strict=True):
        assert (curve.degree, curve.name) == (other.degree, other.name)
        for name in ("control_points", "knots", "weights"):
            assert getattr(curve, name).tobytes() == getattr(other, name).tobytes()


def assert_same_face(came, expected):
    assert (came.name, came.reversed, came.color) == (expected.name, expected.reversed, expected.color)
    assert_same_curves(came.boundary, expected.boundary)
    assert came.chains == expected.chains
    for mine, other in zip(came.packed_trim(), expected.packed_trim(), strict=True):
        assert mine.tobytes() == other.tobytes()
    assert (came.outer is None) == (expected.outer is None)
    loops = [(came.outer, expected.outer)] if came.outer is not None else []
    for mine, other in [*loops, *zip(came.holes, expected.holes, strict=True)]:
        assert_same_curves(mine.curves, other.curves)
        assert (mine.tolerance, mine.turn.tolist()) == (other.tolerance, other.turn.tolist())


def test_faces_come_back_to_the_bit(tmp_path):
    scene = faced_scene()
    again = reread(scene, tmp_path / "scene.json")
    for body, other in zip(again.bodies, scene.bodies, strict=True):
        assert body.color == other.color
        for side, expected in zip(body.faces, other.faces, strict=True):
            assert side.name == expected.name
            assert_same_face(side.face, expected.face)
    assert again.bodies[1].color == (0.1, 1.0, 0.0)


def test_a_face_that_bodies_share_is_stored_and_read_once(tmp_path, document):
    assert len(document["faces"]) == 6  # of seven sides
    base, twin, *_ = load_document(document, tmp_path / "scene.json").bodies
    assert base.faces[0].face is twin.faces[0].face


def test_trims_come_back_on_the_loops_of_their_faces(tmp_path):
    scene = faced_scene()
    again = reread(scene, tmp_path / "scene.json")
    top = again.body("base").faces[0].face
    loops = {trim.name: trim.loop for trim in again.constraints[2:]}
    assert loops["edge"] is top.outer and loops["trim base-egg"] is top.holes[2]
    for came, expected in zip(again.constraints[2:], scene.constraints[2:], strict=True):
        assert repr(came) == repr(expected) and came.side == expected.side
        assert came.contact is again.constraints[0 if expected.contact is scene.constraints[0] else 1]
        assert_same_curves(came.loop.curves, expected.loop.curves)
        assert_same_face(came.region, expected.region)


def test_the_text_and_the_packed_scene_are_the_same_every_time(tmp_path):
    one, two, three = (tmp_path / name for name in ("one", "two", "three"))
    scene = faced_scene()
    scene.save(one)
    faced_scene().save(two)
    again = reread(scene, three)
    again.save(three)
    assert one.read_bytes() == two.read_bytes() == three.read_bytes()
    assert again.packed().table.tobytes() == scene.packed().table.tobytes()
    assert again.packed().pool.tobytes() == scene.packed().pool.tobytes()


def test_loops_that_turn_come_back_to_the_bit(tmp_path):
    """A start plus a period, less the period, is often not the start."""
    rng = np.random.default_rng(2)
    torus = asm.shapes.torus(3.0, 1.0)
    (a, b), (c, d) = torus.domain
    faces = []
    for k in range(200):
        first, (low, high) = rng.uniform(-9.0, 9.0), np.sort(rng.uniform(c, d, 2))
        ends = [first, first + rng.uniform(0.1, 0.9) * (b - a), first + (b - a) + rng.uniform(-1e-10, 1e-10)]
        ring = [segment((x, low), (y, low)) for x, y in zip(ends[:-1], ends[1:], strict=True)]
        faces.append(asm.Face(torus, ring, [segment((b, high), (a, high))], name=f"{k}"))
    again = reread(asm.Assembly([asm.Body("rings", faces)]), tmp_path / "scene.json")
    for side, expected in zip(again.bodies[0].faces, faces, strict=True):
        assert_same_face(side.face, expected)


def test_loops_of_many_curves(tmp_path):
    angle = np.linspace(0.0, 2.0 * np.pi, 1001)
    corners = (2.0 + 0.3 * np.cos(40.0 * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    gear = asm.Face(asm.shapes.plane(8.0, 6.0), polygon(*corners[:-1]), [circle((0.0, 0.0), 0.5)])
    again = reread(asm.Assembly([asm.Body("gear", gear)]), tmp_path / "scene.json")
    assert_same_face(again.bodies[0].faces[0].face, gear)


OLD = """{"format": "assembly-scene", "version": 1,
 "surfaces": [{"name": null, "degree": [1, 1], "knots": [[0.0, 0.0, 1.0, 1.0], [0.0, 0.0, 2.0, 2.0]],
   "control_points": [[[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]], [[1.0, 0.0, 0.0], [1.0, 2.0, 0.0]]],
   "weights": [[1.0, 1.0], [1.0, 1.0]]}],
 "bodies": [{"name": "base", "fixed": true, "position": [0.0, 0.0, 0.0], "quaternion": [1.0, 0.0, 0.0, 0.0],
   "shape": [{"surface": 0, "name": "up", "reversed": false}, {"surface": 0, "name": "down", "reversed": true}]},
  {"name": "lid", "fixed": false, "position": [0.0, 0.0, 1.0], "quaternion": [1.0, 0.0, 0.0, 0.0],
   "shape": [{"surface": 0, "name": "surface", "reversed": false}]}],
 "constraints": [{"type": "contact", "name": "touch", "a": {"body": "base", "face": "up"},
   "b": {"body": "lid", "face": null}, "unilateral": true}],
 "objective": []}"""


def test_files_of_version_1_are_read_and_saved_in_the_newest(tmp_path):
    path = tmp_path / "scene.json"
    path.write_text(OLD)
    scene = asm.load(path)
    base, lid = scene.bodies
    assert [(side.name, side.face.reversed) for side in base.faces] == [("up", False), ("down", True)]
    assert base.faces[0].face.surface is lid.faces[0].face.surface
    assert (base.color, base.faces[0].face.color, base.faces[0].face.outer) == (None, None, None)
    assert scene.constraints[0].a is base.faces[0]
    again = reread(scene, path)
    assert json.loads(path.read_text())["version"] == 5
    assert repr(again.constraints) == repr(scene.constraints)


@pytest.mark.parametrize(
    ("table", "field", "text"),
    [
        ("bodies", "color", r"bodies\[0\] has the unknown field 'color'; expected only name, fixed"),
        (None, "faces", "document has the unknown field 'faces'; expected only format, version"),
    ],
)
def test_files_of_version_1_have_the_fields_of_version_1(table, field, text, tmp_path):
    document = json.loads(OLD)
    (document if table is None else document[table][0])[field] = []
    with pytest.raises(InputError, match=text):
        load_document(document, tmp_path / "scene.json")


def test_faces_in_files_of_version_1_are_named_by_their_body(tmp_path):
    document = json.loads(OLD)
    document["bodies"][0]["shape"][1]["surface"] = 3
    with pytest.raises(
        InputError, match=r"bodies\[0\].shape\[1\].surface is 3; expected an index of one of 1 surfaces"
    ):
        load_document(document, tmp_path / "scene.json")


MISSING = object()
FACE, EDGE, HOLE, OWN = ("faces", 0), ("constraints", 2), ("constraints", 3), ("constraints", 4)
CURVE = (*FACE, "outer", "curves", 1)
CASES = {
    "missing": ((*FACE, "outer"), MISSING, " has no field 'outer'; expected the fields surface, name, reversed, color"),
    "color": ((*FACE, "color"), "red", '.color is "red"; expected a list of 3'),
    "color short": ((*FACE, "color"), [1, 0], ".color is a list of 2; expected a list of 3"),
    "color beyond": ((*FACE, "color", 1), 2, r".color is \[0.3.*; expected three numbers from 0 to 1"),
    "body color": (("bodies", 1, "color"), [0, 0, -1], r".color is .*; expected three numbers from 0 to 1"),
    "outer": ((*FACE, "outer"), [], ".outer is a list of 0; expected an object with the fields tolerance, curves"),
    "tolerance": ((*FACE, "outer", "tolerance"), None, ".outer.tolerance is null; expected a finite number"),
    "no curves": ((*FACE, "outer", "curves"), [], ".outer.curves is empty; expected at least one curve"),
    "open": (CURVE, MISSING, r".outer.curves is open: a gap of 5.6 between curves 0 and 1; expected curves that meet"),
    "degree": ((*CURVE, "degree"), 2, r".outer.curves\[1\].degree is 2; expected at most 1"),
    "knots": ((*CURVE, "knots"), [0, 1], r".outer.curves\[1\].knots has 2 values; expected 4"),
    "in space": (
        (*CURVE, "control_points", 0),
        [0, 0, 0],
        r".outer.curves\[1\].control_points\[0\] is a list of 3; exp",
    ),
    "weights": ((*CURVE, "weights"), [1], r".outer.curves\[1\].weights has shape \(1,\); expected \(2,\)"),
    "name": ((*CURVE, "name"), 1, r".outer.curves\[1\].name is 1; expected a string"),
    "holes": ((*FACE, "holes"), None, ".holes is null; expected a list"),
    "hole": ((*FACE, "holes", 1), None, r".holes\[1\] is null; expected an object with the fields tolerance, curves"),
    "contact": ((*EDGE, "contact"), "edge", ".contact is \"edge\"; expected a contact of the file: 'base-egg', 'rest'"),
    "side": ((*EDGE, "side"), "c", '.side is "c"; expected "a" or "b"'),
    "keep": ((*EDGE, "keep"), "in", ".keep is 'in'; expected one of 'on', 'inside', 'outside'"),
    "form": ((*EDGE, "form"), None, ".form is null; expected a string"),
    "loop": ((*EDGE, "loop"), "inner", '.loop is "inner"; expected "outer", the index of a hole, or an object with'),
    "loop true": ((*EDGE, "loop"), True, '.loop is true; expected "outer", the index of a hole, or an object with'),
    "loop float": ((*HOLE, "loop"), 1.0, '.loop is 1.0; expected "outer", the index of a hole, or an object with'),
    "no hole": ((*HOLE, "loop"), 3, ".loop is 3; expected an index of one of 3 holes of the face"),
    "negative": ((*HOLE, "loop"), -1, ".loop is -1; expected an index of one of 3 holes of the face"),
    "no outer": ((*EDGE, "side"), "b", '.loop is "outer"; expected another, for that of the face is the edge of its'),
    "own": ((*OWN, "loop", "curves", 0, "degree"), 0, r".loop.curves\[0\].degree is 0; expected"),
    "several faces": (("constraints", 0, "a", "face"), None, ".contact has body 'base' with 2 faces as side a; exp"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_named_by_its_path(case, document, tmp_path):
    way, value, text = CASES[case]
    changed = copy.deepcopy(document)
    place = changed
    for step in way[:-1]:
        place = place[step]
    if value is MISSING:
        del place[way[-1]]
    else:
        place[way[-1]] = value
    table, number = ("constraints", 2) if case == "several faces" else way[:2]
    path = tmp_path / "scene.json"
    with pytest.raises(InputError, match=f"^{re.escape(str(path))}: {table}\\[{number}\\]{text}"):
        load_document(changed, path)


def moved(loop, shift):
    """A loop of a document, moved."""
    loop = copy.deepcopy(loop)
    for curve in loop["curves"]:
        curve["control_points"] = [[u + shift[0], v + shift[1]] for u, v in curve["control_points"]]
    return loop


def test_loops_that_do_not_fit_are_named_by_their_path(document, tmp_path):
    path = tmp_path / "scene.json"
    changed = copy.deepcopy(document)
    changed["faces"][0]["holes"][0] = moved(changed["faces"][0]["holes"][0], (9.0, 0.0))
    with pytest.raises(InputError, match=r": faces\[0\].holes\[0\] leaves the domain: curve 0 has u from "):
        load_document(changed, path)
    changed = copy.deepcopy(document)
    changed["constraints"][4]["loop"] = moved(changed["constraints"][4]["loop"], (9.0, 0.0))
    with pytest.raises(InputError, match=r": constraints\[4\].loop leaves the domain: curve 0 has u from "):
        load_document(changed, path)


def test_trims_stand_after_their_contact(document, tmp_path):
    changed = copy.deepcopy(document)
    changed["constraints"].insert(0, changed["constraints"].pop(2))
    with pytest.raises(
        InputError, match=r"constraints\[0\]: constraint 'edge' keeps contact 'base-egg', which is not in"
    ):
        load_document(changed, tmp_path / "scene.json")


def test_unnamed_faces_and_named_curves(tmp_path):
    ring = NurbsCurve(circle((0.1, 0.2), 1.0).control_points, *_of_circle(), name='rim "1"')
    plate = asm.Face(asm.shapes.plane(8.0, 6.0), holes=[ring])
    again = reread(asm.Assembly([asm.Body("plate", plate)]), tmp_path / "scene.json")
    face = again.bodies[0].faces[0].face
    assert (face.name, face.outer, face.holes[0].curves[0].name) == (plate.name, None, 'rim "1"')


def _of_circle():
    whole = circle((0.0, 0.0), 1.0)
    return whole.knots, whole.degree, whole.weights
