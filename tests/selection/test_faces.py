"""What faces are, and which of them a selection has: by what parts were made with, and by brute force over samples."""

from __future__ import annotations

import copy
import pickle
from math import atan, pi

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix
from tests.geometry.recognition.constructions import rewritten

SEEDS = range(6)
# Of numbers that follow from fits, over sizes of some 10.
FITTED = 1e-11


def unit(vector):
    return vector / np.linalg.norm(vector)


def placed(seed, shape):
    """A body with a shape that is turned and moved, and how."""
    rng = np.random.default_rng(seed)
    rotation, offset = rotation_matrix(unit(rng.normal(size=4))), rng.uniform(-5, 5, 3)
    faces = [shape] if isinstance(shape, (asm.NurbsSurface, asm.Face)) else shape
    faces = [face if isinstance(face, asm.Face) else asm.Face(face) for face in faces]
    return asm.Body("part", [face.transformed(rotation, offset) for face in faces]), rotation, offset


def plate():
    return asm.Body("plate", asm.shapes.plate(10, 8, 2, [(1, 1, 1.5), (-3, 0, 0.5)]))


def names(selection):
    return [face.name for face in selection]


SPLINE = asm.NurbsCurve([[1, 0], [2, 1], [1, 3], [2, 4]], [0, 0, 0, 0, 1, 1, 1, 1], 3)
WAVE = asm.NurbsCurve([[0, 0, 0], [1, 2, 0], [3, -1, 0], [4, 0, 0]], [0, 0, 0, 0, 1, 1, 1, 1], 3)
FREE = asm.NurbsSurface(
    np.stack(
        [*np.meshgrid(np.arange(3.0), np.arange(3.0), indexing="ij"), [[0, 1, 0], [2, 0, 1], [0, 1, 3.0]]], axis=-1
    ),
    ([0, 0, 0, 1, 1, 1], [0, 0, 0, 1, 1, 1]),
    (2, 2),
)
MADE = {
    "plane": asm.shapes.plane(2, 3),
    "cylinder": asm.shapes.cylinder(2, 3),
    "cone": asm.shapes.cone(3, 4),
    "sphere": asm.shapes.sphere(2),
    "torus": asm.shapes.torus(3, 1),
    "extrusion": asm.shapes.loft([WAVE, WAVE.transformed(translation=(0, 0, 2))]),
    "revolution": asm.shapes.revolution(SPLINE),
    "spline": FREE,
}


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", MADE)
def test_kinds_and_what_they_have(seed, kind):
    body, rotation, offset = placed(seed, asm.Face(MADE[kind], reversed=seed % 2 == 1))
    face, z = body.face(), rotation[:, 2]
    assert face.kind == kind
    sense = -1.0 if seed % 2 else 1.0
    if kind == "plane":
        assert abs(face.normal - sense * z).max() < FITTED and abs(face.center - offset).max() < FITTED
        assert abs(face.frame().axes[:, 2] - face.normal).max() < FITTED
    elif kind == "cone":
        assert abs(face.axis + z).max() < FITTED and face.half_angle == pytest.approx(atan(3 / 4), abs=FITTED)
        assert abs(face.apex - (offset + 2 * z)).max() < FITTED
        # The centroid of the lines is a third up from the base, which is at -2.
        assert abs(face.center - (offset + (4 / 3 - 2) * z)).max() < 1e-9
    elif kind not in ("sphere", "spline", "extrusion"):
        assert np.linalg.norm(np.cross(face.axis, z)) < FITTED and face.axis[np.argmax(abs(face.axis))] > 0
    if kind in ("cylinder", "sphere"):
        assert face.radius == pytest.approx(2, abs=FITTED) and abs(face.center - offset).max() < 1e-9
    if kind == "torus":
        assert (face.major_radius, face.minor_radius) == (pytest.approx(3, abs=FITTED), pytest.approx(1, abs=FITTED))
    if kind in ("cylinder", "cone", "sphere", "torus"):
        assert face.is_hole == (seed % 2 == 1)
    if kind == "extrusion":
        assert np.linalg.norm(np.cross(face.axis, z)) < FITTED
    # What a kind does not have says what it is.
    has = {
        "plane": {"normal"},
        "cylinder": {"axis", "radius", "is_hole"},
        "cone": {"axis", "half_angle", "apex", "is_hole"},
        "sphere": {"radius", "is_hole"},
        "torus": {"axis", "major_radius", "minor_radius", "is_hole"},
        "extrusion": {"axis"},
        "revolution": {"axis"},
        "spline": set(),
    }[kind]
    for name in {"normal", "axis", "radius", "major_radius", "minor_radius", "half_angle", "apex", "is_hole"} - has:
        with pytest.raises(InputError, match=f"is a {kind} and has no .*; expected"):
            getattr(face, name)


@pytest.mark.parametrize("seed", SEEDS)
def test_how_a_surface_is_written_does_not_matter(seed):
    rng = np.random.default_rng(seed)
    face = asm.Body("part", rewritten(MADE["cylinder"], rng)).face()
    assert face.kind == "cylinder" and face.radius == pytest.approx(2, abs=1e-9)


@pytest.mark.parametrize("seed", SEEDS)
def test_filters_by_numbers(seed):
    body, rotation, offset = placed(seed, asm.shapes.plate(10, 8, 2, [(1, 1, 1.5), (-3, 0, 0.5), (3, -2, 0.5)]))
    x, _y, z = rotation.T
    faces = body.faces
    assert names(faces.planes(normal=3 * z)) == ["top"] and names(faces.planes(normal=-z)) == ["bottom"]
    assert names(faces.planes(at=offset + rotation @ [5, 4, 1])) == ["right", "back", "top"]
    assert names(faces.planes(x, offset + rotation @ [5, 0, 0])) == ["right"]
    assert names(faces.planes(x, offset)) == []
    assert names(faces.cylinders()) == ["hole 1", "hole 2", "hole 3"] == names(faces.cylinders(hole=True))
    assert names(faces.cylinders(radius=0.5)) == ["hole 2", "hole 3"] and not faces.cylinders(hole=False)
    assert names(faces.cylinders(axis=-z)) == names(faces.cylinders()) and not faces.cylinders(axis=x)
    assert names(faces.cylinders(0.5).near(offset + rotation @ [-4, 0, 0])) == ["hole 2"]
    assert names(faces.named("h*[12]")) == ["hole 1", "hole 2"] and names(faces.named("TOP")) == []
    assert names(faces.largest()) == ["bottom"]  # as large as the top, and before it
    assert not faces.cones() and not faces.spheres() and not faces.tori()


def test_filters_of_round_faces():
    full, hollow = asm.shapes.cone(3, 4), asm.Face(asm.shapes.cone(1, 1), name="hollow", reversed=True)
    shape = asm.shapes.joined(cone=full, cup=hollow, ball=asm.shapes.sphere(2), ring=asm.shapes.torus(3, 1))
    faces = asm.Body("part", shape).faces
    assert names(faces.cones()) == ["cone", "cup hollow"] and names(faces.cones(pi / 4)) == ["cup hollow"]
    assert names(faces.cones(hole=False)) == ["cone"] and names(faces.spheres(2)) == ["ball"] and not faces.spheres(3)
    assert names(faces.tori(3)) == ["ring"] == names(faces.tori(minor_radius=1, axis=(0, 0, -2)))
    assert not faces.tori(3, 2) and not faces.tori(hole=True)


@pytest.mark.parametrize("seed", range(12))
def test_near_is_the_nearest_of_samples(seed):
    rng = np.random.default_rng(seed)
    profile = asm.curves.polygon([(0, -3), (1, -3), (1, 1), (2, 1), (2, 2), (0, 2)])
    body, _, _ = placed(seed, asm.shapes.revolution(profile) if seed % 2 else asm.shapes.plate(10, 8, 2, [(1, 1, 1.5)]))
    for _ in range(4):
        point = body.faces[0].centroid + rng.normal(size=3) * 4
        gaps = []
        for side in body.faces:
            (a, b), (c, d) = side.face.surface.domain
            u, v = (p.ravel() for p in np.meshgrid(np.linspace(a, b, 201), np.linspace(c, d, 201)))
            inside = side.face.contains(u, v)
            gaps.append(np.linalg.norm(side.face.surface.evaluate(u[inside], v[inside]) - point, axis=1).min())
        for side, gap in zip(body.faces, gaps, strict=True):
            # Samples are some 0.1 apart, and none is nearer than the nearest.
            assert side.distance(point) <= gap + 1e-9 and gap - side.distance(point) < 0.1
        nearest = body.faces.near(point).one()
        assert nearest.distance(point) <= min(gaps) + 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_centroids_are_those_of_facets_and_of_formulas(seed):
    rng = np.random.default_rng(seed)
    x, y, r = rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 2)
    body, rotation, offset = placed(seed, asm.shapes.plate(10, 8, 2, [(x, y, r)]))
    hole = pi * r * r
    expected = -hole * np.array([x, y, 0]) / (80 - hole)
    assert abs(rotation.T @ (body.face("top").centroid - offset) - expected - [0, 0, 1]).max() < 1e-10
    half = asm.shapes.revolution(asm.curves.polygon([(2, 0), (3, 0), (3, 1), (2, 1)]), pi)
    wall = asm.Body("half", half).face("wall 2")
    assert abs(wall.centroid - [0, 3 * 2 / pi, 0.5]).max() < 1e-10  # of a half circle, 2 r / pi


def test_a_selection_is_a_tuple():
    body = plate()
    assert isinstance(body.faces, tuple) and body.faces == tuple(body.faces) and len(body.faces) == 8
    assert body.faces[0] is body.face("front") and names(body.faces[1:3]) == ["right", "back"]
    assert body.faces.index(body.face("top")) == 7 and body.face("top") in body.faces
    again = pickle.loads(pickle.dumps(body))
    assert names(again.faces.cylinders()) == ["hole 1", "hole 2"] and again.faces[0].body is again
    other = copy.copy(body)
    assert all(face.body is other for face in other.faces.cylinders())
    bare = asm.Body("bare")
    assert (
        bare.faces == ()
        and bare.edges == ()
        and bare.vertices == ()
        and not bare.faces(">Z")
        and not bare.faces.largest()
    )
    assert not bare.faces.near((0, 0, 0)) and not bare.edges("|Z") and not bare.edges.longest()


def test_what_is_not_one_says_what_there_is():
    faces = plate().faces
    with pytest.raises(InputError, match=r"plate.faces.cylinders\(radius=7\) is empty; .* there are: 'front' \(plane"):
        faces.cylinders(radius=7).one()
    with pytest.raises(
        InputError, match=r"is 2 faces: 'hole 1' \(hollow cylinder, radius 1.5, .*'hole 2'.*; expected one"
    ):
        faces.cylinders().one()
    with pytest.raises(
        InputError, match=r"cylinders\(\)\.named\('x'\) is empty; .* there are: 'hole 1' \(.*radius 0.5"
    ):
        faces.cylinders().named("x").one()
    with pytest.raises(InputError, match="is 8 faces"):
        faces.frame()
    assert faces(">Z").one() is faces(">Z")[0] and faces(">Z").frame().origin[2] == pytest.approx(1)
    with pytest.raises(InputError, match="of the faces that there are: none"):
        asm.Body("bare").faces.one()


@pytest.mark.parametrize(
    ("call", "error", "text"),
    [
        (lambda f: f.cylinders(radius=-1), InputError, "radius is -1; expected a positive number"),
        (lambda f: f.cylinders(hole=1), InputError, "hole is 1; expected True, False or None"),
        (lambda f: f.cylinders(axis=(0, 0, 0)), InputError, "axis is "),
        (lambda f: f.planes(normal=(1, 2)), InputError, "normal has shape"),
        (lambda f: f.planes(at=(1, 2, np.nan)), InputError, r"at\[2\] is nan"),
        (lambda f: f.near((1, 2)), InputError, "point has shape"),
        (lambda f: f.named(3), TypeError, "pattern is 3; expected a string"),
        (lambda f: f(3), TypeError, "selector is 3; expected a string"),
    ],
)
def test_bad_input(call, error, text):
    with pytest.raises(error, match=text):
        call(plate().faces)


@pytest.mark.parametrize("seed", SEEDS)
def test_what_distances_are_at_least(seed):
    rng = np.random.default_rng(seed)
    body, rotation, offset = placed(seed, asm.shapes.plate(10, 8, 2, [(1, 1, 1.5), (-3, 0, 0.5)]))
    for point in offset + rng.uniform(-8, 8, (4, 3)) @ rotation.T:
        for item in (*body.faces, *body.edges, *body.vertices):
            # Vertices' are their distances.
            assert item.at_least(point) <= item.distance(point) + 1e-12


def test_few_distances_find_the_nearest_of_many_faces(monkeypatch):
    holes = [(x, y, 0.3) for x in range(-6, 7, 2) for y in range(-6, 7, 2)]
    body, asked = asm.Body("plate", asm.shapes.plate(16, 16, 2, holes)), []
    plain = type(body.faces[0]).distance
    monkeypatch.setattr(type(body.faces[0]), "distance", lambda face, point: asked.append(face) or plain(face, point))
    (found,) = body.faces.cylinders().near((4.1, 2, 0))
    assert np.allclose(found.center, (4, 2, 0)) and len(holes) == 49 and len(asked) <= 2


def test_boxes_around_faces_are_asked_for_once(monkeypatch):
    """A selection by lengths asks for the body's size at each of its faces."""
    holes = [(x, 0, 0.3) for x in range(-6, 7, 2)]
    body, asked = asm.Body("plate", asm.shapes.plate(16, 16, 2, holes)), []
    plain = asm.NurbsSurface.bounding_box
    assert len(body.faces.cylinders(0.3)) == 7
    monkeypatch.setattr(asm.NurbsSurface, "bounding_box", lambda surface: asked.append(surface) or plain(surface))
    assert len(body.faces.cylinders(0.3)) == 7 and body.size > 0.0 and not asked
