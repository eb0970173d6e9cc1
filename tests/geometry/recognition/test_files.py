"""Faces of STEP files: what the file calls them is what they are recognized as."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.recognition.elementary import elementary_form

FOLDER = os.environ.get("ASSEMBLY_CAD_DATA")
FILES = sorted(
    (path for path in Path(FOLDER or ".").rglob("*") if path.suffix.lower() in (".stp", ".step")),
    key=lambda path: (path.stat().st_size, path.name),
)


@pytest.fixture
def surfaces(monkeypatch):
    """Surfaces of OCCT, and what was read of them, of all files that are read meanwhile."""
    from assembly.step import edges

    found, made = [], edges.patch

    def recorded(surface, box):
        read = made(surface, box)
        found.append((surface, read.surface))
        return read

    monkeypatch.setattr(edges, "patch", recorded)
    return found


def xyz(point):
    return np.array([point.X(), point.Y(), point.Z()])


def check_axis(form, at, place, size):
    """The axis of a form is that of a placement."""
    axis, off = xyz(place.Direction()), at - xyz(place.Location())
    assert np.linalg.norm(np.cross(form.axis, axis)) < 1e-9
    assert np.linalg.norm(off - (off @ axis) * axis) < 1e-9 * max(size, np.abs(at).max())


def check(surface, form, size):
    """A form is what OCCT's surface is; its name."""
    while hasattr(surface, "BasisSurface"):
        surface = surface.BasisSurface()
    name = type(surface).__name__.removeprefix("Geom_")
    found = type(form).__name__
    if name == "Plane":
        assert found == "Plane"
        assert np.linalg.norm(np.cross(form.normal, xyz(surface.Position().Direction()))) < 1e-9
    elif name == "CylindricalSurface":
        assert found == "Cylinder" and form.radius == pytest.approx(surface.Radius(), abs=1e-9 * size)
        check_axis(form, form.point, surface.Position(), size)
    elif name == "ConicalSurface":
        assert found == "Cone" and form.half_angle == pytest.approx(abs(surface.SemiAngle()), abs=1e-9)
        check_axis(form, form.apex, surface.Position(), size)
    elif name == "SphericalSurface":
        assert found == "Sphere" and form.radius == pytest.approx(surface.Radius(), abs=1e-9 * size)
        np.testing.assert_allclose(form.center, xyz(surface.Position().Location()), atol=1e-9 * size)
    elif name == "ToroidalSurface":
        assert found == "Torus"
        assert form.major == pytest.approx(surface.MajorRadius(), abs=1e-9 * size)
        assert form.minor == pytest.approx(surface.MinorRadius(), abs=1e-9 * size)
        check_axis(form, form.center, surface.Position(), size)
    elif name == "SurfaceOfLinearExtrusion":
        assert found in ("Plane", "Cylinder", "Extrusion")
    elif name == "SurfaceOfRevolution":
        assert found in ("Plane", "Cylinder", "Cone", "Sphere", "Torus", "Revolution")
    return name


@pytest.mark.skipif(FOLDER is None, reason="ASSEMBLY_CAD_DATA names no folder with STEP files")
def test_analytic_faces_of_files(surfaces, cases):
    pytest.importorskip("OCP")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in FILES[: cases(5, len(FILES))]:
            asm.read_step(path, strict=False)
    names = [check(surface, elementary_form(made), made.size) for surface, made in surfaces]
    assert {"Plane", "CylindricalSurface", "SphericalSurface"} <= set(names)


def test_analytic_surfaces_of_occt(cases):
    pytest.importorskip("OCP")
    from assembly.step.occt import occt
    from assembly.step.surfaces import patch

    o = occt()
    rng = np.random.default_rng(0)
    for _ in range(cases(10, 300)):
        axis, x = rng.standard_normal((2, 3))
        place = o.gp_Ax3(o.gp_Pnt(*(100.0 * rng.standard_normal(3))), o.gp_Dir(*axis), o.gp_Dir(*x))
        radius, other, angle = rng.uniform(1.0, 10.0), rng.uniform(0.1, 0.9), rng.uniform(0.1, 1.4)
        turn, height = (0.3, 0.3 + rng.uniform(0.1, 5.9)), (1.0, 1.0 + rng.uniform(0.1, 9.0))
        arc = (-0.4, -0.4 + rng.uniform(0.1, 1.8))
        made = [
            (o.Geom_CylindricalSurface(place, radius), (*turn, *height)),
            (o.Geom_ConicalSurface(place, angle, radius), (*turn, *height)),
            (o.Geom_SphericalSurface(place, radius), (*turn, *arc)),
            (o.Geom_ToroidalSurface(place, radius, other * radius), (*turn, *arc)),
        ]
        for surface, box in made:
            read = patch(surface, box).surface
            check(surface, elementary_form(read), read.size)
