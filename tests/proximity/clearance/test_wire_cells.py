"""Pieces of wires: all points of the surface are within its radius of the spine, and so of the pieces' chords and sags.

`spine_of` says what the spine is; that pieces are parts of it, and that halves stay on it, is asked here.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.geometry.shapes.centerline import spine_of
from assembly.geometry.shapes.path import Path
from assembly.proximity.clearance.records import WIRE
from assembly.proximity.clearance.wire_cells import wire_cells
from tests.proximity.clearance.nodes import forest_of, halve_all, leaves, nearest_on_segments, outside, tree_of
from tests.proximity.clearance.scenes import faces_of
from tests.proximity.clearance.splines import points_of

CLOSE = 1e-13
WIRES = {
    "rod": asm.shapes.pipe(Path().line(1.0), 0.2),
    "hook": asm.shapes.pipe(Path().line(1.0).arc(0.5, 3.0, toward=(1, 0, 0)).line(0.4), 0.1),
    "clip": asm.shapes.paper_clip(),
    "far": asm.shapes.pipe(Path((300.0, 200.0, 0.0)).arc(2.0, 1.3, toward=(1, 0, 0)).line(1.0), 0.3),
}


def on_spine(spine, points):
    """How far points are from a spine, from many points of it."""
    many = [spine.frames(k, np.linspace(0.0, length, 4001))[0] for k, length in enumerate(spine.length)]
    return np.min([np.linalg.norm(nearest(points, line) - points, axis=1) for line in many], axis=0)


def nearest(points, line):
    """The nearest points of a polyline."""
    found = nearest_on_segments(points[:, None], line[:-1], line[1:])
    of = np.linalg.norm(found - points[:, None], axis=-1).argmin(axis=1)
    return found[np.arange(len(points)), of]


@pytest.mark.parametrize("name", WIRES)
def test_pieces_are_parts_of_the_spine(name):
    shape = WIRES[name]
    spine, cells = spine_of(Face(shape)), wire_cells(Face(shape), shape.size)
    corners = np.unique(cells.corner.reshape(-1, 3).round(9), axis=0)
    # Chords of 4000 parts are off an arc by less than 1e-7 of its radius.
    assert on_spine(spine, corners).max() < 1e-6
    # From end to end without a gap.
    assert np.abs(cells.corner[:-1, 1] - cells.corner[1:, 0]).max(initial=0.0) < CLOSE * np.abs(corners).max()
    chords = np.linalg.norm(cells.corner[:, 1] - cells.corner[:, 0], axis=1).sum()
    assert 0.98 * spine.length.sum() < chords <= spine.length.sum() * (1.0 + 1e-12)
    assert (cells.first[:, 1] == spine.radius).all() and cells.form == WIRE


@pytest.mark.parametrize("name", WIRES)
def test_halves_stay_on_the_spine_and_hold_the_wire(name, cases):
    rng, forest, shape = np.random.default_rng(0), forest_of(faces_of(WIRES[name])), WIRES[name]
    spine, points = spine_of(Face(shape)), points_of(shape, cases(150, 3000), rng)
    for _ in range(3):
        rows = leaves(forest)
        assert outside(forest, rows, points).max() <= 1e-14 * np.abs(points).max()
        _, nodes = tree_of(forest)
        assert on_spine(spine, nodes.corner[rows, 1]).max() < 1e-6
        halve_all(forest, rng)
    assert (nodes.reach[rows] < 1e-3 * shape.size).all()


@pytest.mark.parametrize("name", WIRES)
def test_sags_are_those_of_the_arcs(name):
    """How far the spine is from the chord of a piece, sampled; `reach` is that and what rounding may do."""
    shape = WIRES[name]
    forest, spine = forest_of(faces_of(shape)), spine_of(Face(shape))
    _, nodes = tree_of(forest)
    rows = leaves(forest)
    points = np.concatenate(
        [spine.frames(k, np.linspace(0.0, length, 301))[0] for k, length in enumerate(spine.length)]
    )
    a, b = nodes.corner[rows, 0], nodes.corner[rows, 1]
    off = np.linalg.norm(nearest_on_segments(points[:, None], a, b) - points[:, None], axis=-1)
    assert (off - nodes.reach[rows]).min(axis=1).max() <= 0.0
    bent = nodes.first[rows, 0] > 0.0
    chord = np.linalg.norm(b - a, axis=1)[bent]
    radius = 1.0 / nodes.first[rows, 0][bent]
    sag = radius - np.sqrt(radius**2 - 0.25 * chord**2)
    assert nodes.reach[rows][bent] == pytest.approx(sag, rel=1e-6, abs=1e-9 * shape.size)


@pytest.mark.parametrize("shape", [asm.shapes.sphere(1.0), asm.shapes.cylinder(0.5, 2.0), asm.shapes.cone(0.5, 1.0)])
def test_others_are_no_wires(shape):
    assert wire_cells(Face(shape), 2.0) is None
