from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.bezier import full_knots
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.curve_parts import between
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.brep.recut import with_cuts
from assembly.proximity.brep.topology import topology_of
from tests.solids import tiled_solid


def line(start, end):
    length = float(np.hypot(*np.subtract(end, start)))
    return NurbsCurve([start, end], [0.0, 0.0, length, length], 1)


def arc(center, radius, start, sweep, parts=1):
    """A circular arc of `parts` rational quadratic pieces."""
    half = 0.5 * sweep / parts
    angles = start + half * np.arange(2 * parts + 1)
    weights = np.where(np.arange(angles.size) % 2, cos(half), 1.0)
    points = np.column_stack([np.cos(angles), np.sin(angles)]) / weights[:, None]
    return NurbsCurve(radius * points + center, full_knots(np.linspace(0.0, 1.0, parts + 1), 2), 2, weights)


def polygon(corners):
    """A closed polygon as one curve of degree one."""
    points = np.concatenate([corners, corners[:1]])
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    return NurbsCurve(points, np.concatenate([at[:1], at, at[-1:]]), 1)


def moved(face, rotation=None, translation=(0.0, 0.0, 0.0), scale=1.0):
    surface = face.surface.transformed(rotation, translation, scale)
    return Face(surface, face.outer, face.holes, name=face.name, reversed=face.reversed)


def rotation(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else q[:, [1, 0, 2]]


def ell():
    corners = np.array([[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3.0]])
    return shapes.extrusion(polygon(corners), 2.0)


def rounded():
    """A prism over a quarter disc."""
    profile = [line((0, 0), (2, 0)), arc((0, 0), 2.0, 0.0, 0.5 * pi), line((0, 2), (0, 0))]
    return shapes.extrusion(profile, 1.0, holes=[arc((0.6, 0.7), 0.2, 0.3, 2 * pi, 3)])


# name: faces, edges, vertices, chi, convex edges, concave, smooth
SOLIDS = {
    "box": (shapes.box(1, 2, 3), 12, 8, 2, 12, 0, 0),
    "solid cylinder": (shapes.solid_cylinder(1, 2), 2, 0, 2, 2, 0, 0),
    "plate": (shapes.plate(4, 3, 1), 12, 8, 2, 12, 0, 0),
    "plate with holes": (shapes.plate(4, 3, 1, [(0, 0, 0.5), (1, 0.5, 0.3)]), 16, 8, -2, 16, 0, 0),
    "plate with slot": (shapes.plate_with_slot(4, 3, 1, 2, 0.5, angle=0.3), 24, 16, 0, 20, 0, 4),
    "cam": (shapes.cam([2, 2.1, 2.4, 2.2, 1.9, 1.8], 1.0, 0.5), 4, 0, 0, 4, 0, 0),
    "ell": (ell(), 18, 12, 2, 17, 1, 0),
    "rounded": (rounded(), 11, 6, 0, 11, 0, 0),
    "tiled": (tiled_solid(), 12, 8, 2, 12, 0, 0),
}


def along(topology, edge, side, t):
    """Points and outward normals of an edge on its first or second face, and its direction there."""
    number, index = ((edge.face_a, edge.curve_a), (edge.face_b, edge.curve_b))[side]
    face = topology.faces[number]
    curve = face.boundary[index]
    low, high = curve.domain
    closed = edge.start is None
    t = low + (t - low) % (high - low) if closed else np.clip(t, low, high)
    uv, rate = curve.evaluate(t, 1)
    for k in range(2):
        if not face.surface.closed[k]:
            uv[..., k] = np.clip(uv[..., k], *face.surface.domain[k])
    point, su, sv = face.surface.evaluate(uv[..., 0], uv[..., 1], 1)
    return point, face.normal(uv[..., 0], uv[..., 1]), su * rate[..., :1] + sv * rate[..., 1:]


def check(topology, tolerance):
    """What holds for every topology: adjacency is mutual, curves and points agree within a tolerance."""
    x = np.linspace(0.05, 0.95, 7)
    for k, edge in enumerate(topology.edges):
        low, high = topology.faces[edge.face_a].boundary[edge.curve_a].domain
        assert topology.face_edges[edge.face_a][edge.curve_a] == k
        t = low + (high - low) * x
        a, _, direction_a = along(topology, edge, 0, t)
        if edge.face_b is not None:
            assert topology.face_edges[edge.face_b][edge.curve_b] == k
            m0, m1 = edge.map_b
            b, _, direction_b = along(topology, edge, 1, m0 + m1 * t)
            assert np.linalg.norm(a - b, axis=1).max() <= tolerance
            signs = topology.faces[edge.face_a].sign * topology.faces[edge.face_b].sign
            assert (signs * (direction_a * direction_b).sum(axis=1) < 0.0).all()
        ends, _, _ = along(topology, edge, 0, np.array([low, high]))
        for side, number in enumerate((edge.start, edge.end)):
            if number is None:
                assert edge.start is None and edge.end is None
                assert np.linalg.norm(ends[0] - ends[1]) <= tolerance
            else:
                vertex = topology.vertices[number]
                assert np.linalg.norm(vertex.point - ends[side]) <= tolerance
                assert (k, side) in vertex.edges
                assert edge.face_a in vertex.faces and (edge.face_b is None or edge.face_b in vertex.faces)
    for number, vertex in enumerate(topology.vertices):
        for k, side in vertex.edges:
            assert (topology.edges[k].start, topology.edges[k].end)[side] == number
    for face, edges in zip(topology.faces, topology.face_edges, strict=True):
        assert len(face.boundary) == len(edges)
    seen = [edge for edges in topology.face_edges for edge in edges if edge is not None]
    sides = [1 + (edge.face_b is not None) for edge in topology.edges]
    assert np.bincount(seen, minlength=len(sides)).tolist() == sides


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("name", SOLIDS)
def test_solids(name, size):
    faces, edges, vertices, chi, convex, concave, smooth = SOLIDS[name]
    topology = topology_of([moved(face, rotation(1), (3.0 * size, size, -size), size) for face in faces])
    assert (len(topology.edges), len(topology.vertices), topology.chi) == (edges, vertices, chi)
    assert topology.is_closed
    bends = [edge.convex for edge in topology.edges]
    assert [bends.count(value) for value in (True, False, None)] == [convex, concave, smooth]
    # Exact curves on both sides, with parameters that go together linearly: rounding of the coordinates.
    check(topology, 1e-13 * 10.0 * size)


def test_faces_without_cuts_are_the_ones_given():
    faces = shapes.plate(4, 3, 1, [(0, 0, 0.5)])
    topology = topology_of(iter(faces))
    assert all(a is b for a, b in zip(topology.faces, faces, strict=True))
    assert repr(topology) == "Topology(7 faces, 14 edges, 8 vertices, closed)"


def test_box_vertices():
    topology = topology_of(shapes.box(1, 2, 3))
    points = np.array([vertex.point for vertex in topology.vertices])
    expected = np.stack(np.meshgrid([-0.5, 0.5], [-1, 1], [-1.5, 1.5]), axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(points[np.lexsort(points.T)], expected[np.lexsort(expected.T)], atol=1e-15)
    assert all(len(vertex.edges) == len(vertex.faces) == 3 for vertex in topology.vertices)
    np.testing.assert_allclose(sorted(edge.length for edge in topology.edges), np.repeat([1, 2, 3], 4), rtol=1e-14)


def test_lengths_of_curved_edges():
    # Three Gauss points on sixteen intervals: a circle's length to 1e-9 or better.
    cylinder = topology_of(shapes.solid_cylinder(1.5, 2))
    np.testing.assert_allclose([edge.length for edge in cylinder.edges], 3 * pi, rtol=1e-9)
    topology = topology_of(tiled_solid())
    arches = sorted(edge.length for edge in topology.edges if edge.length not in (8.0, 10.0))[-4:]
    # Of z = -c x^2 over [-h, h], with s = 2 c h: (s sqrt(1 + s^2) + arsinh s) / (2 c).
    exact = [
        (s * sqrt(1 + s * s) + np.arcsinh(s)) / (2 * c) for c, h in ((0.05, 4.0), (0.06, 5.0)) for s in [2 * c * h]
    ]
    np.testing.assert_allclose(arches, np.repeat(exact, 2), rtol=1e-9)


def test_concave_edge_is_the_inner_one():
    topology = topology_of(ell())
    (edge,) = [edge for edge in topology.edges if edge.convex is False]
    points = np.array([topology.vertices[k].point for k in (edge.start, edge.end)])
    np.testing.assert_allclose(points[:, :2], 1.0, atol=1e-15)


def plane_face(origin, x, y, corners, holes=(), name=None):
    """A plane face of a polygon; its normal is x cross y."""
    origin, x, y = (np.array(value, dtype=float) for value in (origin, x, y))
    size = 10.0
    points = np.array([[origin + a * x + b * y for b in (-size, size)] for a in (-size, size)])
    knots = np.array([-size, -size, size, size])
    return Face(NurbsSurface(points, (knots, knots), (1, 1)), polygon(np.array(corners, dtype=float)), holes, name=name)


def tee_box():
    """A box 2 by 1 by 1 whose front is two faces: the long edges above and below meet two short ones each."""
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    oblong = [[0, 0], [2, 0], [2, 1], [0, 1]]
    return [
        plane_face((0, 0, 0), (1, 0, 0), (0, 0, 1), square, name="front 1"),
        plane_face((1, 0, 0), (1, 0, 0), (0, 0, 1), square, name="front 2"),
        plane_face((2, 1, 0), (-1, 0, 0), (0, 0, 1), oblong, name="back"),
        plane_face((2, 0, 0), (0, 1, 0), (0, 0, 1), square, name="right"),
        plane_face((0, 1, 0), (0, -1, 0), (0, 0, 1), square, name="left"),
        plane_face((0, 0, 1), (1, 0, 0), (0, 1, 0), oblong, name="top"),
        plane_face((0, 1, 0), (1, 0, 0), (0, -1, 0), oblong, name="bottom"),
    ]


def test_long_edges_are_cut_where_short_ones_end():
    faces = tee_box()
    topology = topology_of(faces)
    assert (len(topology.edges), len(topology.vertices), topology.chi, topology.is_closed) == (15, 10, 2, True)
    check(topology, 1e-14)
    counts = {face.name: len(face.boundary) for face in topology.faces}
    assert counts == {"front 1": 4, "front 2": 4, "back": 4, "right": 4, "left": 4, "top": 5, "bottom": 5}
    assert [edge.convex for edge in topology.edges].count(None) == 1
    u, v = np.random.default_rng(0).uniform(-1, 3, (2, 500))
    for before, after in zip(faces, topology.faces, strict=True):
        np.testing.assert_array_equal(before.locate(u, v), after.locate(u, v))
        assert (before.name, before.sign, before.surface) == (after.name, after.sign, after.surface)


def disc(radius, z, up, curves):
    """A disc with normal +z or -z."""
    size = 2.0 * radius
    points = [[[x, y, z] for y in (-size, size)] for x in (-size, size)]
    knots = np.array([-size, -size, size, size])
    return Face(NurbsSurface(points, (knots, knots), (1, 1)), curves, reversed=not up)


RINGS = {
    "as one": [arc((0, 0), 2.0, 0.0, 2 * pi, 4)],
    "from elsewhere": [arc((0, 0), 2.0, 1.0, 2 * pi, 4)],
    "in other pieces": [arc((0, 0), 2.0, 2.0, 2 * pi, 3)],
    "of higher degree": [arc((0, 0), 2.0, -0.3, 2 * pi, 5).elevate(4)],
    "backwards": [arc((0, 0), 2.0, 0.5, -2 * pi, 4)],
    "two halves": [arc((0, 0), 2.0, 0.4, pi, 3), arc((0, 0), 2.0, 0.4 + pi, pi, 2)],
    "two halves from the same start": [arc((0, 0), 2.0, 0.0, pi, 2), arc((0, 0), 2.0, pi, pi, 2)],
    "four arcs": [
        arc((0, 0), 2.0, 0.1 + k, s, 2) for k, s in ((0.0, 1.0), (1.0, 2.0), (3.0, 0.5), (3.5, 2 * pi - 3.5))
    ],
}


@pytest.mark.parametrize("bottom", RINGS)
@pytest.mark.parametrize("top", RINGS)
def test_rings_meet_however_they_are_divided(top, bottom):
    wall = Face(shapes.cylinder(2.0, 3.0))
    for order in (slice(None), slice(None, None, -1)):
        faces = [wall, disc(2.0, 1.5, True, RINGS[top]), disc(2.0, -1.5, False, RINGS[bottom])][order]
        topology = topology_of(faces)
        assert topology.is_closed and topology.chi == 2
        assert all(edge.convex for edge in topology.edges)
        # A ring in one piece that meets arcs is cut where it begins, too.
        at_start = {"two halves from the same start": 2, "two halves": 3, "four arcs": 5}
        count = sum(at_start.get(name, 0) for name in (top, bottom))
        assert len(topology.vertices) == count
        np.testing.assert_allclose(sum(edge.length for edge in topology.edges), 8 * pi, rtol=1e-5)
        # Parameters of different arcs of a circle go together up to the second order.
        check(topology, 0.5)
        x = np.linspace(0.1, 0.9, 5)
        for edge in topology.edges:
            low, high = topology.faces[edge.face_a].boundary[edge.curve_a].domain
            points = along(topology, edge, 0, low + (high - low) * x)[0]
            np.testing.assert_allclose(np.hypot(points[:, 0], points[:, 1]), 2.0, rtol=1e-13)


def walls():
    """The wall of a cylinder with its boundary given in many ways."""
    tube = shapes.cylinder(2.0, 3.0)
    around = tube.domain[0][1]

    def rectangle(start):
        corners = [(start, 0.0), (start + around, 0.0), (start + around, 3.0), (start, 3.0)]
        return [line(corners[k], corners[(k + 1) % 4]) for k in range(4)]

    rings = [line((1.0, 0.0), (1.0 + around, 0.0)), line((around, 3.0), (0.0, 3.0))]
    window = arc((5.0, 1.5), 0.5, 0.0, 2 * pi, 4)
    return {
        "whole": Face(tube),
        "with its seam": Face(tube, rectangle(0.0)),
        "with a seam elsewhere": Face(tube, rectangle(4.0)),
        "with a seam on another sheet": Face(tube, rectangle(-9.0)),
        "turned and from the middle": Face(tube, [curve.reversed() for curve in rectangle(1.0)[::-1]][2:] +
                                           [curve.reversed() for curve in rectangle(1.0)[::-1]][:2]),
        "rings": Face(tube, rings[0], [rings[1]]),
        "with a window": Face(tube, rectangle(2.0), [window]),
        "whole with a window": Face(tube, holes=[window]),
    }  # fmt: skip


@pytest.mark.parametrize("name", walls())
def test_walls_are_cut_however_their_loops_are_given(name):
    wall = walls()[name]
    window = len(wall.boundary) - 2
    faces = [wall, disc(2.0, 1.5, True, RINGS["four arcs"]), disc(2.0, -1.5, False, RINGS["two halves"])]
    topology = topology_of(faces)
    assert topology.is_closed == (window == 0)
    assert (len(topology.edges), len(topology.vertices)) == (8 + window, 8) and topology.chi == 2 - window
    assert len(topology.faces[0].boundary) == 8 + window
    assert topology.faces[0].area() == pytest.approx(wall.area(), rel=1e-12)
    check(topology, 0.5)
    u, v = np.random.default_rng(0).uniform(0, [[4 * pi], [3.0]], (2, 500))
    np.testing.assert_array_equal(topology.faces[0].locate(u, v), wall.locate(u, v))


def test_a_gap_within_the_tolerance_is_closed_and_a_wider_one_is_not():
    faces = list(shapes.box(1, 2, 3))
    size = sqrt(14.0)
    near = [moved(faces[0], translation=(5e-7 * size, 0, 0)), *faces[1:]]
    assert topology_of(near).is_closed
    far = [moved(faces[0], translation=(5e-6 * size, 0, 0)), *faces[1:]]
    topology = topology_of(far)
    assert not topology.is_closed
    assert sum(edge.face_b is None for edge in topology.edges) == 8 and len(topology.vertices) == 12
    assert "open" in repr(topology)
    assert topology_of(far, tolerance=1e-5 * size).is_closed


@pytest.mark.parametrize(("bulge", "joins"), [(0.0, True), (5e-6, True), (5e-5, False)])
def test_curves_between_common_ends_may_be_a_little_off(bulge, joins):
    """Two faces of a folded sheet whose common side is a line on one and an arch on the other."""
    size = 10.0 * sqrt(2.0)
    arch = NurbsCurve([[0, 0], [0.5, -2.0 * bulge * size], [1, 0.0]], [0, 0, 0, 1, 1, 1], 2)
    rest = [line((1, 0), (1, 1)), line((1, 1), (0, 1)), line((0, 1), (0, 0))]
    knots = np.array([-5.0, -5.0, 5.0, 5.0])
    flat = [[[a, b, 0.0] for b in (-5, 5)] for a in (-5, 5)]
    folded = Face(NurbsSurface(flat, (knots, knots), (1, 1)), [arch, *rest])
    upright = [[[a, 0.0, -b] for b in (-5, 5)] for a in (-5, 5)]
    other = Face(NurbsSurface(upright, (knots, knots), (1, 1)), [line((0, 0), (1, 0)), *rest], reversed=True)
    topology = topology_of([folded, other], tolerance=1e-6 * size)
    assert len(topology.vertices) == 6
    assert len(topology.edges) == (7 if joins else 8)


def test_faces_with_contradicting_sides_do_not_join():
    bottom, top = shapes.box(1, 2, 3)[4:]
    faces = [*shapes.box(1, 2, 3)[:4], bottom, Face(top.surface, reversed=True)]
    topology = topology_of(faces)
    assert sum(edge.face_b is None for edge in topology.edges) == 8
    # The vertices are there all the same.
    assert len(topology.vertices) == 8


def test_single_faces():
    plane = topology_of([Face(shapes.plane(2, 1))])
    assert (len(plane.edges), len(plane.vertices), plane.chi, plane.is_closed) == (4, 4, 1, False)
    assert all(edge.convex is None and edge.face_b is None and edge.map_b == (0.0, 0.0) for edge in plane.edges)
    tube = topology_of([Face(shapes.cylinder(1, 1))])
    assert (len(tube.edges), len(tube.vertices), tube.chi, tube.is_closed) == (2, 0, 0, False)
    ball = topology_of([Face(shapes.sphere(1))])
    assert (len(ball.edges), len(ball.vertices), ball.chi, ball.is_closed) == (0, 0, 2, True)
    clip = topology_of([Face(shapes.paper_clip())])
    assert (len(clip.edges), len(clip.vertices), clip.chi, clip.is_closed) == (0, 0, 2, True)


def test_rings_of_surfaces_that_are_closed_twice():
    torus = topology_of([Face(shapes.torus(4, 1))])
    assert (len(torus.edges), torus.chi, torus.is_closed) == (0, 0, True)
    window = arc((3.0, 3.0), 1.0, 0.0, 2 * pi, 4)
    pierced = topology_of([Face(shapes.torus(4, 1), holes=[window])])
    assert (len(pierced.edges), pierced.chi, pierced.is_closed) == (1, -1, False)
    pane = topology_of([Face(shapes.torus(4, 1), window)])
    assert (len(pane.edges), pane.chi) == (1, 1)


def octant():
    """An eighth of a ball: the curved face is a whole patch, one side of which is a pole."""
    quarter = arc((0, 0), 2.0, 0.0, 0.5 * pi)
    flat = [line((0, 0), (2, 0)), quarter, line((0, 2), (0, 0))]
    # Rows of the patch: the quarter circle at u = 0 turned about z.
    profile, weights = 2.0 * np.array([[1, 0], [1, 1], [0, 1.0]]), np.array([1.0, sqrt(0.5), 1.0])
    points = np.empty((3, 3, 3))
    points[..., :2] = np.array([[1, 0], [1, 1], [0, 1.0]])[:, None] * profile[None, :, :1]
    points[..., 2] = profile[:, 1]
    knots = np.array([0, 0, 0, 1, 1, 1.0])
    patch = Face(NurbsSurface(points, (knots, knots), (2, 2), np.outer(weights, weights)))

    def side(x, y):
        """The quarter disc in the plane of x and y, with the normal x cross y."""
        x, y = np.array(x, dtype=float), np.array(y, dtype=float)
        corners = np.array([[a * x + b * y for b in (-3.0, 3.0)] for a in (-3.0, 3.0)])
        ends = np.array([-3.0, -3.0, 3.0, 3.0])
        return Face(NurbsSurface(corners, (ends, ends), (1, 1)), flat)

    return [patch, side((0, 1, 0), (1, 0, 0)), side((0, 0, 1), (0, 1, 0)), side((1, 0, 0), (0, 0, 1))]


def test_a_pole_on_the_boundary_is_a_vertex():
    topology = topology_of(octant())
    assert (len(topology.edges), len(topology.vertices), topology.chi, topology.is_closed) == (6, 4, 2, True)
    assert len(topology.faces[0].boundary) == 3
    assert all(edge.convex for edge in topology.edges)
    check(topology, 1e-14)


def cut_octant():
    """The same with one of the plane sides in two parts: an edge of the patch that runs into the pole is cut."""
    patch, first, second, third = octant()
    # x is z and y is y in the second side: cut it along the diagonal.
    d = 2.0 * sqrt(0.5)
    lower = [line((0, 0), (2, 0)), arc((0, 0), 2.0, 0.0, 0.25 * pi), line((d, d), (0, 0))]
    upper = [line((0, 0), (d, d)), arc((0, 0), 2.0, 0.25 * pi, 0.25 * pi), line((0, 2), (0, 0))]
    return [patch, first, Face(second.surface, lower), Face(second.surface, upper), third]


def test_edges_of_a_surface_itself_are_cut_too():
    topology = topology_of(cut_octant())
    assert (len(topology.edges), len(topology.vertices), topology.chi, topology.is_closed) == (8, 5, 2, True)
    assert len(topology.faces[0].boundary) == 4
    assert [edge.convex for edge in topology.edges].count(None) == 1
    check(topology, 0.05)
    # The ends are exact where the linear map is not.
    for edge in topology.edges:
        start, end = (topology.vertices[k].point for k in (edge.start, edge.end))
        low, high = topology.faces[edge.face_b].boundary[edge.curve_b].domain
        b, _, _ = along(topology, edge, 1, np.array([high, low]))
        np.testing.assert_allclose(b, [start, end], atol=1e-13)


def test_loops_that_touch_and_end_at_a_pole_are_cut():
    """A hole touches a loop through the pole in the middle of a line: the boundary is cut there, the loop is not."""
    ball = shapes.sphere(2.0)
    top = ball.domain[1][1]
    corners = [(0.5, top), (0.5, 2.0), (6.0, 2.0), (6.0, top)], [(3.0, 2.0), (4.0, 4.0), (2.0, 4.0)]
    loops = [[line(a, b) for a, b in zip(loop, loop[1:] + loop[:1], strict=True)] for loop in corners]
    face = Face(ball, loops[0], holes=loops[1:])
    assert len(face.boundary) == 7 and len(face.outer.curves) == 4
    halves = [np.array([c.domain[0], sum(c.domain) / 2, c.domain[1]]) for c in face.boundary]
    parts = [[between(c, a, b), between(c, b, d)] for c, (a, b, d) in zip(face.boundary, halves, strict=True)]
    made = with_cuts(face, parts)
    assert [c.domain for c in made.boundary] == [c.domain for pair in parts for c in pair]
    assert [len(chain) for chain in made.chains] == [2 * len(chain) for chain in face.chains]
    u, v = np.meshgrid(np.linspace(*ball.domain[0], 41), np.linspace(*ball.domain[1], 43))
    np.testing.assert_array_equal(made.locate(u, v), face.locate(u, v))
    assert {-1, 1} <= set(made.locate(u, v).ravel().tolist())


def test_a_slice_of_a_ball():
    """Two poles: both ends of both meridians."""
    ball = shapes.sphere(2.0)
    u1 = ball.domain[0][1] / 4
    patch = Face(ball, [line((0, 0), (u1, 0)), line((u1, 0), (u1, 2 * pi)), line((u1, 2 * pi), (0, 2 * pi)),
                        line((0, 2 * pi), (0, 0))])  # fmt: skip
    half = [line((0, -2), (0, 2)), arc((0, 0), 2.0, 0.5 * pi, -pi, 2)]

    def side(x, y):
        x, y = np.array(x, dtype=float), np.array(y, dtype=float)
        corners = np.array([[a * x + b * y for b in (-3.0, 3.0)] for a in (-3.0, 3.0)])
        ends = np.array([-3.0, -3.0, 3.0, 3.0])
        return corners, ends

    corners, ends = side((1, 0, 0), (0, 0, 1))
    first = Face(NurbsSurface(corners, (ends, ends), (1, 1)), half)  # normal -y
    corners, ends = side((0, 1, 0), (0, 0, 1))
    second = Face(NurbsSurface(corners, (ends, ends), (1, 1)), half, reversed=True)  # normal -x
    topology = topology_of([patch, first, second])
    assert (len(topology.edges), len(topology.vertices), topology.chi, topology.is_closed) == (3, 2, 2, True)
    assert all(edge.convex for edge in topology.edges)
    check(topology, 1e-13)


def test_the_tip_of_a_cone_is_a_vertex_without_edges():
    base = disc(1.0, -1.0, False, [arc((0, 0), 1.0, 0.0, 2 * pi, 4)])
    topology = topology_of([Face(shapes.cone(1.0, 2.0)), base])
    assert topology.is_closed and topology.chi == 2
    (tip,) = topology.vertices
    np.testing.assert_allclose(tip.point, [0, 0, 1], atol=1e-15)
    assert (tip.edges, tip.faces) == ((), (0,))
    # Cut off by the trim there is no tip.
    low, high = shapes.cone(1.0, 2.0).domain[0]
    half = 0.5 * shapes.cone(1.0, 2.0).domain[1][1]
    trimmed = Face(shapes.cone(1.0, 2.0), line((low, 0.0), (high, 0.0)), [line((high, half), (low, half))])
    assert topology_of([trimmed, base]).vertices == ()


def test_a_face_meets_itself_along_a_seam_that_is_not_closed():
    tube = shapes.cylinder(2.0, 3.0)
    points = tube.control_points.copy()
    points[-1] += [0.0, 1e-8, 0.0]
    wall = Face(NurbsSurface(points, tube.knots, tube.degree, tube.weights))
    assert wall.surface.closed == (False, False)
    faces = [wall, disc(2.0, 1.5, True, RINGS["as one"]), disc(2.0, -1.5, False, RINGS["from elsewhere"])]
    topology = topology_of(faces)
    assert topology.is_closed and topology.chi == 2
    seam = [edge for edge in topology.edges if edge.face_a == edge.face_b == 0]
    assert len(seam) == 1 and seam[0].convex is None
    check(topology, 0.5)


def test_points_are_no_edges():
    # A loop with a side of a millionth of a millionth.
    outer = [line((0, 0), (1, 0)), line((1, 0), (1, 1)), line((1, 1), (1e-9, 1)), line((1e-9, 1), (0, 1)),
             line((0, 1), (0, 0))]  # fmt: skip
    topology = topology_of([Face(shapes.plane(4, 4), outer)])
    assert (len(topology.edges), len(topology.vertices), topology.chi) == (4, 4, 1)
    assert topology.face_edges == ((0, 1, 2, None, 3),)


def test_corners_inside_a_curve_are_vertices_and_smooth_knots_are_not():
    smooth = arc((0, 0), 1.0, 0.0, 2 * pi, 7)
    bent = polygon(np.array([[-3, -3], [0, -3], [3, -3], [3, 3], [-3, 3.0]]))
    topology = topology_of([Face(shapes.plane(8, 8), bent, [smooth])])
    # The corner at (0, -3) is none.
    assert (len(topology.edges), len(topology.vertices), topology.chi) == (5, 4, 0)
    teardrop = NurbsCurve([[1, 0], [3, 2], [1, 3], [-1, 2], [1, 0.0]], [0, 0, 0, 0, 0, 1, 1, 1, 1, 1], 4)
    topology = topology_of([Face(shapes.plane(8, 8), teardrop)])
    assert (len(topology.edges), len(topology.vertices)) == (1, 1)
    assert topology.edges[0].start == topology.edges[0].end == 0
    assert topology.vertices[0].edges == ((0, 0), (0, 1))


def test_two_bodies_side_by_side():
    """Characteristics add up, and where four faces meet along one line each finds a partner."""
    faces = [*shapes.box(1, 1, 1), *(moved(face, translation=(1, 1, 0)) for face in shapes.box(1, 1, 1))]
    topology = topology_of(faces)
    assert topology.is_closed and len(topology.edges) == 24 and len(topology.vertices) == 14
    apart = topology_of([*shapes.box(1, 1, 1), *(moved(face, translation=(5, 0, 0)) for face in shapes.box(1, 1, 1))])
    assert apart.chi == 4


def test_random_prisms(cases):
    for seed in range(cases(7, 20)):
        rng = np.random.default_rng(seed)
        count = int(rng.integers(3, 30))
        angles = np.sort(rng.uniform(0, 2 * pi, count) + 0.0)
        if np.diff(np.append(angles, angles[0] + 2 * pi)).min() < 1e-2:
            angles = np.linspace(0, 2 * pi, count, endpoint=False)
        radii = rng.uniform(2.0, 4.0, count)
        corners = radii[:, None] * np.column_stack([np.cos(angles), np.sin(angles)])
        faces = shapes.extrusion(polygon(corners), rng.uniform(0.1, 5.0))
        mixed = [faces[k] for k in rng.permutation(len(faces))]
        topology = topology_of([moved(face, rotation(seed)) for face in mixed])
        assert topology.is_closed and topology.chi == 2
        assert (len(topology.edges), len(topology.vertices)) == (3 * count, 2 * count)
        x, y = corners.T
        turns = np.cross(
            np.pad(np.diff(np.vstack([corners, corners[:1]]), axis=0), ((0, 0), (0, 1))),
            np.pad(np.roll(np.diff(np.vstack([corners, corners[:1]]), axis=0), -1, axis=0), ((0, 0), (0, 1))),
        )[:, 2]
        assert [edge.convex for edge in topology.edges].count(False) == int((turns < 0).sum())
        check(topology, 1e-13)


def test_bad_input():
    faces = shapes.box(1, 1, 1)
    with pytest.raises(TypeError, match="faces is Face.*expected several of Face"):
        topology_of(faces[0])
    with pytest.raises(TypeError, match=r"faces\[0\] is NurbsSurface.*expected a Face"):
        topology_of([shapes.plane(1, 1)])
    with pytest.raises(InputError, match="faces is empty; expected at least one Face"):
        topology_of([])
    for tolerance in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match="tolerance is .*expected a"):
            topology_of(faces, tolerance)


def test_blades_are_convex():
    """A blade (both faces on the same side of their edge) counts as convex, whatever rounding says."""
    for tilt in (0.0, 1e-9, -1e-9):
        x = np.array([cos(tilt), 0.0, sin(tilt)])
        blade = [
            plane_face((0, 0, 0), (1, 0, 0), (0, 1, 0), [[0, 0], [1, 0], [1, 1], [0, 1]]),
            plane_face((0, 0, 0), (0, 1, 0), x, [[0, 0], [1, 0], [1, 1], [0, 1]]),
        ]
        topology = topology_of(blade, tolerance=1e-12)
        shared = [edge for edge in topology.edges if edge.face_b is not None]
        assert shared and all(edge.convex is True for edge in shared)
