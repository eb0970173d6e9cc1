"""Solids over flat faces: the lowest place is listed, though nothing is looked for inside faces or at slanted edges."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.model.contact import side_faces
from assembly.constraints.program.records import MANAGER_RECORD
from assembly.proximity.brep.borders import feature_at, feature_kind
from assembly.proximity.brep.records import EDGE, FACE
from assembly.proximity.bvh.facet_tree import FacetTree
from assembly.proximity.bvh.tree import ELEMENT, element_at, node_of, tree_at
from assembly.proximity.extrema.feature_jets import edge_jet
from assembly.proximity.manager.flat_patches import may_be_level
from assembly.proximity.manager.records import pair_in
from tests.laws.scenes import posed

CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


def disc(radius, height):
    """A cylinder and its lowest height over the plane z = 0 at a pose."""

    def lowest(turn, place):
        axis = turn[:, 2]
        return place[2] - 0.5 * height * abs(axis[2]) - radius * np.hypot(axis[0], axis[1])

    return asm.shapes.solid_cylinder(radius, height), lowest


def block(*sides):
    """A box and its lowest height."""
    return asm.shapes.box(*sides), lambda turn, place: place[2] + (0.5 * CORNERS * sides @ turn.T)[:, 2].min()


@pytest.mark.parametrize("swap", [False, True], ids=["over", "under"])
@pytest.mark.parametrize("made", [lambda: disc(1.5, 0.8), lambda: disc(0.4, 2.0), lambda: block(2.0, 1.2, 0.8)])
def test_the_lowest_place_over_a_plate_is_listed(made, swap, cases):
    shape, lowest = made()
    top = asm.Body("top", asm.shapes.box(8.0, 8.0, 1.0), (0.0, 0.0, -0.5), fixed=True)
    body = asm.Body("body", shape)
    scene = asm.Assembly([body, top] if swap else [top, body])
    scene.constrain(asm.Clearance())
    rng = np.random.default_rng(8)
    for _ in range(cases(12, 200)):
        tilt = 10.0 ** rng.uniform(-9.0, -0.5)
        lean = Rotation.from_rotvec(tilt * np.array([*rng.normal(size=2), 0.0]))
        turn = lean * Rotation.from_rotvec([0.0, 0.0, rng.uniform(0.0, 2.0 * np.pi)])
        gap = 10.0 ** rng.uniform(-9.0, -2.0)
        place = np.array([*rng.uniform(-1.0, 1.0, 2), 0.0])
        place[2] = gap - lowest(turn.as_matrix(), place)
        q = np.array([scene.bodies[k].pose.position.tolist() + [1.0, 0.0, 0.0, 0.0] for k in range(2)])
        q[0 if swap else 1] = [*place, *turn.as_quat(scalar_first=True)]
        found = scene.solve(q, max_iterations=0).contacts
        # A lower one would be in the other body; the closed form is exact but for rounding of poses of some units.
        assert min(contact.gap for contact in found.values()) == pytest.approx(gap, abs=1e-12 + 1e-9 * gap)


@kernel
def tangent(table, pool, edge, t):
    """The tangent of an edge."""
    return edge_jet(Store(table, pool), edge, t)[1]


@kernel
def may_be(pair, codes, e, d):
    """`may_be_level`, from Python."""
    return may_be_level(pair, codes, e, d)


def elements_of(packed, body, tree, shell, kind):
    """Numbers and records of the elements of a body's tree whose features are of a kind."""
    first, count = tree_at(packed.table, tree).element_pool, len(FacetTree.of(side_faces(body)).feature)
    all_of_them = [element_at(packed.pool, first + ELEMENT * e) for e in range(count)]
    return [(e, x) for e, x in enumerate(all_of_them) if feature_kind(packed.table, shell, int(x.feature)) == kind]


@pytest.mark.parametrize("swap", [False, True], ids=["disc first", "disc second"])
def test_edges_are_level_where_their_tangents_are(swap, cases):
    """Sampled along each part of a rim: a tangent that is perpendicular to a flat face's normal there is not missed."""
    disc_body = asm.Body("disc", asm.shapes.solid_cylinder(1.5, 0.8), fixed=swap)
    block_body = asm.Body("block", asm.shapes.box(2.0, 1.2, 0.8), (0.0, 0.0, 3.0), fixed=not swap)
    scene = asm.Assembly([block_body, disc_body] if swap else [disc_body, block_body])
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    pair = pair_in(packed.table, packed.table[MANAGER_RECORD], 0)
    shells, trees = (int(pair.shell_f), int(pair.shell_g)), (int(pair.tree_f), int(pair.tree_g))
    store, side = Store(packed.table, packed.pool), 1 if swap else 0
    rims = elements_of(packed, scene.bodies[side], trees[side], shells[side], EDGE)
    flats = elements_of(packed, scene.bodies[1 - side], trees[1 - side], shells[1 - side], FACE)
    rng = np.random.default_rng(2)
    near = far = 0
    for _ in range(cases(6, 60)):
        turn = Rotation.random(random_state=int(rng.integers(1 << 30))).as_matrix()
        looked_into = posed(store, tuple(turn.ravel()), (0.0, 0.0, 1.0), shells=shells, trees=trees)
        for (e, rim), (d, flat) in itertools.product(rims, flats):
            n = np.array(node_of(store, trees[1 - side], d).axis)
            # `turn` leads from the axes of g to those of f.
            n = turn.T @ n if swap else turn @ n
            codes = (int(rim.feature), int(flat.feature))
            edge = feature_at(packed.table, shells[side], codes[0])
            at = rim.middle[0] + rim.half[0] * np.linspace(-6.0, 6.0, 121)
            along = np.array([np.dot(tangent(packed.table, packed.pool, edge, t), n) for t in at])
            found = may_be(looked_into, codes[::-1] if swap else codes, *((d, e) if swap else (e, d)))
            if np.ptp(np.sign(along[50:71])) > 0.0:
                near += 1
                assert found
            elif np.ptp(np.sign(along)) == 0.0:
                # Six half widths are 0.6 rad, at which the slope of a sine is near enough to that in the middle.
                far += 1
                assert not found
    assert near > 50 and far > 50
