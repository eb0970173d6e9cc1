"""Pairs of a continuum whose points slide to an end of their patch: `solve/loop/ends.py`."""

from __future__ import annotations

from math import cos, radians, sin, sqrt

import numpy as np
import pytest

import assembly as asm


def _cam(roller, heights, swapped):
    """A round cam of radius 3 that turns about an axis 1 off its middle, and a roller on a slide that touches it."""
    ground = asm.Body("ground", fixed=True)
    cam = asm.Body("cam", asm.shapes.solid_cylinder(3.0, heights[0]))
    follower = asm.Body("follower", asm.shapes.solid_cylinder(roller, heights[1]), position=(0, 4 + roller, 0))
    drive = asm.Revolute(ground.frame(x=(0, 1, 0)), cam.frame(at=(0, -1, 0), x=(0, 1, 0)), "drive", angle=0.0)
    guide = asm.Prismatic(ground.frame(z=(0, 1, 0)), follower.frame(z=(0, 1, 0)), "guide")
    walls = (cam.face("wall"), follower.face("wall"))
    scene = asm.Assembly([ground, cam, follower])
    scene.constrain(drive, guide, asm.Contact(*(walls[::-1] if swapped else walls), "touch"))
    return scene, drive


@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize("heights", [(1.0, 2.0), (2.0, 1.0), (1.0, 1.0)])
@pytest.mark.parametrize("roller", [0.5, 1.0, 2.0])
def test_parallel_cylinders_converge_quadratically(roller, heights, swapped):
    # Cut off at the end of a wall, every step halves the rows: some 30 iterations, of which rounding decided the last.
    scene, drive = _cam(roller, heights, swapped)
    solution = None
    for degrees in range(0, 50, 5):
        drive.angle = radians(degrees)
        solution = scene.solve(solution)
        assert solution.status is asm.Status.SOLVED
        assert solution.iterations <= (15 if degrees == 0 else 6)
        t = radians(degrees)
        slide = cos(t) + sqrt((3 + roller) ** 2 - sin(t) ** 2)
        assert abs(solution.values["guide.slide"] - slide) < 1e-11  # the tolerance of rows, 1e-12 of lengths of 10


@pytest.mark.parametrize("end", [-1.0, 1.0])
@pytest.mark.parametrize("off", [0.0, 0.3])
def test_a_shaft_that_stands_out_over_the_edge_of_a_plane(end, off):
    # Half of it, so that its points of contact may come to the edge.
    ground = asm.Body("ground", asm.shapes.plane(4.0, 4.0), fixed=True)
    shaft = asm.Body("shaft", asm.shapes.cylinder(0.5, 2.0), position=(2.0 * end, off, 0.6))
    scene = asm.Assembly([ground, shaft])
    scene.constrain(asm.Parallel(ground.frame(z=(1, 0, 0)), shaft.frame()), asm.Contact(ground, shaft, "touch"))
    solution = scene.solve()
    assert solution.status is asm.Status.SOLVED
    assert solution.iterations <= 10
    assert abs(abs(solution.pose(shaft).position[2]) - 0.5) < 1e-11


SHAPES = {"cone": (0.8, 1.5, 0.2), "cylinder": (0.5, 1.0)}


@pytest.mark.parametrize(
    ("seed", "names"),
    [
        (0, ("cylinder", "cylinder")),
        (5, ("cylinder", "cylinder")),
        (6, ("cone", "cylinder")),
        (21, ("cone", "cylinder")),
        (8, ("cylinder", "cone")),
        (26, ("cylinder", "cone")),
        (24, ("cone", "cone")),
        (35, ("cone", "cone")),
    ],
)
def test_a_solve_goes_on_from_a_contact_at_an_end(seed, names):
    # Each comes to rest with a point at the end of its patch, where Newton's method on the surfaces finds no pair.
    rng = np.random.default_rng(seed)
    rng.integers(2, size=2)
    position = (0.9 + rng.uniform(-0.2, 0.3), 0.0, rng.uniform(-1.6, 1.6))
    quaternion = np.concatenate([[1.0], 0.2 * rng.normal(size=3)])
    shapes = [getattr(asm.shapes, name)(*SHAPES[name]) for name in names]
    a = asm.Body("a", shapes[0], fixed=True)
    b = asm.Body("b", shapes[1], position=position, quaternion=quaternion / np.linalg.norm(quaternion))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Contact(a, b, "touch"))
    first = scene.solve()
    assert first.status is asm.Status.SOLVED
    again = scene.solve(first)
    assert again.status is asm.Status.SOLVED
    assert again.iterations == 0
    assert abs(again.q - first.q).max() < 1e-15
