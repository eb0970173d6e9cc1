"""Which surfaces no rigid motion takes along themselves: none of those that are elementary or swept, all wavy ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly import NurbsSurface
from assembly.geometry.recognition.elementary import elementary_form
from assembly.geometry.recognition.forms import Freeform
from assembly.geometry.recognition.nets import has_no_motion
from tests.geometry.recognition.constructions import Placement, revolved, rewritten
from tests.geometry.recognition.test_elementary import KINDS, random_surface

# Squares of singular values are told to some roundings: what moves along itself is known by less than a tenth of what
# recognition asks, 1e-5.
LOOSE = 1e-6


def without_motion(surface, loose):
    low, high = surface.bounding_box()
    return has_no_motion(surface.bezier_pieces(), 0.5 * low + 0.5 * high, surface.size, loose)


def wavy_profile(rng):
    """Control points (5, 3) of a profile beside the axis, homogeneous, its knots and degree."""
    rho, z = 1.0 + 0.4 * rng.random(5), np.linspace(0.0, 1.0, 5)
    return np.column_stack([rho, z, np.ones(5)]), np.array([0.0] * 4 + [0.5] + [1.0] * 4), 3


def extruded(rng):
    """A wavy curve along straight lines."""
    profile, knots, degree = wavy_profile(rng)
    ends = profile[:, None] * [1.0, 1.0, 0.0] + np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    return NurbsSurface(ends, (knots, [0.0, 0.0, 1.0, 1.0]), (degree, 1))


def screwed(rng):
    """A helicoid: a line that turns about an axis and goes along it. It is no plane, and no turn or slide keeps it."""
    at = np.linspace(0.0, 1.2, 400)
    rows = np.stack([np.cos(at), np.sin(at), 0.4 * at], axis=1)
    axis = np.stack([0.0 * at, 0.0 * at, 0.4 * at], axis=1)
    knots = np.concatenate([[0.0], np.linspace(0.0, 1.0, 400), [1.0]])
    return NurbsSurface(np.stack([axis, rows], axis=1), (knots, [0.0, 0.0, 1.0, 1.0]), (1, 1))


@pytest.mark.parametrize("kind", [*KINDS, "extrusion", "revolution"])
@pytest.mark.parametrize("far", [0.0, 1e3])
def test_what_is_elementary_or_swept_has_a_motion(kind, far, cases):
    rng = np.random.default_rng(5)
    for _ in range(cases(20, 500)):
        if kind == "extrusion":
            surface = extruded(rng)
        elif kind == "revolution":
            surface = revolved(*wavy_profile(rng), 2.0, 2)
        else:
            surface = random_surface(kind, rng)[0]
        surface = Placement(rng, surface.size, far).surface(rewritten(surface, rng))
        assert not without_motion(surface, LOOSE)


def test_a_screw_is_a_motion():
    # Its facets are flat only to the square of their length, which is what is left of the sixth singular value.
    surface = screwed(np.random.default_rng(0))
    assert not without_motion(surface, 1e-4)


def test_wavy_surfaces_have_none(cases):
    rng = np.random.default_rng(6)
    x, y = np.meshgrid(*2 * [np.linspace(0.0, 1.0, 5)], indexing="ij")
    knots = [0.0] * 4 + [0.4] + [1.0] * 4
    for _ in range(cases(50, 2000)):
        net = (
            np.stack([x, y, 0.3 * rng.standard_normal((5, 5))], axis=2) @ Rotation.random(random_state=rng).as_matrix()
        )
        surface = NurbsSurface(net, (knots, knots), (3, 3), rng.uniform(0.5, 2.0, (5, 5)))
        assert without_motion(surface, 1e-5)
        assert isinstance(elementary_form(surface), Freeform)


@pytest.mark.parametrize("kind", ["cylinder", "cone", "sphere", "torus"])
def test_one_control_point_that_is_off_takes_the_motion_away(kind):
    # Elevated, so that one piece has more samples than an elementary one needs points.
    rng = np.random.default_rng(7)
    surface = random_surface(kind, rng)[0].elevate((4, 4))
    for size in (1e-2, 1e-4):
        net = surface.control_points.copy()
        net[3, 2] += size * surface.size * np.array([0.3, 0.5, 0.7])
        bent = NurbsSurface(net, surface.knots, surface.degree, surface.weights)
        assert without_motion(bent, 1e-3 * size)
        assert not without_motion(surface, 1e-3 * size)
