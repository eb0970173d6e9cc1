"""Trees of facets: what they are made of, that they hold their bodies, and what is refused."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from assembly._record import rows_of
from assembly.errors import InputError
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes import solids
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface
from assembly.proximity.bvh import tree as layout
from assembly.proximity.bvh.cones import FULL, around_cones, around_vectors, between
from assembly.proximity.bvh.facet_check import triangle_distance
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.bvh.packing import pack_tree

TORUS = (Face(shapes.torus(2.0, 0.7)),)
SPHERE = (Face(shapes.sphere(1.3)),)
BOX = shapes.box(1.0, 1.3, 0.8)
SLOT = solids.plate_with_slot(2.0, 1.0, 0.3, 0.8, 0.3)


def test_a_body_has_one_tree():
    assert FacetTree.of(TORUS) is FacetTree.of(TORUS)
    assert FacetTree.of(TORUS, count=50) is not FacetTree.of(TORUS)


@pytest.mark.parametrize("angle", [0.4, 0.2, 0.1])
def test_cones_are_as_narrow_as_asked(angle):
    for faces in (TORUS, SPHERE):
        tree = FacetTree.of(faces, angle=angle)
        assert tree.half_angle.max() <= angle
        # Not by a multitude of patches: the sphere needs some (2 / angle)^2 for its half angles, a torus 3 times them.
        assert len(tree.corners) < 12.0 * (4.0 / angle) ** 2


@pytest.mark.parametrize("count", [64, 500, 3000])
def test_as_many_patches_as_asked(count):
    tree = FacetTree.of(TORUS, count=count)
    assert len(tree.corners) == count
    assert tree.triangles.shape == (2 * count, 3, 3)
    # A facet over an arc of a circle is off it as the square of its length, so by the number of facets.
    assert tree.offset * count < 2.0 * FacetTree.of(TORUS, count=6000).offset * 6000


def test_patches_tile_a_whole_face():
    tree = FacetTree.of(SPHERE, angle=0.3)
    box = tree.parameters
    (u0, u1), (v0, v1) = SPHERE[0].surface.domain
    area = ((box[:, 1] - box[:, 0]) * (box[:, 3] - box[:, 2])).sum()
    assert area == pytest.approx((u1 - u0) * (v1 - v0), rel=1e-12)


def test_what_the_trim_leaves_out_is_not_there():
    face = solids.plate(2.0, 1.5, 0.3, [(0.4, 0.3, 0.3)])[-1]
    assert face.holes
    tree = FacetTree.of((face,))
    box = tree.parameters[: len(tree.corners)]
    u, v = (np.random.default_rng(0).uniform(*ends, 4000) for ends in face.surface.domain)
    held = (box[:, 0] <= u[:, None]) & (u[:, None] <= box[:, 1])
    held &= (box[:, 2] <= v[:, None]) & (v[:, None] <= box[:, 3])
    inside = face.contains(u, v)
    assert held.any(axis=1)[inside].all()
    # Where boundaries run no patch is longer than an eighth of the face: much of what is outside is gone.
    assert (~held.any(axis=1)[~inside]).mean() > 0.3


def test_edges_and_vertices_of_a_box():
    tree = FacetTree.of(BOX)
    features = set(tree.feature.tolist())
    assert features == set(range(6 + 12 + 8))
    edges = (tree.feature >= 6) & (tree.feature < 18)
    # Half a right angle on an edge; at a corner the angle between the diagonal of a cube and its axes.
    np.testing.assert_allclose(tree.half_angle[edges], np.pi / 4.0, atol=1e-9)
    np.testing.assert_allclose(tree.half_angle[tree.feature >= 18], np.arccos(1.0 / np.sqrt(3.0)), atol=1e-4)
    assert tree.half_angle[tree.feature < 6].max() < 1e-12


def test_concave_edges_have_no_elements():
    tree = FacetTree.of(SLOT)
    topology = tree.topology
    present = set(tree.feature.tolist())
    for k, edge in enumerate(topology.edges):
        if edge.convex is True:
            assert len(topology.faces) + k in present
    # Inside corners: an L of a box has one edge where material bends toward the outside.
    corners = np.array([(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)], dtype=float)
    sides = [NurbsCurve(corners[k : k + 2], [0, 0, 1, 1], 1) for k in range(6)]
    bracket = solids.extrusion(sides, 0.5)
    tree = FacetTree.of(bracket)
    first = len(tree.topology.faces)
    concave = [k for k, edge in enumerate(tree.topology.edges) if edge.convex is False]
    assert len(concave) == 1
    assert first + concave[0] not in set(tree.feature.tolist())
    assert tree.check_enclosure(500) <= 0.0


def test_a_part_of_an_edge_over_many_pieces():
    """The wall of a cylinder in some 400 pieces around: a part of its edges runs through 25 of them."""
    faces = shapes.solid_cylinder(1.0, 3.0)
    (number,) = (k for k, face in enumerate(faces) if any(face.surface.closed))
    surface = faces[number].surface
    around = surface.closed.index(True)
    for value in np.linspace(*surface.domain[around], 402)[1:-1].tolist():
        surface = surface.insert_knot(around, value)
    tree = FacetTree.of((*faces[:number], Face(surface), *faces[number + 1 :]))
    assert tree.check_enclosure(1000) <= 0.0
    edges = (tree.feature >= 3) & (tree.feature < 5)
    # Between the normals of the wall and of an end there is a right angle, and what the wall's turn along a part.
    assert edges.any() and (np.abs(tree.half_angle[edges] - np.pi / 4.0) < 0.2).all()


def test_a_free_edge_has_all_directions():
    face = Face(shapes.plane(2.0, 1.0))
    tree = FacetTree.of((face,))
    edges = (tree.feature >= 1) & (tree.feature < 5)
    assert edges.sum() >= 4
    assert (tree.half_angle[edges] == FULL).all()


def test_a_reversed_face_turns_its_cones():
    one, other = (FacetTree.of((Face(shapes.sphere(1.0), reversed=turned),)) for turned in (False, True))
    np.testing.assert_allclose(one.axis, -other.axis, atol=1e-12)


def test_creases_are_edges():
    """A square tube: four knot lines of u, the seam among them, are creases."""
    corners = np.array([(1, -1), (1, 1), (-1, 1), (-1, -1), (1, -1)], dtype=float)
    points = np.stack([np.column_stack([corners, np.full(5, z)]) for z in (0.0, 2.0)], axis=1)
    tube = Face(NurbsSurface(points, ([0, 0, 1, 2, 3, 4, 4], [0, 0, 1, 1]), (1, 1)))
    assert tube.surface.closed == (True, False)
    tree = FacetTree.of((tube,), count=400)
    patches = slice(0, len(tree.corners))
    assert (tree.half_angle[patches] < 1e-12).all()
    # Four sides; four edges between two of them hold the normals of both, at right angles.
    convex = np.flatnonzero([edge.convex is True for edge in tree.topology.edges])
    assert len(tree.topology.faces) == 4 and len(convex) == 4
    for edge in convex:
        half = tree.half_angle[tree.feature == 4 + edge]
        assert (np.abs(half - np.pi / 4) < 1e-9).all()
    assert tree.check_enclosure() <= 0.0
    # A wire has knots, too, but no creases.
    assert FacetTree.of(TORUS).half_angle.max() < FULL


def test_nodes_hold_their_children():
    for faces in (TORUS, BOX):
        tree = FacetTree.of(faces)
        nodes = tree.nodes
        inner = np.flatnonzero(nodes.child >= 0)
        assert len(nodes.child) == 2 * len(tree.feature) - 1
        for k in range(2):
            child = nodes.child[inner] + k
            assert (nodes.low[inner] <= nodes.low[child]).all() and (nodes.high[inner] >= nodes.high[child]).all()
        leaves = -1 - nodes.child[nodes.child < 0]
        assert sorted(leaves.tolist()) == list(range(len(tree.feature)))


def test_check_enclosure_sees_what_is_wrong():
    tree = FacetTree.of(TORUS, count=300)
    assert tree.check_enclosure() <= 0.0
    size = 2.7 * 2.0
    shrunk = dataclasses.replace(tree, low=tree.low + 0.01 * size)
    assert shrunk.check_enclosure() > 1e-3
    narrow = dataclasses.replace(tree, half_angle=0.8 * tree.half_angle)
    assert narrow.check_enclosure() > 1e-3
    flat = dataclasses.replace(tree, chord_error=0.3 * tree.chord_error)
    assert flat.check_enclosure() > 1e-4
    short = tree.nodes._replace(high=tree.nodes.high - 0.01 * size)
    assert dataclasses.replace(tree, nodes=short).check_enclosure() > 1e-3
    holed = dataclasses.replace(tree, parameters=np.where(np.arange(300)[:, None] == 7, 0.0, tree.parameters))
    assert holed.check_enclosure(5000) == np.inf


def test_packed_trees_stand_where_they_are_put():
    tree = FacetTree.of(BOX)
    one, pool, at = pack_tree(tree, 2.0)
    assert at == 0
    moved, same, offset = pack_tree(tree, 2.0, 100, 1000)
    assert offset == 100
    np.testing.assert_array_equal(pool, same)
    header, other = layout.tree_at(one, 0), layout.tree_at(moved, 0)
    assert other.node_table - header.node_table == 100
    assert other.node_pool - header.node_pool == other.element_pool - header.element_pool == 1000
    np.testing.assert_array_equal(moved[layout.TREE :], one[layout.TREE :])
    count = header.nodes
    nodes = rows_of(layout.NODE_BOUNDS, pool[: layout.NODE * count].reshape(count, layout.NODE))
    center, half = nodes.center, nodes.half
    assert (center - half <= 0.5 * tree.nodes.low).all() and (center + half >= 0.5 * tree.nodes.high).all()
    np.testing.assert_allclose(np.hypot(nodes.cosine, nodes.sine), 1.0, atol=1e-15)


def test_bad_input():
    with pytest.raises(TypeError, match="faces is .* expected a tuple of Face"):
        FacetTree.of([TORUS[0]])
    with pytest.raises(InputError, match="faces is empty"):
        FacetTree.of(())
    with pytest.raises(InputError, match=r"angle is 2; expected 0\.005 to 1\.5 rad"):
        FacetTree.of(TORUS, angle=2.0)
    with pytest.raises(InputError, match="count is 0; expected an integer from 1"):
        FacetTree.of(TORUS, count=0)
    with pytest.raises(InputError, match="scale is 0; expected a positive number"):
        pack_tree(FacetTree.of(TORUS), 0.0)


def test_cones_hold_what_they_are_around():
    rng = np.random.default_rng(5)
    vectors = rng.normal(size=(200, 6, 3)) * 0.3 + rng.normal(size=(200, 1, 3))
    vectors[::7, 2] = 0.0
    axis, half = around_vectors(vectors, np.zeros(200), np.ones(200, dtype=bool))
    weights = rng.uniform(size=(200, 6, 1))
    mixed = (weights * vectors).sum(axis=1)
    mixed /= np.linalg.norm(mixed, axis=1, keepdims=True)
    narrow = half < FULL
    assert 50 < narrow.sum() < 200
    assert (between(mixed, axis) <= half)[narrow].all()
    begins = np.arange(0, 200, 4)
    around, wide = around_cones(axis, np.minimum(half, 0.1), begins)
    reach = between(axis, np.repeat(around, 4, axis=0)) + np.minimum(half, 0.1)
    assert (reach <= np.repeat(wide, 4) + 1e-15).all() or (wide == FULL).any()
    # Two directions: the cone is no wider than half the angle between them, all but what the steps leave.
    pair = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert around_cones(pair, np.zeros(2), np.array([0]))[1][0] == pytest.approx(np.pi / 4.0, abs=1e-9)


def test_a_vector_that_may_be_zero_proves_nothing():
    vectors = np.array([[[1.0, 0.0, 0.0], [1e-9, 0.0, 0.0]]])
    yes, no = np.array([True]), np.array([False])
    assert around_vectors(vectors, np.array([1e-8]), yes)[1][0] == FULL
    assert around_vectors(vectors, np.array([1e-12]), yes)[1][0] < 2e-3
    assert around_vectors(np.zeros((1, 3, 3)), np.zeros(1), yes)[1][0] == FULL
    vectors[0, 1] = 0.0
    assert around_vectors(vectors, np.zeros(1), yes)[1][0] < 1e-12
    assert around_vectors(vectors, np.zeros(1), no)[1][0] == FULL


def test_distance_of_triangles():
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    points = np.array([[0.2, 0.2, 0.5], [-3.0, -4.0, 0.0], [1.0, 1.0, 0.0], [0.5, -2.0, 0.0]])
    found = triangle_distance(points, np.repeat(triangle[None], 4, axis=0))
    np.testing.assert_allclose(found, [0.5, 5.0, np.sqrt(0.5), 2.0], rtol=1e-15)
    segment = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]])
    np.testing.assert_allclose(triangle_distance(np.array([[2.0, 1.0, 0.0]]), segment), [np.sqrt(2.0)])
