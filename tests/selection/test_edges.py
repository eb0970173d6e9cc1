"""Edges and vertices: what they are, where, and which a selection has."""

from __future__ import annotations

import copy
import gc
import weakref
from math import cos, pi, sin

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from tests.selection.test_faces import placed, plate

SEEDS = range(6)
FITTED = 1e-11


@pytest.mark.parametrize("seed", SEEDS)
def test_circles_and_lines(seed):
    body, rotation, offset = placed(seed, asm.shapes.plate(10, 8, 2, [(1, 1, 1.5), (-3, 0, 0.5)]))
    x, _, z = rotation.T
    edges = body.edges
    assert len(edges) == 16 and len(edges.circles()) == 4 and len(edges.lines()) == 12
    assert len(edges.lines(direction=-x)) == 4 == len(edges.lines(z)) and not edges.lines(x + z)
    assert len(edges.circles(radius=0.5)) == 2 and len(edges.circles(axis=z)) == 4 and not edges.circles(axis=x)
    assert edges.circles(7) == ()
    for edge in edges.circles(1.5):
        side = 1.0 if "top" in edge.name else -1.0
        assert edge.kind == "circle" and edge.radius == pytest.approx(1.5, abs=FITTED)
        assert abs(edge.center - (offset + rotation @ [1, 1, side])).max() < FITTED
        assert abs(edge.frame().axes[:, 2] - side * z).max() < FITTED  # outward of the flat face
        assert edge.length == pytest.approx(3 * pi, abs=1e-4) and edge.vertices == () and edge.is_convex
        assert {face.name for face in edge.faces} == {"hole 1", "top" if side > 0 else "bottom"}
    top, right = body.face("top"), body.face("right")
    (edge,) = edges.of(top, right)
    assert abs(edge.centroid - (offset + rotation @ [5, 0, 1])).max() < FITTED and len(edge.vertices) == 2
    assert edge in edge.vertices[0].edges and {f.name for f in edge.vertices[0].faces} >= {"top", "right"}
    assert edges.longest() == edges.lines(x)[:1]
    vertex = body.vertices.near(offset + rotation @ [9, 9, 9]).one()
    assert abs(vertex.point.coordinates - (offset + rotation @ [5, 4, 1])).max() < FITTED


@pytest.mark.parametrize("angle", [0.3, 1.0, pi / 2, 2.5, pi, 4.0, 6.0])
def test_arcs(angle):
    """Of a part of a ring; the centroid of an arc is sin(a / 2) / (a / 2) of the radius away from its center."""
    ring = asm.Body("ring", asm.shapes.revolution(asm.curves.polygon([(2, 0), (3, 0), (3, 1), (2, 1)]), angle))
    arcs = ring.edges.circles()
    assert sorted(round(arc.radius, 9) for arc in arcs) == [2, 2, 3, 3] and len(ring.edges.lines()) == 8
    half = 0.5 * angle
    for arc in arcs:
        away = arc.radius * sin(half) / half
        assert abs(arc.centroid[:2] - [away * cos(half), away * sin(half)]).max() < 1e-4 * arc.radius
        assert abs(arc.center[:2]).max() < FITTED and arc.kind == "circle"


def test_edges_between_curved_faces_are_what_they_are():
    """Where a cylinder runs through another one, and where a cone ends."""
    cone = asm.Body("cone", asm.shapes.cone(3, 4))
    assert [edge.kind for edge in cone.edges] == ["circle"] and cone.edges.one().radius == pytest.approx(3)
    assert cone.vertices.one().center.tolist() == pytest.approx([0, 0, 2]) and cone.vertices.one().edges == ()
    cam = asm.Body("cam", asm.shapes.cam([2, 2.1, 2.5, 2.2, 2], 1, 0.5))
    assert sorted(edge.kind for edge in cam.edges) == ["circle", "circle", "spline", "spline"]
    spline = cam.edges("%BSPLINE")[0]
    with pytest.raises(InputError, match=r"edge \d+ \('cam' \| '.*'\) of body 'cam' is a spline and has no frame"):
        spline.frame()
    t = np.linspace(*spline.domain, 20001)
    points = spline.at(t)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    mean = (0.5 * (points[1:] + points[:-1]) * steps[:, None]).sum(axis=0) / steps.sum()
    assert abs(spline.centroid - mean).max() < 1e-5 and spline.length == pytest.approx(steps.sum(), rel=1e-4)


@pytest.mark.parametrize("seed", SEEDS)
def test_distances_are_those_of_samples(seed):
    rng = np.random.default_rng(seed)
    body, _, _ = placed(seed, asm.shapes.cam([2, 2.1, 2.5, 2.2, 2], 1, 0.5))
    for _ in range(5):
        point = body.faces[0].center + 2 * rng.normal(size=3)
        gaps = []
        for edge in body.edges:
            gap = np.linalg.norm(edge.at(np.linspace(*edge.domain, 20001)) - point, axis=1).min()
            gaps.append(gap)
            assert gap - 1e-6 < edge.distance(point) <= gap + 1e-12
        assert body.edges.near(point).one().index == int(np.argmin(gaps))


def test_a_face_with_creases_keeps_its_name():
    roof = asm.NurbsSurface(
        [[[x, y, z] for y in (0, 2)] for x, z in ((0, 0), (1, 1), (2, 0))], ([0, 0, 1, 2, 2], [0, 0, 1, 1]), (1, 1)
    )
    body = asm.Body("roof", roof)
    (ridge,) = body.edges.lines((0, 1, 0))(">Z")
    assert ridge.faces == (body.face(),) and len(body.edges) == 7


def test_what_is_not_one_says_what_there_is():
    edges = plate().edges
    with pytest.raises(
        InputError, match=r"plate.edges.circles\(\) is 4 edges: edge \d+ \('hole 1' .* circle, radius 1.5"
    ):
        edges.circles().one()
    with pytest.raises(InputError, match="is empty; expected one of the edges that there are: edge 0"):
        edges.circles(9).one()
    with pytest.raises(InputError, match="plate.vertices is 8 vertices: vertex 0 at"):
        plate().vertices.one()
    with pytest.raises(InputError, match="is a vertex; expected a face or an edge"):
        plate().vertices(">X and >Y and >Z").frame()
    with pytest.raises(TypeError, match="face is 'top'; expected a face of a body"):
        edges.of("top")
    other = asm.Body("other", asm.shapes.box(1, 1, 1))
    with pytest.raises(InputError, match="expected one of body '.*', whose edges these are"):
        edges.of(other.faces[0])
    line = edges.lines()[0]
    with pytest.raises(InputError, match="is a line and has no radius"):
        _ = line.radius


def test_edges_are_of_their_body_and_go_with_it():
    body = plate()
    assert body.edges is body.edges and all(edge.body is body for edge in body.edges)
    other = copy.copy(body)
    assert all(edge.body is other for edge in other.edges) and other.edges.circles()[0].radius == pytest.approx(1.5)
    gone = weakref.ref(body)
    del body
    gc.collect()
    assert gone() is None
