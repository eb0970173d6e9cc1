"""Volumes, centers and inertias against closed forms; what encloses nothing; gaps that are told."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.errors import InputError

PI = np.pi
# Sums over some ten faces of what is exact to rounding.
RIGHT = 1e-12


def diagonal(body):
    """The moments of inertia of a body whose products of inertia are rounding."""
    inertia = body.inertia
    assert np.abs(inertia - np.diag(np.diag(inertia))).max() < RIGHT * np.abs(inertia).max()
    return np.diag(inertia)


def test_shapes_with_closed_forms():
    a, b, c = 2.0, 3.0, 5.0
    r, h, ring = 1.5, 4.0, 3.0
    ball, tube = 4.0 / 3.0 * PI * r**3, 2.0 * PI**2 * ring * r**2
    around, across = ring**2 + 0.75 * r**2, 0.5 * ring**2 + 0.625 * r**2
    rod = PI * r**2 * h
    for shape, volume, moments in (
        (asm.shapes.box(a, b, c), a * b * c, np.array([b * b + c * c, a * a + c * c, a * a + b * b]) / 12.0),
        (asm.shapes.sphere(r), ball, np.full(3, 0.4 * r**2)),
        (asm.shapes.torus(ring, r), tube, np.array([across, across, around])),
        (asm.shapes.solid_cylinder(r, h), rod, np.array([r**2 / 4 + h**2 / 12, r**2 / 4 + h**2 / 12, r**2 / 2])),
    ):
        body = asm.Body("body", shape, density=0.7)
        assert body.volume == pytest.approx(volume, rel=RIGHT)
        assert body.mass == pytest.approx(0.7 * volume, rel=RIGHT)
        np.testing.assert_allclose(body.center_of_mass, 0.0, atol=RIGHT)
        np.testing.assert_allclose(diagonal(body), 0.7 * volume * moments, rtol=RIGHT)
        assert body.mass_properties.volume_error < 1e-12 * volume


def test_moved_and_turned_shapes():
    """A shape that is moved far and turned: the center goes with it, and inertia by its rotation."""
    rng = np.random.default_rng(3)
    for k in range(5):
        shape = asm.shapes.plate(4.0, 3.0, 1.0, [(1.0, 0.5, 0.4)])
        turn = Rotation.random(random_state=rng).as_matrix() if k else np.eye(3)
        shift = 100.0 * rng.normal(size=3)
        moved = [
            asm.Face(face.surface.transformed(turn, shift), face.outer, face.holes, reversed=face.reversed)
            for face in shape
        ]
        one, other = asm.Body("one", shape), asm.Body("other", moved)
        assert other.volume == pytest.approx(one.volume, rel=RIGHT)
        np.testing.assert_allclose(other.center_of_mass, turn @ one.center_of_mass + shift, rtol=0, atol=1e-11)
        np.testing.assert_allclose(other.inertia, turn @ one.inertia @ turn.T, rtol=0, atol=1e-10)


def test_a_plate_with_a_hole():
    x, y, r, t = 1.0, 0.5, 0.4, 1.0
    body = asm.Body("plate", asm.shapes.plate(4.0, 3.0, t, [(x, y, r)]))
    hole = PI * r * r * t
    volume = 12.0 * t - hole
    assert body.volume == pytest.approx(volume, rel=RIGHT)
    assert body.area == pytest.approx(2.0 * (12.0 - PI * r * r) + 14.0 * t + 2.0 * PI * r * t, rel=RIGHT)
    center = -hole * np.array([x, y, 0.0]) / volume
    np.testing.assert_allclose(body.center_of_mass, center, atol=RIGHT)
    second = 12.0 * t * 9.0 / 12.0 - hole * (r * r / 4.0 + y * y) - volume * center[1] ** 2
    third = 12.0 * t**3 / 12.0 - hole * t * t / 12.0
    assert body.inertia[0, 0] == pytest.approx(second + third, rel=RIGHT)


@pytest.mark.parametrize("size", [1e-3, 1e3])
def test_scales(size):
    body = asm.Body("body", asm.shapes.box(size, 2.0 * size, 3.0 * size), density=size)
    assert body.volume == pytest.approx(6.0 * size**3, rel=RIGHT)
    assert body.inertia[2, 2] == pytest.approx(6.0 * size**4 * 5.0 * size**2 / 12.0, rel=RIGHT)


def test_gaps_between_faces_are_told():
    """A cap that is too small by 1e-7: the volume is wrong by less than what is told, which is not much more."""
    faces = list(asm.shapes.box(1.0, 1.0, 1.0))
    lifted = 1e-7
    top = max(range(len(faces)), key=lambda k: faces[k].surface.bounding_box()[0][2])
    faces[top] = asm.Face(faces[top].surface.transformed(translation=(0, 0, lifted)), name=faces[top].name)
    found = asm.Body("body", faces).mass_properties
    wrong = abs(found.volume - 1.0)
    assert 0.1 * lifted < wrong < found.volume_error < 10.0 * lifted


def test_gaps_of_files_are_closed_and_told():
    """A cap that is off by more than what makes edges one elsewhere: still a volume, with how wrong it may be."""
    faces = list(asm.shapes.box(1.0, 1.0, 1.0))
    top = max(range(len(faces)), key=lambda k: faces[k].surface.bounding_box()[0][2])
    for lifted in (1e-5, 5e-5):
        faces[top] = asm.Face(asm.shapes.box(1.0, 1.0, 1.0)[top].surface.transformed(translation=(0, 0, lifted)))
        found = asm.Body("body", faces).mass_properties
        assert 0.1 * lifted < abs(found.volume - 1.0) < found.volume_error < 10.0 * lifted
    faces[top] = asm.Face(asm.shapes.box(1.0, 1.0, 1.0)[top].surface.transformed(translation=(0, 0, 1e-2)))
    with pytest.raises(InputError, match="is open"):
        _ = asm.Body("body", faces).volume


def test_places_along_an_edge_may_be_beyond_the_other_curve_s_ends():
    """Halves of a ring against a whole one: speeds differ along it, and a first guess leaves the other curve."""
    low, high = asm.shapes.solid_cylinder(1.0, 2.0), asm.shapes.solid_cylinder(1.0, 2.0)
    wall = next(face for face in low if face.surface.closed[0])
    (u0, u1), (v0, v1) = wall.surface.domain
    others = [face for face in high if not face.surface.closed[0]]
    halves = []
    for k in (0, 1):
        a, b = u0 + 0.5 * k * (u1 - u0), u0 + 0.5 * (k + 1) * (u1 - u0)
        # A curve whose speed is halved from one end to the other.
        corners = [(a, v0), (b, v0), (b, v1), (a, v1)]
        loop = [
            asm.NurbsCurve([p, q], [0, 0, 1, 1], 1, [1.0, 2.0])
            for p, q in zip(corners, corners[1:] + corners[:1], strict=True)
        ]
        halves.append(asm.Face(wall.surface, loop, name=f"wall {k}", reversed=wall.reversed))
    found = asm.Body("body", [*others, *halves]).mass_properties
    assert found.volume == pytest.approx(2.0 * PI, rel=RIGHT)
    assert found.volume_error < 1e-9


def test_what_encloses_nothing_raises():
    with pytest.raises(InputError, match="'bare' has no shape; expected faces that enclose a volume"):
        _ = asm.Body("bare").volume
    with pytest.raises(InputError, match="'tube' is open: an edge of .* has no other face; expected a closed body"):
        _ = asm.Body("tube", asm.shapes.cylinder(1.0, 2.0)).inertia
    # Its flux along the axis is zero, and yet it is open.
    assert asm.Body("tube", asm.shapes.cylinder(1.0, 2.0)).area == pytest.approx(4.0 * PI, rel=RIGHT)
    inward = asm.Face(asm.shapes.sphere(1.0), reversed=True)
    with pytest.raises(InputError, match="'hollow' has a piece with a volume of -4.18879, .*; expected a positive one"):
        _ = asm.Body("hollow", inward).mass
    for density in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(InputError, match="density is"):
            asm.Body("ball", asm.shapes.sphere(1.0), density=density)


def test_results_are_for_reading():
    body = asm.Body("ball", asm.shapes.sphere(1.0))
    with pytest.raises(ValueError, match="read-only"):
        body.inertia[0, 0] = 1.0
    with pytest.raises(AttributeError):
        body.volume = 2.0  # type: ignore[misc]  # it is read-only, as mypy says too


def moved(faces, shift, reverse=False):
    return [
        asm.Face(face.surface.transformed(translation=shift), face.outer, face.holes, name=f"{face.name} {shift}",
                 reversed=face.reversed != reverse)
        for face in faces
    ]  # fmt: skip


def ball(radius, shift=(0.0, 0.0, 0.0), reverse=False):
    return moved([asm.Face(asm.shapes.sphere(radius))], shift, reverse)


@pytest.mark.parametrize("order", [1, -1])
def test_pieces_apart_and_voids(order):
    """Two balls, one with a void that has a ball in it."""
    faces = [*ball(3.0), *ball(2.0, (0.1, 0, 0), True), *ball(1.0, (0.2, 0, 0)), *ball(0.5, (9.0, 0, 0))][::order]
    body = asm.Body("body", faces)
    volumes = 4.0 / 3.0 * PI * np.array([27.0, -8.0, 1.0, 0.125])
    assert body.volume == pytest.approx(volumes.sum(), rel=RIGHT)
    center = volumes @ [0.0, 0.1, 0.2, 9.0] / volumes.sum()
    np.testing.assert_allclose(body.center_of_mass, (center, 0.0, 0.0), atol=1e-12)
    box = [*asm.shapes.box(4.0, 4.0, 4.0), *moved(asm.shapes.box(2.0, 2.0, 2.0), (0.5, 0, 0), True)]
    assert asm.Body("box", box[::order]).volume == pytest.approx(56.0, rel=RIGHT)


def test_pieces_that_do_not_add_up_raise():
    box, small = asm.shapes.box(4.0, 4.0, 4.0), asm.shapes.box(2.0, 2.0, 2.0)
    for pieces, message in (
        ([*box, *moved(small, (9.0, 0, 0), True)], "has a piece with a volume of -8, .*; expected a positive one"),
        ([*box, *moved(small, (0.0, 0, 0))], "has a piece within another one, .*; expected a void there"),
        ([*box, *moved(small, (2.0, 0, 0))], "has pieces that meet, .*; expected pieces that are apart"),
        ([*box, *ball(1.0)], "has a piece within another one"),
        (
            [*ball(3.0), *ball(2.0, (0.1, 0, 0), True), *ball(1.0, (0.2, 0, 0), True)],
            "has a piece with a volume of -4.1",
        ),
        ([*ball(1.0), *ball(1.0, (1e-9, 0, 0))], "has pieces that meet"),
        ([*small, *moved(small, (0.0, 0, 0))], "has pieces that meet"),
    ):
        with pytest.raises(InputError, match=f"body 'pieces' {message}"):
            _ = asm.Body("pieces", pieces).volume
