"""Trimmed faces and edges in pictures: what is drawn, once, and where; and that it moves with its body."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.view import mesh as meshes
from assembly.view.commands import ROOT, commands
from assembly.view.mesh import body_mesh, face_mesh
from assembly.view.outline import body_lines, extent
from assembly.view.picture import draw
from tests.view.test_page import array, drawn

PI = np.pi


@pytest.fixture
def pinned():
    """A plate with two holes and a pin above one of them."""
    plate = asm.Body("blue", asm.shapes.plate(60.0, 40.0, 8.0, holes=[(0.0, 0.0, 8.0), (20.0, -8.0, 4.0)]), fixed=True)
    pin = asm.Body("orange", asm.shapes.solid_cylinder(7.9, 30.0), position=(0.0, 0.0, 22.0))
    return asm.Assembly([plate, pin])


def area(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()


def edge_length(lines):
    return np.linalg.norm(np.diff(lines.points[lines.segments], axis=1), axis=2).sum()


def test_a_trimmed_face_is_drawn_within_its_trim(pinned):
    plate = pinned.bodies[0]
    mesh = body_mesh(plate)
    middle = mesh.vertices[mesh.triangles].mean(axis=1)
    cap = np.abs(np.abs(middle[:, 2]) - 4.0) < 1e-9
    for x, y, radius in ((0.0, 0.0, 8.0), (20.0, -8.0, 4.0)):
        # 48 sides to a circle: chords are 0.2 percent of the radius within it.
        assert np.hypot(middle[cap, 0] - x, middle[cap, 1] - y).min() > 0.997 * radius
    walls = 2 * (60 + 40) * 8 + 2 * PI * (8 + 4) * 8
    caps = 2 * (60 * 40 - PI * (64 + 16))
    assert area(mesh) == pytest.approx(walls + caps, rel=2e-3)
    # Outward: moved along their normals, corners leave the plate's volume, also into its holes.
    out = mesh.vertices + 1e-3 * mesh.normals
    within = (np.abs(out) < [30, 20, 4]).all(axis=1)
    in_hole = (np.hypot(out[:, 0], out[:, 1]) < 8.0) | (np.hypot(out[:, 0] - 20, out[:, 1] + 8) < 4.0)
    assert not (within & ~in_hole).any()


def test_edges_are_drawn_once(pinned):
    plate, pin = (body_lines(body) for body in pinned.bodies)
    # The edges of the box, and two circles for each hole of 48 sides or more; each is of two faces.
    box, rims = 4 * (60 + 40 + 8), 4 * PI * (8 + 4)
    assert edge_length(plate) == pytest.approx(box + rims, rel=2e-3)
    assert len(plate.segments) == 12 + 4 * 48
    assert edge_length(pin) == pytest.approx(4 * PI * 7.9, rel=2e-3)
    assert np.abs(np.abs(pin.points[:, 2]) - 15.0).max() < 1e-12


def test_what_has_no_edges():
    for shape in (asm.shapes.sphere(1.0), asm.shapes.torus(3.0, 1.0), asm.shapes.paper_clip(), None):
        assert body_lines(asm.Body("smooth", shape)) is None
    # A seam is no edge, nor is the apex of a cone.
    lines = body_lines(asm.Body("cone", asm.shapes.cone(1.0, 2.0)))
    assert np.abs(lines.points[:, 2] + 1.0).max() < 1e-12
    assert edge_length(lines) == pytest.approx(2 * PI, rel=2e-3)


def test_the_extent_of_a_face_is_not_that_of_its_surface():
    wide = asm.shapes.plane(1000.0, 1000.0)
    corners = [(0.0, 0.0), (3.0, 0.0), (3.0, 4.0), (0.0, 4.0)]
    loop = [asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    assert extent([asm.Face(wide, loop)]) == pytest.approx(5.0, abs=1e-12)
    # A cap is more than its ring.
    ring = asm.NurbsCurve([[0.0, 0.1], [2 * PI, 0.1]], [0, 0, 1, 1], 1)
    assert extent([asm.Face(asm.shapes.sphere(1.0), ring)]) >= 2.0


def test_faces_are_cut_up_once(pinned, monkeypatch):
    draw(pinned)
    monkeypatch.setattr(meshes, "facets", None)
    first = draw(pinned)
    twin = asm.Body("twin", [side.face for side in pinned.bodies[0].faces], position=(0.0, 100.0, 0.0))
    both = draw(asm.Assembly([*pinned.bodies, twin]))
    found = {item.path[1]: item.mesh for item in both.items}
    assert (found["twin"].triangles == found["blue"].triangles).all()
    assert len(first.items) + 1 == len(both.items)


def test_a_page_holds_the_edges(pinned, tmp_path):
    asm.view.save_html(tmp_path / "pin.html", pinned)
    found = drawn((tmp_path / "pin.html").read_text(encoding="utf-8"))
    objects = {c["path"]: c["object"] for c in found if c["type"] == "set_object"}
    assert set(objects) == {f"{ROOT}/bodies/{name}{part}" for name in ("blue", "orange") for part in ("", "/edges")}
    moved = {c["path"] for c in found if c["type"] == "set_transform"}
    assert moved == {f"{ROOT}/bodies/blue", f"{ROOT}/bodies/orange"}
    for item in draw(pinned).items:
        edges = objects["/".join([ROOT, *item.path, "edges"])]
        assert edges["object"]["type"] == "LineSegments"
        assert edges["materials"][0]["type"] == "LineBasicMaterial"
        data = edges["geometries"][0]["data"]
        points = array(data["attributes"]["position"]).reshape(-1, 3)
        # Single precision is the browser's.
        assert points == pytest.approx(item.lines.points, abs=1e-5)
        assert (array(data["index"]).reshape(-1, 2) == item.lines.segments).all()
        # In the same coordinates as the mesh: every corner of an edge is one of the mesh, or on one of its edges.
        assert np.abs(np.abs(points).max(axis=0) - np.abs(item.mesh.vertices).max(axis=0)).max() < 1e-5
    # Meshcat's viewer is two thirds of a megabyte; a plate and a pin are little beside it.
    assert (tmp_path / "pin.html").stat().st_size < 1_200_000


def test_edges_move_with_their_body(pinned, tmp_path):
    q = np.repeat(pinned.q[None], 5, axis=0)
    q[:, 1, 2] = np.linspace(22.0, 12.0, 5)
    asm.view.animate(pinned, q, tmp_path / "pin.html")
    *still, last = drawn((tmp_path / "pin.html").read_text(encoding="utf-8"))
    assert f"{ROOT}/bodies/orange/edges" in {c.get("path") for c in still}
    # Below the body in the viewer's tree: no track of their own.
    assert {clip["path"] for clip in last["animations"]} == {f"{ROOT}/bodies/blue", f"{ROOT}/bodies/orange"}


def test_a_browser_shows_a_hole_and_edges(photo, tmp_path):
    plate = asm.Body("green", asm.shapes.plate(60.0, 40.0, 8.0, holes=[(0.0, 0.0, 12.0)]))
    asm.view.save_html(tmp_path / "plate.html", asm.Assembly([plate]), direction=(0.0, 0.0, 1.0))
    pixels = photo(tmp_path / "plate.html").astype(int)
    height, width, _ = pixels.shape
    green = pixels[..., 1] > pixels[..., 0] + 40
    assert green.mean() > 0.15
    # Straight through the hole there is the background.
    assert not green[height // 2 - 5 : height // 2 + 5, width // 2 - 5 : width // 2 + 5].any()
    # A closed dark line around the plate: every row and column that cuts the plate's middle meets one at both ends.
    dark = pixels.max(axis=2) < 110
    row = np.flatnonzero(dark[height // 2])
    sides = np.flatnonzero(green[height // 2])[[0, -1]]
    assert np.abs(row[[0, -1]] - sides).max() <= 3
    # The round edge, too: left and right of the hole.
    assert len(row) >= 4 and (np.abs(row - width / 2) < 0.5 * np.ptp(sides) - 8).any()


def test_trimmed_faces_of_bodies_that_do_not_fit_a_budget():
    mesh = face_mesh(
        asm.Face(
            asm.shapes.plane(4.0, 4.0),
            asm.NurbsCurve(
                np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float),
                [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4],
                2,
                [1, np.sqrt(0.5)] * 4 + [1],
            ),
        ),
        10,
    )
    # Equal steps around the circle, to the precision of 64 samples.
    assert len(mesh.vertices) == 48
    assert area(mesh) == pytest.approx(0.5 * 48 * np.sin(2 * PI / 48), rel=1e-7)


def test_a_scene_of_trimmed_faces_draws_the_same_again(pinned):
    first, second = (list(commands(draw(pinned))) for _ in range(2))
    assert first == second


def test_colors_of_bodies_and_faces(pinned, monkeypatch):
    plate, pin = pinned.bodies
    monkeypatch.setattr(pin, "color", (0.1, 0.2, 0.3), raising=False)
    top = plate.face("top").face
    monkeypatch.setattr(top, "color", (1.0, 0.5, 0.0), raising=False)
    first, second = draw(pinned).items
    assert second.color == (0.1, 0.2, 0.3) and second.mesh.colors is None
    own = ~np.isnan(first.mesh.colors).any(axis=1)
    # The upper cap and nothing else.
    assert (first.mesh.normals[own] == [0.0, 0.0, 1.0]).all()
    assert own.sum() == len(face_mesh(top).vertices)
    plate_object, *_ = (c["object"] for c in commands(draw(pinned)) if c["type"] == "set_object")
    assert plate_object["materials"][0]["vertexColors"] and plate_object["materials"][0]["color"] == 0xFFFFFF
    colors = array(plate_object["geometries"][0]["data"]["attributes"]["color"]).reshape(-1, 3)
    # Single precision is the browser's.
    assert colors[own] == pytest.approx(np.tile([1.0, 0.5, 0.0], (own.sum(), 1)), abs=1e-6)
    assert colors[~own] == pytest.approx(np.tile(first.color, ((~own).sum(), 1)), abs=1e-6)
