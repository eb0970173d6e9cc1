"""What the rows of a joint mean, at poses that are made from the values of its freedoms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assembly as asm
from assembly.constraints.program import primitives
from assembly.constraints.program.primitives import COINCIDENT

PI = math.pi
OPPOSABLE = [asm.Fixed, asm.Revolute, asm.Prismatic, asm.Cylindrical, asm.Planar, asm.Parallel]
POINTED = [asm.PointOnLine, asm.PointOnPlane]
HOLDING = [asm.Distance, asm.Angle]


def turn(axis, angle):
    return asm.Pose.from_axis_angle(np.eye(3)[axis], angle)


def shift(x, y, z):
    return asm.Pose((x, y, z))


def random_pose(rng):
    return asm.Pose.from_axis_angle(rng.normal(size=3), rng.uniform(-3, 3), rng.normal(size=3))


def frame_pose(frame):
    """The frame as a pose in its body."""
    m = frame.axes
    w = np.linalg.eigh(  # the quaternion of a rotation: the largest eigenvector of this matrix
        np.array(
            [
                [np.trace(m), m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]],
                [m[2, 1] - m[1, 2], 2 * m[0, 0] - np.trace(m), m[0, 1] + m[1, 0], m[0, 2] + m[2, 0]],
                [m[0, 2] - m[2, 0], m[0, 1] + m[1, 0], 2 * m[1, 1] - np.trace(m), m[1, 2] + m[2, 1]],
                [m[1, 0] - m[0, 1], m[0, 2] + m[2, 0], m[1, 2] + m[2, 1], 2 * m[2, 2] - np.trace(m)],
            ]
        )
    )[1][:, -1]
    return asm.Pose(frame.origin, w)


def ball(swing, azimuth, twist):
    return turn(2, azimuth) @ turn(1, swing) @ turn(2, twist - azimuth)


# Where frame b stands in frame a, from the values of the freedoms; what is left free is random.
MOTIONS = {
    asm.Fixed: lambda rng: shift(0, 0, 0),
    asm.Revolute: lambda rng, angle: turn(2, angle),
    asm.Prismatic: lambda rng, slide: shift(0, 0, slide),
    asm.Cylindrical: lambda rng, angle, slide: shift(0, 0, slide) @ turn(2, angle),
    asm.Planar: lambda rng, x, y, angle: shift(x, y, 0.75) @ turn(2, angle),
    asm.Spherical: lambda rng, swing, azimuth, twist: ball(swing, azimuth, twist),
    # z_a seen from b is Rz(-t) Ry(-pi/2) z = Rz(-t) (-x), at the angle pi - t.
    asm.Universal: lambda rng, angle_a, angle_b: turn(2, angle_a) @ turn(1, PI / 2) @ turn(2, PI - angle_b),
    asm.Parallel: lambda rng, angle: shift(*rng.normal(size=3)) @ turn(2, angle),
    asm.Perpendicular: lambda rng: shift(*rng.normal(size=3)) @ ball(PI / 2, *rng.uniform(-3, 3, 2)),
    asm.PointOnLine: lambda rng, slide: shift(0, 0, slide) @ asm.Pose((0, 0, 0), random_pose(rng).quaternion),
    asm.PointOnPlane: lambda rng, x, y: shift(x, y, 0.75) @ asm.Pose((0, 0, 0), random_pose(rng).quaternion),
    asm.Distance: lambda rng, distance: random_turn(rng) @ shift(0, 0, distance) @ random_turn(rng),
    asm.Angle: lambda rng, angle: shift(*rng.normal(size=3)) @ ball(angle, *rng.uniform(-3, 3, 2)),
}


def random_turn(rng):
    return asm.Pose((0, 0, 0), random_pose(rng).quaternion)


def evaluate(joint, poses):
    """Residuals of the rows, and their gradients in the twists of both bodies."""
    q = np.array([poses[body] for body in joint.bodies])
    residuals, gradients = [], []
    for row in joint.equations:
        total, gradient = -row.current(), np.zeros((1, 12))
        for coefficient, coordinate in row.terms:
            frames = (coordinate.frames.frame_a, coordinate.frames.frame_b)
            pool = np.concatenate([part for f in frames for part in (f.origin, f.axes.T.ravel())])
            records, places = np.empty((1, primitives.RECORD)), [joint.bodies.index(f.body) for f in frames]
            primitives.place_frames(pool, 0, q, *places, records, 0)
            near = row.current() if len(row.terms) == 1 else 0.0
            value, *parts = primitives.coordinate(coordinate.kind, coordinate.component, records, 0, near)
            out = np.empty((1, 12))
            primitives.write_gradient(*parts, coefficient, out, 0, 0)
            gradient += np.hstack([out[:, 6 * k : 6 * k + 6] for k in np.argsort(places)])
            total += coefficient * value
        residuals.append(total)
        gradients.append(gradient[0])
    return np.array(residuals), np.array(gradients)


def stand(joint, axes, motion, rng):
    """A joint between two frames anywhere, its bodies' poses such that frame b stands in frame a as given."""
    a, b = asm.Body("ground"), asm.Body("crank")
    frames = [body.frame(at=rng.normal(size=3), z=rng.normal(size=3), x=rng.normal(size=3)) for body in (a, b)]
    made = joint(*(frames[::-1] if joint in POINTED else frames), **axes)
    f = random_pose(rng)
    flip = turn(0, PI if axes.get("axes") == "opposed" else 0.0)
    g = f @ frame_pose(frames[0]) @ motion @ flip.inverse() @ frame_pose(frames[1]).inverse()
    return made, {a: f.q, b: g.q}


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("joint", "axes"), [*((j, "aligned") for j in MOTIONS), *((j, "opposed") for j in OPPOSABLE)])
def test_rows_hold_where_the_freedoms_say(joint, axes, seed):
    rng = np.random.default_rng(seed)
    values = {name: rng.uniform(0.3, 2.8) for name in joint._free}
    settings = {"axes": axes} if joint in OPPOSABLE else {}
    if joint in (asm.Planar, asm.PointOnPlane):
        settings["offset"] = 0.75
    if joint in HOLDING:
        settings["value"] = next(iter(values.values()))
    made, poses = stand(joint, settings, MOTIONS[joint](rng, **values), rng)
    count = len(made.equations)
    for name, value in values.items():
        made.freedom(name).value = value
    residuals, gradients = evaluate(made, poses)
    # Rounding of some ten products of numbers up to 5.
    assert np.abs(residuals).max() < 1e-13
    # Every row asks something of its own: own rows and drives have full rank, and move with the bodies together.
    assert np.linalg.matrix_rank(gradients, tol=1e-6) == len(made.equations)
    together = np.tile(np.eye(6), 2)
    together[3:, :3] = np.cross(np.eye(3), poses[made.bodies[0]][:3])
    together[3:, 6:9] = np.cross(np.eye(3), poses[made.bodies[1]][:3])
    spins = gradients[[row.terms[0][1].kind != COINCIDENT for row in made.equations]] @ together.T
    assert np.abs(spins).max(initial=0.0) < 1e-13
    # Away from the value every freedom's row says by how much.
    for name, value in values.items():
        made.freedom(name).value = value + 0.125
    drives = np.array([row.is_drive or joint in HOLDING for row in made.equations])
    assert evaluate(made, poses)[0] == pytest.approx(np.where(drives, -0.125, 0.0), abs=1e-13)
    assert drives.sum() == len(values) and len(drives) == count + (joint not in HOLDING) * len(values)


@pytest.mark.parametrize("seed", range(3))
def test_a_point_at_a_distance_from_a_line(seed):
    rng = np.random.default_rng(seed)
    distance, around, slide = rng.uniform(0.1, 3), rng.uniform(-PI, PI), rng.uniform(-2, 2)
    motion = turn(2, around) @ shift(distance, 0, slide) @ random_turn(rng)
    made, poses = stand(asm.PointOnLine, {"distance": distance}, motion, rng)
    residuals, gradients = evaluate(made, poses)
    assert len(residuals) == 1 and abs(residuals[0]) < 1e-13 and not made.equations[0].is_drive
    # The point's own velocity counts as it is away from the line.
    assert np.linalg.norm(gradients[0, 6:9]) == pytest.approx(1)
    made.slide, made.distance = slide + 0.125, distance + 0.25
    assert evaluate(made, poses)[0] == pytest.approx([-0.125, -0.25], abs=1e-13)
    made.distance, made.distance_limits = distance, (0.0, distance + 0.5)
    made.slide = made.distance = None
    # A lower limit of zero asks for nothing.
    assert evaluate(made, poses)[0] == pytest.approx([0.5], abs=1e-13)
    assert made.distance_limits == (0.0, distance + 0.5) and "distance_limits" in repr(made)


def test_what_a_distance_from_a_line_may_be():
    a, b = asm.Body("ground"), asm.Body("crank")
    on = asm.PointOnLine(b, a)
    assert (on.distance, on.distance_limits, list(on.freedoms), len(on.equations)) == (0.0, None, ["slide"], 2)
    with pytest.raises(asm.errors.InputError, match="was made for a point on the line; expected one made with"):
        on.distance = 1.0
    with pytest.raises(asm.errors.InputError, match="expected a distance above zero; a point on a line is PointOnLine"):
        asm.PointOnLine(b, a, distance=-1.0)
    beside = asm.PointOnLine(b, a, distance=2.0)
    assert list(beside.freedoms) == ["slide", "distance"] and beside.freedom("distance").value == 2.0
    with pytest.raises(asm.errors.InputError, match="distance is 0.0; expected a distance above zero"):
        beside.distance = 0.0
    with pytest.raises(asm.errors.InputError, match="distance is None without limits; expected a number or limits"):
        asm.PointOnLine(b, a, distance=None)
    with pytest.raises(asm.errors.InputError, match="expected a value within the limits"):
        asm.PointOnLine(b, a, distance=2.0, distance_limits=(None, 1.0))
    with pytest.raises(asm.errors.InputError, match="distance is .far."):
        asm.PointOnLine(b, a, distance="far")


@pytest.mark.parametrize("axes", ["aligned", "opposed"])
@pytest.mark.parametrize("pitch", [2.0, -0.5])
def test_a_screw_slides_as_it_turns(pitch, axes):
    rng = np.random.default_rng(7)
    made, poses = stand(asm.Screw, {"pitch": pitch, "axes": axes}, shift(0, 0, pitch / 8) @ turn(2, PI / 4), rng)
    residuals, gradients = evaluate(made, poses)
    assert np.abs(residuals).max() < 1e-13 and np.linalg.matrix_rank(gradients, tol=1e-6) == 5
    made.angle, made.slide = PI / 4, pitch / 8
    assert np.abs(evaluate(made, poses)[0]).max() < 1e-13


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_limits_hold_on_their_side(side):
    rng = np.random.default_rng(11)
    made, poses = stand(asm.Revolute, {"limits": (-0.5, 0.5)}, turn(2, 0.75 * side), rng)
    # The violated side is below zero by how far the angle is out, the other above.
    below, above = evaluate(made, poses)[0][5:]
    assert (below, above) == pytest.approx((0.75 * side + 0.5, 0.5 - 0.75 * side), abs=1e-14)
