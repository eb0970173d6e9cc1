"""Manifolds of plane faces: no gap that faces have in common is below the bound, and rates are those of differences.

Samples are judged by the faces' own tests of (u, v), which know nothing of segments.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle, polygon
from assembly.proximity.manifolds.flat_manifolds import flat_manifold, flat_manifolds
from assembly.proximity.manifolds.regions import plane_region
from tests.proximity.clearance.scenes import faces_of
from tests.proximity.manifolds.plane_faces import plane_faces

UPRIGHT = Rotation.identity()


def upward(face):
    """The sign of a face's normal along z."""
    return -1.0 if face.reversed else 1.0


def conforming_pose(rng, a, b, lean, off=0.3):
    """A pose (turn, shift) of face b over a: about `lean` from parallel, opposed to a."""
    flip = Rotation.from_rotvec([np.pi, 0.0, 0.0]) if upward(a) == upward(b) else UPRIGHT
    tilt = Rotation.from_rotvec(lean * np.append(rng.normal(size=2), 0.0))
    turn = tilt * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)]) * flip
    return turn.as_matrix(), np.append(rng.uniform(-1.0, 1.0, 2), off * lean * rng.normal())


def sampled_gaps(rng, a, b, turn, shift, count=200):
    """Gaps along the normal of a at random points of it that b covers."""
    xy = rng.uniform(-1.5, 1.5, (count, 2))
    xy = xy[a.contains(*xy.T)]
    # x + h n is on b's plane: its third coordinate there is zero.
    n = np.array([0.0, 0.0, upward(a)])
    points = np.column_stack([xy, np.zeros(len(xy))])
    h = ((shift - points) @ turn[:, 2]) / (n @ turn[:, 2])
    there = (points + h[:, None] * n - shift) @ turn
    return h[b.contains(there[:, 0], there[:, 1])]


def test_bounds_hold_for_random_faces(cases):
    rng = np.random.default_rng(0)
    faces, seen, tight = plane_faces(), 0, []
    regions = [plane_region(face) for face in faces]
    for _ in range(cases(1000, 100000)):
        i, j = rng.integers(len(faces), size=2)
        turn, shift = conforming_pose(rng, faces[i], faces[j], 10.0 ** rng.uniform(-10.0, -1.0))
        manifold = flat_manifold(regions[i], regions[j], turn, shift)
        gaps = sampled_gaps(rng, faces[i], faces[j], turn, shift)
        if manifold is None:
            # Samples are nowhere on both: what they have in common may be thinner than these are apart.
            assert len(gaps) <= 1
            continue
        if len(gaps):
            seen += 1
            assert gaps.min() >= manifold.bound
            span = np.ptp(manifold.gaps)
            if len(gaps) > 30 and span > 0.0:
                tight.append((gaps.min() - manifold.bound) / span)
        # The bound is that of the rows, which are places of both, but for what arcs are off that lean.
        assert manifold.bound <= manifold.gaps.min()
        lean = np.arcsin(np.hypot(*turn[:2, 2]))
        assert manifold.gaps.min() - manifold.bound < 1e-11 + 1.5 * np.tan(lean) * (1.0 - np.cos(lean))
    assert seen > cases(600, 60000)
    assert np.median(tight) < 0.2


def twisted(turn, shift, twist, step):
    """A pose after a step along a twist (v, w), about the origin."""
    w = Rotation.from_rotvec(step * twist[3:]).as_matrix()
    return w @ turn, w @ shift + step * twist[:3]


@pytest.mark.parametrize("lean, off", [(0.3, 3e-9), (1e-3, 5e-5), (1e-5, 3e-8)])
def test_rates_are_those_of_differences(cases, lean, off):
    """Faces with arcs, too: where these lean, they are taken for circles, which rates are off by."""
    rng = np.random.default_rng(1)
    faces = [face for face in plane_faces() if lean < 0.1 or all(curve.degree == 1 for curve in face.boundary)]
    regions, step, seen = [plane_region(face) for face in faces], 3e-5, 0
    for _ in range(cases(150, 1500)):
        i, j = rng.integers(len(faces), size=2)
        turn, shift = conforming_pose(rng, faces[i], faces[j], lean)
        twist = rng.normal(size=6)
        steps = (-step, -0.5 * step, 0.0, 0.5 * step, step)
        there = [flat_manifold(regions[i], regions[j], *twisted(turn, shift, twist, s)) for s in steps]
        if any(m is None for m in there) or len({len(m.gaps) for m in there}) > 1:
            continue
        # Corners that take turns at being the first of a hull, or of which others became corners.
        if max(np.abs(m.places - there[2].places).max() for m in there) > 1e-3:
            continue
        seen += 1
        wide, rates = (there[4].gaps - there[0].gaps) / (2.0 * step), (there[3].gaps - there[1].gaps) / step
        # What half the step changes is more than what is left of the error.
        assert (np.abs(there[2].rates() @ twist - rates) <= off + np.abs(wide - rates)).all()
    assert seen > cases(60, 600)


def square(half, at=(0.0, 0.0)):
    x, y = at
    return asm.shapes.trimmed_plane(
        polygon([(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)])
    )


DOWN = Rotation.from_rotvec([np.pi, 0.0, 0.0]).as_matrix()


@pytest.mark.parametrize(
    "turn, shift, rows",
    [
        (DOWN, (0.0, 0.0, 0.0), 4),  # flush, and each the other one's size
        (DOWN, (0.5, 0.5, 0.0), 4),
        (DOWN, (2.0, 0.0, 0.0), 0),  # an edge in common
        (DOWN, (2.0, 2.0, 0.0), 0),  # a corner
        (DOWN, (3.0, 0.0, 0.0), 0),  # nothing
        (np.eye(3), (0.0, 0.0, 0.0), 0),  # both look up
        (Rotation.from_rotvec([0.5 * np.pi, 0.0, 0.0]).as_matrix(), (0.0, 0.0, 0.0), 0),  # across
    ],
)
def test_faces_that_share_little(turn, shift, rows):
    region = plane_region(square(1.0))
    manifold = flat_manifold(region, region, turn, np.array(shift))
    assert (0 if manifold is None else len(manifold.gaps)) == rows
    if manifold is not None:
        assert manifold.gaps == pytest.approx(0.0, abs=1e-15)
        assert -1e-11 < manifold.bound <= 0.0


def test_an_arc_has_eight_rows_and_its_lowest_point():
    """Over a circle of radius R the least gap is h(c) - R |grad h|."""
    plane, disc = square(2.0), asm.shapes.trimmed_plane(circle(1.0))
    turn = Rotation.from_rotvec(0.01 * np.array([np.cos(0.2), np.sin(0.2), 0.0])).as_matrix() @ DOWN
    manifold = flat_manifold(plane_region(disc), plane_region(plane), turn, np.array([0.0, 0.0, 0.1]))
    assert len(manifold.gaps) == 9
    assert manifold.gaps.min() == pytest.approx(0.1 - np.tan(0.01), abs=1e-12)
    flush = flat_manifold(plane_region(disc), plane_region(plane), DOWN, np.array([0.0, 0.0, 0.1]))
    assert len(flush.gaps) == 8


def test_holes_drop_out():
    """Of a plate with a hole on another one only the corners are rows; over a disc that is within the hole are none."""
    holed = asm.shapes.trimmed_plane(square(1.0).outer.curves, [circle(0.5)])
    plain, disc = plane_region(square(1.0)), asm.shapes.trimmed_plane(circle(0.4))
    assert len(flat_manifold(plain, plane_region(holed), DOWN, np.zeros(3)).gaps) == 4
    assert flat_manifold(plane_region(holed), plane_region(disc), DOWN, np.zeros(3)) is None


def test_of_two_bodies_those_that_lie_on_each_other():
    """A box in the corner of a slot: its floor and one flank, and no others."""
    slot = faces_of(
        asm.shapes.extrusion(polygon([(-2, -1), (2, -1), (2, 1), (1, 1), (1, 0), (-1, 0), (-1, 1), (-2, 1)]), 4.0)
    )
    box = faces_of(asm.shapes.box(1.0, 0.5, 1.0))
    found = flat_manifolds((slot, box), np.eye(3), np.array([0.5, 0.25, 0.0]), (-1e-9, 1e-9))
    assert len(found) == 2
    assert all(len(manifold.gaps) == 4 for _, manifold in found)
    assert sorted(manifold.normals[0].round(12).tolist() for _, manifold in found) == [
        [-1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
    ]
    assert flat_manifolds((slot, box), np.eye(3), np.array([0.5, 0.25 - 1e-3, 0.0]), (-1e-9, 1e-9)) != found
