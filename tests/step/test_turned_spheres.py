"""Faces of spheres that are written about an axis whose poles are away from their edges."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Sphere
from assembly.step.occt import parts
from assembly.step.turned_spheres import Region, region_of
from tests.step.models import O
from tests.step.test_poles import CASES, by_random, read_by_occt, written


def balls(shape, tmp_path):
    """Faces of spheres of a shape as they are read."""
    bodies = asm.read_step(written(shape, tmp_path / "given.step"))
    sides = [side.face for body in bodies for side in body.faces]
    return [face for face in sides if isinstance(elementary_form(face.surface), Sphere)]


def inside_out(face):
    """The same face with u and v exchanged, so that its normal is opposite."""
    boundary, chains = [], []
    for chain in face.chains:
        chains.append(range(len(boundary), len(boundary) + len(chain)))
        for k in reversed(chain):
            given = face.boundary[k].reversed()
            boundary.append(asm.NurbsCurve(given.control_points[:, ::-1], given.knots, given.degree, given.weights))
    return Region(face.surface.transposed(), tuple(boundary), tuple(chains))


def places(surface, curve, count=2001):
    """Points and normals along a curve, but for its ends, which may be at poles."""
    uv = curve.evaluate(np.linspace(*curve.domain, count)[1:-1])
    for axis, ends in enumerate(surface.domain):
        uv[:, axis] = uv[:, axis] if surface.closed[axis] else np.clip(uv[:, axis], *ends)
    return surface.evaluate(*uv.T), surface.normal(*uv.T)


def poles_of(surface):
    """Where a sphere's parameters have poles."""
    middle, (low, high) = np.mean(surface.domain[0]), surface.domain[1]
    return surface.evaluate([middle, middle], [low, high])


def nearest(points, places):
    return float(min(np.linalg.norm(points - place, axis=1).min() for place in places))


def checked(face):
    """Whether a face is turned; if so its boundary is the same in space, and away from poles."""
    region = region_of(face)
    if region.surface is face.surface:
        return False
    form = elementary_form(region.surface)
    assert isinstance(form, Sphere) and form.outward == elementary_form(face.surface).outward
    assert sorted(k for chain in region.chains for k in chain) == list(range(len(face.boundary)))
    given = [(one.domain, *places(face.surface, one)) for one in face.boundary]
    every = []
    for curve in region.boundary:
        points, normals = places(region.surface, curve)
        # Chains that are linked at a pole are one, so the order may be another one.
        same = [row for row in given if row[0] == curve.domain and np.abs(row[1] - points).max() < 1e-10 * form.radius]
        assert same and np.abs(normals - same[0][2]).max() < 1e-9
        every.append(points)
    # No hole of these tests is so small.
    assert nearest(np.concatenate(every), poles_of(region.surface)) > 0.2 * form.radius
    for chain in region.chains:
        curves = [region.boundary[k] for k in chain]
        for curve, after in zip(curves, curves[1:], strict=False):
            assert (curve.control_points[-1] == after.control_points[0]).all()
        gap = curves[-1].control_points[-1] - curves[0].control_points[0]
        period = region.surface._periods[0]
        assert gap[1] == 0.0 and abs(gap[0] / period - round(gap[0] / period)) < 1e-15
    return True


SPHERES = [name for name in CASES if "drilled" not in name]


@pytest.mark.parametrize("name", SPHERES)
def test_edges_stay_where_they_are(name, tmp_path):
    for face in balls(CASES[name](), tmp_path):
        assert checked(face) == checked(inside_out(face))


def test_random_edges_stay_where_they_are(tmp_path, cases):
    turned = 0
    for seed in range(40, 40 + cases(12, 100)):
        shape = by_random(seed)
        if shape is not None:
            turned += sum(checked(face) + checked(inside_out(face)) for face in balls(shape, tmp_path))
    assert turned >= cases(6, 60)


def test_circles_about_the_axis_keep_it():
    """A ball with a hole along its axis, whose edges are circles of latitude, is written as it is."""
    ball = asm.shapes.sphere(5.0)
    half = np.pi * 5.0
    rings = [
        asm.NurbsCurve([(a, v), (b, v)], [0.0, 0.0, 1.0, 1.0], 1)
        for a, b, v in ((0.0, 2.0 * half, 1.0), (2.0 * half, 0.0, half - 1.0))
    ]
    face = asm.Face(ball, rings[0], [rings[1]])
    assert region_of(face).surface is face.surface


@pytest.mark.parametrize("name", ["a corner at the pole", "three quarters are left"])
def test_free_edges_that_are_circles_are_written_as_such(name, tmp_path):
    faces = balls(CASES[name](), tmp_path)
    asm.write_step(tmp_path / "ours.step", asm.Body("ball", faces))
    (face,) = map(O.as_face, parts(read_by_occt(tmp_path / "ours.step"), O.TopAbs_FACE))
    edges = [O.as_edge(edge) for edge in parts(face, O.TopAbs_EDGE)]
    # OCCT adds the seams, which we leave out.
    added = [O.BRep_Tool.Degenerated_s(edge) or O.BRep_Tool.IsClosed_s(edge, face) for edge in edges]
    curves = [O.BRep_Tool.Curve_s(edge, 0.0, 0.0) for edge, is_added in zip(edges, added, strict=True) if not is_added]
    assert len(curves) > 1 and all(isinstance(curve, O.Geom_Circle) for curve in curves)
    again = asm.read_step(tmp_path / "ours.step")
    assert abs(sum(body.area for body in again) / sum(face.area() for face in faces) - 1.0) < 1e-9
