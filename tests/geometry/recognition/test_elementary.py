"""What surfaces are recognized as: by makers, by nets that are built here and rewritten, by near misses.

Deviations are held against dense samples: a bound that is too small fails there. Radii and axes come from points that
are off by their rounding alone, so that they are told to that, times what a short arc or a large radius costs.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly import NurbsSurface
from assembly.errors import InputError
from assembly.geometry.recognition.elementary import elementary_form, is_plane
from assembly.geometry.recognition.forms import (
    Cone,
    Cylinder,
    Extrusion,
    Freeform,
    Plane,
    Revolution,
    Sphere,
    Torus,
)
from assembly.geometry.recognition.nets import exactness
from assembly.geometry.splines.bezier import bernstein, elevation
from tests.geometry.recognition.constructions import (
    Placement,
    circle_profile,
    distances,
    line,
    revolved,
    rewritten,
    samples,
)

SHAPES = asm.shapes
# Evaluation by power tables, in parts of the largest coordinate.
EVALUATED = 1e-14


def random_angle(rng):
    return float(rng.uniform(0.1, 2.0 * np.pi))


def spans_of(angle):
    return int(np.ceil(angle / 2.0))


def random_surface(kind, rng):
    """A surface of a kind about the z axis, and the numbers that it is told by."""
    angle = random_angle(rng) if rng.random() < 0.7 else 2.0 * np.pi
    spans = spans_of(angle) + int(rng.integers(2))
    if kind == "plane":
        corners = rng.standard_normal((3, 3))
        net = corners[0] + np.multiply.outer([0.0, 1.0], corners[1])[:, None] + np.multiply.outer([0, 1], corners[2])
        return NurbsSurface(net, ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1)), ()
    if kind == "cylinder":
        r = 10.0 ** rng.uniform(-3.0, 1.0)
        return revolved(*line((r, -0.3), (r, 0.7)), angle, spans), (r,)
    if kind == "cone":
        half, low = rng.uniform(0.05, 1.5), rng.uniform(0.0, 2.0) * (rng.random() < 0.7)
        s, c = np.sin(half), np.cos(half)
        return revolved(*line((low * s, low * c), ((low + 1.0) * s, (low + 1.0) * c)), angle, spans), (half,)
    start = rng.uniform(-0.5 * np.pi, 0.3)
    wide = rng.uniform(0.2, 0.5 * np.pi - start)
    if kind == "sphere":
        # Ends on the axis are poles to the bit, as makers make them.
        profile, knots, degree = circle_profile((0.0, 0.0), 1.0, start, wide, 2)
        return revolved(profile, knots, degree, angle, spans), (1.0,)
    minor = rng.uniform(0.01, 0.95)
    profile, knots, degree = circle_profile((1.0, 0.0), minor, rng.uniform(0.0, 6.0), random_angle(rng), 4)
    return revolved(profile, knots, degree, angle, spans), (1.0, minor)


KINDS = {"plane": Plane, "cylinder": Cylinder, "cone": Cone, "sphere": Sphere, "torus": Torus}


def check(form, kind, numbers, where, size, far):
    """A form is that of the kind, about the z axis at a placement, to what coordinates tell."""
    slack = 1e-9 * size + 1e-11 * far
    if kind == "plane":
        return
    told = {"cylinder": ("radius",), "cone": ("half_angle",), "sphere": ("radius",), "torus": ("major", "minor")}[kind]
    for name, number in zip(told, numbers, strict=True):
        scale = 1.0 if name == "half_angle" else where.scale
        assert getattr(form, name) == pytest.approx(scale * number, abs=slack / (size if scale == 1.0 else 1.0))
    if kind == "sphere":
        np.testing.assert_allclose(form.center, where.point([0, 0, 0]), atol=slack)
        return
    assert np.linalg.norm(np.cross(form.axis, where.direction([0, 0, 1]))) <= slack / size
    origin = {"cylinder": "point", "cone": "apex", "torus": "center"}[kind]
    off = getattr(form, origin) - where.point([0, 0, 0])
    if kind == "cylinder":
        off -= (off @ form.axis) * form.axis
    assert np.linalg.norm(off) <= slack * (30.0 if kind == "cone" else 1.0)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("far", [0.0, 1.0, 1e3])
def test_what_is_built_is_recognized(kind, far, cases):
    rng = np.random.default_rng([int(far), list(KINDS).index(kind)])
    for _ in range(cases(25, 1000)):
        surface, numbers = random_surface(kind, rng)
        where = Placement(rng, surface.size, far)
        surface = where.surface(rewritten(surface, rng))
        form = elementary_form(surface)
        assert type(form) is KINDS[kind]
        largest = np.abs(surface.control_points).max()
        assert form.deviation <= 2.0 * exactness(surface.size, largest)
        points = samples(surface)
        assert distances(form, points).max() <= form.deviation + EVALUATED * largest
        check(form, kind, numbers, where, surface.size, largest)
        check_sides(form, surface)


def check_sides(form, surface):
    """`outward`, or the normal of a plane, is the side of S_u x S_v."""
    (u0, u1), (v0, v1) = surface.domain
    u, v = u0 + np.array([0.3, 0.6]) * (u1 - u0), v0 + np.array([0.4, 0.7]) * (v1 - v0)
    points, normals = surface.evaluate(u, v), surface.normal(u, v)
    if isinstance(form, Plane):
        assert (normals @ form.normal > 0.999).all()
        return
    if isinstance(form, Sphere):
        away = points - form.center
    else:
        origin = form.point if isinstance(form, Cylinder) else form.apex if isinstance(form, Cone) else form.center
        off = points - origin
        away = off - (off @ form.axis)[:, None] * form.axis
        if isinstance(form, Torus):
            away = off - form.major * away / np.linalg.norm(away, axis=1)[:, None]
    assert (((away * normals).sum(axis=1) > 0.0) == form.outward).all()


@pytest.mark.parametrize("exponent", range(-3, 4))
def test_radii_of_a_thousandth_to_a_thousand_sizes(exponent):
    """The surface has about the size one; a larger radius leaves less of a turn."""
    radius = 10.0**exponent
    angle = min(2.0 * np.pi, 1.0 / radius)
    spans = spans_of(angle)
    made = {
        "cylinder": revolved(*line((radius, 0.0), (radius, 1.0)), angle, spans),
        "cone": revolved(*line((radius, 0.0), (radius + 0.5, 1.0)), angle, spans),
    }
    tube = circle_profile((2.0 * radius, 0.0), radius, 0.2, min(angle, 1.5), spans)
    made["torus"] = revolved(*tube, 0.5 * angle, spans)
    made["slice of a ring"] = revolved(*circle_profile((radius + 1.0, 0.0), 0.9, 0.2, 3.0, 2), angle, spans)
    if exponent >= 0:
        ball = circle_profile((0.0, 0.0), radius, -0.5 * angle, min(angle, 1.5), spans)
        made["sphere"] = revolved(*ball, angle, spans)
    rng = np.random.default_rng(exponent + 3)
    for name, surface in made.items():
        surface = Placement(rng, 1.0, 0.5).surface(surface)
        form = elementary_form(surface)
        assert type(form) is KINDS.get(name, Torus), name
        largest = np.abs(surface.control_points).max()
        # Samples are measured from centers that far away.
        rounding = EVALUATED * (largest + radius * surface.size)
        assert distances(form, samples(surface)).max() <= form.deviation + rounding
        assert form.deviation < 2.0 * exactness(surface.size, largest)


def test_makers_of_the_library():
    made = {
        "plane": (SHAPES.plane(2.0, 1.0), Plane),
        "sphere": (SHAPES.sphere(0.3), Sphere),
        "cylinder": (SHAPES.cylinder(0.3, 2.0), Cylinder),
        "cone": (SHAPES.cone(0.3, 2.0), Cone),
        "frustum": (SHAPES.cone(0.3, 2.0, 0.5), Cone),
        "frustum of one radius": (SHAPES.cone(0.3, 2.0, 0.3), Cylinder),
        "torus": (SHAPES.torus(1.0, 0.3), Torus),
        "ellipsoid about z": (SHAPES.ellipsoid(1.0, 1.0, 0.7), Revolution),
        "ball as an ellipsoid": (SHAPES.ellipsoid(0.7, 0.7, 0.7), Sphere),
        "ellipsoid": (SHAPES.ellipsoid(1.0, 0.9, 0.7), Freeform),
        "wire": (SHAPES.paper_clip(), Freeform),
    }
    for name, (surface, kind) in made.items():
        assert type(elementary_form(surface)) is kind, name
    for face in SHAPES.box(1.0, 2.0, 3.0):
        form = elementary_form(face.surface)
        assert isinstance(form, Plane)
        np.testing.assert_allclose(form.normal, face.surface.normal(0.1, 0.1), atol=1e-15)
    kinds = {type(elementary_form(face.surface)) for face in SHAPES.solid_cylinder(1.0, 2.0)}
    assert kinds == {Plane, Cylinder}


def free_curve(rng, n):
    return rng.standard_normal((n, 3)), bezier_knots(n)


def bezier_knots(n):
    return np.repeat([0.0, 1.0], n)


def swept_line(rng):
    points, knots = free_curve(rng, 5)
    weights = rng.uniform(0.5, 2.0, 5)
    net = points[:, None] + np.multiply.outer([0.0, 1.0], rng.standard_normal(3))
    return NurbsSurface(net, (knots, [0, 0, 1, 1]), (4, 1), np.column_stack([weights, weights]))


def turned_curve(rng, angle=None):
    profile = np.column_stack([rng.uniform(0.5, 2.0, 4), rng.uniform(-1.0, 1.0, 4), rng.uniform(0.5, 2.0, 4)])
    angle = random_angle(rng) if angle is None else angle
    return revolved(profile, bezier_knots(4), 3, angle, spans_of(angle))


def check_sweep(form, surface):
    """Points of one line, or of one ring, are apart by no more than the deviation on either side."""
    u, v = (np.linspace(*ends, 15) for ends in surface.domain)
    grid = surface.evaluate(u[:, None], v[None, :])
    if isinstance(form, Extrusion):
        lines = grid if form.along == 1 else grid.swapaxes(0, 1)
        off = lines - lines[:, :1]
        off -= (off @ form.direction)[..., None] * form.direction
        apart = np.linalg.norm(off, axis=-1).max()
    else:
        rings = (grid if form.around == 0 else grid.swapaxes(0, 1)) - form.point
        z = rings @ form.axis
        rho = np.linalg.norm(rings - z[..., None] * form.axis, axis=-1)
        apart = max(np.ptp(z, axis=0).max(), np.ptp(rho, axis=0).max())
    assert apart <= 2.0 * form.deviation + 2.0 * EVALUATED * np.abs(surface.control_points).max()


@pytest.mark.parametrize("far", [0.0, 1.0, 1e3])
def test_what_is_swept(far, cases):
    rng = np.random.default_rng(int(far))
    for _ in range(cases(20, 500)):
        surface = swept_line(rng)
        way = surface.control_points[0, 1] - surface.control_points[0, 0]
        where = Placement(rng, surface.size, far)
        moved = where.surface(rewritten(surface, rng))
        form = elementary_form(moved)
        assert isinstance(form, Extrusion)
        slack = 1e-11 + 1e-12 * far
        assert np.linalg.norm(np.cross(form.direction, where.direction(way / np.linalg.norm(way)))) < slack
        check_sweep(form, moved)

        surface = turned_curve(rng)
        where = Placement(rng, surface.size, far)
        moved = where.surface(rewritten(surface, rng))
        form = elementary_form(moved)
        assert isinstance(form, Revolution)
        assert np.linalg.norm(np.cross(form.axis, where.direction([0, 0, 1]))) < 1e-9 + 1e-10 * far
        check_sweep(form, moved)


@pytest.mark.parametrize("change", [1e-3, 1e-6, 1e-9])
def test_what_is_nearly_swept(change, cases):
    """Rings that are ellipses or wavy, all alike, rings that are not level, and lines of which one is not parallel."""
    rng = np.random.default_rng(8)
    for _ in range(cases(10, 300)):
        turned, swept = turned_curve(rng), swept_line(rng)
        wide, sheared = np.diag([1.0 + change, 1.0, 1.0]), np.eye(3)
        sheared[2, 0] = change
        points = swept.control_points.copy()
        points[2, 1] += change * rng.standard_normal(3)
        near = [
            (swept, points),
            (turned, turned.control_points @ wide),
            (turned, turned.control_points @ sheared.T),
        ]
        # Waves by cos(2 phi), which no other axis takes up.
        whole = turned_curve(rng, 2.0 * np.pi)
        wave = change * np.cos(np.pi * np.arange(len(whole.control_points)) / 2.0)[:, None]
        wavy, uneven = whole.control_points.copy(), whole.control_points.copy()
        wavy[..., 2] += wave
        uneven[..., :2] *= 1.0 + wave[..., None]
        near += [(whole, wavy), (whole, uneven)]
        for surface, net in near:
            other = NurbsSurface(net, surface.knots, surface.degree, surface.weights)
            assert isinstance(elementary_form(other), Freeform)
            form = elementary_form(other, 100.0 * change * other.size)
            if isinstance(form, (Extrusion, Revolution)):
                check_sweep(form, other)


def test_near_misses(cases):
    rng = np.random.default_rng(7)
    for _ in range(cases(40, 2000)):
        kind = list(KINDS)[int(rng.integers(len(KINDS)))]
        surface = rewritten(random_surface(kind, rng)[0], rng)
        i, j = (int(rng.integers(n)) for n in surface.control_points.shape[:2])
        points = surface.control_points.copy()
        way = rng.standard_normal(3)
        points[i, j] += 1e-6 * surface.size * way / np.linalg.norm(way)
        near = NurbsSurface(points, surface.knots, surface.degree, surface.weights)
        form = elementary_form(near)
        if isinstance(form, Freeform):
            continue
        # A point that was moved within the surface, along a line of it say, may leave it what it was.
        assert not isinstance(form, (Extrusion, Revolution))
        assert distances(form, samples(near)).max() <= form.deviation + EVALUATED * np.abs(points).max()
        assert form.deviation < 2e-12 * near.size + 1e-13


@pytest.mark.parametrize("change", [1e-3, 1e-6, 1e-9])
def test_what_is_nearly_one_is_another(change):
    def scaled(surface, factors):
        return NurbsSurface(surface.control_points * factors, surface.knots, surface.degree, surface.weights)

    more = 1.0 + change
    assert isinstance(elementary_form(scaled(SHAPES.cylinder(0.3, 1.0), [more, 1, 1])), Extrusion)
    assert isinstance(elementary_form(scaled(SHAPES.sphere(0.3), [1, 1, more])), Revolution)
    assert isinstance(elementary_form(scaled(SHAPES.torus(0.3, 0.1), [1, 1, more])), Revolution)
    for surface in (SHAPES.sphere(0.3), SHAPES.torus(0.3, 0.1), SHAPES.cone(0.3, 1.0), SHAPES.cone(1, 1, 0.7)):
        assert isinstance(elementary_form(scaled(surface, [more, 1, 1])), Freeform)
    assert isinstance(elementary_form(SHAPES.cone(1.0, 2.0, more)), Cone)
    bent = SHAPES.plane(1.0, 1.0).control_points.copy()
    bent[1, 1, 2] = change
    assert isinstance(elementary_form(NurbsSurface(bent, ([0, 0, 1, 1], [0, 0, 1, 1]), (1, 1))), Freeform)


@pytest.mark.parametrize("kind", KINDS)
def test_a_tolerance_and_its_bound(kind, cases):
    """A surface that is off by some 1e-7 is one within 1e-4, and the bound is neither too small nor a multiple."""
    rng = np.random.default_rng(11)
    for _ in range(cases(10, 300)):
        surface = rewritten(random_surface(kind, rng)[0], rng)
        noise = rng.uniform(-1e-7, 1e-7, surface.control_points.shape) * surface.size
        near = NurbsSurface(surface.control_points + noise, surface.knots, surface.degree, surface.weights)
        form = elementary_form(near, 1e-4 * surface.size)
        # What is narrow may be a plane to within so much, or another of these.
        assert not isinstance(form, Freeform)
        if not isinstance(form, (Extrusion, Revolution)):
            off = distances(form, samples(near)).max()
            assert off <= form.deviation <= 1e-4 * surface.size * (1.0 + 1e-9)
        if type(form) is KINDS[kind]:
            assert form.deviation <= 1e-4 * surface.size
        assert isinstance(elementary_form(near), Freeform) or kind == "plane"


def test_turns_and_heights(cases):
    rng = np.random.default_rng(3)
    for _ in range(cases(20, 500)):
        angle, half = random_angle(rng), rng.uniform(0.2, 1.2)
        spans = spans_of(angle)
        low = rng.uniform(0.1, 1.0)
        ends = ((low * np.tan(half), low), ((low + 1) * np.tan(half), low + 1))
        where = Placement(rng, 1.0, 1.0)
        cone = elementary_form(where.surface(rewritten(revolved(*line(*ends), angle, spans), rng)))
        assert cone.heights == pytest.approx((where.scale * low, where.scale * (low + 1)), rel=1e-9)
        wall = elementary_form(where.surface(rewritten(revolved(*line((1, 0), (1, 3)), angle, spans), rng)))
        assert wall.heights == pytest.approx((-1.5 * where.scale, 1.5 * where.scale), rel=1e-9)
        np.testing.assert_allclose(wall.point, where.point([0, 0, 1.5]), atol=1e-9 * where.scale)
        profile = circle_profile((3.0, 0.0), 0.7, rng.uniform(0.0, 6.0), random_angle(rng), 4)
        tube = elementary_form(where.surface(rewritten(revolved(*profile, angle, spans), rng)))
        for form in (cone, wall, tube):
            assert form.turn.angle == pytest.approx(angle, abs=1e-9)
            begin = 0.0 if form.axis @ where.direction([0, 0, 1]) > 0.0 else angle
            np.testing.assert_allclose(form.turn.start, where.direction([np.cos(begin), np.sin(begin), 0]), atol=1e-9)
    assert elementary_form(SHAPES.cylinder(1.0, 1.0)).turn.angle == 2.0 * np.pi
    assert elementary_form(SHAPES.cone(1.0, 1.0)).turn.angle == 2.0 * np.pi


def test_one_piece_that_goes_around_by_almost_half():
    surface = revolved(*line((1.0, 0.0), (1.0, 1.0)), 0.999 * np.pi, 1)
    form = elementary_form(surface)
    assert isinstance(form, Cylinder) and form.turn.angle == pytest.approx(0.999 * np.pi, abs=1e-9)


def test_a_whole_turn_in_one_piece():
    """(c + i s) / w = (1 + i x)^4 / (1 + x^2)^2, x from -1 to 1, goes from -180 to 180 degrees."""
    x = np.polynomial.Polynomial([0.0, 1.0])
    parts = [1 - 6 * x**2 + x**4, 4 * x - 4 * x**3, (1 + x**2) ** 2]
    at = np.linspace(-1.0, 1.0, 5)
    quartic = np.linalg.solve(bernstein(4, 0.5 + 0.5 * at), np.column_stack([part(at) for part in parts]))
    # Of degree four two weights are zero.
    net = elevation(4, 5) @ quartic
    points = np.array([[[c / w, s / w, z] for z in (0.0, 2.0)] for c, s, w in net])
    surface = NurbsSurface(points, (bezier_knots(6), [0, 0, 1, 1]), (5, 1), np.column_stack([net[:, 2]] * 2))
    form = elementary_form(surface)
    assert isinstance(form, Cylinder) and form.turn.angle == 2.0 * np.pi
    assert form.radius == pytest.approx(1.0, abs=1e-14)


def test_other_ways_to_write_a_plane():
    disc = revolved(*line((0.0, 0.5), (1.0, 0.5)), 2.0 * np.pi, 4)
    form = elementary_form(disc)
    assert isinstance(form, Plane) and abs(form.normal[2]) == pytest.approx(1.0, abs=1e-15)
    rng = np.random.default_rng(5)
    net = rng.standard_normal((5, 6, 3)) * [1.0, 1.0, 0.0] + [0.0, 0.0, 2.0]
    form = elementary_form(NurbsSurface(net, (bezier_knots(5), bezier_knots(6)), (4, 5), rng.uniform(1, 2, (5, 6))))
    assert isinstance(form, Plane) and form.point[2] == pytest.approx(2.0, abs=1e-15)


def test_surfaces_that_are_hardly_any(cases):
    """Lines, points, edges that are one point, nets that fold back: an answer that its samples agree with, or none."""
    rng = np.random.default_rng(13)
    for _ in range(cases(200, 5000)):
        p, q = (int(n) for n in rng.integers(1, 4, 2))
        net = rng.integers(-1, 2, (p + 1, q + 1, 3)) * rng.choice([0.0, 1.0], 3) * 10.0 ** rng.integers(-30, 31)
        if rng.random() < 0.5:
            net[0] = net[0, 0]
        weights = rng.choice([0.5, 1.0, 2.0], net.shape[:2])
        surface = NurbsSurface(net, (bezier_knots(p + 1), bezier_knots(q + 1)), (p, q), weights)
        form = elementary_form(surface)
        if isinstance(form, (Plane, Cylinder, Cone, Sphere, Torus)):
            largest = np.abs(net).max()
            assert distances(form, samples(surface, 11)).max() <= form.deviation + EVALUATED * largest


def test_it_is_kept_with_the_surface():
    surface = SHAPES.torus(1.0, 0.2)
    assert elementary_form(surface) is elementary_form(surface)
    assert elementary_form(surface, 1e-3) is elementary_form(surface, 1e-3)
    assert elementary_form(surface, 1e-3) is not elementary_form(surface)
    with pytest.raises(ValueError):
        elementary_form(surface).center[0] = 1.0


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan, "much"])
def test_bad_tolerances(value):
    with pytest.raises((InputError, TypeError), match="tolerance is"):
        elementary_form(SHAPES.sphere(1.0), value)


def test_what_is_a_plane_is_told_without_the_rest(cases):
    rng = np.random.default_rng(17)
    told = {True: 0, False: 0}
    for _ in range(cases(60, 3000)):
        # A net of any degree that is flat but for some, on both sides of the tolerance.
        n, m = rng.integers(2, 6, 2)
        degree = int(rng.integers(1, n)), int(rng.integers(1, m))
        net = np.stack(np.meshgrid(np.arange(float(n)), np.arange(float(m)), indexing="ij"), axis=-1)
        net = np.concatenate([net + rng.uniform(-0.2, 0.2, net.shape), np.zeros((n, m, 1))], axis=2)
        net[..., 2] = 10.0 ** rng.uniform(-14.0, 0.0) * rng.uniform(-1.0, 1.0, (n, m))
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        net = net @ turn + rng.uniform(-5.0, 5.0, 3)
        knots = [
            np.concatenate([np.zeros(p), np.linspace(0.0, 1.0, k - p + 1), np.ones(p)])
            for k, p in zip((n, m), degree, strict=True)
        ]
        tolerance = 10.0 ** rng.uniform(-12.0, -2.0)
        first = NurbsSurface(net, knots, degree, rng.uniform(0.5, 2.0, (n, m)))
        again = NurbsSurface(net, knots, degree, first.weights)
        flat = isinstance(elementary_form(first, tolerance), Plane)
        assert is_plane(first, tolerance) == is_plane(again, tolerance) == is_plane(again, tolerance) == flat
        told[flat] += 1
    assert min(told.values()) > 5
