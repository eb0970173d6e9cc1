"""Manifolds of what is round on plane faces: where samples are nearest, and rates of differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.recognition.forms import Cone, Cylinder, Sphere, Turn
from assembly.geometry.shapes.plane_curves import circle
from assembly.proximity.manifolds.line_manifolds import line_manifold, line_manifolds
from assembly.proximity.manifolds.regions import plane_region
from tests.proximity.clearance.scenes import direction, faces_of
from tests.proximity.manifolds.plane_faces import plane_faces

AROUND = Turn(np.array([1.0, 0.0, 0.0]), 2.0 * np.pi)
Z = np.array([0.0, 0.0, 1.0])
ROUNDS = {
    "cylinder": Cylinder(np.zeros(3), Z, 0.3, (-0.7, 0.7), AROUND, True, 0.0),
    "cone": Cone(np.zeros(3), Z, 0.4, (0.3, 1.5), AROUND, True, 0.0),
    "ball": Sphere(np.zeros(3), 0.4, True, 0.0),
}


def lying(rng, name, up, lean):
    """A pose of what is round over the xy-plane (or under it), off it by about `lean`."""
    if name == "ball":
        turn, height = Rotation.random(rng=rng), 0.4
    else:
        # Its nearest line is along x; then it is turned about z.
        down = Rotation.from_rotvec([0.0, 0.5 * np.pi - (0.4 if name == "cone" else 0.0), 0.0])
        turn = Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 6.0)]) * down
        height = 0.3 if name == "cylinder" else 0.0
    tilt = Rotation.from_rotvec(lean * np.append(rng.normal(size=2), 0.0))
    flip = Rotation.identity() if up else Rotation.from_rotvec([np.pi, 0.0, 0.0])
    shift = np.append(rng.uniform(-1.0, 1.0, 2), height + lean * rng.normal())
    return (flip * tilt * turn).as_matrix(), flip.apply(shift)


def samples(rng, form, count):
    """Random points of what is round."""
    if isinstance(form, Sphere):
        return form.center + form.radius * np.array([direction(rng) for _ in range(count)])
    height = rng.uniform(*form.heights, count)
    turn = rng.uniform(0.0, 2.0 * np.pi, count)
    radius = height * np.tan(form.half_angle) if isinstance(form, Cone) else form.radius
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


@pytest.mark.parametrize("name", ROUNDS)
def test_no_sample_of_the_nearest_line_is_below_the_bound(name, cases):
    rng, form, seen = np.random.default_rng(0), ROUNDS[name], 0
    faces = plane_faces()
    regions = [plane_region(face) for face in faces]
    for _ in range(cases(200, 20000)):
        k = int(rng.integers(len(faces)))
        up = not faces[k].reversed
        turn, shift = lying(rng, name, up, 10.0 ** rng.uniform(-9.0, -1.5))
        manifold = line_manifold(regions[k], form, turn, shift)
        n = np.array([0.0, 0.0, 1.0 if up else -1.0])
        # The nearest point of each circle of what is round, by the turn that is lowest of it.
        if name == "ball":
            points = (shift - form.radius * n)[None]
        else:
            side = turn.T @ n
            side = side - side[2] * Z
            height = np.linspace(*form.heights, 200)
            radius = height * np.tan(form.half_angle) if name == "cone" else np.full(200, form.radius)
            points = (height[:, None] * Z - radius[:, None] * side / np.linalg.norm(side)) @ turn.T + shift
        gaps = (points @ n)[faces[k].contains(points[:, 0], points[:, 1])]
        if manifold is None:
            assert len(gaps) <= 1
            continue
        seen += 1
        assert len(manifold.gaps) == (1 if name == "ball" else 2)
        assert gaps.min(initial=np.inf) >= manifold.bound - 1e-14
        assert manifold.gaps.min() - manifold.bound < 1e-12
        # None of the surface is lower than the line.
        everywhere = (samples(rng, form, 100) @ turn.T + shift) @ n
        assert everywhere.min() >= (points @ n).min() - 1e-14
    assert seen > cases(80, 8000)


@pytest.mark.parametrize("name", ROUNDS)
def test_rates_are_those_of_differences(name, cases):
    """Where the line leans, its ends at borders go along with how it turns: rates are off by the lean."""
    rng, form, step, seen = np.random.default_rng(1), ROUNDS[name], 1e-5, 0
    faces = plane_faces()
    regions = [plane_region(face) for face in faces]
    for _ in range(cases(100, 1000)):
        k = int(rng.integers(len(faces)))
        turn, shift = lying(rng, name, not faces[k].reversed, 1e-6)
        twist, there = rng.normal(size=6), []
        for s in (-step, 0.0, step):
            w = Rotation.from_rotvec(s * twist[3:]).as_matrix()
            there.append(line_manifold(regions[k], form, w @ turn, w @ shift + s * twist[:3]))
        if any(m is None for m in there) or max(np.abs(m.places - there[1].places).max() for m in there) > 1e-2:
            continue
        seen += 1
        rates = (there[2].gaps - there[0].gaps) / (2.0 * step)
        assert there[1].rates() @ twist == pytest.approx(rates, abs=1e-4)
    assert seen > cases(30, 300)


def test_either_body_has_the_plane():
    box, pin = faces_of(asm.shapes.box(2.0, 2.0, 1.0)), faces_of(asm.shapes.solid_cylinder(0.5, 3.0))
    turn, shift = Rotation.from_rotvec([0.5 * np.pi, 0.0, 0.0]).as_matrix(), np.array([0.2, 0.3, 1.0])
    ((_, one),) = line_manifolds((box, pin), turn, shift, (-1e-9, 1e-9))
    assert one.normals == pytest.approx(np.tile(Z, (2, 1))) and sorted(one.places[:, 1]) == pytest.approx([-1.0, 1.0])
    ((_, other),) = line_manifolds((pin, box), turn.T, -turn.T @ shift, (-1e-9, 1e-9))
    assert other.normals @ turn.T == pytest.approx(-one.normals)
    assert line_manifolds((box, pin), turn, shift + 1e-3 * Z, (-1e-9, 1e-9)) == []


def test_what_does_not_lie_on_a_face_has_no_rows():
    disc = plane_region(asm.shapes.trimmed_plane(circle(1.0)))
    upright = line_manifold(disc, ROUNDS["cylinder"], np.eye(3), np.array([0.0, 0.0, 0.7]))
    beside = line_manifold(disc, ROUNDS["ball"], np.eye(3), np.array([1.5, 0.0, 0.4]))
    assert upright is None and beside is None
    # The lower quarter of a wall that is there only above.
    half = Cylinder(np.zeros(3), Z, 0.3, (-0.7, 0.7), Turn(np.array([0.0, 1.0, 0.0]), 1.0), True, 0.0)
    down = Rotation.from_rotvec([0.0, 0.5 * np.pi, 0.0]).as_matrix()
    assert line_manifold(disc, half, down, np.array([0.0, 0.0, 0.3])) is None
