"""Facets against the faces they stand for: how far apart they are either way, their areas, and what they share."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from scipy.spatial import cKDTree

import assembly as asm
from assembly.errors import InputError
from assembly.geometry.meshing.border import border
from assembly.geometry.meshing.delaunay import inside, triangulated
from assembly.geometry.meshing.polygon import facets
from assembly.geometry.splines.bezier import full_knots

RNG = np.random.default_rng(11)
PI = np.pi
HALF = np.sqrt(0.5)


def line(start, end):
    return asm.NurbsCurve([start, end], [0, 0, 1, 1], 1)


def polygon(*corners):
    return [line(a, b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]


def circle(center, radius, along=1):
    """Counterclockwise, or clockwise for a hole."""
    points = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]], dtype=float)
    weights = [1, HALF] * 4 + [1]
    return asm.NurbsCurve(np.array(center) + radius * points[::along], full_knots(np.linspace(0, 1, 5), 2), 2, weights)


def wave(turns=2.0):
    """A smooth closed curve of degree 3, not a conic, around the origin."""
    angle = np.linspace(0, 2 * PI, 25)[:-1]
    points = (1 + 0.3 * np.sin(turns * 2 * angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([points, points[:3]])
    return asm.NurbsCurve(points, np.arange(len(points) + 4.0), 3)


def bumps():
    x, y = np.meshgrid(np.linspace(-2, 2, 7), np.linspace(-2, 2, 7), indexing="ij")
    knots = np.concatenate([np.zeros(3), np.linspace(-2, 2, 5) + 2, np.full(3, 4)]) - 2
    points, weights = np.dstack([x, y, 0.3 * RNG.normal(size=(7, 7))]), RNG.uniform(0.7, 1.4, (7, 7))
    return asm.NurbsSurface(points, (knots, knots), (3, 3), weights)


PLANE = asm.shapes.plane(4.0, 4.0)
CYLINDER = asm.shapes.cylinder(1.0, 8.0)
SPHERE = asm.shapes.sphere(1.0)
TORUS = asm.shapes.torus(3.0, 1.0)
CONE = asm.shapes.cone(1.0, 2.0)
P, Q = 2 * PI, 6 * PI

FACES = {
    "disc": asm.Face(PLANE, circle((0, 0), 1)),
    "annulus": asm.Face(PLANE, circle((0, 0), 1), [circle((0.2, 0), 0.5, -1)]),
    "plate with a hole": asm.Face(PLANE, None, [circle((0.5, -0.5), 0.5, -1)]),
    "wave": asm.Face(PLANE, wave()),
    "cylinder with a window": asm.Face(CYLINDER, None, [circle((3.3, 4), 1, -1)]),
    "cylinder with a window over the seam": asm.Face(CYLINDER, None, [circle((0.3, 4), 1, -1)]),
    "cylinder with a slot that ends at the seam": asm.Face(
        CYLINDER, None, [polygon((0.0, 2.0), (0.0, 6.0), (1.0, 6.0), (1.0, 2.0))]
    ),
    "patch over the seam": asm.Face(CYLINDER, circle((0.3, 4), 1)),
    "oblique rings": asm.Face(
        CYLINDER,
        asm.NurbsCurve([[0, 1], [2, 3], [4, 0], [P, 1]], [0, 0, 0, 0, 1, 1, 1, 1], 3),
        [asm.NurbsCurve([[P, 6], [4, 7], [2, 4], [0, 6]], [0, 0, 0, 0, 1, 1, 1, 1], 3)],
    ),
    "half a sphere": asm.Face(SPHERE, line((0, PI / 2), (P, PI / 2))),
    "the other half": asm.Face(SPHERE, line((P, PI / 2), (0, PI / 2)), reversed=True),
    "an eighth": asm.Face(SPHERE, polygon((0, PI / 2), (P / 4, PI / 2), (P / 4, PI), (0, PI))),
    "sphere with a hole": asm.Face(SPHERE, None, [circle((0.2, PI / 2), 0.5, -1)]),
    "cap of a cone": asm.Face(CONE, line((0, 1), (PI, 1))),
    "torus with a window": asm.Face(TORUS, None, [circle((0, 0), 1, -1)]),
    "band over the seam": asm.Face(TORUS, line((0, 5), (Q, 5)), [line((Q, 7.5), (0, 7.5))]),
    "bumps": asm.Face(bumps(), wave(), [circle((0.1, 0), 0.4, -1)]),
    "whole bumps": asm.Face(bumps()),
    "whole sphere": asm.Face(SPHERE),
    "whole cylinder": asm.Face(CYLINDER),
    "whole cone": asm.Face(CONE),
}


def normals_of(found):
    a, b, c = np.moveaxis(found.points[found.triangles], 1, 0)
    return np.cross(b - a, c - a)


def to_triangles(points, corners):
    """Distance of points (n, 3) from the nearest of triangles (m, 3, 3)."""
    nearest = np.full(len(points), np.inf)
    a, b, c = np.moveaxis(corners, 1, 0)
    flat = np.cross(b - a, c - a)
    flat /= np.maximum(np.linalg.norm(flat, axis=1, keepdims=True), 1e-300)
    for k, p in enumerate(points):
        height = ((p - a) * flat).sum(axis=1)
        foot = p - height[:, None] * flat
        within = np.ones(len(corners), dtype=bool)
        best = np.full(len(corners), np.inf)
        for start, end in ((a, b), (b, c), (c, a)):
            way = end - start
            within &= (np.cross(way, foot - start) * flat).sum(axis=1) >= 0
            part = np.clip(((p - start) * way).sum(axis=1) / np.maximum((way**2).sum(axis=1), 1e-300), 0, 1)
            best = np.minimum(best, np.linalg.norm(start + part[:, None] * way - p, axis=1))
        nearest[k] = np.where(within, np.abs(height), best).min()
    return nearest


def samples(face, count):
    """Parameters (n, 2) on the face, spread over it and along its boundary."""
    low, high = np.array(face.surface.domain).T
    at = low + RNG.random((20 * count, 2)) * (high - low)
    at = at[face.locate(at[:, 0], at[:, 1]) >= 0][:count] if face.boundary else at[:count]
    rims = [curve.evaluate(np.linspace(*curve.domain, 41)) for curve in face.boundary]
    return np.concatenate([at, *rims])


def apart(face, found, count=60):
    """How far points of the face are from the facets, and points of the facets from the face."""
    at = samples(face, count)
    at = np.column_stack(
        [
            column if closed else np.clip(column, *ends)
            for column, closed, ends in zip(at.T, face.surface.closed, face.surface.domain, strict=True)
        ]
    )
    there = to_triangles(face.surface.evaluate(*at.T), found.points[found.triangles])
    weights = RNG.dirichlet([0.5, 0.5, 0.5], 4 * count)
    chosen = found.triangles[RNG.integers(len(found.triangles), size=4 * count)]
    points = (weights[..., None] * found.points[chosen]).sum(axis=1)
    at = (weights[..., None] * found.parameters[chosen]).sum(axis=1)
    back = np.empty(len(points))
    on_face = face.locate(*at.T) >= 0 if face.boundary else np.ones(len(at), dtype=bool)
    rim = [face.surface.evaluate(*curve.evaluate(np.linspace(*curve.domain, 4001)).T) for curve in face.boundary]
    for k, (p, uv) in enumerate(zip(points, at, strict=True)):
        for _ in range(6):  # the foot point, by Newton on the tangent plane
            s, su, sv = face.surface.evaluate(*uv, 1)
            step = np.linalg.lstsq(np.column_stack([su, sv]), p - s, rcond=None)[0]
            uv = [
                x + d if closed else np.clip(x + d, *ends)
                for x, d, closed, ends in zip(uv, step, face.surface.closed, face.surface.domain, strict=True)
            ]
        back[k] = np.linalg.norm(face.surface.evaluate(*uv) - p)
        if face.boundary and not on_face[k] and face.locate(*uv) < 0:
            back[k] = np.nan
    lost = np.isnan(back)
    if lost.any():
        back[lost] = cKDTree(np.concatenate(rim)).query(points[lost])[0]
    return there.max(), back.max()


@pytest.mark.parametrize("face", FACES.values(), ids=FACES)
@pytest.mark.parametrize("tolerance", [0.1, 0.01])
def test_facets_and_face_are_within_the_tolerance(face, tolerance, cases):
    there, back = apart(face, facets(face, tolerance), cases(12, 60))
    # It is measured at the middles of triangles and edges; the farthest point of an arc is a little beside its middle.
    assert max(there, back) <= 1.01 * tolerance


def test_facets_of_another_tolerance_are_not():
    # The test above can fail.
    there, back = apart(FACES["torus with a window"], facets(FACES["torus with a window"], 0.1))
    assert min(there, back) > 0.03


AREAS = {
    "disc": PI,
    "annulus": 0.75 * PI,
    "plate with a hole": 16 - 0.25 * PI,
    "half a sphere": 2 * PI,
    "the other half": 2 * PI,
    "an eighth": PI / 2,
    "whole sphere": 4 * PI,
    "whole cylinder": 16 * PI,
    "whole cone": PI * np.sqrt(5),
    # Half the height of a cone is a quarter of its area; v is the slant.
    "cap of a cone": PI * np.sqrt(5) * (1 - 1 / np.sqrt(5)) ** 2,
}
# The window's corners are at quarters of the turn, where the angle is the parameter.
WINDOW = asm.Face(CYLINDER, None, [polygon((P / 4, 2.0), (P / 4, 6.0), (P / 2, 6.0), (P / 2, 2.0))])
CASES = {**{name: (FACES[name], area) for name, area in AREAS.items()}, "window": (WINDOW, 16 * PI - 2 * PI)}


@pytest.mark.parametrize(("face", "area"), CASES.values(), ids=CASES)
def test_areas_come_to_the_true_ones(face, area):
    # An arc of height h over a chord: areas differ by 4 h / 3 times an edge for each, by less than 2 h for the whole.
    wrong = [abs(facets(face, h).area - area) / area for h in (3e-2, 3e-3, 3e-4)]
    for h, error in zip((3e-2, 3e-3, 3e-4), wrong, strict=True):
        assert error < 2.0 * h
    assert wrong[2] < 0.25 * wrong[1] or wrong[2] < 1e-12


@pytest.mark.parametrize("face", FACES.values(), ids=FACES)
def test_corners_normals_and_triangles(face):
    found = facets(face, 0.02)
    at = [
        column if closed else np.clip(column, *ends)
        for column, closed, ends in zip(found.parameters.T, face.surface.closed, face.surface.domain, strict=True)
    ]
    # Both sides of a seam are evaluated at one of them.
    assert np.abs(found.points - face.surface.evaluate(*at)).max() < 1e-13
    assert np.abs(found.normals - face.normal(*at)).max() < 1e-13
    flat = normals_of(found)
    size = np.linalg.norm(flat, axis=1)
    assert size.min() > 0.0
    assert set(np.unique(found.triangles)) == set(range(len(found.points)))
    # Triangles look where their corners do, but for slivers between corners of one arc.
    cosine = (flat[:, None] * found.normals[found.triangles]).sum(axis=2) / size[:, None]
    wide = size > 1e-3 * size.max()
    assert cosine[wide].min() > 0.5
    # The middle of a triangle is inside, or nearer to the boundary than the tolerance.
    if face.boundary:
        middle = found.parameters[found.triangles].mean(axis=1)
        outside = face.locate(*middle.T) < 0
        rim = [face.surface.evaluate(*c.evaluate(np.linspace(*c.domain, 4001)).T) for c in face.boundary]
        there = found.points[found.triangles].mean(axis=1)[outside]
        assert not outside.any() or cKDTree(np.concatenate(rim)).query(there)[0].max() < 0.021


@pytest.mark.parametrize("name", [n for n in FACES if "cone" not in n])
def test_facets_are_without_cracks(name):
    face = FACES[name]
    found = facets(face, 0.02)
    _, place = np.unique(found.points, axis=0, return_inverse=True)
    # Corners on both sides of a seam, and all of a pole, are equal to the last bit.
    corners = place.reshape(-1)[found.triangles]
    edges = Counter((int(a), int(b)) for t in corners for a, b in zip(t, np.roll(t, -1), strict=True))
    assert set(edges.values()) == {1}
    single = [(a, b) for a, b in edges if (b, a) not in edges]
    # What is left are closed chains: the boundary.
    assert Counter(a for a, _ in single) == Counter(b for _, b in single)
    loops = 2 if face.surface is CYLINDER and face.outer is None else 0
    assert (len(single) > 0) == bool(face.boundary or loops)


def test_neighbors_share_the_corners_of_their_edge():
    plate = {face.name: face for face in asm.shapes.plate(60.0, 40.0, 8.0, holes=[(0.0, 0.0, 8.0)])}
    for tolerance, angle in ((1e-2, 0.1), (1e-3, 1.0)):
        top, wall = (border(plate[name], tolerance, angle).points.reshape(-1, 3) for name in ("top", "hole 1"))
        top, wall = top[np.hypot(top[:, 0], top[:, 1]) < 9.0], wall[wall[:, 2] > 0.0]
        assert len(top) == len(wall) > 60
        # The same circle in the same parametrization, once as a curve on a plane: rounding of coordinates up to 8.
        assert cKDTree(top).query(wall)[0].max() < 1e-12


def test_an_edge_of_the_surface_is_an_edge_of_the_facets():
    roof = asm.NurbsSurface(
        [[[-1, -1, 0], [-1, 1, 0]], [[0, -1, 1], [0, 1, 1]], [[1, -1, 0], [1, 1, 0]]],
        ([0, 0, 0.5, 1, 1], [0, 0, 1, 1]),
        (1, 1),
    )
    found = facets(asm.Face(roof, circle((0.45, 0.5), 0.3), [circle((0.5, 0.5), 0.1, -1)]), 1e-3)
    # Both sides are flat: two normals, exact but for rounding.
    s = HALF
    left = found.normals[:, 0] < 0
    assert found.normals == pytest.approx(np.where(left[:, None], [-s, 0, s], [s, 0, s]), abs=1e-12)
    sides = np.sign(np.round(found.parameters[found.triangles][..., 0] - 0.5, 9))
    assert np.ptp(sides, axis=1).max() == 1.0
    # Four places where a circle crosses the ridge, in two normals each.
    ridge = found.points[np.abs(found.points[:, 0]) < 1e-12]
    assert len(ridge) >= 8 and len(np.unique(ridge, axis=0)) * 2 == len(ridge)


def test_holes_a_period_away():
    face = asm.Face(CYLINDER, circle((0.3, 4), 1), [circle((0.3, 4), 0.5, -1)])
    away = asm.Face(CYLINDER, circle((0.3, 4), 1), [circle((0.3 + P, 4), 0.5, -1)])
    # A period is not a number of few bits.
    assert facets(away, 1e-2).area == pytest.approx(facets(face, 1e-2).area, abs=1e-9)


@pytest.mark.parametrize("gap", [1e-2, 1e-5])
def test_chords_that_cross_are_parted(gap):
    turn = 0.3
    hole = circle((0, 0), 0.5, -1)
    matrix = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    hole = asm.NurbsCurve(hole.control_points @ matrix.T + [0.5 - gap, 0.0], hole.knots, 2, hole.weights)
    face = asm.Face(PLANE, circle((0, 0), 1), [hole])
    found = facets(face, 0.1)
    assert found.area == pytest.approx(0.75 * PI, rel=0.15)
    assert max(apart(face, found)) <= 0.101
    assert (normals_of(found)[:, 2] > 0).all()


@pytest.mark.parametrize("radius", [1.0, 1.0 - 1e-12, 1.0 + 1e-10])
def test_cusps_between_loops_that_touch(radius):
    net = np.array([[[-1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]], [[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]])
    square = asm.NurbsSurface(net, [[-1.0, -1.0, 1.0, 1.0]] * 2, (1, 1))
    face = asm.Face(square, None, [asm.curves.circle(radius)])
    assert len(face.chains) == 4
    made = facets(face, 1e-4)
    # Chords of the hole are inside it, by at most the tolerance.
    assert 4.0 - np.pi <= made.area <= 4.0 - np.pi + 1e-4 * 2.0 * np.pi
    assert len(made.triangles) < 1000


def test_ways_between_corners_a_rounding_apart_end():
    # Corners that arithmetic cannot tell apart lie on the way from each to the other.
    random = np.random.default_rng(3)
    base = random.random((12, 2))
    points = np.concatenate([base, np.nextafter(base, 2.0), np.nextafter(base, -1.0)])
    segments = random.permutation(len(points)).reshape(-1, 2)
    found = triangulated(points, segments)
    assert set(found.owner) | set(found.blocked) == set(range(len(segments)))


def test_chords_that_are_not_parted(monkeypatch):
    # A ring much thinner than the tolerance, with no leave to part its chords: what is found is in the ring.
    monkeypatch.setattr("assembly.geometry.meshing.polygon._PARTINGS", 0)
    found = facets(asm.Face(PLANE, circle((0, 0), 1), [circle((1e-5, 0), 0.9999, -1)]), 0.1)
    assert found.area < 0.1
    assert np.abs(np.hypot(*found.points.T[:2]) - 1.0).max() < 2e-4


def test_other_units_and_places():
    for name in ("bumps", "cylinder with a window over the seam", "an eighth"):
        face = FACES[name]
        reference = facets(face, 1e-2)
        small = asm.Face(face.surface.transformed(scale=1e-3), face.outer, face.holes)
        far = asm.Face(face.surface.transformed(translation=(1e4, -1e4, 3e3)), face.outer, face.holes)
        # Rounding decides which of two equal diagonals is taken; that is much less than the tolerance.
        assert facets(small, 1e-5).area == pytest.approx(1e-6 * reference.area, rel=1e-4)
        assert facets(far, 1e-2).area == pytest.approx(reference.area, rel=1e-4)


def test_a_smaller_angle_makes_more_facets():
    face = FACES["cylinder with a window"]
    found = facets(face, 1.0, angle=np.deg2rad(7.5))
    assert found.area == pytest.approx(facets(face, 1e-4).area, rel=5e-3)
    turned = found.normals[found.triangles]
    cosine = (turned * np.roll(turned, 1, axis=1)).sum(axis=2)
    # An edge may turn half as far again.
    assert np.rad2deg(np.arccos(cosine.min())) < 12.0


def test_bad_input():
    with pytest.raises(TypeError, match="face is 3; expected a Face"):
        facets(3, 0.1)
    for bad in (0.0, -1.0, np.nan, "fine"):
        with pytest.raises(InputError, match="tolerance is"):
            facets(FACES["disc"], bad)
    with pytest.raises(InputError, match="angle is 0"):
        facets(FACES["disc"], 0.1, angle=0.0)
    for name in ("whole sphere", "half a sphere"):
        with pytest.raises(InputError, match="tolerance is 1e-09; expected one that needs less than"):
            facets(FACES[name], 1e-9)


def star(count, seed):
    """A polygon around the origin that does not cross itself, and points anywhere."""
    random = np.random.default_rng(seed)
    angle = np.sort(random.uniform(0, 2 * PI, count))
    radius = random.uniform(0.2, 1.0, count)
    rim = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return rim, np.column_stack([np.arange(count), np.roll(np.arange(count), -1)])


@pytest.mark.parametrize("seed", range(20))
def test_every_segment_is_an_edge(seed):
    rim, segments = star(30, seed)
    points = np.concatenate([rim, np.random.default_rng(seed + 99).uniform(-1, 1, (100, 2))])
    found = triangulated(points, segments)
    assert not found.blocked
    edges = np.stack([found.triangles, np.roll(found.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
    known = {(int(a), int(b)) for a, b in edges}
    assert {(int(a), int(b)) for a, b in segments} <= known
    framed = np.concatenate([points, np.full((12, 2), np.nan)])
    a, b, c = np.moveaxis(framed[found.triangles], 1, 0)
    area = 0.5 * ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    assert np.nanmin(area) > 0.0
    within = inside(found.triangles, len(framed), found.edges, np.empty((0, 2), dtype=np.int64))
    x, y = rim.T
    # The shoelace formula; rounding of a hundred products near one.
    shoelace = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
    assert area[within].sum() == pytest.approx(shoelace, abs=1e-13)


def test_segments_through_points_and_across_each_other():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij"), axis=-1).reshape(-1, 2)
    found = triangulated(grid, np.array([[0, 24]]))
    # The diagonal of the grid goes through three points.
    assert [tuple(edge) for edge in found.edges.tolist()] == [(0, 6), (6, 12), (12, 18), (18, 24)]
    assert found.owner.tolist() == [0, 0, 0, 0] and found.blocked == []
    across = triangulated(grid, np.array([[0, 23], [20, 3]]))
    assert set(across.blocked) == {0, 1}
    # One that gives way is not reported.
    assert triangulated(grid, np.array([[0, 23], [20, 3]]), [1]).blocked == []
