"""Curves of a boundary stay in the triangles whose edges are their chords: no other cell has what is beside the face.

Where one has, a curve of another body that goes through the hole there counts as one that crosses the face.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.answers import Verdict
from assembly.proximity.clearance.records import NONE
from tests.proximity.clearance.nodes import forest_of, halve_all, leaves, tree_of
from tests.proximity.clearance.scenes import at, faces_of, poses, proof_of
from tests.proximity.clearance.splines import shapes

SHAPES = shapes()
TRIMMED = [name for name in SHAPES if any(face.boundary for face in faces_of(SHAPES[name]))]


def holes(rng, most=3):
    """Circles in a plate of 4 x 2 that are 0.02 apart at least."""
    found: list[tuple[float, float, float]] = []
    for _ in range(50):
        r = rng.uniform(0.1, 0.5)
        x, y = rng.uniform(r - 1.9, 1.9 - r), rng.uniform(r - 0.9, 0.9 - r)
        if all(np.hypot(x - a, y - b) > r + s + 0.02 for a, b, s in found):
            found.append((x, y, r))
        if len(found) == most:
            break
    return found


# What is cut off of a cell that is not its own begins at a corner, along a side.
ALONG = 0.5 ** np.arange(1, 12)


def along_sides(uv):
    """Points of the sides of triangles (n, 3, 2), ever nearer to their corners."""
    ways = [(uv[:, k], uv[:, (k + step) % 3]) for k in range(3) for step in (1, 2)]
    return np.concatenate([p[:, None] + ALONG[:, None] * (q - p)[:, None] for p, q in ways], axis=1)


def beside_faces(forest, faces):
    """How far points of cells without chords of bent curves are beside their faces, at most."""
    links, nodes = tree_of(forest)
    far = 0.0
    straight = (links.rim == NONE) | (nodes.rim_second == 0.0).all(axis=2)
    rows = [k for k in leaves(forest) if straight[k].all()]
    for number, face in enumerate(faces):
        own = [k for k in rows if links.face[k] == number]
        if not face.boundary or not own:
            continue
        points = along_sides(nodes.uv[own][:, :3])
        u, v = face.surface.domain
        # Of a face over a seam parameters are beyond the domain.
        for d, (low, high) in enumerate((u, v)):
            if face.surface.closed[d]:
                points[..., d] = low + np.mod(points[..., d] - low, high - low)
        # `pad` is what cells allow for, with what is cut off of some.
        beyond = -face.space_distance(points[..., 0], points[..., 1]) - nodes.pad[own][:, None]
        far = max(far, float(beyond.max()))
    return far


@pytest.mark.parametrize("name", TRIMMED)
def test_no_cell_has_what_is_cut_off_beside_another_one(name, cases):
    faces = faces_of(SHAPES[name])
    rng, forest = np.random.default_rng(0), forest_of(faces)
    for _ in range(cases(2, 6)):
        # Points on straight edges are inside or outside by rounding.
        assert beside_faces(forest, faces) < 1e-9 * forest.cells[0].size
        halve_all(forest, rng, 0.7)


def test_no_cell_of_random_plates_has_what_is_in_their_holes(cases):
    rng = np.random.default_rng(1)
    for _ in range(cases(3, 200)):
        faces = faces_of(asm.shapes.plate(4.0, 2.0, 0.3, holes(rng)))
        forest = forest_of(faces)
        for _ in range(3):
            assert beside_faces(forest, faces) < 1e-9 * 4.5
            halve_all(forest, rng, 0.5)


def test_pins_in_holes_with_play_are_clear(cases):
    """The least gap is the play less how far the pin is off the middle."""
    rng = np.random.default_rng(2)
    for _ in range(cases(5, 400)):
        (x, y, r), *others = holes(rng)
        play = rng.choice([1e-3, 1e-2]) * r
        plate = asm.shapes.plate(4.0, 2.0, 0.3, [(x, y, r), *others])
        proof = proof_of(plate, asm.shapes.solid_cylinder(r - play, 1.0))
        (answer,) = proof.look(poses(at(x + 0.3 * play, y, rng.uniform(-0.2, 0.2))), 0.0)
        assert answer.verdict is Verdict.CLEAR
        assert 0.0 < answer.bound <= 0.7 * play + 1e-12


def test_faces_that_are_told_have_a_boundary():
    assert {"plate", "pin", "trimmed sheet"} <= set(TRIMMED) and isinstance(faces_of(SHAPES["plate"])[0], Face)
