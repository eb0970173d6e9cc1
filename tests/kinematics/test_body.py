from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import assembly as asm
from assembly.kinematics.pose import direction

SPHERE = asm.shapes.sphere(2.0)


def test_a_body_without_a_shape():
    body = asm.Body("hand")
    assert body.faces == () and body.size == 0.0 and not body.fixed
    assert body.q.tolist() == [0, 0, 0, 1, 0, 0, 0]
    assert repr(body) == "Body('hand', 0 faces)"


def test_faces_get_names():
    assert [f.name for f in asm.Body("a", SPHERE).faces] == ["surface"]
    named = asm.shapes.sphere(1.0, name="ball")
    assert asm.Body("a", named).face("ball").face.surface is named
    mixed = asm.Body("a", [SPHERE, asm.Face(SPHERE, name="inside", reversed=True), SPHERE])
    assert [f.name for f in mixed.faces] == ["face 1", "inside", "face 3"]
    assert mixed.face("inside").face.reversed and mixed.face("inside").body is mixed
    assert repr(mixed.face("inside")) == "a.face('inside')"


def test_the_only_face_needs_no_name():
    body = asm.Body("a", SPHERE)
    assert body.face() is body.face("surface") is body.faces[0]


def test_faces_of_a_box():
    box = asm.Body("box", asm.shapes.box(2.0, 3.0, 6.0))
    assert [f.name for f in box.faces] == ["left", "right", "front", "back", "bottom", "top"]
    assert box.size == pytest.approx(7.0, rel=1e-15)


def test_size_is_the_diagonal_of_all_faces_together():
    shifted = SPHERE.transformed(translation=(10.0, 0.0, 0.0))
    # From -2 to 12, and -2 to 2 twice.
    assert asm.Body("a", [SPHERE, shifted]).size == pytest.approx(np.sqrt(14.0**2 + 2 * 4.0**2), rel=1e-15)


def test_poses_and_whether_it_is_fixed_may_be_set_and_the_rest_may_not():
    body = asm.Body("a", SPHERE, position=(1, 2, 3), fixed=True)
    body.pose = asm.Pose((4, 5, 6))
    assert body.q.tolist() == [4, 5, 6, 1, 0, 0, 0]
    with pytest.raises(TypeError, match="pose is .*; expected a Pose"):
        body.pose = body.q
    body.fixed = False
    assert body.fixed is False
    with pytest.raises(ValueError, match="fixed is 1; expected True or False"):
        body.fixed = 1
    # An assembly has packed these; changes would go unnoticed.
    for name, value in (("name", "b"), ("faces", ())):
        with pytest.raises(AttributeError):
            setattr(body, name, value)


def test_points_and_frames_cannot_be_changed():
    body = asm.Body("a")
    point, frame = body.point(1, 2, 3), body.frame()
    assert repr(point) == "a.point(1, 2, 3)" and point.coordinates.tolist() == [1, 2, 3]
    for array in (point.coordinates, frame.origin, frame.axes):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 2.0


def test_the_frame_without_arguments_is_the_body():
    frame = asm.Body("a").frame()
    np.testing.assert_array_equal(frame.origin, np.zeros(3))
    np.testing.assert_array_equal(frame.axes, np.eye(3))


coordinate = st.floats(-1.0, 1.0)
axes = st.lists(coordinate, min_size=3, max_size=3).map(np.array).filter(lambda v: np.abs(v).max() > 1e-6)


@given(axes, st.one_of(st.none(), axes))
def test_frames_are_right_handed_and_keep_their_axes(z, x):
    if x is not None and np.linalg.norm(np.cross(direction("z", z), direction("x", x))) < 1e-6:
        return
    frame = asm.Body("a").frame(at=(1, 2, 3), z=z, x=x)
    np.testing.assert_array_equal(frame.origin, [1, 2, 3])
    np.testing.assert_allclose(frame.axes.T @ frame.axes, np.eye(3), rtol=0, atol=2e-15)
    assert np.linalg.det(frame.axes) == pytest.approx(1.0, abs=2e-15)
    np.testing.assert_allclose(frame.axes[:, 2], direction("z", z), rtol=0, atol=2e-16)
    if x is not None:
        # x leans to the given x and y is across it.
        assert frame.axes[:, 0] @ x > 0.0
        assert abs(frame.axes[:, 1] @ direction("x", x)) < 1e-9


@pytest.mark.parametrize("lean", [2e-9, 1e-7, 1e-4, 1.0])
def test_frames_are_orthonormal_even_where_x_is_almost_along_z(lean):
    z = np.array([1.0, 2.0, 2.0]) / 3.0
    x = z + lean * np.array([2.0, 1.0, -2.0]) / 3.0
    frame = asm.Body("a").frame(z=z, x=x)
    np.testing.assert_allclose(frame.axes.T @ frame.axes, np.eye(3), rtol=0, atol=1e-15)


def test_frames_of_axes_with_extreme_lengths():
    for factor in (1e-200, 1e200):
        frame = asm.Body("a").frame(z=(0, 0, factor), x=(factor, 0, factor))
        np.testing.assert_allclose(frame.axes, np.eye(3), rtol=0, atol=1e-15)
