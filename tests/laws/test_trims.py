"""Laws of trims: sides by another winding number, nearest points and bounds by samples, gradients by differences."""

from __future__ import annotations

import numpy as np
import pytest

from assembly._record import rows_of
from assembly.geometry import shapes
from assembly.geometry.faces import trim_pieces as pieces
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim_nearest import nearest_points
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.derivative_bounds import derivative_bounds
from assembly.geometry.splines.surface import NurbsSurface
from tests.geometry.loops import blob, dense, polygon_winding, random_face, segment

PLANE = shapes.plane(10.0, 10.0)


def piece_rows(face):
    """Integers and doubles of a face's pieces."""
    table, pool = face.packed_trim()
    record = pieces.trim_at(table, 0)
    ints = table[record.piece_table :][: record.pieces * pieces.PIECE_INTS].reshape(-1, pieces.PIECE_INTS)
    doubles = pool[record.piece_pool :][: record.pieces * pieces.PIECE_DOUBLES].reshape(-1, pieces.PIECE_DOUBLES)
    return rows_of(pieces.PIECE_LINKS, ints), rows_of(pieces.PIECE_BOUNDS, doubles)


@pytest.mark.parametrize("seed", range(12))
def test_sides_are_those_of_another_winding_number(seed, cases):
    rng = np.random.default_rng(seed)
    face = random_face(rng, PLANE)
    u, v = rng.uniform(-4.9, 4.9, (2, cases(500, 3000)))
    winding = sum(polygon_winding(dense(curve), u, v) for curve in face.boundary)
    # A chord of these polygons is less than 0.005 from its arc.
    clear = np.abs(face.trim_distance(u, v)) > 0.005
    assert clear.mean() > 2900 / 3000
    np.testing.assert_array_equal(face.locate(u, v)[clear], np.where(winding == 1, 1, -1)[clear])


@pytest.mark.parametrize("seed", range(12))
def test_sides_and_distances_beside_the_curves(seed):
    rng = np.random.default_rng(seed)
    face = random_face(rng, PLANE)
    size = np.linalg.norm(np.ptp(np.concatenate([dense(curve) for curve in face.boundary]), axis=0))
    for curve in face.boundary:
        t = rng.uniform(*curve.domain, 200)
        point, slope = curve.evaluate(t, 1)
        assert (face.locate(*point.T) == 0).all()
        left = np.column_stack([-slope[:, 1], slope[:, 0]]) / np.linalg.norm(slope, axis=1)[:, None]
        off = 10.0 ** rng.uniform(-13, -6, 200)
        for sign in (1, -1):
            u, v = (point + sign * off[:, None] * left).T
            sides = face.locate(u, v)
            sure = np.abs(off - 1e-12 * size) > 0.01e-12 * size
            np.testing.assert_array_equal(sides[sure], np.where(off > 1e-12 * size, sign, 0)[sure])
            # Rounding of coordinates of a few units.
            np.testing.assert_allclose(face.trim_distance(u, v), sign * off, rtol=0, atol=5e-15)


@pytest.mark.parametrize("seed", range(8))
def test_no_sample_is_nearer_than_the_nearest_point(seed, cases):
    rng = np.random.default_rng(seed)
    face = random_face(rng, PLANE)
    u, v = rng.uniform(-5, 5, (2, cases(70, 400)))
    near = face.nearest_on_boundary(u, v)
    np.testing.assert_array_equal(np.sign(near.distance), face.locate(u, v))
    foot = np.array([face.boundary[k].evaluate(t) for k, t in zip(near.curve, near.t, strict=True)])
    np.testing.assert_allclose(foot, near.point, rtol=0, atol=5e-15)
    np.testing.assert_allclose(np.hypot(*(foot.T - [u, v])), np.abs(near.distance), rtol=0, atol=5e-15)
    samples = np.concatenate([dense(curve, 4000) for curve in face.boundary])
    least = np.min(np.hypot(samples[:, :1] - u, samples[:, 1:] - v), axis=0)
    assert (np.abs(near.distance) <= least + 5e-15).all()
    # Nor is it nearer than a curve whose samples are as close as these can be.
    assert (np.abs(near.distance) >= least - 0.02).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_normal_at_the_foot_is_the_gradient_of_the_distance(seed):
    rng = np.random.default_rng(seed)
    face = random_face(rng, PLANE)
    table, pool = face.packed_trim()
    points = rng.uniform(-4, 4, (300, 2))
    count = len(face.boundary)

    def distance(at):
        out = np.empty((len(at), 7))
        nearest_points(table, pool, 0, 0, count, at[:, 0].copy(), at[:, 1].copy(), out)
        return out

    here = distance(points)
    h = 1e-6
    ways = [
        (distance(points + [h, 0]), distance(points - [h, 0])),
        (distance(points + [0, h]), distance(points - [0, h])),
    ]
    gradient = np.column_stack([(a[:, 0] - b[:, 0]) / (2.0 * h) for a, b in ways])
    # Where the nearest curve changes between the points of a difference there is no gradient, nor where the
    # distance is of the order of the step: at a corner it bends there.
    same = np.all([np.abs(a[:, 2:3] - here[:, 2:3]) < 1e-3 for pair in ways for a in pair], axis=(0, 2))
    same &= np.all([a[:, 1] == here[:, 1] for pair in ways for a in pair], axis=0) & (np.abs(here[:, 0]) > 1e-2)
    assert same.sum() > 250
    np.testing.assert_allclose(gradient[same], here[same, 5:], rtol=0, atol=2e-7)
    np.testing.assert_allclose(np.linalg.norm(here[:, 5:], axis=1), 1.0, rtol=0, atol=1e-14)


@pytest.mark.parametrize("seed", range(12))
def test_pieces_run_one_way_within_their_bounds(seed):
    rng = np.random.default_rng(seed)
    face = random_face(rng, PLANE)
    ints, doubles = piece_rows(face)
    for row, piece in zip(ints, doubles, strict=True):
        curve = face.boundary[row.curve]
        t0, t1 = piece.t0, piece.t1
        inner = t0 + (t1 - t0) * np.linspace(1e-9, 1.0 - 1e-9, 41)
        point, first, second = curve.evaluate(inner, 2)
        step = 1e-5 * (t1 - t0)
        third = (curve.evaluate(inner[1:-1] + step, 2)[2] - curve.evaluate(inner[1:-1] - step, 2)[2]) / (2.0 * step)
        # One way in u and v (to rounding), and the major coordinate is the one that moves more.
        signs = row.sign_u, row.sign_v
        assert (np.diff(point, axis=0) * signs >= -1e-15).all()
        major = row.major
        tiny = 1e-6 * np.linalg.norm(first, axis=1)
        assert (np.abs(first[:, major]) >= np.abs(first[:, 1 - major]) - tiny).all()
        low, high = piece.box[::2], piece.box[1::2]
        assert ((point >= low - 1e-15) & (point <= high + 1e-15)).all()
        for bound, values in zip((piece.bound_1, piece.bound_2, piece.bound_3), (first, second, third), strict=True):
            largest = np.linalg.norm(values, axis=1).max()
            # Differences of second derivatives round at this step to 1e-10 of the scale of the third.
            assert largest <= bound * (1.0 + 1e-9) + 1e-9 * np.linalg.norm(second, axis=1).max() / (t1 - t0)


def test_bounds_on_derivatives_of_surfaces_hold():
    rng = np.random.default_rng(0)
    knots = [0, 0, 0, 0, 0.4, 1, 1, 1, 1]
    for _ in range(10):
        points, weights = rng.normal(size=(5, 4, 3)), rng.uniform(0.5, 2.0, (5, 4))
        surface = NurbsSurface(points, (knots, [0, 0, 0, 1, 2, 2, 2]), (3, 2), weights)
        first, second, third = derivative_bounds(surface)
        angle = rng.uniform(0, 2 * np.pi, 200)
        c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
        u, v = rng.uniform(0.01, 0.99, 200), rng.uniform(0.02, 1.98, 200)
        _, su, sv, suu, suv, svv = surface.evaluate(u, v, 2)
        assert np.linalg.norm(c * su + s * sv, axis=1).max() <= first

        def along(h, u=u, v=v, c=c, s=s, surface=surface):
            suu, suv, svv = surface.evaluate(u + h * c[:, 0], v + h * s[:, 0], 2)[3:]
            return c * c * suu + 2.0 * c * s * suv + s * s * svv

        assert np.linalg.norm(c * c * suu + 2.0 * c * s * suv + s * s * svv, axis=1).max() <= second
        # Away from knots, where the third derivative jumps.
        smooth = (np.abs(u - 0.4) > 1e-4) & (np.abs(v - 1.0) > 1e-4)
        h = 1e-5
        assert np.linalg.norm((along(h) - along(-h))[smooth] / (2.0 * h), axis=1).max() <= third * (1.0 + 1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_no_sample_is_nearer_in_space(seed):
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(5.0), np.arange(5.0), indexing="ij")
    surface = NurbsSurface(
        np.stack([x, y, rng.normal(size=(5, 5))], axis=-1),
        ([0, 0, 0, 0, 2, 4, 4, 4, 4], [0, 0, 0, 0, 2, 4, 4, 4, 4]),
        (3, 3),
        rng.uniform(0.7, 1.4, (5, 5)),
    )
    face = Face(surface, blob(rng, (2.0, 2.0), 1.2), [blob(rng, (2.0, 2.0), 0.3)])
    u, v = rng.uniform(0, 4, (2, 60))
    distance = face.space_distance(u, v)
    np.testing.assert_array_equal(np.sign(distance), face.locate(u, v))
    samples = np.concatenate([surface.evaluate(*dense(curve, 4000).T) for curve in face.boundary])
    least = np.linalg.norm(samples[:, None] - surface.evaluate(u, v), axis=2).min(axis=0)
    assert (np.abs(distance) <= least + 1e-14).all()
    assert (np.abs(distance) >= least - 0.01).all()


def test_whole_periods_change_nothing():
    rng = np.random.default_rng(0)
    torus = shapes.torus(3.0, 1.0)
    (_, a), (_, b) = torus.domain
    loop = blob(rng, (0.3, 0.2), 1.0)
    u, v = rng.uniform(0, a, 500), rng.uniform(0, b, 500)
    base = Face(torus, None, [loop])
    for i, j in ((1, 0), (0, -2), (3, 5)):
        moved = NurbsCurve(loop.control_points + [i * a, j * b], loop.knots, loop.degree, loop.weights)
        face = Face(torus, None, [moved])
        np.testing.assert_array_equal(face.locate(u, v), base.locate(u - j * a, v + i * b))
        # Five periods away, coordinates of up to a hundred have been rounded.
        np.testing.assert_allclose(face.trim_distance(u, v), base.trim_distance(u, v), rtol=0, atol=1e-13)
    assert base.area() == pytest.approx(face.area(), rel=1e-12)
    ring = Face(torus, segment((0, 1), (a, 1)), [segment((a, 4), (0, 4))])
    drawn = Face(torus, segment((-5 * a, 1 + b), (-4 * a, 1 + b)), [segment((a, 4), (0, 4))])
    np.testing.assert_array_equal(ring.locate(u, v), drawn.locate(u, v))
