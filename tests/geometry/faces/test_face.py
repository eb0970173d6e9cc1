from __future__ import annotations

import pickle

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face, whole_face
from assembly.geometry.splines import evaluate as spline


def test_a_face_turns_the_normal_when_reversed():
    ball = shapes.sphere(1.0, name="ball")
    out, inward = Face(ball), Face(ball, name="socket", reversed=True)
    assert (out.name, inward.name) == ("ball", "socket")
    assert "reversed" in repr(inward) and "reversed" not in repr(out)
    u, v = np.array([0.3, 2.0]), np.array([1.0, 2.0])
    np.testing.assert_array_equal(inward.normal(u, v), -out.normal(u, v))
    np.testing.assert_allclose(out.normal(u, v), ball.evaluate(u, v), rtol=0, atol=1e-14)


def test_a_reversed_face_differs_from_its_surface_in_the_sign_alone():
    ball = shapes.sphere(1.0)
    record, pool = Face(ball, reversed=True).packed()
    plain, plain_pool = Face(ball).packed()
    assert pool is plain_pool
    assert plain[spline.SIGN] == 1 and record[spline.SIGN] == -1
    assert np.flatnonzero(record != plain).tolist() == [spline.SIGN]


def test_all_of_a_surface_is_one_face_however_many_others_are_asked_for():
    surfaces = [shapes.plane(1.0, 1.0) for _ in range(600)]
    faces = [whole_face(surface) for surface in surfaces]
    assert all(whole_face(surface) is face for surface, face in zip(surfaces, faces, strict=True))
    assert all(face.surface is surface for surface, face in zip(surfaces, faces, strict=True))


def test_a_copy_of_a_surface_has_a_face_of_its_own():
    surface = shapes.plane(1.0, 1.0)
    face = whole_face(surface)
    twin = pickle.loads(pickle.dumps(surface))
    assert whole_face(twin) is not face and whole_face(twin).surface is twin


@pytest.mark.parametrize(
    ("arguments", "text"),
    [(("ball", None, False), "surface is 'ball'"), ((None, 3, False), "name is 3"), ((None, None, 2), "reversed is 2")],
)
def test_bad_arguments_are_named(arguments, text):
    surface, name, reversed_ = arguments
    with pytest.raises(TypeError, match=text):
        Face(shapes.sphere(1.0) if surface is None else surface, name=name, reversed=reversed_)


def test_a_surface_in_a_unit_is_kept_and_is_no_part_of_copies():
    surface = shapes.sphere(2.0)
    size = len(pickle.dumps(surface))
    half = surface.scaled(0.5)
    assert surface.scaled(0.5) is half and surface.scaled(0.25) is not half
    assert np.array_equal(half.control_points, surface.transformed(scale=0.5).control_points)
    assert all(
        np.array_equal(*both) for both in zip(half.packed(), surface.transformed(scale=0.5).packed(), strict=True)
    )
    assert len(pickle.dumps(surface)) == size
