"""Pairs of faces, edges and vertices: closed forms, ends, continua, signs; compiled and as plain Python."""

from __future__ import annotations

import json

import numpy as np
import pytest

from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.splines.curve import NurbsCurve
from assembly.proximity import extremal_pair, gap_hessian
from assembly.proximity.brep.records import EDGE, FACE, VERTEX
from assembly.proximity.extrema.feature_query import FOLD, GAP, ISOLATED, NORMAL, PAIR, POINT_F, PROPER
from tests.laws.feature_scenes import Feature, Packed, random_feature
from tests.laws.scenes import quaternion_of, random_quaternion
from tests.laws.test_feature_pairs import KINDS, random_cases
from tests.laws.witness import rotated

HOME = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
HALF = np.sqrt(0.5)
X, Y, Z = np.eye(3)


def segment(a, b):
    return Feature(EDGE, curve=NurbsCurve([a, b], [0, 0, 1, 1], 1))


def circle_curve(radius=1.0):
    corners = [[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]]
    points = np.pad(radius * np.array(corners, float), ((0, 0), (0, 1)))
    return NurbsCurve(points, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1.0, HALF] * 4 + [1.0])


LINE = segment([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0])
CIRCLE = Feature(EDGE, curve=circle_curve(), endless=True)
POINT = Feature(VERTEX, point=np.zeros(3))
PLANE = Feature(FACE, face=Face(shapes.plane(4.0, 4.0)))
CYLINDER = Feature(FACE, face=Face(shapes.cylinder(1.0, 4.0)))
BALL = Feature(FACE, face=Face(shapes.sphere(1.0)))
GRID = [
    (u, v) for u in np.linspace(*BALL.face.surface.domain[0], 33) for v in np.linspace(*BALL.face.surface.domain[1], 17)
]
SAMPLES = BALL.face.surface.evaluate(*np.transpose(GRID))


def pose(x=0.0, y=0.0, z=0.0, matrix=None):
    return np.array([x, y, z, *((1.0, 0.0, 0.0, 0.0) if matrix is None else quaternion_of(np.array(matrix)))])


def turn(axis, angle):
    """Rotation matrix about an axis of the frame."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    m = np.eye(3)
    m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
    return m


def both(f, g, q_f, q_g, x, n=(0.0, 0.0, 0.0), **options):
    """The pair solved with the features in both orders, which must agree: status and what was found, f first."""
    n = np.asarray(n, float)
    status, out = Packed(f, g).solve(np.r_[q_f, q_g], x, n, **options)
    other, back = Packed(g, f).solve(np.r_[q_g, q_f], [*x[2:], *x[:2]], -n, **options)
    assert other == status
    if status != "NOT_CONVERGED":
        assert abs(back[GAP] - out[GAP]) < 1e-12
        assert np.isfinite(out).all() and np.isfinite(back).all()
    return status, out


def close(found, expected, atol=1e-12):
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=atol)


# ---- closed forms ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("gap", [0.7, 1e-6, 0.0, -1e-6, -0.2])
def test_ball_and_line_and_point(gap):
    rng = np.random.default_rng(1)
    for _ in range(20):
        q_f, q_g = (np.r_[rng.uniform(-3.0, 3.0, 3), random_quaternion(rng)] for _ in range(2))
        away, along = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
        u, v = rng.uniform(0.5, 5.5), rng.uniform(0.6, 2.4)
        local, _su, _sv = BALL.face.surface.evaluate(u, v, 1)
        away = rotated(q_f[None], local[None])[0]
        along -= (along @ away) * away
        along /= np.linalg.norm(along)
        center = q_f[:3] + (1.0 + gap) * away
        # The line's body: its x axis along `along`, its origin a little off the nearest point.
        q_g[3:] = quaternion_of(np.stack([along, np.cross(away, along), away], 1))
        q_g[:3] = center - 0.3 * along
        near = 0.02 * rng.uniform(-1.0, 1.0, 3)
        status, out = both(BALL, LINE, q_f, q_g, [u + near[0], v + near[1], 0.65 + near[2], 0.0])
        assert status == "CONVERGED"
        close(out[GAP], gap, 1e-13)
        close(out[NORMAL : NORMAL + 3], away)
        close(out[2], 0.65)
        status, out = both(BALL, POINT, q_f, np.r_[center, q_g[3:]], [u + near[0], v + near[1], 0.0, 0.0])
        assert status == "CONVERGED"
        close(out[GAP], gap, 1e-13)
        close(out[POINT_F : POINT_F + 6], np.r_[q_f[:3] + away, center])


@pytest.mark.parametrize("gap", [0.7, 1e-9, 0.0, -1e-9, -0.2])
def test_crossed_lines_keep_their_side(gap):
    for angle in (0.01, 0.3, 1.5, 3.1):
        q = pose(0.2, 0.0, gap, turn(2, angle))
        status, out = both(LINE, LINE, HOME, q, [0.62, 0.0, 0.48, 0.0], Z)
        assert status == "CONVERGED"
        close(out[GAP], gap, 1e-13)
        close(out[NORMAL : NORMAL + 3], Z)
        # Without a side to begin from, the distance.
        status, out = both(LINE, LINE, HOME, q, [0.62, 0.0, 0.48, 0.0])
        close(out[GAP], abs(gap), 1e-13)
        close(abs(out[NORMAL + 2]), 1.0)


def test_distances_of_points_and_edges_are_not_negative():
    for n in (Z, -Z, (0.0, 0.0, 0.0)):
        status, out = both(LINE, POINT, HOME, pose(0.2, 0.3, 0.4), [0.3, 0.0, 0.0, 0.0], n)
        assert status == "CONVERGED"
        close(out[GAP], 0.5)
        close(out[NORMAL : NORMAL + 3], [0.0, 0.6, 0.8])
        status, out = both(POINT, POINT, HOME, pose(0.0, 0.3, 0.4), [0.0] * 4, n)
        assert status == "CONVERGED"
        close(out[GAP], 0.5)


def test_points_that_coincide_have_the_normal_given():
    status, out = both(POINT, POINT, HOME, HOME, [0.0] * 4, Y)
    assert status == "CONVERGED" and out[GAP] == 0.0
    close(out[NORMAL : NORMAL + 3], Y)
    # On the edge, the given normal made orthogonal to it.
    status, out = both(LINE, POINT, HOME, HOME, [0.4, 0.0, 0.0, 0.0], 0.8 * Y + 0.6 * X)
    assert status == "CONVERGED" and abs(out[GAP]) < 1e-15
    close(out[NORMAL : NORMAL + 3], Y)
    for f, g, x in ((POINT, POINT, [0.0] * 4), (LINE, POINT, [0.4, 0.0, 0.0, 0.0])):
        status, out = both(f, g, HOME, HOME, x)
        assert status == "SINGULAR" and out[ISOLATED] == 0.0
        close(np.linalg.norm(out[NORMAL : NORMAL + 3]), 1.0)
        derivatives = Packed(f, g).derivatives(np.r_[HOME, HOME], out[:4])
        assert all(np.isfinite(a).all() for a in derivatives)


def test_two_faces_are_what_they_were():
    rng = np.random.default_rng(5)
    for _ in range(10):
        f, x_f = random_feature(rng, FACE)
        g, x_g = random_feature(rng, FACE)
        q = np.r_[rng.uniform(-3.0, 3.0, 3), random_quaternion(rng), rng.uniform(-3.0, 3.0, 3), random_quaternion(rng)]
        pair = extremal_pair(f.face, q[:7], g.face, q[7:], [*x_f, *x_g])
        packed = Packed(f, g)
        status, out = packed.solve(q, [*x_f, *x_g], size=max(f.face.surface.size, g.face.surface.size))
        assert status == pair.status.name
        if status == "CONVERGED":
            # Solved to the last bit there, to half of it here.
            close(out[GAP], pair.gap)
            close(out[NORMAL : NORMAL + 3], pair.normal, 1e-11)
            hessian = packed.derivatives(q, pair.parameters, size=max(f.face.surface.size, g.face.surface.size))[2]
            expected = gap_hessian(f.face, q[:7], g.face, q[7:], pair.parameters)
            close(hessian, expected, 1e-12 * (1.0 + np.abs(expected).max()))


def test_surfaces_that_cross_are_not_proper():
    saddle = Feature(FACE, face=Face(shapes.cylinder(1.0, 4.0), reversed=True))
    # A thick pin across a bore, touching it: it runs through the wall on both sides.
    pin = Feature(FACE, face=Face(shapes.cylinder(0.5, 4.0)))
    q = np.r_[HOME, pose(0.5, 0.0, 0.0)]
    _status, out = Packed(saddle, pin).solve(q, [0.1, 2.0, 0.1, 2.0])
    assert out[PROPER] == 1.0
    q = np.r_[HOME, pose(0.5, 2.0, 0.0, turn(0, 0.5 * np.pi))]
    status, out = Packed(saddle, pin).solve(q, [0.0, 2.0, 0.0, 2.0])
    assert status == "CONVERGED" and out[PROPER] == 0.0
    assert Packed(BALL, LINE).solve(np.r_[HOME, pose(0.2, 0.0, 1.5)], [1.0, 2.9, 0.4, 0.0])[1][PROPER] == 1.0


# ---- continua: the current pair is kept, its gap is right ------------------------------------------------------------


def held_by_damping(f, g, q_g, x, gap, free, n=(0.0, 0.0, 0.0)):
    """A continuum: SINGULAR, with the right gap, and a pair that solving again does not move along `free`."""
    status, out = both(f, g, HOME, q_g, x, n)
    assert status == "SINGULAR" and out[ISOLATED] == 0.0
    close(out[GAP], gap, 1e-13)
    packed = Packed(f, g)
    again = packed.solve(np.r_[HOME, q_g], out[:4], n)
    assert again[0] == "SINGULAR"
    close(again[1][:4], out[:4], 1e-12)
    assert abs(out[FOLD]) < 1e-7
    assert np.abs(out[free] - np.asarray(x)[free]).max() < 0.3
    assert all(np.isfinite(a).all() for a in packed.derivatives(np.r_[HOME, q_g], out[:4], n))


@pytest.mark.parametrize("gap", [0.5, 0.0, -0.1])
def test_line_parallel_to_a_plane(gap):
    for angle in (0.0, 0.7, 3.0):
        held_by_damping(PLANE, LINE, pose(0.2, 0.1, gap, turn(2, angle)), [0.2, 0.1, 0.5, 0.0], gap, [0, 1, 2])
    held_by_damping(PLANE, CIRCLE, pose(0.2, 0.1, gap), [0.2, 0.9, 1.1, 0.0], gap, [2])


@pytest.mark.parametrize("gap", [0.5, 0.0, -0.1])
def test_line_along_a_ruling(gap):
    along = np.stack([Z, Y, -X], 1)
    held_by_damping(CYLINDER, LINE, pose(1.0 + gap, 0.0, 0.0, along), [0.1, 1.9, 0.5, 0.0], gap, [1, 2])


@pytest.mark.parametrize("apart", [1.0, 1e-3, 0.0])
def test_parallel_lines(apart):
    for matrix in (np.eye(3), turn(2, np.pi)):
        held_by_damping(LINE, LINE, pose(0.2, 0.0, apart, matrix), [0.5, 0.0, 0.4, 0.0], apart, [0, 2], Z)


def test_coaxial_circles_and_points_on_an_axis():
    held_by_damping(CIRCLE, CIRCLE, pose(0.0, 0.0, 0.2), [0.3, 0.0, 0.4, 0.0], 0.2, [0, 2])
    held_by_damping(CIRCLE, POINT, pose(0.0, 0.0, 0.4), [0.3, 0.0, 0.0, 0.0], np.hypot(1.0, 0.4), [0])
    held_by_damping(CYLINDER, POINT, pose(0.0, 0.0, 0.2), [0.3, 2.2, 0.0, 0.0], -1.0, [0, 1])
    held_by_damping(BALL, POINT, HOME, [0.3, 1.2, 0.0, 0.0], -1.0, [0, 1])


@pytest.mark.parametrize("angle", [1e-14, 1e-11, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2])
def test_nearly_parallel_lines_have_the_right_gap(angle):
    # On both sides of every threshold: the gap of the two lines is what it is, wherever the pair is said to be.
    for gap in (0.7, 1e-4):
        status, out = both(LINE, LINE, HOME, pose(0.2, 0.0, gap, turn(2, angle)), [0.5, 0.0, 0.4, 0.0], Z)
        assert status in ("CONVERGED", "SINGULAR")
        close(out[GAP], gap)
    across = np.stack([np.sin(angle) * Y + np.cos(angle) * Z, np.cos(angle) * Y - np.sin(angle) * Z, -X], 1)
    status, out = both(CYLINDER, LINE, HOME, pose(1.3, 0.0, 0.1, across), [0.01, 2.1, 0.51, 0.0])
    assert status in ("CONVERGED", "SINGULAR")
    close(out[GAP], 0.3)


# ---- ends --------------------------------------------------------------------------------------------------------


def segment_distance(a, b, c, d):
    """Distance of two segments: of an end and the other segment, or inside of both."""

    def to_segment(p, q, r):
        t = np.clip((p - q) @ (r - q) / ((r - q) @ (r - q)), 0.0, 1.0)
        return np.linalg.norm(q + t * (r - q) - p)

    best = min(to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b))
    matrix = np.stack([b - a, c - d], 1)
    s, t = np.linalg.lstsq(matrix, c - a, rcond=None)[0]
    return min(best, np.linalg.norm(matrix @ [s, t] - (c - a))) if 0.0 < s < 1.0 and 0.0 < t < 1.0 else best


def test_segments_from_anywhere():
    rng = np.random.default_rng(11)
    seen = set()
    for _ in range(300):
        a, b, c, d = rng.normal(size=(4, 3))
        f, g = segment(a, b), segment(c, d)
        status, out = both(f, g, HOME, HOME, [rng.random(), 0.0, rng.random(), 0.0])
        seen.add((status, out[0] in (0.0, 1.0), out[2] in (0.0, 1.0)))
        close(out[GAP], segment_distance(a, b, c, d), 1e-13)
        inside = 0.0 < out[0] < 1.0 and 0.0 < out[2] < 1.0
        assert status == ("CONVERGED" if inside else "LEFT_PATCH")
        # An end is a point: the normal is along the difference.
        close(out[NORMAL : NORMAL + 3] * out[GAP], out[POINT_F + 3 : POINT_F + 6] - out[POINT_F : POINT_F + 3])
    assert len(seen) == 4


def test_segment_over_a_ball():
    rng = np.random.default_rng(12)
    seen = set()
    count = 0
    while count < 200:
        a, b = rng.normal(size=(2, 3)) * 1.5
        t = np.clip(-a @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        nearest = a + t * (b - a)
        if np.linalg.norm(nearest) < 1.05 or np.linalg.norm(nearest[:2]) < 0.3:
            continue
        count += 1
        # Somewhere on the segment, and the point of the ball under that.
        s = np.clip(t + rng.uniform(-0.3, 0.3), 0.0, 1.0)
        p = a + s * (b - a)
        uv = under(p)
        status, out = both(BALL, segment(a, b), HOME, HOME, [*uv, s, 0.0])
        seen.add((status, t in (0.0, 1.0)))
        assert status == ("LEFT_PATCH" if t in (0.0, 1.0) else "CONVERGED")
        close(out[2], t, 1e-11)
        close(out[GAP], np.linalg.norm(nearest) - 1.0)
    assert len(seen) == 2


def under(p):
    """Parameters of the unit ball near the direction of p, by sampling."""
    i = np.argmax(SAMPLES @ p)
    return GRID[i]


def test_line_inclined_to_a_plane_has_its_lower_end():
    for angle in (1e-8, 1e-6, 1e-3, 0.1, 1.0, 0.5 * np.pi, 2.0, -0.3):
        for gap in (1.5, 0.3):
            direction = turn(1, angle) @ X
            low = 1.0 if direction[2] < 0.0 else 0.0
            status, out = both(PLANE, LINE, HOME, pose(0.0, 0.0, gap, turn(1, angle)), [0.3, 0.2, 0.4, 0.0])
            assert status == "LEFT_PATCH"
            assert out[2] == low
            close(out[GAP], gap - abs(direction[2]))
            close(out[:2], [(2.0 * low - 1.0) * direction[0], 0.0])


def test_straight_parts_are_passed():
    """A stadium, two lines and two half circles, inclined along its lines: its lowest point is on an arc."""
    corners = [[1, -1], [2, -1], [2, 0], [2, 1], [1, 1], [-1, 1], [-2, 1], [-2, 0], [-2, -1], [-1, -1], [1, -1]]
    points = np.insert(np.pad(np.array(corners, float), ((0, 0), (0, 1))), 5, [0.0, 1.0, 0.0], axis=0)
    points = np.insert(points, 11, [0.0, -1.0, 0.0], axis=0)
    weights = np.array([1, HALF, 1, HALF, 1, 1, 1, HALF, 1, HALF, 1, 1, 1])
    knots = np.r_[0, np.repeat(np.arange(7), 2), 6]
    stadium = NurbsCurve(points, knots, 2, weights)
    close(stadium.evaluate(2.5), [0.0, 1.0, 0.0])
    for endless in (False, True):
        edge = Feature(EDGE, curve=stadium, endless=endless)
        for tilt in (0.2, 1.4):
            q = pose(0.0, 0.0, 3.0, turn(1, tilt))
            for start in (2.1, 2.5, 2.9, 5.5):
                status, out = both(PLANE, edge, HOME, q, [0.0, 0.5, start, 0.0])
                if start == 5.5 and not endless:
                    # Down to the end of the curve, in the middle of nothing.
                    assert status == "LEFT_PATCH" and out[2] == 6.0
                    close(out[GAP], 3.0 - np.sin(tilt))
                    continue
                assert status == "CONVERGED"
                close(out[GAP], 3.0 - 2.0 * np.sin(tilt))
                close(out[2], 1.0)


def test_an_extremum_at_the_very_end_is_one():
    status, out = both(LINE, POINT, HOME, pose(1.0, 0.3, 0.4), [0.4, 0.0, 0.0, 0.0])
    assert status == "CONVERGED"
    close(out[[0, GAP]], [1.0, 0.5])


def test_closed_edges_wrap():
    # The seam is at (1, 0, 0), t = 0 = 4.
    for y in (-0.1, 0.1):
        for start in (0.1, 3.9):
            status, out = both(CIRCLE, POINT, HOME, pose(1.3, y, 0.2), [start, 0.0, 0.0, 0.0])
            assert status == "CONVERGED"
            close(out[GAP], np.hypot(np.hypot(1.3, y) - 1.0, 0.2))
            assert (out[0] < 1.0) == (y > 0.0) and 0.0 <= out[0] <= 4.0
    open_circle = Feature(EDGE, curve=circle_curve())
    status, out = Packed(open_circle, POINT).solve(np.r_[HOME, pose(1.3, -0.1, 0.2)], [0.1, 0.0, 0.0, 0.0])
    assert status == "LEFT_PATCH" and out[0] == 0.0


def test_edges_round_a_closed_surface():
    """A helix beyond the seam of a cylinder: its plane curve leaves the domain where the surface is closed."""
    (low, high), _ = CYLINDER.face.surface.domain
    turns = NurbsCurve([[low - 0.3, 1.0], [high + 0.4, 3.0]], [0, 0, 1, 1], 1)
    helix = Feature(EDGE, face=CYLINDER.face, curve=turns)
    for t in (0.02, 0.04, 0.5, 0.93, 0.98):
        c = turns.evaluate(t)
        c[0] = low + (c[0] - low) % (high - low)
        foot = CYLINDER.face.surface.evaluate(*c)
        status, out = both(helix, POINT, HOME, pose(*(1.2 * foot[:2]), foot[2]), [t + 0.01, 0.0, 0.0, 0.0])
        assert status == "CONVERGED"
        close(out[[0, GAP]], [t, 0.2])


def test_a_face_is_held_at_its_end():
    status, out = both(PLANE, POINT, HOME, pose(5.0, 0.0, 0.2), [0.3, 0.2, 0.0, 0.0])
    assert status == "LEFT_PATCH"
    assert out[0] == 2.0


def test_a_far_start_is_refused_where_patience_ends():
    args = np.r_[HOME, pose(0.0, 0.0, 1.5, turn(0, 0.3))], [1.0, 1.2, 0.9, 0.0]
    assert Packed(BALL, LINE).solve(*args)[0] != "NOT_CONVERGED"
    assert Packed(BALL, LINE).solve(*args, turn=1e-3)[0] == "NOT_CONVERGED"
    args = np.r_[HOME, pose(0.2, 0.1, 0.3, turn(2, 0.5))], [0.9, 0.0, 0.1, 0.0]
    assert Packed(LINE, LINE).solve(*args)[0] == "CONVERGED"
    assert Packed(LINE, LINE).solve(*args, turn=1e-3)[0] == "NOT_CONVERGED"


def test_places_without_a_tangent_are_not_converged():
    # A cusp, where the curve stands still, and the apex of a cone.
    cusp = Feature(EDGE, curve=NurbsCurve([[-1, 0, 1], [0, 0, 0], [0, 0, 0], [1, 0, 1]], [0, 0, 0, 0, 1, 1, 1, 1], 3))
    cone = Feature(FACE, face=Face(shapes.cone(1.0, 1.0)))
    for f, g, x in ((cusp, POINT, [0.5, 0, 0, 0]), (PLANE, cusp, [0, 0, 0.5, 0]), (cone, POINT, [1.0, 1.0, 0, 0])):
        packed = Packed(f, g)
        q = np.r_[HOME, pose(0.0, 0.0, 1.2)]
        status, out = packed.solve(q, x)
        assert status in ("NOT_CONVERGED", "LEFT_PATCH") or out[GAP] > 0.0
        assert np.isfinite(out).all()


# ---- without JIT -------------------------------------------------------------------------------------------------


def pairs_of_every_kind():
    out = []
    for kinds in KINDS:
        (case,) = random_cases(*kinds, 1)
        status, found = case.packed.solve(case.q, case.x + 1e-3 * case.moves, case.n)
        derivatives = case.packed.derivatives(case.q, case.x, case.n)
        out.append([status, found.tolist(), *(np.asarray(a).tolist() for a in derivatives)])
    return out


STEPS = """
import json
import numpy as np
from assembly._record import Store
from assembly.kinematics.motion import relative_pose, rotation
from assembly.proximity.extrema.feature_pair import newton_on_features
from tests.laws.test_feature_pairs import KINDS, random_cases

rng, out = np.random.default_rng(6), []
for kinds in KINDS[1:]:
    for case in random_cases(*kinds, 2):
        q = case.q.reshape(2, 7)
        pose = relative_pose(q, 0, rotation(q, 0), 1, rotation(q, 1))
        features = (case.packed.kinds[0], case.packed.at[0], case.packed.kinds[1], case.packed.at[1])
        direction = rng.uniform(-1.0, 1.0, 4) * case.moves / case.speed
        row = []
        for off in (1e-2, 1e-3, 1e-4):
            start = tuple((case.x + off * direction).tolist())
            _status, x, _frame = newton_on_features(
                Store(case.packed.table, case.packed.pool), *features, pose, start, tuple(case.n), 4.0, np.inf, 1
            )
            row.append(float(np.abs((np.array(x) - case.x) * case.speed).max()))
        out.append(row)
print(json.dumps(out))
"""


def test_plain_python_gives_the_same_pairs(run_python):
    code = (
        "import json; from tests.proximity.extrema.test_feature_pair import *; print(json.dumps(pairs_of_every_kind()))"
    )
    plain = json.loads(run_python(code, NUMBA_DISABLE_JIT="1"))
    assert len(plain) == len(KINDS) and len(plain[0][1]) == PAIR
    for a, b in zip(pairs_of_every_kind(), plain, strict=True):
        assert a[0] == b[0] == "CONVERGED"
        for x, y in zip(a[1:], b[1:], strict=True):
            # Without fused multiply-add: other roundings, amplified by the solve.
            np.testing.assert_allclose(y, x, rtol=0.0, atol=1e-11 * (1.0 + np.abs(x).max()))


def test_convergence_is_quadratic(run_python):
    # One step from three distances: a tenth of the distance leaves a hundredth of the error.
    for errors in json.loads(run_python(STEPS, NUMBA_DISABLE_JIT="1")):
        for far, near in zip(errors[:2], errors[1:], strict=True):
            assert near < 0.03 * far + 1e-12
        assert errors[2] < 1e-5
