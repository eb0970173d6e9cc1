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
