"""Hard surfaces: knots nearly equal, high degrees, needles, collapsed edges, shapes that fit each other."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.stress.honest import check

STATUSES = tuple(asm.Status)


def patch(points, knots_u, knots_v, degrees):
    return asm.NurbsSurface(points, (knots_u, knots_v), degrees)


def dome(width, length, count=4, knots=None, degree=3):
    """z = -(x^2 / width^2 + y^2 / length^2) / 4 over a rectangle, as a net of so many points."""
    x, y = np.meshgrid(np.linspace(-width, width, count), np.linspace(-length, length, count), indexing="ij")
    z = -0.25 * ((x / width) ** 2 + (y / length) ** 2)
    clamped = np.concatenate([np.zeros(degree), np.linspace(0.0, 1.0, count - degree + 1), np.ones(degree)])
    rows = clamped if knots is None else knots
    return patch(np.stack([x, y, z], axis=2), rows, clamped, (degree, degree))


def dropped(surface, radius, above=(0.03, -0.02), height=0.5):
    """A ball over a surface, to touch it and to stay where it is sideways."""
    floor = asm.Body("floor", surface, fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(radius), position=(*above, radius + height))
    scene = asm.Assembly([floor, ball])
    scene.constrain(asm.Contact(floor, ball))
    scene.minimize(asm.Posture())
    return scene


def is_on(scene, solution):
    """The ball's center is one radius from the surface, by brute force over a grid around the contact."""
    floor, ball = scene.bodies
    radius = 0.5 * np.ptp(ball.face().face.surface.bounding_box()[0:2], axis=0)[2]
    (pair,) = solution.contacts.values()
    surface = floor.face().face.surface
    (low_u, high_u), (low_v, high_v) = surface.domain
    u = np.clip(pair.parameters[0] + np.linspace(-0.05, 0.05, 201) * (high_u - low_u), low_u, high_u)
    v = np.clip(pair.parameters[1] + np.linspace(-0.05, 0.05, 201) * (high_v - low_v), low_v, high_v)
    points = surface.evaluate(*np.meshgrid(u, v, indexing="ij"))
    distances = np.linalg.norm(points - solution.q[1, :3], axis=-1)
    # No point of the grid is nearer; the nearest is as near as the grid is fine.
    return distances.min() >= radius * (1.0 - 1e-12) and distances.min() <= radius * (1.0 + 1e-3)


@pytest.mark.parametrize("step", [1e-3, 1e-6, 1e-9, 1e-12])
def test_knots_nearly_equal(step):
    knots = [0, 0, 0, 0, 0.5, 0.5 + step, 1, 1, 1, 1]
    scene = dropped(dome(1.0, 1.0, 6, knots), 0.3)
    solution = scene.solve()
    assert check(scene, solution) is asm.Status.SOLVED
    assert is_on(scene, solution)


@pytest.mark.parametrize("degree", [2, 5, 9, 15])
def test_high_degrees(degree):
    scene = dropped(dome(1.0, 1.0, degree + 3, degree=degree), 0.3)
    solution = scene.solve()
    assert check(scene, solution) is asm.Status.SOLVED
    assert is_on(scene, solution)


@pytest.mark.parametrize("thin", [1e-2, 1e-4, 1e-6])
def test_needles(thin):
    """A patch as narrow as that; the ball touches it or the answer says that it does not."""
    scene = dropped(dome(thin, 1.0), 0.3, above=(0.1 * thin, -0.02))
    assert check(scene, scene.solve()) in STATUSES


@pytest.mark.parametrize("collapse", [0.0, 1e-12, 1e-6])
def test_collapsed_edges(collapse):
    """One side of the patch is a point, or nearly."""
    net = dome(1.0, 1.0).control_points.copy()
    net[0] = net[0].mean(axis=0) + collapse * (net[0] - net[0].mean(axis=0))
    knots = [0, 0, 0, 0, 1, 1, 1, 1]
    scene = dropped(patch(net, knots, knots, (3, 3)), 0.3)
    solution = scene.solve()
    assert check(scene, solution) is asm.Status.SOLVED
    assert is_on(scene, solution)


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-6, 1e-9, 0.0, -1e-3])
def test_a_ball_in_a_socket_of_nearly_its_size(gap):
    socket = asm.Face(asm.shapes.sphere(1.0 + gap), reversed=True)
    outer = asm.Body("socket", socket, fixed=True)
    inner = asm.Body("ball", asm.shapes.sphere(1.0), position=(0.02, 0.01, -0.015))
    scene = asm.Assembly([outer, inner])
    scene.constrain(asm.Contact(outer, inner))
    scene.minimize(asm.Posture())
    solution = scene.solve()
    status = check(scene, solution)
    if status is asm.Status.SOLVED:
        # The centers are as far apart as the radii differ; where these are equal, all pairs are extremal.
        np.testing.assert_allclose(np.linalg.norm(solution.q[1, :3]), abs(gap), rtol=0, atol=1e-11)


@pytest.mark.parametrize("gap", [1e-1, 1e-4, 1e-8, 0.0])
def test_conforming_cylinders(gap):
    bore = asm.Face(asm.shapes.cylinder(0.5 + gap, 2.0), reversed=True)
    sleeve = asm.Body("sleeve", bore, fixed=True)
    pin = asm.Body("pin", asm.shapes.cylinder(0.5, 1.0), position=(0.01, 0.02, 0.4))
    scene = asm.Assembly([sleeve, pin])
    scene.constrain(asm.Contact(sleeve, pin))
    assert check(scene, scene.solve()) in STATUSES
