"""Sizes of bodies whose points are tracked: those that are promised hold, others are refused at once."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError


def spread_out(surface: asm.NurbsSurface, size: float) -> asm.NurbsSurface:
    """The surface times a size, with knots from 0 to 1."""
    knots = [(own - own[0]) / (own[-1] - own[0]) for own in surface.knots]
    return asm.NurbsSurface(surface.control_points * size, knots, surface.degree, surface.weights)


def drawn_together(shape, radius, by, other=None):
    """Two bodies of such a radius along x, the second one drawn into the first one."""
    a, b = asm.Body("a", shape, fixed=True), asm.Body("b", other or shape, (3.0 * radius, 0, 0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b) if by == "contact" else asm.Clearance())
    scene.minimize(asm.PointDistance(b.point(0, 0, 0), (0.1 * radius, 0, 0)))
    return scene.solve()


def off_touching(solution, radius):
    return abs(np.linalg.norm(solution.pose("b").position) / (2.0 * radius) - 1.0)


# Knots of a ball are lengths on it, up to 2 pi radii.
@pytest.mark.parametrize("radius", [1e-59, 1e-40, 1.0, 1e40, 1e59])
@pytest.mark.parametrize("by", ["contact", "clearance"])
def test_balls_of_promised_sizes_come_to_touch(radius, by):
    solution = drawn_together(asm.shapes.sphere(radius), radius, by)
    assert solution.success and off_touching(solution, radius) < 1e-9


@pytest.mark.parametrize("radius", [1e-59, 1e-40, 1.0, 1e40, 1e59])
def test_blocks_of_promised_sizes_come_to_touch(radius):
    # Not equal blocks: edges that coincide all around have rows of which rounding decides, at any size.
    wide, narrow = asm.shapes.box(2 * radius, 2 * radius, 2 * radius), asm.shapes.box(2 * radius, 1.4 * radius, radius)
    solution = drawn_together(wide, radius, "clearance", narrow)
    assert solution.success and off_touching(solution, radius) < 1e-9


# The control points of a ball are in a cube, whose diagonal is the size.
@pytest.mark.parametrize("radius", [3e-76, 1e-74, 1.0, 1e74, 2.8e74])
def test_knots_may_have_another_length_than_what_is_kept_apart(radius):
    solution = drawn_together(spread_out(asm.shapes.sphere(1.0), radius), radius, "clearance")
    assert solution.success and off_touching(solution, radius) < 1e-9


@pytest.mark.parametrize("size", [1e-61, 1e61, 1e90])
def test_parameters_that_are_too_long_or_too_short_are_refused(size):
    a, b = asm.Body("a", asm.shapes.torus(size, 0.2 * size)), asm.Body("b", asm.shapes.sphere(1.0))
    said = r" has a face whose u goes from .* expected knots that span 1e-60 to 1e\+60"
    with pytest.raises(InputError, match=r"b, Body\('a', 1 faces\)," + said):
        asm.Contact(b, a)
    with pytest.raises(InputError, match=r"bodies\[1\], 'a'," + said):
        asm.Clearance([b, a])
    with pytest.raises(InputError, match=r"bodies\[0\], 'a'," + said):
        asm.Manager([a, b])
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance())
    with pytest.raises(InputError, match="body 'a' of 'clearance'" + said):
        scene.solve()


@pytest.mark.parametrize("size", [1e-76, 1e76, 1e100, 1e140])
def test_bodies_that_are_too_large_or_too_small_are_refused_by_clearances_alone(size):
    ball = spread_out(asm.shapes.sphere(0.5), size)
    a, b = asm.Body("a", ball, fixed=True), asm.Body("b", ball, (2.0 * size, 0, 0))
    with pytest.raises(InputError, match=r"bodies\[0\], 'a', has the size .*; expected 1e-75 to 1e\+75 for clearances"):
        asm.Clearance([a, b])
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b))
    assert scene.solve().success
