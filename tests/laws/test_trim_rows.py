"""Rows of trims against differences of re-solved rows, and against closed forms found another way."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.model.trim_contact import FORMS
from assembly.constraints.program import records as layout
from tests.laws.curve_witness import CurveStack, SurfaceCurve
from tests.laws.loop_point import LoopPoint, moved
from tests.laws.trim_scenes import LOOPS, SURFACES, FreePoint, TrimScene, circle, polygon, spline, trim_scene
from tests.laws.witness import OFFSETS, SLOPE, STEP, Pairs, Stack, rotated
from tests.laws.witness import moved as pair_moved

# Surface and loop in turn, both sides, off the loop and on its other side.
CASES = [(k, SURFACES[k % 3], LOOPS[(k + k // 3) % 3], "ab"[k % 2], bool(k // 2 % 2)) for k in range(6)]


def as_vectors(made):
    """The same scene, whose vectors count by their components: what their lengths are made of."""
    table = made.scene.packed().table
    for r in range(1, made.scene.packed().rows):
        table[table[layout.ROW_TABLE] + layout.ROW * r + layout.TRIM_LENGTH] = 0
    return made


def differences(rows, n, step):
    """Slopes (rows, n) of a function of a step (n,) of the unknowns, sixth order."""
    columns = []
    for j in range(n):
        way = np.zeros(n)
        way[j] = step
        columns.append(np.tensordot(SLOPE, [rows(offset * way) for offset in OFFSETS], 1) / step)
    return np.stack(columns, -1)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", CASES, ids=str)
def test_gradients_of_rows_whose_contact_is_tracked(case, form):
    seed, surface, loop, side, inside = case
    made = trim_scene(seed, surface, loop, side, form, gap=0.05, inside=inside)
    point = made.at(made.q)
    way = np.random.default_rng(seed).normal(size=(12, 12))
    ways = np.linalg.qr(way)[0]
    found = point.jacobian() @ ways

    def rows(steps):
        return made.at(moved(made.scene, made.q, ways @ steps), point.tracked[0, :4]).residual

    # The loop is small: a step of 1e-4 leaves 1e-12. Re-solved rows are exact to 1e-14, over the step.
    expected = differences(rows, 12, 1e-4)
    assert np.abs(found[1:]).max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("case", CASES[:4], ids=str)
def test_gradients_of_rows_whose_contact_is_free(case, form):
    """Also where the coordinates are not those of an extremal pair."""
    seed, surface, loop, side, inside = case
    made = trim_scene(seed, surface, loop, side, form, gap=0.05, inside=inside)
    rng = np.random.default_rng(seed)
    size = made.scene.packed().scale
    x = made.x + 0.002 * size * rng.uniform(-1.0, 1.0, 4)
    point = FreePoint(made, made.q, x)
    ways = np.linalg.qr(rng.normal(size=(16, 16)))[0]
    found = point.jacobian() @ ways

    def rows(steps):
        d = ways @ steps
        return FreePoint(made, moved(made.scene, made.q, d[:12]), x + d[12:] / point.lengths[0], point.lengths).residual

    expected = differences(rows, 16, 1e-4)
    assert np.abs(found[1:-4]).max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("case", CASES[:3], ids=str)
def test_the_hessian_of_a_signed_row(case):
    seed, surface, loop, side, inside = case
    made = trim_scene(seed, surface, loop, side, "signed", inside=inside)
    rng = np.random.default_rng(seed)
    point = FreePoint(made, made.q, made.x)
    weights = np.zeros(point.rows)
    y = np.zeros(point.rows)
    y[1] = 0.7
    ways = np.linalg.qr(rng.normal(size=(16, 16)))[0]

    def slopes(steps):
        d = ways @ steps
        x = made.x + d[12:] / point.lengths[0]
        return FreePoint(made, moved(made.scene, made.q, d[:12]), x, point.lengths).jacobian()[1]

    expected = 0.7 * differences(slopes, 16, 5e-4) @ ways.T
    found = point.row_terms(y, weights)
    if loop == "polygon":
        # Straight.
        np.testing.assert_array_equal(found, 0.0)
    else:
        assert np.abs(found).max() > 0.1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7)


@pytest.mark.parametrize("form", FORMS)
def test_squares_of_gradients_of_a_free_contact(form):
    """J^T diag(weights) J has the columns of the coordinates, too."""
    made = trim_scene(3, "ellipsoid", "circle", "b", form)
    point = FreePoint(made, made.q, made.x)
    weights = np.random.default_rng(0).uniform(1.0, 2.0, point.rows)
    jacobian = point.jacobian()
    expected = jacobian.T @ (weights[:, None] * jacobian)
    np.testing.assert_allclose(point.row_terms(np.zeros(point.rows), weights), expected, rtol=0, atol=1e-13)


def closed_forms(made, t, curve):
    """s_q, v1_q, v2_q, v3_q (14 columns, quaternions) by implicit differentiation in complex steps.

    The vectors are in the axes of the body with the loop, where f(u) and c(t) have no rates of their own.
    """
    own, other = made.side, 1 - made.side
    q, x = made.q.ravel()[None], made.x[None]
    stacks = [Stack([face.surface], [face.sign]) for face in made.faces]
    u_q = Pairs(*stacks).jacobian(x, q)[0]
    # The surface is the other body's, the curve is on this one.
    pair = SurfaceCurve(stacks[other], CurveStack([curve]), stacks[own])
    order = np.r_[7 * other : 7 * other + 7, 7 * own : 7 * own + 7]
    start = np.concatenate([made.x[2 * other : 2 * other + 2], [t]])[None]
    y = pair.solve(start, q[:, order], 12)
    t_q = np.zeros(14)
    t_q[order] = pair.jacobian(y, q[:, order])[0, 2]
    t = float(y[0, 2])
    c, c_t = curve.evaluate(t, 1)
    u, v = made.uv
    p, p_u, p_v = made.faces[own].surface.evaluate(u, v, 1)
    s, s_u, s_v = made.faces[own].surface.evaluate(*c, 1)
    along = s_u * c_t[0] + s_v * c_t[1]
    own_q, other_q = u_q[2 * own : 2 * own + 2], u_q[2 * other : 2 * other + 2]

    def there(x, q):
        """The other body's point in the axes of this one."""
        frames = Pairs(*stacks).frames(x, q)
        turned = q[:, 7 * own : 7 * own + 7].copy()
        turned[:, 4:] *= -1.0
        return rotated(turned, frames[3 * other] - q[:, 7 * own : 7 * own + 3])[0]

    explicit = np.stack([there(x.astype(complex), q + 1j * STEP * e).imag / STEP for e in np.eye(14)], 1)
    g_u = np.stack(
        [there(x + 1j * STEP * np.eye(4)[2 * other + k], q.astype(complex)).imag / STEP for k in range(2)], 1
    )
    return {
        "parametric": (made.uv - c, own_q - np.outer(c_t, t_q)),
        "cartesian": (p - s, np.stack([p_u, p_v], 1) @ own_q - np.outer(along, t_q)),
        "between": (there(x, q) - s, explicit + g_u @ other_q - np.outer(along, t_q)),
        "own": own_q,
    }


@pytest.mark.parametrize("seed", range(4))
def test_rows_against_the_closed_forms(seed):
    surface, loop, side = SURFACES[seed % 3], ("spline", "circle")[seed // 2], "ab"[seed % 2]
    for form in FORMS:
        made = as_vectors(trim_scene(40 + seed, surface, loop, side, form, gap=0.03, inside=seed % 2 == 0))
        region = made.trim.region
        foot = region.nearest_on_boundary(*made.uv)
        curve = region.boundary[int(foot.curve)]
        forms = closed_forms(made, float(foot.t), curve)
        packed = made.scene.packed()
        if form == "signed":
            way = made.uv - foot.point
            normal = way / np.linalg.norm(way) * np.sign(foot.distance)
            value, slope = np.atleast_1d(foot.distance), normal[None] @ forms["own"]
        else:
            value, slope = forms[form]
        unit = made.trim.stretch if form in ("signed", "parametric") else 1.0
        point = made.at(made.q)
        rng = np.random.default_rng(seed)
        twist = rng.normal(size=12)
        lengths = twist.copy()
        lengths[[0, 1, 2, 6, 7, 8]] *= packed.scale
        _, rate = pair_moved(made.q.ravel()[None], lengths[None], 0.0)
        # Both exact but for rounding, in units of a few times the shape's size.
        np.testing.assert_allclose(packed.scale * point.residual[1:], unit * value, rtol=0, atol=1e-11)
        jacobian = point.point.jacobian[1:, :12]
        np.testing.assert_allclose(packed.scale * (jacobian @ twist), unit * (slope @ rate[0]), rtol=0, atol=1e-10)


def distance_of(loop):
    """Signed distance to a loop in a plane, its gradient (2,), its second derivative (2, 2): from the rows."""
    plane = asm.Face(asm.shapes.plane(10.0, 10.0))
    bodies = [asm.Body("ground", plane, fixed=True), asm.Body("ball", asm.shapes.sphere(1.0))]
    scene = asm.Assembly(bodies)
    contact = asm.Contact(*bodies)
    trim = asm.TrimContact(contact, loop)
    scene.constrain(contact, trim)
    made = TrimScene(scene, trim, (plane, bodies[1].faces[0].face), [], scene.q, np.array([0.0, 0.0, 0.1, 0.1]))
    factor = trim.stretch / scene.packed().scale

    def distance(u):
        point = FreePoint(made, made.q, np.concatenate([u, made.x[2:]]), np.ones((1, 4)))
        y = np.zeros(point.rows)
        y[1] = 1.0 / factor
        hessian = point.row_terms(y, np.zeros(point.rows))
        place = 6 * int(point.table[layout.MOVING])
        assert np.count_nonzero(hessian) == np.count_nonzero(hessian[place : place + 2, place : place + 2])
        return (
            point.residual[1] / factor,
            point.jacobian()[1, 12:14] / factor,
            hessian[place : place + 2, place : place + 2],
        )

    return distance


def across(n):
    """I - n n^T."""
    return np.eye(2) - np.outer(n, n)


def test_the_distance_to_a_circle_is_exact():
    center, radius = np.array([0.3, -0.2]), 1.7
    distance = distance_of(circle(center, radius))
    rng = np.random.default_rng(1)
    for r in (0.4, 1.2, 1.6999999, 1.7, 1.7000001, 2.2, 3.0):
        angle = rng.uniform(0.0, 6.28)
        way = np.array([np.cos(angle), np.sin(angle)])
        s, n, bend = distance(center + r * way)
        assert s == pytest.approx(radius - r, abs=1e-13)
        np.testing.assert_allclose(n, -way, rtol=0, atol=1e-9)
        # s = radius - |u - center|: its second derivative is -1 / |u - center| across the way.
        np.testing.assert_allclose(bend, -across(way) / r, rtol=0, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_the_distance_to_a_spline_and_its_derivatives(seed, cases):
    rng = np.random.default_rng(seed)
    distance = distance_of(spline(rng, np.zeros(2), 1.0))
    for _ in range(cases(2, 8)):
        angle, r = rng.uniform(0.0, 6.28), rng.choice([rng.uniform(0.75, 0.9), rng.uniform(1.1, 2.0)])
        u = r * np.array([np.cos(angle), np.sin(angle)])
        _s, n, bend = distance(u)
        assert np.hypot(*n) == pytest.approx(1.0, abs=1e-13)
        slopes = differences(lambda d, u=u: np.array([distance(u + d)[0]]), 2, 1e-3)[0]
        np.testing.assert_allclose(n, slopes, rtol=0, atol=1e-9)
        assert np.abs(bend).max() > 0.1
        curves = differences(lambda d, u=u: distance(u + d)[1], 2, 1e-3)
        np.testing.assert_allclose(bend, curves, rtol=0, atol=1e-7)


def test_the_distance_to_corners():
    """A convex corner is nearest from outside, a re-entrant one from inside: distances are those of a point there."""
    points = np.array([[-2.0, -2.0], [2.0, -2.0], [2.0, 2.0], [0.0, 0.5], [-2.0, 2.0]])
    distance = distance_of(polygon(points))
    beside = (((2.3, -2.4), points[1], -1.0), ((0.02, 0.3), points[3], 1.0), ((2.5, 2.1), points[2], -1.0))
    for u, corner, sign in beside:
        s, n, bend = distance(u)
        way = (np.array(u) - corner) / np.hypot(*(np.array(u) - corner))
        assert s == pytest.approx(sign * np.hypot(*(np.array(u) - corner)), abs=1e-14)
        np.testing.assert_allclose(n, sign * way, rtol=0, atol=1e-14)
        np.testing.assert_allclose(bend, across(way) / s, rtol=0, atol=1e-12)
    for u, value, normal in (((0.5, -1.9), 0.1, (0.0, 1.0)), ((2.2, 0.3), -0.2, (-1.0, 0.0))):
        s, n, bend = distance(u)
        assert s == pytest.approx(value, abs=1e-14)
        np.testing.assert_allclose(n, normal, rtol=0, atol=1e-14)
        np.testing.assert_array_equal(bend, 0.0)
    # At the corner itself everything is finite.
    for corner in points:
        s, n, bend = distance(corner)
        assert s == 0.0 and np.hypot(*n) == pytest.approx(1.0, abs=1e-14) and np.isfinite(bend).all()


@pytest.mark.parametrize("form", FORMS)
def test_rows_at_a_corner_of_the_loop(form):
    """Beyond a convex corner the loop's nearest point is the corner, and stays there."""
    made = as_vectors(trim_scene(7, "ellipsoid", "polygon", "a", form, gap=0.02, inside=False, corner=True))
    point = made.at(made.q)
    region = made.trim.region
    foot = region.nearest_on_boundary(*made.uv)
    assert foot.distance < 0.0
    corners = np.array([curve.evaluate(0.0) for curve in made.curves])
    assert np.linalg.norm(corners - foot.point, axis=1).min() < 1e-14
    ways = np.linalg.qr(np.random.default_rng(7).normal(size=(12, 12)))[0]

    def rows(steps):
        return made.at(moved(made.scene, made.q, ways @ steps), point.tracked[0, :4]).residual

    # The distance to a point bends as sharply as it is near.
    np.testing.assert_allclose(point.jacobian() @ ways, differences(rows, 12, 1e-4), rtol=0, atol=1e-9)
    if form == "parametric":
        unit = made.trim.stretch / made.scene.packed().scale
        np.testing.assert_allclose(point.residual[1:3], unit * (made.uv - foot.point), rtol=0, atol=1e-14)


@pytest.mark.parametrize("form", ["signed", "parametric", "cartesian"])
@pytest.mark.parametrize("keep", ["inside", "outside"])
def test_one_sided_rows(form, keep):
    """The signed one is the two-sided one with the side's sign; of a vector it is the length that has that sign."""
    for inside in (True, False):
        made = trim_scene(8, "dome", "circle", "a", form, keep, inside=inside)
        both = as_vectors(trim_scene(8, "dome", "circle", "a", form, "on", inside=inside))
        assert made.scene.packed().one_sided.tolist() == [False] + [True] * (made.scene.packed().rows - 1)
        point, other = made.at(made.q), both.at(both.q)
        right = inside == (keep == "inside")
        if form == "signed":
            sign = 1.0 if keep == "inside" else -1.0
            np.testing.assert_array_equal(point.residual[1:], sign * other.residual[1:])
            np.testing.assert_array_equal(point.jacobian()[1:], sign * other.jacobian()[1:])
            assert (point.residual[1] > 0.0) == right
        else:
            sign = 1.0 if right else -1.0
            vector, slopes = other.residual[1:], other.jacobian()[1:]
            length = np.linalg.norm(vector)
            # Sums of three products, in another order.
            np.testing.assert_allclose(point.residual[1], sign * length, rtol=1e-15)
            np.testing.assert_allclose(point.jacobian()[1], sign * vector @ slopes / length, rtol=0, atol=1e-14)
            assert not point.residual[2:].any() and not point.jacobian()[2:].any()


def test_a_row_has_the_unit_of_a_length():
    """A signed row is the distance in (u, v) times how far a unit across the loop reaches in space, here exactly."""
    made = trim_scene(9, "ellipsoid", "circle", "b", "signed")
    row = made.scene.packed().table[layout.ROW_TABLE] + layout.ROW
    assert made.scene.packed().table[row + layout.IS_LENGTH] == 1
    ground = asm.Body("ground", asm.Face(asm.shapes.plane(8.0, 8.0)), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(1.0), position=(0.5, 0.2, 1.0))
    contact = asm.Contact(ground, ball)
    scene = asm.Assembly([ground, ball])
    plane = ground.faces[0].face.surface
    at = plane.evaluate(*np.mean(plane.domain, axis=1), 1)
    trim = asm.TrimContact(contact, circle(np.mean(plane.domain, axis=1), 1.5), "inside")
    scene.constrain(contact, trim)
    assert trim.stretch == pytest.approx(np.linalg.norm(at[1]), rel=1e-12)


@pytest.mark.parametrize("form", FORMS)
def test_the_hessian_of_a_row_whose_contact_cannot_be_freed(form):
    """A ball standing on its pole, where its coordinates are none: on a plane the contact moves as its center does."""
    plane = asm.Face(asm.shapes.plane(10.0, 10.0))
    bodies = [asm.Body("ground", plane, fixed=True), asm.Body("ball", asm.shapes.sphere(1.0), position=(1.5, 0.4, 1.0))]
    scene = asm.Assembly(bodies)
    contact = asm.Contact(*bodies)
    trim = asm.TrimContact(contact, circle((0.0, 0.0), np.hypot(1.5, 0.4)), "on", form)
    scene.constrain(contact, trim)
    point = LoopPoint(scene, scene.q)
    y = np.zeros(point.rows)
    y[1:] = [0.7, -0.4, 0.3][: point.rows - 1]
    found = point.row_terms(y)

    def slopes(steps):
        return LoopPoint(scene, moved(scene, scene.q, steps), point.tracked).jacobian().T @ y

    expected = differences(slopes, 6, 1e-3)
    if form == "signed":
        assert np.abs(found).max() > 0.1
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-8)
        return
    # Of vectors along the loop, where the signed distance is zero: a step there leaves it by the loop's curvature.
    way = np.array([-0.4, 1.5, 0.0, 0.0, 0.0, 0.0]) / np.hypot(0.4, 1.5)
    outward = np.array([1.5, 0.4, 0.0, 0.0, 0.0, 0.0]) / np.hypot(0.4, 1.5)
    slope = float(y @ point.jacobian() @ outward)
    assert way @ found @ way == pytest.approx(slope * scene.packed().scale / np.hypot(0.4, 1.5), rel=1e-9)
