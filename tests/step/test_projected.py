"""Edges beside their surfaces: faces end at the surfaces' intersection, or at what of the edge is nearest to each."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
from scipy.spatial import cKDTree

import assembly as asm
from assembly.step import trims
from assembly.step.bodies import read_shape
from assembly.step.carriers import spline_curve
from assembly.step.crossings import crossings
from assembly.step.edge_feet import distance_across, fill_surface_points, move_between, move_to_feet
from assembly.step.occt import quiet, settings
from assembly.step.profiles import approximated, point, values_of
from assembly.step.projected import Side, is_loose, points_of, projected, space_of
from assembly.step.surfaces import patch
from tests.step.models import MODELS, O, cylinder, edges, faces, parts, without

# What an edge is off in these tests, of parts of size 5.
OFF = 2e-3


def waved(t, curve, low, high, off):
    """Points beside a curve: outward by 0.4 of two waves, and up by half of them; at its ends on it."""
    points = np.array([point(curve.Value(x)) for x in t.tolist()])
    wave = off * np.sin(2.0 * pi * (t - low) / (high - low)) ** 2
    return points + wave[:, None] * (0.2 * points * [1.0, 1.0, 0.0] + [0.0, 0.0, 0.5])


def spoiled(shape, off=OFF):
    """A shape whose edges between a plane and another face are off both in space, by waves along their way."""
    build = O.BRep_Builder()
    for face in faces(shape):
        if not isinstance(O.BRep_Tool.Surface_s(face), O.Geom_Plane):
            continue
        for edge in parts(face, O.TopAbs_EDGE):
            edge = O.as_edge(edge)
            curve = O.BRep_Tool.Curve_s(edge, 0.0, 0.0)
            low, high = O.BRep_Tool.Range_s(edge)
            if isinstance(curve, O.Geom_Line):
                continue
            at = np.linspace(low, high, 9)
            made, _ = approximated(lambda t, given=(curve, low, high): waved(t, *given, off), at, 1e-9)
            fitted = spline_curve(*made.cartesian, made.knots, made.degree)
            build.UpdateEdge(edge, fitted, 2.0 * off)
            build.Range(edge, low, high, True)
    return shape


def volume(shape):
    made = read_shape(shape, lambda _: (None, None), None, 1.0)
    assert not made.missing
    return sum(face.volume_integral() for face in made.faces)


def test_faces_end_where_their_surfaces_cross():
    # A ring cut out of a cylinder: 4 edges of a plane and a cylinder.
    def ring():
        return without(cylinder(2.0, 5.0), cylinder(1.0, 5.0))

    exact = 15.0 * pi
    assert volume(ring()) == pytest.approx(exact, rel=1e-13)
    shape = spoiled(ring())
    assert sum(is_loose(O.as_edge(edge)) for edge in edges(shape)) == 8  # four, each at two faces
    # Waves of 2e-3 along edges of 19 mm would change it by some 1e-3; what is left is how curves are followed.
    assert volume(shape) == pytest.approx(exact, rel=1e-10)


def test_edges_of_one_surface_alone_end_at_its_nearest_points():
    shape = spoiled(cylinder(2.0, 5.0))
    checked = 0
    for face in faces(shape):
        surface = O.BRep_Tool.Surface_s(face)
        where = patch(surface, O.BRepTools.UVBounds_s(face))
        for edge in map(O.as_edge, parts(face, O.TopAbs_EDGE)):
            if not is_loose(edge):
                continue
            low, high = O.BRep_Tool.Range_s(edge)
            flat = O.BRep_Tool.CurveOnSurface_s(edge, face, low, high)
            curve, deviation = projected(space_of(edge), Side(flat, where, low, high), None, low, high)
            assert deviation < 1e-9
            points, _ = curve.cartesian
            assert points.shape[1] == 2
            made = asm.NurbsCurve(points, curve.knots, curve.degree, curve.cartesian[1])
            space = O.BRep_Tool.Curve_s(edge, 0.0, 0.0)
            for t in np.linspace(low, high, 41)[1:-1].tolist():
                u, v = made.evaluate(t)
                wanted = space.Value(t)
                wanted = np.array([wanted.X(), wanted.Y(), wanted.Z()])
                (a, b) = where.surface.domain[0]
                s, su, sv = where.surface.evaluate(a + np.mod(u - a, b - a) if where.surface.closed[0] else u, v, 1)
                # The foot of a point: what is between is along the normal, up to the interpolation.
                for slope in (su, sv):
                    assert abs((wanted - s) @ slope) < 1e-8 * np.linalg.norm(slope)
                checked += 1
    assert checked > 100


@pytest.mark.parametrize("name", ["boss", "box", "frustum", "rounded box", "ring of a torus", "vase"])
def test_edges_that_are_followed_well_are_not_looked_at(name, monkeypatch):
    monkeypatch.setattr(trims, "projected", lambda *_: pytest.fail("an edge was projected"))
    made = read_shape(MODELS[name](), lambda _: (None, None), None, 1.0)
    assert made.faces and not made.missing


@pytest.mark.parametrize("name", MODELS)
def test_points_of_curves_are_occt_s(name):
    shape = MODELS[name]()
    for face in faces(shape):
        for edge in map(O.as_edge, parts(face, O.TopAbs_EDGE)):
            if O.BRep_Tool.Degenerated_s(edge):
                continue
            low, high = O.BRep_Tool.Range_s(edge)
            for curve in (O.BRep_Tool.Curve_s(edge, 0.0, 0.0), O.BRep_Tool.CurveOnSurface_s(edge, face, low, high)):
                at = np.linspace(low, high, 23)
                wanted = np.array([point(curve.Value(x)) for x in at.tolist()])
                # Two formulas for the same points, their ends included.
                np.testing.assert_allclose(
                    points_of(curve, low, high)(at), wanted, rtol=0, atol=3e-14 * (1.0 + abs(wanted).max())
                )


def test_distances_across_a_curve_are_those_in_space():
    # Beside a helix on a cylinder, along it by 1e-4 and across it by 1e-5 times a wave.
    surface, t = asm.shapes.cylinder(2.0, 6.0), np.linspace(0.0, 1.0, 19) ** 1.1
    (u0, u1), (v0, v1) = surface.domain
    given = np.column_stack([u0 + 0.6 * (u1 - u0) * t, v0 + (0.2 + 0.5 * t) * (v1 - v0)])
    ground = (*surface._tables, surface.size)
    s, su, sv = surface.evaluate(given[:, 0], given[:, 1], 1)
    points = np.empty_like(s)
    fill_surface_points(ground, given, points)
    np.testing.assert_array_equal(points, s)
    slopes = np.gradient(given, t, axis=0)
    along = su * slopes[:, :1] + sv * slopes[:, 1:]
    along /= np.linalg.norm(along, axis=1)[:, None]
    off = 1e-4 * along + 1e-5 * np.sin(9.0 * t)[:, None] * np.cross(np.cross(su, sv), along)
    there = given + np.array(
        [np.linalg.lstsq(np.column_stack(ways), way, rcond=None)[0] for *ways, way in zip(su, sv, off, strict=True)]
    )
    across = off - (off * along).sum(axis=1)[:, None] * along
    wanted = np.linalg.norm(across, axis=1).max()
    assert distance_across(ground, t, given, there) == pytest.approx(wanted, rel=1e-9)
    assert distance_across(ground, t, given, given) == 0.0


def test_points_are_moved_the_same_whichever_they_are_with():
    # A cylinder of radius 2 and a plane across it, 5e-3 and 3e-3 beside which points begin.
    rng = np.random.default_rng(3)
    turned, flat = asm.shapes.cylinder(2.0, 6.0), asm.shapes.plane(9.0, 9.0)
    turn = np.array([[0.8, 0.0, 0.6], [0.0, 1.0, 0.0], [-0.6, 0.0, 0.8]])
    tilt = asm.NurbsSurface(flat.control_points @ turn, flat.knots, (1, 1))
    grounds = [(*surface._tables, surface.size) for surface in (turned, tilt)]
    angles = rng.uniform(0.0, 2.0 * pi, 40)
    ring = np.column_stack([2.0 * np.cos(angles), 2.0 * np.sin(angles)])
    normal = np.cross(*(np.diff(tilt.control_points, axis=k).reshape(2, 3)[0] for k in (0, 1)))
    normal /= np.linalg.norm(normal)
    height = -(ring @ normal[:2]) / normal[2]
    points = np.column_stack([ring, height]) + rng.uniform(-5e-3, 5e-3, (40, 3))
    places = np.empty((40, 4))
    for k, x in enumerate(points):
        for surface, at in ((turned, slice(0, 2)), (tilt, slice(2, 4))):
            lines = [np.linspace(*ends, 60) for ends in surface.domain]
            near = np.linalg.norm(surface.evaluate(lines[0][:, None], lines[1]) - x, axis=2)
            i, j = divmod(int(near.argmin()), 60)
            places[k, at] = lines[0][i], lines[1][j]
    moved = points.copy()
    move_between(*grounds, moved, places)
    # On both, at the nearest such point to first order: the way there has no part along the intersection.
    assert np.abs(np.hypot(moved[:, 0], moved[:, 1]) - 2.0).max() < 1e-13
    assert np.abs(moved @ normal).max() < 1e-13
    outward = moved * [1.0, 1.0, 0.0] / 2.0
    along = np.cross(outward, normal)
    assert np.abs(np.einsum("ij,ij->i", moved - points, along)).max() < 1e-4
    one = points[7:8].copy()
    move_between(*grounds, one, places[7:8].copy())
    assert one.tobytes() == moved[7:8].tobytes()
    feet = np.ascontiguousarray(places[:, :2])
    assert move_to_feet(grounds[0], moved, feet)
    assert np.abs(turned.evaluate(*feet.T) - moved).max() < 1e-12


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("distance", [1e-6, 1e-4, 1e-2])
def test_feet_are_found_beside_poles(distance, turned):
    """From places on the other side of a pole as well, where a step in (u, v) alone goes far astray."""
    rng = np.random.default_rng(5)
    for made in (asm.shapes.sphere(2.0), asm.shapes.cone(2.0, 3.0), asm.shapes.ellipsoid(3.0, 2.0, 2.5)):
        surface = made.transposed() if turned else made
        axis = 0 if turned else 1
        ends = made.domain[1]
        places = np.column_stack([rng.uniform(*made.domain[0], 60), ends[1] - distance * rng.uniform(0.3, 3.0, 60)])
        wanted = made.evaluate(*places.T)
        starts = np.column_stack([rng.uniform(*made.domain[0], 60), ends[1] - distance * rng.uniform(0.3, 3.0, 60)])
        feet = np.ascontiguousarray(starts[:, ::-1] if turned else starts)
        assert move_to_feet((*surface._tables, surface.size), wanted, feet)
        assert np.abs(surface.evaluate(*feet.T) - wanted).max() < 1e-13
        # Around by less than half a turn, and not through the pole.
        assert (feet[:, axis] < ends[1]).all()
        assert (
            np.abs(feet - (starts[:, ::-1] if turned else starts))[:, 1 - axis].max() <= 0.5 * made._periods[0] + 1e-9
        )


def test_what_begins_at_a_pole_keeps_its_direction():
    surface = asm.shapes.sphere(2.0)
    top = surface.domain[1][1]
    feet = np.array([[1.2, top], [3.4, top - 1e-15]])
    assert move_to_feet((*surface._tables, surface.size), np.array([[1e-13, 2e-13, 2.0], [0.0, 0.0, 2.0]]), feet)
    np.testing.assert_array_equal(feet[:, 0], [1.2, 3.4])


def test_where_surfaces_are_tangent_points_stay():
    turned, flat = asm.shapes.cylinder(2.0, 6.0), asm.shapes.plane(9.0, 9.0)
    beside = asm.NurbsSurface(flat.control_points[..., [2, 1, 0]] + [2.0, 0.0, 0.0], flat.knots, (1, 1))
    points = np.array([[2.0 + 1e-3, 0.0, 0.4], [2.0 - 1e-3, 0.0, -0.3]])
    before = points.copy()
    grounds = [(*surface._tables, surface.size) for surface in (turned, beside)]
    places = np.empty((2, 4))
    for surface, at in ((turned, slice(0, 2)), (beside, slice(2, 4))):
        lines = [np.linspace(*ends, 241) for ends in surface.domain]
        for k, x in enumerate(points):
            near = np.linalg.norm(surface.evaluate(lines[0][:, None], lines[1]) - x, axis=2)
            i, j = divmod(int(near.argmin()), 241)
            places[k, at] = lines[0][i], lines[1][j]
    move_between(*grounds, points, places)
    assert np.array_equal(points, before)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_all_crossings_are_found_at_once(scale):
    at = scale * np.linspace(0.0, 7.0, 40)
    calls = []

    def wave(t):
        calls.append(t.size)
        return np.column_stack([np.sin(t / scale), np.expm1(t / scale - 3.0)])

    found = np.sort(crossings(wave(at), at, wave, [np.array([0.5, 2.0]), np.array([0.0, -1.0])]) / scale)
    asked = np.sort([pi / 6, 5 * pi / 6, 13 * pi / 6, 3.0])
    assert np.abs(found - asked).max() < 2e-15 * 7.0 + 1e-15 / scale
    # The samples, and few places for each of four roots.
    assert len(calls) < 14 and sum(calls[1:]) < 50
    # What is a value at a sample is there.
    level = crossings(at[:, None], at, lambda t: t[:, None], [at[[3, 9]]])
    assert np.array_equal(np.sort(level), at[[3, 9]])


@pytest.mark.parametrize("off", [0.1, 0.01])
def test_curves_that_occt_makes_beside_poles(tmp_path, off):
    # Without curves on surfaces in the file OCCT makes them, and tells 1e-7 of what is off by some 3e-2 near a pole.
    ball = O.BRepPrimAPI_MakeSphere(O.gp_Pnt(0.0, 0.0, 0.0), 5.0).Shape()
    other = O.BRepPrimAPI_MakeSphere(O.gp_Pnt(2.0 + off, 0.0, 5.0), 2.0).Shape()
    path = tmp_path / "ball.step"
    with quiet(), settings({"write.surfacecurve.mode": 0}):
        writer = O.STEPControl_Writer()
        writer.Transfer(O.BRepAlgoAPI_Cut(ball, other).Shape(), O.STEPControl_AsIs)
        writer.Write(str(path))
    (body,) = asm.read_step(path)
    sides = {}
    for face in body.faces:
        for curve in face.face.boundary:
            t = np.linspace(*curve.domain, 4001)
            sides.setdefault(curve.name, []).append(face.face.surface.evaluate(*curve.evaluate(t).T))
    shared = [pair for pair in sides.values() if len(pair) == 2]
    assert len(shared) == 2
    for one, two in shared:
        # As far as one is from the chords of the other.
        assert cKDTree(two).query(one[::40])[0].max() < 1e-3
    # Two caps with the circle where the spheres cross in common.
    apart = float(np.hypot(2.0 + off, 5.0))
    across = (apart**2 + 25.0 - 4.0) / (2.0 * apart)
    caps = [pi / 3.0 * h**2 * (3.0 * r - h) for h, r in ((5.0 - across, 5.0), (2.0 - (apart - across), 2.0))]
    assert body.volume == pytest.approx(4.0 / 3.0 * pi * 125.0 - sum(caps), rel=1e-9)


def test_points_of_hyperbolas_are_those_of_occt():
    """In space and in the plane, without asking OCCT for each."""
    t = np.linspace(-1.5, 2.0, 30)
    axes = O.gp_Ax2(O.gp_Pnt(1.0, 2.0, 3.0), O.gp_Dir(0.3, -0.4, 0.8), O.gp_Dir(1.0, 2.0, 0.2))
    flat = O.gp_Ax2d(O.gp_Pnt2d(1.0, -2.0), O.gp_Dir2d(0.6, 0.8))
    for curve in (O.Geom_Hyperbola(axes, 4.0, 1.5), O.Geom2d_Hyperbola(flat, 4.0, 1.5, False)):
        wanted = np.array([point(curve.Value(x)) for x in t.tolist()])
        assert np.abs(values_of(curve)(t) - wanted).max() < 1e-14 * np.abs(wanted).max()
