"""Points of faces are within their cells, however often these are halved, and within all nodes above them.

Points are evaluated as cells' corners are, which are off by `cells.ROUNDING` of the largest coordinate at most, and so
are the points: `ROUNDED` of it twice.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly._record import rows_of
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.body_cells import cells_of_body
from assembly.proximity.clearance.cells import cells_of
from assembly.proximity.clearance.records import FLAT, LINKS, NODE, NONE, ROUNDED, RULED
from tests.proximity.clearance.nodes import forest_of, halve_all, leaves, outside, top, tree_of
from tests.proximity.clearance.scenes import direction, faces_of
from tests.proximity.clearance.splines import points_of, random_surface, shapes

OFF = 4e-15
SHAPES = shapes()


@pytest.mark.parametrize("name", SHAPES)
def test_points_are_within_cells(name, cases):
    rng, forest = np.random.default_rng(0), forest_of(faces_of(SHAPES[name]))
    points = points_of(SHAPES[name], cases(60, 2000), rng)
    far = np.abs(points).max()
    for _ in range(cases(4, 7)):
        assert outside(forest, leaves(forest), points).max() <= OFF * far
        halve_all(forest, rng, 0.7)


def test_points_beside_an_apex_are_within_cells(cases):
    """Triangles with two corners in the apex have no area in space, but what is over them is over no other one."""
    for seed in range(cases(8, 100)):
        rng, forest = np.random.default_rng(seed), forest_of(faces_of(SHAPES["cone"]))
        points = points_of(SHAPES["cone"], 60, rng)
        for _ in range(5):
            assert outside(forest, leaves(forest), points).max() <= OFF * np.abs(points).max()
            halve_all(forest, rng, 0.7)


def test_points_of_random_surfaces_are_within_cells(cases):
    rng = np.random.default_rng(1)
    for number in range(cases(6, 400)):
        surface = random_surface(rng, offset=(0.0, 1e4)[number % 2])
        forest, points = forest_of(faces_of(surface)), points_of(surface, 60, rng)
        for _ in range(3):
            assert outside(forest, leaves(forest), points).max() <= OFF * np.abs(points).max()
            halve_all(forest, rng, 0.2)


@pytest.mark.parametrize("name", ["sheet", "trimmed sheet", "plate", "wire", "bumpy hole"])
def test_halved_cells_are_nearer(name):
    """Halved by their chord errors, four times: twice in either direction, which leaves a sixteenth of it at best."""
    rng, forest = np.random.default_rng(2), forest_of(faces_of(SHAPES[name]))
    sizes = []
    for _ in range(2):
        _, nodes = tree_of(forest)
        sizes.append((nodes.disc + nodes.reach)[leaves(forest)].max())
        for _ in range(4):
            halve_all(forest, rng, by_length=False)
    assert sizes[1] < 0.3 * sizes[0]


@pytest.mark.parametrize("name", SHAPES)
def test_nodes_hold_what_is_below(name):
    """Corners of the cells below, and balls around them: of boxes, and of exact hulls of what is round."""
    rng, forest = np.random.default_rng(3), forest_of(faces_of(SHAPES[name]))
    links, nodes = tree_of(forest)
    far = np.abs(nodes.corner).max()
    ways = np.array([direction(rng) for _ in range(60)])

    def below(k):
        if links.child[k] == NONE:
            return [k]
        return below(links.child[k]) + below(links.child[k] + 1)

    for k in range(len(links)):
        cells = below(k)
        points = nodes.corner[cells].reshape(-1, 3)
        n = np.vstack([ways, nodes.axes[k], -nodes.axes[k]])
        assert ((points @ n.T).max(axis=0) <= top(nodes[k], links.face[k] != NONE, n) + OFF * far).all()
        assert np.linalg.norm(points - nodes.center[k], axis=1).max() <= nodes.radius[k] + OFF * far
        if links.child[k] == NONE:
            continue
        if nodes.disc[k] == 0.0 and nodes.rho[k] == 0.0:
            # A disc reaches along an axis by the part of that across its ruling.
            flat = np.linalg.norm(np.cross(nodes.ruling[cells][:, None], nodes.axes[k]), axis=2)
            reach = np.repeat(nodes.rho[cells][:, None] + nodes.disc[cells][:, None] * flat, 4, axis=0)
            heights = (points - nodes.center[k]) @ nodes.axes[k].T
            assert (np.abs(heights) + reach <= nodes.half[k] + OFF * far).all()


@pytest.mark.parametrize("name", SHAPES)
def test_all_of_a_body_is_within_its_root_and_its_halves(name):
    rng, forest = np.random.default_rng(4), forest_of(faces_of(SHAPES[name]))
    points = points_of(SHAPES[name], 300, rng)
    links, nodes = tree_of(forest)
    n = np.array([direction(rng) for _ in range(200)])
    high = [top(nodes[k], links.face[k] != NONE, n) for k in (0, *(links.child[0] + np.arange(2)))]
    told = (points @ n.T).max(axis=0)
    assert (told <= high[0] + OFF * np.abs(points).max()).all()
    assert (told <= np.maximum(high[1], high[2]) + OFF * np.abs(points).max()).all()


@pytest.mark.parametrize(
    ("name", "forms"),
    [("box", {FLAT}), ("pin", {FLAT, RULED}), ("ball", {ROUNDED}), ("cone", {RULED}), ("cylinder", {RULED})],
)
def test_forms(name, forms):
    found = {cells_of(face, 0.01, 0.5).form for face in faces_of(SHAPES[name])}
    assert found == forms


@pytest.mark.parametrize("degrees", [(2, 2), (3, 4), (4, 1)])
def test_lines_of_any_degree_are_lines(degrees):
    """A wall of other degrees, with more knots, and with the parameters exchanged, has the cells of the plain one."""
    wall = asm.shapes.cylinder(0.3, 1.2)
    plain = cells_of(Face(wall), 0.01, 0.5)
    assert plain.form == RULED
    written = wall.elevate(degrees).insert_knot(1, 0.4)
    for surface in (written, written.transposed().reversed(0)):
        table = cells_of(Face(surface), 0.01, 0.5)
        assert table.form == RULED
        assert np.linalg.norm(np.cross(table.ruling, plain.ruling)) < 1e-14
        assert table.pad.max() < 1e-13
    # Not at one speed: heights are no linear function of the parameters, and cells would be off along the lines.
    even = wall.elevate((2, 2))
    slow = asm.NurbsSurface(even.control_points, even.knots, (2, 2), even.weights * [1.0, 0.7, 1.0])
    assert cells_of(Face(slow), 0.01, 0.5).form == ROUNDED


def test_a_flat_face_of_straight_lines_is_exact():
    """Its cells are no thicker than rounding: bodies that lie on it are decided."""
    for face in faces_of(SHAPES["box"]):
        table = cells_of(face, 0.01, 0.5)
        assert not table.second.any() and table.pad.max() < 1e-14
    cells = cells_of_body(faces_of(SHAPES["box"]))
    assert rows_of(NODE, cells.nodes[cells.first]).reach.max() < 1e-14


@pytest.mark.parametrize("name", ["ball", "torus", "ellipsoid", "sheet", "wire"])
def test_first_cells_are_about_as_near_as_asked(name):
    """8e-3 of the size is asked for. Of boundaries chords are a second part of it, and bounds are above."""
    forest = forest_of(faces_of(SHAPES[name]))
    _, nodes = tree_of(forest)
    assert nodes.reach[leaves(forest)].max() < 3.0 * 8e-3 * forest.cells[0].size


def test_boundaries_that_bend_away_add_nothing():
    """Of a plate's round hole the material is nowhere beyond the chords; of a disc it is."""
    rows = {}
    for name in ("plate", "pin"):
        cells = cells_of_body(faces_of(SHAPES[name]))
        links, nodes = (
            rows_of(kind, table[cells.first]) for kind, table in ((LINKS, cells.links), (NODE, cells.nodes))
        )
        bent = (links.form == FLAT) & (links.rim != NONE).any(axis=1) & (nodes.rim_second.max(axis=(1, 2)) > 0.0)
        rows[name] = nodes.disc[bent]
    # But where a chord is of two spans: of a circle of four there are up to four.
    assert (rows["plate"] > 0.0).sum() <= 16 < 0.5 * len(rows["plate"])
    assert rows["pin"].min() > 0.0


def test_connected_parts_of_a_boundary():
    """A hole through a body joins its faces to one part; two bodies' faces are two parts."""
    assert len(np.unique(cells_of_body(faces_of(SHAPES["plate"])).component)) == 1
    first, second = asm.shapes.sphere(0.3), asm.shapes.sphere(0.2).transformed(translation=[3.0, 0.0, 0.0])
    assert cells_of_body(faces_of([first, second])).component.max() == 1


def test_a_flat_face_in_polar_parameters_is_flat():
    """What its cells are off their corners lies in its plane: what lies on it is decided, however coarse they are."""
    faces = faces_of(asm.shapes.revolution(asm.curves.polygon([(0.3, 0), (1, 0), (1, 1), (0.3, 1)])))
    cells = cells_of_body(faces)
    nodes, links = rows_of(NODE, cells.nodes), rows_of(LINKS, cells.links)
    flat = cells.first[links.form[cells.first] == FLAT]
    assert len(flat) > 10 and nodes.rho[flat].max() < 1e-14 and nodes.disc[flat].min() > 1e-4
    assert nodes.half[0, np.abs(nodes.axes[0, :, 2]).argmax()] < 0.5 + 1e-13
