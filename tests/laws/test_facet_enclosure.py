"""Trees of facets hold their bodies, and a descent of two of them finds every extremal pair within its reach.

Pairs are made, not searched: a point of each body with a normal, the second body placed so that the points are a given
gap apart along the first normal and the normals oppose each other. Such a pair is extremal, whatever else there is.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from assembly._record import Store
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.kinematics.motion import RelativePose
from assembly.proximity import FeatureStatus, PairStatus, closest_features, extremal_pair
from assembly.proximity.bvh.box_descent import least_distance, tree_distance
from assembly.proximity.bvh.facet_check import edge_point, other_parameter
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.bvh.packing import pack_tree
from assembly.proximity.bvh.tree import facing_pairs, pairs_within, tree_at
from tests.geometry.splines.test_surface import random_surface

CLIP = (Face(shapes.paper_clip()),)
SLOT = solids.plate_with_slot(2.0, 1.0, 0.3, 0.8, 0.3)
FAR = (Face(shapes.torus(2e-3, 1e-3).transformed(translation=(10.0, -20.0, 30.0))),)


def trimmed():
    """A wavy rational patch of several spans within a circle."""
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(6.0), np.arange(5.0), indexing="ij")
    points = np.stack([x, y, rng.uniform(size=(6, 5))], axis=-1)
    surface = NurbsSurface(
        points,
        (np.r_[[0.0] * 4, 0.3, 0.6, [1.0] * 4], np.r_[[0.0] * 3, 0.4, 0.7, [1.0] * 3]),
        (3, 2),
        rng.uniform(0.5, 2.0, (6, 5)),
    )
    w = np.sqrt(0.5)
    square = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    circle = NurbsCurve(
        0.4 * np.array(square, float) + 0.5, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, w, 1, w, 1, w, 1, w, 1]
    )
    return (Face(surface, circle),)


BODIES = {
    "torus": (Face(shapes.torus(2.0, 0.7)),),
    "sphere": (Face(shapes.sphere(1.3)),),
    "ellipsoid, inside out": (Face(shapes.ellipsoid(1.0, 2.0, 0.3), reversed=True),),
    "clip": CLIP,
    "far": FAR,
    "cone": (Face(shapes.cone(1.0, 2.0)),),
    "mixed": (Face(random_surface(1, (4, 2), ("multiple", "unclamped"))),),
    "high": (Face(random_surface(2, (7, 6))),),
    "trimmed": trimmed(),
    "box": shapes.box(1.0, 1.3, 0.8),
    "cylinder": solids.solid_cylinder(0.5, 1.5),
    "slot": SLOT,
    "cam": solids.cam([1.0, 1.2, 0.8, 1.1, 0.9, 1.0], 0.4, 0.2),
    "plate": solids.plate(2.0, 1.5, 0.3, [(0.4, 0.3, 0.15), (-0.5, -0.2, 0.25)]),
}


class Descent:
    """Two trees packed, and what a descent of them finds at a pose of the second one."""

    def __init__(self, f, g):
        self.trees = FacetTree.of(f), FacetTree.of(g)
        table, pool, self.f = pack_tree(self.trees[0], 1.0)
        more, doubles, self.g = pack_tree(self.trees[1], 1.0, table.size, pool.size)
        self.table, self.pool = np.concatenate([table, more]), np.concatenate([pool, doubles])
        self.stack = np.empty((256, 2), dtype=np.int64)
        self.out = np.empty((200_000, 2), dtype=np.int64)

    def pairs(self, turn, shift, reach, stack=None, out=None):
        stack = self.stack if stack is None else stack
        out = self.out if out is None else out
        pose = tuple(turn.ravel().tolist()), tuple(shift.tolist())
        return facing_pairs(self.table, self.pool, (self.f, self.g), *pose, reach, stack, out)

    def found(self, turn, shift, reach):
        count = self.pairs(turn, shift, reach)
        assert 0 <= count <= len(self.out)
        return {tuple(row) for row in self.out[:count].tolist()}

    def lower(self, turn, shift, upper, stack=None):
        stack = self.stack if stack is None else stack
        pose = tuple(turn.ravel().tolist()), tuple(shift.tolist())
        return tree_distance(self.table, self.pool, (self.f, self.g), *pose, upper, stack)


def elements_at(tree, feature, parameters):
    """The elements of a feature whose boxes hold parameters: up to rounding, which makes the wider set."""
    box = tree.parameters
    slack = 1e-9 * np.abs(box).max()
    held = tree.feature == feature
    for k in range(2):
        held &= (box[:, 2 * k] <= parameters[k] + slack) & (parameters[k] <= box[:, 2 * k + 1] + slack)
    return np.flatnonzero(held).tolist()


def sample(tree, rng):
    """A feature, parameters on it, the point and a unit normal there."""
    topology = tree.topology
    kinds = 1 + bool(topology.edges) + any(len(v.edges) >= 3 for v in topology.vertices)
    kind = rng.integers(kinds)
    faces = len(topology.faces)
    while kind == 0:
        number = int(rng.integers(faces))
        face = topology.faces[number]
        u, v = (rng.uniform(*ends) for ends in face.surface.domain)
        if face.contains(u, v):
            return number, (u, v), face.surface.evaluate(u, v), face.normal(u, v)
    while kind == 1:
        number = int(rng.integers(len(topology.edges)))
        edge = topology.edges[number]
        face = topology.faces[edge.face_a]
        curve = face.boundary[edge.curve_a]
        t = rng.uniform(*curve.domain, 1)
        point, along = edge_point(face.surface, curve, t)
        at = (t[0], 0.0)
        if edge.face_b is None:
            # Any direction across the edge.
            n = np.cross(along[0], rng.normal(size=3))
            return faces + number, at, point[0], n / np.linalg.norm(n)
        other = topology.faces[edge.face_b]
        second = other.boundary[edge.curve_b]
        low, high = second.domain
        there = low + np.mod(other_parameter(topology, edge, t) - low, high - low) if edge.start is None else None
        there = other_parameter(topology, edge, t) if there is None else there
        a, b = face.normal(*curve.evaluate(t)[0]), other.normal(*second.evaluate(there)[0])
        if face.sign * np.cross(a, b) @ along[0] < -1e-9:
            continue
        x = rng.uniform()
        n = x * a + (1.0 - x) * b
        return faces + number, at, point[0], n / np.linalg.norm(n)
    # A convex corner of three flat faces or more: combinations of their normals.
    while True:
        number = int(rng.integers(len(topology.vertices)))
        vertex = topology.vertices[number]
        normals = []
        for k in vertex.faces:
            face = topology.faces[k]
            at = [curve.evaluate(curve.domain[0]) for curve in face.boundary]
            near = min(at, key=lambda c, face=face: np.linalg.norm(face.surface.evaluate(*c) - vertex.point))
            normals.append(face.normal(*near))
        rays = [
            (-1.0 if side else 1.0) * edge_point(face.surface, curve, np.array(curve.domain)[[side]])[1][0]
            for index, side in vertex.edges
            for edge in [topology.edges[index]]
            for face in [topology.faces[edge.face_a]]
            for curve in [face.boundary[edge.curve_a]]
        ]
        n = rng.dirichlet(np.ones(len(normals))) @ np.array(normals)
        if not rays or max(ray @ n for ray in rays) > 0.0:
            continue
        return faces + len(topology.edges) + number, (0.0, 0.0), vertex.point, n / np.linalg.norm(n)


def placed(rng, f, n, g, m, gap):
    """Rotation and shift of g: its point gap beyond f along n, its normal m opposed, turned about n at random."""
    turn = Rotation.align_vectors([-n], [m])[0]
    turn = (Rotation.from_rotvec(n * rng.uniform(0.0, 2.0 * np.pi)) * turn).as_matrix()
    return turn, f + gap * n - turn @ g


@pytest.mark.parametrize("name", BODIES)
def test_a_tree_holds_its_body(name, cases):
    # The wavy surface of high degree takes tens of thousands of patches for a narrow angle.
    for angle in (0.6,) if name == "high" else (0.45, 0.2)[: cases(1, 2)]:
        tree = FacetTree.of(BODIES[name], angle=angle)
        assert tree.check_enclosure(cases(400, 3000), seed=1) <= 0.0
    tree = FacetTree.of(BODIES[name], count=400)
    assert len(tree.corners) >= 400
    assert tree.check_enclosure(cases(400, 3000), seed=2) <= 0.0


@pytest.mark.parametrize(
    "pair",
    [
        ("torus", "torus"),
        ("clip", "clip"),
        ("sphere", "ellipsoid, inside out"),
        ("far", "far"),
        ("cone", "mixed"),
        ("trimmed", "torus"),
        ("box", "cylinder"),
        ("slot", "cam"),
        ("plate", "box"),
    ],
)
def test_every_pair_that_is_made_is_found(pair, cases):
    rng = np.random.default_rng(11)
    descent = Descent(BODIES[pair[0]], BODIES[pair[1]])
    size = [np.linalg.norm(np.ptp(np.stack([tree.low, tree.high]), axis=(0, 1))) for tree in descent.trees]
    spared = []
    for _ in range(cases(40, 250)):
        (kf, xf, f, n), (kg, xg, g, m) = (sample(tree, rng) for tree in descent.trees)
        gap = rng.choice([-1.0, 0.0, 1.0]) * 10.0 ** rng.uniform(-6.0, -0.5) * min(size)
        turn, shift = placed(rng, f, n, g, m, gap)
        reach = abs(gap) * (1.0 + 1e-9) + 1e-12 * max(size)
        found = descent.found(turn, shift, reach)
        ones, others = elements_at(descent.trees[0], kf, xf), elements_at(descent.trees[1], kg, xg)
        assert ones and others
        # On a line between two patches the one side may be it, or the other.
        assert any((a, b) in found for a in ones for b in others), (kf, kg, gap)
        spared.append(len(found) / (len(descent.trees[0].feature) * len(descent.trees[1].feature)))
    # A descent that returns everything would pass.
    assert np.median(spared) < 0.05


@pytest.mark.parametrize("pair", [("torus", "torus"), ("clip", "clip"), ("sphere", "torus")])
def test_every_extremum_that_newton_finds_is_in_a_pair(pair, cases):
    rng = np.random.default_rng(12)
    f, g = (BODIES[name][0] for name in pair)
    descent = Descent((f,), (g,))
    checked, count = 0, cases(1, 8)
    for _ in range(count):
        (_, _, a, n), (_, _, b, m) = (sample(tree, rng) for tree in descent.trees)
        radius = 0.5 if "clip" in pair else 0.7
        gap = rng.uniform(-0.4, 0.4) * radius
        turn, shift = placed(rng, a, n, b, m, gap)
        reach = radius
        q = np.concatenate([shift, Rotation.from_matrix(turn).as_quat(scalar_first=True)])
        home = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
        found = descent.found(turn, shift, reach)
        # Starts all over: the nearest and the best aligned of random samples.
        u, v = (rng.uniform(*ends, 1500) for ends in f.surface.domain)
        s, t = (rng.uniform(*ends, 1500) for ends in g.surface.domain)
        d = np.linalg.norm(f.surface.evaluate(u, v)[:, None] - (g.surface.evaluate(s, t) @ turn.T + shift), axis=2)
        d += np.where(f.normal(u, v) @ (g.normal(s, t) @ turn.T).T < -0.5, 0.0, 100.0)
        i, j = np.unravel_index(
            np.argsort(d, axis=None)[:: max(1, int((d < 2.0 * radius).sum()) // 150)][:150], d.shape
        )
        for start in np.column_stack([u[i], v[i], s[j], t[j]]):
            root = extremal_pair(f, home, g, q, start=start)
            x = root.parameters
            if root.status is not PairStatus.CONVERGED or abs(root.gap) > reach:
                continue
            if root.normal @ (turn @ g.normal(x[2], x[3])) > 0.0:
                continue
            checked += 1
            ones, others = elements_at(descent.trees[0], 0, x[:2]), elements_at(descent.trees[1], 0, x[2:])
            assert any((a, b) in found for a in ones for b in others), root
    assert checked > 100 / 8 * count


@pytest.mark.parametrize("pair", [("box", "cylinder"), ("slot", "cam"), ("plate", "box"), ("trimmed", "torus")])
def test_the_closest_features_are_in_a_pair(pair, cases):
    rng = np.random.default_rng(13)
    bodies = [BODIES[name] for name in pair]
    descent = Descent(*bodies)
    first = [
        (0, len(tree.topology.faces), len(tree.topology.faces) + len(tree.topology.edges)) for tree in descent.trees
    ]
    kinds = ("face", "edge", "vertex")
    middles = [0.5 * (tree.low.min(axis=0) + tree.high.max(axis=0)) for tree in descent.trees]
    checked, count = 0, cases(20, 60)
    for _ in range(count):
        turn = Rotation.random(random_state=rng).as_matrix()
        way = rng.normal(size=3)
        shift = middles[0] + rng.uniform(0.5, 3.0) * way / np.linalg.norm(way) - turn @ middles[1]
        q = np.concatenate([shift, Rotation.from_matrix(turn).as_quat(scalar_first=True)])
        closest = closest_features(*bodies, q_b=q)
        size = 10.0
        if closest.status is FeatureStatus.APART:
            distance = float(np.linalg.norm(closest.points[1] - closest.points[0]))
            assert descent.lower(turn, shift, 2.0 * distance) <= distance
            assert descent.lower(turn, shift, 0.5 * distance) <= 0.5 * distance
        elif closest.status is not FeatureStatus.PENETRATING:
            continue
        found = descent.found(turn, shift, abs(closest.gap) + 1e-12 * size)
        codes = [first[k][kinds.index(closest.features[k].kind)] + closest.features[k].index for k in range(2)]
        ones, others = (elements_at(descent.trees[k], codes[k], closest.parameters[k]) for k in range(2))
        assert any((a, b) in found for a in ones for b in others), closest
        checked += 1
    assert checked > count / 2


def test_a_lower_bound_is_near_the_distance():
    rng = np.random.default_rng(14)
    torus, clip = BODIES["torus"], CLIP
    for f, g in ((torus, torus), (clip, torus)):
        descent = Descent(f, g)
        for _ in range(15):
            turn = Rotation.random(random_state=rng).as_matrix()
            way = rng.normal(size=3)
            shift = rng.uniform(2.0, 30.0) * way / np.linalg.norm(way)
            q = np.concatenate([shift, Rotation.from_matrix(turn).as_quat(scalar_first=True)])
            closest = closest_features(f, g, q_b=q)
            if closest.status is not FeatureStatus.APART:
                assert descent.lower(turn, shift, 1.0) == 0.0
                continue
            lower = descent.lower(turn, shift, 100.0)
            # Boxes reach over the surface by about their size: half of one here.
            assert closest.gap - 0.7 <= lower <= closest.gap
            # Where something nearer is known that is the bound, and a short stack makes it lower.
            assert descent.lower(turn, shift, 0.5 * lower) == pytest.approx(0.5 * lower, rel=1e-9)
            assert descent.lower(turn, shift, 100.0, np.empty((6, 2), dtype=np.int64)) <= lower
            assert descent.lower(turn, shift, 100.0, np.empty((0, 2), dtype=np.int64)) <= lower


def test_what_has_no_room_says_so():
    descent = Descent(BODIES["torus"], BODIES["torus"])
    turn, shift = np.eye(3), np.array([0.1, 0.0, 1.4])
    whole = descent.pairs(turn, shift, 0.3)
    assert whole > 10
    assert descent.pairs(turn, shift, 0.3, stack=np.empty((3, 2), dtype=np.int64)) == -1
    assert descent.pairs(turn, shift, 0.3, stack=np.empty((0, 2), dtype=np.int64)) == -1
    short = np.full((6, 2), -5)
    assert descent.pairs(turn, shift, 0.3, out=short[:5]) == whole
    assert (short[:5] == descent.out[:5]).all() and (short[5] == -5).all()
    assert tree_at(descent.table, descent.f).nodes == len(descent.trees[0].nodes.child)


def test_plain_python_finds_the_same():
    rng = np.random.default_rng(16)
    descent = Descent(BODIES["cylinder"], BODIES["box"])
    workspace = np.empty((20_000, 2), dtype=np.int64)
    for _ in range(4):
        (_, _, f, n), (_, _, g, m) = (sample(tree, rng) for tree in descent.trees)
        turn, shift = placed(rng, f, n, g, m, rng.uniform(-0.1, 0.1))
        pose = RelativePose(tuple(turn.ravel().tolist()), tuple(shift.tolist()))
        arrays = Store(descent.table, descent.pool), (descent.f, descent.g)
        # An inner kernel is plain Python when it is called from Python.
        count = pairs_within(*arrays, pose, 0.2, descent.stack, workspace)
        assert {tuple(row) for row in workspace[:count].tolist()} == descent.found(turn, shift, 0.2)
        lower = least_distance(*arrays, pose, 5.0, descent.stack)
        assert descent.lower(turn, shift, 5.0) == pytest.approx(lower, rel=1e-12, abs=1e-12)


def test_both_ways_round_and_in_other_axes(cases):
    """The pairs that are made are found by g and f as by f and g, and whatever the axes of both are."""
    rng = np.random.default_rng(15)
    one, other = Descent(BODIES["torus"], CLIP), Descent(CLIP, BODIES["torus"])
    for _ in range(cases(15, 40)):
        (_, xf, f, n), (_, xg, g, m) = (sample(tree, rng) for tree in one.trees)
        gap = rng.uniform(-0.3, 0.3)
        turn, shift = placed(rng, f, n, g, m, gap)
        ones, others = elements_at(one.trees[0], 0, xf), elements_at(one.trees[1], 0, xg)
        for found, swapped in (
            (one.found(turn, shift, 0.31), False),
            (other.found(turn.T, -turn.T @ shift, 0.31), True),
        ):
            assert any(((b, a) if swapped else (a, b)) in found for a in ones for b in others)
