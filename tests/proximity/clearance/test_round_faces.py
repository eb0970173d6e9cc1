"""What faces lie on: hulls hold their samples, nothing of a bore's wall is nearer than its radius, and others are none.

Recognized is what is off by no more than `round_faces.EXACT` of its size; bounds are those of the face itself, so that
samples are within them but for rounding of the coordinates.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.path import Path
from assembly.proximity.clearance.body_cells import cells_of_body
from assembly.proximity.clearance.records import NODE
from assembly.proximity.clearance.round_faces import round_holes, round_of, round_parts
from tests.proximity.clearance.nodes import top
from tests.proximity.clearance.scenes import direction, faces_of
from tests.proximity.clearance.splines import bumpy_hole, shapes, surface_points

OFF = 2e-15
SURFACES = {
    "cylinder": asm.shapes.cylinder(0.3, 1.2),
    "ball": asm.shapes.sphere(0.4),
    "torus": asm.shapes.torus(0.6, 0.15),
}


def placed(surface, rng, offset):
    """Turned and moved by so much, and with parameters the other way around, half of the times."""
    found = surface.transformed(
        rotation=Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix(),
        translation=offset * rng.normal(size=3),
    )
    return found.transposed() if rng.random() < 0.5 else found


def distances(found, points):
    """Of points from the axis, the center, or the circle of middles of a tube."""
    off = points - found.center
    along = off @ found.axis
    across = np.linalg.norm(off - along[:, None] * found.axis, axis=1)
    return np.hypot(across - found.ring, along) if found.ring > 0.0 else across


@pytest.mark.parametrize("name", SURFACES)
def test_exact_ones_at_any_place(name, cases):
    rng = np.random.default_rng(0)
    for number in range(cases(12, 400)):
        offset = (0.0, 1.0, 1e3)[number % 3]
        for is_inward in (False, True):
            surface = placed(SURFACES[name], rng, offset)
            face = Face(surface, reversed=is_inward)
            found, points = round_of(face), surface_points(Face(surface), 500, rng)
            # Turned over, parameters count as well.
            if name == "torus" and (found is None or not found.outward):
                assert found is None
                continue
            if offset == 1e3 and found is None:
                # Coordinates this large tell no more than 1e-13.
                continue
            far, told = np.abs(points).max(), distances(found, points)
            if found.outward:
                assert told.max() <= found.radius + OFF * far
                assert np.abs((points - found.center) @ found.axis).max() <= max(
                    found.half, 1e3 * (name == "torus")
                ) + (OFF * far)
            else:
                assert told.min() >= found.radius - OFF * far
            assert told.mean() == pytest.approx(found.radius, abs=1e-11 * max(1.0, offset))


@pytest.mark.parametrize("name", ["pin", "plate", "slot", "cam", "ball", "torus", "cylinder", "clip", "wire"])
def test_sides_of_bodies(name):
    """Walls of holes are seen from inside, all others from outside: by normals, at samples."""
    rng = np.random.default_rng(1)
    for face in faces_of(shapes()[name]):
        found = round_of(face)
        if found is None or not face.surface.degree[0] + face.surface.degree[1] > 2:
            continue
        (u0, u1), (v0, v1) = face.surface.domain
        u, v = rng.uniform(u0, u1, 50), rng.uniform(v0, v1, 50)
        points, normals = face.surface.evaluate(u, v), face.normal(u, v)
        off = points - found.center
        off -= (off @ found.axis)[:, None] * found.axis
        if found.ring > 0.0:
            off = points - found.center - found.ring * off / np.linalg.norm(off, axis=1)[:, None]
        assert ((off * normals).sum(axis=1) > 0.0).all() == found.outward
        assert ((off * normals).sum(axis=1) < 0.0).all() != found.outward


def test_walls_of_bodies():
    """Of the wall of a hole radius and axis are known; nothing of the wall is nearer to that."""
    rng = np.random.default_rng(2)
    found = cells_of_body(faces_of(shapes()["plate"])).walls
    assert sorted(wall.radius for wall in found) == pytest.approx([0.4, 0.5], abs=1e-13)
    walls = [face for face in faces_of(shapes()["plate"]) if face.surface.degree != (1, 1)]
    assert len(walls) == 2
    for wall in found:
        near = []
        for face in walls:
            off = surface_points(face, 2000, rng) - wall.center
            near.append(np.linalg.norm(off - (off @ wall.axis)[:, None] * wall.axis, axis=1).min())
        assert min(near) >= wall.radius - OFF


def test_holes_of_flat_faces():
    """Circles within the outer boundary alone."""
    (flat,) = [face for face in faces_of(asm.shapes.plate(4.0, 2.0, 0.3, [(0.5, 0.1, 0.4)])) if face.name == "top"]
    (hole,) = round_holes(flat)
    assert not hole.outward and hole.radius == pytest.approx(0.4, abs=1e-14) and hole.radius <= 0.4
    assert hole.center == pytest.approx([0.5, 0.1, 0.15], abs=1e-14)
    # A slot along half of that circle leaves its middle: nothing tells by how it is round.
    angle = np.linspace(0.0, 3.0, 300)
    arcs = [r * np.column_stack([np.cos(t), np.sin(t)]) for r, t in ((0.4, angle), (0.40002, angle[::-1]))]
    points = np.concatenate([*arcs, arcs[0][:1]])[::-1]
    slot = asm.NurbsCurve(points, [0.0, *np.linspace(0.0, 1.0, len(points)), 1.0], 1)
    assert round_holes(Face(flat.surface, flat.outer, [slot])) == []
    (disc,) = [face for face in faces_of(asm.shapes.solid_cylinder(0.4, 1.0)) if face.name == "top"]
    assert round_holes(disc) == [] and all(round_holes(face) == [] for face in faces_of(asm.shapes.sphere(1.0)))


@pytest.mark.parametrize("name", ["pin", "ball", "torus", "cylinder", "wire", "clip"])
def test_hulls_above_cells_hold_samples(name):
    """One node that is exact stands over each round part; together with the others they hold all."""
    rng = np.random.default_rng(3)
    cells = cells_of_body(faces_of(shapes()[name]))
    nodes = rows_of(NODE, cells.nodes)
    is_hull = (nodes.uv == 0.0).all(axis=(1, 2)) & ((nodes.disc > 0.0) | (nodes.rho > 0.0))
    is_hull[cells.first] = False
    n = np.array([direction(rng) for _ in range(300)])
    points = np.concatenate([surface_points(face, 1500, rng) for face in faces_of(shapes()[name])])
    for node in nodes[is_hull]:
        # A hull is no larger than the body's: it is exact.
        assert (top(node, False, n) <= (points @ n.T).max(axis=0) + 0.06 * cells.size).all()
    if name in ("ball", "cylinder"):
        assert is_hull[0]
        assert ((points @ n.T).max(axis=0) <= top(nodes[0], False, n) + OFF).all()


def test_what_is_not_round_is_none(cases):
    rng = np.random.default_rng(4)
    for name in ("ellipsoid", "sheet", "trimmed sheet", "box"):
        assert [round_of(face) for face in faces_of(shapes()[name])] == [None] * len(faces_of(shapes()[name]))
    assert round_of(bumpy_hole()) is None
    for _ in range(cases(10, 300)):
        surface = placed(SURFACES[("cylinder", "ball", "torus")[rng.integers(3)]], rng, 0.0)
        i, j = (int(rng.integers(n)) for n in surface.control_points.shape[:2])
        points = surface.control_points.copy()
        # So large a change of one point shows; two poles or the seam open as well.
        points[i, j] += 1e-8 * direction(rng)
        bent = asm.NurbsSurface(points, surface.knots, surface.degree, surface.weights)
        assert round_of(Face(bent)) is None


def test_less_than_half_a_cylinder_is_no_round_body():
    """A box around it is much smaller than the hull of the whole."""
    low, eighth = np.sqrt(0.5), np.pi / 8
    exact = asm.NurbsCurve([[1, 0], [1, np.tan(eighth)], [low, low]], [0, 0, 0, 1, 1, 1], 2, [1, np.cos(eighth), 1])
    points = np.stack([np.column_stack([exact.control_points, np.full(3, z)]) for z in (0.0, 1.0)], axis=1)
    weights = np.column_stack([exact.weights, exact.weights])
    wall = asm.NurbsSurface(points, [exact.knots, [0, 0, 1, 1]], (2, 1), weights)
    is_outward = Face(wall).normal(0.3, 0.3) @ [1.0, 0.3, 0.0] > 0.0
    assert round_of(Face(wall, reversed=not is_outward)) is None
    # As a part of a bore it keeps others away as any does.
    assert round_of(Face(wall, reversed=bool(is_outward))).radius == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("name", SURFACES)
def test_rewritten_ones_are_the_same(name):
    """Higher degrees, more knots and exchanged parameters change nothing of what a face lies on."""
    surface = SURFACES[name]
    plain = round_of(Face(surface))
    degree = tuple(d + 1 for d in surface.degree)
    for other in (surface.elevate(degree), surface.elevate(degree).insert_knot(0, 0.1).transposed().reversed(1)):
        found = round_of(Face(other))
        assert found.outward
        assert found.radius == pytest.approx(plain.radius, abs=1e-14)
        assert (found.half, found.ring) == pytest.approx((plain.half, plain.ring), abs=1e-14)


def test_spans_of_a_rod_with_half_balls():
    rod = asm.shapes.pipe(Path((0.0, 0.0, -0.4), (0.0, 0.0, 1.0)).line(0.8), 0.2)
    direction_of_spans, parts = round_parts(Face(rod))
    assert direction_of_spans == 0 and len(parts) == 3
    for part, z in ((parts[0], -0.4), (parts[2], 0.4)):
        assert part.radius == pytest.approx(0.2, abs=1e-14) and not part.axis.any()
        assert part.center == pytest.approx([0.0, 0.0, z], abs=1e-14)


def test_flat_rings_of_revolutions(cases):
    """A flat face all around an axis is within its outer circle and beyond its inner one; of other lines it is not."""
    rng = np.random.default_rng(7)
    for number in range(cases(10, 300)):
        inner = (0.0, rng.uniform(0.1, 0.9))[number % 2]
        ring = asm.shapes.revolution(asm.curves.polygon([(inner, 0), (1, 0), (1, 1), (inner, 1)]))
        flat = [face for face in faces_of(ring) if np.ptp(face.surface.control_points[..., 2]) < 1e-9]
        assert len(flat) == 2
        for one in flat:
            face = Face(placed(one.surface, rng, (0.0, 10.0)[number % 3 > 0]))
            found, holes, points = round_of(face), round_holes(face), surface_points(face, 300, rng)
            off, far = points - found.center, np.abs(points).max()
            assert np.abs(off @ found.axis).max() <= found.half + OFF * far
            assert found.radius == pytest.approx(1.0, abs=1e-13 * far)
            assert np.linalg.norm(off, axis=1).max() <= found.radius + OFF * far
            assert len(holes) == (inner > 0.0)
            for hole in holes:
                assert hole.radius == pytest.approx(inner, abs=1e-13 * far)
                assert distances(hole, points).min() >= hole.radius - OFF * far
    # Lines that lead past the center: the inner circle is turned against the outer one.
    net = one.surface.control_points.copy()
    edges = np.moveaxis(net, int(one.surface.closed[1]), 0)
    edges[:, 0] = edges[:, 0] @ Rotation.from_rotvec((0.0, 0.0, 0.4)).as_matrix().T
    surface = asm.NurbsSurface(net, one.surface.knots, one.surface.degree, one.surface.weights)
    assert round_of(Face(surface)) is None and not round_holes(Face(surface))


def test_cones_by_their_end_circles(cases):
    """From outside within the hull of both, from inside the level of the wall; full ones with their apex as well."""
    rng = np.random.default_rng(8)
    for number in range(cases(12, 300)):
        low, high, slope = (0.0, rng.uniform(0.1, 0.8))[number % 2], rng.uniform(0.9, 2.0), rng.uniform(0.1, 2.0)
        solid = asm.shapes.revolution(
            asm.curves.polygon([(low * slope, low), (high * slope, high), (0, high), (0, low)][: 4 if low else 3])
        )
        wall = max(faces_of(solid), key=lambda face: np.ptp(face.surface.control_points[..., 2]))
        surface = placed(wall.surface, rng, (0.0, 10.0)[number % 3 > 0])
        for is_reversed in (False, True):
            face = Face(surface, reversed=is_reversed)
            found, points = round_of(face), surface_points(face, 300, rng)
            far, off = np.abs(points).max(), points - found.center
            along = off @ found.axis
            flat = np.linalg.norm(off - along[:, None] * found.axis, axis=1)
            if found.outward:
                part = 0.5 * (along / found.half + 1.0)
                assert np.abs(along).max() <= found.half + OFF * far
                assert (flat <= found.radius - (1.0 - part) * found.less[1] + OFF * far).all()
                assert found.radius == pytest.approx(high * slope, abs=1e-12 * far)
                assert found.radius - found.less[1] == pytest.approx(low * slope, abs=1e-12 * far)
            else:
                level = np.sqrt(1.0 - found.slant**2) * flat - found.slant * along
                assert np.abs(level - found.radius).max() <= 1e-12 * far
                assert level.min() >= found.radius - OFF * far
                assert found.slant == pytest.approx(np.sin(np.arctan(slope)), abs=1e-12 * far)
