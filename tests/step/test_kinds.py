"""Surfaces are written as what they are, at every size, and bands, loops that touch and overshoots are read again."""

from __future__ import annotations

import shutil
from math import pi
from types import SimpleNamespace

import numpy as np
import pytest

import assembly as asm
from assembly.step import StepError, StepWarning
from assembly.step.documents import _entries_of
from assembly.step.solids import sewn
from tests.geometry.loops import circle, polygon
from tests.step.models import O

KINDS = (
    "PLANE",
    "CYLINDRICAL_SURFACE",
    "CONICAL_SURFACE",
    "SPHERICAL_SURFACE",
    "TOROIDAL_SURFACE",
    "SURFACE_OF_LINEAR_EXTRUSION",
    "SURFACE_OF_REVOLUTION",
    "B_SPLINE_SURFACE_WITH_KNOTS",
)


def wave(count=7):
    """An open spline in the plane of x and y, away from the axis of x."""
    x = np.linspace(0.0, 3.0, count)
    return np.column_stack([x, 2.0 + 0.3 * np.sin(2.0 * x), np.zeros(count)])


def pushed(scale):
    points = scale * np.stack([wave(), wave() + [0.0, 0.2, 2.0]], axis=1)
    return asm.NurbsSurface(points, (np.array([0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4.0]), [0, 0, 1, 1.0]), (3, 1))


def turned(scale):
    """The wave turned by a right angle about the axis of x."""
    flat = wave()
    half = np.stack([flat, flat * [1, 1, 0] + flat[:, [0, 2, 1]] * [0, 0, 1], flat[:, [0, 2, 1]]], axis=1)
    weights = np.repeat([[1.0, np.sqrt(0.5), 1.0]], 7, axis=0)
    knots = (np.array([0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4.0]), [0, 0, 0, 1, 1, 1.0])
    return asm.NurbsSurface(scale * half, knots, (3, 2), weights)


SURFACES = {
    "plane": (lambda s: asm.shapes.plane(3.0 * s, 2.0 * s), "PLANE"),
    "cylinder": (lambda s: asm.shapes.cylinder(s, 3.0 * s), "CYLINDRICAL_SURFACE"),
    "sphere": (lambda s: asm.shapes.sphere(2.0 * s), "SPHERICAL_SURFACE"),
    "torus": (lambda s: asm.shapes.torus(4.0 * s, s), "TOROIDAL_SURFACE"),
    "extrusion": (pushed, "SURFACE_OF_LINEAR_EXTRUSION"),
    "revolution": (turned, "SURFACE_OF_REVOLUTION"),
}
CHANGES = {
    "as it is": lambda surface: surface,
    "u and v exchanged": lambda surface: surface.transposed(),
    "u backwards": lambda surface: surface.reversed(0),
    "v backwards": lambda surface: surface.reversed(1),
    "of a higher degree": lambda surface: surface.elevate((4, 4)),
    "far away": lambda surface: surface.transformed(translation=np.array([300.0, -200.0, 100.0]) * surface.size),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_is_written_as_what_it_is(tmp_path, name, scale, change):
    make, kind = SURFACES[name]
    body = asm.Body(name, CHANGES[change](make(scale)))
    # A millimeter is the least that OCCT's tolerances of 1e-7 leave eight digits of.
    unit = "m" if scale < 1.0 else "mm"
    made = sewn([body.faces[0].face], 1e3 if unit == "m" else 1.0)
    assert O.BRepCheck_Analyzer(made.shape).IsValid()
    path = tmp_path / "part.step"
    asm.write_step(path, body, unit=unit)
    text = path.read_text()
    assert {each: text.count(each + "(") for each in KINDS if each + "(" in text} == {kind: 1}
    (back,) = asm.read_step(path, unit=unit)
    face, again = body.faces[0].face, back.faces[0].face
    far = 1e3 if change == "far away" else 1.0
    # A solid has its inside within, whatever the normal was.
    sign = np.sign(face.volume_integral() * again.volume_integral()) if name in ("sphere", "torus") else 1.0
    assert again.area() == pytest.approx(face.area(), rel=1e-12 * far)
    right = sign * face.volume_integral()
    assert again.volume_integral() == pytest.approx(right, rel=1e-10 * far, abs=1e-12 * far * scale**3)


@pytest.mark.parametrize("turns", [0.3, 1.0, 1.5, 4.0])
@pytest.mark.parametrize("shift", [0.0, -3.0])
@pytest.mark.parametrize("kind", ["cylinder", "turned wave"])
def test_bands_of_any_number_of_turns_keep_their_area(tmp_path, kind, shift, turns):
    surface = asm.shapes.cylinder(2.5, 8.0)
    if kind == "turned wave":
        net = surface.elevate((2, 3)).control_points.copy()
        # A barrel, which is turned about the axis.
        net[:, 1:3, :2] *= 1.2
        surface = surface.elevate((2, 3))
        surface = asm.NurbsSurface(net, surface.knots, surface.degree, surface.weights)
    surface = asm.NurbsSurface(
        surface.control_points, (surface.knots[0], surface.knots[1] + shift), surface.degree, surface.weights
    )
    (u0, u1), (v0, _) = surface.domain
    turn, bottom = u1 - u0, v0 + 0.2
    ends = [(u0, bottom), (u0 + turns * turn, bottom + turns), (u0 + turns * turn, bottom + turns + 0.25)]
    face = asm.Face(surface, polygon(*ends, (u0, bottom + 0.25)))
    path = tmp_path / "band.step"
    asm.write_step(path, asm.Body("band", face))
    back = asm.read_step(path)
    assert sum(side.face.area() for body in back for side in body.faces) == pytest.approx(face.area(), rel=1e-9)


PLANE = asm.shapes.plane(10.0, 10.0)
TOUCHING = {
    "two holes": (circle((0, 0), 4), [circle((-1, 0), 1), circle((1, 0), 1)], 14.0 * pi),
    "a hole at the edge": (circle((0, 0), 4), [circle((3, 0), 1)], 15.0 * pi),
    "three holes in a row": (None, [circle((2 * k, 0), 1) for k in (-1, 0, 1)], 100.0 - 3.0 * pi),
    "holes that go into each other by 1e-5": (
        circle((0, 0), 4),
        [circle((-1 + 5e-6, 0), 1), circle((1 - 5e-6, 0), 1)],
        14.0 * pi + 4.0 / 3.0 * 5e-6 * np.sqrt(2.0 * 5e-6),
    ),
    "a slot between two sides": (polygon((0, 0), (4, 0), (4, 2), (0, 2)), [circle((2, 1), 1)], 8.0 - pi),
    "an hourglass": (polygon((-1, -1), (0, 0), (1, -1), (1, 1), (0, 0), (-1, 1)), [], 2.0),
}


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", TOUCHING)
def test_loops_that_touch_are_cut_into_parts(tmp_path, name, scale):
    outer, holes, right = TOUCHING[name]

    def scaled(loop):
        rows = [loop] if isinstance(loop, asm.NurbsCurve) else loop
        return [asm.NurbsCurve(scale * c.control_points, c.knots, c.degree, c.weights) for c in rows]

    plane = asm.shapes.plane(10.0 * scale, 10.0 * scale)
    face = asm.Face(plane, None if outer is None else scaled(outer), [scaled(hole) for hole in holes])
    assert face.area() == pytest.approx(right * scale**2, rel=1e-9)
    # A chain passes no place twice, and a face of these loops is the same again.
    for chain in face.chains:
        starts = np.array([face.boundary[k].evaluate(face.boundary[k].domain[0]) for k in chain]) / scale
        assert len(np.unique(starts.round(7), axis=0)) == len(chain)
    assert asm.Face(plane, face.outer, face.holes).area() == pytest.approx(face.area(), rel=1e-12)
    if scale > 1.0 and len(holes) > 1:
        # Not read yet: OCCT's cuts, below, make tangent circles of this size cross beside the vertex.
        return
    path = tmp_path / "touching.step"
    asm.write_step(path, asm.Body("plate", face), unit="m" if scale < 1.0 else "mm")
    back = asm.read_step(path, unit="m" if scale < 1.0 else "mm")
    # OCCT cuts edges that touch 1e-5 mm from their common vertex, when it reads them.
    assert sum(side.face.area() for body in back for side in body.faces) == pytest.approx(face.area(), rel=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_goes_on_where_loops_overshoot_it(name, scale):
    surface = SURFACES[name][0](scale)
    (u0, u1), (v0, v1) = surface.domain
    grow = 1e-5 * np.array([u1 - u0, v1 - v0])
    low = np.where(surface.closed, [u0 + 0.25 * (u1 - u0), v0 + 0.25 * (v1 - v0)], [u0, v0] - grow)
    high = np.where(surface.closed, [u0 + 0.75 * (u1 - u0), v0 + 0.75 * (v1 - v0)], [u1, v1] + grow)
    face = asm.Face(surface, polygon(low, (high[0], low[1]), high, (low[0], high[1])))
    # Where it was it has not changed.
    u, v = (np.linspace(*ends, 7) for ends in surface.domain)
    there = surface.evaluate(u[:, None], v[None])
    np.testing.assert_allclose(face.surface.evaluate(u[:, None], v[None]), there, atol=1e-12 * surface.size)
    inner = np.clip(low, [u0, v0], None), np.clip(high, None, [u1, v1])
    (a, b), (c, d) = inner[0], inner[1]
    held = asm.Face(surface, polygon((a, b), (c, b), (c, d), (a, d)))
    if not surface._pole_bits:
        assert face.area() >= held.area()
    assert face.area() == pytest.approx(held.area(), rel=1e-4)
    if all(surface.closed):
        return
    with pytest.raises(asm.errors.InputError, match="leaves the domain"):
        asm.Face(
            surface, polygon(low - 1e-2 * (high - low), (high[0], low[1]), high, (low[0], high[1])), tolerance=1e-9
        )


def test_missing_references_are_told(tmp_path):
    box = asm.Body("box", asm.shapes.box(1.0, 1.0, 1.0))
    asm.write_step(tmp_path / "main.step", box)
    text = (tmp_path / "main.step").read_text()
    document = "#9001=DOCUMENT_FILE('gone.stp','','',#9002,'',$);\n#9002=DOCUMENT_TYPE('');\n"
    (tmp_path / "main.step").write_text(text.replace("ENDSEC;\nEND-ISO", document + "ENDSEC;\nEND-ISO"))
    with pytest.warns(StepWarning, match=r"not read: 'gone.stp', which it refers to and which is not there"):
        (body,) = asm.read_step(tmp_path / "main.step")
    assert len(body.faces) == 6
    shutil.copy(tmp_path / "main.step", tmp_path / "gone.stp")
    assert len(asm.read_step(tmp_path / "main.step")) == 1


def test_shapes_of_other_files_are_occt_s_where_it_does_not_say_which_they_are(tmp_path):
    def unknown():
        raise TypeError("Unable to convert function return value to a Python type")

    assert _entries_of({"a.stp": tmp_path / "a.stp"}, SimpleNamespace(ExternFiles=unknown)) == {}


@pytest.mark.parametrize(("name", "says"), [("a.json", "Assembly.save"), ("a.HTML", "save_html"), ("a.stl", "STL")])
def test_suffixes_of_other_formats_are_refused(tmp_path, name, says):
    with pytest.raises(StepError, match=says):
        asm.write_step(tmp_path / name, asm.Body("ball", asm.shapes.sphere(1.0)))
    assert not (tmp_path / name).exists()
