from __future__ import annotations

import copy
import json

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError


def awkward_scene():
    """Every kind of thing a file holds, with numbers that have no short decimals and names that need escapes."""
    ring = asm.shapes.torus(3.0, 1.0 / 3.0, name="ring \N{SNOWMAN}")
    base = asm.Body("base", ring, position=(0.1, 1e-300, -0.0), quaternion=(0.99, 0.1, 0.05, 0.02), fixed=True)
    link = asm.Body('"link"\n', [asm.Face(ring, name="out"), asm.Face(ring, name="in", reversed=True)], (2.7, 0.3, 0.2))
    box = asm.Body("box", asm.shapes.box(1.0, 2.0, np.pi), (1e5, 0.0, 9.0), (0.5, -0.5, 0.5, 0.5))
    scene = asm.Assembly([base, link, box, asm.Body("hand")])
    scene.constrain(
        asm.Contact(base, link.face("out")), asm.Contact(box.face("top"), link, name="lid", unilateral=True)
    )
    scene.minimize(
        asm.PointDistance(link.point(0.1, 0.2, 0.3), target=(1.0 / 3.0, 1e22, -7.0), weight=0.3), asm.Posture()
    )
    scene.maximize(asm.Posture(np.tile([0.1, 0.2, 0.3, 0.99, 0.1, 0.05, 0.02], (4, 1)), weight=1e-9))
    return scene


def three_rings():
    """Two rings that move and touch a fixed one and each other."""
    ring = asm.shapes.torus(3.0, 0.5)
    base = asm.Body("base", ring, fixed=True)
    first = asm.Body("first", ring, (6.6, 0.3, 0.2), (0.98, 0.17, 0.1, 0.05))
    second = asm.Body("second", ring, (3.1, 6.2, 0.4), (0.97, -0.2, 0.1, 0.1))
    scene = asm.Assembly([base, first, second])
    scene.constrain(asm.Contact(base, first), asm.Contact(base, second), asm.Contact(first, second))
    scene.minimize(asm.PointDistance(second.point(0.0, 0.0, 1.0), (2.0, 6.0, 1.0)), asm.Posture(weight=0.1))
    return scene


def reread(scene, path):
    scene.save(path)
    return asm.load(path)


@pytest.fixture(scope="module")
def document(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.json"
    awkward_scene().save(path)
    return json.loads(path.read_text())


@pytest.fixture
def load_document(tmp_path):
    def load(document):
        path = tmp_path / "changed.json"
        path.write_text(json.dumps(document))
        return asm.load(path)

    return load


def test_everything_comes_back_to_the_bit(tmp_path):
    scene = awkward_scene()
    again = reread(scene, tmp_path / "scene.json")
    assert isinstance(again, asm.Assembly)
    np.testing.assert_array_equal(again.q, scene.q)
    assert np.signbit(again.q[0, 2])  # the position's -0.0
    assert [(b.name, b.fixed) for b in again.bodies] == [(b.name, b.fixed) for b in scene.bodies]
    for body, other in zip(scene.bodies, again.bodies, strict=True):
        for side, twin in zip(body.faces, other.faces, strict=True):
            assert (side.name, side.face.reversed) == (twin.name, twin.face.reversed)
            surface, copied = side.face.surface, twin.face.surface
            assert (surface.degree, surface.name) == (copied.degree, copied.name)
            np.testing.assert_array_equal(copied.control_points, surface.control_points)
            np.testing.assert_array_equal(copied.weights, surface.weights)
            for knots, twin_knots in zip(surface.knots, copied.knots, strict=True):
                np.testing.assert_array_equal(twin_knots, knots)
    assert [repr(c) for c in again.constraints] == [repr(c) for c in scene.constraints]
    for (sign, term), (other_sign, other_term) in zip(scene.objectives, again.objectives, strict=True):
        assert sign == other_sign and repr(term) == repr(other_term) and term.weight == other_term.weight
    first, other = scene.objectives[0][1], again.objectives[0][1]
    np.testing.assert_array_equal(other.target, first.target)
    np.testing.assert_array_equal(other.point.coordinates, first.point.coordinates)
    assert again.objectives[1][1].reference is None
    np.testing.assert_array_equal(again.objectives[2][1].reference, scene.objectives[2][1].reference)


def test_the_text_is_the_same_every_time(tmp_path):
    one, two, three = (tmp_path / name for name in ("one", "two", "three"))
    awkward_scene().save(one)
    awkward_scene().save(str(two))
    reread(awkward_scene(), three).save(three)
    assert one.read_bytes() == two.read_bytes() == three.read_bytes()
    assert one.read_bytes().isascii() and one.read_text().endswith("}\n")


def test_the_scene_that_comes_back_solves_to_the_same_bits(tmp_path):
    scene = three_rings()
    again = reread(scene, tmp_path / "scene.json")
    solution, other = scene.solve(), again.solve()
    assert solution.success
    np.testing.assert_array_equal(other.q, solution.q)
    np.testing.assert_array_equal(other.multipliers["base-first"], solution.multipliers["base-first"])
    assert (other.objective, other.iterations) == (solution.objective, solution.iterations)


def test_a_surface_that_bodies_share_is_stored_and_read_once(document, load_document):
    assert len(document["surfaces"]) == 7  # the ring and the box's six
    bodies = load_document(document).bodies
    rings = [side.face.surface for body in bodies[:2] for side in body.faces]
    assert len(rings) == 3 and all(ring is rings[0] for ring in rings)


def test_an_empty_assembly_is_a_scene_too(tmp_path):
    assert reread(asm.Assembly(), tmp_path / "empty.json").bodies == ()


def test_other_texts_of_the_same_document_are_read(document, tmp_path):
    path = tmp_path / "scene.json"
    for text in (json.dumps(document, indent=4).encode("utf-8-sig"), json.dumps(document).encode("utf-16")):
        path.write_bytes(text)
        assert len(asm.load(path).bodies) == 4


def test_integers_are_numbers(document, load_document):
    document = copy.deepcopy(document)
    document["bodies"][0]["position"] = [1, -2, 10**150]
    assert load_document(document).bodies[0].pose.position.tolist() == [1.0, -2.0, 1e150]


def replaced(document, path, value):
    """A copy of the document with another value at a path of keys."""
    document = copy.deepcopy(document)
    *way, last = path
    place = document
    for key in way:
        place = place[key]
    if value is MISSING:
        del place[last]
    else:
        place[last] = value
    return document


MISSING = object()
NAN, INF = float("nan"), float("inf")
CASES = {
    "format": (["format"], "step", 'format is "step"; expected a scene of format'),
    "no format": (["format"], MISSING, "format is null"),
    "newer": (["version"], 6, "version is 6; expected 1 to 5; a newer version of this library wrote the file"),
    "older": (["version"], 0, "version is 0; expected 1 to 5$"),
    "no version": (["version"], MISSING, "version is null; expected an integer"),
    "version true": (["version"], True, "version is true; expected an integer"),
    "missing table": (["surfaces"], MISSING, "document has no field 'surfaces'; expected the fields format, version"),
    "unknown table": (["colors"], [], "document has the unknown field 'colors'; expected only format"),
    "bodies object": (["bodies"], {}, "bodies is an object; expected a list"),
    "body number": (["bodies", 1], 7, r"bodies\[1\] is 7; expected an object with the fields name, fixed"),
    "missing": (["bodies", 1, "fixed"], MISSING, r"bodies\[1\] has no field 'fixed'; expected the fields name, fixed"),
    "unknown": (["bodies", 1, "mass"], 1.0, r"bodies\[1\] has the unknown field 'mass'; expected only name, fixed"),
    "fixed": (["bodies", 1, "fixed"], 1, r"bodies\[1\].fixed is 1; expected true or false"),
    "name": (["bodies", 1, "name"], None, r"bodies\[1\].name is null; expected a string"),
    "empty name": (["bodies", 1, "name"], " ", r"bodies\[1\].name is ' '; expected a nonempty string"),
    "same name": (["bodies", 1, "name"], "base", r"bodies\[1\]: body has the name 'base' of another body"),
    "position": (["bodies", 1, "position"], [1, 2], r"bodies\[1\].position has shape \(2,\); expected \(3,\)"),
    "position nan": (["bodies", 1, "position", 2], NAN, r"bodies\[1\].position\[2\] is NaN; expected a finite number"),
    "position text": (["bodies", 1, "position", 0], "1.5", r"bodies\[1\].position\[0\] is \"1.5\"; expected a finite"),
    "position true": (["bodies", 1, "position", 0], True, r"bodies\[1\].position\[0\] is true; expected a finite"),
    "position huge": (["bodies", 1, "position", 0], 10**400, r"bodies\[1\].position\[0\] is Infinity; expected a fin"),
    "quaternion": (["bodies", 1, "quaternion", 0], 2.0, r"bodies\[1\].quaternion is \[2.0, .* with norm 2; expected"),
    "shape": (["bodies", 1, "shape"], None, r"bodies\[1\].shape is null; expected a list"),
    "shape index": (["bodies", 2, "shape", 1], 9, r"bodies\[2\].shape\[1\] is 9; expected an index of one of 9 faces"),
    "shape object": (["bodies", 2, "shape", 1], {}, r"bodies\[2\].shape\[1\] is an object; expected an integer"),
    "index": (["faces", 4, "surface"], 7, r"faces\[4\].surface is 7; expected an index of one of 7 surfaces"),
    "negative index": (["faces", 4, "surface"], -1, r"faces\[4\].surface is -1"),
    "float index": (["faces", 4, "surface"], 1.0, r"faces\[4\].surface is 1.0; expected an integer"),
    "same face": (["bodies", 2, "shape", 1], 3, r"bodies\[2\].shape of body 'box' has two faces named 'left'"),
    "face name": (["faces", 4, "name"], "left", r"bodies\[2\].shape of body 'box' has two faces named 'left'"),
    "face name number": (["faces", 4, "name"], 1, r"faces\[4\].name is 1; expected a string"),
    "reversed": (["faces", 4, "reversed"], 0, r"faces\[4\].reversed is 0; expected true or"),
    "surface name": (["surfaces", 1, "name"], 3, r"surfaces\[1\].name is 3; expected a string"),
    "degree": (["surfaces", 1, "degree", 1], 9, r"surfaces\[1\].degree\[1\] is 9; expected at most 1"),
    "degree float": (["surfaces", 1, "degree", 1], 1.0, r"surfaces\[1\].degree\[1\] is 1.0; expected an integer"),
    "degrees": (["surfaces", 1, "degree"], [1], r"surfaces\[1\].degree is a list of 1; expected a list of 2"),
    "knots": (["surfaces", 1, "knots", 0], [0, 1], r"surfaces\[1\].knots\[0\] has 2 values; expected 4"),
    "knots decrease": (["surfaces", 1, "knots", 1, 3], -9.0, r"surfaces\[1\].knots\[1\] decreases from .* at index 3"),
    "knot nan": (["surfaces", 0, "knots", 0, 4], NAN, r"surfaces\[0\].knots\[0\]\[4\] is NaN; expected a finite"),
    "weight": (["surfaces", 0, "weights", 0, 1], 0.0, r"surfaces\[0\].weights\[0, 1\] is 0; expected positive weights"),
    "weights": (["surfaces", 0, "weights"], [[1.0]], r"surfaces\[0\].weights has shape \(1, 1\); expected \(9, 9\)"),
    "weights null": (["surfaces", 0, "weights"], None, r"surfaces\[0\].weights is null; expected a list"),
    "point inf": (["surfaces", 1, "control_points", 0, 1, 2], INF, r"control_points\[0\]\[1\]\[2\] is Infinity"),
    "point flat": (["surfaces", 1, "control_points", 0, 1], 0, r"surfaces\[1\].control_points\[0\]\[1\] is 0; expec"),
    "point short": (["surfaces", 1, "control_points", 0, 1], [0, 0], r"surfaces\[1\].control_points is .*; expected"),
    "type": (["constraints", 0, "type"], "weld", r"constraints\[0\].type is \"weld\"; expected one of contact"),
    "type list": (["constraints", 0, "type"], ["contact"], r"constraints\[0\].type is a list of 1; expected one of"),
    "no type": (["constraints", 0, "type"], MISSING, r"constraints\[0\] has no field 'type'; expected one of contact"),
    "constraint": (["constraints", 0], None, r"constraints\[0\] is null; expected an object"),
    "constraint name": (["constraints", 1, "name"], 'base-"link"\n', r"constraints\[1\]: constraint name .* is taken"),
    "empty constraint name": (["constraints", 1, "name"], "", r"constraints\[1\].name is ''; expected a nonempty"),
    "unilateral": (["constraints", 1, "unilateral"], None, r"constraints\[1\].unilateral is null; expected true or"),
    "edges": (["constraints", 0, "edges"], None, r"constraints\[0\].edges is null; expected true or false"),
    "no edges": (["constraints", 1, "edges"], False, r"constraints\[1\].edges is False for a body with several"),
    "side": (["constraints", 0, "a"], "base", r"constraints\[0\].a is \"base\"; expected an object with the fields"),
    "stranger": (["constraints", 0, "a", "body"], "bose", r"constraints\[0\].a.body: name is 'bose'; expected one of"),
    "shapeless": (["constraints", 0, "a", "body"], "hand", r"constraints\[0\].a is body 'hand' without a shape"),
    "face": (["constraints", 1, "a", "face"], "roof", r"constraints\[1\].a.face: name is 'roof'; .*'bottom', 'top'"),
    "one body": (["constraints", 1, "b", "body"], "box", r"constraints\[1\]: sides a and b are both on body 'box'"),
    "two fixed": (["bodies", 1, "fixed"], True, r"constraints\[0\]: constraint .* is between two fixed bodies"),
    "term type": (["objective", 0, "type"], None, r"objective\[0\].type is null; expected one of point_distance"),
    "term fields": (["objective", 1, "target"], None, r"objective\[1\] has the unknown field 'target'"),
    "sign": (["objective", 0, "sign"], 0, r"objective\[0\].sign is 0; expected 1 \(minimized\) or -1 \(maximized\)"),
    "sign float": (["objective", 0, "sign"], 1.0, r"objective\[0\].sign is 1.0; expected an integer"),
    "term weight": (["objective", 0, "weight"], -1, r"objective\[0\].weight is -1; expected a positive number"),
    "term body": (["objective", 0, "body"], 3, r"objective\[0\].body is 3; expected a string"),
    "term stranger": (["objective", 0, "body"], "?", r"objective\[0\].body: name is '\?'; expected one of 'base'"),
    "point": (["objective", 0, "point"], [0, 0], r"objective\[0\].point is a list of 2; expected a list of 3"),
    "target": (["objective", 0, "target"], [0, 0], r"objective\[0\].target has shape \(2,\); expected \(3,\)"),
    "reference": (
        ["objective", 2, "reference"],
        [[0]],
        r"objective\[2\].reference has shape \(1, 1\); expected \(n, 7\)",
    ),
    "references": (["objective", 2, "reference", 1, 3], 3.0, r"objective\[2\].reference\[1, 3:\] is \[3.0, .* norm 3"),
}


@pytest.mark.parametrize("case", CASES)
def test_what_is_wrong_is_named_by_its_path(case, document, load_document, tmp_path):
    path, value, text = CASES[case]
    with pytest.raises(InputError, match=text) as caught:
        load_document(replaced(document, path, value))
    assert str(caught.value).startswith(str(tmp_path / "changed.json") + ": ")


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "is not JSON"),
        (b"{", "is not JSON"),
        (b"\xff\xfe\xfa", "is not JSON"),
        (b"ISO-10303-21;", "is not JSON"),
        (b"[" * 100_000, "is not JSON"),
        (b"[]", "document is a list of 0; expected a scene of format"),
        (b"null", "document is null"),
        (b'"assembly-scene"', "document is"),
        (b'{"format": "assembly-scene", "format": 1}', "field 'format' stands twice"),
        (b'{"format": "assembly-scene", "version": 1' + b"0" * 5000 + b"}", "version is Infinity"),
    ],
)
def test_files_that_are_no_scenes(data, text, tmp_path):
    path = tmp_path / "other.json"
    path.write_bytes(data)
    with pytest.raises(InputError, match=text) as caught:
        asm.load(path)
    assert str(path) in str(caught.value)


def test_missing_files_are_the_system_s_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        asm.load(tmp_path / "nowhere.json")
    with pytest.raises(FileNotFoundError):
        asm.Assembly().save(tmp_path / "nowhere" / "scene.json")


def test_only_assemblies_are_saved(tmp_path):
    from assembly import scene_file

    with pytest.raises(TypeError, match="scene is .*; expected an Assembly"):
        scene_file.save([], tmp_path / "scene.json")


def test_kinds_that_a_file_does_not_hold_are_refused_before_a_file_is_touched(tmp_path):
    class Weld(asm.Contact):
        pass

    class Reach(asm.PointDistance):
        pass

    path = tmp_path / "scene.json"
    ball = asm.shapes.sphere(1.0)
    bodies = [asm.Body("a", ball), asm.Body("b", ball, (3, 0, 0))]
    scene = asm.Assembly(bodies)
    scene.constrain(Weld(*bodies))
    with pytest.raises(
        InputError,
        match=r"constraints\[0\] is Contact\(.*; expected one of what scene files hold: Contact, Fixed, .*Expression$",
    ):
        scene.save(path)
    scene = asm.Assembly(bodies)
    scene.minimize(Reach(bodies[0].point(0, 0, 0), (1, 2, 3)))
    with pytest.raises(
        InputError, match=r"objective\[0\] is PointDistance\(.*; expected one of what scene files hold: PointDistance"
    ):
        scene.save(path)
    assert not path.exists()
