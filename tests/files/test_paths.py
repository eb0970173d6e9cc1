"""What is no path of a file is refused by the name of its argument, at every door."""

from __future__ import annotations

import pytest

import assembly as asm

BALL = asm.Body("ball", asm.shapes.sphere(1.0))
READERS = [asm.read_brep, asm.read_iges, asm.read_picture, asm.read_step, asm.read_urdf]
WRITERS = [asm.write_brep, asm.write_iges, asm.write_step, asm.write_stl, asm.write_gltf, asm.write_urdf]


@pytest.mark.parametrize("read", READERS, ids=lambda read: read.__name__)
@pytest.mark.parametrize("path", [7, None, ["part.step"]], ids=repr)
def test_readers(read, path):
    with pytest.raises(TypeError, match=r"path is .*; expected the path of a file"):
        read(path)


@pytest.mark.parametrize("write", WRITERS, ids=lambda write: write.__name__)
def test_writers(write):
    with pytest.raises(TypeError, match=r"path is 7; expected the path of a file"):
        write(7, [BALL])


@pytest.mark.parametrize("suffix", [".step", ".STL", ".glb", ".urdf"])
def test_scenes_and_pages_do_not_take_the_suffix_of_another_format(tmp_path, suffix):
    scene, path = asm.Assembly([BALL]), tmp_path / f"ball{suffix}"
    for write in (scene.save, lambda path: asm.view.save_html(path, scene)):
        with pytest.raises(asm.errors.InputError, match=r"a name of .* files; expected .*; asm.write_\w* writes these"):
            write(path)
    assert not path.exists()
    scene.save(tmp_path / "ball.scene")
    asm.view.save_html(tmp_path / "ball.page", scene)


@pytest.mark.parametrize("suffix", ["", ".igs", ".stl", ".json", ".urdf", ".obj"])
@pytest.mark.parametrize("read", [*READERS, asm.load], ids=lambda read: read.__name__)
def test_a_file_of_another_format_says_what_reads_it(tmp_path, read, suffix):
    path = tmp_path / f"ball{suffix}"
    path.write_text("something else\n")
    pytest.importorskip({"read_urdf": "yourdfpy", "read_picture": "trimesh", "load": "json"}.get(read.__name__, "OCP"))
    with pytest.raises(asm.errors.InputError) as error:
        read(path)
    own = {".igs": asm.read_iges, ".json": asm.load, ".urdf": asm.read_urdf}.get(suffix, asm.read_picture)
    assert (f"asm.{own.__name__} reads {suffix} files" in str(error.value)) == (bool(suffix) and read is not own)
