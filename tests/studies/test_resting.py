"""An objective that draws bodies onto what they fit, and what is seated where faces contradict each other."""

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.shapes.plane_curves import polygon
from assembly.proximity.manifolds.closed_gaps import closed_gaps
from assembly.solve.interruption import CTRL_C
from assembly.studies.seated import seated


def bolt_drawn_down(force=-3.0):
    """A headed bolt 0.5 free in its hole, drawn down by points of its head: the only answer is flush."""
    plate = asm.Body("plate", asm.shapes.plate(40, 40, 10, [(0, 0, 4.5)]), fixed=True)
    head = asm.shapes.plate(20, 20, 4, [(0, 0, 4.0)])
    ring = asm.Body("ring", head, position=(0.3, -0.2, 40.0), quaternion=(0.999, 0.02, -0.03, 0.0))
    scene = asm.Assembly([plate, ring])
    scene.constrain(asm.Clearance())
    corners = ((9.0, 9.0), (-9.0, 9.0), (9.0, -9.0), (-9.0, -9.0))
    scene.minimize(*(asm.PointDistance(ring.point(x, y, -2.0), (x, y, 5.0 + force)) for x, y in corners))
    return scene


def test_what_is_drawn_into_what_it_fits_rests_on_it():
    solution = bolt_drawn_down().solve()
    assert solution.success and solution.proved
    # Flush, where points are 3 below it: each of the four distances is 3.
    assert solution.q[1] == pytest.approx([0, 0, 7, 1, 0, 0, 0], abs=1e-9)
    assert solution.objective == pytest.approx(4 * 9.0, rel=1e-9)
    assert solution.put_together


def test_what_is_drawn_away_is_not_held():
    solution = bolt_drawn_down(force=2.0).solve()
    assert solution.success
    assert solution.q[1, 2] == pytest.approx(9.0, abs=1e-9)


def test_rows_of_a_ball_in_its_socket_are_its_slopes():
    ball = asm.Body("ball", asm.shapes.sphere(2.0))
    hollow = [asm.Face(face.surface, face.outer, face.holes, reversed=not face.reversed) for face in _faces(ball)]
    socket = asm.Body("socket", hollow)
    shapes = (tuple(_faces(socket)), tuple(_faces(ball)))
    normals, places, is_flat = closed_gaps(shapes, np.eye(3), np.zeros(3), (-1e-9, 1e-9))
    assert len(normals) > 40 and not is_flat.any()
    assert places == pytest.approx(-2.0 * normals, abs=1e-12)
    # A ball that is moved by v is nearer to the wall along u by u.v: the gap's slope is -u.
    step = 1e-6 * np.array([0.3, -0.5, 0.8])
    outward = places / 2.0
    gaps = 2.0 - np.array([np.linalg.norm(step + 2.0 * u) for u in outward])
    assert gaps == pytest.approx(normals @ step, abs=1e-11)
    # With play there are none that are closed.
    assert not len(closed_gaps(shapes, np.eye(3), np.array([1e-3, 0, 0]), (-1e-9, 1e-9))[0])


def test_rows_of_a_ball_do_not_depend_on_how_long_its_parameters_are():
    (whole,) = _faces(asm.Body("ball", asm.shapes.sphere(2.0)))
    surface = whole.surface
    # As a profile that begins on its axis is revolved with lengths for angles: the first circle has hardly any.
    short = asm.NurbsSurface(
        surface.control_points, (1e-15 * surface.knots[0], surface.knots[1]), surface.degree, surface.weights
    )
    hollow = asm.Face(surface, whole.outer, whole.holes, reversed=not whole.reversed)
    expected, found = (
        closed_gaps(((hollow,), (ball,)), np.eye(3), np.zeros(3), (-1e-9, 1e-9))[0] for ball in (whole, asm.Face(short))
    )
    assert len(expected) > 40 and (found == expected).all()


def _faces(body):
    return [face.face for face in body.faces]


def test_flat_faces_that_others_keep_apart_are_not_seated():
    # A boss 3 high in a recess 3.5 deep: the flange lies on the rim, the boss does not reach the floor.
    def stepped(step):
        outline = [(-20, 0), (-20, -8), (20, -8), (20, 0), (8, 0), (8, step), (-8, step), (-8, 0)]
        return _prism(outline)

    lower = asm.Body("lower", stepped(-3.5), fixed=True)
    upper = asm.Body(
        "upper", _prism([(-20, 0), (-7.9, 0), (-7.9, -3), (7.9, -3), (7.9, 0), (20, 0), (20, 6), (-20, 6)])
    )
    scene = asm.Assembly([lower, upper])
    scene.constrain(asm.Clearance())
    poses = np.array([[0, 0, 0, 1, 0, 0, 0], [0.02, -0.3, 0.2, 0.99999, 0, 0, 0.002]], dtype=float)
    poses[1, 3:] /= np.linalg.norm(poses[1, 3:])
    seat = seated(scene, poses, 1e-9, CTRL_C)
    assert seat is not None
    assert seat.poses[1, 1] == pytest.approx(0.0, abs=1e-9)
    assert seat.poses[1, 3] == pytest.approx(1.0, abs=1e-9)


def _prism(points):
    curves = []
    for k, point in enumerate(points):
        ends = np.array([point, points[(k + 1) % len(points)]], dtype=float)
        length = float(np.linalg.norm(ends[1] - ends[0]))
        curves.append(asm.NurbsCurve(ends, [0.0, 0.0, length, length], 1))
    return asm.shapes.extrusion(curves, 30.0)


# A cone of 30 degrees from 5 to 12.9, a hole of 8, and a countersink from 4 to 8; where a ball of 12 lies on each.
SEATS = {
    "seat": ([(5, -5 * 3**0.5), (25, -5 * 3**0.5), (25, 5), (10 + 5 / 3**0.5, 5)], 24 - 10 * 3**0.5),
    "hole": ([(8, -5), (30, -5), (30, 5), (8, 5)], 5 + 80**0.5),
    "countersink": ([(4, -5), (30, -5), (30, 5), (8, 5), (4, 1)], 5 + 80**0.5),
}


def ball_over(name, place):
    """A ball of 12 over a turned part."""
    seat = asm.Body("seat", asm.shapes.revolution(polygon(SEATS[name][0])), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(12.0), place)
    scene = asm.Assembly([seat, ball])
    scene.constrain(asm.Clearance())
    return scene, ball


@pytest.mark.parametrize("name", SEATS)
def test_a_ball_comes_to_rest_where_it_touches_all_around(name):
    """It has one row, at its nearest point, that jumped around: out of iterations, or stalled, at the right place."""
    height = SEATS[name][1]
    for place in ((0.0, 0.0, height), (1.0, 2.0, height + 4.0)):
        for aim in ((0.0, 0.0, height - 3.0), (0.5, 0.2, height - 5.0)):
            scene, ball = ball_over(name, place)
            scene.minimize(asm.PointDistance(ball.point(0, 0, 0), aim))
            solution = scene.solve()
            assert solution.success and solution.proved, (place, aim)
            np.testing.assert_allclose(solution.q[1, :3], (0.0, 0.0, height), rtol=0, atol=1e-8)


@pytest.mark.parametrize("name", SEATS)
def test_a_ball_where_it_touches_all_around_stays(name):
    scene, _ = ball_over(name, (0.0, 0.0, SEATS[name][1]))
    solution = scene.solve()
    assert solution.success and solution.proved and np.array_equal(solution.q, scene.q)


@pytest.mark.parametrize("name", SEATS)
def test_rows_of_a_ball_on_a_circle_are_its_slopes(name):
    scene, _ = ball_over(name, (0.0, 0.0, SEATS[name][1]))
    shapes = tuple(tuple(_faces(body)) for body in scene.bodies)
    shift = np.array([0.0, 0.0, SEATS[name][1]])
    normals, places, _ = closed_gaps(shapes, np.eye(3), shift, (-1e-9, 1e-9))
    assert len(normals) >= 12
    back, own, _ = closed_gaps(shapes[::-1], np.eye(3), -shift, (-1e-9, 1e-9))
    np.testing.assert_allclose(back, -normals, rtol=0, atol=1e-12)
    np.testing.assert_allclose(own, places - shift, rtol=0, atol=1e-12)
    # Each point of the ball goes off the wall's along the normal, at the rate of that.
    feet, step = places.copy(), 1e-6 * np.array([0.3, -0.5, 0.8])
    gaps = np.linalg.norm(shift + step - feet, axis=1) - 12.0
    np.testing.assert_allclose(gaps, normals @ step, rtol=0, atol=1e-12)


def test_a_ball_that_is_drawn_out_of_its_seat_is_not_held():
    scene, ball = ball_over("seat", (0.0, 0.0, SEATS["seat"][1]))
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (0.0, 0.0, 20.0)))
    solution = scene.solve()
    assert solution.success and solution.q[1, 2] == pytest.approx(20.0, abs=1e-6)
