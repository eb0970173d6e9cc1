"""Shapes of OCCT as bodies, with whichever of its versions is installed."""

from __future__ import annotations

import copy
import math

import numpy as np
import pytest

import assembly as asm

pytest.importorskip("OCP", reason='needs OCCT: pip install "assembly-solver[step]", or CadQuery, or build123d')

from assembly.cad.locations import frame_on, location_of, pose_of  # noqa: E402  # they ask for OCCT
from assembly.step.occt import occt, parts  # noqa: E402
from assembly.step.solids import sewn  # noqa: E402

TURNED = asm.Pose.from_axis_angle((1, 2, 3), 1.1, (4, -5, 6))


def cube(x=1.0):
    return sewn(asm.shapes.box(x, 1.0, 1.0), 1.0).shape


def several(*shapes):
    o = occt()
    build, compound = o.BRep_Builder(), o.TopoDS_Compound()
    build.MakeCompound(compound)
    for shape in shapes:
        build.Add(compound, shape)
    return compound


def test_locations_are_poses_there_and_back():
    for pose in (asm.Pose(), TURNED, asm.Pose.from_axis_angle((0, 1, 1), math.pi, (1, 0, 0))):
        again = pose_of(location_of(pose), "it")
        points = np.random.default_rng(0).normal(size=(5, 3))
        assert again.apply(points) == pytest.approx(pose.apply(points), abs=1e-14)


def test_frames_are_those_of_the_body():
    body, random = asm.Body("a"), np.random.default_rng(1)
    for z in [*np.eye(3), *-np.eye(3), *random.normal(size=(20, 3))]:
        z = z / np.linalg.norm(z)
        mine, its = frame_on(body, (1, 2, 3), tuple(z.tolist())), body.frame((1, 2, 3), z)
        assert mine.axes == pytest.approx(its.axes, abs=1e-15) and (mine.origin == its.origin).all()
        assert mine.axes.T @ mine.axes == pytest.approx(np.eye(3), abs=1e-15)


def test_solids_are_bodies_where_they_stand_and_one_solid_is_read_once():
    one = cube()
    compound = several(one, one.Located(location_of(TURNED)), cube(2.0))
    bodies = asm.cad.from_occt(compound, "cube", fixed=["cube"])
    assert [body.name for body in bodies] == ["cube", "cube 2", "cube 3"]
    assert [body.fixed for body in bodies] == [True, False, False]
    assert bodies[0].faces[0].face is bodies[1].faces[0].face and len(bodies[1].faces) == 6
    assert bodies[1].pose.position == pytest.approx(TURNED.position, abs=1e-15)
    assert sum(face.face.volume_integral() for face in bodies[1].faces) == pytest.approx(1.0, rel=1e-12)


def test_a_face_alone_is_a_body():
    face = parts(cube(), occt().TopAbs_FACE)[0]
    (body,) = asm.cad.from_occt(face)
    assert [face.name for face in body.faces] == ["face 1"]


def test_what_is_no_shape_raises():
    with pytest.raises(TypeError, match="shape is 3; expected a TopoDS_Shape"):
        asm.cad.from_occt(3)
    for nothing in (occt().TopoDS_Solid(), several()):
        with pytest.raises(asm.errors.InputError, match="no faces"):
            asm.cad.from_occt(nothing)


def test_copies_of_solids_have_their_own_faces():
    (body,) = asm.cad.from_occt(cube())
    other = copy.copy(body)
    assert other.faces[0].face is body.faces[0].face and other.faces[0].body is other
