from __future__ import annotations

from math import pi

import numpy as np
import pytest

from assembly._record import rows_of, size_of
from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.faces.trim import locate_points
from assembly.geometry.faces.trim_pieces import trim_at
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.evaluate import (
    CELL_COUNT,
    CELL_SIZE,
    CELLS,
    CURVE_BREAKS,
    CURVE_RECORD,
    CURVE_SPANS,
    SIGN,
    curve_point,
    surface_point,
)
from assembly.proximity.brep import records as shell
from assembly.proximity.brep.body_nets import SurfaceParts, pack_nets
from assembly.proximity.brep.edge_cells import edge_cells
from assembly.proximity.brep.packing import pack_shell
from assembly.proximity.brep.topology import topology_of
from tests.geometry.splines.test_surface import random_surface
from tests.proximity.brep.test_topology import RINGS, SOLIDS, arc, cut_octant, disc, line, octant, tee_box

BODIES = {
    **{name: parts[0] for name, parts in SOLIDS.items()},
    "tee": tee_box(),
    "octant": octant(),
    "cut octant": cut_octant(),
    "ball": [Face(shapes.sphere(2.0))],
    "cone": [Face(shapes.cone(2.0, 3.0)), disc(2.0, -1.5, False, RINGS["four arcs"])],
    "tube": [Face(shapes.cylinder(2.0, 3.0), reversed=True)],
    "window": [Face(shapes.torus(4, 1), arc((0.5, 6.0), 1.0, 0.0, 2 * pi, 4))],
}


class Shell:
    """A shell read back from its table and pool, in the middle of other things."""

    def __init__(self, faces, scale, table_at=17, pool_at=1001):
        self.topology = topology_of(faces)
        table, pool, self.offset = pack_shell(self.topology, scale, table_at, pool_at)
        self.table = np.concatenate([np.full(table_at, -(10**9)), table, np.full(3, -(10**9))])
        self.pool = np.concatenate([np.full(pool_at, np.nan), pool, np.full(5, np.nan)])
        header = self.table[self.offset : self.offset + shell.SHELL]
        self.faces, self.edges, self.vertices = (
            rows_of(dtype, self.table[at : at + count * size_of(dtype)].reshape(count, size_of(dtype)))
            for count, at, dtype in zip(
                header[::2].tolist(),
                header[1::2].tolist(),
                (shell.FACE_DTYPE, shell.EDGE_DTYPE, shell.VERTEX_DTYPE),
                strict=True,
            )
        )

    def surface(self, record, u, v):
        closed = [self.table[record + 7], self.table[record + 8]]
        ends = [(self.table[record + 4], self.table[record + 2]), (self.table[record + 5], self.table[record + 3])]
        inside = []
        for x, shut, (at, count) in zip((u, v), closed, ends, strict=True):
            low, high = self.pool[at], self.pool[at + count]
            inside.append(low + (x - low) % (high - low) if shut and not low <= x <= high else min(max(x, low), high))
        return np.array(surface_point(self.table, self.pool, record, *inside)[0])

    def curve(self, record, t):
        return curve_point(self.table, self.pool, record, t)[0][:2]

    def domain(self, record):
        at = self.table[record + CURVE_BREAKS]
        return self.pool[at], self.pool[at + self.table[record + CURVE_SPANS]]


@pytest.fixture(scope="module", params=BODIES)
def packed(request):
    return Shell(BODIES[request.param], 3.7)


def test_counts(packed):
    topology = packed.topology
    counts = len(packed.faces), len(packed.edges), len(packed.vertices)
    assert counts == (len(topology.faces), len(topology.edges), len(topology.vertices))
    assert packed.offset == 17


def test_faces_are_scaled_and_keep_their_parameters(packed):
    rng = np.random.default_rng(0)
    for face, record in zip(packed.topology.faces, packed.faces, strict=True):
        (a, b), (c, d) = face.surface.domain
        at = record.surface
        assert packed.table[at + SIGN] == face.sign
        for u, v in zip(rng.uniform(a, b, 10), rng.uniform(c, d, 10), strict=True):
            # Rounding of sums of some sixteen products.
            np.testing.assert_allclose(packed.surface(at, u, v), face.surface.evaluate(u, v) / 3.7, atol=1e-14)
        trim = record.trim
        if not face.boundary:
            assert trim == -1
            continue
        assert trim_at(packed.table, trim).curves == len(face.boundary)
        u, v = rng.uniform(a, b, 50), rng.uniform(c, d, 50)
        sides = np.empty(50, dtype=np.int64)
        locate_points(packed.table, packed.pool, trim, u, v, sides)
        np.testing.assert_array_equal(sides, face.locate(u, v))
        for k, curve in enumerate(face.boundary):
            at = trim_at(packed.table, trim).first + CURVE_RECORD * k
            assert packed.domain(at) == curve.domain
            for t in rng.uniform(*curve.domain, 5):
                np.testing.assert_allclose(packed.curve(at, t), curve.evaluate(t), atol=1e-13)


def test_edges_join_faces_and_vertices(packed):
    for k, record in enumerate(packed.edges):
        edge = packed.topology.edges[k]
        low, high = packed.domain(record.curve)
        listed = packed.table[packed.faces[record.face_a].edges + edge.curve_a]
        assert listed == k
        assert record.surface == packed.faces[record.face_a].surface

        def point(t, record=record):
            return packed.surface(record.surface, *packed.curve(record.curve, t))

        for side, (field, t) in enumerate((("start", low), ("end", high))):
            number = record[field]
            if number < 0:
                assert number == -1 and record.start == record.end
                np.testing.assert_allclose(point(low), point(high), atol=1e-14)
                continue
            vertex = packed.vertices[number]
            at = vertex.point
            np.testing.assert_allclose(packed.pool[at : at + 3], point(t), atol=1e-14)
            ends = packed.table[vertex.edge_list :][: 2 * vertex.edges].reshape(-1, 2)
            assert [k, side] in ends.tolist()
            faces = packed.table[vertex.face_list :][: vertex.faces]
            assert record.face_a in faces
        if edge.face_b is None:
            fields = "face_b", "surface_b", "curve_b"
            assert [record[field] for field in fields] == [-1, -1, -1]
            continue
        assert record.face_b == edge.face_b
        assert packed.table[packed.faces[edge.face_b].edges + edge.curve_b] == k
        assert record.surface_b == packed.faces[edge.face_b].surface
        m0, m1 = packed.pool[record.map : record.map + 2]
        start, end = packed.domain(record.curve_b)
        for t in low + (high - low) * np.array([0.2, 0.5, 0.8]):
            other = m0 + m1 * t
            other = start + (other - start) % (end - start) if record.start < 0 else other
            b = packed.surface(record.surface_b, *packed.curve(record.curve_b, other))
            # Linear in parameters that do not go together linearly on circles of other pieces.
            assert np.linalg.norm(b - point(t)) <= 0.1 * edge.length / 3.7


def test_vertices_list_their_faces(packed):
    for vertex, record in zip(packed.topology.vertices, packed.vertices, strict=True):
        assert record.edges == len(vertex.edges)
        faces = packed.table[record.face_list :][: record.faces]
        assert tuple(faces.tolist()) == vertex.faces


def test_every_ball_holds_its_part_of_the_edge(packed):
    x = np.linspace(0.0, 1.0, 25)
    for edge, record in zip(packed.topology.edges, packed.edges, strict=True):
        count = record.cell_count
        rows = packed.pool[record.cells :][: count * shell.EDGE_CELL_SIZE].reshape(count, -1)
        low, high = packed.domain(record.curve)
        assert rows[0, 0] == low and rows[-1, 1] == high
        np.testing.assert_array_equal(rows[1:, 0], rows[:-1, 1])
        assert 16 <= count <= 256
        assert rows[:, 5].max() <= 0.0625 * edge.length / 3.7 or count == 256
        for t0, t1, *center, radius in rows:
            for t in np.append(t0 + (t1 - t0) * x[:-1], t1):
                p = packed.surface(record.surface, *packed.curve(record.curve, t))
                assert np.linalg.norm(p - center) <= radius


def test_cells_that_are_flagged_out_hold_no_material(packed):
    rng = np.random.default_rng(1)
    for face, record in zip(packed.topology.faces, packed.faces, strict=True):
        at = record.surface
        count = packed.table[at + CELL_COUNT]
        rows = packed.pool[packed.table[at + CELLS] :][: count * CELL_SIZE].reshape(count, -1)
        flags = packed.pool[record.cell_flags :][:count]
        assert set(np.unique(flags)) <= {0.0, 1.0}
        out = rows[flags == 0.0]
        if not face.boundary:
            assert not len(out)
            continue
        # Corners, middle and points inside the boxes; the flags leave no boundary point in either.
        x = np.concatenate([[[-1, -1], [-1, 1], [1, -1], [1, 1], [0, 0]], rng.uniform(-1, 1, (40, 2))])
        u, v = (out[:, k, None] + out[:, k + 9, None] * x[:, k] for k in range(2))
        for w, k in ((u, 0), (v, 1)):
            np.clip(w, *face.surface.domain[k], out=w)
        assert (face.locate(u, v) < 0).all()
        x, y = (rows[:, k, None] + rows[:, k + 9, None] * rng.uniform(-1, 1, (1, 20)) for k in range(2))
        holds = (face.locate(x, y) > 0).any(axis=1)
        assert (flags[holds] == 1.0).all()


def test_flags_leave_little_over():
    """A thin ring fills few cells of its plane: all but those near it are out."""
    face = disc(2.0, 0.0, True, RINGS["as one"])
    ring = Face(face.surface, face.outer, [arc((0, 0), 1.98, 0.0, 2 * pi, 4)])
    packed = Shell([ring], 1.0)
    count = packed.table[packed.faces[0].surface + CELL_COUNT]
    flags = packed.pool[packed.faces[0].cell_flags :][:count]
    # The circle runs through some fifth of the cells of the square twice as wide, in each of 16 pieces' boxes.
    assert 0.1 * count < flags.sum() < 0.45 * count


def test_other_scales_and_places():
    faces = shapes.plate(4, 3, 1, [(0, 0, 0.5)])
    topology = topology_of(faces)
    table, pool, offset = pack_shell(topology, 2.0)
    assert offset == 0
    twice, pool_twice, _ = pack_shell(topology, 1.0)
    np.testing.assert_array_equal(table, twice)
    ratio = pool_twice[(pool != 0.0)] / pool[pool != 0.0]
    # A factor of two is exact: every number is a length or none.
    assert set(np.unique(ratio)) == {1.0, 2.0}
    elsewhere, same_pool, offset = pack_shell(topology, 2.0, 100, 1000)
    assert offset == 100
    np.testing.assert_array_equal(pool, same_pool)
    assert set(np.unique(elsewhere - table)) == {0, 100, 1000}
    for scale in (0.0, -1.0, np.inf, "big"):
        with pytest.raises(InputError, match="scale"):
            pack_shell(topology, scale)


def wild_curve(rng, domain):
    """A random rational curve somewhere in a domain, not closed."""
    (a, b), (c, d) = domain
    degree = int(rng.integers(1, 6))
    count = degree + 1 + int(rng.integers(0, 8))
    points = np.column_stack([rng.uniform(a, b, count), rng.uniform(c, d, count)])
    inner = np.sort(rng.uniform(0.05, 0.95, count - degree - 1))
    knots = np.concatenate([np.zeros(degree + 1), inner, np.ones(degree + 1)])
    return NurbsCurve(points, knots, degree, rng.uniform(0.3, 3.0, count))


def cells_of(surface, curves, lengths):
    """The cells of edges on one surface."""
    count = len(curves)
    nets = pack_nets([SurfaceParts(surface, curves)])
    return edge_cells(nets, np.zeros(count, dtype=np.int64), np.arange(count), np.asarray(lengths))


@pytest.mark.parametrize("seed", range(30))
def test_balls_on_any_surface(seed):
    rng = np.random.default_rng(seed)
    surface = [
        random_surface(seed, (4, 2), ("multiple", "unclamped")),
        random_surface(seed, (3, 3)),
        shapes.sphere(2.0),
        shapes.torus(4.0, 1.0),
        shapes.cylinder(1.0, 5.0),
    ][seed % 5]
    curves = [wild_curve(rng, surface.domain) for _ in range(3)]
    lengths = rng.uniform(0.1, 30.0, 3)
    for curve, length, rows in zip(curves, lengths, cells_of(surface, curves, lengths), strict=True):
        assert (rows[1:, 0] == rows[:-1, 1]).all() and (rows[0, 0], rows[-1, 1]) == curve.domain
        assert rows[:, 5].max() <= 0.0625 * length or len(rows) == 256
        t = rows[:, :1] + (rows[:, 1:2] - rows[:, :1]) * np.linspace(0, 1, 40)
        uv = curve.evaluate(np.clip(t, *curve.domain))
        points = surface.evaluate(*(np.clip(uv[..., k], *surface.domain[k]) for k in range(2)))
        # The evaluated points are off by some roundings of their coordinates.
        slack = 4e-15 * np.abs(surface.control_points).max()
        assert (np.linalg.norm(points - rows[:, None, 2:5], axis=2) <= rows[:, 5:] + slack).all()


def test_balls_across_seams():
    """Curves around a torus, over both seams, from any sheet."""
    torus = shapes.torus(4.0, 1.0)
    (a, b), (c, d) = torus.domain
    for shift_u, shift_v in ((0.0, 0.0), (0.3, -0.7), (-5.2, 3.6)):
        start = np.array([a + shift_u * (b - a), c + shift_v * (d - c)])
        for turns in ((1, 0), (0, 1), (1, 1), (0.3, 0.6), (-1, 1)):
            curve = line(start, start + np.array(turns) * [b - a, d - c])
            (rows,) = cells_of(torus, [curve], [50.0])
            t = rows[:, :1] + np.diff(rows[:, :2]) * np.linspace(0, 1, 30)
            uv = curve.evaluate(np.clip(t, *curve.domain))
            points = torus.evaluate(uv[..., 0], uv[..., 1])
            assert (np.linalg.norm(points - rows[:, None, 2:5], axis=2) <= rows[:, 5:] + 2e-14).all()
            # A ball on half of the torus at most: seams do not make balls around everything.
            assert rows[:, 5].max() < 4.0


def test_a_straight_edge_has_the_smallest_balls():
    (rows,) = cells_of(shapes.plane(4.0, 4.0), [line((-1, -1), (1, 1))], [8**0.5])
    np.testing.assert_allclose(rows[:, 5], 8**0.5 / 32, rtol=1e-11)
