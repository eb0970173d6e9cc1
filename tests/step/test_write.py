"""What is written is read again: bodies, poses, shapes, names, colors."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.splines.bezier import full_knots
from assembly.step import StepError, StepWarning
from assembly.step.documents import UNITS
from assembly.step.edges import Edges
from assembly.step.faces import read_face
from assembly.step.occt import parts
from assembly.step.solids import sewn
from tests.step.models import MODELS, O, areas, box, edges, faces, filleted, off, volumes
from tests.step.test_poles import read_by_occt

HALF = np.sqrt(0.5)


def ring(center, radius, clockwise=False):
    """A circle in (u, v)."""
    points = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    points = radius * (points[::-1] if clockwise else points) + center
    return asm.NurbsCurve(points, full_knots(np.linspace(0.0, 1.0, 5), 2), 2, [1, HALF] * 4 + [1])


def measures(body):
    return sum(side.face.area() for side in body.faces), sum(side.face.volume_integral() for side in body.faces)


def again(path, what, **options):
    asm.write_step(path, what, **options)
    return asm.read_step(path, **options)


SHAPES = {
    "box": lambda: asm.shapes.box(1.0, 2.0, 3.0),
    "sphere": lambda: asm.shapes.sphere(2.0),
    "ellipsoid": lambda: asm.shapes.ellipsoid(1.0, 2.0, 3.0),
    "torus": lambda: asm.shapes.torus(4.0, 1.0),
    "paper clip": lambda: asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5),
    # Their flat walls are discs and rings about their centers, with a seam, and a pole, in (u, v).
    "turned bolt": lambda: turned((0, -12), (1.9, -12), (1.9, 0), (5, 0), (5, 4), (0, 4)),
    "turned ring": lambda: turned((1, 0), (3, 0), (2, 4)),
    "turned tube": lambda: turned((1, 0), (3, 0), (3, 4), (1, 4)),
    "turned in part": lambda: turned((0, 0), (3, 0), (3, 4), (0, 4), angle=2.0),
}


def turned(*corners, angle=2.0 * pi):
    return asm.shapes.revolution(asm.curves.polygon(corners), angle)


@pytest.mark.parametrize("name", SHAPES)
def test_closed_shapes_are_solids(tmp_path, name):
    body = asm.Body(name, SHAPES[name](), position=(1.0, 2.0, 3.0))
    made = sewn([side.face for side in body.faces], 1.0)
    assert made.closed and made.shape.ShapeType() == O.TopAbs_SOLID and O.BRepCheck_Analyzer(made.shape).IsValid()
    (back,) = again(tmp_path / "part.step", body)
    assert back.name == name and len(back.faces) == len(body.faces)
    # The surfaces are the same; full circles come back as they were written.
    assert measures(back) == pytest.approx(measures(body), rel=1e-12)


# Corners in (u, v), whether they are those of a hole, and how many edges there are: the seam cuts two of a hole's.
TRIMS = {
    "beside the seam": ([(2, 1), (5, 1), (5, 2), (2, 2)], False, 4),
    "across the seam": ([(-2, 1), (3, 1), (3, 2), (-2, 2)], False, 4),
    "a hole": ([(2, 1), (2, 2), (5, 2), (5, 1)], True, 5),
    "a hole across the seam": ([(-2, 1), (-2, 2), (3, 2), (3, 1)], True, 7),
}


@pytest.mark.parametrize("name", TRIMS)
def test_trims_of_a_disc_about_its_center(tmp_path, name):
    corners, is_hole, count = TRIMS[name]
    disc = turned((0, 0), (3, 0), (3, 4), (0, 4))[0].surface
    sides = zip(corners, [*corners[1:], corners[0]], strict=True)
    loop = [asm.NurbsCurve(np.array(side, dtype=float), [0, 0, 1, 1], 1) for side in sides]
    face = asm.Face(disc, None, [loop]) if is_hole else asm.Face(disc, loop)
    made = sewn([face], 1.0)
    assert O.BRepCheck_Analyzer(made.shape).IsValid() and len(parts(made.shape, O.TopAbs_EDGE)) == count
    (back,) = again(tmp_path / "part.step", asm.Body("part", face))
    # Circles of a disc are followed to 1e-10 of its size.
    assert back.area == pytest.approx(face.area(), rel=1e-10) and back.faces[0].kind == "plane"


@pytest.mark.parametrize("name", MODELS)
def test_sewn_faces_are_the_solid_they_came_from(name):
    shape = MODELS[name]()
    numbers = Edges(shape)
    direct = [read_face(face, numbers, None).face for face in faces(shape)]
    made = sewn(direct, 1.0)
    assert made.closed and O.BRepCheck_Analyzer(made.shape).IsValid()
    assert len(parts(made.shape, O.TopAbs_FACE)) == len(direct)
    numbers = Edges(made.shape)
    back = [read_face(face, numbers, None).face for face in faces(made.shape)]
    assert off(sum(face.area() for face in back), [sum(face.area() for face in direct)]) < 1e-9
    assert off(sum(face.volume_integral() for face in back), [sum(face.volume_integral() for face in direct)]) < 1e-8
    if not any(isinstance(O.BRep_Tool.Surface_s(face), O.Geom_SurfaceOfLinearExtrusion) for face in faces(made.shape)):
        # OCCT measures what we made of its shape, by a rule that stops at 1e-9; not so of splines that are extruded,
        # of which it takes a few points however many spans they have: an ellipse's is 5 percent off.
        assert off(areas(made.shape)[1], [sum(face.area() for face in direct)]) < 1e-7
        assert off(volumes(made.shape)[1], [sum(face.volume_integral() for face in direct)]) < 1e-6


@pytest.mark.parametrize("name", ["boss", "drilled torus", "drilled cone", "wedge of a sphere", "crossed cylinders"])
def test_a_round_trip_keeps_shapes(tmp_path, name):
    shape = MODELS[name]()
    numbers = Edges(shape)
    body = asm.Body(name, [read_face(face, numbers, f"side {k}").face for k, face in enumerate(faces(shape))])
    (back,) = again(tmp_path / "part.step", body)
    assert {side.name for side in back.faces} == {side.name for side in body.faces}
    for side in body.faces:
        # Surfaces are written exactly; edges between them within 1e-10 of their size, and OCCT's 1e-7 of vertices.
        assert back.face(side.name).face.area() == pytest.approx(side.face.area(), rel=1e-7)
    assert measures(back)[1] == pytest.approx(measures(body)[1], rel=1e-7)


def test_windows_across_seams_are_cut_open(tmp_path):
    tube = asm.shapes.cylinder(1.0, 4.0)
    for center in ((0.0, 2.0), (2.0 * pi, 2.0), (3.0, 2.0)):
        face = asm.Face(tube, holes=[ring(center, 0.5, clockwise=True)])
        (back,) = again(tmp_path / "tube.step", asm.Body("tube", face))
        assert back.faces[0].face.area() == pytest.approx(face.area(), rel=1e-8)
    wheel = asm.shapes.torus(4.0, 1.0)
    for center in ((0.0, 0.0), (8.0 * pi, 3.0), (10.0, 2.0 * pi), (10.0, 3.0)):
        face = asm.Face(wheel, holes=[ring(center, 0.5, clockwise=True)])
        (back,) = again(tmp_path / "wheel.step", asm.Body("wheel", face))
        assert back.faces[0].face.area() == pytest.approx(face.area(), rel=1e-8)
        assert face.area() < 16.0 * pi**2 - 0.5


def test_a_patch_on_a_closed_surface(tmp_path):
    for center in ((0.0, 0.0), (3.0, 2.0)):
        face = asm.Face(asm.shapes.torus(4.0, 1.0), outer=ring(center, 0.5), reversed=True)
        (back,) = again(tmp_path / "patch.step", asm.Body("patch", face))
        assert back.faces[0].face.area() == pytest.approx(face.area(), rel=1e-8)
        assert back.faces[0].face.volume_integral() == pytest.approx(face.volume_integral(), rel=1e-8)


def test_a_thread_that_winds_several_times_is_one_face(tmp_path):
    # Two and a half turns, a strip 0.4 high with a pitch of 1, and a hole in its second turn.
    tube, turns, pitch, height = asm.shapes.cylinder(1.0, 4.0), 2.5, 1.0, 0.4
    end = 2.0 * pi * turns
    corners = [(0.0, 0.1), (end, 0.1 + turns * pitch), (end, 0.1 + height + turns * pitch), (0.0, 0.1 + height)]
    sides = [asm.NurbsCurve([a, b], [0, 0, 1, 1], 1) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    u = 2.0 * pi * 1.3
    face = asm.Face(tube, sides, [ring((u, 0.1 + 1.3 * pitch + 0.2), 0.1, clockwise=True)])
    made = sewn([face], 1.0)
    assert O.BRepCheck_Analyzer(made.shape).IsValid()
    (back,) = again(tmp_path / "thread.step", asm.Body("thread", face))
    assert back.faces[0].face.area() == pytest.approx(face.area(), rel=1e-8)
    # The parameter is the angle at quarters of the turn, and within a few percent of it everywhere.
    assert face.area() == pytest.approx(end * height - 0.01 * pi, rel=1e-2)


def test_unclamped_surfaces_are_written(tmp_path):
    random = np.random.default_rng(3)
    grid = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    net = np.stack([*grid, random.normal(size=(6, 5))], axis=-1)
    surface = asm.NurbsSurface(net, (np.arange(10.0), np.arange(8.0)), (3, 2), random.uniform(0.5, 2.0, (6, 5)))
    body = asm.Body("hills", surface)
    (back,) = again(tmp_path / "hills.step", body)
    assert measures(back)[0] == pytest.approx(measures(body)[0], rel=1e-11)


def test_a_solved_assembly_is_written_where_it_stands(tmp_path):
    wire = asm.shapes.torus(1.0, 0.12)
    first = asm.Body("first", wire, fixed=True)
    second = asm.Body("second", wire, position=(0.9, 0.1, 0.0), quaternion=(0.7, 0.7, 0.1, 0.0))
    scene = asm.Assembly([first, second])
    scene.constrain(asm.Contact(first, second))
    scene.minimize(asm.PointDistance(second.point(1.0, 0.0, 0.0), target=(1.5, 0.7, 0.2)))
    solution = scene.solve()
    assert solution.success
    assert np.abs(solution.q - scene.q).max() > 1e-3
    for what, q in ((solution, solution.q), (scene, scene.q), (scene.bodies, scene.q)):
        back = again(tmp_path / "wires.step", what)
        assert [body.name for body in back] == ["first", "second"]
        for body, row in zip(back, q, strict=True):
            wanted = asm.Pose(row[:3], row[3:])
            np.testing.assert_allclose(body.pose.matrix, wanted.matrix, rtol=0, atol=1e-11)
    # Two bodies of one surface, but of faces of their own.
    assert back[0].faces[0].face is not back[1].faces[0].face


def test_bodies_that_share_faces_are_instances_of_one_part(tmp_path):
    sides = asm.shapes.box(1.0, 2.0, 3.0)
    names = ["nut", "nut 2", "nut 3", "spacer", "spacer 3"]
    bodies = [asm.Body(name, sides, position=(float(k), 0.0, 0.0)) for k, name in enumerate(names)]
    bodies[0].color = (0.1, 0.2, 0.3)
    bodies[1].color = (0.4, 0.5, 0.6)
    bodies[4].color = (0.7, 0.8, 0.9)
    back = again(tmp_path / "nuts.step", bodies)
    assert [body.name for body in back] == names
    assert [body.color for body in back] == [(0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.1, 0.2, 0.3), None, (0.7, 0.8, 0.9)]
    assert len({id(side.face) for body in back[:3] for side in body.faces}) == 6
    assert (tmp_path / "nuts.step").read_text().count("MANIFOLD_SOLID_BREP(") == 3


def test_face_names_and_colors_are_kept(tmp_path):
    body = asm.Body("box", asm.shapes.box(1.0, 2.0, 3.0))
    body.faces[2].face.color = (0.2, 0.4, 0.6)
    (back,) = again(tmp_path / "box.step", body)
    assert {side.name: side.face.color for side in back.faces} == {side.name: side.face.color for side in body.faces}
    for side in body.faces:
        mine, other = side.face.surface, back.face(side.name).face.surface
        np.testing.assert_allclose(
            back.face(side.name).face.normal(*np.mean(other.domain, axis=1)),
            side.face.normal(*np.mean(mine.domain, axis=1)),
            rtol=0,
            atol=1e-14,
        )


@pytest.mark.parametrize("own", [None, (0.4, 0.5, 0.6)])
@pytest.mark.parametrize("color", [None, (0.1, 0.2, 0.3)])
@pytest.mark.parametrize("name", ["plane", "sphere"])
def test_a_body_and_its_only_face_have_colors_of_their_own(tmp_path, name, color, own):
    surface = asm.shapes.plane(2.0, 3.0) if name == "plane" else asm.shapes.sphere(1.0)
    # What closes is turned with the material inside, and other faces stay as they are.
    face = asm.Face(surface, name="side", color=own, reversed=name == "plane")
    body = asm.Body("part", face, color=color)
    (back,) = again(tmp_path / "part.step", body)
    assert (back.name, back.color) == ("part", color)
    assert [(side.name, side.face.color) for side in back.faces] == [("side", own)]
    assert back.faces[0].face.reversed == face.reversed


def test_pieces_of_a_body_have_its_color(tmp_path):
    low = asm.shapes.plane(2.0, 3.0)
    high = low.transformed(translation=(0.0, 0.0, 5.0))
    body = asm.Body("pair", [asm.Face(low), asm.Face(high, color=(0.4, 0.5, 0.6))], color=(0.1, 0.2, 0.3))
    back = again(tmp_path / "pair.step", body)
    assert [(piece.name, piece.color) for piece in back] == [("pair", body.color), ("pair 2", body.color)]
    assert [piece.faces[0].face.color for piece in back] == [None, (0.4, 0.5, 0.6)]


def test_a_ball_with_a_void_is_a_solid(tmp_path):
    sides = [asm.Face(asm.shapes.sphere(2.0)), asm.Face(asm.shapes.sphere(1.0), reversed=True)]
    for order in (sides, sides[::-1]):
        made = sewn(order, 1.0)
        assert made.closed and O.BRepCheck_Analyzer(made.shape).IsValid()
        (back,) = again(tmp_path / "ball.step", asm.Body("ball", order))
        assert measures(back) == pytest.approx((20.0 * pi, 28.0 * pi / 3.0), rel=1e-12)


def test_units(tmp_path):
    body = asm.Body("ball", asm.shapes.sphere(0.002), position=(0.1, 0.0, 0.0))
    asm.write_step(tmp_path / "ball.step", body, unit="m")
    (back,) = asm.read_step(tmp_path / "ball.step")
    np.testing.assert_allclose(back.pose.position, (100.0, 0.0, 0.0), rtol=1e-13)
    assert measures(back)[0] == pytest.approx(16.0 * pi, rel=1e-12)
    (metric,) = asm.read_step(tmp_path / "ball.step", unit="m")
    assert measures(metric)[0] == pytest.approx(16e-6 * pi, rel=1e-12)


SOLIDS = {
    # Faces, and how many of them are rectangles.
    "plate with a hole": (lambda: asm.shapes.plate(4.0, 4.0, 1.0, holes=[(0.0, 0.0, 1.0)]), 6),
    "cylinder": (lambda: asm.shapes.solid_cylinder(1.0, 3.0), 2),
    "cam": (lambda: asm.shapes.cam(2.0 + 0.5 * np.cos(np.arange(24.0) * pi / 12.0), 1.0, 0.5), 2),
}
POSE = asm.Pose.from_axis_angle((1.0, 2.0, -1.0), 1.1, (1.0 / 3.0, 2.0, -1.0))


def reshaped(face, change):
    """The face with another surface of the same parameters."""
    return asm.Face(change(face.surface), face.outer, face.holes, name=face.name, reversed=face.reversed)


def check_again(path, body, planes, unit):
    """A body comes back with its pose, areas, volumes and names, and its rectangles were written as planes."""
    (back,) = again(path, body, unit=unit)
    assert path.read_text().count("= PLANE(") == planes
    assert {side.name for side in back.faces} == {side.name for side in body.faces}
    # Files have twelve digits of a coordinate or more, which round by 5e-13.
    np.testing.assert_allclose(back.pose.matrix, body.pose.matrix, rtol=0, atol=1e-12)
    assert measures(back) == pytest.approx(measures(body), rel=1e-12)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("name", SOLIDS)
def test_solids_in_every_unit(tmp_path, name, unit):
    make, planes = SOLIDS[name]
    check_again(tmp_path / "part.step", asm.Body(name, make(), POSE.position, POSE.quaternion), planes, unit)


@pytest.mark.parametrize("factor", [0.5, 2.0, 25.4])
@pytest.mark.parametrize("name", SOLIDS)
def test_parameters_need_not_be_lengths(tmp_path, name, factor):
    make, planes = SOLIDS[name]
    sides = [reshaped(face, lambda surface: surface.transformed(scale=factor)) for face in make()]
    for unit in ("mm", "in"):
        check_again(tmp_path / "part.step", asm.Body(name, sides, POSE.position, POSE.quaternion), planes, unit)


@pytest.mark.parametrize("name", SOLIDS)
def test_flat_faces_may_be_splines(tmp_path, name):
    make, planes = SOLIDS[name]
    sides = [reshaped(face, lambda surface: surface.elevate((3, 3))) for face in make()]
    for unit in ("mm", "in"):
        check_again(tmp_path / "part.step", asm.Body(name, sides, POSE.position, POSE.quaternion), planes, unit)


def test_open_shapes_are_shells(tmp_path):
    open_box = asm.shapes.box(1.0, 2.0, 3.0)[:5]
    made = sewn(open_box, 1.0)
    assert not made.closed and len(parts(made.shape, O.TopAbs_SHELL)) == 1
    (back,) = again(tmp_path / "open.step", asm.Body("open", open_box))
    assert len(back.faces) == 5


def test_nothing_is_printed(tmp_path, capfd):
    asm.write_step(tmp_path / "ball.step", asm.Body("ball", asm.shapes.sphere(1.0)))
    assert capfd.readouterr().out == ""


def test_bad_arguments_are_named(tmp_path):
    ball, frame = asm.Body("ball", asm.shapes.sphere(1.0)), asm.Body("frame")
    with pytest.raises(ValueError, match="unit is 'inch'"):
        asm.write_step(tmp_path / "a.step", ball, unit="inch")
    with pytest.raises(TypeError, match="what is 3; expected an Assembly, a Solution, a Body or several"):
        asm.write_step(tmp_path / "a.step", 3)
    with pytest.raises(TypeError, match="what holds 'ball'"):
        asm.write_step(tmp_path / "a.step", ["ball"])
    with pytest.raises(ValueError, match="what has no bodies"):
        asm.write_step(tmp_path / "a.step", asm.Assembly())
    with pytest.raises(StepError, match="no body with faces"):
        asm.write_step(tmp_path / "a.step", frame)
    with pytest.warns(StepWarning, match="a.step: bodies without faces are left out: 'frame'"):
        asm.write_step(tmp_path / "a.step", [frame, ball])
    assert [body.name for body in asm.read_step(tmp_path / "a.step")] == ["ball"]
    with pytest.raises(StepError, match="cannot write there"):
        asm.write_step(tmp_path / "none" / "a.step", ball)


def test_straight_edges_far_from_the_origin_stay_lines(tmp_path):
    """Points of a plane at 2e4 are rounded by more than lines at the origin are; a circle of radius 4e14 fits too."""
    start, u, v = np.array([[-9164.775095, 19918.19766, 22092.173425], [4.1, 12.51, -272.9], [4.49, -45.89, -2.037]])
    # Rounded as points of files are, so that it is a plane but no parallelogram to the last digit.
    corners = np.round([[start, start + v], [start + u, start + u + v + [8e-10, 0, -8e-10]]], 11)
    plane = asm.NurbsSurface(corners, [[0, 0, 1, 1], [0, 0, 1, 1]], (1, 1))
    ends = np.array([(0.1, 0.2), (0.9, 0.15), (0.43, 0.97), (0.1, 0.2)])
    lines = [asm.NurbsCurve(ends[k : k + 2], [0, 0, 1, 1], 1) for k in range(3)]
    sheet = asm.Body("sheet", asm.Face(plane, lines))
    path = tmp_path / "sheet.step"
    asm.write_step(path, sheet)
    assert "CIRCLE" not in path.read_text() and path.read_text().count("= LINE(") >= 3
    (again,) = asm.read_step(path)
    assert again.area == pytest.approx(sheet.area, rel=1e-11)


def test_rounded_corners_far_from_the_origin_are_written(tmp_path):
    """At 2e6 coordinates are rounded by more than curves on a small sphere are followed."""
    block = box(3.0, 4.0, 5.0, (1e6, -2e6, 3e5))
    rounded = filleted(block, 0.4, edges(block)[::2])
    (body,) = asm.cad.from_occt(rounded)
    path = tmp_path / "rounded.step"
    asm.write_step(path, body)
    (again,), shape = asm.read_step(path), read_by_occt(path)
    assert again.volume == pytest.approx(body.volume, rel=1e-8) and O.BRepCheck_Analyzer(shape).IsValid()
