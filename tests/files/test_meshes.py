"""Triangles of scenes in STL and glTF files, read back by the libraries that others use."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.kinematics.pose import rotation_matrix

trimesh = pytest.importorskip("trimesh")
pygltflib = pytest.importorskip("pygltflib")
# Chords of a picture turn by 7.5 degrees: a ball of them has 0.7 percent less volume.
ROUGH = 1e-2
# Numbers in these files have single precision.
SINGLE = 1e-6


def scene():
    turned = np.array([0.9, 0.1, -0.3, 0.3])
    box = asm.Body("box", asm.shapes.box(10.0, 20.0, 30.0), (50.0, -20.0, 10.0), turned / np.linalg.norm(turned))
    ball = asm.Body("ball", asm.shapes.sphere(7.0), (0.0, 30.0, 0.0), color=(1.0, 0.5, 0.0))
    twin = asm.Body("twin", [side.face for side in ball.faces], (0.0, 60.0, 0.0), color=(1.0, 0.5, 0.0))
    return asm.Assembly([asm.Body("ground", fixed=True), box, ball, twin])


def test_an_stl_file_has_the_bodies_where_they_stand(tmp_path):
    path = tmp_path / "scene.stl"
    bodies = scene().bodies
    asm.write_stl(path, scene())
    mesh = trimesh.load(path)
    assert mesh.is_watertight and mesh.is_winding_consistent
    expected = bodies[1].volume + 2.0 * bodies[2].volume
    assert mesh.volume == pytest.approx(expected, rel=ROUGH)
    parts = sorted(mesh.split(), key=lambda part: -part.volume)
    assert parts[0].volume == pytest.approx(6000.0, rel=SINGLE)
    np.testing.assert_allclose(parts[0].center_mass, (50.0, -20.0, 10.0), rtol=SINGLE)
    asm.write_stl(path, scene().solve())
    assert trimesh.load(path).volume == pytest.approx(expected, rel=ROUGH)


def test_a_glb_file_has_names_colors_and_places_in_meters(tmp_path):
    path = tmp_path / "scene.glb"
    given = scene()
    asm.write_gltf(path, given)
    loaded = trimesh.load(path)
    up = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    for body in given.bodies[1:]:
        matrix, mesh = loaded.graph[body.name]
        np.testing.assert_allclose(matrix[:3, 3], 1e-3 * up @ body.pose.position, atol=1e-9)
        np.testing.assert_allclose(matrix[:3, :3], 1e-3 * up @ rotation_matrix(body.q[3:]), atol=1e-9)
        volume = loaded.geometry[mesh].volume
        assert volume == pytest.approx(body.volume, rel=ROUGH)
    document = pygltflib.GLTF2.load(str(path))
    names = [node.name for node in document.nodes]
    assert names == ["scene", "ground", "box", "ball", "twin"] and document.nodes[1].mesh is None
    # The same faces and color: one mesh.
    assert document.nodes[3].mesh == document.nodes[4].mesh and len(document.meshes) == 2
    color = document.materials[document.meshes[document.nodes[3].mesh].primitives[0].material]
    # sRGB 0.5 is 0.214 of the light.
    np.testing.assert_allclose(color.pbrMetallicRoughness.baseColorFactor, (1.0, 0.21404114, 0.0, 1.0), atol=1e-8)


def test_faces_of_their_own_color(tmp_path):
    path = tmp_path / "body.glb"
    faces = list(asm.shapes.box(1.0, 1.0, 1.0))
    faces[0] = asm.Face(faces[0].surface, name=faces[0].name, color=(1.0, 0.0, 0.0))
    asm.write_gltf(path, asm.Body("box", faces, color=(0.0, 0.0, 1.0)), unit="m")
    document = pygltflib.GLTF2.load(str(path))
    place = document.accessors[document.meshes[0].primitives[0].attributes.COLOR_0]
    view = document.bufferViews[place.bufferView]
    data = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
    colors = np.frombuffer(data, dtype=np.float32).reshape(-1, 3)
    assert {tuple(row) for row in colors.tolist()} == {(1.0, 0.0, 0.0), (0.0, 0.0, 1.0)}


def test_a_trajectory_plays(tmp_path):
    path = tmp_path / "film.glb"
    given = scene()
    rows = np.stack([given.q, given.q, given.q])
    rows[1, 2, :3] += 10.0
    # The same turn by the other quaternion: nothing turns on the way.
    rows[2, 1, 3:] *= -1.0
    asm.write_gltf(path, given, rows, seconds=3.0)
    document = pygltflib.GLTF2.load(str(path))
    (animation,) = document.animations

    def numbers(accessor, width):
        view = document.bufferViews[document.accessors[accessor].bufferView]
        data = document.binary_blob()[view.byteOffset : view.byteOffset + view.byteLength]
        return np.frombuffer(data, dtype=np.float32).reshape(-1, width)

    for channel in animation.channels:
        sampler = animation.samplers[channel.sampler]
        np.testing.assert_allclose(numbers(sampler.input, 1)[:, 0], (0.0, 1.5, 3.0))
        body = channel.target.node - 1
        if channel.target.path == "translation":
            np.testing.assert_allclose(numbers(sampler.output, 3), rows[:, body, :3], atol=1e-5)
        else:
            turns = numbers(sampler.output, 4)
            np.testing.assert_allclose(turns, np.tile(turns[:1], (3, 1)), atol=SINGLE)
            np.testing.assert_allclose(turns[0], given.q[body, [4, 5, 6, 3]], atol=SINGLE)


def test_bad_input(tmp_path):
    given = scene()
    with pytest.raises(InputError, match="expected a name that ends in .glb"):
        asm.write_gltf(tmp_path / "scene.gltf", given)
    with pytest.raises(InputError, match="expected a name that ends in .stl"):
        asm.write_stl(tmp_path / "scene.step", given)
    with pytest.raises(InputError, match="what has no body with a shape"):
        asm.write_stl(tmp_path / "scene.stl", asm.Body("bare"))
    with pytest.raises(InputError, match="what has no bodies"):
        asm.write_gltf(tmp_path / "scene.glb", [])
    with pytest.raises(TypeError, match="expected an Assembly, of which the trajectory is"):
        asm.write_gltf(tmp_path / "scene.glb", given.bodies, [given.q, given.q])
    with pytest.raises(InputError, match="trajectory has 1 frame"):
        asm.write_gltf(tmp_path / "scene.glb", given, [given.q])
    with pytest.raises(InputError, match="seconds is"):
        asm.write_gltf(tmp_path / "scene.glb", given, [given.q, given.q], seconds=0.0)
    assert not list(tmp_path.iterdir())
