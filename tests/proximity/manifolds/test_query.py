"""Contact manifolds of faces of bodies in the world: where, which way, how far, and how that changes."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError
from assembly.geometry.shapes.plane_curves import polygon
from assembly.kinematics.pose import retract
from assembly.proximity import contact_manifold

# A pose of everything, so that world and body axes are others.
AWAY = asm.Pose((30.0, -20.0, 7.0), (0.8, 0.2, -0.4, 0.4))


def pose_of(place, turn=(1.0, 0.0, 0.0, 0.0)):
    return AWAY @ asm.Pose(place, turn)


def block(size, place, turn=(1.0, 0.0, 0.0, 0.0)):
    pose = pose_of(place, turn)
    return asm.Body("block", asm.shapes.box(*size), pose.position, pose.quaternion)


def plate():
    return asm.Body("plate", asm.shapes.plate(100, 60, 10, [(20, 0, 8)]), AWAY.position, AWAY.quaternion)


def test_a_block_over_the_edge_of_a_plate():
    base, lid = plate(), block((30, 20, 10), (45.0, 0.0, 10.5))
    found = contact_manifold(base.face("top"), lid.face("bottom"))
    # What both have in common: 30 to 50 by -10 to 10, seen along the normal.
    local = np.sort([tuple(np.round(AWAY.inverse().apply(place), 9)) for place in found.places], axis=0)
    assert len(local) == 4
    assert (local.min(axis=0)[:2].tolist(), local.max(axis=0)[:2].tolist()) == ([30.0, -10.0], [50.0, 10.0])
    np.testing.assert_allclose(found.gaps, found.gaps[0], rtol=0, atol=1e-12)
    assert found.bound == pytest.approx(found.gaps.min(), abs=1e-9) and found.bound <= found.gaps.min()
    np.testing.assert_allclose(found.normals, np.tile(AWAY.matrix[:3, 2], (4, 1)), rtol=0, atol=1e-12)


def rate_pairs():
    base, pin = plate(), asm.Body("pin", asm.shapes.solid_cylinder(7.9, 30.0))
    pin.pose = pose_of((20.02, 0.01, 0.0), (np.cos(5e-4), np.sin(5e-4), 0.0, 0.0))
    lid = block((30, 20, 10), (45.0, 0.0, 10.5), turn=(np.cos(0.01), np.sin(0.006), np.sin(0.008), 0.0))
    rod = asm.Body("rod", asm.shapes.solid_cylinder(3.0, 20.0))
    rod.pose = pose_of((-20.0, 5.0, 8.2), (np.cos(0.78), np.sin(0.78), 0.0, 0.0))
    (bore,) = base.faces.cylinders(hole=True)
    (wall,), (side,) = pin.faces.cylinders(), rod.faces.cylinders()
    return {"flat": (base.face("top"), lid.face("bottom")), "bore": (bore, wall), "line": (base.face("top"), side)}


@pytest.mark.parametrize("kind", ["flat", "bore", "line"])
@pytest.mark.parametrize("exchanged", [False, True])
def test_rates_are_those_of_gaps(kind, exchanged):
    """Central differences, of either body; rows of rings and lines keep their direction, off by the lean squared."""
    a, b = rate_pairs()[kind][:: -1 if exchanged else 1]
    poses = a.body.pose, b.body.pose
    found = contact_manifold(a, b, poses=poses)
    assert found is not None and found.bound <= found.gaps.min()
    rng, step = np.random.default_rng(2), 1e-6
    for side, rates in enumerate(found.rates()):
        for twist in rng.normal(size=(5, 6)) * [1, 1, 1, 0.02, 0.02, 0.02]:
            ends = []
            for sign in (1.0, -1.0):
                rows = np.array([poses[side].q])
                moved = retract(rows, sign * step * twist[None])[0]
                pair = [*poses]
                pair[side] = asm.Pose(moved[:3], moved[3:])
                ends.append(contact_manifold(a, b, poses=tuple(pair)).gaps)
            differences = (ends[0] - ends[1]) / (2.0 * step)
            np.testing.assert_allclose(rates @ twist, differences, rtol=0, atol=2e-3 if kind == "bore" else 1e-6)


def seen_from(a, b):
    """Points of the face b from the body of a."""
    u, v = (np.linspace(*ends, 200) for ends in b.face.surface.domain)
    points = b.face.surface.evaluate(u[:, None], v[None, :]).reshape(-1, 3)
    return a.body.pose.inverse().apply(b.body.pose.apply(points))


def test_the_bound_holds_of_points():
    """Points of the pin's wall within the plate, and of the rod over it: none is nearer, and some nearly as near."""
    a, b = rate_pairs()["bore"]
    points = seen_from(a, b)
    within = points[np.abs(points[:, 2]) <= 5.0]
    gap = (8.0 - np.hypot(within[:, 0] - 20.0, within[:, 1])).min()
    assert gap - 2e-3 < contact_manifold(a, b).bound <= gap
    a, b = rate_pairs()["line"]
    gap = seen_from(a, b)[:, 2].min() - 5.0
    assert gap - 2e-3 < contact_manifold(a, b).bound <= gap


def test_a_ball_in_its_socket_has_one_row():
    socket = asm.Body("socket", [asm.Face(asm.shapes.sphere(0.5), reversed=True)])
    ball = asm.Body("ball", asm.shapes.sphere(0.4))
    rng = np.random.default_rng(8)
    for apart in (1e-6, 0.05, 0.1, 0.3):
        way = rng.normal(size=3)
        way /= np.linalg.norm(way)
        socket.pose, ball.pose = AWAY, pose_of(apart * way, (0.5, 0.1, -0.7, 0.5))
        found = contact_manifold(socket.faces[0], ball.faces[0])
        exchanged = contact_manifold(ball.faces[0], socket.faces[0])
        assert found.gaps.tolist() == pytest.approx([0.1 - apart], abs=1e-13)
        np.testing.assert_allclose(found.normals, [-AWAY.matrix[:3, :3] @ way], rtol=0, atol=1e-7)
        np.testing.assert_allclose(found.places, [AWAY.apply((apart + 0.4) * way)], rtol=0, atol=1e-7)
        np.testing.assert_allclose(exchanged.normals, -found.normals, rtol=0, atol=1e-12)
        # Samples of the ball, in the axes of the socket.
        gaps = 0.5 - np.linalg.norm(seen_from(socket.faces[0], ball.faces[0]), axis=1)
        assert found.gaps[0] - 1e-12 < found.bound <= gaps.min() + 1e-14 and gaps.min() < found.bound + 1e-3
    # Where the centers meet the normal is one of all; beyond the socket they do not face each other.
    ball.pose = AWAY
    (normal,) = contact_manifold(socket.faces[0], ball.faces[0]).normals
    np.testing.assert_allclose(normal, AWAY.matrix[:3, 2], rtol=0, atol=1e-14)
    ball.pose = pose_of((0.6, 0.0, 0.0))
    assert contact_manifold(socket.faces[0], ball.faces[0]) is None


def hollow(angle):
    """A body with a wall about z, a cone with its apex at the origin or a bore of 0.7."""
    low, high = (0.004, 3.0) if angle > 0.0 else (-3.0, 3.0)
    near, far = (0.7, 0.7) if angle == 0.0 else (low * np.tan(angle), high * np.tan(angle))
    loop = polygon([(near, low), (9.0, low), (9.0, high), (far, high)])
    body = asm.Body("wall", asm.shapes.revolution(loop))
    # The outer wall is a cylinder of 9.
    walls = [*body.faces.cones(), *body.faces.cylinders()]
    return body, next(face for face in walls if face.face.surface.bounding_box()[1][0] < 8.5)


@pytest.mark.parametrize("angle", [0.0, 0.2, np.pi / 6, 1.2])
def test_a_ball_in_a_hollow_wall_has_a_ring(angle, cases):
    """Its least gap is that of samples of the wall, exactly, and no sample is below the bound."""
    body, face = hollow(angle)
    rng = np.random.default_rng(9)
    u, v = (np.linspace(*ends, 150) for ends in face.face.surface.domain)
    wall = face.face.surface.evaluate(u[:, None], v[None, :]).reshape(-1, 3)
    for _ in range(cases(20, 500)):
        radius = rng.uniform(0.2, 0.6)
        ball = asm.Body("ball", asm.shapes.sphere(radius))
        height = 0.0 if angle == 0.0 else radius / np.sin(angle)
        center = np.append(rng.normal(scale=0.03, size=2), height) + rng.normal(scale=0.03, size=3)
        body.pose, ball.pose = AWAY, pose_of(center, (0.5, 0.1, -0.7, 0.5))
        found, exchanged = contact_manifold(face, ball.faces[0]), contact_manifold(ball.faces[0], face)
        assert len(found.gaps) == 5 and found.gaps[4] <= found.gaps.min() + 1e-14
        np.testing.assert_allclose(exchanged.normals, -found.normals, rtol=0, atol=1e-14)
        gap = (np.linalg.norm(wall - center, axis=1) - radius).min()
        assert found.bound <= gap and gap < found.bound + 1e-2 and found.gaps[4] - 1e-12 < found.bound <= found.gaps[4]
        # Points of the ball, along the normals from points of the wall.
        at = np.linalg.norm(found.places - ball.pose.position, axis=1)
        np.testing.assert_allclose(at, radius, rtol=0, atol=1e-12)
    ball.pose = pose_of((0.0, 0.0, 30.0))
    assert contact_manifold(face, ball.faces[0]) is None


def test_faces_that_have_nothing_in_common():
    base, lid = plate(), block((30, 20, 10), (200.0, 0.0, 10.5))
    assert contact_manifold(base.face("top"), lid.face("bottom")) is None
    assert contact_manifold(base.face("top"), block((30, 20, 10), (0, 0, 30)).face("top")) is None


def test_bad_input():
    base, lid = plate(), block((30, 20, 10), (0, 0, 10.5))
    ring = asm.Body("ring", asm.shapes.torus(5.0, 1.0))
    with pytest.raises(TypeError, match="a is 3; expected a face of a body"):
        contact_manifold(3, lid.face("bottom"))
    with pytest.raises(InputError, match="of one body; expected faces of two bodies"):
        contact_manifold(lid.face("top"), lid.face("bottom"))
    with pytest.raises(InputError, match="a plane and a torus; expected planes with edges of lines and arcs"):
        contact_manifold(lid.face("top"), ring.faces[0])
    with pytest.raises(InputError, match="poses is 3; expected a pair, one pose for a and one for b"):
        contact_manifold(lid.face("top"), base.faces[0], poses=3)
