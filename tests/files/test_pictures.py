"""Pictures of bodies: triangles of files and of robots' meshes, drawn, written and kept, and touched by nothing."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.files.robot import UrdfWarning
from assembly.view.mesh import body_mesh
from assembly.view.outline import body_lines

trimesh = pytest.importorskip("trimesh")
TRIANGLE = asm.PictureMesh([[0, 0, 0], [1, 0, 0], [0, 2, 0]], [[0, 1, 2]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]])
# Numbers of these files have single precision.
SINGLE = 1e-6

ROBOT = """<robot name="arm">
  <material name="steel"><color rgba="0.1 0.2 0.3 1"/></material>
  <link name="base">
    <visual><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>
      <geometry><mesh filename="package://somewhere/meshes/block.stl" scale="0.001 0.001 -0.002"/></geometry>
      <material name="steel"/></visual>
    <visual><geometry><sphere radius="0.5"/></geometry></visual>
    <collision><geometry><box size="1 2 3"/></geometry></collision>
  </link>
  <link name="fore"><collision><geometry><mesh filename="meshes/block.stl"/></geometry></collision></link>
  <link name="hand"><visual><geometry><box size="1 1 1"/></geometry></visual></link>
  <link name="nail"><visual><geometry><mesh filename="meshes/none.stl"/></geometry></visual></link>
  <link name="ball"><visual><geometry><sphere radius="1"/></geometry></visual>
    <collision><geometry><sphere radius="1"/></geometry></collision></link>
  <joint name="a" type="fixed"><parent link="base"/><child link="fore"/></joint>
  <joint name="b" type="fixed"><parent link="base"/><child link="hand"/></joint>
  <joint name="c" type="fixed"><parent link="base"/><child link="nail"/></joint>
  <joint name="d" type="fixed"><parent link="base"/><child link="ball"/></joint>
</robot>
"""


@pytest.fixture
def robot(tmp_path):
    (tmp_path / "meshes").mkdir()
    block = trimesh.creation.box(extents=(1.0, 2.0, 4.0))
    block.apply_translation((0.5, 1.0, 2.0))
    block.export(tmp_path / "meshes" / "block.stl")
    path = tmp_path / "arm.urdf"
    path.write_text(ROBOT)
    with pytest.warns(UrdfWarning, match="link 'nail' has the mesh 'meshes/none.stl'.*no such file; left out"):
        return asm.read_urdf(path)


def volume(picture):
    corners = picture.vertices[picture.triangles]
    return np.linalg.det(corners).sum() / 6.0


def test_meshes_of_a_robot_are_pictures_of_its_links(robot):
    base = robot.body("base")
    # The block, a thousandth of it and mirrored, turned by 90 degrees and a meter up, beside a ball that is drawn too.
    steel = (base.picture.colors == [0.1, 0.2, 0.3]).all(axis=1)
    block = base.picture.vertices[steel]
    np.testing.assert_allclose(block.min(axis=0), (-2.0, 0.0, 992.0), atol=1e-3)
    np.testing.assert_allclose(block.max(axis=0), (0.0, 1.0, 1000.0), atol=1e-3)
    # Corners of the mirrored block go around as seen from outside: volumes of both are positive.
    assert volume(base.picture) == pytest.approx(4.0 / 3.0 * np.pi * 500.0**3, rel=1e-2)
    assert volume(robot.body("fore").picture) == pytest.approx(8e9, rel=SINGLE) and not robot.body("fore").faces
    assert volume(robot.body("hand").picture) == pytest.approx(1e9, rel=SINGLE)
    assert robot.body("nail").picture is None and robot.body("ball").picture is None
    # Exact is what `<collision>` says.
    assert base.volume == pytest.approx(6e9, rel=1e-12)


def test_a_mirrored_mesh_faces_outward(robot, tmp_path):
    alone = ROBOT.replace('<visual><geometry><sphere radius="0.5"/></geometry></visual>', "")
    (tmp_path / "alone.urdf").write_text(alone)
    with pytest.warns(UrdfWarning, match="nail"):
        base = asm.read_urdf(tmp_path / "alone.urdf").body("base")
    assert volume(base.picture) == pytest.approx(16.0, rel=SINGLE)


def test_a_robot_with_pictures_is_written_and_read_again(robot, tmp_path):
    again = tmp_path / "again" / "arm.urdf"
    again.parent.mkdir()
    asm.write_urdf(again, robot)
    other = asm.read_urdf(again)
    for one, two in zip(robot.bodies, other.bodies, strict=True):
        assert (one.picture is None, len(one.faces)) == (two.picture is None, len(two.faces))
        if one.picture is not None:
            assert volume(two.picture) == pytest.approx(volume(one.picture), rel=1e-5)
    page = tmp_path / "arm.html"
    asm.view.save_html(page, robot.assembly())
    assert page.stat().st_size > 1000


def test_a_body_that_is_no_primitive_has_its_own_mesh_beside_its_picture(tmp_path):
    ring = asm.Body("ring", asm.shapes.torus(50.0, 10.0), picture=TRIANGLE, fixed=True)
    asm.write_urdf(tmp_path / "ring.urdf", asm.Assembly([ring]))
    seen, exact = (trimesh.load(tmp_path / name) for name in ("ring_ring.stl", "ring_ring_2.stl"))
    assert len(seen.faces) == 1 and exact.volume == pytest.approx(1e-9 * ring.volume, rel=2e-2)


def test_a_body_is_drawn_by_its_picture(tmp_path):
    body = asm.Body("box", asm.shapes.box(1.0, 1.0, 1.0))
    assert body.picture is None and len(body_lines(body).segments) == 12
    body.picture = TRIANGLE
    mesh = body_mesh(body)
    np.testing.assert_array_equal(mesh.vertices, TRIANGLE.vertices)
    np.testing.assert_array_equal(mesh.normals, [[0, 0, 1]] * 3)
    np.testing.assert_array_equal(mesh.colors, TRIANGLE.colors)
    assert body_lines(body) is None
    twin = asm.Body("twin", [side.face for side in body.faces])
    pytest.importorskip("pygltflib")
    asm.write_gltf(tmp_path / "two.glb", [body, twin])
    loaded = trimesh.load(tmp_path / "two.glb")
    assert sorted(len(each.faces) for each in loaded.geometry.values()) == [1, 12]


def test_scene_files_and_pickles_keep_pictures(tmp_path):
    plain = asm.Body("plain", picture=asm.PictureMesh(TRIANGLE.vertices / 3.0, TRIANGLE.triangles))
    scene = asm.Assembly([asm.Body("ground", fixed=True), asm.Body("seen", picture=TRIANGLE), plain])
    scene.save(tmp_path / "scene.json")
    for other in (asm.load(tmp_path / "scene.json"), pickle.loads(pickle.dumps(scene))):
        assert other.bodies[0].picture is None
        for one, two in zip(scene.bodies[1:], other.bodies[1:], strict=True):
            np.testing.assert_array_equal(one.picture.vertices, two.picture.vertices)
            np.testing.assert_array_equal(one.picture.triangles, two.picture.triangles)
            np.testing.assert_array_equal(one.picture.colors, two.picture.colors)
            assert not two.picture.vertices.flags.writeable


@pytest.mark.parametrize("suffix", [".stl", ".obj", ".ply", ".glb"])
def test_files_of_triangles(tmp_path, suffix):
    path = tmp_path / f"rod{suffix}"
    trimesh.creation.cylinder(radius=1.0, height=3.0, sections=64).export(path)
    picture = asm.read_picture(path, unit="mm", file_unit="cm")
    expected = 64 / 2 * np.sin(2 * np.pi / 64) * 3000.0
    assert volume(picture) == pytest.approx(expected, rel=SINGLE)
    # Smooth around the rod, sharp at its rims: normals of vertices are radial or axial.
    axial = np.abs(picture.normals[:, 2])
    assert ((axial < 1e-3) | (axial > 1.0 - 1e-3)).all() and (axial < 0.5).sum() == 128
    # Without being told, glTF is in meters, and the others are as the body is.
    factor = 1e9 if suffix == ".glb" else 1.0
    assert volume(asm.read_picture(path)) == pytest.approx(1e-3 * factor * expected, rel=SINGLE)


def test_colors_of_a_file(tmp_path):
    mesh = trimesh.creation.box()
    mesh.visual.face_colors = [51, 102, 255, 255]
    mesh.export(tmp_path / "box.ply")
    np.testing.assert_allclose(asm.read_picture(tmp_path / "box.ply").colors, [[0.2, 0.4, 1.0]] * 24)


def test_what_is_no_picture(tmp_path):
    with pytest.raises(InputError, match=r"path is '.*box.step'; expected a name that ends in one of .glb"):
        asm.read_picture(tmp_path / "box.step")
    with pytest.raises(FileNotFoundError, match=r"none.stl'; no such file"):
        asm.read_picture(tmp_path / "none.stl")
    for content in (b"", b"solid nothing\nendsolid nothing\n", b"\x00" * 200):
        (tmp_path / "broken.stl").write_bytes(content)
        with pytest.raises(InputError, match=r"broken.stl'; expected triangles"):
            asm.read_picture(tmp_path / "broken.stl")
    with pytest.raises(InputError, match="file_unit is 'foot'; expected one of"):
        asm.read_picture(tmp_path / "box.stl", file_unit="foot")
    with pytest.raises(TypeError, match="picture is 'box.stl'; expected a PictureMesh or None"):
        asm.Body("box", picture="box.stl")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (([[0, 0]], [[0, 0, 0]]), r"vertices has the shape \(1, 2\); expected \(n, 3\)"),
        (([[0, 0, np.nan]], [[0, 0, 0]]), "vertices hold numbers that are not finite"),
        (([[0, 0, 0]], np.zeros((0, 3))), "triangles are none; expected one at least"),
        (([[0, 0, 0]], [[0, 0, 1]]), "triangles hold 1; expected indices of 1 vertices, from 0"),
        (([[0, 0, 0]], [[0, 0, -1]]), "triangles hold -1"),
        (([[0, 0, 0]], [[0, 0, 0.5]]), "triangles hold numbers that are not whole"),
        (([[0, 0, 0]], [[0, 0, 0]], [[0, 0, 2]]), "colors hold numbers out of range; expected 0 to 1"),
        (([[0, 0, 0]], [[0, 0, 0]], [[0, 0, 0]] * 2), "colors are 2; expected one for each of 1 vertices"),
        (("abc", [[0, 0, 0]]), "vertices is 'abc'; expected rows of three numbers"),
    ],
)
def test_bad_triangles(arguments, text):
    with pytest.raises(InputError, match=text):
        asm.PictureMesh(*arguments)
