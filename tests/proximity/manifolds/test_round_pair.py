"""Manifolds of shafts in bores and of cones in their seats: bounds hold for samples, rates are those of differences."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.recognition.forms import Cone, Cylinder, Turn
from assembly.proximity.manifolds.elementary_faces import elementary_faces
from assembly.proximity.manifolds.round_manifolds import round_manifold, round_manifolds
from tests.proximity.clearance.scenes import direction, faces_of

AROUND = Turn(np.array([1.0, 0.0, 0.0]), 2.0 * np.pi)


def cylinder(radius, half, outward, at=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0)):
    return Cylinder(np.array(at), np.array(axis), radius, (-half, half), AROUND, outward, 0.0)


def cone(angle, low, high, outward, axis=(0.0, 0.0, 1.0)):
    return Cone(np.zeros(3), np.array(axis), angle, (low, high), AROUND, outward, 0.0)


def points_of(rng, form, count):
    """Random points of a surface, half of them on its ends."""
    height = rng.uniform(*form.heights, count)
    height[: count // 4], height[count // 4 : count // 2] = form.heights
    is_cone = isinstance(form, Cone)
    radius = height * np.tan(form.half_angle) if is_cone else np.full(count, form.radius)
    side = np.cross(form.axis, np.eye(3)[np.abs(form.axis).argmin()])
    side /= np.linalg.norm(side)
    turn = rng.uniform(0.0, 2.0 * np.pi, count)[:, None]
    across = np.cos(turn) * side + np.sin(turn) * np.cross(form.axis, side)
    return (form.apex if is_cone else form.point) + height[:, None] * form.axis + radius[:, None] * across


def gaps_to_bore(points, bore):
    """How far points are from a bore's wall, where they are beside it; negative in its material."""
    off = points - bore.point
    along = off @ bore.axis
    beside = (along >= bore.heights[0]) & (along <= bore.heights[1])
    return bore.radius - np.linalg.norm(off[beside] - along[beside, None] * bore.axis, axis=1)


def random_pair(rng):
    """A bore, a shaft, and a pose at which it is off by about the play."""
    play = 10.0 ** rng.uniform(-6.0, -1.0)
    bore = cylinder(1.0, rng.uniform(0.3, 3.0), False, axis=direction(rng))
    shaft = cylinder(1.0 - play, rng.uniform(0.3, 3.0), True, axis=direction(rng))
    onto, _ = Rotation.align_vectors([bore.axis], [shaft.axis])
    lean = Rotation.from_rotvec(play * rng.normal() * direction(rng))
    shift = 0.5 * play * direction(rng) + rng.uniform(-1.0, 1.0) * bore.heights[1] * bore.axis
    return bore, shaft, (lean * onto).as_matrix(), shift


def test_bounds_hold_for_shafts_in_bores(cases):
    rng, tight = np.random.default_rng(0), []
    for _ in range(cases(1000, 100000)):
        bore, shaft, turn, shift = random_pair(rng)
        manifold = round_manifold(bore, shaft, turn, shift)
        if manifold is None:
            continue
        pin = points_of(rng, shaft, 400) @ turn.T + shift
        # Both ways: points of the shaft beside the wall, and points of the wall beside the shaft.
        least = gaps_to_bore(pin, bore).min(initial=np.inf)
        wall = (points_of(rng, bore, 400) - shift) @ turn
        along = wall @ shaft.axis
        beside = np.abs(along) <= shaft.heights[1]
        out = np.linalg.norm(wall[beside] - along[beside, None] * shaft.axis, axis=1) - shaft.radius
        least = min(least, out.min(initial=np.inf))
        assert least >= manifold.bound - 1e-14
        assert manifold.bound <= manifold.gaps.min() + 1e-14
        tight.append((manifold.gaps.min() - manifold.bound) / (1.0 - shaft.radius))
    assert len(tight) > cases(700, 70000)
    # What the bound gives away is of second order in the lean.
    assert np.quantile(tight, 0.95) < 0.2


def test_bounds_hold_for_cones(cases):
    rng = np.random.default_rng(1)
    for _ in range(cases(500, 5000)):
        angle, axis = rng.uniform(0.05, 1.3), direction(rng)
        seat, plug = cone(angle, 0.5, 1.5, False, axis), cone(angle, *np.sort(rng.uniform(0.2, 2.0, 2)), True, axis)
        small = 10.0 ** rng.uniform(-9.0, -2.0)
        turn, shift = Rotation.from_rotvec(small * rng.normal(size=3)).as_matrix(), small * rng.normal(size=3)
        manifold = round_manifold(seat, plug, turn, shift)
        if manifold is None:
            continue
        off = points_of(rng, plug, 400) @ turn.T + shift
        along = off @ axis
        out = np.linalg.norm(off - along[:, None] * axis, axis=1)
        gaps = np.sin(angle) * along - np.cos(angle) * out
        assert gaps.min() >= manifold.bound - 1e-14
        assert gaps.min() - manifold.bound < 3.0 * small


def test_rates_are_those_of_differences(cases):
    """Of rings that end the shaft, of rims that end the bore, and of cones."""
    rng, step, seen = np.random.default_rng(2), 1e-5, 0
    for k in range(cases(150, 1500)):
        if k % 2:
            one, other, turn, shift = random_pair(rng)
        else:
            one, other = cone(0.5, 0.5, 1.5, False), cone(0.5, 0.7, 1.3 + 0.5 * (k % 4), True)
            turn, shift = Rotation.from_rotvec(0.01 * rng.normal(size=3)).as_matrix(), 0.05 * rng.normal(size=3)
        twist, there = rng.normal(size=6), []
        for s in (-step, -0.5 * step, 0.0, 0.5 * step, step):
            w = Rotation.from_rotvec(s * twist[3:]).as_matrix()
            there.append(round_manifold(one, other, w @ turn, w @ shift + s * twist[:3]))
        if any(m is None for m in there):
            continue
        # Rows of directions that are kept, and those of the nearest one where that is told.
        some = np.abs([m.places - there[2].places for m in there]).max(axis=(0, 2)) < 1e-3
        seen += int(some.sum())
        wide = (there[4].gaps - there[0].gaps) / (2.0 * step)
        rates = (there[3].gaps - there[1].gaps) / step
        assert (np.abs(there[2].rates() @ twist - rates) <= 1e-9 + np.abs(wide - rates))[some].all()
        # The direction of the nearest row has no less a gap than it.
        for ring in (slice(0, 5), slice(5, 10)):
            assert there[2].gaps[ring][-1] <= there[2].gaps[ring].min() + 1e-12
    assert seen > cases(1000, 10000)


def test_where_axes_are_one():
    """Without play all gaps are zero; play, and how far a cone is off its seat along the axis, are told."""
    for play in (0.0, 1e-3):
        manifold = round_manifold(cylinder(1.0, 1.0, False), cylinder(1.0 - play, 2.0, True), np.eye(3), np.zeros(3))
        assert manifold.gaps == pytest.approx(play, abs=1e-15) and manifold.bound == pytest.approx(play, abs=1e-15)
    # Upside down it is the same.
    down = np.diag([1.0, -1.0, -1.0])
    assert round_manifold(
        cylinder(1.0, 1.0, False), cylinder(0.9, 2.0, True), down, np.zeros(3)
    ).bound == pytest.approx(0.1)
    lifted = round_manifold(cone(0.5, 1.0, 2.0, False), cone(0.5, 1.2, 2.5, True), np.eye(3), np.array([0, 0, 0.01]))
    assert lifted.gaps == pytest.approx(0.01 * np.sin(0.5), abs=1e-15)
    assert lifted.bound == pytest.approx(0.01 * np.sin(0.5), abs=1e-15)


@pytest.mark.parametrize(
    "turn, shift",
    [
        (np.eye(3), (0.0, 0.0, 3.0)),  # one before the other
        (Rotation.from_rotvec([0.5 * np.pi, 0.0, 0.0]).as_matrix(), (0.0, 0.0, 0.0)),  # across
    ],
)
def test_what_is_not_in_each_other_has_no_rows(turn, shift):
    assert round_manifold(cylinder(1.0, 1.0, False), cylinder(0.9, 1.0, True), turn, np.array(shift)) is None


def test_either_body_may_be_the_hollow_one():
    plate = elementary_faces(faces_of(asm.shapes.plate(4.0, 4.0, 1.0, [(0.3, 0.2, 0.5)])))
    pin = elementary_faces(faces_of(asm.shapes.solid_cylinder(0.5, 2.0)))
    turn, place = Rotation.from_rotvec([0.0, 0.0, 0.4]).as_matrix(), np.array([0.3, 0.2, 0.1])
    ((_, one),) = round_manifolds((plate, pin), turn, place, (-1e-9, 1e-9))
    ((_, other),) = round_manifolds((pin, plate), turn.T, -turn.T @ place, (-1e-9, 1e-9))
    # Normals lead from the first body to the second one.
    assert (one.normals * (one.places - place))[:, :2].sum(axis=1) == pytest.approx(-0.5)
    assert (other.normals * other.places)[:, :2].sum(axis=1) == pytest.approx(0.5)
    assert round_manifolds((plate, pin), turn, place + (0.1, 0.0, 0.0), (-1e-9, 1e-9)) == []
