"""IGES and BREP files: what is written is read again, with names, colors and places, and volumes to 1e-9."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.step.documents import StepError, StepWarning

pytest.importorskip("OCP")
# Surfaces are written exactly; what is left is how edges are followed, and sums of some ten faces.
CLOSE = 1e-9
FORMATS = {"iges": (asm.read_iges, asm.write_iges), "brep": (asm.read_brep, asm.write_brep)}


def bodies():
    plate = asm.Body(
        "a plate with a hole", asm.shapes.plate(40.0, 30.0, 5.0, [(5.0, 3.0, 4.0)]), (1.0, 2.0, 3.0), color=(1, 0, 0)
    )
    turn = np.array([0.8, 0.0, 0.6, 0.0])
    ball = asm.Body("ball", asm.shapes.sphere(3.0), (50.0, 0.0, 0.0), turn)
    ring = asm.Body("ring", asm.shapes.torus(6.0, 2.0), (0.0, 50.0, 7.0), turn)
    rod = asm.Body("rod", asm.shapes.solid_cylinder(2.0, 9.0), (0.0, -50.0, 0.0), turn)
    return [plate, ball, ring, rod]


def places(given):
    """Where the centers of mass are in the world, and volumes, of which two are equal but for rounding."""
    return sorted((*np.round(body.pose.apply(body.center_of_mass), 6).tolist(), body.volume) for body in given)


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("unit", ["mm", "in"])
def test_what_is_written_is_read_again(tmp_path, kind, unit):
    read, write = FORMATS[kind]
    path = tmp_path / f"parts.{kind}"
    if kind == "brep":
        with pytest.warns(StepWarning, match="parts.brep: BREP files have no names: those of 4 bodies are left out"):
            write(path, bodies(), unit=unit)
    else:
        write(path, bodies(), unit=unit)
    found = read(path, unit=unit)
    assert len(found) == 4 and [len(body.faces) for body in found] == [7, 1, 1, 3]
    for one, other in zip(places(found), places(bodies()), strict=True):
        assert one[-1] == pytest.approx(other[-1], rel=CLOSE)
        np.testing.assert_allclose(one[:-1], other[:-1], rtol=0, atol=2e-6)
    kinds = [face.kind for body in found for face in body.faces]
    assert kinds.count("sphere") == kinds.count("torus") == 1 and kinds.count("cylinder") == 2
    if kind == "iges":
        assert [body.name for body in found] == ["a plate with a hole", "ball", "ring", "rod"]
        # Each is the body of its name.
        for one, other in zip(found, bodies(), strict=True):
            assert one.volume == pytest.approx(other.volume, rel=CLOSE)
        assert found[0].color is not None or found[0].faces[0].face.color is not None
    else:
        assert [body.name for body in found] == ["parts", "parts 2", "parts 3", "parts 4"]


def test_faces_without_solids_are_sewn(tmp_path):
    """An IGES file of trimmed surfaces alone, as most programs write it."""
    from assembly.step.occt import occt, quiet, settings
    from assembly.step.writer import document_of_bodies

    o = occt()
    path = tmp_path / "faces.igs"
    o.IGESCAFControl_Writer()
    with quiet(), settings({"write.iges.brep.mode": 0}):
        document = document_of_bodies(path, bodies()[:1], 1.0)
        writer = o.IGESCAFControl_Writer()
        assert writer.Transfer(document.made) and writer.Write(str(path))
    (plate,) = asm.read_iges(path)
    assert len(plate.faces) == 7 and plate.volume == pytest.approx(bodies()[0].volume, rel=CLOSE)


def test_bad_input(tmp_path):
    nothing = tmp_path / "nothing.igs"
    with pytest.raises(FileNotFoundError, match="no such file"):
        asm.read_iges(nothing)
    with pytest.raises(FileNotFoundError, match="a folder"):
        asm.read_brep(tmp_path)
    nothing.write_text("nonsense\n")
    with pytest.raises(StepError, match="expected an IGES file with shapes"):
        asm.read_iges(nothing)
    with pytest.raises(StepError, match="expected a BREP file with a shape"):
        asm.read_brep(nothing)
    with pytest.raises(InputError, match=r"expected a name that ends in .igs or .iges"):
        asm.write_iges(tmp_path / "parts.step", bodies())
    with pytest.raises(InputError, match=r"expected a name that ends in .brep or .brp"):
        asm.write_brep(tmp_path / "parts.stl", bodies())
    with pytest.raises(InputError, match="unit is 'ell'"):
        asm.write_brep(tmp_path / "parts.brep", bodies(), unit="ell")
    for suffix, name in (
        (".igs", "write_iges"),
        (".brep", "write_brep"),
        (".stl", "write_stl"),
        (".glb", "write_gltf"),
    ):
        with pytest.raises(StepError, match=f"asm.{name} writes these"):
            asm.write_step(tmp_path / f"parts{suffix}", bodies())
    for write in (asm.write_iges, asm.write_brep, asm.write_stl, asm.write_gltf):
        with pytest.raises(InputError, match="a name of STEP files; expected .*; asm.write_step writes these"):
            write(tmp_path / "parts.step", bodies())
    with pytest.raises(InputError, match="parts.xyz'; expected a name that ends in .igs or .iges$"):
        asm.write_iges(tmp_path / "parts.xyz", bodies())
