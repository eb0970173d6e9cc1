"""Hulls of faces hold samples of these, and no sample is in a hollow; depths of discs are bounds of sampled ones."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.shapes.plane_curves import circle
from assembly.proximity.clearance.hulls.body_hulls import hulls_of_body
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.hollows import Hollow, Ring, Tube, depths_within
from assembly.proximity.clearance.hulls.prism import Prism
from assembly.proximity.clearance.hulls.sheet import Sheet
from assembly.proximity.clearance.hulls.triangles import triangles_of
from tests.proximity.clearance.scenes import direction, faces_of
from tests.studies.machined import bolt, retaining_ring, socket, turned_part

# Of coordinates of up to 60.
OFF = 2e-12
GROOVE = [(-30, -20), (30, -20), (30, 0), (10, 0), (14.6, -8), (-14.6, -8), (-10, 0), (-30, 0)]


def polygon(corners):
    return [asm.NurbsCurve([p, q], [0, 0, 1, 1], 1) for p, q in zip(corners, corners[1:] + corners[:1], strict=True)]


def square_hole(at=4.0):
    return polygon([(at, -2.0), (at, 2.0), (at + 5.0, 2.0), (at + 5.0, -2.0)])


def slotted():
    """A plate with a slot between half circles, whose hole is no circle."""
    half = np.sqrt(0.5)
    ends = [
        asm.NurbsCurve(points, [0, 0, 0, 1, 1, 2, 2, 2], 2, [1, half, 1, half, 1])
        for points in (
            [(3, -2), (5, -2), (5, 0), (5, 2), (3, 2)],
            [(-3, 2), (-5, 2), (-5, 0), (-5, -2), (-3, -2)],
        )
    ]
    sides = [asm.NurbsCurve(ends_of, [0, 0, 1, 1], 1) for ends_of in ([(3, 2), (-3, 2)], [(-3, -2), (3, -2)])]
    loop = [ends[0], sides[0], ends[1], sides[1]]
    return asm.shapes.extrusion(polygon([(-20, -10), (20, -10), (20, 10), (-20, 10)]), 6.0, [loop])


def ring(surface, v, up=True):
    """A loop once around a surface that is closed in u; material is above it, or below."""
    ends = [(side, v) for side in surface.domain[0]]
    return polygon(ends if up else ends[::-1])[:1]


def window(surface, u, v):
    """A face that is a rectangle of its surface."""
    corners = [(u[0], v[0]), (u[1], v[0]), (u[1], v[1]), (u[0], v[1])]
    return asm.Face(surface, polygon(corners), name="window")


def band(surface, low, high):
    """A face between two rings of a surface."""
    return asm.Face(surface, ring(surface, low), [ring(surface, high, up=False)], name="band")


WALL, CONE, BALL = asm.shapes.cylinder(4, 40), asm.shapes.cone(6, 12, 2), asm.shapes.sphere(5)
LOW = BALL.domain[1][0]
HOLE = polygon([(3.0, LOW + 12.5), (3.0, LOW + 13.5), (4.0, LOW + 13.5), (4.0, LOW + 12.5)])
FILLET = asm.shapes.revolution(asm.NurbsCurve([(3, -8), (3, 8)], [0, 0, 16, 16], 1), 1.2)
# Faces whose surfaces reach beyond them, as those of files do.
LOOPED = {
    "wall": (band(WALL, WALL.domain[1][0] + 7.0, WALL.domain[1][0] + 11.0),),
    "cone": (band(CONE, CONE.domain[1][0] + 3.0, CONE.domain[1][0] + 5.0),),
    "cap": (asm.Face(BALL, ring(BALL, LOW + 12.0), name="cap"),),
    "cap with a hole": (asm.Face(BALL, ring(BALL, LOW + 12.0), [HOLE], name="cap"),),
    "fillet": (window(FILLET, (0.5, 1.5), (3.0, 7.0)),),
}
SHAPES = {
    **LOOPED,
    "plate": asm.shapes.plate(60, 40, 10, [(0, 0, 4.5), (10, 5, 2.0)]),
    "pin": asm.shapes.solid_cylinder(4, 40),
    "bolt": bolt(4, 30, 6.5, 8),
    "socket": socket(10, 18, 16),
    "seat": turned_part([(5, -8.66), (25, -8.66), (25, 0), (10, 0)]),
    "ball": asm.shapes.sphere(4),
    "torus": asm.shapes.torus(6.0, 1.5),
    "groove": asm.shapes.extrusion(polygon(GROOVE), 30.0),
    "square hole": asm.shapes.extrusion([circle(12.0)], 5.0, [square_hole()]),
    "slot": slotted(),
}


def samples(face):
    """Points of a face, on a grid, and on its loops."""
    (u0, u1), (v0, v1) = face.surface.domain
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(u0, u1, 23), np.linspace(v0, v1, 23)))
    mine = face.contains(u, v)
    return np.concatenate([face.surface.evaluate(u[mine], v[mine]), samples_of_loops(face)])


def samples_of_loops(face):
    """Points of a face's boundary, none where it has none."""
    at = [np.empty((0, 2)), *(curve.evaluate(np.linspace(*curve.domain, 9)) for curve in face.boundary)]
    return face.surface.evaluate(*np.concatenate(at).T)


@pytest.mark.parametrize("name", SHAPES)
def test_a_face_is_within_its_hulls(name):
    rng = np.random.default_rng(1)
    normals = np.array([*np.eye(3), *-np.eye(3), *(direction(rng) for _ in range(60))])
    for face in faces_of(SHAPES[name]):
        points = samples(face)
        assert len(points) > 3
        reach = hulls_of_body((face,)).reach(normals)
        within = (points @ normals.T <= reach[:, None] + OFF).all(axis=2)
        assert within.any(axis=0).all(), face
        # And no hull is much larger: along one of these at least a part ends where the face does.
        assert (reach.max(axis=0) - (points @ normals.T).max(axis=0)).min() < 1e-9, face


def test_a_face_reaches_no_farther_than_its_loops():
    """Surfaces of files are longer than what loops leave: bodies seemed to be in each other."""
    along = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    for name in ("wall", "cone", "fillet"):
        (face,) = faces_of(LOOPED[name])
        ends = (samples_of_loops(face) @ along.T).max(axis=0)
        assert np.abs(hulls_of_body((face,)).reach(along).max(axis=0) - ends).max() <= OFF, name
    # A third of a radian of the fillet is no wider than its chord and what its control points are beyond.
    turn = FILLET.evaluate(1.0, 5.0) * (1.0, 1.0, 0.0) / 3.0
    ways = np.array([np.cross((0.0, 0.0, 1.0), turn), np.cross(turn, (0.0, 0.0, 1.0)), -turn])
    wide = (FILLET.evaluate([0.5, 1.5], 5.0) @ ways.T).max(axis=0)
    assert np.abs(hulls_of_body(LOOPED["fillet"]).reach(ways).max(axis=0) - wide).max() < 0.05


@pytest.mark.parametrize("name", SHAPES)
def test_no_point_of_a_face_is_in_its_hollows(name):
    for face in faces_of(SHAPES[name]):
        for number, hollow in hulls_of_body((face,)).hollows:
            assert number >= 0
            assert hollow.depth_of(samples(face)).max() <= OFF, face


def test_a_flat_face_is_beside_the_cone_that_goes_through_its_hole():
    faces = faces_of(SHAPES["seat"])
    hulls = hulls_of_body(faces)
    cones = [(k, hollow) for k, hollow in hulls.hollows if isinstance(hollow, Hollow) and hollow.slope > 0.0]
    # The seat itself, the top around it, and the bottom.
    assert len(cones) == 3
    for number, cone in cones:
        assert cone.depth_of(samples(faces[number])).max() <= 1e-8


def test_a_flat_face_is_beside_the_ball_that_goes_through_its_hole():
    def beside_balls(faces):
        hulls = hulls_of_body(faces)
        hollows = [(k, hollow) for k, hollow in hulls.hollows if isinstance(hollow, Hollow)]
        return [(faces[hulls.part_of[k]], hollow) for k, hollow in hollows if not hollow.axis.any()]

    balls = beside_balls(faces_of(retaining_ring(12.0, 22.0, 0.6)))
    # The seat itself, and both ends.
    assert {face.name for face, _ in balls} == {"face 0", "face 2", "seat"}
    for face, ball in balls:
        assert ball.depth_of(samples(face)).max() <= 1e-8
    # A ball that is wider than the holes does not go through them.
    washer = faces_of(turned_part([(11.0, 0), (22.0, 0), (22.0, 3), (11.0, 3)]))
    cavity = asm.Face(asm.shapes.sphere(12.0), name="cavity", reversed=True)
    assert {face.name for face, _ in beside_balls((*washer, cavity))} == {"cavity"}


@pytest.mark.parametrize("name", SHAPES)
def test_points_are_of_the_face(name):
    """Each is within a hull, and beside every hollow."""
    rng = np.random.default_rng(5)
    normals = np.array([*np.eye(3), *-np.eye(3), *(direction(rng) for _ in range(60))])
    for face in faces_of(SHAPES[name]):
        hulls = hulls_of_body((face,))
        assert (hulls.points @ normals.T <= hulls.reach(normals)[:, None] + OFF).all(axis=2).any(axis=0).all()
        for _, hollow in hulls.hollows:
            assert hollow.depth_of(hulls.points).max() <= OFF


def test_a_pin_across_a_bore_is_within_it_as_far_as_its_rims():
    """Discs whose axes lead away from the bore's count with what they are across, not with all of their radius."""
    bore = Hollow(np.array([0.5, 0.0, 3.0]), np.array([0.0, 0.0, 1.0]), 25.0)
    pin = Discs(np.array([[22.5, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([6.0]))
    assert abs(bore.depth(pin)[0] - (25.0 - np.hypot(22.0, 6.0))) < 1e-14


@pytest.mark.parametrize(
    "hollow",
    [
        Hollow(np.array([0.3, 0.1, -0.2]), np.array([0.0, 0.0, 1.0]), 2.0),
        Hollow(np.array([0.3, 0.1, -5.0]), np.array([0.0, 0.6, 0.8]), 0.0, 0.7),
        Hollow(np.array([0.3, 0.1, -0.2]), np.zeros(3), 2.5),
        Prism(np.array([0.0, 0.0, 1.0]), np.array([[1.0, 0, 0], [0, 1, 0], [-0.6, -0.8, 0]]), np.array([-2.0, -2, -2])),
    ],
    ids=["cylinder", "cone", "ball", "prism"],
)
def test_depths_of_discs_are_bounds(hollow):
    rng = np.random.default_rng(2)
    angle = np.linspace(0.0, 2.0 * np.pi, 200)
    inside = 0
    for _ in range(60):
        center, axis, radius = 0.5 * rng.normal(size=3), direction(rng), rng.uniform(0.1, 0.8)
        across = np.linalg.svd(axis[None])[2][1:]
        rim = center + radius * (np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1])
        depth = hollow.depth(Discs(center[None], axis[None], np.array([radius])))[0]
        sampled = hollow.depth_of(rim).min()
        assert depth <= sampled + 1e-14
        # Within by the half spaces as well.
        inward, borders = hollow.planes(center)
        if depth > 0.0:
            inside += 1
            assert (rim @ inward.T >= borders - 1e-12).all()
    assert inside > 5


def test_depths_in_several_hollows_are_those_in_each():
    """Cylinders and cones are asked at once; the others, and points, stay where they are among them."""
    rng = np.random.default_rng(4)
    cylinder, cone = (Hollow(rng.normal(size=3), direction(rng), 2.0, slope) for slope in (0.0, 0.6))
    ball = Hollow(rng.normal(size=3), np.zeros(3), 2.5)
    prism = Prism(direction(rng), np.array([direction(rng) for _ in range(3)]), np.full(3, -2.0))
    tube = Tube(rng.normal(size=3), direction(rng), 2.0, 0.6, True, True)
    hollows = [cylinder, ball, cone, prism, cylinder, tube]
    axes, radii = np.array([direction(rng) for _ in range(20)]), rng.uniform(0.1, 0.8, 20)
    axes[::3] = radii[::3] = 0.0
    discs = Discs(rng.normal(size=(20, 3)), axes, radii)
    found = depths_within(hollows, discs)
    for row, hollow in zip(found, hollows, strict=True):
        one_by_one = [hollow.depth(Discs(*(column[k : k + 1] for column in discs)))[0] for k in range(20)]
        np.testing.assert_allclose(row, one_by_one, rtol=0, atol=1e-14)
    assert depths_within([], discs).shape == (0, 20)


@pytest.mark.parametrize("outside", [True, False])
def test_a_tube_and_a_ball_are_apart_by_what_samples_say(outside):
    """The depth of a ball's center less its radius is the distance to samples, and half spaces say no less of it."""
    rng = np.random.default_rng(8)
    tube = Tube(np.array([0.1, -0.2, 0.3]), direction(rng), 2.0, 0.6, outside, True)
    angle, around = (grid.ravel() for grid in np.meshgrid(*[np.linspace(0.0, 2.0 * np.pi, 400)] * 2))
    across = np.linalg.svd(tube.normal[None])[2][1:]
    ways = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    sides = np.cos(around)[:, None] * ways + np.sin(around)[:, None] * tube.normal
    surface = tube.center + tube.major * ways + tube.minor * sides
    for k in range(20):
        center = tube.center + tube.normal if k == 0 else surface[rng.integers(len(surface))] + 0.5 * rng.normal(size=3)
        depth, sampled = tube.depth_of(center[None])[0], np.linalg.norm(surface - center, axis=1).min()
        # Samples are up to 0.03 from each other.
        assert abs(depth) <= sampled + 1e-12 and sampled <= abs(depth) + 0.03
        inward, borders = tube.planes(center)
        least = (inward @ center - borders).min()
        assert abs(least - depth) < 1e-12


@pytest.mark.parametrize("ends", [((-1.0, 2.0), (3.0, 2.0)), ((0.5, 1.0), (2.0, 2.5)), ((0.0, 1.5), (0.0, 6.0))])
def test_a_ring_and_a_ball_are_apart_by_what_samples_say(ends):
    """The depth of a ball's center is the distance to samples, and half spaces say no less of it."""
    rng = np.random.default_rng(8)
    made = Ring(np.array([0.1, -0.2, 0.3]), direction(rng), np.array(ends), 0.0)
    angle, part = (grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 600), np.linspace(0.0, 1.0, 200)))
    across = np.linalg.svd(made.normal[None])[2][1:]
    height, beside = made.ends[0][:, None] + part * (made.ends[1] - made.ends[0])[:, None]
    ways = np.cos(angle)[:, None] * across[0] + np.sin(angle)[:, None] * across[1]
    surface = made.center + height[:, None] * made.normal + beside[:, None] * ways
    assert np.abs(made.depth_of(surface)).max() < 1e-12
    for k in range(20):
        center = made.center + made.normal if k == 0 else surface[rng.integers(len(surface))] + 0.5 * rng.normal(size=3)
        depth, sampled = made.depth_of(center[None])[0], np.linalg.norm(surface - center, axis=1).min()
        # Samples are up to 0.07 from each other.
        assert depth <= sampled + 1e-12 and sampled <= depth + 0.07
        inward, borders = made.planes(center)
        assert abs((inward @ center - borders).min() - depth) < 1e-12
    # What the face may be off it is nearer by as much.
    off = made._replace(off=0.01)
    np.testing.assert_allclose(off.depth_of(surface), -0.01, rtol=0, atol=1e-12)
    # At its very profile a point is on no side of it.
    level = Ring(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array(ends), 0.0)
    assert not len(level.planes(np.array([ends[0][1], 0.0, ends[0][0]]))[0])


def test_flat_rings_that_are_turned_have_holes():
    """As plates with holes have: a pin through one was left to cells, and a ball that goes into it."""
    for part in (turned_part([(4, -5), (30, -5), (30, 5), (8, 5), (4, 1)]), SHAPES["seat"]):
        flat = [face for face in faces_of(part) if np.ptp(samples(face)[:, 2]) < 1e-9]
        assert len(flat) == 2
        for face in flat:
            hollow, around = (hollow for _, hollow in hulls_of_body((face,)).hollows if not isinstance(hollow, Sheet))
            assert isinstance(hollow, Hollow) and isinstance(around, Ring)
            assert hollow.radius == pytest.approx(np.hypot(*samples(face).T[:2]).min(), abs=1e-7)


def test_poses_and_scales_move_all_of_it():
    rng = np.random.default_rng(3)
    turn, shift = Rotation.random(random_state=4).as_matrix(), rng.normal(size=3)
    normals = np.array([direction(rng) for _ in range(9)])
    for shape in SHAPES.values():
        hulls = hulls_of_body(faces_of(shape))
        posed, scaled = hulls.posed(turn, shift), hulls.scaled(0.25, shift)
        assert posed.reach(normals) == pytest.approx(hulls.reach(normals @ turn) + normals @ shift, abs=OFF)
        assert scaled.reach(normals) == pytest.approx(0.75 * hulls.reach(normals) + normals @ shift, abs=OFF)
        points = 9.0 * rng.normal(size=(20, 3))
        for (_, one), (_, two), (_, three) in zip(hulls.hollows, posed.hollows, scaled.hollows, strict=True):
            depth = one.depth_of(points)
            assert two.depth_of(points @ turn.T + shift) == pytest.approx(depth, abs=OFF)
            assert three.depth_of(0.75 * points + shift) == pytest.approx(0.75 * depth, abs=OFF)


@pytest.mark.parametrize("corners", [GROOVE, [(0, 0), (4, 0), (4, 1), (2, 1), (1, 1), (1, 3), (0, 3)]])
def test_triangles_are_the_polygon(corners):
    flat = np.column_stack([np.array(corners, dtype=float), np.zeros(len(corners))])
    parts = triangles_of(flat, np.array([0.0, 0.0, 1.0]))
    assert all(len(part) == 3 for part in parts)

    def area(rows):
        x, y = flat[list(rows), 0], flat[list(rows), 1]
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    areas = [area(part) for part in parts]
    assert min(areas) >= 0.0
    assert sum(areas) == pytest.approx(area(range(len(flat))), rel=1e-12)


@pytest.mark.parametrize("outside", [True, False])
def test_a_tube_has_half_spaces_for_a_ball_on_its_middles(outside):
    """A ball that fills a race is as far from the tube all around: one half space at least says by how much."""
    tube = Tube(np.zeros(3), np.array([0.0, 0.0, 1.0]), 2.0, 0.5, outside, True)
    center = np.array([2.0, 0.0, 0.0])
    inward, borders = tube.planes(center)
    assert len(inward) > 0 and np.linalg.norm(inward, axis=1) == pytest.approx(1.0, abs=1e-15)
    assert (inward @ center - borders).min() == tube.depth_of(center[None])[0]
