"""Second derivatives of rows of contact manifolds are those of differences, by twists of both bodies."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle, polygon
from assembly.kinematics.pose import retract
from assembly.proximity import contact_manifold

TRIANGLE = [(-1.0, -0.8), (1.2, -0.5), (0.1, 1.1)]
# What lies on what, and how far above the origin of the first the second one is where it touches.
DOWN = Rotation.from_rotvec([np.pi, 0.0, 0.0])
CONE = Rotation.from_rotvec([0.0, 0.25 * np.pi, 0.0])
LYING = Rotation.from_rotvec([0.0, 0.5 * np.pi, 0.0])


def sheet(loop):
    return asm.Body("sheet", asm.shapes.trimmed_plane(loop)).faces[0]


def wall(faces, **which):
    """The only cylinder or cone of a body."""
    body = asm.Body("round", faces)
    (face,) = body.faces.cones() or body.faces.cylinders(**which)
    return face


def cone(outer, inset):
    """A solid with a cone from a radius of 0.5 to one of 1.5; the hollow one has an outer radius."""
    low, high = 0.5 + inset, 1.5 - inset
    if outer == 0.0:
        return asm.shapes.revolution(polygon([(0.0, low), (low, low), (high, high), (0.0, high)]))
    return asm.shapes.revolution(polygon([(low, low), (outer, low), (outer, high), (high, high)]))


PAIRS = {
    "polygons": (lambda: sheet(polygon(TRIANGLE)), lambda: sheet(polygon(TRIANGLE)), DOWN, 0.0),
    "discs": (lambda: sheet(circle(1.0)), lambda: sheet(circle(0.9, (0.5, 0.1))), DOWN, 0.0),
    "disc on polygon": (lambda: sheet(polygon(TRIANGLE)), lambda: sheet(circle(0.6)), DOWN, 0.0),
    "shaft": (
        lambda: wall(asm.shapes.plate(4.0, 4.0, 1.0, [(0.0, 0.0, 0.5)]), hole=True),
        lambda: wall(asm.shapes.solid_cylinder(0.49, 0.8)),
        Rotation.identity(),
        0.0,
    ),
    "long shaft": (
        lambda: wall(asm.shapes.plate(4.0, 4.0, 1.0, [(0.0, 0.0, 0.5)]), hole=True),
        lambda: wall(asm.shapes.solid_cylinder(0.5, 3.0)),
        Rotation.identity(),
        0.0,
    ),
    "rod over a corner": (
        lambda: sheet(polygon(TRIANGLE)),
        lambda: wall(asm.shapes.solid_cylinder(0.3, 4.0)),
        LYING,
        0.3,
    ),
    "rod on a disc": (lambda: sheet(circle(0.8)), lambda: wall(asm.shapes.solid_cylinder(0.3, 4.0)), LYING, 0.3),
    "rod within": (lambda: sheet(circle(2.0)), lambda: wall(asm.shapes.solid_cylinder(0.3, 1.0)), LYING, 0.3),
    "cone in its seat": (lambda: wall(cone(3.0, 0.2)), lambda: wall(cone(0.0, 0.1)), Rotation.identity(), 0.0),
    "long cone": (lambda: wall(cone(3.0, 0.2)), lambda: wall(cone(0.0, -0.2)), Rotation.identity(), 0.0),
    "cone on a disc": (lambda: sheet(circle(1.0)), lambda: wall(cone(0.0, 0.0)), CONE, 0.0),
    "ball in its socket": (
        lambda: asm.Body("socket", [asm.Face(asm.shapes.sphere(0.5), reversed=True)]).faces[0],
        lambda: asm.Body("ball", asm.shapes.sphere(0.4)).faces[0],
        DOWN,
        0.08,
    ),
    "ball in a hollow cone": (
        lambda: wall(cone(3.0, 0.2)),
        lambda: asm.Body("ball", asm.shapes.sphere(1.0)).faces[0],
        DOWN,
        1.6,
    ),
    "ball in a bore": (
        lambda: wall(asm.shapes.plate(4.0, 4.0, 1.0, [(0.0, 0.0, 0.5)]), hole=True),
        lambda: asm.Body("ball", asm.shapes.sphere(0.4)).faces[0],
        DOWN,
        0.1,
    ),
    "ball": (lambda: sheet(circle(2.0)), lambda: asm.Body("ball", asm.shapes.sphere(0.4)).faces[0], DOWN, 0.4),
}
RINGS = ("shaft", "long shaft", "cone in its seat", "long cone")


def moved(pose, twist):
    row = retract(pose.q[None], twist[None])[0]
    return asm.Pose(row[:3], row[3:])


def gaps_along(faces, poses, twist, step, found):
    """Gaps after a step along twists, of the rows that are where those found are; NaN where that is not told."""
    there = contact_manifold(*faces, poses=(moved(poses[0], step * twist[:6]), moved(poses[1], step * twist[6:])))
    if there is None:
        return np.full(len(found.gaps), np.nan)
    far = np.linalg.norm(found.places[:, None] - there.places, axis=2)
    near = far < 0.05
    return np.where(near.sum(axis=1) == 1, there.gaps[np.where(near, far, np.inf).argmin(axis=1)], np.nan)


def random_poses(rng, lean, turn, height):
    x, y, z, w = Rotation.random(rng=rng).as_quat()
    away = asm.Pose(rng.normal(size=3), (w, x, y, z))
    spin = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)])
    x, y, z, w = (Rotation.from_rotvec(lean * np.append(rng.normal(size=2), 0.0)) * spin * turn).as_quat()
    place = np.append((0.05 * lean if height == 0.0 else 0.1) * rng.normal(size=2), height + 0.1 * lean)
    return away, away @ asm.Pose(place, (w, x, y, z))


@pytest.mark.parametrize(
    "loops",
    [
        (polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)]), circle(1.0)),
        (circle(1.0), polygon([(-1, -1), (1, -1), (1, 1), (-1, 1)])),
        (circle(1.0), circle(0.5, (0.5, 0.0))),
    ],
)
def test_gaps_are_those_of_the_planes_where_borders_are_tangent(loops):
    a, b = map(sheet, loops)
    x, y, z, w = DOWN.as_quat()
    found = contact_manifold(a, b, poses=(asm.Pose(), asm.Pose((0.0, 0.0, 0.3), (w, x, y, z))))
    assert len(found.gaps) >= 8
    np.testing.assert_allclose(found.gaps, 0.3, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.places[:, 2], 0.3, rtol=0, atol=1e-12)
    assert np.isfinite(found.second_rates()).all()


@pytest.mark.parametrize("exchanged", [False, True])
@pytest.mark.parametrize("lean", [0.0, 1e-6, 0.03])
@pytest.mark.parametrize("name", PAIRS)
def test_second_rates_are_those_of_differences(name, lean, exchanged, cases):
    """Flush or with axes that meet as well: rows that have a kink there are none, or keep their direction."""
    rng = np.random.default_rng(4)
    a, b, turn, height = PAIRS[name]
    faces = (b(), a()) if exchanged else (a(), b())
    seen, step = 0, 1e-3
    for _ in range(cases(4, 100)):
        poses = random_poses(rng, lean, turn, height)[:: -1 if exchanged else 1]
        found = contact_manifold(*faces, poses=poses)
        second = found.second_rates()
        assert second.shape == (len(found.gaps), 12, 12) and np.isfinite(second).all()
        np.testing.assert_array_equal(second, second.transpose(0, 2, 1))
        twist = rng.normal(size=12) * np.tile([1.0, 1.0, 1.0, 0.3, 0.3, 0.3], 2)
        # What is nearest all around where axes all but meet turns by any angle in a step.
        steady = np.abs(second).max(axis=(1, 2)) < 30.0
        differences, firsts = [], []
        for size in (step, 0.5 * step):
            low, high = (gaps_along(faces, poses, twist, sign * size, found) for sign in (-1.0, 1.0))
            differences.append((low - 2.0 * found.gaps + high) / size**2)
            firsts.append((high - low) / (2.0 * size))
        told = steady & np.isfinite(differences).all(axis=0)
        if lean == 0.0 and name in RINGS:
            told[4::5] = False
        exact = np.einsum("i,kij,j->k", twist, second, twist)
        # Halving a step leaves a quarter of the error.
        error = np.abs(differences[0] - differences[1])
        assert (np.abs(exact - differences[1]) <= 1e-7 + error)[told].all()
        rates = np.hstack(found.rates()) @ twist
        assert (np.abs(rates - firsts[1]) <= 1e-9 + np.abs(firsts[0] - firsts[1]))[told].all()
        seen += int(told.sum())
    assert seen >= cases(4, 100)


def test_a_tilted_disc_is_as_low_as_the_formula_says():
    """Over a tilted circle of radius R the least gap is h - R |grad h|, which curves by R over the slope across it."""
    lower, upper = sheet(polygon([(-2, -2), (2, -2), (2, 2), (-2, 2)])), sheet(circle(1.0))
    tilt = 0.01
    x, y, z, w = (Rotation.from_rotvec([tilt, 0.0, 0.0]) * DOWN).as_quat()
    found = contact_manifold(lower, upper, poses=(asm.Pose(), asm.Pose((0.0, 0.0, 0.1), (w, x, y, z))))
    k = int(found.gaps.argmin())
    assert found.gaps[k] == pytest.approx(0.1 - np.sin(tilt), abs=1e-15)
    # Turned about y, across the tilt: - sqrt(sin(tilt)^2 + s^2) to second order, and about x: - sin(tilt + s).
    assert found.second_rates()[k, 10, 10] == pytest.approx(-1.0 / np.sin(tilt) + np.sin(tilt), rel=1e-9)
    assert found.second_rates()[k, 9, 9] == pytest.approx(np.sin(tilt), abs=1e-12)


@pytest.mark.parametrize("loop", [polygon(TRIANGLE), circle(0.8)])
def test_no_point_over_a_slanted_border_is_below_the_bound(loop, cases):
    """A rod that leans is lowest beside its lowest line where a border runs aslant."""
    rng, lower, rod, beside = np.random.default_rng(5), sheet(loop), wall(asm.shapes.solid_cylinder(0.5, 3.0)), 0
    xy = rng.uniform(-1.2, 1.2, (20000, 2))
    xy = xy[lower.face.contains(*xy.T)]
    for _ in range(cases(40, 1000)):
        spin = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)])
        turn = spin * Rotation.from_rotvec(rng.uniform(0.02, 0.2) * rng.normal(size=3)) * LYING
        x, y, z, w = turn.as_quat()
        center = np.append(rng.uniform(-0.3, 0.3, 2), 0.5)
        found = contact_manifold(lower, rod, poses=(asm.Pose(), asm.Pose(center, (w, x, y, z))))
        if found is None:
            continue
        # The rod is at most as high over a point as where the vertical there enters its endless cylinder.
        axis = turn.apply([0.0, 0.0, 1.0])
        off = np.column_stack([xy, np.zeros(len(xy))]) - center
        up, off = np.array([0.0, 0.0, 1.0]) - axis[2] * axis, off - np.outer(off @ axis, axis)
        half = off @ up
        root = half**2 - (up @ up) * ((off**2).sum(axis=1) - 0.25)
        heights = (-half[root > 0.0] - np.sqrt(root[root > 0.0])) / (up @ up)
        along = (np.column_stack([xy[root > 0.0], heights]) - center) @ axis
        gaps = heights[np.abs(along) < 1.5]
        assert gaps.min(initial=np.inf) >= found.bound
        assert found.bound <= found.gaps.min()
        beside += gaps.min(initial=np.inf) < found.gaps.min() + 1e-3
    assert beside > cases(5, 100)
